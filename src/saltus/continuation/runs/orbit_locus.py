"""One call of `continue_locus` from an orbit: critical orbits along two parameters."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from saltus.continuation.core.arclength import follow
from saltus.continuation.core.locating import events_between
from saltus.continuation.core.monitor import Monitor, at_grazing
from saltus.continuation.core.zero_problem import SAME, Event, Point, start_point
from saltus.continuation.problems.critical_points import CriticalOrbit
from saltus.continuation.problems.ends.closure import alongside, passes
from saltus.continuation.problems.orbit_locus import LocusZeroProblem
from saltus.continuation.results.locus import Locus
from saltus.continuation.results.special_points import SpecialPoint
from saltus.continuation.runs.field_roots import rooted_modes
from saltus.continuation.runs.run import TwoParameterRun
from saltus.continuation.runs.two_sided import Found, OneSide, join, traced, turned
from saltus.errors import InputError
from saltus.orbits.orbit import PeriodicOrbit, orbit_at
from saltus.orbits.signature import DIRECTION, DURATION

__all__ = ["OrbitLocusRun"]

# Special points at which a TR locus ends, and why.
_ENDS = {
    "R1": "beyond it the two multipliers are real, of product 1",
    "R2": "beyond it the two multipliers are real, of product 1",
}

_MOVED = 1e-3  # change, over the unknowns' sizes, by which the first point of a locus may differ from the start
_REGULAR = 1e-11  # least singular value of the extended equations, over the largest, of a regular start
_UNFOLDED = 1e-7  # forcing from which on the branch points of a BP locus do not persist


class OrbitLocusRun(TwoParameterRun):
    """One call of `continue_locus` from an orbit: start, options and equations, which both directions share."""

    odd = LocusZeroProblem.odd
    branch: LocusZeroProblem

    def __init__(self, start: SpecialPoint | PeriodicOrbit, orbit: PeriodicOrbit, *options: Any) -> None:
        super().__init__(*options)
        self.start, self.orbit = start, orbit

    def locus(self, order: tuple[str, ...], directions: str) -> Locus:
        """Return the locus, its parameters in the order that the user gave."""
        if self.kind != "GR" and (modes := rooted_modes(self.orbit)):
            hint = (
                f"in {', '.join(modes)} its slope is infinite there: loci crawl; give the force by its impulse instead"
            )
            wanted = "an orbit whose field has second derivatives where its segments begin"
            raise InputError("start", self.kind, wanted, f'{hint}, as form="impulse" of a law does')
        begin = partial(self.begin, self.names.index(order[1]))
        origin = begin()
        with self.reporter:
            halves = traced(origin, begin, self.trace, directions)
        joined = self.with_start(join((self.branch, origin), halves, "locus"), self._at_start(origin))
        return Locus(
            system=self.orbit.system,
            parameters=dict(self.orbit.parameters),
            tolerance=self.orbit.tolerance,
            angle=np.array([point.examined.data.angle for _, point in joined.rows]),
            **self.fields(joined, order, self.locus_options(directions)),
            **joined.fields(),
        )

    def begin(self, towards: int) -> Point:
        """Return the first point, its tangent towards growing values of the parameter number `towards`."""
        start = self.start if isinstance(self.start, SpecialPoint) else None
        critical = CriticalOrbit(
            self.kind,
            self.orbit,
            self.names,
            self.scales,
            self.start_values(np.array([self.orbit.parameters[name] for name in self.names])),
            None if start is None else start.sizes,
            (self.names[0],) if start is None else start.varied,
            start is not None and start.locus == "GR",
        )
        problem, u, condition, extra = critical.extended()
        z = np.concatenate([u[: problem.size], extra, u[-2:]])
        self.branch = LocusZeroProblem(problem, self.kind, condition, z, self.bounds)
        values = np.linalg.svd(self.branch.evaluate(z)[1] * self.branch.scale(), compute_uv=False)
        if values[-1] < _REGULAR * values[0]:
            reason = "the extended equations have more than one solution direction there"
            if isinstance(self.start, SpecialPoint) and self.start.type == "CP":
                reason = "these do not unfold the cusp"
            raise self.irregular(reason)
        try:
            point = start_point(self.branch, z)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise self.irregular(str(error)) from None
        sizes = np.maximum(self.branch.scale(), float(problem.state_scale.max()) * _MOVED)
        moved = float(np.max(np.abs(point.u - z) / sizes))
        if moved > _MOVED:
            raise InputError(
                "start", f"{moved:.2g} away", f"a located {self.kind}", "the nearest one lies that far from the orbit"
            )
        point.examined = self.branch.examine(point, None)
        return turned(point, float(point.tangent[towards - 2]), self.odd)

    def ready(self, origin: Point) -> Point:
        """See `TwoParameterRun.ready`: the meshes are made for the located point, not for the guess of it."""
        branch, start = self.branch, replace(origin, u=origin.u.copy(), tangent=origin.tangent.copy())
        branch.problem.start(branch.orbit(start.u))
        branch.evaluate(start.u)
        start.examined = branch.examine(start, None)
        return start

    def followed(self, half: OneSide, point: Point, origin: Point) -> str:
        """See `TwoParameterRun.followed`."""
        last = point
        for item in follow(self.branch, point, self.control, log=self.log):
            if isinstance(item, str):
                return f"{self.place(last)}: {item}"
            if isinstance(item, Event):
                end = self._event(half, item)
                if end is not None:
                    half.points.append((self.branch, item.point))
                    return f"{self.place(item.point)}: {end}"
                continue
            if self.kind == "BP" and abs(float(item.u[self.branch.problem.size])) > _UNFOLDED:
                return f"{self.place(last)}: the branch point does not persist: the parameters unfold it"
            if last.arc > 0.0 and passes(self.branch, self.branch.problem, origin, last, item, self.control):
                self._close(half, last, point)
                return "the locus is closed"
            if (end := self.keep(half, self.branch, item)) is not None:
                return end
            last = item
        raise AssertionError("follow ends with a reason")

    def _close(self, half: OneSide, last: Point, start: Point) -> None:
        """End a closed locus at its start; special points of the last step beyond the start are dropped."""
        half.specials = [found for found in half.specials if found.after < len(half.points)]
        half.closed = True
        again = replace(start, u=alongside(self.branch.problem, start.u, last.u), tangent=start.tangent.copy())
        again.arc = last.arc + math.sqrt(float(last.weights @ (again.u - last.u) ** 2))
        again.J = self.branch.evaluate(again.u)[1]
        again.examined = self.branch.examine(again, last)
        found = events_between(self.branch, last, again)
        for event in [] if isinstance(found, str) else found:
            self._event(half, event)
        half.points.append((self.branch, again))

    def _event(self, half: OneSide, event: Event) -> str | None:
        """Keep a special point; return the reason why the locus ends there, or None."""
        kind, at = event.name.kind, event.name.segment
        if kind in ("low", "high"):
            return self.bound_met(event.point, at, kind)
        of = ""
        on_grazing = isinstance(self.start, SpecialPoint) and self.start.locus == "GR"
        if on_grazing and event.point.arc < SAME and kind != "TP" and not at_grazing(event.name):
            return None  # at a start on a grazing every determinant vanishes
        if kind == "TP":
            of = self.names[at]
        elif at_grazing(event.name):
            kind = "GR"
        elif kind == "unfolded":
            return None
        elif event.name.side:
            of = f"{event.name.side} signature"
        if kind == "GR":  # where a duration or a velocity vanishes, its sign is rounding
            if event.name.kind == "duration":
                event.point.u[at * (self.branch.n + 1) + self.branch.n] = 0.0
            data = event.point.examined.data
            survey = replace(data.survey, faults=data.survey.faults & ~(DURATION | DIRECTION))
            event.point.examined = replace(event.point.examined, data=replace(data, survey=survey))
        orbit = self._orbit(event.point)
        half.specials.append(Found(kind, orbit, event.value, len(half.points), event.point.arc, of))
        if kind == "GR":
            return "grazing: orbits beyond it are of another signature"
        if self.kind == "TR" and kind in _ENDS:
            return f"{kind}: {_ENDS[kind]}"
        return kind if kind in self.stops else None

    def _orbit(self, point: Point) -> PeriodicOrbit:
        branch, data = self.branch, point.examined.data
        return orbit_at(branch.problem, branch.orbit(point.u), point.J, data.survey, data.multipliers)

    def _at_start(self, origin: Point) -> Found | None:
        """Return the start as a special point of the locus, if it is one."""
        start, monitors = self.start, origin.examined.monitors
        if not isinstance(start, SpecialPoint) or (monitor := Monitor(start.type)) not in monitors:
            return None
        return Found(start.type, self._orbit(origin), monitors[monitor], 0, 0.0, start.of)
