"""Two equal stops, met at one amplitude: the branch of the free motion goes on with the orbit that meets both."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import saltus
from selection import guarding

FREE = "F*cos(s) - 2*z*v - x"
BEYOND = {"springs": "k*({x})", "Hertzian": "k*({x})**(3/2)", "piecewise linear": "(k - 1)*({x})"}


def random_system(seed: int) -> tuple[saltus.HybridSystem, str, float]:
    """An oscillator between two equal stops of a random kind, and the drive at which the free motion grazes both."""
    rng = np.random.default_rng(seed)
    kind = ("walls", *BEYOND)[seed % 4]
    w = float(rng.uniform(0.3, 0.9) if rng.uniform() < 0.4 else rng.uniform(1.1, 2.6))
    z, d = float(rng.uniform(0.02, 0.3)), float(10.0 ** rng.uniform(-3.0, 3.0))
    values = {"F": 0.0, "z": z, "d": d, "w": w}
    if kind == "walls":
        e = float(rng.uniform(0.1, 0.95))
        modes = {"free": saltus.Mode({"x": "v", "v": FREE})}
        events = [
            saltus.Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="right"),
            saltus.Transition("free", "free", "x + d", -1, {"v": "-e*v"}, name="left"),
        ]
        values |= {"e": e}
    else:
        law, values["k"] = BEYOND[kind], float(rng.uniform(1.5, 30.0))
        modes = {
            "free": saltus.Mode({"x": "v", "v": FREE}),
            "right": saltus.Mode({"x": "v", "v": f"{FREE} - {law.format(x='x - d')}"}),
            "left": saltus.Mode({"x": "v", "v": f"{FREE} + {law.format(x='-x - d')}"}),
        }
        events = [
            saltus.Transition("free", "right", "x - d", 1),
            saltus.Transition("right", "free", "x - d", -1),
            saltus.Transition("free", "left", "x + d", -1),
            saltus.Transition("left", "free", "x + d", 1),
        ]
    system = saltus.HybridSystem(("x", "v"), values, modes, events, phase=("s", "w"))
    return system, kind, d * math.hypot(1.0 - w * w, 2.0 * z * w)


def free_motion(system: saltus.HybridSystem, drive: float) -> saltus.PeriodicOrbit:
    """The orbit that meets no stop, from its closed form."""
    w, z = system.parameters["w"], system.parameters["z"]
    at_rest, in_phase = 1.0 - w * w, 2.0 * z * w
    size = drive / (at_rest * at_rest + in_phase * in_phase)
    return saltus.solve_orbit(
        system, {"F": drive}, segments=[("free", None, [size * at_rest, size * in_phase * w, 0.0], 2.0 * math.pi / w)]
    )


def after_a_period(orbit: saltus.PeriodicOrbit, kind: str) -> np.ndarray:
    """The state a period after that of the orbit at phase 0, over the gap, by SciPy from extreme to extreme.

    The field has no kink on the way: what is passed between two extremes is met by the root of a continuous solution.
    """
    p = orbit.parameters
    d, w, k = p["d"], p["w"], p.get("k", 0.0)

    def push(x: float, side: float) -> float:
        depth = max(side * x - 1.0, 0.0)
        force = {"springs": k * depth, "Hertzian": k * math.sqrt(d) * depth**1.5, "piecewise linear": (k - 1.0) * depth}
        return -side * force.get(kind, 0.0)

    def field(t: float, x: np.ndarray, side: float) -> list[float]:
        return [x[1], p["F"] / d * math.cos(w * t) - 2.0 * p["z"] * x[1] - x[0] + push(x[0], side)]

    def speed(t: float, x: np.ndarray, side: float) -> float:
        return float(x[1])

    speed.terminal = True  # type: ignore[attr-defined]
    t, end, x = 0.0, 2.0 * math.pi / w * round(orbit.period * w / 2.0 / math.pi), np.array(orbit.x0[:2]) / d
    side, way = (0.0 if abs(x[0]) < 1.0 or kind == "walls" else math.copysign(1.0, x[0])), -math.copysign(1.0, x[1])
    while t < end:
        speed.direction = way  # type: ignore[attr-defined]
        ahead = solve_ivp(
            field, (t, end), x, "DOP853", events=speed, dense_output=True, args=(side,), rtol=1e-12, atol=1e-13
        )
        wall = side or math.copysign(1.0, ahead.y[0, -1])
        if (wall * ahead.y[0, -1] > 1.0) == bool(side):
            t, x, way = ahead.t[-1], ahead.y[:, -1], -way
            continue
        t = brentq(lambda s, y=ahead.sol, wall=wall: wall * y(s)[0] - 1.0, t, ahead.t[-1], xtol=1e-15)
        x = np.array([wall, ahead.sol(t)[1]])
        if kind == "walls":
            x[1], way = -p["e"] * x[1], -way
        else:
            side = 0.0 if side else wall
    return x


@pytest.mark.parametrize("seed", guarding(range(24), 0, campaign=3))
def test_a_motion_that_grazes_two_equal_stops_goes_on_with_both(seed: int) -> None:
    system, kind, drive = random_system(seed)
    branch = saltus.continue_orbit(free_motion(system, 0.6 * drive), "F", (0.4 * drive, 2.0 * drive))
    assert branch["GR1"].value("F") == pytest.approx(drive, rel=1e-9)
    assert not branch.audit.breaches, str(branch)
    counts = np.array([len(branch.solution(i).segments) for i in range(len(branch))])
    born = branch.solution(int(np.flatnonzero(counts > 1)[0]))
    assert {part.transition for part in born.segments} == set(system.transition_names), str(branch)
    grazings = [point.value("F") for point in branch.special_points.of_type("GR")]
    for i in range(len(branch)):
        orbit = branch.solution(i)
        if np.abs(orbit.parameters["F"] / np.array(grazings) - 1.0).min() < 1e-9:
            continue  # a touch is met or missed by rounding
        again = after_a_period(orbit, kind)
        error = 1e-8 * (1.0 + np.abs(orbit.multipliers).max())
        assert again == pytest.approx(np.array(orbit.x0[:2]) / system.parameters["d"], abs=error), (i, str(branch))


@pytest.mark.parametrize("seed", guarding([0, 1, 2, 3, 4, 5, 6, 7, 8, 20], 4, 7, campaign=3))
def test_the_branch_is_the_same_from_the_orbit_that_meets_both(seed: int) -> None:
    system, _, drive = random_system(seed)
    bounds = 0.4 * drive, 2.0 * drive
    up = saltus.continue_orbit(free_motion(system, 0.6 * drive), "F", bounds)
    met = [i for i in range(len(up)) if len(up.solution(i).segments) > 1]
    down = saltus.continue_orbit(up.solution(met[4]), "F", bounds)
    assert not down.audit.breaches, str(down)
    known, found = (sorted((p.type, p.value("F")) for p in branch.special_points) for branch in (up, down))
    assert [kind for kind, _ in found] == [kind for kind, _ in known]
    assert [value for _, value in found] == pytest.approx([value for _, value in known], rel=1e-8)
    assert len(down.solution(0).segments) == 1 or len(down.solution(len(down) - 1).segments) == 1


@pytest.mark.parametrize("back", [False, True])
@pytest.mark.parametrize("event", ["x**2 - d**2", "x**2/d - d", "abs(x) - d"])
@pytest.mark.parametrize("seed", guarding(range(0, 24, 4), 0, campaign=2))
def test_two_stops_in_one_event_are_those_of_two(seed: int, event: str, back: bool) -> None:
    two, _, drive = random_system(seed)
    hit = saltus.Transition("free", "free", event, 1, {"v": "-e*v"}, name="stop")
    one = saltus.HybridSystem(two.states, dict(two.parameters), dict(two.modes), [hit], phase=("s", "w"))
    bounds = 0.4 * drive, 2.0 * drive
    known, found = (
        saltus.continue_orbit(free_motion(system, 0.6 * drive), "F", bounds) for system in (two, one)
    )  # fmt: skip
    if back:
        met = [i for i in range(len(found)) if len(found.solution(i).segments) > 1]
        found = saltus.continue_orbit(found.solution(met[4]), "F", bounds)
    assert not found.audit.breaches, str(found)
    places, again = (sorted((p.type, p.value("F")) for p in branch.special_points) for branch in (known, found))
    assert [kind for kind, _ in again] == [kind for kind, _ in places], str(found)
    assert [value for _, value in again] == pytest.approx([value for _, value in places], rel=1e-8)


@pytest.mark.parametrize(
    ("phase", "coupling"),
    guarding([(0.0, 0.0), (0.0, 0.3), (3.14159265358979, 0.0), (1.57, 0.0)], (0.0, 0.3), (1.57, 0.0)),
)
def test_two_equal_oscillators_at_their_walls_are_each_one_oscillator(phase: float, coupling: float) -> None:
    free = {
        "x": "v", "v": f"F*cos(s) - 0.2*v - x - {coupling}*(x - y)",
        "y": "u", "u": f"F*cos(s + {phase}) - 0.2*u - y - {coupling}*(y - x)",
    }  # fmt: skip
    two = saltus.HybridSystem(
        ("x", "v", "y", "u"), {"F": 0.3, "e": 0.7, "w": 1.4}, {"free": saltus.Mode(free)},
        [
            saltus.Transition("free", "free", "x - 1", 1, {"v": "-e*v"}, name="first"),
            saltus.Transition("free", "free", "y - 1", 1, {"u": "-e*u"}, name="second"),
        ],
        phase=("s", "w"),
    )  # fmt: skip
    one = saltus.HybridSystem(
        ("x", "v"), {"F": 0.3, "e": 0.7, "w": 1.4}, {"free": saltus.Mode({"x": "v", "v": "F*cos(s) - 0.2*v - x"})},
        [saltus.Transition("free", "free", "x - 1", 1, {"v": "-e*v"}, name="first")],
        phase=("s", "w"),
    )  # fmt: skip
    both, single = (
        saltus.continue_orbit(saltus.find_orbit(system, x0=np.zeros(len(system.states))), "F", (0.2, 3.0))
        for system in (two, one)
    )
    assert not both.audit.breaches
    assert both["GR1"].value("F") == pytest.approx(single["GR1"].value("F"), rel=1e-9)
    assert both.values.min() == pytest.approx(single.values.min(), abs=2e-3)
    for F in (0.7, 1.5, 2.9):
        expected = sorted(orbit.max["v"] for orbit in single.at(F))
        assert sorted(orbit.max["v"] for orbit in both.at(F)) == pytest.approx(expected, rel=1e-7)


def in_step(seed: int) -> tuple[saltus.HybridSystem, saltus.HybridSystem]:
    """An impact oscillator, and two or three of it with springs between them, which move as one."""
    rng = np.random.default_rng(seed)
    count = 2 + seed % 2
    values = {
        "A": 1.5,
        "w": float(rng.uniform(1.15, 1.6)),
        "e": float(rng.uniform(0.3, 0.9)),
        "k": float(rng.uniform(0.0, 0.5)),
    }
    names = [f"x{i}" for i in range(count)]
    rates, events = {}, []
    for i, x in enumerate(names):
        rates |= {x: f"v{i}", f"v{i}": f"A*cos(s) - 0.1*v{i} - {x} + k*({' + '.join(names)} - {count}*{x})"}
        events.append(saltus.Transition("f", "f", f"{x} - 1", 1, {f"v{i}": f"-e*v{i}"}, name=f"hit{i}"))
    several = saltus.HybridSystem(tuple(rates), values, {"f": saltus.Mode(rates)}, events, phase=("s", "w"))
    one = saltus.HybridSystem(
        ("x0", "v0"),
        values,
        {"f": saltus.Mode({"x0": "v0", "v0": "A*cos(s) - 0.1*v0 - x0"})},
        events[:1],
        phase=("s", "w"),
    )
    return one, several


@pytest.mark.parametrize("seed", guarding(range(16), 0, campaign=5))
def test_oscillators_in_step_graze_at_once(seed):
    """From the side of the impacts, and from that of the free motion, they have the branch of one of them."""
    one, several = in_step(seed)
    for drive in (0.25, 1.5, 3.0):
        alone = saltus.continue_orbit(saltus.find_orbit(one, {"A": drive}, x0=[0.0, 0.0]), "A", (0.2, 4.0))
        rest = np.zeros(len(several.states))
        branch = saltus.continue_orbit(saltus.find_orbit(several, {"A": drive}, x0=rest), "A", (0.2, 4.0))
        assert all("bound reached" in reason for reason in branch.stopped), branch
        assert not branch.audit.breaches, branch
        known, found = (
            {kind: [p.parameters["A"] for p in curve.special_points.of_type(kind)] for kind in ("GR", "SN", "BP")}
            for curve in (alone, branch)
        )
        np.testing.assert_allclose(found["GR"], known["GR"], rtol=1e-9)
        assert all(min(abs(fold - value) for value in found["SN"] + found["BP"]) < 1e-8 for fold in known["SN"]), branch
        assert np.ptp(branch.values) == pytest.approx(np.ptp(alone.values))
        for value in np.linspace(alone.values.min(), alone.values.max(), 6)[1:-1]:
            speeds, others = (sorted(o.max["v0"] for o in curve.at(value)) for curve in (branch, alone))
            np.testing.assert_allclose(speeds, others, rtol=1e-7)


def _rattle(length: float, rate: float) -> tuple[saltus.HybridSystem, saltus.PeriodicOrbit]:
    """Return a driven mass between two walls 2 d apart, and its motion with a hit on each wall in a period."""
    system = saltus.HybridSystem(
        ("x", "v"),
        {"A": length, "d": 0.5 * length, "e": 0.6, "w": rate},
        {"f": saltus.Mode({"x": "v", "v": "A*w**2*cos(th)"})},
        [
            saltus.Transition("f", "f", "x - d", 1, {"v": "-e*v"}, name="R"),
            saltus.Transition("f", "f", "x + d", -1, {"v": "-e*v"}, name="L"),
        ],
        phase=("th", "w"),
    )
    angle, speed = 3.378093327609896, 0.7029064493612437 * length * rate
    starts = [("f", "R", [-0.5 * length, speed, angle]), ("f", "L", [0.5 * length, -speed, angle + np.pi])]
    return system, saltus.solve_orbit(system, segments=[(*start, np.pi / rate) for start in starts])


@pytest.mark.parametrize(
    ("length", "rate"),
    guarding([(1.0, 1.0), (1e-9, 1.0), (1e9, 1.0), (1e-9, 1e6), (1e-6, 1e4), (1e9, 1e-3)], (1.0, 1.0), (1e-9, 1e6)),
)
def test_a_rattle_goes_on_behind_its_grazing_in_all_units(length, rate):
    """Between two hits the motion is a parabola and a cosine: its start follows from the angle of the hit."""
    _, orbit = _rattle(length, rate)
    branch = saltus.continue_orbit(orbit, "d", (0.2 * length, 0.6 * length))
    assert branch.stopped == (f"d = {0.2 * length:.9g}: bound reached", f"d = {0.6 * length:.9g}: bound reached")
    found = {point.label: point.value("d") / length for point in branch.special_points}
    assert found == pytest.approx({"BP1": 0.343724240072, "SN1": 0.427548849578, "GR1": 0.250447525721}, rel=1e-9)
    simple = [i for i in range(len(branch)) if len(branch.signature(i)) == 2]
    assert simple
    for i in simple:
        angle, speed = branch.unknowns[i][2], abs(branch.unknowns[i][1]) / (length * rate)
        swing, turn = abs(np.sin(angle)), np.cos(angle) * (1.0 if branch.unknowns[i][0] < 0.0 else -1.0)
        assert speed == pytest.approx(3.0 * swing, rel=1e-8)
        assert 2.0 * branch.values[i] / length == pytest.approx(np.pi * (speed + swing) + 2.0 * turn, rel=1e-7)
    assert branch.audit.passed, branch.audit
