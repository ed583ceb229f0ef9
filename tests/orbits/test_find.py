"""`find_orbit`: what a motion settles on, against closed forms, and what it says where there is nothing to find."""

from __future__ import annotations

import importlib
import math
import re

import numpy as np
import pytest

import systems
from oracles.closed_forms import LOGISTIC, ImpactOrbit, TableJump, logistic_cycle
from saltus import (
    ConvergenceError,
    HybridSystem,
    InputError,
    Mode,
    Transition,
    filippov,
    find_orbit,
    simulate,
)


def test_a_forced_motion_settles_on_the_closed_form():
    form = ImpactOrbit(1.0)
    orbit = find_orbit(systems.impact_oscillator(), x0=[0.0, 0.0])
    assert orbit.signature == (("free", "impact"),)
    assert orbit.segments[0].state[1] == pytest.approx(form.after_impact(form.speeds(1.0)[1])[1], abs=1e-10)
    assert orbit.stable
    assert orbit.admissible


def test_a_forced_motion_without_events_settles_on_the_linear_response():
    form, A = ImpactOrbit(1.4), 0.3
    orbit = find_orbit(systems.impact_oscillator(), {"w": 1.4, "A": A}, x0=[0.0, 0.0])
    assert orbit.signature == (("free", "theta"),)
    np.testing.assert_allclose(orbit.x0, form.linear_response(A)[1], atol=1e-10)


@pytest.mark.parametrize("share", [0.99, 1.01])
def test_a_jump_is_found_once_round_below_its_doubling_and_twice_above(share):
    form = TableJump(0.5)
    a = share * form.doubling
    orbit = find_orbit(systems.ball_on_table(), {"a": a}, x0=form.after_impact(a))
    turns = 1 if share < 1.0 else 2
    assert orbit.period == pytest.approx(2.0 * math.pi * turns, abs=1e-10)
    assert len(orbit.segments) == turns


def test_a_slow_transient_is_found_once_round():
    form = TableJump(0.5)
    orbit = find_orbit(systems.ball_on_table(), {"a": 0.998 * form.doubling}, x0=form.after_impact(1.2))
    assert orbit.period == pytest.approx(2.0 * math.pi, abs=1e-10)


def test_an_autonomous_motion_settles_on_the_shortest_cycle_of_its_events():
    orbit = find_orbit(systems.stick_slip(), x0=[0.0, 0.3], mode="stick")
    assert orbit.period == pytest.approx(4.222431654131 + 10.0 / 3.0, abs=1e-11)
    assert len(orbit.segments) == 2


@pytest.mark.parametrize("period", [1, 2, 4])
def test_a_cycle_of_a_carried_map_is_found_with_its_period(period):
    a = {1: 2.8, 2: 3.2, 4: 3.5}[period]
    system = systems.carried_map(("x",), {"a": a}, LOGISTIC)
    orbit = find_orbit(system, x0=[0.3, 0.0])
    assert sorted(segment.state[0] for segment in orbit.segments) == pytest.approx(
        sorted(logistic_cycle(a, period)), abs=1e-10
    )


def test_an_autonomous_motion_without_events_settles_on_the_unit_circle():
    system = HybridSystem(
        ("x", "y"),
        {"w": 2.0},
        {"m": Mode({"x": "x*(1 - x**2 - y**2) - w*y", "y": "y*(1 - x**2 - y**2) + w*x"})},
    )
    orbit = find_orbit(system, x0=[0.3, 0.1])
    assert orbit.period == pytest.approx(math.pi, abs=1e-10)
    np.testing.assert_allclose(orbit.multipliers, [math.exp(-2.0 * math.pi), 1.0], atol=1e-10)


def test_a_chaotic_motion_has_no_orbit():
    system = systems.carried_map(("x",), {"a": 3.9}, LOGISTIC)
    with pytest.raises(ConvergenceError, match=r"^periodic attractor: .* after \d+ returns; "):
        find_orbit(system, x0=[0.3, 0.0], settle=500.0)


@pytest.mark.parametrize(
    ("offset", "start"), [(0.0, [1.0, 0.0]), (0.1, [1.0, 0.0]), (1e-9, [1e-9, 1e-9]), (0.1, [0.1, 0.0])]
)
def test_a_motion_that_comes_to_rest_has_no_orbit_and_the_place_is_told(offset, start):
    with pytest.raises(ConvergenceError, match=r"comes to rest in mode 'm' at x = .*, v = .*, an equilibrium$") as rest:
        find_orbit(SPRING, {"f": offset}, x0=start)
    place = re.search(r"at x = (\S+), v", str(rest.value))
    assert place
    assert float(place[1]) == pytest.approx(offset, rel=1e-5, abs=1e-11)


SPRING = HybridSystem(("x", "v"), {"f": 0.0}, {"m": Mode({"x": "v", "v": "f - x - v"})})


@pytest.mark.parametrize(("rate", "size"), [(1.0, 1.0), (1e6, 1e9), (1e-8, 1e-9), (1e6, 1e-12)])
def test_a_cycle_is_found_in_any_units(rate, size):
    van_der_pol = HybridSystem(
        ("x", "y"), {"k": 1.0, "a": 1.0}, {"m": Mode({"x": "k*y/a", "y": "k*((1 - x**2)*y - a*x)"})}
    )
    orbit = find_orbit(van_der_pol, {"k": rate, "a": size}, x0=[0.1, 0.0])
    assert orbit.period * rate == pytest.approx(6.6632868593231301, rel=1e-9)
    assert orbit.max["y"] / size == pytest.approx(find_orbit(van_der_pol, {}, x0=[0.1, 0.0]).max["y"], rel=1e-8)


@pytest.mark.parametrize("clock", [1e-5, 1e6])
def test_settling_counts_transitions_whatever_their_time(clock):
    ticking = HybridSystem(
        ("v", "s"),
        {"T": 1.0, "r": 3.2},
        {"on": Mode({"v": "0", "s": "1"})},
        [Transition("on", "on", "s - T", 1, {"v": "r*v*(1 - v)", "s": "0"}, name="tick")],
    )
    assert find_orbit(ticking, {"T": clock}, x0=[0.3, 0.0]).period == pytest.approx(2.0 * clock, rel=1e-12)
    with pytest.raises(ConvergenceError, match=r"after \d{4} returns; the motion is chaotic: its leading"):
        find_orbit(ticking, {"T": clock, "r": 3.9}, x0=[0.3, 0.0])


@pytest.mark.parametrize("factor", [0.9, 0.98])
@pytest.mark.parametrize(
    ("states", "fields", "resets"),
    [
        (("x", "s"), {"x": "0", "s": "1"}, {"x": "f*x", "s": "0"}),
        (("x", "s"), {"x": "log(f)*x", "s": "1"}, {"s": "0"}),
        (("u", "v", "x"), {"u": "v", "v": "(1 - u**2)*v - u", "x": "log(f)*x"}, None),
    ],
    ids=["by resets", "by its field", "beside a cycle"],
)
def test_a_state_that_dies_away_has_no_size_of_its_own(states, fields, resets, factor):
    ticks = [] if resets is None else [Transition("on", "on", "s - 1", 1, resets, name="tick")]
    system = HybridSystem(states, {"f": factor}, {"on": Mode(fields)}, ticks)
    start = [1e-3, 0.5] if ticks else [1.0, 1.0, 1e-3]
    orbit = find_orbit(system, x0=start)
    assert factor**orbit.period == pytest.approx(sorted(np.abs(orbit.multipliers))[-2], rel=1e-9)
    assert abs(orbit.x0[states.index("x")]) < 1e-12


@pytest.mark.parametrize("amplitude", [1e-6, 1e-9, 1e-10, 1e-11])
def test_a_tiny_motion_about_an_offset_is_an_oscillation(amplitude):
    w, c = 1.3, 0.2
    linear = HybridSystem(
        ("x", "v"), {"A": 1.0}, {"m": Mode({"x": "v", "v": "-x - 0.2*v + 0.1 + A*cos(s)"})}, phase=("s", "1.3")
    )
    response = 1.0 / complex(1.0 - w**2, c * w)
    orbit = find_orbit(linear, {"A": amplitude}, x0=[0.0, 0.0])
    told = (orbit.x0 - [0.1, 0.0]) / amplitude
    np.testing.assert_allclose(told, [response.real, (1j * w * response).real], atol=2e-16 / amplitude + 1e-9)
    np.testing.assert_allclose(np.abs(orbit.multipliers), math.exp(-c * math.pi / w), rtol=1e-9)


@pytest.mark.parametrize("settle", [0.0, -1.0, math.nan, math.inf, "long"])
def test_a_time_to_settle_that_cannot_be(settle):
    with pytest.raises(InputError, match=rf"^settle = {re.escape(repr(settle))}: must be a finite number > 0$"):
        find_orbit(systems.impact_oscillator(), x0=[0.0, 0.0], settle=settle)


@pytest.mark.parametrize("x0", [(), [1.0]])
def test_a_start_of_another_length(x0):
    with pytest.raises(InputError, match=r"^x0 = .*: must be of shape \(2,\), one number for each of x, v, or"):
        find_orbit(systems.impact_oscillator(), x0=x0)


def test_an_unknown_mode():
    with pytest.raises(InputError, match=r"^mode = 'stik': must be one of slip, stick; did you mean 'stick'\?$"):
        find_orbit(systems.stick_slip(), x0=[0.0, 0.3], mode="stik")


def test_an_orbit_of_too_many_transitions_is_told_before_its_equations_are_made(monkeypatch):
    monkeypatch.setattr(importlib.import_module("saltus.orbits.guesses"), "_MOST_UNKNOWNS", 12)
    field = {"x": "cos(s) - x/10", "y": "1 - y"}
    ticks = [Transition("m", "m", "sin(20*x)", 1, {"y": "y/2"}, name="tick")]
    system = HybridSystem(("x", "y"), {}, {"m": Mode(field)}, ticks, phase=("s", "1"))
    with pytest.raises(ConvergenceError, match="segments of the orbit = [0-9]+: must be at most 3; its"):
        find_orbit(system, {}, [0.5, 1.0], settle=60)


@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e6])
def test_a_start_behind_a_wall_is_told_with_its_transition(unit):
    wall = Transition("free", "free", event="x - d", direction=1, reset={"v": "-0.8*v"}, name="impact")
    field = {"x": "v", "v": "A*cos(s) - 0.1*v - x"}
    struck = HybridSystem(("x", "v"), {"d": unit, "w": 1.1, "A": unit}, {"free": Mode(field)}, [wall], phase=("s", "w"))
    with pytest.warns(
        RuntimeWarning, match=r"starts behind event 'impact' of mode 'free', where its function is"
    ) as told:
        find_orbit(struck, x0=[2.0 * unit, 0.0])
    assert [one.filename for one in told] == [__file__]
    find_orbit(struck, x0=[unit, -0.5 * unit])


@pytest.mark.parametrize(
    "pull",
    ["0.9 - x**2 - y**2", "0.96 - 2*(x**2 + y**2) + (x**2 + y**2)**2", "0.2"],
    ids=["cubic", "quintic", "linear"],
)
def test_a_decay_below_the_smallest_numbers_comes_to_rest(pull):
    above = {"x": f"-x*({pull}) - y", "y": f"-y*({pull}) + x"}
    system = filippov(("x", "y"), {}, surface="y + 1", above=above, below={"x": "1", "y": "1"})
    with pytest.raises(ConvergenceError, match="comes to rest in mode 'above' at x = 0, y = 0, an equilibrium"):
        find_orbit(system, x0=[0.5, 0.0])


def test_what_grows_from_next_to_the_smallest_numbers_goes_on_growing():
    growing = HybridSystem.smooth({"x": "x - x**3"}, {})
    assert simulate(growing, {}, [1e-300], t_end=800.0).x_end == pytest.approx([1.0], abs=1e-9)
