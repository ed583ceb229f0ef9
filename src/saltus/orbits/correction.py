"""Newton's method for an orbit's equations in a plane, in compiled calls between which meshes are moved."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.orbits.records import MOVE, SINGULAR

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["Corrected", "corrected"]


class Corrected(NamedTuple):
    """How Newton's method in a plane ends: what `saltus.orbits.kernels.newton` tells, and the point that it reached."""

    told: int
    u: NDArray[np.float64]  # shape (size + 1,): unknowns
    J: NDArray[np.float64]  # shape (size, size + 1): Jacobian before the last step
    direction: NDArray[np.float64]  # shape (size + 1,): along the curve, of any length
    # sign, log: sign and logarithm of the determinant of the Jacobian bordered by the plane's normal
    sign: float
    log: float
    residual: float  # largest residual before the last step, over the sizes of the unknowns
    iterations: int


def corrected(
    problem: OrbitProblem,
    guess: NDArray[np.float64],
    row: NDArray[np.float64],
    scale: NDArray[np.float64],
    most: int,
) -> Corrected | None:
    """Return how Newton's method ends in the plane through a point; None for a stiff flow.

    Meshes of a stiff flow are made anew at each evaluation that they do not fit.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, with one active parameter.
    guess, row, scale : ndarray, shape (size + 1,)
        The point, the plane's normal, and sizes of the unknowns.
    most : int
        Most iterations, besides those on meshes that were moved.
    """
    if problem.stiff:
        return None
    kernels, m = problem.newton, problem.size
    u, F, J, steps = guess.copy(), np.empty(m), np.empty((m, m + 1)), np.empty((m + 1, 2))
    numbers = kernels.beginning(most)
    while (told := problem.correct((guess, row, scale), numbers, (u, F, J, steps))) == MOVE:
        numbers[kernels.FINE] = problem.refine()
        if problem.crowded:
            told = SINGULAR
            break
    _, iterations, *_, sign, log, _, residual, _ = numbers.tolist()
    return Corrected(told, u, J, steps[:, 1], sign, log, residual, int(iterations))
