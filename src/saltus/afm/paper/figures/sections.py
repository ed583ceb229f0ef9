"""Common parts of Figs. 8 to 10: model, attractors, sections of the basins, and files.

Labels are in Zarr stores, from which an interrupted run resumes. The attractors' orbits are in the NetCDF file, each a
`PeriodicOrbit`.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import asdict
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.afm.paper.figures.files import write_figure
from saltus.afm.paper.figures.telling import about, tell
from saltus.extras import check_installed
from saltus.progress import Report

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from saltus.basins import Basins
    from saltus.result import Result
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

# Parameters of the paper's basins, for every mode.
PARAMETERS: Mapping[str, float] = MappingProxyType({"Omega": 1.15, "D_att": 0.025, "D_rep": 4.0})

RANGE = (-5.0, 5.0)  # of every coordinate

RESOLUTION = 400  # cells along a coordinate in the paper

# The paper's symbols of the states.
LABELS: Mapping[str, str] = MappingProxyType(
    {"q1": r"$\bar{q}_1$", "q2": r"$\bar{q}_2$", "v1": r"$\bar{q}_1'$", "v2": r"$\bar{q}_2'$"}
)

# Colours of the attractors' marks; blue is the paper's for the attractive regime.
MARKS: Mapping[str, str] = MappingProxyType({"repulsive": "#d1495b", "attractive": "#1f6fd0"})


def model(modes: int) -> HybridSystem:
    """Return tapping mode with the paper's set-up."""
    from saltus.afm.paper.table1 import table1
    from saltus.afm.paper.tapping import tapping_mode

    return tapping_mode(table1(), modes=modes)


def attractors_of(system: HybridSystem, store: Path, progress: bool | Report) -> Any:
    """Return the attractors in the paper's box, those of a store if it exists."""
    from saltus.basins import Basins, find_attractors

    if store.exists():
        return Basins.open(store).attractors
    tell(progress, f"attractors, {_modes_in_words(system)}")
    return find_attractors(system, PARAMETERS, region=dict.fromkeys(system.states, RANGE))


def mapped(
    system: HybridSystem, grid: Mapping[str, Any], attractors: Any, store: Path, progress: bool | Report, what: str
) -> Basins:
    """Return the basins over a grid; only cells that the store lacks are computed.

    Raises
    ------
    InputError
        The store has other inputs, as another resolution.
    """
    from saltus.basins import map_basins

    return map_basins(system, PARAMETERS, grid, attractors, path=store, progress=about(progress, what))


def group(path: Path) -> Path:
    """Return the folder of a Zarr group of stores, created if absent."""
    check_installed("zarr")
    import zarr

    zarr.open_group(path, mode="a", zarr_format=3)
    return path


def write_sections(
    out: Path,
    name: str,
    compute: Callable[[Path, int, bool | Report], Iterable[tuple[str, Basins]]],
    content: Callable[[Mapping[str, Basins]], dict[str, Any]],
    draw: Callable[[Mapping[str, Basins]], Figure],
    *,
    resolution: int,
    progress: bool | Report,
) -> dict[str, Any]:
    """Compute a figure of basins and write its files as `write_figure` does; its stores are among them.

    Parameters
    ----------
    out : Path
        An existing folder.
    name : str
        Of the figure: ``<name>.zarr`` is the store, or the group of stores.
    compute : callable
        Called with the store, the resolution and `progress`, a generator of names and basins, which computes each on
        demand.
    content, draw : callable
        As for `write_figure`, called with the basins by name.
    resolution : int
        Cells along each axis.
    progress : bool or callable
        True for a bar on stderr, or a function called with a `saltus.Progress`, which counts the cells that are done.

    Raises
    ------
    InputError
        The resolution is no whole number of 2 or more, or an existing store has another resolution.
    """
    resolution = checks.count("resolution", resolution, 2)
    basins: dict[str, Basins] = {}

    def orbits(progress: bool | Report) -> Iterator[tuple[str, Result]]:
        return _orbits(compute(out / f"{name}.zarr", resolution, progress), basins)

    written = write_figure(out, name, orbits, lambda _: content(basins), lambda _: draw(basins), progress)
    written["files"].insert(1, out / f"{name}.zarr")
    return written | {"results": basins}


def _orbits(found: Iterable[tuple[str, Basins]], basins: dict[str, Basins]) -> Iterator[tuple[str, Result]]:
    """Go through the orbits of the attractors of all basins, once for each system; keep the basins."""
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
    """Return the entries of a figure's JSON file on basins.

    The entries are the shares of the cells by label (with ``not done`` where needed), and the count of undecided cells.
    The `LabelError` follows once all cells are done. The attractors have their states at phase 0 and Floquet
    multipliers. Further entries are the motions followed a second, and the notes on the trapping regions.
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
