"""A rocking block comes to rest: each impact takes the same part of the energy.

A slender block on two corners after Housner (Bull. Seism. Soc. Am. 53 (1963) 403), linear in the angle, which is
measured in units of the slenderness: x'' = x - 1 for x > 0 and x'' = x + 1 for x < 0. At an impact the rate falls to
e times it. Known answers (there): from rest at x0 the first impact comes after arccosh(1/(1 - x0)). After n impacts
the greatest angle is 1 - sqrt(1 - e^(2n) (1 - (1 - x0)^2)).

Field: Walking and standing.

    python rocking_block.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

e, x0 = 0.925, 0.9
block = saltus.HybridSystem(
    states=("x", "v"),
    parameters={"e": e},
    modes={
        "right": saltus.Mode({"x": "v", "v": "x - 1"}),
        "left": saltus.Mode({"x": "v", "v": "x + 1"}),
    },
    transitions=[
        saltus.Transition("right", "left", event="x", direction=-1, reset={"v": "e*v"}, name="impact on the left"),
        saltus.Transition("left", "right", event="x", direction=1, reset={"v": "e*v"}, name="impact on the right"),
    ],
    outputs={"energy": "v**2/2 + abs(x) - x**2/2"},
    name="rocking block",
)
motion = saltus.simulate(block, x0=[x0, 0.0], mode="right", t_end=26.0)
times = motion.events["time"]
first = np.arccosh(1.0 / (1.0 - x0))
n = np.arange(len(times))
greatest = 1.0 - np.sqrt(1.0 - e ** (2.0 * n) * (1.0 - (1.0 - x0) ** 2))
impacts = np.concatenate([[first], first + 2.0 * np.cumsum(np.arccosh(1.0 / (1.0 - greatest[1:])))])
print(f"{len(times)} impacts, difference of their times {np.max(np.abs(times - impacts)):.1e}")
assert np.max(np.abs(times - impacts)) < 1e-9

figure, ax = plt.subplots(figsize=(9.0, 4.2), layout="constrained")
t = np.linspace(0.0, 26.0, 3000)
ax.plot(t, motion(t)[:, 0], color="#1b1b1e", label="block")
peaks = impacts[:-1] + 0.5 * np.diff(impacts)
ax.plot(peaks, (-1.0) ** n[1:] * greatest[1:], "o", mfc="none", color="#d55e00", label="Housner 1963")
ax.set(xlabel="time (units of $1/p$)", ylabel="angle over slenderness", title="A block rocks, $e = 0.925$")
ax.legend()

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "rocking_block.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
