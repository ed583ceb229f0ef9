"""A locus as a result: critical cycles of a map along two parameters."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, final

import numpy as np

from saltus.continuation.problems.extents import in_lockstep
from saltus.continuation.results.map_curve import MapCurve
from saltus.continuation.results.parameters import TwoParameters
from saltus.maps.orbit import MapOrbit

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["MapLocus"]


@final
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class MapLocus(TwoParameters[MapOrbit], MapCurve):
    """Critical cycles of a map along two parameters, with the parameters' values in `values`, shape (point, 2).

    Special points of an SN locus are ``CP`` (cusp), ``R1`` and ``FF`` (fold-flip). Those of a PD locus are ``GPD``,
    ``R2`` and ``FF``. Those of a TR locus are ``CH`` (Chenciner) and ``R1`` to ``R4``. A BC locus has ``SN``, ``PD``
    and ``TR``: there the cycle is critical too. At ``BC`` another border is met. At ``TP`` the parameter
    `SpecialPoint.of` turns. `TwoParameters` and `MapCurve` list the
    other attributes.

    Attributes
    ----------
    angle : ndarray, shape (point,)
        Angle of the critical pair on a TR locus, in radians; NaN on other loci.
    """

    angle: NDArray[np.float64] = field(default_factory=lambda: np.empty(0))

    kinds = MapCurve.kinds | dict.fromkeys(("angle", "coefficient"), np.float64)

    def _own_columns(self) -> dict[str, NDArray[np.float64]]:
        return {"angle": self.angle, "coefficient": self.coefficient}

    def _scale(self) -> NDArray[np.float64]:
        moduli = np.abs(self.points).max(axis=0)
        return in_lockstep(np.maximum(np.ptp(self.points, axis=0), 1e-3 * moduli.max()).ravel(), self.period)

    def to_xarray(self) -> xr.Dataset:
        """Return the locus as a Dataset: cycles against ``point``, special points against ``special``."""
        dataset = super().to_xarray()
        dataset["angle"], dataset["coefficient"] = ("point", self.angle), ("point", self.coefficient)
        return dataset.assign_attrs(type=self.type)

    @classmethod
    def _own_fields(cls, held: Contents, varied: tuple[str, ...], values: NDArray[np.float64]) -> dict[str, Any]:
        found = held.array("angle", ("point",), finite=False)
        return super()._own_fields(held, varied, values) | {"angle": found}

    def __repr__(self) -> str:
        return self._described(f"{self.type} locus")
