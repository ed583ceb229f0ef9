"""Branches of bursting neurons with resets, beside trajectories by SciPy: isolas of spikes added at canards."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit
from saltus.continuation.problems.guards import residual_fault
from selection import guarding

# Izhikevich, Simple model of spiking neurons (2003): a, b, c, d, I of bursts; the last two are further up
CELLS = {"bursts": (0.02, 0.2, -50.0, 2.0, 15.0), "long bursts": (0.02, 0.2, -48.0, 2.0, 20.0)}
ISOLAS = [("bursts", "I"), ("bursts", "d"), ("bursts", "a"), ("long bursts", "I"), ("long bursts", "a")]


def neuron(cell):
    a, b, c, d, current = CELLS[cell]
    return HybridSystem(
        ("v", "u"),
        {"a": a, "b": b, "c": c, "d": d, "I": current},
        {"rest": Mode({"v": "0.04*v**2 + 5*v + 140 - u + I", "u": "a*(b*v - u)"})},
        [Transition("rest", "rest", "v - 30", 1, {"v": "c", "u": "u + d"}, name="spike")],
    )


def landed(orbit, segment):
    """Where the motion from a segment's start meets the threshold, after how long, and the way that it magnifies."""
    p = orbit.parameters

    def field(_, y):
        v, u = y
        return [0.04 * v * v + 5.0 * v + 140.0 - u + p["I"], p["a"] * (p["b"] * v - u)]

    def spike(_, y):
        return y[0] - 30.0

    spike.terminal, spike.direction = True, 1.0
    run = [
        solve_ivp(field, (0.0, 3.0 * segment.duration), start, "DOP853", events=spike, rtol=1e-12, atol=1e-13)
        for start in (segment.state, np.add(segment.state, [0.0, 1e-9]))
    ]
    moved = abs(run[1].y[1, -1] - run[0].y[1, -1]) / 1e-9
    return run[0].y[:, -1], run[0].t[-1], max(moved, 1.0)


@pytest.mark.parametrize(("cell", "name"), guarding(ISOLAS, ISOLAS[0]))
def test_bursts_of_one_count_of_spikes_lie_on_a_closed_branch(cell, name):
    system = neuron(cell)
    start = find_orbit(system, x0=[CELLS[cell][2], -10.0])
    value = start.parameters[name]
    branch = continue_orbit(start, name, (0.5 * value, 2.0 * value))
    assert branch.stopped == ("the branch is closed", "the branch is closed")
    assert [len(branch.special_points.of_type(kind)) for kind in ("SN", "PD")] == [2, 2]
    assert not branch.audit.breaches
    for i in range(0, len(branch), max(len(branch) // 6, 1)):
        orbit = branch.solution(i)
        for segment, following in zip(orbit.segments, (*orbit.segments[1:], orbit.segments[0]), strict=True):
            met, after, moved = landed(orbit, segment)
            assert after == pytest.approx(segment.duration, rel=1e-9 * moved)
            assert met[1] + orbit.parameters["d"] == pytest.approx(following.state[1], abs=1e-9 * moved)


def test_a_gap_of_a_slow_state_is_told_where_more_is_left_of_the_event():
    field = {"v": "v**2 + 2 - a", "a": "-0.3*a"}
    spike = Transition("m", "m", "v - 100", 1, {"v": "-1", "a": "a + 0.5"}, name="spike")
    orbit = find_orbit(HybridSystem(("v", "a"), {}, {"m": Mode(field)}, [spike]), x0=[-1.0, 0.5])
    problem, u = orbit.problem(), orbit.unknowns.copy()
    problem.start(u)
    u[1] += 2.5e-4
    for _ in range(8):  # the event is missed by more than the state
        F, J = problem.evaluate(u)
        u[-1] += (2e-4 - F[-1]) / J[-1, problem.size - 1]
    survey = problem.survey(u)
    assert survey.residual == pytest.approx(2.5e-4 * (1.0 - np.exp(-0.3 * orbit.period)) / 1.0, rel=0.5)
    assert residual_fault(problem, survey, u) is not None


def test_a_residual_is_told_with_what_grows_over_a_segment():
    branch = continue_orbit(find_orbit(neuron("bursts"), x0=[-50.0, -10.0]), "c", (-60.0, -40.0))
    told = [text for text in branch.stopped if "is left of the equations" in text]
    assert told
    assert all("a change of a segment's start grows" in text for text in told)
    assert np.isfinite(branch.values).all()
