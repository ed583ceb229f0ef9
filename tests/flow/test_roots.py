"""Roots of negative arguments: told where a motion comes to them, and nothing told of what only rounds below 0."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

from saltus import (
    HybridSystem,
    Map,
    Mode,
    Piece,
    Transition,
    find_equilibrium,
    find_orbit,
    iterate,
    run_sweep,
    simulate,
    solve_orbit,
)
from saltus.ensemble.ensemble import Ensemble
from saltus.ensemble.labels import DIVERGED
from saltus.ensemble.map_ensemble import MapEnsemble
from saltus.ensemble.traps import Traps
from saltus.errors import DivergenceError, MapDivergenceError
from saltus.options import SweepOptions
from selection import guarding

TOLERANCES = (1e-12, 1e-10, 1e-8, 1e-5, 1e-3)
POWERS = {"sqrt(x)": 0.5, "x**0.3": 0.3, "x**(1/3)": 1 / 3, "x**0.9": 0.9, "x**n": 0.5}


def smooth(field, parameters=None):
    return HybridSystem.smooth(field, parameters or {"a": 1.0})


@pytest.mark.parametrize(("power", "tolerance"), guarding(
    [(power, tolerance) for power in POWERS for tolerance in TOLERANCES], ("sqrt(x)", 1e-10), ("x**0.9", 1e-12)
))  # fmt: skip
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_motion_that_comes_to_rest_at_the_zero_of_a_root_stays_there(power, tolerance, unit):
    # in units of x and time: x' = -x**q from 1 is at 0 from the time 1/(1 - q) on
    q = POWERS[power]
    system = smooth({"x": f"-a*{power}", "y": "-y/t"}, {"a": unit ** (1.0 - q), "n": q, "t": 1.0})
    motion = simulate(system, x0=[unit, 1.0], t_end=20.0, tolerance=tolerance)
    assert abs(motion.x_end[0]) <= 100.0 * max(tolerance, 1e-10) * unit
    half = 0.5 / (1.0 - q)
    assert motion(half)[0] / unit == pytest.approx((1.0 - (1.0 - q) * half) ** (1.0 / (1.0 - q)), rel=100.0 * tolerance)


@pytest.mark.parametrize("tolerance", guarding(TOLERANCES, 1e-10))
@pytest.mark.parametrize(("power", "q"), [("sqrt(x)", 0.5), ("x**0.7", 0.7), ("x**n", 0.5), ("x**(3/2)", 1.5)])
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_argument_that_goes_negative_ends_the_motion_where_it_does(power, q, unit, tolerance):
    # x = unit - unit*t is 0 at t = 1; the integral of (1 - t)**q from 0 to 1 is 1/(1 + q)
    system = smooth({"x": "-a", "y": power}, {"a": unit, "n": q})
    with pytest.raises(DivergenceError) as caught:
        simulate(system, x0=[unit, 0.0], t_end=3.0, tolerance=tolerance)
    error = caught.value
    assert error.time == pytest.approx(1.0, abs=30.0 * tolerance + 1e-10)
    assert error.state[1] == pytest.approx(unit**q / (1.0 + q), rel=1e3 * tolerance)
    assert f"in {power}" in str(error)
    assert "x is -" in str(error)


def test_message_names_expression_value_and_what_to_define():
    told = (
        r"at t = 1\.00000000\d* in mode 'smooth', state .*: the argument of a root is negative: "
        r"b - x is -\S+ in sqrt\(b - x\); define a mode, and a transition at b - x = 0, where it is negative"
    )
    with pytest.raises(DivergenceError, match=told):
        simulate(smooth({"x": "1", "y": "3*sqrt(b - x)"}, {"b": 1.0}), x0=[0.0, 0.0], t_end=3.0)


def test_root_that_is_0_below_0_by_its_formula_is_followed():
    motion = simulate(smooth({"x": "-a", "y": "sqrt((x + abs(x))/2)"}), x0=[1.0, 0.0], t_end=3.0)
    assert motion.x_end == pytest.approx([-2.0, 2.0 / 3.0], rel=1e-8)


@pytest.mark.parametrize("rate", ["sqrt(abs(x))", "sqrt(x**2 + a)", "(x**2)**0.3", "x**2", "x**n", "abs(x)**n/a"])
def test_powers_of_what_is_not_negative_and_whole_powers_are_followed(rate):
    system = smooth({"x": "-a", "y": rate}, {"a": 1.0, "n": 3.0})
    assert simulate(system, x0=[1.0, 0.0], t_end=3.0).x_end[0] == pytest.approx(-2.0)


def test_orifice_flows_both_ways():
    # two vessels: with d = x - y, d' = -2 sqrt(d), so that sqrt(d) falls by 1 in a unit of time
    system = smooth({"x": "-sign(x - y)*sqrt(abs(x - y))", "y": "sign(x - y)*sqrt(abs(x - y))"})
    for d in (1.0, -1.0):
        motion = simulate(system, x0=[2.0 + d / 2.0, 2.0 - d / 2.0], t_end=0.9)
        assert motion.x_end[0] - motion.x_end[1] == pytest.approx(d * 0.01, rel=1e-6)


def test_refuge_of_a_prey_that_lives_is_followed():
    # x' = x (1 - x) - y sqrt(x), y' = y (sqrt(x)/2 - m): sqrt(x) = 2 m
    system = smooth({"x": "x*(1 - x) - y*sqrt(x)", "y": "y*(0.5*sqrt(x) - m)"}, {"m": 0.4})
    motion = simulate(system, x0=[0.5, 0.5], t_end=400.0)
    assert motion.x_end == pytest.approx([0.64, 0.8 * 0.36], rel=1e-5)


def test_contact_whose_force_begins_at_the_surface_is_followed():
    # Hertz: v^2/2 + 2/5 d^(5/2) is constant in contact, so that the ball leaves as fast as it came
    system = HybridSystem(
        ("z", "v"), {"k": 1.0},
        {"free": Mode({"z": "v", "v": "-1"}), "contact": Mode({"z": "v", "v": "k*(-z)**1.5"})},
        [Transition("free", "contact", "z", -1), Transition("contact", "free", "z", 1)],
    )  # fmt: skip
    events = simulate(system, x0=[1.0, 0.0], t_end=40.0).events
    assert len(events) > 6
    assert np.abs(events["before"][:, 1]) == pytest.approx(math.sqrt(2.0), rel=1e-7)


def test_root_of_a_reset_is_told():
    bounce = Transition("flight", "flight", "z", -1, {"v": "sqrt(v**2 - c)"}, name="hit")
    ball = HybridSystem(("z", "v"), {"c": 0.9}, {"flight": Mode({"z": "v", "v": "-1"})}, [bounce])
    # v^2 is 2 at the first hit, 1.1 at the second, 0.2 at the third
    with pytest.raises(DivergenceError, match=r"-c \+ v\*\*2 is -0.7 in sqrt") as caught:
        simulate(ball, x0=[1.0, 0.0], t_end=20.0)
    assert caught.value.state[1] == pytest.approx(-math.sqrt(0.2), rel=1e-9)


FORCED = HybridSystem(("y",), {"b": 1.5, "w": 1.0}, {"m": Mode({"y": "sqrt(b + cos(s)) - y"})}, phase=("s", "w"))


def test_orbit_is_found_with_a_root_and_refused_beyond_its_end():
    orbit = find_orbit(FORCED, x0=[1.0])
    assert orbit.admissible
    with pytest.raises(DivergenceError, match=r"in sqrt\(b \+ cos\(s\)\)") as caught:
        find_orbit(FORCED, {"b": 0.5}, x0=[1.0])
    assert caught.value.time == pytest.approx(math.acos(-0.5), rel=1e-6)
    steep = HybridSystem(("y",), {"b": 1.5, "w": 1.0}, {"m": Mode({"y": "(b + cos(s))**1.5 - y"})}, phase=("s", "w"))
    segment = ("m", None, [*orbit.x0, 0.0], 2.0 * math.pi)
    beyond = solve_orbit(steep, {"b": 0.5}, [segment])
    assert not beyond.admissible
    found = re.fullmatch(r"the argument of a root is negative: b \+ cos\(s\) is (\S+) in .*", beyond.reasons[0])
    assert float(found[1]) == pytest.approx(-0.5, rel=1e-2)


def test_sweep_and_lanes_end_where_a_root_does():
    values = [0.5, 0.9, 1.1, 1.5]
    for follow in ("up", "restart"):
        sweep = run_sweep(FORCED, "b", values, x0=[1.0], options=SweepOptions(discard=20, keep=20, follow=follow))
        assert sweep.labels[0].tolist() == ["diverged", "diverged", "period-1", "period-1"]
    ends, _ = Ensemble(smooth({"x": "-a", "y": "sqrt(x) - y"}), interval=1.0).strobe([[1.5, 0.0], [4.5, 0.0]], count=3)
    assert np.isnan(ends[0]).all()
    assert ends[1, 0] == pytest.approx(1.5)


def test_equilibrium_at_which_a_root_has_no_value_is_virtual():
    # with 0 for the root x = -b would be an equilibrium
    system = smooth({"x": "-b - x + (x + c)**1.5"}, {"b": 1.0, "c": 0.5})
    assert "x + c is -0.5" in find_equilibrium(system, x0=[-0.9]).reasons[0].replace("c + x", "x + c")
    regular = find_equilibrium(system, {"b": 0.0, "c": 0.1}, x0=[0.05])
    x = float(regular.state[0])
    assert regular.regular
    assert (x + 0.1) ** 1.5 == pytest.approx(x, rel=1e-9)


def test_map_ends_where_its_image_has_no_value():
    system = Map(("x",), {"r": 0.3}, {"x": "sqrt(x) - r"})
    x, count = 1.0, 0
    while x >= 0.0:
        x, count = math.sqrt(x) - 0.3, count + 1
    with pytest.raises(MapDivergenceError, match=r"in sqrt\(x\)") as caught:
        iterate(system, x0=[1.0], n=100)
    assert (caught.value.step, caught.value.state[0]) == (count, pytest.approx(x, rel=1e-9))
    # x = sqrt(x) - r
    assert find_orbit(system, {"r": 0.2}, x0=[1.0]).x0[0] == pytest.approx((0.5 + math.sqrt(0.05)) ** 2, rel=1e-12)


def test_piece_that_takes_roots_on_its_side_alone_is_iterated():
    pieces = {"hit": Piece({"x": "-a*sqrt(x) - 0.1"}, "x"), "free": Piece({"x": "0.5*x + 0.3"}, "-x")}
    states = iterate(Map(("x",), {"a": 0.4}, pieces=pieces), x0=[0.7], n=50).states[:, 0]
    x = 0.7
    for found in states:
        assert found == pytest.approx(x, abs=1e-12)
        x = -0.4 * math.sqrt(x) - 0.1 if x > 0.0 else 0.5 * x + 0.3


def test_motions_of_a_map_end_each_for_itself_where_a_root_does():
    ends, _ = MapEnsemble(Map(("x",), {}, {"x": "sqrt(x) - 3/10"})).strobe([[0.5], [0.04], [0.16]], count=2)
    assert np.isnan(ends).ravel().tolist() == [False, True, False]
    assert ends[2, 0] == pytest.approx(math.sqrt(0.1) - 0.3)
    labels, _ = MapEnsemble(Map(("x",), {}, {"x": "sqrt(x) - 3/10"})).settle([[0.5], [0.04]], Traps(1), longest=100)
    assert labels.tolist() == [DIVERGED, DIVERGED]


@pytest.mark.parametrize("names", [("x", "y", "z"), ("v0", "v1", "v2"), ("v2", "v0", "v1"), ("r0", "v1", "c_0")])
def test_rounding_of_an_event_does_not_depend_on_the_names_of_states(names):
    a, b, c = names
    event = f"cos({a} + {b}**2 - {c}) - {b}*exp({c})"
    watch = Transition("on", "on", event, 1, name="watch")
    system = HybridSystem(names, {"k": 1.0}, {"on": Mode({a: "k", b: "-k", c: "0"})}, [watch])
    out, errors = np.empty(1), [1e6, 2e6, 3e6]
    p = system.compiled.extended(system.parameter_vector({}))
    system.compiled.call("rounding", 0, 0, np.array([0.3, 0.7, -0.4, *errors]), p, out)
    # to first order: |sin(u)| (e_a + 2 b e_b + e_c) + exp(c) (e_b + b e_c), beside which a few roundings are nothing
    u = 0.3 + 0.7**2 + 0.4
    carried = math.sin(u) * (1e6 + 1.4 * 2e6 + 3e6) + math.exp(-0.4) * (2e6 + 0.7 * 3e6)
    assert out[0] == pytest.approx(carried, rel=1e-4)
