"""Labelling of motions by the flow, the attractors' trapping regions, and settings."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cached_property, singledispatch
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from saltus import checks
from saltus.basins.attractors.closed_sides import ClosedSides
from saltus.basins.attractors.found import SAME
from saltus.basins.attractors.trap_files import check_traps, traps_as_data, traps_from_data
from saltus.basins.map.patience import LEAST_NEARER, NEARER, patience_again
from saltus.ensemble.ensemble import limit_at
from saltus.ensemble.traps import DIVERGED, UNDECIDED, Ellipsoids, Traps
from saltus.errors import InputError
from saltus.flow.starting import defined_modes
from saltus.system import HybridSystem, Map
from saltus.system.maps import flowing
from saltus.system.plain import all_parameters, system_from
from saltus.work import starting

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from saltus.basins.map.grid import Grid

    _Labelled: TypeAlias = tuple[tuple[slice, ...], NDArray[np.uint8], int]

__all__ = ["TOLERANCE", "Labelling", "checked_engine", "units_of"]

TOLERANCE = 3e-9  # default tolerance of a step in the first period, in the unit nearest to a state's size

_STRIDE = 4  # cells between neighbours of a preview's first lattice, along each coordinate

_BATCH = {"cpu": 1, "cuda": 2**22}  # cells that an engine is handed at once, unless a unit has more

_FOLLOWERS = {"cpu": 2, "cuda": 1}  # batches computed at once: threads that one leaves idle serve the next

_AHEAD = 1  # batches that wait while others are computed


@dataclass(frozen=True, eq=False)
class Labelling:
    """System, trapping regions and settings that give a motion its label."""

    system: HybridSystem | Map
    parameters: Mapping[str, float]  # all parameters
    traps: Traps  # trapping regions
    interval: float | None  # time between two strobes of a system without a phase
    tolerance: float  # tolerance of a step
    longest: int  # periods after which a motion is undecided
    engine: str = "cpu"  # {"cpu", "cuda"}: engine that follows the motions
    preview: bool = False  # whether only cells next to cells of another label are refined
    threads: int | None = None  # threads that compute; by default one for each processor
    scale: tuple[float, ...] | None = None  # unit of each state for errors, 1 by default

    def definition(self) -> dict[str, Any]:
        """Return all inputs of a label as plain data, from which `from_definition` makes an equal labelling."""
        return {
            "system": self.system.definition(),
            "parameters": dict(self.parameters),
            "tolerance": self.tolerance,
            "longest": self.longest,
            "interval": self.interval,
            "engine": self.engine,
            "preview": self.preview,
            "scale": None if self.scale is None else list(self.scale),
            "traps": traps_as_data(self.traps),
        }

    @classmethod
    def from_definition(cls, definition: Mapping[str, Any], threads: int | None = None) -> Labelling:
        """Return the labelling that `definition` describes; raise `InputError` where it describes none."""
        wanted = ("system", "parameters", "traps", "tolerance", "longest", "interval", "engine", "preview")
        if not isinstance(definition, Mapping) or not set(wanted) <= set(definition):
            raise InputError("inputs", definition, f"a mapping of {', '.join(wanted)}")
        system, given = system_from(definition["system"]), definition["parameters"]
        if not isinstance(given, Mapping):
            raise InputError("inputs' parameters", given, "a mapping")
        traps = traps_from_data(definition["traps"])
        check_traps(traps, system, range(DIVERGED))
        for name in ("tolerance", "interval"):
            value = definition[name]
            if not (checks.is_real(value) and 0.0 < value < math.inf) and (name, value) != ("interval", None):
                raise InputError(f"inputs' {name}", value, "a finite number > 0")
        scale = definition.get("scale")  # earlier files lack it
        if scale is not None:
            scale = tuple(
                checks.positive("inputs' scale", size) for size in checks.listed("inputs' scale", scale, "sizes")
            )
            if len(scale) != len(system.states):
                raise InputError("inputs' scale", scale, f"a size for each of {', '.join(system.states)}")
        if not isinstance(definition["preview"], bool):
            raise InputError("inputs' preview", definition["preview"], "True or False")
        return cls(
            system, all_parameters(given, system), traps, definition["interval"], float(definition["tolerance"]),
            checks.count("inputs' longest", definition["longest"], 1), checked_engine(definition["engine"]),
            definition["preview"], threads, scale,
        )  # fmt: skip

    @cached_property
    def ensemble(self) -> Any:
        """The engine that follows motions."""
        return _ensemble(self.system, self)

    def check_engine(self) -> None:
        """Raise `InputError` where the engine cannot run here."""
        if self.engine == "cuda":
            _ = self.ensemble  # looks for a device

    def of(self, points: ArrayLike) -> NDArray[np.uint8]:
        """Return the labels, shape (m,), of motions that start at points, shape (m, n)."""
        labels, _ = self.ensemble.settle(points, self.traps, self.longest)
        return np.asarray(labels, dtype=np.uint8)

    def from_each_mode(self, point: NDArray[np.float64]) -> list[int]:
        """Return the labels of the motions that start at a point, shape (n,), one for each mode defined there."""
        return _from_each_mode(self.system, self, point)

    def stricter(
        self, tolerance: float, points: Mapping[int, ArrayLike], decays: Mapping[int, float] = MappingProxyType({})
    ) -> Labelling:
        """Return a labelling on the processor by regions next to the attractors, where nothing else can be missed.

        The boxes of attractors that are no periodic orbits stay as they are.

        Parameters
        ----------
        tolerance : float
            Of a step.
        points : mapping of int to array_like, shape (k, n)
            Points of the attractors, by label.
        decays : mapping of int to float, optional
            Factor by which distances from an attractor shrink in a period, by label, where it is known.
        """
        longest = patience_again(self.longest, decays.values())
        return replace(
            self, tolerance=tolerance, longest=longest, traps=_nearer(self.traps, points, self.scale),
            engine="cpu", preview=False,
        )  # fmt: skip

    def by_events(self, points: NDArray[np.float64]) -> NDArray[np.uint8]:
        """Return the labels, shape (m,), of motions followed one by one; a flow, from event to event at 1e-11."""
        found = (self.ensemble.alone(x, self.traps, self.longest) for x in points)
        return np.fromiter(found, np.uint8, len(points))

    def undecided(self, points: NDArray[np.float64]) -> str:
        """Return why motions from points, shape (m, n), end in no trapping region, in words."""
        ensemble = replace(self, engine="cpu").ensemble
        labels, states, modes = ensemble.arrivals(points, self.traps, self.longest)
        lost = (labels == UNDECIDED) & ~np.isfinite(states).all(axis=1)
        barred = [not ensemble.admits(x) for x in points[lost]]
        late = (labels == UNDECIDED) & ~lost
        beyond = _beyond(self.system, self, points[late], states[late], modes[late])
        reasons = {
            f"reach no trapping region within {self.longest} periods": int(late.sum()) - beyond,
            "stay beyond an event of their mode": beyond,
            "start outside the domains of all modes": sum(barred),
            "meet events that accumulate": len(barred) - sum(barred),
        }
        told = ", ".join(f"{count} {reason}" for reason, count in reasons.items() if count)
        return f"of {len(points)} followed again {told}" if told else ""

    def units(
        self, grid: Grid, units: Sequence[tuple[slice, ...]]
    ) -> Iterator[tuple[tuple[slice, ...], NDArray[np.uint8], int]]:
        """Go through units of a grid: cells, labels, and count of motions followed."""
        followers = _FOLLOWERS[self.engine]
        with (
            starting(),
            ThreadPoolExecutor(1) as maker,
            ThreadPoolExecutor(followers) as follower,  # ahead of who takes the labels
        ):
            under_way: deque[Future[list[_Labelled]]] = deque()
            try:
                for batch in _batches(units, 1 if self.preview else _BATCH[self.engine]):
                    if self.preview:
                        under_way.append(follower.submit(self._previewed, grid, batch))
                    else:
                        points = maker.submit(_points, grid, batch)
                        under_way.append(follower.submit(self._followed, batch, points))
                    if len(under_way) >= followers + _AHEAD:
                        yield from under_way.popleft().result()
                while under_way:
                    yield from under_way.popleft().result()
            finally:
                maker.shutdown(wait=False, cancel_futures=True)
                follower.shutdown(wait=False, cancel_futures=True)

    def _followed(self, batch: Sequence[tuple[slice, ...]], points: Future[NDArray[np.float64]]) -> list[_Labelled]:
        """Label all cells of units."""
        labels, first, parted = self.of(points.result()), 0, []
        for cells in batch:
            shape = _shape(cells)
            count = math.prod(shape)
            parted.append((cells, labels[first : first + count].reshape(shape), count))
            first += count
        return parted

    def _previewed(self, grid: Grid, batch: Sequence[tuple[slice, ...]]) -> list[_Labelled]:
        return [(cells, *self._refined(grid, cells)) for cells in batch]

    def _refined(self, grid: Grid, cells: tuple[slice, ...]) -> tuple[NDArray[np.uint8], int]:
        """Label a lattice of cells; then repeat with half the stride, only where neighbours differ."""
        from scipy.ndimage import binary_dilation

        counts, starts = _shape(cells), [part.start for part in cells]
        lattice = [_lattice(count, _STRIDE) for count in counts]
        chosen = [start + indices for start, indices in zip(starts, lattice, strict=True)]
        labels = self.of(grid.points(chosen)).reshape([len(indices) for indices in lattice])
        followed, stride = labels.size, _STRIDE
        while stride > 1:
            stride //= 2
            finer = [_lattice(count, stride) for count in counts]
            least, greatest = labels, labels
            for axis, (coarse, fine) in enumerate(zip(lattice, finer, strict=True)):
                below = np.searchsorted(coarse, fine, "right") - 1
                above = np.searchsorted(coarse, fine, "left")
                least = np.minimum(least.take(below, axis), least.take(above, axis))
                greatest = np.maximum(greatest.take(below, axis), greatest.take(above, axis))
            wanted = binary_dilation(least != greatest, np.ones((3,) * len(counts), dtype=bool))
            wanted[np.ix_(*(np.isin(fine, coarse) for fine, coarse in zip(finer, lattice, strict=True)))] = False
            lattice, labels = finer, least
            places = np.argwhere(wanted)
            if len(places):
                at = np.stack([s + f[places[:, k]] for k, (s, f) in enumerate(zip(starts, finer, strict=True))], axis=1)
                labels[tuple(places.T)] = self.of(grid.at(at))
                followed += len(places)
        return labels, followed


@singledispatch
def _ensemble(system: HybridSystem | Map, labelling: Labelling) -> Any:
    options: dict[str, Any] = {
        "tolerance": labelling.tolerance, "interval": labelling.interval, "scale": labelling.scale,
        "limit": _within(labelling),
    }  # fmt: skip
    if labelling.engine == "cuda":
        from saltus.ensemble.cuda import CudaEnsemble

        return CudaEnsemble(flowing(system), labelling.parameters, **options)
    from saltus.ensemble.ensemble import Ensemble

    return Ensemble(flowing(system), labelling.parameters, threads=labelling.threads, **options)


def _within(labelling: Labelling) -> float:
    """Return the size of a state that an engine calls diverged, even between strobes; the traps' is never above it."""
    system = labelling.system
    scale = np.ones(len(system.states)) if labelling.scale is None else np.array(labelling.scale)
    usual = limit_at(system, system.parameter_vector(labelling.parameters), scale, None)
    return usual if labelling.traps.limit == math.inf else max(usual, labelling.traps.limit)


@_ensemble.register(Map)
def _ensemble_of_map(system: Map, labelling: Labelling) -> Any:
    from saltus.ensemble.map_ensemble import MapEnsemble

    if labelling.engine != "cpu":
        raise InputError("BasinOptions.engine", labelling.engine, "'cpu' or 'dask' for a map")
    return MapEnsemble(
        system, labelling.parameters, scale=labelling.scale, limit=_within(labelling), threads=labelling.threads
    )


@singledispatch
def _beyond(
    system: HybridSystem | Map,
    labelling: Labelling,
    starts: NDArray[np.float64],
    x: NDArray[np.float64],
    modes: NDArray[np.int64],
) -> int:
    """Return how many motions end, in states x, shape (m, n), beyond an event to whose other side no motion comes."""
    if not len(x):
        return 0
    system, low, high = flowing(system), x.min(axis=0), x.max(axis=0)
    sizes = np.ones(x.shape[1]) if labelling.scale is None else np.array(labelling.scale)
    sides = ClosedSides(system, system.parameter_vector(labelling.parameters), low, high, sizes)
    sides.watch(starts, x, modes)
    return sum(sides.hold(row, system.mode_names[mode]) for row, mode in zip(x, modes.tolist(), strict=True))


@_beyond.register(Map)
def _of_no_events(
    system: Map,
    labelling: Labelling,
    starts: NDArray[np.float64],
    x: NDArray[np.float64],
    modes: NDArray[np.int64],
) -> int:
    return 0


@singledispatch
def _from_each_mode(system: HybridSystem | Map, labelling: Labelling, point: NDArray[np.float64]) -> list[int]:
    system = flowing(system)
    modes = list(defined_modes(system, system.full_state(point), system.parameter_vector(labelling.parameters)))
    points = np.broadcast_to(point, (len(modes), point.size))
    labels: NDArray[np.uint8] = labelling.ensemble.settle(points, labelling.traps, labelling.longest, modes)[0]
    return [int(label) for label in labels]


@_from_each_mode.register(Map)
def _of_a_map(system: Map, labelling: Labelling, point: NDArray[np.float64]) -> list[int]:
    return [int(label) for label in labelling.of(point[None])]


def units_of(sizes: Sequence[float] | None) -> tuple[float, ...] | None:
    """Return the unit nearest to each state's size, a power of 1000; it is 1 for sizes from 0.032 to 32."""
    return None if sizes is None else tuple(1000.0 ** round(math.log10(size) / 3.0) for size in sizes)


def _lattice(count: int, stride: int) -> NDArray[np.int64]:
    """Return every `stride`-th index, and the last."""
    return np.unique(np.append(np.arange(0, count, stride), count - 1))


def _shape(cells: Sequence[slice]) -> tuple[int, ...]:
    return tuple(part.stop - part.start for part in cells)


def _nearer(traps: Traps, points: Mapping[int, ArrayLike], scale: Sequence[float] | None) -> Traps:
    """Return ellipsoids about the attractors' points, smaller than their ellipsoids and cages: next to rounding."""
    if traps.ellipsoids is None and traps.cages is None:
        return traps
    parts = [] if traps.ellipsoids is None else [traps.ellipsoids]
    if (c := traps.cages) is not None:
        for rows, bound, label, mode in zip(c.rows, c.bounds, c.labels, c.modes, strict=True):
            own = np.atleast_2d(points[int(label)])
            shape = np.linalg.qr(np.concatenate([rows.real, rows.imag]))[1]  # |rows x| = |shape x|
            shapes = np.broadcast_to(shape / bound, (len(own), *shape.shape))
            modes = np.full(len(own), mode)
            parts.append(Ellipsoids(own, shapes, np.full(len(own), label, np.uint8), modes=modes))
    joined = Ellipsoids.joined(parts)
    units = np.ones(traps.n) if scale is None else np.array(scale)
    half_widths = 1.0 / np.linalg.norm(joined.shapes * units, 2, axis=(1, 2))
    return replace(traps, cages=None, ellipsoids=joined.smaller(np.clip(half_widths / SAME, LEAST_NEARER, NEARER)))


def _points(grid: Grid, batch: Sequence[tuple[slice, ...]]) -> NDArray[np.float64]:
    return np.concatenate([grid.points(cells) for cells in batch])


def _batches(units: Sequence[tuple[slice, ...]], most: int) -> Iterator[list[tuple[slice, ...]]]:
    batch: list[tuple[slice, ...]] = []
    held = 0
    for cells in units:
        count = math.prod(_shape(cells))
        if batch and held + count > most:
            yield batch
            batch, held = [], 0
        batch.append(cells)
        held += count
    if batch:
        yield batch


def checked_engine(engine: object) -> str:
    """Return an engine's arithmetic, ``cpu`` or ``cuda``; raise `InputError` for an unknown engine."""
    return "cuda" if checks.chosen("engine", engine, ("cpu", "cuda", "dask")) == "cuda" else "cpu"
