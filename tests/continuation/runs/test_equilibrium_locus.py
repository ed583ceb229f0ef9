"""Loci of critical equilibria in two parameters: curves and points of codimension two against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

import fields
import saltus
from saltus import StepControl, continue_equilibrium, continue_locus, find_equilibrium
from saltus.continuation.results.equilibrium_branch import EquilibriumBranch
from saltus.continuation.results.equilibrium_locus import EquilibriumLocus
from saltus.errors import InputError

STEPS = (None, StepControl(largest=0.02), StepControl(initial=0.05, largest=0.3))
WINDOW = {"b1": (-1.0, 2.0), "b2": (-2.0, 2.0)}
BAZYKIN = {"al": (0.01, 1.2), "de": (1e-5, 5.0)}
# al, de, x, y to all digits that two root searches in extended precision share
PRINTED = {
    "BT1": (0.4536243277781295, 0.1751275929502174, 6.265765528962353, 3.601553936836365),
    "BT2": (0.8607044593098513, 0.006058794394012899, 42.68798122744384, 21.6305507075847),
    "CP": (0.901232691938992, 0.003568419361272271, 32.59360576615827, 20.47430335720152),
    "CP far": (0.08876730806100797, 2.802361210268357, 25.8230609005084, 2.442085531687371),
    "GH": (0.9566231980352828, 0.0009504482477532, 48.29245038105697, 24.4047629386232),
}


def _takens(plane: fields.Coordinates, b1: float = -1.0) -> EquilibriumBranch:
    start = find_equilibrium(plane.system(fields.TAKENS, {"b1": b1, "b2": -1.0}), x0=plane.to([-1.0, 0.0]))
    return continue_equilibrium(start, "b1", (-2.0, 2.0))


@pytest.fixture(scope="module", params=fields.PLANES)
def plane(request) -> fields.Coordinates:
    return fields.PLANES[request.param]


@pytest.fixture(scope="module")
def bazykin(plane) -> dict[str, EquilibriumLocus]:
    """The locus of saddle-nodes and those of Hopf points from both of its BT, in coordinates of the plane."""
    start = find_equilibrium(plane.system(fields.BAZYKIN, {"al": 0.35, "de": 0.01}), x0=plane.to([3.0, 3.0]))
    folds = continue_locus(continue_equilibrium(start, "al", (0.1, 1.1))["SN1"], ("al", "de"), BAZYKIN)
    first, second = sorted(folds.special_points.of_type("BT"), key=lambda point: point.parameters["al"])
    return {
        "SN": folds,
        "HB1": continue_locus(first, ("al", "de"), BAZYKIN, type="HB"),
        "HB2": continue_locus(second, ("al", "de"), BAZYKIN, type="HB"),
    }


def _place(plane: fields.Coordinates, point) -> tuple[float, ...]:
    return (*(point.parameters[name] for name in ("al", "de")), *plane.back(point.equilibrium.state).tolist())


# A1


@pytest.mark.parametrize("steps", STEPS)
def test_the_curve_of_the_cusp(steps):
    system = fields.system({"x": "r + h*x - x**3"}, {"r": 0.0, "h": 1.5})
    branch = continue_equilibrium(find_equilibrium(system, x0=[1.2]), "r", (-2.0, 2.0))
    window = {"r": (-2.0, 2.0), "h": (-1.0, 2.0)}
    locus = continue_locus(branch["SN1"], ("r", "h"), window, steps=steps)
    r, h = locus.values.T
    assert np.abs(r) == pytest.approx(2.0 * (h / 3.0) ** 1.5, abs=1e-12)
    assert fields.places(locus.special_points.of_type("CP"), "r", "h") == [
        ("CP", pytest.approx(0.0), pytest.approx(0.0))
    ]
    assert len(locus.special_points) == 1  # h turns at the cusp itself, which is told once
    assert all(line.endswith("h = 2: bound reached") for line in locus.stopped)
    swapped = continue_locus(branch["SN1"], ("h", "r"), window, steps=steps)
    assert swapped.names == ("h", "r")
    assert np.abs(swapped.values[:, 1]) == pytest.approx(2.0 * (swapped.values[:, 0] / 3.0) ** 1.5, abs=1e-12)


def test_saddle_nodes_and_hopf_points_meet_at_the_bogdanov_takens_point(plane):
    folds = continue_locus(_takens(plane)["SN1"], ("b1", "b2"), WINDOW)
    b1, b2 = folds.values.T
    assert b1 == pytest.approx(b2**2 / 4.0, abs=1e-11)
    assert np.isnan(folds.frequency).all()
    (takens,) = folds.special_points.of_type("BT")
    assert [takens.parameters[name] for name in folds.names] == pytest.approx([0.0, 0.0], abs=1e-11)
    hopf = continue_locus(takens, ("b1", "b2"), WINDOW, type="HB")
    assert hopf.values[:, 0] == pytest.approx(0.0, abs=1e-11)
    assert hopf.frequency == pytest.approx(np.sqrt(np.maximum(-hopf.values[:, 1], 0.0)), abs=1e-7)
    assert hopf.values[:, 1].max() < 1e-11  # for b2 > 0 b1 = 0 is a neutral saddle
    assert [point.type for point in hopf.special_points] == ["BT"]
    ends = [line for line in hopf.stopped if "BT" in line]
    assert len(ends) == 1
    assert ends[0].endswith("BT: beyond it two real eigenvalues differ in sign alone: no Hopf points")
    assert np.nanmax(hopf.coefficient) < 0.0


@pytest.mark.parametrize("steps", STEPS)
def test_hopf_points_from_a_branch_end_at_the_bogdanov_takens_point(steps):
    locus = continue_locus(_takens(fields.TURNED)["HB1"], ("b1", "b2"), WINDOW, steps=steps)
    assert locus.type == "HB"
    (takens,) = locus.special_points.of_type("BT")
    assert [takens.parameters[name] for name in ("b1", "b2")] == pytest.approx([0.0, 0.0], abs=1e-10)


def test_the_coefficient_along_hopf_points_of_the_bautin_form(plane):
    """It is 2 b2 for q = (1, -i)/sqrt(2), and vanishes at b2 = 0."""
    system = plane.system(fields.BAUTIN, {"b1": -0.5, "b2": 0.3})
    branch = continue_equilibrium(find_equilibrium(system, x0=plane.to([0.01, 0.0])), "b1", (-1.0, 1.0))
    window = {"b1": (-1.0, 1.0), "b2": (-1.0, 1.0)}
    locus = continue_locus(branch["HB1"], ("b1", "b2"), window)
    assert locus.values[:, 0] == pytest.approx(0.0, abs=1e-11)
    length = float(np.linalg.norm(plane.matrix @ np.array([1.0, -1.0j]))) ** 2
    assert locus.coefficient * length / 2.0 == pytest.approx(2.0 * locus.values[:, 1], rel=1e-6, abs=1e-9)
    assert fields.places(locus.special_points, "b1", "b2") == [
        ("GH", pytest.approx(0.0, abs=1e-11), pytest.approx(0.0, abs=1e-9))
    ]
    again = continue_locus(locus["GH1"], ("b1", "b2"), window)
    assert again.type == "HB"
    assert [point.type for point in again.special_points] == ["GH"]


# A4


@pytest.mark.parametrize("stretch", [0.3, 0.5, 0.97, 1.0, 1.01, 1.5])
def test_hopf_points_that_touch_a_straight_line_of_folds_do_not_turn_there(stretch):
    system = saltus.HybridSystem.smooth(
        {"x": "y", "y": "c + b**2/4 + b*x + x**2 - x*y"}, {"b": 1.0, "c": -0.1}
    )  # its folds are c = 0, which the Hopf points c = -b^2/4 touch where they end
    branch = continue_equilibrium(find_equilibrium(system, {}, [-0.816, 0.0]), "b", (-2.0, 2.0))
    steps = StepControl(initial=0.01 * stretch, largest=0.1 * stretch)
    locus = continue_locus(branch["HB1"], ("b", "c"), {"b": (-2.0, 2.0), "c": (-1.0, 1.0)}, steps=steps)
    assert [(p.type, *p.parameters.values()) for p in locus.special_points] == [
        ("BT", pytest.approx(0.0, abs=1e-9), pytest.approx(0.0, abs=1e-9))
    ]


@pytest.mark.campaign
def test_bazykins_saddle_nodes_have_both_cusps_and_both_bogdanov_takens_points(plane, bazykin):
    folds = bazykin["SN"]
    assert folds.stopped == ("the locus is closed", "the locus is closed")
    for kind, wanted in (("CP", ("CP far", "CP")), ("BT", ("BT1", "BT2"))):
        found = sorted(_place(plane, point) for point in folds.special_points.of_type(kind))
        assert len(found) == 2
        for place, name in zip(found, wanted, strict=True):
            assert place[:2] == pytest.approx(PRINTED[name][:2], rel=1e-11)
            assert place[2:] == pytest.approx(PRINTED[name][2:], rel=1e-9)
    near = max(folds.special_points.of_type("CP"), key=lambda point: point.parameters["al"])
    assert near.equilibrium.eigenvalues.sum().real == pytest.approx(0.25287515713, abs=1e-9)


def test_bazykins_hopf_points_change_their_kind_once(plane, bazykin):
    locus = bazykin["HB2"]
    (hard,) = locus.special_points.of_type("GH")
    assert _place(plane, hard) == pytest.approx(PRINTED["GH"], rel=1e-9)
    assert hard.equilibrium.eigenvalues[0].imag == pytest.approx(0.10330351983778, rel=1e-9)
    al = locus.column("al")
    there = np.isfinite(locus.coefficient)
    assert np.array_equal(locus.coefficient[there] > 0.0, al[there] < PRINTED["GH"][0])


def test_bazykins_first_hopf_points_are_soft_and_lie_where_printed(plane, bazykin):
    locus = bazykin["HB1"]
    assert {point.type for point in locus.special_points} == {"BT", "TP"}
    there = np.isfinite(locus.coefficient)
    assert there.sum() > len(locus) - 3
    assert (locus.coefficient[there] < 0.0).all()
    for x, al in ((6.0, 0.4486), (5.0, 0.4263), (4.0, 0.3958), (3.0, 0.3488), (2.0, 0.2602)):
        assert _hopf_by_x(x) == pytest.approx(al, abs=6e-5)
    x = plane.back(locus.states)[:, 0]
    assert locus.values[:, 0] == pytest.approx([_hopf_by_x(value) for value in x], abs=1e-8)


def _hopf_by_x(x: float) -> float:
    """Return al at the Hopf point with that x: the root of the trace, with y and de eliminated."""
    from scipy.optimize import brentq

    def trace(al: float) -> float:
        y = (1.0 - 0.01 * x) * (1.0 + al * x)
        de = (-1.0 + x / (1.0 + al * x)) / y
        a11 = 1.0 - y / (1.0 + al * x) ** 2 - 0.02 * x
        a22 = -1.0 + x / (1.0 + al * x) - 2.0 * de * y
        return a11 + a22

    return float(brentq(trace, 1e-6, 0.4537, xtol=1e-15))


# zero-Hopf and double Hopf points, boundaries


def _zero_hopf() -> EquilibriumBranch:
    field = {"x": "mu + x**2 + 0.2*(u**2 + v**2)", "u": "(b + x)*u - 2*v", "v": "2*u + (b + x)*v"}
    turned = fields.Coordinates(fields.TURN3, [0.3, -1.0, 2.0])
    system = turned.system(field, {"mu": -0.5, "b": -0.3})
    return continue_equilibrium(find_equilibrium(system, x0=turned.to([-0.7, 0.0, 0.0])), "mu", (-1.0, 1.0))


@pytest.mark.campaign
@pytest.mark.thorough
def test_saddle_nodes_and_hopf_points_meet_at_a_zero_hopf_point():
    """x = -+ sqrt(-mu) folds at mu = 0; the pair b + x +- 2i crosses at x = -b: mu = -b^2."""
    branch = _zero_hopf()
    window = {"mu": (-1.0, 1.0), "b": (-1.0, 1.0)}
    for label, curve in (("SN1", lambda b: 0.0 * b), ("HB1", lambda b: -(b**2))):
        locus = continue_locus(branch[label], ("mu", "b"), window)
        assert locus.values[:, 0] == pytest.approx(curve(locus.values[:, 1]), abs=1e-10)
        (zero,) = locus.special_points.of_type("ZH")
        assert [zero.parameters[name] for name in ("mu", "b")] == pytest.approx([0.0, 0.0], abs=1e-8)
    assert locus.frequency == pytest.approx(2.0, rel=1e-9)


def test_two_pairs_at_once_are_a_double_hopf_point():
    field = {
        "x": "a*x - y - x*(x**2 + y**2) + 0.1*u*x",
        "y": "x + a*y - y*(x**2 + y**2)",
        "u": "b*u - 2.5*v - u*(u**2 + v**2)",
        "v": "2.5*u + b*v - v*(u**2 + v**2) + 0.3*x**2",
    }
    system = fields.system(field, {"a": -0.5, "b": -0.3})
    branch = continue_equilibrium(find_equilibrium(system), "a", (-1.0, 1.0))
    locus = continue_locus(branch["HB1"], ("a", "b"), {"a": (-1.0, 1.0), "b": (-1.0, 1.0)})
    assert locus.values[:, 0] == pytest.approx(0.0, abs=1e-12)
    assert fields.places(locus.special_points, "a", "b") == [
        ("HH", pytest.approx(0.0, abs=1e-11), pytest.approx(0.0, abs=1e-10))
    ]
    assert sorted(locus["HH1"].equilibrium.eigenvalues.imag) == pytest.approx([-2.5, -1.0, 1.0, 2.5], abs=1e-9)


def test_boundary_equilibria_of_chua_in_two_parameters():
    """It is d/(1 + m0) = 1; with k = a (1 + m0) it is critical where k = 0 or be = (k + 1)(a - k)."""
    branch = continue_equilibrium(find_equilibrium(fields.chua(), mode="inner"), "d", (-1.0, 1.0))
    point = next(point for point in branch.special_points if point.of == "up")
    locus = continue_locus(point, ("d", "m0"), {"d": (-1.0, 1.0), "m0": (-1.9, -0.2)})
    assert locus.type == "BE"
    d, m0 = locus.values.T
    assert d == pytest.approx(1.0 + m0, abs=1e-12)
    assert np.isnan(locus.coefficient).all()
    found = [("SN", 0.0), ("HB", 4.0 - math.sqrt(5.0)), ("HB", 4.0 + math.sqrt(5.0))]
    wanted = [(kind, pytest.approx(k / 9.0 - 1.0, abs=1e-10)) for kind, k in found]
    points = [point for point in locus.special_points if point.type != "TP"]
    assert sorted(fields.places(points, "m0"), key=lambda item: item[1]) == wanted


# options, files, bad input


def _locus(**options) -> EquilibriumLocus:
    return continue_locus(_takens(fields.SAME)["SN1"], ("b1", "b2"), WINDOW, **options)


def test_directions_and_stop_at():
    up, down = _locus(directions="up"), _locus(directions="down")
    assert up.values[-1, 1] == pytest.approx(2.0)
    assert down.values[-1, 1] == pytest.approx(-2.0)
    stopped = _locus(directions="up", stop_at="BT")
    assert stopped.stopped[1].endswith(": BT")
    assert stopped.values[-1] == pytest.approx([0.0, 0.0], abs=1e-11)


@pytest.mark.campaign
def test_any_point_of_a_locus_starts_another():
    locus = _locus()
    again = continue_locus(locus.point(3), ("b1", "b2"), WINDOW)
    assert again.type == "SN"
    assert again.values[:, 0] == pytest.approx(again.values[:, 1] ** 2 / 4.0, abs=1e-11)
    by_type = continue_locus(locus.solution(3), ("b1", "b2"), WINDOW, type="SN")
    assert len(by_type) > 5


def test_columns_of_a_locus():
    locus = continue_locus(_takens(fields.SAME)["HB1"], ("b1", "b2"), WINDOW)
    assert np.array_equal(locus.column("frequency"), locus.frequency)
    assert np.array_equal(locus.column("b2"), locus.values[:, 1])
    assert locus.value_at(locus["BT1"], "b2") == pytest.approx(0.0, abs=1e-10)


def test_progress_is_told_and_an_interrupt_keeps_what_is_done():
    told = []

    def stop(progress):
        told.append(progress.text)
        if len(told) == 4:
            raise KeyboardInterrupt

    locus = _locus(progress=stop)
    assert told[0].startswith("b1 = ")
    assert "interrupted" in locus.stopped
    assert 3 <= len(locus) <= 5


@pytest.mark.campaign
def test_a_saved_locus_is_loaded_as_it_was(tmp_path, bazykin):
    for locus in (*bazykin.values(), _locus()):
        again = saltus.load(locus.save(tmp_path / "locus.nc"))
        assert isinstance(again, EquilibriumLocus)
        assert again == locus
        assert repr(again) == repr(locus)
        assert np.array_equal(again.frequency, locus.frequency, equal_nan=True)


def test_bad_input_is_told_in_a_line():
    branch = _takens(fields.SAME)
    wrong = [
        (
            {"start": find_equilibrium(branch.system, x0=[-1.0, 0.0]), "type": "SN"},
            "an equilibrium with an eigenvalue 0",
        ),
        ({"start": find_equilibrium(branch.system, x0=[-1.0, 0.0]), "type": "HB"}, "an imaginary pair"),
        ({"start": find_equilibrium(branch.system, x0=[-1.0, 0.0]), "type": "BE"}, "start = "),
        ({"start": find_equilibrium(branch.system, x0=[-1.0, 0.0])}, "type"),
        ({"type": "PD"}, "type = 'PD'"),
        ({"parameters": ("b1", "b3")}, "b3"),
        ({"parameters": ("b1", "b1")}, "parameters"),
        ({"bounds": {"b1": (-1.0, 2.0)}}, "bounds"),
        ({"bounds": {"b1": (0.5, 2.0), "b2": (-2.0, 2.0)}}, "bounds"),
        ({"directions": "left"}, "directions = 'left'"),
        ({"stop_at": "GPD"}, "stop_at = 'GPD'"),
    ]
    for change, message in wrong:
        options = {"start": branch["SN1"], "parameters": ("b1", "b2"), "bounds": WINDOW} | change
        with pytest.raises(InputError) as told:
            continue_locus(**options)
        assert message in str(told.value), change
        assert "\n" not in str(told.value)
