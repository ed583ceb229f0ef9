"""A branch of equilibria along one parameter."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from saltus.continuation.equilibrium_curve import EquilibriumCurve

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["EquilibriumBranch"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EquilibriumBranch(EquilibriumCurve):
    """Equilibria along one parameter.

    Types of `special_points` are ``SN``, ``BP``, ``HB``, ``BE`` (boundary equilibrium) and users' events.
    `SpecialPoint.kind` of a BE is ``persistence`` where the equilibrium goes on in the neighbouring mode. It is
    ``nonsmooth fold`` where both equilibria lie on the same side of the parameter. `EquilibriumCurve` lists the other
    attributes.

    Attributes
    ----------
    parameter : str
        The parameter that varies. Its values along the branch are in `values`, shape (point,).
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

    def __repr__(self) -> str:
        return self._described("EquilibriumBranch")
