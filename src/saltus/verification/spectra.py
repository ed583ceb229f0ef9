"""Eigenvalues of products of matrices with the digits that they have, and how two sets of eigenvalues correspond."""

from __future__ import annotations

import contextlib
import functools
import itertools
import math
from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import (
    DOUBLES_SUFFICE,
    FINEST,
    INFINITE,
    SENSITIVITIES,
    VERIFIED_EIGENVALUE,
    VERIFIED_MULTIPLIER,
    followed,
)
from saltus.verification.table import Row, compared, unchecked

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["growth_on_the_way", "has_multiplier_condition", "matched", "multiplier_condition", "paired", "spectrum"]

_DIGITS = 60  # of the arithmetic in which a product and its eigenvalues are computed
_AT_ONE = {"SN": 1.0, "BP": 1.0, "CP": 1.0, "PD": -1.0, "GPD": -1.0}  # places of critical multipliers
_ON_CIRCLE = ("TR", "CH")  # types with a pair on the unit circle
_AT_ANGLES = {"R1": 0.0, "R2": math.pi, "R3": 2.0 * math.pi / 3.0, "R4": 0.5 * math.pi}  # their angles at resonances

# types at which two things happen to different multipliers
_TWICE = {
    "FF": ("SN", "PD"),
    "FNS": ("SN", "TR"),
    "PDNS": ("PD", "TR"),
    "NSNS": ("TR", "TR"),
    "SNSN": ("SN", "SN"),
    "PDPD": ("PD", "PD"),
}


def spectrum(
    steps: Sequence[NDArray[np.float64]],
    sizes: NDArray[np.float64],
    dropped: int = 0,
    least: float = VERIFIED_MULTIPLIER,
    error: float | None = None,
    *,
    zeros: bool = False,
) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Return the eigenvalues of a product of matrices, the largest modulus first, and how far each may be off.

    Parameters
    ----------
    steps : sequence of ndarray, shape (n, n)
        The factors; the first one acts first.
    sizes : ndarray, shape (n,)
        Sizes of the components.
    dropped : int
        How many eigenvalues are known to be 0 and left out.
    least : float
        Absolute accuracy that is asked of any eigenvalue.
    error : float, optional
        Relative error of the factors; by default that of an integration at the finest tolerance.
    zeros : bool
        Whether eigenvalues below the error of the whole product may have been taken for 0.
    """
    from scipy.linalg import eig

    scaled = [step * sizes / sizes[:, None] for step in steps]
    with np.errstate(all="ignore"):
        product = functools.reduce(lambda before, step: step @ before, scaled)
    if not np.all(np.isfinite(product)):
        values = _many_digits(scaled)
        order = np.argsort(-np.abs(values), kind="stable")[: values.size - dropped]
        return values[order], np.full(order.size, np.inf)
    values, left, right = eig(product, left=True)
    values, norm = values.astype(np.complex128), float(np.linalg.norm(product, 2))
    condition = 1.0 / np.maximum(np.abs(np.sum(left.conj() * right, axis=0)), 1e-8)
    error = followed(FINEST) if error is None else error
    level = error * growth_on_the_way(steps, sizes)  # what the factors' errors leave of an eigenvalue
    if norm > DOUBLES_SUFFICE * float(np.abs(values).min(initial=1.0)):
        precise = _many_digits(scaled)
        if not np.all(np.isfinite(precise)):
            return np.full(values.size - dropped, complex(math.nan)), np.full(values.size - dropped, math.inf)
        order = _order(precise, values)
        values, condition = precise, condition[order]
    uncertain = np.minimum(condition * level, np.sqrt(level * max(norm, 1.0))) + max(least, VERIFIED_EIGENVALUE * norm)
    if zeros:
        whole = functools.reduce(lambda before, step: step @ before, scaled[:-1])
        uncertain += SENSITIVITIES * error * float(np.linalg.norm(whole, 2))
    order = np.argsort(-np.abs(values), kind="stable")[: values.size - dropped]
    return values[order], uncertain[order]


def growth_on_the_way(steps: Sequence[NDArray[np.float64]], sizes: NDArray[np.float64]) -> float:
    """Return by how much an error of a factor may grow in a product, over the sizes.

    The growth is the largest product of the norms of what acts before a place and of what acts behind.
    """
    scaled = [step * sizes / sizes[:, None] for step in steps]
    one = np.eye(sizes.size)
    with np.errstate(all="ignore"):
        before = [one, *itertools.accumulate(scaled, lambda product, step: step @ product)]
        behind = [one, *itertools.accumulate(scaled[::-1], lambda product, step: product @ step)][::-1]
        norms = [np.linalg.norm(a) * np.linalg.norm(b) for a, b in zip(before, behind, strict=True)]
    return float(np.nan_to_num(max(norms), nan=np.inf))


def matched(
    said: NDArray[np.complex128], found: NDArray[np.complex128], uncertain: NDArray[np.float64]
) -> Iterator[tuple[complex, complex, float]]:
    """Yield pairs of eigenvalues, each of one set with its counterpart in the other, and their allowed distance."""
    from scipy.optimize import linear_sum_assignment

    finite = np.flatnonzero(np.isfinite(said))
    distance = np.abs(said[finite, None] - found[None, :])
    rows, columns = linear_sum_assignment(np.log(distance + 1e-12))
    for i, j in zip(rows.tolist(), columns.tolist(), strict=True):
        yield complex(said[finite[i]]), complex(found[j]), float(uncertain[j] + 1e-7 * abs(found[j]))


def paired(values: NDArray[np.complex128], others: NDArray[np.complex128]) -> NDArray[np.intp]:
    """Return the index in `others` of the partner of each of `values`; both have one length."""
    from scipy.optimize import linear_sum_assignment

    distance = np.abs(np.subtract.outer(values, others))
    return np.asarray(linear_sum_assignment(np.nan_to_num(distance, nan=INFINITE, posinf=INFINITE))[1])


def has_multiplier_condition(kind: str) -> bool:
    """Whether a type of special points is told by the place of a multiplier."""
    return any(kind in known for known in (_AT_ONE, _ON_CIRCLE, _AT_ANGLES, _TWICE))


def multiplier_condition(
    values: NDArray[np.complex128], kind: str, multiplicity: int = 1, loose: float = 0.0
) -> list[Row]:
    """Return the check that multipliers lie at the place that a type of special points has.

    loose: error of the multipliers besides that of an orbit of the finest tolerance.
    """
    if kind in _TWICE:
        one, other = _TWICE[kind]
        if one != other:
            return [row for kind in (one, other) for row in multiplier_condition(values, kind, 1, loose)]
        if one in _AT_ONE:
            return multiplier_condition(values, one, 2, loose)
        pairs = np.sort(np.abs(np.abs(values[values.imag > 0.0]) - 1.0))
        found = float(pairs[1]) if pairs.size > 1 else math.nan
        return [compared("two critical pairs, from the unit circle", 0.0, found, 1e-6 + loose)]
    allowed = (1e-6 if multiplicity == 1 else 1e-3) + loose
    name = "critical multiplier" if multiplicity == 1 else f"critical multipliers, {multiplicity} of them"
    if kind in _AT_ONE:
        distance = np.sort(np.abs(values - _AT_ONE[kind]))
        found = float(distance[multiplicity - 1]) if distance.size >= multiplicity else math.nan
        return [compared(f"{name}, from {_AT_ONE[kind]:g}", 0.0, found, allowed)]
    if kind in _ON_CIRCLE:
        pairs = np.sort(np.abs(np.abs(values[values.imag > 0.0]) - 1.0))
        found = float(pairs[multiplicity - 1]) if pairs.size >= multiplicity else math.nan
        return [compared(f"{name}, from the unit circle", 0.0, found, allowed)]
    if kind in _AT_ANGLES:
        angle = _AT_ANGLES[kind]
        place = complex(math.cos(angle), math.sin(angle))
        digits = 1e-3 if kind in ("R1", "R2") else 1e-5  # a double multiplier has half the digits
        return [compared(f"{name}, from that of {kind}", 0.0, float(np.abs(values - place).min()), digits + loose)]
    return [unchecked(f"type {kind}", kind, "no independent condition")]


def _order(values: NDArray[np.complex128], rough: NDArray[np.complex128]) -> NDArray[np.intp]:
    from scipy.optimize import linear_sum_assignment

    return np.asarray(linear_sum_assignment(np.abs(values[:, None] - rough[None, :]))[1])


def _many_digits(steps: Sequence[NDArray[np.float64]]) -> NDArray[np.complex128]:
    """Return the eigenvalues of a product that is computed with many digits; NaN where none are found."""
    import mpmath

    if steps[0].shape == (1, 1):  # its eig returns vectors of such a matrix, whatever is asked of it
        return np.array([math.prod(float(step[0, 0]) for step in steps)], np.complex128)
    with mpmath.workdps(_DIGITS):
        product = mpmath.eye(steps[0].shape[0])
        for step in steps:
            product = mpmath.matrix(step.tolist()) * product
        for matrix in (product, product.T):
            with contextlib.suppress(RuntimeError):  # its iteration may end before a multiple eigenvalue has parted
                values = mpmath.eig(matrix, left=False, right=False)
                return np.array([complex(value) for value in values])
    return np.full(product.rows, complex(math.nan))
