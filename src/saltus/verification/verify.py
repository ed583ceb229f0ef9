"""`verify`: checks of solutions, special points and curves, by means that share no code with how they were made."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import singledispatch
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.continuation.algebraic_curve import AlgebraicCurve
from saltus.continuation.orbit_columns import OrbitColumns
from saltus.continuation.special_points import SpecialPoint
from saltus.cycles.orbit import MapOrbit
from saltus.equilibria import Equilibrium
from saltus.errors import InputError
from saltus.orbits import PeriodicOrbit
from saltus.verification.algebraic import (
    cycle_condition,
    cycle_rows,
    equilibrium_condition,
    equilibrium_rows,
    multiplier_condition,
    spectrum_of,
)
from saltus.verification.motion import StiffMotionError
from saltus.verification.orbits import followed, is_rest, least_contact, orbit_rows, shrunk_rows
from saltus.verification.table import Row, Verification, compared, equal, placed, unchecked, worst

if TYPE_CHECKING:
    from collections.abc import Sequence

__all__ = ["verify"]

_TOUCHES = 1e-6  # allowed distance of a grazing orbit from its surface, over the surface's unit
_AT_ONE = {"SN": 1.0, "BP": 1.0, "CP": 1.0, "PD": -1.0, "GPD": -1.0}  # critical multipliers
_AT_SURFACES = ("GR", "BE", "BC")  # types at which the number of unstable directions may jump
_STEPS = {"SN": 1, "BP": 1, "PD": 1, "HB": 2, "TR": 2}  # unstable directions that one passes


def verify(result: Any, *, points: int = 9) -> Verification:
    """Check a solution, a special point or a curve by an independent computation.

    The equations are read anew from the definition. Orbits are integrated by SciPy at 1e-12, segment by segment, with
    monodromies by differences and projections at events; eigenvalues are computed by mpmath where doubles lose digits.
    docs/verification.md says what is compared, and with what accuracy.

    Parameters
    ----------
    result : PeriodicOrbit, Equilibrium, MapOrbit, SpecialPoint, branch or locus
        What is checked.
    points : int, optional
        How many solutions of a branch or a locus are checked, besides those next to its special points.

    Returns
    -------
    Verification
        A table of claims, each with said and found values and a verdict. Along a curve each claim stands once, at the
        solution where it is nearest to what is allowed; claims that differ are all listed.

    Raises
    ------
    InputError
        A result of another kind, or a number of points that is none.

    Examples
    --------
    >>> from saltus import HybridSystem, continue_equilibrium, find_equilibrium, verify
    >>> fold = HybridSystem.smooth({"x": "r - x**2"}, {"r": 1.0})
    >>> checked = verify(continue_equilibrium(find_equilibrium(fold, x0=[1.0]), "r", (-1.0, 2.0)))
    >>> checked.passed, len(checked.unchecked)
    (True, 0)
    """
    count = checks.count("points", points)
    return Verification(f"{type(result).__name__}", tuple(_rows(result, count)))


@singledispatch
def _rows(result: Any, points: int) -> list[Row]:
    known = "an orbit, an equilibrium, a cycle of a map, a special point, a branch or a locus"
    raise InputError("result", type(result).__name__, known)


@_rows.register
def _(result: PeriodicOrbit, points: int) -> list[Row]:
    return orbit_rows(result)


@_rows.register
def _(result: Equilibrium, points: int) -> list[Row]:
    return equilibrium_rows(result)


@_rows.register
def _(result: MapOrbit, points: int) -> list[Row]:
    return cycle_rows(result)


@_rows.register
def _(result: SpecialPoint, points: int) -> list[Row]:
    kind, solution = result.type, result.solution
    multiplicity = getattr(result, "multiplicity", 1)
    if result.homoclinic is not None:
        return placed(result.label, equilibrium_rows(result.homoclinic.saddle))
    wanted = [kind] if not result.locus or kind == result.locus else [result.locus, kind]
    rows = [row for one in wanted for row in _condition(solution, one, multiplicity)]
    if not (isinstance(solution, PeriodicOrbit) and kind in ("HB", "BE")):
        rows += [row for row in _rows(solution, points) if not _is_critical(row)]
    return placed(result.label, rows)


@_rows.register
def _(result: OrbitColumns, points: int) -> list[Row]:
    return _curve_rows(result, result.orbit, points)


@_rows.register(AlgebraicCurve)
def _(result: AlgebraicCurve[Any], points: int) -> list[Row]:
    return _curve_rows(result, result._solution, points)


def _is_critical(row: Row) -> bool:
    """Whether a claim means nothing at a critical solution: where Newton's method is singular, what is marginal."""
    return row.what in ("distance from Newton's solution", "place", "stable", "unstable directions", "admissible")


def _condition(solution: Any, kind: str, multiplicity: int) -> list[Row]:
    """Return the check of a special point's own condition."""
    if isinstance(solution, Equilibrium):
        return equilibrium_condition(solution, kind, multiplicity)
    if isinstance(solution, MapOrbit):
        return cycle_condition(solution, kind, multiplicity)
    if kind == "HB":
        return shrunk_rows(solution)
    if kind not in (*_AT_ONE, "TR", "CH", "R1", "R2", "R3", "R4", "GR"):
        return [unchecked(f"type {kind}", kind, "no independent condition")]
    try:
        found = followed(solution)
    except (StiffMotionError, np.linalg.LinAlgError):
        return [unchecked(f"type {kind}", kind, "the motion cannot be followed by an explicit integration")]
    if kind == "GR":
        return [compared("least distance from a contact without speed", 0.0, least_contact(solution, found), _TOUCHES)]
    return multiplier_condition(found.multipliers, kind, _AT_ONE, multiplicity)


def _curve_rows(curve: Any, solution: Any, points: int) -> list[Row]:
    """Return the checks of a curve: of some of its solutions, of all special points, and of what changes between."""
    chosen = _chosen(curve, points)
    rows: list[Row] = []
    counts: dict[int, tuple[int, bool]] = {}
    for index in chosen:
        one = solution(index)
        found = _rows(one, points)
        rows += placed(_place(curve, index), found)
        counts[index] = _unstable(one)
        if len(curve.varied) > 1:
            rows += placed(_place(curve, index), _condition(one, curve.type, 1))
    rows = worst(rows)
    for point in curve.special_points:
        rows += _rows(point, points)
    if len(curve.varied) == 1:
        rows += list(_account(curve, counts))
    return rows


def _chosen(curve: Any, points: int) -> list[int]:
    """Return the indices of the solutions that are checked: spread evenly, and both neighbours of special points."""
    last = len(curve) - 1
    spread = np.unique(np.linspace(0, last, min(points, last + 1)).round().astype(int)).tolist()
    beside = [math.floor(p.position) + k for p in curve.special_points for k in (0, 1)]
    return sorted({index for index in (*spread, *beside) if 0 <= index <= last})


def _place(curve: Any, index: int) -> str:
    values = np.atleast_1d(curve.values[index])
    return ", ".join(f"{name} = {value:.6g}" for name, value in zip(curve.varied, values, strict=True))


def _unstable(solution: Any) -> tuple[int, bool]:
    """Return the independent number of unstable directions, and whether none is marginal."""
    if isinstance(solution, PeriodicOrbit):
        if is_rest(solution):
            return 0, False
        try:
            found = followed(solution)
        except (StiffMotionError, np.linalg.LinAlgError):
            return 0, False
        values, uncertain = found.multipliers, found.uncertain
    else:
        values, uncertain = spectrum_of(solution)
    if isinstance(solution, Equilibrium):
        return int(np.sum(values.real > 0.0)), bool(np.all(np.abs(values.real) > uncertain))
    sizes = np.abs(values)
    return int(np.sum(sizes > 1.0)), bool(np.all(np.abs(sizes - 1.0) > uncertain))


def _account(curve: Any, counts: dict[int, tuple[int, bool]]) -> Iterator[Row]:
    """Yield for each two neighbouring checked solutions whether the points between explain what changes."""
    met = [p.position for p in curve.special_points if p.type in _AT_SURFACES]
    sure = [
        index for index, (_, known) in sorted(counts.items())
        if known and all(abs(index - position) > 0.5 for position in met)
    ]  # fmt: skip
    changes = explained = 0
    for a, b in pairwise(sure):
        change = counts[b][0] - counts[a][0]
        between = [p for p in curve.special_points if a <= p.position <= b]
        changes += change != 0
        explained += change != 0 and _explains(between, change)
        if not _explains(between, change):
            told = " and ".join(p.label for p in between) or "no point"
            row = equal("change of the unstable directions", f"as by {told}", f"{change:+d}")
            yield row._replace(place=f"{_place(curve, a)} to {_place(curve, b)}")
    yield equal("changes of stability that are explained", changes, explained)


def _explains(between: Sequence[SpecialPoint[Any]], change: int) -> bool:
    """Whether special points may change the number of unstable directions by so much."""
    if any(p.type in _AT_SURFACES for p in between):
        return True  # multipliers jump where a surface is met
    steps = [_STEPS[p.type] * getattr(p, "multiplicity", 1) for p in between if p.type in _STEPS]
    most = sum(steps)
    return abs(change) <= most and (most - change) % 2 == 0
