"""Basins over a grid: each cell's motion followed until its fate is certain, unit by unit, resumable.

Rules
-----
* The label belongs to the motion that starts at the cell's centre at phase 0.
* It is the label of the attractor in whose trapping region the motion is first seen at a strobe, ``diverged`` beyond
  every bound, or ``undecided`` after `longest` periods, by default those that the slowest decay asks for.
* Cells are labelled in units that follow from the grid alone, each written once and as a whole; how many threads,
  workers or runs there are changes nothing.
"""

from __future__ import annotations

import json
import math
import os
from collections.abc import Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict, is_dataclass, replace
from importlib.metadata import version
from inspect import signature
from pathlib import Path
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.basins.attractors.finding import find_attractors
from saltus.basins.attractors.found import Search
from saltus.basins.map.basin_files import attributes_of, told
from saltus.basins.map.basins import Basins
from saltus.basins.map.grid import Grid, Plane
from saltus.basins.map.labelling import TOLERANCE, Labelling, checked_engine, checked_interval, units_of
from saltus.basins.map.outcomes import attractors_bytes, outcomes_from
from saltus.basins.map.patience import Patience, patience_for
from saltus.basins.map.store import Store, check_same
from saltus.basins.telling import Progress
from saltus.ensemble.traps import NOT_DONE, UNDECIDED, Traps
from saltus.errors import InputError, nearest
from saltus.system import HybridSystem

if TYPE_CHECKING:
    import os

    from numpy.typing import NDArray

__all__ = ["map_basins"]

_IN_MEMORY = 10**9
"""Cells that are held in memory at most."""

_CHECKED, _FEWEST, _MOST = 100, 500, 10_000
"""Of a store one cell in so many is followed again, but not fewer and not more than so many."""

_BY_EVENTS = 50
"""How many of them the event-driven flow follows: it takes some milliseconds for each."""

_SHOWN = 16
"""Points of each attractor that are followed to see whether it is one."""

_TOLD = ("search", "longest_reason")
"""Inputs that need not be the same where a store is gone on with."""

_ASKED = 16
"""Undecided cells of a unit, and of the whole grid, that are followed again to say why they are."""

_SEEDS: int = signature(find_attractors).parameters["seeds"].default


def map_basins(
    system: HybridSystem,
    parameters: Mapping[str, float] | None,
    grid: Mapping[str, Any] | Plane | Grid,
    attractors: Any = None,
    *,
    engine: str = "cpu",
    path: str | os.PathLike[str] | None = None,
    client: Any = None,
    longest: int | None = None,
    tolerance: float = TOLERANCE,
    preview: bool = False,
    interval: float | None = None,
    progress: Progress | None = None,
) -> Basins:
    """Return the basins of attraction over a grid of initial conditions.

    Parameters
    ----------
    system : HybridSystem
        What moves.
    parameters : mapping of str to float or None
        Parameters that differ from the system's defaults.
    grid : mapping of str to (float, float, int) or float, Plane or Grid
        For each state a range ``(low, high, count)`` or the value it is frozen at; or a plane of any direction. See
        `Grid`. All motions start at phase 0.
    attractors : Attractors or mapping, optional
        Where motions end, as `find_attractors` or `attractors_from` returned them; or options with which
        `find_attractors` looks for them, as ``{"seeds": 512}``. It looks in the box of the grid if no `region` is
        given, and measures trapping regions as well as that is worth for the cells; ``progress`` is told how far it has
        come. By default all options are the usual ones, and a store's own attractors are taken as they are.
    engine : {"cpu", "cuda", "dask"}, optional
        This machine's processors, its graphics cards, or the workers of a Dask cluster.
    path : path-like, optional
        A folder in which labels are written as they are found. Where it exists, the run goes on from its finished
        units, and ends with the same array as one that was not interrupted. Without it labels are held in memory.
    client : dask.distributed.Client or str, optional
        The cluster, or the address of its scheduler, for ``engine="dask"``.
    longest : int, optional
        Periods after which a motion that is in no trapping region is undecided. By default four times as many as the
        slowest decay to an attractor takes, by its largest multiplier, from the farthest corner of the grid into the
        trapping region, or as the slowest motion of the search took; 200 at the least, 100 000 at the most.
    tolerance : float, optional
        Of a step, in the unit nearest to a state's size in steps of a thousand: 1 for sizes from 0.032 to 32.
    preview : bool, optional
        Whether only every fourth cell along each coordinate is computed at first, then again and again those beside
        cells of different labels, at half the distance; the others take the label that surrounds them. From 12 per
        cent of the motions to 60, on coarse grids in four dimensions, are followed. Where basins are fractal 0.5 to 2
        per cent of the cells come out wrong.
    interval : float, optional
        Time between two looks at a system without a phase, for the search of its attractors; attractors that are given,
        or that a store has, were found with theirs.
    progress : callable, optional
        Called with the count of cells that are done, the count of all, the motions followed a second, and how many
        seconds are left.

    Returns
    -------
    Basins
        An interrupt (Ctrl-C) keeps the units that are done; `Basins.stopped` says so.

    Raises
    ------
    InputError
        An argument that cannot be used, an attractor that is none, a store that belongs to other inputs, cannot be
        written, or whose disk is full.

    Notes
    -----
    Labels that are wrong: of 20 000 random cells each 0 per cent in the plane of Fig. 9, 0.015 per cent in the worst
    plane of Fig. 10 and 0.02 per cent in [-5, 5]^4, with the tapping cantilever of two modes (see `examples/configs`)
    at the default tolerance, against the event-driven flow at tolerance 1e-11, followed until it is within 1e-6 of an
    attractor (``benchmarks/basin_accuracy.py``). Motions that are chaotic for long have more:
    `Basins.label_error` measures it, and a store has it as ``label_error``, of a hundredth of its cells, and of some
    by the event-driven flow. Besides, at most `measured_error` of any one trapping region belongs elsewhere, by the
    samples from which it was made. A store's metadata has these numbers as ``accuracy`` and ``attractors``, and
    in ``attractors.notes`` how each region was made, and what proves it or how many samples it rests on.

    Whatever ends a run, a store stays readable: a unit is written aside and then renamed. Units that were cut off all
    the same are found by their checksums, and computed again. `docs/basins.md` is a guide.

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
    _check_options(system, client, progress, engine=engine, preview=preview)
    settings = Labelling(
        system, system.resolve(parameters), Traps(len(system.states)), checked_interval(interval),
        checks.between("tolerance", tolerance, 1e-14, 1e-2),
        0 if longest is None else checks.count("longest", longest, 1), checked_engine(engine), bool(preview),
    )  # fmt: skip
    cells, place = _grid(system, grid), _path(path)
    if place is None and cells.size > _IN_MEMORY:
        raise InputError("path", None, f"given for a grid of more than {_IN_MEMORY:.0e} cells", f"it has {cells.size}")
    with ExitStack() as stack:
        if engine == "dask":
            from saltus.basins.map.cluster import labelled_by, scheduler

            cluster = stack.enter_context(scheduler(client))
        kept = Store.open(place, writable=True) if place is not None and place.exists() else None
        found, search = attractors_for(settings, cells, attractors, kept)
        labelling, reason = with_traps(settings, found, cells)
        inputs = {
            **labelling.definition(), "longest_reason": reason, "labels": dict(found.labels),
            "saltus_version": version("saltus"), **search,
        }  # fmt: skip
        if kept is not None:
            inputs = _same_inputs(kept, cells, inputs)
        else:
            _check_attractors(labelling, found)
            if place is not None:
                kept = Store.create(place, cells, attributes_of(inputs, cells, found), attractors_bytes(found))
        run = _Run(cells, kept, progress, labelling)
        if engine == "dask":
            return run.through(labelled_by(cluster, cells, inputs, place, run.units), found, inputs)
        return run.through(labelling.units(cells, run.units), found, inputs)


class _Run:
    """Units of a grid on their way into a store or an array."""

    def __init__(self, grid: Grid, store: Store | None, progress: Progress | None, labelling: Labelling) -> None:
        self.grid, self.store, self.progress, self.labelling = grid, store, progress, labelling
        self.undecided: list[NDArray[np.int64]] = []
        self.array = np.full(grid.shape if store is None else 0, NOT_DONE, np.uint8)
        self.units = list(grid.units()) if store is None else store.missing()
        self.done = self.kept = grid.size - sum(map(_count, self.units))
        self.followed, self.started = 0, monotonic()

    @property
    def rate(self) -> float:
        """Motions followed a second."""
        return self.followed / max(monotonic() - self.started, 1e-9)

    @property
    def left(self) -> float:
        """Seconds that the other cells take, at the pace of those done in this run."""
        return (monotonic() - self.started) * (self.grid.size - self.done) / (self.done - self.kept)

    def through(self, labelled: Any, attractors: Any, inputs: Mapping[str, Any]) -> Basins:
        """Keep all units as they come, and return the basins."""
        interrupted = False
        try:
            with closing(labelled):
                for cells, labels, followed in labelled:
                    self.keep(cells, labels, followed)
        except KeyboardInterrupt:
            interrupted = True
        if self.store is None:
            said = told(self.done, self.grid.size, interrupted=interrupted)
            return Basins(self.array, self.grid, attractors, inputs, said, None, self.rate, self.why_undecided())
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
        """Follow some cells of a whole store again, if that has not been done, and note how many labels were wrong."""
        if "label_error" not in store.attributes:
            some = min(self.grid.size, max(self.grid.size // _CHECKED, _FEWEST), _MOST)
            store.note(label_error=asdict(Basins.of_store(store, attractors).label_error(some, by_events=_BY_EVENTS)))

    def why_undecided(self) -> str:
        """Say why cells of this run are undecided, from some of them; nothing where none is."""
        if not self.undecided:
            return ""
        found = np.concatenate(self.undecided)
        return self.labelling.undecided(self.grid.at(found[:: -(-len(found) // _ASKED)]))

    def keep(self, cells: tuple[slice, ...], labels: NDArray[np.uint8] | None, followed: int) -> None:
        """Keep a unit, unless the one who labelled it did, and tell."""
        if labels is not None and self.store is not None:
            self.store.write(cells, labels)
        elif labels is not None:
            self.array[cells] = labels
        elif self.store is not None:
            labels = np.asarray(self.store.labels[cells])
        if labels is not None and len(at := np.argwhere(labels == UNDECIDED)):
            self.undecided.append(at[:: -(-len(at) // _ASKED)] + [part.start for part in cells])
        self.done += _count(cells)
        self.followed += followed
        if self.progress is not None:
            self.progress(self.done, self.grid.size, self.rate, self.left)


def _count(cells: Sequence[slice]) -> int:
    return math.prod(part.stop - part.start for part in cells)


def _check_options(system: object, client: object, progress: object, *, engine: str, preview: object) -> None:
    """Raise `InputError` where an argument is of another kind, or does not belong to the engine."""
    checks.instance("system", system, HybridSystem)
    checked_engine(engine)
    if (client is not None) != (engine == "dask"):
        raise InputError("client", client, "given for engine='dask', and for no other")
    checks.function("progress", progress, "of two counts, a rate and a time")
    checks.flag("preview", preview)


def _path(path: object) -> Path | None:
    return None if path is None else checks.path("path", path, "the path of a folder")


def _grid(system: HybridSystem, grid: Any) -> Grid:
    if isinstance(grid, Mapping) and system.phase is not None and system.phase[0] in grid:
        raise InputError("grid", system.phase[0], "a state other than the phase", "all motions start at phase 0")
    if isinstance(grid, Grid):
        if grid.states != system.states:
            raise InputError("grid's states", grid.states, f"those of the system: {', '.join(system.states)}")
        return grid
    return Grid(system.states, grid)


def attractors_for(
    settings: Labelling, grid: Grid, given: Any, kept: Store | None = None
) -> tuple[Any, dict[str, Any]]:
    """Return the attractors that are given, that a store has, or that are found; and how they are looked for.

    Parameters
    ----------
    settings : Labelling
        What labels the cells, still without trapping regions.
    grid : Grid
        In whose box attractors are looked for.
    given : Attractors, mapping or None
        As `map_basins` takes it.
    kept : Store, optional
        Which has attractors.

    Returns
    -------
    attractors : Attractors
    search : dict
        All options of the search as plain data, as ``search``; nothing where it is not asked how they are found.

    Raises
    ------
    InputError
        They are no attractors, no such options, or the engine cannot run here.
    """
    asked = isinstance(given, Mapping) or (given is None and kept is None)
    options = _search(grid, given or {}) if asked else {}
    found = given
    if kept is not None and (given is None or asked):
        found = outcomes_from(kept.attractors, kept.attributes["attractors"])
    elif asked:
        settings.check_engine()
        tell = (given or {}).get("progress")
        found = find_attractors(
            settings.system, settings.parameters, interval=settings.interval, progress=tell, **options
        )
    if not isinstance(getattr(found, "traps", None), Traps):
        kind, hint = type(found).__name__, "attractors_from makes one of known orbits"
        raise InputError("attractors", kind, "an Attractors, as find_attractors returns", hint)
    if settings.interval not in (None, found.interval):
        raise InputError("interval", settings.interval, f"that of the attractors, {found.interval!r}", "leave it out")
    return found, {"search": json.loads(json.dumps(options, default=_plain))} if asked else {}


def with_traps(settings: Labelling, found: Any, grid: Grid) -> tuple[Labelling, str]:
    """Return what labels the cells of a grid by the traps of attractors, and why it follows motions for so long."""
    given = Patience(settings.longest, "as given")
    patience = given if settings.longest else patience_for(found, grid.box)
    scale = units_of(getattr(found, "scale", None))
    settled = replace(settings, traps=found.traps, interval=found.interval, longest=patience.periods, scale=scale)
    return settled, patience.reason


def _search(grid: Grid, given: Mapping[str, Any]) -> dict[str, Any]:
    """Return the options of a search for attractors: those given, and what the others are by default."""
    region = {name: low if low == high else (low, high) for name, (low, high) in grid.box.items()}
    usual = {"region": region, "seeds": _SEEDS, "search": Search(), "motions": grid.size}
    for name in given:
        if name not in usual and name != "progress":
            hint = nearest(name, usual) or "attractors_from makes attractors of orbits by name"
            raise InputError("attractors", name, f"options among {', '.join(usual)}", hint)
    return usual | {name: value for name, value in given.items() if name != "progress"}


def _plain(value: Any) -> Any:
    return asdict(value) if is_dataclass(value) and not isinstance(value, type) else float(value)


def _same_inputs(kept: Store, grid: Grid, inputs: Mapping[str, Any]) -> dict[str, Any]:
    """Return a store's inputs; `InputError` where others are asked for, in which `search` may be missing."""
    its = dict(kept.attributes["inputs"])
    inputs = {key: value for key, value in inputs.items() if key != "longest_reason"}
    there = {key: value for key, value in its.items() if key not in _TOLD or key in inputs}
    check_same(kept.path, {"grid": grid.definition(), **inputs}, {"grid": kept.grid.definition(), **there})
    if kept.attributes.get("stopped"):
        kept.note(stopped="")
    return its


def _check_attractors(labelling: Labelling, attractors: Any) -> None:
    """Raise `InputError` where attractors belong to something else, or one of them is none."""
    if attractors.system != labelling.system:
        raise InputError("attractors", attractors.system.name, f"of this system, {labelling.system.name!r}")
    theirs = attractors.system.resolve(attractors.parameters)
    for name, value in labelling.parameters.items():
        if theirs[name] != value:
            raise InputError("attractors", f"{name} = {theirs[name]!r}", f"of these parameters: {name} = {value!r}")
    for name in attractors.names:
        points, label = np.atleast_2d(attractors.points[name]), attractors.labels[name]
        ends = labelling.of(points[:: max(len(points) // _SHOWN, 1)])
        if (wrong := ends[(ends != label) & (ends != UNDECIDED)]).size:
            told = {value: key for key, value in attractors.labels.items()}
            raise InputError("attractor", name, "one", f"a motion that starts on it ends as {told[int(wrong[0])]!r}")
