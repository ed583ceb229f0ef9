"""Border collisions at which an event begins: its condition holds from there on, or the motion meets its surface."""

import math

import numpy as np
import pytest

import saltus
from saltus import Mode, Transition

_W, _D, _G = 1.3, 0.2, 0.5
_GAIN = 1.0 / math.hypot(1.0 - _W**2, 0.1 * _W)
_FIELD = Mode({"x": "v", "v": "F*cos(s) - x - 0.1*v"})


def force(d=_D, g=_G):
    """Return the amplitude of the force at which the surface at d is passed with speed g."""
    return math.hypot(d, g / _W) / _GAIN


def counted(direction, when):
    """Return a linear oscillator with an event that changes nothing."""
    event = Transition("m", "m", "x - d", direction, when=when, name="counted")
    return saltus.HybridSystem(
        ("x", "v"), {"F": 0.3, "d": _D, "g": _G, "w": _W}, {"m": _FIELD}, [event], phase=("s", "w")
    )  # fmt: skip


@pytest.mark.parametrize(("direction", "when"), [(1, "v - g"), (-1, "-v - g"), (0, "v - g"), (0, "-v - g")])
@pytest.mark.parametrize("start", [0.3, 0.5])
def test_a_condition_begins_to_hold_where_a_closed_form_says(direction, when, start):
    system = counted(direction, when)
    assert 0.3 < force() < 0.5
    orbit = saltus.find_orbit(system, {"F": start}, [0.0, 0.0])
    branch = saltus.continue_orbit(orbit, "F", (0.3, 0.5))
    assert branch.stopped == ("F = 0.3: bound reached", "F = 0.5: bound reached")
    (point,) = branch.special_points
    assert (point.type, point.parameters["F"]) == ("BC", pytest.approx(force(), rel=1e-12))
    assert branch.admissible.all()
    assert point.orbit.admissible
    assert [len(branch.at(F)[0].segments) for F in (0.3, 0.5)] == [1, 1]
    assert [branch.at(F)[0].segments[0].transition for F in (0.3, 0.5)] == ["s", "counted"]


@pytest.mark.campaign
def test_the_border_of_a_condition_has_a_locus():
    branch = saltus.continue_orbit(saltus.find_orbit(counted(1, "v - g"), {}, [0.0, 0.0]), "F", (0.3, 0.5))
    locus = saltus.continue_locus(branch["BC1"], ("F", "d"), {"F": (0.2, 0.6), "d": (0.05, 0.3)})
    F, d = (locus.column(name) for name in ("F", "d"))
    assert d.min() == pytest.approx(0.05)
    assert d.max() == pytest.approx(0.3)
    np.testing.assert_allclose(F, [force(d=value) for value in d], rtol=1e-9)


def thrown(g):
    """Return a ball that a racket throws up, with speed c, or harder if the ball comes down faster than g."""
    return saltus.HybridSystem(
        ("z", "v"), {"c": 0.6, "g": g}, {"flight": Mode({"z": "v", "v": "-1"})},
        [
            Transition("flight", "flight", "z", -1, {"v": "2*c"}, when="-v - g", name="hard"),
            Transition("flight", "flight", "z", -1, {"v": "c"}, name="soft"),
        ],
    )  # fmt: skip


def test_of_two_events_at_one_surface_the_first_in_the_definition_happens():
    orbits = [saltus.solve_orbit(thrown(1.0), {"c": c}, [("flight", "soft", [0.0, c], 2 * c)]) for c in (0.8, 1.2)]
    assert [orbit.admissible for orbit in orbits] == [True, False]
    assert orbits[1].reasons == ("another event lies inside a segment",)


def test_a_branch_ends_where_the_first_of_two_events_begins_to_happen():
    orbit = saltus.solve_orbit(thrown(1.0), {"c": 0.8}, [("flight", "soft", [0.0, 0.8], 1.6)])
    branch = saltus.continue_orbit(orbit, "c", (0.5, 2.0))
    assert branch["BC1"].parameters["c"] == pytest.approx(1.0, rel=1e-12)
    assert branch.stopped[1].endswith("no transition leads on behind 'hard', which happens first")


def reset_to():
    """Return a ramp that falls back to a at 2, with a section at 0.5."""
    return saltus.HybridSystem(
        ("x", "y"), {"a": 0.8}, {"m": Mode({"x": "1", "y": "x - y"})},
        [Transition("m", "m", "x - 2", 1, {"x": "a"}, name="top"), Transition("m", "m", "x - 0.5", 1, name="section")],
    )  # fmt: skip


@pytest.mark.parametrize("start", [0.2, 0.8])
def test_a_reset_lands_on_the_surface_of_another_event(start):
    orbit = saltus.find_orbit(reset_to(), {"a": start}, [0.0, 0.0])
    branch = saltus.continue_orbit(orbit, "a", (0.1, 0.9))
    assert branch.stopped == ("a = 0.1: bound reached", "a = 0.9: bound reached")
    (point,) = branch.special_points
    assert (point.type, point.parameters["a"]) == ("BC", pytest.approx(0.5, abs=1e-12))
    np.testing.assert_allclose(branch.period, 2.0 - branch.values, rtol=1e-12)
    assert [len(branch.at(a)[0].segments) for a in (0.2, 0.8)] == [2, 1]


def test_an_orbit_that_a_wall_does_not_turn_back_is_no_motion():
    wall = Transition("m", "m", "x - 1", 1, {"v": "3.2 - 2*v"}, name="wall")
    system = saltus.HybridSystem(("x", "v"), {}, {"m": Mode({"x": "v", "v": "-x"})}, [wall])
    # through x = 1 with the speed 16/15 the wall leaves 16/15: it turns speeds about, so that the event happens again
    guess = [("m", "wall", [1.0, 3.2 / 3.0], 2.0 * math.pi)]
    assert saltus.solve_orbit(system, {}, guess).reasons == ("another event lies inside a segment",)
