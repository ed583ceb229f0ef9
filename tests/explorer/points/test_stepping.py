"""Steps along a branch: points, special points, ends."""

import pytest

from saltus.explorer.points.stepping import stepped
from saltus.explorer.steps import Place


@pytest.mark.parametrize(
    ("begun", "count", "then"), [(0, 1, 1), (5, -2, 3), (0, -1, 0), (3, 10**9, None), (3, -(10**9), 0)]
)
def test_points_follow_each_other_up_to_the_ends(results, begun, count, then):
    last = len(results["branch1"]) - 1
    place = stepped(Place(of="branch1", index=begun), count, results)
    assert place == Place(of="branch1", index=last if then is None else then)


def test_a_step_from_a_special_point_leads_to_its_neighbours(results):
    at = results["branch1"]["SN1"].position
    place = Place(of="branch1", label="SN1")
    for count, side in ((1, 1), (-1, -1)):
        found = stepped(place, count, results).index
        assert side * (found - at) > 0.0
        assert abs(found - at) <= 1.0


def test_special_points_follow_each_other(results):
    branch = results["branch1"]
    order = [point.label for point in sorted(branch.special_points, key=lambda point: point.position)]
    place, met = Place(of="branch1", index=0), []
    for _ in order:
        place = stepped(place, 1, results, special=True)
        met.append(place.label)
    assert met == order
    assert stepped(place, 1, results, special=True) == place
    back = stepped(place, -1, results, special=True)
    assert back.label == order[-2]


def test_steps_from_elsewhere_begin_on_the_first_branch(results):
    assert stepped(None, 1, results) == stepped(Place(of="orbit1"), -1, results) == Place(of="branch1", index=0)
    assert stepped(Place(of="locus1", label="X"), 1, results) == Place(of="branch1", index=0)
    assert stepped(None, 1, {}) is None
