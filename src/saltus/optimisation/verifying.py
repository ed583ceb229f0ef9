"""An optimum looked at again: orbits on both sides along each parameter, whose differences test all derivatives.

References
----------
Nocedal and Wright, Numerical Optimization, Springer 2006, ch. 12.5 (second-order conditions).
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.optimisation.sequential import ACTIVE, Box, Local, optimality

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.optimisation.task import Task

__all__ = ["Verified", "verified"]

_STEP = 1e-4  # change of a parameter, in its unit, in differences
_WRONG = 1e-4  # difference between exact and approximate derivatives, over the largest, that is none of rounding
_FALLS = -1e-5  # curvature, in units, below which the place is no optimum
_HELD = 1e-9  # multiplier, in units, from which a constraint holds the place


class Verified(NamedTuple):
    """What the orbits around an optimum say.

    Attributes
    ----------
    mismatch : float
        Largest difference between exact derivatives and those by differences, in units; NaN where none is known.
    curvature : float
        Least curvature of the Lagrange function along the active constraints, in units; infinite where these leave no
        direction, NaN where it is not known.
    notes : tuple of str
        What is wrong, in words.
    """

    mismatch: float
    curvature: float
    notes: tuple[str, ...]


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
    rows, curved, notes = [], [], []
    own = multipliers[: len(best.values)]
    for i, name in enumerate(task.names):
        ends = [task.local_beyond(best, i, side * _STEP) for side in (1.0, -1.0)]
        refused = [end for end in ends if isinstance(end, str)]
        above, below = ends
        if isinstance(above, str) or isinstance(below, str):
            notes.append(f"derivatives by {name} are not tested: {refused[0]}")
            rows.append(np.full(1 + len(own), np.nan))
            curved.append(np.full(len(task.names), np.nan))
            continue
        width = float(above.place[i] - below.place[i])
        rows.append(np.append(above.objective - below.objective, above.values - below.values) / width)
        slopes = [end.gradient - end.jacobian.T @ own for end in (above, below)]
        curved.append((slopes[0] - slopes[1]) / width)
    active = np.append(True, best.values <= ACTIVE)
    exact = np.vstack([best.gradient, best.jacobian])
    gaps = np.abs(np.array(rows).T - exact)[active]
    known = gaps[np.isfinite(gaps)]
    mismatch = float(known.max()) if known.size else np.nan
    if mismatch > _WRONG * max(1.0, float(np.abs(exact[active]).max())):
        notes.append(f"exact derivatives and differences disagree by {mismatch:.2g}, in units")
    curvature = _least_curvature(np.array(curved), box.rows(best)[1][multipliers > _HELD])
    if curvature < _FALLS:
        notes.append("no optimum: the objective gets better in a direction in which all first derivatives vanish")
    return Verified(mismatch, curvature, tuple(notes))


def _least_curvature(hessian: NDArray[np.float64], rows: NDArray[np.float64]) -> float:
    """Return the least curvature in the directions that constraints leave free."""
    if not np.all(np.isfinite(hessian)):
        return np.nan
    _, sizes, right = np.linalg.svd(rows) if len(rows) else (None, np.zeros(0), np.eye(len(hessian)))
    free = right[int(np.sum(sizes > 1e-9 * sizes.max(initial=0.0))) :]
    if not len(free):
        return np.inf
    return float(np.linalg.eigvalsh(free @ (0.5 * (hessian + hessian.T)) @ free.T)[0])
