"""Fits against closed forms, finite differences and data that the model itself makes."""

import pickle

import numpy as np
import pytest

import saltus
from saltus import InputError, MeasuredPoint, continue_orbit, find_orbit, fit
from saltus.continuation.many.retracing import Retraced
from saltus.fitting.evaluation import Evaluation
from saltus.fitting.jumps import jumps_in
from saltus.fitting.measured import read_measured
from saltus.fitting.optimum import Objective, minimised
from saltus.fitting.search import largest_chi2
from saltus.options import FitOptions
from saltus.progress import Reporter

BOUNDS = (0.5, 2.6)
Z = "harmonic(x, 1)"


def branch_of(system, **changes):
    return continue_orbit(find_orbit(system, {"w": 0.6, **changes}, [0.0, 0.0]), "w", BOUNDS)


def followed(orbit, known):
    return continue_orbit(orbit, "w", BOUNDS)


@pytest.fixture(scope="module")
def true_branch(duffing):
    return branch_of(duffing)


def harmonic(orbit):
    amplitude, phase = orbit.observe("amplitude(x, 1)", "phase(x, 1)").values()
    return amplitude * np.exp(1j * phase)


def swept(branch, w):
    """The responses on the ways up and down."""
    low, high = sorted(point.value("w") for point in branch.special_points.of_type("SN"))
    found = []
    for way, values in (("up", w), ("down", w[::-1])):
        for value in values:
            stable = sorted((harmonic(orbit) for orbit in branch.at(value) if orbit.stable), key=abs)
            last = (value < high) if way == "up" else (value < low)
            found.append((value, stable[-1 if last else 0], way))
    return {"w": [one[0] for one in found], Z: np.array([one[1] for one in found]), "direction": [o[2] for o in found]}


@pytest.fixture(scope="module")
def sweep(true_branch):
    return swept(true_branch, np.linspace(0.6, 2.5, 24))


@pytest.fixture(scope="module")
def few(true_branch):
    return swept(true_branch, np.linspace(0.6, 2.5, 8))


@pytest.fixture(scope="module")
def found(duffing, sweep):
    start = {"k": 1.35, "c": 0.14, "b": 0.65}
    vary = {"k": (0.2, 3.0), "c": (0.01, 1.0), "b": (0.1, 5.0)}
    return fit(sweep, branch_of(duffing, **start), vary, {Z: 0.02}, jumps=True)


def linear(branch_or_w, k=1.0, c=0.1, A=0.5):
    w = np.asarray(branch_or_w)
    return 1j * A / (k - w**2 + 1j * c * w)  # of A cos(s), which is A sin(s + pi/2)


def linear_data(noise=0.0, seed=0):
    w = np.linspace(0.6, 1.5, 15)
    rng = np.random.default_rng(seed)
    return {"w": w, Z: linear(w) + noise * (rng.normal(size=15) + 1j * rng.normal(size=15))}


@pytest.mark.campaign
def test_of_a_linear_oscillator_the_fit_and_its_error_are_those_of_linear_least_squares(duffing):
    sigma = 0.5  # large, so that the loss is that of least squares
    data = linear_data(0.01)
    gain = linear(data["w"], A=1.0)
    best = float(np.real(np.vdot(gain, data[Z])) / np.sum(np.abs(gain) ** 2))
    error = sigma / np.sqrt(np.sum(np.abs(gain) ** 2))
    options = FitOptions(profile=("A",))
    one = fit(data, branch_of(duffing, b=0.0, A=0.7), {"A": (0.1, 2.0)}, {Z: sigma}, options=options)
    assert one["A"] == pytest.approx(best, rel=1e-5)
    assert one.errors["A"] == pytest.approx(error, rel=1e-3)
    low, high = one.profiles["A"]
    assert (low, high) == pytest.approx((best - error, best + error), rel=0.03)


@pytest.mark.campaign
def test_a_duffing_oscillator_is_found_from_a_third_off_and_each_datum_lies_on_its_sheet(found, sweep):
    errors = [found.errors[name] for name in found.names]
    assert np.all(np.abs(found.values - [1.0, 0.1, 1.0]) < 0.5 * np.array(errors))  # jumps are known to a step of w
    assert found.stopped == "the optimum is found"
    assert found.chi2 < 2.0
    upper = np.abs(sweep[Z]) > 0.8
    sheets = found.data["sheet"].to_numpy()
    w = np.array(sweep["w"])
    two = (w > 1.45) & (w < 2.2)
    assert len(set(sheets[two & upper])) == 1
    assert len(set(sheets[two & ~upper])) == 1
    assert set(sheets[two & upper]) != set(sheets[two & ~upper])
    assert (found.data["side"] == 0).all()


def test_exact_jumps_and_responses_give_the_exact_values(duffing, few, true_branch):
    folds = [MeasuredPoint("SN", point.value("w"), 0.01) for point in true_branch.special_points.of_type("SN")]
    vary = {"k": (0.2, 3.0), "c": (0.01, 1.0), "b": (0.1, 5.0)}
    one = fit(few, branch_of(duffing, k=1.2, c=0.12, b=0.8), vary, {Z: 0.02}, jumps=folds)
    assert one.values == pytest.approx([1.0, 0.1, 1.0], rel=1e-6)
    assert one.chi2 < 1e-6


@pytest.mark.campaign
def test_noise_gives_values_within_their_errors_and_chi2_of_one(duffing, sweep):
    rng = np.random.default_rng(3)
    size = len(sweep["w"])
    noisy = sweep | {Z: sweep[Z] + 0.02 * (rng.normal(size=size) + 1j * rng.normal(size=size))}
    vary = {"k": (0.2, 3.0), "c": (0.01, 1.0), "b": (0.1, 5.0)}
    one = fit(noisy, branch_of(duffing, k=0.8, c=0.07, b=1.3), vary, {Z: 0.02}, jumps=True)
    errors = np.array([one.errors[name] for name in one.names])
    assert np.all(np.abs(one.values - [1.0, 0.1, 1.0]) < 3.0 * errors)
    assert 0.7 < one.chi2_per_datum < 1.35


@pytest.mark.campaign
def test_jumps_in_the_data_are_those_of_the_model_and_are_fitted(found, true_branch):
    folds = sorted(point.value("w") for point in true_branch.special_points.of_type("SN"))
    measured, sigma = (np.sort(found.data[name].to_numpy()) for name in ("special_value", "special_sigma"))
    assert np.all(np.abs(measured - folds) < 2.0 * sigma)
    assert found.data["special_residual"].shape == (2,)


@pytest.mark.campaign
def test_derivatives_of_all_residuals_are_those_of_differences_also_beyond_the_end_of_a_sheet(duffing, sweep):
    measured = read_measured(sweep, "w", duffing, {Z: 0.02}, {}, {})
    points = [*jumps_in(measured), MeasuredPoint("SN", 2.0, 0.01)]
    measured = measured.with_points(points)
    start, names = {"k": 1.2, "c": 0.13, "b": 0.8}, ("k", "c", "b")
    branch = branch_of(duffing, **start)
    here = Evaluation(measured, (branch,), names)
    sides = here.assigned[2]
    assert (sides != 0).sum() > 2  # data that the model's sheets do not reach
    step = 1e-5
    for j, name in enumerate(names):
        ends = []
        for side in (1.0, -1.0):
            there = Retraced((branch,), followed)({**start, name: start[name] + side * step})
            ends.append(Evaluation(measured, there, names))
        assert all(np.array_equal(end.assigned[0], here.assigned[0]) for end in ends)
        differences = (ends[0].residuals - ends[1].residuals) / (2.0 * step)
        size = np.abs(here.jacobian[:, j]).max()
        assert np.abs(differences - here.jacobian[:, j]).max() < 1e-4 * size


@pytest.mark.campaign
def test_parameters_that_enter_only_together_are_told_in_words(duffing):
    data = linear_data()
    one = fit(data, branch_of(duffing, b=0.0, A=0.6), {"A": (0.1, 2.0), "g": (0.5, 2.0), "c": (0.01, 1.0)}, {Z: 0.01})
    (note,) = [note for note in one.notes if "combination" in note]
    assert "A +1 %, g -1 %" in note or "A -1 %, g +1 %" in note
    assert "c " not in note
    assert one["A"] * one["g"] == pytest.approx(0.5, rel=1e-6)
    assert np.isinf(one.errors["A"])
    assert one.errors["c"] < 0.01
    assert "not told by the data" in repr(one)


@pytest.mark.campaign
def test_strong_correlation_is_told_and_profiled(duffing):
    data = linear_data(0.01)
    narrow = {"w": data["w"][:4], Z: data[Z][:4]}
    vary = {"k": (0.3, 3.0), "A": (0.1, 2.0)}
    one = fit(narrow, branch_of(duffing, b=0.0), vary, {Z: 0.01})
    assert abs(one.correlation.loc["k", "A"]) > 0.95
    assert set(one.profiles) == {"k", "A"}
    low, high = one.profiles["k"]
    assert low < one["k"] < high
    assert "correlate by" in repr(one)


@pytest.mark.campaign
def test_an_interrupt_keeps_the_best_so_far(duffing, sweep):
    seen = []

    def stop(progress):
        seen.append(progress.text)
        if len(seen) == 4:
            raise KeyboardInterrupt

    vary = {"k": (0.2, 3.0), "c": (0.01, 1.0)}
    one = fit(sweep, branch_of(duffing, k=1.3, c=0.14), vary, {Z: 0.02}, progress=stop)
    assert one.stopped.startswith("interrupted")
    assert seen[0].startswith("chi2/n = ")
    first = float(seen[0].split()[2].rstrip(","))
    assert one.chi2_per_datum < first


@pytest.mark.campaign
def test_a_fit_is_saved_read_pickled_and_drawn(found, tmp_path):
    again = saltus.load(found.save(tmp_path / "fit.nc"))
    assert again == found
    assert pickle.loads(pickle.dumps(found)) == found
    assert again["k"] == found["k"]
    assert again.to_dataframe().equals(found.to_dataframe())
    upper, lower = found.plot()
    assert upper.get_ylabel()
    assert len(lower.lines) == 5  # two ways of two residuals, and zero
    assert "chi2/n" in repr(again)
    assert again.parameters["A"] == 0.5


def test_the_result_of_lmfit_has_values_errors_and_correlations(found):
    lmfit = pytest.importorskip("lmfit")
    result = found.to_lmfit()
    assert result.params["k"].value == found["k"]
    assert result.params["k"].stderr == found.errors["k"]
    assert result.params["k"].correl["b"] == found.correlation.loc["k", "b"]
    assert result.chisqr == pytest.approx(found.chi2)
    assert "[[Variables]]" in lmfit.fit_report(result)


@pytest.fixture(scope="module")
def impacting():
    return saltus.HybridSystem(
        ("x", "v"), {"k": 1.0, "c": 0.1, "d": 1.0, "e": 0.8, "w": 0.9, "A": 1.0},
        {"free": saltus.Mode({"x": "v", "v": "A*cos(s) - c*v - k*x"})},
        [saltus.Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="impact")], phase=("s", "w"),
        name="impact oscillator",
    )  # fmt: skip


@pytest.mark.campaign
def test_restitution_and_damping_of_an_impact_oscillator(impacting):
    def traced(**changes):
        return continue_orbit(find_orbit(impacting, {"w": 0.9, **changes}, [0.0, 0.0]), "w", (0.7, 1.3))

    true = traced()
    w = np.linspace(0.8, 1.2, 14)
    names = ("min(x)", "velocity(impact)")
    seen = [next(orbit for orbit in true.at(value) if orbit.stable).observe(*names) for value in w]
    data = {"w": w} | {name: [one[name] for one in seen] for name in names}
    vary = {"e": (0.2, 0.99), "c": (0.01, 0.5)}
    one = fit(data, traced(e=0.6, c=0.14), vary, {"min(x)": 0.01, "velocity(impact)": 0.01})
    assert one.values == pytest.approx([0.8, 0.1], rel=1e-5)


@pytest.mark.campaign
@pytest.mark.parametrize("direction", ["", "up"])
def test_a_measured_grazing_tells_the_gap(impacting, direction):
    """The free amplitude is d at the grazing, which the closed form has."""
    start = find_orbit(impacting, {"A": 0.05, "w": 0.9}, [0.0, 0.0])
    free = np.hypot(1.0 - 0.9**2, 0.09)  # d over A at the grazing
    branch = continue_orbit(start, "A", (0.02, 1.0))
    data = {"A": [0.05, 0.1], "max(x)": [0.05 / free, 0.1 / free]}
    point = MeasuredPoint("GR", 1.4 * free, 1e-3, direction)
    one = fit(data, branch, {"d": (0.5, 2.0), "k": (0.9, 1.1)}, {"max(x)": 1e-3}, jumps=[point])
    assert one["d"] == pytest.approx(1.4, rel=1e-6)
    assert one["k"] == pytest.approx(1.0, rel=1e-6)


def test_a_parameter_without_effect_is_named(impacting):
    start = find_orbit(impacting, {"A": 0.05, "w": 0.9}, [0.0, 0.0])
    branch = continue_orbit(start, "A", (0.02, 0.2))
    data = {"A": [0.05, 0.1], "max(x)": [0.2, 0.4]}
    with pytest.raises(InputError, match="vary = 'e': must be parameters on which a datum depends"):
        fit(data, branch, {"k": (0.5, 2.0), "e": (0.1, 1.0)}, {"max(x)": 0.01})


@pytest.mark.campaign
def test_rows_without_numbers_and_columns_without_errors_are_told(duffing):
    data = linear_data()
    data[Z][3] = np.nan
    data["temperature"] = np.full(15, 20.0)
    one = fit(data, branch_of(duffing, b=0.0), {"c": (0.01, 1.0)}, {Z: 0.01})
    assert "1 rows with missing or infinite numbers were left out" in one.notes
    assert "columns without a standard error are not fitted: temperature" in one.notes
    assert one.data.sizes["datum"] == 14


@pytest.mark.campaign
def test_one_wild_datum_is_told_and_does_not_spoil_the_fit_and_no_further_start_is_tried(duffing):
    data = linear_data()
    data[Z][3] += 1.0
    one = fit(data, branch_of(duffing, b=0.0), {"c": (0.01, 1.0)}, {Z: 0.01})
    assert one.outliers == (3,)
    assert not one.misfit
    assert "outlier: datum 3 at w = " in repr(one)
    assert one.chi2_per_datum > 100.0 > 2.0 > one.chi2_without_outliers
    assert one["c"] == pytest.approx(0.1, rel=0.05)
    assert one.message == "the optimum is found"


@pytest.mark.campaign
def test_data_that_no_parameters_fit_are_told_first_of_all(duffing):
    data = linear_data()
    far = {"w": data["w"][::3], Z: data[Z][::3] + 3.0}
    with pytest.warns(RuntimeWarning, match="5 of 5 data lie .* no better fit is found from 3 starts"):
        one = fit(far, branch_of(duffing, b=0.0), {"c": (0.01, 1.0)}, {Z: 0.01})
    assert repr(one).splitlines()[1].strip() == one.misfit
    assert one.misfit.startswith("the data do not fit")
    assert "optimum is found" not in one.message
    assert largest_chi2(10) < one.chi2_per_datum


@pytest.mark.campaign
@pytest.mark.thorough
def test_a_search_that_ends_in_a_local_optimum_goes_on_from_further_starts(duffing, few):
    """From here the trust region ends where the upper sheet is missed: chi2/n is about 800 there."""
    vary = {"k": (0.2, 3.0), "b": (0.05, 10.0)}
    start = np.array([1.2, 5.0])
    branch = branch_of(duffing, **dict(zip(vary, start, strict=True)))
    measured = read_measured(few, "w", duffing, {Z: 0.02}, {}, {})
    with Reporter(False) as reporter:
        objective = Objective(measured, Retraced((branch,), followed), tuple(vary), reporter)
        alone = minimised(objective, start, np.array(list(vary.values())).T, most=60)
    assert alone.loss > 100.0 * len(few["w"])
    one = fit(few, branch, vary, {Z: 0.02})
    assert one.values == pytest.approx([1.0, 1.0], rel=1e-6)
    assert one.message == "the optimum is found"


@pytest.mark.campaign
def test_repeated_rows_are_told(duffing):
    data = linear_data()
    twice = {name: np.concatenate([values[:6], values[:3]]) for name, values in data.items()}
    one = fit(twice, branch_of(duffing, b=0.0), {"c": (0.01, 1.0)}, {Z: 0.01})
    assert "3 rows repeat others, and count as measured again" in one.notes


@pytest.mark.campaign
def test_jumps_that_the_data_lack_are_told_and_one_jump_is_enough(duffing, sweep):
    data = linear_data() | {"direction": ["up"] * 15}
    one = fit(data, branch_of(duffing, b=0.0), {"c": (0.01, 1.0)}, {Z: 0.01}, jumps=True)
    assert "jumps were sought, but the data show none" in one.notes
    up = np.array(sweep["direction"]) == "up"
    alone = {name: np.array(column)[up] for name, column in sweep.items()}
    one = fit(alone, branch_of(duffing, b=0.8), {"b": (0.1, 5.0)}, {Z: 0.02}, jumps=True)
    assert one.data.sizes["special_datum"] == 1
    assert [note.split(" at ")[0] for note in one.notes] == ["the jump up"]
    assert one["b"] == pytest.approx(1.0, abs=0.01)


BAD = {
    "no branch": ({"branch": "Duffing"}, "a Branch of periodic orbits"),
    "outside": ({"data": {"w": [0.6, 3.0], Z: [1j, 1j]}}, "1 of 2 data outside.*where the branch is"),
    "no column": ({"sigma": {"lag": 1.0}}, "with a column 'lag'"),
    "no sigma": ({"sigma": {}}, "standard error of at least one column"),
    "sigma of 0": ({"sigma": {Z: 0.0}}, "sigma"),
    "sigma's shape": ({"sigma": {Z: [0.1, 0.2]}}, "one for each of 15 rows"),
    "no parameter": ({"vary": {"q": (0.0, 1.0)}}, "q"),
    "the branch's own": ({"vary": {"w": (0.0, 1.0)}}, "w"),
    "nothing varied": ({"vary": {}}, "at least one parameter"),
    "bounds": ({"vary": {"c": (0.2, 1.0)}}, "start of c = 0.1: must be between 0.2 and 1"),
    "few data": ({"data": {"w": [1.0], "x_max": [1.0]}, "sigma": {"x_max": 0.1}, "vary": {"c": (0.1, 1), "k": (0.5, 2)},
                      "options": FitOptions(observables={"x_max": "max(x)"})}, "1 numbers.*at least 2"),
    "no observable": ({"data": {"w": [1.0], "y": [1.0]}, "sigma": {"y": 0.1}}, "y"),
    "real data": ({"data": {"w": [1.0], Z: [1.0]}}, "for real data"),
    "complex data": ({"data": {"w": [1.0], "max(x)": [1j]}, "sigma": {"max(x)": 0.1}}, "for complex data"),
    "texts": ({"data": {"w": ["a"], Z: [1j]}}, "column 'w'"),
    "no rows": ({"data": {"w": [np.nan], Z: [1j]}}, "at least one row"),
    "lengths": ({"data": {"w": [1.0, 2.0], Z: [1j]}}, "columns of one length"),
    "no table": ({"data": 3.0}, "a pandas DataFrame"),
    "jumps without ways": ({"jumps": True}, "column 'direction'"),
    "jumps": ({"jumps": [MeasuredPoint("BP", 1.0, 0.1)]}, "type = 'BP'"),
    "jump outside": ({"jumps": [MeasuredPoint("SN", 9.0, 0.1)]}, "value of a measured point"),
    "profile": ({"options": FitOptions(profile=("k",))}, "profile = 'k'"),
    "sigma below 0": ({"sigma": {Z: -1.0}}, "must be a finite number > 0"),
    "a sigma of 0": ({"sigma": {Z: [0.0] + 14 * [1.0]}}, r"\[0\] = 0.0: must be positive"),
    "sigma not given": ({"sigma": None}, "sigma = None: must be the standard error of at least one column"),
    "a start": ({"options": FitOptions(start={"c": "0.2"})}, r"start\['c'\] = '0.2': must be a finite number"),
    "no number as a start": ({"options": FitOptions(start={"c": np.nan})}, r"start\['c'\] = nan: must be"),
    "no evaluations": ({"options": FitOptions(max_evaluations=0)}, "max_evaluations = 0: must be an integer >= 1"),
    "turns of no column": ({"options": FitOptions(turns={"q": 1.0})}, "turns = 'q': must be one of harmonic"),
    "no such column": ({"options": FitOptions(observables={"q": "max(x)"})}, "observables = 'q': must be one of"),
    "almost no effect": ({"vary": {"b": (0.0, 1e-12)}, "options": FitOptions(start={"b": 0.0})}, "vary = 'b': must be"),
}  # fmt: skip


@pytest.mark.parametrize("what", BAD)
def test_bad_input_is_told(true_branch, what):
    given, message = BAD[what]
    arguments = {"data": linear_data(), "branch": true_branch, "vary": {"c": (0.01, 1.0)}, "sigma": {Z: 0.1}} | given
    with pytest.raises(InputError, match=message):
        fit(**arguments)


def test_a_steep_resonance_is_no_jump(duffing):
    data = linear_data() | {"direction": ["up"] * 15}
    assert jumps_in(read_measured(data, "w", duffing, {Z: 0.02}, {}, {})) == []
