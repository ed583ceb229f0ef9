"""Newton's method for equilibria."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.algebraic.newton import solve_zero, why_none
from saltus.equilibria.equilibrium import Equilibrium
from saltus.equilibria.problem import EquilibriumProblem, check_autonomous
from saltus.equilibria.pseudo import WithoutPole
from saltus.equilibria.sliding import sides_of
from saltus.errors import ConvergenceError
from saltus.flow.starting import starting_mode
from saltus.system import HybridSystem
from saltus.system.angles import wrapped
from saltus.system.maps import flowing

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import NDArray

    from saltus.checks.states import StateLike


__all__ = ["find_equilibrium", "solve_equilibrium"]

_RESIDUAL = 1e-10  # most residual, over the field's terms, of an equilibrium


def find_equilibrium(
    system: HybridSystem,
    parameters: Mapping[str, float] | None = None,
    x0: StateLike | None = None,
    *,
    mode: str | None = None,
) -> Equilibrium:
    """Return the equilibrium of one mode near a state, by damped Newton steps.

    docs/theory/equilibria.md, "Equations", describes the steps and when they have converged.

    Parameters
    ----------
    system : HybridSystem
        An autonomous system.
    parameters : mapping of str to float, optional
        Parameters that differ from the system's defaults.
    x0 : array_like, shape (states,), or mapping of str to float, optional
        A state near the equilibrium; by default the origin.
    mode : str, optional
        The mode whose field vanishes. By default the mode in which a motion from `x0` starts.

    Returns
    -------
    Equilibrium
        Regular or virtual: `Equilibrium.regular` tells.

    Raises
    ------
    InputError
        The system is forced; a name or a state that cannot be used.
    ConvergenceError
        Newton's method finds no equilibrium near `x0`, or the field is singular on the way.

    Examples
    --------
    >>> from saltus import HybridSystem, Mode
    >>> lorenz = HybridSystem(
    ...     ("x", "y", "z"), {"sigma": 10.0, "r": 24.0, "b": 8 / 3},
    ...     {"flow": Mode({"x": "sigma*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"})},
    ... )
    >>> find_equilibrium(lorenz, x0=[8.0, 8.0, 23.0]).kind
    'stable focus'
    """
    flowing(system, "solve_orbit, find_orbit")
    check_autonomous(system)
    p = system.parameter_vector(parameters)
    x = np.zeros(len(system.states)) if x0 is None else system.full_state(x0)
    index = starting_mode(system, x, p) if mode is None else system.mode_index(mode)
    problem = EquilibriumProblem(system, index, p)
    return solve_equilibrium(problem, x)


def solve_equilibrium(problem: EquilibriumProblem, x: NDArray[np.float64]) -> Equilibrium:
    """Return the equilibrium near the state `x` at fixed parameters; see `find_equilibrium`."""
    sought = problem
    if sides_of(problem.system, problem.mode) is not None:
        sought = WithoutPole(problem.system, problem.mode, problem.p, problem.active, problem.scales)
    u, sizes, iteration = solve_zero(sought, x, "equilibrium", "there may be no equilibrium in this mode")
    if problem.circles.size:
        u, sizes, iteration = solve_zero(problem, -wrapped(-u, problem.circles), "equilibrium", "")
    u = problem.with_totals(u)  # a state that nothing changes may be far below the others, and no rounding of 0
    if not np.isfinite(problem.evaluate(u)[1]).all():
        where = ", ".join(f"{name} = {value:.6g}" for name, value in zip(problem.system.states, u, strict=False))
        told = f"it comes to {where}, where the field has no finite derivatives; start elsewhere"
        raise ConvergenceError("equilibrium", math.inf, iteration, told)
    found = Equilibrium.from_unknowns(problem, u, np.maximum(sizes, np.abs(u)))
    if not found.residual <= _RESIDUAL:
        raise ConvergenceError("equilibrium", found.residual, iteration, why_none(problem.evaluate(u)[1]))
    return found
