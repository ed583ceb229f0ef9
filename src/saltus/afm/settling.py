"""Where a motion of a model settles: on a periodic orbit, or what it does instead, in words."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from typing import TYPE_CHECKING

import numpy as np

from saltus.afm.modelling import suffix
from saltus.errors import ConvergenceError, SaltusError, StiffnessError, shortened
from saltus.orbits import PeriodicOrbit, find_orbit
from saltus.sweeps import SweepOptions, run_sweep

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from saltus.system import HybridSystem

__all__ = ["described", "periods_of_patience", "settled", "starts_about", "stays_in_contact"]

_PATIENCE = 8.0  # periods in which a motion is given up, over those in which a free one falls to 1/e
_FEWEST = 500.0  # periods after which a motion is given up, at the least
_MOST = 200_000.0  # periods after which a motion is given up, at the most
_KEPT = 3000  # periods of which the kind of a motion without a period is told, at the most
_RADII = (0.5, 1.0)  # amplitudes of the starts, over the largest displacement
_ANGLES = 8  # phases of the starts for each amplitude
_LONGEST = 120  # characters of an orbit's path in words, at most
_COUNTED = {"form": "neck", "touch": "contact"}  # transitions that are counted in words


def settled(
    system: HybridSystem, parameters: Mapping[str, float], x0: ArrayLike, mode: str | None = None
) -> PeriodicOrbit | str:
    """Return the periodic orbit on which a motion settles, or what it does instead, in words.

    Parameters
    ----------
    system : HybridSystem
        A model of `saltus.afm.model`.
    parameters : mapping of str to float
        All its parameters.
    x0 : array_like
        Where the motion starts.
    mode : str, optional
        Mode there; by default the first that the state allows.

    Notes
    -----
    A motion that is on no orbit of up to 16 periods is named as a sweep names it, by `saltus.flow.motion_kind`.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=20.0, R_nm=10.0)
    >>> system = afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=10.0), Zc_nm=20.0)
    >>> found = settled(system, system.parameters, [0.0, 0.0])
    >>> print(found if isinstance(found, str) else round(found.max["z1_nm"], 6))
    10.0
    """
    patience = periods_of_patience(parameters)
    try:
        with suppress(ConvergenceError, StiffnessError):  # a sweep tells what it does instead
            return find_orbit(system, parameters, x0, mode, settle=patience)
    except SaltusError as error:
        return f"the motion is lost: {error}"
    if patience == _MOST:
        return f"the motion has not settled after {_MOST:.6g} periods"
    options = SweepOptions(mode=mode, discard=int(patience), keep=min(int(patience), _KEPT), workers=1)
    at = {name: value for name, value in parameters.items() if name != "Zc_nm"}
    try:
        motion = run_sweep(system, "Zc_nm", [parameters["Zc_nm"]], parameters=at, x0=x0, options=options).at(
            parameters["Zc_nm"]
        )
    except SaltusError as error:
        return f"the motion is lost: {error}"
    if not motion.period:
        lost = f"the motion is lost: {motion.reason}"
        return lost if motion.reason else f"the motion is {motion.label}"
    try:
        return find_orbit(system, parameters, motion.state, motion.mode, settle=1.0)
    except SaltusError:
        return f"the motion settles on {_periods(motion.period)}"


def periods_of_patience(parameters: Mapping[str, float]) -> float:
    """Return after how many periods of the drive a motion of a model that has not settled is given up.

    Examples
    --------
    >>> periods_of_patience({"f_kHz": 300.0, "f0_kHz": 300.0, "Q": 30000.0}) > 70000.0
    True
    """
    return min(max(_FEWEST, _PATIENCE * _decay(parameters)), _MOST)


def _decay(parameters: Mapping[str, float]) -> float:
    """Return in how many periods of the drive the free motion of the slowest mode falls to 1/e."""
    modes = [suffix(i) for i in range(1, len(parameters) + 1) if f"f0_kHz{suffix(i)}" in parameters]
    slowest = max(parameters[f"Q{end}"] / parameters[f"f0_kHz{end}"] for end in modes)
    return slowest * parameters["f_kHz"] / math.pi


def _periods(count: int) -> str:
    return f"a motion of period {count}"


def stays_in_contact(orbit: PeriodicOrbit) -> bool:
    """Return whether the tip of a model stays in one mode other than the first, as behind the static pull-in."""
    modes = {mode for mode, _ in orbit.signature}
    return orbit.system.mode_names[0] not in modes


def described(orbit: PeriodicOrbit) -> str:
    """Return an orbit in words: its period, its necks and contacts, its path.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=20.0, R_nm=10.0)
    >>> system = afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=10.0), Zc_nm=9.0)
    >>> described(settled(system, system.parameters, [0.0, 0.0]))
    'a motion of period 1 with 1 contact: far:touch -> contact:release'
    """
    events = [transition for _, transition in orbit.signature]
    counts = {word: events.count(name) for name, word in _COUNTED.items() if name in events}
    parts = [f"{count} {word}{'s' * (count > 1)}" for word, count in counts.items()]
    path = shortened(" -> ".join(f"{mode}:{transition}" for mode, transition in orbit.signature), _LONGEST)
    return f"{_periods(orbit.form.turns)}{' with ' * bool(parts)}{' and '.join(parts)}: {path}"


def starts_about(
    system: HybridSystem, parameters: Mapping[str, float], largest: float
) -> tuple[NDArray[np.float64], ...]:
    """Return initial states: rest, then motions of the first mode at two amplitudes and eight phases.

    Parameters
    ----------
    system : HybridSystem
        A model of `saltus.afm.model`.
    parameters : mapping of str to float
        All its parameters.
    largest : float
        The larger amplitude, in nm.
    """
    z, v = system.states.index("z1_nm"), system.states.index("v1_nm_us")
    omega = 2e-3 * math.pi * parameters["f_kHz"]
    angles = 2.0 * np.pi * np.arange(_ANGLES) / _ANGLES
    starts = np.zeros((1 + len(_RADII) * _ANGLES, len(system.states)))
    for k, radius in enumerate(_RADII):
        rows = slice(1 + k * _ANGLES, 1 + (k + 1) * _ANGLES)
        starts[rows, z] = radius * largest * np.cos(angles)
        starts[rows, v] = radius * largest * omega * np.sin(angles)
    return tuple(starts)
