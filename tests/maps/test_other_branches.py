"""Normal forms, doubled orbits, other branches and cascades of maps."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from known_maps import delayed, henon, logistic, tent
from saltus import InputError, Map


def branch_of(system, parameter, bounds, x0, parameters=None, period=1, **options):
    return saltus.continue_orbit(
        saltus.solve_orbit(system, parameters, x0=x0, period=period), parameter, bounds, **options
    )


def test_the_flip_of_the_logistic_map_has_coefficient_nine():
    """c = f''^2/4 + f'''/6 (Kuznetsov 2004, theorem 4.3) with f'' = -6, f''' = 0."""
    form = branch_of(logistic(), "r", (2.5, 3.5), [0.6], {"r": 2.8})["PD1"].normal_form
    assert form.coefficient == pytest.approx(9.0, rel=1e-8)
    assert form.criticality == "supercritical"


def test_the_flip_of_the_ricker_map_is_that_of_kuznetsov():
    """x -> r x exp(-x) doubles at r = exp(2), x = 2; c = f''^2/4 + f'''/6 = 1/6 with f'' = 0, f''' = 1."""
    ricker = Map(("x",), {"r": 6.0}, {"x": "r*x*exp(-x)"})
    point = branch_of(ricker, "r", (5.0, 9.0), [1.8])["PD1"]
    assert point.parameters["r"] == pytest.approx(math.exp(2), rel=1e-10)
    assert point.normal_form.coefficient == pytest.approx(1 / 6, rel=1e-8)


def test_the_fold_of_the_orbit_of_period_three_has_half_the_second_derivative_of_the_third_iterate():
    point = branch_of(logistic(), "r", (3.0, 4.0), [0.15], {"r": 3.84}, period=3)["SN1"]
    r, x = point.parameters["r"], float(point.map_orbit.x0[0])

    def third(y):
        for _ in range(3):
            y = r * y * (1 - y)
        return y

    step = 1e-4
    bend = (third(x + step) - 2 * third(x) + third(x - step)) / step**2
    assert abs(point.normal_form.coefficient) == pytest.approx(abs(bend) / 2, rel=1e-5)


def test_invariant_circles_of_the_delayed_logistic_map_have_the_radius_of_its_normal_form():
    """Near r = 2 the circle of z -> mu z (1 + d |z|^2) has |z|^2 = (|mu| - 1)/-d, and x - x* = 2 Re(z q)."""
    point = branch_of(delayed(), "r", (1.5, 2.5), [0.47, 0.47])["TR1"]
    form = point.normal_form
    assert (form.criticality, form.angle) == ("supercritical", pytest.approx(math.pi / 3, abs=1e-10))
    r = 2.002
    modulus = math.sqrt(r - 1)  # the determinant at the fixed point is r - 1
    states = saltus.iterate(delayed(), {"r": r}, [0.51, 0.5], n=20_000, discard=20_000).states
    # q = (exp(i pi/3), 1)/sqrt(2): y - y* has the amplitude 2 |z|/sqrt(2)
    amplitude = math.sqrt(2) * math.sqrt((modulus - 1) / -form.coefficient)
    assert np.ptp(states[:, 1]) / 2 == pytest.approx(amplitude, rel=0.03)


def test_a_doubled_orbit_lies_beside_its_doubling_on_the_stable_side():
    doubled = saltus.switch_branch(branch_of(logistic(), "r", (2.5, 3.5), [0.6], {"r": 2.8})["PD1"])
    r = doubled.parameters["r"]
    root = math.sqrt((r - 3) * (r + 1))
    assert r > 3.0
    assert (doubled.period, doubled.stable) == (2, True)
    assert sorted(doubled.points[:, 0]) == pytest.approx([(r + 1 - root) / (2 * r), (r + 1 + root) / (2 * r)])


def test_the_henon_map_doubles_as_the_orbit_of_period_two_in_closed_form():
    """det - tr of the orbit of period two: it exists from a = 3 (1 - b)^2/4 on, where 4 a = 3 (1 - b)^2."""
    doubled = saltus.switch_branch(branch_of(henon(), "a", (0.0, 1.0), [0.7, 0.2], {"a": 0.1})["PD1"])
    a, b = doubled.parameters["a"], 0.3
    assert a > 3 * (1 - b) ** 2 / 4
    root = math.sqrt(4 * a - 3 * (1 - b) ** 2)
    assert sorted(doubled.points[:, 0]) == pytest.approx([(1 - b - root) / (2 * a), (1 - b + root) / (2 * a)])


def test_at_a_branch_point_the_other_fixed_point_is_found():
    other = saltus.switch_branch(branch_of(logistic(), "r", (0.5, 2.5), [0.4], {"r": 1.8})["BP1"])
    assert other.x0[0] == pytest.approx(0.0, abs=1e-14)
    halved = saltus.switch_branch(branch_of(logistic(), "r", (2.5, 3.3), [0.5], period=2)["BP1"])
    assert (halved.period, halved.x0[0]) == (1, pytest.approx(2 / 3))


@pytest.mark.campaign
def test_the_cascade_of_the_logistic_map_has_feigenbaums_limits(tmp_path):
    start = branch_of(logistic(), "r", (2.5, 3.5), [0.6], {"r": 2.8})["PD1"]
    cascade = saltus.follow_cascade(start, (2.5, 4.0), doublings=6)
    known = [3.0, 1 + math.sqrt(6), 3.544090359551922, 3.564407266095, 3.568759419543826]
    assert cascade.values[:5] == pytest.approx(known, abs=1e-10)
    assert cascade.ratios[-1] == pytest.approx(4.669201609, rel=5e-5)
    assert cascade.limit == pytest.approx(3.569945671870945, abs=1e-8)
    assert [point.map_orbit.period for point in cascade.points] == [2**k for k in range(7)]
    assert saltus.load(cascade.save(tmp_path / "cascade.nc")) == cascade
    assert "period 16" in repr(cascade)


def test_where_no_other_branch_meets_the_type_is_named():
    branch = branch_of(tent(), "mu", (-1.0, 1.0), [-0.4])
    with pytest.raises(InputError, match="of type PD or BP"):
        saltus.switch_branch(branch["BC1"])
    assert branch["BC1"].normal_form.reason.startswith("the sequence of events changes there")
    with pytest.raises(InputError, match="a PD of a branch"):
        saltus.follow_cascade(branch["BC1"], (-1.0, 1.0))


def test_a_point_with_a_double_multiplier_has_no_normal_form():
    standard = Map(("p", "x"), {"K": 3.5}, {"p": "p + K*sin(x)", "x": "x + p + K*sin(x)"})
    point = saltus.continue_orbit(saltus.solve_orbit(standard, x0=[0.0, 3.0]), "K", (1.0, 8.0))["PD1"]
    assert point.parameters["K"] == pytest.approx(4.0, abs=1e-9)
    form = point.normal_form
    assert math.isnan(form.coefficient)
    assert form.criticality == "undetermined"
    assert repr(form) == "NormalForm PD: undetermined, 2 are critical at once"
