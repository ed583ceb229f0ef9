"""The modes of a clamped-free beam: wavenumbers, shapes and their integrals.

The equation ``phi'''' = b**4 phi`` on ``0 <= x <= 1`` with ``phi = phi' = 0`` at the clamp and ``phi'' = phi''' = 0``
at the tip has the wavenumbers ``cos(b) cosh(b) = -1``. There ``sin(b) = s tanh(b)`` with ``s = 1, -1, 1, ...``, and the
factor sigma of the textbook shape ``cosh bx - cos bx - sigma (sinh bx - sin bx)`` becomes ``tanh(b/2)**s``. Then the
growing exponentials cancel by hand, and no mode is too high for double precision.

References
----------
R. D. Blevins, Formulas for Natural Frequency and Mode Shape (1979), Table 8-1, case 3: clamped-free.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus import checks

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["mode_shape", "mode_shape_integrals", "wavenumbers"]

_NEWTON_STEPS = 8  # Newton steps to a root; 5 reach rounding for the first mode, the hardest
_PI_HEAD = 3.140625  # leading bits of pi, whose products with short integers are exact
_PI_TAIL = 9.6765358979323846e-4  # pi less `_PI_HEAD`


def wavenumbers(n: int) -> NDArray[np.float64]:
    """Return the first `n` roots of ``cos(b) cosh(b) = -1``, to the rounding of their last digit.

    Returns
    -------
    ndarray, shape (n,), read-only
        Wavenumbers times the beam's length, ascending; natural frequencies are proportional to their squares.

    Raises
    ------
    InputError
        `n` is below 1.

    Notes
    -----
    With ``b = (i - 1/2) pi + d`` the equation is ``sin(d) = s / cosh(b)``. Newton's method finds the small d to its own
    rounding. ``cos(b) cosh(b) + 1`` would lose a digit for each digit of ``cosh(b)``.

    Examples
    --------
    >>> print(*(f"{b:.14f}" for b in wavenumbers(3)))
    1.87510406871196 4.69409113297417 7.85475743823761
    """
    middle = np.arange(1, checks.size("n", n) + 1, dtype=np.float64) - 0.5
    s = _signs(n)
    d = np.zeros(n)
    for _ in range(_NEWTON_STEPS):
        b = np.pi * middle + d
        sech = 2.0 * np.exp(-b) / (1.0 + np.exp(-2.0 * b))
        d -= (np.sin(d) - s * sech) / (np.cos(d) + s * sech * np.tanh(b))
    return _read_only(_PI_HEAD * middle + (_PI_TAIL * middle + d))


def mode_shape(i: int, x: ArrayLike) -> NDArray[np.float64]:
    """Return the `i`-th mode shape at `x`: 0 at the clamp, 1 at the tip.

    Parameters
    ----------
    i : int
        Which mode, from 1.
    x : array_like, any shape, in units of the beam's length
        Places along the beam, from 0 (clamp) to 1 (tip).

    Returns
    -------
    ndarray, shape of `x`

    Raises
    ------
    InputError
        `i` is below 1, or some `x` is outside 0 to 1.

    Examples
    --------
    >>> mode_shape(1, [0.0, 0.5, 1.0]).round(6).tolist()
    [0.0, 0.339523, 1.0]
    """
    i = checks.count("i", i)
    x = checks.array("x", x)
    checks.refuse("x", x, (x < 0.0) | (x > 1.0), "from 0 (clamp) to 1 (tip), in units of the beam's length")
    b, s = wavenumbers(i)[-1], _signs(i)[-1]
    exponentials = (np.exp(-b * x) + s * np.exp(-b * (1.0 - x))) / (1.0 + s * np.exp(-b))
    return np.asarray(0.5 * s * (exponentials - np.cos(b * x) + np.tanh(b / 2.0) ** s * np.sin(b * x)))


def mode_shape_integrals(n: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the integrals of the first `n` mode shapes and of their squares, from clamp to tip.

    Parameters
    ----------
    n : int
        How many modes.

    Returns
    -------
    phi : ndarray, shape (n,), in units of the beam's length
        ``int(phi_i) = s sigma_i / b_i``, from ``phi = phi''''/b**4`` and the shape's third derivative at the clamp.
    phi_squared : ndarray, shape (n,), in units of the beam's length
        ``int(phi_i**2) = phi_i(1)**2 / 4``, for every mode.

    Raises
    ------
    InputError
        `n` is below 1.

    Examples
    --------
    >>> phi, phi_squared = mode_shape_integrals(2)
    >>> phi.round(8).tolist(), phi_squared.tolist()
    ([0.39149588, -0.21696795], [0.25, 0.25])
    """
    b, s = wavenumbers(n), _signs(n)
    return _read_only(s * np.tanh(b / 2.0) ** s / b), _read_only(np.full_like(b, 0.25))


def _signs(n: int) -> NDArray[np.float64]:
    """Return the signs of ``sin(b_i)``: 1, -1, 1, ..., shape (n,)."""
    return np.where(np.arange(checks.size("n", n)) % 2 == 0, 1.0, -1.0)


def _read_only(array: NDArray[np.float64]) -> NDArray[np.float64]:
    array.flags.writeable = False
    return array
