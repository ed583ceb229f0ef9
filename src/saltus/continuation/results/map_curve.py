"""A curve of orbits of a map as a result, along one parameter or two, with its special points."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Any, ClassVar, final

import numpy as np

from saltus import checks
from saltus.algebraic.solution import Packed
from saltus.continuation.problems.extents import in_lockstep
from saltus.continuation.results.algebraic_curve import AlgebraicCurve
from saltus.continuation.results.parameters import OneParameter
from saltus.errors import InputError
from saltus.maps.orbit import MapOrbit
from saltus.maps.problem import MapOrbitProblem
from saltus.maps.solve import solve_map_orbit
from saltus.system.maps import Map

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["MapBranch", "MapCurve"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MapCurve(AlgebraicCurve[MapOrbit]):
    """Orbits of a map in order along a curve, and special points: the base of `MapBranch` and `MapLocus`.

    `AlgebraicCurve` lists the other attributes.

    Attributes
    ----------
    system : Map
        The map.
    points : ndarray, shape (point, period, state)
        The orbits' points.
    multipliers : ndarray of complex, shape (point, state)
        Multipliers, the largest modulus first.
    forms : tuple of tuple of int
        The itineraries that occur, as indices of pieces.
    form : ndarray of int, shape (point,)
        Index of each orbit's itinerary in `forms`.
    """

    system: Map
    points: NDArray[np.float64]
    multipliers: NDArray[np.complex128]
    forms: tuple[tuple[int, ...], ...]
    form: NDArray[np.int64]

    counted = "map orbits"
    solved = MapOrbit
    written: ClassVar = {
        "points": Packed("x", ("iteration", "state")),
        "multipliers": Packed("multiplier", ("multiplier",), complex),
        "form": Packed("form", (), int),
    }

    @property
    def period(self) -> int:
        """Number of points of each orbit."""
        return int(self.points.shape[1])

    @property
    def at_rest(self) -> bool:
        """See `SolutionCurve.at_rest`: fixed points."""
        return self.period == 1

    @property
    def called(self) -> str:
        """See `SolutionCurve.called`: fixed points, or orbits of a period."""
        return "fixed points" if self.at_rest else f"orbits of period {self.period}"

    @property
    def equations(self) -> NDArray[np.int64]:
        """See `SolutionCurve.equations`: `form`."""
        return self.form

    @property
    def itinerary(self) -> tuple[tuple[str, ...], ...]:
        """The itinerary of each orbit: names of pieces."""
        names = [tuple(self.system.piece_names[k] for k in form) for form in self.forms]
        return tuple(names[i] for i in self.form)

    def iteration(self, name: str, number: int) -> NDArray[np.float64]:
        """Return a state or an output at one point of each orbit.

        Parameters
        ----------
        name : str
            A state or an output.
        number : int
            The orbit's point; negative ones count from the end.

        Returns
        -------
        ndarray, shape (point,)
            In the units of the definition.

        Raises
        ------
        InputError
            A quantity of another name, or no such point of the orbit.
        """
        checks.chosen("quantity", name, dict.fromkeys([*self.system.states, *self.system.output_names]))
        at = range(self.period)[checks.count("number", number, -self.period, self.period - 1)]
        if name in self.system.states:
            return np.asarray(self.points[:, at, self.system.states.index(name)])
        return np.array([orbit.output(name)[at] for orbit in self])

    def _solution(self, index: int) -> MapOrbit:
        problem = MapOrbitProblem(self.system, self.forms[self.form[index]], self._parameter_vector(index))
        sizes = in_lockstep(np.abs(self.points).max(axis=0).ravel(), self.period)
        return MapOrbit.from_unknowns(problem, self.points[index].ravel().copy(), sizes)

    def _scale(self) -> NDArray[np.float64]:
        return in_lockstep(super()._scale(), self.period)

    def _kept_attributes(self) -> dict[str, str]:
        return super()._kept_attributes() | {"forms": json.dumps(self.forms)}

    @classmethod
    def _sizes(cls, held: Contents, system: Map) -> dict[str, int]:
        states = len(system.states)
        return {"multiplier": states, "unknown": held.size("iteration", least=1) * states}

    @classmethod
    def _held_columns(cls, held: Contents, system: Map) -> dict[str, Any]:
        forms = _forms(held, system, held.size("iteration"))
        known = held.array("form", ("point",), int, least=0, most=len(forms) - 1)
        return super()._held_columns(held, system) | {"forms": forms, "form": known}

    def _described(self, what: str) -> str:
        return super()._described(f"{what} of period {self.period}" if self.period > 1 else what)


@final
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MapBranch(OneParameter[MapOrbit], MapCurve):
    """Fixed points or orbits of a map along one parameter.

    Types of `special_points` are ``SN``, ``PD``, ``TR`` (Neimark-Sacker), ``BP``, ``BC`` (border collision), ``EX``
    (extremum) and users' events. `SpecialPoint.kind` of a BC is ``persistence`` where the orbit goes on in the
    neighbouring itinerary. It is ``nonsmooth fold`` where both lie on the same side of the parameter. `OneParameter`
    and `MapCurve` list the attributes.

    Examples
    --------
    >>> import saltus
    >>> logistic = saltus.Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"})
    >>> orbit = saltus.find_orbit(logistic, {"r": 2.5}, x0=[0.1])
    >>> branch = saltus.continue_orbit(orbit, "r", bounds=(2.0, 3.5))
    >>> [(point.label, round(point.parameters["r"], 9)) for point in branch.special_points]
    [('PD1', 3.0)]
    """

    def _attempts(self, a: MapOrbit, b: MapOrbit, share: float, value: float) -> Iterator[Callable[[], MapOrbit]]:
        itinerary, parameters = (a if share < 0.5 else b).itinerary, {**a.parameters, self.parameter: value}
        guesses = (a.points + share * (b.points - a.points), a.points, b.points)
        return (partial(solve_map_orbit, self.system, parameters, itinerary, points) for points in guesses)


def _forms(held: Contents, system: Map, period: int) -> tuple[tuple[int, ...], ...]:
    """Return the itineraries in a file, checked."""
    forms = []
    for row in held.json("forms", list):
        known = isinstance(row, list) and all(type(k) is int and 0 <= k < len(system.pieces) for k in row)
        if not known or len(row) != period:
            raise InputError("attribute 'forms'", row, f"{period} indices of pieces")
        forms.append(tuple(row))
    return tuple(forms)
