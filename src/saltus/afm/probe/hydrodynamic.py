"""Sader's hydrodynamic function: the load of a viscous fluid on a thin rectangular beam that oscillates in it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.probe.blade_flow import blade_load
from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["REYNOLDS", "WALL_GAPS", "WALL_REYNOLDS", "hydrodynamic_function"]

REYNOLDS = (1e-6, 1e4)  # where the correction of the circular cylinder is fitted
WALL_REYNOLDS = (1e-3, 1e4)  # where the equations of the blade near a wall are solved to four digits
WALL_GAPS = (0.02, 20.0)  # gaps over the beam's width where they are

# Coefficients of the correction's real and imaginary part, by powers of log10(Re): Sader 1998, Eqs. (21a) and (21b).
_REAL = (
    (0.91324, -0.48274, 0.46842, -0.12886, 0.044055, -0.0035117, 0.00069085),
    (1.0, -0.56964, 0.48690, -0.13444, 0.045155, -0.0035862, 0.00069085),
)
_IMAGINARY = (
    (-0.024134, -0.029256, 0.016294, -0.00010961, 0.000064577, -0.000044510),
    (1.0, -0.59702, 0.55182, -0.18357, 0.079156, -0.014369, 0.0028361),
)


def hydrodynamic_function(reynolds: ArrayLike, gap: float | None = None) -> NDArray[np.complex128]:
    r"""Return the hydrodynamic function of a thin rectangular beam, whose real part is inertia and imaginary part drag.

    The fluid's force per length on a beam of width b that oscillates as ``exp(-i omega t)`` with the amplitude W is
    ``pi/4 rho omega**2 b**2 Gamma W``. Far from walls it is that of a circular cylinder, by Bessel functions, times a
    rational correction. Near a wall the flow's integral equations are solved for a beam without thickness.

    Parameters
    ----------
    reynolds : array_like, any shape
        ``rho omega b**2 / (4 eta)``: from 1e-6 to 1e4, near a wall from 1e-3.
    gap : float, optional
        Distance of the beam's axis to a parallel wall, in widths: from 0.02 to 20.

    Returns
    -------
    ndarray, shape of `reynolds`, complex
        Its size differs from exact values of a thin blade by less than 0.01 %; near a wall to four digits.

    Raises
    ------
    InputError
        A value outside these ranges.

    References
    ----------
    J. E. Sader, J. Appl. Phys. 84, 64 (1998), Eqs. (18), (20), (21). Walls: C. P. Green, J. E. Sader, J. Appl. Phys.
    98, 114913 (2005); `saltus.afm.probe.blade_flow`.

    Examples
    --------
    >>> print(f"{hydrodynamic_function(1.0):.5f}")
    3.73396+4.07461j
    >>> print(f"{hydrodynamic_function(10.0, gap=0.5).imag / hydrodynamic_function(10.0).imag:.2f}")
    1.87
    """
    Re = checks.array("reynolds", reynolds)
    low, high = REYNOLDS if gap is None else WALL_REYNOLDS
    checks.refuse("reynolds", Re, (Re < low) | (Re > high), f"between {low:g} and {high:g}")
    if gap is None:
        return _far_from_walls(Re)
    wide = 2.0 * checks.number("gap", gap, unit="widths")
    if not WALL_GAPS[0] <= gap <= WALL_GAPS[1]:
        hint = "leave it out far from walls" if gap > WALL_GAPS[1] else ""
        raise InputError("gap", gap, f"between {WALL_GAPS[0]:g} and {WALL_GAPS[1]:g} widths of the beam", hint)
    return np.reshape([blade_load(float(one), wide) for one in Re.ravel()], Re.shape)


def _far_from_walls(Re: NDArray[np.float64]) -> NDArray[np.complex128]:
    from scipy.special import kve

    root = np.sqrt(1j * Re)
    cylinder = 1.0 + 4j * kve(1, -1j * root) / (root * kve(0, -1j * root))
    tau = np.log10(Re)
    real, imaginary = (
        np.polyval(over[::-1], tau) / np.polyval(under[::-1], tau) for over, under in (_REAL, _IMAGINARY)
    )
    return np.asarray((real + 1j * imaginary) * cylinder)
