"""The load of a viscous fluid on an oscillating thin blade, near a wall or far from one, by its integral equations.

The blade is a strip without thickness, long against its width, which moves along its normal. Lengths are in units of
half its width, and ``Re = rho omega b**2 / (4 eta)``. The linear equations of the flow have the Fourier transform
``exp(-i omega t)`` in time and ``exp(i k x)`` across the blade. A force on the fluid at the blade's height moves the
fluid there by the kernels of `_kernels`: the free fluid's, and what the wall reflects. The forces across the blade are
Chebyshev polynomials over ``sqrt(1 - x**2)``, whose transforms are Bessel functions. Galerkin's method gives a small
linear system, and the sum of the forces the hydrodynamic function.

References
----------
E. O. Tuck, J. Eng. Math. 3, 29 (1969): the blade far from walls. C. P. Green, J. E. Sader, J. Appl. Phys. 98, 114913
(2005): the blade near a wall. The expansion is Galerkin's in place of their quadrature.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.special import ive, jv, kve

__all__ = ["blade_load"]

Complex = NDArray[np.complex128]
Real = NDArray[np.float64]

_TERMS = (
    8  # polynomials of each component, at least; the load then has 6 digits at gaps above a fifth of the half-width
)
_TERMS_A_GAP = 0.4  # polynomials more for each half-width over the gap
_NODES = 12  # Gauss-Legendre nodes of a panel of wavenumbers
_PANEL = 2.0  # width of a panel, less than a turn of the product of two Bessel functions
_LEAST = 1e-6  # upper end of the first panel
_SMALL_PANELS = 25  # panels between `_LEAST` and `_PANEL`, in geometric progression
_REACH = 40.0  # largest wavenumber, over the largest of the flow's and the polynomials'


def blade_load(reynolds: float, gap: float | None = None) -> complex:
    """Return the hydrodynamic function of a thin blade.

    Parameters
    ----------
    reynolds : float
        ``rho omega b**2 / (4 eta)``.
    gap : float, optional
        Distance to a wall, in units of half the width; none means no wall.

    Examples
    --------
    >>> print(f"{blade_load(1.0):.5f}")  # Brumley, Willcox and Sader, Phys. Fluids 22, 052001 (2010): 3.73387, 4.07467
    3.73387+4.07467j
    >>> print(f"{blade_load(1.0, 1.0).imag / blade_load(1.0).imag:.3f}")  # a wall at half the width
    3.559
    """
    terms = _TERMS + (0 if gap is None else int(_TERMS_A_GAP / gap))
    even, odd = np.arange(0, 2 * terms, 2), np.arange(1, 2 * terms, 2)
    k, weights = _wavenumbers(_REACH * max(np.sqrt(reynolds), 2.0 * terms))
    size = max(1.0, np.sqrt(reynolds))
    bessel = jv(np.arange(2 * terms)[:, None], k)
    across, along = bessel[even], bessel[odd]
    normal, tangential, mixed = _kernels(k, reynolds, gap)
    smooth = k / (4.0 * (k * k + size * size))
    rows = _projected(weights * (normal - smooth), across, across) + _smooth_part(even, size)
    inner = _projected(weights * (tangential - smooth), along, along) + _smooth_part(odd, size)
    signs, turns = (1j) ** even, (1j) ** odd
    cross = signs[:, None] * _projected(weights * mixed, across, along) / turns[None, :]
    matrix = np.block(
        [
            [signs[:, None] * rows / signs[None, :], cross],
            [cross.T, turns[:, None] * inner / turns[None, :]],
        ]
    )
    unit = np.zeros(2 * terms, dtype=complex)
    unit[0] = 1.0
    return complex(1j * np.linalg.solve(matrix, unit)[0] / reynolds)


def _wavenumbers(largest: float) -> tuple[Real, Real]:
    """Return Gauss-Legendre nodes and weights of wavenumbers, in panels."""
    small = np.geomspace(_LEAST, _PANEL, _SMALL_PANELS)
    edges = np.concatenate([[0.0], small, np.arange(_PANEL, largest + _PANEL, _PANEL)[1:]])
    nodes, weights = np.polynomial.legendre.leggauss(_NODES)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (1.0 + nodes)).ravel(), (half * weights).ravel()


def _projected(kernel: Complex, left: Real, right: Real) -> Complex:
    return np.asarray((left * kernel) @ right.T)


def _smooth_part(orders: NDArray[np.int64], size: float) -> Real:
    """Return the integrals of ``J_n(k) J_m(k) k / (4 (k**2 + size**2))`` over k: I_n(size) K_m(size) / 4, n >= m."""
    high, low = np.maximum.outer(orders, orders), np.minimum.outer(orders, orders)
    return np.asarray((-1.0) ** ((high - low) // 2) * ive(high, size) * kve(low, size) / 4.0)


def _kernels(k: Real, reynolds: float, gap: float | None) -> tuple[Complex, Complex, Complex]:
    """Return velocities at the blade: normal by normal forces, tangential by tangential ones, normal by tangential.

    Velocities are over the force over the viscosity. Without a wall the first two are ``k / (2 m (m + k))`` and
    ``1 / (2 (m + k))``, with ``m = sqrt(k**2 - i Re)``, and the third vanishes. Differences of exponentials are taken
    by `numpy.expm1`, which keeps their digits where m is next to k.
    """
    m = np.sqrt(k * k - 1j * reynolds)
    normal, tangential = k / (2.0 * m * (m + k)), 1.0 / (2.0 * (m + k))
    if gap is None:
        return normal, tangential, np.zeros_like(normal)
    step = -1j * reynolds / (m + k)  # m - k
    outer = np.exp(-k * gap)
    excess = np.expm1(-step * gap)  # exp(-m gap) over exp(-k gap), less 1
    half = outer / (-2j * reynolds)
    by_normal = _reflected(k, m, step, outer, excess, k * step / m - k * k / m * excess, -(k * k) * excess)
    by_tangential = _reflected(k, m, step, outer, excess, -1j * k * excess, -1j * k * (step + m * excess))
    return (
        normal + half * by_normal[0],
        tangential - half * by_tangential[1] / (1j * k),
        half * by_tangential[0],
    )


def _reflected(
    k: Real, m: Complex, step: Complex, outer: Real, excess: Complex, speed: Complex, slope: Complex
) -> tuple[Complex, Complex]:
    """Return normal velocity and its slope, at the blade, of the flow that stops the fluid at the wall.

    The free flow has the given normal velocity and slope at the wall. The reflected one is
    ``A exp(-k y) + B exp(-m y)``, with ``A + B = -speed`` and ``k A + m B = slope``.
    """
    second = (slope + k * speed) / step
    first = -speed - second
    decayed = outer * (1.0 + excess)
    return first * outer + second * decayed, -k * first * outer - m * second * decayed
