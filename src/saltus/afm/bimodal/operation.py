"""How a mode is operated: at constant drive and frequency (AM), or at a lag that the frequency holds (FM)."""

from __future__ import annotations

from dataclasses import InitVar, dataclass

from saltus import checks
from saltus.afm.probe.units import checked
from saltus.errors import InputError

__all__ = ["AM", "FM"]

_MOST_HZ = 1e8  # largest set frequency shift


@dataclass(frozen=True, kw_only=True)
class AM:
    """Amplitude modulation: drive and frequency of the mode are constant.

    Parameters
    ----------
    A0_nm : float
        Drive, as the free amplitude at the natural frequency, in nm: a force ``k A0/Q`` on the mode.
    shift_Hz : float, optional
        Frequency of the drive over the natural frequency, in Hz.
    setpoint_nm : float, optional
        Amplitude that a loop holds by the distance, in nm.
    check : bool, optional
        Whether implausible values are refused.

    Raises
    ------
    InputError
        A value is not allowed or, with `check`, not plausible.

    Examples
    --------
    >>> AM(A0_nm=10.0, setpoint_nm=8.0).held
    {'excitation_nm': 10.0, 'shift_Hz': 0.0, 'amplitude_nm': 8.0}
    """

    A0_nm: float
    shift_Hz: float = 0.0
    setpoint_nm: float | None = None
    check: InitVar[bool] = True

    def __post_init__(self, check: bool) -> None:
        checks.flag("check", check)
        object.__setattr__(self, "A0_nm", _size("A0_nm", self.A0_nm, check))
        object.__setattr__(self, "shift_Hz", checks.between("shift_Hz", self.shift_Hz, -_MOST_HZ, _MOST_HZ))
        if self.setpoint_nm is not None:
            object.__setattr__(self, "setpoint_nm", checked("setpoint_nm", self.setpoint_nm, plausible=check))

    @property
    def held(self) -> dict[str, float]:
        """Readings of the mode that are held."""
        own = {"excitation_nm": self.A0_nm, "shift_Hz": self.shift_Hz}
        return own if self.setpoint_nm is None else own | {"amplitude_nm": self.setpoint_nm}

    @property
    def sets_distance(self) -> bool:
        """Whether a set point of this mode holds the distance."""
        return self.setpoint_nm is not None


@dataclass(frozen=True, kw_only=True)
class FM:
    """Frequency modulation: a loop holds the lag at 90 degrees by the frequency, another one may hold the amplitude.

    Parameters
    ----------
    A_nm : float, optional
        Amplitude that the drive holds, in nm.
    A0_nm : float, optional
        In place of `A_nm`, the drive that is constant, as the free amplitude at the natural frequency, in nm.
    setpoint_Hz : float, optional
        Frequency shift that a loop holds by the distance, in Hz.
    check : bool, optional
        Whether implausible values are refused.

    Raises
    ------
    InputError
        Not exactly one of `A_nm` and `A0_nm` is given; a value is not allowed or, with `check`, not plausible.

    Examples
    --------
    >>> FM(A_nm=0.5).held
    {'lag_deg': 90.0, 'amplitude_nm': 0.5}
    """

    A_nm: float | None = None
    A0_nm: float | None = None
    setpoint_Hz: float | None = None
    check: InitVar[bool] = True

    def __post_init__(self, check: bool) -> None:
        checks.flag("check", check)
        given = [name for name in ("A_nm", "A0_nm") if getattr(self, name) is not None]
        if len(given) != 1:
            raise InputError("FM", given, "given exactly one of A_nm (held) and A0_nm (constant drive)")
        object.__setattr__(self, given[0], _size(given[0], getattr(self, given[0]), check))
        if self.setpoint_Hz is not None:
            shift = checks.between("setpoint_Hz", self.setpoint_Hz, -_MOST_HZ, _MOST_HZ)
            if shift == 0.0:
                raise InputError("setpoint_Hz", self.setpoint_Hz, "not 0", "a probe far away has this shift everywhere")
            object.__setattr__(self, "setpoint_Hz", shift)

    @property
    def held(self) -> dict[str, float]:
        """Readings of the mode that are held."""
        held = {"lag_deg": 90.0}
        if self.A_nm is not None:
            held["amplitude_nm"] = self.A_nm
        if self.A0_nm is not None:
            held["excitation_nm"] = self.A0_nm
        return held if self.setpoint_Hz is None else held | {"shift_Hz": self.setpoint_Hz}

    @property
    def sets_distance(self) -> bool:
        """Whether a set point of this mode holds the distance."""
        return self.setpoint_Hz is not None


def _size(name: str, value: object, check: bool) -> float:
    """Return an amplitude, which must not be 0."""
    return checks.positive(name, checked(name, value, plausible=check), "nm")
