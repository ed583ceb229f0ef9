"""A probe that excites itself: its own velocity takes the place of the drive's phase, as in frequency modulation."""

from __future__ import annotations

from saltus.afm.models.parts import parts_of
from saltus.afm.probe.units import checked, suffix
from saltus.errors import InputError
from saltus.system import HybridSystem

__all__ = ["excited_mode", "self_excited"]

_DRIVEN = "one drive of one mode at its natural frequency, as afm.Drive(A0_nm=10.0)"  # what a model must have
_WAVE = "cos(theta)"  # the drive's wave in the texts of a model


def excited_mode(system: HybridSystem) -> int:
    """Return the number of the mode that a model's only drive excites.

    Raises
    ------
    InputError
        The system is no model with one drive of one mode, given by the free amplitude at its natural frequency.
    """
    drives = parts_of(system).drives.parts
    first = drives[0]
    plain = first.A0_nm is not None and first.at == "f0" and not first.phase_deg
    if system.phase is None or len(drives) != 1 or not plain:
        raise InputError("system", system.name or system.unnamed, f"a model with {_DRIVEN}")
    return first.mode


def self_excited(system: HybridSystem, A_nm: float, *, check: bool = True) -> HybridSystem:
    """Return a model whose drive follows the velocity of the driven mode, as an autonomous hybrid system.

    In place of ``cos(theta)`` stands the mode's velocity over ``omega_0 A_nm``. The force leads the displacement by 90
    degrees, as an ideal phase shifter makes it. A motion with the amplitude `A_nm` feels the force of a drive with the
    free amplitude ``A0_nm``, which is now the excitation. Without losses in the sample it equals `A_nm`. At a fixed
    excitation the amplitude is not held: `frequency_shift` seeks the excitation.

    Parameters
    ----------
    system : HybridSystem
        A model of `saltus.afm.model` with one drive of one mode, given by its free amplitude.
    A_nm : float
        The amplitude of the driven mode at which the excitation is meant, in nm.
    check : bool, optional
        Whether an implausible `A_nm` is refused.

    Returns
    -------
    HybridSystem
        The states of the model, without a phase. Its parameters are those of the model without ``f_kHz``, and ``A_nm``.

    Raises
    ------
    InputError
        The system is no such model, or the amplitude is not positive or, with `check`, not plausible.

    References
    ----------
    H. Holscher, B. Gotsmann, W. Allers, U. D. Schwarz, H. Fuchs, R. Wiesendanger, Phys. Rev. B 64, 075402 (2001):
    self-excitation.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    >>> law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    >>> system = self_excited(afm.model(probe, law, afm.Drive(A0_nm=10.0), Zc_nm=14.0), 10.0)
    >>> system.phase is None, "f_kHz" in system.parameter_names
    (True, False)
    """
    number = excited_mode(system)
    amplitude = checked("A_nm", A_nm, plausible=check)
    definition = system.definition()
    for key, mode in definition["modes"].items():
        velocity = f"(({mode['field'][f'z{number}_nm']})/(0.002*pi*f0_kHz{suffix(number)}*A_nm))"
        mode["field"] = {name: rate.replace(_WAVE, velocity) for name, rate in mode["field"].items()}
        for texts in definition["outputs"].values():
            texts[key] = texts[key].replace(_WAVE, velocity)
    kept = {name: value for name, value in definition["parameters"].items() if name != "f_kHz"}
    changed = {
        "name": f"{definition['name']}, self-excited",
        "phase": None,
        "parameters": kept | {"A_nm": amplitude},
        "positive": [*(name for name in definition["positive"] if name != "f_kHz"), "A_nm"],
    }
    return HybridSystem.from_definition(definition | changed)
