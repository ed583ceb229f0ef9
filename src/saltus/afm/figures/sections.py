"""What Figs. 8 to 10 share: the model and its attractors, sections of its basins, and their files.

Labels lie in Zarr stores, written as they are found, from which an interrupted run goes on; the attractors' orbits are
in the NetCDF file, a `PeriodicOrbit` each.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.afm.figures.files import write_figure

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from saltus.basins import Basins
    from saltus.results import Result
    from saltus.system import HybridSystem

__all__ = [
    "LABELS",
    "MARKS",
    "PARAMETERS",
    "RANGE",
    "attractors_of",
    "group",
    "mapped",
    "model",
    "summary_of",
    "write_sections",
]

PARAMETERS: Mapping[str, float] = MappingProxyType({"Omega": 1.15, "D_att": 0.025, "D_rep": 4.0})
"""Of the paper's basins, for every mode."""

RANGE = (-5.0, 5.0)
"""Of every coordinate."""

RESOLUTION = 400
"""Cells along a coordinate in the paper."""

LABELS: Mapping[str, str] = MappingProxyType(
    {"q1": r"$\bar{q}_1$", "q2": r"$\bar{q}_2$", "v1": r"$\bar{q}_1'$", "v2": r"$\bar{q}_2'$"}
)
"""The paper's symbols of the states."""

MARKS: Mapping[str, str] = MappingProxyType({"repulsive": "#d1495b", "attractive": "#1f6fd0"})
"""Colours of the attractors' marks; blue is the paper's for the attractive regime."""


def model(modes: int) -> HybridSystem:
    """Return tapping mode with the paper's set-up."""
    from saltus.afm.paper import table1
    from saltus.afm.tapping import tapping_mode

    return tapping_mode(table1(), modes=modes)


def attractors_of(system: HybridSystem, store: Path, say: Callable[[str], None]) -> Any:
    """Return the attractors that the paper's box holds; those in a store where there is one."""
    from saltus.basins import Basins, find_attractors

    if store.exists():
        return Basins.open(store).attractors
    say(f"attractors, {_modes_in_words(system)}")
    return find_attractors(system, PARAMETERS, region=dict.fromkeys(system.states, RANGE))


def mapped(
    system: HybridSystem, grid: Mapping[str, Any], attractors: Any, store: Path, say: Callable[[str], None], what: str
) -> Basins:
    """Return the basins over a grid, of which those cells are computed that the store does not hold.

    Raises
    ------
    InputError
        The store is of other inputs, as of another resolution.
    """
    from saltus.basins import map_basins

    def told(done: int, total: int, rate: float, left: float) -> None:
        say(f"{what}: {done / total:.0%} of {total} cells, {rate:,.0f} orbits/s, {left:.0f} s left")

    return map_basins(system, PARAMETERS, grid, attractors, path=store, progress=told)


def group(path: Path) -> Path:
    """Return the folder of a Zarr group that holds stores, made if it is absent."""
    import zarr

    zarr.open_group(path, mode="a", zarr_format=3)
    return path


def write_sections(
    out: Path,
    name: str,
    compute: Callable[[Path, int, Callable[[str], None]], Iterable[tuple[str, Basins]]],
    content: Callable[[Mapping[str, Basins]], dict[str, Any]],
    draw: Callable[[Mapping[str, Basins]], Figure],
    *,
    resolution: int,
    progress: Callable[[str], None] | None,
) -> dict[str, Any]:
    """Compute a figure of basins and write its files as `write_figure` does; its stores are among them.

    Parameters
    ----------
    out : Path
        An existing folder.
    name : str
        Of the figure: ``<name>.zarr`` is the store, or the group of stores.
    compute : callable
        Given the store, the resolution and what is called with a line of text, goes through what the figure is made of,
        with names, computing each when it is asked for.
    content, draw : callable
        As `write_figure` takes them, from the basins by name.
    resolution : int
        Cells along each axis.
    progress : callable or None
        Called with a line of text whenever there is something new to say.

    Raises
    ------
    InputError
        The resolution is no whole number of 2 or more, or the store there is of another one.
    """
    resolution = checks.count("resolution", resolution, 2)
    say = progress or (lambda _: None)
    basins: dict[str, Basins] = {}
    found = compute(out / f"{name}.zarr", resolution, say)
    written = write_figure(out, name, _orbits(found, basins), lambda _: content(basins), lambda _: draw(basins), say)
    written["files"].insert(1, out / f"{name}.zarr")
    return written | {"results": basins}


def _orbits(found: Iterable[tuple[str, Basins]], basins: dict[str, Basins]) -> Iterator[tuple[str, Result]]:
    """Go through the orbits of the attractors of all basins, each system's once, keeping the basins."""
    told: set[str] = set()
    for name, section in found:
        basins[name] = section
        outcomes = section.attractors
        for attractor, orbit in outcomes.orbits.items():
            title = f"{attractor}, {_modes_in_words(outcomes.system)}"
            if title not in told:
                told.add(title)
                yield title, orbit
        if "interrupted" in section.stopped:
            raise KeyboardInterrupt


def _modes_in_words(system: HybridSystem) -> str:
    n = len(system.states) // 2
    return f"{n} {'mode' if n == 1 else 'modes'}"


def summary_of(basins: Basins) -> dict[str, Any]:
    """Return what a figure's JSON file says of basins.

    Parts of the cells by label (with ``not done`` where there are such cells), how many cells are undecided, how many
    labels were wrong (`LabelError`; none before all cells are done), the attractors with their states at phase 0 and
    Floquet multipliers, motions followed a second, and how it is known in which basin a motion is.
    """
    parts, outcomes, error = basins.fractions(), basins.attractors, basins.noted_error
    rate = basins.orbits_per_second
    return {
        "grid": {
            **{name: list(span) for name, span in zip(basins.grid.names, basins.grid.ranges, strict=True)},
            **basins.grid.fixed,
        },
        "fractions": parts,
        "undecided": round(parts["undecided"] * basins.grid.size),
        "label_error": None if error is None else asdict(error),
        "done": basins.stopped,
        "orbits_per_second": rate if math.isfinite(rate) else None,
        "attractors": {name: _attractor(outcomes, name) for name in outcomes.names},
        "traps": {str(key): str(note) for key, note in outcomes.notes.items()},
    }


def _attractor(outcomes: Any, name: str) -> dict[str, Any]:
    content: dict[str, Any] = {
        "label": int(outcomes.labels[name]),
        "kind": outcomes.kinds[name],
        "states": [dict(zip(outcomes.system.states, row, strict=True)) for row in _rows(outcomes.points[name])],
    }
    if name in outcomes.orbits:
        orbit = outcomes.orbits[name]
        content |= {
            "period": orbit.period,
            "multipliers": [[float(mu.real), float(mu.imag)] for mu in orbit.multipliers],
            "min_z": orbit.min["z"],
            "signature": [list(pair) for pair in orbit.signature],
        }
    return content


def _rows(points: Any) -> list[list[float]]:
    return [[float(x) for x in row] for row in np.atleast_2d(np.asarray(points))]
