"""A cantilever's spring constant by Sader's method, and the factors between static and modal stiffness."""

from __future__ import annotations

import math

from saltus import checks
from saltus.afm.probe.beam import wavenumbers
from saltus.afm.probe.fluid import Fluid
from saltus.afm.probe.hydrodynamic import hydrodynamic_function
from saltus.afm.probe.probe import MOST_MODES
from saltus.afm.probe.tip_mass import modes_with_mass
from saltus.afm.probe.units import checked, other_unit
from saltus.errors import InputError

__all__ = ["BOLTZMANN_AJ_K", "modal_over_static", "optical_chi", "sader_stiffness"]

BOLTZMANN_AJ_K = 1.380649e-5  # aJ/K, by the definition of the SI
_FASTEST_M_S = 300.0  # frequency times length of a first mode, at most; a quartz fork has 80 m/s
_SLOWEST_M_S = 0.1  # the same at the least; a soft lever in a liquid has 0.4 m/s
_STATIC_SLOPE = 1.5  # slope at the end of a beam bent by a force there, over the displacement, times the length


def sader_stiffness(
    f0_kHz: float, Q: float, *, length_um: float, width_um: float, fluid: Fluid, mode: int = 1, check: bool = True
) -> float:
    """Return the static spring constant of a rectangular cantilever by Sader's method.

    A mode's resonance in a fluid of known density and viscosity tells the fluid's drag, and so the stiffness. For the
    first mode it is ``0.1906 rho b**2 L Q Im(Gamma) omega**2``. A probe's modal stiffness is 1.0302 times as large.

    Parameters
    ----------
    f0_kHz : float
        Natural frequency in the fluid, in kHz.
    Q : float
        Quality factor there.
    length_um, width_um : float
        Length and width of the beam, in um.
    fluid : Fluid
        What the resonance was measured in.
    mode : int, optional
        Number of the mode, from 1.
    check : bool, optional
        Whether implausible values are refused.

    Returns
    -------
    float, in N/m

    Raises
    ------
    InputError
        A value that is not allowed or, with `check`, not plausible, as a beam wider than long. A frequency that no beam
        of that length has. A Reynolds number outside 1e-6 to 1e4.

    References
    ----------
    J. E. Sader, J. W. M. Chon, P. Mulvaney, Rev. Sci. Instrum. 70, 3967 (1999), Eq. (3); the factor of mode n is
    ``3 pi / (4 alpha_n**4)``.

    Examples
    --------
    >>> k = sader_stiffness(17.36, 55.5, length_um=397.0, width_um=29.0, fluid=Fluid.air())  # first row of their table
    >>> print(f"{k:.4f}")
    0.1573
    """
    f0, quality = checked("f0_kHz", f0_kHz, plausible=check), checked("Q", Q, plausible=check)
    length = checked("length_um", length_um, plausible=check) * 1e-6
    width = checked("width_um", width_um, plausible=check)
    if check:
        check_plan(length_um, width_um)
    checks.instance("fluid", fluid, Fluid)
    b = float(wavenumbers(checks.count("mode", mode, 1, MOST_MODES))[-1])
    if check:
        _check_length(f0, length, (b / float(wavenumbers(1)[0])) ** 2)
    drag = float(hydrodynamic_function(fluid.reynolds(f0, width)).imag)
    omega = math.tau * f0 * 1e3
    moved = 0.25 * math.pi * fluid.density_kg_m3 * (width * 1e-6) ** 2 * length
    return 3.0 / b**4 * moved * quality * drag * omega * omega


def _check_length(f0_kHz: float, length_m: float, ratio: float) -> None:
    """Raise `InputError` where no beam of a length has a frequency; `ratio` is that of the mode's to the first's.

    ``f0 L`` is 0.16 times the speed of sound in the beam times its thickness over its length.
    """
    unit = 1e-3 * ratio / length_m  # kHz in 1 m/s
    low, high = _SLOWEST_M_S * unit, _FASTEST_M_S * unit
    if not low <= f0_kHz <= high:
        slip = other_unit("kHz", [f0_kHz], lambda one: low <= one[0] <= high)
        allowed = f"between {low:.3g} and {high:.3g} kHz for a beam of {length_m * 1e6:g} um"
        raise InputError("f0_kHz", f0_kHz, allowed, f"{slip}check=False insists")


def check_plan(length_um: float, width_um: float) -> None:
    """Raise `InputError` where a beam is wider than long."""
    if width_um > length_um:
        raise InputError("width_um", width_um, f"at most the length of {length_um:g} um", "are both swapped?")


def modal_over_static(mode: int = 1) -> float:
    """Return a mode's stiffness over the static one: ``alpha**4 / 12``, the inverse of 0.971 for the first.

    Examples
    --------
    >>> round(1.0 / modal_over_static(), 4)
    0.9707
    """
    return float(wavenumbers(mode)[-1]) ** 4 / 12.0


def optical_chi(mode: int = 1) -> float:
    """Return by what the deflection that reflected light shows of a mode is less than its displacement.

    The scale of the light was set by pressing on the sample: slopes are those of a static bend.

    Examples
    --------
    >>> round(optical_chi(), 4)
    1.0897
    """
    return _STATIC_SLOPE / abs(modes_with_mass(mode)[-1].slope)
