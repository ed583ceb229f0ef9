"""Sizes of the unknowns at the start of a curve of equilibria or of orbits of a map."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.algebraic.newton import responses, state_sizes, terms_of_rows
from saltus.scales import BESIDE_ZERO, RESPONSE_KNOWN, SINGULAR_AT_ROUNDING, SIZE_CHOSEN, STEEP

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from saltus.algebraic.protocol import AlgebraicProblem

__all__ = ["extents", "in_lockstep"]

_ROUNDED = 1e-14  # relative change of the unknowns that must not change a response
_SHORTEST = -320.0  # logarithm to base 10 of the least share of a response
_LONGEST = 100.0  # the same of the greatest share of a null vector
_APART = 0.25  # difference of two logarithms up to which a share is known


def extents(problem: AlgebraicProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sizes at the start of a curve, shape (n,): how far the parameters move the unknowns, and their moduli.

    Those of a state are the same at all points of a map orbit.

    A state may be large and yet hardly move, as a temperature in kelvins: its size is then how far it moves. Next to a
    fold a state may be next to 0 by chance: its size is then how far it goes along its response to the parameter, as
    far as the equations hardly bend.
    """
    return in_lockstep(_extents(problem, u), problem.period)


def in_lockstep(sizes: NDArray[np.float64], period: int) -> NDArray[np.float64]:
    """Return the largest size of each state along a map orbit, for all its points, shape (n,)."""
    if period == 1:
        return sizes.copy()
    return np.tile(sizes.reshape(period, -1).max(axis=0), period)


def _extents(problem: AlgebraicProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return `extents` of each unknown by itself."""
    J = problem.evaluate(u)[1]
    n, x = problem.n, np.abs(u[: problem.n])
    sizes = state_sizes(problem, u, J)
    if not np.any(x):
        return _at_fold(problem, u, J, sizes)
    answers = responses(J[:, :n], J[:, n:], sizes)
    moved = np.abs(answers).max(axis=1)
    usual = np.where((x > SIZE_CHOSEN * sizes) & (moved > 0.0), np.clip(moved, SIZE_CHOSEN * x, x), sizes)
    steep = np.where(x > SIZE_CHOSEN * sizes, moved / usual, 0.0)
    if not np.any(steep > STEEP):
        return usual
    nudged = problem.evaluate(u * (1.0 + _ROUNDED))[1]
    again = responses(nudged[:, :n], nudged[:, n:], sizes)
    known = np.where(np.abs(again - answers) <= RESPONSE_KNOWN * np.abs(answers), answers, 0.0)
    ways = np.array([_way(problem, u, J, sizes, known[:, k], steep > STEEP, k) for k in range(known.shape[1])])
    way = ways.max(axis=0)
    return np.where(x < BESIDE_ZERO * way, way, usual)


def _at_fold(
    problem: AlgebraicProblem, u: NDArray[np.float64], J: NDArray[np.float64], sizes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return sizes where all unknowns vanish: at a fold those of its parabola, elsewhere the ones given.

    The parabola reaches as far as one unit of the parameter does, where its residual is seen by the left null vector.
    """
    n = problem.n
    rows = terms_of_rows(J)
    left, values, right = np.linalg.svd(J[:, :n] / rows)
    drive = np.abs(left[:, -1] @ (J[:, n:] / rows))
    if values[-1] > SINGULAR_AT_ROUNDING or not drive.max(initial=0.0) > SINGULAR_AT_ROUNDING:
        return sizes

    def residual(exponent: float) -> NDArray[np.float64]:
        with np.errstate(all="ignore"):
            F = problem.evaluate(u + 10.0**exponent * np.append(right[-1], np.zeros(u.size - n)))[0]
        return np.asarray(F / rows[:, 0])

    reach = _reach(lambda exponent: not abs(float(left[:, -1] @ residual(exponent))) <= drive.max(), _LONGEST)
    if reach == _LONGEST:
        return sizes
    follows = -np.linalg.lstsq(J[:, :n] / rows, residual(reach), rcond=SINGULAR_AT_ROUNDING)[0]
    way = np.abs(10.0**reach * right[-1] + follows)
    return np.where(way > 0.0, way, sizes)


def _reach(bends: Callable[[float], bool], longest: float) -> float:
    """Return the logarithm to base 10 of the share of a direction up to which the equations hardly bend."""
    low, high = _SHORTEST, longest
    if not bends(high):
        return high
    while high - low > _APART:
        middle = 0.5 * (low + high)
        low, high = (low, middle) if bends(middle) else (middle, high)
    return low


def _way(
    problem: AlgebraicProblem,
    u: NDArray[np.float64],
    J: NDArray[np.float64],
    sizes: NDArray[np.float64],
    answer: NDArray[np.float64],
    steep: NDArray[np.bool_],
    k: int,
) -> NDArray[np.float64]:
    """Return how far the unknowns go along the response to parameter `k`, as far as the equations hardly bend.

    There their residual moves one of the steep unknowns as far as one unit of the parameter does. The others go along.
    """
    n, steep = problem.n, steep & (answer != 0.0)
    if not np.any(steep):
        return np.zeros(n)

    def bent(exponent: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        away = np.zeros(u.size)
        away[:n], away[n + k] = -answer, 1.0
        away *= 10.0**exponent
        with np.errstate(all="ignore"):
            residual = problem.evaluate(u + away)[0]
        if not np.isfinite(residual).all():
            return away[:n], np.full(n, math.inf)
        return away[:n], responses(J[:, :n], residual[:, None], sizes)[:, 0]

    def bends(exponent: float) -> bool:
        return bool(np.any(np.abs(bent(exponent)[1]) > np.abs(answer), where=steep))

    away, moves = bent(_reach(bends, 0.0))
    at = int(np.argmax(np.where(steep, np.abs(moves / np.where(steep, answer, 1.0)), 0.0)))
    return np.asarray(np.abs(away - (moves - answer * (moves[at] / answer[at]))))
