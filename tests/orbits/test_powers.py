"""Broken powers other than roots that vanish on a surface, and broken powers of parameters."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from saltus import Average, HybridSystem, Mode, Transition, find_orbit, lyapunov_spectrum, simulate
from saltus.errors import DefinitionError, DivergenceError
from saltus.system.evaluate import evaluate


def stop(term):
    """A driven oscillator with a Hertzian stop at x = 1/2 and another force there."""
    free = "cos(s) - 0.1*v - x"
    return HybridSystem(
        ("x", "v"),
        {"w": 1.0, "d": 0.5, "e": 1.0, "a": 0.25},
        {"free": Mode({"x": "v", "v": free}), "in": Mode({"x": "v", "v": f"{free} - 10*(x - d)**(3/2) - {term}"})},
        [Transition("free", "in", "x - d", 1, name="touch"), Transition("in", "free", "x - d", -1, name="release")],
        phase=("s", "w"),
    )


def period_of_scipy(x, force):
    """The state after a period, its events met by SciPy."""
    t, inside = 0.0, x[0] > 0.5
    while t < 2.0 * math.pi:

        def surface(t, x):
            return x[0] - 0.5

        def field(t, x, inside=inside):
            depth = max(x[0] - 0.5, 0.0) if inside else 0.0
            push = 10.0 * depth**1.5 + force(depth, x[1]) if inside else 0.0
            return [x[1], math.cos(t) - 0.1 * x[1] - x[0] - push]

        surface.terminal, surface.direction = True, -1.0 if inside else 1.0
        found = solve_ivp(field, (t, 2.0 * math.pi), x, method="DOP853", events=surface, rtol=1e-12, atol=1e-13)
        t, x, inside = found.t[-1], found.y[:, -1], not inside
    return x


@pytest.mark.parametrize(
    ("term", "force"),
    [
        ("e*(x - d)**(1/4)*v", lambda h, v: h**0.25 * v),
        ("e*(x - d)**a*v", lambda h, v: h**0.25 * v),
        ("e*(x - d)**0.7", lambda h, v: h**0.7),
    ],
)
def test_motions_with_a_broken_power_of_what_vanishes_are_those_of_scipy(term, force):
    motion = simulate(stop(term), {}, [0.0, 0.0], periods=1, tolerance=(1e-11, 1e-12))
    assert {"touch", "release"} <= set(motion.events["name"])
    assert motion.x_end[:2] == pytest.approx(period_of_scipy([0.0, 0.0], force), abs=1e-9)


@pytest.mark.parametrize(("power", "exponent"), [("3/4", 0.75), ("2/3", 2 / 3), ("0.7", 0.7), ("5/4", 1.25)])
def test_multipliers_with_a_power_above_a_half_are_those_of_scipy(power, exponent):
    orbit = find_orbit(stop(f"e*(x - d)**({power})*v"), {"e": 0.3}, [0.0, 0.0])
    x, step, rows = np.array(orbit.x0), 1e-4, []

    def force(h, v):
        return 0.3 * h**exponent * v

    assert period_of_scipy(x, force) == pytest.approx(x, abs=1e-9)
    for along in np.eye(2):
        near, far = (
            period_of_scipy(x + k * step * along, force) - period_of_scipy(x - k * step * along, force) for k in (1, 2)
        )
        rows.append((8.0 * near - far) / (12.0 * step))
    matrix = np.array(rows).T
    assert np.prod(orbit.multipliers) == pytest.approx(np.linalg.det(matrix), abs=1e-5)
    assert np.sum(orbit.multipliers) == pytest.approx(np.trace(matrix), abs=1e-5)


def test_multipliers_with_a_conservative_force_have_the_product_of_the_damping():
    orbit = find_orbit(stop("e*(x - d)**(3/4)"), {}, [0.0, 0.0])
    assert np.prod(orbit.multipliers) == pytest.approx(math.exp(-0.1 * orbit.period), rel=1e-9)


@pytest.mark.parametrize("term", ["(x - d)**(1/4)*v", "(x - d)**0.3", "(sqrt(x - d) + (x - d)**(3/4))*v"])
def test_powers_whose_derivatives_are_too_steep_are_told_where_these_are_wanted(term):
    system = stop(term)
    start = simulate(system, {}, [0.0, 0.0], periods=10).x_end
    for call in (find_orbit, lambda *args: lyapunov_spectrum(*args, average=Average(periods=10))):
        with pytest.raises(DefinitionError, match="must be 1/2 alone, or above 1/2, where it vanishes on a surface"):
            call(system, {}, start)


@pytest.mark.parametrize("factor", ["sqrt(k)", "k**0.3", "k**a"])
def test_a_broken_power_of_a_negative_parameter_is_no_number(factor):
    system = HybridSystem(("x",), {"k": 1.0, "a": 0.3}, {"m": Mode({"x": f"1 - {factor}*x"})})
    assert simulate(system, {}, [0.2], t_end=1.0).x_end[0] == pytest.approx(1.0 - 0.8 * math.exp(-1.0), abs=1e-9)
    with pytest.raises(DivergenceError, match="the vector field is not finite"):
        simulate(system, {"k": -1.0}, [0.2], t_end=1.0)


@pytest.mark.parametrize("text", ["x**(1/2)", "x**0.3", "x**a", "sqrt(x)"])
def test_a_broken_power_of_a_negative_state_is_zero_in_every_evaluation(text):
    system = HybridSystem(("x",), {"a": 0.3}, {"m": Mode({"x": text})})
    for x in (-0.5, 0.5):
        compiled = system.compiled.field(0, np.array([x]), system.parameter_vector({}))[0]
        assert evaluate(system, text, [[x]], [0])[0] == pytest.approx(compiled, rel=1e-14)
        assert (compiled == 0.0) == (x < 0.0)


def test_whole_powers_of_negative_states_keep_their_sign():
    system = HybridSystem(("x",), {"a": 3.0}, {"m": Mode({"x": "x**a + x**3"})})
    assert system.compiled.field(0, np.array([-0.5]), system.parameter_vector({}))[0] == -0.25
    assert evaluate(system, "x**a + x**3", [[-0.5]], [0])[0] == -0.25
