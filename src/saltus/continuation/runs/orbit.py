"""A branch of periodic orbits under way: its start, its events, through grazings into other signatures."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from saltus.continuation.core.monitor import BIFURCATIONS, Monitor, at_grazing
from saltus.continuation.core.point_types import ACCUMULATION, CHANGES, POINT_TYPES
from saltus.continuation.core.zero_problem import Event, Examined, Point, start_point
from saltus.continuation.problems.changes import type_of_change
from saltus.continuation.problems.ends.accumulating import accumulating
from saltus.continuation.problems.ends.boundary_homoclinic import meeting_ahead, shrunk_onto
from saltus.continuation.problems.ends.closure import passes
from saltus.continuation.problems.ends.period_halving import halved
from saltus.continuation.problems.ends.shrinking import equilibrium_ahead, on_boundary_ahead, shrunk_to
from saltus.continuation.problems.ends.slowing import grazing_ahead
from saltus.continuation.problems.ends.unbounded import (
    grows_at_last,
    grows_for_ever,
    meets_two_fold,
    perhaps_grows_for_ever,
    period_of,
    swells_at_last,
    swells_for_ever,
    told,
    too_stiff,
    vanishes_at_last,
)
from saltus.continuation.problems.grazing import Neighbour, neighbours
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.continuation.problems.twins import type_of
from saltus.continuation.results.branch import Branch
from saltus.continuation.runs import beyond
from saltus.continuation.runs.chattering import accumulation_between, ended_at, from_accumulation
from saltus.continuation.runs.closed_points import points_when_closed, unless_followed
from saltus.continuation.runs.columns import orbit_columns
from saltus.continuation.runs.copies import copied
from saltus.continuation.runs.excursion import adding_sliding_ahead
from saltus.continuation.runs.on_faces import within_faces
from saltus.continuation.runs.one_parameter import OneParameterRun, Wanted
from saltus.continuation.runs.options import read_events
from saltus.continuation.runs.pieces import in_more_pieces
from saltus.continuation.runs.run import Going
from saltus.continuation.runs.seen import seen_beyond
from saltus.continuation.runs.sizes import beside_rest
from saltus.continuation.runs.to_homoclinic import end_unbounded
from saltus.continuation.runs.two_sided import Found, OneSide
from saltus.errors import InputError
from saltus.orbits.cuts import cut, stretched
from saltus.orbits.orbit import PeriodicOrbit, orbit_at
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import ON_BORDER, Signature
from saltus.orbits.stability.critical import solve_branch_point
from saltus.orbits.stability.floquet import distance_from_circle
from saltus.orbits.unfolding import Fixed
from saltus.scales import ADMISSIBLE_SIDE, BRANCH_POINT_NEAR, FOLD_SHADOW, SAME_POINT

if TYPE_CHECKING:
    from collections.abc import Callable, Mapping, Sequence

    from numpy.typing import NDArray

__all__ = ["OrbitRun"]


class OrbitRun(OneParameterRun):
    """One call of `continue_branch` from a periodic orbit; see `OneParameterRun`."""

    odd = OrbitZeroProblem.odd
    types: ClassVar[tuple[str, ...]] = (*BIFURCATIONS, ACCUMULATION)
    solution: PeriodicOrbit
    fixed: Fixed | None = None

    @classmethod
    def wanted(cls, start: PeriodicOrbit, name: str, events: Mapping[str, float | str]) -> tuple[Wanted, ...]:
        """See `OneParameterRun.wanted`."""
        return read_events(start, name, events)

    def branch(self, options: dict[str, Any]) -> Branch:
        """See `OneParameterRun.branch`."""
        joined = self.joined()
        return Branch(
            tolerance=self.solution.tolerance,
            fixed=self.fixed,
            freed=np.array([self.freed(*row) for row in joined.rows]),
            **self.fields(joined, options),
            **orbit_columns(joined),
        )

    def freed(self, branch: OrbitZeroProblem, point: Point) -> float:
        """Return the freed parameter at a point; NaN where none is freed."""
        return math.nan

    def equations(
        self, signature: Signature, u: NDArray[np.float64], sizes: NDArray[np.float64] | None = None
    ) -> OrbitZeroProblem:
        """Return the zero problem of a signature near `u`; sizes: (states,), those that `u` may not show."""
        p, index = self.solution.system.parameter_vector(self.solution.parameters), self.solution.system.parameter_names
        units = [index.index(self.name)], np.array([self.scale])
        problem = OrbitProblem(self.solution.system, signature, p, *units, self.solution.tolerance)
        problem.start(u, sizes)
        return self.zero_problem(problem, u)

    def zero_problem(self, problem: OrbitProblem, u: NDArray[np.float64]) -> OrbitZeroProblem:
        """Return the zero problem of segment equations near `u`, meshes made."""
        return OrbitZeroProblem(problem, u, self.interest)

    def first(self) -> tuple[OrbitZeroProblem, NDArray[np.float64]]:
        """Return equations and unknowns of the orbit at which the branch starts."""
        u = np.append(self.solution.unknowns, self.start_value(self.solution.parameters))
        branch, self.first_length = beside_rest(self.equations, self.solution.form, u, self.control.largest)
        return branch, u

    def start(self, branch: OrbitZeroProblem, u: NDArray[np.float64]) -> Point:
        """Return the first point of the branch."""
        return within_faces(branch, u, start_point(branch, u))

    def orbit_of(self, branch: OrbitZeroProblem, point: Point) -> PeriodicOrbit:
        """Return the orbit of a point."""
        data = point.examined.data
        found = orbit_at(branch.problem, point.u, point.J, data.survey, data.told)
        return replace(found, tolerance=data.tolerance)

    def last(self, piece: OrbitZeroProblem, point: Point) -> Any:
        """See `Run.last`."""
        return lambda: self.orbit_of(piece, point)

    def halved(self, half: OneSide, branch: OrbitZeroProblem, point: Point) -> Point | None:
        """Return a branch point at which the period halves, located; None where it does not halve."""
        return halved(branch, point, half.points)

    def sharpened(self, branch: OrbitZeroProblem, point: Point) -> Point:
        """Return a branch point located by equations that are regular there."""
        return _sharpened(branch, point)

    def shrinks(self, branch: OrbitZeroProblem, before: Point, point: Point) -> tuple[OrbitZeroProblem, Point] | None:
        """Return equations and point of the equilibrium a few steps ahead to which orbits shrink, or None."""
        return equilibrium_ahead(branch, before, point)

    def _cut(self, half: OneSide, branch: OrbitZeroProblem, item: Point) -> Going | str | None:
        """Return the branch with its orbits cut into more pieces, a point and a step; None where no cut is due.

        Where more pieces are needed than are allowed, this is told.
        """
        found = in_more_pieces(branch, item, self.zero_problem, most=self.control.pieces)
        if found is None:
            return None
        if isinstance(found, str):
            return f"{self.place(item)}: {found}"
        step = item.arc - half.points[-2][1].arc if len(half.points) > 1 else self.control.initial
        return *found, step

    def again(self, piece: OrbitZeroProblem, point: Point) -> Callable[[], tuple[OrbitZeroProblem, Point]]:
        """See `Run.again`."""
        return self.begin if piece.further else copied(piece, point, self.zero_problem)

    def begin(self) -> tuple[OrbitZeroProblem, Point]:
        """Return the equations and the first point, its tangent towards growing parameter."""
        branch, u = self.first()
        try:
            point = self.start(branch, u)
        except InputError:
            raise
        except ValueError as error:
            value = float(u[-1]) * self.scale
            raise self.irregular("periodic orbit", value, error, self.advice()) from None
        if stretched(branch.problem, point.u, point.J):
            problem, u = cut(branch.problem, point.u, point.J)
            branch = self.zero_problem(problem, u)
            point = start_point(branch, u)
        found = branch.examine(point, None)
        for name, value in found.monitors.items():
            if name.kind == "EX" and math.isnan(value):
                raise InputError("events", self.interest.events[name.segment][0], "of orbits that have its derivative")
        self._check_events(found)
        # a start at a grazing counts as on its admissible side, whatever the rounding
        monitors = {
            name: ADMISSIBLE_SIDE if at_grazing(name) and abs(value) < SAME_POINT * SAME_POINT else value
            for name, value in found.monitors.items()
        }
        data = found.data
        if any(value == ADMISSIBLE_SIDE and name.kind in ("duration", "rate") for name, value in monitors.items()):
            monitors = {name: value for name, value in monitors.items() if name.kind != "TR"}
            data = replace(data, followed=())  # multipliers mean nothing at a grazing
        point.examined = replace(found, monitors=monitors, data=data)
        return branch, point

    def _check_events(self, found: Examined) -> None:
        """Raise `InputError` where an event asks for a quantity that is no number on part of the first orbit."""
        system, survey = self.solution.system, found.data.survey
        names = (*system.all_states, *system.output_names)
        for i, (name, kind, value) in enumerate(self.interest.events):
            known = found.monitors.get(Monitor("EX" if value is None else "event", i), 0.0)
            if kind[4:] in names:
                known += (survey.lows if kind.startswith("min") else survey.highs)[names.index(kind[4:])]
            if math.isnan(known) and not name.startswith("velocity("):  # an orbit without the event may be the first
                raise InputError("events", name, "a quantity that is a number all along the orbits", "NaN at the start")

    def advice(self) -> str:
        """Return what to do where a branch along a parameter starts at an orbit of a family."""
        family = self.solution.fixed is not None and self.solution.fixed.family
        return "the orbit is one of a family: vary a quantity, as 'period'" if family else ""

    def _followed(self, half: OneSide, piece: OrbitZeroProblem, point: Point, step: float | None) -> str | Going:
        ended = super()._followed(half, piece, point, step)
        return ended if isinstance(ended, str) else accumulation_between(self, half, ended)

    def stuck(self, half: OneSide, piece: OrbitZeroProblem, last: Point, reason: str) -> str | Going:
        """See `Run.stuck`."""
        if (hits := self._hits(half, reason)) and (
            again := from_accumulation(self, half, half.points[-1], hits)
        ) is not None:
            return again
        if (added := self._excursion_ends(half)) is not None:
            return added
        if (birth := self.halved(half, piece, last)) is not None:  # next to a rest signs of folds are rounding
            half.specials.append(self.found("BP", piece, Event(Monitor("BP"), birth, 0.0), half))
            return self.ends(half, piece, birth, "the period halves")
        if half.points and (landed := on_boundary_ahead(half.points)) is not None:
            end_piece = half.points[-1][0]
            found = self.found("BE", end_piece, Event(Monitor("BE"), landed.point, 0.0), half)
            half.specials.append(replace(found, of=landed.end.event, kind=landed.kind, homoclinic=landed.end))
            return self.ends(half, end_piece, landed.point, landed.told)
        slowed = grazing_ahead(half.points)
        if slowed is not None and (end := self.event(half, piece, slowed)) is not None:
            return end
        how, known = self._unbounded(half) if grows_at_last(half.points) else ("", False)
        if not known and (finer := beyond.more_exactly(half, piece, last)) is not None:
            return piece, finer, self.first_step
        return how if known else f"{how}; {reason}" if how else f"{self.place(last)}: {self._why(piece, half, reason)}"

    def _excursion_ends(self, half: OneSide) -> Going | str | None:
        """Keep the AS at which an excursion from sliding vanishes, and return what goes on there; None without one."""
        if not half.points or self.control.at_grazing == "pass":
            return None
        if (ahead := adding_sliding_ahead(half.points, self.equations)) is None:
            return None
        fresh, event, later = ahead
        arc = half.points[-1][1].arc
        event.point.arc, later.arc = arc, arc + abs(later.arc - event.point.arc)
        self._drop_shadows(half, fresh, event.point)
        half.specials.append(self.found("AS", fresh, event, half))
        half.points.append((fresh, event.point))
        if "AS" in self.stops:
            return f"{self.place(event.point)}: {POINT_TYPES['AS'].meaning}"
        return fresh, later, self.first_step

    def closes(self, half: OneSide, piece: OrbitZeroProblem, last: Point, point: Point) -> bool:
        """See `Run.closes`; special points of the last step beyond the start are those of the first one."""
        begun = half.start[0]
        if piece.problem.signature.whole != begun.problem.signature.whole or (piece is begun and last.arc == 0.0):
            return False
        start = begun.problem, half.first
        met = passes(piece, piece.problem, start, last, point, self.control, begun.active_at)
        if met is None:
            return False
        half.end_at(met.arc)
        half.specials = points_when_closed(half, piece)
        half.points.append(half.start)
        return True

    def keep(self, half: OneSide, piece: OrbitZeroProblem, last: Point, point: Point) -> str | None:
        """See `Run.keep`: a branch ends at the equilibrium to which its orbits shrink."""
        end, rest = super().keep(half, piece, last, point), self.shrinks(piece, last, point)
        return end if rest is None else self._shrunk(half, *rest)

    def arrived(self, half: OneSide, piece: OrbitZeroProblem, point: Point) -> str | Going | None:
        """See `Run.arrived`."""
        sure = grows_for_ever(half.points)
        if (sure or perhaps_grows_for_ever(half.points)) and ((end := self._unbounded(half))[1] or sure):
            return end[0]
        if (swollen := swells_for_ever(half.points)) is not None:
            return f"{self.place(point)}: {swollen}"
        if (again := beyond.parted(piece, point, self.equations)) is not None:
            half.points.pop()
            return *again, self.first_step
        late = beyond.summed_late(piece.problem, point.u)
        again = seen_beyond(piece, point, self.equations, self.wide, ways=(1.0,), rounds=2) if late else None
        if again is not None:
            return *again, self.first_step
        return self._cut(half, piece, point)

    def _why(self, branch: OrbitZeroProblem, half: OneSide, item: str) -> str:
        """Return why no step succeeds behind the last point; `item` if nothing better is known."""
        known = meets_two_fold(half.points) or too_stiff(branch.problem) or swells_at_last(half.points)
        hits = self._hits(half, item)
        return known or vanishes_at_last(half.points) or (f"{hits}; {item}" if hits else item)

    def _hits(self, half: OneSide, reason: str) -> str | None:
        """Return in words that hits accumulate where no step succeeds, for a reason; None where they do not."""
        if not half.points or "not admissible" not in reason:
            return None
        piece, point = half.points[-1]
        return accumulating(piece.problem, point.u)

    def _unbounded(self, half: OneSide) -> tuple[str, bool]:
        """Look for a homoclinic orbit at the end of a branch; return why it ends there, and whether there is one."""
        reason, located = self.ends_unbounded(half)
        piece, point = half.points[-1]
        if not located and piece.problem.system.phase is None and (met := meeting_ahead(half.points)) is not None:
            reason, located, after = f"{told(period_of(piece, point))}: {met.told}", True, len(half.points) - 1
            orbit, end = self.orbit_of(piece, point), met.end
            half.specials.append(Found("BC", orbit, met.error, after, point.arc, end.event, homoclinic=end))
        return f"{self.place(half.points[-1][1])}: {reason}", located

    def ends_unbounded(self, half: OneSide) -> tuple[str, bool]:
        """Append long cycles and the homoclinic orbit to a branch; return why it ends, and whether one is located."""
        return end_unbounded(half, self.interest)

    def _shrunk(self, half: OneSide, piece: OrbitZeroProblem, end: Point) -> str:
        """End a branch at the Hopf point that is its last point."""
        orbit = self.orbit_of(piece, end)
        amplitude = 0.5 * float(np.max((orbit.highs - orbit.lows)[: len(orbit.system.states)]))
        half.specials.append(Found("HB", orbit, amplitude, len(half.points), end.arc))
        return self.ends(half, piece, end, "the cycle shrinks to an equilibrium")

    def at_bound(self, half: OneSide, piece: OrbitZeroProblem, point: Point, kind: str) -> str:
        """See `OneParameterRun.at_bound`."""
        if (swollen := swells_at_last(half.points)) is not None:
            return f"{self.place(half.points[-1][1])}: {swollen}"
        return super().at_bound(half, piece, point, kind)

    def special(self, half: OneSide, branch: OrbitZeroProblem, event: Event) -> str | Going | None:
        """See `OneParameterRun.special`."""
        point = event.point
        if point.examined.data is None:
            return f"{self.place(point)}: {event.name} vanishes, but {point.examined.fault}"
        name = "GR" if at_grazing(event.name) else type_of(event.name)
        changes = name == "GR"
        if name == "BP" and (birth := self.halved(half, branch, point)) is not None:
            half.specials.append(self.found(name, branch, replace(event, point=birth), half))
            return self.ends(half, branch, birth, "the period halves")
        if not changes:
            if name == "SN" and self._same_place(half, branch, point, CHANGES):
                return None
            if name == "BP":
                event = replace(event, point=self.sharpened(branch, point))
            half.specials.append(self.found(name, branch, event, half))
            return self.end_at(half, branch, event.point, name)
        if any(s.name in CHANGES and abs(s.arc - point.arc) < 1e-9 for s in half.specials):
            return None
        if (shrunk := shrunk_to(branch.problem, half.points, point)) is not None:
            point.examined = beyond.as_before(point.examined, half.points[-1][1].examined.data)
            kind, rest = (shrunk.kind, None) if shrunk.kind else shrunk_onto(branch.problem, point.u)
            of = shrunk.kind if rest is None else rest.event
            half.specials.append(replace(self.found("BE", branch, event, half), of=of, kind=kind, homoclinic=rest))
            return self.ends(half, branch, point, shrunk.told)
        if (hits := beyond.accumulated(branch, event)) is not None:
            if (again := from_accumulation(self, half, (branch, point), hits)) is not None:
                return again
            point.examined = beyond.without_rounding(point.examined)
            return self.ends(half, branch, point, hits)
        way = beyond.leaving(branch, event)
        if beyond.sums_up(branch.problem, way):
            half.points.append((branch, point))
            seen = seen_beyond(branch, point, self.equations, self.wide, ways=(1.0,), rounds=2)
            if seen is not None:
                return *seen, self.first_step
            told = "the sum of the impacts that accumulate is no longer exact"
            ended = from_accumulation(self, half, (branch, point), told)
            return ended or f"{self.place(point)}: {told}"
        found = (beside := neighbours(branch.problem, way, point.u))[0]
        name = type_of_change(branch.problem, way, point.u, found)
        # an excursion's duration and the rate at its end vanish at once there: either may have been located
        vanishes = way.kind == "duration" if name == "AS" else way.kind == "rate" and isinstance(found, str)
        if vanishes and (added := self._excursion_ends(half)) is not None:
            return added
        point.examined = beyond.without_rounding(point.examined)
        if self.control.at_grazing == "pass":
            half.specials.append(self.found(name, branch, event, half))
            return self.end_at(half, branch, point, name)
        self._drop_shadows(half, branch, point)
        exchanged = beyond.exchanged_freely(branch, way, found, point, self.equations)
        if exchanged is not None:  # independent events: the orbit and its derivative pass on
            return *exchanged, self.first_step
        half.specials.append(self.found(name, branch, event, half))
        if isinstance(found, Neighbour) and len(found.signature) < len(branch.problem.signature.heads):
            fewer = self.equations(found.signature, found.u)
            orbit = orbit_at(fewer.problem, found.u, fewer.problem.resolve(found.u)[1])
            orbit = replace(orbit, faults=orbit.faults & ~ON_BORDER)
            half.specials[-1] = replace(half.specials[-1], solution=orbit)
        half.points.append((branch, point))
        if name in self.stops:
            return f"{self.place(point)}: {POINT_TYPES[name].meaning}"
        what = POINT_TYPES[name].meaning
        went = beyond.gone_on(beside, branch.problem, point, self.equations)
        if isinstance(went, str) and (name != "GR" or (way.kind == "margin" and len(beside) > 1)):
            went = seen_beyond(branch, point, self.equations, self.wide) or went
        if isinstance(went := unless_followed(half, went), str):
            return ended_at(self, half, (branch, point), f"{what}, {went}")
        if name != "GR" and beyond.turns_back(half.points, went[1]):
            half.specials[-1] = replace(half.specials[-1], of="non-smooth fold")
        return *went, self.first_step

    @property
    def wide(self) -> float:
        """The parameter's interval, in its unit."""
        return self.interest.high - self.interest.low

    @property
    def first_step(self) -> float:
        """The first step behind a change of signature."""
        return min(self.control.initial, 1e-3)

    def _drop_shadows(self, half: OneSide, branch: OrbitZeroProblem, point: Point) -> None:
        """Drop the folds that are shadows of a change of signature."""
        while self._same_place(half, branch, point, ("SN",)):
            half.specials.pop()

    def _same_place(self, half: OneSide, branch: OrbitZeroProblem, point: Point, names: Sequence[str]) -> bool:
        """Return whether a point is the last special point found, which is of given types.

        Where a duration vanishes the parameter may turn like its square, so that there seems to be a fold.
        """
        if not half.specials or half.specials[-1].name not in names:
            return False
        last = half.specials[-1]
        apart = abs(last.solution.parameters[self.name] - point.parameter * self.scale)
        return last.after >= len(half.points) - 2 and apart < FOLD_SHADOW * self.wide * self.scale

    def found(self, name: str, branch: OrbitZeroProblem, event: Event, half: OneSide) -> Found:
        """See `OneParameterRun.found`."""
        point, orbit, value = event.point, self.orbit_of(branch, event.point), event.value
        multipliers = point.examined.data.multipliers
        if name == "PD":
            value = float(np.abs(multipliers[np.isfinite(multipliers)] + 1.0).min())
        elif name == "TR":
            value = distance_from_circle(multipliers)
        tangent = None
        if name == "BP":
            tangent = np.append(point.tangent[: branch.problem.size], self.scale * point.tangent[-1])
        return Found(name, orbit, value, len(half.points), point.arc, tangent=tangent)


def _sharpened(branch: OrbitZeroProblem, point: Point) -> Point:
    """Return a branch point located by equations that are regular there; unchanged where they have no solution."""
    u = solve_branch_point(branch.problem, point.u, branch.evaluate(point.u)[1])
    if u is None or float(point.weights @ (u - point.u) ** 2) > BRANCH_POINT_NEAR**2:
        return point
    found = replace(point, u=u, J=branch.evaluate(u)[1])
    found.examined = branch.examine(found, None)
    return point if found.examined.data is None else found
