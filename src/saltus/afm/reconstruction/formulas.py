"""Inversions of the average in print, as matrices from the reduced shift to the force.

The reduced shift is ``Omega = -<F z>/(k A**2)`` as a function of the least gap. In each formula it is linear between
places. `saltus.afm.reconstruction.inversion` needs no such formula.

J. E. Sader, S. P. Jarvis, Appl. Phys. Lett. 84, 1801 (2004), Eq. (9a)::

    F(D) = 2 k integral from D of (1 + sqrt(A)/(8 sqrt(pi (t - D)))) Omega - A**1.5/sqrt(2 (t - D)) dOmega/dt, dt

A. J. Katan, M. H. van Es, T. H. Oosterkamp, Nanotechnology 20, 165703 (2009): the same with the amplitude A(t).

H. Hoelscher, Appl. Phys. Lett. 89, 123109 (2006), for amplitudes above the range of the force::

    F(D) = -2 k d/dD integral from D of A**1.5 Omega/sqrt(2 (t - D)) dt

A. F. Payam, D. Martin-Jimenez, R. Garcia, Nanotechnology 26, 185706 (2015)::

    F(D) = 2 k integral from D of Omega dt - 2 k d/dD integral from D of A**1.5 Omega/sqrt(2 (t - D)) dt
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.afm.reconstruction.averages import Grid

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Matrix = NDArray[np.float64]

__all__ = ["FORMULAS", "force_matrix"]

FORMULAS = ("sader-jarvis", "katan", "hoelscher", "payam")


def force_matrix(formula: str, k: float, amplitude: Matrix, grid: Grid) -> Matrix:
    """Return the matrix from the reduced shift at knots to the force there, over a grid of the shift."""
    at = np.interp(grid.places, grid.knots, amplitude)
    s = np.maximum(grid.places - grid.knots[:, None], 0.0)
    roots, steps = np.diff(np.sqrt(s), axis=1), np.diff(grid.places)
    after = grid.places[:-1] >= grid.knots[:, None]
    area = _sums(np.where(after, 0.5 * steps, 0.0))
    if formula in ("sader-jarvis", "katan"):
        middle = 0.5 * (at[1:] + at[:-1])
        corrected = area + _halves(s, roots, steps) * np.sqrt(at) / (8.0 * math.sqrt(math.pi))
        matrix = corrected - _rises(math.sqrt(2.0) * roots / steps * middle**1.5)
    else:
        matrix = -_rises(math.sqrt(2.0) * roots / steps) * at**1.5
        if formula == "payam":
            matrix = matrix + area
    return np.asarray(2.0 * k * matrix @ grid.spread)


def _sums(weights: Matrix) -> Matrix:
    """Return the matrix of sums of weights times both ends of an interval."""
    return np.pad(weights, ((0, 0), (0, 1))) + np.pad(weights, ((0, 0), (1, 0)))


def _rises(weights: Matrix) -> Matrix:
    """Return the matrix of sums of weights times what is gained in an interval."""
    return np.pad(weights, ((0, 0), (1, 0))) - np.pad(weights, ((0, 0), (0, 1)))


def _halves(s: Matrix, roots: Matrix, steps: Matrix) -> Matrix:
    """Return the matrix of integrals over ``1/sqrt(t - D)``."""
    slopes = (2.0 / 3.0 * np.diff(s**1.5, axis=1) - 2.0 * s[:, :-1] * roots) / steps
    return np.pad(2.0 * roots, ((0, 0), (0, 1))) + _rises(slopes)
