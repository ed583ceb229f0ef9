"""Multipliers of an orbit: order, stability, test functions. docs/theory/map_orbits.md, "Test functions"."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.algebraic.products import combined

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "FAINT", "NEUTRAL", "count_outside", "flip_product", "fold_product", "multiplicity", "multipliers_of",
    "pair_product", "unstable_count",
]  # fmt: skip

NEUTRAL = 1e-9  # distance of a multiplier's modulus from 1, up to which it is rounding of 1
_CRITICAL = 1e-6  # distance from its place on the unit circle up to which a multiplier is critical
FAINT = 1e-13  # test function of a multiplier or of a pair, over its size, up to which it is rounding


def multipliers_of(slopes: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the eigenvalues of a product of matrices, the largest modulus first, of a pair the upper one first.

    That of two columns has its determinant from those of the factors: a small multiplier keeps its digits beside a
    large one. One that is too large for a number is infinite.

    Parameters
    ----------
    slopes : ndarray, shape (period, states, states)
        Derivatives at the points, the first one applied first.
    """
    product, power, determinant, shift = np.eye(slopes.shape[1]), 0, 1.0, 0
    for slope in slopes:
        product, own = _normalised(slope @ product)
        power += own
        mantissa, exponent = math.frexp(determinant * _determinant(slope))
        determinant, shift = mantissa, shift + exponent
    if slopes.shape[1] == 1:
        values = product.ravel().astype(np.complex128)
    elif slopes.shape[1] == 2:
        values = _of_two(product, math.ldexp(determinant, max(shift - 2 * power, -2000)))
    else:
        values = np.linalg.eigvals(product).astype(np.complex128)
    with np.errstate(over="ignore"):
        values = np.ldexp(values.real, power) + 1j * np.ldexp(values.imag, power)
    values.imag[values.imag == 0.0] = 0.0
    return np.asarray(values[np.lexsort((-values.imag, -values.real, -np.round(np.abs(values), 14)))])


def _normalised(matrix: NDArray[np.float64]) -> tuple[NDArray[np.float64], int]:
    top = float(np.abs(matrix).max())
    if top == 0.0 or not math.isfinite(top):
        return matrix, 0
    power = math.frexp(top)[1]
    return np.ldexp(matrix, -power), power


def _determinant(slope: NDArray[np.float64]) -> float:
    if slope.shape[0] == 2:
        return float(slope[0, 0] * slope[1, 1] - slope[0, 1] * slope[1, 0])
    return float(np.linalg.det(slope))


def _of_two(A: NDArray[np.float64], determinant: float) -> NDArray[np.complex128]:
    half, apart = 0.5 * float(A[0, 0] + A[1, 1]), 0.5 * float(A[0, 0] - A[1, 1])
    inner = apart * apart + float(A[0, 1] * A[1, 0])
    if inner < 0.0:
        modulus, imaginary = math.sqrt(max(determinant, 0.0)), math.sqrt(-inner)
        if modulus > abs(half):
            imaginary = math.sqrt((modulus - half) * (modulus + half))
        return np.array([complex(half, imaginary), complex(half, -imaginary)])
    large = half + math.copysign(math.sqrt(inner), half)
    return np.array([large, determinant / large if large != 0.0 else 0.0], dtype=np.complex128)


def unstable_count(values: NDArray[np.complex128]) -> int:
    """Return the number of multipliers outside the unit circle, those on it but for rounding left out."""
    return int(np.sum(np.abs(values) > 1.0 + NEUTRAL))


def multiplicity(values: NDArray[np.complex128], kind: str) -> int:
    """Return how many multipliers (SN, BP, PD) or pairs (TR) are critical at once; at least 1.

    Equal multipliers come apart by a root of the matrix' error, as the pair of a conservative orbit does where it meets
    at -1. The coefficients of their polynomial do not, and tell that they are one.

    Parameters
    ----------
    values : ndarray of complex, shape (n,)
        Multipliers at a special point.
    kind : str
        Type of the point; 1 for all others.
    """
    if kind == "TR":
        on_circle = (np.abs(np.abs(values) - 1.0) <= _CRITICAL) & (values.imag > _CRITICAL)
        return max(int(np.sum(on_circle)), 1)
    goal = {"SN": 1.0, "BP": 1.0, "PD": -1.0}.get(kind)
    if goal is None:
        return 1
    away = values[np.isfinite(values)] - goal
    away = away[np.argsort(np.abs(away))]
    near = range(1, int(np.sum(np.abs(away) < 1.0)) + 1)
    return max((k for k in near if np.all(np.abs(np.poly(away[:k])[1:]) <= _CRITICAL)), default=1)


def count_outside(values: NDArray[np.complex128]) -> int:
    """Return how many multipliers lie outside the unit circle, beyond what rounding may do."""
    return int(np.sum(np.abs(values) > 1.0 + _CRITICAL))


def fold_product(values: NDArray[np.complex128]) -> float:
    """Return the `combined` 1 - mu over sqrt(1 + abs(mu)^2); it vanishes with a multiplier 1."""
    return _single(values, 1.0)


def flip_product(values: NDArray[np.complex128]) -> float:
    """Return the `combined` 1 + mu over sqrt(1 + abs(mu)^2); it vanishes with a multiplier -1."""
    return _single(values, -1.0)


def _single(values: NDArray[np.complex128], goal: float) -> float:
    return float(combined(_over_size(1.0 - goal * values, values)))


def pair_product(values: NDArray[np.complex128]) -> float:
    """Return the `combined` m - 1 over sqrt(1 + abs(m)^2) of all pairs, with the product m of the pair.

    It vanishes where a complex pair is on the unit circle, or where the product of two real multipliers is 1.
    """
    first, second = np.triu_indices(values.size, 1)
    with np.errstate(over="ignore", invalid="ignore"):
        products = values[first] * values[second]
    return float(combined(_over_size(products - 1.0, products)))


def _over_size(factors: NDArray[np.complex128], values: NDArray[np.complex128]) -> NDArray[np.complex128]:
    """Return factors over sqrt(1 + abs(value)^2); 1 for infinite values."""
    finite = np.isfinite(values)
    sizes = np.hypot(1.0, np.abs(np.where(finite, values, 0.0)))
    return np.asarray(np.where(finite, np.where(finite, factors, 0.0) / sizes, 1.0))
