"""A branch of periodic orbits along one parameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from saltus.continuation.orbit_curve import OrbitCurve

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["Branch"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Branch(OrbitCurve):
    """Periodic orbits along one parameter.

    Attributes
    ----------
    parameter : str
        The parameter that varies. Its values along the branch are in `values`, shape (point,). Types of
        `special_points` are SN, PD, TR, BP, GR, HB, HOM, SNIC and users' events. `OrbitCurve` lists the other
        attributes.
    """

    parameter: str

    @property
    def varied(self) -> tuple[str, ...]:
        """The parameter, in a tuple."""
        return (self.parameter,)

    def _own_columns(self) -> dict[str, NDArray[np.float64]]:
        return {}

    @classmethod
    def _own_fields(cls, held: Contents, varied: tuple[str, ...]) -> dict[str, Any]:
        held.expect(parameter=1)
        return {"parameter": varied[0], "values": cls._varied_columns(held)[0]}

    def __repr__(self) -> str:
        return self._described("Branch")
