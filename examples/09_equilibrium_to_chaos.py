"""From an equilibrium to chaos: a feedback system of Lur'e's type, by a Hopf point, cycles and period doublings.

Known answers: the equilibrium at 0 has an imaginary pair of eigenvalues where al be = 1 (Routh and Hurwitz). The
distances of the doublings shrink by Feigenbaum's number, 4.669 (M. J. Feigenbaum, J. Stat. Phys. 19 (1978) 25).

Field: Smooth systems.

    python 09_equilibrium_to_chaos.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

lure = saltus.HybridSystem.smooth(
    {"x": "y", "y": "z", "z": "-al*z - be*y - x + x**2"}, parameters={"al": 1.2, "be": 1.0}, name="Lur'e"
)
diagram = saltus.diagram(lure, "al", (0.5, 1.5), x0=[0.0, 0.0, 0.0])
print(diagram)
hopf = diagram[0]["HB1"]
for name, found in (("al", hopf.parameters["al"]), ("frequency", hopf.normal_form.frequency)):
    print(f"HB: {name} = {found:.12f}, closed form 1, difference {found - 1.0:.1e}")
    assert abs(found - 1.0) < 1e-10
cascade = saltus.follow_cascade(diagram[1]["PD1"], (0.5, 1.5), doublings=4)
print(cascade)
assert abs(cascade.ratios[-1] - 4.669) < 0.02
start = [0.1, 0.0, 0.0]
exponents = saltus.lyapunov_spectrum(lure, {"al": 0.55}, start, average=saltus.Average(t_end=2000.0))
print(exponents)

settled = saltus.simulate(lure, {"al": 0.55}, start, t_end=300.0).x_end
chaos = saltus.simulate(lure, {"al": 0.55}, settled, t_end=250.0)

figure, (left, right) = plt.subplots(1, 2, figsize=(9.0, 3.8), layout="constrained")
diagram.plot("x", ax=left)
left.set_title("equilibria, cycles, doubled cycles")
chaos.plot("x", "y", ax=right, legend=False)
for line in right.lines:
    line.set_linewidth(0.6)
right.set_title(f"al = 0.55: leading exponent {np.max(exponents.exponents):.3f}")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "09_equilibrium_to_chaos.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
