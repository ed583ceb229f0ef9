"""Elastic contact with a thin sample on a rigid support: paraboloid, cone and flat punch.

A layer of thickness t answers a pressure with the wavenumber w/t as a half space does, times ``L(w)``. The stress under
the tip follows from a Fredholm equation with the kernel ``int (1 - L(w)) cos(w u/t) dw``. In powers of a/t, a being the
radius of contact, its solution to the fourth order has two moments only: ``m0 = int (1 - L) dw`` and
``m2 = int (1 - L) w**2 dw``.
"""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass
from typing import ClassVar

from saltus import checks
from saltus.afm.laws.tips import SLOPE, Pressed, below_90, force_of_cone, force_of_punch
from saltus.errors import InputError

__all__ = ["ThinCone", "ThinPunch", "ThinSphere"]

# Polynomials in nu of (1 - nu) m0 and (1 - nu) m2 for a bonded layer, within 1e-5 and 4e-5 of the integrals.
_M0 = (1.211066, -0.9826359, 0.451262, -0.06241982, 1.762406, -3.447734, 3.707592)
_M2 = (1.878813, -0.7841405, 1.163408, -1.533072, 11.1839, -23.71276, 23.77954)
_SLIPPING = (1.1675768364, 1.5815255458)  # m0 and m2 of a layer that slips, for every nu

# Largest values of what the series are in: up to there they are within 2.5 % of the integral equation, for every nu.
_SPHERE = 0.55  # sqrt(R h)/t
_CONE = 0.8  # h tan(alpha)/t
_PUNCH = 0.7  # a/t

_LARGEST_NU = 0.5  # Poisson's ratio of what keeps its volume


@dataclass(frozen=True, kw_only=True)
class _Thin(Pressed):
    """Base of laws of thin samples: the force on a thick one, times a series in a ratio of lengths."""

    positive: ClassVar[tuple[str, ...]] = ("thickness_nm",)

    thickness_nm: float
    nu: float = 0.5
    support: str = "bonded"

    def __post_init__(self, check: bool) -> None:
        super().__post_init__(check)
        checks.chosen("support", self.support, ("bonded", "slipping"))
        if self.nu > _LARGEST_NU:
            raise InputError("nu", self.nu, f"at most {_LARGEST_NU:g}, Poisson's ratio of what keeps its volume")

    @abstractmethod
    def _thick(self, depth: str) -> str:
        """Return the force on a thick sample at a depth, as a formula."""

    @abstractmethod
    def _ratio(self, depth: str) -> str:
        """Return what the series is in, as a formula."""

    @abstractmethod
    def _series(self, m0: str, m2: str) -> tuple[str, ...]:
        """Return the coefficients of the first to fourth power, as formulas."""

    def _pressed(self, depth: str) -> str:
        """Return the force at a depth, as a formula."""
        x, factor = self._ratio(depth), "0"
        for coefficient in self._series(*self._moments)[::-1]:
            factor = f"{x}*({coefficient} + {factor})"
        return f"{self._thick(depth)}*(1 + {factor})"

    @property
    def _moments(self) -> tuple[str, str]:
        """The moments of the layer's kernel, divided by pi, as formulas."""
        if self.support == "slipping":
            return f"({_SLIPPING[0]!r}/pi)", f"({_SLIPPING[1]!r}/pi)"
        m0, m2 = (" + ".join(f"{one!r}*nu**{i}" if i else repr(one) for i, one in enumerate(m)) for m in (_M0, _M2))
        return f"(({m0})/(pi*(1 - nu)))", f"(({m2})/(pi*(1 - nu)))"


@dataclass(frozen=True, kw_only=True)
class ThinSphere(_Thin):
    """Elastic contact of a paraboloid, as `Hertz`, and a thin sample on a rigid support.

    With ``x = sqrt(R h)/t`` at the depth h and the moments ``m = m0/pi`` and ``n = m2/pi``,
    ``F = 4/3 E sqrt(R) h**1.5 (1 + 2 m x + 14/3 m**2 x**2 + 8 (200 m**3 - 9 n) x**3/135
    + 2 m (715 m**3 - 72 n) x**4/45)``. For ``nu = 0.5`` and a bonded sample the coefficients are 1.127, 1.482, 1.470
    and 1.005. No energy is lost.

    The formula of Dimitriadis et al. has 1.133, 1.283, 0.769 and 0.0975, which lacks the growth of the contact on a
    thin sample: 5 % less force at ``x = 0.42``, 12 % at 0.69. That of Garcia and Garcia has 1.133, 1.497, 1.469 and
    0.755.

    Parameters
    ----------
    E_GPa : float
        Effective modulus of tip and sample, in GPa: Young's modulus over ``1 - nu**2``.
    thickness_nm : float
        Thickness t of the sample, in nm.
    nu : float, optional
        Poisson's ratio of the sample.
    support : {"bonded", "slipping"}, optional
        Whether the sample sticks to its support or slips on it without friction.
    a0_nm : float, optional
        Gap at which contact begins, in nm; by default 0.
    check : bool, optional
        Whether implausible values are refused.

    Raises
    ------
    InputError
        A value that is not allowed or, with `check`, not plausible. A force is asked for at ``x > 0.55``, where the
        series is more than 2.5 % wrong.

    References
    ----------
    E. K. Dimitriadis, F. Horkay, J. Maresca, B. Kachar, R. S. Chadwick, Biophys. J. 82, 2798 (2002), Eq. (12);
    P. D. Garcia, R. Garcia, Biophys. J. 114, 2923 (2018); the integral equation by R. S. Dhaliwal, I. S. Rau,
    Int. J. Eng. Sci. 8, 843 (1970).

    Examples
    --------
    >>> law = ThinSphere(E_GPa=1e-5, thickness_nm=1000.0)
    >>> law.force_nN([-10.0, -100.0], R_nm=1000.0).round(6).tolist()
    [0.015054, 0.658205]
    """

    def _thick(self, depth: str) -> str:
        """Return the force on a thick sample at a depth, as a formula."""
        return f"4/3*E_GPa*sqrt(R_nm)*{depth}**(3/2)"

    def _ratio(self, depth: str) -> str:
        """Return what the series is in, as a formula."""
        return f"(sqrt(R_nm)*{depth}**(1/2)/thickness_nm)"

    def _series(self, m0: str, m2: str) -> tuple[str, ...]:
        """Return the coefficients of the first to fourth power, as formulas."""
        third, fourth = f"8/135*(200*{m0}**3 - 9*{m2})", f"2/45*{m0}*(715*{m0}**3 - 72*{m2})"
        return f"2*{m0}", f"14/3*{m0}**2", third, fourth

    @property
    def _limit(self) -> str:
        """What is positive where the series is valid."""
        return f"({_SPHERE!r}*thickness_nm)**2 - R_nm*{self._depth}"


@dataclass(frozen=True, kw_only=True)
class ThinCone(_Thin):
    """Elastic contact of a cone and a thin sample on a rigid support.

    With ``x = h tan(alpha)/t`` at the depth h and the moments ``m = m0/pi`` and ``n = m2/pi``,
    ``F = 2/pi E tan(alpha) h**2 (1 + 4 m x/pi + 20 m**2 x**2/pi**2 + 4 (28 m**3 - n) x**3/pi**3
    + 56 m (12 m**3 - n) x**4/pi**4)``. For ``nu = 0.5`` and a bonded sample the coefficients are 0.717, 0.643, 0.489
    and 0.300. No energy is lost.

    Garcia and Garcia have 0.721, 0.650, 0.491 and 0.225.

    Parameters
    ----------
    E_GPa : float
        Effective modulus of tip and sample, in GPa: Young's modulus over ``1 - nu**2``.
    half_angle_deg : float
        Angle alpha between the axis and the flank, in degrees.
    thickness_nm : float
        Thickness t of the sample, in nm.
    nu : float, optional
        Poisson's ratio of the sample.
    support : {"bonded", "slipping"}, optional
        Whether the sample sticks to its support or slips on it without friction.
    a0_nm : float, optional
        Gap at which contact begins, in nm; by default 0.
    check : bool, optional
        Whether implausible values are refused.

    Raises
    ------
    InputError
        A value that is not allowed or, with `check`, not plausible. A force is asked for at ``x > 0.8``, where the
        series is more than 2.5 % wrong.

    References
    ----------
    P. D. Garcia, R. Garcia, Biophys. J. 114, 2923 (2018); see `ThinSphere`.

    Examples
    --------
    >>> law = ThinCone(E_GPa=1e-5, half_angle_deg=35.0, thickness_nm=1000.0)
    >>> law.force_nN([-10.0, -300.0]).round(6).tolist()
    [0.000448, 0.475094]
    """

    positive: ClassVar[tuple[str, ...]] = ("thickness_nm", "half_angle_deg")

    half_angle_deg: float

    def __post_init__(self, check: bool) -> None:
        super().__post_init__(check)
        below_90(self.half_angle_deg)

    def _thick(self, depth: str) -> str:
        """Return the force on a thick sample at a depth, as a formula."""
        return force_of_cone(depth)

    def _ratio(self, depth: str) -> str:
        """Return what the series is in, as a formula."""
        return f"({depth}*{SLOPE}/thickness_nm)"

    def _series(self, m0: str, m2: str) -> tuple[str, ...]:
        """Return the coefficients of the first to fourth power, as formulas."""
        third, fourth = f"4/pi**3*(28*{m0}**3 - {m2})", f"56/pi**4*{m0}*(12*{m0}**3 - {m2})"
        return f"4/pi*{m0}", f"20/pi**2*{m0}**2", third, fourth

    @property
    def _limit(self) -> str:
        """What is positive where the series is valid."""
        return f"{_CONE!r} - {self._ratio(self._depth)}"


@dataclass(frozen=True, kw_only=True)
class ThinPunch(_Thin):
    """Elastic contact of a flat punch, or cylinder, and a thin sample on a rigid support.

    With ``x = a/t`` and the moments ``m = m0/pi`` and ``n = m2/pi``,
    ``F = 2 E a h (1 + 2 m x + 4 m**2 x**2 + (8 m**3 - 2 n/3) x**3 + 8 m (6 m**3 - n) x**4/3)``. For ``nu = 0.5`` and a
    bonded sample the coefficients are 1.127, 1.270, 0.618 and -0.219. No energy is lost.

    Garcia and Garcia have 1.133, 1.283, 0.598 and -0.291.

    Parameters
    ----------
    E_GPa : float
        Effective modulus of tip and sample, in GPa: Young's modulus over ``1 - nu**2``.
    punch_nm : float
        Radius a of the punch, in nm.
    thickness_nm : float
        Thickness t of the sample, in nm.
    nu : float, optional
        Poisson's ratio of the sample.
    support : {"bonded", "slipping"}, optional
        Whether the sample sticks to its support or slips on it without friction.
    a0_nm : float, optional
        Gap at which contact begins, in nm; by default 0.
    check : bool, optional
        Whether implausible values are refused.

    Raises
    ------
    InputError
        A value that is not allowed or, with `check`, not plausible; a radius of more than 0.7 of the thickness, where
        the series is more than 2.5 % wrong.

    References
    ----------
    P. D. Garcia, R. Garcia, Biophys. J. 114, 2923 (2018); see `ThinSphere`.

    Examples
    --------
    >>> law = ThinPunch(E_GPa=1e-5, punch_nm=300.0, thickness_nm=1000.0)
    >>> round(float(law.force_nN(-10.0)), 6)
    0.088038
    """

    punch_nm: float

    def __post_init__(self, check: bool) -> None:
        super().__post_init__(check)
        if self.punch_nm > _PUNCH * self.thickness_nm:
            allowed = (
                f"at most {_PUNCH:g} of thickness_nm = {self.thickness_nm!r}, beyond which the series does not hold"
            )
            raise InputError("punch_nm", self.punch_nm, allowed)

    def _thick(self, depth: str) -> str:
        """Return the force on a thick sample at a depth, as a formula."""
        return force_of_punch(depth)

    def _ratio(self, depth: str) -> str:
        """Return what the series is in, as a formula."""
        return "(punch_nm/thickness_nm)"

    def _series(self, m0: str, m2: str) -> tuple[str, ...]:
        """Return the coefficients of the first to fourth power, as formulas."""
        return f"2*{m0}", f"4*{m0}**2", f"(8*{m0}**3 - 2/3*{m2})", f"8/3*{m0}*(6*{m0}**3 - {m2})"

    @property
    def _limit(self) -> str:
        """What is not negative where the series is valid."""
        return f"{_PUNCH!r}*(1 + 1e-9) - punch_nm/thickness_nm"
