"""A locus of critical periodic orbits under way: its start, its events."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.locating import events_between
from saltus.continuation.core.monitor import Monitor, at_grazing
from saltus.continuation.core.point_types import ACCUMULATION, CHANGES, POINT_TYPES, loci_through
from saltus.continuation.core.zero_problem import Event, Point
from saltus.continuation.problems.changes import type_of_change
from saltus.continuation.problems.critical_points import CriticalOrbit
from saltus.continuation.problems.ends.accumulating import accumulating
from saltus.continuation.problems.ends.closure import alongside, passes
from saltus.continuation.problems.grazing import neighbour
from saltus.continuation.problems.orbit_locus import LocusZeroProblem
from saltus.continuation.results.locus import Locus
from saltus.continuation.runs.columns import orbit_columns
from saltus.continuation.runs.field_roots import rooted_modes
from saltus.continuation.runs.two_parameters import TwoParameterRun, locus_run
from saltus.continuation.runs.two_sided import Found, OneSide
from saltus.errors import InputError
from saltus.orbits.observables.quantities import read_quantity
from saltus.orbits.orbit import PeriodicOrbit, orbit_at
from saltus.orbits.signature import ON_BORDER
from saltus.scales import LOCUS_SHADOW, SAME_POINT, UNFOLDED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.results.special_points import SpecialPoint

__all__ = ["OrbitLocusRun"]

# Special points at which a TR locus ends, and why.
_ENDS = {
    "R1": "beyond it the two multipliers are real, of product 1",
    "R2": "beyond it the two multipliers are real, of product 1",
}

_LEAST = 1e-3  # size of an unknown, over the largest of the states, by which the way from the start is measured


class OrbitLocusRun(TwoParameterRun):
    """One call of `continue_locus` from a periodic orbit; see `TwoParameterRun`."""

    odd = LocusZeroProblem.odd
    solution: PeriodicOrbit
    branch: LocusZeroProblem
    loci = loci_through("orbit")
    measured = ("coefficient", "angle")

    @classmethod
    def types(cls) -> tuple[str, ...]:
        """See `TwoParameterRun.types`: accumulations of hits have loci too."""
        return (*super().types(), ACCUMULATION)

    @classmethod
    def check(cls, solution: PeriodicOrbit) -> None:
        """See `TwoParameterRun.check`."""
        if solution.fixed is not None and solution.fixed.family:
            raise InputError("start", "one of a family of orbits", "an orbit that is isolated at its parameters")

    @classmethod
    def check_quantity(cls, point: SpecialPoint[PeriodicOrbit]) -> None:
        """See `TwoParameterRun.check_quantity`."""
        super().check_quantity(point)
        if point.type in point.orbit.min:
            low, high = f"min_{point.type}", f"max_{point.type}"
            raise InputError("start", point.type, f"a point of an event {low} or {high}", "which of both is not known")
        read_quantity(point.orbit.system, point.type)

    def locus(self) -> Locus:
        """See `TwoParameterRun.locus`."""
        if self.kind not in CHANGES and (modes := rooted_modes(self.solution)):
            hint = (
                f"in {', '.join(modes)} its slope is infinite there: loci crawl; give the force by its impulse instead"
            )
            wanted = "an orbit whose field has second derivatives where its segments begin"
            raise InputError("start", self.kind, wanted, f'{hint}, as form="impulse" of a law does')
        joined = self.joined()
        return Locus(tolerance=self.solution.tolerance, **self.fields(joined), **orbit_columns(joined))

    def extended(self) -> NDArray[np.float64]:
        """See `TwoParameterRun.extended`."""
        start, orbit = self.start, self.solution
        critical = CriticalOrbit(
            self.kind,
            orbit,
            self.names,
            self.scales,
            self.start_values(np.array([orbit.parameters[name] for name in self.names])),
            None if start is None else start.sizes,
            (self.names[0],) if start is None else start.varied,
            start is not None and start.locus in CHANGES,
        )
        problem, u, condition, extra = critical.extended()
        z = np.concatenate([u[: problem.size], extra, u[-2:]])
        self.branch = LocusZeroProblem(problem, self.kind, condition, z, self.bounds)
        return z

    def judged(self, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
        """See `TwoParameterRun.judged`: conditions on multipliers are judged as they are.

        The terms of a condition at a cusp vanish where its parameters do not unfold it.
        """
        found, size = super().judged(matrix), self.branch.problem.size
        if self.kind not in CHANGES:
            found[size:] = matrix[size:]
        return found

    def why_irregular(self) -> str:
        """See `TwoParameterRun.why_irregular`."""
        at_cusp = self.start is not None and self.start.type == "CP"
        return "these do not unfold the cusp" if at_cusp else super().why_irregular()

    def moved(self, u: NDArray[np.float64], z: NDArray[np.float64]) -> float:
        """See `TwoParameterRun.moved`."""
        least = float(self.branch.problem.state_scale.max()) * _LEAST
        return float(np.max(np.abs(u - z) / np.maximum(self.branch.scale(), least)))

    def ready(self, piece: LocusZeroProblem, origin: Point) -> Point:
        """See `Run.ready`: the meshes are made for the located point, not for the guess of it."""
        start = replace(origin, u=origin.u.copy(), tangent=origin.tangent.copy())
        piece.problem.start(piece.orbit(start.u))
        piece.evaluate(start.u)
        start.examined = piece.examine(start, None)
        return start

    def passed(self, piece: LocusZeroProblem, point: Point) -> str | None:
        """See `Run.passed`."""
        unfolded = self.kind == "BP" and abs(float(point.u[piece.problem.size])) > UNFOLDED
        return "the branch point does not persist: the parameters unfold it" if unfolded else None

    def closes(self, half: OneSide, piece: LocusZeroProblem, last: Point, point: Point) -> bool:
        """See `Run.closes`; special points of the last step beyond the start are dropped."""
        if last.arc == 0.0:
            return False
        met = passes(piece, piece.problem, (piece.problem, half.first), last, point, self.control)
        if met is None:
            return False
        half.specials = [found for found in half.specials if found.after < len(half.points)]
        begun, again = half.first, met.point
        if not piece.problem.slides:
            again = replace(begun, u=alongside(piece.problem, begun.u, last.u), tangent=begun.tangent.copy())
        again.arc = met.arc
        again.J = piece.evaluate(again.u)[1]
        again.examined = piece.examine(again, last)
        found = events_between(piece, last, again)
        for event in [] if isinstance(found, str) else found:
            if event.name.kind not in ("low", "high"):
                self.special(half, event)
        half.end_at(again.arc)
        half.points.append((piece, again))
        return True

    def special(self, half: OneSide, event: Event) -> str | None:
        """See `TwoParameterRun.special`."""
        kind, at = event.name.kind, event.name.segment
        on_grazing = self.start is not None and self.start.locus in CHANGES
        if on_grazing and event.point.arc < SAME_POINT and kind != "TP" and not at_grazing(event.name):
            return None  # at a start on a grazing every determinant vanishes
        of = ""
        if kind == "TP":
            of = self.names[at]
        elif at_grazing(event.name):
            u = self.branch.orbit(event.point.u)
            if self.kind not in CHANGES and (hits := accumulating(self.branch.problem, u, event.name)) is not None:
                return hits  # which of them grazes is rounding
            found = neighbour(self.branch.problem, event.name, u)
            kind = type_of_change(self.branch.problem, event.name, u, found)
        elif kind == "unfolded":
            return None
        elif event.name.side:
            of = f"{event.name.side} signature"
        if kind in CHANGES:
            if event.name.kind == "duration":
                event.point.u[at * (self.branch.n + 1) + self.branch.n] = 0.0
            data = event.point.examined.data
            survey = data.survey._replace(faults=data.survey.faults & ~ON_BORDER)
            event.point.examined = replace(event.point.examined, data=replace(data, survey=survey))
            half.specials = [found for found in half.specials if not self._is_shadow(found, event.point)]
        orbit = self._orbit(event.point)
        half.specials.append(Found(kind, orbit, event.value, len(half.points), event.point.arc, of))
        if kind in CHANGES:
            return f"{POINT_TYPES[kind].meaning}: orbits beyond it are of another signature"
        if self.kind == "TR" and kind in _ENDS:
            return f"{kind}: {_ENDS[kind]}"
        return kind if kind in self.stops else None

    def _is_shadow(self, found: Found, point: Point) -> bool:
        """Return whether a bifurcation found before lies where the signature changes: determinants vanish there."""
        here = found.solution.parameters
        apart = max(abs(here[name] / unit - value) for name, unit, value in
                    zip(self.names, self.scales.tolist(), point.u[-2:].tolist(), strict=True))  # fmt: skip
        return found.name not in CHANGES and found.name != "TP" and apart < LOCUS_SHADOW

    def _orbit(self, point: Point) -> PeriodicOrbit:
        branch, data = self.branch, point.examined.data
        return orbit_at(branch.problem, branch.orbit(point.u), point.J, data.survey, data.multipliers)

    def at_start(self, origin: Point) -> Found | None:
        """See `TwoParameterRun.at_start`."""
        start, monitors = self.start, origin.examined.monitors
        if start is None or (monitor := Monitor(start.type)) not in monitors:
            return None
        return Found(start.type, self._orbit(origin), monitors[monitor], 0, 0.0, start.of)


@locus_run.register
def _(solution: PeriodicOrbit) -> type[OrbitLocusRun]:
    return OrbitLocusRun
