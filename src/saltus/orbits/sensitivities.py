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
from saltus.orbits.critical import scaling, touched
from saltus.orbits.multiplier_slopes import MultiplierSlopes, multipliers_by_parameters
from saltus.orbits.observed import Differentiated, Plan, Sums, planned
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.quantities import gradient_of, read_quantity
from saltus.orbits.records import Seen
from saltus.orbits.winding import rotating_of

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["Sensitivities", "sensitivities", "slope_along", "unknowns_by_parameters"]

MULTIPLIERS = "multipliers"  # what the multipliers are asked for by
SEGMENTS = "segments"  # what the segments' starts and durations are asked for by
_MOVES = 1e-5  # change of a parameter, in its unit, per unit of arclength, from which on it moves along a branch
_LARGE = 1e8  # multiple of a tangent beside which a change of the parameter by its unit is small
_SINGULAR = 1e-9  # least singular value of the equations, over the largest, at which parameters determine no orbit


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
    import xarray as xr

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
    if not values[-1] > _SINGULAR * values[0]:
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
    values = plan.values(_followed(problem, u, du, plan), problem.p, chosen)
    found = multipliers_by_parameters(problem, u, J, du) if MULTIPLIERS in names else None
    parameters = tuple(problem.system.parameter_names[i] for i in chosen)
    return Sensitivities(parameters, du, values, found, SEGMENTS in names)


def slope_along(problem: OrbitProblem, u: NDArray[np.float64], tangent: NDArray[np.float64], name: str) -> float:
    """Return the derivative of an observable in the direction of a branch; NaN where it has none.

    What variations of the unknowns add to the derivative by a parameter is linear in them. Where the parameter moves
    along the branch, the variations are those of the branch by the parameter. Where it rests, as at a fold, two large
    opposite multiples of the tangent take the part of the parameter out.

    Parameters
    ----------
    u : ndarray, shape (size + active,) or longer
        The orbit.
    tangent : ndarray, shape of `u`
        The direction.
    name : str
        The observable, as `sensitivities` takes it.
    """
    p, size, index, unit, share = problem.parameters_at(u), problem.size, 0, 1.0, 0.0
    if not p.size:  # no parameter by which to differentiate: the quantity's differences by the unknowns
        return float(gradient_of(read_quantity(problem.system, name), problem, u)[:size] @ tangent[:size])
    if len(problem.active):
        index, unit, share = int(problem.active[0]), float(problem.scales[0]), float(tangent[size])
    multiples = np.array([1.0 / share if abs(share) > _MOVES else _LARGE])
    if abs(share) <= _MOVES:
        multiples = np.append(multiples, -_LARGE)
    count = len(multiples)
    own = OrbitProblem(problem.system, problem.signature, p, [index] * count, np.ones(count), problem.tol)
    here = np.append(u[:size], [p[index]] * count)
    if own.start(here) is not None:
        return math.nan
    plan = planned(problem.system, (name,))
    variations = np.outer(tangent[:size], multiples / unit)
    slopes = plan.values(_followed(own, here, variations, plan), p, own.active)[name].slopes * unit
    if count == 1:
        return float(slopes[0] * share)
    return float((slopes[0] - slopes[1]) / (2.0 * _LARGE) + 0.5 * share * (slopes[0] + slopes[1]))


def _followed(problem: OrbitProblem, u: NDArray[np.float64], du: NDArray[np.float64], plan: Plan) -> Sums:
    """Follow the orbit with its variations, and return what is found of the observables."""
    n, columns, turns = problem.n, len(problem.active), problem.signature.turns
    at = np.arange(n, problem.size, n + 1)
    durations = np.column_stack([u[at], du[at]])
    total = durations.sum(axis=0)
    advance = 3.0 * math.pi * max(turns, 1) * float(np.max(np.diff(problem.mesh[0])))
    from saltus.orbits.kernels import sensitivity as sensitivity_kernels, variation as variation_kernels

    observed = plan.observed(problem.system, problem.p, problem.state_scale, advance)
    dense = np.empty(problem.mesh[0].size * n * (1 + columns)), np.empty(7 * problem.mesh[0].size * n * (1 + columns))
    problem.set_parameters(u)
    du = np.ascontiguousarray(du)
    variation_kernels.vary(problem.record, problem.mesh, u, du, *dense)
    extremes = len(plan.extremes)
    samples = (problem.steps * (observed.places.size // 2 + 1) + problem.segments) if extremes else 0
    seen = Seen(
        np.zeros((len(plan.integrals), 3, 1 + columns)),
        np.empty((extremes, samples)),
        np.empty((extremes, samples)),
        np.zeros((extremes, columns)),
        np.zeros(extremes),
        np.empty((extremes, 1 + columns)),
        np.zeros(extremes, dtype=np.int64),
        np.zeros(len(plan.expressions), dtype=np.int64),
    )
    sensitivity_kernels.observe(problem.record, problem.mesh, dense, u, du, tuple(observed), tuple(seen))

    def rates(transition: int) -> Differentiated:
        ends = dense[0].reshape(-1, n * (1 + columns))[problem.mesh[1][1:] - 1]
        found = [np.empty(1 + columns) for other in problem.signature.transitions if other == transition]
        own = (end for end, other in zip(ends, problem.signature.transitions, strict=True) if other == transition)
        for end, out in zip(own, found, strict=True):
            sensitivity_kernels.rate_at(problem.record, transition, end, out)
        mean = np.add.reduce(found) / len(found) if found else np.full(1 + columns, math.nan)
        return Differentiated(float(mean[0]), mean[1:], "" if found else "the transition does not happen")

    bent = np.zeros(0, dtype=np.bool_)
    if observed.cornered and seen.bent.any():
        bent = np.append(np.zeros(n, dtype=np.bool_), seen.bent > 0)[[what for what, _ in plan.integrals]]
    return Sums(
        problem.system, Differentiated(float(total[0]), total[1:]), durations, problem.signature.modes, turns or 1,
        seen.sums, seen.extremes, seen.kinds, bent, rates, problem.slides,
    )  # fmt: skip
