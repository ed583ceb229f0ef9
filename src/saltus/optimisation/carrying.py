"""An orbit carried to other parameters along its smooth piece: same events, same sheet, or a reason why not.

A step is predicted by the exact derivatives of the unknowns, and corrected by Newton's method. An orbit of another
sheet may be found that way. So the change of the unknowns must agree with the derivatives at both ends of the step.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import ConvergenceError, InputError, StickingError
from saltus.orbits.observables.quantities import sizes_of_unknowns
from saltus.orbits.observables.sensitivities import unknowns_by_parameters
from saltus.orbits.orbit import PeriodicOrbit, orbit_at
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.solve import check_fields, solve_unknowns

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Carried", "carried", "carrying"]

_SHORTEST = 2.0**-6  # share of a way below which no step is tried
_AGREE = 0.3  # most by which a change and its derivatives may differ, over the change
_ROUNDING = 1e-8  # change of an unknown, over its size, that is too small to be judged


@dataclass(frozen=True)
class Carried:
    """An orbit, with the derivatives of its unknowns by some parameters."""

    orbit: PeriodicOrbit
    names: tuple[str, ...]  # the parameters
    values: NDArray[np.float64]  # shape (parameters,): their values
    problem: OrbitProblem  # the orbit's equations, these parameters active
    u: NDArray[np.float64]  # shape (size + parameters,): its unknowns
    slopes: NDArray[np.float64]  # shape (size, parameters): derivatives of the unknowns

    def onward(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the unknowns that the derivatives predict at other values."""
        return np.asarray(self.orbit.unknowns + self.slopes @ (values - self.values))


def carrying(orbit: PeriodicOrbit, names: Sequence[str]) -> Carried:
    """Return an orbit with the derivatives of its unknowns.

    Raises
    ------
    InputError
        Its parameters do not determine the orbit, as at a saddle-node.
    ConvergenceError
        The equations cannot be followed.
    """
    problem = orbit.problem(tuple(names))
    values = problem.p[list(problem.active)]
    u = np.append(orbit.unknowns, values)
    slopes = unknowns_by_parameters(problem, u, problem.resolve(u)[1])
    return Carried(orbit, tuple(names), values, problem, u, slopes)


def carried(known: Carried, values: NDArray[np.float64]) -> Carried | str:
    """Return the orbit at other values of the parameters, or in words why there is none on its smooth piece.

    Parameters
    ----------
    known : Carried
        The orbit.
    values : ndarray, shape (parameters,)
        The values.
    """
    step, left = 1.0, 1.0
    while left > 0.0:
        share = min(step, left)
        found = _stepped(known, known.values + share / left * (values - known.values))
        if isinstance(found, str):
            step = 0.5 * share
            if step < _SHORTEST:
                return found
            continue
        known, left = found, left - share
    return known


def _stepped(known: Carried, values: NDArray[np.float64]) -> Carried | str:
    """Return the orbit at the end of one step, or why there is none."""
    like, names = known.orbit, known.names
    try:
        p = like.system.parameter_vector({**like.parameters, **dict(zip(names, values.tolist(), strict=True))})
        problem = OrbitProblem(like.system, like.form, p, tol=like.tolerance)
        u, J = solve_unknowns(problem, known.onward(values))
        orbit = orbit_at(problem, u, J)
        check_fields(problem)
        if not orbit.admissible:
            return f"a grazing: beyond it {'; '.join(orbit.reasons)}"
        found = carrying(orbit, names)
    except (ConvergenceError, InputError, StickingError) as error:
        return str(error)
    if not _same_sheet(known, found):
        return "no orbit of the same sheet is found there, as beyond a saddle-node"
    return found


def _same_sheet(a: Carried, b: Carried) -> bool:
    """Return whether the change from one orbit to another is what the derivatives at both say."""
    sizes = sizes_of_unknowns(a.problem, a.u)
    change = (b.orbit.unknowns - a.orbit.unknowns) / sizes
    expected = 0.5 * (a.slopes + b.slopes) @ (b.values - a.values) / sizes
    return float(np.abs(change - expected).max()) <= _AGREE * float(np.abs(change).max()) + _ROUNDING
