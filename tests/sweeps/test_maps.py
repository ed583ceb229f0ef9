"""Exponents and brute-force diagrams of maps against closed forms and numbers in print."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from discrete import HENON, LOGISTIC, TENT, tent_of
from saltus import Average, InputError, Map, Piece, lyapunov_spectrum, run_sweep
from saltus.errors import DefinitionError
from saltus.options import SweepOptions
from saltus.system.angles import TURN
from selection import guarding


def test_the_logistic_map_at_four_has_the_exponent_ln_2():
    found = lyapunov_spectrum(LOGISTIC, {"r": 4.0}, [0.3], average=Average(periods=1_000_000))
    assert found.exponents[0] == pytest.approx(math.log(2.0), abs=5e-5)
    assert abs(found.exponents[0] - math.log(2.0)) < 3 * found.errors[0]


@pytest.mark.parametrize("slope", [1.1, 1.5, 1.9])
def test_the_tent_map_has_the_logarithm_of_its_slope(slope):
    found = lyapunov_spectrum(TENT, {"a": slope}, [0.3], average=Average(periods=10_000))
    assert found.exponents[0] == pytest.approx(math.log(slope), rel=1e-13)


@pytest.mark.parametrize("c", [0.2, 0.5, 0.7])
def test_the_skew_tent_map_has_the_entropy_of_its_two_slopes(c):
    # it keeps lengths of intervals: a part c of the states is left of c
    skew = Map(
        ("x",),
        {"c": c},
        pieces={"left": Piece({"x": "x/c"}, "c - x"), "right": Piece({"x": "(1 - x)/(1 - c)"}, "x - c")},
    )
    found = lyapunov_spectrum(skew, {}, [0.1234], average=Average(periods=400_000))
    assert found.exponents[0] == pytest.approx(-c * math.log(c) - (1 - c) * math.log(1 - c), abs=5e-3)


@pytest.mark.campaign
def test_the_henon_map_has_the_exponents_in_print():
    # J. C. Sprott, Chaos and Time-Series Analysis, 2003: 0.41922, and a dimension of 1.25827
    found = lyapunov_spectrum(HENON, {}, [0.1, 0.1], average=Average(periods=3_000_000))
    assert found.exponents[0] == pytest.approx(0.41922, abs=3e-4)
    assert found.sum == pytest.approx(math.log(0.3), abs=1e-12)
    assert found.kaplan_yorke == pytest.approx(1.25827, abs=5e-4)
    assert found.errors[0] < 1e-3
    assert found.per_period == pytest.approx(found.exponents)


def test_a_direction_that_a_map_removes_has_no_exponent():
    found = lyapunov_spectrum(HENON, {"b": 0.0}, [0.3, 0.0], average=Average(periods=1000))
    assert found.exponents[1] == -math.inf
    assert np.isfinite(found.exponents[0])


def test_a_map_in_billionths_has_the_same_exponents():
    small = Map(("x", "y"), {"a": 1.4, "b": 0.3}, {"x": "1e-9 - a*1e9*x**2 + y", "y": "b*x"})
    one = lyapunov_spectrum(HENON, {}, [0.1, 0.1], average=Average(periods=100_000))
    other = lyapunov_spectrum(small, {}, [0.1e-9, 0.1e-9], average=Average(periods=100_000))
    assert other.sum == pytest.approx(math.log(0.3), abs=1e-12)
    assert abs(one.exponents[0] - other.exponents[0]) < one.errors[0] + other.errors[0]


def test_a_spectrum_of_a_map_counts_iterations(tmp_path):
    found = lyapunov_spectrum(HENON, {}, [0.1, 0.1], average=Average(periods=1000, discard=100))
    assert (found.times[-1], found.discarded, found.mode_end) == (1000.0, 100.0, "map")
    assert "over 1000 iterations, after 100 discarded" in repr(found)
    assert found.plot().get_xlabel() == "iterations"
    assert saltus.load(found.save(tmp_path / "henon.nc")) == found
    assert found.to_xarray()["exponent"].attrs["unit"] == "1 / iteration"


GOLDEN = math.pi * (math.sqrt(5.0) - 1.0)
ROTATION = Map(("t",), {"o": GOLDEN}, {"t": "t + o"}, angles=("t",))
FORCED = Map(("x", "t"), {"s": 0.9, "o": GOLDEN}, {"x": "2*s*tanh(x)*cos(t)", "t": "t + o"}, angles=("t",))
CIRCLE = Map(("x",), {"w": 2.0, "K": 0.9}, {"x": "x + w + K*sin(x)"}, angles=("x",))
NEIMARK = Map(  # its circle has the radius sqrt(10*(r - 1)) and turns by o
    ("x", "y"),
    {"r": 1.05, "o": 2.0},
    {
        "x": "r*(cos(o)*x - sin(o)*y)/(1 + 0.1*(x**2 + y**2))",
        "y": "r*(sin(o)*x + cos(o)*y)/(1 + 0.1*(x**2 + y**2))",
    },
)


@pytest.mark.parametrize(
    ("system", "rotation"),
    [(ROTATION, (3.0 - math.sqrt(5.0)) / 2.0), (FORCED, (3.0 - math.sqrt(5.0)) / 2.0), (CIRCLE, None),
     (NEIMARK, 1.0 / math.pi)],
)  # fmt: skip
@pytest.mark.parametrize(
    ("keep", "discard"), guarding([(100, 600), (1000, 600), (5000, 600), (5000, 20_000), (20_000, 600)], (5000, 600))
)
def test_a_torus_keeps_its_label_however_many_iterates_are_kept(system, rotation, keep, discard):
    parameter, start = system.parameter_names[0], [0.3, 0.1][: len(system.states)]
    options = SweepOptions(keep=keep, discard=discard)
    sweep = run_sweep(system, parameter, [system.parameters[parameter]], x0=start, options=options)
    assert sweep.labels[0, 0] == "quasi-periodic"
    if rotation is not None:
        assert sweep.rotations[0, 0] == pytest.approx(rotation, abs=1e-4)


QUASI_FORCED = Map(
    ("x", "t"), {"a": 3.35, "e": 0.1, "o": GOLDEN}, {"x": "a*x*(1 - x) + e*cos(t)", "t": "t + o"}, angles=("t",)
)


def exponent_of_the_forced_logistic_map(a, start, count=400_000):
    """Mean logarithm of the derivative along its own iterates, from many phases side by side."""
    t = start[1] + TURN * np.arange(400.0) / 400.0
    x, total = np.full(t.size, start[0]), 0.0
    for i in range(-1000, count // t.size * 10):
        if i >= 0:
            total += float(np.log(np.abs(a * (1.0 - 2.0 * x))).mean())
        x, t = a * x * (1.0 - x) + 0.1 * np.cos(t), t + GOLDEN
    return total / (count // t.size * 10)


@pytest.mark.parametrize("keep", guarding([100, 200, 500, 2000], 100, 500))
def test_no_label_of_a_quasi_periodically_forced_map_contradicts_the_truth(keep):
    values = [3.32, 3.33, 3.34, 3.345, 3.35, 3.355, 3.36]
    options = SweepOptions(follow="restart", keep=keep)
    sweep = run_sweep(QUASI_FORCED, "a", values, x0=[0.4, 0.1], options=options)
    for value, label in zip(values, sweep.labels[0].tolist(), strict=True):
        truth = exponent_of_the_forced_logistic_map(value, (0.4, 0.1))
        if label == "chaotic":
            assert truth > 0.003
        elif label == "strange nonchaotic":
            assert truth < 0.001
        else:
            assert label == ("quasi-periodic" if value == 3.32 else "unresolved")
    assert sweep.labels[0].tolist().count("unresolved") <= 2


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"average": Average(t_end=10.0)}, "Average.t_end = 10.0: must be left out for a map; periods counts"),
        ({"mode": "map"}, "mode = 'map': must be left out for a map"),
        ({"exponents": 3}, "exponents = 3"),
        ({"x0": [0.1]}, "x0"),
    ],
)
def test_wrong_options_of_exponents_are_told(options, message):
    with pytest.raises(InputError, match=message):
        lyapunov_spectrum(**({"system": HENON, "x0": [0.1, 0.1], "average": Average(periods=100)} | options))


def test_a_motion_that_leaves_has_no_exponents():
    with pytest.raises(saltus.errors.MapDivergenceError, match="diverges at iteration"):
        lyapunov_spectrum(HENON, {}, [3.0, 3.0], average=Average(periods=100))


# brute-force diagrams


def test_doublings_of_the_logistic_map_are_where_they_are_known_to_be():
    # 3, 1 + sqrt 6, and in print 3.54409, 3.56441; the motion settles slowly next to them
    values = [2.9, 3.05, 3.44, 3.46, 3.54, 3.55, 3.562, 3.5655, 3.7]
    sweep = run_sweep(LOGISTIC, "r", values, x0=[0.3], options=SweepOptions(discard=5000))
    periods = ["1", "2", "2", "4", "4", "8", "8", "16"]
    assert sweep.labels[0].tolist() == [*(f"period-{n}" for n in periods), "chaotic"]
    assert (sweep.return_times == 1.0).all()


def test_the_window_of_period_3_begins_at_one_and_the_square_root_of_8():
    edge = 1.0 + math.sqrt(8.0)
    values = [edge - 1e-3, edge - 1e-4, edge + 1e-6, edge + 1e-4, edge + 1e-3]
    sweep = run_sweep(LOGISTIC, "r", values, x0=[0.5], options=SweepOptions(discard=20_000))
    assert sweep.labels[0].tolist() == ["chaotic", "chaotic", "period-3", "period-3", "period-3"]


def test_the_fixed_point_has_the_state_and_the_exponent_of_its_formula():
    sweep = run_sweep(LOGISTIC, "r", [1.5, 2.4, 2.8], x0=[0.3])
    np.testing.assert_allclose(sweep.points[0, :, -1, 0], 1.0 - 1.0 / sweep.values, rtol=1e-12)
    np.testing.assert_allclose(sweep.exponents[0, :, 0], np.log(np.abs(2.0 - sweep.values)), rtol=1e-9)


@pytest.mark.parametrize("period", [2, 3, 4, 5])
def test_cycles_of_the_border_collision_follow_each_other_where_the_formula_says(period):
    # slopes a and b: the cycle with one point on the right exists below the first value and is stable above the second
    a = 0.4
    born = -(1.0 - a ** (period - 1)) / ((1.0 - a) * a ** (period - 2))
    lost = -1.0 / a ** (period - 1)
    pieces = {"left": Piece({"x": "a*x + 1"}, "-x"), "right": Piece({"x": "b*x + 1"}, "x")}
    border = Map(("x",), {"a": a, "b": -1.0}, pieces=pieces)
    values = [1.01 * lost, 0.99 * lost, 0.5 * (born + lost), 1.01 * born, 0.99 * born]
    sweep = run_sweep(
        border, "b", values, x0=[0.1], options=SweepOptions(discard=20_000, observables=["fraction(right)"])
    )
    labels = sweep.labels[0].tolist()
    assert labels[1:4] == [f"period-{period}"] * 3
    assert f"period-{period}" not in (labels[0], labels[4])
    np.testing.assert_allclose(sweep.observed[0, 1:4, 0], 1.0 / period)
    exponents = ((period - 1) * np.log(a) + np.log(-sweep.values[1:4])) / period
    np.testing.assert_allclose(sweep.exponents[0, 1:4, 0], exponents, atol=1e-12)


def test_a_motion_that_starts_on_an_unstable_point_leaves_it():
    sweep = run_sweep(LOGISTIC, "r", [3.2])  # by default from 0
    assert sweep.labels[0].tolist() == ["period-2"]


@pytest.mark.parametrize("follow", ["up", "restart"])
def test_a_motion_that_has_come_to_an_unstable_torus_leaves_it(follow):
    """C. Grebogi, E. Ott, S. Pelikan, J. A. Yorke, Physica D 13 (1984) 261: x = 0 is stable for s < 1 alone."""
    sweep = run_sweep(FORCED, "s", [0.5, 1.5, 2.0], x0=[0.5, 0.3], options=SweepOptions(follow=follow))
    assert sweep.labels[0].tolist() == ["quasi-periodic", "strange nonchaotic", "strange nonchaotic"]
    assert np.abs(sweep.at(1.5).points["x"]).max() > 1.0


def test_a_delayed_map_is_quasi_periodic_behind_its_torus_bifurcation():
    # the delayed logistic map has a Neimark-Sacker bifurcation at r = 2 with rotation number 1/6
    delayed = Map(("x", "y"), {"r": 2.0}, {"x": "r*x*(1 - y)", "y": "x"})
    sweep = run_sweep(delayed, "r", [1.95, 2.02], x0=[0.4, 0.4], options=SweepOptions(discard=5000, keep=400))
    assert sweep.labels[0].tolist() == ["period-1", "quasi-periodic"]
    assert sweep.rotations[0, 1] == pytest.approx(1 / 6, abs=0.01)


def test_a_motion_that_leaves_every_bound_is_diverged_and_the_next_value_starts_anew():
    sweep = run_sweep(HENON, "a", [1.2, 1.45], x0=[0.1, 0.1], options=SweepOptions(follow="both"))
    assert sweep.labels.tolist() == [["chaotic", "diverged"]] * 2
    assert "the motion diverges at iteration" in sweep.reasons[0, 1]


def test_a_gap_at_some_value_ends_a_sweep():
    opened = Map(
        ("x",), {"d": 0.0}, pieces={"low": Piece({"x": "x + 0.3"}, "-x"), "high": Piece({"x": "x/2"}, "x - d")}
    )
    with pytest.raises(DefinitionError, match="none of 'low', 'high' does"):
        run_sweep(opened, "d", [0.0, 0.5], x0=[-1.0])


def test_a_sweep_of_a_map_is_saved_resumed_and_drawn(tmp_path):
    options = SweepOptions(observables=["mean(double)", "fraction(left)"], quantities=["x", "double"])
    path = tmp_path / "tent.nc"
    sweep = run_sweep(tent_of(), "a", [0.8, 1.3, 1.8], x0=[0.3], options=options, path=path)
    assert saltus.load(path) == sweep
    assert run_sweep(tent_of(), "a", [0.8, 1.3, 1.8], x0=[0.3], options=options, path=path) == sweep
    assert sweep.labels[0].tolist() == ["period-1", "chaotic", "chaotic"]
    np.testing.assert_allclose(sweep.exponents[0, :, 0], np.log(sweep.values), rtol=1e-12)
    assert sweep.column("fraction(left)")[0, 0] == 1.0
    assert "600 iterations dropped, 100 kept: x, double" in repr(sweep)
    assert sweep.plot().get_ylabel() == "$x$"
    assert sweep.at(1.8).mode in ("left", "right")


def test_a_map_in_billionths_has_the_same_diagram():
    small = Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - 1e9*x)"})
    values = [0.9, 2.9, 3.2, 3.5, 3.7, 3.84]
    one, other = (run_sweep(m, "r", values, x0=[0.3 * u]) for m, u in ((LOGISTIC, 1.0), (small, 1e-9)))
    assert one.labels.tolist() == other.labels.tolist()
    assert one.labels[0, 0] == "period-1"  # it decays to 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"section": "map"}, "SweepOptions.section = 'map': must be left out for a map"),
        ({"mode": "map"}, "SweepOptions.mode = 'map': must be left out for a map"),
        ({"observables": ["amplitude(x, 1)"]}, "a map has no phase"),
        ({"exponents": 2}, "SweepOptions.exponents = 2"),
    ],
)
def test_wrong_options_of_a_sweep_are_told(options, message):
    with pytest.raises(InputError, match=message):
        run_sweep(LOGISTIC, "r", [3.2], x0=[0.3], options=SweepOptions(**options))
