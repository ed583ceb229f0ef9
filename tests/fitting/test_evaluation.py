"""Data against traced branches: closed forms of a linear oscillator, sheets, their ends, and differences."""

import numpy as np
import pytest

from saltus import (
    ConvergenceError,
    HybridSystem,
    MeasuredPoint,
    Mode,
    Transition,
    continue_orbit,
    find_orbit,
    solve_orbit,
)  # fmt: skip
from saltus.fitting.evaluation import Evaluation
from saltus.fitting.measured import read_measured

NAMES = ("k", "c", "A")
Z = "harmonic(x, 1)"


@pytest.fixture(scope="module")
def linear(duffing):
    return continue_orbit(find_orbit(duffing, {"w": 0.6, "b": 0.0}, [0.0, 0.0]), "w", (0.5, 1.6))


@pytest.fixture(scope="module")
def folded(duffing):
    return continue_orbit(find_orbit(duffing, {"w": 1.2}, [0.0, 0.0]), "w", (1.0, 2.6))


@pytest.fixture(scope="module")
def folds(folded):
    return sorted(point.value("w") for point in folded.special_points.of_type("SN"))


def evaluated(branch, data, sigma, points=(), names=NAMES, turns=None):
    measured = read_measured(data, "w", branch.system, sigma, {}, turns or {})
    return Evaluation(measured.with_points(points), (branch,), names)


def response(w, k=1.0, c=0.1, A=0.5):
    return 1j * A / (k - w**2 + 1j * c * w)


def test_residuals_of_a_linear_oscillator_are_those_of_its_closed_form(linear):
    w = np.array([0.6, 0.95, 1.02, 1.5])
    z, sigma = np.array([1.0 + 1.0j, -2.0j, 0.5, 0.0]), np.array([0.1, 0.2, 0.3, 0.4])
    found = evaluated(linear, {"w": w, Z: z, "max(x)": np.zeros(4)}, {Z: sigma, "max(x)": 0.5})
    away = (response(w) - z) / sigma
    assert found.residuals == pytest.approx(
        np.concatenate([away.real, away.imag, np.abs(response(w)) / 0.5]), rel=1e-8, abs=1e-8
    )


def test_the_jacobian_of_a_linear_oscillator_is_that_of_its_closed_form(linear):
    w = np.array([0.6, 0.95, 1.02, 1.5])
    found = evaluated(linear, {"w": w, Z: np.zeros(4, complex)}, {Z: 0.1})
    stiff = response(w) / 0.5
    slopes = np.array([0.5j * stiff**2, -0.5 * w * stiff**2, stiff]).T / 0.1
    assert found.jacobian == pytest.approx(np.concatenate([slopes.real, slopes.imag]), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("names", [("c", "k"), ("g",), ("b", "A")])
def test_columns_of_the_jacobian_are_in_the_order_of_the_names(linear, names):
    """The product A g is what counts, so g has the slope of A times A over g."""
    w = np.array([0.7, 1.2])
    data = {"w": w, "amplitude(x, 1)": np.zeros(2)}
    found = evaluated(linear, data, {"amplitude(x, 1)": 1.0}, names=names).jacobian
    step, columns = 1e-6, []
    for name in names:
        if name == "b":
            continue
        p = {"k": 1.0, "c": 0.1, "A": 0.5}
        if name == "g":
            ends = [np.abs(response(w, A=0.5 * (1.0 + side * step))) for side in (1.0, -1.0)]
        else:
            ends = [np.abs(response(w, **(p | {name: p[name] + side * step}))) for side in (1.0, -1.0)]
        columns.append((ends[0] - ends[1]) / (2.0 * step))
    kept = [i for i, name in enumerate(names) if name != "b"]
    assert found[:, kept] == pytest.approx(np.array(columns).T, rel=1e-6)
    assert found.shape == (2, len(names))


def test_permuted_data_have_permuted_residuals(linear):
    w, order = np.array([0.6, 0.95, 1.02, 1.5]), np.array([2, 0, 3, 1])
    one, two = (
        evaluated(linear, {"w": w[which], "max(x)": np.arange(4.0)[which]}, {"max(x)": 0.1})
        for which in (np.arange(4), order)
    )
    assert two.residuals == pytest.approx(one.residuals[order], rel=1e-12)
    assert two.jacobian == pytest.approx(one.jacobian[order], rel=1e-10)


def test_a_phase_is_compared_by_the_shorter_way_round(linear):
    w = np.array([0.8])
    phase = float(np.angle(response(w[0])))
    for rounds in (-2.0, 0.0, 5.0):
        data = {"w": w, "phase(x, 1)": [phase + 0.1 + 2.0 * np.pi * rounds]}
        found = evaluated(linear, data, {"phase(x, 1)": 0.1})
        assert found.residuals == pytest.approx([-1.0], abs=1e-7)


def test_interpolated_residuals_are_near_the_exact_ones_and_solve_no_orbit(linear):
    w = np.linspace(0.6, 1.5, 6)
    found = evaluated(linear, {"w": w, "amplitude(x, 1)": np.abs(response(w))}, {"amplitude(x, 1)": 0.01})
    assert np.abs(found.rough).max() < 15.0  # the peak is 5, or 500 standard errors
    assert not found._known
    assert np.abs(found.residuals).max() < 1e-6
    assert len(found._known) == 6


def test_data_at_one_place_are_solved_once(linear):
    found = evaluated(linear, {"w": [0.8, 0.8, 0.8], "max(x)": [1.0, 2.0, 3.0]}, {"max(x)": 0.5})
    assert found.residuals == pytest.approx((abs(response(0.8)) - np.array([1.0, 2.0, 3.0])) / 0.5, rel=1e-8)
    assert len(found._known) == 1


# sheets and their ends


def test_orbits_decide_where_interpolation_between_points_is_wrong(folded, folds):
    """Of data next to the middle between two sheets, those below belong to the lower one and those above to the other.

    The interpolated middle lies elsewhere at each of these places, by more than the data are away from the exact one.
    """
    w = np.linspace(*folds, 9)[1:-1]
    stable = np.array([sorted(orbit.max["x"] for orbit in folded.at(place) if orbit.stable) for place in w])
    middle = stable.mean(axis=1)
    data = {"w": np.repeat(w, 2), "max(x)": (middle[:, None] + [-1e-6, 1e-6]).ravel()}
    found = evaluated(folded, data, {"max(x)": 1.0})
    near = np.abs(data["max(x)"][:, None] - np.repeat(stable, 2, axis=0)).min(axis=1)
    assert np.abs(found.residuals) == pytest.approx(near, abs=1e-9)
    assert np.count_nonzero(np.abs(np.abs(found.rough) - near) > 1e-5) > 7


def test_each_datum_belongs_to_the_nearest_of_two_sheets(folded, folds):
    w = 0.5 * sum(folds)
    stable = sorted(orbit.max["x"] for orbit in folded.at(w) if orbit.stable)
    middle = 0.5 * sum(stable)
    data = {"w": [w] * 4, "max(x)": [stable[0], middle - 0.01, middle + 0.01, stable[1]]}
    found = evaluated(folded, data, {"max(x)": 0.1})
    sheets, places, sides = found.assigned
    assert sheets[0] == sheets[1] != sheets[2] == sheets[3]
    assert places.tolist() == [w] * 4
    assert not sides.any()
    half = (middle - stable[0] - 0.01) / 0.1
    assert found.residuals == pytest.approx([0.0, -half, half, 0.0], abs=1e-5)


def test_a_datum_beyond_a_fold_is_compared_with_the_last_orbits_of_its_sheet(folded, folds):
    high = folds[1]
    upper = max(orbit.max["x"] for orbit in folded.at(high - 1e-4))
    found = evaluated(folded, {"w": [high + 0.05], "max(x)": [upper]}, {"max(x)": 0.01}, names=("A",))
    (sheet,), (place,), (side,) = found.assigned
    assert side == 1
    assert high - 1e-3 < place < high
    assert abs(found.residuals[0]) < 5.0
    end = found.sheets[sheet].ends[1]
    assert end.value("w") == high
    whole = found.jacobian[0, 0]
    alone = found._observed(sheet, place, 1, high + 0.05, 0.0)[1][0]
    moved = end.sensitivity(["A"])["w"].to_numpy()[0]
    assert moved > 0.1  # more force, a higher fold
    # the share of the other end in the place is 1e-5 of the sheet's length
    assert whole == pytest.approx((alone[0] + alone[-1] * moved) / 0.01, rel=1e-3)


def test_beyond_the_branch_itself_there_is_no_sheet(linear):
    data = {"w": [0.3, 0.8, 1.9], "max(x)": [1.0, 1.0, 1.0]}
    found = evaluated(linear, data, {"max(x)": 0.1})
    with pytest.raises(ConvergenceError, match=r"stable sheet at w = 0.3.*2 of 3 data lie where no sheet is"):
        _ = found.assigned


def test_a_branch_without_stable_orbits_cannot_be_compared(duffing, folded, folds):
    w = 0.5 * sum(folds)
    middle = next(orbit for orbit in folded.at(w) if not orbit.stable)
    unstable = continue_orbit(middle, "w", (w - 0.05, w + 0.05))
    with pytest.raises(ConvergenceError, match="all orbits of its branches are unstable"):
        evaluated(unstable, {"w": [w], "max(x)": [1.0]}, {"max(x)": 0.1})


# special points


def test_special_points_come_last_and_move_as_they_do(folded, folds):
    low, high = folds
    points = [MeasuredPoint("SN", low + 0.02, 0.01, "down"), MeasuredPoint("SN", high - 0.03, 0.02, "up")]
    found = evaluated(folded, {"w": [1.1], "max(x)": [1.0]}, {"max(x)": 0.1}, points, names=("k", "A"))
    assert found.residuals[1:] == pytest.approx([-2.0, 1.5], rel=1e-6)
    ends = [min(found.special, key=lambda one: one.value("w")), max(found.special, key=lambda one: one.value("w"))]
    slopes = [
        end.sensitivity(["k", "A"])["w"].to_numpy() / point.sigma for end, point in zip(ends, points, strict=True)
    ]
    assert found.jacobian[1:] == pytest.approx(np.array(slopes), rel=1e-9)


@pytest.mark.parametrize(("w", "span"), [([0.7, 1.2], 0.5), ([0.7], 1.0)])
def test_a_special_point_that_the_model_lacks_counts_with_the_range_of_the_data(linear, w, span):
    points = [MeasuredPoint("PD", 1.0, 0.25)]
    found = evaluated(linear, {"w": w, "max(x)": np.ones(len(w))}, {"max(x)": 0.1}, points)
    assert found.special == [None]
    assert found.residuals[-1] == pytest.approx(span / 0.25)
    assert found.jacobian[-1].tolist() == [0.0] * 3


@pytest.fixture(scope="module")
def peaked():
    """Orbits x = A sin(s) in closed form, with a peak, a kink and an output for each mode."""
    field = {"x": "w*A*cos(s) - (x - A*sin(s))"}
    outputs = {
        "peak": "1/(1 + (40*(x - c))**2)", "kink": "Max(x, c*sin(s))", "lower": {"low": "0", "high": "x - b"},
    }  # fmt: skip
    events = [Transition("low", "high", "x - b", 1, name="up"), Transition("high", "low", "x - b", -1, name="down")]
    return HybridSystem(
        ("x",), {"A": 0.8, "w": 1.3, "c": 0.3, "b": 0.2}, {"low": Mode(field), "high": Mode(field)}, events,
        phase=("s", "w"), outputs=outputs,
    )  # fmt: skip


@pytest.mark.parametrize("tolerance", [1e-12, 1e-9, 1e-7, 1e-5])
def test_what_is_compared_with_data_is_what_orbits_are_observed_to_have(peaked, tolerance):
    names = (
        "mean(peak)",
        "max(peak)",
        "amplitude(peak, 2)",
        "mean(kink)",
        "mean(lower)",
        "max(lower)",
        "fraction(high)",
    )
    branch = continue_orbit(find_orbit(peaked, {"A": 0.8}, [0.0], tolerance=tolerance), "A", (0.6, 1.0))
    places = np.array([0.65, 0.75, 0.9])
    data = {"A": places, **dict.fromkeys(names, np.zeros(3))}
    measured = read_measured(data, "A", branch.system, dict.fromkeys(names, 1.0), {}, {})
    found = Evaluation(measured, (branch,), ("c", "b"))
    for i, place in enumerate(places):
        (orbit,) = branch.at(place)
        told = orbit.observe(*names, errors=True)
        for formula, value, slopes in zip(measured.formulas, found.seen[:, i], found.jacobian[i::3], strict=True):
            assert abs(value - told[formula].value) <= told[formula].error, formula
            for k, name in enumerate(("c", "b")):
                assert slopes[k] == pytest.approx(
                    difference(orbit, formula, name), rel=1e-6, abs=difference_error(tolerance)
                )


def difference_error(tolerance: float) -> float:
    """Error of a derivative by differences, and of a peak of width 1/40 by the errors of the states."""
    return 1e-6 + 40.0**2 * 1e2 * tolerance


def difference(orbit, formula: str, name: str) -> float:
    """Derivative by central differences of orbits that are solved at the finest tolerance."""
    step, ends = 1e-5, []
    for side in (1.0, -1.0):
        p = dict(orbit.parameters) | {name: orbit.parameters[name] + side * step}
        guess = [(part.mode, part.transition, part.state, part.duration) for part in orbit.segments]
        ends.append(solve_orbit(orbit.system, p, guess).observe(formula)[formula])
    return (ends[0] - ends[1]) / (2.0 * step)
