"""`OrbitProblem.second` is the derivative of the Jacobian times a vector, for all kinds of ends and parameters."""

from __future__ import annotations

import math

import numpy as np
import pytest

import systems
from oracles.closed_forms import DELAYED, ImpactOrbit, TableJump
from oracles.tapping import Tapping
from saltus import HybridSystem, Mode, Transition, continue_orbit, solve_orbit
from saltus.afm import table1, tapping_mode
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, EVENT_END, MEAN_END, PHASE_END, TOUCH_END, Signature


def problem_of(orbit, *names):
    """The orbit's equations with the named parameters active in units of their own, and the point."""
    system = orbit.system
    p = system.parameter_vector(orbit.parameters)
    active = [system.parameter_names.index(name) for name in names]
    scales = np.array([0.7 * abs(p[i]) or 1.0 for i in active])
    problem = OrbitProblem(system, orbit.form, p, active, scales, orbit.tolerance)
    u = np.append(orbit.unknowns, p[active] / scales)
    problem.start(u)
    return problem, u


def sizes(problem, u):
    period = float(np.abs(u[problem.n : problem.size : problem.n + 1]).sum())
    return np.append(np.tile(np.append(problem.state_scale, period), problem.segments), np.ones(u.size - problem.size))


def difference(problem, u, v, t, step):
    """d(J v)/dt along t, by central differences of order 4."""

    def slope(h):
        return problem.evaluate(u + h * t)[1] @ v

    one, two = (slope(k * step) - slope(-k * step) for k in (1.0, 2.0))
    return (8.0 * one - two) / (12.0 * step)


def assert_second(problem, u, pairs, step=1e-4, tolerance=1e-9):
    """S(v) t agrees with differences, row by row, relative to the terms of that row.

    The differences' own error at this step is a few times 1e-11: step^4 times fifth derivatives, 1e-15 over the step.
    """
    for v, t in pairs:
        S = problem.second(u, v)
        assert S.shape == (problem.size, u.size)
        got, wanted = S @ t, difference(problem, u, v, t, step)
        reach = float(np.abs(t / sizes(problem, u)).max())
        floor = np.abs(S) @ np.abs(t) + np.abs(problem.evaluate(u)[1]) @ np.abs(v) * reach
        np.testing.assert_array_less(
            np.abs(got - wanted), tolerance * np.maximum(floor, 1e-6), err_msg=f"{got - wanted}"
        )


def any_pairs(problem, u, count=4, seed=5):
    """Random directions, of the unknowns' sizes."""
    rng = np.random.default_rng(seed)
    size = sizes(problem, u)
    return [(size * rng.standard_normal(u.size), size * rng.standard_normal(u.size)) for _ in range(count)]


def tangential_pairs(problem, u, count=4, seed=5):
    """Directions that keep to all surfaces: null vectors of the Jacobian without one closing row."""
    rng = np.random.default_rng(seed)
    J = problem.evaluate(u)[1]
    size = sizes(problem, u)
    kept = np.delete(J, problem.size - 2, axis=0) * size
    rank = np.linalg.matrix_rank(kept, tol=1e-9 * np.abs(kept).max())
    null = np.linalg.svd(kept)[2][rank:]
    assert len(null) == u.size - problem.size + 1
    return [tuple(size * (rng.standard_normal(len(null)) @ null) for _ in range(2)) for _ in range(count)]


def impact_orbit(w=1.1, m=1, U=0.5):
    form = ImpactOrbit(w, m)
    start = [("free", "impact", form.after_impact(U), form.period)]
    return solve_orbit(systems.impact_oscillator(), {"w": w, "A": form.amplitude(U)}, start)


@pytest.mark.parametrize("names", [(), ("A",), ("w", "A"), ("e", "d"), ("k", "c", "w", "A", "e", "d")])
def test_event_ends_of_the_impact_oscillator(names):
    orbit = impact_orbit()
    assert orbit.form.kinds == (EVENT_END,)
    problem, u = problem_of(orbit, *names)
    assert_second(problem, u, any_pairs(problem, u))


@pytest.mark.parametrize("names", [(), ("a", "e"), ("w", "g")])
def test_event_ends_of_a_ball_on_a_table(names):
    x = TableJump(0.5).after_impact(1.2)
    orbit = solve_orbit(systems.ball_on_table(), {"a": 1.2}, [("flight", "impact", x, 2 * math.pi)])
    problem, u = problem_of(orbit, *names)
    assert_second(problem, u, any_pairs(problem, u))


@pytest.mark.parametrize("names", [(), ("al", "be"), ("ga", "al")])
def test_event_ends_of_two_planar_fields(names):
    segments = [("left", "to_right", [0.0, 1.93], math.pi), ("right", "to_left", [0.0, -1.02], 1.67)]
    orbit = solve_orbit(systems.two_fields(), {}, segments)
    problem, u = problem_of(orbit, *names)
    assert_second(problem, u, any_pairs(problem, u))


@pytest.mark.parametrize("names", [(), ("Fs", "v0"), ("Fk", "Fs")])
def test_event_ends_of_stick_and_slip(names):
    segments = [("slip", "catch", [1.0, 0.3], 4.2), ("stick", "release", [0.0, 0.3], 3.3)]
    orbit = solve_orbit(systems.stick_slip(), {}, segments)
    problem, u = problem_of(orbit, *names)
    assert_second(problem, u, any_pairs(problem, u))


def test_a_carried_map_has_the_second_derivatives_of_the_map():
    system = systems.carried_map(("x", "y"), {"a": 1.5, "c": 1.2}, DELAYED)
    orbit = solve_orbit(system, {}, [("carry", "map", [1 / 3, 1 / 3, 0.0], 1.0)])
    problem, u = problem_of(orbit, "a", "c")
    v, t = np.zeros(u.size), np.zeros(u.size)
    (v[0], v[1]), (t[0], t[1]) = (0.3, -0.7), (1.1, 0.4)
    bent = problem.second(u, v) @ t
    wanted = -1.5 * (v[0] * t[1] + v[1] * t[0])
    np.testing.assert_allclose(np.abs(bent), np.abs([0.0, wanted, 0.0, 0.0]), atol=1e-12)
    assert_second(problem, u, any_pairs(problem, u))


def nonlinear_forced():
    return HybridSystem(
        ("x", "v"),
        {"w": 1.3, "A": 0.4, "b": 0.2},
        {"m": Mode({"x": "v", "v": "-x - x**3 - b*v*(1 + x**2) + A*cos(s)*exp(x/3)"})},
        phase=("s", "w"),
    )


@pytest.mark.parametrize("names", [(), ("A",), ("w", "A"), ("b", "w")])
def test_phase_ends(names):
    orbit = solve_orbit(nonlinear_forced(), {}, [("m", "s", [0.3, 0.1], 2 * math.pi / 1.3)])
    assert orbit.form.kinds == (PHASE_END,)
    problem, u = problem_of(orbit, *names)
    assert_second(problem, u, any_pairs(problem, u))


@pytest.mark.parametrize("names", [(), ("mu",), ("mu", "k")])
def test_closed_ends(names):
    system = HybridSystem(
        ("x", "y"), {"mu": 0.8, "k": 0.2}, {"m": Mode({"x": "y + k*x*y", "y": "mu*(1 - x**2)*y - x"})}
    )
    orbit = solve_orbit(system, {}, [("m", None, [2.0, 0.0], 6.5)])
    assert orbit.form.kinds == (CLOSED_END,)
    problem, u = problem_of(orbit, *names)
    assert_second(problem, u, any_pairs(problem, u))


def soft_impact():
    """A smooth contact, so that no direction needs to be tangential: a short contact segment next to a grazing."""
    force = "k*(x - d) + 0.3*(x - d)**2"
    free = "-x - 0.1*v + A*cos(s)"
    return HybridSystem(
        ("x", "v"),
        {"w": 1.0, "A": 0.12, "d": 1.0, "k": 5.0},
        {"free": Mode({"x": "v", "v": free}), "contact": Mode({"x": "v", "v": f"{free} - ({force})"})},
        [
            Transition("free", "contact", "x - d", 1, name="touch"),
            Transition("contact", "free", "x - d", -1, name="release"),
        ],
        phase=("s", "w"),
    )


@pytest.fixture(scope="module")
def soft_branch():
    form = ImpactOrbit(1.1)
    A = 0.8 * form.A_grazing
    start = [("free", "s", form.linear_response(A)[1], form.period)]
    free = solve_orbit(soft_impact(), {"w": 1.1, "A": A}, start)
    branch = continue_orbit(free, "A", (0.5 * form.A_grazing, 2.5 * form.A_grazing), directions="up")
    assert len(branch.special_points.of_type("GR")) == 1
    return branch


@pytest.mark.parametrize("names", [(), ("A",), ("w", "d"), ("k", "A")])
@pytest.mark.parametrize("share", [0.0, 1e-4, 1e-3, 0.005, 0.0099, 0.0101, 0.02, 0.1])
def test_mean_ends_above_and_below_the_share_where_the_quadrature_takes_over(soft_branch, share, names):
    """The contact's duration over the period; at 0 it is the grazing itself."""
    index = min(i for i in range(len(soft_branch)) if len(soft_branch.signature(i)) == 2)
    orbit = soft_branch.solution(index)
    problem, u = problem_of(orbit, *names)
    short = orbit.form.kinds.index(MEAN_END)
    u = u.copy()
    at = short * (problem.n + 1) + problem.n
    # a mesh made for a segment without length would not serve the differences, which give it some
    u[at] = max(share, 1e-3) * orbit.period
    problem.start(u)
    u[at] = share * orbit.period
    pairs = any_pairs(problem, u)
    for _, t in pairs:
        # the share decides which of two forms of the same equation is taken: differences must not cross it
        t[at] *= 0.05
    assert_second(problem, u, pairs, tolerance=1e-8)


@pytest.mark.parametrize("names", [(), ("A",), ("w", "A"), ("d", "shift")])
@pytest.mark.parametrize("cut", [False, True])
def test_touch_ends(names, cut):
    system = HybridSystem(
        ("x", "v"),
        {"k": 1.0, "w": 1.1, "A": 0.3, "d": 1.0, "shift": 0.2},
        {"free": Mode({"x": "v", "v": "-k*x - 0.1*v - x**3/5 + A*cos(s)"})},
        [Transition("free", "free", "x - d*(1 + v**2/7)", 1, {"v": "-0.5*v", "x": "x - shift*x"}, name="touch")],
        phase=("s", "w"),
    )
    p = system.parameter_vector({})
    active = [system.parameter_names.index(name) for name in names]
    count = 2 if cut else 1
    signature = Signature((0,) * count, (0,) * count, (TOUCH_END, EVENT_END)[:count], 1)
    problem = OrbitProblem(system, signature, p, active, np.full(len(active), 0.5))
    blocks = [[0.9, 0.1, 0.2, 3.0], [0.4, -0.3, 3.5, 2.5]][:count]
    u = np.concatenate([*blocks, p[active] / 0.5])
    assert problem.start(u) is None
    assert_second(problem, u, any_pairs(problem, u))


STARTS = {
    1: (1.0, [-0.48489216, 0.8003283]),
    2: (1.15, [-1.23947331, -0.02950304, 0.40286884, 0.48412771]),
}


@pytest.mark.parametrize("names", [(), ("Omega",), ("Omega", "ybar"), ("D_att_1", "D_rep_1"), ("H", "a0")])
@pytest.mark.parametrize("modes", [1, 2])
def test_the_tapping_cantilever_along_its_surfaces(modes, names):
    """Its contact force has a power 3/2 of the distance: second derivatives exist along the surfaces alone."""
    Omega, x = STARTS[modes]
    system = tapping_mode(table1(), modes=modes)
    _, ((t1, touch), (t2, release)) = Tapping(modes, Omega).map(np.array(x), 1e-7)
    end = 2.0 * math.pi / Omega - t2
    segments = [("flight", "touch", x, t1), ("contact", "release", touch, t2 - t1), ("flight", "theta", release, end)]
    problem, u = problem_of(solve_orbit(system, {"Omega": Omega}, segments), *names)
    assert_second(problem, u, tangential_pairs(problem, u), step=3e-5, tolerance=2e-8)


def test_the_second_derivative_is_symmetric():
    problem, u = problem_of(impact_orbit(), "w", "A")
    for v, t in any_pairs(problem, u):
        np.testing.assert_allclose(problem.second(u, v) @ t, problem.second(u, t) @ v, rtol=1e-9, atol=1e-9)


def test_the_derivative_of_a_velocity_at_an_event_is_exact():
    problem, u = problem_of(impact_orbit(), "w", "A")
    value, gradient = problem.rate(u, 0)
    assert value == pytest.approx(0.5, abs=1e-9)
    size = sizes(problem, u)
    for i in range(u.size):
        step = np.zeros(u.size)
        step[i] = 1e-3 * size[i]
        one, two = (problem.rate(u + k * step, 0)[0] - problem.rate(u - k * step, 0)[0] for k in (1, 2))
        assert gradient[i] * step[i] == pytest.approx((8 * one - two) / 12, abs=1e-11)
