"""The drive: what keeps the cantilever swinging, at one frequency or at several with whole ratios."""

from __future__ import annotations

import math
from dataclasses import KW_ONLY, InitVar, dataclass, field, replace
from fractions import Fraction
from typing import TYPE_CHECKING

from saltus import checks
from saltus.afm.probe.named_arguments import NamedArguments
from saltus.afm.probe.probe import MOST_MODES
from saltus.afm.probe.units import checked
from saltus.errors import InputError

if TYPE_CHECKING:
    pass

__all__ = ["Drive", "Drives"]

_LARGEST = 100  # numerator and denominator of a ratio of frequencies, at most
_ROUNDING = 1e-12  # distance, relative, at which a number is a fraction
_SIZES = ("A0_nm", "F0_nN", "Y_nm")
_FLUIDS = ("moves", "rests")  # what the fluid does about a shaken base


@dataclass(frozen=True)
class Drive(NamedArguments):
    """One harmonic drive, ``cos`` of its phase: of one mode by a force, of the tip by a force, or of the base.

    Parameters
    ----------
    A0_nm : float, optional
        Free amplitude, in nm: a force ``k A0 / Q`` on one mode, which alone is driven.
    mode : int, optional
        Which mode is driven, from 1, where `A0_nm` is given.
    ratio : str, int or Fraction, optional
        Frequency over the first drive's, as ``"19/3"``. The first drive has 1.
    at : {"f0", "peak"} or float, optional
        Frequency at which the free amplitude is `A0_nm`: the mode's natural frequency, that of its largest amplitude,
        or a number of kHz.
    phase_deg : float, optional
        Lead over ``cos`` of its own frequency, in degrees.
    F0_nN : float, optional
        In place of `A0_nm`, a force on the tip, which drives all modes; see `force`.
    Y_nm : float, optional
        In place of `A0_nm`, the amplitude of the base; see `base`.
    fluid : {"moves", "rests"}, optional
        Whether the fluid moves with a shaken base; see `base`.
    check : bool, optional
        Whether implausible values are refused, an amplitude of 0 among them.

    Attributes
    ----------
    repeats : bool
        Whether the drive repeats with the first one; not after `at_any_ratio`.

    Raises
    ------
    InputError
        Not exactly one of the amplitudes is given, a value is not allowed, or `ratio` is no fraction of small integers.

    Examples
    --------
    >>> both = Drive(A0_nm=10.0) + Drive(A0_nm=1.0, mode=2, ratio="19/3")
    >>> [str(part.ratio) for part in both.parts]
    ['1', '19/3']
    >>> Drive(A0_nm=1.0, ratio=6.267)
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: ratio = 6.267: must be a fraction of integers up to 100, as '19/3'; ...
    """

    A0_nm: float | None = None
    _: KW_ONLY
    mode: int = 1
    ratio: str | float | Fraction = 1
    at: str | float = "f0"
    phase_deg: float = 0.0
    F0_nN: float | None = None
    Y_nm: float | None = None
    fluid: str = "moves"
    repeats: bool = field(default=True, init=False)
    check: InitVar[bool] = True

    def __post_init__(self, check: bool) -> None:
        checks.flag("check", check)
        given = [name for name in _SIZES if getattr(self, name) is not None]
        if len(given) != 1:
            raise InputError("drive", given, f"given by exactly one of {', '.join(_SIZES)}")
        object.__setattr__(self, given[0], checked(given[0], getattr(self, given[0]), plausible=check))
        if check and getattr(self, given[0]) == 0.0:
            raise InputError(given[0], 0.0, "above 0", "without a drive nothing swings; check=False insists")
        checks.count("mode", self.mode, 1, MOST_MODES)
        object.__setattr__(self, "ratio", _fraction(self.ratio))
        object.__setattr__(self, "phase_deg", checks.number("phase_deg", self.phase_deg, unit="degrees"))
        if isinstance(self.at, str):
            checks.chosen("at", self.at, ("f0", "peak"), instead=", or a number of kHz")
        else:
            object.__setattr__(self, "at", checked("f_kHz", self.at, plausible=check))
        if given[0] != "A0_nm" and (self.mode != 1 or self.at != "f0"):
            raise InputError("drive", given[0], "given without mode and at, which belong to A0_nm")
        if checks.chosen("fluid", self.fluid, _FLUIDS) != "moves" and given[0] != "Y_nm":
            raise InputError("fluid", self.fluid, "left out where the base is not shaken")

    @classmethod
    def force(
        cls, F0_nN: float, *, ratio: str | float | Fraction = 1, phase_deg: float = 0.0, check: bool = True
    ) -> Drive:
        """Return a force on the tip, which drives all modes, as a magnetic one.

        Parameters
        ----------
        F0_nN : float
            Its amplitude, in nN.
        ratio, phase_deg, check : optional
            As for `Drive`.

        Returns
        -------
        Drive

        Raises
        ------
        InputError
            A value is not allowed.

        Examples
        --------
        >>> Drive.force(2.0).size
        ('F0_nN', 2.0)
        """
        return cls(F0_nN=F0_nN, ratio=ratio, phase_deg=phase_deg, check=check)

    @classmethod
    def base(
        cls,
        Y_nm: float,
        *,
        fluid: str = "moves",
        ratio: str | float | Fraction = 1,
        phase_deg: float = 0.0,
        check: bool = True,
    ) -> Drive:
        """Return a motion of the base, as of a piezo under the cantilever.

        Each mode feels the inertia ``b m omega**2 Y``, with its weight b of `Probe.base_weights`, and the tip moves
        with the base. By default the fluid moves along, and its drag acts on the deflection.

        Parameters
        ----------
        Y_nm : float
            Its amplitude, in nm.
        fluid : {"moves", "rests"}, optional
            Where the fluid rests, its drag acts on the motion of base and deflection together. Then each mode feels
            ``b k omega Y / (omega_n Q)`` as well, a quarter of a period behind. In air this is nothing. At Q = 2 the
            force at the natural frequency is 12 % larger, and lags by 27 degrees.
        ratio, phase_deg, check : optional
            As `Drive.force` takes them.

        Returns
        -------
        Drive
            Of the base.

        Raises
        ------
        InputError
            The amplitude, or one of these, is not allowed.

        References
        ----------
        X. Xu, A. Raman, J. Appl. Phys. 102, 034303 (2007): a shaken base in a fluid at rest.

        Examples
        --------
        >>> Drive.base(0.5).size
        ('Y_nm', 0.5)
        """
        return cls(Y_nm=Y_nm, fluid=fluid, ratio=ratio, phase_deg=phase_deg, check=check)

    def at_any_ratio(self, ratio: float) -> Drive:
        """Return the same drive at a frequency that need not repeat with the first one, for simulations.

        A model of such a drive has its phase as a state, ``theta_2`` in rad, and ``ratio_2`` may vary. It has no
        periodic orbit, and so neither curves nor observables of orbits.

        Parameters
        ----------
        ratio : float
            Frequency over the first drive's.

        Returns
        -------
        Drive

        Raises
        ------
        InputError
            The ratio is not positive.

        Examples
        --------
        >>> from saltus import afm, simulate
        >>> probe = afm.Probe(k_N_m=(2.0, 78.5), f0_kHz=(70.0, 438.7), Q=(150.0, 450.0), R_nm=10.0)
        >>> drive = Drive(A0_nm=20.0) + Drive(A0_nm=1.0, mode=2).at_any_ratio(438.7 / 70.0)
        >>> system = afm.model(probe, afm.Hertz(E_GPa=1.0), drive, Zc_nm=15.0)
        >>> system.states
        ('z1_nm', 'z2_nm', 'v1_nm_us', 'v2_nm_us', 'theta_2')
        >>> motion = simulate(system, x0=[0.0] * 5, periods=500)
        >>> print(f"{motion.observe('max(indentation_nm)', t_start=400.0 / 0.07)['max(indentation_nm)']:.2f} nm")
        0.98 nm
        """
        free = replace(self, ratio=1)
        object.__setattr__(free, "ratio", checks.positive("ratio", ratio))
        object.__setattr__(free, "repeats", False)
        return free

    @property
    def size(self) -> tuple[str, float]:
        """Name and value of the amplitude that is given."""
        return next((name, float(getattr(self, name))) for name in _SIZES if getattr(self, name) is not None)

    @property
    def parts(self) -> tuple[Drive, ...]:
        """The drive itself, as the only one."""
        return (self,)

    def __add__(self, other: Drive | Drives) -> Drives:
        return Drives(self.parts + other.parts) if isinstance(other, Drive | Drives) else NotImplemented


@dataclass(frozen=True)
class Drives:
    """Several drives at once, as `+` makes them.

    Raises
    ------
    InputError
        The first drive's ratio is not 1, two drives have one frequency, or the common period is too long.
    """

    parts: tuple[Drive, ...]  # the drives; the first has the ratio 1

    def __post_init__(self) -> None:
        ratios = [Fraction(part.ratio) for part in self.parts]
        if ratios[0] != 1 or not self.parts[0].repeats:
            raise InputError("ratio", str(ratios[0]), "1 for the first drive", "ratios are over its frequency")
        if len(set(ratios)) < len(ratios):
            raise InputError("ratio", [str(ratio) for ratio in ratios], "another for each drive")
        if self.turns > _LARGEST:
            allowed = f"fractions that repeat after at most {_LARGEST} periods of the first drive"
            raise InputError("ratio", [str(ratio) for ratio in ratios], allowed)

    @property
    def turns(self) -> int:
        """Periods of the first drive after which all of them repeat."""
        return math.lcm(*(Fraction(part.ratio).denominator for part in self.parts if part.repeats))

    def __add__(self, other: Drive | Drives) -> Drives:
        return Drives(self.parts + other.parts) if isinstance(other, Drive | Drives) else NotImplemented


def _fraction(ratio: object) -> Fraction:
    """Return a ratio of two frequencies as a fraction of small integers."""
    allowed = f"a fraction of integers up to {_LARGEST}, as '19/3'"
    try:
        found = Fraction(ratio) if isinstance(ratio, str) else Fraction(checks.positive("ratio", ratio))
    except (ValueError, ZeroDivisionError):
        raise InputError("ratio", ratio, allowed) from None
    near = found.limit_denominator(_LARGEST)
    if found <= 0:
        raise InputError("ratio", ratio, allowed)
    if max(near.numerator, near.denominator) > _LARGEST or abs(near / found - 1) > _ROUNDING:
        rough = max(found, Fraction(1, _LARGEST)).limit_denominator(10)
        hint = f"others never repeat: simulate with at_any_ratio({ratio}), or take one near, as '{rough}'"
        raise InputError("ratio", ratio, allowed, hint)
    return near
