"""Whole diagrams of maps: fixed points, doublings and branch points to a stated depth, against closed forms."""

from __future__ import annotations

import math

import pytest

import saltus
from explained import unexplained
from known_maps import delayed, henon, logistic
from saltus import Map, diagram
from saltus.options import DiagramOptions
from saltus.results import MapBranch

CUBIC = Map(("x",), {"a": 0.5}, {"x": "a*x - x**3"}, name="cubic map")


@pytest.fixture(scope="module")
def of_logistic():
    return diagram(logistic(), "r", (0.5, 4.0), x0=[[0.6], [0.0]], options=DiagramOptions(depth=3))


def places(found, kind):
    return sorted(p.parameters[found.parameter] for p in found.special_points if p.type == kind)


def test_doublings_of_the_logistic_map_are_followed_to_the_depth(of_logistic):
    known = [3.0, 1.0 + math.sqrt(6.0), 3.544090359551922, 3.564407266095]
    assert places(of_logistic, "PD") == pytest.approx(known, abs=1e-9)
    assert places(of_logistic, "BP") == pytest.approx([1.0], abs=1e-10)
    assert [branch.period for branch in of_logistic] == [1, 1, 2, 4, 8]
    assert [origin.depth for origin in of_logistic.origins] == [0, 0, 1, 2, 3]
    assert of_logistic.stopped == "all branches to depth 3"
    assert of_logistic.failures == ()


def test_a_start_on_a_known_branch_is_not_followed_again():
    found = diagram(logistic(), "r", (0.5, 2.9), x0=[[0.0], [1e-9], [0.6]], options=DiagramOptions(depth=0))
    assert len(found) == 2
    assert all(isinstance(branch, MapBranch) for branch in found)


def test_the_cubic_map_has_its_pitchfork_and_both_doublings():
    """x = 0 has the multiplier a, x^2 = a - 1 has 3 - 2 a; both doubled orbits double again at the root of 5."""
    found = diagram(CUBIC, "a", (-2.5, 3.0), x0=[0.0])
    assert places(found, "BP") == pytest.approx([1.0], abs=1e-9)
    assert places(found, "PD") == pytest.approx([-1.0, 2.0, 2.0, math.sqrt(5.0), math.sqrt(5.0)], abs=1e-8)
    assert [(origin.parent, origin.label) for origin in found.origins] == [
        (-1, ""), (0, "PD1"), (0, "BP1"), (2, "PD1"), (2, "PD2"),
    ]  # fmt: skip
    pitchfork = found[2]
    assert pitchfork.x0[:, 0] ** 2 == pytest.approx(pitchfork.values - 1.0, abs=1e-9)
    first = found[1]
    assert first.points[:, :, 0] ** 2 == pytest.approx((first.values[:, None] + 1.0).repeat(2, axis=1), abs=1e-9)


def test_the_henon_map_doubles_where_it_should():
    """With b = 0.3: SN at -(1 - b)^2/4, PD at 3 (1 - b)^2/4 and (1 - b)^2 + (1 + b)^2/4."""
    found = diagram(henon(), "a", (-0.2, 1.0), x0=[0.5, 0.15], parameters={"a": 0.1}, options=DiagramOptions(depth=1))
    assert places(found, "SN") == pytest.approx([-0.1225], abs=1e-9)
    assert places(found, "PD") == pytest.approx([0.3675, 0.9125], abs=1e-9)


def test_the_other_branch_of_a_plane_map_is_its_point_0_and_not_rounding_of_it():
    found = diagram(delayed(), "r", (0.5, 2.2), x0=[0.47, 0.47])
    assert places(found, "TR") == pytest.approx([2.0], abs=1e-9)
    assert places(found, "BP") == pytest.approx([1.0], abs=1e-9)
    assert [point.type for point in found.special_points] == ["BP", "TR"]
    trivial = found[1]
    assert (trivial.values.min(), trivial.values.max()) == (0.5, pytest.approx(2.2))
    assert not trivial.points.any()


@pytest.mark.campaign
def test_a_diagram_of_a_map_is_saved_loaded_listed_and_told(of_logistic, tmp_path):
    assert saltus.load(of_logistic.save(tmp_path / "diagram.nc")) == of_logistic
    assert unexplained(of_logistic.to_xarray()) == []
    table = of_logistic.table()
    assert list(table["of"]) == ["map orbits"] * 5
    assert list(table["period"]) == [1, 1, 2, 4, 8]
    assert "orbits of period 4 from PD1 of branch 2" in repr(of_logistic)
    assert "17 fixed points from a start" in repr(of_logistic)


def test_without_a_fixed_point_near_the_start_the_search_says_so():
    with pytest.raises(saltus.ConvergenceError, match="orbit"):
        diagram(Map(("x",), {"a": 1.0}, {"x": "x + a + x**2"}), "a", (0.5, 2.0), x0=[0.3])
