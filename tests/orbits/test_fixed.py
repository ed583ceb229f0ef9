"""Orbits of which a quantity is fixed: conservative ones against closed forms, others against plain branches."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.special import ellipk

from saltus import ConvergenceError, HybridSystem, InputError, Mode, Transition, continue_orbit, load, solve_orbit

SWINGS = (0.1, 0.5, 1.0, 2.0, 3.0, 3.1)


def swing(x):
    """Period of a pendulum of that amplitude."""
    return 4.0 * ellipk(math.sin(x / 2.0) ** 2)


def duffing(a):
    """Period of x'' = -x - x^3 of that amplitude."""
    return 4.0 * ellipk(a * a / (2.0 * (1.0 + a * a))) / math.sqrt(1.0 + a * a)


@pytest.fixture(scope="module")
def pendulum():
    return HybridSystem.smooth({"x": "v", "v": "-sin(x)"}, outputs={"energy": "v**2/2 - cos(x)"}, name="pendulum")


@pytest.fixture(scope="module")
def hardening():
    """x'' = -k x - b x^3 + c v."""
    return HybridSystem.smooth({"x": "v", "v": "-k*x - b*x**3 + c*v"}, {"k": 1.0, "b": 1.0, "c": 0.0})


@pytest.fixture(scope="module")
def ball():
    flight, hit = Mode({"z": "v", "v": "-g"}), Transition("flight", "flight", "z", -1, {"v": "-e*v"}, name="hit")
    return HybridSystem(("z", "v"), {"g": 1.0, "e": 1.0}, {"flight": flight}, [hit])


@pytest.fixture(scope="module")
def driven():
    field = {"x": "v", "v": "-0.1*v - x - x**3 + A*cos(s)"}
    return HybridSystem.smooth(field, {"A": 0.3, "w": 1.2}, phase=("s", "w"))


@pytest.mark.parametrize("a", SWINGS)
@pytest.mark.parametrize("quantity", ["max_x", "period", "energy"])
def test_swings_of_a_pendulum_have_the_period_of_the_elliptic_integral(pendulum, a, quantity):
    value = {"max_x": a, "period": swing(a), "energy": -math.cos(a)}[quantity]
    orbit = solve_orbit(pendulum, x0=[0.9 * a, 0.0], period=swing(0.9 * a), fix={quantity: value})
    assert orbit.period == pytest.approx(swing(a), rel=1e-9)
    assert orbit.max["x"] == pytest.approx(a, rel=1e-9)
    assert np.abs(orbit.multipliers - 1.0).max() < 1e-7
    assert (orbit.admissible, orbit.stable, orbit.fixed.family) == (True, True, True)


@pytest.mark.campaign
@pytest.mark.parametrize("a", [3.0, 3.1])
def test_a_far_guess_does_not_lead_into_another_well(pendulum, a):
    orbit = solve_orbit(pendulum, x0=[0.5 * a, 0.0], period=swing(0.5 * a), fix={"period": swing(a)})
    assert orbit.max["x"] == pytest.approx(a, rel=1e-9)


@pytest.mark.parametrize(("quantity", "value"), [("period", 3.0), ("max_z", 1.125), ("velocity(hit)", -1.5)])
@pytest.mark.parametrize("free", [None, "e"])
def test_jumps_of_an_elastic_ball(ball, quantity, value, free):
    orbit = solve_orbit(ball, {}, [("flight", "hit", [0.0, 1.0], 2.0)], fix={quantity: value}, free=free)
    assert (orbit.period, orbit.max["z"]) == pytest.approx((3.0, 1.125), rel=1e-12)
    assert (orbit.parameters["e"], orbit.fixed.family) == (1.0, True)
    assert np.abs(orbit.multipliers - 1.0).max() < 1e-9


@pytest.mark.parametrize("free", [None, "c"])
@pytest.mark.parametrize(("length", "time"), [(1.0, 1.0), (1e-9, 1e-6)])
def test_a_hardening_spring_in_any_units_with_a_damping_freed_or_not(hardening, free, length, time):
    values = {"k": time**-2, "b": time**-2 * length**-2}
    x0, period = [length, 0.0], 5.0 * time
    for fix in ({"max_x": 1.5 * length}, {"period": duffing(1.5) * time}, {"mean(v**2)": (length / time) ** 2}):
        orbit = solve_orbit(hardening, values, x0=x0, period=period, fix=fix, free=free)
        assert orbit.period / time == pytest.approx(duffing(orbit.max["x"] / length), rel=1e-9)
        if "mean(v**2)" in fix:
            assert orbit.observe(*fix) == pytest.approx(fix, rel=1e-10)
        assert (orbit.parameters["c"], orbit.fixed.free) == (0.0, free or "")


def test_a_linear_centre_is_fixed_by_its_size_not_by_its_period():
    centre = HybridSystem.smooth({"x": "y", "y": "-x"})
    orbit = solve_orbit(centre, x0=[0.5, 0.0], period=6.0, fix={"max_x": 2.0})
    assert (orbit.period, orbit.max["y"]) == pytest.approx((2.0 * math.pi, 2.0), rel=1e-11)
    with pytest.raises(ConvergenceError, match="'period' hardly changes from orbit to orbit there"):
        solve_orbit(centre, x0=[0.5, 0.0], period=6.28, fix={"period": 2.0 * math.pi})


HENON = {"x": "u", "y": "v", "u": "-x - 2*x*y", "v": "-y - x**2 + y**2"}
ENERGY = "(u**2 + v**2 + x**2 + y**2)/2 + x**2*y - y**3/3"


@pytest.mark.parametrize(("x0", "period"), [([0.0, 0.4, 0.0, 0.0], 6.7), ([0.0, 0.0, 0.5, 0.0], 6.7)])
def test_normal_modes_of_henon_and_heiles_close_in_another_solver(x0, period):
    system = HybridSystem.smooth(HENON, outputs={"energy": ENERGY})
    orbit = solve_orbit(system, x0=x0, period=period, fix={"energy": 0.08})
    assert orbit.min["energy"] == pytest.approx(0.08, rel=1e-10) == orbit.max["energy"]

    def field(t, z):
        x, y, u, v = z
        return [u, v, -x - 2 * x * y, -y - x**2 + y**2]

    start = orbit.states[0]
    ends = solve_ivp(field, (0.0, orbit.period), start, method="DOP853", rtol=1e-13, atol=1e-13).y[:, -1]
    assert np.abs(ends - start).max() < 1e-10
    assert np.prod(orbit.multipliers).real == pytest.approx(1.0, rel=1e-7)


def test_an_oscillator_between_an_elastic_wall_and_a_spring():
    """x'' = -x with x < d: the period is 2 pi - 2 acos(d/a) for an amplitude a without the wall."""
    wall = Transition("free", "free", "x - d", 1, {"v": "-v"}, name="wall")
    system = HybridSystem(("x", "v"), {"d": 1.0}, {"free": Mode({"x": "v", "v": "-x"})}, [wall])
    orbit = solve_orbit(system, {}, [("free", "wall", [1.0, -1.0], 4.7)], fix={"min_x": -2.0})
    assert orbit.period == pytest.approx(2.0 * math.pi - 2.0 * math.acos(0.5), rel=1e-11)


def test_a_parameter_is_found_at_which_an_orbit_has_a_maximum(driven):
    branch = continue_orbit(solve_orbit(driven, x0=[0.5, 0.0]), "A", (0.01, 1.0), events={"max_x": 0.9})
    for label in [point.label for point in branch.special_points if point.type == "max_x"]:
        near = branch[label].orbit
        guess = [value + 0.01 for value in near.x0]
        orbit = solve_orbit(driven, {"A": near.parameters["A"] * 1.02}, x0=guess, fix={"max_x": 0.9}, free="A")
        assert orbit.parameters["A"] == pytest.approx(near.parameters["A"], rel=1e-8)
        assert orbit.max["x"] == pytest.approx(0.9, rel=1e-10)
        assert not orbit.fixed.family


def test_the_period_of_a_driven_orbit_is_fixed_by_its_frequency(driven):
    orbit = solve_orbit(driven, x0=[0.5, 0.0], fix={"period": 5.0}, free="w")
    assert orbit.parameters["w"] == pytest.approx(2.0 * math.pi / 5.0, rel=1e-12)


@pytest.mark.campaign
def test_a_file_keeps_what_was_fixed(pendulum, driven, tmp_path):
    swinging = solve_orbit(pendulum, x0=[1.0, 0.0], period=6.7, fix={"period": 7.0})
    forced = solve_orbit(driven, x0=[0.5, 0.0], fix={"max_x": 0.6}, free="A")
    for orbit in (swinging, forced):
        orbit.save(tmp_path / "orbit.nc")
        assert load(tmp_path / "orbit.nc").fixed == orbit.fixed
        assert str(orbit.fixed) in repr(orbit)


def test_a_smooth_system_is_one_mode():
    system = HybridSystem.smooth({"x": "y", "y": "-k*x"}, {"k": 2.0}, outputs={"E": "x*y"}, name="spring")
    same = HybridSystem(
        ("x", "y"), {"k": 2.0}, {"smooth": Mode({"x": "y", "y": "-k*x"})}, outputs={"E": "x*y"}, name="spring"
    )
    assert system.definition() == same.definition()


def test_a_start_and_a_period_are_one_segment(driven):
    short = solve_orbit(driven, x0=[0.5, 0.0], period=5.2)
    for closing in (None, "s"):
        long = solve_orbit(driven, segments=[("smooth", closing, [0.5, 0.0], 5.2)])
        assert np.array_equal(short.unknowns, long.unknowns)
    assert solve_orbit(driven, x0=[0.5, 0.0]).x0 == pytest.approx(short.x0, rel=1e-10)


BAD_GUESSES = [
    ({}, "guess = None: must be segments="),
    ({"x0": [0.5, 0.0], "segments": [("smooth", None, [0.5, 0.0], 5.2)]}, "x0 .*must be left out where segments"),
    ({"period": 5.2, "segments": [("smooth", None, [0.5, 0.0], 5.2)]}, "period .*must be left out where segments"),
    ({"period": 5.2}, "x0 = None: must be an initial state"),
    ({"x0": [0.5, 0.0], "period": -1.0}, "period"),
    ({"x0": [0.5]}, "x0"),
    ({"x0": [0.5, 0.0], "free": "A"}, "free = 'A': must be left out without fix"),
    (
        {"x0": [0.5, 0.0], "fix": {"max_x": 0.6, "min_x": 0.1}, "free": "A"},
        "fix = 'max_x, min_x': must be one quantity",
    ),
    ({"x0": [0.5, 0.0], "fix": {}, "free": "A"}, "fix = 'none'"),
    ({"x0": [0.5, 0.0], "fix": {"maxx": 0.6}, "free": "A"}, "did you mean 'max_x'"),
    ({"x0": [0.5, 0.0], "fix": {"A": 0.6}, "free": "w"}, "'A' is a parameter: set it in `parameters`"),
    ({"x0": [0.5, 0.0], "fix": {"max_s": 0.6}, "free": "w"}, "quantity = 'max_s'"),
    ({"x0": [0.5, 0.0], "fix": {"mean(q)": 0.6}, "free": "w"}, "q"),
    ({"x0": [0.5, 0.0], "fix": {"max_x": math.nan}, "free": "A"}, "max_x"),
    ({"x0": [0.5, 0.0], "fix": {"period": -1.0}, "free": "w"}, "period"),
    ({"x0": [0.5, 0.0], "fix": {"max_x": 0.6}, "free": "B"}, "free = 'B': must be one of A, w"),
    ({"x0": [0.5, 0.0], "fix": {"x": 0.6}, "free": "A"}, "a state or output that is constant"),
]


@pytest.mark.parametrize(("arguments", "message"), BAD_GUESSES)
def test_what_cannot_be_used_is_named(driven, arguments, message):
    with pytest.raises(InputError, match=message):
        solve_orbit(driven, **arguments)


def test_a_system_with_events_needs_segments(ball):
    with pytest.raises(InputError, match="pass segments=, which name modes and events"):
        solve_orbit(ball, x0=[0.0, 1.0], period=2.0)


def test_a_motion_without_a_phase_needs_a_period(pendulum):
    with pytest.raises(InputError, match="has no period of its own"):
        solve_orbit(pendulum, x0=[1.0, 0.0])


NO_ORBIT = [
    ({"fix": {"max_x": 0.6}}, "no orbit of a family is near the guess: .* free a parameter"),
    ({"fix": {"period": 5.0}, "free": "A"}, "'period' hardly changes with 'A' there"),
]


@pytest.mark.campaign
@pytest.mark.parametrize(("arguments", "message"), NO_ORBIT)
def test_what_no_unknown_moves_is_told(driven, arguments, message):
    with pytest.raises(ConvergenceError, match=message):
        solve_orbit(driven, x0=[1.0, 0.0], **arguments)


def test_values_beyond_the_family_are_told_with_how_far_it_goes(hardening):
    with pytest.raises(ConvergenceError, match=r"orbits next to the guess have period up to 6\.2"):
        solve_orbit(hardening, x0=[1.2, 0.0], period=5.0, fix={"period": 20.0})


def test_damping_ends_the_family(ball, hardening):
    with pytest.raises(ConvergenceError, match="no orbit of a family is near the guess: .* free a parameter"):
        solve_orbit(ball, {"e": 0.999}, [("flight", "hit", [0.0, 1.0], 2.0)], fix={"period": 2.0})
    with pytest.raises(ConvergenceError, match="no orbit of a family is near the guess: .* free a parameter"):
        solve_orbit(hardening, {"c": -1e-6}, x0=[1.0, 0.0], period=4.77, fix={"max_x": 1.0})


TODA = HybridSystem.smooth(
    {
        "x": "px",
        "y": "py",
        "px": "-(exp(2*x + 2*sqrt(3)*y) + exp(2*x - 2*sqrt(3)*y) - 2*exp(-4*x))/12",
        "py": "-sqrt(3)*(exp(2*x + 2*sqrt(3)*y) - exp(2*x - 2*sqrt(3)*y))/12",
    }
)


@pytest.mark.parametrize("x0", [[0.2, 0.1, 0.1, 0.3], [0.5, 0.0, 0.5, 0.5], [0.0, 0.3, 0.2, 0.0]])
def test_rough_guesses_in_a_conservative_system_are_not_taken_for_isolated_orbits(x0):
    """Periods of the Toda lattice are at most 2 pi; those of its straight-line orbits begin there."""
    for period in (2.0, 3.5):
        with pytest.raises(ConvergenceError, match="nearer") as told:
            solve_orbit(TODA, x0=x0, period=period, fix={"period": period})
        assert "isolated" not in str(told.value)


def test_a_parameter_that_keeps_the_family_is_told(ball):
    with pytest.raises(ConvergenceError, match="a family that 'g' does not end"):
        solve_orbit(ball, {}, [("flight", "hit", [0.0, 1.0], 2.0)], fix={"period": 3.0}, free="g")


def test_an_isotropic_oscillator_has_too_many_orbits():
    field = {"x": "u", "y": "v", "u": "-x", "v": "-y"}
    with pytest.raises(ConvergenceError, match="family of more than one dimension"):
        solve_orbit(HybridSystem.smooth(field), x0=[1.0, 0.0, 0.0, 0.5], period=6.28, fix={"max_x": 1.0})


def test_a_guess_next_to_its_maximum_is_as_good_as_any():
    """x'' = mu x' - x - x^2 x': the greatest x is next to the start, where the period ends as well."""
    system = HybridSystem.smooth({"x": "v", "v": "mu*v - x - x**2*v"}, {"mu": 0.5})
    orbit = solve_orbit(system, x0=[1.2, 0.0], period=6.3, fix={"max_x": 1.0}, free="mu")
    again = solve_orbit(system, {"mu": orbit.parameters["mu"]}, x0=orbit.x0, period=orbit.period)
    assert again.max["x"] == pytest.approx(1.0, rel=1e-10)


def test_a_parameter_that_may_not_be_negative_stays_positive():
    field = {"x": "v", "v": "-0.1*v - x + A*cos(s)"}
    system = HybridSystem.smooth(field, {"A": 0.3, "w": 1.2}, phase=("s", "w"), positive=["A"])
    orbit = solve_orbit(system, x0=[-0.6, 0.1], fix={"max_x": 0.3}, free="A")
    assert orbit.parameters["A"] == pytest.approx(0.3 * math.hypot(1.0 - 1.44, 0.12), rel=1e-10)
    with pytest.raises(ConvergenceError):
        solve_orbit(system, x0=[-0.6, 0.1], fix={"max_x": -0.3}, free="A")


def test_predators_and_prey_have_a_first_integral():
    """x' = x (1 - y), y' = y (x - 1): the means of both are 1 over any period."""
    system = HybridSystem.smooth({"x": "x*(1 - y)", "y": "y*(x - 1)"}, outputs={"V": "x - log(x) + y - log(y)"})
    orbit = solve_orbit(system, x0=[1.5, 1.0], period=6.5, fix={"V": 2.5})
    assert orbit.observe("mean(x)", "mean(y)") == pytest.approx({"mean(x)": 1.0, "mean(y)": 1.0}, rel=1e-10)


def test_the_planets_are_a_family_of_more_than_one_dimension():
    field = {"x": "u", "y": "v", "u": "-x/(x**2 + y**2)**1.5", "v": "-y/(x**2 + y**2)**1.5"}
    with pytest.raises(ConvergenceError, match="family of more than one dimension"):
        solve_orbit(HybridSystem.smooth(field), x0=[1.0, 0.0, 0.0, 1.1], period=8.0, fix={"max_x": 1.0})
