"""Loci of orbits that run to infinity, and test functions that vanish along whole curves, against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from known_maps import henon
from saltus import Map

BOUNDS = {"a": (-2.0, 3.0), "b": (-1.2, 1.2)}
CURVES = {
    "SN1": lambda b: -((1 - b) ** 2) / 4,
    "PD1": lambda b: 3 * (1 - b) ** 2 / 4,
}  # parameter a on the loci of the Henon map's fixed point


def branch_of(system, parameter, bounds, x0, parameters=None, period=1):
    return saltus.continue_orbit(saltus.solve_orbit(system, parameters, x0=x0, period=period), parameter, bounds)


@pytest.fixture(scope="module")
def bounded():
    """The Henon map in coordinates that stay bounded at a = 0."""
    return Map(("x", "y"), {"a": 0.1, "b": 0.3}, {"x": "a - x**2 + b*y", "y": "x"})


@pytest.mark.campaign
@pytest.mark.parametrize(("label", "last"), [("SN1", 1e-8), ("PD1", 1e-8)])
def test_a_locus_whose_points_run_to_infinity_ends_with_a_word(label, last):
    branch = branch_of(henon(), "a", (-1.0, 1.0), [0.7, 0.2], {"a": 0.1})
    locus = saltus.continue_locus(branch[label], ("a", "b"), BOUNDS)
    assert locus.column("a") == pytest.approx(CURVES[label](locus.column("b")), abs=1e-12)
    assert "grows without bound" in locus.stopped[1]
    assert "bound reached" in locus.stopped[0]
    assert len(locus) < 300
    assert 0.0 < abs(locus.column("a")[-1]) < last
    assert [point.type for point in locus.special_points] == (["R1"] if label == "SN1" else [])


@pytest.mark.parametrize("label", ["SN1", "PD1"])
def test_the_same_locus_passes_its_fold_flip_where_the_points_stay_bounded(bounded, label):
    branch = branch_of(bounded, "a", (-1.0, 1.0), [0.1, 0.1])
    locus = saltus.continue_locus(branch[label], ("a", "b"), BOUNDS)
    assert locus.column("a") == pytest.approx(CURVES[label](locus.column("b")), abs=1e-12)
    assert all("bound reached" in reason for reason in locus.stopped)
    (flip,) = locus.special_points.of_type("FF")
    assert [flip.parameters["a"], flip.parameters["b"]] == pytest.approx([0.0, 1.0], abs=1e-8)
    assert not locus.special_points.of_type("CP", "GPD")
    assert not any("location" in reason for reason in locus.rejected)  # the pole of the coefficient is no doubt


@pytest.mark.parametrize("form", ["area", "bounded"])
def test_the_orbit_of_period_two_doubles_on_its_closed_form(bounded, form):
    system = henon() if form == "area" else bounded
    branch = branch_of(system, "a", (0.36, 2.0), [1.0, -0.1], {"a": 0.6, "b": 0.3}, period=2)
    locus = saltus.continue_locus(branch["PD1"], ("a", "b"), BOUNDS)
    b = locus.column("b")
    assert locus.column("a") == pytest.approx((1 - b) ** 2 + (1 + b) ** 2 / 4, abs=1e-11)
    assert [point.type for point in locus.special_points] == ["TP", "R2"]
    assert locus["R2_1"].parameters["b"] == pytest.approx(1.0, abs=1e-8)
    assert locus["TP1"].parameters["b"] == pytest.approx(0.6, abs=1e-8)


@pytest.mark.campaign
def test_a_direction_does_not_take_over_the_sizes_of_the_other_one():
    branch = branch_of(henon(), "a", (-1.0, 1.0), [0.7, 0.2], {"a": 0.1})
    alone = saltus.continue_locus(branch["PD1"], ("b", "a"), BOUNDS, directions="up")
    both = saltus.continue_locus(branch["PD1"], ("b", "a"), BOUNDS)
    assert "grows without bound" in both.stopped[0]
    assert both.points[-len(alone) :] == pytest.approx(alone.points, rel=1e-9)


@pytest.mark.parametrize("states", [2, 3])
def test_loci_of_an_area_preserving_map_have_no_resonances_by_rounding(states):
    """Both multipliers are 1 on the whole SN locus, -1 on the whole PD locus: x is where the trace is 2 or -2."""
    image = {"x": "a - x**2 + c*x - y", "y": "x"} | ({"z": "z/2 + x"} if states == 3 else {})
    system = Map(tuple(image), {"a": 0.5, "c": 0.0}, image)
    branch = branch_of(system, "a", (-2.0, 4.0), [0.2, 0.2, 0.4][:states])
    bounds = {"a": (-3.0, 5.0), "c": (-1.0, 1.0)}
    folds = saltus.continue_locus(branch["SN1"], ("a", "c"), bounds)
    flips = saltus.continue_locus(branch["PD1"], ("a", "c"), bounds)
    c = folds.column("c")
    assert folds.column("a") == pytest.approx(-((2 - c) ** 2) / 4, abs=1e-12)
    x = (2 + flips.column("c")) / 2  # trace c - 2 x = -2
    assert flips.column("a") == pytest.approx(x**2 + (2 - flips.column("c")) * x, abs=1e-12)
    assert len(folds.special_points) == len(flips.special_points) == 0


@pytest.mark.parametrize("damping", [0.0, 1e-12, 1e-9, 1e-6, 1e-3])
@pytest.mark.parametrize("largest", [0.05, 0.0557, 0.3])
def test_a_doubling_next_to_which_two_multipliers_become_a_pair_is_located(damping, largest):
    image = {"x": "a - x**2 - b*y", "y": "x", "z": "z/2 + x"}
    system = Map(tuple(image), {"a": 0.5, "b": 1.0 - damping}, image)
    orbit = saltus.solve_orbit(system, x0=[0.2, 0.2, 0.4])
    branch = saltus.continue_orbit(orbit, "a", (-0.9, 4.0), steps=saltus.StepControl(largest=largest))
    (doubling,) = branch.special_points
    x = (2.0 - damping) / 2.0  # 1 - 2 x + b = -(1 + b) + ...: the trace -2 x is -(1 + b)
    assert doubling.parameters["a"] == pytest.approx(x**2 + (2.0 - damping) * x, abs=1e-10)


def test_a_multiplier_of_minus_one_along_a_whole_branch_is_no_doubling():
    system = Map(("x", "y"), {"r": 0.3, "s": 0.5}, {"x": "x + r - x**2 + s*x", "y": "-y + y**3"})
    branch = branch_of(system, "r", (-0.5, 0.5), [0.9, 0.0])
    assert [point.label for point in branch.special_points] == ["SN1"]
    assert branch["SN1"].parameters["r"] == pytest.approx(-1 / 16, abs=1e-10)
    locus = saltus.continue_locus(branch["SN1"], ("r", "s"), {"r": (-1.0, 1.0), "s": (0.0, 2.0)})
    assert not locus.special_points.of_type("FF", "CP")


@pytest.mark.campaign
def test_pairs_of_a_fixed_angle_have_no_resonances_along_their_locus():
    """Every point of the locus m = 0 is a resonance 1:3: none of them is special."""
    turn, w = "(1 + m + d*(x**2 + y**2))", 2 * math.pi / 3
    system = Map(
        ("x", "y"), {"m": -0.1, "d": -0.5},
        {"x": f"{turn}*(x*cos({w}) - y*sin({w}))", "y": f"{turn}*(x*sin({w}) + y*cos({w}))"},
    )  # fmt: skip
    branch = branch_of(system, "m", (-0.5, 0.5), [0.0, 0.0])
    locus = saltus.continue_locus(branch["TR1"], ("m", "d"), {"m": (-1.0, 1.0), "d": (-1.0, 1.0)})
    assert [point.label for point in locus.special_points] == ["CH1"]
    assert np.cos(locus.angle) == pytest.approx(-0.5, abs=1e-12)
