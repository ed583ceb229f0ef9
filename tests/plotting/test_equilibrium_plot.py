"""Pictures of equilibria, their branches and loci: the curves are the closed forms, with their special points."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import pyplot as plt
from matplotlib.colors import to_hex

import fields
import saltus
from saltus import StepControl, continue_equilibrium, continue_locus, find_equilibrium
from saltus.errors import InputError
from saltus.plotting import style
from saltus.plotting.branch import pieces_of
from saltus.plotting.space import stretches_of


@pytest.fixture(scope="module")
def takens() -> saltus.results.EquilibriumBranch:
    start = find_equilibrium(fields.system(fields.TAKENS, {"b1": -1.0, "b2": -1.0}), x0=[-1.0, 0.0])
    return continue_equilibrium(start, "b1", (-2.0, 2.0))


@pytest.fixture(scope="module")
def chua() -> saltus.results.EquilibriumBranch:
    return continue_equilibrium(find_equilibrium(fields.chua(), mode="inner"), "d", (-1.0, 1.0))


@pytest.fixture(scope="module")
def loci(takens) -> dict[str, saltus.results.EquilibriumLocus]:
    window = {"b1": (-1.0, 2.0), "b2": (-2.0, 2.0)}
    return {label: continue_locus(takens[label], ("b1", "b2"), window) for label in ("SN1", "HB1")}


def _lines(ax) -> list:
    return [line for line in ax.lines if line.get_linestyle() != "None"]


def _dots(ax) -> dict:
    return {line.get_label(): line for line in ax.lines if line.get_linestyle() == "None"}


def _texts(ax) -> list[str]:
    return [text.get_text() for text in ax.get_legend().get_texts()]


# eigenvalues


def test_eigenvalues_are_drawn_where_they_are_and_named_by_what_they_do():
    found = find_equilibrium(fields.lorenz(), {"r": 28.0}, x0=[8.4, 8.4, 27.0])
    ax = found.plot()
    dots = _dots(ax)
    assert list(dots) == ["Re < 0: decays", "Re > 0: grows"]
    drawn = np.concatenate([line.get_xdata() + 1j * line.get_ydata() for line in dots.values()])
    assert sorted(drawn, key=lambda v: (v.real, v.imag)) == sorted(found.eigenvalues, key=lambda v: (v.real, v.imag))
    assert (ax.get_xlabel(), ax.get_ylabel(), ax.get_title()) == ("real part", "imaginary part", found.kind)
    for value in found.eigenvalues:
        assert ax.get_xlim()[0] < value.real < ax.get_xlim()[1]
        assert ax.get_ylim()[0] < value.imag < ax.get_ylim()[1]


def test_a_critical_pair_is_marked_as_such(takens):
    ax = takens["HB1"].equilibrium.plot()
    (pair,) = _dots(ax).values()
    assert pair.get_label() == "Re = 0: critical"
    assert sorted(pair.get_ydata()) == pytest.approx([-1.0, 1.0])


def test_given_axes_are_used_and_a_legend_can_be_left_out():
    _, ax = plt.subplots()
    found = find_equilibrium(fields.system({"x": "-x"}, {}))
    assert found.plot(ax=ax, legend=False) is ax
    assert ax.get_legend() is None
    with pytest.raises(InputError, match="legend = "):
        found.plot(legend="yes")
    with pytest.raises(InputError, match="ax = "):
        found.plot(ax="left")


# branches


def test_a_branch_is_the_closed_form_between_its_points_too(takens):
    for piece in pieces_of(takens, "b1", "x"):
        assert piece.x == pytest.approx(piece.y - piece.y**2, abs=2e-3)


def test_kinds_change_at_the_special_points(takens):
    pieces = sorted(pieces_of(takens, "b1", "x"), key=lambda piece: piece.y.min())
    assert [piece.kind for piece in pieces] == ["unstable", "stable", "unstable"]
    ends = sorted({float(piece.y[0]) for piece in pieces} | {float(piece.y[-1]) for piece in pieces})
    assert ends == pytest.approx([-1.0, 0.0, 0.5, 2.0], abs=1e-9)
    ax = takens.plot()
    assert _texts(ax) == ["stable", "unstable", "HB, Hopf point", "SN, saddle-node"]
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$b_{1}$", "$x$")
    assert _dots(ax)["HB, Hopf point"].get_xydata()[0] == pytest.approx([0.0, 0.0], abs=1e-9)


def test_corners_stand_at_boundaries(chua):
    pieces = pieces_of(chua, "d", "x")
    assert {piece.kind for piece in pieces} == {"unstable"}
    places = np.concatenate([np.stack([piece.x, piece.y], axis=1) for piece in pieces])
    for d, x in places:
        lines = (-7.0 * d, 3.5 * d + 1.5, 3.5 * d - 1.5)
        assert min(abs(x - line) for line in lines) < 1e-9
    for corner in ((-1.0 / 7.0, 1.0), (1.0 / 7.0, -1.0)):
        assert np.linalg.norm(places - corner, axis=1).min() < 1e-12
    assert _texts(chua.plot()) == ["unstable", "BE, boundary equilibrium"]


def test_virtual_equilibria_are_dotted():
    start = find_equilibrium(fields.chua(), mode="inner")
    branch = continue_equilibrium(start, "d", (-1.0, 1.0), steps=StepControl(at_grazing="pass"))
    pieces = pieces_of(branch, "d", "x")
    assert [piece.kind for piece in pieces] == ["virtual", "unstable", "virtual"]
    assert _texts(branch.plot()) == ["unstable", "virtual", "BE, boundary equilibrium"]
    middle = pieces[1]
    assert sorted([middle.y[0], middle.y[-1]]) == pytest.approx([-1.0, 1.0], abs=1e-12)


def test_two_branches_in_one_picture_are_named_once():
    lorenz = fields.lorenz()
    trivial = continue_equilibrium(find_equilibrium(lorenz, {"r": 0.5}), "r", (0.0, 30.0))
    ax = trivial.plot()
    continue_equilibrium(saltus.switch_branch(trivial["BP1"]), "r", (0.0, 30.0)).plot(ax=ax)
    assert _texts(ax) == ["stable", "unstable", "BP, branch point", "HB, Hopf point"]


def test_quantities_can_be_chosen_and_wrong_ones_are_told(takens):
    ax = takens.plot("x", "y", special=False, legend=False)
    assert not _dots(ax)
    assert ax.get_legend() is None
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$x$", "$y$")
    with pytest.raises(InputError, match="quantity = 'max_w'"):
        takens.plot("b1", "max_w")


def test_extremes_of_a_motion_at_rest_are_its_state(takens):
    for mine, theirs in zip(_lines(takens.plot("b1", "max_x")), _lines(takens.plot("b1", "x")), strict=True):
        assert np.array_equal(mine.get_xydata(), theirs.get_xydata())
    point = takens.special_points[0]
    assert takens.value_at(point, "min_y") == takens.value_at(point, "y")


def test_a_saved_branch_is_drawn_the_same(chua, tmp_path):
    again = saltus.load(chua.save(tmp_path / "branch.nc"))
    for mine, theirs in zip(_lines(chua.plot()), _lines(again.plot()), strict=True):
        assert np.array_equal(mine.get_xydata(), theirs.get_xydata())


# loci


def test_a_locus_has_its_colour_and_lies_on_the_closed_form(loci):
    ax = loci["SN1"].plot()
    assert {to_hex(line.get_color()) for line in _lines(ax)} == {style.SPECIAL["SN"].colour}
    for line in _lines(ax):
        b1, b2 = np.array(line.get_xydata()).T
        assert b1 == pytest.approx(b2**2 / 4.0, abs=2e-3)
    wanted = {"SN, saddle-node", "SN, saddle-node, of unstable equilibria", "TP, turning point", "BT, Bogdanov-Takens"}
    assert set(_texts(ax)) == wanted
    assert _texts(loci["HB1"].plot()) == ["HB, Hopf point", "BT, Bogdanov-Takens"]


def test_a_locus_in_space(loci):
    ax = loci["SN1"].plot(z="x")
    assert ax.name == "3d"
    for stretch in stretches_of(loci["SN1"], ("b1", "b2", "x")):
        b1, b2, x = stretch.places
        assert x == pytest.approx(-b2 / 2.0, abs=2e-3)
        assert b1 == pytest.approx(b2**2 / 4.0, abs=2e-3)


def test_every_special_point_of_equilibria_has_a_mark_of_its_own():
    kinds = ("SN", "HB", "BP", "BE", "CP", "BT", "GH", "ZH", "HH", "TP", "GR", "PD", "TR")
    marks = {(style.SPECIAL[kind].marker, style.SPECIAL[kind].filled, style.SPECIAL[kind].colour) for kind in kinds}
    assert len(marks) == len(kinds)
    shapes = {(style.SPECIAL[kind].marker, style.SPECIAL[kind].filled) for kind in ("CP", "BT", "GH", "ZH", "HH")}
    assert len(shapes) == 5
