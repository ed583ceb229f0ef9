"""Elastic contact of tips of other shapes than the paraboloid of `Hertz`: cone, sphere on a cone, flat punch.

A shape enters by the force against the depth alone. Sneddon's theory gives both by the radius a of the contact: the
depth is ``q(a) = a int_0^a f'(r)/sqrt(a**2 - r**2) dr`` for the profile f, and the force ``2 E (a q - int_0^a q dt)``.
"""

from __future__ import annotations

import math
from abc import abstractmethod
from dataclasses import dataclass
from functools import cache
from typing import ClassVar, NamedTuple

import numpy as np

from saltus.afm.laws.contact import touching
from saltus.afm.laws.law import Law
from saltus.afm.laws.regions import Crossing, Region
from saltus.errors import InputError

__all__ = ["Cone", "FlatPunch", "SphereCone"]

SLOPE = "tan(pi/180*half_angle_deg)"
"""How fast a cone widens with its height, as a formula."""

_ANGLES = (5.0, 85.0)  # degrees; half angles for which the fit of `_fitted` is within 4e-4 of y

# Coefficients of w/sqrt(d) as a ratio of polynomials in d, where w tanh(w) = d: within 1e-5 for d up to 3.3. The force
# is stationary in w, so that its error is the square.
_ABOVE = (-0.13669784, 0.06448268692, 0.005755356278)
_BELOW = (-0.3034873487, 0.08512456163, -0.003480393407)

# The fit of `_fitted`.
_FITTED = (1e-2, 1e5)  # range of y over the sine of the half angle
_POINTS = 200
_ROUNDS = 8  # in which errors come to count relative to the value


@dataclass(frozen=True, kw_only=True)
class Pressed(Law):
    """Base of laws of elastic contact that begins and ends at one gap, by the force against the depth.

    Parameters
    ----------
    E_GPa : float
        Effective modulus of tip and sample, in GPa.
    a0_nm : float, optional
        Gap at which contact begins, in nm; by default 0.
    check : bool, optional
        Whether implausible values are refused.
    """

    contact: ClassVar[str] = "0"

    E_GPa: float
    a0_nm: float | None = None

    def __post_init__(self, check: bool) -> None:
        super().__post_init__(check)
        if self.a0_nm is not None:
            object.__setattr__(self, "contact", "a0_nm")

    @property
    def _depth(self) -> str:
        """The depth of indentation as a formula."""
        return "(-D_nm)" if self.contact == "0" else f"({self.contact} - D_nm)"

    @abstractmethod
    def _pressed(self, depth: str) -> str:
        """Return the force at a depth, as a formula."""

    @property
    def _limit(self) -> str:
        """What is positive where the formula of the force is valid; empty if it is everywhere."""
        return ""

    def _touched(self, force: str) -> Region:
        """Return a region of contact with a force."""
        return Region(force, separation=self.contact, indentation=self._depth, domain=self._limit)

    @property
    def regions(self) -> dict[str, Region]:
        """Without and with contact."""
        return {"far": Region(), "contact": self._touched(self._pressed(self._depth))}

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """Where contact begins and ends."""
        return touching(self.contact)


@dataclass(frozen=True, kw_only=True)
class Cone(Pressed):
    """Elastic contact of a cone and a flat: ``F = 2/pi E tan(alpha) h**2`` at the depth h. No energy is lost.

    Parameters
    ----------
    E_GPa : float
        Effective modulus of tip and sample, in GPa.
    half_angle_deg : float
        Angle alpha between the axis and the flank, in degrees.
    a0_nm : float, optional
        Gap at which contact begins, in nm; by default 0.
    check : bool, optional
        Whether implausible values are refused.

    Raises
    ------
    InputError
        A value that is not allowed or, with `check`, not plausible.

    References
    ----------
    I. N. Sneddon, Int. J. Eng. Sci. 3, 47 (1965), Sec. 6: the cone.

    Examples
    --------
    >>> law = Cone(E_GPa=0.01, half_angle_deg=45.0)
    >>> round(float(law.force_nN(-10.0)), 9)  # 2/pi
    0.636619772
    """

    positive: ClassVar[tuple[str, ...]] = ("half_angle_deg",)

    half_angle_deg: float

    def __post_init__(self, check: bool) -> None:
        super().__post_init__(check)
        below_90(self.half_angle_deg)

    def _pressed(self, depth: str) -> str:
        """Return the force at a depth, as a formula."""
        return force_of_cone(depth)


@dataclass(frozen=True, kw_only=True)
class FlatPunch(Pressed):
    """Elastic contact of a flat punch, round, and a flat: ``F = 2 E a h`` at the depth h. No energy is lost.

    The slope of the force jumps where contact begins.

    Parameters
    ----------
    E_GPa : float
        Effective modulus of tip and sample, in GPa.
    punch_nm : float
        Radius a of the punch, in nm. It is a field of its own: the radius of the probe is that of its curvature.
    a0_nm : float, optional
        Gap at which contact begins, in nm; by default 0.
    check : bool, optional
        Whether implausible values are refused.

    Raises
    ------
    InputError
        A value that is not allowed or, with `check`, not plausible.

    References
    ----------
    I. N. Sneddon, Int. J. Eng. Sci. 3, 47 (1965), Sec. 6: the flat-ended cylinder.

    Examples
    --------
    >>> float(FlatPunch(E_GPa=0.01, punch_nm=50.0).force_nN(-3.0))
    3.0
    """

    punch_nm: float

    def _pressed(self, depth: str) -> str:
        """Return the force at a depth, as a formula."""
        return force_of_punch(depth)


@dataclass(frozen=True, kw_only=True)
class SphereCone(Pressed):
    """Elastic contact of a cone with a spherical end and a flat; cone and sphere join without an edge.

    The sphere, a true one, has the probe's radius R and touches the cone at the radius ``b = R cos(alpha)``. While the
    contact's radius a is smaller, the depth is ``q = a/2 log((R + a)/(R - a))``. Beyond, with ``y = sqrt(a**2 - b**2)``
    and all lengths in units of R, it is ``q = a (log((1 + a)/(sin(alpha) + y)) + cot(alpha) atan(y/b))``. The force is
    ``2 E (a q - int_0^a q dt)``. At small depths it is that of `Hertz`, at large ones it grows as that of `Cone`. No
    energy is lost.

    The radius of contact over the depth is a ratio of polynomials, fitted to these equations within 4e-4. At a given
    depth the force is greatest at the right radius, so that its error is the square: below 1e-6 of the force. The fit
    is one for this half angle, so that a model has no parameter `half_angle_deg`.

    Parameters
    ----------
    E_GPa : float
        Effective modulus of tip and sample, in GPa.
    half_angle_deg : float
        Angle alpha between the axis and the flank, from 5 to 85 degrees.
    a0_nm : float, optional
        Gap at which contact begins, in nm; by default 0.
    check : bool, optional
        Whether implausible values are refused.

    Raises
    ------
    InputError
        A value that is not allowed or, with `check`, not plausible.

    References
    ----------
    I. N. Sneddon, Int. J. Eng. Sci. 3, 47 (1965), Secs. 5 and 6: any profile, and the sphere; B. J. Briscoe,
    K. S. Sebastian, M. J. Adams, J. Phys. D 27, 1156 (1994), with a paraboloid in place of the sphere.

    Examples
    --------
    >>> law = SphereCone(E_GPa=0.01, half_angle_deg=20.0)
    >>> law.force_nN([-0.1, -5.0, -200.0], R_nm=10.0).round(6).tolist()
    [0.001332, 0.447743, 111.289062]
    """

    half_angle_deg: float

    def __post_init__(self, check: bool) -> None:
        super().__post_init__(check)
        low, high = _ANGLES
        if not low <= self.half_angle_deg <= high:
            raise InputError("half_angle_deg", self.half_angle_deg, f"from {low:g} to {high:g}, the range of the fit")

    def _pressed(self, depth: str) -> str:
        """Return the force at a depth at which the sphere alone touches, as a formula."""
        d = f"({depth}/R_nm)"
        above, below = (_polynomial((1.0, *coefficients), d) for coefficients in (_ABOVE, _BELOW))
        w = f"(({depth})**(1/2)/sqrt(R_nm)*{above}/{below})"
        u = f"tanh({w})"
        return f"2*E_GPa*R_nm**2*({d}*{u} + (1 - {u}**2)/2*{w} - {u}/2)"

    @property
    def regions(self) -> dict[str, Region]:
        """Without contact, with contact of the sphere, and of sphere and cone."""
        return super().regions | {"flank": self._touched(_flank(self._depth, self.half_angle_deg))}

    @property
    def parameters(self) -> dict[str, float]:
        """Names and values of the parameters that are given, without the half angle."""
        return {name: value for name, value in super().parameters.items() if name != "half_angle_deg"}

    @property
    def crossings(self) -> tuple[Crossing, ...]:
        """Where contact begins and ends, and where the cone touches."""
        level = f"{'' if self.contact == '0' else self.contact} - {_join(self.half_angle_deg)!r}*R_nm".strip()
        inner = (
            Crossing("contact", "flank", level, -1, "cone_touches"),
            Crossing("flank", "contact", level, 1, "cone_off"),
        )
        return (*super().crossings, *inner)


def force_of_cone(depth: str) -> str:
    """Return the force of a cone at a depth of a thick sample, as a formula."""
    return f"2/pi*E_GPa*{SLOPE}*{depth}**2"


def force_of_punch(depth: str) -> str:
    """Return the force of a flat punch at a depth of a thick sample, as a formula."""
    return f"2*E_GPa*punch_nm*{depth}"


def below_90(half_angle_deg: float) -> None:
    """Raise `InputError` where an angle between the axis of a cone and its flank is none."""
    if half_angle_deg >= 90.0:
        raise InputError("half_angle_deg", half_angle_deg, "below 90, where the cone is a plane")


def _polynomial(coefficients: tuple[float, ...], x: str) -> str:
    return "(" + " + ".join(f"{one!r}*{x}**{i}" if i else repr(one) for i, one in enumerate(coefficients)) + ")"


def _angles(half_angle_deg: float) -> tuple[float, float]:
    """Radius of the join in radii, and the sine of the half angle."""
    return math.cos(math.radians(half_angle_deg)), math.sin(math.radians(half_angle_deg))


def _join(half_angle_deg: float) -> float:
    """Depth in radii at which the cone touches."""
    b, _ = _angles(half_angle_deg)
    return b * math.atanh(b)


def _flank(depth: str, half_angle_deg: float) -> str:
    """Text of the force where sphere and cone touch, with y as in `SphereCone`."""
    b, sine = _angles(half_angle_deg)
    fit = _fitted(half_angle_deg)
    x = f"(({depth} - {_join(half_angle_deg)!r}*R_nm)**(1/2)*{fit.scale!r}/sqrt(R_nm))"
    y = f"({fit.size!r}*{x}*{_polynomial(fit.above, x)}/{_polynomial(fit.below, x)})"
    a = f"sqrt({b * b!r} + {y}**2)"
    integral = (
        f"({y}**2 - {sine * sine!r})/2*log((1 + {a})/({sine!r} + {y})) + ({a} - {sine!r}*{y})/2"
        f" + {b / (2.0 * sine)!r}*({a}**2*atan({y}/{b!r}) - {b!r}*{y})"
    )
    return f"2*E_GPa*R_nm**2*({depth}/R_nm*{a} - ({integral}))"


class _Fit(NamedTuple):
    """y over the root of the depth from the join: ``y = size x above(x)/below(x)`` with ``x = scale s``."""

    scale: float
    size: float
    above: tuple[float, ...]
    below: tuple[float, ...]


@cache
def _fitted(half_angle_deg: float) -> _Fit:
    """Fit of y for a half angle, exact at small s, where y is ``k1 s``, and at large ones, where it is ``far s**2``."""
    b, sine = _angles(half_angle_deg)
    far = 2.0 / math.pi * sine / b
    k1 = math.sqrt(2.0 / (math.atanh(b) / b + 1.0 / (1.0 + b) + b / sine**2))
    y = sine * np.geomspace(*_FITTED, _POINTS)
    a = np.sqrt(b**2 + y**2)
    depth = a * (np.log((1.0 + a) / (sine + y)) + b / sine * np.arctan(y / b))
    x, wanted = np.sqrt(depth - _join(half_angle_deg)) * far / k1, y * far / k1**2
    terms = np.column_stack([x**2, x**3, x**4, -wanted * x, -wanted * x**2, x**5 - wanted * x**3])
    weight = 1.0 / wanted
    for _ in range(_ROUNDS):
        weighted = terms * weight[:, None]
        size = np.abs(weighted).max(axis=0)
        found = np.linalg.lstsq(weighted / size, (wanted - x) * weight, rcond=None)[0] / size
        weight = 1.0 / (wanted * (1.0 + found[3] * x + found[4] * x**2 + found[5] * x**3))
    p1, p2, p3, q1, q2, q3 = (float(f"{one:.6g}") for one in found)
    return _Fit(far / k1, k1**2 / far, (1.0, p1, p2, p3, q3), (1.0, q1, q2, q3))
