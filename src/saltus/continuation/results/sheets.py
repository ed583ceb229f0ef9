"""Stable sheets of branches: their ends, the observables on them, the orbit at a value."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.continuation.core.point_types import CHANGES
from saltus.continuation.results.branch import Branch
from saltus.continuation.results.crossings import extremes_of
from saltus.continuation.results.special_points import SpecialPoint
from saltus.errors import ConvergenceError, InputError
from saltus.orbits import PeriodicOrbit
from saltus.orbits.signature import Signature
from saltus.orbits.solve import converge
from saltus.scales import AT_GRAZING, SHEET_END, SHEET_REACH, SHEET_ROUNDED

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["MOVING", "Sheet", "Stretch", "sheets_of", "stretches_of"]

# Types of special points at which a stable sheet ends and that move with parameters.
MOVING = ("SN", "PD", "TR", *CHANGES)


class Stretch(NamedTuple):
    """Consecutive stable motions of a branch, along which the parameter grows or falls all the time."""

    sheet: int  # the branch
    points: tuple[int, ...]  # its points, in the order of growing parameter


def stretches_of(branches: Sequence[Branch]) -> list[Stretch]:
    """Return the stable stretches of branches; a lone point on a grazing, whose motion is rounding, parts none."""
    found = []
    for sheet, branch in enumerate(branches):
        good = branch.stable & branch.admissible
        known = np.flatnonzero(~_lone(branch, good))
        for part in np.split(known, np.flatnonzero(good[known][1:] != good[known][:-1]) + 1):
            rising = np.diff(branch.values[part]) > 0.0
            turns = np.flatnonzero(rising[1:] != rising[:-1]) + 1
            for piece in np.split(part, turns) if part.size and good[part[0]] else []:
                order = piece if branch.values[piece[-1]] >= branch.values[piece[0]] else piece[::-1]
                found.append(Stretch(sheet, tuple(order.tolist())))
    return found


def _lone(branch: Branch, good: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which points are no stable motions, lie on a grazing, and have stable neighbours on both sides."""
    lone = np.zeros(len(branch), dtype=bool)
    between = ~good[1:-1] & good[:-2] & good[2:]
    grazings = np.array([point.value(branch.parameter) for point in branch.special_points if point.type in CHANGES])
    if grazings.size and between.any():
        near = np.abs(branch.values[1:-1, None] - grazings).min(axis=1) <= AT_GRAZING * float(np.ptp(branch.values))
        lone[1:-1] = between & near
    return lone


class _Node(NamedTuple):
    """What is known of an orbit of a sheet: value, signature, unknowns, extremes, and whether the parameter turns."""

    value: float
    form: Signature
    unknowns: NDArray[np.float64]
    extremes: NDArray[np.float64]
    turns: bool = False


@dataclass(frozen=True, eq=False)
class Sheet:
    """Stable orbits over an interval of the parameter."""

    branch: Branch  # the branch they belong to
    points: tuple[int, ...]  # its points, in the order of growing parameter
    # special points at the lower and at the upper end; None where the branch just ends
    ends: tuple[SpecialPoint | None, SpecialPoint | None]
    number: int  # its number among all sheets

    @cached_property
    def bounds(self) -> tuple[float, float]:
        """Values at the ends."""
        low, high = self.ends
        values, name = self.branch.values, self.branch.parameter
        return (
            float(values[self.points[0]]) if low is None else low.value(name),
            float(values[self.points[-1]]) if high is None else high.value(name),
        )

    def place(self, upper: bool, inset: float = SHEET_END) -> float:
        """Return a value just within an end, by a share of the sheet's length; where the branch just ends, the end."""
        end, other = (self.bounds[1], self.bounds[0]) if upper else self.bounds
        return end if self.ends[upper] is None else (1.0 - inset) * end + inset * other

    def place_slopes(self, upper: bool, parameters: Sequence[str], inset: float = SHEET_END) -> NDArray[np.float64]:
        """Return the derivatives of `place` by parameters."""
        if self.ends[upper] is None:
            return np.zeros(len(parameters))
        own, other = self._end_slopes(upper, parameters), self._end_slopes(not upper, parameters)
        return np.asarray((1.0 - inset) * own + inset * other)

    @cached_property
    def _nodes(self) -> list[_Node]:
        branch, n = self.branch, len(self.branch.system.states)
        rows = np.hstack([branch.lows[:, :n], branch.highs[:, :n]])
        nodes = [
            _Node(float(branch.values[i]), branch.forms[branch.form[i]], branch.unknowns[i], rows[i])
            for i in self.points
        ]
        for k, end in enumerate(self.ends):
            if end is not None and end.value(branch.parameter) != nodes[-k].value:
                orbit, turns = end.orbit, end.type == "SN"
                node = _Node(end.value(branch.parameter), orbit.form, orbit.unknowns, extremes_of(orbit), turns)
                nodes.insert(len(nodes) if k else 0, node)
        return nodes

    def column(self, formula: str, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return an observable at values of the parameter, interpolated; next to an end it is that of the end."""
        at, branch = list(self.points), self.branch
        known, column = branch.values[at], branch.column(formula)[at]
        for k, end in enumerate(self.ends):
            if end is not None:
                where = len(known) if k else 0
                known = np.insert(known, where, self.bounds[k])
                column = np.insert(column, where, branch.value_at(end, formula))
        return np.asarray(np.interp(values, known, column))

    def orbit(self, value: float) -> PeriodicOrbit:
        """Return the stable orbit at a value, solved there.

        Raises
        ------
        ConvergenceError
            No stable orbit of the sheet is found there.
        """
        nodes, branch = self._nodes, self.branch
        k = int(np.clip(np.searchsorted([node.value for node in nodes], value), 1, max(len(nodes) - 1, 1)))
        a, b = nodes[k - 1], nodes[min(k, len(nodes) - 1)]
        share = (value - a.value) / (b.value - a.value) if b.value > a.value else 0.0
        if a.turns:
            share = math.sqrt(max(share, 0.0))
        elif b.turns:
            share = 1.0 - math.sqrt(max(1.0 - share, 0.0))
        wanted = (1.0 - share) * a.extremes + share * b.extremes
        size = max(float(np.abs(a.extremes).max()), float(np.abs(b.extremes).max()))
        around = [node.extremes for node in nodes[max(k - 2, 0) : k + 2]]  # the curve may turn between the nearest two
        reach = SHEET_REACH * float(np.abs(np.diff(around, axis=0)).max(initial=0.0)) + SHEET_ROUNDED * size
        p = branch.system.parameter_vector({**branch.parameters, branch.parameter: value})
        for form, unknowns in _guesses(a, b, share):
            try:
                orbit = converge(branch.system, form, unknowns, p, branch.tolerance)
            except ConvergenceError:
                continue  # the next guess may be nearer; where none is, the branch is asked below
            if orbit.stable and orbit.admissible and float(np.abs(extremes_of(orbit) - wanted).max()) <= reach:
                return orbit
        return self._asked(value, wanted)

    def _asked(self, value: float, wanted: NDArray[np.float64]) -> PeriodicOrbit:
        """Return the stable orbit among those that the branch finds at a value."""
        try:
            found = [orbit for orbit in self.branch.at(value) if orbit.stable and orbit.admissible]
        except InputError as error:
            raise ConvergenceError("orbit of a sheet", math.inf, 0, str(error)) from error
        if not found:
            raise ConvergenceError(f"stable orbit at {self.branch.parameter} = {value:.9g}", math.inf, 0)
        return min(found, key=lambda orbit: float(np.abs(extremes_of(orbit) - wanted).max()))

    def _end_slopes(self, upper: bool, parameters: Sequence[str]) -> NDArray[np.float64]:
        end = self.ends[upper]
        if end is None:
            return np.zeros(len(parameters))
        return np.asarray(end.sensitivity(parameters)[self.branch.parameter].to_numpy())


def _guesses(a: _Node, b: _Node, share: float) -> Iterator[tuple[Signature, NDArray[np.float64]]]:
    if a.form == b.form:
        yield a.form, (1.0 - share) * a.unknowns + share * b.unknowns
    for node in (a, b) if share <= 0.5 else (b, a):
        yield node.form, node.unknowns


def sheets_of(branches: Sequence[Branch]) -> list[Sheet]:
    """Return the stable sheets of branches, with the special points at their ends."""
    found = []
    for number, stretch in enumerate(stretches_of(branches)):
        branch, points = branches[stretch.sheet], stretch.points
        ends = tuple(_end(branch, points, upper=upper) for upper in (False, True))
        found.append(Sheet(branch, points, (ends[0], ends[1]), number))
    return found


def _end(branch: Branch, points: tuple[int, ...], *, upper: bool) -> SpecialPoint | None:
    """Return the special point at which a stretch ends; None where the branch just ends."""
    last = points[-1 if upper else 0]
    sign = 1.0 if upper else -1.0
    value = float(branch.values[last])
    ahead = [
        point
        for point in branch.special_points
        if point.type in MOVING
        and point.homoclinic is None
        and abs(point.position - last) <= 1.0
        and sign * (point.value(branch.parameter) - value) >= 0.0
        and not (len(points) > 1 and _is_between(point, points))
    ]
    # a motion stays stable at most grazings, so that a bifurcation in the same step is where stability is lost
    return min(ahead, key=lambda point: (point.type in CHANGES, abs(point.position - last)), default=None)


def _is_between(point: SpecialPoint, points: Sequence[int]) -> bool:
    return min(points) < point.position < max(points)
