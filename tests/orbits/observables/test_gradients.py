"""Gradients of an orbit's quantities by its unknowns and parameters: closed forms, and differences at several steps."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
import pytest
from numpy.typing import NDArray

from saltus import ConvergenceError, HybridSystem, Mode, Transition, find_orbit, solve_orbit
from saltus.orbits.cuts import clustered
from saltus.orbits.observables.gradients import gradient_of
from saltus.orbits.observables.quantities import read_quantity, sizes_of_unknowns
from saltus.orbits.observables.sensitivities import unknowns_by_parameters
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, CUT_END, Signature
from saltus.results import PeriodicOrbit

STEPS = (1e-4, 1e-5)
"""Changes of an unknown, over its size: the error of central differences is a hundredth at the second one."""

EXACT = 1e-7
"""Relative error of differences at the second step, where third derivatives are at most a thousand times the first."""


def forced(field: str, **values: float) -> HybridSystem:
    return HybridSystem.smooth(
        {"x": "v", "v": field}, values | {"w": 1.2}, phase=("s", "w"), outputs={"E": "v**2 + x**2"}
    )


def impacting() -> PeriodicOrbit:
    """Return the orbit of an oscillator that hits a wall at its greatest x, with a jump of v."""
    wall = Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="impact")
    values = {"k": 1.0, "c": 0.1, "d": 1.0, "e": 0.8, "w": 0.9, "A": 1.0}
    modes = {"free": Mode({"x": "v", "v": "A*cos(s) - c*v - k*x"})}
    return find_orbit(HybridSystem(("x", "v"), values, modes, [wall], phase=("s", "w")), x0=[0.0, 0.0])


def equations(orbit: PeriodicOrbit, active: Sequence[str] = ()) -> tuple[OrbitProblem, NDArray[np.float64]]:
    problem = orbit.problem(active)
    return problem, np.append(orbit.unknowns, problem.p[list(problem.active)])


def opened(problem: OrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unknowns of an orbit nearby that is not closed, meshes made."""
    u = u * (1.0 + 1e-3 * np.random.default_rng(1).standard_normal(u.size))
    problem.start(u)
    problem.resolve(u)
    return u


def mismatches(problem: OrbitProblem, u: NDArray[np.float64], name: str) -> list[float]:
    """Return the differences of a gradient from central ones at all steps, over its largest component."""
    quantity = read_quantity(problem.system, name)
    exact = gradient_of(quantity, problem, u)
    sizes = np.append(sizes_of_unknowns(problem, u), np.abs(u[problem.size :]))
    found = []
    for share in STEPS:
        slopes = []
        for i, step in enumerate((share * sizes).tolist()):
            ends = [quantity.value(problem, u + side * step * np.eye(u.size)[i]) for side in (1.0, -1.0)]
            slopes.append((ends[0] - ends[1]) / (2.0 * step))
        found.append(float(np.abs((exact - slopes) * sizes).max() / np.abs(exact * sizes).max()))
    return found


@pytest.mark.parametrize(
    "name", ["max_x", "min_v", "max_E", "max(x**2)", "max(x) - min(x)", "mean(x*v)", "amplitude(x, 1)"]
)
def test_gradients_are_those_of_differences_at_two_steps(name):
    orbit = solve_orbit(forced("-0.1*v - x - x**3 + A*cos(s)", A=0.3), x0=[0.5, 0.0])
    problem, u = equations(orbit, ("A", "w"))
    first, second = mismatches(problem, opened(problem, u), name)
    assert second < EXACT
    assert second < 0.02 * first


@pytest.mark.parametrize("name", ["max_x", "min_x", "max_v", "min_v", "velocity(impact)", "amplitude(x, 1)"])
def test_gradients_at_and_between_impacts(name):
    problem, u = equations(impacting(), ("d", "e", "w"))
    assert mismatches(problem, opened(problem, u), name)[1] < EXACT


def test_the_gradient_of_the_greatest_x_at_a_wall_is_that_of_its_event():
    problem, u = equations(impacting())
    u[problem.n] += 1e-6  # the end is beyond the wall, and the highest place
    gradient = gradient_of(read_quantity(problem.system, "max_x"), problem, u)
    event = problem.resolve(u)[1][problem.n]  # of x - d, at the segment's end
    assert gradient == pytest.approx(event[: problem.size], rel=1e-9, abs=1e-9)


def test_gradients_of_an_orbit_in_pieces():
    pendulum = HybridSystem.smooth({"x": "v", "v": "-sin(x)"}, outputs={"H": "v**2/2 - cos(x)"})
    whole, own = equations(solve_orbit(pendulum, x0=[2.0, 0.0], period=8.3, fix={"max_x": 2.0}))
    whole.survey(own)
    starts = [whole.state_on(0, clustered((k + 0.3) / 5.0)) for k in range(5)]
    signature = Signature((0,) * 5, (-1,) * 5, (CLOSED_END, *[CUT_END] * 4), 0)
    problem = OrbitProblem(pendulum, signature, whole.p)
    u = opened(problem, np.concatenate([np.append(start, own[-1] / 5.0) for start in starts]))
    for name in ("max_x", "min_v", "mean(x**2)", "amplitude(x, 1)"):
        assert mismatches(problem, u, name)[1] < EXACT


@pytest.mark.campaign
def test_gradients_by_implicit_steps():
    relaxation = HybridSystem(("x", "y"), {"mu": 100.0}, {"m": Mode({"x": "y", "y": "mu*(1 - x**2)*y - x"})})
    problem, u = equations(find_orbit(relaxation, x0=[2.0, 0.0]), ("mu",))
    assert problem.stiff
    for name in ("max_x", "mean(x**2)"):
        quantity = read_quantity(relaxation, name)
        exact = gradient_of(quantity, problem, u)
        for share in (1e-5, 1e-6):
            way = np.append(np.zeros(problem.size), share * u[-1])
            near, far = (quantity.value(problem, u + side * way) for side in (1.0, -1.0))
            assert exact[-1] == pytest.approx((near - far) / (2.0 * way[-1]), rel=1e-5)


@pytest.mark.parametrize("w", [0.6, 1.0, 1.4])
def test_along_the_orbits_of_a_linear_oscillator_gradients_are_those_of_its_resonance_curve(w):
    """max x = A/sqrt((1 - w^2)^2 + c^2 w^2), max v = w max x."""
    system = forced("A*cos(s) - c*v - x", c=0.2, A=1.0)
    problem, u = equations(solve_orbit(system, {"w": w}, x0=[1.0, 0.0]), ("A", "c", "w"))
    moved = unknowns_by_parameters(problem, u, problem.resolve(u)[1])
    square = (1.0 - w * w) ** 2 + 0.04 * w * w
    height = 1.0 / math.sqrt(square)
    by = [height, -height * 0.2 * w * w / square, height * w * (2.0 * (1.0 - w * w) - 0.04) / square]
    for name, factor, own in (("max_x", 1.0, 0.0), ("min_x", -1.0, 0.0), ("max_v", w, height)):
        gradient = gradient_of(read_quantity(system, name), problem, u)
        total = gradient[: problem.size] @ moved + gradient[problem.size :]
        assert total == pytest.approx([factor * by[0], factor * by[1], factor * by[2] + own], rel=1e-9, abs=1e-10)


def test_a_frequency_with_a_given_maximum_is_that_of_the_resonance_curve():
    system = forced("A*cos(s) - c*v - x", c=0.2, A=1.0)
    guess = solve_orbit(system, {"w": 1.25}, x0=[1.0, 0.0])
    orbit = solve_orbit(system, {"w": 1.25}, x0=guess.x0, fix={"max_x": 2.0}, free="w")
    b = 1.0 - 0.02
    assert orbit.parameters["w"] == pytest.approx(math.sqrt(b + math.sqrt(b * b - 0.75)), rel=1e-11)


@pytest.fixture(scope="module")
def two_peaks():
    """x' = -x + A cos s + cos 2s: with A = 0 both maxima are equally high, 1/sqrt(5)."""
    return HybridSystem.smooth({"x": "-x + A*cos(s) + cos(2*s + 1)"}, {"A": 0.3, "w": 1.0}, phase=("s", "w"))


def height(A: float) -> float:
    """Return the maximum of A cos(s - pi/4)/sqrt(2) + cos(2s + 1 - atan 2)/sqrt(5)."""
    s = np.linspace(0.0, 2.0 * np.pi, 4001)
    for _ in range(4):
        values = A * np.cos(s - np.pi / 4.0) / np.sqrt(2.0) + np.cos(2.0 * s + 1.0 - np.arctan(2.0)) / np.sqrt(5.0)
        at = s[np.argmax(values)]
        s = np.linspace(at - 3.0 * (s[1] - s[0]), at + 3.0 * (s[1] - s[0]), 4001)
    return float(values.max())


@pytest.mark.parametrize("A", [0.3, 0.0, -0.2])
@pytest.mark.parametrize("value", [0.5, 0.4473])
def test_a_maximum_is_found_on_both_sides_of_a_switch_of_peaks(two_peaks, A, value):
    orbit = solve_orbit(two_peaks, {"A": A}, x0=[0.1], fix={"max_x": value}, free="A")
    assert height(orbit.parameters["A"]) == pytest.approx(value, rel=1e-9)


def test_below_the_height_at_which_peaks_switch_there_is_no_orbit(two_peaks):
    with pytest.raises(ConvergenceError, match=r"have max_x down to 0\.44[78]"):
        solve_orbit(two_peaks, x0=[0.1], fix={"max_x": 0.44}, free="A")


def test_of_a_pendulum_that_does_not_turn_over_it_is_told_that_periods_grow():
    pendulum = HybridSystem.smooth({"x": "v", "v": "-sin(x)"})
    with pytest.raises(ConvergenceError, match=r"max_x up to 3\.1\d*, where the period has grown from 9 to 2\d"):
        solve_orbit(pendulum, x0=[2.0, 0.0], period=9.0, fix={"max_x": 4.0})


def test_a_mean_with_a_corner_is_differentiated_by_differences():
    """A hardening spring's mean |v| is four amplitudes a period; a quadrature across its corner errs by 1e-6."""
    spring = HybridSystem.smooth({"x": "v", "v": "-x - x**3"})
    orbit = solve_orbit(spring, x0=[1.0, 0.0], period=5.0, fix={"mean(abs(v))": 1.2})
    assert 4.0 * orbit.max["x"] / orbit.period == pytest.approx(1.2, rel=1e-5)
