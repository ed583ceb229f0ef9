"""Maps: a border that a fixed point meets, the basins of Newton's method, and branches of cycles.

Left, a piecewise-linear map of one state, the normal form of a border collision: `mu` moves the fixed point over the
border at 0. Before the border it is stable. Behind it the motion visits both pieces, and is chaotic at once. In the
middle, the right piece becomes steeper: cycles of period 2, 3, 4 follow each other, with chaos between them. Right,
Newton's method for z^3 = 1: three roots and the basins between them.

In the second row, the fixed points of the logistic map exchange their stability at r = 1. At r = 3 the period doubles,
and again and again up to the limit of the doublings. In the middle, loci of the Henon map in two parameters:
saddle-nodes and period doublings of the fixed point, and period doublings of the cycle of period 2. Right, the stable
cycle of period 4 of the logistic map as a cobweb.

Known answers: the doublings end at r = 3.569945672 (M. J. Feigenbaum, J. Stat. Phys. 19 (1978) 25). Fixed points of the
Henon map are born at a = -(1 - b)^2/4, and double their period at a = 3 (1 - b)^2/4 (M. Henon, Comm. Math. Phys. 50
(1976) 69).

Field: Maps.

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

options = saltus.options.SweepOptions(discard=1000, keep=200, criteria=saltus.options.Criteria(longest=32))
along_mu = saltus.run_sweep(border, "mu", np.linspace(-0.5, 1.0, 301), x0=[-0.1], options=options)
along_b = saltus.run_sweep(border, "b", np.linspace(-16.0, -0.5, 621), x0=[0.1], options=options)
print(along_mu)
print([along_b.at(b).label for b in (-0.7, -2.0, -3.2, -5.0, -12.0)])

# closed forms: the fixed point mu/(1 - a), and the exponent of the cycle of period 2
fixed = along_mu.points[0, 0, -1, 0]
print(f"fixed point {fixed:.12f}, difference {fixed - along_mu.values[0] / 0.6:.1e}")
assert abs(fixed - along_mu.values[0] / 0.6) < 1e-10
found = saltus.lyapunov_spectrum(border, {"b": -2.0}, [0.1], average=saltus.Average(periods=100))
print(f"exponent {found.exponents[0]:.12f}, difference {found.exponents[0] - 0.5 * np.log(0.8):.1e}")
assert abs(found.exponents[0] - 0.5 * np.log(0.8)) < 1e-10

logistic = saltus.Map(("x",), {"r": 2.8}, {"x": "r*x*(1 - x)"}, name="logistic map")
fixed_points = saltus.continue_orbit(saltus.solve_orbit(logistic, x0=[0.6]), "r", (0.5, 4.0))
rest = saltus.continue_orbit(saltus.solve_orbit(logistic, x0=[0.0]), "r", (0.5, 4.0))
cascade = saltus.follow_cascade(fixed_points["PD1"], (0.5, 4.0), doublings=4)
print(cascade)
assert abs(cascade.limit - 3.569945672) < 1e-5
period_4 = saltus.find_orbit(logistic, {"r": 3.5}, x0=[0.4])

henon = saltus.Map(("x", "y"), {"a": 0.1, "b": 0.3}, {"x": "a - x**2 + b*y", "y": "x"}, name="Henon map")
along_a = saltus.continue_orbit(saltus.solve_orbit(henon, x0=[0.1, 0.1]), "a", (-1.0, 1.0))
doubled = saltus.continue_orbit(saltus.solve_orbit(henon, {"a": 0.6}, x0=[1.0, -0.1], period=2), "a", (0.4, 2.0))
window = {"a": (-1.5, 3.0), "b": (-1.2, 1.2)}
loci = [saltus.continue_locus(point, ("a", "b"), window) for point in (along_a["SN1"], along_a["PD1"], doubled["PD1"])]
print(loci[1])
for locus, share in zip(loci[:2], (-0.25, 0.75), strict=True):
    assert np.max(np.abs(locus.values[:, 0] - share * (1.0 - locus.values[:, 1]) ** 2)) < 1e-10

basins = saltus.map_basins(newton, {}, {"x": (-2.0, 2.0, 400), "y": (-2.0, 2.0, 400)})
print(basins)

figure, ((left, middle, right), (tree, plane, web)) = plt.subplots(2, 3, figsize=(12.0, 7.6), layout="constrained")
along_mu.plot(ax=left)
along_b.plot(ax=middle)
basins.plot(ax=right, legend=False)
left.set(title=r"fixed point to chaos at $\mu = 0$")
middle.set(title="slope of the right piece")
right.set(title="Newton's method for $z^3 = 1$", aspect="equal")
for branch in (rest, fixed_points):
    branch.plot(ax=tree, special=branch is fixed_points, legend=False)
cascade.plot(ax=tree, legend=False)
tree.set(title="branches of the logistic map", ylim=(-0.9, 1.0))
for locus in loci:
    locus.plot(ax=plane, legend=False)
plane.set(title="loci of the Henon map", xlim=(-1.6, 6.4))
for ax in (tree, plane):
    named = dict(zip(*reversed(ax.get_legend_handles_labels()), strict=True))
    named = {label: line for label, line in named.items() if "of unstable" not in label}
    ax.legend(named.values(), named, loc="lower right" if ax is tree else "upper right", fontsize="small")
period_4.plot(ax=web)

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "07_maps.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=110)
print("written", picture)
