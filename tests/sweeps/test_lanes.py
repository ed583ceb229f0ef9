"""Sweeps whose motions are followed side by side in lanes: closed forms, and the same as one motion at a time."""

from __future__ import annotations

import math
import signal

import numpy as np
import pytest
from scipy.integrate import quad

import own_states
import saltus
import systems
from oracles.closed_forms import ImpactOrbit
from saltus import HybridSystem, Mode, Section, Transition, run_sweep
from saltus.ensemble.returns import ManyReturns
from saltus.errors import InputError
from saltus.options import SweepOptions
from saltus.sweeps.task import Task

AMPLITUDES = np.linspace(0.05, 0.4, 15)
PLACE = {"w": 1.1}
SHORT = {"discard": 300, "keep": 20}
SIDE_BY_SIDE = {"lanes": True, "follow": "restart", **SHORT}


@pytest.fixture
def followed(monkeypatch) -> list[tuple[int, int]]:
    """Counts of motions handed to lanes, and of those that these have told."""
    counts = []

    def follow(self, starts, skip, keep):
        found = original(self, starts, skip, keep)
        counts.append((len(starts), sum(returns is not None for returns in found)))
        return found

    original = ManyReturns.follow
    monkeypatch.setattr(ManyReturns, "follow", follow)
    return counts


def same(one, other, rtol=1e-6):
    """Compare two sweeps value by value: labels, reasons, and what is measured of periodic motions."""
    assert one.labels.tolist() == other.labels.tolist()
    periodic = np.char.startswith(one.labels.astype(str), "period-")
    for name in ("points", "exponents", "return_times", "observed", "states"):
        a, b = getattr(one, name)[periodic], getattr(other, name)[periodic]
        np.testing.assert_allclose(a, b, rtol=rtol, atol=rtol)
    np.testing.assert_array_equal(one.modes, other.modes)


def test_each_lane_has_a_rate_of_its_own(followed):
    """The amplitude of a forced linear oscillator is that of its frequency response."""
    linear = HybridSystem.smooth({"x": "v", "v": "-x - c*v + cos(s)"}, {"c": 0.3, "w": 1.0}, phase=("s", "w"))
    values = np.linspace(0.4, 2.0, 12)
    sweep = run_sweep(linear, "w", values, options=SweepOptions(**SIDE_BY_SIDE))
    response = 1.0 / (1.0 - values**2 + 0.3j * values)
    np.testing.assert_allclose(sweep.column("x")[0, :, -1], response.real, rtol=1e-6)
    np.testing.assert_allclose(sweep.return_times[0], 2.0 * math.pi / values, rtol=1e-12)
    assert sum(told for _, told in followed) == 12


@pytest.mark.parametrize(("parameter", "values"), [("e", [0.7, 0.75, 0.8]), ("d", [0.9, 1.0, 1.1]), ("w", [1.0, 1.05])])
def test_each_lane_has_parameters_of_its_own_in_field_event_and_reset(impact_oscillator, followed, parameter, values):
    options = SweepOptions(section="impact", quantities=["v"], **SIDE_BY_SIDE)
    sweep = run_sweep(impact_oscillator, parameter, values, x0=[0.0, 0.0], options=options)
    for speeds, value in zip(sweep.column("v")[0], values, strict=True):
        np.testing.assert_allclose(speeds, ImpactOrbit(**{"w": 1.0, parameter: value}).speeds(1.0)[1], rtol=1e-6)
    assert sum(told for _, told in followed) == len(values)


@pytest.mark.campaign
def test_a_system_without_a_phase_has_its_limit_cycle(followed):
    """The normal form of a Hopf bifurcation: a circle of radius sqrt(mu), round which it goes at the rate w."""
    normal = HybridSystem.smooth(
        {"x": "mu*x - w*y - x*(x**2 + y**2)", "y": "w*x + mu*y - y*(x**2 + y**2)"}, {"mu": 1.0, "w": 2.0}
    )
    values = np.linspace(0.2, 1.0, 9)
    options = SweepOptions(section=Section("y", direction=1), exponents=2, **SIDE_BY_SIDE)
    sweep = run_sweep(normal, "mu", values, x0=[0.4, 0.1], options=options)
    np.testing.assert_allclose(sweep.column("x")[0], np.tile(np.sqrt(values)[:, None], 20), rtol=1e-7)
    np.testing.assert_allclose(sweep.return_times[0], math.pi, rtol=1e-7)
    np.testing.assert_allclose(sweep.exponents[0, :, 1], -2.0 * values, rtol=1e-3)
    assert sum(told for _, told in followed) == 9


@pytest.mark.parametrize("options", [{"follow": "restart"}, {"chunks": 5}, {"chunks": 5, "follow": "both"}])
def test_lanes_find_what_single_motions_find(impact_oscillator, followed, options):
    both = [
        run_sweep(
            impact_oscillator, "A", AMPLITUDES, parameters=PLACE,
            options=SweepOptions(lanes=lanes, observables=["max(x)"], **SHORT, **options),
        )
        for lanes in (True, False)
    ]  # fmt: skip
    same(*both)
    count = AMPLITUDES.size * len(both[0].directions)
    assert sum(asked for asked, _ in followed) == sum(told for _, told in followed) == count


@pytest.mark.parametrize(
    "system",
    [own_states.wall(), pytest.param(systems.afm(1), marks=pytest.mark.campaign)],
    ids=["states of a mode's own", "cantilever"],
)
def test_lanes_find_what_single_motions_find_in_several_modes(followed, system):
    parameter, values = ("A", np.linspace(0.6, 1.4, 9)) if "A" in system.parameters else ("ybar", [0.09, 0.1, 0.108])
    one, other = (
        run_sweep(system, parameter, values, options=SweepOptions(follow="restart", lanes=lanes, **SHORT))
        for lanes in (True, False)
    )
    same(one, other)
    assert sum(told for _, told in followed) >= len(values) - 1


@pytest.mark.campaign
def test_a_section_in_every_mode_is_the_same_by_lanes(followed):
    options = {"section": Section("v", direction=-1), "quantities": ["x"], "follow": "restart", **SHORT}
    one, other = (
        run_sweep(own_states.wall(), "A", [0.8, 1.0, 1.2], options=SweepOptions(lanes=lanes, **options))
        for lanes in (True, False)
    )
    same(one, other)
    assert sum(told for _, told in followed) == 3


@pytest.mark.campaign
def test_chaos_has_the_same_statistics_by_lanes(followed):
    duffing = HybridSystem.smooth(
        {"x": "v", "v": "x - x**3 - 0.25*v + A*cos(s)"}, {"A": 0.4, "w": 1.0}, phase=("s", "w")
    )
    options = {"follow": "restart", "discard": 100, "keep": 2000, "quantities": ["x"]}
    one, other = (
        run_sweep(duffing, "A", [0.4], x0=[0.5, 0.0], options=SweepOptions(lanes=lanes, **options))
        for lanes in (True, False)
    )
    assert one.labels.tolist() == other.labels.tolist() == [["chaotic"]]
    spread = np.hypot(one.errors[0, 0, 0], other.errors[0, 0, 0])
    assert abs(one.exponents[0, 0, 0] - other.exponents[0, 0, 0]) < 2.0 * spread
    quantiles = [np.quantile(sweep.points, [0.1, 0.3, 0.5, 0.7, 0.9]) for sweep in (one, other)]
    np.testing.assert_allclose(*quantiles, atol=0.15)
    assert followed == [(1, 1)]


# what lanes leave to single motions


def test_a_definition_without_series_is_followed_alone(followed):
    rough = HybridSystem.smooth({"x": "v", "v": "-x - abs(v)*v + A*cos(s)"}, {"A": 1.0, "w": 1.0}, phase=("s", "w"))
    options = [SweepOptions(follow="restart", lanes=lanes, discard=50, keep=5) for lanes in (True, False)]
    assert run_sweep(rough, "A", [0.5, 1.0], options=options[0]) == run_sweep(
        rough, "A", [0.5, 1.0], options=options[1]
    )
    assert followed == []


def test_rows_without_a_motion_have_their_reasons(impact_oscillator):
    escape = HybridSystem(("x",), {"a": -1.0}, {"free": Mode({"x": "a*x"})}, phase=("s", "1"))
    sweep = run_sweep(
        escape, "a", [-1.0, 1.0], x0=[1.0], options=SweepOptions(lanes=True, chunks=2, discard=10, keep=5)
    )
    assert sweep.labels.tolist() == [["period-1", "diverged"]]
    assert sweep.reasons[0, 1].startswith("the trajectory diverges at t = ")
    options = SweepOptions(section="impact", lanes=True, follow="restart", discard=5, keep=4)
    away = run_sweep(impact_oscillator, "A", [0.1, 1.0], parameters=PLACE, options=options)
    assert away.labels.tolist() == [["no return", "period-1"]]
    low = HybridSystem(("x",), {"b": 3.0}, {"low": Mode({"x": "-x"}, domain="x - 2 + b")}, phase=("s", "1"))
    nowhere = run_sweep(low, "b", [1.0, 3.0], x0=[0.0], options=SweepOptions(**SIDE_BY_SIDE))
    assert nowhere.labels.tolist() == [["diverged", "period-1"]]


def test_chattering_is_told(ball):
    options = SweepOptions(section="impact", discard=10, keep=30, follow="restart", lanes=True)
    sweep = run_sweep(ball, "e", [0.5, 1.0], x0=[1.0, 0.0], options=options)
    assert sweep.labels.tolist() == [["chattering", "period-1"]]


def test_angles_are_followed_alone(followed):
    circle = HybridSystem.smooth({"x": "w - sin(x)"}, {"w": 2.0}, angles=["x"])
    options = {"section": Section("sin(x)", direction=1), "follow": "restart", "discard": 20, "keep": 5}
    one, other = (
        run_sweep(circle, "w", [1.5, 2.0], x0=[0.3], options=SweepOptions(lanes=lanes, **options))
        for lanes in (True, False)
    )
    assert one == other
    assert followed == []


def test_a_map_has_no_lanes():
    logistic = saltus.Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"})
    with pytest.raises(InputError, match=r"^SweepOptions\.lanes = True: must be left out for a map"):
        run_sweep(logistic, "r", [3.2], x0=[0.3], options=SweepOptions(lanes=True))


# the same however it is computed


def test_a_motion_in_lanes_knows_nothing_of_its_neighbours(impact_oscillator):
    def swept(values, **options):
        return run_sweep(
            impact_oscillator, "A", values, parameters=PLACE, options=SweepOptions(**SIDE_BY_SIDE, **options)
        )

    whole = swept(AMPLITUDES, workers=1)
    assert swept(AMPLITUDES, workers=3) == whole
    np.testing.assert_array_equal(swept(AMPLITUDES[4:6]).points[0], whole.points[0, 4:6])


def test_an_interrupt_keeps_what_is_done_and_the_file_goes_on(impact_oscillator, tmp_path):
    def interrupt(progress):
        told.append(progress.done)
        if progress.done == 6:
            signal.raise_signal(signal.SIGINT)

    def swept(progress, workers):
        options = SweepOptions(lanes=True, chunks=5, workers=workers, **SHORT)
        return run_sweep(
            impact_oscillator, "A", AMPLITUDES, parameters=PLACE, options=options, path=tmp_path / "a.nc",
            progress=progress,
        )  # fmt: skip

    told: list[int] = []
    part = swept(interrupt, 1)
    assert part.stopped == "interrupted: 6 of 15 values done"
    assert told == list(range(1, 7))
    whole = swept(False, 2)
    np.testing.assert_array_equal(part.points[part.done], whole.points[part.done])
    (tmp_path / "a.nc").unlink()
    assert swept(False, 1) == whole


def test_a_dask_cluster_computes_the_same(impact_oscillator):
    distributed = pytest.importorskip("distributed")
    options = {"options": SweepOptions(**SIDE_BY_SIDE), "parameters": PLACE}
    here = run_sweep(impact_oscillator, "A", AMPLITUDES[:4], **options)
    cluster = distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0")
    with cluster, distributed.Client(cluster, set_as_default=False) as client:
        options["options"] = SweepOptions(client=client, **SIDE_BY_SIDE)
        assert run_sweep(impact_oscillator, "A", AMPLITUDES[:4], **options) == here


@pytest.mark.parametrize(
    ("options", "by_lanes"),
    [
        ({"chunks": 20, "discard": 5000}, True),
        ({"chunks": 20, "discard": 5000, "lanes": False}, False),
        ({"chunks": 2, "discard": 5000}, False),
        ({"chunks": 20, "discard": 10}, False),
        ({"discard": 5000}, False),
    ],
)
def test_many_returns_of_many_stretches_are_followed_by_lanes(impact_oscillator, monkeypatch, options, by_lanes):
    asked = []
    monkeypatch.setattr(Task, "by_lanes", lambda *_, **__: asked.append(True))
    monkeypatch.setattr(Task, "row", interrupted)
    run_sweep(impact_oscillator, "A", AMPLITUDES[:1].repeat(40) + np.arange(40) / 100, options=SweepOptions(**options))
    assert bool(asked) == by_lanes


def interrupted(*_):
    raise KeyboardInterrupt


def test_a_pulse_of_the_drive_is_met(followed):
    """A drive that all but rests for most of its period: the motion is the integral of the pulse."""
    pulse = HybridSystem.smooth({"x": "-x + A*exp(60*(cos(s) - 1))"}, {"A": 1.0, "w": 1.0}, phase=("s", "w"))
    sweep = run_sweep(pulse, "A", [1.0, 2.0], options=SweepOptions(**SIDE_BY_SIDE))

    def response(s):
        return math.exp(60.0 * (math.cos(s) - 1.0) + s)

    whole, _ = quad(response, -math.pi, math.pi, points=[0.0], epsabs=1e-13)
    before, _ = quad(response, -math.pi, 0.0, epsabs=1e-13)
    settled = before + whole / math.expm1(2.0 * math.pi)
    np.testing.assert_allclose(sweep.column("x")[0, :, -1], [settled, 2.0 * settled], rtol=1e-6)
    assert sum(told for _, told in followed) == 2


@pytest.mark.campaign
def test_transitions_that_share_a_surface_are_the_same_by_lanes():
    two = HybridSystem(
        ("x", "v"), {"A": 1.2, "w": 0.67, "e": 0.9},
        {"m": Mode({"x": "v", "v": "-x - 0.1*v + A*cos(s)"})},
        [
            Transition("m", "m", "x - 1/2", 1, {"v": "-e*v"}, "v - 0.4", name="hard"),
            Transition("m", "m", "x - 1/2", 1, {"v": "-0.3*v"}, "0.4 - v", name="soft"),
        ],
        phase=("s", "w"),
    )  # fmt: skip
    options = {"follow": "restart", "discard": 2, "keep": 3, "section": "hard"}
    one, other = (
        run_sweep(two, "e", [0.2, 0.3, 0.4], options=SweepOptions(lanes=lanes, **options)) for lanes in (True, False)
    )
    same(one, other, rtol=1e-5)
