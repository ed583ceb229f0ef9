"""A curve of equilibria as a result, along one parameter or two, with its special points."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from saltus.contents import Contents, as_json
from saltus.continuation.results.algebraic_curve import (
    AlgebraicCurve,
    held_varied,
    special_rows,
    special_table,
    special_variables_of,
)
from saltus.continuation.results.curve_files import complex_table
from saltus.continuation.results.special_points import SpecialPoints
from saltus.equilibria import Equilibrium
from saltus.equilibria.problem import EquilibriumProblem
from saltus.system import HybridSystem
from saltus.system.plain import all_parameters, held_parameters, held_system

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr
    from numpy.typing import NDArray

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

    kinds = AlgebraicCurve.kinds | {"states": np.float64, "eigenvalues": np.complex128, "mode": np.int64}

    @property
    def extremes(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """See `SolutionCurve.extremes`: twice the states."""
        return self.states, self.states

    def _solution(self, index: int) -> Equilibrium:
        return self.equilibrium(index)

    def _first_states(self) -> NDArray[np.float64]:
        return self.states

    def _known_as(self, name: str) -> str:
        """Return a state or an output where its least or greatest value is named: those of a motion at rest."""
        whose = name[4:] if isinstance(name, str) and name[:4] in ("min_", "max_") else ""
        return whose if whose in (*self.system.states, *self.system.output_names) else name

    def equilibrium(self, index: int) -> Equilibrium:
        """Return the equilibrium of one point, from which another continuation can start.

        Parameters
        ----------
        index : int
            The point; negative ones count from the end.

        Returns
        -------
        Equilibrium
            With the parameters of the point.

        Raises
        ------
        InputError
            There is no such point.
        """
        i, p = self._at_point(index)
        problem = EquilibriumProblem(self.system, int(self.mode[i]), p)
        return Equilibrium.from_unknowns(problem, np.array(self.states[i]), np.abs(self.states).max(axis=0))

    def to_xarray(self) -> xr.Dataset:
        """Return the curve as a Dataset: points against ``point``, special points against ``special``."""
        import xarray as xr

        data, attrs = self._shared_variables()
        data |= {
            "equilibrium": (("point", "state"), self.states),
            "eigenvalue_re": (("point", "eigenvalue"), self.eigenvalues.real),
            "eigenvalue_im": (("point", "eigenvalue"), self.eigenvalues.imag),
            "mode": ("point", self.mode),
        }
        data |= _special_variables(self.special_points, len(self.system.states), self.varied, self.system)
        return xr.Dataset(data, coords={"state": list(self.system.states), "parameter": list(self.varied)}, attrs=attrs)

    @classmethod
    def _read(cls, held: Contents) -> Self:
        system = held_system(held)
        parameters, varied = held_parameters(held, system), held_varied(held, system)
        held.names("state", system.states)
        held.expect(eigenvalue=len(system.states), unknown=len(system.states))
        return cls(
            system=system,
            parameters=parameters,
            states=held.array("equilibrium", ("point", "state")),
            eigenvalues=complex_table(held, "eigenvalue", ("point", "eigenvalue")),
            mode=held.array("mode", ("point",), int, least=0, most=len(system.modes) - 1),
            special_points=_special_points(held, system, parameters, varied),
            **cls._shared_fields(held),
            **cls._own_fields(held, varied, held.array("value", ("point", "parameter"))),
        )


def _special_variables(
    points: SpecialPoints[Equilibrium], n: int, varied: tuple[str, ...], system: HybridSystem
) -> dict[str, Any]:
    """Return special points as variables of a Dataset."""
    rows = [point.equilibrium for point in points]
    return special_variables_of(points, n, varied) | {
        "special_state": (("special", "state"), special_table([row.state for row in rows], n)),
        "special_eigenvalue_re": (("special", "eigenvalue"), special_table([row.eigenvalues.real for row in rows], n)),
        "special_eigenvalue_im": (("special", "eigenvalue"), special_table([row.eigenvalues.imag for row in rows], n)),
        "special_mode": ("special", np.array([system.mode_index(row.mode) for row in rows], dtype=np.int64)),
    }


def _special_points(
    held: Contents, system: HybridSystem, parameters: Mapping[str, float], varied: tuple[str, ...]
) -> SpecialPoints[Equilibrium]:
    """Return the special points that `_special_variables` wrote."""
    special, n = ("special",), len(system.states)
    values = held.array("special_value", ("special", "parameter"))
    states = held.array("special_state", ("special", "state"))
    eigenvalues = complex_table(held, "special_eigenvalue", ("special", "eigenvalue"))
    modes = held.array("special_mode", special, int, least=0, most=len(system.modes) - 1)
    residuals = held.array("special_residual", special)
    reasons = held.array("special_reasons", special, str)
    solved = [
        Equilibrium(
            system,
            all_parameters({**parameters, **dict(zip(varied, values[i].tolist(), strict=True))}, system),
            system.mode_names[modes[i]],
            states[i],
            eigenvalues[i],
            float(residuals[i]),
            tuple(str(line) for line in as_json(str(reasons[i]), "special_reasons", list)),
        )
        for i in range(len(values))
    ]
    return special_rows(held, n, varied, solved)
