"""A clock: each swing gets one push, and the pendulum finds its own amplitude.

A pendulum with viscous friction, x'' + 2 h x' + x = 0, that gains a fixed energy where it passes the middle to the
right: v := sqrt(v^2 + p^2). Known answer (Andronov, Vitt and Khaikin, Theory of Oscillators, 1966, chapter III): the
speed after a push is p/sqrt(1 - d^2), with d = exp(-2 pi h/sqrt(1 - h^2)). The multiplier is d^2, so the cycle is
stable.

Field: Machines and valves.

    python clock_escapement.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

clock = saltus.HybridSystem(
    states=("x", "v"),
    parameters={"h": 0.05, "p": 0.3},
    modes={"swing": saltus.Mode({"x": "v", "v": "-x - 2*h*v"})},
    transitions=[
        saltus.Transition("swing", "swing", event="x", direction=1, reset={"v": "sqrt(v**2 + p**2)"}, name="push")
    ],
    name="clock",
)
orbit = saltus.find_orbit(clock, x0=[0.0, 0.3])
branch = saltus.continue_orbit(orbit, "h", bounds=(0.01, 0.5))
print(branch)
friction = branch.values
speed = np.array([one.states[0][1] for one in branch])
left_of_speed = np.exp(-2.0 * np.pi * friction / np.sqrt(1.0 - friction**2))
exact = 0.3 / np.sqrt(1.0 - left_of_speed**2)
print(f"speed after a push, difference {np.max(np.abs(speed - exact)):.1e}")
assert np.max(np.abs(speed - exact)) < 1e-8
d = np.exp(-2.0 * np.pi * 0.05 / np.sqrt(1.0 - 0.05**2))
assert abs(orbit.multipliers[0] - d**2) < 1e-9

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained")
for start, colour in ((0.05, "#0072b2"), (1.2, "#d55e00")):
    motion = saltus.simulate(clock, x0=[0.0, start], t_end=60.0)
    t = np.linspace(0.0, 60.0, 4000)
    left.plot(*motion(t)[:, :2].T, color=colour, linewidth=0.7, label=f"from $v = {start:g}$")
sample = orbit.sample()
left.plot(sample["x"], sample["v"], color="#1b1b1e", linewidth=2.0, label="the clock's cycle")
left.set(xlabel="angle $x$", ylabel="rate $v$", title="$h = 0.05$, $p = 0.3$")
left.legend(loc="lower right", fontsize="small")
right.plot(friction, speed, color="#1b1b1e", label="found")
right.plot(friction[::5], exact[::5], "o", mfc="none", color="#d55e00", label="closed form")
right.set(xlabel="friction $h$", ylabel="speed after a push", title="the amplitude over the friction")
right.legend()

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "clock_escapement.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
