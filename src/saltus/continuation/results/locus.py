"""A locus as a result: critical periodic orbits along two parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.results.displacement import displaced
from saltus.continuation.results.orbit_curve import OrbitCurve
from saltus.continuation.results.special_points import SpecialPoint

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["Locus"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Locus(OrbitCurve):
    """Critical periodic orbits along two parameters, with the parameters' values in `values`, shape (point, 2).

    An SN locus has ``CP`` (cusp) among its `special_points`. A PD locus has ``GPD`` and a TR locus ``CH``, where the
    normal form's coefficient vanishes. ``R1`` to ``R4`` are strong resonances. At ``FF`` (fold-flip) an SN and a PD
    locus meet. At ``GR`` a grazing locus is met. A GR locus has ``SN``, ``PD`` and ``TR``, where a locus of that type
    is met. At ``TP`` the parameter `SpecialPoint.of` turns. docs/theory/loci.md, "What is found on a locus", gives the
    test functions. `OrbitCurve` lists the other attributes.

    Attributes
    ----------
    type : str
        ``SN``, ``PD``, ``TR``, ``BP`` or ``GR``.
    names : tuple of str
        The two parameters.
    angle : ndarray, shape (point,)
        Angle of the critical multipliers in radians: 0 on an SN locus, pi on a PD locus; NaN on a GR or BP locus.
    coefficient : ndarray, shape (point,)
        Test function of CP, GPD and CH, over its size at the start; NaN on other loci. Its zeros are those of the
        normal form's coefficient. Its sign is not, since a determinant that removes poles is a factor.
    """

    type: str
    names: tuple[str, str]
    angle: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))
    coefficient: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    kinds = OrbitCurve.kinds | dict.fromkeys(("angle", "coefficient"), np.float64)

    @property
    def varied(self) -> tuple[str, ...]:
        """The two parameters."""
        return self.names

    def point(self, index: int) -> SpecialPoint:
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
        orbit = self.orbit(index)
        at = range(len(self))[index]
        return SpecialPoint(self.type, f"{self.type} point {at}", orbit, 0.0, at, float(self.arclength[at]), self.names)

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
        """
        return displaced(self, of, parameters)

    def _own_columns(self) -> dict[str, NDArray[np.float64]]:
        return {"angle": self.angle, "coefficient": self.coefficient}

    def to_xarray(self) -> xr.Dataset:
        """Return the locus as a Dataset: points against ``point``, special points against ``special``."""
        dataset = super().to_xarray()
        dataset.attrs["type"] = self.type
        return dataset

    @classmethod
    def _own_fields(cls, held: Contents, varied: tuple[str, ...]) -> dict[str, Any]:
        held.expect(parameter=2)
        point, values = ("point",), np.column_stack(cls._varied_columns(held))
        return {
            "type": held.text("type"),
            "names": varied,
            "values": values,
            "angle": held.array("angle", point, finite=False),
            "coefficient": held.array("coefficient", point, finite=False),
        }

    def __repr__(self) -> str:
        return self._described(f"{self.type} locus")
