"""The ledger of stability: how many directions grow along a curve, and what the special points between explain.

docs/theory/continuation.md, "The audit", lists what each type of point changes.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.core.point_types import CHANGES, POINT_TYPES, accumulates
from saltus.equilibria import Equilibrium
from saltus.equilibria.spectrum import NEUTRAL
from saltus.scales import (
    EPS,
    LIKE_ONE,
    LOCATED,
    POINT_OF_BRANCH,
    SEPARATED,
    SOLVED,
    critical_error,
    same,
    value_error,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["at_one", "contradicted_labels", "critical_rows", "growing", "unexplained"]

_SINGLE = ("SN", "PD")  # types at which one direction begins to grow or to shrink
_PAIRED = ("TR", "HB")  # types at which two do
_FREE = ("EX", "TP")  # types that say nothing of stability, as users' events
_BORDER = "the domain of mode"  # what the end of a branch says where a mode's equations end


def _critical(curve: Any) -> NDArray[np.complex128] | None:
    """Return the multipliers that tell stability, or the eigenvalues, shape (point, value); None for other kinds."""
    if "eigenvalues" in vars(curve):
        return np.asarray(curve.eigenvalues)
    if "multipliers" not in vars(curve):
        return None
    values = np.asarray(curve.multipliers)
    trivial = "means" in vars(curve) and curve.system.phase is None  # that of the flow stands last
    return values[:, :-1] if trivial else values


def growing(curve: Any) -> NDArray[np.int64] | None:
    """Return the least and the greatest number of directions that may grow at each point, (point, 2); -1 if unknown.

    None where no eigenvalues or multipliers tell them, and along loci.
    """
    values = _critical(curve) if len(curve.varied) == 1 else None
    if values is None:
        return None
    if "eigenvalues" in vars(curve):
        errors = NEUTRAL * _sizes(curve, values)
        growth = values.real
    else:
        moduli = np.abs(values)
        growth = np.where(np.isfinite(moduli), moduli - 1.0, math.inf)
        errors = value_error(vars(curve).get("tolerance", SOLVED)) * np.maximum(
            1.0, np.where(growth < 1e300, moduli, 1.0)
        )
    known = np.empty((len(values), 2), dtype=np.int64)
    known[:, 0], known[:, 1] = (growth > errors).sum(axis=1), (growth >= -errors).sum(axis=1)
    if not np.isfinite(values).all():
        known[np.isnan(values).any(axis=1)] = -1
    return known


def _sizes(curve: Any, values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the sizes of the eigenvalues, shape (point, value), in the order in which they are held; or (point, 1)."""
    moduli = np.abs(values)
    top = moduli.max(axis=1, initial=0.0)
    slow = moduli.min(axis=1, initial=math.inf) < SEPARATED * top
    if not slow.any():
        return np.asarray(top[:, None])
    found = np.repeat(top[:, None], values.shape[1], axis=1)
    for i in np.flatnonzero(slow).tolist():
        found[i] = curve.solution(i).value_sizes
    return found


def unexplained(curve: Any, counts: NDArray[np.int64] | None) -> tuple[list[tuple[float, str]], int]:
    """Return where the number of growing directions changes by what no special point between explains.

    counts: what `growing` returns.
    """
    if counts is None or (vars(curve).get("fixed") or curve).__dict__.get("family"):
        return [], 0
    rows = counts.tolist()
    for end, reason in zip((0, -1), curve.stopped, strict=True):
        if _BORDER in reason:  # the equations may be 0/0 there
            rows[end] = [-1, -1]
    known = [i for i, (least, _) in enumerate(rows) if least >= 0]
    if len(known) < 2:
        return [], 0
    slack = min(rows[i][1] - rows[i][0] for i in known)
    clear = [i for i in known if rows[i][1] - rows[i][0] == slack]
    points = sorted(curve.special_points, key=lambda point: point.position)
    places = [point.position for point in points]
    found, told, first = [], 0, 0
    for i, j in pairwise(clear):
        while first < len(points) and places[first] <= i - 1.0:
            first += 1
        # the point at which a signature changes has the multipliers of either
        between = []
        if first < len(points) and places[first] < j + 1.0:
            between = [point for point in points[first:] if i - _wide(point) < point.position < j + _wide(point)]
        change = rows[j][0] - rows[i][0]
        if not between and abs(change) <= slack:
            told += 1
            continue
        explained = _explained(curve, between, change, slack)
        if explained is False and j > i + 1:
            explained = None  # a point of the branch is critical itself, as where it starts at a fold
        told += explained is not None
        if explained is False:
            names = ", ".join(point.label for point in between) or "nothing"
            text = f"{rows[i][0]} growing directions at point {i}, {rows[j][0]} at point {j}: {names} lies between"
            found.append((0.5 * (i + j), text))
    return found, told


def critical_rows(curve: Any, counts: NDArray[np.int64] | None) -> NDArray[np.bool_]:
    """Return which points of a branch are critical within the error of their values, shape (point,).

    counts: what `growing` returns.
    """
    if counts is None:
        return np.zeros(len(curve), dtype=np.bool_)
    width = counts[:, 1] - counts[:, 0]
    return np.asarray(width > width.min())


def _wide(point: Any) -> int:
    """Return how many points beside a special point may have the values of its other side."""
    return 1 if point.type in (*CHANGES, "BE") or accumulates(point.type, point.locus) else 0


def _explained(curve: Any, between: list[Any], change: int, slack: int) -> bool | None:
    """Return whether special points explain a change; None where one of them may change anything.

    The cycles of a branch may be neutral where they end at a Hopf point, as along a family.
    """
    reached = {0}
    for point in between:
        if point.type == "HB" and "eigenvalues" not in vars(curve):
            return None
        if point.type not in (*_SINGLE, *_PAIRED, "BP") and _says_nothing(point):
            continue
        if point.type not in (*_SINGLE, *_PAIRED, "BP"):
            return None
        share = 2 if point.type in _PAIRED else 1
        ways = [-1, 0, 1] if point.type == "BP" else [-1, 1]
        if not any(abs(known + share * way - change) <= slack for known in reached for way in ways):
            count = point.multiplicity  # several at once, which takes time to tell
            ways = ways if count == 1 else list(range(-count, count + 1))
        reached = {known + share * way for known in reached for way in ways}
    return any(abs(known - change) <= slack for known in reached)


def _says_nothing(point: Any) -> bool:
    """Return whether a special point is a user's event or an extremum."""
    return point.type in _FREE or point.type not in POINT_TYPES


def contradicted_labels(curve: Any, counts: NDArray[np.int64] | None) -> tuple[list[tuple[float, str]], int]:
    """Return special points whose critical value is none, and points whose stability contradicts their values.

    counts: what `growing` returns.
    """
    found, told = [], 0
    error = critical_error(vars(curve).get("tolerance", SOLVED))
    borders = [point.value(curve.varied[0]) for point in curve.special_points if point.type in CHANGES]
    apart = LOCATED * float(np.ptp(curve.values)) if borders else 0.0
    for point in curve.special_points if len(curve.varied) == 1 else ():
        away = _away(curve, point)
        if away is None or (borders and _together(point.value(curve.varied[0]), borders, apart)):
            continue  # next to a grazing multipliers change without bound
        told += 1
        if not away <= error + POINT_OF_BRANCH * _speed(curve, point):
            value = "eigenvalue" if point.solution.at_rest and hasattr(point.solution, "eigenvalues") else "multiplier"
            found.append((point.position, f"{point.label} has no critical {value}: the nearest is {away:.2g} away"))
    if counts is None:
        return found, told
    rows, stable = counts.tolist(), curve.stable.tolist()
    found += [
        (float(i), f"stable is {quiet}, but {least} to {most} directions grow")
        for i, ((least, most), quiet) in enumerate(zip(rows, stable, strict=True))
        if (least > 0 if quiet else most == 0)
    ]
    return found, told + sum(least >= 0 for least, _ in rows)


def _speed(curve: Any, point: Any) -> float:
    """Return how fast multipliers change by arclength where a special point lies; 0 where it cannot be told.

    On a canard that is so fast that the point's place, as far as it is known, moves a critical one.
    """
    values, first = _critical(curve), int(point.position)
    if values is None or "eigenvalues" in vars(curve) or not 0 <= first < len(values) - 1:
        return 0.0
    moved, apart = np.abs(values[first + 1] - values[first]), float(curve.arclength[first + 1] - curve.arclength[first])
    return float(moved.max(initial=0.0)) / apart if apart > 0.0 and np.all(np.isfinite(moved)) else 0.0


def at_one(curve: Any) -> NDArray[np.bool_]:
    """Return at which points a multiplier is at 1 within its error, as all along a family; all where none is known."""
    values = None if "eigenvalues" in vars(curve) else _critical(curve)
    if values is None:
        return np.ones(len(curve), dtype=bool)
    away = np.abs(values - 1.0).min(axis=1, initial=math.inf)
    return np.asarray(~(away > critical_error(vars(curve).get("tolerance", SOLVED))))


def _together(value: float, others: list[float], apart: float) -> bool:
    """Return whether a value of the parameter is one of others, as far as places are told apart."""
    return any(bool(same(value, other, apart)) for other in others)


def _away(curve: Any, point: Any) -> float | None:
    """Return how far the nearest value is from critical at an SN, BP, PD, TR or HB; None where it cannot be told."""
    solution = point.solution
    if isinstance(solution, Equilibrium):
        values = solution.eigenvalues
        if point.type in ("SN", "BP"):
            sizes = solution.value_sizes
            first = min(int(point.position), len(curve) - 1)
            beside = np.abs(curve.eigenvalues[first : first + 2])
            # all eigenvalues may vanish at the point; the size of a slow one vanishes with it
            sizes = np.maximum(sizes, beside.max() if np.ptp(sizes) == 0.0 else beside.min(axis=1).max())
            return float(np.min(np.abs(values) / np.where(sizes > 0.0, sizes, 1.0)))
        pairs = values[values.imag > 0.0] if point.type == "HB" else values[:0]
        return (
            float(np.min(np.abs(pairs.real) / np.abs(pairs)))
            if pairs.size
            else (math.inf if point.type == "HB" else None)
        )
    if point.type not in ("SN", "BP", "PD", "TR") or not hasattr(solution, "multipliers"):
        return None
    values = solution.multipliers
    if hasattr(solution, "durations") and solution.system.phase is None:
        values = values[:-1]
    error = value_error(curve.tolerance) if "tolerance" in vars(curve) else EPS
    if not np.all(np.isfinite(values)) or error * float(np.abs(values).max(initial=0.0)) > LIKE_ONE:
        return None  # beside so large a multiplier one near the unit circle has no digits left
    if point.type == "TR":
        pairs = values[values.imag > 0.0]
        return float(np.min(np.abs(np.abs(pairs) - 1.0), initial=math.inf))
    # in a file over turns of the phase, the doubling of a drive that repeats in them is a branch point
    goal = -1.0 if point.type == "PD" and point.tangent is None else 1.0
    return float(np.min(np.abs(values - goal), initial=math.inf))
