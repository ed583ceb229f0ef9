"""The backbone curve of a hardening spring, and the forced responses that gather around it.

Known answer for x'' = -x - x^3 with the amplitude a: the period is 4 K(m) / sqrt(1 + a^2) with m = a^2 / (2 (1 + a^2)),
K being the complete elliptic integral of the first kind; the energy is a^2 / 2 + a^4 / 4.

Field: Smooth systems.

    python 08_backbone_curve.py [picture]
"""

import math
import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from scipy.special import ellipk

import saltus

free = saltus.HybridSystem.smooth({"x": "v", "v": "-x - x**3"}, outputs={"energy": "v**2/2 + x**2/2 + x**4/4"})
orbit = saltus.solve_orbit(free, x0=[0.5, 0.0], period=6.0, fix={"max_x": 0.5})
backbone = saltus.continue_orbit(orbit, "max_x", bounds=(0.01, 1.6))
print(backbone)

a = backbone.values
exact = 4.0 * ellipk(a**2 / (2.0 * (1.0 + a**2))) / np.sqrt(1.0 + a**2)
off = np.max(np.abs(backbone.period / exact - 1.0))
print(f"{len(a)} orbits, closed form of the period, largest relative difference {off:.1e}")
assert off < 1e-10
off = np.max(np.abs(backbone.column("max_energy") - a**2 / 2.0 - a**4 / 4.0))
print(f"closed form of the energy, largest difference {off:.1e}")
assert off < 1e-10

field = {"x": "v", "v": "-0.08*v - x - x**3 + A*cos(s)"}
driven = saltus.HybridSystem.smooth(field, {"A": 0.05, "w": 0.6}, phase=("s", "w"), positive=["w"])
responses = {}
for drive in (0.03, 0.06, 0.1):
    start = saltus.solve_orbit(driven, {"A": drive}, x0=[drive, 0.0])
    responses[drive] = saltus.continue_orbit(start, "w", bounds=(0.4, 2.0))

# the drive with which the response at w = 1.3 is as large as the free oscillation of that frequency
there = saltus.solve_orbit(free, x0=[1.0, 0.0], period=2.0 * math.pi / 1.3, fix={"period": 2.0 * math.pi / 1.3})
same = {"max_x": there.max["x"]}
drive = saltus.solve_orbit(driven, {"w": 1.3, "A": 0.1}, x0=[0.0, 1.2], fix=same, free="A").parameters["A"]
print(f"max_x = {same['max_x']:.9f} at w = 1.3 with A = {drive:.9f}")

figure, ax = plt.subplots(layout="constrained")
for drive, branch in responses.items():
    w, x = branch.values, branch.column("max_x")
    ax.plot(np.where(branch.stable, w, np.nan), x, "C0", label="driven, stable" if drive == 0.03 else None)
    ax.plot(np.where(branch.stable, np.nan, w), x, "C0--", label="driven, unstable" if drive == 0.03 else None)
ax.plot(2.0 * math.pi / backbone.period, a, "k", lw=2, label="free, undamped: the backbone")
ax.set(xlabel="frequency (units of the linear one)", ylabel="greatest $x$", xlim=(0.4, 2.0), title="hardening spring")
ax.legend()

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "08_backbone_curve.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
