"""A curve of cycles of a map as a result, along one parameter or two, with its special points."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING, Self, final

import numpy as np

from saltus.contents import Contents, as_json
from saltus.continuation.problems.extents import in_lockstep
from saltus.continuation.results.algebraic_curve import (
    AlgebraicCurve,
    held_varied,
    special_rows,
    special_table,
    special_variables_of,
)
from saltus.continuation.results.crossings import solutions_at
from saltus.continuation.results.curve_files import complex_table
from saltus.continuation.results.parameters import OneParameter
from saltus.continuation.results.special_points import SpecialPoints
from saltus.errors import InputError
from saltus.maps.orbit import MapOrbit, itinerary_of
from saltus.maps.problem import CycleProblem
from saltus.maps.solve import solve_cycle
from saltus.system.maps import Map
from saltus.system.plain import all_parameters, held_map, held_parameters

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator, Mapping

    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["MapBranch", "MapCurve"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MapCurve(AlgebraicCurve[MapOrbit]):
    """Cycles of a map in order along a curve, and special points: the base of `MapBranch` and `MapLocus`.

    `AlgebraicCurve` lists the other attributes.

    Attributes
    ----------
    system : Map
        The map.
    points : ndarray, shape (point, period, state)
        The cycles' points.
    multipliers : ndarray of complex, shape (point, state)
        Multipliers, the largest modulus first.
    forms : tuple of tuple of int
        The itineraries that occur, as indices of pieces.
    form : ndarray of int, shape (point,)
        Index of each cycle's itinerary in `forms`.
    """

    system: Map
    points: NDArray[np.float64]
    multipliers: NDArray[np.complex128]
    forms: tuple[tuple[int, ...], ...]
    form: NDArray[np.int64]

    counted = "cycles"

    kinds = AlgebraicCurve.kinds | {"points": np.float64, "multipliers": np.complex128, "form": np.int64}

    @property
    def period(self) -> int:
        """Number of points of each cycle."""
        return int(self.points.shape[1])

    @property
    def extremes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """See `SolutionCurve.extremes`."""
        return self.points.min(axis=1), self.points.max(axis=1)

    @property
    def x0(self) -> NDArray[np.float64]:
        """The first point of each cycle, shape (point, state)."""
        return np.asarray(self.points[:, 0])

    @property
    def itinerary(self) -> tuple[tuple[str, ...], ...]:
        """The itinerary of each cycle: names of pieces."""
        names = [tuple(self.system.piece_names[k] for k in form) for form in self.forms]
        return tuple(names[i] for i in self.form)

    def _solution(self, index: int) -> MapOrbit:
        return self.orbit(index)

    def _first_states(self) -> NDArray[np.float64]:
        return self.x0

    def iteration(self, name: str, number: int) -> NDArray[np.float64]:
        """Return a state or an output at one point of each cycle.

        Parameters
        ----------
        name : str
            A state or an output.
        number : int
            The cycle's point; negative ones count from the end.

        Returns
        -------
        ndarray, shape (point,)
            In the units of the definition.

        Raises
        ------
        InputError
            A quantity of another name, or no such point of the cycle.
        """
        from saltus import checks

        checks.chosen("quantity", name, dict.fromkeys([*self.system.states, *self.system.output_names]))
        at = range(self.period)[checks.count("number", number, -self.period, self.period - 1)]
        if name in self.system.states:
            return np.asarray(self.points[:, at, self.system.states.index(name)])
        return np.array([orbit.output(name)[at] for orbit in self])

    def orbit(self, index: int) -> MapOrbit:
        """Return the cycle of one point, from which another continuation can start.

        Parameters
        ----------
        index : int
            The point; negative ones count from the end.

        Returns
        -------
        MapOrbit
            With the parameters of the point.

        Raises
        ------
        InputError
            There is no such point.
        """
        i, p = self._at_point(index)
        problem = CycleProblem(self.system, self.forms[self.form[i]], p)
        sizes = in_lockstep(np.abs(self.points).max(axis=0).ravel(), self.period)
        return MapOrbit.from_unknowns(problem, self.points[i].ravel().copy(), sizes)

    def to_xarray(self) -> xr.Dataset:
        """Return the curve as a Dataset: cycles against ``point``, special points against ``special``."""
        import xarray as xr

        data, attrs = self._shared_variables()
        states, shape = len(self.system.states), (self.period, len(self.system.states))
        rows = [point.cycle for point in self.special_points]
        data |= {
            "x": (("point", "iteration", "state"), self.points),
            "multiplier_re": (("point", "multiplier"), self.multipliers.real),
            "multiplier_im": (("point", "multiplier"), self.multipliers.imag),
            "form": ("point", self.form),
            **special_variables_of(self.special_points, shape[0] * shape[1], self.varied),
            "special_x": (("special", "iteration", "state"), special_table([row.points for row in rows], *shape)),
            "special_multiplier_re": (("special", "multiplier"),
                                      special_table([row.multipliers.real for row in rows], states)),
            "special_multiplier_im": (("special", "multiplier"),
                                      special_table([row.multipliers.imag for row in rows], states)),
            "special_piece": (("special", "iteration"), np.array(
                [itinerary_of(self.system, row.itinerary) for row in rows], dtype=np.int64).reshape(-1, shape[0])),
        }  # fmt: skip
        attrs |= {"forms": json.dumps(self.forms)}
        return xr.Dataset(data, coords={"state": list(self.system.states), "parameter": list(self.varied)}, attrs=attrs)

    @classmethod
    def _read(cls, held: Contents) -> Self:
        system = held_map(held)
        parameters, varied = held_parameters(held, system), held_varied(held, system)
        held.names("state", system.states)
        states, period = len(system.states), held.size("iteration", least=1)
        held.expect(multiplier=states, unknown=period * states)
        forms = _forms(held, system, period)
        return cls(
            system=system,
            parameters=parameters,
            points=held.array("x", ("point", "iteration", "state")),
            multipliers=complex_table(held, "multiplier", ("point", "multiplier")),
            forms=forms,
            form=held.array("form", ("point",), int, least=0, most=len(forms) - 1),
            special_points=_special_points(held, system, parameters, varied),
            **cls._shared_fields(held),
            **cls._own_fields(held, varied, held.array("value", ("point", "parameter"))),
        )

    def _described(self, what: str) -> str:
        return super()._described(f"{what} of period {self.period}" if self.period > 1 else what)


@final
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MapBranch(OneParameter[MapOrbit], MapCurve):
    """Fixed points or cycles of a map along one parameter.

    Types of `special_points` are ``SN``, ``PD``, ``TR`` (Neimark-Sacker), ``BP``, ``BC`` (border collision), ``EX``
    (extremum) and users' events. `SpecialPoint.kind` of a BC is ``persistence`` where the cycle goes on in the
    neighbouring itinerary. It is ``nonsmooth fold`` where both lie on the same side of the parameter. `OneParameter`
    and `MapCurve` list the attributes.
    """

    def at(self, value: float) -> tuple[MapOrbit, ...]:
        """Return the cycles of the branch at a value of its parameter, each solved there.

        Parameters
        ----------
        value : float
            The value.

        Returns
        -------
        tuple of MapOrbit
            In order along the branch; more than one where it turns.

        Raises
        ------
        InputError
            The branch does not come to the value.
        ConvergenceError
            Newton's method does not find the cycle between two points of the branch.

        Examples
        --------
        >>> from saltus import Map, continue_orbit, solve_orbit
        >>> logistic = Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"})
        >>> branch = continue_orbit(solve_orbit(logistic, x0=[0.7]), "r", (2.0, 4.0))
        >>> [float(found.points[0, 0].round(9)) for found in branch.at(2.5)]
        [0.6]
        """
        return solutions_at(
            self, value, lambda a, b, share: self._attempts(a, b, share, value), lambda found: found.points.ravel()
        )

    def _attempts(self, a: MapOrbit, b: MapOrbit, share: float, value: float) -> Iterator[Callable[[], MapOrbit]]:
        """Yield what solves for a cycle at a value, from a guess between two neighbours and from both of them."""
        itinerary, parameters = (a if share < 0.5 else b).itinerary, {**a.parameters, self.parameter: value}
        guesses = (a.points + share * (b.points - a.points), a.points, b.points)
        return (partial(solve_cycle, self.system, parameters, itinerary, points) for points in guesses)

    def __repr__(self) -> str:
        return self._described("MapBranch")


def _forms(held: Contents, system: Map, period: int) -> tuple[tuple[int, ...], ...]:
    """Return the itineraries in a file, checked."""
    forms = []
    for row in held.json("forms", list):
        known = isinstance(row, list) and all(type(k) is int and 0 <= k < len(system.pieces) for k in row)
        if not known or len(row) != period:
            raise InputError("attribute 'forms'", row, f"{period} indices of pieces")
        forms.append(tuple(row))
    return tuple(forms)


def _special_points(
    held: Contents, system: Map, parameters: Mapping[str, float], varied: tuple[str, ...]
) -> SpecialPoints[MapOrbit]:
    """Return the special points that `MapCurve.to_xarray` wrote."""
    values = held.array("special_value", ("special", "parameter"))
    points = held.array("special_x", ("special", "iteration", "state"))
    multipliers = complex_table(held, "special_multiplier", ("special", "multiplier"))
    pieces = held.array("special_piece", ("special", "iteration"), int, least=0, most=len(system.pieces) - 1)
    residuals, reasons = held.array("special_residual", ("special",)), held.array("special_reasons", ("special",), str)
    solved = [
        MapOrbit(
            system,
            all_parameters({**parameters, **dict(zip(varied, values[i].tolist(), strict=True))}, system),
            points[i],
            tuple(system.piece_names[k] for k in pieces[i].tolist()),
            multipliers[i],
            float(residuals[i]),
            tuple(str(line) for line in as_json(str(reasons[i]), "special_reasons", list)),
        )
        for i in range(len(values))
    ]
    return special_rows(held, points.shape[1] * points.shape[2], varied, solved)
