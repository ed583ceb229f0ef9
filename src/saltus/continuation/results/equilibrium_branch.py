"""A branch of equilibria along one parameter."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from typing import final

from saltus.continuation.results.crossings import solutions_at
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
    ``nonsmooth fold`` where both lie on the same side of the parameter. `OneParameter` and `EquilibriumCurve` list the
    attributes.
    """

    def at(self, value: float) -> tuple[Equilibrium, ...]:
        """Return the equilibria of the branch at a value of its parameter, each solved there.

        Parameters
        ----------
        value : float
            The value.

        Returns
        -------
        tuple of Equilibrium
            In order along the branch; more than one where it turns.

        Raises
        ------
        InputError
            The branch does not come to the value.
        ConvergenceError
            Newton's method does not find the equilibrium between two points of the branch.

        Examples
        --------
        >>> from saltus import HybridSystem, continue_equilibrium, find_equilibrium
        >>> fold = HybridSystem.smooth({"x": "a - x**2"}, {"a": 1.0})
        >>> branch = continue_equilibrium(find_equilibrium(fold, x0=[1.0]), "a", (-1.0, 4.0))
        >>> [float(found.state[0].round(9)) for found in branch.at(2.25)]
        [-1.5, 1.5]
        """
        return solutions_at(
            self, value, lambda a, b, share: self._attempts(a, b, share, value), lambda found: found.state
        )

    def _attempts(
        self, a: Equilibrium, b: Equilibrium, share: float, value: float
    ) -> Iterator[Callable[[], Equilibrium]]:
        """Yield what solves for an equilibrium at a value, from guesses between and at two neighbours."""
        mode, parameters = (a if share < 0.5 else b).mode, {**a.parameters, self.parameter: value}
        guesses = (a.state + share * (b.state - a.state), a.state, b.state)
        return (partial(find_equilibrium, self.system, parameters, x0, mode=mode) for x0 in guesses)

    def __repr__(self) -> str:
        return self._described("EquilibriumBranch")
