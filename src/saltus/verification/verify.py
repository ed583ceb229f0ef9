"""`verify`: checks of solutions, special points and curves, by means that share no code with how they were made."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import singledispatch
from itertools import pairwise
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.continuation.core.point_types import CHANGES, accumulates
from saltus.continuation.results.cascade import Doublings
from saltus.continuation.results.curve import SolutionCurve
from saltus.continuation.results.diagram import Diagram
from saltus.continuation.results.family import Family
from saltus.continuation.results.special_points import SpecialPoint
from saltus.equilibria import Equilibrium
from saltus.errors import InputError
from saltus.fitting.result import Fit
from saltus.maps.orbit import MapOrbit
from saltus.optimisation.optimum import Optimum
from saltus.orbits import PeriodicOrbit
from saltus.scales import EPS
from saltus.verification.algebraic import EquilibriumCheck, MapOrbitCheck, sizes_of
from saltus.verification.along import course_rows
from saltus.verification.averages import average_rows
from saltus.verification.best import fit_rows, optimum_rows
from saltus.verification.branch_points import meeting_rows
from saltus.verification.columns import ELSEWHERE, column_rows, solution_rows
from saltus.verification.names import test_rows
from saltus.verification.orbits import OrbitCheck
from saltus.verification.table import Row, Verification, compared, equal, place_of, placed, unchecked, worst
from saltus.verification.unread import unread_rows

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = ["verify"]

_AT_SURFACES = (*CHANGES, "BE")  # types at which the number of unstable directions may jump
_BY_NEWTON = ("distance from Newton's solution", "place")  # claims that mean nothing where the Jacobian is singular
_SINGULAR = ("SN", "BP")  # types of loci on which it is
_STEPS = {"SN": 1, "BP": 1, "PD": 1, "HB": 2, "TR": 2}  # unstable directions that one passes


def verify(result: Any, *, points: int = 9) -> Verification:
    """Check a solution, a special point or a curve by an independent computation.

    The equations are read anew from the definition. Orbits are integrated by SciPy at 1e-12, segment by segment, with
    variational equations and projections at events; eigenvalues are computed by mpmath where doubles lose digits.
    docs/verification.md says what is compared, and with what accuracy.

    Parameters
    ----------
    result : PeriodicOrbit, Equilibrium, MapOrbit, SpecialPoint, branch or locus
        What is checked; also a `Family`, a `Diagram`, a cascade, an `Optimum` or a `Fit`.
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
    >>> checked.passed, [row.what for row in checked.unchecked]
    (True, ['variable arclength', 'variable special_arclength', 'variable special_scale'])
    """
    count = checks.count("points", points)
    return Verification(f"{type(result).__name__}", tuple(_rows(result, count)))


_LONGEST = tuple(one for one in ELSEWHERE if one not in ("lows", "highs"))  # what is checked of a longest cycle
_NO_CONDITION = "no independent condition"  # why a type is not checked


@singledispatch
def _rows(result: Any, points: int) -> list[Row]:
    return [*_check(result).rows(), *solution_rows(result)]


@_rows.register
def _(result: SpecialPoint, points: int) -> list[Row]:
    return [*_point_rows(result, None, getattr(result.solution, "tolerance", None)), *unread_rows(result)]


@_rows.register(SolutionCurve)
def _(result: SolutionCurve[Any], points: int) -> list[Row]:
    return _curve_rows(result, points)


@_rows.register
def _(result: Family, points: int) -> list[Row]:
    rows = [*_over(result)]
    for i, branch in enumerate(result):
        if branch is not None:
            place = ", ".join(f"{name} = {values[i]:.6g}" for name, values in result.over.items())
            rows += [row._replace(place=f"{place}; {row.place}") for row in _curve_rows(branch, points)]
    return worst(rows)


@_rows.register
def _(result: Diagram, points: int) -> list[Row]:
    rows = [
        row._replace(place=f"branch {i}; {row.place}")
        for i, branch in enumerate(result)
        for row in _curve_rows(branch, points)
    ]
    return worst(rows)


@_rows.register
def _(result: Doublings, points: int) -> list[Row]:
    begun = [row if row.place else row._replace(place="start") for row in _rows(result.start, points)]
    rows = [*begun, *_doublings(result)]
    for k, branch in enumerate(result.branches):
        rows += [row._replace(place=f"period {2 ** (k + 1)}; {row.place}") for row in _curve_rows(branch, points)]
    return worst(rows)


@_rows.register
def _(result: Optimum, points: int) -> list[Row]:
    return [*_rows(result.orbit, points), *optimum_rows(result, points), *unread_rows(result)]


@_rows.register
def _(result: Fit, points: int) -> list[Row]:
    rows = [
        row._replace(place=f"branch {i}; {row.place}")
        for i, branch in enumerate(result.branches)
        for row in _curve_rows(branch, points)
    ]
    return [*worst(rows), *fit_rows(result, points)]


@singledispatch
def _check(solution: Any, sizes: NDArray[np.float64] | None = None) -> OrbitCheck | EquilibriumCheck | MapOrbitCheck:
    """Return the checks of one solution; the states have the sizes that they have along a curve, if any."""
    known = "an orbit, an equilibrium, an orbit of a map, a special point, a curve or several, an optimum or a fit"
    raise InputError("result", type(solution).__name__, known)


@_check.register(PeriodicOrbit)
def _(solution: PeriodicOrbit, sizes: NDArray[np.float64] | None = None) -> OrbitCheck:
    return OrbitCheck(solution, sizes)


@_check.register(Equilibrium)
def _(solution: Equilibrium, sizes: NDArray[np.float64] | None = None) -> EquilibriumCheck:
    return EquilibriumCheck(solution, sizes)


@_check.register(MapOrbit)
def _(solution: MapOrbit, sizes: NDArray[np.float64] | None = None) -> MapOrbitCheck:
    return MapOrbitCheck(solution, sizes)


def _point_rows(point: SpecialPoint[Any], sizes: NDArray[np.float64] | None, tolerance: float | None) -> list[Row]:
    """Return the checks of a special point, the states of the sizes that they have along its curve, if any.

    tolerance: that of the flow along its curve; None of equations without a flow.
    """
    rows = list(test_rows(point, tolerance))
    own, point = point, point.itself
    if point.homoclinic is not None:
        saddle = point.homoclinic.saddle
        rows += [*EquilibriumCheck(saddle).rows(), *solution_rows(saddle), *_claimed_at(own, sizes, _LONGEST)]
        return placed(point.label, rows)
    check, multiplicity = _check(point.solution, sizes), getattr(point, "multiplicity", 1)
    wanted = [point.type] if not point.locus or point.type == point.locus else [point.locus, point.type]
    if accumulates(point.type, point.locus):
        return placed(point.label, [*rows, unchecked(f"type {point.type}", point.type, _NO_CONDITION)])
    rows += [row for one in wanted for row in check.condition(one, multiplicity)]
    if point.type not in check.shrinks_at:
        rows += [row for row in check.rows() if not _is_critical(row)]
    rows += _claimed_at(point, sizes)
    if own is not point:
        rows += _claimed_at(own, sizes, _LONGEST)
    return placed(point.label, rows)


def _claimed_at(
    point: SpecialPoint[Any], sizes: NDArray[np.float64] | None, elsewhere: Sequence[str] = ELSEWHERE
) -> list[Row]:
    """Return what the solution of a special point says of itself, held against its unknowns."""
    told = () if point.type in _AT_SURFACES else ("regular", "admissible")
    states = None if isinstance(point.solution, MapOrbit) else sizes  # a map orbit has sizes at each of its points
    along = states if point.scale is None else point.scale
    return solution_rows(point.solution, [claim for claim in elsewhere if claim not in told], along)


def _is_critical(row: Row) -> bool:
    """Whether a claim means nothing at a critical solution: where Newton's method is singular, what is marginal."""
    return row.what in (*_BY_NEWTON, "stable", "unstable directions", "admissible")


def _curve_rows(curve: Any, points: int) -> list[Row]:
    """Return the checks of a curve: of some of its solutions, of all special points, and of what changes between."""
    chosen = _chosen(curve, points)
    rows: list[Row] = []
    counts: dict[int, tuple[int, bool]] = {}
    sizes = sizes_of(curve.x0)
    accumulated = [p.value(curve.varied[0]) for p in curve.special_points if accumulates(p.type, p.locus)]
    for index in chosen:
        solution = curve.solution(index)
        check = _check(solution, sizes)
        chatters = accumulates(getattr(curve, "type", ""), "")
        if isinstance(check, OrbitCheck) and (chatters or curve.values[index] in accumulated):
            check.left_out = float(solution.residual)
        own = check.rows()
        if len(curve.varied) > 1 and curve.type in _SINGULAR:
            own = [row for row in own if row.what not in _BY_NEWTON]
        rows += placed(place_of(curve, index), own)
        if isinstance(check, OrbitCheck) and check.found is not None:
            rows += placed(place_of(curve, index), average_rows(curve, index, check.found))
        counts[index] = check.unstable()
        if chatters:
            rows += placed(place_of(curve, index), [unchecked(f"type {curve.type}", curve.type, _NO_CONDITION)])
        elif len(curve.varied) > 1:
            rows += placed(place_of(curve, index), check.condition(curve.type))
    rows = worst(rows)
    for point in curve.special_points:
        rows += _point_rows(point, sizes, getattr(curve, "tolerance", None))
    rows += [*column_rows(curve), *course_rows(curve), *meeting_rows(curve), *unread_rows(curve)]
    if len(curve.varied) == 1:
        rows += list(_account(curve, counts))
    return rows


def _over(family: Family) -> Iterator[Row]:
    """Yield whether each branch has the values by which its family orders it."""
    for i, branch in enumerate(family):
        own = {} if branch is None else {k: branch.parameters[k] for k in family.over if k in branch.parameters}
        for name, value in own.items():
            said = float(family.over[name][i])
            yield compared(f"value of {name}", said, value, EPS * abs(value))._replace(place=f"member {i}")
    missing = sum(branch is None for branch in family)
    yield equal("members without a branch", len(family.failures), missing)


def _doublings(cascade: Doublings) -> Iterator[Row]:
    """Yield whether each branch of a cascade begins at the doubling before it, with twice the period."""
    name = cascade.parameter
    for point, branch in zip(cascade.points, cascade.branches, strict=False):
        values = branch.values
        first = abs(point.parameters[name] - values[0])
        steps = float(np.abs(np.diff(values)).max(initial=0.0))
        yield compared(f"{name} at the begin", point.parameters[name], float(values[0]), max(steps, first * EPS))
        periods = np.atleast_1d(branch.period)
        ratio = float(periods[0] / point.solution.period)
        yield equal("periods at the begin", 2, round(ratio))._replace(place=point.label)


def _chosen(curve: Any, points: int) -> list[int]:
    """Return the indices of the solutions that are checked: spread evenly, and both neighbours of special points."""
    last = len(curve) - 1
    spread = np.unique(np.linspace(0, last, min(points, last + 1)).round().astype(int)).tolist()
    beside = [math.floor(p.position) + k for p in curve.special_points for k in (0, 1)]
    return sorted({index for index in (*spread, *beside) if 0 <= index <= last})


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
            yield row._replace(place=f"{place_of(curve, a)} to {place_of(curve, b)}")
    yield equal("changes of stability that are explained", changes, explained)


def _explains(between: Sequence[SpecialPoint[Any]], change: int) -> bool:
    """Whether special points may change the number of unstable directions by so much."""
    if any(p.type in _AT_SURFACES for p in between):
        return True  # multipliers jump where a surface is met
    steps = [_STEPS[p.type] * getattr(p, "multiplicity", 1) for p in between if p.type in _STEPS]
    most = sum(steps)
    # at a branch point a direction may touch the imaginary axis, or the unit circle, without crossing it
    return abs(change) <= most and ((most - change) % 2 == 0 or any(p.type == "BP" for p in between))
