"""An optimum looked at again: orbits on both sides along each parameter, whose differences test all derivatives.

References
----------
Nocedal and Wright, Numerical Optimization, Springer 2006, ch. 12.5 (second-order conditions).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.optimisation.sequential import ACTIVE, HELD, Box, Local, optimality

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.optimisation.task import Task

__all__ = ["Verified", "verified"]

_STEPS = (1e-4, 1e-5, 1e-6, 1e-7, 1e-8)  # changes of a parameter, in its unit, in differences: the first that agrees
_AGREES = 1e-6  # difference between derivatives, over the largest, up to which a change agrees
_WRONG = 1e-4  # difference between exact and approximate derivatives, over the largest, that is none of rounding
_FALLS = -1e-5  # curvature, in units, below which the place is no optimum


class Verified(NamedTuple):
    """What the orbits around an optimum say."""

    # largest difference between exact derivatives and those by differences, over the largest; NaN where none is known
    mismatch: float
    # least curvature of the Lagrange function along the active constraints, in units; infinite where these leave no
    # direction, NaN where it is not known
    curvature: float
    notes: tuple[str, ...]  # what is wrong, in words


def verified(task: Task, best: Local, box: Box) -> Verified:
    """Return what the orbits around an optimum say.

    Parameters
    ----------
    task : Task
        What is sought.
    best : Local
        The optimum.
    box : Box
        Bounds of the parameters, in their units.
    """
    multipliers = optimality(best, box)[1]
    own = multipliers[: len(best.values)]
    active = np.append(True, best.values <= ACTIVE)
    exact = np.vstack([best.gradient, best.jacobian])
    largest = max(1.0, float(np.abs(exact[active]).max()))
    gaps, curved, notes = [], [], []
    for i, name in enumerate(task.names):
        mismatch, slopes = np.nan, np.full(len(task.names), np.nan)
        why = ""
        for step in _STEPS:
            ends = _ends(task, best, i, step)
            if isinstance(ends, str):
                why = why or ends
                continue
            above, below = ends
            width = float(above.place[i] - below.place[i])
            row = np.append(above.objective - below.objective, above.values - below.values) / width
            gap = float(np.abs(row - exact[:, i])[active].max())
            if not gap >= mismatch:
                mismatch = gap
                slopes = (above.gradient - below.gradient - (above.jacobian - below.jacobian).T @ own) / width
            if mismatch <= _AGREES * largest:
                break
        if np.isnan(mismatch):
            notes.append(f"derivatives by {name} are not tested: {why}")
        gaps.append(mismatch)
        curved.append(slopes)
    known = np.array(gaps)[np.isfinite(gaps)]
    mismatch = float(known.max()) / largest if known.size else np.nan
    if mismatch > _WRONG:
        notes.append(f"exact derivatives and differences disagree by {mismatch:.2g} of the largest")
    curvature = _least_curvature(np.array(curved), box.rows(best)[1][multipliers > HELD])
    if curvature < _FALLS:
        notes.append("no optimum: the objective gets better in a direction in which all first derivatives vanish")
    return Verified(mismatch, curvature, tuple(notes))


def _ends(task: Task, best: Local, index: int, step: float) -> tuple[Local, Local] | str:
    """Return what is known a step along one parameter further and a step back, or why it is not."""
    above, below = (task.local_beyond(best, index, side * step) for side in (1.0, -1.0))
    if isinstance(above, str):
        return above
    return below if isinstance(below, str) else (above, below)


def _least_curvature(hessian: NDArray[np.float64], rows: NDArray[np.float64]) -> float:
    """Return the least curvature in the directions that constraints leave free."""
    if not np.all(np.isfinite(hessian)):
        return np.nan
    _, sizes, right = np.linalg.svd(rows) if len(rows) else (None, np.zeros(0), np.eye(len(hessian)))
    free = right[int(np.sum(sizes > 1e-9 * sizes.max(initial=0.0))) :]
    if not len(free):
        return np.inf
    return float(np.linalg.eigvalsh(free @ (0.5 * (hessian + hessian.T)) @ free.T)[0])
