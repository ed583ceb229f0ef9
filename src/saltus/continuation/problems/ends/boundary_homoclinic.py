"""Cycles whose period grows without bound since an equilibrium of a mode meets the event that ends a segment."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.problems.ends.connection import Homoclinic
from saltus.equilibria import Equilibrium
from saltus.equilibria.problem import EquilibriumProblem
from saltus.scales import NEWTON_AT_ROUNDING

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Point
    from saltus.continuation.problems.orbit import OrbitZeroProblem
    from saltus.orbits.problem import OrbitProblem

__all__ = ["Meeting", "meeting_ahead"]

_ITERATIONS = 20  # Newton steps, at most
_AWAY = 0.1  # distance of the equilibrium from the segment's end, in sizes of the states, and of the parameter


@dataclass(frozen=True, eq=False)
class Meeting:
    """An equilibrium of a mode on the event that ends a segment of a cycle in this mode."""

    end: Homoclinic  # the equilibrium
    error: float  # last change of the unknowns, over their sizes
    told: str  # the meeting, in words


def meeting_ahead(branch: OrbitZeroProblem, point: Point) -> Meeting | None:
    """Return where an equilibrium meets an event of a cycle; None where none does so nearby.

    Parameters
    ----------
    branch : OrbitZeroProblem
        The equations, of an autonomous system.
    point : Point
        The last cycle of a branch.
    """
    problem = branch.problem
    system, n = problem.system, problem.n
    problem.survey(point.u)
    durations = point.u[n : problem.size : n + 1]
    for i in np.argsort(-durations).tolist():
        transition = problem.signature.transitions[i]
        if transition < 0:
            continue
        found = _meeting(problem, point, i, transition)
        if found is not None:
            rest, error = found
            name, event = system.parameter_names[problem.active[0]], system.transitions[transition].name
            where = f"{name} = {rest.parameters[name]:.9g}"
            told = f"the equilibrium of mode {rest.mode!r} meets the event {event!r} at {where}"
            return Meeting(Homoclinic(rest, event), error, told)
    return None


def _meeting(problem: OrbitProblem, point: Point, segment: int, transition: int) -> tuple[Equilibrium, float] | None:
    """Return the equilibrium on the event and the last change of the unknowns; None where there is none."""
    n, ends = problem.n, problem.state_on(segment, 1.0)
    rest = EquilibriumProblem(
        problem.system, problem.signature.modes[segment], problem.parameters_at(point.u), problem.active, problem.scales
    )
    u: NDArray[np.float64] = np.append(ends, point.u[-1])
    sizes = np.append(problem.state_scale, max(abs(float(point.u[-1])), 1.0))
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
            away = np.max(np.abs(u - np.append(ends, point.u[-1])) / sizes)
            return (Equilibrium.from_unknowns(rest, u, sizes[:n]), error) if away < _AWAY else None
    return None
