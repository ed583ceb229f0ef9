"""All solutions of a branch at a value of its parameter, each solved there."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from itertools import chain, islice
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from saltus import checks
from saltus.continuation.results.special_points import Solved
from saltus.errors import ConvergenceError, InputError
from saltus.scales import END_ROUNDED, GUESS_MISSES, GUESS_MISSES_BESIDE, POINT_OF_BRANCH, RESTING

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.results.special_points import SpecialPoints

__all__ = ["OneParameterCurve", "comes_to", "covered", "extremes_of", "solutions_at"]


class OneParameterCurve(Protocol[Solved]):
    """What is asked of a branch: its parameter, points, special points and solutions."""

    @property
    def parameter(self) -> str:
        """Name of the parameter."""

    @property
    def values(self) -> NDArray[np.float64]:
        """Values of the parameter, shape (point,)."""

    @property
    def arclength(self) -> NDArray[np.float64]:
        """Arclength from the first point, shape (point,)."""

    @property
    def special_points(self) -> SpecialPoints[Solved]:
        """The special points."""

    def _solution(self, index: int) -> Solved:
        """Return the solution of one point."""


def extremes_of(solution: Solved) -> NDArray[np.float64]:
    """Return least and greatest values of the states of a solution, shape (2 states,)."""
    return np.concatenate(solution.extremes)


def comes_to(curve: OneParameterCurve[Solved], value: float) -> bool:
    """Return whether the points of a branch come to a value of its parameter, but for rounding."""
    least, largest, rounding = float(curve.values.min()), float(curve.values.max()), _rounding(curve, value)
    return least - rounding <= value <= largest + rounding


def covered(curves: Iterable[OneParameterCurve[Solved]]) -> list[tuple[float, float]]:
    """Return the ranges to which the points of some branches come, joined where they overlap, in ascending order."""
    ranges: list[tuple[float, float]] = []
    for low, high in sorted((float(one.values.min()), float(one.values.max())) for one in curves):
        if ranges and low <= ranges[-1][1]:
            ranges[-1] = ranges[-1][0], max(high, ranges[-1][1])
        else:
            ranges.append((low, high))
    return ranges


def _rounding(curve: OneParameterCurve[Solved], value: float) -> float:
    return END_ROUNDED * max(abs(value), float(np.ptp(curve.values)))


def solutions_at(
    curve: OneParameterCurve[Solved],
    value: float,
    attempts: Callable[[Solved, Solved, float], Iterable[Callable[[], Solved]]],
    extent: Callable[[Solved], NDArray[np.float64]],
) -> tuple[Solved, ...]:
    """Return the solutions of a branch at a value of its parameter, in order along it.

    Parameters
    ----------
    curve : OneParameterCurve
        The branch.
    value : float
        The value.
    attempts : callable
        Given neighbours and the share of the way between them: what solves there, from one guess after the other.
    extent : callable
        Sizes by which solutions are compared.

    Raises
    ------
    InputError
        The branch does not come to the value.
    ConvergenceError
        No solution is found between two neighbours.
    """
    value = checks.number("value", value)
    found = [_between(curve, value, crossing, attempts, extent) for crossing in _crossings(curve, value)]
    if not found:
        reached = [*curve.values.tolist(), *(point.value(curve.parameter) for point in curve.special_points)]
        low, high = min(reached), max(reached)
        raise InputError(curve.parameter, value, f"between {low:.9g} and {high:.9g}, where the branch is")
    return tuple(found)


def _between(
    curve: OneParameterCurve[Solved],
    value: float,
    crossing: tuple[Node, Node, float],
    attempts: Callable[[Solved, Solved, float], Iterable[Callable[[], Solved]]],
    extent: Callable[[Solved], NDArray[np.float64]],
) -> Solved:
    a, b, share = crossing
    first, last = (
        curve.special_points[node.which].solution if node.is_special else curve._solution(node.which) for node in (a, b)
    )
    if a is b:
        return first
    low, high = extent(first), extent(last)
    sizes = np.maximum(np.abs(low), np.abs(high))
    sizes = np.maximum(sizes, max(RESTING * float(sizes.max()), 1e-300))
    best, least = None, float(np.linalg.norm((high - low) / sizes)) + GUESS_MISSES_BESIDE
    failed: list[ConvergenceError] = []
    apart: list[float] = []
    line = (value - a.value) / (b.value - a.value)
    for attempt in chain(attempts(first, last, share), islice(attempts(first, last, line), 1)):
        try:
            solution = attempt()
        except ConvergenceError as error:
            failed.append(error)  # the next guess may be nearer; where none is, this is told below
            continue
        own = extent(solution)
        away, *beside = (
            float(np.linalg.norm((own - other) / sizes)) for other in (low + share * (high - low), low, high)
        )
        if away <= max(GUESS_MISSES, min(beside)):  # what lies on another branch may be nearer to a neighbour
            return solution
        apart.append(away)
        if away < least:
            best, least = solution, away
    if best is not None:
        return best
    what = f"solution at {curve.parameter} = {value:.9g}, between points at {a.value:.9g} and {b.value:.9g}"
    tried = [f"Newton's method fails from {len(failed)} guesses"] * bool(failed)
    tried += [f"from {len(apart)} it leads to one {min(apart, default=0.0):.3g} of its size away"] * bool(apart)
    residual = min((error.residual for error in failed), default=min(apart, default=math.inf))
    hint = f"{', '.join(tried)}; trace the branch with shorter steps there"
    raise ConvergenceError(what, residual, sum(error.iterations for error in failed), hint)


class Node(NamedTuple):
    """A point or special point of a branch."""

    # arclength, value: where it is, and its parameter
    arclength: float
    value: float
    which: int  # which point or special point it is
    is_special: bool  # whether it is a special point
    slope: float  # of the parameter by arclength at a special point: 0 where it turns; NaN where it is not known

    def turns(self, other: Node) -> bool:
        """Return whether the parameter turns here: its slope is less than half of that of the chord to a neighbour."""
        return 2.0 * abs(self.slope * (other.arclength - self.arclength)) < abs(other.value - self.value)


def _crossings(curve: OneParameterCurve[Solved], value: float) -> Iterator[tuple[Node, Node, float]]:
    """Yield neighbours before and after each place where a branch takes a value, and the share of the way between them.

    Next to a turn the parameter grows like the square of the way; elsewhere it is a parabola. Where a node has the
    value itself, it is both of them, and the share is 0. So it is with an end that misses the value by rounding.
    """
    arclength, values = curve.arclength.tolist(), curve.values.tolist()
    nodes = [Node(arc, v, i, False, math.nan) for i, (arc, v) in enumerate(zip(arclength, values, strict=True))]
    for i, special in enumerate(curve.special_points):
        slope = 0.0 if special.type in ("SN", "TP") else math.nan
        if special.type == "BP" and special.tangent is not None:  # at the vertex of a fork it turns
            slope = float(special.tangent[-1])
        nearest = int(np.abs(curve.arclength - special.arclength).argmin())
        if abs(arclength[nearest] - special.arclength) > POINT_OF_BRANCH:
            nodes.append(Node(special.arclength, special.value(curve.parameter), i, True, slope))
        else:
            nodes[nearest] = nodes[nearest]._replace(slope=slope)
    nodes.sort()
    short = [
        end
        for end, inner in ((nodes[0], nodes[1:2]), (nodes[-1], nodes[-2:-1]))
        if abs(end.value - value) <= _rounding(curve, value)
        and all((end.value - value) * (b.value - value) > 0.0 for b in inner)
    ]
    for at, b in enumerate(nodes):
        if b.value == value or b in short:
            yield b, b, 0.0
        a = nodes[at - 1]
        if at > 0 and (a.value - value) * (b.value - value) < 0.0:
            share = (value - a.value) / (b.value - a.value)
            if a.turns(b):
                share = math.sqrt(share)
            elif b.turns(a):
                share = 1.0 - math.sqrt(1.0 - share)
            else:
                share = _curved(a, b, nodes[max(at - 2, 0) : at - 1] + nodes[at + 1 : at + 2], share)
            yield a, b, share


def _curved(a: Node, b: Node, others: list[Node], share: float) -> float:
    """Return the share of the way by the parabola through the nearest other node, where that is monotone.

    others : list of Node
        Those before and behind.
    share : float
        That of the straight line.
    """
    width, rise = b.arclength - a.arclength, b.value - a.value
    third = min(others, key=lambda node: abs(node.arclength - 0.5 * (a.arclength + b.arclength)), default=None)
    if third is None:
        return share
    x, y = (third.arclength - a.arclength) / width, (third.value - a.value) / rise
    if min(abs(x), abs(x - 1.0)) <= POINT_OF_BRANCH:
        return share
    bend = (y - x) / (x * (x - 1.0))  # value = x + bend x (x - 1)
    if not abs(bend) < 1.0:
        return share
    slope = 1.0 - bend
    return 2.0 * share / (slope + math.sqrt(slope**2 + 4.0 * bend * share))
