"""What curves along one parameter have in common, and what those along two have: names, values, points of a locus."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, ClassVar

import numpy as np

from saltus.continuation.results.crossings import solutions_at
from saltus.continuation.results.curve import SolutionCurve, Solved
from saltus.continuation.results.displacement import displaced
from saltus.continuation.results.special_points import SpecialPoint
from saltus.result import frozen

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["OneParameter", "TwoParameters"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class OneParameter(SolutionCurve[Solved]):
    """What branches have: one parameter that varies."""

    parameter: str  # the parameter. Its values along the branch are in `values`, shape (point,).

    @property
    def varied(self) -> tuple[str, ...]:
        """The parameter, in a tuple."""
        return (self.parameter,)

    def at(self, value: float) -> tuple[Solved, ...]:
        """Return the solutions of the branch at a value of its parameter, each solved there.

        Parameters
        ----------
        value : float
            The value, or that of the quantity along which the branch goes.

        Returns
        -------
        tuple of PeriodicOrbit, Equilibrium or MapOrbit
            In order along the branch; more than one where it turns.

        Raises
        ------
        InputError
            The branch does not come to the value.
        ConvergenceError
            Newton's method does not find the solution between two points of the branch.

        Examples
        --------
        >>> from saltus import HybridSystem, continue_orbit, find_orbit
        >>> spring = HybridSystem.smooth(
        ...     {"x": "v", "v": "-0.1*v - x - x**3 + 0.5*cos(theta)"}, {"w": 1.0}, phase=("theta", "w")
        ... )
        >>> response = continue_orbit(find_orbit(spring, {"w": 1.2}, [0.0, 0.0]), "w", (1.0, 2.5))
        >>> [(round(orbit.max["x"], 6), orbit.stable) for orbit in response.at(2.0)]
        [(2.083176, True), (1.973689, False), (0.1675, True)]
        """
        return solutions_at(self, value, lambda a, b, share: self._attempts(a, b, share, value), self._extent)

    @abstractmethod
    def _attempts(self, a: Solved, b: Solved, share: float, value: float) -> Iterator[Callable[[], Solved]]:
        """Yield what solves for a solution at a value, from guesses between and at two neighbours."""

    @classmethod
    def _own_fields(cls, held: Contents, varied: tuple[str, ...], values: NDArray[np.float64]) -> dict[str, Any]:
        held.expect(parameter=1)
        return {"parameter": varied[0], "values": values[:, 0]}

    def __repr__(self) -> str:
        return self._described(type(self).__name__)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class TwoParameters(SolutionCurve[Solved]):
    """What loci have: a type, and two parameters that vary."""

    type: str  # type of the locus' points
    names: tuple[str, str]  # the two parameters. Their values along the locus are in `values`, shape (point, 2).
    # shape (point,): coefficient of the normal form; NaN where the type has none
    coefficient: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    told: ClassVar[tuple[str, ...]] = ("coefficient",)  # columns that only loci have

    def __post_init__(self) -> None:
        super().__post_init__()
        for name in self.told:
            object.__setattr__(self, name, frozen(getattr(self, name)))

    @property
    def varied(self) -> tuple[str, ...]:
        """The two parameters."""
        return self.names

    def point(self, index: int) -> SpecialPoint[Solved]:
        """Return one point of the locus as a special point of the locus' type; another locus can start from it.

        Parameters
        ----------
        index : int
            The point; negative ones count from the end.

        Returns
        -------
        SpecialPoint
            Of the locus' type.

        Raises
        ------
        InputError
            There is no such point.
        """
        at = self._place(index)
        arc, label = float(self.arclength[at]), f"{self.type} point {at}"
        return SpecialPoint(self.type, label, self._solution(at), 0.0, at, arc, self.names, scale=self._scale())

    def _own_columns(self) -> dict[str, NDArray[np.float64]]:
        return {name: getattr(self, name) for name in self.told}

    def _kept_attributes(self) -> dict[str, str]:
        return super()._kept_attributes() | {"type": self.type}

    def displacement(self, of: str, parameters: Sequence[str] | None = None) -> xr.Dataset:
        """Return how the locus moves as parameters change: exact derivatives of one of its two parameters.

        The other one is held at each point, unless it is among `parameters`. docs/theory/sensitivities.md, "Special
        points", derives them.

        Parameters
        ----------
        of : str
            The parameter of the locus that is displaced.
        parameters : sequence of str, optional
            Parameters that change; by default all but `of`. For the locus' other parameter it is the locus' own slope.

        Returns
        -------
        xarray.Dataset
            ``displacement`` along ``point`` and ``parameter``; the locus' parameters and ``note`` along ``point``.
            Where the locus turns in `of`, as at a cusp, derivatives are NaN, and ``note`` says why.

        Raises
        ------
        InputError
            `of` is no parameter of the locus, or a name is no other parameter.

        Examples
        --------
        >>> from saltus import HybridSystem, continue_equilibrium, continue_locus, find_equilibrium
        >>> fold = HybridSystem.smooth({"x": "r + h*x - a*x**3"}, {"r": 1.0, "h": 3.0, "a": 1.0})
        >>> branch = continue_equilibrium(find_equilibrium(fold, {}, [2.0]), "r", (-4.0, 4.0))
        >>> folds = continue_locus(branch["SN1"], ("r", "h"), {"r": (0.5, 4.0), "h": (2.0, 4.0)})
        >>> moved = folds.displacement("r", ["a"])["displacement"].sel(parameter="a")
        >>> bool(abs(moved + folds.values[:, 0] / 2.0).max() < 1e-9)
        True
        """
        return displaced(self, of, parameters)

    @classmethod
    def _own_fields(cls, held: Contents, varied: tuple[str, ...], values: NDArray[np.float64]) -> dict[str, Any]:
        held.expect(parameter=2)
        columns = {name: held.array(name, ("point",), finite=False) for name in cls.told}
        return {"type": held.text("type"), "names": varied, "values": values, **columns}

    def __repr__(self) -> str:
        return self._described(f"{self.type} locus")
