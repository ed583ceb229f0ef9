"""Many motions of one system at once."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.ensemble.fallback import Effort, follow_alone
from saltus.ensemble.labels import DIVERGED, LEFT_OVER, NOT_DONE, Boxes, Found, Motions, Regions, Settings
from saltus.ensemble.modal import LinearPart, linear_parts
from saltus.ensemble.traps import Traps
from saltus.errors import InputError
from saltus.flow.event_logs import events_after
from saltus.flow.shares import limit_of
from saltus.flow.starting import allowed_modes, phase_rate, starting_mode
from saltus.flow.transition_rows import jumps_at_phase_zero
from saltus.flow.variational import Average, Growth, growth_along
from saltus.system.angles import wrapped
from saltus.system.own_states import absent_states
from saltus.work import processors, starting

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from saltus.ensemble.compiled import CompiledLanes
    from saltus.system.hybrid import HybridSystem
    from saltus.system.maps import Map

__all__ = ["Ensemble", "boxes_of", "checked_points", "follow_pieces", "limit_at", "part_of", "regions_of"]

_ORDER = 10  # last coefficient of the Taylor series
_GROWTH = 4.5  # growth of a motion's tolerance a period: a late error equals a smaller one at the start
_LARGEST_TOLERANCE = 1e-4  # tolerance, against `scale`, up to which it grows
_OF_A_TRAP = 1e-3  # largest tolerance, in units of the narrowest trap's half width
_ALIVE = 256  # motions that a thread has under way
_PIECE = 8000  # motions that a thread is given at once
_LONGEST_STEP = 0.25  # longest Taylor step, in periods
_BOUND = 1e8  # least size of a diverged state, in units of the largest scale or of 1, whichever is larger
_LEAST_TERM = 1e-30  # least size of a step's last terms, in tolerances, that lets a step be as long as it may


class Ensemble:
    """Many motions of one system at once, all from phase 0, looked at once a period.

    Motions are followed by Taylor steps of order 10, generated for the system and made for many motions side by side
    (see `saltus.ensemble.writer`); those that they cannot follow, by the event-driven flow.

    Parameters
    ----------
    system : HybridSystem
        The system.
    parameters : mapping of str to float, optional
        Parameters that differ from the system's defaults.
    tolerance : float, optional
        Tolerance of a step, against `scale`.
    interval : float, optional
        Time between two looks at a system without a phase.
    scale : array_like, shape (n,), optional
        Size of each state against which an error is measured; 1 by default.
    limit : float, optional
        Size beyond which a state that grows has diverged. By default 1e8 times the largest scale or 1, or a million
        times the largest size of the problem, as in `simulate`.
    threads : int, optional
        Threads that share the motions; by default one for each processor that this process may use.

    Attributes
    ----------
    limit, period : float
        Size of a diverged state, and the time between two looks.
    work : ndarray of int64
        Steps made so far in each pool of lanes.
    left_over : int
        Motions so far that lanes could not follow.
    periods, periods_alone : int
        Periods that motions have been followed so far; those of them by the event-driven flow.
    effort : Effort
        Steps of the event-driven flow of a system without a phase, and how many it may take.

    Raises
    ------
    InputError
        An `interval` where there is a phase, or none where there is not; a number out of its range.

    Examples
    --------
    >>> from saltus import HybridSystem, Mode
    >>> field = {"x": "v", "v": "x - x**3 - 0.15*v + 0.2*cos(s)"}
    >>> duffing = HybridSystem(("x", "v"), {"w": 1.0}, {"free": Mode(field)}, phase=("s", "w"))
    >>> ends, modes = Ensemble(duffing).strobe([[1.0, 0.0], [-1.0, 0.0]], count=3)
    >>> ends.round(4)
    array([[ 1.2597, -0.0341],
           [-0.7664, -0.0387]])
    """

    def __init__(
        self,
        system: HybridSystem,
        parameters: Mapping[str, float] | None = None,
        *,
        tolerance: float = 1e-8,
        interval: float | None = None,
        scale: ArrayLike | None = None,
        limit: float | None = None,
        threads: int | None = None,
    ) -> None:
        if (interval is None) == (system.phase is None):
            hint = "the time between two looks at a motion, about its period, as BasinOptions(interval=1.0)"
            allowed = "given for a system without a phase, and for no other"
            raise InputError("interval", interval, allowed, hint if interval is None else "")
        interval = None if interval is None else checks.positive("interval", interval)
        self.system, self.parameters = system, checks.mapping("parameters", parameters, "names to numbers, or None")
        self.p = system.parameter_vector(self.parameters)
        self.tolerance = checks.between("tolerance", tolerance, 1e-14, 1e-2)
        self.n = len(system.states)
        self.scale = np.ones(self.n) if scale is None else checks.array("scale", scale, finite=False)
        if self.scale.shape != (self.n,) or not ((self.scale > 0.0) & (self.scale < np.inf)).all():
            raise InputError("scale", scale, f"a finite number > 0 for each of {', '.join(system.states)}")
        self.limit = limit_at(self.system, self.p, self.scale, limit)
        self.threads = threads or processors()
        self.work = np.zeros(2 * len(system.modes), np.int64)
        self.left_over, self.periods, self.periods_alone, self.rate = 0, 0, 0, 0.0
        self.effort = Effort()
        if interval is None:
            self.rate = phase_rate(system, self.p, system.full_state(np.zeros(self.n)), 0)
        self.period = system.turn / self.rate if interval is None else interval

    def strobe(
        self, points: ArrayLike, modes: ArrayLike | None = None, count: int = 1
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return where motions are after some periods: the iterated Poincare map.

        Parameters
        ----------
        points : array_like, shape (m, n)
            States at phase 0, in the order of `system.states`.
        modes : array_like of int, shape (m,), optional
            Indices of the modes there; by default the first that a state allows.
        count : int, optional
            Periods.

        Returns
        -------
        points : ndarray, shape (m, n)
            NaN where a motion diverges, or may not start.
        modes : ndarray of int, shape (m,)

        Raises
        ------
        InputError
            Shapes that do not fit, or a count below 1.
        """
        x = self._points(points)
        starts = self._modes(modes, x)
        if count < 1:
            raise InputError("count", count, "at least 1")
        found = self._followed(x, starts, Traps(self.n, limit=self.limit), count, growth=False)
        found[2][found[0] == DIVERGED] = np.nan
        return found[2], found[3]

    def settle(
        self, points: ArrayLike, traps: Traps, longest: int = 200, modes: ArrayLike | None = None
    ) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
        """Return the label of the trap that each motion falls into, and after how many periods.

        The tolerance grows 4.5 times a period, up to 1e-4, unless motions must stay in the boxes of an attractor: an
        error late in a transient equals a smaller one at its start. Motions that have met no fate after 48 periods go
        on at the first tolerance. Where transients are chaotic for very long, labels near the boundary are less certain
        than elsewhere at any tolerance, and less so for this.

        Parameters
        ----------
        points : array_like, shape (m, n)
            States at phase 0, in the order of `system.states`.
        longest : int, optional
            Periods after which a motion is undecided.
        modes : array_like of int, shape (m,), optional
            Indices of the modes at the start; by default the first that a state allows.

        Returns
        -------
        labels : ndarray of uint8, shape (m,)
        periods : ndarray of int32, shape (m,)

        Raises
        ------
        InputError
            Points of another shape.
        """
        return self._settled(points, traps, longest, modes)[:2]

    def arrivals(
        self, points: ArrayLike, traps: Traps, longest: int = 200
    ) -> tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.int64]]:
        """Return the label of the trap that each motion falls into, and where the motion is then.

        Parameters
        ----------
        points, traps, longest
            As in `settle`.

        Returns
        -------
        labels : ndarray of uint8, shape (m,)
        states : ndarray, shape (m, n)
            The first states at phase 0 in a trap.
        modes : ndarray of int, shape (m,)
            Their modes.

        Raises
        ------
        InputError
            Points of another shape.
        """
        labels, _, ends, modes = self._settled(points, traps, longest)
        return labels, ends, modes

    def admits(self, x: NDArray[np.float64]) -> bool:
        """Return whether a motion can start from a state: in a mode's domain, and before its events."""
        try:
            self.starting_mode(x)
        except InputError:
            return False
        return True

    def allowing(self, points: NDArray[np.float64], modes: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return from which points, shape (m, n), a motion may start in a mode; any may where the mode is negative."""
        found = np.ones(len(points), np.bool_)
        for i in np.flatnonzero(modes >= 0):
            found[i] = modes[i] in allowed_modes(self.system, self.system.full_state(points[i]), self.p)
        return found

    def starting_mode(self, x: NDArray[np.float64]) -> int:
        """Return the index of the mode in which a motion starts from a state; raise `InputError` without one."""
        return starting_mode(self.system, self.system.full_state(x), self.p)

    def lacked(self, points: NDArray[np.float64], modes: NDArray[np.int64] | None = None) -> NDArray[np.bool_]:
        """Return whether the mode in which a motion starts lacks each state, shape (m, n), as `points` has."""
        found = np.zeros(points.shape, np.bool_)
        for i, x in enumerate(points):
            found[i, absent_states(self.system, self.starting_mode(x) if modes is None else int(modes[i]))] = True
        return found

    def growth(self, x: NDArray[np.float64], mode: int, periods: int, discard: int | None) -> Growth:
        """Return how perturbations grow along a motion, over periods of the phase or intervals between strobes."""
        full = self.system.full_state(x)
        if self.system.phase is not None:
            return growth_along(self.system, self.p, full, mode, average=Average(periods=periods, discard=discard))
        wait = None if discard is None else discard * self.period
        return growth_along(self.system, self.p, full, mode, average=Average(t_end=periods * self.period, discard=wait))

    def visited(self, x: NDArray[np.float64], mode: int, periods: int) -> tuple[frozenset[int], bool]:
        """Return the modes that a motion visits within some periods, and whether it meets an event."""
        if self.system.phase is not None:
            log = events_after(self.system, self.p, x, mode, periods=periods)
        else:
            log = events_after(self.system, self.p, x, mode, t_end=periods * self.period)
        modes = {mode, *log.mode_before.tolist(), *log.mode_after.tolist()}
        return frozenset(modes), bool(np.any(log.transition >= 0))

    def alone(self, x: NDArray[np.float64], traps: Traps, longest: int) -> int:
        """Return the label of one motion, followed by the event-driven flow at tolerance 1e-11."""
        return follow_alone(self.system, self.parameters, x, -1, traps, longest, self.period, self.effort)[0]

    def _settled(
        self, points: ArrayLike, traps: Traps, longest: int, modes: ArrayLike | None = None
    ) -> tuple[NDArray[np.uint8], NDArray[np.int32], NDArray[np.float64], NDArray[np.int64]]:
        x = self._points(points)
        return self._followed(x, self._modes(modes, x), traps, longest, growth=traps.cells is None)

    def _modes(self, modes: ArrayLike | None, x: NDArray[np.float64]) -> NDArray[np.int64]:
        starts = np.full(len(x), -1, np.int64) if modes is None else np.array(modes, dtype=np.int64)
        if starts.shape != (len(x),):
            raise InputError("modes", starts.shape, f"as many as points, {len(x)}")
        return starts

    def _points(self, points: ArrayLike) -> NDArray[np.float64]:
        return wrapped(checked_points(points, self.system.states), self.system.angle_places)

    def _followed(
        self, x: NDArray[np.float64], modes: NDArray[np.int64], traps: Traps, longest: int, *, growth: bool
    ) -> tuple[NDArray[np.uint8], NDArray[np.int32], NDArray[np.float64], NDArray[np.int64]]:
        m = len(x)
        labels, strobes = np.full(m, NOT_DONE, np.uint8), np.zeros(m, np.int32)
        ends, end_modes = np.full((m, self.n), np.nan), np.zeros(m, np.int64)
        if self._lanes is None:
            labels[:] = LEFT_OVER
        else:
            itol, visits = 1.0 / self.tolerance, 1 if traps.cells is None else traps.cells.visits
            settings = Settings(
                itol, 1.0 / _GROWTH if growth else 1.0, min(1.0 / _largest_tolerance(traps), itol),
                float(traps.limit), longest, visits,
            )  # fmt: skip
            regions, boxes = regions_of(traps, self.n, self.system.angle_places), boxes_of(traps, self.n)
            self._run(Motions(x, modes), regions, boxes, settings, Found(labels, strobes, ends, end_modes))
        alone = np.flatnonzero(labels == LEFT_OVER)
        self.left_over += len(alone)
        for i in alone:
            labels[i], strobes[i], ends[i], end_modes[i] = follow_alone(
                self.system, self.parameters, x[i], int(modes[i]), traps, longest, self.period, self.effort
            )
        self.periods += int(strobes.sum())
        self.periods_alone += int(strobes[alone].sum())
        return labels, strobes, ends, end_modes

    def _run(self, motions: Motions, regions: Regions, boxes: Boxes, settings: Settings, found: Found) -> None:
        """Follow motions by lanes; `found` is written."""
        from saltus.ensemble.kernels.life import run  # with Numba, which takes its time

        compiled, count = self._lanes, len(motions.points)
        assert compiled is not None
        lanes = compiled.with_numbers(self._constants, self._quantities)
        piece = min(_PIECE, max(-(-count // self.threads), _ALIVE))

        def follow(start: int, end: int) -> NDArray[np.int64]:
            work = np.zeros_like(self.work)
            run(
                lanes, part_of(motions, start, end), regions, boxes, settings, part_of(found, start, end), _ALIVE, work,
                compiled.scratch(piece),
            )  # fmt: skip
            return work

        for work in follow_pieces(follow, count, piece, self.threads):
            self.work += work

    @cached_property
    def _linear(self) -> dict[int, LinearPart]:
        if self.system.angles:
            return {}  # a whole turn is not taken away from amplitudes
        return linear_parts(self.system, self.p, self.rate, self.period)

    @cached_property
    def _lanes(self) -> CompiledLanes | None:
        from saltus.ensemble.compiled import load_lanes

        if jumps_at_phase_zero(self.system, self.p):
            return None  # lanes cannot tell on which side of such a jump they are
        return load_lanes(self.system, _ORDER, {mode: part.pairs for mode, part in self._linear.items()})

    @cached_property
    def _constants(self) -> NDArray[np.float64]:
        assert self._lanes is not None
        return self._lanes.constants(self.p)

    @cached_property
    def _quantities(self) -> NDArray[np.float64]:
        assert self._lanes is not None
        longest = _LONGEST_STEP * self.period
        values = {"rate": self.rate, "period": self.period, "longest": longest, "limit": self.limit}
        values |= {f"least{k}": max(_LEAST_TERM / longest**k, 1e-300) for k in range(_ORDER - 2, _ORDER + 1)}
        values |= {f"iscale{i}": 1.0 / size for i, size in enumerate(self.scale)}
        values |= {f"escale{k}": 1.0 / size for k, size in enumerate(self._event_sizes())}
        for mode, part in self._linear.items():
            values |= {f"far{mode}_{key}": value for key, value in part.numbers(1.0 / self.scale).items()}
        return np.array([values[name] for name in self._lanes.quantities])

    def _event_sizes(self) -> list[float]:
        """How much each event function changes over the states' scales, at a few states of their size."""
        compiled, n_all = self.system.compiled, len(self.system.all_states)
        extended, out, found = compiled.extended(self.p), np.empty(2 + 2 * n_all), []
        for k in range(len(self.system.transitions)):
            sizes = []
            for side in (-1.0, 0.0, 1.0):
                compiled.call("event_x", k, 0, self.system.full_state(side * self.scale), extended, out)
                sizes.append(float(np.abs(out[2 : 2 + self.n]) @ self.scale))
            finite = [size for size in sizes if 0.0 < size < math.inf]
            found.append(max(finite, default=1.0))
        return found


def limit_at(
    system: HybridSystem | Map, p: NDArray[np.float64], scale: NDArray[np.float64], limit: float | None
) -> float:
    """Return the size of a diverged state of motions of some scale, shape (n,); `limit` where it is given."""
    if limit is not None:
        return checks.positive("limit", limit)
    return limit_of(system.compiled, p, scale, _BOUND * max(1.0, float(scale.max())))


def _largest_tolerance(traps: Traps) -> float:
    """What a motion's tolerance may grow to: small against the narrowest ellipsoid too."""
    if traps.ellipsoids is None or not len(traps.ellipsoids.shapes):
        return _LARGEST_TOLERANCE
    return min(_LARGEST_TOLERANCE, _OF_A_TRAP * traps.ellipsoids.narrowest())


def checked_points(points: ArrayLike, states: Sequence[str]) -> NDArray[np.float64]:
    """Return starts of motions, shape (m, n), a copy; raise `InputError` for another shape."""
    x = checks.array("points", points, finite=False)
    if x.ndim != 2 or x.shape[1] != len(states):
        raise InputError("points", x.shape, f"of shape (m, {len(states)})", f"a row holds {', '.join(states)}")
    return x


def follow_pieces(follow: Callable[[int, int], Any], count: int, piece: int, threads: int) -> list[Any]:
    """Return what a function returns for pieces of motions, each given by its ends, by threads where there are several.

    Parameters
    ----------
    follow : callable
        Called with the first motion of a piece, and the one behind its last.
    count, piece, threads : int
        Motions, motions of a piece, and threads.
    """
    starts = range(0, count, piece)
    if len(starts) < 2 or threads < 2:
        return [follow(start, start + piece) for start in starts]
    pool = ThreadPoolExecutor(threads)
    try:
        with starting("threads=1"):
            return list(pool.map(follow, starts, (start + piece for start in starts)))
    finally:
        pool.shutdown(cancel_futures=True)


def part_of(record: Any, start: int, end: int) -> Any:
    """Return motions `start` to `end` of `Motions`, or what is `Found` of them, which may be written there."""
    return type(record)(*(array[start:end] for array in record))


def regions_of(traps: Traps, n: int, circles: NDArray[np.int64]) -> Regions:
    """Return trapping regions as kernels read them, and the places of the states on a circle."""
    labels = []
    cages = np.empty((0, 2 + n))
    if (c := traps.cages) is not None:
        rows = np.concatenate([c.floors[:, :, None], c.rows.real, c.rows.imag], axis=2)
        flat = rows.reshape(len(rows), -1)
        cages = np.concatenate([c.modes[:, None], c.bounds[:, None], c.centres, flat], axis=1)
        labels.append(c.labels)
    ellipsoids = np.empty((0, 1 + n + n * n))
    if (e := traps.ellipsoids) is not None:
        planes = np.concatenate([e.normals, e.offsets[:, :, None]], axis=2)
        parts = (e.modes, e.centres, e.shapes, planes)
        ellipsoids = np.concatenate([part.reshape(len(part), -1) for part in parts], axis=1, dtype=np.float64)
        labels.append(e.labels)
    return Regions(cages, ellipsoids, np.concatenate([np.empty(0, np.int64), *labels]).astype(np.int64), circles)


def boxes_of(traps: Traps, n: int) -> Boxes:
    """Return boxes as kernels read them."""
    if (cells := traps.cells) is None:
        return Boxes(np.zeros(n), np.ones(n), np.empty((0, n), np.int64), np.empty(0, np.int64))
    order = np.lexsort(cells.boxes.T[::-1])
    indices = np.ascontiguousarray(cells.boxes[order])
    return Boxes(cells.origin, cells.size, indices, cells.labels[order].astype(np.int64))
