"""Motions of random Filippov systems with one surface, against SciPy's, event by event."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

import saltus
from oracles.filippov import course
from random_filippov import drawn
from selection import guarding

T_END = 10.0
NEAR = 1e-3  # nearness to tangency at which two motions may part by rounding
NUDGE = 1e-8


def compared(seed: int, results: Counter[str]) -> None:
    """Assert that the motion of a random system is the oracle's, until it comes near to a tangency."""
    system = drawn(seed)
    print(system)
    wanted = course(system.oracle(), system.x0, T_END)
    clear = wanted.clear_until(NEAR)
    nudge = NUDGE * np.append(np.ones(len(system.states)), [0.0] * system.forced)
    nudged = course(system.oracle(), system.x0 + nudge, T_END)
    try:
        found = saltus.simulate(system.system(), {}, system.x0, t_end=T_END, tolerance=1e-12)
    except saltus.SaltusError as error:
        results[f"refused: {type(error).__name__} {str(error)[:150]}"] += 1
        if not wanted.ended:
            print("REFUSED", type(error).__name__, error, wanted.times, wanted.modes)
            results["refused alone"] += 1
        return
    results["sliding"] += "sliding" in wanted.modes
    end = min(clear, wanted.t_end, found.t_end)
    events = found.events[found.events["kind"] == "event"]
    until = [t for t in wanted.times if t < end - 1e-6]
    assert found.mode_at(0.0) == wanted.modes[0]
    happened = np.array([*wanted.times, -1.0])
    times = [t for t in np.linspace(0.0, end, 11) if t <= end and not np.any(np.abs(happened - t) < 1e-6)]
    bound = 1e-8
    for t in times:
        a, b = wanted(t), nudged(t) if t < nudged.t_end else None
        spread = 1.0 if b is None else np.max(np.abs(a - b)) / NUDGE
        gap = np.abs(found(t) - a)
        if system.forced:
            gap[-1] = abs((gap[-1] + np.pi) % (2.0 * np.pi) - np.pi)
        bound = max(bound, 1e-9 * max(spread, 1.0))
        if spread > 1e3:
            results["grew too sensitive"] += 1
            return
        assert np.max(gap) < bound, (t, gap, bound, wanted.times, events["time"])
    assert len([t for t in events["time"] if t < end - 1e-6]) == len(until), (events["time"], wanted.times, clear)
    for k, t in enumerate(until):
        assert abs(events["time"][k] - t) < 1e-6, (k, t, events["time"][k])
        assert events["mode_after"][k] == wanted.modes[k + 1], (k, t)
    if wanted.ended:
        results[f"oracle ended: {wanted.ended}"] += 1
    results["agreed" if end == T_END else "cut short"] += 1


@pytest.mark.parametrize("seed", guarding(range(300), 2, 6, campaign=10))
def test_motions_of_random_filippov_systems_are_those_of_scipy(seed):
    compared(seed, Counter())
