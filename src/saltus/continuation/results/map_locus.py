"""A locus as a result: critical orbits of a map along two parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from saltus.continuation.results.map_curve import MapCurve
from saltus.continuation.results.parameters import TwoParameters
from saltus.maps.orbit import MapOrbit

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["MapLocus"]


@final
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MapLocus(TwoParameters[MapOrbit], MapCurve):
    """Critical orbits of a map along two parameters, with the parameters' values in `values`, shape (point, 2).

    Special points of an SN locus are ``CP`` (cusp), ``R1`` and ``FF`` (fold-flip). Those of a PD locus are ``GPD``,
    ``R2`` and ``FF``. Those of a TR locus are ``CH`` (Chenciner) and ``R1`` to ``R4``. A BC locus has ``SN``, ``PD``
    and ``TR``: there the orbit is critical too. At ``BC`` another border is met. At ``TP`` the parameter
    `SpecialPoint.of` turns. `TwoParameters` and `MapCurve` list the
    other attributes.

    Attributes
    ----------
    angle : ndarray, shape (point,)
        Angle of the critical pair on a TR locus, in radians; NaN on other loci.
    """

    angle: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    told = ("angle", "coefficient")
