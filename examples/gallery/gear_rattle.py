"""Gears rattle: teeth lose contact at resonance, and two motions exist side by side.

Relative motion x of a pair with backlash from -1 to 1, x'' + 2 zeta x' + g(x) = f0 + f1 cos(s), with g the part of x
outside of the backlash, after Kahraman and Singh (J. Sound Vib. 142 (1990) 49). Known answers: in contact all the time
the motion is linear, and x - 1 falls to 0 where f1 = f0 sqrt((1 - w^2)^2 + (2 zeta w)^2). SciPy integrates the motion
that rattles, and over a period the torque's work equals what friction takes.

Field: Machines and valves.

    python gear_rattle.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from scipy.integrate import solve_ivp

import saltus

zeta, f0, f1 = 0.05, 0.1, 0.05
force = "f0 + f1*cos(s) - 2*zeta*v"
gears = saltus.HybridSystem(
    states=("x", "v"),
    parameters={"zeta": zeta, "f0": f0, "f1": f1, "w": 1.5},
    modes={
        "drive": saltus.Mode({"x": "v", "v": f"{force} - (x - 1)"}),
        "free": saltus.Mode({"x": "v", "v": force}),
        "back": saltus.Mode({"x": "v", "v": f"{force} - (x + 1)"}),
    },
    transitions=[
        saltus.Transition("drive", "free", event="x - 1", direction=-1),
        saltus.Transition("free", "drive", event="x - 1", direction=1),
        saltus.Transition("free", "back", event="x + 1", direction=-1),
        saltus.Transition("back", "free", event="x + 1", direction=1),
    ],
    phase=("s", "w"),
    positive=["w"],
    name="gear pair",
)
orbit = saltus.find_orbit(gears, x0=[1.1, 0.0], mode="drive")
branch = saltus.continue_orbit(orbit, "w", bounds=(0.3, 1.6))
print(branch)
for name in ("GR1", "GR2"):
    w = branch[name].parameters["w"]
    exact = f0 * np.hypot(1.0 - w**2, 2.0 * zeta * w)
    print(f"teeth part at w = {w:.12f}: f1 = {f1}, closed form {exact:.12f}")
    assert abs(exact - f1) < 1e-10

quiet, unstable, rattle = sorted(branch.at(0.6), key=lambda one: one.max["x"])
balance = rattle.observe("mean(f1*cos(s)*v)", "mean(2*zeta*v**2)")
gained, lost = balance.values()
print(f"at w = 0.6 the torque gives {gained:.12f} a period, friction takes {lost:.12f}")
assert abs(gained - lost) < 1e-10


def pair(t, y, start):
    x, v, w = *y, 0.6
    return [v, f0 + f1 * np.cos(start + w * t) - 2.0 * zeta * v - (x - np.clip(x, -1.0, 1.0))]


for one in (quiet, rattle):
    *state, start = one.segments[0].state
    again = solve_ivp(pair, (0.0, one.period), state, "DOP853", rtol=1e-11, atol=1e-12, max_step=0.05, args=(start,))
    print(f"SciPy returns within {np.abs(again.y[:, -1] - state).max():.1e}")
    assert np.abs(again.y[:, -1] - state).max() < 1e-7

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.4), layout="constrained")
branch.plot("w", "max_x", ax=left)
left.set(xlabel="frequency of the mesh $w$", ylabel="greatest $x$ (units of half the backlash)")
left.set_title("the resonance leans to lower frequencies")
for one, kind, colour, label in (
    (quiet, "-", "#0072b2", "in contact"),
    (unstable, "--", "0.5", "unstable"),
    (rattle, "-", "#d55e00", "rattles"),
):
    sample = one.sample()
    right.plot(sample["x"], sample["v"], kind, color=colour, label=label)
right.axvspan(-1.0, 1.0, color="0.93", zorder=0)
right.set(xlabel="relative motion $x$", ylabel="relative velocity $v$", xlim=(-0.5, 1.6))
right.set_title("three motions at $w = 0.6$; grey: teeth apart")
right.legend(loc="upper left")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "gear_rattle.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
