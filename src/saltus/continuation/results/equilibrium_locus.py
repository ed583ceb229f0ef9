"""A locus as a result: critical equilibria along two parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, final

import numpy as np

from saltus.continuation.results.equilibrium_curve import EquilibriumCurve
from saltus.continuation.results.parameters import TwoParameters
from saltus.equilibria import Equilibrium

if TYPE_CHECKING:
    from numpy.typing import NDArray


__all__ = ["EquilibriumLocus"]


@final
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EquilibriumLocus(TwoParameters[Equilibrium], EquilibriumCurve):
    """Critical equilibria along two parameters, with the parameters' values in `values`, shape (point, 2).

    Special points of an SN locus are ``CP`` (cusp), ``BT`` (Bogdanov-Takens), ``ZH`` (zero-Hopf) and ``SNSN``, where a
    second eigenvalue is 0, as by symmetry. Those of an HB locus are ``GH`` (generalised Hopf), ``BT``, ``ZH`` and
    ``HH`` (double Hopf). A BE locus has ``SN`` and ``HB``: there the equilibrium is critical too. At ``BE`` a boundary
    of the mode is met. At ``TP`` the parameter `SpecialPoint.of` turns. `TwoParameters` and `EquilibriumCurve` list the
    other attributes.

    Attributes
    ----------
    frequency : ndarray, shape (point,)
        Imaginary part of the critical pair on an HB locus, in radians per unit of time; NaN on other loci.

    Examples
    --------
    >>> import saltus
    >>> neuron = saltus.HybridSystem.smooth(
    ...     {"v": "v - v**3/3 - w + I", "w": "c*(v + 0.7 - 0.8*w)"}, {"I": 0.0, "c": 0.08}
    ... )
    >>> branch = saltus.continue_equilibrium(saltus.find_equilibrium(neuron, x0=[-1.2, -0.6]), "I", bounds=(0.0, 2.0))
    >>> locus = saltus.continue_locus(branch["HB1"], ("I", "c"), {"I": (0.0, 2.0), "c": (0.02, 0.5)})
    >>> locus.type
    'HB'
    """

    frequency: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    told = ("frequency", "coefficient")

    def __repr__(self) -> str:
        return self._described(f"{self.type} locus of equilibria")
