"""The ledger of a locus: its condition holds, and its coefficient and other values change only at points that say so.

docs/theory/continuation.md, "The audit", lists the checks. Loci of SN, PD, TR and HB are looked at.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.equilibria.spectrum import NEUTRAL
from saltus.scales import EPS, LIKE_ONE, SOLVED, critical_error, value_error

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["holds", "other_values", "signs_of_coefficient"]

_Found = tuple[list[tuple[float, str]], int]

_COEFFICIENTS = {"SN": "CP", "PD": "GPD", "TR": "CH", "HB": "GH"}  # points at which the coefficient of a type vanishes
_GOALS = {"SN": 1.0, "PD": -1.0}  # critical multipliers
_TURNS = ("TP", "EX")  # points at which nothing bifurcates


def _values(curve: Any) -> NDArray[np.complex128] | None:
    """Return multipliers or eigenvalues, shape (point, value), those of the flow left out; None of other loci."""
    if curve.type not in _COEFFICIENTS or len(curve.varied) < 2:
        return None
    if hasattr(curve, "eigenvalues"):
        return np.asarray(curve.eigenvalues)
    if not hasattr(curve, "multipliers"):
        return None
    values = np.asarray(curve.multipliers)
    return values[:, :-1] if hasattr(curve, "means") and curve.system.phase is None else values


def _told(curve: Any, values: NDArray[np.complex128]) -> NDArray[np.bool_]:
    """Return at which points values near critical have digits left, shape (point,)."""
    finite = np.all(np.isfinite(values), axis=1)
    if hasattr(curve, "eigenvalues"):
        return np.asarray(finite)
    error = value_error(curve.tolerance) if hasattr(curve, "tolerance") else EPS
    largest = np.where(np.isfinite(values), np.abs(values), np.inf).max(axis=1, initial=0.0)
    return np.asarray(finite & (error * largest < LIKE_ONE))


def _away(curve: Any, values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return how far each value is from critical, shape (point, value); of eigenvalues over the largest."""
    if hasattr(curve, "eigenvalues"):
        tops = np.abs(values).max(axis=1, keepdims=True)
        away = np.abs(values) if curve.type == "SN" else np.abs(values.real)
        return np.asarray(away / np.where(tops > 0.0, tops, 1.0))
    return np.abs(np.abs(values) - 1.0) if curve.type == "TR" else np.abs(values - _GOALS[curve.type])


def holds(curve: Any) -> _Found:
    """Return the points of a locus at which no value is critical."""
    values = _values(curve)
    if values is None or values.shape[1] < (2 if hasattr(curve, "eigenvalues") else 1):
        return [], 0  # of one eigenvalue no other tells the size
    known = _told(curve, values)
    for point in curve.special_points:  # several values are critical there, or of another signature
        if point.type not in _TURNS:
            known[max(math.ceil(point.position - 1.0), 0) : math.floor(point.position + 1.0) + 1] = False
    nearest = _away(curve, values).min(axis=1)
    error = critical_error(getattr(curve, "tolerance", SOLVED))
    wrong = np.flatnonzero(known & ~(nearest <= error)).tolist()
    return [(float(i), f"no value is critical: the nearest is {nearest[i]:.2g} away") for i in wrong], int(known.sum())


def signs_of_coefficient(curve: Any) -> _Found:
    """Return where the coefficient of the normal form changes its sign and no point says so, or a point says it alone.

    That of a saddle-node of equilibria has the sign of a null vector, which is a convention.
    """
    if _values(curve) is None or (curve.type == "SN" and not hasattr(curve, "means")):
        return [], 0
    name, coefficient = _COEFFICIENTS[curve.type], np.asarray(curve.coefficient)
    rows = np.flatnonzero(np.isfinite(coefficient) & (coefficient != 0.0))
    found = []
    places = np.array([point.position for point in curve.special_points if point.type not in _TURNS])
    own = [point.position for point in curve.special_points if point.type == name]
    for i, j in zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True):
        if j > i + 1:  # it is undetermined between
            continue
        turns = coefficient[i] * coefficient[j] < 0.0
        between = int(np.sum((places > i - 1) & (places < j + 1)))
        if turns and not between:
            found.append((0.5 * (i + j), f"the coefficient changes its sign between points {i} and {j} without {name}"))
        inner = [place for place in own if i < place < j]
        if not turns and len(inner) == 1 and between == 1:
            found.append((inner[0], f"{name} lies between points {i} and {j}, where the coefficient keeps its sign"))
    return found, max(len(rows) - 1, 0)


def other_values(curve: Any) -> _Found:
    """Return where the number of growing directions changes, the critical ones left out, and no point says so."""
    values = _values(curve)
    if values is None:
        return [], 0
    known = _told(curve, values)
    count = min(2 if curve.type in ("TR", "HB") else 1, values.shape[1])
    order = np.argsort(_away(curve, values), axis=1, kind="stable")[:, count:]
    others = np.take_along_axis(values, order, axis=1)
    if hasattr(curve, "eigenvalues"):
        growth, error = others.real, NEUTRAL * np.abs(values).max(axis=1, keepdims=True)
    else:
        moduli = np.abs(others)
        growth = moduli - 1.0
        error = value_error(getattr(curve, "tolerance", SOLVED)) * np.maximum(1.0, moduli)
    clear = known & np.all(np.abs(growth) > error, axis=1)
    numbers, rows = np.sum(growth > 0.0, axis=1), np.flatnonzero(clear)
    places = np.array([point.position for point in curve.special_points if point.type not in _TURNS])
    found = []
    for i, j in zip(rows[:-1].tolist(), rows[1:].tolist(), strict=True):
        if numbers[i] != numbers[j] and not np.any((places > i - 1) & (places < j + 1)):
            text = (
                f"{numbers[i]} further growing directions at point {i}, {numbers[j]} at point {j}: nothing lies between"
            )
            found.append((0.5 * (i + j), text))
    return found, max(len(rows) - 1, 0)
