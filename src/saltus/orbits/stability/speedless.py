"""Multipliers of an orbit that meets an event more slowly than its own speed is known: they have no digits."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.signature import EVENT_END, MEAN_END
from saltus.scales import INFINITE, ROUGH, followed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["or_unknown"]


def or_unknown(
    problem: OrbitProblem, u: NDArray[np.float64], rates: NDArray[np.float64], values: NDArray[np.complex128]
) -> NDArray[np.complex128]:
    """Return an orbit's multipliers, NaN where an event is met more slowly than its own speed is known.

    The pencil is 0/0 there: the multipliers have limits on either side, and rounding in place of them. Where one of
    them is infinite it is told as such.

    Parameters
    ----------
    rates : ndarray, shape (segments,)
        Lie derivative of each segment's event at its end, as a survey has it.
    """
    met = [i for i, kind in enumerate(problem.signature.kinds) if kind in (EVENT_END, MEAN_END)]
    if problem.signature.is_cut or not met or any(abs(value) >= INFINITE for value in values.tolist()):
        return values
    period = float(np.abs(u[problem.n : problem.size : problem.n + 1]).sum())
    known = np.abs(rates[met]) * period * ROUGH > followed(problem.tol) * problem.event_sizes(u)[met]
    if np.all(known):
        return values
    unknown = np.full(values.size, complex(math.nan))
    if problem.system.phase is None:
        unknown[-1] = 1.0
    return unknown
