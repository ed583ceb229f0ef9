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

    Special points of an SN locus are ``CP`` (cusp), ``R1``, ``FF`` (fold-flip) and ``FNS`` (fold-Neimark-Sacker). Those
    of a PD locus are ``GPD``, ``R2``, ``FF`` and ``PDNS`` (flip-Neimark-Sacker). At ``SNSN`` and ``PDPD`` a second
    multiplier is 1 or -1, as by symmetry. Those of a TR locus are ``CH`` (Chenciner), ``R1`` to ``R4``, ``FNS``,
    ``PDNS`` and ``NSNS`` (double Neimark-Sacker). A BC locus has ``SN``, ``PD``
    and ``TR``: there the orbit is critical too. At ``BC`` another border is met. At ``TP`` the parameter
    `SpecialPoint.of` turns. `TwoParameters` and `MapCurve` list the
    other attributes.

    Attributes
    ----------
    angle : ndarray, shape (point,)
        Angle of the critical pair on a TR locus, in radians; NaN on other loci.

    Examples
    --------
    >>> import saltus
    >>> henon = saltus.Map(("x", "y"), {"a": 0.1, "b": 0.3}, {"x": "1 - a*x**2 + y", "y": "b*x"})
    >>> orbit = saltus.find_orbit(henon, x0=[0.0, 0.0])
    >>> branch = saltus.continue_orbit(orbit, "a", bounds=(0.0, 1.0))
    >>> locus = saltus.continue_locus(branch["PD1"], ("a", "b"), {"a": (0.0, 1.0), "b": (0.0, 0.9)})
    >>> locus.type
    'PD'
    """

    angle: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    told = ("angle", "coefficient")
