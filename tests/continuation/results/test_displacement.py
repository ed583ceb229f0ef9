"""How loci move with other parameters: closed forms, and loci traced again at changed values."""

import numpy as np
import pytest

import known_maps
import saltus
from saltus import InputError, StepControl, continue_locus, continue_orbit, find_orbit


@pytest.fixture(scope="module")
def response():
    duffing = saltus.HybridSystem.smooth(
        {"x": "v", "v": "-c*v - k*x - b*x**3 + A*g*cos(s)"},
        {"k": 1.0, "c": 0.1, "b": 1.0, "A": 0.5, "g": 1.0, "w": 1.0},
        phase=("s", "w"), name="Duffing",
    )  # fmt: skip
    return continue_orbit(find_orbit(duffing, {"w": 0.6}, [0.0, 0.0]), "w", (0.5, 2.6))


@pytest.fixture(scope="module")
def folds(response):
    return continue_locus(
        response["SN1"], ("A", "w"), {"A": (0.3, 0.7), "w": (1.0, 3.0)}, steps=StepControl(largest=0.2)
    )


def test_a_locus_of_folds_moves_as_its_points_do_on_branches(response, folds):
    """The start of the locus lies on the branch along w, whose fold has these derivatives."""
    moved = folds.displacement("w", ["c", "k", "b"])
    at = int(np.argmin(np.abs(folds.column("A") - 0.5)))
    point = response["SN1"].sensitivity(["c", "k", "b"])["w"].to_numpy()
    assert folds.column("A")[at] == pytest.approx(0.5, abs=1e-9)
    assert moved["displacement"].isel(point=at).to_numpy() == pytest.approx(point, rel=1e-6)
    assert not np.any(np.isnan(moved["displacement"]))
    assert moved["displacement"].attrs == {"of": "w"}


def test_force_and_gain_enter_as_a_product(folds):
    """A g alone counts, with g = 1: the displacement of A by g is -A, whatever the point."""
    moved = folds.displacement("A", ["g"])["displacement"].sel(parameter="g")
    assert moved.to_numpy() == pytest.approx(-folds.column("A"), rel=1e-7)


def test_by_the_other_parameter_it_is_the_slope_of_the_locus(folds):
    slopes = folds.displacement("w", ["A"])["displacement"].sel(parameter="A").to_numpy()
    A, w = folds.column("A"), folds.column("w")
    order = np.argsort(A)
    between = np.diff(w[order]) / np.diff(A[order])
    inner = 0.5 * (slopes[order][1:] + slopes[order][:-1])
    assert between == pytest.approx(inner, rel=2e-2)


def test_units_of_lengths_and_times_leave_the_product_rule(folds):
    """By scaling, the fold's w/sqrt(k) depends on b A**2/k**3 and c/sqrt(k) alone."""
    moved = folds.displacement("w", ["k", "b", "c", "A"])["displacement"]
    by = {name: moved.sel(parameter=name).to_numpy() for name in ("k", "b", "c", "A")}
    A, w = folds.column("A"), folds.column("w")
    assert 2.0 * by["b"] == pytest.approx(A * by["A"], rel=1e-6)  # b = 1
    assert by["k"] == pytest.approx(0.5 * w - 3.0 * by["b"] - 0.5 * 0.1 * by["c"], rel=1e-6)  # k = 1, c = 0.1


def test_of_a_map_the_doubling_of_henon_moves_as_its_closed_form():
    """The fixed point doubles at a = 3 (1 - b)**2/4."""
    henon = known_maps.henon()
    start = find_orbit(henon, {"a": 0.2, "b": 0.3}, [0.5, 0.1])
    doubling = continue_orbit(start, "a", (0.1, 1.0))["PD1"]
    locus = continue_locus(doubling, ("a", "b"), {"a": (0.1, 0.6), "b": (0.2, 0.5)})
    slopes = locus.displacement("a")["displacement"].sel(parameter="b").to_numpy()
    assert slopes == pytest.approx(-1.5 * (1.0 - locus.column("b")), rel=1e-7)


def test_names_are_checked(folds):
    with pytest.raises(InputError, match="of = 'c': must be one of A, w"):
        folds.displacement("c")
    with pytest.raises(InputError, match="parameters = 'w'"):
        folds.displacement("w", ["w"])
