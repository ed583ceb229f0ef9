"""Predators are harvested above a threshold: sliding, a pseudo-saddle-node, and a cycle beside a state of rest.

Prey x and predators y of Rosenzweig and MacArthur, x' = x (1 - x) - g y and y' = (g - d) y with g = a x/(1 + b x); a
harvest e y begins where y exceeds P, as in Kuznetsov, Rinaldi and Gragnani (Int. J. Bifurcation Chaos 13 (2003) 2157).
Known answers: on the threshold both rates of x are one, and pseudo-equilibria solve (1 - x)(1 + b x) = a P. They meet
at x = (b - 1)/(2 b), and end where g = d + e and where g = d. A motion that slides needs the time of an integral over
x.

Field: Life.

    python predator_threshold.py [picture]
"""

import sys
from pathlib import Path

from matplotlib import pyplot as plt
from scipy.integrate import quad, solve_ivp

import saltus

a, b, d, e = 5.0, 3.0, 0.5, 0.5
prey = "x*(1 - x) - a*x*y/(1 + b*x)"
harvest = saltus.filippov(
    states=("x", "y"),
    parameters={"P": 0.2, "a": a, "b": b, "d": d, "e": e},
    surface="y - P",
    above={"x": prey, "y": "a*x*y/(1 + b*x) - d*y - e*y"},
    below={"x": prey, "y": "a*x*y/(1 + b*x) - d*y"},
    name="predators above a threshold",
)
rest = saltus.continue_equilibrium(saltus.find_equilibrium(harvest, x0=[0.5, 0.25], mode="above"), "P", (0.2, 0.9))
orbit = saltus.find_orbit(harvest, {"P": 0.4}, x0=[0.3, 0.3], mode="below")
cycles = saltus.continue_orbit(orbit, "P", bounds=(0.2, 0.9))
print(rest, cycles, sep="\n")


def held(x):
    """Threshold with a pseudo-equilibrium at x."""
    return (1.0 - x) * (1.0 + b * x) / a


meets, ends, fold = ((d + e) / (a - b * (d + e)), d / (a - b * d), (b - 1.0) / (2.0 * b))
for label, x in (("BE1", meets), ("SN1", fold), ("BE2", ends)):
    found = rest[label].parameters["P"]
    print(f"{label} at P = {found:.12f}, closed form {held(x):.12f}")
    assert abs(found - held(x)) < 1e-9
print(f"the cycle is born at P = {cycles['BE1'].parameters['P']:.12f}")
assert abs(cycles["BE1"].parameters["P"] - held(ends)) < 1e-9
slide = next(part for part in orbit.segments if part.mode == "sliding")
needs = quad(lambda x: 1.0 / (x * (1.0 - x) - a * x * 0.4 / (1.0 + b * x)), slide.state[0], ends, epsabs=1e-12)[0]
print(f"at P = 0.4 the cycle slides for {slide.duration:.10f}, the integral is {needs:.10f}")
assert abs(slide.duration - needs) < 1e-8


def free(t, s):
    eaten = a * s[0] * s[1] / (1.0 + b * s[0])
    return [s[0] * (1.0 - s[0]) - eaten, eaten - d * s[1]]


def top(t, s):
    return free(t, s)[1]


top.direction = -1.0
wild = solve_ivp(free, (0.0, 300.0), [0.3, 0.3], "DOP853", rtol=1e-11, atol=1e-13, events=top)
print(f"from P = {cycles['GS1'].parameters['P']:.9f} nothing is harvested; SciPy {wild.y_events[0][-1][1]:.9f}")
assert abs(cycles["GS1"].parameters["P"] - wild.y_events[0][-1][1]) < 1e-8

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.4), layout="constrained")
rest.plot("P", "x", ax=left)
cycles.plot("P", "max_x", ax=left, legend=False)
cycles.plot("P", "min_x", ax=left, legend=False)
left.set(xlabel="threshold $P$", ylabel="prey $x$ at rest, greatest and least in a cycle")
left.set_title("rest and cycles over the threshold")
for P, colour in ((0.255, "#0072b2"), (0.4, "#009e73"), (0.8, "#d55e00")):
    sample = cycles.at(P)[0].sample()
    right.plot(sample["x"], sample["y"], color=colour, label=f"$P = {P:g}$")
right.set(xlabel="prey $x$", ylabel="predators $y$", title="flat: the cycle slides on the threshold")
right.legend()

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "predator_threshold.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
