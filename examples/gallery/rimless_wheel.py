"""A rimless wheel rolls down a slope: one collision a step, and a speed that it keeps.

Between collisions the wheel is an inverted pendulum on the spoke that stands, in units of length and gravity. At each
collision it loses the part of its speed that points into the ground: w := w cos(2 alpha). Known answer (McGeer, Int.
J. Robotics Research 9 (1990) 62): after the collision w^2 = 4 sin(alpha) sin(gamma) c^2/(1 - c^2) with c = cos(2
alpha). The multiplier of a step is c^2, whatever the slope gamma.

Field: Walking and standing.

    python rimless_wheel.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

alpha = np.pi / 8.0
wheel = saltus.HybridSystem(
    states=("theta", "omega"),
    parameters={"alpha": alpha, "gamma": 0.15},
    modes={"spoke": saltus.Mode({"theta": "omega", "omega": "sin(theta)"})},
    transitions=[
        saltus.Transition(
            "spoke",
            "spoke",
            event="theta - gamma - alpha",
            direction=1,
            reset={"theta": "gamma - alpha", "omega": "omega*cos(2*alpha)"},
            name="collision",
        )
    ],
    name="rimless wheel",
)
orbit = saltus.find_orbit(wheel, x0=[0.15 - alpha, 0.7])
branch = saltus.continue_orbit(orbit, "gamma", bounds=(0.1, 0.4))
print(branch)

c = np.cos(2.0 * alpha)
slopes = branch.values
speeds = np.array([one.states[0][1] for one in branch])
exact = np.sqrt(4.0 * np.sin(alpha) * np.sin(slopes) * c**2 / (1.0 - c**2))
print(f"speed after a collision, difference {np.max(np.abs(speeds - exact)):.1e}")
print(f"multiplier of a step {orbit.multipliers[0].real:.12f}, difference {orbit.multipliers[0].real - c**2:.1e}")
assert np.max(np.abs(speeds - exact)) < 1e-9
assert abs(orbit.multipliers[0] - c**2) < 1e-9

figure, (left, right) = plt.subplots(1, 2, figsize=(10.0, 4.2), layout="constrained")
for slope, colour in ((0.12, "#0072b2"), (0.2, "#009e73"), (0.3, "#d55e00")):
    sample = branch.at(slope)[0].sample()
    left.plot(sample["theta"], sample["omega"], color=colour, label=f"$\\gamma = {slope:g}$")
left.set(xlabel="angle of the spoke $\\theta$", ylabel="rate $\\omega$ (units of $\\sqrt{g/l}$)", title="one step")
left.legend()
right.plot(slopes, speeds, color="#1b1b1e", label="found")
right.plot(slopes[::3], exact[::3], "o", mfc="none", color="#d55e00", label="McGeer 1990")
right.set(xlabel="slope $\\gamma$", ylabel="rate after a collision", title="the speed that it keeps")
right.legend()

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "rimless_wheel.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
