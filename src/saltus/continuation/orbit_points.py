"""Special points of a branch of periodic orbits: where they are located, and what is kept of them."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.two_sided import Found, OneSide
from saltus.orbits.critical import solve_branch_point
from saltus.orbits.floquet import distance_from_circle
from saltus.orbits.orbit import PeriodicOrbit, orbit_at

if TYPE_CHECKING:
    from saltus.continuation.orbit_problem import OrbitZeroProblem
    from saltus.continuation.zero_problem import Event, Point

__all__ = ["amplitude_of", "found_at", "sharpened"]

_NEAR = 1e-3  # distance in arclength between a branch point and the zero of its determinant


def sharpened(branch: OrbitZeroProblem, point: Point) -> Point:
    """Return a branch point located by equations that are regular there; unchanged where they have no solution."""
    u = solve_branch_point(branch.problem, point.u, branch.evaluate(point.u)[1])
    if u is None or float(point.weights @ (u - point.u) ** 2) > _NEAR**2:
        return point
    found = replace(point, u=u, J=branch.evaluate(u)[1])
    found.examined = branch.examine(found, None)
    return point if found.examined.data is None else found


def amplitude_of(orbit: PeriodicOrbit) -> float:
    """Return half the range of the state that varies most."""
    n = len(orbit.system.states)
    return 0.5 * float(np.max(orbit.highs[:n] - orbit.lows[:n]))


def found_at(name: str, branch: OrbitZeroProblem, event: Event, half: OneSide) -> Found:
    """Return a special point of one direction of a branch."""
    point, data = event.point, event.point.examined.data
    orbit = orbit_at(branch.problem, point.u, point.J, data.survey, data.multipliers)
    value = event.value
    if name == "PD":
        finite = orbit.multipliers[np.isfinite(orbit.multipliers)]
        value = float(np.abs(finite + 1.0).min())
    elif name == "TR":
        value = distance_from_circle(orbit.multipliers)
    tangent = None
    if name == "BP":  # it is undetermined at the point itself: the last point's is taken
        last = half.points[-1][1] if half.points else point
        tangent = (last if last.u.size == point.u.size else point).tangent.copy()
    return Found(name, orbit, value, len(half.points), point.arc, tangent=tangent)
