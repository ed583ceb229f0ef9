"""Data are compared with sheets at their own places: closed forms by Mathieu functions, curves by SciPy, walls."""

import numpy as np
import pytest
from scipy.special import mathieu_a

import saltus
from campaign.fit_intervals import cases
from saltus import HybridSystem, continue_orbit, find_orbit
from saltus.fitting.evaluation import Evaluation
from saltus.fitting.measured import read_measured
from saltus.options import FitOptions
from selection import guarding

E = 0.5
FOLD = -float(mathieu_a(0, 2.0 * E)) / 4.0  # with x = y'/y it is Mathieu's equation y'' = (mu + a + e cos s) y


@pytest.fixture(scope="module")
def sloped():
    """x' = mu + a - x^2 + e cos s, whose orbits end at a fold, and below it there is none."""
    return HybridSystem.smooth(
        {"x": "mu + a - x**2 + e*cos(s)"}, {"mu": 1.0, "a": 0.0, "e": E, "w": 1.0}, phase=("s", "w")
    )


@pytest.fixture(scope="module")
def curve(sloped):
    return continue_orbit(find_orbit(sloped, {}, [1.0]), "mu", (-0.3, 1.5))


def evaluated(branch, data, sigma, allowance, names=("a",), along="mu"):
    measured = read_measured(data, along, branch.system, sigma, {}, {})
    return Evaluation(measured, (branch,), names, allowance=allowance)


def mean(curve, mu):
    return max(orbit.observe("mean(x)")["mean(x)"] for orbit in curve.at(mu))


def test_a_datum_where_no_orbit_is_costs_its_distance_from_the_fold(curve):
    """The distance is counted in the standard error of an equal distribution over the distance of the next datum."""
    found = evaluated(curve, {"mu": [1.0, 0.4, 0.0], "mean(x)": [1.0, 0.6, 0.3]}, {"mean(x)": 0.1}, 0.0)
    last = evaluated(curve, {"mu": [1.0, 0.4, 0.0], "mean(x)": [1.0, 0.6, 0.3]}, {"mean(x)": 0.1}, np.inf)
    unit = 0.4 / np.sqrt(12.0)
    assert found.residuals[:2] == pytest.approx(last.residuals[:2], abs=1e-9)
    assert abs(found.residuals[2]) == pytest.approx(np.hypot(last.residuals[2], FOLD / unit), rel=1e-3)
    assert found.beyond == pytest.approx([0.0, 0.0, FOLD], rel=1e-3)
    assert not found.overhang


def test_a_shift_of_the_parameter_moves_distances_as_it_moves_the_fold(sloped, curve):
    """All depends on mu + a, so that a datum at mu - h with a = h has the residual of one at mu with a = 0."""
    data = {"mu": np.array([1.0, 0.4, 0.05]), "mean(x)": np.array([1.0, 0.6, 0.3])}
    found = evaluated(curve, data, {"mean(x)": 0.1}, 0.0)
    step, ends = 1e-5, []
    for side in (1.0, -1.0):
        moved = data | {"mu": data["mu"] + side * step}
        ends.append(evaluated(curve, moved, {"mean(x)": 0.1}, 0.0).residuals)
    expected = (ends[0] - ends[1]) / (2.0 * step)
    assert found.jacobian[:2, 0] == pytest.approx(expected[:2], rel=1e-6)
    # last orbits lie 1e-5 of the sheet's length within, whose other end does not move with the data
    assert found.jacobian[2, 0] == pytest.approx(expected[2], rel=2e-2)


def test_a_sheet_that_exists_comes_before_the_end_of_a_nearer_one(duffing):
    branch = continue_orbit(find_orbit(duffing, {"w": 1.2}, [0.0, 0.0]), "w", (1.0, 2.6))
    high = max(point.value("w") for point in branch.special_points.of_type("SN"))
    upper = max(orbit.max["x"] for orbit in branch.at(high - 1e-4))
    (lower,) = (orbit.max["x"] for orbit in branch.at(high + 0.05))
    data = {"w": [high + 0.05], "max(x)": [upper]}
    lenient, strict = (evaluated(branch, data, {"max(x)": 0.1}, one, along="w", names=("A",)) for one in (np.inf, 0.0))
    assert lenient.overhang == pytest.approx(0.05, rel=1e-3)
    assert abs(lenient.residuals[0]) < 1.0
    assert strict.residuals == pytest.approx([(lower - upper) / 0.1], rel=1e-6)
    assert strict.reached.all()
    between = evaluated(branch, data, {"max(x)": 0.1}, 0.05, along="w", names=("A",))
    assert abs(between.residuals[0]) == pytest.approx(np.hypot(lenient.residuals[0], 1.0), rel=1e-3)


def test_an_interval_ends_where_a_datum_would_lose_its_sheet(curve):
    """The data hardly tell a, but that the fold lies below the least mu: a > fold - mu."""
    mu = np.array([0.2, 0.6, 1.0])
    data = {"mu": mu, "mean(x)": [mean(curve, one) for one in mu]}
    found = saltus.fit(data, curve, {"a": (-1.0, 1.0)}, {"mean(x)": 0.3}, options=FitOptions(profile=()))
    low, high = found.intervals["a"]
    assert found["a"] == pytest.approx(0.0, abs=1e-3)
    assert low == pytest.approx(FOLD - 0.2, abs=2e-3)
    assert high > 1.5 * abs(low)
    assert found.errors["a"] == pytest.approx(high - found["a"])
    assert found.limits["a"].startswith("the SN at which a sheet ends next to the datum 0 at mu = 0.2")
    assert "limited by the SN" in repr(found)


def test_data_where_the_model_has_no_orbit_are_named_and_survive_a_file(curve, tmp_path):
    mu = np.array([0.05, 0.3, 0.6, 1.0])
    data = {"mu": mu, "mean(x)": [0.3, *(mean(curve, one) for one in mu[1:])]}
    found = saltus.fit(data, curve, {"a": (-0.05, 0.02)}, {"mean(x)": 0.01}, options=FitOptions(profile=()))
    assert found.beyond == (0,)
    assert "datum 0 at mu = 0.05 lies" in repr(found)
    assert "the model has no stable orbit there" in repr(found)
    (row,) = [line for line in str(saltus.verify(found)).splitlines() if "stable orbits at datum 0" in line]
    assert "agrees" in row
    found.save(tmp_path / "fit.nc")
    again = saltus.load(tmp_path / "fit.nc")
    assert again.beyond == found.beyond
    assert again.limits == found.limits
    assert again.intervals == found.intervals


SEEDS = [("soft stop", 12), ("soft stop", 2), ("impacts", 0), ("Duffing", 0), ("soft stop with hysteresis", 0)]


@pytest.mark.parametrize(("name", "seed"), guarding(SEEDS, ("impacts", 0), campaign=2))
def test_chi2_is_that_of_the_curve_by_scipy_and_errors_hold_the_truth(name, seed):
    """At the optimum SciPy settles on the model's own curve; four standard errors hold all of the true values."""
    (case,) = (one for one in cases() if one.name == name)
    clean = case.clean()
    found = case.fitted(clean, seed)
    assert not found.misfit
    pulls = [(found[known] - true) / found.errors[known] for known, true in case.truth.items()]
    assert np.abs(pulls).max() < 4.0
    noisy = found.data["measured"].to_numpy()[:, 0]
    fitted = case.clean(**found.parameters)
    w = np.array([place for place, _ in case.places])
    off = [float(np.min(np.abs(fitted[w == place] - value))) for place, value in zip(w, noisy, strict=True)]
    chi2 = float(np.sum((np.array(off) / case.sigma) ** 2))
    assert float(np.sum(found.data["residual"].to_numpy() ** 2)) == pytest.approx(chi2, rel=1e-2, abs=1e-2)
    assert chi2 < float(np.sum(((noisy - clean) / case.sigma) ** 2)) + 1.0  # of three values that are fitted
