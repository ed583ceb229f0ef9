"""The same branches at every tolerance: special points, halvings, cascades, Liouville's theorem, verification."""

from __future__ import annotations

import itertools
import math

import pytest

import tolerances
from saltus import continue_orbit, find_orbit, follow_cascade, switch_branch, verify
from selection import guarding

LOOSE = tolerances.TOLERANCES[1:]
EVERY = list(itertools.product(tolerances.CASES, LOOSE))
DOUBLING = 2.8324450278  # of Roessler's cycle in c


@pytest.mark.parametrize(
    ("name", "tolerance"), guarding(EVERY, ("Roessler", 1e-5), ("hard stop", 1e-5), campaign=17, spread=True)
)
def test_special_points_are_those_of_the_finest_tolerance(name: str, tolerance: float) -> None:
    exact, found = tolerances.branch(name, 1e-12), tolerances.branch(name, tolerance)
    assert [point.type for point in found.special_points] == [point.type for point in exact.special_points]
    for one, other in zip(exact.special_points, found.special_points, strict=True):
        value = one.parameters[exact.parameter]
        assert other.parameters[exact.parameter] == pytest.approx(value, rel=100.0 * tolerance, abs=1e-8)


@pytest.mark.parametrize(("name", "tolerance"), guarding(EVERY, ("two wells", 1e-5), campaign=17, spread=True))
def test_what_is_right_to_the_tolerance_passes_verification(name: str, tolerance: float) -> None:
    checked = verify(tolerances.branch(name, tolerance))
    assert checked.passed, checked
    # a column keeps the digits of the last Newton step, of which those of an orbit made anew may differ; where an event
    # is met without speed multipliers have no digits
    left = [row for row in checked.unchecked if not row.what.startswith(("column", "variable"))]
    assert not [row for row in left if not str(row.found).startswith("an event is met more slowly")]


@pytest.mark.parametrize("tolerance", guarding(tolerances.TOLERANCES, 1e-5))
def test_grazing_of_a_hard_stop_is_the_closed_form(tolerance: float) -> None:
    # A/sqrt((1 - w^2)^2 + (c w)^2) = d
    truth = math.hypot(1.0 - 0.7**2, 0.1 * 0.7)
    point = tolerances.branch("hard stop", tolerance)["GR1"]
    assert point.parameters["A"] == pytest.approx(truth, rel=max(1e-9, 10.0 * tolerance))


@pytest.mark.parametrize("tolerance", guarding(tolerances.TOLERANCES, 1e-6))
def test_period_doubling_of_a_ball_is_the_closed_form(tolerance: float) -> None:
    # cos(phase) = pi (1 - e) g / ((1 + e) a w^2); the multiplier is -1 where a^2 = that of equal e + 1/e, Holmes 1982
    cosine = math.pi * (1.0 - 0.5) / (1.0 + 0.5)
    truth = math.hypot(cosine, 2.0 * (1.0 + 0.5**2) / (1.0 + 0.5) ** 2)
    point = tolerances.branch("ball", tolerance)["PD1"]
    assert point.parameters["a"] == pytest.approx(truth, rel=max(1e-9, 10.0 * tolerance))


@pytest.mark.parametrize("tolerance", guarding(tolerances.TOLERANCES, 1e-5))
def test_multipliers_multiply_to_liouville_at_every_tolerance(tolerance: float) -> None:
    branch = tolerances.branch("soft stop", tolerance)
    assert not [point for point in branch.special_points if point.type == "TR"]
    for values, period in zip(branch.multipliers, branch.period, strict=True):
        assert values.prod().real == pytest.approx(math.exp(-0.1 * period), rel=max(1e-6, 1e3 * tolerance))


@pytest.mark.parametrize("tolerance", guarding(tolerances.TOLERANCES, 1e-6))
def test_a_doubled_branch_ends_where_its_period_halves(tolerance: float) -> None:
    doubled = find_orbit(tolerances.system("Roessler"), {"c": 3.5}, x0=[3.0, 0.0, 0.1], tolerance=tolerance)
    branch = continue_orbit(doubled, "c", (2.0, 3.7))
    assert [point.type for point in branch.special_points] == ["BP"]
    assert branch["BP1"].parameters["c"] == pytest.approx(DOUBLING, rel=1e-8)
    assert branch.values.min() == pytest.approx(DOUBLING, rel=1e-8)
    assert "the period halves" in branch.stopped[0]


@pytest.mark.parametrize("tolerance", guarding(tolerances.TOLERANCES, 1e-5))
def test_a_forced_branch_doubles_where_it_is_left_and_ends_there(tolerance: float) -> None:
    point = tolerances.branch("two wells", tolerance)["PD1"]
    branch = continue_orbit(switch_branch(point), "A", (0.05, 0.3))
    assert [one.type for one in branch.special_points] == ["BP", "PD"]
    assert "the period halves" in branch.stopped[0]
    assert branch.values.min() == pytest.approx(point.parameters["A"], rel=10.0 * tolerance, abs=1e-9)


@pytest.mark.parametrize("tolerance", guarding(tolerances.TOLERANCES, 1e-6))
def test_cascades_are_as_long_at_every_tolerance(tolerance: float) -> None:
    start = find_orbit(tolerances.system("Roessler"), x0=[3.0, 0.0, 0.1], tolerance=tolerance)
    point = continue_orbit(start, "c", (2.4, 4.5))["PD1"]
    cascade = follow_cascade(point, (2.4, 4.5))
    assert len(cascade.values) == 5
    assert cascade.ratios[-1] == pytest.approx(4.669, abs=0.05)
