"""A locus of accumulations of hits under way: orbits that rest up to their release, shown as those that hit."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.point_types import ACCUMULATION
from saltus.continuation.core.zero_problem import Examined, Point, start_point
from saltus.continuation.problems.ends.accumulation import Accumulated, Accumulating, accumulated_near
from saltus.continuation.problems.orbit_data import LocusData
from saltus.continuation.problems.orbit_locus import LocusZeroProblem
from saltus.continuation.runs.orbit_locus import OrbitLocusRun
from saltus.continuation.runs.two_parameters import TwoParameterRun
from saltus.continuation.runs.two_sided import BothSides, OneSide, turned
from saltus.errors import InputError
from saltus.orbits.orbit import PeriodicOrbit, orbit_at
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import ON_BORDER, Signature
from saltus.orbits.stability import floquet
from saltus.orbits.stability.speedless import or_unknown

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.monitor import Monitor
    from saltus.continuation.problems.ends.release import Accumulation
    from saltus.continuation.runs.run import Going
    from saltus.orbits.signature import Survey

__all__ = ["AccumulationLocusRun"]


class _Accumulations(LocusZeroProblem):
    """Orbits at an accumulation with so many hits as a `ZeroProblem`, of two parameters."""

    def __init__(self, found: Accumulated, bounds: tuple[tuple[float, float], tuple[float, float]]) -> None:
        self.found = found
        condition = Accumulating(found.problem, found.known, found.stops)
        super().__init__(found.problem, ACCUMULATION, condition, found.u, bounds)
        rest = found.stops, (found.stops + 1) % found.problem.segments  # it lasts as long as the hops left out
        self._durations = {name: i for name, i in self._durations.items() if name.segment not in rest}

    def orbit_of(self, z: NDArray[np.float64]) -> Accumulated:
        """Return what is known of the accumulation with the unknowns `z`."""
        return replace(self.found, u=z)

    def _at_CH(
        self, point: Point, survey: Survey | None, only: Monitor | None
    ) -> tuple[dict[Monitor, float], LocusData | None]:
        return {}, self._data(survey, point.u, math.nan, math.nan)


@dataclass(frozen=True, eq=False)
class _Shown:
    """Equations of the orbits that hit, with what is known of the accumulation near them."""

    problem: OrbitProblem
    found: Accumulated


class AccumulationLocusRun(OrbitLocusRun):
    """One call of `continue_locus` from an accumulation of hits; see `TwoParameterRun`."""

    branch: _Accumulations

    def extended(self) -> NDArray[np.float64]:
        """See `TwoParameterRun.extended`."""
        values = self.start_values(np.array([self.solution.parameters[name] for name in self.names]))
        varied = () if self.start is None else self.start.varied
        order = sorted(self.names, key=lambda name: name not in varied)
        found = None
        for name in order:
            found = found or self._located(self.solution.form, self.solution.unknowns, values, self.names.index(name))
        if found is None:
            wanted = "an orbit whose hits accumulate just where their surface lets it go"
            raise InputError("start", f"hits {self.solution.signature}", wanted, "a point `CH` of a branch is one")
        self.branch = _Accumulations(found, self.bounds)
        return found.u

    def _located(
        self, form: Signature, unknowns: NDArray[np.float64], values: NDArray[np.float64], free: int,
        known: Accumulation | None = None,
    ) -> Accumulated | None:  # fmt: skip
        """Return the accumulation near an orbit, sought in one of the two parameters; then both are active."""
        at = dict(zip(self.names, (values * self.scales).tolist(), strict=True))
        system, tolerance = self.solution.system, self.solution.tolerance
        p = system.parameter_vector({**self.solution.parameters, **at})
        active = [system.parameter_names.index(name) for name in self.names]
        one = slice(free, free + 1)
        problem = OrbitProblem(system, form, p, active[one], self.scales[one], tolerance)
        u = np.append(unknowns, values[free])
        problem.start(u)
        if (found := accumulated_near(problem, u, known)) is None:
            return None
        own = found.problem
        both = OrbitProblem(own.system, own.signature, own.parameters_at(found.u), active, self.scales, own.tol)
        u = np.append(found.u[: own.size], values)
        u[free - 2] = found.u[-1]
        both.start(u)
        return replace(found, problem=both, u=u)

    def judged(self, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `TwoParameterRun.judged`: behind many hits a change of the condition is that of a small time left."""
        return TwoParameterRun.judged(self, matrix)

    def keep(self, half: OneSide, piece: _Accumulations, last: Point, point: Point) -> str | None:
        """See `Run.keep`: what is kept is solved with as many hits as it asks for."""
        shown = self._shown(piece, point)
        if shown is None:
            return f"{self.place(last)}: beyond it no orbit is found whose hits accumulate"
        end = super().keep(half, piece, last, point)
        half.points[-1] = shown
        return end

    def ends(self, half: OneSide, piece: _Accumulations, point: Point, reason: str) -> str:
        """See `Run.ends`."""
        if (shown := self._shown(piece, point)) is not None:
            half.points.append(shown)
        return f"{self.place(point)}: {reason}"

    def arrived(self, half: OneSide, piece: _Accumulations, point: Point) -> str | Going | None:
        """See `Run.arrived`: goes on with as many hits as the accumulation asks for, not fewer, nor below rounding."""
        found = half.points[-1][0].found
        if found.hits == piece.found.hits:
            return None
        self.branch = _Accumulations(found, self.bounds)
        begun = start_point(self.branch, found.u)
        begun = turned(begun, float(begun.tangent[-2:] @ point.tangent[-2:]), self.odd)
        begun.arc, begun.examined = point.arc, self.branch.examine(begun, None)
        before = half.points[-2][1].arc if len(half.points) > 1 else 0.0
        return self.branch, begun, point.arc - before

    def closes(self, half: OneSide, piece: LocusZeroProblem, last: Point, point: Point) -> bool:
        """See `Run.closes`."""
        return piece is half.start[0] and super().closes(half, piece, last, point)

    def joined(self) -> BothSides:
        """See `Run.joined`; the start is shown as all others are."""
        joined = super().joined()
        shown = [self._shown(*row) if isinstance(row[0], _Accumulations) else row for row in joined.rows]
        joined.rows = [row if known is None else known for row, known in zip(joined.rows, shown, strict=True)]
        return joined

    def _orbit(self, point: Point) -> PeriodicOrbit:
        piece, there = self._shown(self.branch, point) or self._flights(self.branch.orbit_of(point.u), point)
        data = there.examined.data
        return orbit_at(piece.problem, there.u, there.J, data.survey, data.multipliers)

    def _shown(self, piece: _Accumulations, point: Point) -> tuple[_Shown, Point] | None:
        """Return a point of the locus as an orbit that hits, solved with the hits it asks for; None where none is."""
        known, values = piece.orbit_of(point.u), point.u[-2:].copy()
        bounds = [i for i in (0, 1) if values[i] in self.bounds[i]]  # what is at a bound is held, or what moves
        free = 1 - bounds[0] if bounds else int(np.argmin(np.abs(point.tangent[-2:])))
        signature, u = known.among_flights()
        found = self._located(signature, u[:-2], values, free, known.known)
        return None if found is None else self._flights(found, point)

    def _flights(self, found: Accumulated, point: Point) -> tuple[_Shown, Point]:
        """Return equations and point of the orbits that hit, at an accumulation."""
        (signature, u), own = found.among_flights(), found.problem
        system = self.solution.system
        problem = OrbitProblem(system, signature, own.parameters_at(found.u), own.active, own.scales, own.tol)
        problem.start(u)
        J, survey = problem.resolve(u)[1], problem.survey(u)
        values = floquet.multipliers(problem, u, J)
        told = or_unknown(problem, u, J, survey.rates[:, 0], values)
        survey = survey._replace(faults=survey.faults & ~ON_BORDER)
        unstable = floquet.unstable_count(floquet.nontrivial(values, autonomous=system.phase is None))
        data = LocusData(survey, told, unstable, values, math.nan, math.nan)
        examined = Examined(point.examined.monitors, None, data)
        return _Shown(problem, found), replace(point, u=u, J=J, examined=examined)
