"""A brute-force diagram of an oscillator with a stop: hysteresis, period doublings and chaos, up and down.

The attractor is followed by simulation as the drive's amplitude A grows, and again as it falls. At each value the first
periods are dropped, the next ones kept, and the leading Lyapunov exponent says what the motion is. Where the two ways
differ, two attractors exist side by side.

The free motion has the amplitude A / |k - w^2 + i c w|: it reaches the stop at A = 6.8457. Its exponent is -c / 2.

Field: Impacts.

    python 05_brute_force.py [picture]
"""

import sys
from pathlib import Path

import numpy as np

import saltus

oscillator = saltus.HybridSystem(
    states=("x", "v"),
    parameters={"k": 1.0, "c": 0.1, "d": 1.0, "e": 0.8, "w": 2.8, "A": 3.0},
    modes={"free": saltus.Mode({"x": "v", "v": "-k*x - c*v + A*cos(theta)"})},
    transitions=[saltus.Transition("free", "free", event="x - d", direction=1, reset={"v": "-e*v"}, name="impact")],
    phase=("theta", "w"),
    positive=["w"],
    name="oscillator with a stop",
)

options = saltus.options.SweepOptions(discard=300, keep=100, follow="both")
sweep = saltus.run_sweep(oscillator, "A", np.linspace(3.0, 9.0, 301), options=options)
print(sweep)

up, down = sweep.labels
print(f"two attractors at {np.sum(up != down)} of {len(sweep.values)} values at the least")
grazing = np.hypot(1.0 - 2.8**2, 0.1 * 2.8)  # d = 1
free = sweep.values[up == up[0]]
print(f"the free motion lasts to A = {free.max():.2f} and reaches the stop at {grazing:.4f}")
assert grazing - 0.04 < free.max() < grazing
assert abs(sweep.at(4.0, "up").exponents[0] + 0.05) < 1e-4

for A in (4.0, 5.65, 7.5, 9.0):
    for direction in sweep.directions:
        found = sweep.at(A, direction)
        print(f"A = {found.parameters['A']:.2f} {direction:4s} {found.label:10s} exponent {found.exponents[0]:+.4f}")

ax = sweep.plot("v")
ax.set(ylabel="$v$ at phase 0", title=oscillator.name)

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "05_brute_force.png")
picture.parent.mkdir(parents=True, exist_ok=True)
ax.figure.savefig(picture, dpi=150)
print("written", picture)
