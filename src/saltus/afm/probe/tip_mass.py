"""A clamped beam with a mass at its end: wavenumbers, and the integrals of its modes.

With the tip's mass ``mu`` in units of the beam's, the wavenumbers solve
``1 + cos(b) cosh(b) + mu b (cos(b) sinh(b) - sin(b) cosh(b)) = 0``. What else is needed of a mode has a closed form, in
which ``s, c = sin(b), cos(b)`` and ``t = tanh(b)``: the slope at the end over the displacement there is
``b s t / (s - c t)``, for any ``mu``. Partial integration of ``phi'''' = b**4 phi`` gives the rest.

References
----------
R. D. Blevins, Formulas for Natural Frequency and Mode Shape (1979), Table 8-8: clamped beam with a mass at its end.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from saltus.afm.probe.beam import wavenumbers

__all__ = ["EndMode", "modes_with_mass"]

_STEPS = 40  # fixed-point steps to a root of tan(b) = tanh(b); each gains more than a digit
_HALVINGS = 60  # of an interval of wavenumbers; 53 reach rounding
_LEAST = 1e-9  # wavenumber below which no first mode is sought


class EndMode(NamedTuple):
    """One mode of a clamped beam with a mass at its end, its displacement at the end being 1."""

    wavenumber: float  # in units of one over the beam's length
    slope: float  # slope at the end, in units of one over the length
    mass: float  # modal mass ``int(phi**2) + mu``, in units of the beam's mass
    base_weight: float  # ``(int(phi) + mu)`` over the modal mass: what drives the mode where the base is shaken


def modes_with_mass(n: int, mu: float = 0.0) -> tuple[EndMode, ...]:
    """Return the first `n` modes of a clamped beam with a mass at its end.

    Parameters
    ----------
    mu : float, optional
        The mass, in units of the beam's.

    Examples
    --------
    >>> [round(mode.slope, 6) for mode in modes_with_mass(2)]
    [1.376505, 4.780778]
    >>> heavy = modes_with_mass(1, 1000.0)[0]  # a massless spring of stiffness 3 EI/L**3 under a mass
    >>> round(heavy.wavenumber**4 * heavy.mass, 2)
    3.0
    """
    return tuple(_mode(i, float(free), mu) for i, free in enumerate(wavenumbers(n)))


def _mode(i: int, free: float, mu: float) -> EndMode:
    b = free if mu == 0.0 else _wavenumber(_pinned(i), free, mu)
    s, c, t, sech = math.sin(b), math.cos(b), math.tanh(b), 1.0 / math.cosh(b)
    slope = b * s * t / (s - c * t)
    mass = 0.25 * (1.0 + mu + 2.0 * mu * slope)
    return EndMode(b, slope, mass, (1.0 + c * sech) / (b * (s - c * t)) / mass)


def _wavenumber(low: float, high: float, mu: float) -> float:
    """Return the root of the characteristic equation between two wavenumbers, by halving."""
    sign = math.copysign(1.0, _characteristic(low, mu))
    for _ in range(_HALVINGS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if sign * _characteristic(middle, mu) > 0.0 else (low, middle)
    return 0.5 * (low + high)


def _characteristic(b: float, mu: float) -> float:
    return 1.0 / math.cosh(b) + math.cos(b) + mu * b * (math.cos(b) * math.tanh(b) - math.sin(b))


def _pinned(i: int) -> float:
    """Return the wavenumber of mode `i`, from 0, at an infinite mass: that of a pinned end."""
    if i == 0:
        return _LEAST
    b = (i + 0.25) * math.pi
    for _ in range(_STEPS):
        b = i * math.pi + math.atan(math.tanh(b))
    return b
