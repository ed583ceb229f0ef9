"""What curves along one parameter have in common, and what those along two have: names, values, points of a locus."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.results.curve import SolutionCurve, Solved
from saltus.continuation.results.displacement import displaced
from saltus.continuation.results.special_points import SpecialPoint

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["OneParameter", "TwoParameters"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class OneParameter(SolutionCurve[Solved]):
    """What branches have: one parameter that varies.

    Attributes
    ----------
    parameter : str
        The parameter. Its values along the branch are in `values`, shape (point,).
    """

    parameter: str

    @property
    def varied(self) -> tuple[str, ...]:
        """The parameter, in a tuple."""
        return (self.parameter,)

    @classmethod
    def _own_fields(cls, held: Contents, varied: tuple[str, ...], values: NDArray[np.float64]) -> dict[str, Any]:
        held.expect(parameter=1)
        return {"parameter": varied[0], "values": values[:, 0]}


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class TwoParameters(SolutionCurve[Solved]):
    """What loci have: a type, and two parameters that vary.

    Attributes
    ----------
    type : str
        Type of the locus' points.
    names : tuple of str
        The two parameters. Their values along the locus are in `values`, shape (point, 2).
    coefficient : ndarray, shape (point,)
        Coefficient of the normal form; NaN where the type has none.
    """

    type: str
    names: tuple[str, str]
    coefficient: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

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

    def _scale(self) -> NDArray[np.float64] | None:
        """Return sizes of the unknowns, for a locus that starts from one of the points; None if unknown."""
        return None

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
        found = held.array("coefficient", ("point",), finite=False)
        return {"type": held.text("type"), "names": varied, "values": values, "coefficient": found}
