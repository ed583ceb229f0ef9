"""Border collisions: what goes on where a point of an orbit meets the border of its piece.

docs/theory/map_orbits.md, "Border collisions", derives the conditions.

References
----------
di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, Springer 2008, ch. 3.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.problems.boundary import FOLDS, PERSISTS, Crossing, slope_of
from saltus.scales import BORDERS_ALIKE, FIELDS_MEET, MET
from saltus.system.angles import wrapped
from saltus.system.tiling import piece_at

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.maps.problem import MapOrbitProblem

__all__ = ["beyond_border", "shrinks_to"]

_NEAR = 1e-6  # distance beyond a border, in the states' sizes, at which the neighbouring piece is looked for


def beyond_border(
    problem: MapOrbitProblem, point: int, guard: int, u: NDArray[np.float64], sizes: NDArray[np.float64]
) -> Crossing:
    """Return what goes on where a point of the orbit `u` meets a border of its piece.

    Parameters
    ----------
    problem : MapOrbitProblem
        The equations of the orbit's itinerary, one parameter active.
    point, guard : int
        The point, and the condition that vanishes there.
    u : ndarray, shape (n + 1,)
        The orbit.
    sizes : ndarray, shape (n,)
        Typical sizes of the points.
    """
    inwards = problem.border(point, guard, u)[1]
    itinerary = list(problem.itinerary)
    for i, other, height in problem.heights(u):
        gradient = problem.border(i, other, u)[1] if (i, other) != (point, guard) else inwards
        unit = float(np.abs(gradient[: problem.n]) @ sizes)
        if (i, other) != (point, guard) and abs(height) > MET * unit:
            continue
        beyond = _piece_beyond(problem, i, gradient, u, sizes)
        if beyond is None:
            return Crossing("", problem, None, -inwards, "beyond it the same piece holds, or none")
        itinerary[i] = beyond
    beside = problem.along(tuple(itinerary))
    F, J = beside.evaluate(u)
    own, n = problem.evaluate(u)[1], problem.n
    terms = (np.abs(J[:, :n]) + np.abs(own[:, :n])) @ sizes
    if not np.all(np.abs(F) <= FIELDS_MEET * np.maximum(terms, 1e-12 * terms.max())):
        return Crossing("", beside, None, -inwards, "the map jumps there")
    # each branch's parameter, where its point moves to the side of its own piece
    sides = [slope_of(own[:, :n], own, inwards, sizes), slope_of(J[:, :n], J, -inwards, sizes)]
    meets_itself = shrinks_to(problem, beside.itinerary, u, sizes) is not None
    kind = "" if meets_itself or 0.0 in sides else PERSISTS if sides[0] * sides[1] < 0.0 else FOLDS
    return Crossing(kind, beside, u.copy(), -inwards)


def shrinks_to(
    problem: MapOrbitProblem, beyond: tuple[int, ...], u: NDArray[np.float64], sizes: NDArray[np.float64]
) -> int | None:
    """Return the period of the shorter orbit to which one shrinks on a border; None where it does not.

    The itinerary beyond is then its own, begun at another point that lies where the first one does. The equations of
    both are the same, and so are their orbits: none lies beyond.
    """
    points, own, places = problem.points(u), problem.itinerary, problem.system.angle_places
    turns = [
        k
        for k in range(1, problem.period)
        if np.all(
            np.abs(wrapped(np.roll(points, -k, axis=0) - points, places)) <= BORDERS_ALIKE * sizes[: problem.states]
        )
    ]
    return turns[0] if any(own[k:] + own[:k] == beyond for k in turns) else None


def _piece_beyond(
    problem: MapOrbitProblem,
    point: int,
    gradient: NDArray[np.float64],
    u: NDArray[np.float64],
    sizes: NDArray[np.float64],
) -> int | None:
    """Return the piece that holds a little beyond a border; None where it is the same, or there is none."""
    at = slice(point * problem.states, (point + 1) * problem.states)
    scaled = gradient[at] * sizes[at]
    length = float(np.linalg.norm(scaled))
    if length == 0.0:
        return None
    x = u[at] - _NEAR * sizes[at] * scaled / length
    p = problem.compiled.extended(problem.parameters_at(u))
    found = piece_at(problem.system, np.ascontiguousarray(x), p)
    return None if found < 0 or found == problem.itinerary[point] else found
