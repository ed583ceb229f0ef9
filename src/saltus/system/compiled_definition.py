"""A definition with the functions that are compiled from it, whatever its kind."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

from saltus.system import compiled
from saltus.system.angles import TURN
from saltus.system.definition import Definition
from saltus.system.generated import source_file
from saltus.system.integrals.laws import NONE
from saltus.system.periodicity import check_angles, drive_repeats, faded_modes

if TYPE_CHECKING:
    from saltus.system.compiled import Compiled, CompiledSecond, CompiledThird
    from saltus.system.integrals.laws import Laws

__all__ = ["CompiledDefinition"]


class CompiledDefinition(Definition):
    """A definition of a hybrid system or a map with its compiled functions."""

    def _prepare(self) -> None:
        check_angles(self)
        self.modes = faded_modes(self)
        source_file(compiled.FLOW, self)
        self._second: dict[tuple[int, ...], CompiledSecond] = {}

    @cached_property
    def compiled(self) -> Compiled:
        """The compiled functions; of a map ``field`` is the image of a piece, and ``vary`` its derivative."""
        return compiled.load(self)

    @property
    def drive_repeats(self) -> int:
        """How many times the drive repeats while the phase turns once, as 2 for ``cos(2*s)``; 1 without a phase.

        The formulas tell it. Outputs count, too: an output ``cos(s)`` has the period of a whole turn.
        """
        return drive_repeats(self)

    @cached_property
    def turn(self) -> float:
        """Angle of the phase in a period of the drive, which is where it goes back to 0: 2 pi over `drive_repeats`."""
        return TURN / self.drive_repeats

    def _circle(self) -> str:
        count = self.drive_repeats
        return "modulo 2 pi" if count == 1 else f"modulo 2 pi/{count}, in which the drive repeats"

    @property
    def laws(self) -> Laws:
        """Linear first integrals, which solutions keep; none of a map."""
        return NONE

    @property
    def freedom(self) -> int:
        """Dimension of the states of given totals: the number of eigenvalues, or multipliers, of a solution."""
        return len(self.states) - len(self.laws)

    @cached_property
    def third(self) -> CompiledThird:
        """The compiled third derivatives of fields or images in the state."""
        return compiled.load_third(self)

    def second(self, active: tuple[int, ...]) -> CompiledSecond:
        """Return the compiled second derivatives in the state and in some parameters.

        Parameters
        ----------
        active : tuple of int
            Indices of the parameters, growing.

        Returns
        -------
        CompiledSecond
            Made once for each `active`.

        Raises
        ------
        DefinitionError
            SymPy cannot differentiate an expression twice.
        """
        if active not in self._second:
            self._second[active] = compiled.load_second(self, active)
        return self._second[active]
