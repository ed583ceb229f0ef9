"""Orbits that pass a surface of their mode as a whole, as rests and circular whirls do."""

from __future__ import annotations

import math

import numpy as np
import pytest

from saltus import (
    ConvergenceError,
    HybridSystem,
    Mode,
    StepControl,
    Transition,
    continue_locus,
    continue_orbit,
    find_orbit,
    grazing_orbits,
    load,
    solve_orbit,
    switch_branch,
)

BEYOND = "a segment lies wholly beyond an event of its mode"


def threshold(direction, when=None):
    """A state that rests at p, pulled back beyond d by k in the other mode; y rests at q."""
    low = {"x": "r*(p - x)", "y": "r*(q - y)"}
    return HybridSystem(
        ("x", "y"),
        {"p": 0.1, "q": 1.0, "d": 1.0, "k": 5.0, "r": 1.0, "w": 1.0},
        {"low": Mode(low), "high": Mode({**low, "x": "r*(p - x - k*(x - d))"})},
        [
            Transition("low", "high", "x - d", direction, when=when, name="rise"),
            Transition("high", "low", "x - d", -direction, name="fall"),
        ],
        phase=("s", "w"),
    )


@pytest.fixture(scope="module")
def rising():
    return threshold(1, "y - 0.5")


@pytest.fixture(scope="module")
def whirl():
    """A cycle of radius sqrt(mu) about the origin, held back in contact beyond radius sqrt(d)."""
    fields = {}
    for mode, force in {"free": "0", "contact": "k*(x**2 + y**2 - d)"}.items():
        growth = f"(mu - x**2 - y**2 - ({force}))"
        fields[mode] = Mode({"x": f"x*{growth} - y", "y": f"y*{growth} + x"})
    surface = "x**2 + y**2 - d"
    return HybridSystem(
        ("x", "y"),
        {"mu": 0.5, "d": 1.0, "k": 3.0},
        fields,
        [Transition("free", "contact", surface, 1), Transition("contact", "free", surface, -1)],
    )


def grazings(branch):
    return [point.parameters[branch.parameter] for point in branch.special_points if point.type == "GR"]


UNITS = [1.0, 1e-9, 1e6]


@pytest.mark.parametrize("unit", UNITS)
def test_a_rest_that_passes_a_threshold_goes_on_in_the_mode_beyond(rising, unit):
    rate = {"d": unit, "r": 1.0 / unit, "w": 1.0 / unit}
    orbit = find_orbit(rising, rate | {"p": 0.1 * unit}, [0.3 * unit, 1.0])
    branch = continue_orbit(orbit, "p", (0.0, 3.0 * unit))
    assert grazings(branch) == pytest.approx([unit], rel=1e-10)
    last = branch.solution(-1)
    assert last.signature == (("high", "s"),)
    assert last.x0[0] == pytest.approx((3.0 + 5.0) / 6.0 * unit, rel=1e-10)
    assert last.admissible
    assert last.multipliers[0] == pytest.approx(math.exp(-2.0 * math.pi), rel=1e-8)
    found = find_orbit(rising, rate | {"p": 3.0 * unit}, [0.3 * unit, 1.0])
    assert found.signature == last.signature
    back = continue_orbit(last, "p", (0.0, 3.0 * unit))
    assert grazings(back) == pytest.approx([unit], rel=1e-10)
    assert back.solution(0).signature == (("low", "s"),)


def test_a_rest_beyond_a_threshold_is_no_motion(rising):
    branch = continue_orbit(find_orbit(rising, {}, [0.3, 1.0]), "p", (0.0, 3.0), steps=StepControl(at_grazing="pass"))
    assert grazings(branch) == pytest.approx([1.0], abs=1e-10)
    np.testing.assert_array_equal(branch.admissible, branch.values <= 1.0)
    assert branch.solution(-1).reasons == (BEYOND,)
    assert solve_orbit(rising, {"p": 3.0}, [("low", "s", [3.0, 1.0], 2.0 * math.pi)]).reasons == (BEYOND,)
    with pytest.raises(ConvergenceError, match=BEYOND):
        find_orbit(rising, {"p": 3.0}, [2.5, 1.0], mode="low", settle=200)


def test_a_threshold_whose_condition_fails_is_passed_freely(rising):
    branch = continue_orbit(find_orbit(rising, {"q": 0.2}, [0.3, 0.2]), "p", (0.0, 3.0))
    assert not branch.special_points
    assert branch.solution(-1).signature == (("low", "s"),)
    assert branch.admissible.all()


def test_the_locus_of_rests_on_a_threshold_is_the_threshold(rising):
    branch = continue_orbit(find_orbit(rising, {}, [0.3, 1.0]), "p", (0.0, 3.0))
    locus = continue_locus(branch["GR1"], ("p", "d"), {"p": (0.2, 3.0), "d": (0.5, 2.0)})
    np.testing.assert_allclose(locus.values[:, 0], locus.values[:, 1], atol=1e-10)
    assert np.ptp(locus.values[:, 1]) == pytest.approx(1.5)
    assert [orbit.signature for orbit in grazing_orbits(branch["GR1"])] == [(("low", "s"),), (("high", "s"),)]


def test_a_threshold_in_either_direction_is_passed_both_ways():
    system = threshold(0)
    branch = continue_orbit(find_orbit(system, {}, [0.3, 1.0], mode="low"), "p", (0.0, 3.0))
    assert branch.signature(len(branch) - 1) == (("high", "s"),)
    back = continue_orbit(branch.solution(-1), "p", (0.0, 3.0))
    assert back.signature(0) == (("low", "s"),)
    assert (back.values[0], back.values[-1]) == pytest.approx((0.0, 3.0), abs=1e-12)
    assert grazings(branch) == pytest.approx([1.0], abs=1e-10)
    assert grazings(back) == pytest.approx([1.0], abs=1e-10)


def test_a_circular_whirl_comes_into_contact_all_round(whirl):
    branch = continue_orbit(find_orbit(whirl, {}, [0.7, 0.0]), "mu", (0.5, 2.0))
    assert grazings(branch) == pytest.approx([1.0], abs=1e-9)
    last = branch.solution(-1)
    assert last.signature == (("contact", ""),)
    assert np.sum(last.x0**2) == pytest.approx((2.0 + 3.0) / 4.0, abs=1e-10)
    locus = continue_locus(branch["GR1"], ("mu", "d"), {"mu": (0.3, 2.0), "d": (0.3, 2.0)})
    np.testing.assert_allclose(locus.values[:, 0], locus.values[:, 1], atol=1e-9)


def test_a_motion_with_events_changes_all_its_modes():
    """A ball that jumps on a table and drifts sideways: impacts in each of two modes."""
    height, jump = "z - a*sin(s)", {"v": "-e*v + (1 + e)*a*w*cos(s)"}
    fall = {"z": "v", "v": "-g"}
    system = HybridSystem(
        ("x", "z", "v"),
        {"p": 0.1, "g": 1.0, "e": 0.5, "a": 1.1, "w": 1.0},
        {"low": Mode({"x": "p - x", **fall}), "high": Mode({"x": "p - x - 5*(x - 1)", **fall})},
        [
            *(Transition(mode, mode, height, -1, jump, name=f"hit_{mode}") for mode in ("low", "high")),
            Transition("low", "high", "x - 1", 1),
            Transition("high", "low", "x - 1", -1),
        ],
        phase=("s", "w"),
    )
    orbit = find_orbit(system, {}, [0.3, 1.035, 3.0])
    branch = continue_orbit(orbit, "p", (0.0, 3.0))
    assert grazings(branch) == pytest.approx([1.0], abs=1e-10)
    last = branch.solution(-1)
    assert last.signature == (("high", "hit_high"),)
    assert last.x0[0] == pytest.approx(8.0 / 6.0, abs=1e-10)
    assert last.admissible


@pytest.mark.parametrize("event", ["x - 1", "v + 5"])
def test_a_wall_met_by_a_rest_ends_the_branch(event):
    stop = Transition("on", "on", "x - 1", 1, {"v": "-v/2"}, name="stop")
    counter = Transition("on", "on", "x - 1", 1, name="counter")
    system = HybridSystem(
        ("x", "v"),
        {"p": 0.1},
        {"on": Mode({"x": "v", "v": "p - x - 0.3*v"})},
        [stop if event == "x - 1" else counter],
        phase=("s", "1"),
    )
    branch = continue_orbit(find_orbit(system, {}, [0.3, 0.0]), "p", (0.0, 3.0))
    if event == "x - 1":
        assert grazings(branch) == pytest.approx([1.0], abs=1e-10)
        assert "the whole orbit meets the surface of 'stop'" in branch.stopped[1]
    else:
        assert not branch.special_points
        assert branch.values[-1] == pytest.approx(3.0)


def test_a_field_that_jumps_at_the_threshold_ends_the_branch():
    system = HybridSystem(
        ("x",),
        {"p": 0.1},
        {"on": Mode({"x": "p - x"}), "off": Mode({"x": "p - 2 - x"})},
        [Transition("on", "off", "x - 1", 1, name="hot"), Transition("off", "on", "x + 1", -1)],
        phase=("s", "1"),
    )
    branch = continue_orbit(find_orbit(system, {}, [0.3], mode="on"), "p", (0.0, 3.0))
    assert grazings(branch) == pytest.approx([1.0], abs=1e-10)
    assert "the field jumps on the surface of 'hot'" in branch.stopped[1]


def test_a_motion_that_starts_beyond_an_event_and_comes_back_is_admissible():
    """A pendulum is pushed from x = 0 to x = 0.2 on its way up, and swings freely back over both."""
    swing = "-x - 0.1*v"
    system = HybridSystem(
        ("x", "v"),
        {"F": 0.5},
        {"free": Mode({"x": "v", "v": swing}), "push": Mode({"x": "v", "v": f"{swing} + F"})},
        [Transition("free", "push", "x", 1), Transition("push", "free", "x - 0.2", 1)],
    )
    with pytest.warns(RuntimeWarning, match="'push_to_free' lands beyond event 'free_to_push' of mode 'free'"):
        orbit = find_orbit(system, {}, [0.1, 1.0], mode="push")
    assert orbit.admissible
    assert len(orbit.segments) == 2


@pytest.mark.parametrize(("landing", "reasons"), [(0.5, ()), (1.5, (BEYOND,))])
def test_a_transition_that_lands_beyond_an_event_for_good_is_told(landing, reasons):
    """A neuron whose refractory time may end above its threshold, where it would never fire."""
    system = HybridSystem(
        ("V", "t"),
        {"V0": 0.5},
        {"active": Mode({"V": "-V/10", "t": "1"}), "refractory": Mode({"V": "0", "t": "1"})},
        [
            Transition("active", "refractory", "V - 1", 1, {"V": "0", "t": "0"}, name="fires"),
            Transition("active", "refractory", "t - 1", 1, {"t": "0"}, name="tires"),
            Transition("refractory", "active", "t - 1", 1, {"V": "V0", "t": "0"}, name="wakes"),
        ],
    )
    guess = [("active", "tires", [landing, 0.0], 1.0), ("refractory", "wakes", [landing, 0.0], 1.0)]
    assert solve_orbit(system, {"V0": landing}, guess).reasons == reasons


# orbits at rest


def test_a_branch_through_the_origin_continues(rising):
    orbit = solve_orbit(rising, {"p": 0.0, "q": 0.0}, [("low", "s", [0.0, 0.0], 2.0 * math.pi)])
    for reach in (1.0, 1e-9):
        branch = continue_orbit(orbit, "p", (-reach / 2.0, reach / 2.0))
        np.testing.assert_allclose(branch.x0[:, 0], branch.values, atol=1e-12 * reach)
        assert (branch.values[0], branch.values[-1]) == (-reach / 2.0, reach / 2.0)
        assert len(branch) < 100


@pytest.fixture(scope="module")
def pitchfork():
    return HybridSystem(("x",), {"p": -0.5, "b": 1.0}, {"m": Mode({"x": "p*x - b*x**3"})}, phase=("s", "1"))


def test_the_other_branch_at_a_pitchfork_in_the_origin(pitchfork):
    rest = solve_orbit(pitchfork, {}, [("m", "s", [0.0], 2.0 * math.pi)])
    branch = continue_orbit(rest, "p", (-1.0, 1.0))
    assert branch["BP1"].parameters["p"] == pytest.approx(0.0, abs=1e-10)
    other = continue_orbit(switch_branch(branch["BP1"]), "p", (-1.0, 1.0))
    np.testing.assert_allclose(other.x0[:, 0] ** 2, other.values, atol=1e-10)
    assert abs(other.x0[-1, 0]) == pytest.approx(1.0, abs=1e-10)


def test_a_branch_along_which_the_parameter_rests_has_no_folds(pitchfork):
    rest = solve_orbit(pitchfork, {"b": 0.0}, [("m", "s", [0.0], 2.0 * math.pi)])
    branch = continue_orbit(rest, "p", (-1.0, 1.0))
    family = continue_orbit(switch_branch(branch["BP1"]), "p", (-1.0, 1.0), steps=StepControl(max_points=60))
    assert np.abs(family.values).max() < 1e-12
    assert np.abs(family.x0).max() > 0.5
    assert not family.special_points.of_type("SN")


def test_a_pitchfork_is_no_family(pitchfork):
    with pytest.raises(ConvergenceError, match="singular"):
        solve_orbit(pitchfork, {"p": 0.0}, [("m", "s", [0.0], 2.0 * math.pi)])


@pytest.mark.campaign
def test_a_hopf_locus_of_an_orbit_at_rest_is_that_of_the_brusselator():
    system = HybridSystem(
        ("x", "y"),
        {"A": 1.0, "B": 1.5},
        {"m": Mode({"x": "A - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"})},
        phase=("s", "2.3"),
    )
    branch = continue_orbit(find_orbit(system, {}, [1.1, 1.6]), "B", (0.5, 2.5))
    assert branch["TR1"].parameters["B"] == pytest.approx(2.0, abs=1e-9)
    locus = continue_locus(branch["TR1"], ("A", "B"), {"A": (0.8, 1.1), "B": (0.5, 5.0)})
    A, B = locus.values.T
    np.testing.assert_allclose(B, 1.0 + A**2, atol=1e-9)
    assert (A.min(), A.max()) == pytest.approx((0.8, 1.1))


# starts at a grazing


@pytest.mark.parametrize("side", [0, 1])
def test_a_start_at_a_grazing_shows_no_bifurcation_of_rounding(side):
    """An oscillator that touches a soft stop; its multipliers' product is exp(-c T), so that it has no torus."""
    force = "-x - c*v + A*cos(s)"
    system = HybridSystem(
        ("x", "v"),
        {"c": 0.1, "K": 5.0, "w": 1.1, "A": 0.2},
        {"free": Mode({"x": "v", "v": force}), "contact": Mode({"x": "v", "v": f"{force} - K*(x - 1)"})},
        [Transition("free", "contact", "x - 1", 1), Transition("contact", "free", "x - 1", -1)],
        phase=("s", "w"),
    )
    linear = 1.0 / complex(1.0 - 1.1**2, 0.1 * 1.1)
    start = [0.2 * linear.real, 0.2 * 1.1 * linear.imag]
    rest = solve_orbit(system, {}, [("free", "s", start, 2.0 * math.pi / 1.1)])
    branch = continue_orbit(rest, "A", (0.1, 3.0))
    assert grazings(branch) == pytest.approx([1.0 / abs(linear)], abs=1e-10)
    folds = [p.parameters["A"] for p in branch.special_points.of_type("SN")]
    again = continue_orbit(grazing_orbits(branch["GR1"])[side], "A", (0.1, 3.0))
    assert {p.type for p in again.special_points} == {"GR", "SN"}
    assert sorted(p.parameters["A"] for p in again.special_points.of_type("SN")) == pytest.approx(sorted(folds))


@pytest.mark.parametrize("lag", [0.0, 1e-3, 0.3])
@pytest.mark.parametrize("side", [1, -1])
def test_a_touch_from_either_side_is_located_wherever_the_phase_begins(side, lag):
    """x = p cos(s - lag) lies below 1, or above -1; from p = 1 on the event happens on a way down."""
    field = {"x": "-x + side*p*(cos(s - lag) - sin(s - lag))", "y": "1 - y"}
    events = [Transition("m", "m", "x - side", -1, {"y": "y/2"}, name="fall")]
    parameters = {"p": 0.5, "side": side, "lag": lag}
    system = HybridSystem(("x", "y"), parameters, {"m": Mode(field)}, events, phase=("s", "1"))
    start = find_orbit(system, {}, x0=[0.0, 1.0])
    for most in (0.02, 0.1, 0.3):
        branch = continue_orbit(start, "p", (0.2, 3.0), steps=StepControl(largest=most))
        assert branch["GR1"].parameters["p"] == pytest.approx(1.0, abs=1e-9)
        quiet = [orbit for orbit in map(branch.solution, range(len(branch))) if orbit.signature == (("m", "s"),)]
        assert all(orbit.parameters["p"] < 1.0 + 1e-9 for orbit in quiet if orbit.admissible)
    falling = find_orbit(system, {"p": 1.0001}, x0=[0.0, 1.0])
    assert falling.signature == (("m", "fall"),)


@pytest.mark.parametrize("step", [0.001, 0.01, 0.1])
def test_a_reset_that_lands_on_the_far_side_of_an_event_of_either_direction_is_not_admissible(step):
    """From 1 the state is set to q, and rises again: for q below 0 it meets the surface at 0 first."""
    field = {"x": "1", "y": "1 - y"}
    events = [Transition("m", "m", "x*(x - 1)", 0, {"x": "q*x*x"}, name="edge")]
    system = HybridSystem(("x", "y"), {"q": 0.2}, {"m": Mode(field)}, events)
    branch = continue_orbit(find_orbit(system, {}, x0=[0.5, 1.0]), "q", (-0.5, 0.5), steps=StepControl(largest=step))
    admissible = [o.parameters["q"] for o in map(branch.solution, range(len(branch))) if o.admissible]
    assert min(admissible) == pytest.approx(0.0, abs=1e-6)
    assert min(admissible) >= -1e-9


def test_an_orbit_beyond_a_surface_can_be_saved_and_read_again(rising, tmp_path):
    low = find_orbit(rising, {}, x0=[0.1, 1.0])
    beyond = solve_orbit(rising, {"p": 2.0}, [(s.mode, s.transition, s.state, s.duration) for s in low.segments])
    assert beyond.reasons == (BEYOND,)
    assert load(beyond.save(tmp_path / "orbit.nc")) == beyond


def test_a_long_signature_is_shown_in_short():
    field, events = (
        {"x": "cos(s) - x/10", "y": "1 - y"},
        [Transition("m", "m", "sin(20*x)", 1, {"y": "y/2"}, name="tick")],
    )
    orbit = find_orbit(HybridSystem(("x", "y"), {}, {"m": Mode(field)}, events, phase=("s", "1")), {}, x0=[0.5, 1.0])
    assert len(orbit.signature) > 4
    assert f"m:tick ({len(orbit.signature)} times)" in repr(orbit)
