"""`verify` reads what users see: each column of each kind of result, ends, special points; a falsified one fails."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import saltus
from falsified import NOTHING, falsifications, falsified, told
from saltus.continuation.results.special_points import SpecialPoints
from selection import CAMPAIGN, THOROUGH

BRUSSELATOR = saltus.HybridSystem.smooth({"x": "A - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"}, {"A": 1.2, "B": 1.5})
HENON = saltus.Map(("x", "y"), {"a": 0.2, "b": 0.3}, {"x": "1 - a*x**2 + y", "y": "b*x"})
CHAIN = saltus.HybridSystem.smooth({"x": "y", "y": "z", "z": "-al*z - y - x + x**2"}, {"al": 1.2})
SPRING = saltus.HybridSystem.smooth({"x": "v", "v": "-c*v - x + cos(s)"}, {"c": 0.3, "w": 1.0}, phase=("s", "w"))


def impacts(w: float = 1.1) -> saltus.HybridSystem:
    return saltus.HybridSystem(
        ("x", "v"), {"k": 1.0, "c": 0.1, "d": 1.0, "e": 0.8, "w": w, "A": 0.4},
        {"free": saltus.Mode({"x": "v", "v": "A*cos(s) - c*v - k*x"})},
        [saltus.Transition("free", "free", event="x - d", direction=1, reset={"v": "-e*v"}, name="impact")],
        phase=("s", "w"), positive=["w"],
    )  # fmt: skip


def equilibria():
    return saltus.continue_equilibrium(saltus.find_equilibrium(BRUSSELATOR, x0=[1.2, 1.5]), "B", (1.0, 3.2))


def map_orbits():
    return saltus.continue_orbit(saltus.find_orbit(HENON, {}, [0.6, 0.2]), "a", (0.1, 1.0))


def branch():
    return saltus.continue_orbit(saltus.find_orbit(impacts(), x0=[0.0, 0.0]), "A", (0.05, 2.0))


def locus():
    return saltus.continue_locus(branch()["SN1"], ("A", "w"), {"A": (0.05, 2.0), "w": (1.0, 1.2)})


def cycles():
    """Return cycles that shrink to a Hopf point."""
    rests = saltus.continue_equilibrium(saltus.find_equilibrium(BRUSSELATOR, x0=[1.2, 1.5]), "B", (1.0, 3.5))
    return saltus.continue_orbit(saltus.switch_branch(rests["HB1"]), "B", (2.0, 3.0))


def hopf_locus():
    return saltus.continue_locus(equilibria()["HB1"], ("A", "B"), {"A": (1.0, 1.5), "B": (1.5, 3.5)})


def fold_locus():
    """Return folds with a cusp."""
    cubic = saltus.HybridSystem.smooth({"x": "m + q*x - x**3 - y", "y": "0.3*x - y"}, {"m": -2.0, "q": 1.0})
    rests = saltus.continue_equilibrium(saltus.find_equilibrium(cubic, x0=[-1.5, -0.5]), "m", (-2.0, 2.0))
    return saltus.continue_locus(rests["SN1"], ("m", "q"), {"m": (-1.0, 1.0), "q": (0.0, 1.2)})


def map_locus():
    return saltus.continue_locus(map_orbits()["PD1"], ("a", "b"), {"a": (0.0, 0.6), "b": (0.2, 0.4)})


def equilibrium():
    return equilibria().solution(2)


def map_orbit():
    return map_orbits().solution(2)


def point():
    return equilibria()["HB1"]


def family():
    return saltus.continue_family(driven(), "w", {"c": [0.2, 0.4]}, (0.9, 1.1), workers=1)


def driven():
    return saltus.find_orbit(SPRING, x0=[0.0, 0.0])


def quantity():
    held = [(mode, end or None, x, duration) for mode, end, x, duration in driven().segments]
    orbit = saltus.solve_orbit(SPRING, {"c": 0.3, "w": 1.0}, held, fix={"max_x": 3.0}, free="c")
    return saltus.continue_orbit(orbit, "max_x", (2.0, 4.0))


def cascade():
    diagram = saltus.diagram(CHAIN, "al", (0.5, 1.5), x0=[0.0, 0.0, 0.0])
    return saltus.follow_cascade(diagram[1]["PD1"], (0.5, 1.5), doublings=2)


def optimum():
    return saltus.optimise(driven(), maximise="amplitude(x, 1)", vary={"w": (0.5, 2.0)})


def fit():
    w = np.linspace(0.6, 1.4, 9)
    data = {"w": w, "amplitude(x, 1)": 1.0 / np.hypot(1.0 - w**2, 0.2 * w)}
    curve = saltus.continue_orbit(driven(), "w", (0.5, 1.5))
    return saltus.fit(data, curve, {"c": (0.05, 1.0)}, {"amplitude(x, 1)": 0.01})


@pytest.fixture(scope="module")
def rest():
    return equilibria()


@pytest.fixture(scope="module")
def forced():
    return branch()


@pytest.mark.parametrize(
    ("name", "what"),
    [("stable", "column stable"), ("eigenvalue_re", "column eigenvalues"), ("residual", "column residual")],
)
def test_a_wrong_column_of_equilibria_is_found_at_one_point(rest, name, what):
    assert what in told(rest, name, "one")


@pytest.mark.parametrize("name", ["stable", "multiplier_re"])
def test_a_wrong_column_of_map_orbits_is_found_everywhere(name):
    assert told(map_orbits(), name, "all") != NOTHING


@pytest.mark.parametrize(
    ("name", "what"),
    [("admissible", "column admissible"), ("period", "column period"), ("x0", "column x0"), ("highs", "column highs")],
)
def test_a_wrong_column_of_orbits_is_found_at_one_point(forced, name, what):
    changed = falsified(forced.to_xarray().drop_vars(["max_x", "max_v"]), name, "one")
    wrong = saltus.verify(type(forced).from_xarray(changed), points=2)
    assert what in {row.what for row in wrong.failures}


def test_means_are_found_wrong_by_means_of_scipy(forced):
    wrong = saltus.verify(replace(forced, means=forced.means + 1e-3), points=2)
    assert {"column means", "mean x", "mean v"} <= {row.what for row in wrong.failures}


def test_a_column_that_repeats_another_one_is_refused(forced):
    for name in ("max_x", "signature"):
        with pytest.raises(saltus.SaltusError, match=f"variable '{name}' = 'another one'"):
            type(forced).from_xarray(falsified(forced.to_xarray(), name, "one"))


@pytest.mark.parametrize("end", [0, 1])
@pytest.mark.parametrize(
    "reason", ["B = 2: bound reached", "the branch is closed", "B = 2.5: step below 1e-8", "the start"]
)
def test_an_invented_end_is_found(rest, end, reason):
    inner = rest.values[1:-1].copy()
    kept = {name: getattr(rest, name)[1:-1] for name in ("stable", "residual", "regular", "eigenvalues", "mode")}
    cut = replace(
        rest, values=inner, states=rest.states[1:-1], arclength=rest.arclength[1:-1] - rest.arclength[1], **kept,
        special_points=SpecialPoints([replace(rest["HB1"], position=rest["HB1"].position - 1.0,
                                              arclength=rest["HB1"].arclength - rest.arclength[1])], rest.varied),
    )  # fmt: skip
    told_ends = tuple(reason if i == end else "interrupted" for i in (0, 1))
    wrong = saltus.verify(replace(cut, stopped=told_ends), points=2)
    what = f"stopped, at the {'last' if end else 'first'} point"
    assert any(row.what.startswith(what) for row in wrong.failures), wrong
    assert saltus.verify(replace(cut, stopped=("interrupted", "interrupted")), points=2).passed


def test_a_renamed_a_copied_and_a_dropped_point_are_found(rest):
    hopf = rest["HB1"]
    for points in (
        [replace(hopf, type="SN", label="SN1")], [hopf, hopf], [hopf, replace(hopf, label="HB2")],
        [replace(hopf, label="HB")], [replace(hopf, position=hopf.position + 3.0)], [],
    ):  # fmt: skip
        wrong = saltus.verify(replace(rest, special_points=SpecialPoints(points, rest.varied)), points=2)
        assert not wrong.passed


def test_a_claim_of_all_points_is_one_row(rest):
    wrong = saltus.verify(replace(rest, stable=~rest.stable))
    assert [row.what for row in wrong].count("column stable") == 1


@pytest.mark.campaign
def test_a_doubling_that_ends_at_a_grazing_has_unknown_multipliers_there():
    # the product is e**2*exp(-c*T) on either side; at an impact without speed it is 0/0 of the equations
    start = saltus.continue_orbit(saltus.find_orbit(impacts(0.7), x0=[0.0, 0.0]), "A", (0.05, 2.0))
    found = saltus.continue_locus(start["PD1"], ("A", "w"), {"A": (0.05, 2.0), "w": (0.6, 0.8)})
    assert abs(found.values[0, 1] - np.sqrt(1.0 - 0.0025) * 2.0 / 3.0) < 1e-9
    for values in (found.multipliers[0], found.solution(0).multipliers, found["GR1"].orbit.multipliers):
        assert np.all(np.isnan(values))
    assert not found.solution(0).stable
    product = np.prod(found.multipliers[1:], axis=1).real
    assert np.allclose(product, 0.64 * np.exp(-0.1 * found.period[1:]), rtol=1e-8)
    checked = saltus.verify(found)
    assert checked.passed, checked
    assert "multipliers" in {row.what for row in checked.unchecked}


@pytest.mark.parametrize("name", ["special_test", "special_position"])
def test_a_wrong_variable_of_a_special_point_is_found(rest, name):
    assert told(rest, name, "all") not in (NOTHING, "not read")


@pytest.mark.campaign
@pytest.mark.parametrize("end", ["x0", "multiplier_re", "low", "high", "test", "position", "residual", "implicit"])
def test_a_wrong_variable_of_a_cycle_that_has_shrunk_is_found(end):
    dataset = (shrunk := cycles()).to_xarray()
    assert dataset["special_type"].values.tolist() == ["HB"]
    checked = told(shrunk, f"special_{end}", "all", points=2)
    assert checked != NOTHING or end == "implicit"


def test_what_no_check_reads_is_named(rest):
    named = [row.what for row in saltus.verify(rest, points=2).unchecked]
    assert named == ["variable arclength", "variable special_arclength", "variable special_scale"]


@pytest.mark.parametrize(
    "made",
    [
        *(pytest.param(kind, marks=CAMPAIGN) for kind in (equilibria, map_orbits, map_locus)),
        *(pytest.param(kind, marks=CAMPAIGN) for kind in (equilibrium, map_orbit, driven, point)),
        *(pytest.param(kind, marks=THOROUGH) for kind in (branch, cycles, family, cascade)),
        *(pytest.param(kind, marks=THOROUGH) for kind in (locus, hopf_locus, fold_locus, quantity, optimum)),
    ],
)
def test_every_variable_that_is_falsified_is_found_or_named(made):
    result = made()
    assert saltus.verify(result).passed
    ways = falsifications(result.to_xarray())
    assert not [(name, how) for name, how in ways if told(result, name, how, points=2) == NOTHING]


@pytest.mark.campaign
@pytest.mark.parametrize("name", ["fitted", "fit_residual", "fit_measured", "fit_model", "fit_x", "covariance"])
def test_a_fit_that_is_falsified_is_found(name):
    found = fit()
    assert saltus.verify(found).passed
    assert told(found, name, "all") != NOTHING


def folds():
    """Return branches of each kind with folds whose stability and course tell no branch point from a fold."""
    cubic = saltus.HybridSystem.smooth({"x": "m + x - x**3 - y", "y": "0.3*x - y"}, {"m": -2.0})
    yield saltus.continue_equilibrium(saltus.find_equilibrium(cubic, x0=[-1.5, -0.5]), "m", (-2.0, 2.0))
    square = saltus.Map(("x", "y"), {"r": 0.5}, {"x": "r + x - x**2", "y": "0.5*y + x"})
    yield saltus.continue_orbit(saltus.solve_orbit(square, x0=[0.7, 1.4]), "r", (-0.5, 0.6))
    field = {"x": "v", "v": "-0.2*v - x - x**3 + 0.2*cos(th)"}
    duffing = saltus.HybridSystem(("x", "v"), {"w": 1.0}, {"m": saltus.Mode(field)}, phase=("th", "w"))
    yield saltus.continue_orbit(saltus.find_orbit(duffing, x0=[0.0, 0.0]), "w", (0.6, 2.0))


def test_a_fold_that_is_called_a_branch_point_is_found():
    for found in folds():
        fold = found["SN1"]
        others = [replace(fold, type="BP", label="BP1") if p is fold else p for p in found.special_points]
        wrong = saltus.verify(replace(found, special_points=SpecialPoints(others, found.varied)), points=2)
        assert "branches meet" in {row.what for row in wrong.failures}


@pytest.mark.parametrize("term", ["x**2", "x**3", "x**2 + 1e-3*x**3"])
def test_points_where_branches_meet_are_found_to_be_such(term):
    field = saltus.HybridSystem.smooth({"x": f"m*x - ({term})", "y": "x**2 - y + m"}, {"m": -1.0})
    rests = saltus.continue_equilibrium(saltus.find_equilibrium(field, x0=[0.0, -1.0]), "m", (-1.0, 1.0))
    orbits = saltus.continue_orbit(
        saltus.solve_orbit(saltus.Map(("x",), {"m": -0.5}, {"x": f"x + m*x - ({term})"}), x0=[0.0]), "m", (-0.5, 0.5)
    )
    for found in (rests, orbits):
        (row,) = [row for row in saltus.verify(found, points=2) if row.what == "branches meet"]
        assert row.verdict == "agrees"
