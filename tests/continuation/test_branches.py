"""What `continue_orbit` and `StepControl` refuse, by the text of the message."""

from __future__ import annotations

import math
import re

import pytest

import systems
from oracles.closed_forms import HENON, LOGISTIC
from saltus import HybridSystem, InputError, Mode, StepControl, continue_orbit, find_orbit, solve_orbit
from saltus.options import BranchOptions


@pytest.fixture(scope="module")
def orbit():
    return solve_orbit(
        systems.carried_map(("x",), {"a": 2.5, "gain": 1.0}, LOGISTIC), {}, [("carry", "map", [0.6, 0.0], 1.0)]
    )


def refuse(message):
    return pytest.raises(InputError, match=f"^{re.escape(message)}$")


def test_a_start_that_is_no_orbit():
    with pytest.raises(
        InputError, match="orbit = 3: must be a PeriodicOrbit or a MapOrbit; find_orbit and solve_orbit give one"
    ):
        continue_orbit(3, "a", (0.0, 1.0))


@pytest.mark.parametrize(("name", "hint"), [("gian", "; did you mean 'gain'?"), ("Omega", "")])
def test_an_unknown_parameter_is_told_its_nearest_name(orbit, name, hint):
    with refuse(f"parameter = {name!r}: must be one of a, gain{hint}"):
        continue_orbit(orbit, name, (0.0, 4.0))


@pytest.mark.parametrize("bounds", [(2.6, 3.0), (1.0, 2.4), (2.6, math.inf)])
def test_bounds_without_the_start(orbit, bounds):
    with refuse(f"bounds = {bounds!r}: must be an interval that holds the start, a = 2.5"):
        continue_orbit(orbit, "a", bounds)


@pytest.mark.parametrize(
    "bounds",
    [(3.0, 2.0), (2.5, 2.5), (math.nan, 3.0), (2.0, math.nan), (1.0,), (1.0, 2.0, 3.0), "ab", None, (1.0, None)],
)
def test_bounds_that_are_no_interval(orbit, bounds):
    with refuse(f"bounds = {bounds!r}: must be two numbers, the lower first"):
        continue_orbit(orbit, "a", bounds)


def test_unknown_directions(orbit):
    with refuse("directions = 'left': must be one of both, up, down"):
        continue_orbit(orbit, "a", (2.0, 3.0), directions="left")


def test_unknown_at_grazing(orbit):
    with refuse("StepControl.at_grazing = 'jump': must be one of switch, pass"):
        StepControl(at_grazing="jump")


@pytest.mark.parametrize(("stop_at", "text"), [("sn", "'sn'"), (("PD", "XX"), "'XX'")])
def test_unknown_stop_at(orbit, stop_at, text):
    with pytest.raises(InputError, match=f"^stop_at = {text}: must be one of SN, PD, TR, BP, GR"):
        continue_orbit(orbit, "a", (2.0, 3.0), stop_at=stop_at)


def test_stop_at_names_the_events_that_can_be_stopped_at(orbit):
    with refuse(
        "stop_at = 'max_y': must be one of SN, PD, TR, BP, GR, CS, GS, SS, AS, BC, CH, max_x; did you mean 'max_x'?"
    ):
        continue_orbit(orbit, "a", (2.0, 3.0), events={"max_x": 0.7}, stop_at="max_y")


def test_an_event_on_an_unknown_quantity(orbit):
    known = "a, x, s, min_x, min_s, max_x, max_s, period, or an observable, as in 'mean(x)'"
    with refuse(f"events = 'max_y': must be one of {known}; did you mean 'max_x'?"):
        continue_orbit(orbit, "a", (2.0, 3.0), events={"max_y": 0.7})


@pytest.mark.parametrize("value", [math.nan, math.inf, "high", None])
def test_an_event_at_no_finite_number(orbit, value):
    with refuse(f"events['max_x'] = {value!r}: must be a finite number, or 'extremum'"):
        continue_orbit(orbit, "a", (2.0, 3.0), events={"max_x": value})


@pytest.mark.parametrize("field", ["initial", "smallest", "largest", "deviation", "angle"])
@pytest.mark.parametrize("value", [0.0, -1.0, math.nan, math.inf, "big"])
def test_step_control_wants_positive_numbers(field, value):
    with refuse(f"StepControl.{field} = {value!r}: must be a finite number > 0"):
        StepControl(**{field: value})


def test_step_control_wants_smallest_below_largest():
    with refuse("StepControl.smallest = 0.2: must be <= largest, 0.1"):
        StepControl(smallest=0.2)


@pytest.mark.parametrize(
    ("field", "value"),
    [("max_points", 0), ("max_points", -3), ("iterations", 0), ("max_points", 2.5), ("iterations", "many")],
)
def test_step_control_wants_positive_counts(field, value):
    with pytest.raises(InputError, match=rf"^StepControl\.{field} = {value!r}: must be "):
        StepControl(**{field: value})


def test_an_unknown_label_names_those_there_are(orbit):
    branch = continue_orbit(orbit, "a", (2.2, 3.2))
    with refuse("label = 'PD2': must be one of PD1; did you mean 'PD1'?"):
        branch["PD2"]
    with refuse(f"index = {len(branch)}: must be an integer between {-len(branch)} and {len(branch) - 1}"):
        branch.solution(len(branch))
    with pytest.raises(InputError, match=r"^quantity = 'max_z': must be one of a, period, arclength, x, s, "):
        branch.column("max_z")


def test_bounds_beyond_those_of_the_system():
    system = systems.ball_on_table()
    bounded = type(system).from_definition(system.definition() | {"parameter_bounds": {"a": [0.5, 1.3]}})
    orbit = solve_orbit(bounded, {"a": 1.2}, [("flight", "impact", [0.588, 3.14159, 0.51], 6.28)])
    with refuse("bounds = (0.6, 2.0): must be within [0.5, 1.3], where a may lie"):
        continue_orbit(orbit, "a", (0.6, 2.0))


def test_henon_has_two_states():
    with pytest.raises(
        InputError,
        match=r"^segments\[0\] x0 = \[0\.1, 0\.2\]: must be of shape \(3,\), one number for each of x, y, s$",
    ):
        solve_orbit(
            systems.carried_map(("x", "y"), {"a": 0.2, "b": 0.3}, HENON), {}, [("carry", "map", [0.1, 0.2], 1.0)]
        )


@pytest.mark.parametrize("progress", ["loud", 1, [print]])
def test_progress_is_a_bar_or_a_function(orbit, progress):
    with refuse(f"progress = {progress!r}: must be True for a bar, or a function of a saltus.Progress"):
        continue_orbit(orbit, "a", (2.0, 3.0), progress=progress)


def test_true_shows_a_bar_with_the_parameter(orbit, capsys):
    branch = continue_orbit(orbit, "a", (2.4, 2.6), progress=True)
    out, err = capsys.readouterr()
    assert not out
    assert re.search(r"\d  [\d.,]+ a second  a = 2\.\d+", err)
    assert branch == continue_orbit(orbit, "a", (2.4, 2.6))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"steps": 0.1}, "BranchOptions.steps = 0.1: must be a StepControl"),
        ({"steps": None}, "BranchOptions.steps = None: must be a StepControl"),
        ({"directions": "left"}, "BranchOptions.directions = 'left': must be one of both, up, down"),
        ({"events": 3}, "BranchOptions.events = 3: must be a mapping of names to values, as {'gap': 0.02}"),
        ({"stop_at": 3}, "BranchOptions.stop_at = 3: must be a sequence of types of special points"),
        ({"stop_at": (1,)}, "BranchOptions.stop_at = 1: must be a sequence of types of special points"),
    ],
)
def test_options_of_branches_are_checked_when_they_are_made(options, message):
    with pytest.raises(InputError, match=f"^{re.escape(message)}"):
        BranchOptions(**options)


@pytest.mark.parametrize(
    "events", [{"max_height": 0.1}, {"min_height": 0.1}, {"max_height": "extremum"}, {"mean(log(0.5 - x))": 0.1}]
)
def test_an_event_of_what_is_no_number_on_part_of_the_orbit_is_refused(events):
    system = HybridSystem(
        ("x", "v"),
        {"w": 1.3, "c": 0.2},
        {"free": Mode({"x": "v", "v": "cos(th) - c*v - x"})},
        phase=("th", "w"),
        outputs={"height": "log(0.5 - x)"},
    )
    orbit = find_orbit(system, {}, [0.0, 0.0])
    assert math.isnan(orbit.max["height"])
    with pytest.warns(RuntimeWarning, match=r"amplitude\(height, 1\) is NaN: the expression has no value"):
        assert math.isnan(orbit.observe("amplitude(height, 1)")["amplitude(height, 1)"])
    (name,) = events
    message = f"events = {name!r}: must be a quantity that is a number all along the orbits; NaN at the start"
    with pytest.raises(InputError, match=re.escape(message)):
        continue_orbit(orbit, "w", (1.2, 1.5), events=events)


def test_a_quantity_that_is_no_longer_a_number_is_told_once():
    """x = 1 + X cos(2 s - a); X = A/sqrt(9.64), log(x) has the mean log((1 + sqrt(1 - X^2))/2)."""
    field = {"m": Mode({"x": "v", "v": "-(x - 1) - 0.4*v + A*cos(2*s)"})}
    system = HybridSystem(("x", "v"), {"A": 0.5}, field, phase=("s", "1"), outputs={"log_x": "log(x)"})
    orbit = find_orbit(system, x0=[1.0, 0.0])
    with pytest.warns(RuntimeWarning, match=r"'mean\(log_x\)' is no number at A = 3\.[1-9]") as told:
        branch = continue_orbit(orbit, "A", (0.1, 8.0), events={"mean(log_x)": -0.2})
    assert len(told) == 1
    (met,) = branch.special_points
    X = math.sqrt(1.0 - (2.0 * math.exp(-0.2) - 1.0) ** 2)
    assert met.parameters["A"] == pytest.approx(X * math.sqrt(9.64), rel=1e-9)
