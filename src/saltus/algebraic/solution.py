"""What all zeros of algebraic equations answer as solutions: whether they are regular, how they stand in files."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple, Self

from saltus.solution import Solution

if TYPE_CHECKING:
    from saltus.algebraic.protocol import AlgebraicProblem
    from saltus.contents import Contents

__all__ = ["AlgebraicSolution", "Packed"]


class Packed(NamedTuple):
    """A part of a solution, or a column of a curve, as a variable of a file.

    Attributes
    ----------
    name : str
        Name of the variable; a complex one is written in two, ``<name>_re`` and ``<name>_im``.
    dims : tuple of str
        Dimensions of the part of one solution.
    kind : type
        ``float``, ``complex`` or ``int``.
    most : callable or None
        The greatest index that an ``int`` may be, by the system.
    """

    name: str
    dims: tuple[str, ...]
    kind: type = float
    most: Callable[[Any], int] | None = None


class AlgebraicSolution(Solution):
    """A zero of algebraic equations F(x, p) = 0: the base of `Equilibrium` and `MapOrbit`.

    A new kind inherits from it, has the fields of `Solution`, and says by `packed` what it is made of.

    Attributes
    ----------
    packed : tuple of Packed
        What special points keep of a solution in files; the first are the unknowns x.
    """

    packed: ClassVar[tuple[Packed, ...]]

    @property
    def regular(self) -> bool:
        """Whether the solution lies where its equations hold: `sound`. A virtual one is none of the system."""
        return self.sound

    @property
    def begins_in(self) -> str:
        """Name of the mode, or of the piece, whose outputs hold at `x0`."""
        return ""

    @abstractmethod
    def problem(self, *active: str) -> AlgebraicProblem:
        """Return the equations, with some parameters among the unknowns.

        Parameters
        ----------
        *active : str
            Names of parameters, in the order of the definition.

        Returns
        -------
        AlgebraicProblem
            Its parameters have unit 1.

        Raises
        ------
        InputError
            There is no such parameter.
        """

    @staticmethod
    @abstractmethod
    def _held_system(held: Contents) -> Any:
        """Return the system that a file describes; raise `InputError` where it is of another kind."""

    @abstractmethod
    def pack(self) -> tuple[Any, ...]:
        """Return the values of the parts in `packed`."""

    @classmethod
    @abstractmethod
    def _unpack(
        cls, system: Any, parameters: Mapping[str, float], parts: Sequence[Any], residual: float, reasons: Sequence[str]
    ) -> Self:
        """Return the solution whose parts `pack` returned; they are checked."""
