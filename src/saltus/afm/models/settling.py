"""Where a motion of a model settles: on a periodic orbit, or what it does instead, in words."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.afm.probe.units import suffix
from saltus.errors import ConvergenceError, SaltusError, StiffnessError, shortened
from saltus.flow.poincare import PoincareReturns, iterate
from saltus.flow.starting import starting_mode
from saltus.flow.taylor import ORDER
from saltus.orbits import PeriodicOrbit, find_orbit
from saltus.sweeps import SweepOptions, run_sweep

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.checks.states import StateLike
    from saltus.system import HybridSystem

__all__ = [
    "Known",
    "described",
    "periods_of_decay",
    "periods_of_patience",
    "recurs",
    "settled",
    "settled_orbit",
    "starts_about",
    "stays_in_contact",
]

_PATIENCE = 8.0  # periods in which a motion is given up, over those in which a free one falls to 1/e
_FEWEST = 500.0  # periods after which a motion is given up, at the least
_MOST = 200_000.0  # periods after which a motion is given up, at the most
_KEPT = 3000  # periods of which the kind of a motion without a period is told, at the most
_BATCH = 40  # periods after which a motion is first looked at
_LONGER = 1.5  # periods until it is looked at again, over those before
_AGAIN = 3.0  # periods over those of patience, as the Poincare map takes little time
_TOLERANCE = (1e-7, 1e-9)  # of steps on the way; the orbit is solved for anew
_UNSETTLED = "the motion is quasi-periodic or chaotic, or its period is above 16, or it settles slowly"
_TURNS = 16  # periods of the longest orbit that is looked for
_CLOSE = (
    1e-2  # distance of returns from those of an orbit, in the states' sizes, to which a motion comes that settles on it
)
_NEAR = 1e-4  # distance of two returns, in the states' sizes, from which an orbit is sought
_NEARER = 0.1  # distance of returns at which an orbit is sought again, over that before
_NOTHING = 1e-6  # size of a state, over the largest one, below which it does not count
_RADII = (0.5, 1.0)  # amplitudes of the starts, over the largest displacement
_ANGLES = 8  # phases of the starts for each amplitude
_LONGEST = 120  # characters of an orbit's path in words, at most
_COUNTED = {"form": "neck", "touch": "contact"}  # transitions that are counted in words


class Known(NamedTuple):
    """A stable orbit and its states at phase 0, shape (turn, states)."""

    orbit: PeriodicOrbit
    section: NDArray[np.float64]

    @classmethod
    def of(cls, orbit: PeriodicOrbit) -> Known:
        """Return an orbit with its states at phase 0."""
        system, start = orbit.system, orbit.segments[0]
        p, mode = system.parameter_vector(orbit.parameters), system.mode_index(start.mode)
        return cls(orbit, iterate(system, p, start.state, mode, discard=0, keep=orbit.form.turns).states[:, :-1])


def settled(
    system: HybridSystem, parameters: Mapping[str, float], x0: StateLike, mode: str | None = None
) -> PeriodicOrbit | str:
    """Return the periodic orbit on which a motion settles, or what it does instead, in words.

    Parameters
    ----------
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
            return settled_orbit(system, parameters, x0, mode)
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
        return find_orbit(system, parameters, motion.state, mode=motion.mode, settle=1.0)
    except SaltusError:
        return f"the motion settles on {_periods(motion.period)}"


def settled_orbit(
    system: HybridSystem,
    parameters: Mapping[str, float],
    x0: StateLike,
    mode: str | None = None,
    known: Sequence[Known] = (),
) -> PeriodicOrbit:
    """Return the periodic orbit on which a motion settles; it is followed by the Poincare map until it recurs.

    Parameters
    ----------
    system, parameters, x0, mode
        As `settled` takes them.
    known : sequence of Known, optional
        Stable orbits at these parameters. A motion that comes ever nearer to one of them is not followed further.

    Raises
    ------
    InputError, ConvergenceError, StiffnessError, ChatteringError, DivergenceError
        As `saltus.find_orbit`.

    Examples
    --------
    >>> from saltus import afm
    >>> probe = afm.Probe(k_N_m=2.0, f0_kHz=70.0, Q=20.0, R_nm=10.0)
    >>> system = afm.model(probe, afm.Hertz(E_GPa=1.0), afm.Drive(A0_nm=10.0), Zc_nm=20.0)
    >>> found = settled_orbit(system, system.parameters, [0.0, 0.0])
    >>> round(found.max["z1_nm"], 6)
    10.0
    >>> settled_orbit(system, system.parameters, [1.0, 0.0], known=[Known.of(found)]) is found
    True
    """
    patience = periods_of_patience(parameters)
    if system.series(ORDER) is None:
        return find_orbit(system, parameters, x0, mode=mode, settle=patience)
    p, x = system.parameter_vector(parameters), system.full_state(x0)
    here = starting_mode(system, x, p) if mode is None else system.mode_index(mode)
    near, done, batch, longest = _NEAR, 0, _BATCH, min(_AGAIN * patience, _MOST)
    gap, failure = math.inf, ""
    while True:
        seen = iterate(system, p, x, here, discard=batch, keep=2 * _TURNS + 1, tolerance=_TOLERANCE)
        x, here, states = seen.x_end, seen.mode_end, seen.states[:, :-1]
        done += batch + 2 * _TURNS + 1
        batch = int(_LONGER * batch)
        sizes = _sizes(system, parameters, states)
        for orbit, section in known:
            if _approaches(states, section, sizes):
                return orbit
        gap = min(gap, now := _recurrence(states, sizes))
        if now < near:
            near = _NEARER * now
            with suppress(StiffnessError):
                try:
                    return find_orbit(system, parameters, x, mode=system.mode_names[here], settle=1.0)
                except ConvergenceError as error:
                    failure = str(error.args[3])  # it has not settled yet; where it never does, this is told
        if done >= longest:
            raise ConvergenceError("periodic attractor", gap, done, failure or _UNSETTLED, unit="forcing periods")


def _sizes(system: HybridSystem, parameters: Mapping[str, float], states: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the sizes of a motion's states from its returns; at a return a displacement or a velocity may vanish."""
    sizes: NDArray[np.float64] = np.abs(states).max(axis=0)
    omega = 2e-3 * math.pi * parameters["f_kHz"]
    for z, name in enumerate(system.states):
        if name.startswith("z"):
            v = system.states.index(f"v{name[1:]}_us")
            sizes[z] = max(sizes[z], sizes[v] / omega)
            sizes[v] = sizes[z] * omega
    return np.asarray(np.maximum(sizes, _NOTHING * sizes.max()))


def _approaches(states: NDArray[np.float64], section: NDArray[np.float64], sizes: NDArray[np.float64]) -> bool:
    """Return whether the returns of a motion are near those of an orbit, and come nearer."""
    apart = (np.abs(states[:, None, :] - section) / sizes).max(axis=2).min(axis=1)
    before, after = float(apart[:_TURNS].max()), float(apart[-_TURNS:].max())
    return after < _CLOSE and (after < before or after < _NEAR)


def recurs(system: HybridSystem, parameters: Mapping[str, float], seen: PoincareReturns, longest: int) -> bool:
    """Return whether the returns of a motion at phase 0 recur after that many periods of the drive, at the most."""
    states = seen.states[:, :-1]
    return _recurrence(states, _sizes(system, parameters, states), longest) < _NEAR


def _recurrence(states: NDArray[np.float64], sizes: NDArray[np.float64], longest: int = _TURNS) -> float:
    """Return by how much returns of a motion, shape (return, states), miss those some turns before, at the least."""
    return min(float((np.abs(states[turns:] - states[:-turns]) / sizes).max()) for turns in range(1, longest + 1))


def periods_of_patience(parameters: Mapping[str, float]) -> float:
    """Return after how many periods of the drive a motion of a model that has not settled is given up.

    Examples
    --------
    >>> periods_of_patience({"f_kHz": 300.0, "f0_kHz": 300.0, "Q": 30000.0}) > 70000.0
    True
    """
    return min(max(_FEWEST, _PATIENCE * periods_of_decay(parameters)), _MOST)


def periods_of_decay(parameters: Mapping[str, float]) -> float:
    """Return in how many periods of the drive the free motion of the slowest mode falls to 1/e.

    Examples
    --------
    >>> round(periods_of_decay({"f_kHz": 300.0, "f0_kHz": 300.0, "Q": 400.0}), 3)  # Q / pi
    127.324
    """
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
