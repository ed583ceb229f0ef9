"""A branch of equilibria along one parameter."""

from __future__ import annotations

from dataclasses import dataclass

from saltus.continuation.algebraic_curve import OneParameter
from saltus.continuation.equilibrium_curve import EquilibriumCurve

__all__ = ["EquilibriumBranch"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EquilibriumBranch(OneParameter, EquilibriumCurve):
    """Equilibria along one parameter.

    Types of `special_points` are ``SN``, ``BP``, ``HB``, ``BE`` (boundary equilibrium) and users' events.
    `SpecialPoint.kind` of a BE is ``persistence`` where the equilibrium goes on in the neighbouring mode. It is
    ``nonsmooth fold`` where both lie on the same side of the parameter. `OneParameter` and `EquilibriumCurve` list the
    attributes.
    """

    def __repr__(self) -> str:
        return self._described("EquilibriumBranch")
