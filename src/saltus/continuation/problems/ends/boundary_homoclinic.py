"""Cycles whose period grows without bound since an equilibrium of a mode meets the event that ends a segment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.problems.boundary import beyond_boundary
from saltus.continuation.problems.ends.connection import Homoclinic
from saltus.continuation.problems.ends.unbounded import period_of
from saltus.equilibria import Equilibrium
from saltus.equilibria.problem import EquilibriumProblem
from saltus.scales import NEWTON_AT_ROUNDING

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Point
    from saltus.continuation.problems.orbit import OrbitZeroProblem
    from saltus.orbits.problem import OrbitProblem

    Row = tuple[OrbitZeroProblem, Point]

__all__ = ["Meeting", "meeting_ahead", "shrunk_onto"]

_ITERATIONS = 20  # Newton steps, at most
_AWAY = 0.1  # distance of the equilibrium from the segment's end, in sizes of the states, and of the parameter


@dataclass(frozen=True, eq=False)
class Meeting:
    """An equilibrium of a mode on the event that ends a segment of a cycle in this mode."""

    end: Homoclinic  # the equilibrium
    error: float  # last change of the unknowns, over their sizes
    told: str  # the meeting, in words


def meeting_ahead(points: list[Row]) -> Meeting | None:
    """Return where an equilibrium meets an event of a cycle; None where none does so at the end of a branch.

    The branch tends there: while its period doubled at last, the parameter came by more than it is away. It does where
    the period grows like a logarithm of the distance, or like a root of its inverse.

    Parameters
    ----------
    points : list of (OrbitZeroProblem, Point)
        Points of a branch in order, of an autonomous system; the period of the last grows without bound.
    """
    branch, point = points[-1]
    problem, period = branch.problem, period_of(branch, point)
    short = [old.parameter for piece, old in points if 2.0 * period_of(piece, old) <= period]
    system, n = problem.system, problem.n
    problem.survey(point.u)
    durations = point.u[n : problem.size : n + 1]
    for i in np.argsort(-durations).tolist():
        transition = problem.signature.transitions[i]
        if transition < 0:
            continue
        found = _meeting(problem, point.u, i, transition)
        if found is not None:
            rest, error = found
            value = rest.parameters[system.parameter_names[problem.active[0]]] / problem.scales[0]
            if short and not abs(value - point.parameter) <= abs(short[-1] - point.parameter):
                continue
            name, event = system.parameter_names[problem.active[0]], system.transitions[transition].name
            where = f"{name} = {rest.parameters[name]:.9g}"
            told = f"the equilibrium of mode {rest.mode!r} meets the event {event!r} at {where}"
            return Meeting(Homoclinic(rest, event), error, told)
    return None


def _boundary_equilibrium(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[Equilibrium, int] | None:
    """Return the equilibrium on an event to which a cycle has shrunk, and the transition; None where there is none."""
    problem.survey(u)
    for i, transition in enumerate(problem.signature.transitions):
        found = None if transition < 0 else _meeting(problem, u, i, transition)
        if found is not None:
            return found[0], transition
    return None


def shrunk_onto(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[str, Homoclinic | None]:
    """Return the kind of the boundary equilibrium to which a cycle has shrunk, and the equilibrium with its event.

    The kind is empty where none is told.
    """
    if (met := _boundary_equilibrium(problem, u)) is None:
        return "", None
    rest = met[0].problem(problem.system.parameter_names[problem.active[0]])
    at = np.append(met[0].state, rest.p[rest.active[0]])
    along = np.append(np.zeros(rest.n), 1.0)
    kind = beyond_boundary(rest, met[1], at, along, problem.state_scale[: rest.n]).kind
    return kind, Homoclinic(met[0], problem.system.transitions[met[1]].name)


def _meeting(
    problem: OrbitProblem, unknowns: NDArray[np.float64], segment: int, transition: int
) -> tuple[Equilibrium, float] | None:
    """Return the equilibrium on the event and the last change of the unknowns; None where there is none."""
    value = float(unknowns[-1])
    n, ends = problem.n, problem.state_on(segment, 1.0)
    mode, p = problem.signature.modes[segment], problem.parameters_at(unknowns)
    rest = EquilibriumProblem(problem.system, mode, p, problem.active, problem.scales)
    u: NDArray[np.float64] = np.append(ends, value)
    sizes = np.append(problem.state_scale, max(abs(value), 1.0))
    for _ in range(_ITERATIONS):
        F, J = rest.evaluate(u)
        height, gradient = rest.event(transition, u)
        matrix = np.vstack([J, gradient])
        if not np.all(np.isfinite(matrix)):
            return None
        try:
            step = np.linalg.solve(matrix, -np.append(F, height))
        except np.linalg.LinAlgError:
            return None
        u = u + step
        if (error := float(np.max(np.abs(step) / sizes))) < NEWTON_AT_ROUNDING:
            away = np.max(np.abs(u - np.append(ends, value)) / sizes)
            return (Equilibrium.from_unknowns(rest, u, sizes[:n]), error) if away < _AWAY else None
    return None
