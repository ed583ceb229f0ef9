"""Neurons that kick each other: orbits of pairs against the closed return map, and stability by order of the spikes."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit, simulate, solve_orbit
from selection import guarding


def pair(S: float, e: float, unit: float = 1.0) -> HybridSystem:
    """Return two leaky neurons; a spike lifts the other one by e, which fires at once where that takes it to 1."""
    spikes = [
        Transition("m", "m", "x - L", 1, {"x": "0", "y": "y + e*L"}, when="L - y - e*L", name="x"),
        Transition("m", "m", "y - L", 1, {"y": "0", "x": "x + e*L"}, when="L - x - e*L", name="y"),
        Transition("m", "m", "x - L", 1, {"x": "0", "y": "0"}, when="y + e*L - L", name="x_takes_y"),
        Transition("m", "m", "y - L", 1, {"x": "0", "y": "0"}, when="x + e*L - L", name="y_takes_x"),
    ]
    return HybridSystem(("x", "y"), {"S": S, "e": e, "L": unit}, {"m": Mode({"x": "S*L - x", "y": "S*L - y"})}, spikes)


def drawn(seed: int) -> tuple[float, float, float]:
    draw = np.random.default_rng(seed)
    return draw.uniform(1.05, 3.0), draw.uniform(0.02, 0.3), draw.choice([1e-9, 1.0, 1e9])


def after_a_spike(S: float, e: float, y: float) -> tuple[float, float]:
    """Return how long the other neuron, at y, takes to its spike, and where the first, from 0, is then, kicked.

    References
    ----------
    R. E. Mirollo, S. H. Strogatz, SIAM J. Appl. Math. 50 (1990) 1645-1662.
    """
    t = math.log((S - y) / (S - 1.0))
    return t, S * (1.0 - math.exp(-t)) + e


@pytest.mark.parametrize("seed", guarding(range(60), *range(6), campaign=20))
def test_spikes_come_when_the_closed_return_map_says(seed: int) -> None:
    S, e, unit = drawn(seed)
    y = float(np.random.default_rng(1000 + seed).uniform(0.02, 0.95))
    motion = simulate(pair(S, e, unit), {}, [0.0, y * unit], t_end=40.0, tolerance=(1e-12, 1e-14 * unit))
    names, times = motion.events["name"].tolist(), motion.events["time"]
    t, other = 0.0, "y"
    for name, time in zip(names, times.tolist(), strict=True):
        wait, y = (math.log(S / (S - 1.0)), 1.0) if y >= 1.0 else after_a_spike(S, e, y)
        t += wait
        assert time == pytest.approx(t, abs=1e-8)
        if y >= 1.0:
            assert "takes" in name
        else:
            assert name == other
            other = "x" if other == "y" else "y"
    assert y >= 1.0  # absorbed


@pytest.mark.parametrize("seed", guarding(range(60), *range(6), campaign=20))
def test_all_pairs_that_excite_each_other_end_in_synchrony(seed: int) -> None:
    S, e, unit = drawn(seed)
    start = np.random.default_rng(2000 + seed).uniform(0.0, 0.99, 2) * unit
    orbit = find_orbit(pair(S, e, unit), x0=start.tolist())
    assert orbit.period == pytest.approx(math.log(S / (S - 1.0)), rel=1e-10)
    np.testing.assert_allclose(orbit.multipliers, [0.0, 1.0], atol=1e-12)
    assert orbit.stable


@pytest.mark.parametrize("seed", guarding(range(60), *range(6), campaign=20))
def test_the_orbit_out_of_phase_has_the_slope_of_the_return_map(seed: int) -> None:
    S, e, unit = drawn(seed)
    y = brentq(lambda y: after_a_spike(S, e, y)[1] - y, e, 1.0 - 1e-12, xtol=1e-15)
    t = after_a_spike(S, e, y)[0]
    guess = [("m", "y", [0.0, y * unit], t), ("m", "x", [y * unit, 0.0], t)]
    orbit = solve_orbit(pair(S, e, unit), {}, guess)
    assert orbit.period == pytest.approx(2.0 * t, rel=1e-9)
    assert orbit.multipliers[0].real == pytest.approx((S * (S - 1.0) / (S - y) ** 2) ** 2, rel=1e-7)
    assert not orbit.stable


def kicked(S: float, a: float, b: float, unit: float = 1.0) -> HybridSystem:
    """Return two neurons whose kicks vanish at rest and at the threshold, so that synchrony lasts."""
    spikes = [
        Transition("m", "m", "x - L", 1, {"x": "0", "y": "y + b*y*(L - y)/L"}, name="x"),
        Transition("m", "m", "y - L", 1, {"y": "0", "x": "x + a*x*(L - x)/L"}, name="y"),
    ]
    modes = {"m": Mode({"x": "S*L - x", "y": "S*L - y"})}
    return HybridSystem(("x", "y"), {"S": S, "a": a, "b": b, "L": unit}, modes, spikes)


@pytest.mark.parametrize("seed", guarding(range(60), *range(6), campaign=20))
def test_multipliers_of_synchrony_differ_by_the_order_of_the_spikes(seed: int) -> None:
    # a lag of y at the spike of x shrinks by 1 - b, and grows by 1 + a at that of y; or the other way round
    draw = np.random.default_rng(seed)
    S, (a, b), unit = draw.uniform(1.1, 3.0), draw.uniform(-0.6, 0.6, 2), draw.choice([1e-9, 1.0, 1e9])
    T, truth = math.log(S / (S - 1.0)), {("x", "y"): (1.0 - b) * (1.0 + a), ("y", "x"): (1.0 - a) * (1.0 + b)}
    guess = [("m", "x", [0.0, 0.0], T), ("m", "y", [0.0, unit], 1e-6)]
    orbit = solve_orbit(kicked(S, a, b, unit), {}, guess)
    assert orbit.period == pytest.approx(T, rel=1e-10)
    assert orbit.coincidences == (("x", "y"),)
    assert orbit.admissible
    assert {names: values[0].real for names, values in orbit.orders.items()} == pytest.approx(truth, rel=1e-9)
    assert orbit.multipliers[0].real == pytest.approx(max(truth.values()), rel=1e-9)
    assert orbit.stable == (max(truth.values()) < 1.0)


def test_no_change_of_stability_of_synchrony_passes_without_a_word() -> None:
    # (1 - b)(1 + a) = 1 at a = -1/6 and (1 - a)(1 + b) = 1 at a = -1/4, for b = -0.2
    branch = continue_orbit(find_orbit(kicked(1.5, -0.2, -0.2), x0=[0.0, 0.0]), "a", (-0.6, 0.6))
    np.testing.assert_array_equal(branch.stable, (branch.values > -0.25) & (branch.values < -1.0 / 6.0))
    named = [point.parameters["a"] for point in branch.special_points]
    told = [breach.values[0] for breach in branch.audit.breaches if breach.check == "ledger"]
    for value in (-0.25, -1.0 / 6.0):
        assert min(abs(value - other) for other in [*named, *told]) < 1e-3


@pytest.mark.parametrize("seed", guarding(range(20), 0, 1))
def test_synchrony_has_no_special_point_at_any_coupling(seed: int) -> None:
    S, e, unit = drawn(seed)
    branch = continue_orbit(find_orbit(pair(S, e, unit), x0=[0.0, 0.5 * unit]), "e", (0.01, 0.4))
    assert branch.stopped == ("e = 0.01: bound reached", "e = 0.4: bound reached")
    assert len(branch.special_points) == 0
    assert branch.audit.passed
    assert branch.period == pytest.approx(math.log(S / (S - 1.0)), rel=1e-10)
