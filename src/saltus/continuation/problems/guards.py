"""Checks of a point and of the step to it: its equations' residual, its critical multiplier, multipliers on the way.

docs/theory/continuation.md, "Special points", explains them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.monitor import Monitor, at_grazing
from saltus.continuation.core.zero_problem import Point
from saltus.continuation.problems.doubts import passing
from saltus.continuation.problems.errors import clear_of_one
from saltus.continuation.problems.margins import without_speed
from saltus.orbits.maps import most_grown, piece_maps
from saltus.orbits.rounds import divided
from saltus.orbits.stability.critical import openness
from saltus.orbits.stability.floquet import Passage, multiplier_errors, multipliers, nontrivial, undecided
from saltus.scales import (
    CONFIRMED,
    CROWDED,
    EPS,
    FINEST,
    HALVES_ALIKE,
    INFINITE,
    OPEN_DETERMINANT,
    PARAMETER_PERHAPS_RESTS,
    PARAMETER_RESTS,
    PARAMETER_ROUNDED,
    RESIDUAL_KEPT,
    RESIDUAL_ROUNDING,
    SLOWED,
    split,
    value_error,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.problems.orbit_data import OrbitData
    from saltus.orbits.problem import OrbitProblem
    from saltus.orbits.signature import Survey

__all__ = [
    "CROSSINGS", "HALVES", "ROUGH_GRAZING", "ROUGH_MEETING",
    "goes_twice", "residual_fault", "rests", "step_fault", "tightened", "unconfirmed", "undetermined",
]  # fmt: skip

CROSSINGS = "stability: more than one multiplier crosses the unit circle within the step"
HALVES = "halves: the orbit goes round a shorter one twice, and no branch point explains it"
ROUGH_GRAZING = "location: what lies behind the grazing cannot be told at the tolerance"
ROUGH_MEETING = "location: errors at the tolerance part the branches that meet"


def unconfirmed(
    problem: OrbitProblem,
    kind: str,
    u: NDArray[np.float64],
    J: NDArray[np.float64],
    values: NDArray[np.complex128],
    step: tuple[Point, Point] | None = None,
) -> bool:
    """Return whether no multiplier is at 1 (SN), -1 (PD) or on the unit circle (TR) within its error.

    Next to a grazing a multiplier is infinite. The others are then too inaccurate to contradict: the result is False.
    On a canard multipliers pass their critical places so fast that the point's place does not tell them. `step` has the
    ends of its step. A multiplier that passes its critical place between these needs no confirmation.
    """
    if kind != "TR" and step is not None and passing(problem, kind, *step) is not None:
        return False
    inner = nontrivial(values, autonomous=problem.system.phase is None)
    if not np.all(np.abs(inner) < INFINITE):
        return False
    away = np.abs(np.abs(inner) - 1.0) if kind == "TR" else np.abs(inner - (1.0 if kind == "SN" else -1.0))
    if away.size and float(away.min()) <= CONFIRMED:
        return False
    rounded = RESIDUAL_ROUNDING
    if problem.signature.flies and problem.signature.is_cut:  # a piece magnifies the rounding of each step
        rounded = max(rounded, EPS * problem.steps * most_grown(problem, u, J))
    errors = np.maximum(multiplier_errors(problem, u, J, values)[: inner.size], rounded * _speed(step))
    return not np.any(away <= errors)


def _speed(step: tuple[Point, Point] | None) -> float:
    """Return the largest mean rate of change of a multiplier along a step, by arclength; 0 where it is not known."""
    if step is None or not step[1].arc > step[0].arc:
        return 0.0
    before, after = (np.array(end.examined.data.followed if end.examined.data else ()) for end in step)
    if before.size != after.size or not np.all(np.isfinite(before)) or not np.all(np.isfinite(after)):
        return 0.0
    return float(np.abs(after - before).max(initial=0.0)) / (step[1].arc - step[0].arc)


def residual_fault(problem: OrbitProblem, survey: Survey, u: NDArray[np.float64]) -> str | None:
    """Return the reason if segments miss each other, or their events, by more than `RESIDUAL_KEPT`; else None."""
    if survey.residual <= RESIDUAL_KEPT * problem.state_scale.min():
        return None
    sizes = np.maximum(problem.event_sizes(u), float(problem.state_scale.max()))
    left = float(np.max(survey.rates[:, 2] / sizes))
    if left <= RESIDUAL_KEPT:
        return None
    grown = float(np.abs(piece_maps(problem, problem.evaluate(u)[1])).max())
    told = f"residual: {left:.1e} of the orbit's size is left of the equations"
    return f"{told}; a change of a segment's start grows {grown:.1e} times over it"


def goes_twice(problem: OrbitProblem, u: NDArray[np.float64], survey: Survey) -> bool:
    """Return whether an orbit, just surveyed, goes round a shorter one twice; False of an orbit cut in pieces."""
    if problem.signature.is_cut:
        return False
    return divided(problem, u, 2, HALVES_ALIKE * problem.state_scale, survey) is not None


def tightened(
    problem: OrbitProblem, survey: Survey, u: NDArray[np.float64], J: NDArray[np.float64], *, neutral: bool
) -> bool:
    """Return whether the finest tolerance was just taken, since a looser one cannot tell what the orbit is.

    It cannot where the two halves of an orbit are so near each other that errors part the branches that meet there. Nor
    can it where multipliers may lie on either side of the unit circle. The orbit is to be solved again then.
    """
    if problem.tol <= FINEST:
        return False
    near = split(problem.tol) * np.maximum(survey.highs - survey.lows, 0.0)[: problem.n]
    if not problem.signature.is_cut and divided(problem, u, 2, near, survey) is not None:
        return problem.tighten()
    return not neutral and undecided(problem, u, J, multipliers(problem, u, J)) and problem.tighten()


def undetermined(problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]) -> bool:
    """Return whether det(A - B) and det(A + B) are rounding, as at a grazing where the surface bends no motion.

    The rates of events that are met without speed are 0 there, and rounding of 0 is no term of a determinant.
    """
    exact = J.copy()
    for name in without_speed(problem, u):
        place = name.segment * (problem.n + 1) + problem.n
        exact[place, place] = 0.0
    return all(openness(problem, mu, u, exact) < OPEN_DETERMINANT for mu in (1.0, -1.0))


def rests(
    problem: OrbitProblem,
    a: Point,
    b: Point,
    data: OrbitData,
    own: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> bool:
    """Return whether the parameter rests in a step, as along a family of orbits at one value of the parameter.

    All along a family a multiplier is at 1. Along a canard the parameter moves as little, but none stays there.

    Parameters
    ----------
    problem : OrbitProblem
        The equations.
    a, b : Point
        Ends of the step; `a` is examined.
    data : OrbitData
        What is known of `b`.
    own : callable
        Returns the Jacobian of the orbit's equations, of that of all equations.
    """
    slope = max(abs(float(a.tangent[-1])), abs(float(b.tangent[-1])))
    short = abs(b.arc - a.arc) <= CROWDED
    still = slope < PARAMETER_PERHAPS_RESTS and abs(b.parameter - a.parameter) < PARAMETER_ROUNDED and not short
    if not (slope < PARAMETER_RESTS or still):
        return False
    ends, least = ((a, a.examined.data), (b, data)), value_error(problem.tol)
    apart = any(clear_of_one(problem, point.u, own(point.J), known.multipliers, least) for point, known in ends)
    problem.set_parameters(b.u)
    return not apart


def step_fault(
    point: Point,
    before: Point,
    monitors: Mapping[Monitor, float],
    data: OrbitData,
    way: Passage | None,
    *,
    resting: bool,
) -> str | None:
    """Return the reason why a point may not follow the point before, or None if it may.

    resting: whether the parameter rests in the step.
    """
    old: OrbitData = before.examined.data
    known = before.examined.monitors
    changed = {
        name
        for name, value in monitors.items()
        if name in known and (known[name] < 0.0) != (value < 0.0) and math.isfinite(known[name] + value)
    }
    grazing = any(at_grazing(name) for name in changed)
    if old.survey.admissible and not data.survey.admissible and not grazing:
        return "not admissible: " + "; ".join(data.survey.reasons())
    if point.arc - before.arc < CROWDED or grazing or not old.survey.admissible:
        return None
    if way is not None and resting:
        return None
    if any(name.kind == "rate" and 0.0 < value < SLOWED * known.get(name, 0.0) for name, value in monitors.items()):
        return "velocity: an event is met so much slower that a touch before may be passed over"
    if way is None:
        return None
    if not way.sure:
        return "stability: multipliers may have crossed the unit circle in opposite ways"
    if way.real + way.pairs > 1:
        return CROSSINGS
    simple = sum(name.kind in ("SN", "PD", "BP") for name in changed)
    tori = sum(name.kind == "TR" for name in changed)
    if way.pairs != tori or way.real > simple or (simple - way.real) % 2:
        return "stability changes without a bifurcation that explains it"
    return None
