"""Equations of an equilibrium that slides, without the pole of the sliding field.

Where both fields are tangent to the surface, at a two-fold, the sliding field is 0/0. Its equilibria go through the
two-fold smoothly: docs/theory/equilibria.md, "Two-folds".
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.equilibria.problem import EquilibriumProblem, over_terms
from saltus.equilibria.sliding import sides_of
from saltus.scales import EPS, MET

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["WithoutPole", "beside_two_fold", "residual_of", "without_pole"]

# Distance from a two-fold, in sizes: the sliding field's derivatives have rounding over its square, and its corrections
# are its square.
_ASIDE = EPS ** (1 / 3)


def beside_two_fold(
    problem: EquilibriumProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return unknowns next to a two-fold, where the sliding field is no 0/0; None elsewhere.

    They lie on the branch through it, where a parameter is among the unknowns.

    u : ndarray, shape (n + active,); sizes : ndarray, shape (n,), typical sizes of the states.
    """
    sides, n = sides_of(problem.system, problem.mode), problem.n
    if sides is None:
        return None
    (rise, up), (fall, down) = (problem.event(k, u) for k in (sides.rise, sides.fall))
    terms = [float(np.abs(gradient[:n]) @ sizes) for gradient in (up, down)]
    if abs(rise) > MET * terms[0] or abs(fall) > MET * terms[1]:
        return None
    units, slope = np.append(sizes, np.ones(u.size - n)), down - up
    if u.size == n:
        return np.asarray(u + _ASIDE * units * np.sign(slope))
    J = without_pole(problem, u, sizes)[1] * units
    ways = np.linalg.svd(J)[2][n:]
    along = ways[np.argmax(np.abs(ways @ (slope * units)))]
    at = u + math.copysign(_ASIDE, float(along @ (slope * units))) * units * along
    F, J = without_pole(problem, at, sizes)
    return np.asarray(at - units * np.linalg.lstsq(J * units, F, rcond=None)[0])


def without_pole(
    problem: EquilibriumProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the equations of an equilibrium and their derivatives, of one that slides without the field's denominator.

    At a sliding equilibrium the fields f+ and f- are antiparallel, and h = 0: the sum of both has no part across their
    difference, in whose place h stands. The derivatives are those at a solution.
    """
    sides = sides_of(problem.system, problem.mode)
    if sides is None:
        return problem.evaluate(u)
    n = problem.n
    height, along = problem.event(sides.surface, u)
    (above, A), (below, B) = (problem.in_mode(mode).evaluate(u) for mode in (sides.above, sides.below))
    jump, total = (above - below) / sizes, (above + below) / sizes
    jump_J, total_J = (A - B) / sizes[:, None], (A + B) / sizes[:, None]
    size = float(np.linalg.norm(jump)) or 1.0
    jump = jump / size
    share = float(jump @ total) / size
    F, J = total - jump * (jump @ total), total_J - share * jump_J
    J = J - np.outer(jump, jump @ J)
    # both parts count alike
    units = np.append(sizes, np.ones(u.size - n))
    weight = float(np.abs(J * units).max()) / (float(np.abs(along * units).max()) or 1.0)
    F, J = F + weight * height * jump, J + weight * np.outer(jump, along)
    return F * sizes, J * sizes[:, None]


def residual_of(
    problem: EquilibriumProblem, u: NDArray[np.float64], J: NDArray[np.float64], sizes: NDArray[np.float64]
) -> float:
    """Return the largest of the equations over what the states' sizes make of its terms: those without pole.

    J : ndarray, shape (n, n + active), derivatives of the field.
    """
    if sides_of(problem.system, problem.mode) is None:
        return problem.rounding(u, J, sizes)
    F, J = without_pole(problem, u, sizes)
    return over_terms(np.abs(F), np.abs(J[:, : problem.n]) @ sizes)


class WithoutPole(EquilibriumProblem):
    """The equations of an equilibrium without the pole of a sliding field, for a search from far."""

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the equations and their derivatives: see `without_pole`."""
        moduli = np.abs(u[: self.n])
        sizes = np.where(moduli > 0.0, moduli, float(moduli.max(initial=0.0)) or 1.0)
        return without_pole(self, u, sizes)
