"""Attractors of a map: the search of flows, with Newton's method on iterates in the place of the orbit solver."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.basins.attractors.found import SAME, Found
from saltus.basins.attractors.periodic import in_order
from saltus.basins.attractors.search import AttractorSearch
from saltus.basins.attractors.trapping import OrbitEllipsoids, largest_multiplier, metric_of
from saltus.ensemble.map_ensemble import MapEnsemble
from saltus.errors import InputError, MapDivergenceError
from saltus.maps.iterates import keeps_turns
from saltus.system.angles import TURN, wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import Map

__all__ = ["MapSearch"]

_STEPS = 30  # Newton steps, at most
_CONVERGED = 1e-13  # largest Newton step, over the states' sizes, of an orbit that is found
_ROUNDING = 1e-10  # the same where steps shrink no further, as where derivatives along the orbit are large
_SINGULAR = 1e12  # condition of Newton's equations beyond which an orbit is not isolated


class MapSearch(AttractorSearch):
    """The search for all attractors of a map; its arguments are those of `FollowedMotions`."""

    system: Map
    by_mode = False  # the state decides which piece holds
    budget = 5e8  # iterations take far less than strobes

    @property
    def sampled(self) -> bool:
        """Each state is a return."""
        return True

    def _engines(self) -> tuple[Any, Any]:
        if self.interval is not None:
            raise InputError("interval", self.interval, "left out for a map", "it is looked at after each iteration")
        engine = MapEnsemble(self.system, self.parameters, scale=self.scale, limit=self._within())
        return engine, engine

    def _way(self, start: NDArray[np.float64]) -> NDArray[np.float64]:
        return np.asarray(np.abs(self.system.image(start, parameters=self.parameters) - start))

    def is_virtual(self, found: Found) -> bool:
        """Return False: a map has no events to be beyond."""
        return False

    def find_caged(self) -> None:
        """Find nothing: the theorem of cages is one on flows."""

    def _corrected(self, x: NDArray[np.float64], mode: int, turns: int) -> Found | None:
        """Return the stable orbit near a motion that recurs after a number of iterations, None without one."""
        points = self._solved(x, turns)
        if points is None:
            return None
        apart = [float(np.abs(self._apart(points[later], points[0])).max()) for later in range(1, turns)]
        period = next((later for later, gap in enumerate(apart, 1) if turns % later == 0 and gap < SAME), turns)
        points = points[:period]
        decay = largest_multiplier(self._jacobians(points))
        if not decay < 1.0:
            return None
        pieces = frozenset(self.system.mode_names[self.system.piece_index(point, self.p)] for point in points)
        points, decay = in_order(points, self.scale), decay ** (1.0 / period)
        return Found(f"period-{period}", points, None, pieces, False, turns=self._turns(points), decay=decay)

    def _turns(self, points: NDArray[np.float64]) -> tuple[int, ...]:
        """Return the whole turns that each angle makes along an orbit; none where a turn is none of the image."""
        pieces = np.array([self.system.piece_index(point, self.p) for point in points], np.int64)
        if not self.circles.size or not keeps_turns(self.system, self.p, points, pieces):
            return ()
        images = np.array(
            [self.system.image(point, parameters=self.parameters) - following
             for point, following in zip(points, np.roll(points, -1, axis=0), strict=True)]
        )  # fmt: skip
        return tuple(np.rint(images[:, self.circles] / TURN).sum(axis=0).astype(int).tolist())

    def _solved(self, x: NDArray[np.float64], turns: int) -> NDArray[np.float64] | None:
        """Return the points of an orbit by Newton's method on the whole round; None where it does not converge."""
        before = np.inf
        for _ in range(_STEPS):
            try:
                points = self._round(x, turns)
            except MapDivergenceError:
                return None
            slope = np.eye(len(x))
            for jacobian in self._jacobians(points[:-1]):
                slope = jacobian @ slope
            # in parts of the states' sizes
            matrix = (np.eye(len(x)) - slope) * self.scale / self.scale[:, None]
            if not np.isfinite(matrix).all() or np.linalg.cond(matrix) > _SINGULAR:
                return None
            step = np.linalg.solve(matrix, self._apart(points[-1], x))
            size = float(np.abs(step).max())
            unit = max(1.0, float((np.abs(x) / self.scale).max()))
            if size < _CONVERGED * unit or (size < _ROUNDING * unit and size >= 0.5 * before):
                return points[:-1]
            x, before = wrapped(x + self.scale * step, self.circles), size
            if not self._bounded(x):
                return None
        return None

    def _round(self, x: NDArray[np.float64], turns: int) -> NDArray[np.float64]:
        """Return a state and its images, shape (turns + 1, n)."""
        points = [x]
        for _ in range(turns):
            points.append(self.ensemble.strobe(points[-1][None])[0][0])
            if not np.isfinite(points[-1]).all():
                raise MapDivergenceError(len(points), points[-2], "it leaves every bound")
        return np.array(points)

    def _jacobians(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of the map at points, shape (m, n, n)."""
        compiled, p = self.system.compiled, self.system.compiled.extended(self.p)
        pieces = [self.system.piece_index(point, self.p) for point in points]
        return np.array([compiled.linearised(k, point, p)[1] for k, point in zip(pieces, points, strict=True)])

    def _metric(self, found: Found) -> OrbitEllipsoids | None:
        jacobians = self._jacobians(found.points)
        return metric_of(found.points, jacobians, self.scale) if np.isfinite(jacobians).all() else None
