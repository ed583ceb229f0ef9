"""A locus as a result: critical equilibria along two parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, final

import numpy as np

from saltus.continuation.results.equilibrium_curve import EquilibriumCurve
from saltus.continuation.results.parameters import TwoParameters
from saltus.equilibria import Equilibrium

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["EquilibriumLocus"]


@final
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EquilibriumLocus(TwoParameters[Equilibrium], EquilibriumCurve):
    """Critical equilibria along two parameters, with the parameters' values in `values`, shape (point, 2).

    Special points of an SN locus are ``CP`` (cusp), ``BT`` (Bogdanov-Takens) and ``ZH`` (zero-Hopf). Those of an HB
    locus are ``GH`` (generalised Hopf), ``BT``, ``ZH`` and ``HH`` (double Hopf). A BE locus has ``SN`` and ``HB``:
    there the equilibrium is critical too. At ``BE`` a boundary of the mode is met. At ``TP`` the parameter
    `SpecialPoint.of` turns. `TwoParameters` and `EquilibriumCurve` list the
    other attributes.

    Attributes
    ----------
    frequency : ndarray, shape (point,)
        Imaginary part of the critical pair on an HB locus, in radians per unit of time; NaN on other loci.
    """

    frequency: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    kinds = EquilibriumCurve.kinds | dict.fromkeys(("frequency", "coefficient"), np.float64)

    def _own_columns(self) -> dict[str, NDArray[np.float64]]:
        return {"frequency": self.frequency, "coefficient": self.coefficient}

    def _scale(self) -> NDArray[np.float64]:
        return np.asarray(np.maximum(np.ptp(self.states, axis=0), 1e-3 * np.abs(self.states).max()))

    def to_xarray(self) -> xr.Dataset:
        """Return the locus as a Dataset: points against ``point``, special points against ``special``."""
        dataset = super().to_xarray()
        dataset["frequency"], dataset["coefficient"] = ("point", self.frequency), ("point", self.coefficient)
        return dataset.assign_attrs(type=self.type)

    @classmethod
    def _own_fields(cls, held: Contents, varied: tuple[str, ...], values: NDArray[np.float64]) -> dict[str, Any]:
        found = held.array("frequency", ("point",), finite=False)
        return super()._own_fields(held, varied, values) | {"frequency": found}

    def __repr__(self) -> str:
        return self._described(f"{self.type} locus of equilibria")
