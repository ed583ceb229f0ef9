"""Maps: iterations and exponents on one core, attractors and basins on all, beside plain NumPy."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from measure import interleaved, machine, show

import saltus
from saltus import Average, Map, Piece
from saltus.basins.map.grid import Grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

ITERATIONS = 5_000_000  # of one motion
MEASURED = 2_000_000  # iterations for exponents
CELLS = 1000  # cells along each state
LONGEST = 200  # iterations of NumPy's motions
REPEATS = 7
BOX = {"x": (-2.0, 2.0), "y": (-2.0, 2.0)}

HENON = Map(("x", "y"), {"a": 1.4, "b": 0.3}, {"x": "1 - a*x**2 + y", "y": "b*x"}, name="Henon map")
TENT = Map(
    ("x",),
    {"a": 1.8},
    pieces={"left": Piece({"x": "a*x"}, where="1/2 - x"), "right": Piece({"x": "a*(1 - x)"}, where="x - 1/2")},
)
NEWTON = Map(
    ("x", "y"),
    {},
    {"x": "2*x/3 + (x**2 - y**2)/(3*(x**2 + y**2)**2)", "y": "2*y/3 - 2*x*y/(3*(x**2 + y**2)**2)"},
)


def main() -> None:
    """Print the tables."""
    print(machine())
    one_motion()
    basins()


def one_motion() -> None:
    """Print what an iteration takes."""
    average = Average(periods=MEASURED, discard=0)
    works = {
        "Henon, iteration": lambda: saltus.iterate(HENON, x0=[0.1, 0.1], n=0, discard=ITERATIONS),
        "tent map, iteration": lambda: saltus.iterate(TENT, x0=[0.1], n=0, discard=ITERATIONS),
        "Henon, with two exponents": lambda: saltus.lyapunov_spectrum(HENON, {}, [0.1, 0.1], average=average),
    }
    counts = {name: MEASURED if "exponents" in name else ITERATIONS for name in works}
    seconds = {name: [s / counts[name] for s in values] for name, values in interleaved(works, REPEATS).items()}
    show("one motion, one core", seconds, {}, {name: f"{1.0 / min(s):.3g} a second" for name, s in seconds.items()})


def basins() -> None:
    """Print what attractors and basins of 1000 x 1000 cells take."""
    grid = {name: (*ends, CELLS) for name, ends in BOX.items()}
    henon, newton = (saltus.find_attractors(system, {}, BOX) for system in (HENON, NEWTON))
    works = {
        "Henon, attractors": lambda: saltus.find_attractors(HENON, {}, BOX),
        "Henon, basins": lambda: saltus.map_basins(HENON, {}, grid, henon),
        "Henon, plain NumPy": plain,
        "Newton's method, attractors": lambda: saltus.find_attractors(NEWTON, {}, BOX),
        "Newton's method, basins": lambda: saltus.map_basins(NEWTON, {}, grid, newton),
    }
    seconds = interleaved(works, REPEATS)
    differing = int(np.sum((works["Henon, basins"]().labels == 0) != plain()))
    notes = {"Henon, basins": f"{differing} cells differ from NumPy's"}
    show(f"{CELLS} x {CELLS} cells", seconds, {"Henon, basins": "Henon, plain NumPy"}, notes)


def plain() -> NDArray[np.bool_]:
    """Return whether motions of the Henon map are bounded after a number of iterations, by NumPy."""
    grid = Grid(HENON.states, {name: (*ends, CELLS) for name, ends in BOX.items()})
    x, y = np.meshgrid(*grid.axes, indexing="ij")
    with np.errstate(all="ignore"):
        for _ in range(LONGEST):
            x, y = 1.0 - 1.4 * x * x + y, 0.3 * x
    return np.asarray((np.abs(x) < 1e3) & (np.abs(y) < 1e3))


if __name__ == "__main__":
    main()
