"""Maps: a border that a fixed point meets, and the basins of Newton's method.

Left, a piecewise-linear map of one state, the normal form of a border collision: `mu` moves the fixed point over the
border at 0. Before the border it is stable. Behind it the motion visits both pieces, and is chaotic at once. In the
middle, the right piece becomes steeper: cycles of period 2, 3, 4 follow each other, with chaos between them. Right,
Newton's method for z^3 = 1: three roots and the basins between them.

    python 07_maps.py [picture]
"""

import sys
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt

import saltus

border = saltus.Map(
    ("x",),
    {"a": 0.4, "b": -3.2, "mu": 1.0},
    pieces={
        "left": saltus.Piece({"x": "a*x + mu"}, where="-x"),
        "right": saltus.Piece({"x": "b*x + mu"}, where="x"),
    },
    name="border collision",
)
newton = saltus.Map(
    ("x", "y"),
    {},
    {
        "x": "2*x/3 + (x**2 - y**2)/(3*(x**2 + y**2)**2)",
        "y": "2*y/3 - 2*x*y/(3*(x**2 + y**2)**2)",
    },
    name="Newton's method",
)

options = saltus.SweepOptions(discard=1000, keep=200, criteria=saltus.Criteria(longest=32))
along_mu = saltus.run_sweep(border, "mu", np.linspace(-0.5, 1.0, 301), x0=[-0.1], options=options)
along_b = saltus.run_sweep(border, "b", np.linspace(-16.0, -0.5, 621), x0=[0.1], options=options)
print(along_mu)
print([along_b.at(b).label for b in (-0.7, -2.0, -3.2, -5.0, -12.0)])

# closed forms: the fixed point mu/(1 - a), and the exponent of the cycle of period 2
fixed = along_mu.points[0, 0, -1, 0]
print(f"fixed point {fixed:.12f}, difference {fixed - along_mu.values[0] / 0.6:.1e}")
found = saltus.lyapunov_spectrum(border, {"b": -2.0}, [0.1], average=saltus.Average(periods=100))
print(f"exponent {found.exponents[0]:.12f}, difference {found.exponents[0] - 0.5 * np.log(0.8):.1e}")

basins = saltus.map_basins(newton, {}, {"x": (-2.0, 2.0, 400), "y": (-2.0, 2.0, 400)})
print(basins)

figure, (left, middle, right) = plt.subplots(1, 3, figsize=(12.0, 3.8), layout="constrained")
along_mu.plot(ax=left)
along_b.plot(ax=middle)
basins.plot(ax=right, legend=False)
left.set(title=r"fixed point to chaos at $\mu = 0$")
middle.set(title="slope of the right piece")
right.set(title="Newton's method for $z^3 = 1$", aspect="equal")

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "07_maps.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=110)
print("written", picture)
