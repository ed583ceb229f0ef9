"""A curve of equilibria as a result, along one parameter or two, with its special points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, ClassVar

import numpy as np

from saltus.algebraic.solution import Packed
from saltus.continuation.results.algebraic_curve import AlgebraicCurve
from saltus.equilibria import Equilibrium
from saltus.equilibria.problem import EquilibriumProblem
from saltus.system import HybridSystem

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.contents import Contents

__all__ = ["EquilibriumCurve"]


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class EquilibriumCurve(AlgebraicCurve[Equilibrium]):
    """Equilibria in order along a curve, and special points: the base of `EquilibriumBranch` and `EquilibriumLocus`.

    `AlgebraicCurve` lists the other attributes.

    Attributes
    ----------
    system : HybridSystem
        The system.
    states : ndarray, shape (point, state)
        The equilibria.
    eigenvalues : ndarray of complex, shape (point, state)
        Eigenvalues, the largest real part first.
    mode : ndarray of int, shape (point,)
        Index of the mode whose field vanishes.
    """

    system: HybridSystem
    states: NDArray[np.float64]
    eigenvalues: NDArray[np.complex128]
    mode: NDArray[np.int64]

    counted = "equilibria"
    solved = Equilibrium
    written: ClassVar = {
        "states": Packed("equilibrium", ("state",)),
        "eigenvalues": Packed("eigenvalue", ("eigenvalue",), complex),
        "mode": Packed("mode", (), int, lambda system: len(system.modes) - 1),
    }

    @property
    def at_rest(self) -> bool:
        """See `SolutionCurve.at_rest`: always."""
        return True

    @property
    def equations(self) -> NDArray[np.int64]:
        """See `SolutionCurve.equations`: `mode`."""
        return self.mode

    def _known_as(self, name: str) -> str:
        """Return a state or an output where its least or greatest value is named: those of a motion at rest."""
        whose = name[4:] if isinstance(name, str) and name[:4] in ("min_", "max_") else ""
        return whose if whose in (*self.system.states, *self.system.output_names) else name

    def _solution(self, index: int) -> Equilibrium:
        problem = EquilibriumProblem(self.system, int(self.mode[index]), self._parameter_vector(index))
        return Equilibrium.from_unknowns(problem, np.array(self.states[index]), np.abs(self.states).max(axis=0))

    @classmethod
    def _sizes(cls, held: Contents, system: HybridSystem) -> dict[str, int]:
        return {"eigenvalue": system.freedom, "unknown": len(system.states)}
