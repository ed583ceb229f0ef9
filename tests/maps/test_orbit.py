"""Fixed points and orbits of maps as results: closed forms, long orbits, files, bad input."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from known_maps import henon, logistic, tent
from saltus import ConvergenceError, HybridSystem, InputError, Map, Mode, Transition
from saltus.errors import MapDivergenceError
from saltus.maps.spectrum import multipliers_of


@pytest.mark.parametrize("r", [1.5, 2.5, 3.3, 3.9])
def test_the_fixed_point_of_the_logistic_map_has_multiplier_two_minus_r(r):
    orbit = saltus.solve_orbit(logistic(), {"r": r}, x0=[0.6])
    assert orbit.period == 1
    assert orbit.x0[0] == pytest.approx(1 - 1 / r, abs=1e-14)
    assert orbit.multipliers[0] == pytest.approx(2 - r, abs=1e-13)
    assert orbit.stable == (abs(2 - r) < 1)


def test_the_orbit_of_period_two_of_the_logistic_map_is_that_of_the_textbook():
    r = 3.4
    orbit = saltus.solve_orbit(logistic(), {"r": r}, x0=[0.45], period=2)
    root = math.sqrt((r - 3) * (r + 1))
    assert sorted(orbit.points[:, 0]) == pytest.approx([(r + 1 - root) / (2 * r), (r + 1 + root) / (2 * r)], abs=1e-13)
    assert orbit.multipliers[0].real == pytest.approx(4 + 2 * r - r * r, abs=1e-12)


def test_a_orbit_has_its_least_period():
    assert saltus.solve_orbit(logistic(), {"r": 2.5}, x0=[0.6], period=6).period == 1


def test_fixed_points_of_the_henon_map_multiply_to_its_area():
    a, b = 1.4, 0.3
    for sign in (1.0, -1.0):
        x = (b - 1 + sign * math.sqrt((1 - b) ** 2 + 4 * a)) / (2 * a)
        orbit = saltus.solve_orbit(henon(), x0=[x + 0.01, b * x])
        assert orbit.x0 == pytest.approx([x, b * x], abs=1e-13)
        assert np.prod(orbit.multipliers).real == pytest.approx(-b, abs=1e-14)


def test_a_long_unstable_orbit_of_the_full_logistic_map_has_multiplier_minus_two_to_its_period():
    """At r = 4 each orbit but 0 has the multiplier +-2^k; one round by Newton's method would lose all digits."""
    k, start = 64, 0x123456789ABCDEF5
    angles = [math.pi * (start * 2**i % (2**k - 1)) / (2**k - 1) for i in range(k)]
    points = [math.sin(angle) ** 2 for angle in angles]
    orbit = saltus.solve_orbit(logistic(), {"r": 4.0}, x0=[[p] for p in points])
    assert orbit.period == k
    assert orbit.residual < 1e-14
    assert orbit.points[:, 0] == pytest.approx(points, abs=1e-14)
    assert abs(orbit.multipliers[0]) == pytest.approx(2.0**k, rel=1e-11)


def test_a_small_multiplier_keeps_its_digits_beside_a_large_one():
    a, c = np.array([[9.0, 2.0], [1.0, 1e-6]]), np.array([[3.0, 1.0], [3.0, 1.0 + 1e-7]])
    values = multipliers_of(np.array([a, c] * 8)).real
    determinant = (9e-6 - 2.0) * 3e-7
    assert values[0] * values[1] == pytest.approx(determinant**8, rel=1e-7)


def test_multipliers_beyond_all_numbers_are_infinite():
    assert np.isinf(multipliers_of(np.full((500, 1, 1), 1e3)))[0]


@pytest.mark.parametrize(("r", "period"), [(2.9, 1), (3.2, 2), (3.5, 4), (3.55, 8), (3.83, 3), (3.0001, 2)])
def test_a_motion_settles_on_the_orbit_of_known_period(r, period):
    orbit = saltus.find_orbit(logistic(), {"r": r}, [0.1])
    assert (orbit.period, orbit.stable, orbit.regular) == (period, True, True)
    again = saltus.iterate(logistic(), {"r": r}, orbit.x0, n=period).states[-1]
    assert again == pytest.approx(orbit.x0, abs=1e-13)


@pytest.mark.campaign
def test_orbits_of_a_map_are_the_orbits_of_the_same_map_with_a_clock():
    clocked = HybridSystem(
        ("x", "y", "s"), {"a": 1.4, "b": 0.3}, {"carry": Mode({"x": "0", "y": "0", "s": "1"})},
        [Transition("carry", "carry", "s - 1", 1, {"x": "1 - a*x**2 + y", "y": "b*x", "s": "0"}, name="map")],
    )  # fmt: skip
    own = saltus.solve_orbit(henon(), x0=[0.97, -0.14], period=2)
    assert own.period == 2
    points = [*own.points[1:], own.points[0]]
    guess = [("carry", "map", [*(x + 1e-4), 0.0], 1.0) for x in points]
    other = saltus.solve_orbit(clocked, segments=guess)
    assert other.multipliers[:1].real == pytest.approx(own.multipliers[:1].real, abs=1e-9)


@pytest.mark.parametrize(("a", "b"), [(0.5, -0.6), (2.0, -0.25), (0.3, -3.0)])
def test_the_orbit_left_right_of_the_skew_tent_map_is_in_closed_form(a, b):
    """di Bernardo et al. 2008, section 3.1: x_L = mu (1 + b)/(1 - a b), x_R = mu (1 + a)/(1 - a b)."""
    mu = 0.2
    orbit = saltus.solve_orbit(tent(), {"a": a, "b": b, "mu": mu}, segments=("left", "right"))
    assert orbit.points[:, 0] == pytest.approx([mu * (1 + b) / (1 - a * b), mu * (1 + a) / (1 - a * b)], abs=1e-14)
    assert orbit.multipliers[0].real == pytest.approx(a * b, abs=1e-14)
    assert orbit.regular == (b < -1)
    assert orbit.regular or "point 0 lies beyond the border of left" in orbit.reasons[0]


def test_without_an_itinerary_the_orbit_found_is_regular():
    orbit = saltus.solve_orbit(tent(), {"mu": 0.2}, x0=[-0.1])
    assert orbit.regular
    assert orbit.itinerary == ("right",)
    assert orbit.x0[0] == pytest.approx(0.2 / 1.6)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_units_do_not_matter(unit):
    scaled = Map(("x",), {"r": 3.2, "u": 1.0}, {"x": "r*x*(1 - x/u)"})
    orbit = saltus.solve_orbit(scaled, {"u": unit}, x0=[0.5 * unit], period=2)
    assert orbit.points[:, 0] / unit == pytest.approx([0.513044510, 0.799455490], rel=1e-8)
    assert saltus.find_orbit(scaled, {"u": unit}, [0.5 * unit]).period == 2


def test_a_orbit_is_saved_and_loaded(tmp_path):
    orbit = saltus.solve_orbit(tent(), {"mu": 0.2, "b": -2.0}, segments=("left", "right"))
    assert saltus.load(orbit.save(tmp_path / "orbit.nc")) == orbit
    assert "Orbit of period 2 of skew tent map" in repr(orbit)
    assert orbit.output("2*x") == pytest.approx(2 * orbit.points[:, 0])


def test_what_cannot_be_used_is_named():
    with pytest.raises(InputError, match=r"segments = 'rigth': must be one of left, right"):
        saltus.solve_orbit(tent(), segments=("left", "rigth"))
    with pytest.raises(InputError, match="period"):
        saltus.solve_orbit(tent(), segments=("left", "right"), period=3)
    with pytest.raises(InputError, match="x0"):
        saltus.solve_orbit(logistic())
    with pytest.raises(InputError, match="segments"):
        saltus.solve_orbit(logistic(), {}, [("carry", "map", [0.6], 1.0)])
    with pytest.raises(MapDivergenceError, match="iteration"):
        saltus.solve_orbit(logistic(), {"r": 5.0}, x0=[3.0], period=30)
    with pytest.raises(MapDivergenceError):
        saltus.find_orbit(logistic(), {"r": 5.0}, [0.3])
    with pytest.raises(ConvergenceError, match="chaotic"):
        saltus.find_orbit(logistic(), {"r": 4.0}, [0.3])
    with pytest.raises(ConvergenceError, match="period"):
        saltus.solve_orbit(Map(("x",), {}, {"x": "x + 1 + x**2"}), x0=[0.3])


def test_a_fixed_point_at_the_origin_has_a_residual_of_zero():
    """All terms of x -> a x - x^3 vanish there; its multiplier is a, so it doubles at a = -1 and branches at a = 1."""
    cubic = Map(("x",), {"a": 1.5}, {"x": "a*x - x**3"})
    branch = saltus.continue_orbit(saltus.solve_orbit(cubic, x0=[0.0]), "a", (-2.0, 3.0))
    assert branch.solution(0).residual == 0.0
    assert sorted((p.type, p.parameters["a"]) for p in branch.special_points) == [("BP", 1.0), ("PD", -1.0)]
    assert saltus.verify(branch).passed
