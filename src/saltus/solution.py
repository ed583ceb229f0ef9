"""What every solution answers, whatever its kind: periodic orbits, equilibria, orbits of maps."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar

from saltus import checks
from saltus.result import Result

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Solution"]


class Solution(Result):
    """A solution of a system at given parameters: the base of `PeriodicOrbit`, `Equilibrium` and `MapOrbit`.

    A new kind inherits from it and answers what is abstract here. Nothing above asks of which kind a solution is.

    Attributes
    ----------
    system : HybridSystem or Map
        The system.
    parameters : mapping of str to float
        All parameters.
    residual : float
        How well the equations are solved.
    reasons : tuple of str
        Why the solution is none of the system, though the equations hold. Empty for a sound one.
    x0 : ndarray, shape (states,)
        The state from which a motion along the solution starts.
    noun : str
        What one of its kind is called, as ``"an orbit"``.
    at_rest : bool
        Whether the states of its kind do not move.
    """

    noun: ClassVar[str]
    at_rest: ClassVar[bool] = False

    if TYPE_CHECKING:  # fields of some kinds, computed by others: a property at run time would stand in a field's way

        @property
        def system(self) -> Any:
            """The system."""

        @property
        def parameters(self) -> Mapping[str, float]:
            """All parameters."""

        @property
        def residual(self) -> float:
            """How well the equations are solved."""

        @property
        def reasons(self) -> tuple[str, ...]:
            """Why the solution is none of the system."""

        @property
        def x0(self) -> NDArray[Any]:
            """A state from which a motion along the solution starts."""

    @property
    @abstractmethod
    def stable(self) -> bool:
        """Whether all disturbances decay."""

    @property
    @abstractmethod
    def unstable(self) -> int:
        """In how many directions disturbances grow, beyond what rounding may do."""

    @property
    def sound(self) -> bool:
        """Whether this is a solution of the system, and not only of equations that hold elsewhere."""
        return not self.reasons

    @property
    def conserved(self) -> dict[str, float]:
        """Totals that the system conserves, by name: the solution is isolated, and stable or not, at these.

        They are linear first integrals of the states, as ``HybridSystem.conserved`` names them.
        """
        return self.system.laws.named(self.x0, self.system.parameter_vector(self.parameters))  # type: ignore[no-any-return]

    def _held_value(self, name: str) -> float | None:
        """Return the value of a quantity that was held as the solution was solved; None where it was not."""
        return None

    @property
    @abstractmethod
    def extremes(self) -> tuple[NDArray[Any], NDArray[Any]]:
        """Least and greatest value of each state along the solution, shape (states,) each."""

    def states_along(self, points: int = 400) -> tuple[NDArray[Any], NDArray[Any]]:
        """Return the states along the solution.

        Parameters
        ----------
        points : int, optional
            About how many, where time is continuous.

        Returns
        -------
        places, states : ndarray, shape (place,) and (place, state)
            Times, or numbers of iterations.

        Raises
        ------
        InputError
            `points` is no count.
        """
        return self._states_along(points)

    @abstractmethod
    def _states_along(self, points: int) -> tuple[NDArray[Any], NDArray[Any]]:
        """See `states_along`."""

    @abstractmethod
    def row(self) -> dict[str, Any]:
        """Return what a table says of the solution, by the names of its columns."""

    def multiplicity(self, type: str, varied: Sequence[str]) -> int:
        """Return how many eigenvalues, multipliers or complex pairs are critical at once; at least 1.

        Parameters
        ----------
        type : str
            Type of the special point at which the solution is.
        varied : sequence of str
            Parameters that vary along the curve of the point.

        Returns
        -------
        int
            1 for a type of which only one is ever critical.

        Raises
        ------
        InputError
            `varied` has no names.
        """
        return self._multiplicity(type, checks.names("varied", varied, "names of parameters"))

    def _multiplicity(self, type: str, varied: Sequence[str]) -> int:
        """See `multiplicity`; 1 for a kind that cannot have more."""
        return 1
