"""Branches of cycles of random fields are the same from twelve places of a cycle, from both ends, at three steps.

Cycles at twenty values are closed by SciPy, and where motions settle on one, it is among them.
"""

from __future__ import annotations

import numpy as np
import pytest

from fields_with_cycles import field_with_cycle
from saltus import StepControl, continue_orbit, solve_orbit
from saltus.results import Branch
from selection import guarding

STEPS = (0.03, 0.1, 0.3)
PLACES, VALUES = 12, 20


def told(field, branch: Branch) -> list[tuple[str, float]]:
    """Return types and values of the special points."""
    return sorted((p.type, p.parameters[field.parameter]) for p in branch.special_points)


def same_points(field, branch: Branch, other: Branch) -> bool:
    ours, theirs = told(field, branch), told(field, other)
    width = field.bounds[1] - field.bounds[0]
    return len(ours) == len(theirs) and all(
        kind == also and abs(value - at) < 1e-6 * width for (kind, value), (also, at) in zip(ours, theirs, strict=True)
    )


@pytest.mark.parametrize("seed", guarding(range(200), campaign=4))
def test_cycles_of_a_random_field_are_the_same_from_wherever_they_start(seed):
    field, start, period = field_with_cycle(seed)
    full, name = field.motion(start, period, field.value), field.parameter
    branches = []
    for place in range(PLACES):
        x0 = full.sol(place * period / PLACES)[:-1]
        orbit = solve_orbit(field.system, {name: field.value}, x0=x0, period=period)
        assert orbit.period == pytest.approx(period, rel=1e-7)
        branches.append(continue_orbit(orbit, name, field.bounds, steps=StepControl(largest=STEPS[place % 3])))
    first = branches[0]
    ends = len(first) // 8, len(first) - 1 - len(first) // 8
    branches += [continue_orbit(first.solution(end), name, field.bounds) for end in ends]
    low, high = float(first.values.min()), float(first.values.max())
    values = low + (high - low) * (np.arange(VALUES) + 0.5) / VALUES
    periods = [sorted(o.period for o in first.at(value)) for value in values]
    for other in branches[1:]:
        assert not other.audit.breaches
        assert same_points(field, first, other)
        for value, known in zip(values, periods, strict=True):
            assert sorted(o.period for o in other.at(value)) == pytest.approx(known, rel=1e-7)
    for value in values:
        orbits = first.at(value)
        for orbit in orbits:
            once = field.motion(orbit.states[0], orbit.period, value)
            size = np.ptp(once.y[:-1], axis=1).max()
            growth = max(1.0, float(np.abs(orbit.multipliers).max()))
            assert once.y[:-1, -1] == pytest.approx(orbit.states[0], abs=1e-6 * size * growth)
        if (settled := field.settled(value)) is not None:
            stable = [orbit.period for orbit in orbits if orbit.stable]
            assert min((abs(one - settled[1]) for one in stable), default=np.inf) < 1e-6 * settled[1]
