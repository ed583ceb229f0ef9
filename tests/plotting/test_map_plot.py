"""Pictures of orbits of maps, their branches, loci and cascades: the curves are the closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.colors import to_hex

import saltus
from known_maps import henon, logistic, tent
from saltus.cli import main
from saltus.errors import InputError
from saltus.plotting import style
from saltus.plotting.space import stretches_of


@pytest.fixture(scope="module")
def fixed_points():
    return saltus.continue_orbit(saltus.solve_orbit(logistic(), {"r": 2.8}, x0=[0.6]), "r", (0.5, 3.8))


@pytest.fixture(scope="module")
def doubled(fixed_points):
    return saltus.continue_orbit(saltus.switch_branch(fixed_points["PD1"]), "r", (2.5, 3.8))


@pytest.fixture(scope="module")
def cascade(fixed_points):
    return saltus.follow_cascade(fixed_points["PD1"], (2.5, 4.0), doublings=3)


@pytest.fixture(scope="module")
def folding():
    return saltus.continue_orbit(saltus.solve_orbit(henon(), {"a": 0.1}, x0=[0.7, 0.2]), "a", (-1.0, 1.0))


@pytest.fixture(scope="module")
def locus(folding):
    return saltus.continue_locus(folding["PD1"], ("a", "b"), {"a": (-3.0, 4.0), "b": (-1.5, 0.9)})


def lines(ax, kind):
    """Return the curves of one kind of stability."""
    wanted = plt.Line2D([], [], linestyle=style.LINES[kind]["linestyle"])
    return [line for line in ax.lines if line._dash_pattern == wanted._dash_pattern or (
        kind == "stable" and line.get_linestyle() == "-" and line.get_marker() == "None")]  # fmt: skip


def dots(ax):
    return {line.get_label(): line for line in ax.lines if line.get_linestyle() == "None"}


def texts(ax):
    return [text.get_text() for text in ax.get_legend().get_texts()]


def two_orbit(r):
    root = np.sqrt((r - 3.0) * (r + 1.0))
    return (r + 1.0 - root) / (2.0 * r), (r + 1.0 + root) / (2.0 * r)


def test_a_orbit_of_one_state_is_a_closed_cobweb_with_its_points_on_the_graph():
    orbit = saltus.solve_orbit(logistic(), {"r": 3.3}, x0=[0.5], period=2)
    ax = orbit.plot()
    low, high = two_orbit(3.3)
    (marks,) = [line for line in ax.lines if line.get_marker() == "o"]
    assert sorted(zip(marks.get_xdata(), marks.get_ydata(), strict=True)) == [
        (pytest.approx(low), pytest.approx(high)),
        (pytest.approx(high), pytest.approx(low)),
    ]
    web = ax.lines[2]
    assert (web.get_xdata()[0], web.get_ydata()[0]) == (web.get_xdata()[-1], web.get_ydata()[-1])
    assert len(web.get_xdata()) == 5
    graph = ax.lines[1]
    assert graph.get_ydata() == pytest.approx(3.3 * graph.get_xdata() * (1.0 - graph.get_xdata()))
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_title()) == ("$x$", "next $x$", "stable orbit of period 2")
    assert ax.get_legend() is None


def test_points_have_the_colours_of_their_pieces_and_are_open_where_unstable():
    orbit = saltus.solve_orbit(tent(), {"a": 0.5, "b": -3.0, "mu": 0.2}, segments=("left", "right"))
    ax = orbit.plot()
    assert not orbit.stable
    assert texts(ax) == ["left", "right"]
    marks = [line for line in ax.lines if line.get_marker() == "o"]
    assert [to_hex(line.get_markeredgecolor()) for line in marks] == [style.colour_of_mode(k) for k in (0, 1)]
    assert {line.get_markerfacecolor() for line in marks} == {"white"}
    assert [line.get_xdata()[0] for line in marks] == pytest.approx(orbit.points[:, 0])


def test_a_orbit_of_several_states_is_drawn_in_the_plane():
    orbit = saltus.find_orbit(henon(), {"a": 1.0}, x0=[0.1, 0.1])
    ax = orbit.plot()
    assert dots(ax)["map"].get_xydata() == pytest.approx(orbit.points)
    assert ax.lines[0].get_xydata() == pytest.approx(np.vstack([orbit.points, orbit.points[:1]]))
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_title()) == ("$x$", "$y$", "stable orbit of period 4")
    other = orbit.plot("x", "x + a*y")
    assert dots(other)["map"].get_ydata() == pytest.approx(orbit.points @ [1.0, 1.0])
    with pytest.raises(InputError, match="nothing"):
        orbit.plot("x", "nothing")


def test_a_branch_of_fixed_points_is_one_curve_through_its_special_points(fixed_points):
    ax = fixed_points.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$r$", "$x$")
    assert texts(ax) == ["stable", "unstable", "BP, branch point", "PD, period doubling"]
    (stable,) = [line for line in ax.lines if line.get_label() == "stable"]
    r, x = stable.get_data()
    assert x == pytest.approx(1.0 - 1.0 / r, abs=1e-3)
    assert (r[0], r[-1]) == (pytest.approx(1.0), pytest.approx(3.0))
    found = dots(ax)["PD, period doubling"]
    assert found.get_xydata()[0] == pytest.approx([3.0, 2.0 / 3.0])


def test_a_branch_of_doubled_orbits_has_a_curve_for_each_point(doubled):
    ax = doubled.plot()
    curves = [line for line in ax.lines if line.get_linestyle() == "-"]
    assert len(curves) == 2
    for line, place in zip(sorted(curves, key=lambda line: line.get_ydata()[-1]), (0, 1), strict=True):
        assert line.get_ydata() == pytest.approx(two_orbit(np.maximum(line.get_xdata(), 3.0))[place], abs=3e-3)
        assert line.get_xdata()[-1] == pytest.approx(1.0 + np.sqrt(6.0), abs=1e-9)
    marks = [line for line in ax.lines if line.get_label() == "PD, period doubling"]
    assert sorted(line.get_ydata()[0] for line in marks) == pytest.approx(two_orbit(1.0 + np.sqrt(6.0)))
    assert texts(ax) == ["stable", "unstable", "BP, branch point", "PD, period doubling"]


def test_a_border_collision_is_a_corner_of_the_curve():
    """The fixed point is mu/(1 - a) left of the border and mu/(1 - b) right of it."""
    branch = saltus.continue_orbit(saltus.solve_orbit(tent(), x0=[-0.4]), "mu", (-1.0, 1.0))
    ax = branch.plot()
    for line in ax.lines[:-1]:
        mu, x = line.get_data()
        assert x == pytest.approx(np.where(mu < 0.0, mu / 0.5, mu / 1.6), abs=1e-12)
    assert dots(ax)["BC, border collision"].get_xydata()[0] == pytest.approx([0.0, 0.0], abs=1e-12)


def test_virtual_orbits_are_dotted():
    start = saltus.solve_orbit(tent(), x0=[-0.4])
    branch = saltus.continue_orbit(start, "mu", (-1.0, 1.0), steps=saltus.StepControl(at_grazing="pass"))
    (line,) = [line for line in branch.plot().lines if line.get_label() == "virtual"]
    assert line.get_color() == style.LINES["virtual"]["color"]
    assert line.get_xdata().min() == pytest.approx(0.0, abs=1e-9)


def test_the_axis_ends_before_a_branch_that_runs_to_infinity(folding):
    assert folding.x0[:, 0].max() > 1e4
    ax = folding.plot()
    assert 5.0 < ax.get_ylim()[1] < 50.0
    _, given = plt.subplots()
    assert folding.plot(ax=given) is given
    assert given.get_ylim()[1] > 1e4


def test_a_cascade_is_the_tree_of_all_points(cascade):
    ax = cascade.plot()
    stable = [line for line in ax.lines if line.get_linestyle() == "-"]
    assert len(stable) == 2 + 4 + 8
    marks = dots(ax)["PD, period doubling"].get_xydata()
    assert len(marks) == 1 + 2 + 4 + 8
    assert marks[0] == pytest.approx([3.0, 2.0 / 3.0])
    (limit,) = [line for line in ax.lines if line.get_linestyle() == ":"]
    assert limit.get_xdata()[0] == pytest.approx(cascade.limit)


def test_a_cascade_of_a_orbit_begins_at_each_of_its_points():
    branch = saltus.continue_orbit(saltus.solve_orbit(logistic(), {"r": 3.84}, x0=[0.15], period=3), "r", (3.83, 3.845))
    point = branch.special_points.of_type("PD")[0]
    found = saltus.follow_cascade(point, (3.83, 3.86), doublings=1)
    marks = dots(found.plot())["PD, period doubling"].get_xydata()
    assert len(marks) == 3 + 6
    assert sorted(marks[:3, 1]) == pytest.approx(sorted(point.map_orbit.points[:, 0]))


def test_a_locus_is_drawn_in_the_colour_of_its_type(locus):
    ax = locus.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$a$", "$b$")
    assert "PD, period doubling, of unstable map orbits" in texts(ax)
    assert "R2, resonance 1:2" in texts(ax)
    for stretch in stretches_of(locus, ("a", "b")):
        a, b = stretch.places
        assert a == pytest.approx(3.0 * (1.0 - b) ** 2 / 4.0, abs=2e-3)
    assert locus.plot(z="x").name == "3d"


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["fixed_points", "locus", "cascade"])
def test_saved_results_are_drawn_from_the_command_line(name, request, tmp_path, capsys):
    result = request.getfixturevalue(name)
    path, picture = result.save(tmp_path / "saved.nc"), tmp_path / "picture.png"
    with pytest.raises(SystemExit, match="0"):
        main(["plot", str(path), "--out", str(picture)])
    assert capsys.readouterr().out == f"written  {picture}\n"
    assert picture.read_bytes().startswith(b"\x89PNG")


def test_a_saved_orbit_is_drawn_beside_its_file(tmp_path, capsys):
    path = saltus.solve_orbit(logistic(), {"r": 3.3}, x0=[0.5], period=2).save(tmp_path / "orbit.nc")
    with pytest.raises(SystemExit, match="0"):
        main(["plot", str(path)])
    assert (tmp_path / "orbit.png").read_bytes().startswith(b"\x89PNG")
    with pytest.raises(SystemExit, match="2"):
        main(["plot", str(path), "--out", "orbit.xyz"])
    assert "must be a picture" in capsys.readouterr().err


def test_a_diagram_of_a_map_draws_all_points_and_each_special_point_once():
    found = saltus.diagram(
        logistic(), "r", (0.5, 3.6), x0=[[0.6], [0.0]], options=saltus.options.DiagramOptions(depth=2)
    )
    ax = found.plot()
    assert {"stable fixed points", "stable orbits", "BP, branch point", "PD, period doubling"} <= set(texts(ax))
    blue = [line for line in ax.lines if line.get_linestyle() == "-" and to_hex(line.get_color()) == "#0f5fa8"]
    assert len(blue) == 2 + 4
    marks = [line.get_xydata() for line in ax.lines if line.get_label() == "BP, branch point"]
    assert np.vstack(marks) == pytest.approx(np.array([[1.0, 0.0]]), abs=1e-12)
    doublings = np.vstack([line.get_xydata() for line in ax.lines if line.get_label() == "PD, period doubling"])
    assert len(doublings) == 1 + 2 + 4
