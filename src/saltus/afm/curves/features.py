"""Special points and jumps of a curve in an instrument's words."""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

from saltus.afm.models.settling import stays_in_contact

if TYPE_CHECKING:
    from saltus.afm.curves.routes import Landing
    from saltus.orbits import PeriodicOrbit

__all__ = ["WORDS", "Feature", "Jump"]

_HELD = 0.75  # share of the time in contact from which on a tip counts as held

# What happens at a special point.
WORDS = {
    "SN": "the amplitude jumps", "GR": "contact begins or ends", "PD": "the period doubles",
    "TR": "a slow modulation sets in", "BP": "branches meet",
}  # fmt: skip


class Feature(NamedTuple):
    """A special point of a curve in an instrument's words."""

    label: str  # its label on its sheet, as ``SN1``
    what: str  # what happens there: a jump, contact begins or ends, the motion's period doubles
    value: float  # the distance or frequency
    amplitude_nm: float  # the amplitude there
    sheet: int  # the branch on which it lies
    orbit: PeriodicOrbit  # the motion there

    @property
    def parameters(self) -> dict[str, float]:
        """The values of all parameters there."""
        return dict(self.orbit.parameters)

    def __repr__(self) -> str:
        return (
            f"{self.label} at {self.value:.9g}, amplitude {self.amplitude_nm:.6g} nm, sheet {self.sheet}: {self.what}"
        )


class _Numbers(NamedTuple):
    """What is told of a jump in numbers."""

    direction: str  # the way on which it happens
    value: float  # distance or frequency
    # before_nm, after_nm: amplitudes
    before_nm: float
    after_nm: float


class Jump(_Numbers):
    """A jump on the way of an experiment; as a tuple its way, its place, and the amplitudes before and after.

    Attributes
    ----------
    along : str
        What varies: ``Zc_nm`` or ``f_kHz``.
    before, after : PeriodicOrbit
        The last motion before the jump, and the one on which it lands.

    Examples
    --------
    >>> Jump("approach", 9.8783, 9.847, 10.6).before_nm
    9.847
    """

    along: str
    before: PeriodicOrbit
    after: PeriodicOrbit

    @classmethod
    def of(cls, direction: str, along: str, landing: Landing, amplitude: str) -> Jump:
        """Return a jump; amplitude: the formula of the amplitude."""
        before, after = (orbit.observe(amplitude)[amplitude] for orbit in (landing.before, landing.after))
        jump = cls(direction, landing.value, before, after)
        jump.along, jump.before, jump.after = along, landing.before, landing.after
        return jump

    @property
    def what(self) -> str:
        """What happens: a snap-in, a pull-off, or the amplitude jumps up or down."""
        held, holds = _is_held(self.before), _is_held(self.after)
        if self.along == "Zc_nm" and held != holds:
            return "snap-in: the tip stays in contact" if holds else "pull-off: the tip comes off"
        return f"the amplitude jumps {'up' if self.after_nm > self.before_nm else 'down'}"

    def __str__(self) -> str:
        change = f"amplitude from {self.before_nm:.4g} to {self.after_nm:.4g} nm"
        return f"{self.direction} at {self.along} = {self.value:.6g}: {self.what}, {change}"

    __repr__ = __str__


def _is_held(orbit: PeriodicOrbit) -> bool:
    """Return whether the tip is in contact nearly always, as just before the pull-off."""
    if stays_in_contact(orbit):
        return True
    return "contact" in orbit.system.output_names and orbit.observe("mean(contact)")["mean(contact)"] > _HELD
