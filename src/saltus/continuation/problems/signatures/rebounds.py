"""Resets that leave a motion on their event's own surface, without speed there: a second event right behind is born.

The integrator of Clegg, which is reset to 0 whenever its input is 0, is an example: no reset moves the input.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.continuation.problems.ends.excursions import moved
from saltus.continuation.problems.signatures.rows import Found, Rows, gathered
from saltus.orbits.signature import EVENT_END, MEAN_END
from saltus.scales import ON_SURFACE, TOUCHING
from saltus.system.parts import at_phases

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem
    from saltus.orbits.signature import Signature
    from saltus.system.hybrid import HybridSystem

__all__ = ["born_behind", "rebound", "rebound_without_speed", "rebounds"]


def rebounds(system: HybridSystem, signature: Signature) -> list[Monitor]:
    """Return the monitor functions of events that may be born right behind another one on their surface.

    signature: without cuts.
    """
    found = []
    for i, (mode, kind) in enumerate(zip(signature.modes, signature.kinds, strict=True)):
        before = signature.transitions[i - 1]
        if before < 0 or kind not in (EVENT_END, MEAN_END):
            continue
        first = system.transitions[before]
        if first.source != first.target or not first.reset or at_phases(system, first):
            continue
        found += [
            Monitor("rebound", i, k)
            for k, other in enumerate(system.transitions)
            if other.event == first.event and other.source == other.target == system.mode_names[mode]
        ]
    return found


def rebound(problem: OrbitProblem, name: Monitor, start: int, rate: float) -> float:
    """Return the rate of an event behind a reset on its surface, over that before it; NaN where no event can follow.

    Where a wall turns a motion back the quotient is the restitution's, and never 0. None follows where the reset leads
    off the surface, where the condition does not hold, or where the motion would come back the wrong way. Above 1 it is
    NaN too: where the event before is met without speed, as at a grazing, its sign means nothing.

    Parameters
    ----------
    problem : OrbitProblem
        The equations, surveyed.
    name : Monitor
        The monitor function.
    start : int
        The piece that begins behind the reset.
    rate : float
        That of the event before the reset.
    """
    k, x, event = name.transition, problem.state_on(start, 0.0), np.empty(2)
    problem.system.compiled.call("event", k, 0, x, problem.extended, event)
    after = float(event[1])
    if not abs(after) <= abs(rate) > 0.0:
        return math.nan
    far = 2.0 * abs(after) > abs(rate)  # whether an event can follow is asked where one soon would
    return after / rate if far or _may_follow(problem, k, x) else math.nan


def _may_follow(problem: OrbitProblem, k: int, x: NDArray[np.float64]) -> bool:
    """Return whether a motion that leaves a state slowly comes back to the surface of an event that then happens."""
    n, compiled, transition = problem.n, problem.system.compiled, problem.system.transitions[k]
    event, field, held = np.empty(2 + 2 * n), np.empty(n), np.empty(1)
    compiled.call("event_x", k, 0, x, problem.extended, event)
    compiled.call("field", problem.system.mode_index(transition.source), 0, x, problem.extended, field)
    compiled.call("guard", len(problem.system.modes) + k, 0, x, problem.extended, held)
    lands = abs(event[0]) <= ON_SURFACE * float(np.abs(event[2 : 2 + n]) @ problem.state_scale)
    return bool(lands and held[0] > 0.0 and transition.direction * float(event[2 + n :] @ field) >= 0.0)


def born_behind(problem: OrbitProblem, blocks: NDArray[np.float64], names: Sequence[Monitor]) -> Found | str:
    """Return the signature in which events follow others at once that leave the motion on their surface.

    All those are born that are met without speed there, as on both halves of a symmetric orbit.
    """
    old, n, system = problem.signature, problem.n, problem.system
    rows: Rows = []
    for i, row in enumerate(zip(old.modes, old.transitions, blocks, strict=True)):
        for name in names:
            if name.segment != i:
                continue
            start, after = np.ascontiguousarray(blocks[i, :n]), np.empty(n)
            system.compiled.call("reset", name.transition, 0, start, problem.extended, after)
            if moved(problem, old.modes[i], after, start):
                return f"a second {system.transitions[name.transition].name!r} moves the state"
            rows.append((old.modes[i], name.transition, np.append(start, 0.0)))
        rows.append(row)
    return gathered(rows, old.turns)


def rebound_without_speed(problem: OrbitProblem, u: NDArray[np.float64]) -> list[Monitor]:
    """Return the monitor functions of all events of an orbit that are due right behind another one on their surface."""
    survey = problem.survey(u)
    found = {
        name: rebound(problem, name, name.segment, float(survey.rates[name.segment - 1, 0]))
        for name in rebounds(problem.system, problem.signature)
    }
    return [name for name, value in found.items() if abs(value) < TOUCHING]
