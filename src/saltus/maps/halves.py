"""The orbit of half the period at a point to which an orbit of a map of doubled period has shrunk."""

from __future__ import annotations

import numpy as np

from saltus.maps.orbit import MapOrbit
from saltus.maps.solve import sizes_of
from saltus.scales import HALVES_OF_MAP
from saltus.system.angles import wrapped

__all__ = ["half_of"]


def half_of(orbit: MapOrbit) -> MapOrbit | None:
    """Return the orbit of half the period that an orbit goes round twice; None where its halves differ."""
    half, odd = divmod(orbit.period, 2)
    if odd or orbit.itinerary[:half] != orbit.itinerary[half:]:
        return None
    first, places = orbit.points[:half], orbit.system.angle_places
    gaps = wrapped(orbit.points[half:] - first, places)
    problem = orbit.problem()
    sizes = sizes_of(problem, orbit.points.ravel()).reshape(orbit.points.shape)[:half]
    if not np.all(np.abs(gaps) < HALVES_OF_MAP * sizes):
        return None
    names = orbit.system.piece_names
    single = problem.along(tuple(names.index(name) for name in orbit.itinerary[:half]))
    u = (first + 0.5 * gaps).ravel()
    for _ in range(3):
        F, J = single.evaluate(u)
        u = u - np.linalg.solve(J, F)
    return MapOrbit.from_unknowns(single, u, sizes_of(single, u))
