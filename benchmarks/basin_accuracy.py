"""How many labels of cells are right, and how exact the one-period map is that they rest on.

The truth is the event-driven flow at tolerance 1e-11, followed until the motion is at the attractor itself, whatever
the trapping regions say. The map is compared with that flow, and on fewer states with SciPy's DOP853 in small steps.
"""

from __future__ import annotations

import argparse
import json
import multiprocessing
import os
import sys
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from basin_peers import EventDriven, Model, by_scipy, cells_of, grids, states_of_box, tapping
from measure import machine

from saltus.basins.map.labelling import TOLERANCE
from saltus.basins.wilson import wilson
from saltus.ensemble.traps import DIVERGED, UNDECIDED
from saltus.errors import DivergenceError
from saltus.flow.starting import starting_mode

if TYPE_CHECKING:
    from numpy.typing import NDArray

EXACT, FINER = 1e-11, 1e-13
"""Tolerance of the truth; that at which it is sought again where labels differ."""

AT_THE_ATTRACTOR = 1e-6
"""Distance from its points at phase 0, in each state, at which a motion has converged."""

PATIENCE, STRIDE = 2000, 8
"""Periods after which a motion has no label; periods between two looks."""

WRONG = {"plane": 5e-4, "box": 1e-3}
"""Largest share of wrong labels: in planes, and in three and four dimensions."""

MEDIAN, PERCENTILE_99 = 1e-7, 2e-6
"""Largest errors of the one-period map."""

SCIPY_TOLERANCE, SCIPY_STEP = 1e-12, 0.02
"""Of SciPy: a step this short cannot step over a dip that matters."""

CHUNK, SHOWN = 100, 20
"""Cells that a process is handed at once; wrong ones that are written down."""


@dataclass(frozen=True)
class LabelErrors:
    """Labels of the random cells of a grid.

    Attributes
    ----------
    grid : str
        Which.
    cells : int
        How many.
    wrong : int
        How many labels are not the truth's.
    doubtful : int
        How many of these have another truth at a finer tolerance.
    allowed : float
        Share of wrong labels that is allowed.
    upper : float
        Upper end of the 95 % Wilson interval of the share.
    undecided : int
        Motions without a label, by lanes or in truth.
    examples : list
        Some of the wrong: state, label, truth.
    """

    grid: str
    cells: int
    wrong: int
    doubtful: int
    allowed: float
    upper: float
    undecided: int
    examples: list[tuple[list[float], int, int]]


@dataclass(frozen=True)
class MapError:
    """Errors of the one-period map of the lanes, the largest of the states' each: median, 99th percentile, largest."""

    against: str
    states: int
    median: float
    percentile_99: float
    largest: float


@dataclass(frozen=True)
class Truth:
    """The label of each motion by where it converges: what a process needs to find it."""

    advance: EventDriven
    attractors: dict[int, NDArray[np.float64]]

    @classmethod
    def of(cls, model: Model, tolerance: float = EXACT) -> Truth:
        """Return the truth of a model's motions, at a tolerance."""
        found = model.attractors
        at = {found.labels[name]: found.points[name] for name in found.names}
        return cls(EventDriven(model.system, model.p, tolerance, STRIDE), at)

    def __call__(self, points: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the labels of motions that start at phase 0, shape (m,)."""
        return np.array([self._label(x) for x in points], np.uint8)

    def _label(self, x: NDArray[np.float64]) -> int:
        system = self.advance.system
        mode = starting_mode(system, system.full_state(x), self.advance.p)
        for _ in range(PATIENCE // STRIDE):
            try:
                x, mode = self.advance(x, mode)
            except DivergenceError:
                return DIVERGED
            for label, points in self.attractors.items():
                if np.abs(points - x).max(axis=1).min() < AT_THE_ATTRACTOR:
                    return label
        return UNDECIDED


def label_errors(
    name: str, cells: int, *, seed: int = 1, tolerance: float = TOLERANCE, each: Callable[..., Iterable[Any]] = map
) -> LabelErrors:
    """Compare the labels of random cells of one of the `grids` with the truth.

    Parameters
    ----------
    name : str
        Which of the grids.
    cells : int
        How many.
    seed : int
        Of the draw.
    tolerance : float
        Of the lanes.
    each : callable
        `map`, or that of several processes.
    """
    modes, grid = grids()[name]
    model, points = tapping(modes), cells_of(grid, cells, (seed, list(grids()).index(name)))
    labels, _ = model.ensemble(tolerance).settle(points, model.traps)
    chunks = [points[i : i + CHUNK] for i in range(0, cells, CHUNK)]
    right = np.concatenate(list(each(Truth.of(model), chunks)))
    wrong = np.flatnonzero((labels != right) | (right == UNDECIDED))
    doubtful = int(np.sum(Truth.of(model, FINER)(points[wrong]) != right[wrong]))
    examples = [(points[i].tolist(), int(labels[i]), int(right[i])) for i in wrong[:SHOWN]]
    undecided = int(np.sum((labels == UNDECIDED) | (right == UNDECIDED)))
    allowed = WRONG["plane" if len(grid.shape) == 2 else "box"]
    return LabelErrors(name, cells, wrong.size, doubtful, allowed, wilson(wrong.size, cells)[1], undecided, examples)


def map_error(states: int, seed: int = 2, tolerance: float = TOLERANCE) -> MapError:
    """Compare the map of the lanes with the event-driven flow over random states of the box."""
    return _compared("event-driven flow", states, seed, tolerance)


def map_error_by_scipy(states: int, seed: int = 3, tolerance: float = TOLERANCE) -> MapError:
    """Compare the map of the lanes with SciPy over random states of the box."""
    return _compared("SciPy DOP853", states, seed, tolerance)


def _compared(against: str, states: int, seed: int, tolerance: float) -> MapError:
    model, points = tapping(2), states_of_box(states, seed)
    peer = (
        EventDriven(model.system, model.p, EXACT)
        if against == "event-driven flow"
        else by_scipy(SCIPY_TOLERANCE, SCIPY_STEP)
    )
    exact = np.array([peer(x, model.start(x))[0] for x in points])
    ends, _ = model.ensemble(tolerance).strobe(points)
    errors = np.abs(ends - exact).max(axis=1)
    return MapError(against, states, *(float(value) for value in np.percentile(errors, (50, 99, 100))))


def show(labels: Sequence[LabelErrors], maps: Sequence[MapError]) -> None:
    """Print the tables."""
    heads = ("cells", "wrong", "doubtful", "equal", "wanted", "95 % bound", "undecided")
    print(f"\n{'labels':22} " + " ".join(f"{head:>10}" for head in heads))
    for row in labels:
        equal, wanted = 1.0 - row.wrong / row.cells, 1.0 - row.allowed
        shares = " ".join(f"{share:>10.3%}" for share in (equal, wanted, 1.0 - row.upper))
        counts = f"{row.cells:>10} {row.wrong:>10} {row.doubtful:>10}"
        print(f"  {row.grid:20} {counts} {shares} {row.undecided:>10}{'' if equal >= wanted else '  MISSED'}")
    print(f"\n{'one-period map, against':26} {'states':>7} {'median':>9} {'99 %':>9} {'largest':>9}")
    for error in maps:
        said = "" if error.median <= MEDIAN and error.percentile_99 <= PERCENTILE_99 else "  MISSED"
        print(
            f"  {error.against:24} {error.states:>7} {error.median:>9.1e} {error.percentile_99:>9.1e} "
            f"{error.largest:>9.1e}{said}"
        )
    print(f"  {'wanted':24} {'':>7} {MEDIAN:>9.1e} {PERCENTILE_99:>9.1e}")


def main() -> None:
    """Measure what the command line asks for, print the tables and write them."""
    parser = argparse.ArgumentParser(description="How many labels of cells are right.")
    parser.add_argument("--cells", type=int, default=20_000, help="random cells of each grid, and states of the box")
    parser.add_argument("--scipy", type=int, default=300, help="states that SciPy follows for a period (300)")
    parser.add_argument("--processes", type=int, default=os.cpu_count() or 1, help="that find the truth (all cores)")
    parser.add_argument("--tolerance", type=float, default=TOLERANCE, help=f"of the lanes ({TOLERANCE:g})")
    parser.add_argument("--seed", type=int, default=1, help="of the draws (1)")
    parser.add_argument("--out", type=Path, default=Path("results"), help="folder of basin_accuracy.json (results)")
    options = parser.parse_args()
    begin = time.perf_counter()
    maps = [
        map_error(options.cells, options.seed + 1, options.tolerance),
        map_error_by_scipy(options.scipy, options.seed + 2, options.tolerance),
    ]
    labels: list[LabelErrors] = []
    with multiprocessing.get_context("spawn").Pool(options.processes) as pool:
        for name in grids():
            settings = {"seed": options.seed, "tolerance": options.tolerance, "each": pool.imap}
            labels.append(label_errors(name, options.cells, **settings))
            print(f"{name}: {labels[-1].wrong} wrong, {time.perf_counter() - begin:.0f} s", file=sys.stderr)
    print(machine())
    show(labels, maps)
    content: dict[str, Any] = {
        "machine": machine(),
        "tolerance": options.tolerance,
        "seed": options.seed,
        "seconds": time.perf_counter() - begin,
        "traps": dict(tapping(2).attractors.notes),
        "labels": [asdict(row) for row in labels],
        "maps": [asdict(error) for error in maps],
    }
    options.out.mkdir(parents=True, exist_ok=True)
    file = options.out / "basin_accuracy.json"
    file.write_text(json.dumps(content, indent=1) + "\n")
    print(f"\n{time.perf_counter() - begin:.0f} s; {file}")


if __name__ == "__main__":
    main()
