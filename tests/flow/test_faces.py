"""States that never cross zero: followed by relative error, however rare they become."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from fields_of_growth import growths
from saltus import HybridSystem, Mode, Transition, find_orbit, simulate
from saltus.ensemble.ensemble import Ensemble
from saltus.system.derivatives import Symbolic
from saltus.system.faces import EXPONENTIAL, FACE, PLAIN, SUPPLIED, groups_of, kinds_of
from selection import guarding

PREDATOR = {"N": "0.8*N*(1 - N/K) - 2.5*N*P/(N + 1)", "P": "1.25*N*P/(N + 1) - 0.4*P"}
LASER = {"u": "(N - 1)*u - 3*v", "v": "(N - 1)*v + 3*u", "N": "0.01*(2 - N - N*(u**2 + v**2))"}


def made(field, parameters=None, event="", **options):
    events = [Transition("m", "m", event, 1, name="up")] if event else []
    return HybridSystem(tuple(field), parameters or {}, {"m": Mode(field)}, events, **options)


def times(system, x0, t_end, **options):
    return np.asarray(simulate(system, x0=x0, t_end=t_end, **options).events["time"])


@pytest.mark.parametrize(
    ("field", "kinds", "groups"),
    [
        ({"x": "x - x**3"}, (FACE,), (0,)),
        ({"x": "exp(x) - 1"}, (PLAIN,), (-1,)),
        ({"x": "-sqrt(x)"}, (PLAIN,), (-1,)),
        ({"x": "-0.3*x", "y": "y*log(y) - 2*y/(1 + x)"}, (EXPONENTIAL, FACE), (0, 1)),
        ({"x": "v", "v": "sin(x) - v"}, (PLAIN, PLAIN), (0, 0)),
        ({"x": "v", "v": "cos(x) - v"}, (PLAIN, PLAIN), (-1, -1)),
        (LASER, (PLAIN, PLAIN, SUPPLIED), (0, 0, -1)),
    ],
)
def test_factors_are_seen_in_the_formulas(field, kinds, groups):
    symbolic = Symbolic(made(field))
    assert kinds_of(symbolic) == kinds
    assert groups_of(symbolic) == groups


# by the same equations in logarithms, SciPy's DOP853 at 1e-12
@pytest.mark.parametrize(
    ("K", "period"), guarding([(6.0, 35.49469187), (10.0, 56.62046108), (15.0, 83.58265995)], (15.0, 83.58265995))
)
def test_predator_and_prey_have_the_period_of_their_logarithms(K, period):
    up = times(made(PREDATOR, {"K": K}, "N - 1"), [1.0, 1.0], 40.0 * period)
    assert up[-1] - up[-2] == pytest.approx(period, abs=2e-8)


def test_orbit_is_found_where_a_state_falls_to_1e_12_of_its_size():
    system = made(PREDATOR, {"K": 20.0}, "N - 1")
    orbit = find_orbit(system, x0=[1.0, 1.0])
    up = times(system, [1.0, 1.0], 3000.0)
    assert orbit.period == pytest.approx(up[-1] - up[-2], rel=1e-9)


def test_outbreaks_of_an_epidemic_come_after_1e_21_of_the_ill():
    sir = made({"S": "0.02*(1 - S) - 390*S*I", "I": "390*S*I - 26.02*I"}, event="I - 0.001")
    np.testing.assert_allclose(times(sir, [0.99, 1e-4], 12.0), [0.0064, 6.9924, 11.1999], atol=5e-5)


def test_motion_of_may_and_leonard_keeps_its_three_populations():
    field = {"x": "x*(1-x-0.6*y-1.7*z)", "y": "y*(1-1.7*x-y-0.6*z)", "z": "z*(1-0.6*x-1.7*y-z)"}
    motion = simulate(made(field, event="x - 0.5"), x0=[0.5, 0.3, 0.2], t_end=2000.0)
    np.testing.assert_allclose(motion.events["time"], [22.54, 61.67, 190.79, 802.27], atol=5e-3)
    assert np.all(motion(2000.0) > 0.0)


@pytest.mark.parametrize("x0", [1e-18, -1e-18, 1e-200])
def test_growth_from_nothing_takes_its_time(x0):
    def since(x):  # the integral of 1 / (x - x^3)
        return math.log(x) - 0.5 * math.log1p(-x * x)

    (time,) = times(made({"x": "x - x**3"}, event="x**2 - 0.25"), [x0], 500.0)
    assert time == pytest.approx(since(0.5) - since(abs(x0)), rel=1e-10)


def test_laser_starts_from_1e_15_by_its_intensity_and_by_its_two_quadratures():
    def field(_, y):
        return [y[1] - 1.0, 0.01 * (2.0 - y[1] - y[1] * math.exp(2.0 * y[0]))]

    def starts(_, y):
        return y[0] - math.log(0.5)

    starts.direction = 1.0
    found = solve_ivp(field, (0, 300), [math.log(1e-15), 0.0], method="LSODA", rtol=1e-12, atol=1e-12, events=starts)
    for system, x0 in (
        (made(LASER, event="u**2 + v**2 - 0.25"), [1e-15, 0.0, 0.0]),
        (made({"I": "2*I*(N - 1)", "N": "0.01*(2 - N - N*I)"}, event="I - 0.25"), [1e-30, 0.0]),
    ):
        np.testing.assert_allclose(times(system, x0, 300.0), found.t_events[0], rtol=1e-9)


def test_pendulum_leaves_its_upper_rest_from_1e_18():
    # on the unstable manifold v = 2 sin(x / 2): time from 1e-18 to 1
    time = times(made({"x": "v", "v": "sin(x)"}, event="x - 1"), [1e-18, 1e-18], 60.0)[0]
    assert time == pytest.approx(math.log(math.tan(0.25) / 2.5e-19), rel=1e-9)


def test_immigration_of_1e_15_is_what_a_population_grows_from():
    def field(_, y):
        return [y[1] - 1.0 + 1e-15 * math.exp(-y[0]), 0.01 * (2.0 - y[1] - y[1] * math.exp(y[0]))]

    def starts(_, y):
        return y[0] - math.log(0.5)

    starts.direction = 1.0
    found = solve_ivp(field, (0, 600), [math.log(1e-3), 0.0], method="LSODA", rtol=1e-12, atol=1e-12, events=starts)
    system = made({"I": "I*(N - 1) + s", "N": "0.01*(2 - N - N*I)"}, {"s": 1e-15}, "I - 0.5")
    np.testing.assert_allclose(times(system, [1e-3, 0.0], 600.0), found.t_events[0], rtol=1e-8)


def test_state_that_starts_at_zero_stays_there_exactly():
    system = made({"x": "x*(1 - x - y)", "y": "y*(x - 0.5)"})
    assert simulate(system, x0=[0.5, 0.0], t_end=500.0)(500.0)[1] == 0.0
    assert Ensemble(system, interval=10.0).strobe([[0.5, 0.0]], count=50)[0][0, 1] == 0.0


def test_what_decays_below_all_doubles_costs_no_steps_any_more():
    system = made({"x": "-100*x*(1 + y**2)", "y": "w", "w": "-y"})
    short, long = (simulate(system, x0=[1.0, 1.0, 0.0], t_end=t) for t in (20.0, 200.0))
    assert long.x_end[0] == 0.0
    assert long.step_times.size - short.step_times.size < 1000  # as many as the oscillation takes alone


def test_an_absolute_tolerance_that_is_given_holds_for_all_states():
    system = made(PREDATOR, {"K": 15.0}, "N - 1")
    motion = simulate(system, x0=[1.0, 1.0], t_end=60.0, tolerance=(1e-10, 1e-6))
    assert motion.tolerance == (1e-10, 1e-6)
    assert motion.step_times.size < simulate(system, x0=[1.0, 1.0], t_end=60.0).step_times.size


@pytest.mark.parametrize("index", guarding(range(100), 0, 1, 3, 6, campaign=20))
@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e9])
def test_random_populations_are_those_of_their_logarithms(index, unit):
    growth = growths(100)[index]
    system, periods = growth.system(unit), {"periods": 12} if growth.every else {"t_end": growth.time}
    motion = simulate(system, x0=[unit * x for x in growth.start], **periods)
    logs = growth.logarithms()
    found = np.log(motion.x_end[: logs.size] / unit)
    # errors of the motion grow as those of nearby starts do
    moved = simulate(system, x0=[unit * x * (1.0 + 1e-8) for x in growth.start], **periods)
    growing = np.abs(np.log(moved.x_end[: logs.size] / unit) - found) / 1e-8
    assert np.all(np.abs(found - logs) <= 1e-7 * (1.0 + growing.max()))


@pytest.mark.parametrize("index", guarding(range(100), 0, 1, campaign=10))
def test_lanes_follow_random_populations_as_simulation_does(index):
    growth = growths(100)[index]
    system = growth.system()
    if growth.every:
        ends, _ = Ensemble(system, tolerance=1e-11).strobe([growth.start], count=12)
    else:
        ends, _ = Ensemble(system, interval=growth.time / 10, tolerance=1e-11).strobe([growth.start], count=10)
    logs = growth.logarithms()
    np.testing.assert_allclose(np.log(ends[0]), logs, rtol=0, atol=1e-5 * np.abs(logs).max())
