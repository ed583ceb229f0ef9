"""From equilibria to cycles: the Lorenz equations along one parameter, Bazykin's predators and prey along two.

Known answers: the equilibria of Lorenz (1963) branch at r = 1 and have a Hopf point at r = sigma (sigma + b + 3)/(sigma
- b - 1). Bazykin's equations are those of Kuznetsov, Elements of Applied Bifurcation Theory, section 8.5.

Field: Smooth systems.

    python 06_equilibria_and_hopf.py [picture]
"""

import sys
from pathlib import Path

from matplotlib import pyplot as plt

import saltus

sigma, b = 10.0, 8.0 / 3.0
lorenz = saltus.HybridSystem(
    states=("x", "y", "z"),
    parameters={"sigma": sigma, "r": 0.5, "b": b},
    modes={"flow": saltus.Mode({"x": "sigma*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"})},
    name="Lorenz equations",
)
trivial = saltus.continue_equilibrium(saltus.find_equilibrium(lorenz), "r", bounds=(0.0, 30.0))
wings = saltus.continue_equilibrium(saltus.switch_branch(trivial["BP1"]), "r", bounds=(0.0, 30.0))
hopf = wings["HB1"]
print(wings)
print(hopf.normal_form)
cycles = saltus.continue_orbit(saltus.switch_branch(hopf), "r", bounds=(15.0, 30.0))
print(cycles)
exact = sigma * (sigma + b + 3.0) / (sigma - b - 1.0)
for name, found, wanted in (("BP", trivial["BP1"], 1.0), ("HB", hopf, exact)):
    r = found.parameters["r"]
    print(f"{name} at r = {r:.12f}, closed form {wanted:.12f}, difference {r - wanted:.1e}")
    assert abs(r - wanted) < 1e-10

prey = saltus.HybridSystem(
    states=("x", "y"),
    parameters={"al": 0.35, "de": 0.01},
    modes={"flow": saltus.Mode({"x": "x - x*y/(1 + al*x) - 0.01*x**2", "y": "-y + x*y/(1 + al*x) - de*y**2"})},
    name="Bazykin's predators and prey",
)
bounds = {"al": (0.01, 1.2), "de": (1e-5, 5.0)}
rest = saltus.find_equilibrium(prey, x0=[3.0, 3.0])
folds = saltus.continue_locus(saltus.continue_equilibrium(rest, "al", bounds=(0.1, 1.1))["SN1"], ("al", "de"), bounds)
births = [saltus.continue_locus(point, ("al", "de"), bounds) for point in folds.special_points.of_type("BT")]
print(folds, *births, sep="\n")

figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 4.5), layout="constrained")
trivial.plot(ax=left)
wings.plot(ax=left)
for extreme in ("max_x", "min_x"):
    cycles.plot(y=extreme, ax=left, special=False)
left.set(ylabel="$x$; of cycles both extremes", title=lorenz.name)
for locus in (folds, *births):
    locus.plot(ax=right)
right.set(xlabel=r"$\alpha$", ylabel=r"$\delta$", yscale="log", title=prey.name)

picture = Path(sys.argv[1] if len(sys.argv) > 1 else Path(__file__).parent / "results" / "06_equilibria_and_hopf.png")
picture.parent.mkdir(parents=True, exist_ok=True)
figure.savefig(picture, dpi=150)
print("written", picture)
