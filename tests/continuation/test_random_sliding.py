"""Branches of orbits of random Filippov systems: the same points at any step, and motions beside each of them."""

from __future__ import annotations

import warnings
from collections import Counter

import numpy as np
import pytest

import saltus
from oracles.filippov import course
from random_filippov import drawn
from selection import guarding

LARGEST = (None, 0.05, 0.2)
SPAN = 0.6  # of the parameter, to either side
MOMENT = 1e-6  # stay in a mode, over the period, below which it is the oracle's rounding
HANGS = 89  # a sliding segment that ends at a two-fold: its branch takes a minute a step


def modes_on(seed: int, orbit: saltus.PeriodicOrbit) -> tuple[str, ...] | None:
    """Return the modes of the oracle's motion over one period from a point of an orbit off the surface."""
    system = drawn(seed)
    oracle = system.oracle(orbit.parameters["b"])
    signature = [segment.mode for segment in orbit.segments]
    durations = [segment.duration for segment in orbit.segments]
    free = [i for i, mode in enumerate(signature) if mode != "sliding"]
    if not free:
        return None
    i = max(free, key=lambda j: durations[j])
    half = course(oracle, orbit.segments[i].state, 0.5 * durations[i], signature[i])
    assert half.modes == [signature[i]], (seed, orbit.parameters["b"], signature, half.modes, half.times)
    x = half(0.5 * durations[i])
    moved = course(oracle, x, orbit.period, signature[i])
    if moved.ended:  # too near to a tangency for the oracle
        return None
    back = moved(orbit.period)
    n = len(system.states)
    assert np.max(np.abs(back[:n] - x[:n])) < 1e-6, (seed, orbit.parameters["b"], moved.modes)
    # next to an AS the oracle goes to and fro for a moment where an excursion begins
    lengths = np.diff([0.0, *moved.times, orbit.period])
    if lengths.min() >= 0.0:
        return tuple(moved.modes)
    lasting = [mode for mode, length in zip(moved.modes, lengths, strict=True) if abs(length) > MOMENT * orbit.period]
    return tuple(mode for mode, before in zip(lasting, [None, *lasting], strict=False) if mode != before)


def branches_of(seed: int, results: Counter[str]) -> None:
    """Follow the branch of a random system's orbit at three sizes of steps, and compare."""
    drawn_system = drawn(seed)
    system = drawn_system.system()
    try:
        orbit = saltus.find_orbit(system, {}, drawn_system.x0, settle=300)
    except saltus.SaltusError as error:
        results[f"no orbit: {type(error).__name__} {str(error)[:60]}"] += 1
        return
    print(drawn_system)
    print("orbit", orbit.signature, orbit.period)
    results["branches"] += 1
    found = []
    for largest in LARGEST:
        control = saltus.StepControl() if largest is None else saltus.StepControl(largest=largest)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            branch = saltus.continue_orbit(orbit, "b", (-SPAN, SPAN), steps=control)
        print(largest, len(branch), branch.stopped, flush=True)
        points = [(p.type, p.parameters["b"]) for p in branch.special_points]
        print("   ", points)
        assert all(branch.stopped)
        found.append((points, branch))
    for end in found[0][1].stopped:
        results[f"end: {end.split(': ', 1)[-1][:110]}"] += 1
    for name, _ in found[0][0]:
        results[f"type {name}"] += 1
    for points, _ in found[1:]:
        assert [p[0] for p in points] == [p[0] for p in found[0][0]], (seed, points, found[0][0])
        assert np.allclose([p[1] for p in points], [p[1] for p in found[0][0]], rtol=0, atol=1e-7), (seed, points)
    branch = found[0][1]
    rows = sorted({0, len(branch) - 1, *range(0, len(branch), 5)} | beside(branch))
    for row in rows:
        orbit = branch.solution(row)
        if any(abs(p.parameters["b"] - orbit.parameters["b"]) < 1e-9 for p in branch.special_points):
            continue
        if np.max(np.abs(orbit.multipliers[np.isfinite(orbit.multipliers)]), initial=0.0) > 1e3:
            continue
        assert branch.sound[row], (seed, orbit.parameters["b"], orbit.reasons)
        modes = modes_on(seed, orbit)
        results["orbits simulated"] += modes is not None
        if modes is not None:
            own = [mode for mode, _ in orbit.signature]
            wanted = Counter(own)
            if len(own) > 1 or modes[1:]:
                wanted[modes[0]] += 1  # the motion starts in the middle of a segment
            assert Counter(modes) == wanted, (seed, orbit.parameters["b"], own, modes)


def beside(branch: saltus.Branch) -> set[int]:
    """Return the rows of a branch beside its special points."""
    values = branch.column("b")
    rows: set[int] = set()
    for point in branch.special_points:
        i = int(np.argmin(np.abs(values - point.parameters["b"])))
        rows |= {j for j in range(i - 2, i + 3) if 0 <= j < len(branch)}
    return rows


@pytest.mark.parametrize("seed", guarding((s for s in range(110) if s != HANGS), 47, campaign=4))
def test_random_branches_have_the_same_points_at_each_step_and_the_motions_of_scipy(seed):
    branches_of(seed, Counter())
