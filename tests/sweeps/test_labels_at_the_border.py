"""Labels beside period doublings that are known exactly, and of rotations by nearly a fraction of a turn."""

from __future__ import annotations

import math

import numpy as np
import pytest

from saltus import HybridSystem, Map, run_sweep
from saltus.options import SweepOptions
from selection import guarding

TURN = 2.0 * math.pi
LOGISTIC = Map(("x",), {"r": 3.5}, {"x": "r*x*(1 - x)"})
HENON = Map(("x", "y"), {"a": 0.3, "b": 0.3}, {"x": "1 - a*x**2 + y", "y": "b*x"})
CUBIC = Map(("x",), {"r": 2.0}, {"x": "r*x*(1 - x**2)"})
ODD = Map(("x",), {"r": 1.0}, {"x": "-r*x + x**3"})
RICKER = Map(("x",), {"r": 2.0}, {"x": "x*exp(r*(1 - x))"})

# map, parameter, its value at the doubling, the period before, a start
DOUBLINGS = {
    "logistic map": (LOGISTIC, "r", 3.0, 1, [0.3]),
    "logistic map, second": (LOGISTIC, "r", 1.0 + math.sqrt(6.0), 2, [0.3]),
    "Henon's": (HENON, "a", 0.75 * 0.7**2, 1, [0.1, 0.1]),
    "Henon's, second": (HENON, "a", 0.9125, 2, [0.1, 0.1]),  # (5 - 6 b + 5 b^2) / 4
    "cubic map": (CUBIC, "r", 2.0, 1, [0.3]),
    "cubic map, second": (CUBIC, "r", math.sqrt(5.0), 2, [0.3]),
    "odd map": (ODD, "r", 1.0, 1, [0.3]),
    "Ricker's": (RICKER, "r", 2.0, 1, [0.3]),
}


def drawn_doublings(count: int) -> list[tuple[str, float, int, int, float]]:
    """Draw maps, distances from their doublings, returns dropped and kept, and factors of the start."""
    rng = np.random.default_rng(11)
    return [
        (
            str(rng.choice(list(DOUBLINGS))),
            float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-6.0, -2.0)),
            int(rng.choice([100, 200, 600, 1500, 3000])),
            int(rng.choice([100, 200, 400, 1000])),
            float(rng.uniform(0.7, 1.3)),
        )
        for _ in range(count)
    ]


KNOWN = [
    ("logistic map", -1e-5, 600, 100, 1.0),
    ("logistic map", 1e-4, 600, 400, 1.0),
    ("logistic map", 1e-3, 100, 100, 1.0),
    ("logistic map, second", 1.0 + math.sqrt(6.0) - 3.44948, 600, 400, 1.0),
    ("logistic map, second", -4.9e-4, 3000, 100, 1.0),
    ("Henon's", 1e-3, 100, 400, 1.0),
]


@pytest.mark.parametrize(
    ("name", "beyond", "discard", "keep", "factor"),
    guarding([*KNOWN, *drawn_doublings(400)], *KNOWN, *drawn_doublings(400)[:30], campaign=100),
)
def test_a_label_beside_a_doubling_is_the_period_or_says_what_leaves_it_open(name, beyond, discard, keep, factor):
    system, parameter, at, before, start = DOUBLINGS[name]
    options = SweepOptions(discard=discard, keep=keep)
    sweep = run_sweep(system, parameter, [at + beyond], x0=[factor * start[0], *start[1:]], options=options)
    truth = f"period-{before if beyond < 0.0 else 2 * before}"
    if sweep.labels[0, 0] == "unresolved":
        assert abs(beyond) < 1e-4
        assert sweep.reasons[0, 0]
    else:
        assert sweep.labels[0, 0] == truth


# a flow whose return doubles: in a frame that turns half as fast as the clock it is x' = a x - x^3, y' = -y
DOUBLED = HybridSystem.smooth(
    {"x": "a*px - (x - px) - y/2 - (x*px + y*py)*px", "y": "a*py - (y - py) + x/2 - (x*px + y*py)*py"},
    {"a": 0.2},
    phase=("s", "1.0"),
    let={"px": "((1 + cos(s))*x + sin(s)*y)/2", "py": "(sin(s)*x + (1 - cos(s))*y)/2"},
)


@pytest.mark.parametrize(("discard", "keep"), guarding([(100, 20), (100, 400), (600, 20), (600, 400)], (100, 20)))
def test_a_flow_beside_its_doubling_has_its_period(discard, keep):
    values = [-1e-2, -1e-3, -3e-4, -1e-4, 1e-4, 3e-4, 1e-3, 1e-2]
    options = SweepOptions(follow="restart", discard=discard, keep=keep)
    sweep = run_sweep(DOUBLED, "a", values, x0=[0.3, 0.1], options=options)
    for value, label in zip(values, sweep.labels[0].tolist(), strict=True):
        truth = "period-1" if value < 0.0 else "period-2"
        assert label == truth or (label == "unresolved" and abs(value) < 1e-3)


ROUND = Map(
    ("x", "y"),
    {"o": 2.0},
    {
        "x": "1.05*(cos(o)*x - sin(o)*y)/(1 + 0.1*(x**2 + y**2))",
        "y": "1.05*(sin(o)*x + cos(o)*y)/(1 + 0.1*(x**2 + y**2))",
    },
)
OVAL = Map(  # an ellipse beside 0, which is passed at changing speed
    ("x", "y"),
    {"o": 2.0},
    {
        "x": "3 + 1.2*(cos(o)*(x - 3) - 2*sin(o)*y)/(1 + 0.1*((x - 3)**2 + 4*y**2))",
        "y": "1.2*(sin(o)*(x - 3)/2 + cos(o)*y)/(1 + 0.1*((x - 3)**2 + 4*y**2))",
    },
)
ANGLE = Map(("t",), {"o": 0.1}, {"t": "t + o"}, angles=("t",))


def turning(u: float) -> HybridSystem:
    rates = {"x": "x*(1 - (x**2 + y**2)/u**2) - o*y", "y": "y*(1 - (x**2 + y**2)/u**2) + o*x"}
    return HybridSystem.smooth(rates, {"o": 0.38, "u": u}, phase=("s", "1"))


def drawn_turns(count: int) -> list[tuple[str, int, int, float, int, int, float, int]]:
    """Draw systems, fractions of a turn, distances from them, returns dropped and kept, an angle and a unit."""
    rng = np.random.default_rng(12)
    found = []
    while len(found) < count:
        q = int(rng.integers(1, 13))
        p = int(rng.integers(0, q + 1))
        if math.gcd(p, q) == 1:
            found.append(
                (
                    str(rng.choice(["flow", "flow", "round", "oval", "angle"])),
                    p,
                    q,
                    float(rng.choice([-1.0, 1.0]) * 10.0 ** rng.uniform(-9.0, -4.0)),
                    int(rng.choice([100, 300, 600, 603, 1000])),
                    int(rng.choice([50, 100, 200, 400])),
                    float(rng.uniform(0.0, TURN)),
                    int(rng.integers(-9, 10)),
                )
            )
    return found


NEARLY = [("flow", 1, 3, 2e-7 / 3, 600, 100, angle, unit) for angle in (0.2, 5.1) for unit in (0, 3, 9, -3)]
NEARLY += [("flow", 1, 4, 1e-7, 603, 100, angle, unit) for angle in (0.2, 5.1) for unit in (3, -3)]
NEARLY += [("oval", 3, 8, 4.648e-8, 600, 100, 0.5, 0), ("oval", 1, 2, 3.8537e-5, 600, 100, 0.0, 0)]


@pytest.mark.parametrize(
    ("name", "p", "q", "beyond", "discard", "keep", "angle", "unit"),
    guarding([*NEARLY, *drawn_turns(400)], *NEARLY, *drawn_turns(400)[:25], campaign=100),
)
def test_a_rotation_by_nearly_a_fraction_has_no_other_period(name, p, q, beyond, discard, keep, angle, unit):
    rotation, u = p / q + beyond, 10.0**unit
    start, options = [0.5 * math.cos(angle), 0.5 * math.sin(angle)], SweepOptions(discard=discard, keep=keep)
    if name == "flow":
        sweep = run_sweep(turning(u), "o", [rotation], x0=[u * x for x in start], options=options)
    else:
        system = {"round": ROUND, "oval": OVAL, "angle": ANGLE}[name]
        starts = {"round": start, "oval": [3.0 + start[0], start[1]], "angle": [angle]}
        sweep = run_sweep(system, "o", [TURN * rotation], x0=starts[name], options=options)
    label = sweep.labels[0, 0]
    assert label == "quasi-periodic" or (label == "unresolved" and sweep.reasons[0, 0])
