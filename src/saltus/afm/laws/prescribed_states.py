"""Laws with states of their own along a prescribed motion: the periodic states, and the energy that a cycle costs."""

from __future__ import annotations

from typing import TYPE_CHECKING

from saltus.afm.laws.common_regions import Product, in_brackets, named, sum_of
from saltus.errors import InputError, SaltusError
from saltus.system import HybridSystem, Mode, Transition

if TYPE_CHECKING:
    from saltus.orbits.orbit import PeriodicOrbit

__all__ = ["energy_of_states_aJ"]

_OMEGA = "(0.002*pi*motion_f_kHz)"
_MOTION = {
    "D_nm": "(motion_Zc_nm + motion_A_nm*cos(theta))",
    "V_nm_us": f"(-motion_A_nm*{_OMEGA}*sin(theta))",
}


def energy_of_states_aJ(law: Product, Zc_nm: float, A_nm: float, f_kHz: float) -> float:
    """Return the energy that a law with states loses in a cycle of ``Zc + A cos(2 pi f t)``, once its states repeat.

    Parameters
    ----------
    Zc_nm, A_nm, f_kHz : float
        The motion.

    Returns
    -------
    float, in aJ

    Raises
    ------
    InputError
        The states do not come to repeat in each cycle.
    """
    regions = law.regions
    power = {
        key: _along(f"-{in_brackets(sum_of((one.force, one.impulse_force)))}*V_nm_us") for key, one in regions.items()
    }
    system = HybridSystem(
        law.states,
        {**law.parameters, "motion_Zc_nm": Zc_nm, "motion_A_nm": A_nm, "motion_f_kHz": f_kHz},
        {
            key: Mode(
                {name: _along(rate) for name, rate in one.states.items()},
                domain=_along(one.domain) if one.domain else None,
            )
            for key, one in regions.items()
        },
        [
            Transition(one.source, one.target, _along(f"D_nm - {in_brackets(one.level)}"), one.direction, name=one.name)
            for one in law.crossings
        ],
        phase=("theta", _OMEGA),
        outputs={"power_pW": power},
        name="law along a prescribed motion",
    )
    orbit = _settled(system, len(law.states))
    cycles = round(orbit.period * f_kHz * 1e-3)
    return orbit.observe("mean(power_pW)")["mean(power_pW)"] * orbit.period / cycles


def _settled(system: HybridSystem, states: int) -> PeriodicOrbit:
    from saltus.orbits.find import find_orbit

    try:
        return find_orbit(system, x0=[0.0] * states)
    except SaltusError as error:
        raise InputError("law", list(system.states), "a law whose states repeat in each cycle", str(error)) from error


def _along(text: str) -> str:
    return named(text, _MOTION)
