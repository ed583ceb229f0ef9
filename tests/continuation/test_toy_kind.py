"""A new kind of solution costs one module: tests/polynomial.py adds zeros of polynomials, and only it knows them."""

import pickle

import numpy as np
import pytest

import saltus
from polynomial import Polynomial, ZeroBranch, ZeroLocus
from saltus.continuation import continue_branch, continue_locus
from saltus.continuation.core.arclength import StepControl
from saltus.errors import InputError

START = 2.0 * np.cos(np.pi / 9.0)  # zero of 1 + 3 x - x^3
CUBIC = Polynomial({"r": 0, "h": 1, "c": 3}, {"r": 1.0, "h": 3.0, "c": -1.0}, "cubic")


def fold(h: float) -> float:
    """Return the value of r > 0 at which r + h x - x^3 has a double zero."""
    return 2.0 * (h / 3.0) ** 1.5


@pytest.fixture(scope="module")
def branch() -> ZeroBranch:
    return continue_branch(CUBIC.zero(START), "r", (-4.0, 4.0))


@pytest.fixture(scope="module")
def locus(branch: ZeroBranch) -> ZeroLocus:
    return continue_locus(branch["SN1"], ("r", "h"), {"r": (-3.0, 3.0), "h": (-1.0, 3.9)})


def test_a_branch_has_its_folds(branch):
    assert [point.type for point in branch.special_points] == ["SN", "SN"]
    found = [point.parameters["r"] for point in branch.special_points]
    assert np.allclose(found, [fold(3.0), -fold(3.0)], rtol=0.0, atol=1e-10)
    assert np.allclose([point.solution.x for point in branch.special_points], [-1.0, 1.0], rtol=0.0, atol=1e-7)
    assert branch.values[0] == -4.0
    assert branch.values[-1] == 4.0
    assert np.abs(branch.values + 3.0 * branch.x - branch.x**3).max() < 1e-12


@pytest.mark.parametrize(("way", "end", "folds"), [("up", 4.0, 0), ("down", -4.0, 2)])
def test_each_direction_ends_at_its_bound(way, end, folds):
    half = continue_branch(CUBIC.zero(START), "r", (-4.0, 4.0), directions=way)
    assert (half.values[-1], len(half.special_points)) == (end, folds)


def test_options_are_those_of_all_branches(branch):
    found = continue_branch(
        CUBIC.zero(START), "r", (-4.0, 4.0), directions="down", stop_at="SN", events={"x": 1.5},
        steps=StepControl(largest=0.02),
    )  # fmt: skip
    assert [point.type for point in found.special_points] == ["x", "SN"]
    assert found["x1"].solution.x == pytest.approx(1.5, abs=1e-9)
    assert np.diff(found.arclength).max() < np.diff(branch.arclength).max()
    with pytest.raises(InputError, match="parameter = 's': must be"):
        continue_branch(CUBIC.zero(START), "s", (-4.0, 4.0))
    with pytest.raises(InputError, match="stop_at = 'PD': must be"):
        continue_branch(CUBIC.zero(START), "r", (-4.0, 4.0), stop_at="PD")


def test_a_locus_starts_at_a_zero_with_its_type_as_well(locus):
    again = continue_locus(CUBIC.zero(1.0, r=-2.0), ("r", "h"), {"r": (-3.0, 3.0), "h": (-1.0, 3.9)}, type="SN")
    assert len(again.special_points.of_type("CP")) == 1
    with pytest.raises(InputError, match="start = 'a Zero': must be a special point, or a zero with its type"):
        continue_locus(CUBIC.zero(1.0, r=-2.0), ("r", "h"), {"r": (-3.0, 3.0), "h": (-1.0, 3.9)})


def test_a_locus_has_its_cusp(locus):
    assert np.abs(np.abs(locus.values[:, 0]) - fold(np.maximum(locus.values[:, 1], 0.0))).max() < 1e-9
    cusp = locus["CP1"]
    assert np.allclose([cusp.parameters["r"], cusp.parameters["h"]], 0.0, atol=1e-10)
    # 1/2 p F_xx q over (p q): half of F_xx = -6 x c, along the positive direction
    assert np.allclose(locus.coefficient, -3.0 * locus.x, atol=1e-7)


def test_special_points_have_words_and_a_table(branch, locus):
    assert repr(branch["SN1"]).startswith("SpecialPoint SN1, saddle-node (fold), test function")
    assert list(branch.special_points.to_dataframe()["x"].round(6)) == [-1.0, 1.0]
    assert "CP1" in repr(locus)


@pytest.mark.parametrize("which", ["branch", "locus"])
def test_a_curve_is_saved_and_loaded_equal(which, tmp_path, request):
    curve = request.getfixturevalue(which)
    path = curve.save(tmp_path / "curve.nc")
    again = saltus.load(path)
    assert type(again) is type(curve)
    assert again == curve
    assert [point.solution for point in again.special_points] == [point.solution for point in curve.special_points]
    assert pickle.loads(pickle.dumps(curve)) == curve


def test_a_zero_is_saved_and_loaded_equal(branch, tmp_path):
    zero = branch._solution(3)
    assert saltus.load(zero.save(tmp_path / "zero.nc")) == zero


def test_zeros_at_a_value_are_solved_for(branch):
    found = [zero.x for zero in branch.at(0.0)]
    assert sorted(found) == pytest.approx([-np.sqrt(3.0), 0.0, np.sqrt(3.0)], abs=1e-12)


def test_branch_and_locus_have_pictures(branch, locus):
    pyplot = pytest.importorskip("matplotlib.pyplot")
    pyplot.switch_backend("agg")
    ax = branch.plot()
    assert (ax.get_xlabel(), ax.get_ylabel()) == ("$r$", "$x$")
    assert ax.get_legend_handles_labels()[1] == ["stable", "unstable", "SN, saddle-node"]
    assert "SN, saddle-node" in locus.plot().get_legend_handles_labels()[1]
    pyplot.close("all")
