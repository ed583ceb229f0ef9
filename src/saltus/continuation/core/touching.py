"""Places within a step at which a singular monitor function touches 0 and keeps its sign.

There an eigenvalue touches 0, and curves may cross. docs/theory/equilibria.md, "Touching eigenvalues".
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.core.within_step import dips
from saltus.continuation.core.zero_problem import Event, Point, ZeroProblem, correct, hermite, hermite_slope
from saltus.scales import ROOT_SMOOTH, TOUCHES_ZERO, TOUCHING_SHARE

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["touches_between"]

_PLACES = 8  # in an interval, where a polynomial is fitted


def touches_between(problem: ZeroProblem, before: Point | None, a: Point, b: Point) -> list[Event]:
    """Return the events of a step in which a function touches 0 and no other one changes its sign; none otherwise.

    It is asked of a step that is refused because a function may vanish twice in it.
    """
    names = getattr(problem, "touching", {})
    if not names or b.examined.data is None or before is None:
        return []
    found = []
    back, ahead = a.arc - before.arc, b.arc - a.arc
    for name in b.examined.monitors:
        rows = [point.examined.monitors.get(name, math.nan) for point in (before, a, b)]
        if not dips([rows[0], rows[1], rows[2]], back, ahead):
            continue
        if name not in names and name not in problem.singular:
            return []  # that function may vanish twice
        if name in names and (event := touched(problem, name, a, b)) is not None:
            found.append(replace(event, name=names[name]))
    changed = [
        name for name, value in b.examined.monitors.items() if value * a.examined.monitors.get(name, math.nan) <= 0.0
    ]
    return [] if changed else found


def touched(problem: ZeroProblem, name: Any, a: Point, b: Point) -> Event | None:
    """Return the place between two points at which a monitor function touches 0; None where it touches it nowhere.

    A root of the function, with the sign of the distance from that place, is smooth. Its zero is simple. Where the
    function stays away from 0, or passes it twice, no root is smooth.
    """
    values = a.examined.monitors.get(name, math.nan), b.examined.monitors.get(name, math.nan)
    largest = max(abs(value) for value in values)
    if not (values[0] * values[1] > 0.0 and math.isfinite(largest)):
        return None
    sign, low, high, share = math.copysign(1.0, values[0]), 0.0, 1.0, math.nan
    for zoom in (0.2, 0.2, 0.0):  # share of the interval that is looked at next
        shares = low + (high - low) * 0.5 * (1.0 - np.cos((np.arange(_PLACES) + 0.5) * math.pi / _PLACES))
        row = sign * np.array([_value(problem, name, a, b, s)[0] for s in shares])
        clear = np.abs(row) > ROOT_SMOOTH * largest  # nearer to 0 a point may lie on the other branch
        found = _root(shares, np.abs(row)) if np.isfinite(row).all() and np.all(row[clear] > 0.0) else math.nan
        if not low <= found <= high:
            break
        share = found
        length = 0.5 * zoom * (high - low)
        low, high = max(0.0, share - length), min(1.0, share + length)
    if math.isnan(share):
        return None
    value, point = _value(problem, name, a, b, share)
    if point is None:
        return None
    if not abs(value) <= TOUCHES_ZERO * largest:
        return None
    point.arc = a.arc + share * (b.arc - a.arc)
    point.examined = problem.examine(point, None)
    return Event(name, point, value)


def _value(problem: ZeroProblem, name: Any, a: Point, b: Point, share: float) -> tuple[float, Point | None]:
    """Return a monitor function at a share of a step, and the point there; NaN and None where there is none."""
    length = b.arc - a.arc
    u, tangent = hermite(a, b, length, share), hermite_slope(a, b, length, share)
    tangent /= math.sqrt(float(a.weights @ tangent**2))
    point = correct(problem, u, tangent, a.weights, 2 * _PLACES)
    if isinstance(point, str) or not float(a.weights @ (point.u - u) ** 2) <= (TOUCHING_SHARE * length) ** 2:
        return _at(problem, name, u, tangent, a)
    return problem.monitor(name, point), point


def _at(
    problem: ZeroProblem, name: Any, u: NDArray[np.float64], tangent: NDArray[np.float64], a: Point
) -> tuple[float, Point | None]:
    """Return what `_value` does of unknowns that solve the equations but for what the singular direction takes."""
    from saltus.system.numba_tools.linear import bordered

    F, J = problem.evaluate(u)
    _, sign, log, _, residual = bordered(J, F, a.weights * tangent, u, u, problem.scale())
    if not np.isfinite(J).all():
        return math.nan, None
    point = Point(u, J, tangent, a.weights, sign, log if sign else -math.inf, residual)
    return problem.monitor(name, point) if sign else 0.0, point


def _root(shares: NDArray[np.float64], row: NDArray[np.float64]) -> float:
    """Return where a function touches 0, by the smoothest of its roots; NaN where none is smooth."""
    best, found = ROOT_SMOOTH, math.nan
    for power in (2, 4):
        root = row ** (1.0 / power)
        for turn in range(1, shares.size):
            signed = np.where(np.arange(shares.size) < turn, -root, root)
            if abs(turn - int(np.argmin(row))) > 1:
                continue
            centre, half = float(np.mean(shares)), 0.5 * float(np.ptp(shares))
            fit = np.polynomial.polynomial.polyfit((shares - centre) / half, signed, 5)
            missed = np.abs(np.polynomial.polynomial.polyval((shares - centre) / half, fit) - signed).max()
            missed = float(missed) / float(np.abs(signed).max() or 1.0)
            zeros = np.polynomial.polynomial.polyroots(fit)
            inside = [z.real for z in zeros if abs(z.imag) < ROOT_SMOOTH and abs(z.real) <= 1.0]
            if missed < best and len(inside) == 1:
                best, found = missed, centre + half * inside[0]
    return found
