"""A branch of equilibria along one parameter."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import final

from saltus.continuation.results.equilibrium_curve import EquilibriumCurve
from saltus.continuation.results.parameters import OneParameter
from saltus.equilibria import Equilibrium, find_equilibrium

__all__ = ["EquilibriumBranch"]


@final
@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EquilibriumBranch(OneParameter[Equilibrium], EquilibriumCurve):
    """Equilibria along one parameter.

    Types of `special_points` are ``SN``, ``BP``, ``HB``, ``BE`` (boundary equilibrium), ``EX`` (extremum) and users'
    events. `SpecialPoint.kind` of a BE is ``persistence`` where the equilibrium goes on in the neighbouring mode. It is
    ``nonsmooth fold`` where both lie on the same side of the parameter. It is ``two-fold`` where both fields beside a
    sliding mode are tangent to its surface. `OneParameter` and `EquilibriumCurve` list the attributes.

    Examples
    --------
    >>> import saltus
    >>> lorenz = saltus.HybridSystem.smooth(
    ...     {"x": "10*(y - x)", "y": "x*(r - z) - y", "z": "x*y - 8*z/3"}, {"r": 0.5}
    ... )
    >>> rest = saltus.find_equilibrium(lorenz)
    >>> branch = saltus.continue_equilibrium(rest, "r", bounds=(0.0, 3.0))
    >>> [(point.label, round(point.parameters["r"], 9)) for point in branch.special_points]
    [('BP1', 1.0)]
    """

    def _attempts(
        self, a: Equilibrium, b: Equilibrium, share: float, value: float
    ) -> Iterator[Callable[[], Equilibrium]]:
        mode, parameters = (a if share < 0.5 else b).mode, {**a.parameters, self.parameter: value}
        guesses = (a.state + share * (b.state - a.state), a.state, b.state)
        return (partial(find_equilibrium, self.system, parameters, x0, mode=mode) for x0 in guesses)
