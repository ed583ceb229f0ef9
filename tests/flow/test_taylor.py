"""Returns to sections by Taylor series: against the Runge-Kutta flow, SciPy and closed forms, by the same rules."""

from __future__ import annotations

import math
import tracemalloc

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import systems
from oracles.closed_forms import ImpactOrbit
from oracles.tapping import Tapping
from saltus import afm
from saltus.errors import ChatteringError, DivergenceError, InputError
from saltus.flow.event_logs import events_after
from saltus.flow.poincare import EventSection, iterate
from saltus.flow.taylor import ORDER
from saltus.system.hybrid import HybridSystem, Mode, Transition
from systems import settle

TIGHT = {"tolerance": (1e-12, 1e-13)}

DRIVE = "-x - 0.1*v + A*cos(theta + c)"


def one_mode(field, transitions=(), *, parameters=None, phase=None, domain=None):
    """A system of one mode 'm', transitions given as (event, direction, reset, when)."""
    rows = [Transition("m", "m", t[0], t[1], t[2], t[3], f"t{i}") for i, t in enumerate(transitions)]
    return HybridSystem(tuple(field), parameters or {}, {"m": Mode(field, domain)}, rows, phase=phase)


ROOTS = "(jump + root*sqrt(x - d) + k*(x - d)**(3/2) + high*(x - d)**2.5)"
"""A force law of Hertz, and three terms that are zero unless a case asks for them."""


def stop(force=ROOTS):
    """A driven mass that meets something of a force law at x = d."""
    return HybridSystem(
        ("x", "v"),
        {"w": 0.8, "k": 20.0, "d": 0.1, "A": 0.5, "c": 0.0, "jump": 0.0, "root": 0.0, "high": 0.0},
        {"free": Mode({"x": "v", "v": DRIVE}), "touch": Mode({"x": "v", "v": f"{DRIVE} - {force}"})},
        [Transition("free", "touch", "x - d", 1), Transition("touch", "free", "x - d", -1)],
        phase=("theta", "w"),
    )


def duffing(cube="x**3"):
    modes = {"m": Mode({"x": "v", "v": f"x - {cube} - 0.3*v + F*cos(theta)"})}
    return HybridSystem(("x", "v"), {"w": 1.2, "F": 0.2, "n": 3.0}, modes, [], phase=("theta", "w"))


def lorenz():
    field = {"x": "10*(y - x)", "y": "x*(28 - z) - y", "z": "x*y - 8*z/3"}
    return one_mode(field, [("z - 27", -1, {}, None)])


def van_der_pol():
    return one_mode({"x": "v", "v": "mu*(1 - x**2)*v - x"}, [("x", -1, {}, None)], parameters={"mu": 5.0})


CASES = {
    "cantilever, 1 mode": (lambda: systems.afm(1), {}, [0.0, 0.0], None, 20),
    "cantilever, 2 modes": (lambda: systems.afm(2), {"Omega": 1.15}, [0.0] * 4, None, 20),
    "cantilever, 3 modes": (lambda: afm.tapping_mode(afm.table1(), modes=3), {"Omega": 1.05}, [0.0] * 6, None, 10),
    "cantilever, at its contacts": (lambda: systems.afm(2), {"Omega": 1.15}, [0.0] * 4, EventSection((0, 1)), 40),
    "ball": (systems.ball, {}, [1.0, 0.0], EventSection((0,)), 12),
    "ball on a table": (systems.ball_on_table, {"a": 1.2}, [0.6, 3.1, 0.5], None, 10),
    "ball on a table, at its impacts": (systems.ball_on_table, {"a": 1.2}, [0.6, 3.1, 0.5], EventSection((0,)), 10),
    "impact oscillator": (systems.impact_oscillator, {}, [0.0, 0.0], None, 30),
    "impact oscillator, at its impacts": (systems.impact_oscillator, {}, [0.0, 0.0], EventSection((0,)), 30),
    "two fields": (systems.two_fields, {}, [0.0, 1.5], EventSection((1,)), 10),
    "block on a belt": (systems.stick_slip, {}, [1.0, 0.3], EventSection((0, 1)), 10),
    "relay": (systems.relay, {}, [0.1, 0.0, 0.5], EventSection((0,)), 20),
    "carried map": (
        lambda: systems.carried_map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"}), {}, [0.3, 0.0], EventSection((0,)), 20,
    ),
    "Duffing": (duffing, {}, [0.1, 0.0], None, 20),
    "Duffing, its power a parameter": (lambda: duffing("x**n"), {}, [0.1, 0.0], None, 20),
    "Lorenz": (lorenz, {}, [1.0, 1.0, 1.0], EventSection((0,)), 6),
    "van der Pol": (van_der_pol, {}, [2.0, 0.0], EventSection((0,)), 10),
    "bilinear": (lambda: stop("k*(x - d)"), {}, [0.0, 0.0], None, 30),
    "Hertz": (stop, {}, [0.0, 0.0], None, 30),
    "Hertz, at both ends of a contact": (stop, {}, [0.0, 0.0], EventSection((0, 1)), 30),
    "root": (stop, {"root": 1.0, "k": 0.0}, [0.0, 0.0], None, 30),
    "power 5/2": (stop, {"high": 20.0, "k": 0.0}, [0.0, 0.0], None, 30),
    "force that jumps": (stop, {"jump": 0.2, "A": 2.0}, [0.0, 0.0], None, 30),
    "phase beside a state": (
        lambda: one_mode({"x": "0.3 - 0.2*x + sin(theta - x)"}, phase=("theta", "1.3")), {}, [0.2], None, 10,
    ),
}  # fmt: skip
"""Makers of systems, parameters, starts, sections, and how many returns."""


def by_runge_kutta(monkeypatch, system, *arguments, **options):
    with monkeypatch.context() as patch:
        patch.setattr(system, "series", lambda order: None)
        return iterate(system, *arguments, **options)


@pytest.mark.parametrize("name", CASES)
def test_returns_are_those_of_the_runge_kutta_flow(name, monkeypatch):
    make, parameters, x, section, keep = CASES[name]
    system = make()
    assert system.series(ORDER) is not None
    p = system.parameter_vector(parameters)
    options = {"discard": 0, "keep": keep, "section": section, **TIGHT}
    found, other = iterate(system, p, x, 0, **options), by_runge_kutta(monkeypatch, system, p, x, 0, **options)
    assert found.states == pytest.approx(other.states, abs=2e-9)
    assert found.times == pytest.approx(other.times, abs=1e-10)
    assert found.modes.tolist() == other.modes.tolist()
    assert found.x_end == pytest.approx(other.x_end, abs=2e-9)
    assert found.mode_end == other.mode_end


def test_the_tolerance_is_what_a_step_is_made_for(afm2):
    p, x = afm2.parameter_vector({"Omega": 1.15}), np.zeros(4)
    x, mode = settle(afm2, p, x, 0, periods=200, **TIGHT)
    exact = iterate(afm2, p, x, mode, discard=0, keep=1, tolerance=(1e-13, 1e-14)).states
    errors = [
        float(np.abs(iterate(afm2, p, x, mode, discard=0, keep=1, tolerance=(tol, tol)).states - exact).max())
        for tol in (1e-6, 1e-8, 1e-10, 1e-12)
    ]
    # an impact makes errors up to a hundred times larger
    assert np.all(np.array(errors) <= [1e-4, 1e-6, 1e-8, 1e-10])
    assert errors == sorted(errors, reverse=True)


# closed forms, other solvers


def test_map_of_the_cantilever_is_that_of_scipy():
    tapping = Tapping(2, 1.15)
    system = afm.tapping_mode(afm.table1(), modes=2, parameters={"Omega": 1.15})
    p = system.parameter_vector({})
    x, mode = settle(system, p, np.zeros(4), 0, periods=200)
    found = iterate(system, p, x, mode, discard=0, keep=1, **TIGHT)
    other, crossings = tapping.map(x[:4], 1e-12)
    assert len(crossings) == 2
    assert found.states[0, :4] == pytest.approx(other, abs=1e-9)


def test_section_of_the_van_der_pol_oscillator_is_that_of_scipy():
    def crossing(t, x):
        return x[0]

    crossing.direction = -1.0
    other = solve_ivp(
        lambda t, x: [x[1], 5.0 * (1.0 - x[0] ** 2) * x[1] - x[0]], (0.0, 60.0), [2.0, 0.0], "DOP853",
        rtol=1e-12, atol=1e-13, events=crossing,
    )  # fmt: skip
    system = van_der_pol()
    found = iterate(
        system, system.parameter_vector({}), [2.0, 0.0], 0, discard=0, keep=5, section=EventSection((0,)), **TIGHT
    )
    assert found.times == pytest.approx(other.t_events[0][:5], abs=1e-9)
    assert found.states == pytest.approx(other.y_events[0][:5], abs=1e-8)
    assert found.states[:, 0] == pytest.approx(0.0, abs=1e-15)


def test_impact_orbit_keeps_its_closed_form(impact_oscillator):
    form = ImpactOrbit(1.0)
    speed = form.speeds(1.0)[1]
    p = impact_oscillator.parameter_vector({"A": 1.0})
    found = iterate(
        impact_oscillator,
        p,
        form.after_impact(speed),
        0,
        discard=1000,
        keep=10,
        section=EventSection((0,)),
        tolerance=(1e-8, 1e-8),
    )
    assert found.states[:, 1] == pytest.approx(speed, abs=1e-7)
    assert np.diff(found.times) == pytest.approx(2.0 * math.pi, abs=1e-7)


def test_driven_linear_motion_settles_to_its_closed_form():
    system = one_mode({"x": "v", "v": "-x - c*v + cos(theta)"}, parameters={"c": 0.2, "w": 1.3}, phase=("theta", "w"))
    found = iterate(system, system.parameter_vector({}), [0.0, 0.0], 0, discard=100, keep=3, tolerance=(1e-8, 1e-8))
    motion = 1.0 / (1.0 - 1.3**2 + 0.2j * 1.3)
    assert found.states[:, :2] == pytest.approx(np.tile([motion.real, -1.3 * motion.imag], (3, 1)), abs=1e-7)


def test_dips_are_found_where_a_step_passes_over_them():
    system = one_mode({"z": "v", "v": "2"}, [("z", 0, {}, None)])
    for depth in (1e-3, 1e-6, 1e-9, 1e-12):
        p = system.parameter_vector({})
        found = iterate(system, p, [1.0 - depth, -2.0], 0, discard=0, keep=2, section=EventSection((0,), longest=5.0))
        root = math.sqrt(depth)
        assert found.times == pytest.approx([1.0 - root, 1.0 + root], abs=1e-12 + 2e-15 / root)
    missed = iterate(system, p, [1.0 + 1e-12, -2.0], 0, discard=0, keep=2, section=EventSection((0,), longest=5.0))
    assert missed.times.size == 0


@pytest.mark.parametrize("depth", [1e-4, 1e-7, 1e-10])
def test_dips_of_a_swing_are_found_at_a_tolerance_of_their_size(depth):
    system = one_mode({"x": "v", "v": "-x"}, [("x + 1 - depth", 0, {}, None)], parameters={"depth": 0.0})
    p = system.parameter_vector({"depth": depth})
    for start in np.linspace(0.0, 1.0, 50):
        x = [math.cos(start), -math.sin(start)]
        found = iterate(
            system, p, x, 0, discard=0, keep=2, section=EventSection((0,), longest=6.0), tolerance=(1e-13, 1e-13)
        )
        half = math.acos(1.0 - depth)
        assert found.times == pytest.approx([math.pi - start - half, math.pi - start + half], abs=1e-13 / half)


@pytest.mark.campaign
def test_random_event_functions_lose_no_crossing():
    rng = np.random.default_rng(1)
    event = "c0 + c1*x + c2*x**2 + c3*sin(5*theta) + c4*cos(3*theta)*v"
    system = one_mode(
        {"x": "v", "v": "-4*x"}, [(event, 0, {}, None)], parameters=dict.fromkeys(("c0", "c1", "c2", "c3", "c4"), 0.0),
        phase=("theta", "1"),
    )  # fmt: skip
    grid = np.linspace(0.0, 6.0 * math.pi, 300_001)
    x, v = np.cos(2.0 * grid), -2.0 * np.sin(2.0 * grid)
    for _ in range(60):
        c = rng.normal(size=5)
        h = c[0] + c[1] * x + c[2] * x * x + c[3] * np.sin(5 * grid) + c[4] * np.cos(3 * grid) * v
        where = np.flatnonzero(np.sign(h[1:]) != np.sign(h[:-1]))
        p = system.parameter_vector({f"c{i}": value for i, value in enumerate(c)})
        found = iterate(
            system, p, [1.0, 0.0], 0, discard=0, keep=where.size + 1, section=EventSection((0,), longest=20.0)
        )
        times = found.times[found.times < grid[-1]]
        assert times.size == where.size
        assert np.all(np.abs(times - grid[where]) < 1e-4)


@pytest.mark.campaign
def test_a_thousand_transients_miss_no_contact():
    system = afm.tapping_mode(afm.table1(), modes=2, parameters={"Omega": 1.15})
    p, end = system.parameter_vector({}), 2.0 * math.pi / 1.15
    rng, starts = np.random.default_rng(5), []
    while len(starts) < 1000:
        x = rng.uniform(-5.0, 5.0, 4)
        if 1.0 - x[0] - x[1] > 1.0 / 300.0:
            starts.append(x)
    for x in starts:
        exact = events_after(system, p, x, 0, periods=1, tolerance=(1e-13, 1e-13))
        crossings = exact.time[exact.transition >= 0]
        found = iterate(
            system, p, x, 0, discard=0, keep=40, section=EventSection((0, 1), longest=end), tolerance=(1e-8, 1e-8)
        )
        times = found.times[found.times < end]
        assert times.size == crossings.size
        # an error of the state, grown by violent impacts, over the speed of the next
        assert times == pytest.approx(crossings, abs=1e-2)


# wraps, sections


def test_wraps_inside_a_contact_are_returns(monkeypatch):
    system = stop()
    modes = set()
    for c in np.linspace(0.0, 2.0 * math.pi, 12, endpoint=False):
        p = system.parameter_vector({"A": 3.0, "c": c})
        found = iterate(system, p, [0.0, 0.0], 0, discard=20, keep=5, **TIGHT)
        other = by_runge_kutta(monkeypatch, system, p, [0.0, 0.0], 0, discard=20, keep=5, **TIGHT)
        assert found.states == pytest.approx(other.states, abs=2e-9)
        assert found.modes.tolist() == other.modes.tolist()
        assert found.times == pytest.approx(2.0 * math.pi / 0.8 * np.arange(21, 26), abs=1e-10)
        assert np.all(found.states[:, 2] == 0.0)
        modes |= set(found.modes.tolist())
    assert modes == {0, 1}


def test_returns_are_counted_at_wraps_wherever_the_motion_starts(impact_oscillator):
    p = impact_oscillator.parameter_vector({"w": 2.0, "A": 0.2})
    found = iterate(impact_oscillator, p, [0.0, 0.0, 1.5], 0, discard=1, keep=2)
    assert found.times == pytest.approx([2.0 * math.pi - 0.75, 3.0 * math.pi - 0.75], abs=1e-12)


def test_a_section_of_one_s_own_leaves_the_motion_as_it_is(afm1):
    section = Transition("flight", "flight", "v1 - ybar*cos(theta)", 1, name="section")
    watched = HybridSystem(
        afm1.states, afm1.parameters, afm1.modes, [*afm1.transitions, section], phase=afm1.phase, name="watched"
    )
    p = afm1.parameter_vector({})
    plain, seen = (iterate(s, p, [0.0, 0.0], 0, discard=0, keep=20, **TIGHT) for s in (afm1, watched))
    assert seen.states == pytest.approx(plain.states, abs=1e-9)
    found = iterate(watched, p, [0.0, 0.0], 0, discard=5, keep=20, section=EventSection((2,)), **TIGHT)
    q, v, theta = found.states.T
    assert v - 0.108 * np.cos(theta) == pytest.approx(0.0, abs=1e-14)
    assert np.all(1.0 - q - 0.108 * np.sin(theta) > systems.A0)
    assert np.all(found.modes == 0)


def test_a_section_keeps_the_state_before_the_reset_and_goes_on_after_it(impact_oscillator):
    p = impact_oscillator.parameter_vector({"A": 1.0})
    found = iterate(impact_oscillator, p, [0.0, 0.0], 0, discard=20, keep=3, section=EventSection((0,)), **TIGHT)
    assert found.states[:, 0] == pytest.approx(1.0, abs=1e-15)
    assert np.all(found.states[:, 1] > 0.0)
    assert found.x_end[1] == pytest.approx(-0.8 * found.states[-1, 1], rel=1e-15)


def test_direction_selects_crossings():
    for direction, first in ((1, [1.0]), (-1, [3.0]), (0, [1.0, 3.0])):
        system = one_mode({"x": "1", "y": "1 - x/2"}, [("y - 0.75", direction, {}, None)])
        p = system.parameter_vector({})
        found = iterate(system, p, [0.0, 0.0], 0, discard=0, keep=2, section=EventSection((0,), longest=6.0))
        assert found.times == pytest.approx(first, abs=1e-12)


def test_an_event_whose_condition_fails_is_passed():
    system = one_mode({"x": "v", "v": "-x"}, [("x", 0, {}, "v")])
    found = iterate(system, system.parameter_vector({}), [1.0, 0.0], 0, discard=0, keep=3, section=EventSection((0,)))
    assert found.times == pytest.approx(math.pi * np.array([1.5, 3.5, 5.5]), abs=1e-8)


def test_a_motion_that_does_not_return_ends_in_time():
    system = one_mode({"x": "v", "v": "-x"}, [("x - 2", 0, {}, None)])
    found = iterate(
        system, system.parameter_vector({}), [1.0, 0.0], 0, discard=2, keep=3, section=EventSection((0,), longest=50.0)
    )
    assert found.times.size == 0
    assert found.states.shape == (0, 2)


# starts and simultaneous events


STARTS = {
    "leaves through the surface": ([0.0, -1.0], {}),
    "leaves the surface": ([0.0, 1.0], {}),
    "at rest on the surface": ([0.0, 0.0], {"g": -1.0}),
    "grazes from above": ([0.5, -1.0], {"g": -1.0}),
    "an ulp above": ([5e-324, -1.0], {}),
    "within rounding of the surface": ([1e-16, -1.0], {}),
}


@pytest.mark.parametrize("name", STARTS)
def test_a_start_at_a_surface_is_what_it_is_by_runge_kutta(name, monkeypatch):
    x, parameters = STARTS[name]
    modes = {"flight": Mode({"z": "v", "v": "-g"}), "below": Mode({"z": "v", "v": "1"})}
    rows = [Transition("flight", "below", "z", -1), Transition("below", "flight", "z", 1, {"v": "1/4"})]
    system = HybridSystem(("z", "v"), {"g": 1.0}, modes, rows)
    p = system.parameter_vector(parameters)
    options = {"discard": 0, "keep": 5, "section": EventSection((0, 1), longest=10.0)}
    found, other = iterate(system, p, x, 0, **options), by_runge_kutta(monkeypatch, system, p, x, 0, **options)
    assert found.times == pytest.approx(other.times, abs=1e-9)
    assert found.modes.tolist() == other.modes.tolist()
    assert found.states == pytest.approx(other.states, abs=1e-9)


@pytest.mark.parametrize("lift", [0.0, 1e-12, -1e-12, 1e-6, -1e-6])
def test_grazing_starts_of_the_cantilever_are_what_they_are_by_runge_kutta(lift, afm1, monkeypatch):
    p, theta = afm1.parameter_vector({}), 1.2
    q = 1.0 - systems.A0 - 0.108 * math.sin(theta) - abs(lift)
    x = [q, -0.108 * math.cos(theta) + lift, theta]
    found = iterate(afm1, p, x, 0, discard=0, keep=2, **TIGHT)
    other = by_runge_kutta(monkeypatch, afm1, p, x, 0, discard=0, keep=2, **TIGHT)
    assert found.states == pytest.approx(other.states, abs=1e-7)


def test_events_at_the_same_time_happen_in_the_order_of_definition():
    reset = [{"a": "2*a"}, {"a": "a + 1"}]
    for first, second, wanted in ((0, 1, 3.0), (1, 0, 4.0)):
        events = [("x - 1", 1, reset[first], None), ("2*x - 2", 1, reset[second], None)]
        system = one_mode({"x": "1", "a": "0"}, events)
        p = system.parameter_vector({})
        found = iterate(system, p, [0.0, 1.0], 0, discard=0, keep=2, section=EventSection((0, 1)))
        assert found.times == pytest.approx([1.0, 1.0], abs=1e-14)
        assert found.x_end[1] == wanted


def test_a_motion_through_rounds_of_simultaneous_events_is_that_of_runge_kutta(monkeypatch):
    events = [
        ("sin(theta)", 0, {"n": "n + 1"}, None),
        ("sin(theta)*(2 + cos(theta))", 0, {"n": "2*n"}, None),
        ("cos(theta)", 1, {"n": "n - 3"}, None),
        ("cos(theta)*(3 + sin(theta))", 0, {"n": "n/2"}, None),
    ]
    system = one_mode({"x": "-x", "n": "0"}, events, phase=("theta", "1"))
    p = system.parameter_vector({})
    for theta in (0.0, 0.3, 2.0):
        start = [1.0, 1.0, theta]
        found = iterate(system, p, start, 0, discard=0, keep=6, **TIGHT)
        other = by_runge_kutta(monkeypatch, system, p, start, 0, discard=0, keep=6, **TIGHT)
        assert found.states == pytest.approx(other.states, abs=1e-10)
        assert found.states[-1, 1] != 1.0


@pytest.mark.parametrize("direction", [1, 0])
def test_an_event_of_the_phase_at_its_wrap_comes_after_it_each_time(direction):
    each = 1 if direction else 2
    system = one_mode({"n": "0"}, [("sin(theta)", direction, {"n": "n + 1"}, None)], phase=("theta", "1"))
    found = iterate(system, system.parameter_vector({}), [0.0, 1.0], 0, discard=0, keep=20)
    assert found.states[:, 0].tolist() == list(range(each - 1, each * 20, each))


# what ends a motion


def test_dropped_ball_chatters_at_the_closed_form_time(ball):
    p = ball.parameter_vector({})
    with pytest.raises(ChatteringError, match=r"chattering: events accumulate at t = 4.24264068") as error:
        iterate(ball, p, [1.0, 0.0], 0, discard=0, keep=1000, section=EventSection((0,)))
    assert error.value.time == pytest.approx(3.0 * math.sqrt(2.0), abs=1e-10)
    assert error.value.mode == "flight"


@pytest.mark.parametrize("e", [0.05, 0.3, 0.8, 0.95])
def test_chattering_time_is_right_for_any_restitution(ball, e):
    p = ball.parameter_vector({"e": e})
    with pytest.raises(ChatteringError) as error:
        iterate(ball, p, [1.0, 0.0], 0, discard=10**6, keep=1, section=EventSection((0,)))
    assert error.value.time == pytest.approx(math.sqrt(2.0) * (1 + e) / (1 - e), rel=1e-9)


def test_an_oscillator_pressed_to_its_stop_chatters_there(impact_oscillator):
    p = impact_oscillator.parameter_vector({"w": 2.65, "A": 6.03435572809818})
    with pytest.raises(ChatteringError) as error:
        iterate(impact_oscillator, p, [1.0, -1e-3, 1.0], 0, discard=0, keep=10)
    # hops of the speeds u, e u, ... under the acceleration -1 + 0.1 u + A cos(theta), nearly constant
    pressed = 6.03435572809818 * math.cos(1.0) - 1.0
    assert error.value.time == pytest.approx(2e-3 / pressed / (1.0 - 0.8), rel=2e-2)
    assert error.value.state[0] == pytest.approx(1.0, abs=1e-12)


def test_sliding_is_told_as_chattering():
    modes = {"below": Mode({"x": "1"}), "above": Mode({"x": "-1"})}
    rows = [Transition("below", "above", "x", 1), Transition("above", "below", "x", -1)]
    system = HybridSystem(("x",), {}, modes, rows)
    with pytest.raises(ChatteringError) as error:
        iterate(system, system.parameter_vector({}), [-1.0], 0, discard=0, keep=1000, section=EventSection((0,)))
    assert error.value.time == pytest.approx(1.0, abs=1e-12)


def test_an_explosion_is_told_with_its_time():
    system = one_mode({"x": "x**2"}, phase=("theta", "1"))
    with pytest.raises(DivergenceError, match=r"diverges at t = 1\.0.*a state passes 1e\+12") as error:
        iterate(system, system.parameter_vector({}), [1.0], 0, discard=0, keep=3)
    assert error.value.args[0] == pytest.approx(1.0, abs=1e-9)


@pytest.mark.parametrize(
    ("field", "domain", "message"),
    [
        ("x", None, r"a state passes 1e\+12"),
        ("-1/x", None, r"as it does before a singularity"),
        ("-1", "x", r"leaves the domain of the mode, x > 0"),
    ],
)
def test_a_motion_that_ends_says_why(field, domain, message):
    system = one_mode({"x": field}, domain=domain, phase=("theta", "1"))
    with pytest.raises(DivergenceError, match=message):
        iterate(system, system.parameter_vector({}), [1.0], 0, discard=0, keep=20)


def test_a_field_that_is_not_finite_at_the_start_is_told():
    system = one_mode({"x": "1/x"}, phase=("theta", "1"))
    with pytest.raises(DivergenceError, match=r"the vector field is not finite"):
        iterate(system, system.parameter_vector({}), [0.0], 0, discard=0, keep=1)


def test_a_system_without_a_phase_needs_a_section(ball):
    with pytest.raises(InputError, match=r"section = None: must be a transition for a system without a phase"):
        iterate(ball, ball.parameter_vector({}), [1.0, 0.0], 0, discard=0, keep=1)


# discarded, kept, gone on


@pytest.mark.parametrize("name", ["cantilever, 2 modes", "cantilever, at its contacts", "Hertz", "block on a belt"])
def test_what_is_discarded_does_not_change_what_is_kept(name):
    make, parameters, x, section, _ = CASES[name]
    system = make()
    p = system.parameter_vector(parameters)
    whole = iterate(system, p, x, 0, discard=0, keep=10, section=section, **TIGHT)
    last = iterate(system, p, x, 0, discard=5, keep=5, section=section, **TIGHT)
    assert last.states == pytest.approx(whole.states[5:], abs=1e-9)
    assert last.times == pytest.approx(whole.times[5:], abs=1e-10)
    assert last.modes.tolist() == whole.modes[5:].tolist()
    assert last.x_end == pytest.approx(whole.x_end, abs=1e-9)
    assert last.mode_end == whole.mode_end


@pytest.mark.parametrize("name", ["cantilever, 2 modes", "cantilever, at its contacts", "Hertz", "block on a belt"])
def test_a_motion_goes_on_from_where_it_ended(name):
    make, parameters, x, section, _ = CASES[name]
    system = make()
    p = system.parameter_vector(parameters)
    whole = iterate(system, p, x, 0, discard=0, keep=12, section=section, **TIGHT)
    first = iterate(system, p, x, 0, discard=0, keep=5, section=section, **TIGHT)
    then = iterate(system, p, first.x_end, first.mode_end, discard=0, keep=7, section=section, **TIGHT)
    assert then.states == pytest.approx(whole.states[5:], abs=1e-9)
    assert first.times[-1] + then.times == pytest.approx(whole.times[5:], abs=1e-10)
    assert then.modes.tolist() == whole.modes[5:].tolist()


def test_nothing_kept_is_where_the_motion_would_go_on(afm1):
    p = afm1.parameter_vector({})
    nothing = iterate(afm1, p, [0.0, 0.0], 0, discard=7, keep=0)
    one = iterate(afm1, p, [0.0, 0.0], 0, discard=6, keep=1)
    assert nothing.states.shape == (0, 3)
    assert nothing.x_end == pytest.approx(one.x_end, abs=1e-12)
    assert nothing.mode_end == one.mode_end


@pytest.mark.parametrize("section", [None, EventSection((0, 1))])
def test_what_is_discarded_takes_no_memory(afm1, section):
    p, peaks = afm1.parameter_vector({}), []
    iterate(afm1, p, [0.0, 0.0], 0, discard=1, keep=1, section=section, tolerance=(1e-6, 1e-6))
    for discard in (100, 20_000):
        tracemalloc.start()
        iterate(afm1, p, [0.0, 0.0], 0, discard=discard, keep=10, section=section, tolerance=(1e-6, 1e-6))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 20_000


def test_chattering_that_is_discarded_takes_no_memory():
    # helped through crowds of events by the Runge-Kutta flow
    system = systems.carried_map(("x",), {}, {"x": "x"})
    p, peaks = system.parameter_vector({}), []
    for discard in (500, 5000):
        tracemalloc.start()
        iterate(system, p, [0.0, 0.0], 0, discard=discard, keep=10, section=EventSection((0,)))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < peaks[0] + 20_000


def test_a_step_that_ends_within_rounding_of_the_surface_does_not_miss_it():
    system = afm.tapping_mode(afm.table1(), 2)
    p = system.parameter_vector({"Omega": 1.15})
    deep = [3.8645480979841746, 0.8889701498063012, 2.6692695712632117, 0.34683799004142113]
    coarse, fine = (
        iterate(system, p, system.full_state(deep), 1, discard=0, keep=1, tolerance=(tol, tol)).states[0]
        for tol in (1e-11, 1e-13)
    )
    assert coarse == pytest.approx(fine, abs=1e-7)


@pytest.mark.parametrize(("q1", "v1"), [(3.8375, -1.2125), (4.1125, -2.4625), (4.2625, -3.9125)])
def test_a_fast_approach_feels_the_force_next_to_the_surface(afm2, q1, v1):
    # the whole impulse of the force before contact is 4e-6, felt within 2e-5 of a flight of 3.3
    p = afm2.parameter_vector({"Omega": 1.15})
    start = afm2.full_state([q1, 3.12, v1, 0.48564])
    at = [
        iterate(afm2, p, start, 1, discard=0, keep=1, section=EventSection((0,)), tolerance=(r, r)).states[0]
        for r in (1e-11, 1e-14)
    ]
    np.testing.assert_allclose(*at, rtol=0.0, atol=2e-8)


@pytest.mark.parametrize(("distance", "start"), [(10.248248076768414, 95), (8.944856588848653, 177)])
def test_a_step_that_ends_behind_a_surface_by_its_error_does_not_pass_it(distance, start):
    # errors of a step beside a root put the tip behind the surface of release: it stayed in contact there for a turn
    probe = afm.Probe(k_N_m=26.0, f0_kHz=300.0, Q=400.0, R_nm=12.0)
    law = afm.VanDerWaals(H_aJ=0.12, a0_nm=0.3) + afm.DMT(E_GPa=1.5)
    system = afm.model(probe, law, afm.Drive(A0_nm=12.0), Zc_nm=9.5)
    rng = np.random.default_rng(1)
    draws = [(rng.uniform(5.0, 11.5), rng.uniform(-4.0, 10.0), rng.uniform(-20.0, 20.0)) for _ in range(start + 1)]
    value, *x = draws[start]
    assert value == pytest.approx(distance, rel=1e-12)
    p, x = system.parameter_vector({"Zc_nm": value}), system.full_state(x)
    coarse, fine = (
        iterate(system, p, x, 0, discard=60, keep=3, tolerance=tolerance) for tolerance in ((1e-5, 1e-7), (1e-9, 1e-11))
    )
    assert np.abs(coarse.states - fine.states).max() < 0.05
