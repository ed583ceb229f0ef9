"""Orbits in an invariant plane of a conservative system: what is rounding across the plane has no size of its own."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from saltus import ConvergenceError, HybridSystem, continue_orbit, solve_orbit
from selection import guarding

MU = 0.01215058560962404
# A planar Lyapunov orbit about L1, by Newton's method on SciPy's DOP853 at 1e-12.
START, SPEED, PERIOD = 0.8314151257723575, 0.048045850747484055, 2.698558836176159


@pytest.fixture(scope="module")
def three_body():
    """The spatial circular restricted problem of Earth and Moon."""
    r1, r2 = "sqrt((x + mu)**2 + y**2 + z**2)", "sqrt((x - 1 + mu)**2 + y**2 + z**2)"
    return HybridSystem.smooth(
        {
            "x": "u",
            "y": "v",
            "z": "w",
            "u": f"2*v + x - (1 - mu)*(x + mu)/{r1}**3 - mu*(x - 1 + mu)/{r2}**3",
            "v": f"-2*u + y - (1 - mu)*y/{r1}**3 - mu*y/{r2}**3",
            "w": f"-(1 - mu)*z/{r1}**3 - mu*z/{r2}**3",
        },
        {"mu": MU},
    )


def jacobi(state):
    """Jacobi's constant."""
    x, y, z, *speed = state[:6]
    near, far = np.sqrt((x + MU) ** 2 + y**2 + z**2), np.sqrt((x - 1 + MU) ** 2 + y**2 + z**2)
    return x**2 + y**2 + 2 * (1 - MU) / near + 2 * MU / far - np.dot(speed, speed)


def planar(system, z=0.0, w=0.0):
    return solve_orbit(system, x0=[START, 0.0, z, 0.0, SPEED, w], period=PERIOD, fix={"min_x": START})


@pytest.mark.parametrize(("z", "w"), guarding([(0.0, 0.0), (1e-13, 0.0), (-1e-16, 1e-15)], (0.0, 0.0), (1e-13, 0.0)))
def test_planar_orbits_of_three_bodies_are_found_in_space(three_body, z, w):
    orbit = planar(three_body, z, w)
    assert orbit.period == pytest.approx(PERIOD, abs=1e-10)
    assert np.all(orbit.x0[[2, 5]] == 0.0)
    sizes = np.sort(np.abs(orbit.multipliers))
    assert sizes[-1] == pytest.approx(2629.4, rel=2e-5)
    assert sizes[0] == pytest.approx(1.0 / 2629.4, rel=2e-5)
    across = orbit.multipliers[np.abs(orbit.multipliers.imag) > 0.1]
    assert across.sum().real == pytest.approx(1.97322, abs=1e-5)


def test_states_that_rest_are_no_part_of_their_own(three_body):
    with pytest.raises(ConvergenceError, match="orbits form a family there at fixed parameters"):
        solve_orbit(three_body, x0=[START, 0.0, 0.0, 0.0, SPEED, 0.0], period=PERIOD)


@pytest.mark.campaign
def test_the_halo_orbits_branch_off_where_the_trace_across_is_two(three_body):
    """Trace 2 at C = 3.17435195408, T = 2.74299406946, by SciPy."""
    branch = continue_orbit(planar(three_body), "period", (2.698, 2.75))
    (point,) = [point for point in branch.special_points if point.type == "BP"]
    assert point.orbit.period == pytest.approx(2.74299406946, abs=1e-9)
    assert jacobi(point.orbit.x0) == pytest.approx(3.17435195408, abs=1e-9)
    assert branch.values.max() == pytest.approx(2.75, abs=1e-12)


def henon(size=1.0):
    """Potential x^2/2 + y^2/2 + 0.65 z^2 + x^2 y - y^3/3 + y z^2, a length being `size`."""
    return HybridSystem.smooth(
        {
            "x": "u", "y": "v", "z": "w", "u": f"-x - 2*x*y/{size}", "v": f"-y - (x**2 - y**2 + z**2)/{size}",
            "w": f"-1.3*z - 2*y*z/{size}",
        }
    )  # fmt: skip


def _monodromy(field, x0, period):
    """Trace of the monodromy matrix by central differences of SciPy's flow."""

    def flow(x):
        return solve_ivp(field, (0.0, period), x, method="DOP853", rtol=1e-12, atol=1e-14).y[:, -1]

    steps = 1e-5 * np.eye(len(x0))
    return sum((flow(x0 + d) - flow(x0 - d))[i] / 2e-5 for i, d in enumerate(steps))


@pytest.mark.parametrize(
    ("size", "off"),
    guarding([(1.0, 0.0), (1.0, 1e-13), (1e-6, 1e-12), (1e6, 1e-12), (1e-9, 0.0)], (1.0, 1e-13), (1e6, 1e-12)),
)
def test_a_straight_motion_of_three_oscillators_is_one_of_a_family_of_one_dimension(size, off):
    orbit = solve_orbit(
        henon(size), x0=[0.0, 0.3 * size, off * size, 0.0, 0.0, off * size], period=6.4, fix={"max_y": 0.3 * size}
    )

    def field(_, s):
        x, y, z, u, v, w = s
        return [u, v, w, -x - 2 * x * y, -y - x**2 + y**2 - z**2, -1.3 * z - 2 * y * z]

    trace = _monodromy(field, np.array(orbit.x0[:6]) / size, orbit.period)
    assert orbit.multipliers.sum().real == pytest.approx(trace, abs=1e-6)
    assert np.sum(np.abs(orbit.multipliers - 1.0) < 1e-4) == 2


@pytest.mark.parametrize("axis", guarding([0, 1, 2], 1))
def test_each_normal_mode_of_three_coupled_oscillators_is_found(axis):
    field = {"x": "u", "y": "v", "z": "w"} | {
        speed: f"-{k}*{q} - {q}**3 - 0.5*{q}*({a}**2 + {b}**2)"
        for k, speed, q, a, b in ((1, "u", "x", "y", "z"), (2, "v", "y", "x", "z"), (3, "w", "z", "x", "y"))
    }
    start = [1e-14] * 3 + [1e-13] * 3
    start[axis] = 0.8
    guess = 2.0 * np.pi / np.sqrt(axis + 1 + 0.48)
    orbit = solve_orbit(HybridSystem.smooth(field), x0=start, period=guess, fix={f"max_{'xyz'[axis]}": 0.8})
    assert sum(orbit.x0[i] != 0.0 for i in range(3)) == 1
    assert np.prod(orbit.multipliers).real == pytest.approx(1.0, abs=1e-8)


@pytest.mark.parametrize("size", guarding([1.0, 1e-6, 1e6], 1.0))
def test_families_of_two_dimensions_are_told_in_any_units(size):
    isotropic = HybridSystem.smooth({"x": "u", "y": "v", "z": "w", "u": "-x", "v": "-y", "w": "-z"})
    kepler = HybridSystem.smooth(
        {"x": "u", "y": "v"} | {a: f"-{size**3!r}*{q}/(x**2 + y**2)**1.5" for a, q in (("u", "x"), ("v", "y"))}
    )
    for system, x0, period in (
        (isotropic, [size, 0.0, 0.0, 0.0, 0.5 * size, 0.0], 6.28),
        (kepler, [size, 0.0, 0.0, 1.1 * size], 8.0),
    ):
        with pytest.raises(ConvergenceError, match="family of more than one dimension"):
            solve_orbit(system, x0=x0, period=period, fix={"max_x": size})
