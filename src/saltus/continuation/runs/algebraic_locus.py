"""A locus of solutions of algebraic equations under way: its start, its events."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from saltus.continuation.core.closing import closes
from saltus.continuation.core.zero_problem import Event, Examined, Point
from saltus.continuation.problems.algebraic_locus import AlgebraicLocusProblem
from saltus.continuation.problems.critical_points import critical_condition
from saltus.continuation.problems.extents import extents
from saltus.continuation.runs.algebraic import algebraic_columns
from saltus.continuation.runs.two_parameters import TwoParameterRun
from saltus.continuation.runs.two_sided import Found, OneSide

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.monitor import Monitor

__all__ = ["AlgebraicLocusRun"]


class AlgebraicLocusRun(TwoParameterRun):
    """One call of `continue_locus` from a solution of an `AlgebraicProblem`; see `TwoParameterRun`."""

    odd = AlgebraicLocusProblem.odd
    zero_problem: ClassVar[type[AlgebraicLocusProblem]] = AlgebraicLocusProblem  # how the equations are followed
    result: ClassVar[type[Any]]  # what comes back
    columns = staticmethod(algebraic_columns)  # its fields that tell of solutions
    loci: ClassVar[Mapping[str, str]] = MappingProxyType({"SN": "SN", "CP": "SN"})
    ends_at: ClassVar[Mapping[str, str]] = MappingProxyType({})  # special points at which a locus ends, and why
    first_sizes: NDArray[np.float64]  # sizes of the unknowns at the start, known when the first point is

    def starts(self, piece: Any, origin: Point) -> list[Point]:
        """Return the start of a locus in all forms in which the locus may come back to it."""
        return [origin]

    def end(self, kind: str) -> str | None:
        """Return why the locus ends at a special point of some type; None where it does not."""
        return self.ends_at.get(kind)

    def met(self, name: Monitor) -> str:
        """Return what is met at the zero of a monitor function of a border; empty for others."""
        return ""

    def unbounded(self, point: Point) -> str | None:
        """Return why the locus ends at a point from which it grows without bound; None where it does not."""
        return None

    def locus(self) -> Any:
        """See `TwoParameterRun.locus`."""
        joined = self.joined()
        return self.result(**self.fields(joined), **self.columns(joined))

    def extended(self) -> NDArray[np.float64]:
        """See `TwoParameterRun.extended`."""
        problem = self.solution.problem(*self.names)
        problem.scales[:] = self.scales
        u = np.append(self.solution.unknowns, self.start_values(problem.p[list(problem.active)]))
        known = None if self.start is None else self.start.scale
        sizes = extents(problem, u) if known is None else known
        condition, extra = critical_condition(self.solution, self.kind, problem, u, sizes)
        self.branch = self.zero_problem(problem, self.kind, condition, sizes, self.bounds, u)
        return np.concatenate([u[: problem.n], extra, u[-2:]])

    def moved(self, u: NDArray[np.float64], z: NDArray[np.float64]) -> float:
        """See `TwoParameterRun.moved`; the condition's own unknowns do not count."""
        own = np.r_[: self.branch.n, -2:0]
        return float(np.max(np.abs(u - z)[own] / self.branch.scale()[own]))

    def examined(self, point: Point) -> Examined:
        """See `TwoParameterRun.examined`."""
        found = super().examined(point)
        self.first_sizes = self.branch.sizes.copy()
        own = "" if self.start is None else self.start.type
        # a test function that vanishes at the start itself has no sign there
        others = self.branch.others
        monitors = {
            name: math.nan if name.kind == own or (others.tells(name) and others.is_critical(value)) else value
            for name, value in found.monitors.items()
        }
        return replace(found, monitors=monitors)

    def closes(self, half: OneSide, piece: AlgebraicLocusProblem, last: Point, point: Point) -> bool:
        """See `Run.closes`."""
        circles = piece.problem.circles
        met = (closes(piece, origin, last, point, self.control, circles) for origin in self.starts(piece, half.first))
        same = next((start for start in met if start is not None), None)
        return same is not None and half.closed_at(same, piece)

    def arrived(self, half: OneSide, piece: AlgebraicLocusProblem, point: Point) -> str | None:
        """See `Run.arrived`."""
        end = self.unbounded(point)
        return None if end is None else f"{self.place(point)}: {end}"

    def special(self, half: OneSide, event: Event) -> str | None:
        """See `TwoParameterRun.special`."""
        kind, at = event.name.kind, event.name.segment
        of = self.names[at] if kind == "TP" else self.met(event.name)
        half.specials.append(self._found(kind, event.point, event.value, len(half.points), of))
        if (end := self.end(kind)) is not None:
            return f"{kind}: {end}"
        return kind if kind in self.stops else None

    def _found(self, kind: str, point: Point, value: float, after: int, of: str) -> Found:
        sizes = self.branch.sizes.copy()
        solution = type(self.solution).from_unknowns(self.branch.problem, self.branch.unknowns(point.u), sizes)
        return Found(kind, solution, value, after, point.arc, of, scale=sizes)

    def at_start(self, origin: Point) -> Found | None:
        """See `TwoParameterRun.at_start`: one of codimension two is."""
        start = self.start
        if start is None or self.loci.get(start.type, start.type) == start.type:
            return None
        return self._found(start.type, origin, 0.0, 0, start.of)
