"""Exact derivatives of an orbit and of its observables by parameters.

By the implicit function theorem the derivatives of the unknowns solve one linear system, for all parameters at once.
Variations along the orbit follow, and with them those of integrals and extremes. docs/theory/sensitivities.md derives
the formulas.

References
----------
Dickinson and Gelinas, J. Comput. Phys. 21 (1976) 123-143 (variational equations); Rozenvasser, Autom. Remote Control 28
(1967) 400-404 (jumps); Wilkins, Tidor, White and Barton, SIAM J. Sci. Comput. 31 (2009) 2706-2732 (periods and phases);
Milgrom and Segal, Econometrica 70 (2002) 583-601 (envelope theorem).
Departs from them in the variable: at fixed clustered time of a segment events stay in place, and no jump is passed.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import ConvergenceError, InputError
from saltus.flow.formulas import check_rotating
from saltus.orbits.observables.gradients import followed
from saltus.orbits.observables.observed import Differentiated, planned
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.rounds import rotating_of
from saltus.orbits.stability.critical import scaling, touched
from saltus.orbits.stability.multiplier_slopes import MultiplierSlopes, multipliers_by_parameters
from saltus.scales import SINGULAR

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["Sensitivities", "sensitivities", "unknowns_by_parameters"]

MULTIPLIERS = "multipliers"  # what the multipliers are asked for by
SEGMENTS = "segments"  # what the segments' starts and durations are asked for by


@dataclass(frozen=True)
class Sensitivities:
    """Derivatives of an orbit by parameters."""

    parameters: tuple[str, ...]
    unknowns: NDArray[np.float64]  # shape (size, parameters): derivatives of each segment's state and duration
    values: Mapping[str, Differentiated]  # the observables
    multipliers: MultiplierSlopes | None = None  # the multipliers, where they are asked for
    segments: bool = False  # whether the segments' starts and durations are asked for

    def dataset(self, problem: OrbitProblem) -> xr.Dataset:
        """Return what was asked for as a Dataset."""
        plain = _template(tuple(self.values), self.parameters).copy(
            data={name: one.slopes for name, one in self.values.items()}
        )
        for name, one in self.values.items():
            plain.variables[name].attrs = {"value": one.value, "note": one.note} if one.note else {"value": one.value}
        variables: dict[str, Any] = {}
        if (found := self.multipliers) is not None:
            for part, values, slopes in (
                ("re", found.values.real, found.slopes.real), ("im", found.values.imag, found.slopes.imag)
            ):  # fmt: skip
                notes = {"note": found.note} if found.note else {}
                variables[f"multiplier_{part}"] = (("multiplier", "parameter"), slopes, {"value": values} | notes)
        states: tuple[str, ...] = ()
        if self.segments:
            states, shape = problem.system.all_states, (problem.segments, problem.n + 1, len(self.parameters))
            blocks = self.unknowns.reshape(shape)
            variables["segment_state"] = (("segment", "state", "parameter"), blocks[:, :-1])
            variables["segment_duration"] = (("segment", "parameter"), blocks[:, -1])
        return plain.assign(variables).assign_coords({"state": list(states)} if states else {}) if variables else plain


@lru_cache(maxsize=64)
def _template(names: tuple[str, ...], parameters: tuple[str, ...]) -> xr.Dataset:
    """Return a Dataset with nothing in it: making one costs three times as much as copying it."""
    from saltus.extras import xr

    nothing = np.full(len(parameters), math.nan)
    return xr.Dataset(dict.fromkeys(names, ("parameter", nothing)), {"parameter": list(parameters)})


def unknowns_by_parameters(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the derivatives of an orbit's unknowns by its active parameters, shape (size, active).

    Parameters
    ----------
    problem : OrbitProblem
        The equations, meshes made, parameters in units of 1.

    Raises
    ------
    InputError
        Parameters do not determine the orbit, as at a fold or in a family.
    ConvergenceError
        The equations cannot be followed.
    """
    if not np.all(np.isfinite(J)):
        raise ConvergenceError("the orbit's variations", math.inf, 0, "the field is singular on the orbit")
    columns, rows = scaling(problem, J, u)
    left, values, right = np.linalg.svd(rows[:, None] * J[:, : problem.size] * columns)
    if not values[-1] > SINGULAR * values[0]:
        found = f"with a multiplier 1: singular values {values[-1]:.2g} to {values[0]:.2g}"
        hint = "at a saddle-node, SpecialPoint.sensitivity tells how it moves; in a family nothing is determined"
        raise InputError("orbit", found, "one that its parameters determine", hint)
    forced = left.T @ (rows[:, None] * J[:, problem.size :])
    return np.asarray(-columns[:, None] * (right.T @ (forced / values[:, None])))


def sensitivities(problem: OrbitProblem, u: NDArray[np.float64], names: Sequence[str]) -> Sensitivities:
    """Return the derivatives of an orbit's observables by the active parameters.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, meshes made, parameters in units of 1.
    names : sequence of str
        Observables; ``"segments"``; ``"multipliers"``, for which the active parameters must be growing.

    Raises
    ------
    InputError
        A name is no observable. The orbit touches a surface, or its parameters do not determine it.
    """
    plan = planned(problem.system, tuple(name for name in names if name not in (MULTIPLIERS, SEGMENTS)))
    for formula in plan.formulas.values():
        check_rotating(problem.system, rotating_of(problem, u), formula.parts)
    if where := touched(problem, u, problem.begun):
        hint = "orbits on both sides of a grazing have other derivatives; SpecialPoint.sensitivity tells how a GR moves"
        raise InputError("orbit", where, "one that no small change brings to another sequence of events", hint)
    J = problem.resolve(u)[1]
    du = unknowns_by_parameters(problem, u, J)
    chosen = tuple(problem.active)
    values = plan.values(followed(problem, u, du, plan, chosen), problem.p, chosen)
    found = multipliers_by_parameters(problem, u, J, du) if MULTIPLIERS in names else None
    parameters = tuple(problem.system.parameter_names[i] for i in chosen)
    return Sensitivities(parameters, du, values, found, SEGMENTS in names)
