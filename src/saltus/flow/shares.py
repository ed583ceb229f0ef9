"""The states' shares of an absolute tolerance: none for those whose smallest sizes decide what they become.

A state on an invariant face never crosses 0, and may grow again from whatever it is near it. Its steps are measured by
its own size. docs/theory/flow.md, "States that never cross zero", explains it.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.system.compiled import SHARES
from saltus.system.faces import EXPONENTIAL, FACE, PLAIN, SUPPLIED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.compiled import Compiled

__all__ = ["limit_of", "shares_of", "small_groups", "with_shares"]

_SMALL = 1e-2  # size, or supply in a unit of time, below which a state needs a finer absolute tolerance, as in `sizes`
_BEYOND = 1e6  # size of a state over the problem's largest one at which it has diverged
_LARGEST = 1e150  # size whose square a double holds


def shares_of(compiled: Compiled, p: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return each state's share of an absolute tolerance, shape (all states,).

    It is 0 for a state whose rate has it as a factor, unless it only decays by itself. It is small for one that a small
    constant supplies.

    Parameters
    ----------
    compiled : Compiled
        The generated functions.
    p : ndarray
        Parameters, extended or not.
    """
    if compiled.plain:
        return compiled.whole.copy()
    kinds, own = compiled.kinds, set(compiled.kinds.tolist())
    shares = np.where(kinds == FACE, 0.0, compiled.whole)
    for kind, value in ((SUPPLIED, 0.0), (EXPONENTIAL, 1.0)):
        if kind not in own:
            continue
        states = kinds == kind
        x, extended = np.where(kinds == PLAIN, 1.0, value), compiled.extended(p[: compiled.n_parameters])
        rates, slope = np.full(compiled.n, -np.inf), np.empty(compiled.n)
        for mode in range(len(compiled.jumps)):
            compiled.call("field", mode, 0, x, extended, slope)
            rates = np.fmax(rates, np.abs(slope) if kind == SUPPLIED else slope)
        if kind == SUPPLIED:
            shares[states & (rates < _SMALL)] = rates[states & (rates < _SMALL)]
        else:
            shares[states & (rates > 0.0)] = 0.0
    return shares


def small_groups(compiled: Compiled, sizes: NDArray[np.float64], shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return shares in which states that stay at 0 together have one below 0, if all of them are small.

    Their steps are measured by the size that they have together: they may grow from whatever they are.

    Parameters
    ----------
    compiled : Compiled
        The generated functions.
    sizes : ndarray, shape (all states,)
        Largest sizes of the states so far.
    shares : ndarray, shape (all states,)
        Those of `shares_of`.
    """
    found = shares.copy()
    if not compiled.grouped:
        return found
    free = (compiled.groups >= 0) & (compiled.kinds == PLAIN)
    for group in set(compiled.groups[free].tolist()):
        members = free & (compiled.groups == group)
        if 0.0 < sizes[members].max() < _SMALL:
            found[members] = -1.0 - group
    return found


def limit_of(compiled: Compiled, p: NDArray[np.float64], x: NDArray[np.float64], usual: float | None = None) -> float:
    """Return the size of a state at which a motion diverges: far beyond all sizes that the problem has.

    A rest may be as large as the largest number of the formulas and parameters over the least, or as the start.

    Parameters
    ----------
    compiled : Compiled
        The generated functions.
    p : ndarray
        Parameters, extended or not.
    x : ndarray, shape (all states,)
        Start, or sizes of the states.
    usual : float, optional
        The least limit; 1e12 by default. Motions that start in a region have one of the region's.
    """
    from saltus.flow.kernels.state import BOUND

    largest = max(compiled.spread(p), float(np.abs(x).max(initial=0.0)))
    return float(max(BOUND if usual is None else usual, min(_BEYOND * largest, _LARGEST)))


def with_shares(addresses: NDArray[np.int64], shares: NDArray[np.float64]) -> NDArray[np.int64]:
    """Return the addresses of generated functions with that of some shares, which must live as long."""
    found = addresses.copy()
    found[SHARES] = shares.ctypes.data
    return found
