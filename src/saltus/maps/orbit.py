"""An orbit of a map as a result: points, itinerary, multipliers, stability, whether it is regular."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from saltus import checks
from saltus.algebraic.solution import AlgebraicSolution, Packed
from saltus.contents import Contents
from saltus.described import described
from saltus.errors import InputError
from saltus.flow.starting import negative_root
from saltus.maps.problem import MapOrbitProblem
from saltus.maps.spectrum import NEUTRAL, count_outside, multiplicity, multipliers_of
from saltus.result import frozen
from saltus.scales import STATE_ROUNDED
from saltus.system.angles import TURN
from saltus.system.evaluate import evaluate
from saltus.system.maps import Map
from saltus.system.plain import held_map, held_parameters

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["MapOrbit", "faults_of", "itinerary_of"]

_ON_BORDER = 1e-9  # condition, over its variation with the states' sizes, up to which a point lies on the border
_SHOWN = 4  # points that a `repr` lists


@dataclass(frozen=True, eq=False, repr=False)
class MapOrbit(AlgebraicSolution):
    """A fixed point or an orbit of a map; made by `solve_orbit` and `find_orbit`.

    Attributes
    ----------
    system : Map
        The map.
    parameters : mapping of str to float
        All parameters.
    points : ndarray, shape (period, states)
        The points, each the image of the one before.
    itinerary : tuple of str
        The piece whose image is taken at each point.
    multipliers : ndarray of complex, shape (states,)
        Eigenvalues of the derivative along the orbit, the largest modulus first.
    residual : float
        Largest distance of an image from the next point, over the sizes of its terms.
    reasons : tuple of str
        Why the orbit is virtual: points that lie beyond a border of their pieces. Empty for a regular one.

    Examples
    --------
    >>> import saltus
    >>> logistic = saltus.Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"})
    >>> orbit = saltus.find_orbit(logistic, x0=[0.1])
    >>> orbit.period, orbit.stable
    (2, True)
    """

    system: Map
    parameters: Mapping[str, float]
    points: NDArray[np.float64]
    itinerary: tuple[str, ...]
    multipliers: NDArray[np.complex128]
    residual: float
    reasons: tuple[str, ...] = ()

    noun = "an orbit"
    packed = (
        Packed("x", ("iteration", "state")),
        Packed("multiplier", ("multiplier",), complex),
        Packed("piece", ("iteration",), int, lambda system: len(system.pieces) - 1),
    )

    def __post_init__(self) -> None:
        object.__setattr__(self, "points", frozen(self.points))
        object.__setattr__(self, "multipliers", frozen(self.multipliers, np.complex128))

    @property
    def period(self) -> int:
        """Number of points, after which the orbit closes for the first time."""
        return len(self.points)

    @property
    def extremes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Least and greatest value of each state on the orbit."""
        return self.points.min(axis=0), self.points.max(axis=0)

    @property
    def x0(self) -> NDArray[np.float64]:
        """The first point, shape (states,)."""
        return np.asarray(self.points[0])

    def _states_along(self, points: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        return np.arange(float(self.period)), self.points

    def row(self) -> dict[str, Any]:
        """Return what a table says of the orbit: first point, period, stability, itinerary, whether it is regular."""
        row: dict[str, Any] = dict(zip(self.system.states, self.x0.tolist(), strict=True))
        row |= {"period": self.period, "stable": self.stable, "itinerary": self.itinerary}
        return row | {"regular": self.regular}

    @property
    def stable(self) -> bool:
        """Whether all multipliers lie inside the unit circle, beyond rounding."""
        return bool(np.all(np.abs(self.multipliers) < 1.0 - NEUTRAL))

    @property
    def unstable(self) -> int:
        """Number of multipliers outside the unit circle, beyond rounding."""
        return count_outside(self.multipliers)

    @property
    def begins_in(self) -> str:
        """See `AlgebraicSolution.begins_in`: the first of `itinerary`."""
        return self.itinerary[0]

    @staticmethod
    def _held_system(held: Contents) -> Map:
        """See `AlgebraicSolution._held_system`."""
        return held_map(held)

    def pack(self) -> tuple[Any, ...]:
        """Return points, multipliers and indices of the pieces."""
        return self.points, self.multipliers, itinerary_of(self.system, self.itinerary)

    @classmethod
    def _unpack(
        cls, system: Any, parameters: Mapping[str, float], parts: Sequence[Any], residual: float, reasons: Sequence[str]
    ) -> Self:
        """See `AlgebraicSolution._unpack`."""
        points, values, pieces = parts
        itinerary = tuple(system.piece_names[k] for k in pieces.tolist())
        return cls(system, parameters, points, itinerary, values, residual, tuple(reasons))

    def _multiplicity(self, type: str, varied: Sequence[str]) -> int:
        return multiplicity(self.multipliers, type)

    @property
    def winding(self) -> Mapping[str, int]:
        """How many turns each of the system's angles makes along the orbit; over `period` its rotation number."""
        problem = self.problem()
        gaps = (problem.slopes(self.points.ravel())[0] - np.roll(self.points, -1, axis=0))[
            :, problem.system.angle_places
        ]
        turns = np.rint(gaps / TURN).astype(np.int64).sum(axis=0).tolist()
        return dict(zip((s for s in self.system.states if s in self.system.angles), turns, strict=True))

    @property
    def unknowns(self) -> NDArray[np.float64]:
        """Unknowns of the equations: all points, one after the other."""
        return self.points.ravel()

    @classmethod
    def from_unknowns(cls, problem: MapOrbitProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]) -> Self:
        """Return the orbit with given unknowns.

        Parameters
        ----------
        problem : MapOrbitProblem
            The equations.
        u : ndarray, shape (n + active,)
            The unknowns.
        sizes : ndarray, shape (n,)
            Typical sizes of the points.

        Returns
        -------
        MapOrbit
            As the unknowns are, solved or not: `residual` says how well.

        Raises
        ------
        ValueError
            The unknowns are of another number.
        """
        system, p = problem.system, problem.parameters_at(u)
        return cls(
            system=system,
            parameters=dict(zip(system.parameter_names, p.tolist(), strict=True)),
            points=problem.points(u),
            itinerary=tuple(system.piece_names[k] for k in problem.itinerary),
            multipliers=multipliers_of(problem.slopes(u)[1]),
            residual=problem.rounding(u, problem.evaluate(u)[1], sizes),
            reasons=tuple(faults_of(problem, u, sizes)),
        )

    def problem(self, *active: str) -> MapOrbitProblem:
        """Return the equations, with some parameters among the unknowns.

        Parameters
        ----------
        *active : str
            Names of parameters, in the order of the definition.

        Returns
        -------
        MapOrbitProblem
            Its parameters have unit 1.

        Raises
        ------
        InputError
            A parameter of another name.
        """
        names = self.system.parameter_names
        indices = [names.index(checks.chosen("parameter", name, names)) for name in active]
        p, pieces = self.system.parameter_vector(self.parameters), itinerary_of(self.system, self.itinerary)
        return MapOrbitProblem(self.system, pieces, p, indices, np.ones(len(indices)))

    def output(self, expression: str) -> NDArray[np.float64]:
        """Return an output, or any expression, at each point.

        Parameters
        ----------
        expression : str
            As `Iterates.output` takes it.

        Returns
        -------
        ndarray, shape (period,)
            Its values.

        Raises
        ------
        InputError
            It cannot be read, or has an unknown name.
        """
        pieces = itinerary_of(self.system, self.itinerary)
        return evaluate(self.system, expression, self.points, np.array(pieces), self.parameters)

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return the orbit as a Dataset: points against ``iteration`` and ``state``."""
        from saltus.extras import xr

        data = {
            "x": (("iteration", "state"), np.array(self.points)),
            "multiplier_re": ("multiplier", self.multipliers.real),
            "multiplier_im": ("multiplier", self.multipliers.imag),
        }
        attrs = {
            "parameters": json.dumps(dict(self.parameters)),
            "definition": json.dumps(self.system.definition()),
            "itinerary": json.dumps(list(self.itinerary)),
            "residual": self.residual,
            "reasons": json.dumps(list(self.reasons)),
        }
        return xr.Dataset(data, coords={"state": list(self.system.states)}, attrs=attrs)

    @classmethod
    def _read(cls, held: Contents) -> Self:
        system = held_map(held)
        held.names("state", system.states)
        held.expect(multiplier=len(system.states))
        itinerary = tuple(held.texts("itinerary"))
        itinerary_of(system, itinerary)
        if len(itinerary) != held.size("iteration", least=1):
            raise InputError("attribute 'itinerary'", itinerary, "a piece for each point")
        real, imaginary = (held.array(f"multiplier_{part}", ("multiplier",), finite=False) for part in ("re", "im"))
        multipliers = np.empty(real.shape, dtype=np.complex128)
        multipliers.real, multipliers.imag = real, imaginary
        return cls(
            system=system,
            parameters=held_parameters(held, system),
            points=held.array("x", ("iteration", "state")),
            itinerary=itinerary,
            multipliers=multipliers,
            residual=held.number("residual", least=0.0),
            reasons=tuple(held.texts("reasons")),
        )

    def __repr__(self) -> str:
        what = "Fixed point" if self.period == 1 else f"Orbit of period {self.period}"
        regular = "regular" if self.regular else f"virtual: {'; '.join(self.reasons)}"
        stable = "stable" if self.stable else "unstable"
        lines = [f"{what} of {self.system.name or 'a map'}: {stable}, {regular}"]
        for piece, row in list(zip(self.itinerary, self.points, strict=True))[:_SHOWN]:
            place = ", ".join(f"{name} = {value:.9g}" for name, value in zip(self.system.states, row, strict=True))
            lines.append(f"  {place}" + (f" in {piece}" if self.system.is_piecewise else ""))
        if self.period > _SHOWN:
            lines.append(f"  ... ({self.period - _SHOWN} more)")
        values = ", ".join(_short(value) for value in self.multipliers.tolist())
        return "\n".join([*lines, f"  multipliers {values}", f"  residual {self.residual:.2g}"])


def _short(value: complex) -> str:
    return f"{value.real:.6g}" if value.imag == 0.0 else f"{value.real:.6g}{value.imag:+.6g}i"


def itinerary_of(system: Map, names: object, argument: str = "itinerary") -> tuple[int, ...]:
    """Return the indices of pieces by their names, in turn.

    Raises
    ------
    InputError
        An itinerary that names no piece of the map.
    """
    given = (names,) if isinstance(names, str) else names
    listed = checks.listed(argument, given, f"names of pieces, of {', '.join(system.piece_names)}")
    if not listed:
        raise InputError(argument, names, "a piece for each point")
    return tuple(system.piece_names.index(checks.chosen(argument, name, system.piece_names)) for name in listed)


def faults_of(problem: MapOrbitProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]) -> list[str]:
    """Return why an orbit is virtual: points beyond a border of their pieces, farther than rounding."""
    system, reasons = problem.system, []
    texts = [text for conditions in system.conditions.values() for text in conditions]
    for point, guard, height in problem.heights(u):
        if height < 0.0:
            gradient = problem.border(point, guard, u)[1][: problem.n]
            if -height > _ON_BORDER * float(np.abs(gradient) @ sizes):
                piece = system.piece_names[problem.itinerary[point]]
                text = texts[guard - len(system.pieces)]
                reasons.append(f"point {point} lies beyond the border of {piece}: {text} is {height:.6g}")
    p, spans = problem.parameters_at(u), STATE_ROUNDED * sizes.reshape(problem.period, -1)
    for point, (place, x) in enumerate(zip(problem.itinerary, problem.points(u), strict=True)):
        if told := negative_root(system, place, x, p, spans[point]):
            reasons.append(f"at point {point} {told}")
    return reasons
