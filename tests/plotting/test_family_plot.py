"""Pictures of families: every member at its place and in its colour, and nothing covered or cut off."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.colors import to_hex, to_rgb

import saltus
from saltus.errors import InputError
from saltus.plotting import plot, style
from saltus.plotting.branch import pieces_of

GAPS = (1.2, 0.8, 1.0)


@pytest.fixture(scope="module")
def orbit(impact_oscillator):
    return saltus.solve_orbit(impact_oscillator, {"w": 1.1}, [("free", "impact", [1.0, -1.3, 0.1], 5.71)])


@pytest.fixture(scope="module")
def family(orbit) -> saltus.results.Family:
    return saltus.continue_family(orbit, "A", {"d": GAPS, "c": [0.1, 0.11, 0.12]}, (0.05, 6.0), workers=1)


@pytest.fixture(scope="module")
def broken(orbit) -> saltus.results.Family:
    """A family whose member at d = 9 has no branch."""
    options = saltus.options.BranchOptions(stop_at="GR")
    return saltus.continue_family(orbit, "A", {"d": [1.0, 9.0, 0.9]}, (0.5, 6.0), options=options, workers=1)


def curves(ax):
    return [line for line in ax.lines if line.get_marker() == "None"]


def dots(ax):
    return [line for line in ax.lines if line.get_marker() != "None"]


def colour_at(ax, depth):
    found = {to_hex(line.get_color()) for line in curves(ax) if line.get_data_3d()[1][0] == depth}
    (colour,) = found
    return colour


def bar_of(ax):
    (bar,) = (other for other in ax.figure.axes if other is not ax)
    return bar


def test_each_member_is_drawn_whole_at_its_depth(family):
    ax = family.plot("A", "max_v")
    for branch, gap in zip(family, GAPS, strict=True):
        drawn = [line.get_data_3d() for line in curves(ax) if line.get_data_3d()[1][0] == gap]
        wanted = pieces_of(branch, "A", "max_v")
        assert len(drawn) == len(wanted)
        for (x, y, z), piece in zip(drawn, wanted, strict=True):
            assert set(y) == {gap}
            assert np.array_equal(x, piece.x)
            assert np.array_equal(z, piece.y)


@pytest.mark.parametrize("projection", ["3d", "2d"])
def test_stable_parts_are_solid_and_unstable_parts_dashed(family, projection):
    ax = family.plot("A", "max_v", projection=projection)
    by_depth = sorted((branch for branch in family), key=lambda branch: -branch.parameters["d"])
    kinds = [piece.kind for branch in by_depth for piece in pieces_of(branch, "A", "max_v")]
    assert {"stable", "unstable"} == set(kinds)
    assert [line.get_linestyle() for line in curves(ax)] == ["-" if kind == "stable" else "--" for kind in kinds]


def test_orbits_that_are_no_motion_stay_grey(orbit):
    options = saltus.options.BranchOptions(saltus.StepControl(at_grazing="pass"))
    passed = saltus.continue_family(orbit, "A", {"d": [0.9, 1.1]}, (0.05, 1.5), options=options, workers=1)
    ax = passed.plot("A", "max_v")
    grey = [line for line in curves(ax) if line.get_color() == style.LINES["not admissible"]["color"]]
    assert sorted(line.get_data_3d()[1][0] for line in grey) == [0.9, 1.1]


def test_special_points_are_marked_on_their_members(family):
    ax = family.plot("A", "max_v")
    marked = {tuple(place) for line in dots(ax) for place in np.transpose(line.get_data_3d())}
    wanted = {
        (branch.value_at(point, "A"), gap, branch.value_at(point, "max_v"))
        for branch, gap in zip(family, GAPS, strict=True)
        for point in branch.special_points
    }
    assert marked == wanted
    faces = {to_hex(line.get_markerfacecolor()) for line in dots(ax)}
    assert faces == {style.SPECIAL[kind].colour for kind in ("SN", "GR", "PD")}


def test_colours_grow_lighter_with_the_value_and_differ(family):
    ax = family.plot("A", "max_v")
    lights = [np.dot(to_rgb(colour_at(ax, gap)), (0.2126, 0.7152, 0.0722)) for gap in sorted(GAPS)]
    assert np.diff(lights).min() > 0.15
    assert lights[-1] < 0.8  # still to be seen on white


def test_members_in_front_are_drawn_last(family):
    ax = family.plot("A", "max_v")
    orders = {gap: {line.get_zorder() for line in ax.lines if line.get_data_3d()[1][0] == gap} for gap in GAPS}
    assert all(len(order) == 1 for order in orders.values())
    assert max(orders[1.2]) < max(orders[1.0]) < max(orders[0.8])


def test_the_plane_has_the_waterfall_s_curves_and_colours(family):
    flat, deep = family.plot("A", "max_v", projection="2d"), family.plot("A", "max_v")
    for mine, theirs in zip(flat.lines, deep.lines, strict=True):
        x, _, z = theirs.get_data_3d()
        assert np.array_equal(mine.get_xdata(), x)
        assert np.array_equal(mine.get_ydata(), z)
        assert to_hex(mine.get_color()) == to_hex(theirs.get_color())
    assert (flat.get_xlabel(), flat.get_ylabel()) == ("$A$", "max $v$")


@pytest.mark.parametrize("projection", ["3d", "2d"])
def test_the_bar_names_each_member_s_value_beside_its_colour(family, projection):
    ax = family.plot("A", "max_v", projection=projection)
    bar = bar_of(ax)
    assert [text.get_text() for text in bar.get_yticklabels()] == ["0.8", "1", "1.2"]
    assert bar.get_ylabel() == "$d$"
    mesh = bar.collections[-1]
    cells = [to_hex(mesh.cmap(mesh.norm(place))) for place in bar.get_yticks()]
    drawn = [to_hex(line.get_color()) for line in curves(ax)]
    assert cells == list(dict.fromkeys(drawn))[::-1]


def test_another_parameter_that_varies_can_be_the_depth(family):
    ax = family.plot("A", "max_v", over="c")
    assert ax.get_ylabel() == "$c$"
    assert {line.get_data_3d()[1][0] for line in curves(ax)} == {0.1, 0.11, 0.12}
    assert bar_of(ax).get_ylabel() == "$c$"


def test_axes_and_legend_name_what_is_drawn(family):
    ax = family.plot()
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_zlabel()) == ("$A$", "$d$", "min $x$")
    (legend,) = ax.figure.legends
    texts = [text.get_text() for text in legend.get_texts()]
    assert texts == ["stable", "unstable", "SN, saddle-node", "PD, period doubling", "GR, grazing"]


@pytest.mark.parametrize("projection", ["3d", "2d"])
def test_at_its_default_size_nothing_is_cut_off_or_covered(family, projection):
    ax = family.plot("A", "max_v", projection=projection)
    figure = ax.figure
    figure.canvas.draw()
    whole = figure.bbox
    boxes = [axis.get_tightbbox() for axis in ax._axis_map.values()]
    boxes += [bar_of(ax).get_tightbbox(), figure.legends[0].get_window_extent()]
    for box in boxes:
        assert whole.x0 <= box.x0 < box.x1 <= whole.x1
        assert whole.y0 <= box.y0 < box.y1 <= whole.y1
    for name in boxes[-2:]:
        assert not any(name.overlaps(box) for box in boxes if box is not name)


def test_a_family_of_one_is_drawn(orbit):
    one = saltus.continue_family(orbit, "A", {"d": [1.0]}, (0.9, 1.1), workers=1)
    ax = one.plot("A", "max_v")
    ax.figure.canvas.draw()
    assert [text.get_text() for text in bar_of(ax).get_yticklabels()] == ["1"]


def test_members_without_a_branch_are_left_out(broken):
    ax = broken.plot("A", "max_v")
    assert {line.get_data_3d()[1][0] for line in curves(ax)} == {0.9, 1.0}
    assert [text.get_text() for text in bar_of(ax).get_yticklabels()] == ["0.9", "1"]


@pytest.mark.campaign
def test_of_many_members_the_bar_names_some(orbit):
    many = saltus.continue_family(orbit, "A", {"d": np.linspace(0.9, 1.1, 21)}, (0.99, 1.01), workers=1)
    ax = many.plot("A", "max_v")
    assert [text.get_text() for text in bar_of(ax).get_yticklabels()] == [
        "0.9",
        "0.93",
        "0.96",
        "0.99",
        "1.02",
        "1.05",
        "1.08",
    ]
    assert len({to_hex(line.get_color()) for line in curves(ax)}) == 21


def test_given_axes_are_used_and_options_leave_out_points_and_names(family):
    figure, ax = plt.subplots()
    assert family.plot("A", "max_v", ax=ax, special=False, legend=False) is ax
    assert figure.axes == [ax]
    assert ax.get_legend() is None
    assert not dots(ax)
    space = plt.figure().add_subplot(projection="3d")
    assert family.plot("A", "max_v", ax=space) is space
    assert len(space.get_legend().get_texts()) == 5


@pytest.mark.campaign
def test_a_saved_family_is_drawn_the_same(family, tmp_path):
    again = saltus.load(family.save(tmp_path / "family.nc"))
    for mine, theirs in zip(family.plot().lines, again.plot().lines, strict=True):
        assert np.array_equal(mine.get_data_3d(), theirs.get_data_3d())


def test_a_wrong_name_is_answered_with_the_nearest_one(family):
    with pytest.raises(InputError, match=r"^quantity = 'max_vv': must be one of A, .*; did you mean 'max_v'\?$"):
        family.plot("A", "max_vv")
    with pytest.raises(InputError, match=r"^over = 'dd': must be one of d, c; did you mean 'd'\?$"):
        family.plot(over="dd")


def test_a_projection_must_be_known_and_that_of_the_axes(family):
    with pytest.raises(InputError, match=r"^projection = 'polar': must be one of 2d, 3d$"):
        family.plot(projection="polar")
    _, ax = plt.subplots()
    with pytest.raises(InputError, match=r"^projection = '3d': must be that of the Axes, '2d'; subplots\(subplot_kw="):
        family.plot(projection="3d", ax=ax)


def test_a_family_without_a_branch_cannot_be_drawn(family):
    empty = saltus.results.Family(family.system, "A", {"d": [9.0]}, (None,), {0: "no way"})
    with pytest.raises(InputError, match="^family = '1 members without a branch': must be .* to draw; no way$"):
        plot(empty)
