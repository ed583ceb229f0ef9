"""When a stiff flow goes on by implicit steps: whether it may, and whether they are worth their time."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.invariant_planes import staying

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.compiled import Compiled

__all__ = ["fastest_in_words", "may_be_implicit", "worth"]

_DEARER = 10.0  # time of an implicit step with two states, over that of an explicit one with sensitivities


def worth(n: int) -> float:
    """Return how many explicit steps with sensitivities take the time of an implicit one, with n components."""
    return _DEARER * max(1.0, n / 2.0) ** 2


def may_be_implicit(compiled: Compiled, mode: int, x: NDArray[np.float64], p: NDArray[np.float64], states: int) -> bool:
    """Return whether implicit steps may follow a mode's flow near a state.

    They damp a state that decays to nothing by too little, and it may grow again from what is left: no state may be one
    whose zeros are an invariant plane, as of a population. Nor may the field have roots that vanish on a surface.

    Parameters
    ----------
    compiled : Compiled
        The generated functions.
    mode : int
        Index of the mode.
    x : ndarray, shape (n,)
        Full state.
    p : ndarray
        Extended parameters.
    states : int
        Components without the phase.
    """
    if compiled.rooted[mode]:
        return False
    own, each = np.diag(compiled.linearised(mode, x, p)[1]), np.eye(x.size, dtype=np.bool_)
    kept = [i for i in np.flatnonzero(own[:states]) if staying(compiled, mode, x, p, each[i], states).any()]
    if not kept:
        return True
    # a rate may vanish at one state by chance, as where another state is 0
    top = float(np.abs(x[:states]).max(initial=0.0)) or 1.0
    other = np.where(x == 0.0, top, x) * (1.0 + 0.5 * np.sin(1.0 + np.arange(x.size)))
    return not any(staying(compiled, mode, other, p, each[i], states).any() for i in kept)


def fastest_in_words(compiled: Compiled, mode: int, x: NDArray[np.float64], p: NDArray[np.float64], states: int) -> str:
    """Return the fastest rate at a state in words, and why implicit steps may not follow it; empty where none is known.

    The arguments are those of `may_be_implicit`.
    """
    J = compiled.linearised(mode, x, p)[1]
    if not np.all(np.isfinite(J)):
        return ""
    values = np.linalg.eigvals(J)
    fastest = values[np.argmax(np.abs(values))]
    told = f"the fastest rate there is {abs(fastest):.3g}"
    if fastest.real < -abs(fastest.imag) and not may_be_implicit(compiled, mode, x, p, states):
        told += ", a decay that implicit steps may not follow: a root vanishes on a surface, or a state stays at 0"
    return told
