"""What a model was made of: probe, law of force and drives, kept with its definition as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from fractions import Fraction
from typing import Any, NamedTuple, NoReturn

from saltus import checks
from saltus.afm.laws.known import LAWS
from saltus.afm.laws.law import Law, Sum, Tabulated
from saltus.afm.models.older_models import is_older, plain_parts
from saltus.afm.probe.drive import Drive, Drives
from saltus.afm.probe.probe import Probe
from saltus.afm.probe.units import suffix
from saltus.errors import InputError
from saltus.system import HybridSystem

__all__ = [
    "Parts",
    "UnknownLaw",
    "check_model",
    "drive_values",
    "driven_mode",
    "is_model",
    "keep_parts",
    "kept",
    "parts_of",
    "values_of",
]

_KEY = "saltus.afm"  # of `HybridSystem.made_of`
_OF_MODES = ("k_N_m", "f0_kHz", "Q")  # fields of a probe of which each mode has one
_LAWS = {**LAWS, "Tabulated": Tabulated}


class Parts(NamedTuple):
    """What a model was made of."""

    probe: Probe  # the cantilever
    law: Law  # the force between tip and sample: one law, or a sum
    drives: Drives  # what keeps the cantilever swinging


@dataclass(frozen=True, kw_only=True)
class UnknownLaw(Law):
    """A law of somebody's own in a model from a file: its name and values are known, its formulas are not."""

    name: str  # name of its class
    values: Mapping[str, float]  # its parameters

    def __post_init__(self, check: bool) -> None:
        """Leave the values, which were checked when the model was made."""

    @property
    def parameters(self) -> dict[str, float]:
        """Names and values of the parameters."""
        return dict(self.values)

    @property
    def regions(self) -> NoReturn:
        """Raise `InputError`: the formulas stand where the law is defined, and in the model."""
        raise InputError("law", self.name, "one of saltus.afm", "make the model again from the law where it is defined")


def kept(probe: Probe, law: Law, drives: Drives) -> dict[str, Any]:
    """Return what a model is made of as plain data, for `HybridSystem`."""
    return {
        _KEY: {
            "probe": {one.name: getattr(probe, one.name) for one in fields(probe)},
            "law": [_plain_law(part) for part in law.parts],
            "drives": [_plain_drive(part) for part in drives.parts],
        }
    }


def _plain_law(law: Law) -> dict[str, Any]:
    if isinstance(law, UnknownLaw):
        return {"name": law.name, "values": dict(law.values)}
    values = {one.name: getattr(law, one.name) for one in fields(law)}
    plain = {
        name: value for name, value in values.items() if value is None or isinstance(value, str | int | float | tuple)
    }
    return {"name": type(law).__name__, "values": plain}


def _plain_drive(drive: Drive) -> dict[str, Any]:
    values = {one.name: getattr(drive, one.name) for one in fields(drive)}
    return values | {"ratio": str(Fraction(drive.ratio)) if drive.repeats else float(drive.ratio)}


def parts_of(system: HybridSystem) -> Parts:
    """Return the probe, the law and the drives of which a model was made.

    Values of parameters that are changed later, as along a curve, are not among them.

    Parameters
    ----------
    system : HybridSystem
        A model of `saltus.afm.model`, or what `feedback` or `self_excited` made of one.

    Returns
    -------
    Parts

    Raises
    ------
    InputError
        The system is no such model.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=150.0, R_nm=10.0)
    >>> system = afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=10.0), Zc_nm=20.0)
    >>> parts_of(system).law
    Hertz(E_GPa=1.0)
    >>> parts_of(system).probe == probe
    True
    """
    check_model(system, "system")
    if "_parts" not in vars(system):
        keep_parts(system, _made_again(system.made_of.get(_KEY) or plain_parts(system)))
    found: Parts = vars(system)["_parts"]
    return found


def _made_again(data: Mapping[str, Any]) -> Parts:
    """Return the objects that plain data describe; raise `InputError` where they describe none."""
    try:
        return _parts_in(data)
    except (AttributeError, KeyError, TypeError, ValueError, IndexError) as error:
        told = f"{type(error).__name__}: {error}"
        raise InputError(f"made_of[{_KEY!r}]", data, "as saltus.afm.model keeps it", told) from None


def _parts_in(data: Mapping[str, Any]) -> Parts:
    laws = tuple(
        _LAWS[one["name"]](**one["values"], check=False)
        if one["name"] in _LAWS
        else UnknownLaw(name=one["name"], values={k: v for k, v in one["values"].items() if checks.is_real(v)})
        for one in data["law"]
    )
    drives = []
    for one in data["drives"]:
        given = {name: value for name, value in one.items() if name not in ("repeats", "ratio")}
        drive = Drive(**given, ratio=one["ratio"] if one["repeats"] else 1, check=False)
        drives.append(drive if one["repeats"] else drive.at_any_ratio(one["ratio"]))
    law = laws[0] if len(laws) == 1 else Sum(laws=laws)
    return Parts(Probe(**data["probe"], check=False), law, Drives(tuple(drives)))


def keep_parts(system: HybridSystem, parts: Parts) -> None:
    """Let a model hold the objects of which it was made, as long as it lives."""
    vars(system)["_parts"] = parts


def drive_values(drive: Drive, number: int) -> dict[str, float]:
    """Return names, without its number, and values of the parameters that a drive gives a model."""
    values = dict([drive.size])
    if number > 1:
        values["ratio"] = float(Fraction(drive.ratio))
    if drive.phase_deg:
        values["phase_deg"] = drive.phase_deg
    if not isinstance(drive.at, str):
        values["at_kHz"] = float(drive.at)
    return values


def check_model(system: HybridSystem, argument: str) -> None:
    """Raise `InputError` where a system is none of `saltus.afm.model`."""
    checks.instance(argument, system, HybridSystem)
    if not is_model(system):
        raise InputError(argument, system.name or system.unnamed, "one of saltus.afm.model")


def is_model(system: HybridSystem) -> bool:
    """Return whether a system is one of `saltus.afm.model`, in nm and us.

    Examples
    --------
    >>> from saltus.afm import table1, tapping_mode
    >>> is_model(tapping_mode(table1()))
    False
    """
    return _KEY in system.made_of or is_older(system)


def driven_mode(system: HybridSystem) -> int:
    """Return which mode the first drive of a model acts on, from 1; the first of several."""
    first = parts_of(system).drives.parts[0]
    return 1 if first.A0_nm is None else first.mode


def values_of(system: HybridSystem, values: Mapping[str, float]) -> dict[str, Any]:
    """Return probe, law and drives of a model with the values of parameters, as plain data.

    Parameters
    ----------
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
    >>> values_of(system, system.parameters)["law"]["parameters"]
    {'E_GPa': 1.0}
    """
    parts = parts_of(system)
    modes = range(1, parts.probe.modes + 1)
    return {
        "probe": {name: [values.get(name + suffix(i)) for i in modes] for name in _OF_MODES}
        | {"R_nm": values.get("R_nm")},
        "law": {
            "parameters": {name: values.get(name) for name in parts.law.parameters if name != "R_nm"},
            "force_nN": dict(system.outputs["force_nN"]),
        },
        "drive": [
            {name: values.get(name + suffix(number)) for name in drive_values(drive, number)}
            for number, drive in enumerate(parts.drives.parts, 1)
        ],
    }
