"""What a model is made of, read from its definition: probe, law of force, drives, with the values of parameters."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from saltus.afm.model.modelling import suffix
from saltus.afm.model.readings import drives_of

if TYPE_CHECKING:
    from saltus.system import HybridSystem

__all__ = ["parts_of"]

_PLACE = ("Zc_nm", "f_kHz")  # parameters of neither probe, law nor drive
_OF_MODES = ("k_N_m", "f0_kHz", "Q")  # parameters of which each mode has one
_OF_DRIVES = ("A0_nm", "F0_nN", "Y_nm", "ratio", "phase_deg", "at_kHz")  # the same of drives


def parts_of(system: HybridSystem, values: Mapping[str, float]) -> dict[str, Any]:
    """Return probe, law and drives of a model as plain data.

    Parameters
    ----------
    system : HybridSystem
        A model of `saltus.afm.model`.
    values : mapping of str to float
        Parameters that are held; what is left out has no value.

    Returns
    -------
    dict of str to object
        ``probe`` has one number a mode, and the radius; ``law`` its parameters, and the force in each region as a
        formula; ``drive`` one entry a drive.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=150.0, R_nm=10.0)
    >>> system = afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=10.0), Zc_nm=20.0)
    >>> parts_of(system, system.parameters)["law"]["parameters"]
    {'E_GPa': 1.0}
    """
    modes = range(1, sum(re.fullmatch(r"z\d+_nm", name) is not None for name in system.states) + 1)
    probe: dict[str, Any] = {name: [values.get(name + suffix(i)) for i in modes] for name in _OF_MODES}
    drives = {
        number: {name: name + suffix(number) for name in _OF_DRIVES if name + suffix(number) in system.parameter_names}
        for number in drives_of(system)
    }
    taken = {*_PLACE, "R_nm", *(name + suffix(i) for name in _OF_MODES for i in modes)}
    taken |= {full for names in drives.values() for full in names.values()}
    return {
        "probe": probe | {"R_nm": values.get("R_nm")},
        "law": {
            "parameters": {name: values.get(name) for name in system.parameter_names if name not in taken},
            "force_nN": dict(system.outputs["force_nN"]),
        },
        "drive": [{name: values.get(full) for name, full in names.items()} for names in drives.values()],
    }
