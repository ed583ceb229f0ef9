"""One continuation of a locus, of equilibria or of cycles of a map: its start, its directions, its events."""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from saltus.continuation.core.arclength import follow
from saltus.continuation.core.zero_problem import Event, Point, start_point
from saltus.continuation.problems.algebraic import closes
from saltus.continuation.problems.algebraic_locus import AlgebraicLocusProblem
from saltus.continuation.problems.extents import extents
from saltus.continuation.results.special_points import SpecialPoint
from saltus.continuation.runs.run import TwoParameterRun
from saltus.continuation.runs.two_sided import BothSides, Found, OneSide, join, traced, turned
from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.monitor import Monitor

__all__ = ["AlgebraicLocusRun"]

_MOVED = 1e-3  # change, over the unknowns' sizes, by which the first point of a locus may differ from the start
_REGULAR = 1e-11  # least singular value of the extended equations, over the largest, of a regular start


class AlgebraicLocusRun(TwoParameterRun):
    """One call of `continue_locus` from a solution of an `AlgebraicProblem`.

    Parameters
    ----------
    start : SpecialPoint, Equilibrium or MapOrbit
        Where the locus starts.
    solution : Equilibrium or MapOrbit
        The solution there.
    *options
        As `TwoParameterRun` takes them.
    """

    odd = AlgebraicLocusProblem.odd
    codimension_two: ClassVar[tuple[str, ...]]  # types of special points that a start may be
    zero_problem: ClassVar[type[AlgebraicLocusProblem]]  # how the equations are followed
    first_sizes: NDArray[np.float64]  # sizes of the unknowns at the start, known when the first point is

    def __init__(self, start: Any, solution: Any, *options: Any) -> None:
        super().__init__(*options)
        self.start, self.solution = start, solution

    @abstractmethod
    def equations(self, p: NDArray[np.float64], active: list[int]) -> Any:
        """Return the equations of the start."""

    @abstractmethod
    def given(self) -> NDArray[np.float64]:
        """Return the unknowns of the start without the parameters."""

    @abstractmethod
    def condition(
        self, problem: Any, u: NDArray[np.float64], sizes: NDArray[np.float64]
    ) -> tuple[Any, NDArray[np.float64]]:
        """Return the condition of the locus, and a guess of its further unknowns."""

    @abstractmethod
    def solution_at(self, u: NDArray[np.float64], sizes: NDArray[np.float64]) -> Any:
        """Return the solution with the unknowns `u`."""

    @abstractmethod
    def end(self, kind: str) -> str | None:
        """Return why the locus ends at a special point of some type; None where it does not."""

    def met(self, name: Monitor) -> str:
        """Return what is met at the zero of a monitor function of a border; empty for others."""
        return ""

    def passed(self, point: Point) -> str | None:
        """Return why the locus ended before a point; None where it did not."""
        return None

    def unbounded(self, point: Point) -> str | None:
        """Return why the locus ends at a point from which it grows without bound; None where it does not."""
        return None

    def extents(self, problem: Any, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return typical sizes of the unknowns at the start, shape (n,)."""
        return extents(problem, u)

    def joined(self, order: tuple[str, ...], directions: str) -> BothSides:
        """Return the locus in both directions, its parameters in the order that the user gave."""
        begin = partial(self.begin, self.names.index(order[1]))
        origin = begin()
        with self.reporter:
            halves = traced(origin, begin, self.trace, directions)
        return self.with_start(join((self.branch, origin), halves, "locus"), self._at_start(origin))

    def begin(self, towards: int) -> Point:
        """Return the first point, its tangent towards growing values of the parameter number `towards`."""
        system = self.solution.system
        p = system.parameter_vector(self.solution.parameters)
        active = [system.parameter_names.index(name) for name in self.names]
        values = self.start_values(p[active])
        problem = self.equations(p, active)
        u = np.append(self.given(), values)
        known = self.start.scale if isinstance(self.start, SpecialPoint) else None
        sizes = self.extents(problem, u) if known is None else known
        condition, extra = self.condition(problem, u, sizes)
        z = np.concatenate([u[: problem.n], extra, u[-2:]])
        self.branch = self.zero_problem(problem, self.kind, condition, sizes, self.bounds)
        matrix = self.branch.evaluate(z)[1] * self.branch.scale()
        terms = np.abs(matrix).max(axis=1, keepdims=True)
        found = np.linalg.svd(matrix / np.where(terms > 0.0, terms, 1.0), compute_uv=False)
        if not found[-1] > _REGULAR * found[0]:
            raise self.irregular("the extended equations have more than one solution direction there")
        try:
            point = start_point(self.branch, z)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise self.irregular(str(error)) from None
        away = np.abs(point.u - z)[np.r_[: problem.n, -2:0]]
        if float(np.max(away / np.append(sizes, [1.0, 1.0]))) > _MOVED:
            raise InputError("start", f"{float(np.max(away)):.2g} away", f"a located {self.kind}")
        examined = self.branch.examine(point, None)
        self.first_sizes = self.branch.sizes.copy()
        own = self.start.type if isinstance(self.start, SpecialPoint) else ""
        # a test function that vanishes at the start itself has no sign there
        monitors = {name: math.nan if name.kind == own else value for name, value in examined.monitors.items()}
        point.examined = replace(examined, monitors=monitors)
        return turned(point, float(point.tangent[towards - 2]), self.odd)

    def followed(self, half: OneSide, point: Point, origin: Point) -> str:
        """See `TwoParameterRun.followed`."""
        last = point
        for item in follow(self.branch, point, self.control, log=self.log):
            if isinstance(item, str):
                return f"{self.place(last)}: {item}"
            if isinstance(item, Event):
                if (end := self._event(half, item)) is not None:
                    half.points.append((self.branch, item.point))
                    return f"{self.place(item.point)}: {end}"
                continue
            if (passed := self.passed(item)) is not None:
                return f"{self.place(last)}: {passed}"
            if (same := closes(origin, last, item, self.control, self.branch.problem.circles)) is not None:
                half.points.append((self.branch, same))
                half.closed = True
                return "the locus is closed"
            if (end := self.keep(half, self.branch, item)) is not None:
                return end
            last = item
            if (end := self.unbounded(item)) is not None:
                return f"{self.place(item)}: {end}"
        raise AssertionError("follow ends with a reason")

    def _event(self, half: OneSide, event: Event) -> str | None:
        """Keep a special point; return the reason why the locus ends there, or None."""
        kind, at = event.name.kind, event.name.segment
        if kind in ("low", "high"):
            return self.bound_met(event.point, at, kind)
        of = self.names[at] if kind == "TP" else ""
        of = of or self.met(event.name)
        half.specials.append(self._found(kind, event.point, event.value, len(half.points), of))
        if (end := self.end(kind)) is not None:
            return f"{kind}: {end}"
        return kind if kind in self.stops else None

    def _found(self, kind: str, point: Point, value: float, after: int, of: str) -> Found:
        sizes = self.branch.sizes.copy()
        solution = self.solution_at(self.branch.unknowns(point.u), sizes)
        return Found(kind, solution, value, after, point.arc, of, scale=sizes)

    def _at_start(self, origin: Point) -> Found | None:
        """Return the start as a special point of the locus, if it is one of codimension two."""
        start = self.start
        if not isinstance(start, SpecialPoint) or start.type not in self.codimension_two:
            return None
        return self._found(start.type, origin, 0.0, 0, start.of)
