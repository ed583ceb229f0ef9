"""Jumps in data with a known jump, and the special points of a model that measured ones belong to."""

import math
from types import SimpleNamespace

import numpy as np
import pytest

from saltus import InputError, MeasuredPoint
from saltus.fitting.jumps import beyond, jumps_in, point_near, read_points
from saltus.fitting.measured import Channel, Measured

W = np.linspace(1.0, 2.0, 11)
BOUNDS = (1.0, 2.0)


def measured(x, values, ways, sigma=0.01, turn=0.0):
    x, values = np.asarray(x, dtype=float), np.asarray(values)
    formulas = ("a", "p") if np.iscomplexobj(values) else ("a",)
    channel = Channel("y", formulas, values, np.full(len(x), sigma) * np.ones(len(x)), turn)
    return Measured("w", x, (channel,), tuple(ways))


def step(at, height=1.0):
    return 0.05 * W + height * (at < W)


def permuted(data, order):
    (one,) = data.channels
    channel = Channel(one.name, one.formulas, one.values[order], one.sigma[order], one.turn)
    return Measured("w", data.x[order], (channel,), tuple(data.direction[i] for i in order))


# jumps in the data


@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e9])
def test_a_step_is_a_jump_in_the_middle_between_two_data(unit):
    (found,) = jumps_in(measured(unit * W, step(1.45), ["up"] * 11))
    assert (found.type, found.direction) == ("SN", "up")
    assert found.value == pytest.approx(1.45 * unit, rel=1e-12)
    assert found.sigma == pytest.approx(0.1 * unit / math.sqrt(12.0), rel=1e-9)  # of an equal distribution


def test_each_way_has_its_own_jump():
    x, ways = np.tile(W, 2), ["up"] * 11 + ["down"] * 11
    found = jumps_in(measured(x, np.append(step(1.75), step(1.25)), ways))
    assert [(one.direction, round(one.value, 9)) for one in found] == [("up", 1.75), ("down", 1.25)]


def test_the_order_of_data_whose_way_is_named_does_not_matter():
    x, ways = np.tile(W, 2), ["up"] * 11 + ["down"] * 11
    data = measured(x, np.append(step(1.75), step(1.25)), ways)
    mixed = permuted(data, np.random.default_rng(5).permutation(22))
    assert sorted(jumps_in(mixed)) == sorted(jumps_in(data))


@pytest.mark.parametrize(("name", "way"), [("approach", "down"), ("retract", "up")])
def test_approach_and_retract_are_ways_down_and_up_in_any_order(name, way):
    for x, values in ((W, step(1.45)), (W[::-1], step(1.45)[::-1])):
        (found,) = jumps_in(measured(x, values, [name] * 11))
        assert (found.direction, found.value) == (way, pytest.approx(1.45))


def test_a_way_of_another_name_is_told_by_the_order_of_its_data():
    for x, values, way in ((W, step(1.45), "up"), (W[::-1], step(1.45)[::-1], "down")):
        (found,) = jumps_in(measured(x, values, ["run 3"] * 11))
        assert found.direction == way
    order = np.array([3, 1, *range(4, 11), 0, 2])
    assert jumps_in(permuted(measured(W, step(1.45), ["run 3"] * 11), order)) == []  # which way is not known


@pytest.mark.parametrize(("height", "jumps"), [(0.1, 0), (0.2, 1)])
def test_a_jump_is_ten_standard_errors_of_a_difference_or_more(height, jumps):
    flat = height * (W > 1.45)
    assert len(jumps_in(measured(W, flat, ["up"] * 11))) == jumps  # 0.01 sqrt(2) is that of a difference


def test_a_step_between_data_of_unlike_standard_errors_is_judged_by_both():
    """A difference of 0.5 is small beside a standard error of 1, whichever of both data has it."""
    values, sigma = np.zeros(11), np.full(11, 0.01)
    values[5], sigma[5] = 0.5, 1.0
    for ways in (["up"] * 11, ["down"] * 11):
        assert jumps_in(measured(W, values, ways, sigma)) == []
    rough = np.full(11, 0.01)
    rough[4] = 0.03
    hypot = math.hypot(0.03, 0.01)
    for height, jumps in ((9.99 * hypot, 0), (10.01 * hypot, 1)):
        for ways in (["up"] * 11, ["down"] * 11):
            assert len(jumps_in(measured(W, height * (W > 1.45), ways, rough))) == jumps


def test_a_slope_as_steep_around_is_no_jump():
    assert jumps_in(measured(W, 5.0 * W, ["up"] * 11)) == []
    assert len(jumps_in(measured(W, np.where(W < 1.45, 0.0, 1.6) + W, ["up"] * 11))) == 1  # 17 times the others


def test_two_data_are_too_few_for_a_jump_and_an_empty_way_has_none():
    assert jumps_in(measured([1.0, 2.0], [0.0, 9.0], ["up"] * 2)) == []
    assert jumps_in(measured([1.0], [0.0], ["up"])) == []


def test_a_phase_that_passes_its_cut_does_not_jump():
    angles = np.linspace(2.6, 3.7, 11)
    cut = (angles + np.pi) % (2.0 * np.pi) - np.pi
    assert jumps_in(measured(W, cut, ["up"] * 11, turn=2.0 * np.pi)) == []
    assert len(jumps_in(measured(W, cut, ["up"] * 11))) == 1


def test_a_complex_response_that_only_turns_its_phase_jumps():
    values = np.where(W > 1.45, 1j, 1.0 + 0j)
    assert len(jumps_in(measured(W, values, ["up"] * 11))) == 1


def test_two_values_at_one_parameter_are_no_jump_between_parameters():
    x = np.insert(W, 5, W[5])
    values = np.where(np.arange(12) > 5, 1.0, 0.0)
    assert jumps_in(measured(x, values, ["up"] * 12)) == []


# what is given


def test_false_gives_none_and_true_those_in_the_data():
    data = measured(W, step(1.45), ["up"] * 11)
    assert read_points(False, data, BOUNDS) == []
    assert read_points(True, data, BOUNDS) == jumps_in(data)


def test_points_that_are_given_are_kept_in_their_order():
    points = [MeasuredPoint("GR", 2.0, 0.1), MeasuredPoint("SN", 1.0, 1e-9, "down"), MeasuredPoint("TR", 1.5, 1e9)]
    assert read_points(tuple(points), measured(W, W, [""] * 11), BOUNDS) == points


def test_ways_along_a_distance_are_those_along_any_parameter():
    """Towards the sample the distance falls."""
    given = [MeasuredPoint("SN", 1.5, 0.1, way, 0.2) for way in ("approach", "retract")]
    read = [MeasuredPoint("SN", 1.5, 0.1, way, 0.2) for way in ("down", "up")]
    assert read_points(given, measured(W, W, [""] * 11), BOUNDS) == read


BAD = {
    "no ways": (True, "column 'direction'"),
    "one point": (MeasuredPoint("SN", 1.5, 0.1), "jumps = 'SN': must be"),
    "a number": (1, "True, False or several saltus.fitting.MeasuredPoint"),
    "numbers": ([1.5], "jumps = 1.5"),
    "type": ([MeasuredPoint("BP", 1.5, 0.1)], "type = 'BP': must be one of SN, PD, TR, GR"),
    "value": ([MeasuredPoint("SN", np.nan, 0.1)], "value of a measured point = nan"),
    "outside": ([MeasuredPoint("SN", 2.1, 0.1)], "value of a measured point = 2.1"),
    "sigma": ([MeasuredPoint("SN", 1.5, 0.0)], "sigma of a measured point = 0.0"),
    "direction": ([MeasuredPoint("SN", 1.5, 0.1, "left")], "direction = 'left'"),
    "reach": ([MeasuredPoint("SN", 1.5, 0.1, "up", -0.1)], "reach of a measured point = -0.1"),
    "reach without a way": ([MeasuredPoint("SN", 1.5, 0.1, "", 0.1)], "name the way: up, down"),
}


@pytest.mark.parametrize("what", BAD)
def test_points_that_cannot_be_used_are_told(what):
    given, message = BAD[what]
    with pytest.raises(InputError, match=message):
        read_points(given, measured(W, W, [""] * 11), BOUNDS)


@pytest.mark.parametrize(("way", "sign"), [("up", 1.0), ("down", -1.0)])
def test_a_jump_bounds_its_fold_from_one_side(way, sign):
    """No cost within the reach behind the jump; before it, and beyond its reach, the distance counts."""
    point = MeasuredPoint("SN", 1.5, 0.01, way, 0.2)
    for behind, away, slope in ((-0.1, -0.1, 1.0), (0.1, 0.0, 0.0), (0.3, 0.1, 1.0)):
        assert beyond(point, 1.5 + sign * behind) == (pytest.approx(sign * away, abs=1e-12), slope)
    assert beyond(point._replace(reach=0.0), 1.6) == (pytest.approx(0.1), 1.0)


def test_jumps_in_data_have_the_reach_that_is_asked_for():
    data = measured(W, step(1.45), ["up"] * 11)
    assert [one.reach for one in read_points(True, data, BOUNDS, 0.3)] == [0.3]


# the model's special points


def special(kind, value):
    return SimpleNamespace(type=kind, varied=("w",), value=lambda name: {"w": value}[name])


def branch(*points):
    def of_type(kind):
        return [one for one in points if one.type == kind]

    return SimpleNamespace(special_points=SimpleNamespace(of_type=of_type))


LOW, HIGH, GRAZING, DOUBLING = special("SN", 1.2), special("SN", 1.8), special("GR", 1.5), special("PD", 1.6)
BRANCH = branch(LOW, HIGH, GRAZING, DOUBLING)
SHEETS = [
    SimpleNamespace(ends=(None, HIGH)),
    SimpleNamespace(ends=(LOW, DOUBLING)),
    SimpleNamespace(ends=(GRAZING,) * 2),
]


@pytest.mark.parametrize(
    ("point", "found"),
    [
        (MeasuredPoint("SN", 1.3, 0.1, "up"), DOUBLING),  # the nearest upper end, of any type that is no grazing
        (MeasuredPoint("SN", 1.75, 0.1, "up"), HIGH),
        (MeasuredPoint("SN", 1.9, 0.1, "down"), LOW),  # the only lower end
        (MeasuredPoint("SN", 1.45, 0.1), LOW),
        (MeasuredPoint("SN", 1.55, 0.1), HIGH),
        (MeasuredPoint("PD", 1.0, 0.1), DOUBLING),
        (MeasuredPoint("GR", 1.0, 0.1), GRAZING),
        (MeasuredPoint("GR", 1.0, 0.1, "up"), GRAZING),
        (MeasuredPoint("TR", 1.0, 0.1), None),
    ],
)
def test_a_measured_point_belongs_to_the_nearest_end_on_its_way_or_of_its_type(point, found):
    assert point_near(point, SHEETS, [BRANCH]) is found


def test_without_an_end_on_its_way_a_measured_jump_has_no_point():
    assert point_near(MeasuredPoint("SN", 1.5, 0.1, "down"), SHEETS[:1], [BRANCH]) is None
    assert point_near(MeasuredPoint("SN", 1.5, 0.1, "up"), SHEETS[2:], [BRANCH]) is None


def test_points_of_all_branches_are_looked_at():
    far = special("SN", 1.41)
    assert point_near(MeasuredPoint("SN", 1.45, 0.1), SHEETS, [BRANCH, branch(far)]) is far
