"""States that stay at zero once they are there, as populations: their zeros are an invariant plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import EPS, ILL_CONDITIONED

if TYPE_CHECKING:
    from collections.abc import Iterable

    from numpy.typing import NDArray

    from saltus.system.compiled import Compiled

__all__ = ["driven", "staying"]

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


def driven(
    compiled: Compiled,
    modes: Iterable[int],
    transitions: Iterable[int],
    x: NDArray[np.float64],
    p: NDArray[np.float64],
    zeros: NDArray[np.bool_],
    states: int,
) -> NDArray[np.bool_]:
    """Return which of some states leave zero where all of these are zero: by a constant, a drive or a reset.

    What is rounding of a sum that vanishes changes from one double to the next by about as much as it is; it drives
    nothing. A drive changes by its own rounding.

    Parameters
    ----------
    compiled : Compiled
        The generated functions.
    modes, transitions : iterable of int
        Indices of those that the motion has.
    x : ndarray, shape (n,)
        Full state, of which the others are taken.
    p : ndarray
        Extended parameters.
    zeros : ndarray of bool, shape (n,)
        These states.
    states : int
        Components without the phase.
    """
    asked = [("field", mode) for mode in dict.fromkeys(modes)] + [("reset", k) for k in dict.fromkeys(transitions)]
    near, found, value = x.copy(), np.zeros(x.size, dtype=np.bool_), np.empty(x.size)
    for name, index in asked:
        values = np.empty((_PHASES, 2, x.size))
        for turn in range(_PHASES):
            for side in range(2):
                near[:] = np.where(zeros, 0.0, x * (1.0 + (2 * turn + side) * EPS))
                near[states:] = 2.0 * np.pi * (turn + 0.5) / _PHASES * (1.0 + side * EPS)
                compiled.call(name, index, 0, near, p, value)
                values[turn, side] = value
        sizes = np.abs(values).max(axis=(0, 1))
        found |= ILL_CONDITIONED * sizes > np.abs(values[:, 1] - values[:, 0]).max(axis=0)
    return found & zeros
