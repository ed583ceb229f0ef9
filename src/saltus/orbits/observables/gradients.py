"""Exact derivatives of an orbit's quantities by its unknowns and parameters, as Newton's method takes them.

An orbit is followed with its variations, by parameters or by unknowns alone. docs/theory/sensitivities.md derives the
formulas.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.observables.observed import Differentiated, Plan, Sums, planned
from saltus.orbits.observables.quantities import sizes_of_unknowns
from saltus.orbits.observables.refinement import Varied, divided, narrow
from saltus.orbits.records import Observed, Orbit, Seen
from saltus.scales import PARAMETER_MOVES, SLOPES_ALIKE
from saltus.system.enclosure import may_jump

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.observables.quantities import Quantity
    from saltus.orbits.problem import OrbitProblem

__all__ = ["followed", "gradient_of", "slope_along"]

NODES = 16  # fewest places in a step that is divided where expressions ask for it
FEWER = 4  # places fewer, at which integrals of derivatives are looked at again
FEW_NODES = 5  # fewest places in other steps
_NONE = -1  # of a variation that no parameter takes part in
_ROOM = 1 << 23  # numbers in the dense output of variations that are followed at once: 64 MB
_STEP = 2e-5  # change of an unknown, over its size, in differences of what has no derivative


def followed(
    problem: OrbitProblem,
    u: NDArray[np.float64],
    du: NDArray[np.float64],
    plan: Plan,
    chosen: Sequence[int],
    first: bool = False,
) -> Sums:
    """Follow an orbit with its variations, and return what is found of observables.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, meshes made.
    u : ndarray, shape (size + active,) or longer
        The orbit.
    du : ndarray, shape (size, columns)
        Changes of the unknowns.
    plan : Plan
        The observables.
    chosen : sequence of int
        Of each column the parameter that changes with the unknowns, -1 for none.
    first : bool, optional
        Whether of places that are equally high the first one is the extreme. By default its derivatives are NaN where
        they differ between these places.
    """
    with problem.explicit_steps(u):
        return _followed(problem, u, du, plan, chosen, first)


def _followed(
    problem: OrbitProblem,
    u: NDArray[np.float64],
    du: NDArray[np.float64],
    plan: Plan,
    chosen: Sequence[int],
    first: bool,
) -> Sums:
    from saltus.orbits.kernels import sensitivity as sensitivity_kernels, variation as variation_kernels

    n, columns, turns = problem.n, len(chosen), problem.signature.turns
    length, at = n * (1 + columns), np.arange(n, problem.size, n + 1)
    durations = np.column_stack([u[at], du[at]])
    total = durations.sum(axis=0)
    problem.set_parameters(u)
    record = tuple(Orbit(*problem.record)._replace(active=np.array(chosen, dtype=np.int64)))
    du = np.ascontiguousarray(du)
    dense = np.empty(problem.mesh[0].size * length), np.empty(7 * problem.mesh[0].size * length)
    variation_kernels.vary(record, problem.mesh, u, du, *dense)
    path = Varied(problem.mesh, dense[0].reshape(-1, length), dense[1].reshape(-1, 7, length))
    texts, ends, steps = narrow(problem, u, path, plan.expressions), path.nodes[path.mesh[1][1:] - 1], len(path.nodes)
    if texts:
        path = divided(problem, u, path, texts)

    def look(nodes: int) -> tuple[Observed, Seen]:
        advance = 3.0 * math.pi * max(turns, 1) * float(np.max(np.diff(path.mesh[0])))
        observed = plan.observed(problem.system, problem.parameters_at(u), problem.state_scale, advance, first, nodes)
        extremes, steps = len(plan.extremes), path.mesh[0].size - problem.segments
        samples = (steps * (observed.places.size // 2 + 1) + problem.segments) if extremes else 0
        seen = Seen(
            np.zeros((len(plan.integrals), 3, 1 + columns)),
            np.empty((extremes, samples)),
            np.empty((extremes, samples)),
            np.zeros((extremes, columns)),
            np.zeros(extremes),
            np.empty((extremes, 1 + columns)),
            np.zeros(extremes, dtype=np.int64),
            np.zeros(extremes, dtype=np.int64),
            np.zeros(len(plan.expressions), dtype=np.int64),
        )
        output = path.nodes.reshape(-1), path.coefficients.reshape(-1)
        sensitivity_kernels.observe(record, path.mesh, output, u, du, tuple(observed), tuple(seen))
        return observed, seen

    observed, seen = look(NODES if texts else FEW_NODES)
    unsettled = np.zeros(0, dtype=np.bool_)
    if len(path.nodes) > steps and plan.integrals and not first:
        again = look(NODES - FEWER)[1].sums
        apart = np.abs(again - seen.sums)[:, :2, 1:] <= SLOPES_ALIKE * seen.sums[:, 2:, 1:]
        unsettled = ~np.all(apart, axis=(1, 2))

    def rates(transition: int) -> Differentiated:
        found = [np.empty(1 + columns) for other in problem.signature.transitions if other == transition]
        own = (end for end, other in zip(ends, problem.signature.transitions, strict=True) if other == transition)
        for end, out in zip(own, found, strict=True):
            sensitivity_kernels.rate_at(record, transition, end, out)
        mean = np.add.reduce(found) / len(found) if found else np.full(1 + columns, math.nan)
        return Differentiated(float(mean[0]), mean[1:], "" if found else "the transition does not happen")

    bent = np.zeros(0, dtype=np.bool_)
    if observed.cornered and seen.bent.any():
        jumps = [bool(seen.bent[i]) and may_jump(problem.system, text) for i, text in enumerate(plan.expressions)]
        bent = np.array([*[False] * n, *jumps])[[what for what, _ in plan.integrals]]
    return Sums(
        problem.system, Differentiated(float(total[0]), total[1:]), durations, problem.signature.modes, turns or 1,
        seen.sums, seen.extremes, seen.kinds, seen.segments, bent, unsettled, rates, problem.slides,
    )  # fmt: skip


def gradient_of(quantity: Quantity, problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivatives of a quantity in the unknowns and active parameters, shape (size + active,).

    Of places that are equally high the first one is the extreme, as where the orbit starts and ends at its maximum. The
    start of an orbit that is not closed yet has a kink there. What has no derivative, as the mean of an expression with
    a corner, is differentiated by central differences on the meshes.

    Parameters
    ----------
    quantity : Quantity
        The quantity.
    problem : OrbitProblem
        The equations, meshes made.
    u : ndarray, shape (size + active,) or longer
        The orbit.
    """
    gradient = np.zeros(problem.size + len(problem.active))
    if quantity.kind == "period":
        gradient[problem.n : problem.size : problem.n + 1] = 1.0
        return gradient
    plan = planned(problem.system, (quantity.name,))
    if len(plan.extremes) == 1 and not plan.integrals and not plan.composed:
        gradient = _of_an_extreme(plan, problem, u)
    else:
        gradient = _of_all_segments(plan, problem, u)
    finite = np.all(np.isfinite(gradient))
    return gradient if finite or not np.all(np.isfinite(u)) else _differences(quantity, problem, u)


def _of_an_extreme(plan: Plan, problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the gradient of an extreme: it depends on the unknowns of the segment in which it is."""
    size, block, active = problem.size, problem.n + 1, len(problem.active)
    du = np.hstack([np.tile(np.eye(block), (problem.segments, 1)), np.zeros((size, active))])
    chosen = (*[_NONE] * block, *problem.active)
    found = followed(problem, u, du, plan, chosen, first=True)
    slopes = next(iter(plan.values(found, problem.parameters_at(u), chosen).values())).slopes
    gradient, at = np.zeros(size + active), int(found.segments[0]) * block
    gradient[at : at + block] = slopes[:block]
    gradient[size:] = slopes[block:] * problem.scales
    return gradient


def _of_all_segments(plan: Plan, problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the gradient of an observable of the whole orbit, some unknowns at a time."""
    size, count, p = problem.size, problem.size + len(problem.active), problem.parameters_at(u)
    du = np.eye(size, count)
    chosen = np.append(np.full(size, _NONE), problem.active).astype(np.int64)
    each = max(1, _ROOM // (7 * problem.n * problem.mesh[0].size))
    parts = []
    for begin in range(0, count, each):
        own = chosen[begin : begin + each].tolist()
        found = followed(problem, u, du[:, begin : begin + each], plan, own, first=True)
        parts.append(next(iter(plan.values(found, p, own).values())).slopes)
    gradient = np.concatenate(parts)
    gradient[size:] *= problem.scales
    return gradient


def _differences(quantity: Quantity, problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the gradient of a quantity by central differences; the flow stays on its meshes."""
    steps = _STEP * np.append(sizes_of_unknowns(problem, u), np.ones(len(problem.active)))
    gradient = np.empty(steps.size)
    for i, step in enumerate(steps.tolist()):
        ends = []
        for side in (step, -step):
            moved = u.copy()
            moved[i] += side
            ends.append(quantity.value(problem, moved))
        gradient[i] = quantity.beyond(ends[0], ends[1]) / (2.0 * step)
    problem.set_parameters(u)
    return gradient


def slope_along(problem: OrbitProblem, u: NDArray[np.float64], tangent: NDArray[np.float64], name: str) -> float:
    """Return the derivative of an observable in the direction of a branch; NaN where it has none.

    Where the parameter moves along the branch, the variation is that of the branch by the parameter. Where it rests, as
    at a fold, it is that of the unknowns alone.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, meshes made.
    u : ndarray, shape (size + active,) or longer
        The orbit.
    tangent : ndarray, shape of `u`
        The direction.
    name : str
        The observable, as `PeriodicOrbit.sensitivity` takes it.
    """
    chosen, unit = _NONE, 1.0
    if len(problem.active) and abs(tangent[problem.size]) > PARAMETER_MOVES:
        chosen, unit = int(problem.active[0]), float(problem.scales[0] * tangent[problem.size])
    plan = planned(problem.system, (name,))
    found = followed(problem, u, tangent[: problem.size, None] / unit, plan, (chosen,))
    return float(plan.values(found, problem.parameters_at(u), (chosen,))[name].slopes[0] * unit)
