"""The inflection point test: whether small errors of the data can make large ones of the force.

J. E. Sader, B. D. Hughes, F. Huber, F. J. Giessibl, Nat. Nanotechnol. 13, 1088 (2018). At an inflection of the force at
the distance z from the nearest gap of the data, ``S = z**2/4 F'''/F'``. Where S is below -1, amplitudes from
``sqrt(-F'/F''')`` to ``z/2`` make the inversion ill-posed.
"""

from __future__ import annotations

import math
from itertools import pairwise
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from scipy.interpolate import UnivariateSpline

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

__all__ = ["Inflection", "inflections"]

_SAMPLES = 2000  # gaps at which the curvature is looked at
_ROUGHNESS = 1e-4  # least error of the force, over its greatest magnitude, with which it is smoothed
_SEEN = 3.0  # standard errors by which the force must bend on both sides of an inflection
_EDGE = 0.02  # share of the range at each end in which derivatives are not known


class Inflection(NamedTuple):
    """One inflection of a force."""

    D_nm: float  # gap
    S: float  # the number of the test; below -1 some amplitudes are ill-posed
    # The least and the greatest of these amplitudes, in nm; infinite and 0 where there is none.
    least_nm: float
    most_nm: float
    A_nm: float  # amplitude of the data there

    @property
    def ill_posed(self) -> bool:
        """Whether the amplitude of the data is among them."""
        return self.least_nm <= self.A_nm <= self.most_nm


def inflections(
    D: NDArray[np.float64],
    F: NDArray[np.float64],
    sigma: NDArray[np.float64],
    amplitude: Callable[[float], float],
) -> tuple[Inflection, ...]:
    """Return the inflections of a force at ascending gaps that are clear of its errors, with their test.

    Parameters
    ----------
    amplitude : callable
        The amplitude with which the data reach a least gap, in nm.
    """
    error = np.maximum(sigma, _ROUGHNESS * np.abs(F).max())
    smooth = UnivariateSpline(D, F, w=1.0 / error, k=5, s=len(D))
    edge = _EDGE * (D[-1] - D[0])
    gaps = np.linspace(D[0] + edge, D[-1] - edge, _SAMPLES)
    bend = smooth.derivative(2)(gaps)
    turns = np.flatnonzero(np.sign(bend[1:]) != np.sign(bend[:-1]))
    ends = np.concatenate([[0], turns + 1, [len(gaps)]])
    clear = []
    for begin, end in pairwise(ends.tolist()):
        sagitta = np.abs(bend[begin:end]).max() * (gaps[end - 1] - gaps[begin]) ** 2 / 8.0
        clear.append(sagitta > _SEEN * np.interp(gaps[(begin + end - 1) // 2], D, error))
    found = []
    for i, turn in enumerate(turns):
        if clear[i] and clear[i + 1]:
            gap = float(gaps[turn])
            slope, third = float(smooth.derivative(1)(gap)), float(smooth.derivative(3)(gap))
            found.append(_tested(gap, gap - float(D[0]), slope, third, amplitude(gap)))
    return tuple(found)


def _tested(gap: float, distance: float, slope: float, third: float, A: float) -> Inflection:
    S = 0.25 * distance**2 * third / slope if slope else math.copysign(math.inf, third)
    if S >= -1.0:
        return Inflection(gap, S, math.inf, 0.0, A)
    return Inflection(gap, S, math.sqrt(-slope / third) if slope else 0.0, 0.5 * distance, A)
