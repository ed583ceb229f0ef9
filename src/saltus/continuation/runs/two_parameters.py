"""A locus under way, of any kind of solution: what a continuation along two parameters does in the same way."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import replace
from functools import singledispatch
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from saltus import checks
from saltus.algebraic.newton import terms_of_rows
from saltus.continuation.core.zero_problem import start_point
from saltus.continuation.results.special_points import SpecialPoint
from saltus.continuation.runs.options import Plane
from saltus.continuation.runs.run import Asked, Run
from saltus.continuation.runs.two_sided import BothSides, Found, OneSide, turned
from saltus.errors import InputError
from saltus.scales import ASIDE_OF_POINT, BOUND_MISSED, LOCATED, REGULAR, SAME_POINT, START_MOVED, Verdict, zero

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Event, Examined, Point

__all__ = ["TwoParameterRun", "locus_run"]

_COEFFICIENTS = ("CP", "GPD", "CH", "GH")  # types at which a coefficient of the normal form vanishes
_DEGENERATE = "a family of solutions goes through, or two loci meet"


@singledispatch
def locus_run(solution: object) -> type[TwoParameterRun]:
    """Return how a locus through a critical solution is followed; each kind of solution registers its own."""
    checks.instance("start", solution, SpecialPoint)
    raise AssertionError("a special point has a solution")


class TwoParameterRun(Run):
    """One call that traces a locus.

    Parameters
    ----------
    start : SpecialPoint or None
        Where the locus starts; None where that is a solution with a type.
    solution : Solution
        The solution there.
    kind : str
        Type of the locus.
    plane : Plane
        The two parameters and their intervals.
    asked : Asked
        Steps, directions, types of special points that end the locus, progress.
    """

    curve = "locus"
    loci: ClassVar[Mapping[str, str]]  # type of the locus that starts at a special point of each type, if none is named
    measured: ClassVar[tuple[str, ...]] = ("coefficient",)  # data of its points that a locus holds
    branch: Any  # the equations, known when the first point is

    def __init__(self, start: SpecialPoint[Any] | None, solution: Any, kind: str, plane: Plane, asked: Asked) -> None:
        super().__init__(asked)
        self.start, self.solution, self.kind, self.plane = start, solution, kind, plane
        self.names, self.intervals = plane.names, plane.intervals
        self.scales = np.array([high - low for low, high in self.intervals])
        first, second = ((low / unit, high / unit) for (low, high), unit in
                         zip(self.intervals, self.scales.tolist(), strict=True))  # fmt: skip
        self.bounds = (first, second)
        self.remarks: list[str] = []

    @classmethod
    def types(cls) -> tuple[str, ...]:
        """Return the types of loci."""
        return tuple(name for name, locus in cls.loci.items() if name == locus)

    @classmethod
    def points(cls) -> tuple[str, ...]:
        """Return the types of special points that `stop_at` may name: those of codimension two first."""
        own = [name for name, locus in cls.loci.items() if name == locus]
        return (*(name for name in cls.loci if name not in own), "TP", *own)

    @classmethod
    def check_quantity(cls, point: SpecialPoint[Any]) -> None:
        """Raise `InputError` where the quantity of a user's event has no locus, as a parameter."""
        if point.type in point.solution.system.parameter_names:
            wanted = "a point at which a quantity of the solution has its value"
            raise InputError("start", point.type, wanted, "a parameter keeps its value along a straight line")

    @classmethod
    def check(cls, solution: Any) -> None:
        """Raise `InputError` where no locus starts at a solution, whatever its type."""
        return

    @abstractmethod
    def locus(self) -> Any:
        """Return the locus."""

    @abstractmethod
    def extended(self) -> NDArray[np.float64]:
        """Make the equations, `branch`; return the unknowns of the start."""

    @abstractmethod
    def special(self, half: OneSide, event: Event) -> str | None:
        """Keep a special point that is no bound; return the reason why the locus ends there, or None."""

    @abstractmethod
    def at_start(self, origin: Point) -> Found | None:
        """Return the start as a special point of the locus, if it is one."""

    @abstractmethod
    def moved(self, u: NDArray[np.float64], z: NDArray[np.float64]) -> float:
        """Return how far the first point is from the start, over the unknowns' sizes."""

    def examined(self, point: Point) -> Examined:
        """Return what the first point is."""
        return self.branch.examine(point, None)  # type: ignore[no-any-return]

    def judged(self, matrix: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the rows of the extended equations as they tell whether a start is regular: over their terms."""
        return np.asarray(matrix / terms_of_rows(matrix))

    def why_irregular(self) -> str:
        """Return why a start has no regular locus."""
        return "the extended equations have more than one solution direction there"

    def begin(self) -> tuple[Any, Point]:
        """Return the equations and the first point, its tangent towards growing values of the user's second one."""
        z = self.extended()
        found = np.linalg.svd(self.judged(self.branch.evaluate(z)[1] * self.branch.scale()), compute_uv=False)
        if not found[-1] > REGULAR * found[0]:
            raise self.irregular(self.why_irregular())
        try:
            point = start_point(self.branch, z)
        except (ValueError, np.linalg.LinAlgError) as error:
            raise self.irregular(str(error)) from None
        if (moved := self.moved(point.u, z)) > START_MOVED:
            hint = "the nearest one lies that far from it"
            raise InputError("start", f"{moved:.2g} away", f"a located {self.kind}", hint)
        point.examined = self.examined(point)
        towards = self.names.index(self.plane.order[1])
        return self.branch, turned(point, float(point.tangent[towards - 2]), self.odd)

    def joined(self) -> BothSides:
        """See `Run.joined`; the start is among the special points, unless it was found again.

        The parameters turn at a cusp: where it is the start, their turns there are no further points.
        """
        joined = super().joined()
        own = self.at_start(joined.rows[joined.offset][1])
        if own is not None and all(
            found.name != own.name or abs(arc) > SAME_POINT for found, _, arc in joined.specials
        ):
            others = [
                item
                for item in joined.specials
                if own.name != "CP" or item[0].name != "TP" or abs(item[2]) > SAME_POINT
            ]
            joined.specials = sorted([*others, (own, float(joined.offset), 0.0)], key=lambda item: item[2])
        return joined

    def event(self, half: OneSide, piece: Any, event: Event) -> str | None:
        """See `Run.event`."""
        kind, at = event.name.kind, event.name.segment
        if kind in ("low", "high"):
            event.point.u[at - 2] = self.bounds[at][kind == "high"]
            return self.ends(half, piece, event.point, "bound reached")
        if kind in _COEFFICIENTS and self.degenerate(half, event.point):
            self.remarks.append(f"{self.place(event.point)}: no {kind}, since {_DEGENERATE}")
            return None
        end = self.special(half, event)
        return None if end is None else self.ends(half, piece, event.point, end)

    def degenerate(self, half: OneSide, point: Point) -> bool:
        """Return whether the locus meets other solutions of its equations where a normal form's coefficient vanishes.

        There the equations lose rank, which they have where further terms of the normal form do not vanish. Their least
        singular value grows as the distance from such a place.
        """
        known = [half.first, *(other for piece, other in half.points if piece is self.branch)]
        away = [other for other in known if point.arc - other.arc > ASIDE_OF_POINT and other.J.shape == point.J.shape]
        if not away:
            return False
        beside = away[-1]
        matrices = [at.J * self.branch.scale() for at in (point, beside)]
        terms = np.abs(matrices[1]).max(axis=1, keepdims=True)
        least, other = (float(np.linalg.svd(J / terms, compute_uv=False)[-1]) for J in matrices)
        return zero(least * (point.arc - beside.arc), LOCATED * other) is Verdict.YES

    def start_values(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the parameters at the start, in their units; bounds that are missed by rounding are met."""
        values = values / self.scales
        for i, interval in enumerate(self.bounds):
            for bound in interval:
                values[i] = bound if abs(values[i] - bound) < BOUND_MISSED else values[i]
        return values

    def place(self, point: Point) -> str:
        """See `Run.place`."""
        values = point.u[-2:] * self.scales
        return ", ".join(f"{name} = {value:.9g}" for name, value in zip(self.names, values, strict=True))

    def told(self, point: Point) -> str:
        """See `Run.told`."""
        pairs = zip(self.names, point.u[-2:] * self.scales, strict=True)
        return ", ".join(f"{name} = {value:.6g}" for name, value in pairs)

    def rejected(self) -> tuple[str, ...]:
        """See `Run.rejected`."""
        return self._told_rejected(self.names[1], float(self.scales[1]))

    def irregular(self, reason: str) -> InputError:
        """Return the error of a start at which the parameters have no regular locus."""
        wanted = f"two parameters in which the {self.kind} has a regular locus"
        return InputError("parameters", self.names, wanted, reason)

    def starts_outwards(self, point: Point) -> bool:
        """See `Run.starts_outwards`."""
        for i, (low, high) in enumerate(self.bounds):
            along = float(point.tangent[i - 2])
            beyond = math.copysign(1.0, along) * (float(point.u[i - 2]) - (high if along > 0.0 else low))
            if beyond > -BOUND_MISSED and abs(along) > BOUND_MISSED:
                return True
        return False

    def ready(self, piece: Any, origin: Point) -> Point:
        """See `Run.ready`."""
        return replace(origin, u=origin.u.copy())

    def fields(self, joined: BothSides) -> dict[str, Any]:
        """Return the fields that all loci have in common."""
        order = self.plane.order
        columns = [self.names.index(name) for name in order]
        bounds = {name: list(interval) for name, interval in zip(self.names, self.intervals, strict=True)}
        return {
            "system": self.solution.system,
            "parameters": dict(self.solution.parameters),
            "type": self.kind,
            "names": order,
            "values": np.array([point.u[-2:] * self.scales for _, point in joined.rows])[:, columns],
            "special_points": joined.special_points(order, self.kind),
            "rejected": self.rejected(),
            "options": self.options(bounds),
            **joined.ends(),
            **{
                name: np.array([getattr(point.examined.data, name) for _, point in joined.rows])
                for name in self.measured
            },
        }
