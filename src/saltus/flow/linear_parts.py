"""Linear parts of fields, in whose frames Lawson's method takes steps: pairs of states that turn about each other."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.flow.exponential import speed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.compiled import Compiled

__all__ = ["LinearPart", "linear_part"]

_ONE = 1e-11  # what one function does not explain of the rest's slopes, over the field's largest
_LARGE = 0.5  # entry of the rest's slopes, over the largest, by which they may be told


class LinearPart(NamedTuple):
    """The linear part of a mode's field."""

    # shape (4 + 5 n,): count of the states without the phase; row and column of the entry of the Jacobian by which the
    # rest's slopes vary; rate at which the fastest states turn or decay; then of each component its partner, itself
    # where it has none, the entries of the linear part for itself and for the partner, and those of a column and a row
    # whose product, times the entry, are these slopes
    numbers: NDArray[np.float64]
    rate: float  # at which the fastest pair turns, in radians per unit of time


def linear_part(
    compiled: Compiled, mode: int, along: NDArray[np.float64], p: NDArray[np.float64], states: int
) -> LinearPart | None:
    """Return the linear part of a mode's field along a motion; None where the rest depends on more than one function.

    The rest's function changes along the motion, and with it the entries of the Jacobian. Where its slope is 0, they
    would be the linear part.

    Parameters
    ----------
    compiled : Compiled
        The generated functions.
    mode : int
        Index of the mode.
    along : ndarray, shape (samples, n)
        Full states of the motion.
    p : ndarray
        Extended parameters.
    states : int
        Components without the phase.
    """
    jacobians = np.array([compiled.linearised(mode, np.ascontiguousarray(x), p)[1][:states, :states] for x in along])
    if not np.all(np.isfinite(jacobians)):
        return None
    middle = np.median(jacobians, axis=0)
    turning = np.abs(middle * middle.T)
    np.fill_diagonal(turning, 0.0)
    partners, each = np.argmax(turning, axis=1), np.arange(states)
    paired = (turning[each, partners] > 0.0) & (partners[partners] == each)
    partners = np.where(paired, partners, each)
    own = np.zeros((states, states), dtype=np.bool_)
    own[each, each] = own[each, partners] = True
    found = _rest(jacobians, middle, own)
    if found is None:
        return None
    linear, place, push, look = found
    numbers = np.zeros((compiled.n, 5))
    numbers[:, 0] = np.arange(compiled.n)
    to = np.where(paired, linear[each, partners], 0.0)
    numbers[:states] = np.stack([partners, linear[each, each], to, push, look], axis=1)
    half = 0.5 * (linear[each, each] - linear[partners, partners])
    curls = np.where(paired, half * half + linear[each, partners] * linear[partners, each], 0.0)
    rate = float(np.sqrt(-curls.min(initial=0.0)))
    return LinearPart(np.append([states, *place, speed(numbers)], numbers.ravel()), rate)


def _rest(
    jacobians: NDArray[np.float64], middle: NDArray[np.float64], own: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], tuple[int, int], NDArray[np.float64], NDArray[np.float64]] | None:
    """Linear part, and the rest's slopes as a factor that varies, an entry, times a column and a row; None without one.

    Entries for components and partners vary in proportion to one of the others, which are 0 in the linear part.
    """
    others = np.where(own, 0.0, jacobians)
    sizes = np.abs(others).max(axis=0)
    # of the state that alone makes up the function's argument, the linear part is to leave little rounding
    weights = np.where(sizes >= _LARGE * sizes.max(), np.abs(np.where(own, middle, 0.0)).sum(axis=0), np.inf)
    row, column = np.unravel_index(np.argmin(weights), own.shape)
    factors = others[:, row, column]
    least, most = int(np.argmin(np.abs(factors))), int(np.argmax(np.abs(factors)))
    if factors[least] == factors[most]:
        return None
    share = factors[least] / (factors[most] - factors[least])
    linear = np.where(own, jacobians[least] - share * (jacobians[most] - jacobians[least]), 0.0)
    rest = jacobians[most] - linear
    push, look = rest[:, column] / factors[most], rest[row] / factors[most]
    left = jacobians - linear - factors[:, None, None] * np.outer(push, look)
    plain = np.all(np.abs(left).max(axis=(1, 2)) <= _ONE * np.abs(jacobians).max(axis=(1, 2)))
    return (linear, (int(row), int(column)), push, look) if plain else None
