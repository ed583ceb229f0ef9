"""A probe over a sample as a hybrid system in nm, nN and us: the probe's modes, a law of force, a drive."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from typing import TYPE_CHECKING, Any

from saltus import checks
from saltus.afm.laws.common_regions import Product, in_brackets, named, product, sum_of
from saltus.afm.laws.law import Law
from saltus.afm.models.parts import Parts, drive_values, keep_parts, kept
from saltus.afm.probe.drive import Drive, Drives
from saltus.afm.probe.probe import Probe
from saltus.afm.probe.units import check_drive_frequency, checked, quantity_of, suffix
from saltus.errors import InputError
from saltus.system import HybridSystem, Mode, Transition

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from saltus.afm.laws.regions import Region

__all__ = ["frequency_of", "model"]

_LEAST_Q = math.sqrt(0.5)  # quality factor from which on the response has a peak
_OMEGA = "0.002*pi"  # angular frequency per us of 1 kHz


def model(
    probe: Probe,
    law: Law,
    drive: Drive | Drives | Sequence[Drive],
    *,
    Zc_nm: float,
    f_kHz: float | str = "f0",
    check: bool = True,
) -> HybridSystem:
    """Return a driven probe over a sample as a hybrid system in nm, nN and us.

    States are the modes' displacements at the tip and their velocities, ``(z1_nm, ..., v1_nm_us, ...)``. Then come
    phases of drives that do not repeat (`Drive.at_any_ratio`), then the law's own states. Up is
    positive: the gap is ``Zc_nm`` and the displacements together, and a positive force repels. The phase ``theta``
    turns once in the period in which all other drives repeat. Hybrid modes are the law's regions.

    Parameters
    ----------
    probe : Probe
        The cantilever's modes, and the tip's radius.
    law : Law
        The force between tip and sample: one law, or a sum.
    drive : Drive, sum of drives or sequence of Drive
        What keeps the cantilever swinging. Drives of a sequence act at once, as those of a sum.
    Zc_nm : float
        Gap at rest, without forces, in nm; below 0 the cantilever is pressed into the sample.
    f_kHz : float or {"f0", "peak"}, optional
        Frequency of the first drive, in kHz. Or ``"f0"``, the natural frequency of the mode that it drives, or
        ``"peak"``, where a constant force makes the largest free amplitude of this mode.
    check : bool, optional
        Whether an implausible `Zc_nm` or `f_kHz` is refused.

    Returns
    -------
    HybridSystem
        Its parameters are ``Zc_nm``, ``f_kHz``, those of the drive (``A0_nm``, ``F0_nN`` or ``Y_nm``), of the probe
        (``k_N_m``, ``f0_kHz``, ``Q``, ``R_nm``) and of the law (``H_aJ``, ...). Those of further modes and drives end
        with their number, as ``Q_2``. The ratio of a further drive, ``ratio_2``, cannot be changed where it repeats.

        Outputs:

        ==================  ==========================================================================================
        ``D_nm``            gap
        ``force_nN``        force on the tip
        ``elastic_nN``      its part that does not depend on the gap's rate
        ``deflection_nm``   what light shows that the cantilever reflects, in nm of the first mode
        ``indentation_nm``  depth of indentation, 0 out of contact; for laws with contact
        ``contact``         1 in contact, else 0; for laws with contact
        ``drive_pW``        power that the drive puts in
        ``medium_pW``       power that the modes' own damping takes
        ``sample_pW``       power that the sample takes
        ``virial_aJ``       force times the tip's displacement
        ``drive_nN``        force of the drives on the mode that the first one drives, inertia of a shaken base among it
        ==================  ==========================================================================================

    Raises
    ------
    InputError
        An argument is of another kind, a value is not allowed or, with `check`, not plausible. The law lacks a
        parameter, or the drive a mode.

    References
    ----------
    R. Garcia, R. Perez, Surf. Sci. Rep. 47, 197 (2002); J. R. Lozano, R. Garcia, Phys. Rev. B 79, 014110 (2009):
    several modes, each with its drive.

    Examples
    --------
    >>> from saltus import afm, find_orbit
    >>> probe = afm.Probe(k_N_m=40.0, f0_kHz=300.0, Q=300.0, R_nm=10.0)
    >>> law = afm.VanDerWaals(H_aJ=0.2, a0_nm=0.3) + afm.DMT(E_GPa=1.09)
    >>> system = model(probe, law, afm.Drive(A0_nm=10.0), Zc_nm=8.5)
    >>> system.states, system.mode_names, system.transition_names
    (('z1_nm', 'v1_nm_us'), ('far', 'contact'), ('touch', 'release'))
    >>> system.parameter_names
    ('Zc_nm', 'f_kHz', 'A0_nm', 'k_N_m', 'f0_kHz', 'Q', 'H_aJ', 'a0_nm', 'E_GPa', 'R_nm')
    """
    checks.instance("probe", probe, Probe)
    checks.instance("law", law, Law)
    drives = _drives(drive)
    checks.flag("check", check)
    gap = checked("Zc_nm", Zc_nm, plausible=check)
    for part in drives.parts:
        if part.mode > probe.modes:
            raise InputError("mode", part.mode, f"a mode of the probe, up to {probe.modes}")
    f = checked("f_kHz", _frequency(probe, drives.parts[0].mode, f_kHz), plausible=check)
    if check:
        own = [float(value) for value in probe.f0_kHz]  # type: ignore[union-attr]
        check_drive_frequency("f_kHz", f, own)
        for part in drives.parts:
            if not isinstance(part.at, str):
                check_drive_frequency("at of a drive", part.at, own)
    writing = _Writing(probe, product(law.parts, probe.R_nm), drives, {"Zc_nm": gap, "f_kHz": f})
    system = HybridSystem(**writing.definition, made_of=kept(probe, law, drives))
    keep_parts(system, Parts(probe, law, drives))
    return system


def _drives(drive: object) -> Drives:
    """Return one drive, their sum or a sequence of them as drives that act at once."""
    if isinstance(drive, Drive | Drives):
        return Drives(drive.parts)
    if isinstance(drive, list | tuple) and drive and all(isinstance(one, Drive) for one in drive):
        return Drives(tuple(drive))
    raise InputError("drive", drive, "a Drive, a sum of them, or a sequence of them", "as Drive(A0_nm=10.0)")


def _frequency(probe: Probe, mode: int, f_kHz: float | str) -> Any:
    return frequency_of(f_kHz, list(probe.f0_kHz)[mode - 1], list(probe.Q)[mode - 1])  # type: ignore[arg-type]


def frequency_of(f_kHz: float | str, f0: float, Q: float) -> Any:
    """Return a frequency that is given as a number, or as ``"f0"`` or ``"peak"`` of a mode."""
    if not isinstance(f_kHz, str):
        return f_kHz
    if checks.chosen("f_kHz", f_kHz, ("f0", "peak"), instead=", or a number of kHz") == "f0":
        return f0
    return f0 * math.sqrt(_has_peak(Q) - 0.5 / Q**2)


def _has_peak(Q: float) -> float:
    """Return 1 where the response of a quality factor has a peak; raise `InputError` where it has none."""
    if Q <= _LEAST_Q:
        raise InputError("Q", Q, "above sqrt(1/2), where the response has a peak")
    return 1.0


@dataclass(frozen=True)
class _Writing:
    """The texts of a model."""

    probe: Probe
    law: Product
    drives: Drives
    place: Mapping[str, float]

    @property
    def definition(self) -> dict[str, Any]:
        n = self.probe.modes
        regions = self.law.regions
        values = self.parameters
        signs = {name: quantity.sign for name in values if (quantity := quantity_of(name)) is not None}
        touching = any(region.indentation for region in regions.values())
        outputs = {key: self.outputs(region, touching) for key, region in regions.items()}
        return {
            "states": (*self.z, *self.v, *self.free_phases, *self.law.states),
            "angles": tuple(self.free_phases),
            "parameters": values,
            "modes": {key: Mode(self.field(region), domain=self.domain(region)) for key, region in regions.items()},
            "transitions": [
                Transition(
                    crossing.source,
                    crossing.target,
                    f"{self.gap} - {self.meant(crossing.level)}" if crossing.level != "0" else self.gap,
                    crossing.direction,
                    name=crossing.name,
                )
                for crossing in self.law.crossings
            ],
            "phase": ("theta", f"{_OMEGA}*f_kHz" + (f"/{self.drives.turns}" if self.drives.turns > 1 else "")),
            "outputs": {
                name: {key: texts[name] for key, texts in outputs.items()} for name in next(iter(outputs.values()))
            },
            "positive": [name for name, sign in signs.items() if sign == "+" or name in self.law.positive],
            "parameter_bounds": {
                **{name: (0.0, math.inf) for name, sign in signs.items() if sign == "0+"},
                **{f"Q{suffix(part.mode)}": (_LEAST_Q, math.inf) for part in self.drives.parts if part.at == "peak"},
                **{
                    f"ratio_{number}": (values[f"ratio_{number}"],) * 2 if part.repeats else (0.0, math.inf)
                    for number, part in enumerate(self.drives.parts[1:], 2)
                },
            },
            "name": f"tip and sample, {n} {'mode' if n == 1 else 'modes'}",
        }

    @property
    def z(self) -> list[str]:
        return [f"z{i}_nm" for i in range(1, self.probe.modes + 1)]

    @property
    def v(self) -> list[str]:
        return [f"v{i}_nm_us" for i in range(1, self.probe.modes + 1)]

    @property
    def free_phases(self) -> list[str]:
        """Phases of the drives that do not repeat with the first one."""
        return [f"theta_{number}" for number, part in enumerate(self.drives.parts, 1) if not part.repeats]

    @property
    def parameters(self) -> dict[str, float]:
        values = dict(self.place)
        for number, part in enumerate(self.drives.parts, 1):
            values |= {name + suffix(number): value for name, value in drive_values(part, number).items()}
        for name in ("k_N_m", "f0_kHz", "Q"):
            for number, value in enumerate(getattr(self.probe, name), 1):
                values[name + suffix(number)] = value
        if taken := set(values) & set(self.law.parameters):
            raise InputError("law", sorted(taken), "without names of the probe and the drive")
        return values | dict(self.law.parameters)

    def wave(self, number: int, function: str) -> str:
        """``cos`` or ``sin`` of a drive's phase."""
        part = self.drives.parts[number - 1]
        order = int(Fraction(part.ratio) * self.drives.turns)
        angle = "theta" if order == 1 else f"{order}*theta"
        angle = angle if part.repeats else f"theta_{number}"
        return f"{function}({angle}{f' + pi/180*phase_deg{suffix(number)}' if part.phase_deg else ''})"

    def omega(self, number: int) -> str:
        """Angular frequency of a drive."""
        part = self.drives.parts[number - 1]
        ratio = Fraction(part.ratio)
        if not part.repeats:
            return f"({_OMEGA}*f_kHz*ratio_{number})"
        return f"({_OMEGA}*f_kHz)" if ratio == 1 else f"({_OMEGA}*f_kHz*{ratio.numerator}/{ratio.denominator})"

    @cached_property
    def shaken(self) -> list[int]:
        """The drives that move the base."""
        return [number for number, part in enumerate(self.drives.parts, 1) if part.Y_nm is not None]

    @property
    def gap(self) -> str:
        base = [f" + Y_nm{suffix(number)}*{self.wave(number, 'cos')}" for number in self.shaken]
        return f"(Zc_nm + {' + '.join(self.z)}{''.join(base)})"

    @property
    def base_rate(self) -> str:
        terms = [f"Y_nm{suffix(number)}*{self.omega(number)}*{self.wave(number, 'sin')}" for number in self.shaken]
        return f"-({' + '.join(terms)})"

    def velocities(self, region: Region) -> list[str]:
        """Rates of the displacements."""
        if region.impulse == "0":
            return self.v
        impulse = self.meant(region.impulse)
        return [f"({v} + {self.own(i)}**2/k_N_m{suffix(i)}*{impulse})" for i, v in enumerate(self.v, 1)]

    def meant(self, text: str, region: Region | None = None) -> str:
        """A law's text in the names of the model; the gap's rate is known in a region only."""
        meanings = {"D_nm": self.gap}
        if region is not None:
            rates = [*self.velocities(region), *([self.base_rate] if self.shaken else [])]
            meanings["V_nm_us"] = " + ".join(rates)
        return in_brackets(named(text, meanings))

    @staticmethod
    def own(i: int) -> str:
        """Natural angular frequency of a mode."""
        return f"({_OMEGA}*f0_kHz{suffix(i)})"

    def driving(self, i: int) -> str:
        """Force of the drives on a mode, their inertia among it."""
        end = suffix(i)
        terms = []
        for number, part in enumerate(self.drives.parts, 1):
            name = part.size[0] + suffix(number)
            if part.A0_nm is not None and part.mode == i:
                terms.append(f"k_N_m{end}*{name}/Q{end}{self.at(number, i)}*{self.wave(number, 'cos')}")
            elif part.F0_nN is not None:
                terms.append(f"{name}*{self.wave(number, 'cos')}")
            elif part.Y_nm is not None:
                weight = list(self.probe.base_weights or ())[i - 1]
                mass = f"k_N_m{end}/{self.own(i)}**2"
                terms.append(
                    f"{in_brackets(repr(weight))}*{mass}*{self.omega(number)}**2*{name}*{self.wave(number, 'cos')}"
                )
                if part.fluid == "rests":
                    drag = f"k_N_m{end}/({self.own(i)}*Q{end})"
                    terms.append(
                        f"{in_brackets(repr(weight))}*{drag}*{self.omega(number)}*{name}*{self.wave(number, 'sin')}"
                    )
        return in_brackets(sum_of(terms))

    def at(self, number: int, i: int) -> str:
        """Factor of the force, where the free amplitude is meant at another frequency than the natural one."""
        part, end = self.drives.parts[number - 1], suffix(i)
        if part.at == "f0":
            return ""
        if part.at == "peak":
            _has_peak(list(self.probe.Q)[i - 1])  # type: ignore[arg-type]
            return f"*sqrt(1 - 1/(4*Q{end}**2))"
        ratio = f"(at_kHz{suffix(number)}/f0_kHz{end})"
        return f"*Q{end}*sqrt((1 - {ratio}**2)**2 + {ratio}**2/Q{end}**2)"

    def field(self, region: Region) -> dict[str, str]:
        force = self.meant(region.force, region)
        rates = dict(zip(self.z, self.velocities(region), strict=True))
        for i, (z, v, velocity) in enumerate(zip(self.z, self.v, self.velocities(region), strict=True), 1):
            end, own = suffix(i), self.own(i)
            forces = in_brackets(sum_of((force, self.driving(i))))
            rates[v] = f"{own}**2*({forces}/k_N_m{end} - {z}) - {own}/Q{end}*{velocity}"
        rates |= {name: self.omega(int(name.removeprefix("theta_"))) for name in self.free_phases}
        return rates | {name: self.meant(rate, region) for name, rate in region.states.items()}

    def domain(self, region: Region) -> str | None:
        return self.meant(region.domain) if region.domain else None

    def outputs(self, region: Region, touching: bool) -> dict[str, str]:
        velocities = self.velocities(region)
        force = self.meant(sum_of((region.force, region.impulse_force)), region)
        driven = [f"{self.driving(i)}*{velocity}" for i, velocity in enumerate(velocities, 1)]
        if self.shaken:
            driven.append(f"{force}*({self.base_rate})*(-1)")
        drag = [f"k_N_m{suffix(i)}/({self.own(i)}*Q{suffix(i)})*{one}**2" for i, one in enumerate(velocities, 1)]
        weights = list(self.probe.optical_weights or ())
        contact = {
            "indentation_nm": self.meant(region.indentation or "0"),
            "contact": "1" if region.indentation else "0",
        }
        return {
            "D_nm": self.gap,
            "force_nN": force,
            "elastic_nN": self.meant(region.elastic or "0", region),
            "deflection_nm": sum_of(
                z if weight == 1.0 else f"{weight!r}*{z}" for weight, z in zip(weights, self.z, strict=True)
            ),
            **(contact if touching else {}),
            "drive_pW": " + ".join(driven),
            "medium_pW": " + ".join(drag),
            "sample_pW": f"-{force}*{self.meant('V_nm_us', region)}",
            "virial_aJ": f"{force}*({self.gap} - Zc_nm)",
            "drive_nN": self.driving(self.drives.parts[0].mode),
        }
