"""Pictures of branches: what is drawn is the branch, all of it, and nothing else."""

from __future__ import annotations

from itertools import pairwise

import matplotlib
import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.colors import to_hex

import saltus
from saltus.continuation import Branch
from saltus.errors import InputError
from saltus.plotting import plot, style
from saltus.plotting.branch import _smooth, pieces_of


@pytest.fixture(scope="module")
def impacting(impact_oscillator):
    """Branch in A with an SN at 0.1164 and a GR at 0.2371, where it goes on without impacts."""
    return saltus.solve_orbit(impact_oscillator, {"w": 1.1}, [("free", "impact", [1.0, -1.3, 0.1], 5.71)])


@pytest.fixture(scope="module")
def branch(impacting) -> Branch:
    return saltus.continue_orbit(impacting, "A", (0.05, 1.5))


@pytest.fixture(scope="module")
def tapping(tapping_orbit) -> Branch:
    return saltus.continue_orbit(tapping_orbit, "Omega", (0.8, 1.4))


def _curves(ax, kind: str) -> list:
    wanted = style.LINES[kind]
    found = [
        line for line in ax.lines if line.get_marker() == "None" and to_hex(line.get_color()) == to_hex(wanted["color"])
    ]
    return [line for line in found if (line.get_linestyle() == "-") == (wanted["linestyle"] == "-")]


def test_stable_parts_are_solid_and_unstable_parts_dashed(branch):
    ax = branch.plot("A", "max_v")
    fold, grazing = branch["SN1"].parameters["A"], branch["GR1"].parameters["A"]
    (dashed,) = _curves(ax, "unstable")
    assert dashed.get_linestyle() == "--"
    assert {dashed.get_xdata()[0], dashed.get_xdata()[-1]} == {fold, grazing}
    assert len(_curves(ax, "stable")) == 2


@pytest.mark.parametrize("names", [("Omega", "min_z"), ("Omega", "q1"), ("min_z", "period"), ("arclength", "max_v1")])
def test_no_gap_and_no_nan_anywhere_along_the_branch(tapping, names):
    pieces = pieces_of(tapping, *names)
    for piece in pieces:
        assert np.isfinite(piece.x).all()
        assert np.isfinite(piece.y).all()
    for before, after in pairwise(pieces):
        assert (before.x[-1], before.y[-1]) == (after.x[0], after.y[0])
        assert before.kind != after.kind


def test_the_curve_passes_through_every_point_and_every_special_point(tapping):
    pieces = pieces_of(tapping, "Omega", "min_z")
    drawn = {(x, y) for piece in pieces for x, y in zip(piece.x, piece.y, strict=True)}
    specials = {(tapping.value_at(p, "Omega"), tapping.value_at(p, "min_z")) for p in tapping.special_points}
    assert specials <= drawn
    missing = set(zip(tapping.values, tapping.column("min_z"), strict=True)) - drawn
    grazings = [p.parameters["Omega"] for p in tapping.special_points if p.type == "GR"]
    # the grazing orbit is a point of the branch, in one signature, and a special point, in the other: drawn once
    assert all(min(abs(x - grazing) for grazing in grazings) < 1e-9 for x, _ in missing)
    assert len(missing) <= len(grazings)


def test_pieces_end_at_the_branch_s_ends(tapping):
    pieces = pieces_of(tapping, "Omega", "min_z")
    assert pieces[0].x[0] == tapping.values[0]
    assert pieces[-1].x[-1] == tapping.values[-1]


def test_stability_between_two_special_points_of_one_step_follows_their_multipliers(tapping):
    """Between PD1 and SN2, 1.4e-5 apart in Omega, the impacting orbit is stable."""
    doubling, fold = tapping["PD1"].parameters["Omega"], tapping["SN2"].parameters["Omega"]
    pieces = pieces_of(tapping, "Omega", "min_z")
    between = [piece for piece in pieces if piece.x[0] == doubling and piece.x[-1] == fold]
    assert [piece.kind for piece in between] == ["stable"]


def test_pieces_change_only_at_special_points(tapping):
    ends = {piece.x[0] for piece in pieces_of(tapping, "Omega", "min_z")[1:]}
    assert ends <= {point.parameters["Omega"] for point in tapping.special_points}


def _overshoot(branch, x_name: str, y_name: str) -> float:
    """Return by how much the curve leaves the boxes that neighbouring points span, in units of the boxes."""
    pieces = pieces_of(branch, x_name, y_name)
    x = np.concatenate([pieces[0].x[:1], *(piece.x[1:] for piece in pieces)])
    y = np.concatenate([pieces[0].y[:1], *(piece.y[1:] for piece in pieces)])
    nodes = set(zip(branch.column(x_name), branch.column(y_name), strict=True))
    nodes |= {(branch.value_at(p, x_name), branch.value_at(p, y_name)) for p in branch.special_points}
    at = [i for i, place in enumerate(zip(x, y, strict=True)) if place in nodes]
    assert (at[0], at[-1]) == (0, len(x) - 1)
    worst = 0.0
    for first, last in pairwise(at):
        for values in (x, y):
            low, high = sorted((values[first], values[last]))
            inside = values[first : last + 1]
            over = max(low - inside.min(), inside.max() - high)
            worst = max(worst, over / (high - low) if over > 0.0 else 0.0)
    return worst


def test_the_curve_never_overshoots_its_points(tapping):
    assert _overshoot(tapping, "Omega", "min_z") == 0.0


def test_where_both_coordinates_turn_the_curve_is_round_not_a_cusp():
    """Points of the parabola (s^2, s^2/2 + s/10): x and y both turn at s = 0, where the tangent is vertical."""
    s = np.linspace(-1.0, 1.0, 5)
    x, y = _smooth(s, s**2, 0.5 * s**2 + 0.1 * s, 20)
    fine = np.linspace(-1.0, 1.0, len(x))
    assert x == pytest.approx(fine**2, abs=0.01)
    assert y == pytest.approx(0.5 * fine**2 + 0.1 * fine, abs=0.01)
    assert y.min() < 0.0 < x[np.argmin(y)]


@pytest.mark.campaign
@pytest.mark.parametrize(("which", "x", "y"), [("tapping", "Omega", "min_z"), ("branch", "A", "max_v")])
def test_interpolation_agrees_with_a_branch_of_many_more_points(request, which, x, y):
    """The oracle is a branch of ten times as many points; 1e-3 of the axes is less than a line's width."""
    branch = request.getfixturevalue(which)
    start = branch.solution(len(branch) // 2)
    bounds = branch.values.min(), branch.values.max()
    dense = saltus.continue_orbit(start, x, bounds, steps=saltus.StepControl(largest=0.01))
    size = np.array([np.ptp(branch.column(x)), np.ptp(branch.column(y))])
    line = np.column_stack([dense.column(x), dense.column(y)]) / size
    begin, step = line[:-1], np.diff(line, axis=0)
    length = np.maximum((step**2).sum(axis=1), 1e-300)
    for piece in pieces_of(branch, x, y):
        for place in np.column_stack([piece.x, piece.y]) / size:
            along = np.clip(((place - begin) * step).sum(axis=1) / length, 0.0, 1.0)
            assert np.linalg.norm(place - begin - along[:, None] * step, axis=1).min() < 1e-3


def test_orbits_that_are_no_motion_are_dotted_grey(impacting):
    passed = saltus.continue_orbit(impacting, "A", (0.05, 1.5), steps=saltus.StepControl(at_grazing="pass"))
    ax = passed.plot("A", "max_v")
    (dotted,) = _curves(ax, "not admissible")
    assert (
        dotted.get_xdata()[0] == passed["GR1"].parameters["A"]
        or dotted.get_xdata()[-1] == passed["GR1"].parameters["A"]
    )
    assert dotted.get_color() == "0.6"
    assert "not admissible" in [text.get_text() for text in ax.get_legend().get_texts()]


def test_special_points_are_dots_in_the_paper_s_colours_and_named(tapping):
    ax = tapping.plot("Omega", "min_z")
    dots = {line.get_label(): line for line in ax.lines if line.get_linestyle() == "None"}
    assert list(dots) == ["SN, saddle-node", "GR, grazing", "PD, period doubling"]
    assert [len(dot.get_xdata()) for dot in dots.values()] == [6, 2, 2]
    assert {dot.get_marker() for dot in dots.values()} == {"o"}
    red, green, purple = (matplotlib.colors.to_rgb(dot.get_markerfacecolor()) for dot in dots.values())
    assert red[0] > 2.0 * max(red[1:])
    assert green[1] > 1.5 * max(green[0], green[2])
    assert purple[2] > purple[0] > purple[1]
    luminance = [float(np.dot(colour, (0.2126, 0.7152, 0.0722))) for colour in (green, red)]
    assert luminance[0] > 2.0 * luminance[1]  # lighter, as in the paper's hard copy
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == ["stable", "unstable", *dots]


def test_markers_of_torus_and_branch_points_are_an_empty_diamond_and_a_black_square():
    torus, point = style.SPECIAL["TR"].options(), style.SPECIAL["BP"].options()
    assert (torus["marker"], torus["markerfacecolor"]) == ("D", "white")
    assert (point["marker"], point["markerfacecolor"]) == ("s", "#000000")


def test_a_user_s_event_is_drawn_under_its_name(impacting):
    branch = saltus.continue_orbit(impacting, "A", (0.5, 1.5), events={"max_v": 1.5})
    ax = branch.plot("A", "max_v")
    (dots,) = (line for line in ax.lines if line.get_label() == "max_v")
    assert dots.get_ydata() == pytest.approx([1.5], abs=1e-9)


def test_axes_are_named_and_greek(tapping):
    ax = tapping.plot("Omega", "min_z")
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$\\Omega$", "min $z$")


def test_default_axes_are_the_parameter_and_the_first_output(tapping, branch):
    assert tapping.plot().get_ylabel() == "min $z$"
    ax = branch.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$A$", "min $x$")  # the wall holds the greatest x


def test_given_axes_are_used_and_options_leave_out_points_and_legend(branch):
    _, ax = plt.subplots()
    assert branch.plot("A", "max_v", ax=ax, special=False, legend=False) is ax
    assert ax.get_legend() is None
    assert all(line.get_linestyle() != "None" for line in ax.lines)


def test_a_wrong_name_is_answered_with_the_nearest_one(tapping):
    with pytest.raises(InputError, match=r"quantity = 'min_zz': must be one of Omega, .*; did you mean 'min_z'\?"):
        tapping.plot("Omega", "min_zz")
    with pytest.raises(InputError, match=r"did you mean 'Omega'\?"):
        tapping.plot("Omga", "min_z")


def test_a_thing_that_is_no_result_cannot_be_drawn():
    with pytest.raises(
        InputError, match="result = 'dict': must be a result that can be drawn: Branch, PeriodicOrbit, Trajectory"
    ):
        plot({})


@pytest.mark.campaign
def test_a_saved_branch_is_drawn_the_same(branch, tmp_path):
    again = Branch.load(branch.save(tmp_path / "branch.nc"))
    for mine, theirs in zip(pieces_of(branch, "A", "max_v"), pieces_of(again, "A", "max_v"), strict=True):
        assert mine.kind == theirs.kind
        assert np.array_equal(mine.x, theirs.x)
        assert np.array_equal(mine.y, theirs.y)
