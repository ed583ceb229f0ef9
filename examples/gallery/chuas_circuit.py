"""Chua's circuit: from rest to a double scroll, with fields that are linear in pieces.

x' = alpha (y - g(x)), y' = x - y + z, z' = -beta y, where g has the slope m1 outside of -1 < x < 1 and m0 inside:
alpha = 9, beta = 100/7, m0 = -1/7 and m1 = 2/7 give the double scroll of Matsumoto, Chua and Komuro (IEEE Trans.
Circuits Syst. 32 (1985) 797). Known answers: by Routh and Hurwitz the rest outside loses stability where (1 + alpha
m1)(alpha m1 - alpha + beta) = alpha beta m1. There cycles of all sizes exist at once about x = 1.5, up to the one that
touches x = 1. All fields are linear, so that matrix exponentials give the cycle that doubles its period.

Field: Electronics and control.

    python chuas_circuit.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from scipy.linalg import expm
from scipy.optimize import brentq

import saltus

beta, m0, m1 = 100.0 / 7.0, -1.0 / 7.0, 2.0 / 7.0
slopes = {"inner": "m0*x", "right": "m1*x + m0 - m1", "left": "m1*x - m0 + m1"}
chua = saltus.HybridSystem(
    states=("x", "y", "z"),
    parameters={"alpha": 9.0, "beta": beta, "m0": m0, "m1": m1},
    modes={
        name: saltus.Mode({"x": f"alpha*(y - ({g}))", "y": "x - y + z", "z": "-beta*y"}) for name, g in slopes.items()
    },
    transitions=[
        saltus.Transition("inner", "right", event="x - 1", direction=1),
        saltus.Transition("right", "inner", event="x - 1", direction=-1),
        saltus.Transition("inner", "left", event="x + 1", direction=-1),
        saltus.Transition("left", "inner", event="x + 1", direction=1),
    ],
    name="Chua's circuit",
)
still = saltus.find_equilibrium(chua, {"alpha": 6.0}, x0=[1.5, 0.0, -1.5], mode="right")
rest = saltus.continue_equilibrium(still, "alpha", bounds=(6.0, 9.2))
orbit = saltus.find_orbit(chua, {"alpha": 7.5}, x0=[1.6, 0.1, -1.5], mode="right")
cycles = saltus.continue_orbit(orbit, "alpha", bounds=(6.0, 9.2), stop_at="PD")
cascade = saltus.follow_cascade(cycles["PD1"], bounds=(6.0, 9.2))
print(rest, cycles, cascade, sep="\n")

alpha = brentq(lambda a: (1.0 + a * m1) * (a * m1 - a + beta) - a * beta * m1, 6.0, 9.0, xtol=1e-14)
print(f"rest is lost at alpha = {rest['HB1'].parameters['alpha']:.12f}, Routh and Hurwitz {alpha:.12f}")
assert abs(rest["HB1"].parameters["alpha"] - alpha) < 1e-9
assert abs(cycles["GR1"].parameters["alpha"] - alpha) < 1e-9
assert abs(cycles["GR1"].orbit.max["x"] - 2.0) < 1e-6


def exact(part, alpha):
    """End and derivative of a segment, by the matrix exponential; continuous fields need no more at events."""
    slope, offset = (m0, 0.0) if part.mode == "inner" else (m1, m0 - m1)
    matrix = np.zeros((4, 4))
    matrix[:3] = [[-alpha * slope, alpha, 0.0, -alpha * offset], [1.0, -1.0, 1.0, 0.0], [0.0, -beta, 0.0, 0.0]]
    flow = expm(matrix * part.duration)
    return (flow @ [*part.state, 1.0])[:3], flow[:3, :3]


doubling = cycles["PD1"].orbit
first, second = doubling.segments
(middle, once), (end, twice) = (exact(part, doubling.parameters["alpha"]) for part in (first, second))
multipliers = np.linalg.eigvals(twice @ once)
print("multipliers by matrix exponentials, where the period doubles:", multipliers)
assert max(np.abs(middle - second.state).max(), np.abs(end - first.state).max()) < 1e-9
assert np.abs(multipliers + 1.0).min() < 1e-8
assert abs(cascade.ratios[-1] - 4.6692) < 0.02
scroll = saltus.lyapunov_spectrum(chua, x0=[1.6, 0.1, -1.5], average=saltus.Average(t_end=1000.0))
print(scroll)
assert scroll.exponents[0] > 0.2

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.4), layout="constrained")
cascade.plot("alpha", "max_x", ax=left, legend=False)
cycles.plot("alpha", "max_x", ax=left, legend=False)
rest.plot("alpha", "x", ax=left, legend=False)
left.set(xlabel=r"$\alpha$", ylabel="$x$ at rest, and greatest in a cycle", xlim=(6.2, 9.0))
left.set_title("a Hopf point, cycles, and period doublings")
motion = saltus.simulate(chua, x0=[1.6, 0.1, -1.5], mode="right", t_end=150.0)
x, y, z = motion(np.linspace(20.0, 150.0, 20000))[:, :3].T
right.plot(x, z, color="#0072b2", linewidth=0.5, label="double scroll")
for edge in (-1.0, 1.0):
    right.axvline(edge, color="0.6", linewidth=1.0, zorder=0)
right.set(xlabel="voltage $x$", ylabel="current $z$", title=r"$\alpha = 9$; grey: where the slope of $g$ changes")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "chuas_circuit.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
