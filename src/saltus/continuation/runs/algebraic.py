"""A branch of solutions of algebraic equations under way: its start, its events, through borders."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from saltus.algebraic.conditions import solve_branch_point, solve_saddle_node
from saltus.algebraic.newton import terms_of_rows
from saltus.continuation.core.arclength import StepControl, follow
from saltus.continuation.core.closing import closes
from saltus.continuation.core.multiple import crossing_point
from saltus.continuation.core.zero_problem import Event, Point, correct, start_point
from saltus.continuation.problems.algebraic import AlgebraicZeroProblem
from saltus.continuation.problems.extents import extents
from saltus.continuation.problems.point_data import PointData
from saltus.continuation.runs.branching import NONE_REAL, other_branches
from saltus.continuation.runs.columns import settled
from saltus.continuation.runs.copies import fresh_point
from saltus.continuation.runs.one_parameter import OneParameterRun, Wanted
from saltus.continuation.runs.options import read_value
from saltus.continuation.runs.run import Asked, Going
from saltus.continuation.runs.sizes import algebraic_beside_rest
from saltus.continuation.runs.two_sided import BothSides, Found, OneSide, turned
from saltus.errors import ConvergenceError, InputError, nearest
from saltus.scales import (
    BRANCH_POINT_NEAR,
    GROWN,
    ILL_CONDITIONED,
    MET,
    ONE_VALUE,
    PARAMETER_DIGITS,
    PARAMETER_PERHAPS_RESTS,
    PARAMETER_RESTS,
    PARAMETER_RESTS_IN_GROWTH,
    PARAMETER_ROUNDED,
    START_CRITICAL,
    TESTED_SIGN,
    TURNS_AT_POINT,
    VERTEX,
)

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping

    from numpy.typing import NDArray

    from saltus.algebraic.protocol import AlgebraicProblem
    from saltus.continuation.core.interest import Interest
    from saltus.continuation.problems.boundary import Crossing

__all__ = ["AlgebraicRun", "algebraic_columns"]

_BESIDE = 1e-3  # arclength from a multiple point at which the branch is regular
_ASIDE = 1e-4  # arclength by which a critical start is moved aside
_FURTHER = (1e-3, 1e-2, 5e-2)  # the same in turn, where the parameter still rests
_DOUBLED = 2.0  # growth of a size while the parameter rests, after which the parameter's way is compared
_MARKS = 3  # points of comparison: two such growths
_MOST_GROWN = 1e100  # size of a state, over that at the start, up to which a branch is followed


def algebraic_columns(joined: BothSides) -> dict[str, Any]:
    """Return the fields of `AlgebraicCurve` that a branch and a locus of any kind fill in the same way."""
    data = [point.examined.data for _, point in joined.rows]
    critical = [_critical(piece, point.examined.data) for piece, point in joined.rows]
    return {
        "stable": settled(joined, critical, [d.stable for d in data]),
        "regular": np.array([not d.reasons for d in data]),
        "residual": np.array([point.residual for _, point in joined.rows]),
    }


def _critical(piece: Any, data: Any) -> bool:
    """Return whether a real value of a solution of a branch is critical but for rounding."""
    if not isinstance(data, PointData):
        return False
    known = [piece.tests([value]) for value in piece.in_units(data.values).tolist() if value.imag == 0.0]
    return any(abs(test.values[0]) <= TESTED_SIGN * test.sizes[0] for test in known)


class AlgebraicRun(OneParameterRun):
    """One call of `continue_branch` from a solution of an `AlgebraicProblem`; see `OneParameterRun`."""

    odd = AlgebraicZeroProblem.odd
    zero_problem: ClassVar[type[AlgebraicZeroProblem]] = AlgebraicZeroProblem  # how the equations are followed
    result: ClassVar[type[Any]]  # what comes back
    columns = staticmethod(algebraic_columns)  # its fields that tell of solutions
    types: ClassVar[tuple[str, ...]] = AlgebraicZeroProblem.critical
    what: ClassVar[str] = "solution"  # what a branch consists of
    border: ClassVar[str] = ""  # type of special points at which the solutions belong to another mode or piece
    at_border: ClassVar[str] = ""  # what such a point is

    def __init__(self, solution: Any, name: str, interest: Interest, asked: Asked) -> None:
        super().__init__(solution, name, interest, asked)
        self.first_sizes: NDArray[np.float64] = np.empty(0)
        self._blunt: set[int] = set()  # numbers of the points before folds that Newton's method does not find
        self._marks: list[tuple[NDArray[np.float64], float]] = []  # sizes and parameter since it rests, at doublings

    @classmethod
    def wanted(cls, start: Any, name: str, events: Mapping[str, float | str]) -> tuple[Wanted, ...]:
        """See `OneParameterRun.wanted`; kind is ``parameter``, ``state`` or ``output``."""
        system, found = start.system, []
        kinds = dict.fromkeys(system.output_names, "output") | dict.fromkeys(system.states, "state")
        kinds |= {name: "parameter"}
        for key, given in events.items():
            value = read_value(key, given)
            if key not in kinds:
                raise InputError("events", key, f"one of {', '.join(kinds)}", nearest(key, kinds))
            if value is None and key == name:
                raise InputError("events", key, "a state or an output", "where the branch turns in it is an SN")
            found.append((key, kinds[key], value))
        return tuple(found)

    def branch(self, options: dict[str, Any]) -> Any:
        """See `OneParameterRun.branch`."""
        joined = self.joined()
        return self.result(**self.fields(joined, options), **self.columns(joined))

    def crossing(self, branch: Any, event: Event) -> tuple[str, Crossing]:
        """Return what is met at a border, and what goes on there."""
        raise NotImplementedError

    def inside(self, branch: Any, event: Any) -> float:
        """Return the sign of a border's monitor function on the regular side."""
        return 1.0

    def returned(self, half: OneSide, branch: Any, point: Point) -> bool:
        """Return whether a branch has come back to a border at which it was before, on the same side of it."""
        return False

    def leaves(self, before: Any, branch: Any, point: Point) -> str | None:
        """Return why the solutions next to a border do not belong to the equations behind it; None where they do.

        before, branch: equations that end at the border, and those behind it.
        """
        return None

    def ended(self, branch: Any, point: Point, kind: str) -> str | None:
        """Return why a branch ends at an event of its own, that is no special point; None where it does not."""
        return None

    def passes(self, branch: Any, point: Point) -> bool:
        """Return whether a branch goes on at a border with the same equations."""
        return False

    def closed_up(self, branch: Any, point: Point) -> str | None:
        """Return why a branch ends at a branch point; None where it does not."""
        return None

    def unbounded(self, point: Point) -> str | None:
        """Return why a branch ends at a point from which it grows without bound; None where it does not.

        At a saddle-node the parameter rests as well, but the states do not grow meanwhile. At the vertex of a pitchfork
        they grow from 0, but the parameter moves the more the larger they are; on the way to infinity it does the less.
        """
        grown, runs = self._grown(point), False
        if abs(float(point.tangent[-1])) >= PARAMETER_RESTS_IN_GROWTH:
            self._marks = []
        else:
            sizes = 1.0 / np.sqrt(point.weights[:-1])
            if not self._marks or float(np.max(sizes / self._marks[-1][0])) > _DOUBLED:
                self._marks = [*self._marks[-2:], (sizes, point.parameter)]
            runs = grown > GROWN and len(self._marks) == _MARKS and self._comes_to_rest()
        return f"the {self.what} grows without bound" if runs or grown > _MOST_GROWN else None

    def _comes_to_rest(self) -> bool:
        """Return whether the parameter moves less in the last doubling of the states than in the one before."""
        (first, p), (middle, q), (last, r) = self._marks
        before, now = (
            abs(end - start) / math.log(float(np.max(larger / smaller)))
            for start, end, smaller, larger in ((p, q, first, middle), (q, r, middle, last))
        )
        return now <= before or now < PARAMETER_DIGITS * max(abs(r), 1.0)

    def _grown(self, point: Point) -> float:
        """Return the largest ratio of a state's size at a point to its size at the start."""
        return 1.0 / math.sqrt(float((point.weights[:-1] * self.first_sizes**2).min()))

    def starts(self, branch: Any, origin: Point) -> list[Point]:
        """Return the start of a branch in all forms in which the branch may come back to it."""
        return [origin]

    def equations(
        self, problem: AlgebraicProblem, u: NDArray[np.float64], sizes: NDArray[np.float64] | None = None
    ) -> AlgebraicZeroProblem:
        """Return the zero problem of equations near `u`, the unknowns of the given sizes."""
        return self.zero_problem(problem, extents(problem, u) if sizes is None else sizes, self.interest)

    def begin(self) -> tuple[AlgebraicZeroProblem, Point]:
        """See `Run.begin`."""
        self._marks, self._blunt = [], set()
        problem, apart = self.solution.problem(self.name), self.solution.problem(self.name)
        problem.scales[0] = apart.scales[0] = self.scale
        u = np.append(self.solution.unknowns, self.start_value(self.solution.parameters))
        branch = self.equations(problem, u)
        self.first_length = algebraic_beside_rest(partial(self.equations, apart), branch, u, self.control.largest)
        try:
            point = start_point(branch, u)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise self.irregular(self.what, self.solution.parameters[self.name], error) from None
        point.examined = branch.examine(point, None)
        self.first_sizes = branch.sizes.copy()
        return branch, self._aside(branch, point)

    def again(self, piece: AlgebraicZeroProblem, point: Point) -> Callable[[], tuple[AlgebraicZeroProblem, Point]]:
        """See `Run.again`."""
        made = piece.copied(), fresh_point(point)

        def begun() -> tuple[AlgebraicZeroProblem, Point]:
            self._marks, self._blunt = [], set()
            return made

        return begun

    def _aside(self, branch: AlgebraicZeroProblem, point: Point) -> Point:
        """Return a start that is not critical: a critical one is moved a little, away from where the branch goes.

        Where the parameter rests, as at a fold, the start is moved until the parameter moves.
        """
        rests = abs(float(point.tangent[-1])) <= PARAMETER_RESTS
        critical = [name for name, value in point.examined.monitors.items() if name.kind in branch.critical
                    and name.kind != "SN" and (abs(value) < START_CRITICAL or math.isnan(value))]  # fmt: skip
        if not critical and not rests:
            return point
        sign = 1.0 if self.asked.directions == "down" else -1.0
        for length in (_ASIDE, *_FURTHER) if rests else (_ASIDE,):
            moved = self._moved(branch, turned(point, sign, self.odd), length)
            if moved is not None and (not rests or abs(float(moved.tangent[-1])) > PARAMETER_RESTS):
                return turned(moved, sign, self.odd)
        return point

    def _moved(self, branch: AlgebraicZeroProblem, way: Point, length: float) -> Point | None:
        """Return the solution a step of a length along a branch; None where there is none within the bounds."""
        short = StepControl(initial=length, smallest=length / 16.0, largest=length)
        for item in follow(branch, way, short, log=[]):
            if isinstance(item, Point):
                if not self.interest.low < item.parameter < self.interest.high:
                    return None
                item.arc = 0.0
                item.examined = branch.examine(item, None)
                return item
            if isinstance(item, str):
                break
        return None

    def trace(self, start: tuple[Any, Point], sign: float) -> OneSide:
        """Return one direction of the branch, with those folds at which the parameter turns.

        On a line at one value of the parameter, and on the way to infinity, its sign of growth is rounding.
        """
        half = super().trace(start, sign)
        values = np.array([start[1].parameter, *(point.parameter for _, point in half.points)])
        half.specials = [found for found in half.specials if found.name != "SN" or self._turns(values, found)]
        return half

    def _turns(self, values: NDArray[np.float64], found: Found) -> bool:
        """Return whether the parameter, with its values at the points of a branch, turns at a fold."""
        after, at = found.after + 1, float(found.solution.parameters[self.name]) / self.scale
        if after + 1 >= values.size:
            return True  # the branch ends there
        moved = np.where(np.abs(values - at) > PARAMETER_ROUNDED + 16.0 * math.ulp(at), values - at, 0.0)
        before, beyond = moved[:after][moved[:after] != 0.0], moved[after:][moved[after:] != 0.0]
        # a branch may start next to a fold
        return bool(beyond.size > 0 and (before.size == 0 or before[-1] * beyond[0] > 0.0))

    def ahead(self, piece: AlgebraicZeroProblem) -> Callable[[Point, Point, float], tuple[list[Point], float]]:
        """See `Run.ahead`."""
        return partial(piece.ahead, self.control)

    def closes(self, half: OneSide, piece: AlgebraicZeroProblem, last: Point, point: Point) -> bool:
        """See `Run.closes`."""
        starts = self.starts(half.start[0], half.first) if piece is half.start[0] else []
        circles = piece.problem.circles
        met = (closes(piece, origin, last, point, self.control, circles) for origin in starts)
        same = next((start for start in met if start is not None), None)
        return same is not None and half.closed_at(same, piece)

    def arrived(self, half: OneSide, piece: AlgebraicZeroProblem, point: Point) -> str | None:
        """See `Run.arrived`."""
        end = self.unbounded(point)
        return None if end is None else f"{self.place(point)}: {end}"

    def special(self, half: OneSide, branch: AlgebraicZeroProblem, event: Event) -> str | Going | None:
        """See `OneParameterRun.special`."""
        point = event.point
        if (end := self.ended(branch, point, event.name.kind)) is not None:
            return self.ends(half, branch, point, end)
        name = kind = branch.type_of(event.name)
        blunt = False  # whether Newton's method finds no fold at an SN
        count = branch.multiplicity(point.examined.data, kind)
        if event.name.kind == "touch":
            if self._alone(branch, half, event):
                return None
        elif kind in ("SN", "BP") and (count == 1 or kind == "BP"):
            if count > 1 and _meet_at_once(branch, point):
                u = self._together(branch, half.points[-1][1] if half.points else point, point, count)
            else:
                solve = solve_branch_point if kind == "BP" else solve_saddle_node
                u = solve(branch.problem, point.u, branch.sizes)
            if u is not None and float(point.weights @ (u - point.u) ** 2) < BRANCH_POINT_NEAR**2:
                point.u = u
            blunt = u is None
        if kind == "SN" and any(f.name == "BP" and abs(f.arc - point.arc) < TURNS_AT_POINT for f in half.specials):
            return None
        if kind in ("SN", "BP"):
            # next to the vertex of a pitchfork the parameter rests, so the turn may be placed beside the BP
            beside = [f for f in half.specials if f.name != kind and self._same_turn(f, point)]
            if kind == "SN" and blunt and any(f.name == "BP" for f in beside):
                return None
            if kind == "BP":
                half.specials = [f for f in half.specials if not (f in beside and f.after in self._blunt)]
            if kind == "SN" and blunt:
                self._blunt.add(len(half.points))
        if kind != self.border:
            half.specials.append(self.found(name, branch, event, half))
            if kind == "BP" and (end := self.closed_up(branch, point)) is not None:
                return self.ends(half, branch, point, end)
            return self.end_at(half, branch, point, name)
        if self.returned(half, branch, point):
            return self.ends(half, branch, point, f"{self.at_border}, from which on the branch is followed already")
        of, crossing = self.crossing(branch, event)
        half.specials.append(replace(self.found(name, branch, event, half), of=of, kind=crossing.kind))
        if (end := self.end_at(half, branch, point, name)) is not None:
            return end
        if self.control.at_grazing == "pass" or self.passes(branch, point):
            return None
        half.points.append((branch, point))
        if crossing.u is None:
            return f"{self.place(point)}: {self.at_border}, {crossing.reason}"
        return self._switch(branch, crossing, point)

    def _alone(self, branch: AlgebraicZeroProblem, half: OneSide, event: Event) -> bool:
        """Return whether no other real branch meets at a point where an eigenvalue touches 0: it is no branch point."""
        found, u = self.found("BP", branch, event, half), event.point.u.copy()
        problem = found.solution.problem(self.name)
        u[-1] *= self.scale
        try:
            other_branches(problem, u, found.tangent, self.zero_problem, branch.sizes)
        except ConvergenceError as error:
            return NONE_REAL in str(error)
        return False

    def _same_turn(self, found: Found, point: Point) -> bool:
        """Return whether a special point found before may be the turn of the parameter at a point."""
        away = abs(float(found.solution.parameters[self.name]) / self.scale - point.parameter)
        return found.name in ("SN", "BP") and abs(found.arc - point.arc) < VERTEX and away < ONE_VALUE

    def _together(
        self, branch: AlgebraicZeroProblem, last: Point, point: Point, count: int
    ) -> NDArray[np.float64] | None:
        """Return where several values become critical at once, located between two points beside; None if unknown."""

        def growth(u: NDArray[np.float64]) -> float:
            values = branch.growth(*branch.sized(u))
            return float(np.mean(values[np.argsort(np.abs(values))[:count]]))

        sides = [
            correct(branch, point.u + way * _BESIDE * last.tangent, last.tangent, last.weights, self.control.iterations)
            for way in (-1.0, 1.0)
        ]
        a, b = sides
        if isinstance(a, str) or isinstance(b, str):
            return None
        return crossing_point(branch.evaluate, growth, (a, b), branch.scale(), count)

    def _switch(self, branch: AlgebraicZeroProblem, crossing: Crossing, old: Point) -> str | Going:
        """Return equations, point and step to go on with beyond a border, or why no branch does."""
        assert crossing.u is not None
        beside = self.equations(crossing.beside, crossing.u, branch.sizes)
        try:
            point = start_point(beside, crossing.u)
        except (ValueError, np.linalg.LinAlgError) as error:
            return f"{self.place(old)}: {self.at_border}, no branch goes on: {error}"
        if abs(float(point.tangent[-1])) < PARAMETER_PERHAPS_RESTS:
            return f"{self.place(old)}: {self.at_border}, beyond it all lie at one value of {self.name}"
        point = turned(point, crossing.sign(point), self.odd)
        point.arc = old.arc
        found = beside.examine(point, None)
        if (beyond := self.leaves(branch, beside, point)) is not None:
            return f"{self.place(old)}: {self.at_border}, {beyond}"
        # on a surface the sign of its event function is rounding: the point counts as on the regular side
        monitors = {
            name: MET * self.inside(beside, name)
            if name.kind == self.border and abs(value) < MET else value
            for name, value in found.monitors.items()
        }  # fmt: skip
        point.examined = replace(found, monitors=monitors)
        return beside, point, self.control.initial

    def found(self, name: str, branch: AlgebraicZeroProblem, event: Event, half: OneSide) -> Found:
        """Return a special point of one direction, behind the points found so far."""
        point = event.point
        solution = type(self.solution).from_unknowns(branch.problem, point.u, branch.sizes)
        p = {**solution.parameters, self.name: self.value(point)}
        tangent = None
        if name == "BP":  # it is undetermined at the point itself: the last point's is taken
            last = half.points[-1][1] if half.points else point
            tangent = np.append(last.tangent[:-1], self.scale * last.tangent[-1])
        return Found(
            name, replace(solution, parameters=p), event.value, len(half.points), point.arc, tangent=tangent,
            scale=branch.sizes.copy(),
        )  # fmt: skip


def _meet_at_once(branch: AlgebraicZeroProblem, point: Point) -> bool:
    """Return whether the linear equations have several solutions at a branch point: not one, as of a double value."""
    if branch.n == 1:
        return False
    linear = branch.evaluate(point.u)[1][:, : branch.n] * branch.scale()[: branch.n]
    values = np.linalg.svd(linear / terms_of_rows(linear), compute_uv=False)
    return bool(values[-2] <= ILL_CONDITIONED * values[0])
