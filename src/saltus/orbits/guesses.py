"""Guesses of periodic orbits: segments, or start and period of a smooth one, read and checked."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.checks.states import leaves_out_phase
from saltus.errors import InputError, nearest
from saltus.flow.event_logs import events_after
from saltus.flow.motion import start_state
from saltus.flow.starting import starting_mode
from saltus.orbits.signature import CLOSED_END, EVENT_END, PHASE_END, Signature

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["check_size", "check_states", "read_guess"]

_MOST_UNKNOWNS = 4000  # unknowns of an orbit's equations, whose Jacobian is dense: 128 MB


def read_guess(
    system: HybridSystem, p: NDArray[np.float64], segments: Sequence[tuple[Any, ...]] | None, x0: Any, period: Any
) -> tuple[Signature, NDArray[np.float64]]:
    """Return signature and unknowns of a guess: segments, or `x0` and `period` of an orbit without events.

    Raises
    ------
    InputError
        Both are given, or neither; the segments do not fit the system; the motion from `x0` meets an event.
    """
    if segments is not None:
        for name, value in (("x0", x0), ("period", period)):
            if value is not None:
                raise InputError(name, value, "left out where segments are given", "each segment has its own start")
        return _read_segments(system, p, segments)
    if x0 is None and period is None:
        wanted = "segments=[(mode, transition, x0, duration), ...], or x0=... and period=... of a smooth orbit"
        raise InputError("guess", None, wanted)
    if x0 is None:
        raise InputError("x0", x0, "an initial state beside period=")
    if period is None:
        if system.phase is None:
            raise InputError(
                "period", period, "a duration beside x0=", "a system without a phase has no period of its own"
            )
        period = system.turn / float(system.compiled.field(0, system.full_state(x0, "x0"), p)[-1])
    x, period = system.full_state(x0, "x0"), checks.positive("period", period)
    mode = system.mode_names[0]
    if len(system.modes) > 1 or system.transitions:
        mode = _without_events(system, p, x, period)
    return _read_segments(system, p, [(mode, None, x, period)])


def _without_events(system: HybridSystem, p: NDArray[np.float64], x: NDArray[np.float64], period: float) -> str:
    """Return the mode in which a motion from a guess stays for a period; raise `InputError` where it meets an event."""
    x = start_state(system, x)
    mode = starting_mode(system, x, p)
    log = events_after(system, p, x, mode, t_end=period)
    met = [system.transition_names[k] for k in dict.fromkeys(log.transition[log.transition >= 0].tolist())]
    if met:
        hint = f"pass segments=, which name modes and events: the motion from it meets {', '.join(met)}"
        raise InputError("x0", x.tolist(), "a start of a motion that meets no event in a period", hint)
    return system.mode_names[mode]


def _read_segments(
    system: HybridSystem, p: NDArray[np.float64], given: Sequence[tuple[Any, ...]]
) -> tuple[Signature, NDArray[np.float64]]:
    segments = checks.listed("segments", given, "a sequence of (mode, transition, x0, duration)")
    if not segments:
        raise InputError("segments", segments, "one (mode, transition, x0, duration) or more")
    n = len(system.all_states)
    phase = None if system.phase is None else system.phase[0]
    rate = 0.0
    blocks, modes, transitions = np.empty((len(segments), n + 1)), [], []
    elapsed = 0.0
    for i, segment in enumerate(segments):
        parts = checks.listed(f"segments[{i}]", segment, "(mode, transition, x0, duration)", most=4)
        if len(parts) != 4:
            raise InputError(f"segments[{i}]", segment, "(mode, transition, x0, duration)")
        mode, transition, x0, duration = parts
        modes.append(system.mode_index(mode))
        transitions.append(_transition_index(system, mode, transition, i))
        duration = checks.positive(f"segments[{i}] duration", duration)
        x = system.full_state(x0, f"segments[{i}] x0", mode)
        if phase is not None:
            if i == 0:
                field = system.compiled.field(modes[0], x, p)
                rate, elapsed = float(field[-1]), float(x[-1])
            elif leaves_out_phase(x0, phase, (len(system.states), len(system.modes[mode].states or ()))):
                x[-1] = elapsed
            else:
                x[-1] += system.turn * round((elapsed - x[-1]) / system.turn)
            elapsed += rate * duration
        blocks[i, :n], blocks[i, n] = x, duration
    turns = 0
    if phase is not None:
        turns = round((elapsed - blocks[0, n - 1]) / system.turn)
        if turns < 1:
            wanted = "durations that sum to a whole number of forcing periods, at least one"
            raise InputError(
                "segments", float(blocks[:, n].sum()), wanted, f"the forcing period is {system.turn / rate:g}"
            )
    if transitions[-1] < 0 and len(segments) > 1:
        if modes[-1] != modes[0]:
            raise InputError(
                "segments", segments[-1][0], f"closed in the mode of the first segment, {segments[0][0]!r}"
            )
        last = blocks[-1].copy()
        last[n] += blocks[0, n]
        if phase is not None:
            last[n - 1] -= system.turn * turns
        blocks = np.vstack([last, blocks[1:-1]])
        modes, transitions = modes[:-1], transitions[:-1]
    if any(transition < 0 for transition in transitions[: None if len(transitions) > 1 else 0]):
        raise InputError("segments", [s[1] for s in segments], "a transition for each segment but the last")
    for i, transition in enumerate(transitions):
        if transition >= 0:
            target = system.mode_index(system.transitions[transition].target)
            if target != modes[(i + 1) % len(modes)]:
                name = system.transitions[transition].name
                wanted = f"{system.mode_names[target]!r}, where {name!r} leads"
                raise InputError(
                    f"segments[{(i + 1) % len(modes)}] mode", system.mode_names[modes[(i + 1) % len(modes)]], wanted
                )
    closing = PHASE_END if phase is not None else CLOSED_END
    kinds = (closing,) if transitions[0] < 0 else (EVENT_END,) * len(modes)
    return Signature(tuple(modes), tuple(transitions), kinds, turns), blocks.ravel()


def _transition_index(system: HybridSystem, mode: str, transition: str | None, i: int) -> int:
    closes = isinstance(transition, str) and system.phase is not None and transition == system.phase[0]
    if transition is None or closes:
        return -1
    names = [t.name for t in system.transitions if t.source == mode]
    if not isinstance(transition, str) or transition not in names:
        closing = [] if system.phase is None else [system.phase[0]]
        known = [*names, *closing]
        wanted = f"a transition out of {mode!r}: {', '.join(known) or 'none'}"
        raise InputError(f"segments[{i}] transition", transition, wanted, nearest(transition, known))
    return system.transition_names.index(transition)


def check_states(system: HybridSystem) -> None:
    """Raise `InputError` where a system has more states than the equations of an orbit can have."""
    count, most = len(system.all_states), _MOST_UNKNOWNS - 1
    if count > most:
        hint = f"the Jacobian of its orbits' equations is dense: {8e-9 * (count + 1) ** 2:.3g} GB"
        raise InputError("states of the system", count, f"at most {most} for its orbits", hint)


def check_size(system: HybridSystem, signature: Signature) -> None:
    """Raise `InputError` where an orbit has more segments than its equations can have."""
    most = _MOST_UNKNOWNS // (len(system.all_states) + 1)
    if len(signature) > most:
        raise InputError("segments of the orbit", len(signature), f"at most {most}", "its equations would be too large")
