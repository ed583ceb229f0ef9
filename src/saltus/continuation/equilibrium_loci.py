"""Continuation of loci of equilibria along two parameters: saddle-nodes, Hopf points, boundary equilibria."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.arclength import follow
from saltus.continuation.equilibria import joined_fields
from saltus.continuation.equilibrium_locus import EquilibriumLocus
from saltus.continuation.equilibrium_locus_problem import EquilibriumLocusProblem
from saltus.continuation.equilibrium_problem import closes, extents
from saltus.continuation.run import TwoParameterRun
from saltus.continuation.special_points import SpecialPoint
from saltus.continuation.two_sided import Found, OneSide, join, traced, turned
from saltus.continuation.zero_problem import Event, Point, start_point
from saltus.equilibria.critical import Boundary, Hopf, Singular
from saltus.equilibria.equilibrium import Equilibrium, equilibrium_at
from saltus.equilibria.problem import EquilibriumProblem
from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.equilibria.critical import Condition

__all__ = ["EquilibriumLocusRun"]

_CRITICAL = 1e-3  # distance of a start from its critical condition, over the largest eigenvalue
_MOVED = 1e-3  # change, over the unknowns' sizes, by which the first point of a locus may differ from the start
_REGULAR = 1e-11  # least singular value of the extended equations, over the largest, of a regular start
_ENDS = {
    "BT": "beyond it two real eigenvalues differ in sign alone: no Hopf points",
    "BE": "equilibria beyond it belong to another mode",
}  # special points at which a locus ends, and why


class EquilibriumLocusRun(TwoParameterRun):
    """One call of `continue_locus` from an equilibrium.

    Parameters
    ----------
    start : SpecialPoint or Equilibrium
        Where the locus starts.
    equilibrium : Equilibrium
        The equilibrium there.
    *options
        As `TwoParameterRun` takes them.
    """

    odd = EquilibriumLocusProblem.odd
    branch: EquilibriumLocusProblem

    def __init__(self, start: SpecialPoint[Equilibrium] | Equilibrium, equilibrium: Equilibrium, *options: Any) -> None:
        super().__init__(*options)
        self.start, self.equilibrium = start, equilibrium

    def locus(self, order: tuple[str, ...], directions: str) -> EquilibriumLocus:
        """Return the locus, its parameters in the order that the user gave."""
        origin = self.begin(self.names.index(order[1]))
        with self.reporter:
            halves = traced(lambda sign: self.trace(origin, sign), directions)
        joined = self.with_start(join((self.branch, origin), halves, "locus"), self._at_start(origin))
        return EquilibriumLocus(
            system=self.equilibrium.system,
            parameters=dict(self.equilibrium.parameters),
            frequency=np.array([point.examined.data.frequency for _, point in joined.rows]),
            **self.fields(joined, order, self.locus_options(directions)),
            **joined_fields(joined),
        )

    def begin(self, towards: int) -> Point:
        """Return the first point, its tangent towards growing values of the parameter number `towards`."""
        system = self.equilibrium.system
        p = system.parameter_vector(self.equilibrium.parameters)
        active = [system.parameter_names.index(name) for name in self.names]
        values = self.start_values(p[active])
        mode = system.mode_index(self.equilibrium.mode)
        problem = EquilibriumProblem(system, mode, p, active, self.scales)
        u = np.append(self.equilibrium.state, values)
        known = self.start.scale if isinstance(self.start, SpecialPoint) else None
        sizes = extents(problem, u) if known is None else known
        condition, extra = self._condition(problem, u, sizes)
        z = np.concatenate([u[: problem.n], extra, u[-2:]])
        self.branch = EquilibriumLocusProblem(problem, self.kind, condition, sizes, self.bounds)
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
        own = self.start.type if isinstance(self.start, SpecialPoint) else ""
        # a test function that vanishes at the start itself has no sign there
        monitors = {name: math.nan if name.kind == own else value for name, value in examined.monitors.items()}
        point.examined = replace(examined, monitors=monitors)
        return turned(point, float(point.tangent[towards - 2]), self.odd)

    def _condition(
        self, problem: EquilibriumProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]
    ) -> tuple[Condition, NDArray[np.float64]]:
        """Return the condition of the locus, and a guess of its further unknowns."""
        values = self.equilibrium.eigenvalues
        A = problem.evaluate(u)[1][:, : problem.n]
        top = max(float(np.linalg.norm(A * sizes / sizes[:, None], 2)), 1e-300)
        if self.kind == "SN":
            distance = float(np.abs(values).min()) / top if problem.n > 1 else 0.0
            self._check_critical(distance, "an eigenvalue 0")
            return Singular(problem, u, sizes), np.empty(0)
        if self.kind == "HB":
            pairs = values[values.imag > 0.0]
            small = np.sort(np.abs(values))[:2]
            if small.size > 1 and small[1] < _CRITICAL * top:  # a double zero, as at a BT
                pair, distance = 0j, float(small[1]) / top
            else:
                distances = np.abs(pairs.real) / top
                distance = float(distances.min(initial=math.inf))
                pair = complex(pairs[np.argmin(distances)]) if pairs.size else 0j
            self._check_critical(distance, "an imaginary pair of eigenvalues")
            condition = Hopf(problem, u, sizes, pair)
            return condition, condition.guess
        heights = {}
        for k in problem.ways_out:
            height, gradient = problem.event(k, u)
            heights[k] = abs(height) / (float(np.abs(gradient[: problem.n]) @ sizes) or 1.0)
        nearest = min(heights, key=heights.__getitem__, default=None)
        if nearest is None or not heights[nearest] < _CRITICAL:
            least = math.inf if nearest is None else heights[nearest]
            raise InputError(
                "start", f"{least:.3g} from the nearest surface", "an equilibrium on one", "a BE lies there"
            )
        return Boundary(problem, nearest), np.empty(0)

    def _check_critical(self, distance: float, wanted: str) -> None:
        if not distance < _CRITICAL:
            found = ", ".join(f"{v:.6g}" for v in self.equilibrium.eigenvalues.tolist())
            raise InputError("start", f"eigenvalues {found}", f"an equilibrium with {wanted}, as every {self.kind} has")

    def restarted(self, origin: Point) -> Point:
        """See `TwoParameterRun.restarted`: the borders are those of the other direction's end."""
        if isinstance(self.branch.condition, Hopf):
            at = slice(self.branch.n, -2)
            J = self.branch.problem.evaluate(self.branch.equilibrium(origin.u))[1]
            self.branch.condition.restart(J, origin.u[at])
        return replace(origin, u=origin.u.copy())

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
            if self.kind == "HB" and item.examined.data.frequency == 0.0:
                return f"{self.place(last)}: BT: {_ENDS['BT']}"
            if closes(origin, last, item, self.control):
                half.points.append((self.branch, origin))
                half.closed = True
                return "the locus is closed"
            if (end := self.keep(half, self.branch, item)) is not None:
                return end
            last = item
        raise AssertionError("follow ends with a reason")

    def _event(self, half: OneSide, event: Event) -> str | None:
        """Keep a special point; return the reason why the locus ends there, or None."""
        kind, at = event.name.kind, event.name.segment
        if kind in ("low", "high"):
            return self.bound_met(event.point, at, kind)
        of = self.names[at] if kind == "TP" else ""
        if kind == "BE":
            of = self.branch.problem.system.transitions[event.name.transition].name
        half.specials.append(self._found(kind, event.point, event.value, len(half.points), of))
        if kind in _ENDS and (kind != "BT" or self.kind == "HB"):
            return f"{kind}: {_ENDS[kind]}"
        return kind if kind in self.stops else None

    def _found(self, kind: str, point: Point, value: float, after: int, of: str) -> Found:
        sizes = self.branch.sizes.copy()
        solution = equilibrium_at(self.branch.problem, self.branch.equilibrium(point.u), sizes)
        return Found(kind, solution, value, after, point.arc, of, scale=sizes)

    def _at_start(self, origin: Point) -> Found | None:
        """Return the start as a special point of the locus, if it is one of codimension two."""
        start = self.start
        codimension_two = ("CP", "BT", "GH", "ZH", "HH")
        if not isinstance(start, SpecialPoint) or start.type not in codimension_two:
            return None
        return self._found(start.type, origin, 0.0, 0, start.of)
