"""Whether a step of a curve of orbits passes the curve's start, perhaps at another phase of the orbit."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.arclength import StepControl
from saltus.continuation.core.zero_problem import SAME, Point, ZeroProblem, correct
from saltus.orbits.cuts import clustered
from saltus.orbits.signature import PHASE_END
from saltus.system.angles import TURN, wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["alongside", "passes"]

_SAMPLES = 400  # times over a period between which an orbit's crossings of a plane are sought


def alongside(problem: OrbitProblem, u: NDArray[np.float64], other: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a copy of the unknowns `u`, its phase shifted by whole turns to start next to the phase of `other`.

    Angles are moved next to those of `other`, each segment's by itself.
    """
    moved, n = u.copy(), problem.n
    if problem.system.phase is not None:
        shift = 2.0 * math.pi * round(float(u[n - 1] - other[n - 1]) / (2.0 * math.pi))
        moved[n - 1 : problem.size : n + 1] -= shift
    for place in problem.system.angle_places:
        at = slice(place, problem.size, n + 1)
        moved[at] -= TURN * np.round((moved[at] - other[at]) / TURN)
    return moved


def passes(
    branch: ZeroProblem,
    problem: OrbitProblem,
    origin: Point,
    last: Point,
    new: Point,
    control: StepControl,
    active: slice | None = None,
) -> bool:
    """Return whether the step from `last` to `new` passes the orbit of `origin`, from any of its starting points.

    All three points have one signature. `problem` holds the equations of the orbits of `branch`. Its active parameters
    are the last unknowns, unless `active` says where they are.
    """
    active = slice(-len(problem.active), None) if active is None else active
    if new.arc < 3.0 * control.initial:
        return False
    reach = 20.0 * control.deviation
    if abs(origin.parameter - last.parameter) > abs(new.parameter - last.parameter) + reach:
        return False
    periods = [float(point.u[problem.n : problem.size : problem.n + 1].sum()) for point in (origin, last, new)]
    if abs(periods[0] - periods[1]) > abs(periods[2] - periods[1]) + reach * periods[0]:
        return False
    return any(_meets(branch, problem, same, last, new, control) for same in _phases(problem, origin, active))


def _phases(problem: OrbitProblem, origin: Point, active: slice) -> Iterator[Point]:
    """Yield a point of a curve with each possible start of its orbit; only the first has a tangent."""
    signature, n, size = problem.signature, problem.n, problem.size
    if problem.slides:
        found = _on_plane(problem, origin.u, active)
        if found is not None:
            yield replace(origin, u=found, tangent=np.zeros(0))
        return
    yield origin
    blocks = origin.u[:size].reshape(problem.segments, n + 1)
    if signature.kinds[0] == PHASE_END:
        problem.survey(np.append(origin.u[:size], origin.u[active]))
        for j in range(1, signature.turns):
            moved = origin.u.copy()
            moved[:n] = problem.state_on(0, clustered(j / signature.turns))
            moved[n - 1] = blocks[0, n - 1]
            yield replace(origin, u=moved, tangent=np.zeros(0))
        return
    parts = (signature.modes, signature.transitions, signature.kinds)
    for j in range(1, problem.segments):
        if all(part[j:] + part[:j] == part for part in parts):
            turned = blocks.copy()
            if problem.system.phase is not None:
                turned[:j, n - 1] += 2.0 * math.pi * signature.turns
            moved = origin.u.copy()
            moved[:size] = np.roll(turned, -j, axis=0).ravel()
            yield replace(origin, u=moved, tangent=np.zeros(0))


def _on_plane(problem: OrbitProblem, u: NDArray[np.float64], active: slice) -> NDArray[np.float64] | None:
    """Return the orbit `u` started on the plane of the phase condition; None where it does not cross the plane.

    Of several crossings the one nearest to the plane's point is taken.
    """
    n, size = problem.n, problem.size
    point, normal = problem.phase_plane[:n], problem.phase_plane[n:]
    problem.survey(np.append(u[:size], u[active]))
    places = np.linspace(0.0, 1.0, _SAMPLES + 1)
    circles = problem.system.angle_places
    heights = np.array([wrapped(problem.state_on(0, place) - point, circles) @ normal for place in places])
    heights[-1] = heights[0]  # the same point, but for rounding
    best: tuple[float, NDArray[np.float64]] | None = None
    for i in np.flatnonzero((heights[:-1] < 0.0) & (heights[1:] >= 0.0)):
        low, high = places[i], places[i + 1]
        for _ in range(50):
            middle = 0.5 * (low + high)
            height = wrapped(problem.state_on(0, middle) - point, circles) @ normal
            low, high = (middle, high) if height < 0.0 else (low, middle)
        x = problem.state_on(0, high)
        x[circles] += (wrapped(x - point, circles) - (x - point))[circles]
        away = float(np.linalg.norm((x - point) / problem.state_scale))
        if best is None or away < best[0]:
            best = away, x
    if best is None:
        return None
    moved = u.copy()
    moved[:n] = best[1]
    return moved


def _meets(
    branch: ZeroProblem, problem: OrbitProblem, origin: Point, last: Point, new: Point, control: StepControl
) -> bool:
    """Return whether the step from `last` to `new` passes the point `origin`, its orbit's start unchanged."""
    reach = 20.0 * control.deviation
    w = last.weights
    goal = alongside(problem, origin.u, last.u)
    away, chord = goal - last.u, new.u - last.u
    length = float(w @ chord**2)
    share = float(w @ (away * chord)) / length
    if not 0.0 < share <= 1.0:
        return False
    if not math.sqrt(float(w @ (away - share * chord) ** 2)) < reach:
        return False
    tangent = origin.tangent if origin.tangent.size else chord / math.sqrt(length)
    along = float(w @ (tangent * chord))
    if not abs(along) > 0.9 * math.sqrt(length * float(w @ tangent**2)):
        return False
    weights = origin.weights if origin.tangent.size else w
    guess = last.u + share * chord
    guess -= tangent * (float((weights * tangent) @ (guess - goal)) / float(weights @ tangent**2))
    there = correct(branch, guess, tangent, weights, control.iterations)
    return isinstance(there, Point) and float(w @ (there.u - goal) ** 2) < SAME**2
