"""A runner on springs: an angle of attack that is too flat falls, one too steep doubles its period.

A point mass on a leg with a spring, the spring-loaded inverted pendulum of Blickhan (J. Biomechanics 22 (1989) 1217),
in units of mass, leg and gravity. In flight the leg is held at the angle alpha to the ground. The energy E never
changes: touch-down sets the speed that belongs to it, which is the speed that the runner has. Known answers: of a
symmetric step the mass is lowest right above the foot, which SciPy's integration and a search give; the greatest
distance behind it vanishes at the fold, and the height of a flight maps to the next one with the slope -1 at the
period doubling.

Field: Walking and standing.

    python runner.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar

import saltus

k, energy = 20.0, 2.3
spring = "k*(1/sqrt(x**2 + y**2) - 1)"
runner = saltus.HybridSystem(
    states=("x", "y", "u", "v"),
    parameters={"alpha": np.deg2rad(65.0), "k": k, "E": energy},
    modes={
        "stance": saltus.Mode({"x": "u", "y": "v", "u": f"{spring}*x", "v": f"{spring}*y - 1"}),
        "rise": saltus.Mode({"x": "0", "y": "v", "u": "0", "v": "-1"}),
        "fall": saltus.Mode({"x": "0", "y": "v", "u": "0", "v": "-1"}),
    },
    transitions=[
        saltus.Transition("stance", "rise", event="x**2 + y**2 - 1", direction=1, reset={"x": "0"}, name="take-off"),
        saltus.Transition("rise", "fall", event="v", direction=-1, name="top"),
        saltus.Transition(
            "fall",
            "stance",
            event="y - sin(alpha)",
            direction=-1,
            reset={"x": "-cos(alpha)", "u": "sqrt(2*(E - y) - v**2)"},
            name="touch-down",
        ),
    ],
    outputs={"energy": "(u**2 + v**2)/2 + y"},
    name="runner",
)
orbit = saltus.find_orbit(runner, x0=[0.0, 0.92, np.sqrt(2.0 * (energy - 0.92)), 0.0], mode="fall")
branch = saltus.continue_orbit(orbit, "alpha", bounds=np.deg2rad([60.0, 70.0]).tolist())
print(branch, branch["PD1"].normal_form, sep="\n")


def stance(height, alpha, event):
    """State at the first zero of an event of the stance after a flight of some height, by SciPy."""
    y = np.sin(alpha)
    start = [-np.cos(alpha), y, np.sqrt(2.0 * (energy - height)), -np.sqrt(2.0 * (height - y))]

    def field(t, s):
        force = k * (1.0 / np.hypot(s[0], s[1]) - 1.0)
        return [s[2], s[3], force * s[0], force * s[1] - 1.0]

    event.terminal, event.direction = True, 1.0
    return solve_ivp(field, (0.0, 5.0), start, "DOP853", rtol=1e-12, atol=1e-13, events=event).y_events[0][0]


def lowest(height, alpha):
    """Place of the mass over the foot where it is lowest; 0 in a symmetric step."""
    return stance(height, alpha, lambda t, s: s[3])[0]


def next_height(height, alpha):
    """Height of the next flight."""
    _, y, _, v = stance(height, alpha, lambda t, s: np.hypot(s[0], s[1]) - 1.0)
    return y + v**2 / 2.0


for one in branch:
    assert abs(one.observe("max(energy)")["max(energy)"] - energy) < 1e-8
for degrees in (63.5, 65.0, 66.0):
    alpha = np.deg2rad(degrees)
    one = min(branch.at(alpha), key=lambda one: one.max["y"])
    exact = brentq(lowest, one.max["y"] - 3e-3, one.max["y"] + 3e-3, args=(alpha,), xtol=1e-12)
    print(f"{degrees} degrees: height of flight {one.max['y']:.10f}, SciPy {exact:.10f}")
    assert abs(one.max["y"] - exact) < 1e-8
fold, doubling = (branch[name].parameters["alpha"] for name in ("SN1", "PD1"))
print(f"stable from {np.rad2deg(fold):.6f} to {np.rad2deg(doubling):.6f} degrees")


def behind(alpha):
    """Greatest of the lowest points' places over all heights of flight; 0 at the fold."""
    most = minimize_scalar(lambda h: -lowest(h, alpha), bounds=(0.95, 1.15), method="bounded", options={"xatol": 1e-6})
    return -most.fun


exact = brentq(behind, np.deg2rad(62.8), np.deg2rad(63.4), xtol=1e-11)
print(f"fold: SciPy {np.rad2deg(exact):.6f} degrees")
assert abs(fold - exact) < 1e-7
height = branch["PD1"].orbit.max["y"]
slope = (next_height(height + 1e-5, doubling) - next_height(height - 1e-5, doubling)) / 2e-5
print(f"slope of the map of heights at the doubling: {slope:.7f}")
assert abs(slope + 1.0) < 1e-6

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.4), layout="constrained")
branch.plot("alpha", "max_y", ax=left)
left.set(xlabel=r"angle of attack $\alpha$ in rad", ylabel="height of flight (lengths of the leg)")
left.set_title("stable between fold and doubling")
for degrees, pushed, colour in ((65.0, 0.003, "#0072b2"), (66.0, 0.0006, "#d55e00")):
    alpha = np.deg2rad(degrees)
    height = min(one.max["y"] for one in branch.at(alpha)) + pushed
    start = [0.0, height, np.sqrt(2.0 * (energy - height)), 0.0]
    motion = saltus.simulate(runner, {"alpha": alpha}, x0=start, mode="fall", t_end=6.0)
    t = np.linspace(0.0, 6.0, 3000)
    y, u = motion(t)[:, 1:3].T
    right.plot(np.cumsum(u) * t[1], y, color=colour, label=f"{degrees:g} degrees")
right.set(xlabel="distance (lengths of the leg)", ylabel="height of the mass", ylim=(0.85, 0.95))
right.set_title("deviations die away, or high and low come in turn")
right.legend(loc="upper left", ncols=2)

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "runner.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
