"""Exact derivatives of Floquet multipliers by parameters: docs/theory/sensitivities.md, "Multipliers".

References
----------
Lancaster, On eigenvalues of matrices dependent on a parameter, Numer. Math. 6 (1964) 377-387. Departs from it in the
matrix: it is that of the segment equations, whose derivative along the right null vector is integrated exactly.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.orbits.stability.critical import closing, scaling
from saltus.orbits.stability.floquet import multipliers
from saltus.scales import DOUBLE, SINGULAR_AT_MULTIPLIER

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["ROUGH", "MultiplierSlopes", "multipliers_by_parameters"]

ROUGH = "a root vanishes on a surface, so that second derivatives are differences: three digits or more"
_LOST = "a multiplier is a double one, infinite or lost in rounding"


class MultiplierSlopes(NamedTuple):
    """Multipliers, shape (states,), their derivatives by parameters, (states, parameters), and why some are NaN."""

    values: NDArray[np.complex128]
    slopes: NDArray[np.complex128]
    note: str


def multipliers_by_parameters(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64], du: NDArray[np.float64]
) -> MultiplierSlopes:
    """Return an orbit's multipliers with their derivatives by the active parameters.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, active parameters growing.
    du : ndarray, shape (size, active)
        Derivatives of the unknowns.
    """
    size, count = problem.size, len(problem.active)
    values = multipliers(problem, u, J)
    slopes = np.full((values.size, count), complex(np.nan, np.nan))
    columns, rows = scaling(problem, J, u)
    onward, moved = rows[:, None] * closing(problem) * columns, np.vstack([du, np.eye(count)])
    inner = values.size - (problem.system.phase is None)
    slopes[inner:] = 0.0  # the trivial one
    for i, mu in enumerate(values[:inner].tolist()):
        if not np.isfinite(mu) or (i > 0 and mu == values[i - 1].conjugate() and mu.imag != 0.0):
            slopes[i] = slopes[i - 1].conjugate() if np.isfinite(mu) else slopes[i]
            continue
        left, sizes, right = np.linalg.svd(rows[:, None] * J[:, :size] * columns + (1.0 - mu) * onward)
        p, q = left[:, -1].conjugate(), right[-1].conjugate()
        twist = complex(p @ onward @ q)
        bound = float(np.linalg.norm(p @ onward)) * float(np.linalg.norm(onward @ q))
        if (
            sizes[-1] > SINGULAR_AT_MULTIPLIER * sizes[0]
            or not abs(twist) * float(np.abs(onward).max()) > DOUBLE * bound
        ):
            continue
        w, v, still = p * rows, q * columns, np.zeros(count)
        bend = problem.second(u, np.append(v.real, still)) + 0.0j
        if mu.imag != 0.0:
            bend = bend + 1j * problem.second(u, np.append(v.imag, still))
        slopes[i] = (w @ bend @ moved) / twist
    note = ROUGH if problem.system.compiled.rooted[problem.modes].any() else ""
    return MultiplierSlopes(values, slopes, _LOST if np.isnan(slopes).any() else note)
