"""Many motions by lanes against the event-driven flow at tight tolerance, closed forms and themselves."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import systems
from oracles.closed_forms import ImpactOrbit
from saltus import afm
from saltus.ensemble import ensemble as engine
from saltus.ensemble.ensemble import Ensemble
from saltus.ensemble.traps import DIVERGED, UNDECIDED, Ellipsoids, Traps
from saltus.errors import InputError, SaltusError
from saltus.flow.poincare import iterate
from saltus.flow.simulation import simulate
from saltus.flow.starting import starting_mode
from saltus.system.hybrid import HybridSystem, Mode, Transition
from selection import guarding

SHAKEN = "-x - 0.1*v + A*cos(s)"
DUFFING = "-0.2*v + x - x**3 + A*cos(s)"


def one_mode(field, transitions=(), *, parameters=None, phase=("s", "w"), domain=None):
    """A system of one mode 'm', transitions given as (event, direction, reset, when)."""
    rows = [Transition("m", "m", t[0], t[1], t[2], t[3], f"t{i}") for i, t in enumerate(transitions)]
    return HybridSystem(
        tuple(field), {"w": 1.0, "A": 0.3} | (parameters or {}), {"m": Mode(field, domain)}, rows, phase=phase
    )


def stop(inside, outside=SHAKEN, *, directions=(1, -1), counted=False, **parameters):
    """A mass that meets something at x = d; `counted` adds a state n, which counts the contacts."""
    count = {"n": "0"} if counted else {}
    return HybridSystem(
        ("x", "v", *count),
        {"w": 0.8, "A": 0.5, "d": 0.1, "k": 20.0} | parameters,
        {"free": Mode({"x": "v", "v": outside} | count), "touch": Mode({"x": "v", "v": inside} | count)},
        [
            Transition("free", "touch", "x - d", directions[0], {"n": "n + 1"} if counted else {}),
            Transition("touch", "free", "x - d", directions[1]),
        ],
        phase=("s", "w"),
    )


def between_springs():
    """Three modes; the middle one has two events."""
    fields = {"left": f"{SHAKEN} - 10*(x + 1/2)", "middle": SHAKEN, "right": f"{SHAKEN} - 20*(x - 3/10)**2"}
    return HybridSystem(
        ("x", "v"),
        {"w": 1.0, "A": 1.0},
        {name: Mode({"x": "v", "v": force}) for name, force in fields.items()},
        [
            Transition("middle", "right", "x - 3/10", 1),
            Transition("right", "middle", "x - 3/10", -1),
            Transition("middle", "left", "x + 1/2", -1),
            Transition("left", "middle", "x + 1/2", 1),
        ],
        phase=("s", "w"),
    )


def pendulum(transitions=()):
    return one_mode({"x": "v", "v": "-sin(x) - 0.1*v + A*cos(s)"}, transitions, parameters={"A": 1.2, "w": 0.67})


@dataclass(frozen=True)
class Case:
    """A system, a box of starts, and what of it lanes may leave to the flow."""

    make: Any
    low: tuple[float, ...]
    high: tuple[float, ...]
    parameters: dict[str, float] = field(default_factory=dict)
    interval: float | None = None
    count: int = 1
    left_over: float = 0.05


STIFF = {"x": "v", "v": "-x - 0.1*v + cos(s)", "y": "-300*(y - x)"}
TWO_WAYS = [("x - 1/2", 1, {"v": "-0.9*v"}, "v - 0.4"), ("x - 1/2", 1, {"v": "-0.3*v"}, "0.4 - v")]
CASES = {
    "cantilever, 1 mode": Case(lambda: afm.tapping_mode(afm.table1(), modes=1), (-4, -4), (0.9, 4)),
    "cantilever, 2 modes": Case(
        lambda: afm.tapping_mode(afm.table1(), modes=2), (-4,) * 4, (4,) * 4, {"Omega": 1.15}
    ),
    "cantilever, 3 modes": Case(lambda: afm.tapping_mode(afm.table1(), modes=3), (-2,) * 6, (2,) * 6, {"Omega": 1.05}),
    "cantilever, other dampings": Case(
        lambda: afm.tapping_mode(afm.table1(), modes=2), (-4,) * 4, (4,) * 4, {"D_att": 0.1, "D_rep": 1.0}
    ),
    "impact oscillator": Case(systems.impact_oscillator, (-2, -2), (1, 2), {}, None, 3),
    "impact oscillator, elastic": Case(systems.impact_oscillator, (-2, -2), (1, 2), {"e": 1.0}, None, 3),
    "bilinear": Case(lambda: stop(f"{SHAKEN} - k*(x - d)"), (-2, -2), (2, 2)),
    "bilinear Duffing": Case(lambda: stop(f"{DUFFING} - 5*(x - d)", DUFFING), (-2, -2), (2, 2)),
    "bilinear Duffing, without direction": Case(
        lambda: stop(f"{DUFFING} - 5*(x - d)", DUFFING, directions=(0, -1)), (-2, -2), (0.09, 2)
    ),
    "Hertz": Case(lambda: stop(f"{SHAKEN} - k*(x - d)**(3/2)"), (-2, -2), (2, 2)),
    "soft contact": Case(
        lambda: stop("-x/100 - v/10 + 5*cos(s) - 3*(x - d)**(3/2)/1000"), (-2, -2), (2, 2)
    ),
    "a fast mode": Case(lambda: one_mode({"x": "v", "v": "-90000*x - v/10 + A*cos(s)"}), (-2, -2), (2, 2)),
    "Hertz, shaken hard and fast": Case(
        lambda: stop("-x - v/10 + 50*cos(7*s) + A*sin(s) - k*(x - d)**(3/2)"), (-2, -2), (2, 2)
    ),
    "root": Case(lambda: stop(f"{SHAKEN} - sqrt(x - d)"), (-2, -2), (2, 2)),
    "roots on both sides": Case(
        lambda: stop(f"{SHAKEN} - 2*(x - d)**(3/2)", f"{SHAKEN} + sqrt(d - x)/3"), (-2, -2), (2, 2)
    ),
    "three modes": Case(between_springs, (-2, -2), (2, 2)),
    "smooth Duffing": Case(lambda: one_mode({"x": "v", "v": DUFFING}), (-2, -2), (2, 2)),
    "smooth and linear": Case(lambda: one_mode({"x": "v", "v": SHAKEN}), (-2, -2), (2, 2), {}, None, 3),
    "linear and stiff": Case(lambda: one_mode(STIFF), (-2,) * 3, (2,) * 3),
    "cubic damping": Case(lambda: one_mode({"x": "v", "v": f"{SHAKEN} - 0.1*v**3"}), (-1, -1), (1, 1), {"w": 0.3}),
    "weak rest of a slow state": Case(
        lambda: one_mode({"x": "v", "v": f"{SHAKEN} - y**2/5", "y": "-y/5 + 3*x**2/10"}),
        (-1,) * 3, (1,) * 3, {"w": 0.3},
    ),
    "pendulum": Case(pendulum, (-4, -4), (4, 4)),
    "pendulum between stops": Case(
        lambda: pendulum([("x - 1", 1, {"v": "-0.8*v"}, None), ("x + 1", -1, {"v": "-0.8*v"}, None)]), (-1, -3), (1, 3)
    ),
    "pendulum without drive": Case(
        lambda: one_mode({"x": "v", "v": "-sin(x) - 0.1*v"}, phase=None), (-4, -4), (4, 4), {}, 1.0
    ),
    "two fields": Case(systems.two_fields, (-2, -2), (2, 2), {}, 2.0),
    "relay": Case(systems.relay, (-1,) * 3, (1,) * 3, {}, 2.0, 2),
    "block on a belt": Case(systems.stick_slip, (-1, -1), (1, 0.29), {}, 3.0, 1, 1.0),
    "carried map": Case(
        lambda: systems.carried_map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"}), (0, 0), (1, 0.5), {}, 1.3, 3
    ),
    "ball": Case(systems.ball, (0.5, -1), (2, 2), {}, 2.0),
    "two transitions on one surface": Case(
        lambda: one_mode({"x": "v", "v": SHAKEN}, TWO_WAYS, parameters={"A": 1.2, "w": 0.67}),
        (-1, -3), (0.5, 3), {}, None, 1, 1.0,
    ),
    "no series": Case(lambda: one_mode({"x": "v", "v": f"{SHAKEN} - abs(x)*x"}), (-2, -2), (2, 2), {}, None, 1, 1.0),
}  # fmt: skip
GUARDING = ("impact oscillator", "Hertz", "smooth and linear", "relay", "no series")


@cache
def made(name):
    return CASES[name].make()


@pytest.fixture
def left_over(monkeypatch):
    """Starts of the motions that lanes have left to the event-driven flow."""
    starts, follow = [], engine.follow_alone

    def following(system, parameters, x, *arguments):
        starts.append(x.copy())
        return follow(system, parameters, x, *arguments)

    monkeypatch.setattr(engine, "follow_alone", following)
    return starts


def by_events(system, parameters, points, *, interval=None, count=1, modes=None, tol=1e-12):
    """Ends and modes of motions by the event-driven flow; NaN and -1 where it ends early."""
    p = system.parameter_vector(parameters)
    ends, end_modes = np.full(np.shape(points), np.nan), np.full(len(points), -1)
    for i, x in enumerate(np.asarray(points, dtype=float)):
        try:
            full = system.full_state(x)
            mode = starting_mode(system, full, p) if modes is None else modes[i]
            if interval is None:
                found = iterate(system, p, full, mode, discard=count - 1, keep=1, tolerance=(tol, tol))
                ends[i], end_modes[i] = found.states[0, : x.size], found.modes[0]
            else:
                name = system.mode_names[mode]
                motion = simulate(system, parameters, x, mode=name, t_end=count * interval, tolerance=(tol, tol))
                ends[i], end_modes[i] = motion.x_end, system.mode_names.index(motion.mode_end)
        except SaltusError:
            pass
    return ends, end_modes


def starts_of(case, m, seed=1):
    return np.random.default_rng(seed).uniform(case.low, case.high, (m, len(case.low)))


@pytest.mark.parametrize("name", guarding(CASES, *GUARDING, campaign=8))
def test_ends_are_those_of_the_event_driven_flow(name, left_over):
    case, system = CASES[name], made(name)
    points = starts_of(case, 120)
    ends, modes = Ensemble(system, case.parameters, interval=case.interval).strobe(points, count=case.count)
    assert len(left_over) <= case.left_over * len(points)
    wanted, wanted_modes = by_events(system, case.parameters, points, interval=case.interval, count=case.count)
    lost = np.isnan(wanted).any(axis=1)
    np.testing.assert_array_equal(np.isnan(ends).any(axis=1), lost)
    assert lost.mean() < 0.5
    np.testing.assert_array_equal(modes[~lost], wanted_modes[~lost])
    errors = np.abs(ends - wanted)[~lost].max(axis=1)
    # a tolerance of 1e-8 a step, some tens of steps, and errors that an impact makes larger
    assert np.median(errors) < 2e-7
    assert np.quantile(errors, 0.95) < 5e-6


@pytest.mark.parametrize(
    "name", guarding(["cantilever, 2 modes", "Hertz", "smooth Duffing", "three modes", "cubic damping"], "Hertz")
)
def test_the_tolerance_is_what_a_step_is_made_for(name):
    case, system = CASES[name], made(name)
    points = starts_of(case, 40)
    wanted, _ = by_events(system, case.parameters, points, tol=1e-13)
    errors = []
    for tolerance in (1e-6, 1e-8, 1e-10):
        ends, _ = Ensemble(system, case.parameters, tolerance=tolerance).strobe(points)
        errors.append(float(np.median(np.abs(ends - wanted).max(axis=1))))
    assert np.all(np.array(errors) < [2e-5, 2e-7, 2e-9])


# closed forms


@pytest.mark.parametrize("name", guarding(["smooth and linear", "linear and stiff"], "smooth and linear"))
def test_a_linear_field_is_followed_exactly(name):
    system = made(name)
    n = len(system.states)
    drive = 0.3 if name == "smooth and linear" else 1.0
    matrix = np.zeros((n + 2, n + 2))  # the states, cos, sin
    matrix[0, 1], matrix[1, :2], matrix[1, n] = 1.0, (-1.0, -0.1), drive
    matrix[n, n + 1], matrix[n + 1, n] = -1.0, 1.0
    if n == 3:
        matrix[2, [0, 2]] = 300.0, -300.0
    points = starts_of(CASES[name], 50)
    ends, _ = Ensemble(system).strobe(points, count=2)
    starts = np.column_stack([points, np.ones(len(points)), np.zeros(len(points))])
    wanted = starts @ expm(matrix * 4.0 * math.pi).T
    np.testing.assert_allclose(ends, wanted[:, :n], atol=1e-9)


def test_an_impact_orbit_keeps_its_closed_form():
    form, system = ImpactOrbit(1.0), made("impact oscillator")
    x = np.array(form.after_impact(form.speeds(1.0)[1]))
    p = system.parameter_vector({})
    start = iterate(system, p, x, 0, discard=0, keep=1, tolerance=(1e-12, 1e-13)).states[:, :2]
    ends, _ = Ensemble(system, tolerance=1e-10).strobe(np.tile(start, (3, 1)), count=50)
    np.testing.assert_allclose(ends, np.tile(start, (3, 1)), atol=1e-8)


@pytest.mark.parametrize("direction", [-1, 0])
@pytest.mark.parametrize("depth", [1e-2, 1e-4, 1e-6, 1e-9, -1e-9, -1e-6, -1e-2])
def test_a_shallow_dip_is_not_missed(dipping, direction, depth):
    # z = (t - 1)**2 - depth
    ends, _ = dipping[direction].strobe([[1.0 - depth, -2.0, 0.0]])
    passed = 0.0 if depth < 0.0 else (1.0 if direction else 2.0)
    assert ends[0, 2] == passed
    np.testing.assert_allclose(ends[0, :2], [4.0 - depth, 4.0], atol=1e-12)


@pytest.fixture(scope="module")
def dipping():
    motion = {"z": "v", "v": "2", "n": "0"}
    return {d: Ensemble(one_mode(motion, [("z", d, {"n": "n + 1"}, None)], phase=None), interval=3.0) for d in (-1, 0)}


@pytest.mark.campaign
@pytest.mark.parametrize("force", guarding(["k*(x - d)**(3/2)", "k*(x - d)", "sqrt(x - d)"], "k*(x - d)**(3/2)"))
def test_contacts_next_to_grazing_are_counted_as_the_flow_counts_them(force, left_over):
    system = stop(f"{SHAKEN} - {force}", counted=True, d=1.5)
    lanes = Ensemble(system, tolerance=1e-10)

    def touches(v):
        return by_events(system, {}, [[-0.5, v, 0.0]])[0][0, 2] > 0.0

    low, high = 0.0, 3.0
    assert (touches(low), touches(high)) == (False, True)
    for _ in range(45):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if touches(middle) else (middle, high)
    offsets = 10.0 ** np.arange(-8.0, -2.0)
    points = [[-0.5, low + offset, 0.0] for offset in (*offsets, *-offsets)]
    ends, _ = lanes.strobe(points)
    wanted, _ = by_events(system, {}, points)
    assert set(wanted[:, 2]) == {0.0, 1.0}
    np.testing.assert_array_equal(ends[:, 2], wanted[:, 2])
    np.testing.assert_allclose(ends, wanted, atol=1e-6)
    assert len(left_over) < len(points)


# starts


def test_starts_on_a_surface_are_those_of_the_flow():
    system = made("Hertz")
    points = np.array([[0.1, 0.5], [0.1, -0.5], [0.1, 0.0], [0.1 + 1e-16, 0.3], [0.1 - 2e-17, -0.3]])
    ends, modes = Ensemble(system).strobe(points)
    wanted, wanted_modes = by_events(system, {}, points)
    np.testing.assert_array_equal(modes, wanted_modes)
    np.testing.assert_allclose(ends, wanted, atol=1e-6)


@pytest.mark.campaign
def test_a_start_on_a_surface_that_rises_from_it_has_not_passed_it():
    system = HybridSystem(
        ("x", "v"),
        {},
        {"up": Mode({"x": "v", "v": "-1"}), "down": Mode({"x": "v", "v": "-3"})},
        [Transition("up", "down", "x", -1), Transition("down", "up", "v + 2", -1, {"x": "1"})],
    )
    ends, modes = Ensemble(system, interval=0.5).strobe([[0.0, 1.0], [0.0, -1.0]])
    np.testing.assert_array_equal(modes, [0, 0])
    # the second falls three times as fast for 1/3, then rises again from x = 1 at v = -2 for 1/6
    np.testing.assert_allclose(ends, [[0.375, 0.5], [1.0 - 2.0 / 6.0 - 1.0 / 72.0, -2.0 - 1.0 / 6.0]], atol=1e-12)


@pytest.mark.parametrize("lift", [0.0, 1e-13, 1e-9, 1e-5])
def test_a_start_that_grazes_is_that_of_the_flow(lift):
    system = made("impact oscillator")
    points = [[1.0 - lift, 0.0], [1.0 - lift, 1e-6], [1.0 - lift, -1e-6]]
    ends, _ = Ensemble(system, {"A": 0.5}).strobe(points)
    wanted, _ = by_events(system, {"A": 0.5}, points)
    np.testing.assert_allclose(ends, wanted, atol=1e-6)


@pytest.mark.campaign
def test_a_motion_that_stays_in_contact_is_followed_there():
    # pressed against its spring for ever
    system = stop("-x - 0.5*v + A*cos(s) + 5 - k*(x - d)**(3/2)", f"{SHAKEN} + 5")
    points = starts_of(CASES["Hertz"], 30)
    ends, modes = Ensemble(system).strobe(points, count=20)
    wanted, wanted_modes = by_events(system, {}, points, count=20)
    np.testing.assert_array_equal(modes, 1)
    np.testing.assert_array_equal(wanted_modes, 1)
    np.testing.assert_allclose(ends, wanted, atol=1e-6)
    assert np.ptp(ends, axis=0).max() < 1e-4


@pytest.mark.campaign
def test_the_modes_that_are_given_are_begun_in():
    system = made("bilinear Duffing, without direction")
    points = np.array([[0.5, 0.3], [-0.5, 0.3], [0.5, -0.3]])
    ends, modes = Ensemble(system, tolerance=1e-10).strobe(points, modes=[1, 0, 1])
    wanted, wanted_modes = by_events(system, {}, points, modes=[1, 0, 1])
    np.testing.assert_array_equal(modes, wanted_modes)
    np.testing.assert_allclose(ends, wanted, atol=1e-6)


# motions that end


@pytest.mark.campaign
def test_an_explosion_has_no_end_and_diverges():
    # x(t) = 1/(1/x0 - t)
    system = one_mode({"x": "x**2 + 0*y", "y": "-y"})
    x0 = np.concatenate([np.linspace(-1.0, 0.155, 40), np.linspace(0.163, 0.5, 40)])
    points = np.column_stack([x0, np.ones_like(x0)])
    ends, _ = Ensemble(system).strobe(points)
    bounded = x0 < 0.159
    np.testing.assert_array_equal(np.isnan(ends).any(axis=1), ~bounded)
    np.testing.assert_allclose(ends[bounded, 0], 1.0 / (1.0 / x0[bounded] - 2.0 * math.pi), rtol=1e-5, atol=1e-8)
    labels, _ = Ensemble(system).settle(points, Traps(2), longest=1)
    np.testing.assert_array_equal(labels, np.where(bounded, UNDECIDED, DIVERGED))


@pytest.mark.campaign
def test_motions_that_escape_from_a_well_diverge():
    system = one_mode({"x": "v", "v": "-x + x**2 - 0.1*v + A*cos(s)"}, parameters={"A": 0.05, "w": 0.85})
    points = np.random.default_rng(6).uniform(-1.0, 1.0, (80, 2))
    labels, looks = Ensemble(system).settle(points, Traps(2), longest=10)
    wanted, _ = by_events(system, {}, points, count=10, tol=1e-10)
    gone = np.isnan(wanted).any(axis=1)
    assert 10 < gone.sum() < 70
    np.testing.assert_array_equal(labels, np.where(gone, DIVERGED, UNDECIDED))
    assert (looks[gone] < 10).all()


@pytest.mark.campaign
def test_a_start_in_no_mode_has_no_end():
    system = one_mode({"x": "-x/10"}, domain="x")
    ends, _ = Ensemble(system).strobe([[1.0], [-1.0], [0.0]])
    np.testing.assert_allclose(ends[0], math.exp(-0.2 * math.pi), rtol=1e-9)
    assert np.isnan(ends[1:]).all()


def test_chattering_ends_and_reaches_no_attractor():
    system = made("ball")
    everything = Traps(2, Ellipsoids(np.array([[0.0, 0.0]]), np.eye(2)[None] / 0.5, np.array([0], np.uint8)))
    lanes = Ensemble(system, interval=20.0)
    points = np.array([[1.0, 0.0], [2.0, 1.0]])
    ends, _ = lanes.strobe(points)
    assert np.isnan(ends).all()
    labels, _ = lanes.settle(points, everything, longest=3)
    np.testing.assert_array_equal(labels, UNDECIDED)


# the same however it is done


@pytest.fixture(scope="module")
def wells():
    """A forced double well with its two orbits, whose basins are mixed."""
    system = one_mode({"x": "v", "v": "-0.1*v + x - x**3 + A*cos(s)"}, parameters={"A": 0.05})
    lanes = Ensemble(system)
    centres, _ = lanes.strobe([[1.0, 0.0], [-1.0, 0.0]], count=200)
    return system, Traps(2, Ellipsoids(centres, np.stack([np.eye(2)] * 2) / 0.05, np.array([0, 1], np.uint8)))


def test_fates_are_the_same_in_any_order_in_any_company(wells, monkeypatch):
    system, traps = wells
    points = np.random.default_rng(3).uniform(-2.0, 2.0, (3000, 2))
    labels, looks = Ensemble(system, threads=1).settle(points, traps)
    assert np.bincount(labels, minlength=2)[:2].min() > 300
    order = np.random.default_rng(4).permutation(len(points))
    others = {"order": Ensemble(system, threads=1).settle(points[order], traps)}
    others["order"] = tuple(found[np.argsort(order)] for found in others["order"])
    for alive in (1, 7, 64):
        monkeypatch.setattr(engine, "_ALIVE", alive)
        others[f"{alive} alive"] = Ensemble(system, threads=1).settle(points, traps)
    for piece in (17, 500):
        monkeypatch.setattr(engine, "_PIECE", piece)
        for threads in (1, 3):
            others[f"{threads} threads, {piece}"] = Ensemble(system, threads=threads).settle(points, traps)
    for name, (other_labels, other_looks) in others.items():
        np.testing.assert_array_equal(other_labels, labels, err_msg=name)
        np.testing.assert_array_equal(other_looks, looks, err_msg=name)


@pytest.mark.parametrize(
    "name", guarding(["cantilever, 2 modes", "impact oscillator", "three modes"], "impact oscillator")
)
def test_ends_do_not_depend_on_the_neighbours(name):
    case, system = CASES[name], made(name)
    points = starts_of(case, 100)
    lanes = Ensemble(system, case.parameters)
    ends, modes = lanes.strobe(points)
    for i in range(0, 100, 9):
        alone, mode = lanes.strobe(points[i : i + 1])
        np.testing.assert_allclose(alone[0], ends[i], atol=1e-8)
        assert mode[0] == modes[i]


@pytest.mark.parametrize("name", ["cantilever, 2 modes", "Hertz", "relay"])
def test_three_looks_are_one_after_one_after_one(name):
    case, system = CASES[name], made(name)
    lanes = Ensemble(system, case.parameters, interval=case.interval)
    points = starts_of(case, 60)
    ends, modes = lanes.strobe(points, count=3)
    steps, step_modes = points, None
    for _ in range(3):
        steps, step_modes = lanes.strobe(steps, step_modes)
    np.testing.assert_array_equal(modes, step_modes)
    assert np.quantile(np.abs(ends - steps), 0.95) < 1e-5


def test_labels_are_those_of_motions_followed_by_the_flow_until_settled(wells):
    system, traps = wells
    points = np.random.default_rng(5).uniform(-2.0, 2.0, (150, 2))
    labels, looks = Ensemble(system).settle(points, traps)
    ends, _ = by_events(system, {}, points, count=150, tol=1e-11)
    nearest = np.abs(ends[:, None] - traps.ellipsoids.centres).max(axis=2)
    assert nearest.min(axis=1).max() < 1e-3
    assert np.mean(labels == nearest.argmin(axis=1)) > 0.98
    assert 0 < looks.max() < 200


def test_a_motion_without_a_trap_is_undecided_after_the_longest_time(impact_oscillator):
    labels, looks = Ensemble(impact_oscillator).settle([[0.0, 0.0], [0.5, 1.0]], Traps(2), longest=7)
    np.testing.assert_array_equal(labels, UNDECIDED)
    np.testing.assert_array_equal(looks, 7)


# bad input


def test_nothing_to_follow_is_nothing(impact_oscillator):
    ends, modes = Ensemble(impact_oscillator).strobe(np.empty((0, 2)))
    assert ends.shape == (0, 2)
    assert modes.shape == (0,)


def test_starts_that_are_no_numbers_lead_nowhere(impact_oscillator):
    lanes = Ensemble(impact_oscillator)
    points = [[np.nan, 0.0], [0.0, np.inf], [0.0, 0.0]]
    ends, _ = lanes.strobe(points)
    np.testing.assert_array_equal(np.isnan(ends).any(axis=1), [True, True, False])
    labels, _ = lanes.settle(points, Traps(2), longest=1)
    assert labels[0] >= DIVERGED
    np.testing.assert_array_equal(labels[1:], [DIVERGED, UNDECIDED])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"interval": 1.0}, "interval = 1.0: must be given for a system without a phase, and for no other"),
        ({"tolerance": 0.0}, "tolerance = 0.0: must be a number between"),
        ({"tolerance": math.nan}, "tolerance = nan: must be a number between"),
        ({"scale": [1.0, 0.0]}, "must be a finite number > 0 for each of x, v"),
        ({"scale": [1.0]}, "must be a finite number > 0 for each of x, v"),
        ({"parameters": {"w": 0.0}}, "rate of the phase theta = 0.0: must be > 0 and finite"),
        ({"parameters": {"w": -1.0}}, "rate of the phase theta = -1.0: must be > 0 and finite"),
    ],
)
def test_what_an_ensemble_cannot_be_made_of_is_refused(impact_oscillator, options, message):
    with pytest.raises(InputError, match=message):
        Ensemble(impact_oscillator, **options)


@pytest.mark.parametrize("interval", [None, 0.0, -1.0, math.inf, math.nan])
def test_a_system_without_a_phase_needs_a_time_between_looks(ball, interval):
    with pytest.raises(InputError, match="interval = "):
        Ensemble(ball, interval=interval)


@pytest.mark.parametrize(
    ("points", "options", "message"),
    [
        ([[0.0, 0.0, 0.0]], {}, r"points = \(1, 3\): must be of shape \(m, 2\); a row holds x, v"),
        ([0.0, 0.0], {}, r"points = \(2,\): must be of shape \(m, 2\)"),
        ([[0.0, 0.0]], {"modes": [0, 0]}, "must be as many as points, 1"),
        ([[0.0, 0.0]], {"count": 0}, "count = 0: must be at least 1"),
    ],
)
def test_points_that_do_not_fit_are_refused(impact_oscillator, points, options, message):
    with pytest.raises(InputError, match=message):
        Ensemble(impact_oscillator).strobe(points, **options)
