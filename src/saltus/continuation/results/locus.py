"""A locus as a result: critical periodic orbits along two parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from saltus.continuation.results.orbit_curve import OrbitCurve
from saltus.continuation.results.parameters import TwoParameters
from saltus.orbits import PeriodicOrbit

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["Locus"]


@final
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Locus(TwoParameters[PeriodicOrbit], OrbitCurve):
    """Critical periodic orbits along two parameters, with the parameters' values in `values`, shape (point, 2).

    An SN locus has ``CP`` (cusp) among its `special_points`. A PD locus has ``GPD`` and a TR locus ``CH``, where the
    normal form's coefficient vanishes. ``R1`` to ``R4`` are strong resonances. At ``FF`` (fold-flip) an SN and a PD
    locus meet. At ``FNS``, ``PDNS`` and ``NSNS`` (fold-, flip- and double Neimark-Sacker) a TR locus meets one of SN,
    PD or TR. At ``SNSN`` and ``PDPD`` a second multiplier is 1 or -1, as by symmetry. At ``GR`` a grazing locus is
    met. GR and BP loci have ``SN``, ``PD`` and ``TR``, where a locus of that type is met. At ``TP`` the parameter
    `SpecialPoint.of` turns. docs/theory/loci.md, "What is found on a locus", gives the test functions.
    `OrbitCurve` lists the other attributes.

    Attributes
    ----------
    type : str
        ``SN``, ``PD``, ``TR``, ``BP``, ``GR`` or ``CH``, which is one of accumulations of hits.
    names : tuple of str
        The two parameters.
    angle : ndarray, shape (point,)
        Angle of the critical multipliers in radians: 0 on an SN locus, pi on a PD locus; NaN on a GR or BP locus.
    coefficient : ndarray, shape (point,)
        Test function of CP, GPD and CH, over its size at the start; NaN on other loci. Its zeros are those of the
        normal form's coefficient. Its sign is not, since a determinant that removes poles is a factor.

    Examples
    --------
    >>> import saltus
    >>> ball = saltus.HybridSystem(
    ...     ("z", "v"), {"e": 0.5, "a": 1.2, "w": 1.0}, {"flight": saltus.Mode({"z": "v", "v": "-1"})},
    ...     [saltus.Transition("flight", "flight", "z - a*sin(s)", -1, {"v": "-e*v + (1 + e)*a*w*cos(s)"})],
    ...     phase=("s", "w"),
    ... )
    >>> branch = saltus.continue_orbit(saltus.find_orbit(ball, x0=[0.6, 3.1, 0.5]), "a", bounds=(0.9, 1.8))
    >>> locus = saltus.continue_locus(branch["PD1"], ("a", "e"), {"a": (0.9, 1.8), "e": (0.4, 0.6)})
    >>> locus.type, locus.parameters
    ('PD', {'e': 0.5, 'a': 1.526823700519116, 'w': 1.0})
    """

    angle: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    told = ("angle", "coefficient")
