"""Distance curves and frequency curves of a model, from afar over all folds."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.curve import Curve
from saltus.afm.modelling import suffix
from saltus.afm.readings import check_model, drives_of
from saltus.afm.routes import stays_in_contact
from saltus.continuation import Branch, StepControl, continue_orbit
from saltus.errors import ConvergenceError, InputError
from saltus.orbits import PeriodicOrbit, find_orbit, solve_orbit

if TYPE_CHECKING:
    from saltus.progress import Report
    from saltus.system import HybridSystem

__all__ = ["distance_curve", "far_orbit", "frequency_curve"]

_CLEAR = 3.0  # gap of the far start, over the free amplitude
_MOST_SHEETS = 8  # sheets that are sought beyond the first ones
_CLEAR_NM = 20.0  # least gap of the far start, in nm


def distance_curve(
    system: HybridSystem,
    bounds: tuple[float, float],
    *,
    f_kHz: float | str | None = None,
    parameters: Mapping[str, float] | None = None,
    of: str | int = "deflection",
    steps: StepControl | None = None,
    progress: bool | Report = False,
) -> Curve:
    """Return the readings of a model along the distance ``Zc_nm``, from afar over all folds."""
    check_model(system, "system")
    low, high = checks.interval("bounds", bounds)
    p = _at_frequency(system, system.resolve(parameters), f_kHz)
    start = far_orbit(system, p, high)
    if start.parameters["Zc_nm"] > high:
        way = continue_orbit(start, "Zc_nm", (high, start.parameters["Zc_nm"]), steps=steps, directions="down")
        starts = way.at(high)
    else:
        starts = (start,)
    return _traced(system, "Zc_nm", (low, high), starts, of, steps, progress)


def frequency_curve(
    system: HybridSystem,
    bounds: tuple[float, float],
    *,
    Zc_nm: float | None = None,
    parameters: Mapping[str, float] | None = None,
    of: str | int = "deflection",
    steps: StepControl | None = None,
    progress: bool | Report = False,
) -> Curve:
    """Return the readings of a model along the frequency ``f_kHz`` of its drive, over all folds."""
    check_model(system, "system")
    low, high = checks.interval("bounds", bounds)
    p = system.resolve(parameters) | ({} if Zc_nm is None else {"Zc_nm": Zc_nm})
    p |= {"f_kHz": low}
    start = far_orbit(system, p, p["Zc_nm"])
    if start.parameters["Zc_nm"] > p["Zc_nm"]:
        way = continue_orbit(start, "Zc_nm", (p["Zc_nm"], start.parameters["Zc_nm"]), steps=steps, directions="down")
        starts = way.at(p["Zc_nm"])
    else:
        starts = (start,)
    return _traced(system, "f_kHz", (low, high), starts, of, steps, progress)


def far_orbit(system: HybridSystem, parameters: Mapping[str, float], Zc_nm: float) -> PeriodicOrbit:
    """Return the free motion at a distance, or further away where the tip would come near the sample."""
    p = dict(parameters)
    free = free_amplitude(system, p)
    p["Zc_nm"] = max(Zc_nm, _CLEAR * free, free + _CLEAR_NM)
    n = sum(name.startswith("z") and name.endswith("_nm") for name in system.states)
    speed = 2e-3 * math.pi * p["f_kHz"] * free
    x0 = np.zeros(len(system.states))
    x0[n] = speed
    assert system.phase is not None
    rate = float(system.field(system.mode_names[0], x0, p)[-1])
    first = system.mode_names[0]
    try:
        return solve_orbit(system, p, [(first, system.phase[0], x0, 2.0 * math.pi / rate)])
    except ConvergenceError:
        return find_orbit(system, p, x0)


def free_amplitude(system: HybridSystem, parameters: Mapping[str, float]) -> float:
    """Return the sum of the drives' amplitudes at resonance, in nm: no free motion is larger."""
    total = 0.0
    for number in drives_of(system):
        end = suffix(number)
        stiffness, quality = parameters["k_N_m"], parameters["Q"]
        total += abs(parameters.get(f"A0_nm{end}", 0.0))
        total += abs(parameters.get(f"F0_nN{end}", 0.0)) / stiffness * max(quality, 1.0)
        total += abs(parameters.get(f"Y_nm{end}", 0.0)) * (1.0 + 1.6 * max(quality, 1.0))
    return total


def _at_frequency(system: HybridSystem, p: dict[str, float], f_kHz: float | str | None) -> dict[str, float]:
    if f_kHz is None:
        return p
    if f_kHz == "f0":
        return p | {"f_kHz": p["f0_kHz"]}
    if f_kHz == "peak":
        return p | {"f_kHz": p["f0_kHz"] * math.sqrt(1.0 - 0.5 / p["Q"] ** 2)}
    return p | {"f_kHz": checks.positive("f_kHz", f_kHz, "kHz")}


def _traced(
    system: HybridSystem,
    along: str,
    bounds: tuple[float, float],
    starts: tuple[PeriodicOrbit, ...],
    of: str | int,
    steps: StepControl | None,
    progress: bool | Report,
) -> Curve:
    branches: list[Branch] = []
    for start in starts:
        if not any(_is_on(branch, start) for branch in branches):
            branches.append(continue_orbit(start, along, bounds, steps=steps, progress=progress))
    curve, tried = Curve(system, along, bounds, tuple(branches), of), set[float]()
    for _ in range(_MOST_SHEETS):
        lost = [way.beyond for way in curve.ways if way.beyond is not None and way.beyond.value not in tried]
        found = next((landing for landing in lost if not stays_in_contact(landing.after)), None)
        if found is None:
            return curve
        tried.add(found.value)
        sheet = continue_orbit(found.after, along, bounds, steps=steps, progress=progress)
        curve = Curve(system, along, bounds, (*curve.branches, sheet), of)
    return curve


def _is_on(branch: Branch, orbit: PeriodicOrbit) -> bool:
    value, n = orbit.parameters[branch.parameter], len(orbit.system.states)
    try:
        found = branch.at(value)
    except InputError:
        return False
    wanted = np.concatenate([orbit.lows[:n], orbit.highs[:n]])
    return any(np.allclose(np.concatenate([o.lows[:n], o.highs[:n]]), wanted, rtol=1e-6) for o in found)
