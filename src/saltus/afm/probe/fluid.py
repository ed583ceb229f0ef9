"""The fluid around a cantilever, and the cantilever's modes in it."""

from __future__ import annotations

import math
import warnings
from collections.abc import Sequence
from dataclasses import InitVar, dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from saltus import checks
from saltus.afm.probe.beam import wavenumbers
from saltus.afm.probe.cantilever import Cantilever
from saltus.afm.probe.hydrodynamic import REYNOLDS, hydrodynamic_function
from saltus.afm.probe.probe import MOST_MODES, Probe
from saltus.afm.probe.units import NONE_INSISTS, QUANTITIES, checked
from saltus.errors import InputError

__all__ = ["Fluid", "FluidMode", "fluid_modes", "immersed"]

_SLOWEST = 1e-6  # frequency in a fluid over that in vacuum, at least
_WIDE = 1.0  # wavenumber of a mode times the width above which the flow along the beam counts
_STEEP = 1e-12  # relative accuracy of frequencies


@dataclass(frozen=True, kw_only=True)
class Fluid:
    """A fluid by its density and its viscosity.

    Parameters
    ----------
    density_kg_m3 : float
        Density, in kg/m^3.
    viscosity_Pa_s : float
        Dynamic viscosity, in Pa s.
    check : bool, optional
        Whether implausible values are refused.

    Raises
    ------
    InputError
        A value is not positive or, with `check`, not plausible.

    Examples
    --------
    >>> Fluid.water()
    Fluid(density_kg_m3=997.05, viscosity_Pa_s=0.00089)
    >>> Fluid(density_kg_m3=1.2, viscosity_Pa_s=18.0)
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: viscosity_Pa_s = 18.0: must be between 1e-06 and 10 Pa s; in mPa s? then it is 0.018 ...
    """

    density_kg_m3: float
    viscosity_Pa_s: float
    check: InitVar[bool] = True

    def __post_init__(self, check: bool) -> None:
        checks.flag("check", check)
        for name in ("density_kg_m3", "viscosity_Pa_s"):
            object.__setattr__(self, name, checked(name, getattr(self, name), plausible=check))

    @classmethod
    def air(cls) -> Fluid:
        """Return air at 25 degrees C and 1 atm, with the values of Sader, Chon and Mulvaney (1999).

        Examples
        --------
        >>> Fluid.air().density_kg_m3
        1.18
        """
        return cls(density_kg_m3=1.18, viscosity_Pa_s=1.86e-5)

    @classmethod
    def water(cls) -> Fluid:
        """Return water at 25 degrees C.

        Examples
        --------
        >>> Fluid.water().viscosity_Pa_s
        0.00089
        """
        return cls(density_kg_m3=997.05, viscosity_Pa_s=8.9e-4)

    def reynolds(self, f_kHz: float, width_um: float) -> float:
        """Return the Reynolds number of a beam that oscillates in the fluid, ``rho omega b**2 / (4 eta)``.

        Parameters
        ----------
        f_kHz : float
            Frequency, in kHz.
        width_um : float
            The beam's width, in um.

        Returns
        -------
        float

        Raises
        ------
        InputError
            A value is not positive.

        Examples
        --------
        >>> print(f"{Fluid.water().reynolds(10.0, 30.0):.2f}")
        15.84
        """
        f, width = checks.positive("f_kHz", f_kHz, "kHz"), checks.positive("width_um", width_um, "um")
        return self.density_kg_m3 * math.tau * f * 1e3 * (width * 1e-6) ** 2 / (4.0 * self.viscosity_Pa_s)


class FluidMode(NamedTuple):
    """A mode of a cantilever in a fluid.

    Examples
    --------
    >>> from saltus import afm
    >>> lever = afm.Cantilever(length=197e-6, width=29e-6, thickness=2e-6, density=2320.0, young=169e9)
    >>> mode = afm.fluid_modes(lever, afm.Fluid.water(), 1)[0]
    >>> round(mode.f0_kHz, 2), round(mode.Q, 2)
    (24.51, 3.49)
    """

    f0_kHz: float  # natural frequency with the fluid's added mass, in kHz
    Q: float  # quality factor by the fluid's drag
    added_mass: float  # mass of the fluid that moves along, over the beam's
    reynolds: float  # Reynolds number at `f0_kHz`


def fluid_modes(
    cantilever: Cantilever,
    fluid: Fluid,
    modes: int = 1,
    *,
    plan_um: tuple[float, float] | None = None,
    gap_um: float | None = None,
    measured_in: Fluid | None = None,
) -> tuple[FluidMode, ...]:
    """Return the modes of a uniform rectangular cantilever in a fluid.

    Each mode is an oscillator with the added mass ``pi/4 rho b**2 L Re(Gamma)`` and the drag of ``Im(Gamma)`` at its
    own frequency: ``omega = omega_vac / sqrt(1 + T Re(Gamma))`` and ``Q = (1/T + Re(Gamma)) / Im(Gamma)``, with T the
    mass of a cylinder of fluid about the beam over the beam's. Losses in the beam itself are not counted.

    Parameters
    ----------
    cantilever : Cantilever
        By geometry and material, or by measured values of its first mode.
    fluid : Fluid
        What is around it.
    modes : int, optional
        How many modes.
    plan_um : (float, float), optional
        Length and width, in um, of a measured cantilever.
    gap_um : float, optional
        Distance to a parallel wall, in um; the height of the tip, say. Without it no wall is near.
    measured_in : Fluid, optional
        Fluid in which a measured cantilever has its `f0`; vacuum without it.

    Returns
    -------
    tuple of FluidMode

    Raises
    ------
    InputError
        A value that is not allowed, or a Reynolds number or a gap where the hydrodynamic function is not known. Sizes
        do not suit the measured stiffness and frequency.

    Warns
    -----
    RuntimeWarning
        A mode's wavelength is so short that the flow along the beam counts, which the function leaves out.

    References
    ----------
    J. E. Sader, J. Appl. Phys. 84, 64 (1998), Eqs. (28), (31), (32); C. A. Van Eysden, J. E. Sader, J. Appl. Phys. 101,
    044908 (2007): flow along the beam.

    Examples
    --------
    >>> lever = Cantilever(length=197e-6, width=29e-6, thickness=2e-6, density=2320.0, young=169e9)
    >>> print(*(f"{mode.f0_kHz:.2f} kHz, Q {mode.Q:.2f}" for mode in fluid_modes(lever, Fluid.water(), 2)), sep="; ")
    24.51 kHz, Q 3.49; 168.81 kHz, Q 7.44
    """
    length, width = _sizes(cantilever, plan_um)
    checks.instance("fluid", fluid, Fluid)
    n = checks.count("modes", modes, 1, MOST_MODES)
    gap = None if gap_um is None else checks.positive("gap_um", gap_um, "um") / width
    beam = 4.0 * cantilever.mass
    vacuum = cantilever.f0 * 1e-3
    if measured_in is not None:
        checks.instance("measured_in", measured_in, Fluid)
        if cantilever.density is not None:
            raise InputError("measured_in", measured_in, "left out", "a beam given by geometry has its own density")
        there = measured_in.reynolds(vacuum, width)
        around = _around(measured_in, length, width)
        beam -= around * float(hydrodynamic_function(there).real)
        if not beam > 0.0:
            hint = "the fluid that moves along would be heavier than the beam"
            raise InputError("measured_in", measured_in, "a fluid that suits k, f0 and plan_um", hint)
        vacuum *= math.sqrt(4.0 * cantilever.mass / beam)
    b = wavenumbers(n)
    _warn_of_short_waves(b, width / length)
    ratio = _around(fluid, length, width) / beam
    return tuple(_mode(fluid, float(vacuum * (one / b[0]) ** 2), width, ratio, gap) for one in b)


def immersed(
    cantilever: Cantilever,
    fluid: Fluid,
    modes: int = 1,
    *,
    R_nm: float,
    tilt_deg: float = 0.0,
    plan_um: tuple[float, float] | None = None,
    gap_um: float | None = None,
    measured_in: Fluid | None = None,
) -> Probe:
    """Return the probe that a uniform rectangular cantilever is in a fluid.

    Stiffnesses and shapes are those of vacuum, frequencies and quality factors those of `fluid_modes`. Mass and drag
    of each mode are those at its natural frequency: far from it the fluid's load differs.

    Parameters
    ----------
    cantilever : Cantilever
        By geometry and material, or by measured values.
    fluid : Fluid
        What the cantilever is in.
    modes : int, optional
        Number of modes.
    R_nm : float
        Radius of the tip, in nm.
    tilt_deg : float, optional
        As `Probe.from_cantilever` takes it; the fluid's load is that of a beam parallel to the wall.
    plan_um, gap_um, measured_in : optional
        As for `fluid_modes`.

    Returns
    -------
    Probe

    Raises
    ------
    InputError
        As by `fluid_modes`, or no plausible probe. A mode with Q below 0.5 creeps back and does not swing; the hint
        says how a probe is made of it nevertheless.

    Examples
    --------
    >>> lever = Cantilever.from_measured(k=0.1, f0=38e3, Q=60.0)
    >>> air, water = Fluid.air(), Fluid.water()
    >>> probe = immersed(lever, water, R_nm=10.0, plan_um=(60.0, 25.0), measured_in=air)
    >>> print(f"{probe.f0_kHz[0]:.2f} kHz, Q {probe.Q[0]:.2f}, {probe.k_N_m[0]:.1f} N/m")
    13.09 kHz, Q 2.51, 0.1 N/m
    """
    found = fluid_modes(cantilever, fluid, modes, plan_um=plan_um, gap_um=gap_um, measured_in=measured_in)
    _check_swings(found)
    dry = Probe.from_cantilever(cantilever, R_nm=R_nm, modes=modes, Q=[1.0] * len(found), tilt_deg=tilt_deg)
    return replace(dry, f0_kHz=[one.f0_kHz for one in found], Q=[one.Q for one in found])


def _check_swings(modes: Sequence[FluidMode]) -> None:
    """Raise `InputError` where a mode is overdamped."""
    least = QUANTITIES["Q"].low
    for number, mode in enumerate(modes, 1):
        if least > mode.Q:
            allowed = f"at least {least:g} in mode {number}, below which a beam creeps back to rest and does not swing"
            hint = (
                "a thinner fluid, a wider gap or a stiffer beam has more; fluid_modes tells f0_kHz and Q, which"
                " afm.Probe(k_N_m=..., f0_kHz=..., Q=..., R_nm=..., check=False) takes nevertheless"
            )
            raise InputError("Q", mode.Q, allowed, hint)


def _sizes(cantilever: Cantilever, plan_um: tuple[float, float] | None) -> tuple[float, float]:
    """Return length and width of a cantilever, in um."""
    checks.instance("cantilever", cantilever, Cantilever)
    if cantilever.length is not None and cantilever.width is not None:
        if plan_um is not None:
            raise InputError("plan_um", plan_um, "left out", "a beam given by geometry has its own")
        return cantilever.length * 1e6, cantilever.width * 1e6
    if plan_um is None:
        raise InputError(
            "plan_um", plan_um, "given for a measured cantilever", "the fluid's load goes by its plan view"
        )
    allowed = "length and width, in um"
    if len(sizes := checks.listed("plan_um", plan_um, allowed, most=2)) != 2:
        raise InputError("plan_um", plan_um, allowed)
    length, width = sizes
    known = {"length_um": length, "width_um": width}
    found = [checked(name, value, insists=NONE_INSISTS) for name, value in known.items()]
    return found[0], found[1]


def _around(fluid: Fluid, length: float, width: float) -> float:
    """Return the mass of a cylinder of fluid about a beam, in kg; sizes are in um."""
    return 0.25 * math.pi * fluid.density_kg_m3 * (width * 1e-6) ** 2 * length * 1e-6


def _mode(fluid: Fluid, vacuum: float, width: float, ratio: float, gap: float | None) -> FluidMode:
    """Return the mode that has a frequency in vacuum, in kHz; `ratio` is the fluid's cylinder over the beam."""
    from scipy.optimize import brentq

    def load(logarithm: float) -> complex:
        reynolds = fluid.reynolds(vacuum * math.exp(logarithm), width)
        return complex(hydrodynamic_function(reynolds, gap))

    def excess(logarithm: float) -> float:
        return 2.0 * logarithm + math.log1p(ratio * load(logarithm).real)

    high = min(0.0, math.log(REYNOLDS[1] / fluid.reynolds(vacuum, width)) - _STEEP)
    if excess(high) < 0.0:
        told = f"above {REYNOLDS[1]:g} at {vacuum * math.exp(high):.4g} kHz"
        raise InputError("reynolds", told, f"up to {REYNOLDS[1]:g}", "the mode is too fast or the beam too wide")
    low = high - 0.5 * math.log1p(ratio * load(high).real)
    while excess(low) > 0.0:
        low = high + 2.0 * (low - high)
        if low < math.log(_SLOWEST):
            raise InputError("fluid", fluid, "one in which the cantilever oscillates", "it is too heavy or too viscous")
    root = high if low == high else float(brentq(excess, low, high, xtol=_STEEP, rtol=_STEEP))
    found = load(root)
    f0 = vacuum * math.exp(root)
    quality = (1.0 / ratio + found.real) / found.imag
    return FluidMode(f0, quality, ratio * found.real, fluid.reynolds(f0, width))


def _warn_of_short_waves(b: NDArray[np.float64], aspect: float) -> None:
    """Warn where the width is more than the inverse wavenumber of a mode."""
    short = [number for number, one in enumerate(b.tolist(), 1) if one * aspect > _WIDE]
    if short:
        numbers = ", ".join(map(str, short))
        warnings.warn(
            f"saltus: in modes {numbers} the flow along the beam counts: wavenumber times width is above {_WIDE:g}, and"
            " added mass and drag are too large, by 12 % or more (Van Eysden and Sader 2007)",
            RuntimeWarning,
            stacklevel=3,
        )
