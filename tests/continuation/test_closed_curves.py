"""Branches and loci that are closed curves: each is traced once, whatever its size, its steps and its start."""

from __future__ import annotations

import math
from collections import Counter

import numpy as np
import pytest

import saltus
from selection import CAMPAIGN, guarding

STEPS = {
    "default": saltus.StepControl(),
    "long": saltus.StepControl(largest=0.5, deviation=1e-2, angle=0.8),
    "short": saltus.StepControl(largest=0.02, initial=0.005),
    "exact": saltus.StepControl(deviation=3e-6),
    "rough": saltus.StepControl(deviation=3e-3),
}
ROUND = "({z} - 4)**2 + p**2 - w**2"  # a circle of radius w
THIN = "0.1*w*(({z} - 4)**2/w**2 + p**2 - 1)"  # an ellipse: its two sheets are 2 w apart
CUSPED = "a - ({z} - 4)**3/3 + ({z} - 4)*(1 - b**2)"  # folds at a = -2/3 sin(s)^3, b = cos(s): cusps at s = 0, pi


def circle(size: float, angle: float) -> tuple[dict[str, float], float]:
    """Return parameters and z at an angle of the circle."""
    return {"p": size * math.sin(angle), "w": size}, 4.0 + size * math.cos(angle)


def ellipse(size: float, angle: float) -> tuple[dict[str, float], float]:
    """Return parameters and z at an angle of the ellipse."""
    return {"p": math.sin(angle), "w": size}, 4.0 + size * math.cos(angle)


def rest(formula: str, parameters: dict[str, float], z: float) -> saltus.Equilibrium:
    """Return the equilibrium z of z' = formula."""
    system = saltus.HybridSystem.smooth({"z": formula.format(z="z")}, parameters=parameters)
    return saltus.find_equilibrium(system, x0=[z])


def cycle(formula: str, parameters: dict[str, float], z: float) -> saltus.PeriodicOrbit:
    """Return the cycle of radius root z of a planar system whose radius grows at the rate of the formula."""
    rate = formula.format(z="(x**2 + y**2)")
    system = saltus.HybridSystem.smooth({"x": f"-y + x*({rate})", "y": f"x + y*({rate})"}, parameters=parameters)
    return saltus.find_orbit(system, x0=[math.sqrt(z), 0.0])


def folded(curve: saltus.Branch | saltus.Locus, kind: str) -> list[float]:
    """Return the values of the first parameter at the special points of a type, in order; the curve is closed."""
    assert all(reason.endswith("is closed") for reason in curve.stopped)
    name = curve.special_points[0].varied[0]
    return sorted(point.parameters[name] for point in curve.special_points if point.type == kind)


@pytest.mark.parametrize(
    ("at", "formula", "size", "angle", "steps"),
    guarding(
        [
            (at, formula, size, angle, steps)
            for at, formula, sizes in (
                (circle, ROUND, (1.0, 0.1, 1e-2, 1e-3)),
                (ellipse, THIN, (0.1, 1e-2, 1e-3, 1e-4)),
            )
            for size in sizes
            for angle in (0.3, 2.0, 4.0)
            for steps in STEPS
        ],
        (circle, ROUND, 1.0, 0.3, "exact"),
        (circle, ROUND, 1e-2, 0.3, "default"),
        (circle, ROUND, 1e-3, 4.0, "long"),
        (ellipse, THIN, 1e-2, 4.0, "exact"),
        (ellipse, THIN, 1e-4, 0.3, "rough"),
    ),
)
def test_a_loop_of_equilibria_has_its_two_folds_once(at, formula, size, angle, steps):
    parameters, z = at(size, angle)
    branch = saltus.continue_equilibrium(rest(formula, parameters, z), "p", bounds=(-3, 3), steps=STEPS[steps])
    half = size if at is circle else 1.0
    np.testing.assert_allclose(folded(branch, "SN"), [-half, half], rtol=1e-6)


@pytest.mark.parametrize(
    ("at", "formula", "size", "angle", "steps"),
    guarding(
        [
            (at, formula, size, angle, steps)
            for at, formula, sizes in ((circle, ROUND, (1.0, 1e-2, 3e-3)), (ellipse, THIN, (0.3, 1e-2, 3e-3)))
            for size in sizes
            for angle in (2.0, 3.4)
            for steps in STEPS
        ],
        (circle, ROUND, 1e-2, 2.0, "long"),
        (ellipse, THIN, 1e-2, 2.0, "default"),
        campaign=8,
    ),
)
def test_a_loop_of_cycles_has_its_two_folds_once(at, formula, size, angle, steps):
    parameters, z = at(size, angle)  # on the side of 4 where cycles attract
    branch = saltus.continue_orbit(cycle(formula, parameters, z), "p", bounds=(-3, 3), steps=STEPS[steps])
    half = size if at is circle else 1.0
    np.testing.assert_allclose(folded(branch, "SN"), [-half, half], rtol=1e-5)


@pytest.mark.parametrize(
    ("kind", "angle", "label", "steps"),
    guarding(
        [
            (kind, angle, label, steps)
            for kind in ("rest", "cycle")
            for angle in (0.4, 1.3, 2.5)
            for label in ("SN1", "SN2")
            for steps in STEPS
        ],
        ("rest", 1.3, "SN2", "exact"),
        ("rest", 2.5, "SN1", "long"),
        ("cycle", 0.4, "SN2", "default"),
        campaign=8,
    ),
)
def test_a_closed_locus_of_folds_has_its_two_cusps_once(kind, angle, label, steps):
    b = math.cos(angle)
    solution = (rest if kind == "rest" else cycle)(CUSPED, {"a": 0.0, "b": b}, 4.0 + math.sqrt(3.0 - 3.0 * b * b))
    follow = saltus.continue_equilibrium if kind == "rest" else saltus.continue_orbit
    start = follow(solution, "a", bounds=(-3, 3))[label]
    locus = saltus.continue_locus(start, ("b", "a"), {"a": (-3, 3), "b": (-3, 3)}, steps=STEPS[steps])
    np.testing.assert_allclose(folded(locus, "CP"), [-1.0, 1.0], rtol=1e-6)
    a, b = (locus.values[:, locus.names.index(name)] for name in "ab")
    np.testing.assert_allclose((1.5 * np.abs(a)) ** (2.0 / 3.0), 1.0 - b**2, atol=1e-5)


@pytest.mark.parametrize("label", [pytest.param("PD1", marks=CAMPAIGN), pytest.param("PD2", marks=CAMPAIGN)])
def test_the_closed_doubling_locus_of_a_nerve_has_its_two_resonances_once(label):
    """The rates of Hodgkin and Huxley lose digits where they are 0/0; the two runs tell the same points."""
    nerve = saltus.HybridSystem.smooth(
        {
            "v": "I - 120*m**3*h*(v - 115) - gk*n**4*(v + 12) - 0.3*(v - 10.599)",
            "m": "(1 - m)*(0.1*(25 - v)/(exp((25 - v)/10) - 1)) - m*4*exp(-v/18)",
            "n": "(1 - n)*(0.01*(10 - v)/(exp((10 - v)/10) - 1)) - n*0.125*exp(-v/80)",
            "h": "(1 - h)*0.07*exp(-v/20) - h/(exp((30 - v)/10) + 1)",
        },
        parameters={"I": 0.0, "gk": 36.0},
    )
    still = saltus.continue_equilibrium(
        saltus.find_equilibrium(nerve, x0=[0.0, 0.05, 0.32, 0.6]), "I", bounds=(0.0, 200.0)
    )
    branch = saltus.continue_orbit(saltus.switch_branch(still["HB2"]), "I", bounds=(0.0, 200.0))
    locus = saltus.continue_locus(branch[label], ("I", "gk"), {"I": (0.0, 60.0), "gk": (10.0, 60.0)})
    np.testing.assert_allclose(folded(locus, "R2"), [27.885936, 29.358980], rtol=1e-6)
    assert Counter(point.type for point in locus.special_points)["TP"] == 4


# tongues: round one, a branch comes back to its start with another of the orbit's points first

DELAYED = saltus.Map(("x", "y"), {"r": 2.18}, {"x": "r*x*(1 - y)", "y": "x"})
PREY = saltus.Map(("x", "y"), {"a": 3.12}, {"x": "a*x*(1 - x) - 3.5*x*y", "y": "3.5*x*y"})
FED = saltus.HybridSystem(
    ("S", "x", "y"), {"f": 0.8},
    {"grow": saltus.Mode({"S": "-4*S/(0.3 + S)*x", "x": "4*S/(0.3 + S)*x - 3*x/(0.3 + x)*y", "y": "3*x/(0.3 + x)*y"})},
    [saltus.Transition("grow", "grow", at_phase=0, reset={"S": "S*(1 - f) + 3*f", "x": "(1 - f)*x", "y": "(1 - f)*y"})],
    phase=("th", "2*pi"), name="pulsed food chain",
)  # fmt: skip
TONGUES = [
    (name, first)
    for name, count in (("delayed logistic, 7", 7), ("predator and prey, 13", 13), ("predator and prey, 58", 58),
                        ("pulsed food chain, 9", 9))
    for first in range(0, count, 4)
]  # fmt: skip


def in_tongue(name: str) -> tuple[saltus.Map | saltus.HybridSystem, str, float, list[float], int]:
    """Return a system with a parameter, a value in a tongue, a start on the way there, and the period."""
    if "chain" in name:
        return FED, "f", 0.8, [1.0, 0.1, 0.1], 9
    if "delayed" in name:
        return DELAYED, "r", 2.18, [0.47, 0.45], 7
    return PREY, "a", 3.12 if "13" in name else 3.18, [0.35, 0.3], 13 if "13" in name else 58


@pytest.mark.parametrize(
    ("name", "first"),
    guarding(
        TONGUES,
        ("delayed logistic, 7", 0),
        ("predator and prey, 13", 4),
        ("pulsed food chain, 9", 0),
        campaign=7,
        spread=True,
    ),
)
def test_a_tongue_has_its_two_folds_once_wherever_its_orbit_starts(name, first):
    system, parameter, value, x0, period = in_tongue(name)
    orbit = saltus.find_orbit(system, {parameter: value}, x0=x0)
    if isinstance(system, saltus.Map):
        start = orbit.points[first].tolist()
    else:
        start = saltus.simulate(system, {parameter: value}, list(orbit.x0[:3]), periods=9 + first).x_end[:3].tolist()
    orbit = saltus.find_orbit(system, {parameter: value}, x0=start)
    branch = saltus.continue_orbit(orbit, parameter, (0.02, 4.0) if parameter != "f" else (0.02, 0.99))
    assert (orbit.period if isinstance(system, saltus.Map) else round(orbit.period)) == period
    assert [point.type for point in branch.special_points] == ["SN", "SN"]
    low, high = folded(branch, "SN")
    assert low < value < high
    assert branch.audit.passed
