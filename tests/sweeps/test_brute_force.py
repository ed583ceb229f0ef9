"""Sweeps against closed forms, orbits and maps; the same result however it is computed; files; the paper's labels."""

from __future__ import annotations

import json
import math
import signal
import threading
import tracemalloc
from dataclasses import asdict

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import saltus
import systems
from oracles.closed_forms import DELAYED, HENON, LOGISTIC, ImpactOrbit, TableJump
from oracles.tapping import Tapping
from saltus import HybridSystem, Mode, Progress, Section, Transition, find_orbit, run_sweep
from saltus.errors import InputError
from saltus.options import Criteria, SweepOptions
from saltus.results import Sweep
from saltus.sweeps import record

AMPLITUDES = np.linspace(0.05, 0.4, 15)
SHORT = {"discard": 300, "keep": 40}
START = TableJump(0.5).after_impact(1.2)
"""A ball that jumps once each period of its table, an attractor at a = 1.2 for e = 0.5."""

LOGISTIC_MAP = saltus.Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"})

PLACE = {"w": 1.1}
"""With w = 1.1 the motion without impacts ends at GR, A = 0.237, that with impacts at SN, A = 0.116."""


@pytest.fixture(scope="module")
def logistic():
    return systems.carried_map(("x",), {"a": 3.2}, LOGISTIC)


@pytest.fixture(scope="module")
def escape():
    """A state that decays where a < 0 and grows beyond all bounds where a > 0."""
    return HybridSystem(("x",), {"a": -1.0}, {"free": Mode({"x": "a*x"})}, phase=("s", "1"), name="escape")


def bounded():
    """Return a decay in a mode that reaches down to x = 2 - b."""
    return HybridSystem(("x",), {"b": 3.0}, {"low": Mode({"x": "-x"}, domain="x - 2 + b")}, phase=("s", "1"))


@pytest.fixture(scope="module")
def both(impact_oscillator) -> Sweep:
    return run_sweep(
        impact_oscillator,
        "A",
        AMPLITUDES,
        parameters=PLACE,
        options=SweepOptions(follow="both", observables=["max(x)"], **SHORT),
    )


# what is found


@pytest.mark.parametrize(
    ("a", "label"),
    [(2.9, "period-1"), (3.2, "period-2"), (3.5, "period-4"), (3.55, "period-8"), (3.83, "period-3"), (4.0, "chaotic")],
)
def test_logistic_map_is_what_it_is_known_to_be(logistic, a, label):
    assert run_sweep(
        logistic, "a", [a], x0=[0.3, 0.0], options=SweepOptions(section="map", **SHORT)
    ).labels.tolist() == [[label]]


@pytest.mark.parametrize("keep", [1, 4, 10])
def test_a_label_does_not_depend_on_how_few_returns_are_kept(logistic, keep):
    values, options = [2.9, 2.998, 3.2, 3.5, 3.55, 3.566, 3.7, 3.83], {"section": "map"}
    few = run_sweep(logistic, "a", values, x0=[0.3, 0.0], options=SweepOptions(keep=keep, **options))
    many = run_sweep(logistic, "a", values, x0=[0.3, 0.0], options=SweepOptions(keep=100, **options))
    assert few.labels.tolist() == many.labels.tolist()
    assert few.labels[0].tolist() == [f"period-{n}" for n in (1, 1, 2, 4, 8, 16)] + ["chaotic", "period-3"]
    np.testing.assert_array_equal(few.points, many.points[:, :, -keep:])


@pytest.mark.parametrize("follow", ["up", "restart"])
def test_a_motion_that_comes_to_rest_where_all_states_are_zero_has_the_period_one(follow):
    system = HybridSystem(("x",), {"a": -1.0}, {"free": Mode({"x": "a*x + x**3"})}, phase=("s", "1"))
    sweep = run_sweep(system, "a", [-3.0, -2.0], x0=[1.1], options=SweepOptions(follow=follow, discard=60, keep=20))
    assert sweep.labels.tolist() == [["period-1", "period-1"]]


def test_rounding_is_measured_by_the_size_along_the_motion():
    """x = sin s passes zero at phase 0, where its error is that of a state of size 1."""
    system = HybridSystem(("x",), {"a": 1.0}, {"free": Mode({"x": "-a*x + a*sin(s) + cos(s)"})}, phase=("s", "1"))
    sweep = run_sweep(system, "a", [1.0, 2.0], options=SweepOptions(tolerance=(1e-6, 1e-12), **SHORT))
    assert sweep.labels.tolist() == [["period-1", "period-1"]]


def test_henon_map_is_chaotic_with_its_exponents():
    henon = systems.carried_map(("x", "y"), {"a": 1.4, "b": 0.3}, HENON)
    sweep = run_sweep(
        henon, "a", [1.4], x0=[0.1, 0.1, 0.0], options=SweepOptions(section="map", exponents=3, discard=100, keep=1000)
    )
    assert sweep.labels[0, 0] == "chaotic"
    assert sweep.exponents[0, 0, 1] == pytest.approx(0.0, abs=1e-9)  # that of the clock
    assert sweep.exponents[0, 0, 0] == pytest.approx(0.4192, abs=max(0.03, sweep.errors[0, 0, 0]))
    assert sweep.exponents[0, 0].sum() == pytest.approx(math.log(0.3), abs=1e-9)


def test_delayed_logistic_map_is_quasi_periodic_beyond_its_torus_bifurcation():
    """At a = 2 + c, with the angle arccos((1 - c) / 2)."""
    c = 0.5
    system = systems.carried_map(("x", "y"), {"a": 2.5, "c": c}, DELAYED)
    start = [0.55, 0.5, 0.0]
    sweep = run_sweep(
        system, "a", [2.0 + c - 0.05, 2.0 + c + 0.005], x0=start, options=SweepOptions(section="map", discard=3000)
    )
    assert sweep.labels.tolist() == [["period-1", "quasi-periodic"]]
    assert sweep.rotations[0, 1] == pytest.approx(math.acos((1.0 - c) / 2.0) / (2.0 * math.pi), abs=1e-3)
    assert abs(sweep.exponents[0, 1, 0]) < 0.01


def test_points_and_exponents_are_those_of_the_orbit(impact_oscillator):
    """Next to PD at A = 4.27, where the multipliers are real; other attractors are near."""
    sweep = run_sweep(
        impact_oscillator,
        "A",
        [4.275, 4.3],
        parameters={"w": 2.2},
        x0=[-1.92, 0.21],
        options=SweepOptions(follow="down", exponents=2, tolerance=(1e-11, 1e-13)),
    )
    orbit = find_orbit(impact_oscillator, {"w": 2.2, "A": 4.275}, sweep.at(4.275).state[:2])
    assert np.all(np.isreal(orbit.multipliers))
    assert sweep.labels[0, 0] == "period-1"
    np.testing.assert_allclose(sweep.points[0, 0], np.tile(orbit.x0, (100, 1)), rtol=1e-8)
    np.testing.assert_allclose(sweep.exponents[0, 0], np.log(np.abs(orbit.multipliers)) / orbit.period, atol=1e-6)


def test_points_before_impacts_have_the_speed_in_closed_form(impact_oscillator):
    sweep = run_sweep(
        impact_oscillator, "A", [1.0], options=SweepOptions(section="impact", quantities=["v", "x - d"], **SHORT)
    )
    np.testing.assert_allclose(sweep.column("v"), ImpactOrbit(w=1.0).speeds(1.0)[1], rtol=1e-6)
    np.testing.assert_allclose(sweep.column("x - d"), 0.0, atol=1e-9)
    assert sweep.return_times[0, 0] == pytest.approx(2.0 * math.pi, rel=1e-9)


@pytest.mark.parametrize(("direction", "sign"), [(1, 1.0), (-1, -1.0)])
def test_points_on_a_section_of_one_s_own_lie_on_it_and_pass_it_its_way(ball_on_table, direction, sign):
    system = HybridSystem.from_definition(ball_on_table.definition() | {"outputs": {"h": "z - a*sin(theta)"}})
    section = Section("h - 0.5", direction=direction)
    quantities = ["h", "v - a*w*cos(theta)"]
    sweep = run_sweep(
        system, "a", [1.2], x0=START, options=SweepOptions(section=section, quantities=quantities, **SHORT)
    )
    np.testing.assert_allclose(sweep.column("h"), 0.5, atol=1e-9)
    assert np.all(sign * sweep.column("v - a*w*cos(theta)") > 0.0)


@pytest.mark.campaign
def test_both_sides_of_a_section_make_two_returns_of_one(ball_on_table):
    sections = (Section("z - 1.8", direction=side) for side in (1, 0))
    one, two = (
        run_sweep(ball_on_table, "a", [1.2], x0=START, options=SweepOptions(section=section, **SHORT))
        for section in sections
    )
    assert (one.periods[0, 0], two.periods[0, 0]) == (1, 2)


def test_observables_are_those_of_the_orbit(impact_oscillator):
    names = ["max(x)", "mean(v**2)", "amplitude(x, 1)", "velocity(impact)"]
    sweep = run_sweep(
        impact_oscillator, "A", [1.0], options=SweepOptions(observables=names, tolerance=(1e-11, 1e-13), **SHORT)
    )
    orbit = find_orbit(impact_oscillator, {"A": 1.0}, [0.0, 0.0])
    expected = orbit.observe(*names)
    for name in names:
        assert sweep.column(name)[0, 0] == pytest.approx(expected[name], rel=1e-7)


# hysteresis


def test_each_direction_keeps_its_attractor_as_far_as_it_reaches(both):
    closed = ImpactOrbit(w=1.1)
    fold, grazing = closed.amplitude(closed.U_fold), closed.A_grazing
    impacts = both.column("max(x)") > 1.0 - 1e-9
    up, down = impacts
    assert both.directions == ("up", "down")
    assert not np.any(up[grazing > AMPLITUDES])
    assert np.all(up[grazing < AMPLITUDES])
    assert np.all(down[fold < AMPLITUDES])
    assert not np.any(down[fold > AMPLITUDES])


def test_both_is_up_and_down_each_on_its_own(impact_oscillator, both):
    for row, direction in enumerate(both.directions):
        alone = run_sweep(
            impact_oscillator, "A", AMPLITUDES, parameters=PLACE, options=SweepOptions(follow=direction, **SHORT)
        )
        np.testing.assert_array_equal(alone.points[0], both.points[row])
        assert alone.labels[0].tolist() == both.labels[row].tolist()


def test_restart_begins_every_value_at_the_start(impact_oscillator):
    whole = run_sweep(
        impact_oscillator, "A", AMPLITUDES, parameters=PLACE, options=SweepOptions(follow="restart", **SHORT)
    )
    for k in (0, 7):
        alone = run_sweep(
            impact_oscillator, "A", AMPLITUDES[k : k + 1], parameters=PLACE, options=SweepOptions(**SHORT)
        )
        np.testing.assert_array_equal(alone.points[0, 0], whole.points[0, k])


def test_chunks_are_sweeps_of_their_own(impact_oscillator):
    whole = run_sweep(impact_oscillator, "A", AMPLITUDES, parameters=PLACE, options=SweepOptions(chunks=3, **SHORT))
    parts = [
        run_sweep(impact_oscillator, "A", part, parameters=PLACE, options=SweepOptions(**SHORT))
        for part in np.split(AMPLITUDES, 3)
    ]
    np.testing.assert_array_equal(whole.points, np.concatenate([part.points for part in parts], axis=1))


def test_an_unstable_orbit_on_which_the_motion_rests_is_left(logistic):
    """0 is a fixed point of the map, and unstable above 1; the attractor has the period 2."""
    sweep = run_sweep(logistic, "a", [3.2], x0=[0.0, 0.0], options=SweepOptions(section="map", **SHORT))
    assert sweep.labels[0, 0] == "period-2"
    a = 3.2
    root = math.sqrt((a - 3.0) * (a + 1.0))
    expected = [(a + 1.0 - root) / (2.0 * a), (a + 1.0 + root) / (2.0 * a)]
    np.testing.assert_allclose(np.sort(sweep.points[0, 0, -2:, 0]), expected, rtol=1e-9)


# no motion


@pytest.mark.parametrize("lanes", [False, True])
@pytest.mark.parametrize("tangled", [False, True])
def test_a_motion_diverges_where_it_passes_the_limit(lanes, tangled):
    # x = A/sqrt(2) cos(s - pi/4) at rest: 70.7 at A = 100, 0.707 at A = 1
    rate = "-x + A*cos(s)" + (" + 0*abs(x)**1.5" if tangled else "")
    driven = HybridSystem(("x",), {"A": 1.0}, {"free": Mode({"x": rate})}, phase=("s", "1"))
    options = {"follow": "restart", "discard": 20, "keep": 5, "lanes": lanes}
    free = run_sweep(driven, "A", [1.0, 100.0], options=SweepOptions(**options))
    assert free.labels.tolist() == [["period-1", "period-1"]]
    bounded = run_sweep(driven, "A", [1.0, 100.0], options=SweepOptions(limit=10.0, **options))
    assert bounded.labels.tolist() == [["period-1", "diverged"]]
    assert bounded.reasons[0, 1].startswith("the trajectory diverges at t = ")
    assert "a state passes 10" in bounded.reasons[0, 1]
    np.testing.assert_allclose(bounded.points[0, 0], free.points[0, 0], rtol=1e-6)


@pytest.mark.parametrize("limit", [None, 1e14])
def test_what_is_large_is_no_divergence(limit):
    crowd = HybridSystem(("n",), {"K": 3e13}, {"free": Mode({"n": "n*(1 - n/K) - 0*n*cos(s)"})}, phase=("s", "1"))
    options = SweepOptions(discard=20, keep=5, limit=limit)
    sweep = run_sweep(crowd, "K", [3e13], x0=[1e10], options=options)
    assert sweep.labels.tolist() == [["period-1"]]
    np.testing.assert_allclose(sweep.points[0, 0], 3e13, rtol=1e-6)


def test_a_limit_is_above_zero_and_no_matter_of_maps():
    with pytest.raises(InputError, match=r"SweepOptions.limit = 0: must be"):
        SweepOptions(limit=0)
    logistic = saltus.Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"})
    with pytest.raises(InputError, match=r"SweepOptions.limit = 5.0: must be left out for a map"):
        run_sweep(logistic, "r", [3.2], x0=[0.3], options=SweepOptions(limit=5.0))


def test_a_value_that_diverges_is_a_row_and_the_others_go_on(escape):
    sweep = run_sweep(
        escape, "a", [-1.0, -0.5, 0.5, 1.0], x0=[1.0], options=SweepOptions(follow="down", discard=10, keep=5)
    )
    assert sweep.labels.tolist() == [["period-1", "period-1", "diverged", "diverged"]]
    assert np.all(np.isnan(sweep.points[0, 2:]))
    assert np.all(np.isfinite(sweep.points[0, :2]))
    assert sweep.reasons[0, 3].startswith("the trajectory diverges at t = ")
    assert sweep.stopped == "all 4 values done"
    assert sweep.at(1.0).mode == ""


def test_a_chattering_value_is_a_row_with_its_reason(ball):
    sweep = run_sweep(
        ball,
        "e",
        [0.5, 1.0],
        x0=[1.0, 0.0],
        options=SweepOptions(section="impact", discard=10, keep=30, follow="restart"),
    )
    assert sweep.labels.tolist() == [["chattering", "period-1"]]
    assert sweep.reasons[0, 0].startswith("chattering: ")


def test_a_motion_that_stays_away_from_the_section_is_told(impact_oscillator):
    """Below GR nothing is hit."""
    sweep = run_sweep(
        impact_oscillator,
        "A",
        [0.1, 1.0],
        options=SweepOptions(section="impact", discard=5, keep=4),
        parameters={"w": 1.1},
    )
    assert sweep.labels[0, 0] == "no return"
    assert sweep.labels[0, 1] == "period-1"


def test_returns_that_stay_away_are_waited_for_in_units_of_the_mean_one():
    """One each thousandth, until t = 0.05; then none."""
    fields = {"carry": Mode({"s": "a", "t": "1"}), "rest": Mode({"s": "0", "t": "1"})}
    transitions = [
        Transition("carry", "carry", "s - 1", 1, {"s": "0"}, name="map"),
        Transition("carry", "rest", "t - 0.0505", 1, name="stop"),
    ]
    system = HybridSystem(("s", "t"), {"a": 1000.0}, fields, transitions)
    sweep = run_sweep(system, "a", [1000.0], options=SweepOptions(section="map", **SHORT))
    assert sweep.labels.tolist() == [["no return"]]
    assert 1e-3 < (sweep.states[0, 0, 1] - 0.05) / Criteria().absence < 1e-2


@pytest.mark.parametrize("follow", ["up", "down", "restart"])
@pytest.mark.parametrize("mode", [None, "low"])
def test_a_value_at_which_nothing_can_start_is_a_row_with_its_reason(follow, mode):
    sweep = run_sweep(bounded(), "b", [1.0, 3.0], x0=[0.0], options=SweepOptions(mode=mode, follow=follow, **SHORT))
    assert sweep.labels.tolist() == [["diverged", "period-1"]]
    assert sweep.reasons[0, 0].startswith("x0 = [0.0, 0.0]: must be in the domain of ")


@pytest.mark.parametrize("lanes", [False, True])
def test_a_value_at_which_the_phase_stands_still_is_a_row_with_its_reason(lanes):
    driven = HybridSystem.smooth({"x": "cos(s) - x"}, {"w": 1.0}, phase=("s", "w"))
    options = SweepOptions(follow="restart", lanes=lanes, **SHORT)
    sweep = run_sweep(driven, "w", [-1.0, 0.0, 1.0, 2.0], x0=[0.1], options=options)
    assert sweep.labels.tolist() == [["diverged", "diverged", "period-1", "period-1"]]
    assert [*sweep.reasons[0]] == [f"rate of the phase s = {w}: must be > 0 and finite" for w in (-1.0, 0.0)] + [""] * 2
    at_zero = 1.0 / (1.0 + sweep.values[2:] ** 2)  # x = Re exp(i s)/(1 + i w)
    assert sweep.points[0, 2:, -1, 0] == pytest.approx(at_zero, rel=1e-8)


def test_a_sweep_that_no_value_admits_tells_where_and_why():
    driven = HybridSystem.smooth({"x": "cos(s) - x"}, {"w": 1.0}, phase=("s", "w"))
    told = "rate of the phase s = -2.0: must be > 0 and finite; at w = -2, and no other value admits the start"
    with pytest.raises(saltus.SaltusError, match=told):
        run_sweep(driven, "w", [-2.0, -1.0], x0=[0.1])


def test_a_quantity_without_a_value_is_told_with_the_values_of_the_parameter():
    r = [2.0, 2.4, 2.5, 2.8, 2.9]  # the motion settles at x = 1 - 1/r
    logarithms = ("log(min(x) - 0.59)", "max(log(x - 0.55))", "log(min(x))")
    options = SweepOptions(quantities=("1/(x - x)", "x"), observables=logarithms, **SHORT)
    with pytest.warns(RuntimeWarning) as told:
        sweep = run_sweep(LOGISTIC_MAP, "r", r, x0=[0.3], options=options)
    listed = "has no finite value at r ="
    assert [str(one.message) for one in told] == [
        f"saltus: '1/(x - x)' {listed} 2, 2.4, 2.5 and 2 more, of 5 values",
        f"saltus: 'log(min(x) - 0.59)' {listed} 2, 2.4, of 5 values",
        f"saltus: 'max(log(x - 0.55))' {listed} 2, of 5 values",
    ]
    assert [*sweep.observed[0, :, 2]] == pytest.approx([math.log(1.0 - 1.0 / a) for a in r], rel=1e-6)


def test_an_event_that_does_not_happen_is_no_gap(impact_oscillator):
    seen = f"velocity({impact_oscillator.transition_names[0]})"
    options = SweepOptions(observables=(seen,), **SHORT)
    sweep = run_sweep(impact_oscillator, "A", [0.05], parameters=PLACE, options=options)
    assert sweep.labels.tolist() == [["period-1"]]
    assert np.isnan(sweep.observed).all()


def test_a_start_on_the_section_is_a_start(logistic):
    sweep = run_sweep(logistic, "a", [3.2], x0=[0.3, 1.0], options=SweepOptions(section="map", discard=0, keep=1))
    assert sweep.labels.tolist() == [["period-2"]]
    assert sweep.return_times[0, 0] == pytest.approx(1.0)


# how it is computed


def test_threads_compute_the_same(impact_oscillator):
    one, two = (
        run_sweep(
            impact_oscillator,
            "A",
            AMPLITUDES,
            parameters=PLACE,
            options=SweepOptions(follow="both", workers=workers, **SHORT),
        )
        for workers in (1, 2)
    )
    assert one == two


@pytest.mark.campaign
def test_a_dask_cluster_computes_the_same(impact_oscillator, both):
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(n_workers=1, threads_per_worker=2, processes=False, dashboard_address=":0")
    with cluster, distributed.Client(cluster, set_as_default=False) as client:
        found = run_sweep(
            impact_oscillator,
            "A",
            AMPLITUDES,
            parameters=PLACE,
            options=SweepOptions(follow="both", observables=["max(x)"], client=client, **SHORT),
        )
    assert found == both


@pytest.mark.campaign
def test_other_processes_compute_the_same(impact_oscillator, both):
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=True, dashboard_address=":0")
    with cluster, distributed.Client(cluster, set_as_default=False) as client:
        found = run_sweep(
            impact_oscillator,
            "A",
            AMPLITUDES,
            parameters=PLACE,
            options=SweepOptions(follow="both", observables=["max(x)"], client=client, **SHORT),
        )
    assert found == both


def test_what_is_dropped_takes_no_memory(impact_oscillator):
    peaks = []
    run_sweep(impact_oscillator, "A", [1.0], options=SweepOptions(discard=10, keep=10))
    for discard in (100, 10_000):
        tracemalloc.start()
        run_sweep(impact_oscillator, "A", [1.0], options=SweepOptions(discard=discard, keep=10, workers=1))
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
    assert peaks[1] < 1.5 * peaks[0]


def test_progress_counts_the_values_and_tells_what_is_left(impact_oscillator):
    told = []
    run_sweep(impact_oscillator, "A", [0.8, 0.9], options=SweepOptions(workers=1, **SHORT), progress=told.append)
    assert [(item.done, item.total) for item in told] == [(1, 2), (2, 2)]
    assert [item.text for item in told] == ["A = 0.8 up: period-1", "A = 0.9 up: period-1"]
    assert told[1].left == 0.0


def test_a_bar_tells_what_has_been_done(impact_oscillator, capsys):
    run_sweep(impact_oscillator, "A", [0.8, 0.9], progress=True, options=SweepOptions(**SHORT))
    out, err = capsys.readouterr()
    assert not out
    assert "100.0 %" in err
    assert "A = 0.9 up: period-1" in err


# interrupts and files


class Interrupt:
    """Presses Ctrl-C after so many values."""

    def __init__(self, after: int) -> None:
        self.after = after

    def __call__(self, progress: Progress) -> None:
        if progress.done >= self.after:
            raise KeyboardInterrupt


class InterruptedWrite(np.ndarray):
    """An array in which a signal arrives just behind the third entry that is written."""

    written = 0

    def __setitem__(self, place, value):
        super().__setitem__(place, value)
        InterruptedWrite.written += 1
        if InterruptedWrite.written == 3:
            signal.raise_signal(signal.SIGINT)


@pytest.mark.parametrize("name", ["modes", "reasons", "points", "labels"])
def test_an_interrupt_while_a_value_is_written_leaves_a_whole_one(tmp_path, monkeypatch, name):
    def begun(*arguments):
        made = original(*arguments)
        made.sweep[name] = made.sweep[name].view(InterruptedWrite)
        return made

    original = record.Record.begun
    monkeypatch.setattr(record.Record, "begun", begun)
    monkeypatch.setattr(InterruptedWrite, "written", 0)
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        part = run_sweep(LOGISTIC_MAP, "r", np.linspace(3.0, 3.9, 8), x0=[0.3], path=tmp_path / "a.nc")
    finally:
        signal.signal(signal.SIGINT, before)
    assert part.stopped == "interrupted: 3 of 8 values done"
    assert saltus.load(tmp_path / "a.nc") == part


@pytest.mark.parametrize("workers", [1, 2])
def test_an_interrupted_sweep_keeps_what_is_done_and_goes_on_from_its_file(impact_oscillator, both, tmp_path, workers):
    options = {"follow": "both", "observables": ["max(x)"], "workers": workers}
    part = run_sweep(
        impact_oscillator,
        "A",
        AMPLITUDES,
        progress=Interrupt(7),
        parameters=PLACE,
        options=SweepOptions(**options, **SHORT),
        path=tmp_path / "a.nc",
    )
    assert part.stopped == "interrupted: 7 of 30 values done"
    assert part.done.sum() == 7
    np.testing.assert_array_equal(part.points[part.done], both.points[part.done])
    assert np.all(np.isnan(part.points[~part.done]))
    assert saltus.load(tmp_path / "a.nc") == part
    told = []
    whole = run_sweep(
        impact_oscillator,
        "A",
        AMPLITUDES,
        progress=told.append,
        parameters=PLACE,
        options=SweepOptions(**options, **SHORT),
        path=tmp_path / "a.nc",
    )
    assert whole == both
    assert len(told) == 23
    assert [path.name for path in tmp_path.iterdir()] == ["a.nc"]


@pytest.mark.campaign
def test_whatever_ends_a_sweep_early_what_is_done_is_saved(impact_oscillator, both, tmp_path):
    def fail(progress):
        if progress.done == 3:
            raise RuntimeError("the lamp went out")

    options = {
        "parameters": PLACE,
        "options": SweepOptions(follow="both", observables=["max(x)"], **SHORT),
        "path": tmp_path / "a.nc",
    }
    with pytest.raises(RuntimeError, match=r"^the lamp went out$"):
        run_sweep(impact_oscillator, "A", AMPLITUDES, progress=fail, **options)
    assert saltus.load(tmp_path / "a.nc").done.sum() == 3
    told = []
    assert run_sweep(impact_oscillator, "A", AMPLITUDES, progress=told.append, **options) == both
    assert len(told) == 27


def test_numbers_of_numpy_are_saved_as_plain_ones(impact_oscillator, tmp_path):
    plain = {"discard": 60, "keep": 20, "exponents": 1, "chunks": 1, "tolerance": (0.5**20, 0.5**30)}
    given = {name: np.int64(value) for name, value in plain.items() if isinstance(value, int)}
    given["tolerance"] = tuple(np.float32(value) for value in plain["tolerance"])
    sections = (Section("x", direction=side) for side in (-1, np.int64(-1)))
    one, two = (
        run_sweep(impact_oscillator, "A", [0.5], options=SweepOptions(workers=np.int64(1), section=section, **options))
        for section, options in zip(sections, (plain, given), strict=True)
    )
    assert saltus.load(two.save(tmp_path / "a.nc")) == one


def test_a_finished_file_is_given_back_without_computing(impact_oscillator, tmp_path):
    path = tmp_path / "a.nc"
    first = run_sweep(impact_oscillator, "A", [0.8, 0.9], path=path, options=SweepOptions(**SHORT))
    written = path.stat().st_mtime_ns
    assert (
        run_sweep(impact_oscillator, "A", [0.8, 0.9], path=path, progress=Interrupt(0), options=SweepOptions(**SHORT))
        == first
    )
    assert path.stat().st_mtime_ns == written


def test_a_cluster_that_is_interrupted_keeps_what_is_done(impact_oscillator, both):
    distributed = pytest.importorskip("distributed")
    cluster = distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0")
    with cluster, distributed.Client(cluster, set_as_default=False) as client:
        part = run_sweep(
            impact_oscillator,
            "A",
            AMPLITUDES,
            parameters=PLACE,
            options=SweepOptions(client=client, **SHORT),
            progress=Interrupt(3),
        )
    assert part.done[0].tolist() == [True] * 3 + [False] * 12
    np.testing.assert_array_equal(part.points[0, :3], both.points[0, :3])


def test_threads_are_gone_after_an_interrupt(impact_oscillator):
    run_sweep(
        impact_oscillator,
        "A",
        AMPLITUDES,
        parameters=PLACE,
        options=SweepOptions(follow="restart", workers=2, **SHORT),
        progress=Interrupt(2),
    )
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("sweep")]


def test_a_saved_sweep_is_read_back_equal(both, tmp_path):
    again = saltus.load(both.save(tmp_path / "both.nc"))
    assert isinstance(again, Sweep)
    assert again == both
    assert again.settings == both.settings


def test_the_dataset_names_its_dimensions_and_thresholds(both):
    dataset = both.to_xarray()
    assert dict(dataset.sizes) == {
        "direction": 2, "value": 15, "kept": 40, "quantity": 2, "exponent": 1, "observable": 1, "state": 3,
    }  # fmt: skip
    chosen = dataset.sel(direction="down", quantity="v").sel(value=0.2, method="nearest")
    np.testing.assert_array_equal(chosen["points"], both.at(0.2, "down").points["v"])
    assert {name: dataset.attrs[f"criteria_{name}"] for name in asdict(Criteria())} == asdict(Criteria())
    assert json.loads(dataset.attrs["settings"])["discard"] == 300


# the result


def test_a_value_tells_what_to_go_on_with(impact_oscillator, both):
    found = both.at(0.4, "up")
    assert found.parameters["A"] == 0.4
    assert (found.label, found.mode) == ("period-1", "free")
    later = saltus.simulate(impact_oscillator, found.parameters, found.state, mode=found.mode, periods=3)
    np.testing.assert_allclose(later.x_end[:2], found.state[:2], atol=1e-5)


def test_the_text_of_a_sweep_names_runs_of_labels(logistic):
    sweep = run_sweep(
        logistic,
        "a",
        [2.9, 3.2, 3.3, 3.5],
        x0=[0.3, 0.0],
        options=SweepOptions(section="map", quantities=["x"], **SHORT),
    )
    assert repr(sweep).splitlines() == [
        "Sweep of carried map: a from 2.9 to 3.5, 4 values, up",
        "  300 returns to map dropped, 40 kept: x",
        "  up      2.9                      period-1",
        "  up      3.2 to 3.3               period-2",
        "  up      3.5                      period-4",
        "  all 4 values done",
    ]


# the paper


PAPER = {1.0: "period-2", 1.02: "period-4", 1.023: "chaotic"}
"""ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Figs. 7(b) to 7(e) and section 4.2."""


@pytest.mark.campaign
def test_labels_of_figure_7b_are_the_paper_s(afm2):
    sweep = run_sweep(afm2, "Omega", np.linspace(0.995, 1.05, 300), options=SweepOptions(discard=600, keep=100))
    assert {omega: sweep.at(omega).label for omega in PAPER} == PAPER
    # in print it is quasi-periodic; the nearest value, 1.045953..., is beyond the period doubling at 1.04597
    assert sweep.at(1.046).label == "locked-20"


@pytest.mark.campaign
def test_the_motion_that_is_quasi_periodic_in_print_recurs_after_ten_periods_by_scipy():
    """At Omega = 1.046, from near its last point: differences after 10 periods fall by the multiplier."""
    points = [np.array([-0.8727, -0.0149, 0.6113, -0.4128])]
    for _ in range(120):
        points.append(Tapping(2, 1.046).map(points[-1], 1e-11)[0])
    x = np.array(points)
    apart = np.linalg.norm(x[10:] - x[:-10], axis=1)
    assert apart[100] / apart[90] == pytest.approx(0.757574829, abs=2e-3)
    assert min(np.linalg.norm(x[-n:] - x[-2 * n : -n], axis=1).max() for n in range(1, 10)) > 0.1


def firing_rotation(current: float, amplitude: float, count: int = 4000) -> float:
    """Spikes per period of V' = I - V + A cos(2 pi t) with the reset V = 1 to 0, by its closed form between spikes."""
    w = 2.0 * math.pi

    def forced(t: float) -> float:
        return current + amplitude * (math.cos(w * t) + w * math.sin(w * t)) / (1.0 + w * w)

    t = 0.0
    for _ in range(count):
        start = forced(t)
        t += brentq(lambda s, t=t, start=start: forced(t + s) - start * math.exp(-s) - 1.0, 1e-3, 50.0, xtol=1e-13)
    return count / t


@pytest.mark.campaign
def test_a_quasi_periodic_firing_pattern_is_no_chaos_and_has_its_rotation_number():
    """The firing map is an invertible circle map: its exponent is 0 at most."""
    spike = Transition("rest", "rest", "V - 1", 1, {"V": "0"}, name="spike")
    modes = {"rest": Mode({"V": "I - V + A*cos(th)"})}
    neuron = HybridSystem(("V",), {"I": 1.45, "A": 0.3}, modes, [spike], phase=("th", "2*pi"))
    values = [1.45, 1.5, 1.51, 1.52]
    sweep = run_sweep(neuron, "I", values, x0=[0.1])
    assert sweep.labels.tolist() == [["quasi-periodic"] * 4]
    for current, rotation in zip(values, sweep.rotations[0], strict=True):
        turns = firing_rotation(current, 0.3) % 1.0
        assert rotation == pytest.approx(min(turns, 1.0 - turns), abs=2e-3)


def test_a_population_that_was_nearly_lost_comes_back_and_never_turns_negative() -> None:
    """A predator invades where its prey suffices; the state in logarithms, by SciPy, says where it settles."""
    parameters = {"m": 4.0, "K": 0.3, "f": 0.9, "S0": 3.0, "n": 3.0, "L": 0.3, "w": 2.0 * math.pi}
    chain = {"S": "-m*S/(K + S)*x", "x": "m*S/(K + S)*x - n*x/(L + x)*y", "y": "n*x/(L + x)*y"}
    dose = saltus.Transition(
        "grow", "grow", at_phase=0, reset={"S": "S*(1 - f) + f*S0", "x": "(1 - f)*x", "y": "(1 - f)*y"}, name="dose"
    )
    system = saltus.HybridSystem(("S", "x", "y"), parameters, {"grow": saltus.Mode(chain)}, [dose], phase=("th", "w"))
    options = saltus.options.SweepOptions(follow="down")
    found = saltus.run_sweep(system, "f", [0.9, 0.95], x0=[1.0, 0.1, 0.1], options=options)
    assert found.labels.tolist() == [["period-1", "period-1"]]

    def step(z: np.ndarray) -> np.ndarray:
        def field(t: float, z: np.ndarray) -> list[float]:
            S, x, y = z[0], math.exp(z[1]), math.exp(z[2])
            eaten, taken = 4.0 * S / (0.3 + S), 3.0 / (0.3 + x)
            return [-eaten * x, eaten - taken * y, taken * x]

        end = solve_ivp(field, (0.0, 1.0), z, method="LSODA", rtol=1e-10, atol=1e-12).y[:, -1]
        return np.array([end[0] * 0.1 + 2.7, end[1] + math.log(0.1), end[2] + math.log(0.1)])

    state = found.at(0.9).state[:3]  # before a dose
    assert np.all(state >= 0.0)
    after = np.array([state[0] * 0.1 + 2.7, *(np.log(state[1:]) + math.log(0.1))])
    np.testing.assert_allclose(step(after), after, rtol=1e-6)
