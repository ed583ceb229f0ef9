"""States that stay at zero once they are there, as populations: their zeros are an invariant plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.compiled import Compiled

__all__ = ["staying"]

_PHASES = 16  # phases at which a rate is asked for: a drive may rest at one of them


def staying(
    compiled: Compiled,
    mode: int,
    x: NDArray[np.float64],
    p: NDArray[np.float64],
    zeros: NDArray[np.bool_],
    states: int,
) -> NDArray[np.bool_]:
    """Return which of some states have no rate where all of these are zero, at any phase.

    Parameters
    ----------
    compiled : Compiled
        The generated functions.
    mode : int
        Index of the mode.
    x : ndarray, shape (n,)
        Full state, of which the others are taken.
    p : ndarray
        Extended parameters.
    zeros : ndarray of bool, shape (n,)
        These states.
    states : int
        Components without the phase.
    """
    slope, on_plane, stay = np.empty(x.size), np.where(zeros, 0.0, x), zeros.copy()
    turns = [] if x.size == states else np.linspace(0.0, 2.0 * np.pi, _PHASES, endpoint=False).tolist()
    for phase in [*x[states:].tolist(), *turns] or [0.0]:
        on_plane[states:] = phase
        compiled.call("field", mode, 0, on_plane, p, slope)
        stay &= slope == 0.0
    return stay
