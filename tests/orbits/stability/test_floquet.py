"""Floquet multipliers against an independent event-driven map, Liouville's formula and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import systems
from oracles.closed_forms import ImpactOrbit
from oracles.tapping import Tapping, central_jacobian
from saltus import HybridSystem, Mode, Transition, solve_orbit
from saltus.afm import table1, tapping_mode
from saltus.orbits.stability import floquet

GUESSES = {
    (1, 0.95): [-0.26936714, 0.82217769],
    (1, 1.0): [-0.48489216, 0.8003283],
    (1, 1.2): [-1.36427611, 0.07033167],
    (2, 0.95): [-0.25628581, 0.00929521, 0.82623379, -0.04078384],
    (2, 1.1): [-1.0032898, 0.06109655, 0.53894634, 0.11871108],
    (2, 1.15): [-1.23947331, -0.02950304, 0.40286884, 0.48412771],
}
"""Impacting attractors at phase 0 by DOP853 at a tolerance of 1e-7."""


@pytest.fixture(scope="module")
def tapping():
    return {n: tapping_mode(table1(), modes=n) for n in (1, 2)}


def impacting_orbit(system, n, Omega):
    """The orbit of flight, contact, flight, guessed from the independent map."""
    x = np.array(GUESSES[n, Omega])
    _, ((t1, touch), (t2, release)) = Tapping(n, Omega).map(x, 1e-7)
    segments = [
        ("flight", "touch", x, t1),
        ("contact", "release", touch, t2 - t1),
        ("flight", "theta", release, 2.0 * math.pi / Omega - t2),
    ]
    return solve_orbit(system, {"Omega": Omega}, segments)


@pytest.mark.parametrize(("n", "Omega"), list(GUESSES))
def test_tapping_orbit_is_a_fixed_point_of_the_independent_map(tapping, n, Omega):
    orbit = impacting_orbit(tapping[n], n, Omega)
    image, crossings = Tapping(n, Omega).map(orbit.x0)
    assert orbit.admissible
    assert orbit.signature == (("flight", "touch"), ("contact", "release"))
    np.testing.assert_allclose(
        image, orbit.x0, atol=1e-9
    )  # DOP853 at 1e-12 in some 300 steps; events by brentq at 4 eps
    assert orbit.durations[1] == pytest.approx(crossings[1][0] - crossings[0][0], abs=1e-9)


@pytest.mark.campaign
@pytest.mark.parametrize(("n", "Omega"), list(GUESSES))
def test_tapping_multipliers_are_those_of_the_independent_map(tapping, n, Omega):
    orbit = impacting_orbit(tapping[n], n, Omega)
    J = central_jacobian(lambda x: Tapping(n, Omega).map(x)[0], orbit.x0, 1e-4)
    # errors of the map, 1e-11, over the step; the fourth-order remainder is of the same size
    expected = np.poly(J)
    np.testing.assert_allclose(np.poly(orbit.multipliers).real, expected, atol=2e-6 * max(1.0, np.abs(J).max()))


def test_the_repulsive_attractor_of_two_modes_has_the_second_mode_s_state_to_six_digits(tapping):
    orbit = impacting_orbit(tapping[2], 2, 1.15)
    assert orbit.stable
    np.testing.assert_allclose(orbit.x0[[1, 3]], [-0.02950, 0.48413], atol=5e-6)


@pytest.mark.parametrize("Omega", [0.95, 1.0, 1.2])
def test_tapping_multipliers_multiply_to_liouville(tapping, Omega):
    orbit = impacting_orbit(tapping[1], 1, Omega)
    form = Tapping(1, Omega)
    product = math.exp(-sum({"flight": 0.025, "contact": 4.0}[part.mode] * part.duration for part in orbit.segments))
    for part in orbit.segments:  # each segment starts where a crossing has just happened, z being continuous
        x, theta = part.state[:2], part.state[2]
        time, after = theta / Omega, int(part.mode == "contact")
        gradient = np.array([-1.0, 0.0, -0.108 * math.cos(theta)])
        f1, f2 = (np.append(form.field(mode, time, x), Omega) for mode in (1 - after, after))
        saltation = np.eye(3) + np.outer(f2 - f1, gradient) / (gradient @ f1)
        product *= np.linalg.det(saltation)
    assert np.prod(orbit.multipliers) == pytest.approx(product, abs=1e-9)


@pytest.mark.parametrize(
    ("w", "m", "U"), [(1.0, 1, 1.6957329376), (2.2, 1, 0.5), (2.5, 2, 1.5), (0.7, 1, 0.05), (1.1, 1, 0.1)]
)
def test_impact_multipliers_multiply_to_liouville(w, m, U):
    """The determinant of an impact's saltation matrix, times that of the flow, built from their definitions."""
    form = ImpactOrbit(w, m)
    A = form.amplitude(U)
    orbit = solve_orbit(
        systems.impact_oscillator(), {"w": w, "A": A}, [("free", "impact", form.after_impact(U), form.period)]
    )
    x, v, s = orbit.segments[0].state
    before = np.array([x, -v / 0.8, s])
    f1, f2 = (np.array([y[1], -y[0] - 0.1 * y[1] + A * math.cos(y[2]), w]) for y in (before, orbit.segments[0].state))
    reset, gradient = np.diag([1.0, -0.8, 1.0]), np.array([1.0, 0.0, 0.0])
    saltation = reset + np.outer(f2 - reset @ f1, gradient) / (gradient @ f1)
    product = math.exp(-0.1 * orbit.period) * np.linalg.det(saltation)
    # the product of eigenvalues mu and det / mu has an error of eps * (largest multiplier)^2
    assert np.prod(orbit.multipliers) == pytest.approx(product, abs=1e-9)


@pytest.mark.parametrize(
    ("w", "m", "U"), [(1.0, 1, 1.6957329376), (2.2, 1, 0.5), (2.5, 2, 1.5), (0.7, 1, 0.3), (1.1, 1, 0.1)]
)
def test_impact_multipliers_are_those_of_the_stroboscopic_map(w, m, U):
    form = ImpactOrbit(w, m)
    A = form.amplitude(U)
    orbit = solve_orbit(
        systems.impact_oscillator(), {"w": w, "A": A}, [("free", "impact", form.after_impact(U), form.period)]
    )

    def surface(t, y):
        return y[0] - 1.0

    surface.terminal, surface.direction = True, 1.0

    def image(x):
        t, end = 0.0, form.period
        while t < end:
            flown = solve_ivp(
                lambda t, y: [y[1], -y[0] - 0.1 * y[1] + A * math.cos(w * t)],
                (t, end), x, "DOP853", rtol=1e-12, atol=1e-13, events=surface,
            )  # fmt: skip
            t, x = flown.t[-1], flown.y[:, -1]
            if flown.status == 1:
                x = np.array([1.0, -0.8 * x[1]])
        return x

    np.testing.assert_allclose(image(orbit.x0), orbit.x0, atol=1e-9)
    J = central_jacobian(image, orbit.x0, 1e-5)
    np.testing.assert_allclose(np.poly(orbit.multipliers).real, np.poly(J), atol=2e-6 * max(1.0, np.abs(J).max()))


@pytest.mark.parametrize("seed", [0, 1, 2, 3])
def test_a_rest_at_0_of_states_in_unlike_units_has_the_multipliers_of_its_map(seed: int) -> None:
    """A sampled system at rest gives its states no sizes, and they differ by 1e8."""
    random = np.random.default_rng(seed)
    like = random.normal(size=(3, 3))
    like *= 1.05 / np.abs(np.linalg.eigvals(like)).max()
    units = np.array([1e4, 1e-4, 1.0])
    matrix = (units[:, None] * like / units).tolist()
    names = ["x", "y", "z"]
    images = {
        name: "+".join(f"({a})*{other}" for a, other in zip(row, names, strict=True))
        for name, row in zip(names, matrix, strict=True)
    }
    wait = Mode(dict.fromkeys(names, "0") | {"s": "1"})
    sample = Transition("wait", "wait", "s - 1", 1, images | {"s": "0"}, name="sample")
    system = HybridSystem((*names, "s"), {}, {"wait": wait}, [sample])
    orbit = solve_orbit(system, {}, [("wait", "sample", [0.0] * 4, 1.0)])
    exact = np.linalg.eigvals(like)
    assert np.sort(np.abs(orbit.multipliers[:3])) == pytest.approx(np.sort(np.abs(exact)), rel=1e-6)
    assert not orbit.stable


def test_a_pencil_that_is_no_number_has_no_multipliers():
    values = floquet._eigenvalues(np.array([[1.0, np.nan], [0.0, 1.0]]), np.eye(2))
    assert values.shape == (2,)
    assert np.isnan(values).all()
