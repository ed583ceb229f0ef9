"""Errors of multipliers by how they were computed: on a mesh that was kept, at the last Newton step but one."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.signature import EVENT_END, MEAN_END
from saltus.orbits.stability.floquet import multiplier_errors, multipliers
from saltus.scales import MATRIX_ERROR, NEWTON_ACCEPTED, RESTING, varied
from saltus.verification.motion import event_map
from saltus.verification.reference import Reference
from saltus.verification.spectra import growth_on_the_way, paired

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["own_errors"]

_STEPS = 64  # of a segment at most, of one matrix each: neighbouring steps of its mesh are one
_MOVED = 1e-6  # change of an unknown, over its size, by which the slope of multipliers is taken


def own_errors(problem: OrbitProblem, u: NDArray[np.float64], values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return by how much each of an orbit's multipliers may be off along a branch, shape (multipliers,).

    Each errs by its condition and by the error of a step of the sensitivities, which grows up to the period's end. It
    also errs by its slope and the last Newton step: the Jacobian is that of the unknowns before.

    Parameters
    ----------
    values : ndarray of complex, shape (multipliers,)
        The multipliers.
    """
    J = problem.resolve(u)[1]
    survey = problem.survey(u)
    sizes = np.maximum(np.abs(survey.lows), np.abs(survey.highs))[: problem.n]
    sizes = np.where(sizes > RESTING * problem.state_scale, sizes, problem.state_scale)
    top = float(np.abs(values).max(initial=1.0))
    grown = max(_growth(problem, u, sizes) / top, 1.0)
    own = multipliers(problem, u, J)
    condition = multiplier_errors(problem, u, J, own) / (MATRIX_ERROR * problem.tol)
    errors = varied(problem.tol) * grown * np.maximum(condition, np.abs(own))
    units = np.tile(np.append(problem.state_scale, u[problem.n : problem.size : problem.n + 1].sum()), problem.segments)
    for i in range(problem.size):
        moved = u.copy()
        moved[i] += _MOVED * units[i]
        other = multipliers(problem, moved, problem.evaluate(moved)[1])
        errors += NEWTON_ACCEPTED / _MOVED * np.abs(other - own)[: errors.size]
    problem.resolve(u)
    return np.asarray(errors[paired(values, own)])


def _growth(problem: OrbitProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]) -> float:
    """Return by how much an error of the linearised flow grows up to the period's end, over the states' sizes.

    The orbit has been surveyed last. Each step has the exponential of the Jacobian in its middle: what is asked for is
    an order of magnitude.
    """
    from scipy.linalg import expm

    reference = Reference(problem.system, problem.named_at(u))
    places, starts, nodes, _ = problem.dense()
    form, durations = problem.signature, u[problem.n : problem.size : problem.n + 1]
    steps: list[NDArray[np.float64]] = []
    for i, (first, last) in enumerate(itertools.pairwise(starts.tolist())):
        mode, s = form.modes[i], places[first:last]
        times = durations[i] * s**2 * (3.0 - 2.0 * s)
        for chosen in np.array_split(np.arange(s.size - 1), min(_STEPS, s.size - 1)):
            left, right = int(chosen[0]), int(chosen[-1]) + 1
            slope = reference.field_slope(mode, nodes[first + (left + right) // 2])
            if not np.all(np.isfinite(slope)):
                return float("inf")
            steps.append(expm(slope * (times[right] - times[left])))
        if form.kinds[i] in (EVENT_END, MEAN_END):
            steps.append(event_map(reference, mode, form.transitions[i], problem.state_on(i, 1.0)))
    return growth_on_the_way(steps, sizes)
