"""Branches and loci of cycles go forward wherever the cycles start, and close where their orbits come back."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cache

import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import saltus
from saltus.orbits.stability.critical import Critical
from selection import guarding

PLACES = 12
STEPS = (0.03, 0.1, 0.3)
VALUES = 20


@dataclass(frozen=True)
class Family:
    """A smooth field with a cycle, and the interval of its parameter."""

    field: dict[str, str]
    parameter: str
    value: float  # at which the cycle is found
    bounds: tuple[float, float]
    near: tuple[float, ...]
    hopf: tuple[float, float]  # the values at which the trace vanishes at the equilibrium
    folds: int
    others: dict[str, float] = field(default_factory=dict)


RATE = "Da*(1 - x)*exp(y/(1 + y/20))"  # Uppal, Ray and Poore 1974


def _reactor(cooling: float, hopf: tuple[float, float]) -> Family:
    equations = {"x": f"-x + {RATE}", "y": f"-y + 14*{RATE} - {cooling}*y"}
    return Family(equations, "Da", 0.14, (0.001, 1.0), (0.5, 2.0), hopf, 1)


FAMILIES = {
    "reactor": _reactor(2.0, (0.120818025083, 0.170788603349)),
    "another reactor": _reactor(1.9, (0.114335835963, 0.156341002683)),
    # at x = a + b, y = b / (a + b)^2 the trace is (b - a)/(a + b) - (a + b)^2
    "Schnakenberg": Family(
        {"x": "a - x + x**2*y", "y": "b - x**2*y"},
        "b",
        0.5,
        (0.05, 2.0),
        (0.6, 1.5),
        (
            brentq(lambda b: (b - 0.1) - (b + 0.1) ** 3, 0.1, 0.3),
            brentq(lambda b: (b - 0.1) - (b + 0.1) ** 3, 0.5, 1.0),
        ),
        0,
        {"a": 0.1},
    ),
    "FitzHugh and Nagumo": Family(
        {"v": "v - v**3/3 - w + i0", "w": "0.3*(v + 0.7 - 0.8*w)"},
        "i0",
        0.8,
        (0.0, 2.0),
        (2.0, 0.0),
        tuple((x + 0.7) / 0.8 - x + x**3 / 3.0 for x in (-math.sqrt(0.76), math.sqrt(0.76))),
        2,
    ),
}  # fmt: skip


@cache
def cycle_of(name: str):
    family = FAMILIES[name]
    system = saltus.HybridSystem.smooth(family.field, family.others | {family.parameter: family.value})
    return system, saltus.find_orbit(system, x0=list(family.near))


@cache
def rates(name: str):
    family = FAMILIES[name]
    names = [*family.field, family.parameter]
    texts = [sympy.sympify(text).subs(family.others) for text in family.field.values()]
    states = sympy.symbols(list(family.field))
    divergence = sum(sympy.diff(text, x) for text, x in zip(texts, states, strict=True))
    return sympy.lambdify(sympy.symbols(names), [*texts, divergence])


def by_scipy(name: str, start, period: float, value: float):
    """Return the motion from a state, with the integral of the divergence as its last component."""
    f = rates(name)
    return solve_ivp(
        lambda t, y: f(*y[:-1], value), (0.0, period), [*start, 0.0], method="LSODA", rtol=1e-11, atol=1e-12,
        dense_output=True,
    )  # fmt: skip


@cache
def branch_from(name: str, place: int, largest: float = 0.1):
    """Return the branch whose first cycle starts at a twelfth of its period."""
    family, (system, orbit) = FAMILIES[name], cycle_of(name)
    start = by_scipy(name, orbit.states[0], orbit.period, family.value).sol(place * orbit.period / PLACES)[:-1]
    again = saltus.solve_orbit(system, {family.parameter: family.value}, x0=start, period=orbit.period)
    return saltus.continue_orbit(again, family.parameter, family.bounds, steps=saltus.StepControl(largest=largest))


CASES = [(name, place, largest) for name in FAMILIES for place in range(PLACES) for largest in STEPS]
KEPT = [("reactor", 1, 0.1), ("reactor", 7, 0.3), ("Schnakenberg", 9, 0.1), ("FitzHugh and Nagumo", 5, 0.1)]


@pytest.mark.parametrize(("name", "place", "largest"), guarding(CASES, *KEPT, campaign=14))
def test_a_branch_of_cycles_is_the_same_wherever_its_first_cycle_starts(name, place, largest):
    family, branch = FAMILIES[name], branch_from(name, place, largest)
    kinds = sorted(point.type for point in branch.special_points)
    assert kinds == ["HB", "HB", *["SN"] * family.folds]
    ends = sorted(point.parameters[family.parameter] for point in branch.special_points.of_type("HB"))
    assert ends == pytest.approx(sorted(family.hopf), abs=1e-9)
    assert all("shrinks to an equilibrium" in end for end in branch.stopped)
    ways = np.sign(np.diff(branch.values))
    assert np.count_nonzero(ways[1:] != ways[:-1]) == family.folds


@pytest.mark.parametrize(("name", "place"), guarding([(name, 7) for name in FAMILIES], ("reactor", 7)))
def test_scipy_confirms_the_cycles_at_twenty_values_from_another_start(name, place):
    family, branch, other = FAMILIES[name], branch_from(name, place), branch_from(name, 1)
    low, high = float(branch.values.min()), float(branch.values.max())
    for value in low + (high - low) * (np.arange(VALUES) + 0.5) / VALUES:
        orbits, others = branch.at(value), other.at(value)
        assert sorted(o.period for o in orbits) == pytest.approx(sorted(o.period for o in others), rel=1e-8)
        for orbit in orbits:
            once = by_scipy(name, orbit.states[0], orbit.period, value)
            assert once.y[:-1, -1] == pytest.approx(orbit.states[0], abs=1e-6 * np.ptp(once.y[:-1], axis=1).max())
            seen = once.sol(np.linspace(0.0, orbit.period, 20001))[0]
            first = next(iter(family.field))
            assert (orbit.min[first], orbit.max[first]) == pytest.approx((seen.min(), seen.max()), rel=1e-5, abs=1e-6)
    for fold in branch.special_points.of_type("SN"):
        orbit = fold.solution
        once = by_scipy(name, orbit.states[0], orbit.period, orbit.parameters[family.parameter])
        assert once.y[-1, -1] == pytest.approx(0.0, abs=1e-6)  # of a planar cycle: the multiplier is 1


HODGKIN_HUXLEY = {
    "v": "I - 120*m**3*h*(v-115) - gk*n**4*(v+12) - 0.3*(v-10.599)",
    "m": "(1-m)*(0.1*(25-v)/(exp((25-v)/10)-1)) - m*4*exp(-v/18)",
    "n": "(1-n)*(0.01*(10-v)/(exp((10-v)/10)-1)) - n*0.125*exp(-v/80)",
    "h": "(1-h)*0.07*exp(-v/20) - h/(exp((30-v)/10)+1)",
}


@cache
def axon():
    system = saltus.HybridSystem.smooth(HODGKIN_HUXLEY, {"I": 0.0, "gk": 36.0})
    return saltus.continue_equilibrium(saltus.find_equilibrium(system, x0=[0.0, 0.05, 0.32, 0.6]), "I", (0.0, 200.0))


@pytest.mark.parametrize("label", guarding(["HB1", "HB2"]))
def test_cycles_of_hodgkin_and_huxley_lead_from_one_hopf_point_to_the_other(label):
    rest = axon()
    cycles = saltus.continue_orbit(saltus.switch_branch(rest[label]), "I", (0.0, 200.0))
    ends = sorted(point.parameters["I"] for point in cycles.special_points.of_type("HB"))
    assert ends == pytest.approx(sorted(rest[name].parameters["I"] for name in ("HB1", "HB2")), abs=1e-8)
    points = {kind: sorted(p.parameters["I"] for p in cycles.special_points.of_type(kind)) for kind in ("SN", "PD")}
    assert points["SN"] == pytest.approx([6.264521, 7.846547, 7.921985], abs=1e-5)
    assert points["PD"] == pytest.approx([7.849537, 7.921978], abs=1e-5)
    ways = np.sign(np.diff(cycles.values))
    assert np.count_nonzero(ways[1:] != ways[:-1]) == 3


@pytest.mark.campaign
def test_a_closed_locus_of_cycles_in_pieces_tells_each_point_once():
    cycles = saltus.continue_orbit(saltus.switch_branch(axon()["HB2"]), "I", (0.0, 200.0))
    window = {"I": (0.0, 60.0), "gk": (10.0, 60.0)}
    locus = saltus.continue_locus(cycles["PD2"], ("I", "gk"), window, steps=saltus.StepControl(max_points=120))
    assert locus.stopped == ("the locus is closed", "the locus is closed")
    places = sorted(
        tuple(point.parameters[name] for name in ("I", "gk")) for point in locus.special_points.of_type("R2")
    )
    assert places == [pytest.approx(place, abs=1e-4) for place in ((27.88594, 48.15038), (29.35898, 48.55616))]


# closed branches: growth p^2 + (r^2 - 1)^2 = 0.04 of cycles of radius r, folds at p = -0.2 and 0.2

ACROSS = {"no pieces": "-1", "pieces": "1.5", "pieces on the way": "1.1 + p"}


@pytest.mark.parametrize("across", ACROSS)
@pytest.mark.parametrize("turn", guarding([0.4, 1.9, 3.3, 5.1], 1.9))
def test_a_branch_of_cycles_closes_wherever_they_start_and_however_they_are_cut(across, turn):
    growth = "(0.04 - p**2 - (x**2 + y**2 - 1)**2)"
    equations = {"x": f"{growth}*x - y", "y": f"{growth}*y + x", "z": f"({ACROSS[across]})*z"}
    system = saltus.HybridSystem.smooth(equations, {"p": 0.0})
    radius = math.sqrt(1.2)
    start = [radius * math.cos(turn), radius * math.sin(turn), 0.0]
    orbit = saltus.solve_orbit(system, x0=start, period=2.0 * math.pi)
    branch = saltus.continue_orbit(orbit, "p", (-1.0, 1.0), steps=saltus.StepControl(max_points=300))
    assert branch.stopped == ("the branch is closed", "the branch is closed")
    folds = [(point.type, point.parameters["p"]) for point in branch.special_points]
    assert sorted(folds) == [("SN", pytest.approx(-0.2, abs=1e-9)), ("SN", pytest.approx(0.2, abs=1e-9))]


ROTATIONS = {
    "junctions": (
        {
            "u": "v",
            "v": "1.2 + p - 0.3*v - sin(u) - 0.2*sin(u - q)",
            "q": "r",
            "r": "1.2 - p - 0.3*r - sin(q) - 0.2*sin(q - u)",
        },
        [0.0, 2.0, 0.3, 2.0],
    ),
    "overdamped": (
        {"u": "1.2 + p - 0.3*sin(u) - 0.2*sin(u - q)", "q": "1.2 - p - 0.3*sin(q) - 0.2*sin(q - u)"},
        [0.0, 0.3],
    ),
}


@pytest.mark.parametrize("name", ROTATIONS)
@pytest.mark.parametrize("p", guarding([0.05, 0.1, -0.13], 0.1))
def test_a_loop_of_locked_rotations_is_closed_and_symmetric(name, p):
    equations, start = ROTATIONS[name]
    system = saltus.HybridSystem.smooth(equations, {"p": p}, angles=("u", "q"))
    branch = saltus.continue_orbit(saltus.find_orbit(system, x0=start), "p", (-0.5, 0.5))
    assert branch.stopped == ("the branch is closed", "the branch is closed")
    assert len(branch) < 100
    low, high = sorted(point.parameters["p"] for point in branch.special_points)
    assert [point.type for point in branch.special_points] == ["SN", "SN"]
    assert low == pytest.approx(-high, abs=1e-8)  # both rotators exchanged, with p -> -p


@pytest.mark.parametrize("order", [("a", "b"), ("b", "a")])
def test_a_cusp_is_told_once_and_true_turning_points_stay(order):
    """Folds of x' = r + h x - x^3 with r = a - b, h = a + b have 2 a = 3 x^2 - 2 x^3, 2 b = 3 x^2 + 2 x^3."""
    system = saltus.HybridSystem.smooth({"x": "(a - b) + (a + b)*x - x**3"}, {"a": 0.6, "b": 0.6})
    branch = saltus.continue_equilibrium(saltus.find_equilibrium(system, x0=[1.1]), "a", (-3.0, 3.0))
    window = dict.fromkeys(order, (-3.0, 3.0))
    locus = saltus.continue_locus(branch.special_points.of_type("SN")[0], order, window)
    points = sorted(
        (point.type, point.of, point.parameters["a"], point.parameters["b"]) for point in locus.special_points
    )
    assert points == [
        ("CP", "", pytest.approx(0.0, abs=1e-9), pytest.approx(0.0, abs=1e-9)),
        ("TP", "a", pytest.approx(0.5, abs=1e-9), pytest.approx(2.5, abs=1e-9)),
        ("TP", "b", pytest.approx(2.5, abs=1e-9), pytest.approx(0.5, abs=1e-9)),
    ]
    again = saltus.continue_locus(locus["CP1"], order, window)
    assert sorted(point.type for point in again.special_points) == ["CP", "TP", "TP"]


def test_the_sense_of_a_null_vector_is_the_same_in_every_phase_plane():
    growth = "(mu + (x**2 + y**2) - (x**2 + y**2)**2)"
    equations = {"x": f"{growth}*x - y", "y": f"{growth}*y + x", "z": "x - z"}
    system = saltus.HybridSystem.smooth(equations, {"mu": 0.1})
    fold = saltus.continue_orbit(saltus.find_orbit(system, x0=[1.0, 0.0, 0.0]), "mu", (-0.3, 0.2))["SN1"].solution
    problem, u = fold.problem(), fold.unknowns
    condition = Critical(problem, 1.0, u, problem.evaluate(u)[1])
    flow, senses = problem.flow_at_start(u), []
    for angle in (-1.4, 1.4, 0.3, -1.2, 1.3, 0.9, -1.4):  # of the plane's normal with the flow
        turned = math.cos(angle) * flow + math.sin(angle) * np.array([-flow[1], flow[0], flow[2]])
        condition.turn(u)
        problem.phase_plane = np.concatenate([u[:3], turned])
        condition.evaluate(u, np.empty(0), problem.evaluate(u)[1])
        condition.adjust()
        senses.append(math.copysign(1.0, condition.twist))
    assert len(set(senses)) == 1


CASCADES = [(constant, way) for constant in (0.002, 0.001, 0.005) for way in ("one parameter", "four")]


@pytest.mark.parametrize(("constant", "way"), guarding(CASCADES, (0.002, "one parameter")))
def test_a_mitotic_cascade_relaxes_on_one_branch_from_its_hopf_point(constant, way):
    """Goldbeter (1991): enzymes next to saturation make a cycle with fronts; SciPy has its period in the middle.

    Decays are slow on the small cycle that begins the branch, and hundreds of times faster where enzymes saturate.
    """
    K1, K2, K3, K4 = ("K",) * 4 if way == "one parameter" else ("K1", "K2", "K3", "K4")
    fields = {
        "C": "vi - 0.25*X*C/(0.02 + C) - 0.01*C",
        "M": f"3*C/(0.5 + C)*(1 - M)/({K1} + 1 - M) - 1.5*M/({K2} + M)",
        "X": f"M*(1 - X)/({K3} + 1 - X) - 0.5*X/({K4} + X)",
    }
    system = saltus.HybridSystem.smooth(fields, {"vi": 0.025} | dict.fromkeys((K1, K2, K3, K4), constant))
    rest = saltus.continue_equilibrium(saltus.find_equilibrium(system, x0=[0.01] * 3), "vi", (0.005, 0.1))
    cycles = saltus.continue_orbit(saltus.switch_branch(rest["HB1"]), "vi", (0.005, 0.1))
    assert sorted(point.type for point in cycles.special_points) == ["HB", "SN"]
    assert "vi = 0.1: bound reached" in cycles.stopped
    assert len(cycles) < 100
    assert cycles.audit.passed, cycles.audit
    (orbit,) = cycles.at(0.05)

    def field(_t, u):
        C, M, X = u
        up = 3.0 * C / (0.5 + C) * (1.0 - M) / (constant + 1.0 - M)
        on = M * (1.0 - X) / (constant + 1.0 - X)
        return [
            0.05 - 0.25 * X * C / (0.02 + C) - 0.01 * C,
            up - 1.5 * M / (constant + M),
            on - 0.5 * X / (constant + X),
        ]

    def half(_t, u):
        return u[2] - 0.5

    half.direction = 1.0
    motion = solve_ivp(field, (0.0, 400.0), [0.3, 0.1, 0.1], "LSODA", rtol=1e-10, atol=1e-13, events=half)
    assert orbit.period == pytest.approx(float(np.diff(motion.t_events[0])[-1]), rel=1e-6)
