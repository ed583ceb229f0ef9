"""Basins over a grid: each cell's motion is followed into a trapping region, unit by unit, resumably.

Rules
-----
* The label belongs to the motion that starts at the cell's centre at phase 0.
* It names the attractor in whose trapping region the motion is first seen at a strobe. It is ``diverged`` beyond every
  bound, and ``undecided`` after `BasinOptions.longest` periods.
* For a map a strobe is an iteration, and so is a period.
* Cells are labelled in units that follow from the grid alone, each written once and as a whole. The labels do not
  depend on the number of threads, workers or runs.
"""

from __future__ import annotations

import json
import math
import os
import warnings
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict, is_dataclass, replace
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.basins.attractors.finding import find_attractors
from saltus.basins.attractors.found import AttractorOptions, renamed
from saltus.basins.map.basin_files import accuracy_of, attributes_of
from saltus.basins.map.basins import Basins
from saltus.basins.map.grid import Grid, Plane
from saltus.basins.map.labelling import Labelling, checked_engine, units_of
from saltus.basins.map.options import BasinOptions
from saltus.basins.map.outcomes import attractors_bytes, attractors_table, outcomes_from
from saltus.basins.map.patience import Patience, patience_for
from saltus.basins.map.store import Store, check_same
from saltus.ensemble.traps import NOT_DONE, UNDECIDED, Traps
from saltus.errors import InputError, nearest
from saltus.extras import check_installed
from saltus.progress import Report, Reporter, ended
from saltus.system import HybridSystem, Map
from saltus.system.maps import checked_system
from saltus.version import __version__

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

__all__ = ["map_basins"]

_IN_MEMORY = 10**9  # cells that are held in memory, at most

_CHECKED = 100  # cells for each one that is followed again
_FEWEST = 500  # cells of a store followed again, at least
_FEWEST_IN_MEMORY = 100  # the same in memory, where a grid is done at once
_MOST = 10_000  # cells followed again, at most

_BY_EVENTS = 50  # cells of a store that the event-driven flow follows again, some milliseconds each

_SHOWN = 16  # points of each attractor that are followed to check it

_TOLD = ("search", "longest_reason")  # inputs that may differ where a store is resumed

_ASKED = 16  # undecided cells, of a unit and of the grid, that are followed again to tell why


def map_basins(
    system: HybridSystem | Map,
    parameters: Mapping[str, float] | None,
    grid: Mapping[str, Any] | Plane | Grid,
    attractors: Any = None,
    *,
    options: BasinOptions | None = None,
    path: str | os.PathLike[str] | None = None,
    progress: bool | Report = False,
) -> Basins:
    """Return the basins of attraction over a grid of initial conditions.

    Parameters
    ----------
    system : HybridSystem or Map
        The system.
    parameters : mapping of str to float or None
        Parameters that differ from the system's defaults.
    grid : mapping of str to (float, float, int) or float, Plane or Grid
        For each state a range ``(low, high, count)`` or a frozen value; or a plane of any direction. See `Grid`. All
        motions start at phase 0.
    attractors : Attractors or mapping, optional
        Attractors that `find_attractors` or `attractors_from` returned; or arguments of `find_attractors`, as
        ``{"options": AttractorOptions(starts=512)}``. The region is then by default the box of the grid, and the number
        of motions that of the cells. Without this argument, the attractors are those of the store, or are found with
        default options.
    options : BasinOptions, optional
        Engine, accuracy, and how long motions are followed.
    path : path-like, optional
        A store, in which finished units are written. Where it exists, the run resumes from its finished units, with the
        same labels as a run without interruption. By default labels are held in memory.
    progress : bool or callable, optional
        True for a bar on stderr, or a function called with a `saltus.Progress`. It counts motions of a search for
        attractors, then cells.

    Returns
    -------
    Basins
        An interrupt (Ctrl-C) keeps the finished units; `Basins.stopped` says so.

    Raises
    ------
    InputError
        An argument that cannot be used, an attractor that motions leave, or a store of other inputs. A store that
        cannot be written, or whose disk is full.

    Notes
    -----
    Wrong labels were counted for the tapping cantilever of two modes (see `examples/configs`) at the default tolerance.
    The share of 20 000 random cells with a wrong label is 0 per cent in the plane of Fig. 9, 0.015 per cent in the
    worst plane of Fig. 10, and 0.02 per cent in [-5, 5]^4. The reference is the event-driven flow at tolerance 1e-11,
    followed until it is within 1e-6 of an attractor (``benchmarks/basin_accuracy.py``). Grids with long chaotic
    transients have more wrong labels. `Basins.label_error` measures their share. `Basins.noted_error` has it from a
    hundredth of the cells, at least 100, and a warning tells where it is above 1 per cent. A finished store has it as
    ``label_error``, from at least 500 cells, and from some cells followed by the event-driven flow.

    Besides, at most a share `Attractors.measured_error` of any one trapping region belongs to another basin, by the
    samples that made the region. A store's ``accuracy`` has the tolerance, this share, and the label error.
    ``attractors.notes`` has each region's construction, and its proof or number of samples.

    Whatever ends a run, a store stays readable: a unit is written aside and then renamed. A unit that was cut off is
    detected by its checksum, and computed again. `docs/basins.md` is a guide, docs/theory/basins.md the theory.

    Examples
    --------
    A double well; its attractors are found in the grid's box:

    >>> from saltus import Mode
    >>> wells = HybridSystem(
    ...     ("x", "v"), {"w": 1.0}, {"free": Mode({"x": "v", "v": "x - x**3 - 0.35*v + 0.2*cos(s)"})}, phase=("s", "w")
    ... )
    >>> basins = map_basins(wells, {}, {"x": (-2.2, 2.2, 60), "v": 0.5})
    >>> {name: round(share, 2) for name, share in basins.fractions().items()}
    {'period-1 A': 0.42, 'period-1 B': 0.58, 'diverged': 0.0, 'undecided': 0.0}
    """
    settings = settings_of(system, parameters, options)
    chosen = options or BasinOptions()
    cells, place = _grid(system, grid), _path(path)
    if place is None and cells.size > _IN_MEMORY:
        raise InputError("path", None, f"given for a grid of more than {_IN_MEMORY:.0e} cells", f"it has {cells.size}")
    with ExitStack() as stack:
        report = stack.enter_context(Reporter(progress)).report or False
        if chosen.engine == "dask":
            from saltus.basins.map.cluster import labelled_by, scheduler

            cluster = stack.enter_context(scheduler(chosen.client))
        kept = Store.open(place, writable=True) if place is not None and place.exists() else None
        found, search = attractors_for(settings, cells, attractors, kept, report)
        labelling, reason = with_traps(settings, found, cells)
        inputs = {
            **labelling.definition(), "longest_reason": reason, "labels": dict(found.labels),
            "saltus_version": __version__, **search,
        }  # fmt: skip
        if kept is not None:
            inputs = _same_inputs(kept, cells, inputs)
        else:
            _check_attractors(labelling, found)
            if place is not None:
                told, tables = attributes_of(inputs, cells, found), attractors_table(found, cells.states)
                kept = Store.create(place, cells, told, attractors_bytes(found), tables)
        run = _Run(cells, kept, labelling, report)
        if chosen.engine == "dask":
            basins = run.through(labelled_by(cluster, cells, inputs, place, run.units), found, inputs)
        else:
            basins = run.through(labelling.units(cells, run.units), found, inputs)
    if (error := basins.noted_error) is not None and error.large:
        warnings.warn(f"saltus: wrong labels: {error}; {error.hint}", RuntimeWarning, stacklevel=2)
    return basins


class _Run:
    """Units of a grid on their way into a store or an array."""

    def __init__(self, grid: Grid, store: Store | None, labelling: Labelling, report: bool | Report) -> None:
        self.grid, self.store, self.labelling = grid, store, labelling
        self.undecided: list[NDArray[np.int64]] = []
        self.array = np.full(grid.shape if store is None else 0, NOT_DONE, np.uint8)
        self.units = list(grid.units()) if store is None else store.missing()
        self.reporter = Reporter(report)
        self.reporter.expect(grid.size, grid.size - sum(map(_count, self.units)))
        self.followed, self.started = 0, monotonic()

    @property
    def rate(self) -> float:
        """Motions followed a second."""
        return self.followed / max(monotonic() - self.started, 1e-9)

    @property
    def done(self) -> int:
        """Count of finished cells, those of earlier runs included."""
        return self.reporter.done

    def through(self, labelled: Any, attractors: Any, inputs: Mapping[str, Any]) -> Basins:
        """Keep all units as they are labelled, and return the basins."""
        interrupted = False
        try:
            with closing(labelled):
                for cells, labels, followed in labelled:
                    self.keep(cells, labels, followed)
        except KeyboardInterrupt:
            interrupted = True
        if self.store is None:
            said = ended(self.done, self.grid.size, "cells", interrupted=interrupted)
            basins = Basins(self.array, self.grid, attractors, inputs, said, None, self.rate, self.why_undecided())
            return self.checked(basins) if self.done == self.grid.size and not interrupted else basins
        if self.followed:
            before = self.store.attributes.get("run", {"orbits": 0, "seconds": 0.0})
            seconds = before["seconds"] + monotonic() - self.started
            self.store.note(run={"orbits": before["orbits"] + self.followed, "seconds": seconds})
        if self.undecided:
            self.store.note(undecided=self.why_undecided())
        try:
            if self.done == self.grid.size and not interrupted:
                self.check(self.store, attractors)
        except KeyboardInterrupt:
            interrupted = True
        return Basins.of_store(self.store, attractors, interrupted=interrupted)

    def check(self, store: Store, attractors: Any) -> None:
        """Follow some cells of a complete store again, once, and note how many labels were wrong."""
        if "label_error" not in store.attributes:
            error = Basins.of_store(store, attractors).label_error(self._some(_FEWEST), by_events=_BY_EVENTS)
            accuracy = accuracy_of(store.attributes["inputs"], attractors.measured_error, error)
            store.note(label_error=error.as_data(), **accuracy)

    def checked(self, basins: Basins) -> Basins:
        """Return basins in memory with the share of wrong labels among some cells; an interrupt leaves it out."""
        try:
            error = basins.label_error(self._some(_FEWEST_IN_MEMORY), by_events=0)
        except KeyboardInterrupt:
            return basins
        return replace(basins, noted_error=error if error.cells else None)

    def _some(self, fewest: int) -> int:
        return min(self.grid.size, max(self.grid.size // _CHECKED, fewest), _MOST)

    def why_undecided(self) -> str:
        """Return why cells of this run are undecided, from some of them; empty where none is."""
        if not self.undecided:
            return ""
        found = np.concatenate(self.undecided)
        return self.labelling.undecided(self.grid.at(found[:: -(-len(found) // _ASKED)]))

    def keep(self, cells: tuple[slice, ...], labels: NDArray[np.uint8] | None, followed: int) -> None:
        """Keep a unit, unless a worker wrote it, and report it."""
        if labels is not None and self.store is not None:
            self.store.write(cells, labels)
        elif labels is not None:
            self.array[cells] = labels
        elif self.store is not None:
            labels = np.asarray(self.store.labels[cells])
        if labels is not None and len(at := np.argwhere(labels == UNDECIDED)):
            self.undecided.append(at[:: -(-len(at) // _ASKED)] + [part.start for part in cells])
        self.followed += followed
        self.reporter.step(_count(cells), "labelling cells")


def _count(cells: Sequence[slice]) -> int:
    return math.prod(part.stop - part.start for part in cells)


def _path(path: object) -> Path | None:
    if path is None:
        return None
    check_installed("zarr", "xarray")
    return checks.path("path", path, "the path of a folder")


def _grid(system: HybridSystem | Map, grid: Any) -> Grid:
    if isinstance(grid, Mapping) and system.phase is not None and system.phase[0] in grid:
        raise InputError("grid", system.phase[0], "a state other than the phase", "all motions start at phase 0")
    if isinstance(grid, Grid):
        if grid.states != system.states:
            raise InputError("grid's states", grid.states, f"those of the system: {', '.join(system.states)}")
        return grid
    return Grid(system.states, grid)


def settings_of(
    system: HybridSystem | Map, parameters: Mapping[str, float] | None, options: BasinOptions | None
) -> Labelling:
    """Return the settings of a labelling, still without trapping regions.

    Parameters
    ----------
    parameters : mapping of str to float or None
        Parameters that differ from the system's defaults.
    options : BasinOptions or None
        Engine, accuracy, and how long motions are followed.

    Raises
    ------
    InputError
        No system, parameters that it does not have, or no options.
    """
    checked_system(system)
    options = BasinOptions() if options is None else checks.instance("options", options, BasinOptions)
    return Labelling(
        system,
        system.resolve(parameters),
        Traps(len(system.states), limit=options.limit or math.inf),
        options.interval,
        options.tolerance,
        options.longest or 0,
        checked_engine(options.engine),
        options.preview,
    )


def attractors_for(
    settings: Labelling,
    grid: Grid,
    given: Any,
    kept: Store | None = None,
    progress: bool | Report = False,
) -> tuple[Any, dict[str, Any]]:
    """Return the attractors: given ones, those of a store, or found ones; and the options of the search.

    Parameters
    ----------
    settings : Labelling
        Settings of the labelling, still without trapping regions.
    grid : Grid
        Grid whose box is the default region of the search.
    given : Attractors, mapping or None
        As `map_basins` takes it.
    kept : Store, optional
        Store with attractors.
    progress : bool or callable, optional
        As `find_attractors` takes it.

    Returns
    -------
    attractors : Attractors
    search : dict
        All options of the search as plain data, as ``search``; empty without options.

    Raises
    ------
    InputError
        Not attractors, unknown options, or an engine that cannot run here.
    """
    asked = isinstance(given, Mapping) or (given is None and kept is None)
    wanted = _search(grid, given or {}) if asked else {}
    search = {"search": json.loads(json.dumps(wanted, default=_plain))} if asked else {}
    found = given
    if kept is not None and (given is None or asked):
        found = outcomes_from(kept.attractors, kept.attributes["attractors"])
    elif asked:
        settings.check_engine()
        if settings.interval is not None:
            wanted["options"] = replace(wanted["options"], interval=settings.interval)
        if settings.traps.limit < math.inf:
            wanted["options"] = replace(wanted["options"], limit=settings.traps.limit)
        found = find_attractors(settings.system, settings.parameters, progress=progress, **wanted)
    if not isinstance(getattr(found, "traps", None), Traps):
        kind, hint = type(found).__name__, "attractors_from makes one of known orbits"
        raise InputError("attractors", kind, "an Attractors, as find_attractors returns", hint)
    if settings.interval not in (None, found.interval):
        raise InputError(
            "BasinOptions.interval", settings.interval, f"that of the attractors, {found.interval!r}", "leave it out"
        )
    return found, search


def with_traps(settings: Labelling, found: Any, grid: Grid) -> tuple[Labelling, str]:
    """Return the labelling of a grid with the attractors' traps, and the reason for its `longest`."""
    given = Patience(settings.longest, "as given")
    patience = given if settings.longest else patience_for(found, grid.box)
    scale = units_of(getattr(found, "scale", None))
    traps = found.traps if settings.traps.limit == math.inf else replace(found.traps, limit=settings.traps.limit)
    settled = replace(settings, traps=traps, interval=found.interval, longest=patience.periods, scale=scale)
    return settled, patience.reason


def _search(grid: Grid, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the region and the options of a search for attractors: given ones and defaults."""
    region = {name: low if low == high else (low, high) for name, (low, high) in grid.box.items()}
    usual = {"region": region, "options": AttractorOptions()}
    for name in given:
        if name not in usual:
            hint = nearest(name, usual) or "attractors_from makes attractors of orbits by name"
            raise InputError("attractors", name, f"arguments among {', '.join(usual)}", hint)
    wanted = usual | dict(given)
    options = checks.instance("attractors['options']", wanted["options"], AttractorOptions)
    return wanted | {"options": options if options.motions else replace(options, motions=grid.size)}


def _plain(value: Any) -> Any:
    if isinstance(value, np.random.Generator):
        return value.bit_generator.state
    return asdict(value) if is_dataclass(value) and not isinstance(value, type) else float(value)


def _same_inputs(kept: Store, grid: Grid, inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return a store's inputs; raise `InputError` where the inputs differ; `search` may be missing."""
    its = dict(kept.attributes["inputs"])
    if "search" in its:
        its["search"] = renamed(its["search"])
    inputs = {key: value for key, value in inputs.items() if key != "longest_reason"}
    there = {key: value for key, value in its.items() if key not in _TOLD or key in inputs}
    check_same(kept.path, {"grid": grid.definition(), **inputs}, {"grid": kept.grid.definition(), **there})
    if kept.attributes.get("stopped"):
        kept.note(stopped="")
    return its


def _check_attractors(labelling: Labelling, attractors: Any) -> None:
    """Raise `InputError` where attractors belong to another system or parameters, or motions leave one of them."""
    if attractors.system != labelling.system:
        raise InputError("attractors", attractors.system.name, f"of this system, {labelling.system.name!r}")
    theirs = attractors.system.resolve(attractors.parameters)
    for name, value in labelling.parameters.items():
        if theirs[name] != value:
            raise InputError("attractors", f"{name} = {theirs[name]!r}", f"of these parameters: {name} = {value!r}")
    for name in attractors.names:
        points, label = np.atleast_2d(attractors.points[name]), attractors.labels[name]
        shown = points[:: max(len(points) // _SHOWN, 1)]
        ends = labelling.of(shown)
        for i in np.flatnonzero((ends != label) & (ends != UNDECIDED)):
            if label not in labelling.from_each_mode(shown[i]):
                told = {value: key for key, value in attractors.labels.items()}
                raise InputError("attractor", name, "one", f"a motion that starts on it ends as {told[int(ends[i])]!r}")
