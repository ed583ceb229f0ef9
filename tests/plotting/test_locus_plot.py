"""Pictures of loci, in the plane and in space: the curve is the locus, in its colour, with its special points."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.colors import to_hex

import saltus
from saltus import HybridSystem, Mode, Transition
from saltus.errors import InputError
from saltus.plotting import style
from saltus.plotting.space import draw_in_space, draw_level, stretches_of


@pytest.fixture(scope="session")
def cusp_branch() -> saltus.results.Branch:
    """Fixed points of x -> r + h x - x^3, with folds where h = 1 + 3 x^2, r = -2 x^3."""
    system = HybridSystem(
        ("x", "s"),
        {"r": 0.0, "h": 1.5},
        {"carry": Mode({"x": "0", "s": "1"})},
        [Transition("carry", "carry", "s - 1", 1, {"x": "r + h*x - x**3", "s": "0"}, name="map")],
    )
    orbit = saltus.solve_orbit(system, {}, [("carry", "map", [0.7, 0.0], 1.0)])
    return saltus.continue_orbit(orbit, "r", (-1.0, 1.0))


@pytest.fixture(scope="session")
def cusp(cusp_branch) -> saltus.results.Locus:
    return saltus.continue_locus(cusp_branch["SN1"], ("r", "h"), {"r": (-1.0, 1.0), "h": (0.5, 2.0)})


@pytest.fixture(scope="session")
def response(tapping_orbit) -> saltus.results.Branch:
    return saltus.continue_orbit(tapping_orbit, "Omega", (0.8, 1.4))


@pytest.fixture(scope="session")
def loci(response) -> dict[str, saltus.results.Locus]:
    """Loci over frequency and damping: a fold's, which ends at a grazing, a doubling's likewise, a grazing's."""
    bounds = {"Omega": (0.8, 1.4), "D_att_1": (0.01, 0.2)}
    return {
        label: saltus.continue_locus(response[label], ("Omega", "D_att_1"), bounds) for label in ("SN4", "PD1", "GR2")
    }


def _lines(ax) -> list:
    return [line for line in ax.lines if line.get_linestyle() != "None"]


def _dots(ax) -> dict:
    return {line.get_label(): line for line in ax.lines if line.get_linestyle() == "None"}


@pytest.mark.campaign
def test_the_curve_of_the_cusp_map_is_the_closed_form(cusp):
    """Everywhere to 1e-3 of the picture, less than a line's width."""
    x = np.linspace(-1.0, 1.0, 20001)
    exact = np.column_stack([-2.0 * x**3 / 2.0, (1.0 + 3.0 * x**2) / 1.5])
    for line in _lines(cusp.plot()):
        for place in line.get_xydata()[::5] / (2.0, 1.5):
            assert np.linalg.norm(exact - place, axis=1).min() < 1e-3


def test_the_curve_passes_through_every_point(cusp):
    drawn = np.concatenate([stretch.places for stretch in stretches_of(cusp, ("r", "h"))], axis=1).T
    special = np.array([[point.parameters["r"], point.parameters["h"]] for point in cusp.special_points])
    for place in cusp.values:
        if np.linalg.norm(special - place, axis=1).min() > 1e-3:
            assert np.linalg.norm(drawn - place, axis=1).min() < 1e-12


@pytest.mark.parametrize(("label", "kind"), [("SN4", "SN"), ("PD1", "PD"), ("GR2", "GR")])
def test_a_locus_has_the_colour_of_its_bifurcation_and_is_named(loci, label, kind):
    ax = loci[label].plot()
    assert {to_hex(line.get_color()) for line in _lines(ax)} == {style.SPECIAL[kind].colour}
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts[0] == f"{kind}, {style.SPECIAL[kind].meaning}"


def test_default_axes_are_the_two_parameters(loci):
    ax = loci["SN4"].plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$\\Omega$", "$D_{att,1}$")
    other = loci["SN4"].plot("D_att_1", "min_z")
    assert (other.get_xlabel(), other.get_ylabel()) == ("$D_{att,1}$", "min $z$")


def test_special_points_lie_where_the_locus_found_them_and_are_named(loci, cusp):
    dots = _dots(loci["SN4"].plot())
    assert list(dots) == ["TP, turning point", "GR, grazing"]
    most = loci["SN4"]["TP1"].parameters
    assert (dots["TP, turning point"].get_xdata()[0], dots["TP, turning point"].get_ydata()[0]) == (
        most["Omega"],
        most["D_att_1"],
    )
    ax = cusp.plot()
    assert "CP, cusp" in [text.get_text() for text in ax.get_legend().get_texts()]
    assert _dots(ax)["CP, cusp"].get_ydata() == pytest.approx([1.0], abs=1e-9)


def test_special_points_and_legend_can_be_left_out_and_given_axes_are_used(loci):
    _, ax = plt.subplots()
    assert loci["GR2"].plot(ax=ax, special=False, legend=False) is ax
    assert not _dots(ax)
    assert ax.get_legend() is None


def test_every_special_point_that_a_locus_can_have_has_a_mark_of_its_own():
    kinds = ("CP", "GPD", "CH", "R1", "R2", "R3", "R4", "FF", "TP")
    marks = {(style.SPECIAL[kind].marker, style.SPECIAL[kind].filled) for kind in kinds}
    assert len(marks) == len(kinds)


def test_orbits_unstable_but_for_the_critical_multiplier_are_dashed(response):
    bounds = {"Omega": (0.8, 1.4), "D_att_1": (0.02, 0.03)}
    locus = saltus.continue_locus(response["SN4"], ("Omega", "D_att_1"), bounds)
    changed = replace(locus, stable=np.arange(len(locus)) < len(locus) // 2)
    kinds = [stretch.kind for stretch in stretches_of(changed, ("Omega", "D_att_1"))]
    assert kinds == ["stable", "unstable"]
    ax = changed.plot()
    assert [line.get_linestyle() for line in _lines(ax)] == ["-", "--"]
    texts = [text.get_text() for text in ax.get_legend().get_texts()]
    assert texts == ["SN, saddle-node", "SN, saddle-node, of unstable orbits"]


def test_a_locus_that_ends_at_a_grazing_is_of_one_kind_up_to_it(loci):
    """At the grazing itself a multiplier is infinite and nothing is admissible, which is no stretch of its own."""
    for label in ("SN4", "PD1"):
        stretches = stretches_of(loci[label], ("Omega", "D_att_1"))
        assert [stretch.kind for stretch in stretches] == ["stable"]
        end = loci[label]["GR1"].parameters
        ends = [stretches[0].places[:, 0], stretches[-1].places[:, -1]]
        assert min(np.linalg.norm(place - [end["Omega"], end["D_att_1"]]) for place in ends) < 1e-12


def test_in_space_the_height_is_the_third_quantity(loci):
    ax = loci["SN4"].plot(z="min_z")
    assert ax.name == "3d"
    assert ax.get_zlabel() == "min $z$"
    (line,) = _lines(ax)
    x, y, z = line.get_data_3d()
    at = int(np.argmin(z))
    deepest = int(np.argmin(loci["SN4"].column("min_z")))
    assert (x[at], y[at]) == pytest.approx(tuple(loci["SN4"].values[deepest]))
    (turn, grazing) = _dots(ax).values()
    assert turn.get_data_3d()[2][0] == loci["SN4"]["TP1"].orbit.min["z"]
    assert grazing.get_data_3d()[2] == pytest.approx([1.0 / 300.0])


def test_a_branch_in_space_lies_at_its_constant_parameter_with_its_kinds_apart(response):
    stretches = stretches_of(response, ("Omega", "ybar", "min_z"))
    for stretch in stretches:
        assert (stretch.places[1] == 0.108).all()
        assert np.isfinite(stretch.places).all()
    for before, after in pairwise(stretches):
        assert np.array_equal(before.places[:, -1], after.places[:, 0])
        assert before.kind != after.kind
    ax = plt.figure().add_subplot(projection="3d")
    lines = draw_in_space(ax, response, ("Omega", "ybar", "min_z"), origin=(0.0, 0.108, 0.1), label="response")
    assert [line.get_label() for line in lines] == ["response", *["_"] * (len(lines) - 1)]
    assert {line.get_linestyle() for line in lines} == {"-", "--"}
    assert lines[0].get_data_3d()[1][0] == 0.0
    assert np.array_equal(lines[0].get_data_3d()[2], stretches[0].places[2] - 0.1)


def test_only_the_kinds_asked_for_are_drawn(response):
    ax = plt.figure().add_subplot(projection="3d")
    lines = draw_in_space(ax, response, ("Omega", "ybar", "min_z"), kinds=("stable",), color="#123456")
    assert {line.get_linestyle() for line in lines} == {"-"}
    assert {line.get_color() for line in lines} == {"#123456"}
    kinds = [stretch.kind for stretch in stretches_of(response, ("Omega", "min_z"))]
    assert len(lines) == kinds.count("stable")


def test_quantities_of_a_branch_stay_together_on_the_way_between_points(response):
    """The oracle is a response of ten times as many points; 2e-3 of the picture is a line's width."""
    dense = saltus.continue_orbit(response.solution(0), "Omega", (0.8, 1.4), steps=saltus.StepControl(largest=0.01))
    names = ("Omega", "min_z", "max_v1")
    points = np.array([dense.column(name) for name in names]).T
    size = np.ptp(points, axis=0)
    begin, step = points[:-1] / size, np.diff(points, axis=0) / size
    length = np.maximum((step**2).sum(axis=1), 1e-300)
    for stretch in stretches_of(response, names):
        for place in stretch.places.T[::5] / size:
            along = np.clip(((place - begin) * step).sum(axis=1) / length, 0.0, 1.0)
            assert np.linalg.norm(place - begin - along[:, None] * step, axis=1).min() < 2e-3


def test_a_level_spans_the_box_and_is_transparent():
    ax = plt.figure().add_subplot(projection="3d")
    ax.set(xlim=(0.0, 2.0), ylim=(1.0, 3.0), zlim=(-1.0, 1.0))
    plane = draw_level(ax, 0.5, label="level")
    assert plane.get_label() == "level"
    assert 0.0 < plane.get_alpha() < 0.5
    assert (ax.get_xlim(), ax.get_ylim(), ax.get_zlim()) == ((0.0, 2.0), (1.0, 3.0), (-1.0, 1.0))


def test_wrong_names_and_axes_are_told(loci, response):
    with pytest.raises(InputError, match=r"quantity = 'min_zz': must be one of Omega, .*; did you mean 'min_z'\?"):
        loci["SN4"].plot("Omega", "min_zz")
    _, ax = plt.subplots()
    with pytest.raises(InputError, match="ax = 'rectilinear': must be Axes in space"):
        loci["SN4"].plot(z="min_z", ax=ax)
    with pytest.raises(InputError, match="ax = '3d': must be Axes in the plane"):
        loci["SN4"].plot(ax=plt.figure().add_subplot(projection="3d"))
    with pytest.raises(InputError, match="curve = 'dict': must be a Branch or a Locus"):
        stretches_of({}, ("Omega", "min_z"))
    with pytest.raises(InputError, match=r"did you mean 'Omega'\?"):
        stretches_of(response, ("Omga", "min_z"))


@pytest.mark.campaign
def test_a_saved_locus_is_drawn_the_same(loci, tmp_path):
    again = saltus.results.Locus.load(loci["SN4"].save(tmp_path / "locus.nc"))
    for mine, theirs in zip(_lines(loci["SN4"].plot()), _lines(again.plot()), strict=True):
        assert np.array_equal(mine.get_xydata(), theirs.get_xydata())
