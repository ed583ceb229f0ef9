"""What a point of a curve must show of itself before it is kept: small residuals, critical multipliers."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.floquet import multiplier_errors, nontrivial

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem
    from saltus.orbits.signature import Survey

__all__ = ["INFINITE", "RESIDUAL", "residual_fault", "unconfirmed"]

RESIDUAL = 1e-8  # residual of an orbit's equations, over the sizes of states and events, up to which it is kept
INFINITE = 1e10  # multiplier that counts as infinite, at a grazing that leaves another one undetermined
_CONFIRMED = 1e-5  # distance of a multiplier from 1, -1 or the circle that confirms a bifurcation, beside its error


def unconfirmed(
    problem: OrbitProblem, kind: str, u: NDArray[np.float64], J: NDArray[np.float64], values: NDArray[np.complex128]
) -> bool:
    """Return whether no multiplier is 1 (SN), -1 (PD) or one of a pair on the unit circle (TR), within its error.

    Where one is infinite, next to a grazing, the others are not known well enough to contradict.
    """
    inner = nontrivial(values, autonomous=problem.system.phase is None)
    if not np.all(np.abs(inner) < INFINITE):
        return False
    away = np.abs(np.abs(inner) - 1.0) if kind == "TR" else np.abs(inner - (1.0 if kind == "SN" else -1.0))
    if away.size and float(away.min()) <= _CONFIRMED:
        return False
    errors = multiplier_errors(problem, u, J, values)[: inner.size]
    return not np.any(away <= errors)


def residual_fault(problem: OrbitProblem, survey: Survey, u: NDArray[np.float64]) -> str | None:
    """Return why a point is no orbit, where its segments miss each other, or their events, by too much."""
    if survey.residual <= RESIDUAL * problem.state_scale.min():
        return None
    sizes = np.maximum(problem.event_sizes(u), float(problem.state_scale.max()))
    left = float(np.max(survey.rates[:, 2] / sizes))
    return None if left <= RESIDUAL else f"residual: {left:.1e} of the orbit's size is left of the equations"
