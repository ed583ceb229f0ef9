"""Many motions of one map at once, with the interface of `saltus.ensemble.ensemble.Ensemble`."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus import checks
from saltus.ensemble.ensemble import boxes_of, checked_points, follow_pieces, limit_at, part_of, regions_of
from saltus.ensemble.fallback import Effort
from saltus.ensemble.labels import NOT_DONE, UNDECIDED, Boxes, Found, Motions, Settings
from saltus.ensemble.traps import Traps
from saltus.errors import InputError
from saltus.flow.variational import Average, Growth
from saltus.maps.code import MapCode, code_of
from saltus.maps.growth import growth_of_map
from saltus.maps.iterates import path_from
from saltus.system.angles import wrapped
from saltus.system.tiling import pieces_error
from saltus.work import processors

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from saltus.system.maps import Map

__all__ = ["MapEnsemble"]

_PIECE = 4096  # motions that a thread is given at once
_WORTH = 200_000  # iterations that a thread is given at once, at least, where all motions make as many
_LARGEST_TABLE = 2**22  # boxes between the outermost ones, beyond which they are looked up by bisection


class BoxTable(NamedTuple):
    """Labels of all boxes between the outermost ones, for a look-up in one step."""

    low: NDArray[np.int64]  # shape (n,): least index along each state
    shape: NDArray[np.int64]  # shape (n,): boxes along each state
    labels: NDArray[np.uint8]  # flat; empty where they would be too many


class MapEnsemble:
    """Many motions of one map at once; a period is an iteration.

    Parameters
    ----------
    system : Map
        The map.
    parameters : mapping of str to float, optional
        Parameters that differ from the map's defaults.
    scale : array_like, shape (n,), optional
        Size of each state; 1 by default.
    limit : float, optional
        Size beyond which a state has diverged; by default as in `Ensemble`.
    threads : int, optional
        Threads that share the motions; by default one for each processor that this process may use.

    Attributes
    ----------
    limit : float
        Size of a diverged state.
    period : float
        Time between two looks, 1.
    work : ndarray of int64
        Iterations made so far.
    left_over, periods_alone : int
        0: the loop follows all motions.
    effort : Effort
        Of none: the loop follows all motions.
    periods : int
        Iterations that motions have been followed so far.

    Examples
    --------
    >>> from saltus import Map
    >>> ends, _ = MapEnsemble(Map(("x",), {}, {"x": "x/2"})).strobe([[1.0], [4.0]], count=2)
    >>> ends.tolist()
    [[0.25], [1.0]]
    """

    tolerance = 0.0
    period = 1.0
    left_over = 0
    periods_alone = 0

    def __init__(
        self,
        system: Map,
        parameters: Mapping[str, float] | None = None,
        *,
        scale: ArrayLike | None = None,
        limit: float | None = None,
        threads: int | None = None,
    ) -> None:
        self.system, self.parameters = system, checks.mapping("parameters", parameters, "names to numbers, or None")
        self.p = system.parameter_vector(self.parameters)
        self.n = len(system.states)
        self.scale = np.ones(self.n) if scale is None else np.asarray(scale, dtype=np.float64)
        self.limit = limit_at(self.system, self.p, self.scale, limit)
        self.threads = threads or processors()
        self.work, self.effort = np.zeros(1, np.int64), Effort()
        self.periods = 0

    @cached_property
    def _code(self) -> MapCode:
        return code_of(self.system, self.p)

    def strobe(
        self, points: ArrayLike, modes: ArrayLike | None = None, count: int = 1
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Return where motions are after some iterations.

        Parameters
        ----------
        points : array_like, shape (m, n)
            States, in the order of `system.states`.
        modes : array_like, optional
            Not used: the state decides which piece holds.
        count : int, optional
            Iterations.

        Returns
        -------
        points : ndarray, shape (m, n)
            NaN where a motion diverges.
        modes : ndarray of int, shape (m,)
            0.

        Raises
        ------
        InputError
            Shapes that do not fit, or a count below 1.
        DefinitionError
            A state is met at which no piece holds, or several do.
        """
        from saltus.maps.kernels.steps import DONE, images  # with Numba, which takes its time

        if count < 1:
            raise InputError("count", count, "at least 1")
        x = np.array(self._points(points))

        def follow(start: int, end: int) -> None:
            at = np.empty((2, self.n))
            if images(x[start:end], at[0], at[1], self._code, self.limit, count)[0] != DONE:
                raise pieces_error(self.system, at[0], self.p)

        follow_pieces(follow, len(x), max(_PIECE, _WORTH // count), self.threads)
        self.work += count * len(x)
        self.periods += count * len(x)
        return x, np.zeros(len(x), np.int64)

    def settle(
        self, points: ArrayLike, traps: Traps, longest: int = 200, modes: ArrayLike | None = None
    ) -> tuple[NDArray[np.uint8], NDArray[np.int32]]:
        """Return the label of the trap that each motion falls into, and after how many iterations.

        Parameters
        ----------
        points, modes
            As in `strobe`.
        longest : int, optional
            Iterations after which a motion is undecided.

        Returns
        -------
        labels : ndarray of uint8, shape (m,)
        periods : ndarray of int32, shape (m,)

        Raises
        ------
        InputError, DefinitionError
            As `strobe`.
        """
        return self._followed(points, traps, longest)[:2]

    def arrivals(
        self, points: ArrayLike, traps: Traps, longest: int = 200
    ) -> tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.int64]]:
        """Return each motion's label, its first state in a trap, and 0 as its mode, as `Ensemble.arrivals` does."""
        labels, _, ends = self._followed(points, traps, longest)
        return labels, ends, np.zeros(len(ends), np.int64)

    def admits(self, x: NDArray[np.float64]) -> bool:
        """Return whether a motion can start from a state: from each."""
        return True

    def starting_mode(self, x: NDArray[np.float64]) -> int:
        """Return 0: the state decides which piece holds."""
        return 0

    def allowing(self, points: NDArray[np.float64], modes: NDArray[np.int64]) -> NDArray[np.bool_]:
        """Return True for each point: the state decides which piece holds."""
        return np.ones(len(points), np.bool_)

    def lacked(self, points: NDArray[np.float64], modes: NDArray[np.int64] | None = None) -> NDArray[np.bool_]:
        """Return whether a piece lacks each state, shape (m, n): none does."""
        return np.zeros(points.shape, np.bool_)

    def growth(self, x: NDArray[np.float64], mode: int, periods: int, discard: int | None) -> Growth:
        """Return how perturbations grow along a motion, over some iterations."""
        return growth_of_map(self.system, self.p, x, average=Average(periods=periods, discard=discard))

    def visited(self, x: NDArray[np.float64], mode: int, periods: int) -> tuple[frozenset[int], bool]:
        """Return the pieces that a motion visits within some iterations; it meets no event."""
        return frozenset(path_from(self.system, self.p, self._code, x, 0, periods)[1].tolist()), False

    def alone(self, x: NDArray[np.float64], traps: Traps, longest: int) -> int:
        """Return the label of one motion, by single images and the regions' own tests in place of the loop."""
        seen, extended = 0, self._code.p
        label = traps.of(x, 0)
        for _ in range(longest):
            if label != UNDECIDED:
                break
            image = self.system.compiled.linearised(self.system.piece_index(x, self.p), x, extended)[0]
            x = wrapped(image, self.system.angle_places)
            label = traps.of(x, 0)
            if label == UNDECIDED and traps.cells is not None:
                from saltus.ensemble.kernels.lanes import after_visit

                seen, label = after_visit(seen, traps.box_of(x), traps.cells.visits)
        return int(label)

    def _points(self, points: ArrayLike) -> NDArray[np.float64]:
        return np.ascontiguousarray(wrapped(checked_points(points, self.system.states), self.system.angle_places))

    def _followed(
        self, points: ArrayLike, traps: Traps, longest: int
    ) -> tuple[NDArray[np.uint8], NDArray[np.int32], NDArray[np.float64]]:
        from saltus.ensemble.kernels import map as kernels

        x = self._points(points)
        m = len(x)
        motions = Motions(x, np.zeros(m, np.int64))
        found = Found(
            np.full(m, NOT_DONE, np.uint8), np.zeros(m, np.int32), np.empty((m, self.n)), np.zeros(m, np.int64)
        )
        visits = 1 if traps.cells is None else traps.cells.visits
        settings = Settings(1.0, 1.0, 1.0, float(traps.limit), longest, visits)
        regions, boxes, code = regions_of(traps, self.n, self.system.angle_places), boxes_of(traps, self.n), self._code
        table = _table_of(boxes)

        def follow(start: int, end: int) -> None:
            at = np.empty((2, self.n))
            some, into = part_of(motions, start, end), part_of(found, start, end)
            status = kernels.follow(code, some, regions, boxes, table, settings, into, at[0], at[1])
            if status != kernels.FOLLOWED:
                raise pieces_error(self.system, at[0], self.p)

        follow_pieces(follow, m, _PIECE, self.threads)
        made = int(found.strobes.sum())
        self.work += made
        self.periods += made
        return found.labels, found.strobes, found.ends


def _table_of(boxes: Boxes) -> BoxTable:
    n = boxes.indices.shape[1]
    if not len(boxes.indices):
        return BoxTable(np.zeros(n, np.int64), np.zeros(n, np.int64), np.empty(0, np.uint8))
    low = boxes.indices.min(axis=0)
    shape = boxes.indices.max(axis=0) - low + 1
    if float(np.prod(shape, dtype=np.float64)) > _LARGEST_TABLE:
        return BoxTable(low, shape, np.empty(0, np.uint8))
    labels = np.full(tuple(shape.tolist()), UNDECIDED, np.uint8)
    labels[tuple((boxes.indices - low).T)] = boxes.labels
    return BoxTable(low, shape, labels.ravel())
