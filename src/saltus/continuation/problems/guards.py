"""Checks of a point before it is kept: the residual of its equations, the critical multiplier of a bifurcation.

docs/theory/continuation.md, "Special points", explains them.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.stability.critical import openness
from saltus.orbits.stability.floquet import multiplier_errors, nontrivial

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem
    from saltus.orbits.signature import Survey

__all__ = ["INFINITE", "RESIDUAL", "residual_fault", "unconfirmed", "undetermined"]

RESIDUAL = 1e-8  # largest residual of an orbit that is kept, over the sizes of states and events
INFINITE = 1e10  # modulus from which on a multiplier counts as infinite: the orbit is at a grazing
_OPEN = 1e-10  # least singular value, over the largest, of a matrix whose determinant is rounding
_CONFIRMED = 1e-5  # distance of a multiplier from its critical value that confirms a bifurcation, besides its error


def unconfirmed(
    problem: OrbitProblem, kind: str, u: NDArray[np.float64], J: NDArray[np.float64], values: NDArray[np.complex128]
) -> bool:
    """Return whether no multiplier is at 1 (SN), -1 (PD) or on the unit circle (TR) within its error.

    Next to a grazing a multiplier is infinite. The others are then too inaccurate to contradict: the result is False.
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
    """Return the reason if segments miss each other, or their events, by more than `RESIDUAL`; else None."""
    if survey.residual <= RESIDUAL * problem.state_scale.min():
        return None
    sizes = np.maximum(problem.event_sizes(u), float(problem.state_scale.max()))
    left = float(np.max(survey.rates[:, 2] / sizes))
    return None if left <= RESIDUAL else f"residual: {left:.1e} of the orbit's size is left of the equations"


def undetermined(problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]) -> bool:
    """Return whether det(A - B) and det(A + B) are rounding, as at a grazing where the surface bends no motion."""
    return all(openness(problem, mu, u, J) < _OPEN for mu in (1.0, -1.0))
