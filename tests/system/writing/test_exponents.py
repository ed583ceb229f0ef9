"""Forces that are next to nothing for most of a period, then a pulse: each way to follow a motion meets the pulse.

The motion ``x' = -x + A g(s - C)`` is the integral of the pulse, weighted by the decay since.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
import sympy
from scipy.integrate import quad

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit, run_sweep, simulate
from saltus.options import SweepOptions
from saltus.system.derivatives import Symbolic
from saltus.system.writing.exponents import Exponent, exponent_of, exponents_in
from saltus.system.writing.taylor import series_of_mode
from selection import guarding

TURN = 2.0 * math.pi
CENTRES = (0.4, 1.5, 3.0, 4.0, 5.5)
"""Phases of the pulse: behind a short rest, and behind a long one in which the steps grow."""

PULSES = {
    "gauss": ("exp({K}*(cos({u}) - 1))", lambda u, k: math.exp(k * (math.cos(u) - 1.0)), (60.0, 300.0, 10_000.0)),
    "logistic": (
        "1/(1 + exp(-{K}*(cos({u}) - 0.99)))",
        lambda u, k: 1.0 / (1.0 + math.exp(-k * (math.cos(u) - 0.99))),
        (100.0, 300.0),
    ),
    "tanh": ("1 + tanh({K}*(cos({u}) - 0.99))", lambda u, k: 1.0 + math.tanh(k * (math.cos(u) - 0.99)), (100.0, 900.0)),
    "cosh": ("1/cosh({K}*(1 - cos({u})))", lambda u, k: 1.0 / math.cosh(k * (1.0 - math.cos(u))), (60.0, 300.0)),
    "switch": (
        "1 + tanh({K}*(cos({u}) - 1) + 8)",
        lambda u, k: 1.0 + math.tanh(k * (math.cos(u) - 1.0) + 8.0),
        (1e4, 1e6),
    ),
    "resonance": (
        "(1 + {K}*sin(({u})/2)**2)**-8",
        lambda u, k: (1.0 + k * math.sin(u / 2.0) ** 2) ** -8.0,
        (1e3, 1e5),
    ),
    "base": ("2**({K}*(cos({u}) - 1))", lambda u, k: 2.0 ** (k * (math.cos(u) - 1.0)), (500.0,)),
}

HIGH = {
    "product": (
        "1/(1 + 1e5*sin(({u})/2)**2)/(1 + 2e5*sin(({u})/2)**2)**2/(1 + 3e5*sin(({u})/2)**2)**2",
        lambda u, _: 1.0 / math.prod((1.0 + n * 1e5 * math.sin(u / 2.0) ** 2) ** min(n, 2) for n in (1, 2, 3)),
    ),
    "power of a parameter": ("((1 + cos({u}))/2)**(100*{K})", lambda u, _: ((1.0 + math.cos(u)) / 2.0) ** 6000),
    "even power": ("cos({u})**80", lambda u, _: math.cos(u) ** 80),
    "broken power": ("((1 + cos({u}))/2 + 1e-9)**400.5", lambda u, _: ((1.0 + math.cos(u)) / 2.0 + 1e-9) ** 400.5),
    "erf": ("1 + erf(100*(cos({u}) - 0.99))", lambda u, _: math.erf(100.0 * (math.cos(u) - 0.99)) + 1.0),
}


def pulsed(formula):
    """Return a decaying state with a pulse of amplitude A around the phase C, of sharpness K."""
    force = formula.format(K="K", u="s - C")
    return HybridSystem.smooth({"x": f"-x + A*({force})"}, {"A": 1.0, "C": 1.0, "K": 60.0}, phase=("s", "1"))


def settled(pulse, sharpness, centre, edges=()):
    """Return x at phase 0 after infinitely many periods, and after one from x = 0."""
    middles = [centre + turn - TURN for turn in (-TURN / 2, 0.0, TURN / 2, TURN)]
    near = (-0.5, -0.2, -0.14, -0.1, -0.05, -0.02, 0.0, 0.02, 0.05, 0.1, 0.14, 0.2, 0.5, *edges)
    points = sorted({middle + d for middle in middles for d in near if -TURN < middle + d < 0.0})
    one = quad(
        lambda s: pulse(s - centre, sharpness) * math.exp(s), -TURN, 0.0, points=points, epsabs=0.0, epsrel=1e-12,
        limit=1000,
    )[0]  # fmt: skip
    return one / -math.expm1(-TURN), one


@pytest.mark.parametrize("name", guarding(PULSES, "gauss"))
@pytest.mark.parametrize("lanes", [False, True], ids=["alone", "lanes"])
def test_a_sweep_meets_the_pulse(name, lanes):
    formula, pulse, sharps = PULSES[name]
    system = pulsed(formula)
    options = SweepOptions(follow="restart", discard=20, keep=3, lanes=lanes)
    for sharpness in sharps:
        for centre in CENTRES[::2]:
            place = {"C": centre, "K": sharpness}
            sweep = run_sweep(system, "A", [1.0, 2.0], parameters=place, x0=[0.0], options=options)
            wanted = settled(pulse, sharpness, centre)[0] * np.array([1.0, 2.0])
            np.testing.assert_allclose(sweep.points[0, :, -1, 0], wanted, rtol=3e-7, err_msg=f"{place}")


@pytest.mark.parametrize("name", [*PULSES, *HIGH])
def test_a_motion_and_an_orbit_meet_the_pulse(name):
    formula, pulse, *sharps = PULSES.get(name) or HIGH[name]
    system = pulsed(formula)
    for sharpness in sharps[0] if sharps else (60.0,):
        for centre in CENTRES:
            place = {"C": centre, "K": sharpness}
            periodic, one = settled(pulse, sharpness, centre)
            motion = simulate(system, place, x0=[0.0], t_end=TURN)
            assert motion.x_end[0] == pytest.approx(one, rel=3e-9), place
            orbit = find_orbit(system, place, x0=[0.0])
            assert orbit.x0[0] == pytest.approx(periodic, rel=1e-9), place
            assert orbit.multipliers[0].real == pytest.approx(math.exp(-orbit.period), rel=1e-9), place


def test_a_branch_meets_a_pulse_that_moves_and_sharpens():
    formula, pulse, _ = PULSES["gauss"]
    system = pulsed(formula)
    for name, place, (low, high) in (("C", {"K": 300.0}, (1.0, 6.0)), ("K", {"C": 4.0}, (20.0, 3000.0))):
        branch = continue_orbit(find_orbit(system, place | {name: low}, x0=[0.0]), name, (low, high))
        for i in range(0, len(branch), 4):
            orbit = branch.solution(i)
            wanted = settled(pulse, orbit.parameters["K"], orbit.parameters["C"])[0]
            assert orbit.x0[0] == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("centre", CENTRES)
def test_a_window_between_two_kinks_is_met(centre):
    """The modulus of what is negative but for a moment."""
    window = "(abs(1 + K*(cos(s - C) - 1)) + 1 + K*(cos(s - C) - 1))/2"
    system = HybridSystem.smooth({"x": f"-x + {window}"}, {"C": centre, "K": 1e4}, phase=("s", "1"))
    half = math.acos(1.0 - 1e-4)
    wanted = settled(lambda u, k: max(0.0, 1.0 + k * (math.cos(u) - 1.0)), 1e4, centre, (-half, half))[1]
    motion = simulate(system, x0=[0.0], periods=1)
    assert motion.x_end[0] == pytest.approx(wanted, rel=1e-5)
    assert len(motion.step_times) < 500


def test_a_pulse_of_a_state_is_met():
    """The pulse of an oscillator's position, once a period of its own."""
    system = HybridSystem.smooth({"a": "b", "b": "-a", "x": "-x + exp(1000*(a - 1))"}, phase=("s", "1"))
    motion = simulate(system, x0=[math.cos(4.0), math.sin(4.0), 0.0], periods=1)
    wanted = settled(PULSES["gauss"][1], 1000.0, 4.0)[1]
    assert motion.x_end[2] == pytest.approx(wanted, rel=1e-8)


def test_what_has_an_exponent():
    x, p = sympy.symbols("x p", real=True)
    assert exponent_of(sympy.exp(p * x), {p}) == Exponent(p * x)
    assert exponent_of(sympy.tanh(x), {p}) == Exponent(x, rest=45.0)
    assert exponent_of(x**p, {p}) is None
    assert exponent_of(x**3, {p}) is None
    assert exponent_of(x**-2, {p}) is None
    assert exponent_of(x**80, {p}) == Exponent(40 * sympy.log(x**2))
    assert exponent_of(x**-3, {p}) == Exponent(-3 * sympy.log(x**2) / 2)
    assert exponent_of(sympy.cos(x) ** p, {p}) is None
    assert exponent_of(sympy.cos(x) ** p, {p}, x) == Exponent(p * sympy.log(sympy.cos(x) ** 2) / 2)
    assert exponents_in([sympy.exp(p), sympy.sin(x), x * sympy.exp(x), sympy.exp(x) + 1], {p}) == [Exponent(x)]


@pytest.mark.parametrize("centre", [1.5, 4.0])
def test_a_stiff_flow_meets_the_pulse(centre):
    """With the pulse at 1.5 the drive is exactly nothing at phase 0, where y = 0 is no invariant plane all the same."""
    pulse = PULSES["gauss"][1]
    system = HybridSystem.smooth(
        {"x": "-R*(x - y)", "y": "-y + exp(K*(cos(s - C) - 1))"}, {"R": 1e6, "K": 900.0, "C": centre}, phase=("s", "1")
    )
    periodic, one = settled(pulse, 900.0, centre)
    motion = simulate(system, x0=[0.0, 0.0], periods=1)
    assert motion.implicit_steps > 0
    assert motion.x_end[1] == pytest.approx(one, rel=1e-9)
    orbit = find_orbit(system, x0=[0.0, 0.0])
    assert orbit.implicit
    assert orbit.x0[1] == pytest.approx(periodic, rel=1e-10)
    branch = continue_orbit(orbit, "K", (300.0, 3000.0))
    for i in range(0, len(branch), 3):
        there = branch.solution(i)
        assert there.x0[1] == pytest.approx(settled(pulse, there.parameters["K"], centre)[0], rel=1e-9)


@pytest.mark.parametrize("centre", CENTRES[1::2])
def test_a_bump_of_a_wall_is_met(centre):
    """A wall that comes in once a period for a moment, and sets a state that rests in motion."""
    bump = "x - 1 + 2*exp(3000*(cos(s - C) - 1))"
    hit = Transition("free", "free", bump, 1, {"x": "x + A"}, name="hit")
    system = HybridSystem(
        ("x",), {"A": 1.0, "C": centre}, {"free": Mode({"x": "-x"})}, [hit], phase=("s", "1"), name="struck"
    )
    motion = simulate(system, x0=[0.0], periods=3)
    assert [event["name"] for event in motion.events if event["kind"] == "event"] == ["hit"] * 3
    orbit = find_orbit(system, x0=[0.0])
    assert orbit.signature == (("free", "hit"),)
    for lanes in (False, True):
        options = SweepOptions(follow="restart", discard=20, keep=3, lanes=lanes)
        sweep = run_sweep(system, "A", [1.0, 2.0], x0=[0.0], options=options)
        assert sweep.points[0, 0, -1, 0] == pytest.approx(orbit.x0[0], rel=1e-7)


def test_an_exponent_that_jumps_ends_no_motion():
    """The exponent jumps by 100 where x passes 0, at t = 1: from there on x falls twice as fast."""
    system = HybridSystem.smooth({"x": "-1 - tanh(50 - 50*sign(x))"})
    motion = simulate(system, x0=[1.0], t_end=2.0)
    assert motion.x_end[0] == pytest.approx(-2.0, abs=1e-8)


def test_a_steep_switch_takes_few_steps():
    """Both sides of a logistic switch are at rest: a hundred thousand in its exponent is no hundred thousand steps."""
    system = HybridSystem.smooth({"x": "1/(1 + exp(-1e5*sin(s))) - x"}, phase=("s", "1"))
    motion = simulate(system, x0=[0.0], periods=1)
    sharp = -math.expm1(-math.pi) * math.exp(-math.pi)
    softness = math.log(2.0) / 1e5 * -math.expm1(-2.0 * math.pi)  # what the switch lets through at 2 pi, not at 0
    assert motion.x_end[0] == pytest.approx(sharp + softness, rel=1e-7)
    assert len(motion.step_times) < 500


def test_an_exponent_of_two_functions_goes_no_further_than_either_allows():
    both = HybridSystem.smooth({"x": "exp(9*sin(s)) + tanh(9*sin(s)) - x"}, phase=("s", "1"))
    series = series_of_mode(Symbolic(both), 0, 4, str)
    assert [len(set(terms)) for terms in series.ways] == [2] * 4
