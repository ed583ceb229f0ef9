"""Branches of bursting neurons with resets, beside trajectories by SciPy: isolas of spikes added at canards."""

from __future__ import annotations

import mpmath
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit, load, solve_orbit, verify
from saltus.continuation.problems.guards import residual_fault
from selection import guarding

# Izhikevich, Simple model of spiking neurons (2003): a, b, c, d, I of bursts
CELLS = {
    "bursts": (0.02, 0.2, -50.0, 2.0, 15.0),
    "long bursts": (0.02, 0.2, -48.0, 2.0, 20.0),
    "chatter": (0.02, 0.2, -50.0, 2.0, 10.0),
    "mixed": (0.02, 0.2, -55.0, 4.0, 15.0),
    "intrinsic": (0.02, 0.2, -55.0, 4.0, 10.0),
}
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


@pytest.mark.parametrize(("cell", "name"), guarding(ISOLAS))
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
    assert "a change of a segment's start grows" in residual_fault(problem, survey, u)


# which ends a branch of bursts has along each parameter, from both ends: reached, closed, or at half the period
ALONG = [(cell, name) for cell in CELLS for name in ("I", "c", "d", "a")]


@pytest.mark.parametrize(("cell", "name"), guarding(ALONG, ("mixed", "c"), ("chatter", "a"), campaign=6, spread=True))
def test_branches_of_bursts_go_on_through_canards(cell, name):
    system = neuron(cell)
    start = find_orbit(system, x0=[CELLS[cell][2], 0.2 * CELLS[cell][2]])
    value = start.parameters[name]
    bounds = {"I": (value - 6, value + 10), "c": (value - 10, value + 10)}.get(name, (0.5 * value, 2.0 * value))
    branch = continue_orbit(start, name, bounds)
    ends = ("bound reached", "the branch is closed", "the period halves")
    assert all(text.endswith(ends) for text in branch.stopped)
    assert not branch.audit.breaches


def series(state, p, order):
    """Taylor coefficients of the motion from a state, by exact arithmetic of many digits."""
    v, u = [state[0]], [state[1]]
    for k in range(order):
        square = mpmath.fsum(v[i] * v[k - i] for i in range(k + 1))
        constant = 140 + p["I"] if k == 0 else 0
        v.append((mpmath.mpf(4) / 100 * square + 5 * v[k] - u[k] + constant) / (k + 1))
        u.append(p["a"] * (p["b"] * v[k] - u[k]) / (k + 1))
    return v[::-1], u[::-1]


def fired(u, p, order=32, digits=36):
    """How long it takes from a reset to the next spike, and the state behind it, to so many digits."""
    at, time = (p["c"], u), mpmath.mpf(0)
    while True:
        v, w = series(at, p, order)
        step = (mpmath.mpf(10) ** -digits / abs(v[0])) ** (mpmath.mpf(1) / order)
        if mpmath.polyval(v, step) >= 30:
            met = mpmath.findroot(lambda s: mpmath.polyval(v, s) - 30, (0, step), solver="illinois", tol=1e-90)  # noqa: B023
            return time + met, mpmath.polyval(w, met) + p["d"]
        at, time = (mpmath.polyval(v, step), mpmath.polyval(w, step)), time + step


def exact(orbit):
    """The burst nearest to an orbit, with its period and multiplier, by Newton's method on the firing map."""
    with mpmath.workdps(50):
        p = {name: mpmath.mpf(value) for name, value in orbit.parameters.items()}
        u, small = mpmath.mpf(float(orbit.segments[0].state[1])), mpmath.mpf(10) ** -25
        for _ in range(6):
            period, ends = mpmath.mpf(0), [u, u + small]
            for _ in orbit.segments:
                (time, one), (_, two) = (fired(end, p) for end in ends)
                period, ends = period + time, [one, two]
            slope = (ends[1] - ends[0]) / small
            step = (u - ends[0]) / (slope - 1)
            u += step
            if abs(step) < 1e-15:
                break
        return float(u), float(period), float(slope)


@pytest.mark.parametrize("share", guarding([0.3, 0.5, 0.65, 0.75, 0.9], campaign=2, spread=True))
def test_bursts_along_canards_are_those_of_many_digits(share):
    branch = continue_orbit(find_orbit(neuron("mixed"), x0=[-55.0, -11.0]), "c", (-60.0, -45.0))
    orbit = branch.solution(round(share * (len(branch) - 1)))
    state, period, multiplier = exact(orbit)
    assert orbit.segments[0].state[1] == pytest.approx(state, abs=1e-10)
    assert orbit.period == pytest.approx(period, rel=1e-9)
    assert orbit.multipliers[0].real == pytest.approx(multiplier, rel=1e-8, abs=1e-11)


def test_pieces_of_a_burst_are_no_events(tmp_path):
    branch = continue_orbit(find_orbit(neuron("bursts"), x0=[-50.0, -10.0]), "c", (-52.0, -47.0))
    orbit = branch.solution(min((abs(value + 49.2), i) for i, value in enumerate(branch.values[:40]))[1])
    pieces, spikes = len(orbit.durations), len(orbit.segments)
    assert pieces > spikes == 6
    assert orbit.signature == (("rest", "spike"),) * 6
    assert [end for end in orbit.to_xarray()["segment_transition"].values if end] == ["spike"] * 6
    sampled = orbit.sample()["t"].values
    assert np.count_nonzero(np.diff(sampled) == 0.0) == 5
    assert verify(orbit).passed
    again = solve_orbit(
        orbit.system, orbit.parameters, segments=[(s.mode, s.transition, s.state, s.duration) for s in orbit.segments]
    )
    assert again.period == pytest.approx(orbit.period, rel=1e-11)
    orbit.save(tmp_path / "burst.nc")
    read = load(tmp_path / "burst.nc")
    assert read.form == orbit.form
    assert np.array_equal(read.states, orbit.states)
