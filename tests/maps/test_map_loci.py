"""Loci of orbits of maps along two parameters, against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

import saltus
from known_maps import cusp, henon, logistic, tent
from saltus import InputError, Map


def branch_of(system, parameter, bounds, x0, parameters=None, period=1):
    return saltus.continue_orbit(saltus.solve_orbit(system, parameters, x0=x0, period=period), parameter, bounds)


@pytest.fixture(scope="module")
def folds():
    branch = branch_of(cusp(), "r", (-1.0, 1.0), [0.9])
    return saltus.continue_locus(branch["SN1"], ("r", "h"), {"r": (-1.0, 1.0), "h": (0.5, 2.0)})


def test_folds_of_the_cusp_map_lie_on_its_cusp(folds):
    x = folds.column("x")
    assert folds.column("h") == pytest.approx(1 + 3 * x**2, abs=1e-10)
    assert folds.column("r") == pytest.approx(-2 * x**3, abs=1e-10)
    assert [folds["CP1"].parameters[name] for name in ("r", "h")] == pytest.approx([0.0, 1.0], abs=1e-9)
    assert np.abs(folds.coefficient) == pytest.approx(np.abs(3 * x), abs=1e-9)


@pytest.mark.campaign
def test_a_locus_is_saved_and_loaded_and_another_starts_from_it(folds, tmp_path):
    assert saltus.load(folds.save(tmp_path / "locus.nc")) == folds
    again = saltus.continue_locus(folds.point(3), ("r", "h"), {"r": (-1.0, 1.0), "h": (0.5, 2.0)})
    assert again["CP1"].parameters["h"] == pytest.approx(1.0, abs=1e-9)


def test_doublings_of_the_cusp_map_turn_subcritical_at_nine_x_squared_equal_to_one():
    """c = f''^2/4 + f'''/6 = 9 x^2 - 1 with 3 x^2 = h + 1: GPD at h = -2/3, r = 16/27."""
    branch = branch_of(cusp(), "r", (-1.0, 1.0), [0.9])
    locus = saltus.continue_locus(branch["PD1"], ("r", "h"), {"r": (-2.0, 2.0), "h": (-3.0, 2.0)})
    x = locus.column("x")
    assert locus.column("h") == pytest.approx(3 * x**2 - 1, abs=1e-10)
    assert locus.coefficient == pytest.approx(9 * x**2 - 1, abs=1e-8)
    for point in locus.special_points.of_type("GPD"):
        assert point.parameters["h"] == pytest.approx(-2 / 3, abs=1e-8)
        assert abs(point.parameters["r"]) == pytest.approx(16 / 27, abs=1e-8)
    assert len(locus.special_points.of_type("GPD")) == 2


@pytest.mark.campaign
def test_loci_of_the_henon_map_meet_in_its_resonances():
    """On det = -b = 1: a = -1 (R1), 5/4 (R3), 0 (R4), 3 (R2)."""
    bounds = {"a": (-3.0, 4.0), "b": (-1.5, 0.9)}
    branch = branch_of(henon(), "a", (-1.0, 1.0), [0.7, 0.2], {"a": 0.1})
    folds = saltus.continue_locus(branch["SN1"], ("a", "b"), bounds)
    assert folds.column("a") == pytest.approx(-((1 - folds.column("b")) ** 2) / 4, abs=1e-9)
    assert folds["R1_1"].parameters["b"] == pytest.approx(-1.0, abs=1e-8)
    flips = saltus.continue_locus(branch["PD1"], ("a", "b"), bounds)
    assert flips.column("a") == pytest.approx(3 * (1 - flips.column("b")) ** 2 / 4, abs=1e-9)
    assert flips["R2_1"].parameters["a"] == pytest.approx(3.0, abs=1e-8)
    other = branch_of(henon(), "b", (-1.5, 1.0), [0.5, -0.5], {"a": 0.2, "b": -0.9})
    circles = saltus.continue_locus(other["TR1"], ("a", "b"), bounds)
    assert circles.column("b") == pytest.approx(-1.0, abs=1e-10)
    found = {point.type: point.parameters["a"] for point in circles.special_points}
    assert found == {name: pytest.approx(a, abs=1e-7) for name, a in {"R1": -1, "R2": 3, "R3": 1.25, "R4": 0}.items()}
    assert all("two real multipliers" in reason for reason in circles.stopped)


@pytest.mark.campaign
def test_a_coefficient_that_vanishes_on_a_locus_of_circles_is_a_chenciner_point():
    """x -> (1 + m + d |x|^2) R(angle) x has the coefficient 2 d: |x|^2 = 2 |z|^2 with an eigenvector of length 1."""
    turn = "(1 + m + d*(x**2 + y**2) - (x**2 + y**2)**2)"
    system = Map(
        ("x", "y"), {"m": -0.1, "d": -0.5, "angle": 1.0},
        {"x": f"{turn}*(x*cos(angle) - y*sin(angle))", "y": f"{turn}*(x*sin(angle) + y*cos(angle))"},
    )  # fmt: skip
    branch = branch_of(system, "m", (-0.5, 0.5), [0.0, 0.0])
    point = branch["TR1"]
    assert point.parameters["m"] == pytest.approx(0.0, abs=1e-10)
    assert point.normal_form.coefficient == pytest.approx(-1.0, abs=1e-8)
    locus = saltus.continue_locus(point, ("m", "d"), {"m": (-1.0, 1.0), "d": (-1.0, 1.0)})
    assert locus["CH1"].parameters["d"] == pytest.approx(0.0, abs=1e-8)
    assert locus.angle == pytest.approx(1.0, abs=1e-8)


def test_the_other_multiplier_at_minus_one_is_a_fold_flip():
    system = Map(("x", "y"), {"r": 0.3, "s": 0.5}, {"x": "x + r - x**2", "y": "-s*y + y**3 + x*y/5"})
    branch = branch_of(system, "r", (-0.5, 0.5), [0.5, 0.0])
    locus = saltus.continue_locus(branch["SN1"], ("r", "s"), {"r": (-1.0, 1.0), "s": (0.0, 2.0)})
    assert locus["FF1"].parameters["s"] == pytest.approx(1.0, abs=1e-8)
    assert locus["FF1"].parameters["r"] == pytest.approx(0.0, abs=1e-8)


def test_border_collisions_of_the_skew_tent_map_lie_on_mu_equal_to_zero():
    branch = branch_of(tent(), "mu", (-1.0, 1.0), [-0.4])
    locus = saltus.continue_locus(branch["BC1"], ("mu", "a"), {"mu": (-1.0, 1.0), "a": (-2.0, 2.0)})
    assert locus.column("mu") == pytest.approx(0.0, abs=1e-12)
    assert locus["PD1"].parameters["a"] == pytest.approx(-1.0, abs=1e-9)
    assert locus["SN1"].parameters["a"] == pytest.approx(1.0, abs=1e-9)


def test_a_orbit_of_period_three_has_its_locus_of_folds():
    """x -> 1 - a x^2 + b is the quadratic family: its folds of period three have a (1 + b) = 7/4."""
    quadratic = Map(("x",), {"a": 1.76, "b": 0.0}, {"x": "1 + b - a*x**2"})
    branch = branch_of(quadratic, "a", (1.5, 1.8), [0.0], period=3)
    assert branch["SN1"].parameters["a"] == pytest.approx(1.75, abs=1e-9)
    locus = saltus.continue_locus(branch["SN1"], ("a", "b"), {"a": (1.0, 3.0), "b": (-0.3, 0.5)})
    assert locus.column("a") * (1 + locus.column("b")) == pytest.approx(1.75, abs=1e-9)
    assert locus.period == 3


def test_the_neimark_sacker_locus_of_a_delayed_map_is_a_line():
    """x' = r x (1 - y), y' = (1 - e) x + e y: the determinant at the fixed point is e + (1 - e)(r - 1)."""
    system = Map(("x", "y"), {"r": 1.9, "e": 0.0}, {"x": "r*x*(1 - y)", "y": "(1 - e)*x + e*y"})
    branch = branch_of(system, "r", (1.5, 2.5), [0.47, 0.47])
    locus = saltus.continue_locus(branch["TR1"], ("r", "e"), {"r": (1.5, 3.0), "e": (-0.2, 0.3)})
    r, e = locus.column("r"), locus.column("e")
    assert e + (1 - e) * (r - 1) == pytest.approx(1.0, abs=1e-9)
    assert np.cos(locus.angle) == pytest.approx((1 + e) / 2, abs=1e-9)


def test_what_cannot_be_used_is_named():
    bounds = {"mu": (-1.0, 1.0), "a": (-2.0, 2.0)}
    tented = branch_of(tent(), "mu", (-1.0, 1.0), [-0.4])
    with pytest.raises(InputError, match="multiplier 1"):
        saltus.continue_locus(tented.solution(3), ("mu", "a"), bounds, type="SN")
    with pytest.raises(InputError, match="from the nearest border"):
        saltus.continue_locus(tented.solution(3), ("mu", "a"), bounds, type="BC")
    with pytest.raises(InputError, match="must be one of SN, PD, TR, BC"):
        saltus.continue_locus(tented.solution(3), ("mu", "a"), bounds, type="GR")
    smooth = saltus.solve_orbit(Map(("x",), {"r": 0.3, "s": 0.0}, {"x": "r - x**2 + s"}), x0=[0.2])
    with pytest.raises(InputError, match="a smooth map has no borders"):
        saltus.continue_locus(smooth, ("r", "s"), {"r": (-1.0, 1.0), "s": (-1.0, 1.0)}, type="BC")
    doubling = branch_of(logistic(), "r", (2.0, 3.5), [0.6])["PD1"]
    with pytest.raises(InputError, match="use .equilibrium or .map_orbit"):
        _ = doubling.orbit
