"""Attractors that a search missed: on what motions end that come near none of the known ones."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.basins.attractors.finding import search_of
from saltus.basins.attractors.found import AttractorOptions, Found, Stay
from saltus.basins.attractors.trapping import OrbitEllipsoids

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from numpy.typing import NDArray

    from saltus.ensemble.traps import Ellipsoids
    from saltus.orbits import PeriodicOrbit
    from saltus.system import HybridSystem, Map

__all__ = ["KnownAttractor", "missed_by"]

_SHOWN = 8  # missed attractors that are told, at most


class KnownAttractor(NamedTuple):
    """What is known of an attractor: kind, points, orbit where it has one, and the ellipsoids of all by label."""

    kind: str
    points: NDArray[np.float64]  # shape (k, n)
    orbit: PeriodicOrbit | None
    ellipsoids: Ellipsoids | None
    label: int

    def as_found(self, circles: NDArray[np.int64]) -> Found:
        """Return it as a search knows it, whose motions have been followed; `circles` are the places of the angles."""
        found = Found(self.kind, np.atleast_2d(self.points), self.orbit, frozenset(), touches=False)
        found.stay = Stay(0, 0.0, 0)
        if (e := self.ellipsoids) is not None and (own := e.labels == self.label).any():
            found.core = OrbitEllipsoids(e.centres[own], e.shapes[own], 1.0, modes=e.modes[own], circles=circles)
        return found


def missed_by(
    system: HybridSystem | Map,
    parameters: Mapping[str, float],
    box: Mapping[str, tuple[float, float]],
    known: Sequence[KnownAttractor],
    starts: NDArray[np.float64],
    interval: float | None,
) -> list[str]:
    """Return the attractors on which motions from some states end, but for known ones, in words.

    Parameters
    ----------
    box : mapping of str to (float, float)
        Interval of each state that sizes it.
    known : sequence of KnownAttractor
        Their ellipsoids are those in which a motion has settled.
    starts : ndarray, shape (m, n)
        States from which motions start.
    interval : float or None
        Time between two strobes of a system without a phase.
    """
    low, high = np.array(list(box.values()), dtype=np.float64).T
    search = search_of(system)(system, parameters, low, high, AttractorOptions(interval=interval))
    before = [attractor.as_found(system.angle_places) for attractor in known]
    search.found = list(before)
    admitted = starts[[search.ensemble.admits(x) for x in starts]]
    if not len(admitted):
        return []
    search.settle(admitted)
    search.drop_transients()
    new = [found for found in search.found if found not in before and not search.is_virtual(found)]
    return [f"{found.kind} through [{', '.join(f'{x:.9g}' for x in found.points[0])}]" for found in new[:_SHOWN]]
