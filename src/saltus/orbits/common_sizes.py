"""Sizes that states share where they meet the surfaces of events together.

The modes of a beam move its tip together. A fast mode whose share is small turns many times where the others hardly
change. Steps along a branch, and the growth of sensitivities, are measured by what states do to the tip.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import AFFINE, ILL_CONDITIONED, RESIDUAL_ROUNDING

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["common_sizes", "left_by_rounding", "newton_step", "surface_rows"]

_MOST = 1e3  # largest common size of a state, over its own
_ELSEWHERE = (0.3, -0.7)  # how far from a state gradients are looked at, in the states' sizes


def surface_rows(
    system: HybridSystem, modes: NDArray[np.int64], blocks: NDArray[np.float64], p: NDArray[np.float64],
    sizes: NDArray[np.float64],
) -> NDArray[np.float64]:  # fmt: skip
    """Return gradients of event functions that are affine in the states, then of such Lie derivatives of them.

    Parameters
    ----------
    system : HybridSystem
        The system.
    modes : ndarray of int64, shape (segments,)
        Where the segments run.
    blocks : ndarray, shape (segments, n + 1)
        State at each one's start, and its duration.
    p : ndarray
        Extended parameters.
    sizes : ndarray, shape (n,)
        Sizes of the states.

    Returns
    -------
    ndarray, shape (2, rows, states)
        Rows of zeros where a function is not affine; no rows where no function has several states.
    """
    n, count = blocks.shape[1] - 1, len(system.states)
    known = {system.mode_names[mode]: block[:n] for mode, block in zip(modes.tolist(), blocks, strict=True)}
    met = [k for k, transition in enumerate(system.transitions) if transition.source in known]

    def gradients(share: float) -> NDArray[np.float64]:
        """Return all gradients beside the segments' starts, by that share of the sizes, shape (2, rows, states)."""
        written = np.empty((len(met), 2 + 2 * n))
        for k, out in zip(met, written, strict=True):
            x = known[system.transitions[k].source].copy()
            x[:count] += share * sizes[:count]
            system.compiled.call("event_x", k, 0, x, p, out)
        return written[:, 2:].reshape(-1, 2, n)[:, :, :count].swapaxes(0, 1)

    found = gradients(0.0)
    if not np.any(np.count_nonzero(found, axis=2) > 1):
        return found[:, :0]
    rounding = AFFINE * np.abs(found).max(axis=2, initial=0.0, keepdims=True)
    affine = [np.abs(gradients(share) - found) <= rounding for share in _ELSEWHERE]
    found = np.where(np.all(affine, axis=(0, 3))[:, :, None], found, 0.0)
    together = bool(np.any(np.count_nonzero(found, axis=2) > 1))
    return found if together else found[:, :0]


def common_sizes(rows: NDArray[np.float64], sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sizes at which states change event functions as much as the largest of them does.

    A state that no event function has is measured by the rates of these functions. None is smaller than its own size,
    or larger than 1000 times that.

    Parameters
    ----------
    rows : ndarray, shape (2, rows, states)
        Gradients of event functions and of their rates.
    sizes : ndarray, shape (n,)
        Sizes of the states, and that of the phase.

    Examples
    --------
    The second mode of a tip, with displacements and velocities:

    >>> tip = np.array([[[1.0, 1.0, 0.0, 0.0]], [[0.0, 0.0, 1.0, 1.0]]])
    >>> common_sizes(tip, np.array([1.0, 0.01, 0.8, 0.4])).tolist()
    [1.0, 1.0, 0.8, 0.8]
    """
    common, count = sizes.copy(), rows.shape[2]
    if not rows.size:
        return common
    free = np.ones(count, dtype=bool)  # states that no function so far has
    for gradients in np.abs(rows):
        shares = gradients * sizes[:count]
        tops = shares.max(axis=1, initial=0.0)[:, None]
        entering = shares > 0.0
        reach = np.divide(tops, gradients, out=np.full_like(shares, np.inf), where=entering)
        least = np.minimum(reach.min(axis=0, initial=np.inf), _MOST * sizes[:count])
        found = free & entering.any(axis=0)
        common[:count][found] = np.maximum(sizes[:count], least)[found]
        free &= ~entering.any(axis=0)
    return common


def newton_step(J: NDArray[np.float64], F: NDArray[np.float64], scale: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the solution of J step = F, by elimination in the unknowns' sizes where their units are far apart.

    There the pivots that are largest are not those that keep the digits.

    Raises
    ------
    LinAlgError
        The matrix is singular.
    """
    if not float(scale.min()) < ILL_CONDITIONED * float(scale.max()):
        return np.asarray(np.linalg.solve(J, F), dtype=float)
    shares = scale / scale.max()
    rows = np.maximum(np.abs(J * shares).max(axis=1), 1e-300)
    return np.asarray(shares * np.linalg.solve(J * shares / rows[:, None], F / rows), dtype=float)


def left_by_rounding(F: NDArray[np.float64], J: NDArray[np.float64], scale: NDArray[np.float64]) -> bool:
    """Return whether units are far apart, and what is left of each equation is rounding of what the unknowns are in it.

    The rounding of an equation in a large unit hides whether what is left of one in a small unit falls.
    """
    if not float(scale.min()) < ILL_CONDITIONED * float(scale.max()):
        return False
    with np.errstate(over="ignore", invalid="ignore"):
        rows = np.abs(J[: F.size] * scale).max(axis=1)
    return bool(np.all(np.isfinite(rows)) and np.all(np.abs(F) <= RESIDUAL_ROUNDING * rows))
