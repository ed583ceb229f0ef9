"""What `continue_locus` refuses, by its text."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest

import systems
from oracles.closed_forms import DELAYED, HENON, henon_fixed_point
from saltus import HybridSystem, InputError, Mode, StepControl, Transition, continue_locus, continue_orbit, solve_orbit

BOUNDS = {"a": (-3.0, 5.0), "b": (-2.0, 0.9)}
PAIR = ("a", "b")


def fixed_point(a, b):
    x = henon_fixed_point(a, b)
    system = systems.carried_map(("x", "y"), {"a": a, "b": b}, HENON)
    return solve_orbit(system, {}, [("carry", "map", [x, x, 0.0], 1.0)])


@pytest.fixture(scope="module")
def branch():
    return continue_orbit(fixed_point(0.2, 0.3), "a", (-1.0, 1.5), events={"a": 0.1})


@pytest.fixture(scope="module")
def fold(branch):
    return branch["SN1"]


def message(*args, **kwargs):
    with pytest.raises(InputError) as caught:
        continue_locus(*args, **kwargs)
    return str(caught.value)


def test_a_parameter_that_a_user_asks_for_has_no_locus(branch):
    event = branch.special_points.of_type("a")[0]
    said = message(event, PAIR, BOUNDS)
    assert said == (
        "start = 'a': must be a point at which a quantity of the solution has its value; "
        "a parameter keeps its value along a straight line"
    )


def test_an_orbit_needs_its_type(fold):
    said = message(fold.orbit, PAIR, BOUNDS)
    assert said == "start = 'a PeriodicOrbit': must be a special point, or an orbit with its type; type='SN'"


@pytest.mark.parametrize("start", [None, 3, "SN1"])
def test_a_start_is_a_special_point(start):
    said = message(start, PAIR, BOUNDS)
    assert said == f"start = {start!r}: must be a SpecialPoint; branch['PD1'] is one"


@pytest.mark.parametrize(("kind", "hint"), [("SNN", "; did you mean 'SN'?"), ("CP", ""), ("TP", "")])
def test_types_are_known(fold, kind, hint):
    said = message(fold, PAIR, BOUNDS, type=kind)
    assert said.startswith(f"type = {kind!r}: must be one of SN, PD, TR, BP, GR")
    if hint:
        assert said.endswith(hint)


@pytest.mark.parametrize("pair", ["ab", ("a",), ("a", "b", "a"), ()])
def test_two_parameters_are_named(fold, pair):
    assert message(fold, pair, BOUNDS) == f"parameters = {pair!r}: must be two names, as ('A', 'w')"


@pytest.mark.parametrize("pair", [None, 3])
def test_parameters_that_are_no_names_are_an_error_of_input(fold, pair):
    assert message(fold, pair, BOUNDS).startswith(f"parameters = {pair!r}: must be two names")


def test_a_parameter_named_twice(fold):
    said = message(fold, ("a", "a"), {"a": (-1.0, 1.0)})
    assert said == "parameters = ('a', 'a'): must be two different names"


def test_an_unknown_parameter_is_told_with_those_that_are_known(fold):
    said = message(fold, ("a", "B"), {"a": (-1.0, 1.0), "B": (0.0, 1.0)})
    assert said == "parameters = 'B': must be one of a, b; did you mean 'b'?"


@pytest.mark.parametrize("bounds", [{"a": (-1.0, 1.0)}, {"a": (-1.0, 1.0), "c": (0.0, 1.0)}, (-1.0, 1.0), None])
def test_both_intervals_are_given(fold, bounds):
    said = message(fold, PAIR, bounds)
    assert said == f"bounds = {bounds!r}: must be a mapping of a and b to intervals"


@pytest.mark.parametrize(
    "interval", [(1.0,), 3.0, ("x", "y"), (2.0, -2.0), (0.3, 0.3), (-math.inf, 1.0), (math.nan, 1.0), (0.0, True)]
)
def test_an_interval_is_two_finite_numbers(fold, interval):
    said = message(fold, PAIR, {"a": (-1.0, 1.0), "b": interval})
    assert said == f"bounds['b'] = {interval!r}: must be two finite numbers, the lower first"


def test_the_start_lies_within_its_bounds(fold):
    said = message(fold, PAIR, {"a": (0.0, 1.0), "b": (0.0, 1.0)})
    assert said == "bounds['a'] = (0.0, 1.0): must be an interval that holds the start, a = -0.1225"
    said = message(fold, PAIR, {"a": (-1.0, 1.0), "b": (0.5, 1.0)})
    assert said == "bounds['b'] = (0.5, 1.0): must be an interval that holds the start, b = 0.3"


def test_bounds_lie_where_a_parameter_may():
    system = HybridSystem(
        ("x", "s"),
        {"r": 0.0, "h": 1.5},
        {"carry": Mode({"x": "0", "s": "1"})},
        [Transition("carry", "carry", "s - 1", 1, {"x": "r + h*x - x**3", "s": "0"}, name="map")],
        positive=("h",),
    )
    branch = continue_orbit(solve_orbit(system, {}, [("carry", "map", [0.7, 0.0], 1.0)]), "r", (-1.0, 1.0))
    said = message(branch["SN1"], ("r", "h"), {"r": (-1.0, 1.0), "h": (-1.0, 2.0)})
    assert re.fullmatch(r"bounds\['h'\] = \(-1\.0, 2\.0\): must be within \[.*, inf\], where h may lie", said)


@pytest.mark.parametrize("kind", ["SN", "PD", "TR", "BP", "GR"])
def test_an_orbit_that_is_not_critical_starts_no_locus(kind):
    said = message(fixed_point(0.2, 0.3), PAIR, BOUNDS, type=kind)
    wanted = {
        "SN": "must be an orbit with a multiplier 1, as every SN has",
        "PD": "must be an orbit with a multiplier -1, as every PD has",
        "TR": "must be an orbit with a pair of multipliers on the unit circle, as every TR has",
        "BP": "must be",
        "GR": "must be an orbit that grazes one; a GR does",
    }[kind]
    assert said.startswith("start = ")
    assert wanted in said


def test_an_orbit_of_another_type_starts_no_locus(branch):
    for label, kind in (("SN1", "PD"), ("PD1", "SN"), ("SN1", "TR"), ("PD1", "TR"), ("SN1", "BP"), ("SN1", "GR")):
        assert message(branch[label], PAIR, BOUNDS, type=kind).startswith("start = ")


def test_an_orbit_near_a_fold_is_told_how_far_it_is_from_it():
    said = message(fixed_point(-0.1225 + 1e-4, 0.3), PAIR, BOUNDS, type="SN")
    assert said.startswith("start = ")


def test_parameters_that_do_not_move_the_point_are_refused():
    system = systems.carried_map(("x", "y"), {"a": 0.2, "b": 0.3, "idle": 1.0, "still": 1.0}, HENON)
    x = henon_fixed_point(0.2, 0.3)
    branch = continue_orbit(solve_orbit(system, {}, [("carry", "map", [x, x, 0.0], 1.0)]), "a", (-1.0, 1.5))
    limits = {"idle": (0.0, 2.0), "still": (0.0, 2.0)}
    for label in ("SN1", "PD1"):
        said = message(branch[label], ("idle", "still"), limits)
        kind = label[:2]
        wanted = f"parameters = ('idle', 'still'): must be two parameters in which the {kind} has a regular locus"
        assert said.startswith(wanted)


def test_a_branch_point_needs_the_parameter_of_its_branch():
    system = systems.carried_map(("x", "y"), {"a": 1.5, "c": 1.2, "k": 0.0, "l": 0.0}, DELAYED)
    orbit = solve_orbit(system, {}, [("carry", "map", [1 / 3, 1 / 3, 0.0], 1.0)])
    point = continue_orbit(orbit, "a", (0.8, 1.3 + 0.3))["BP1"]
    said = message(point, ("k", "l"), {"k": (-1.0, 1.0), "l": (-1.0, 1.0)})
    assert said == "parameters = ('k', 'l'): must be a pair with 'a', along which the branch point was found"


@pytest.mark.parametrize("directions", ["left", "", None, 1])
def test_directions_are_known(fold, directions):
    said = message(fold, PAIR, BOUNDS, directions=directions)
    assert said == f"directions = {directions!r}: must be one of both, up, down"


@pytest.mark.parametrize("steps", [0.1, {"largest": 0.1}, "fine"])
def test_steps_are_a_step_control(fold, steps):
    assert message(fold, PAIR, BOUNDS, steps=steps) == f"steps = {steps!r}: must be a StepControl"


def test_a_locus_does_not_pass_a_grazing(fold):
    said = message(fold, PAIR, BOUNDS, steps=StepControl(at_grazing="pass"))
    assert said == "StepControl.at_grazing = 'pass': must be left out; a locus ends at a grazing"


@pytest.mark.parametrize("progress", ["loud", 1])
def test_progress_is_a_bar_or_a_function(fold, progress):
    wanted = f"progress = {progress!r}: must be True for a bar, or a function of a saltus.Progress"
    assert message(fold, PAIR, BOUNDS, progress=progress) == wanted


def test_true_shows_a_bar_with_both_parameters(fold, capsys):
    continue_locus(fold, PAIR, {"a": (-0.2, 0.0), "b": (0.2, 0.4)}, progress=True)
    out, err = capsys.readouterr()
    assert not out
    assert re.search(r"a second  a = -0\.\d+, b = 0\.\d+", err)


def test_stop_at_names_types(fold):
    said = message(fold, PAIR, BOUNDS, stop_at="R5")
    assert said.startswith(
        "stop_at = 'R5': must be one of CP, GPD, CH, R1, R2, R3, R4, FF, FNS, PDNS, NSNS, SNSN, PDPD, TP, "
    )
    assert message(fold, PAIR, BOUNDS, stop_at=3) == ("stop_at = 3: must be a sequence of types of special points")


def test_a_label_that_is_not_there_is_told_with_those_that_are(fold):
    locus = continue_locus(fold, PAIR, BOUNDS)
    with pytest.raises(InputError, match=re.escape("label = 'CP1': must be one of R1_1")):
        locus["CP1"]
    with pytest.raises(InputError, match="quantity = 'angel': must be one of .*did you mean 'angle'"):
        locus.column("angel")
    with pytest.raises(InputError, match="index = 999"):
        locus.solution(999)
    with pytest.raises(InputError, match="index"):
        locus.point(999)


def test_what_has_no_normal_form_says_so(fold):
    locus = continue_locus(fold, PAIR, BOUNDS)
    assert "of codimension two" in locus["R1_1"].normal_form.reason


def test_nothing_is_changed_by_a_refusal(fold):
    before = dict(fold.parameters)
    message(fold, ("a", "a"), {"a": (-1.0, 1.0)})
    assert dict(fold.parameters) == before
    assert len(continue_locus(fold, PAIR, BOUNDS)) > 5
    np.testing.assert_allclose(fold.orbit.parameters["a"], -0.1225, atol=1e-8)
