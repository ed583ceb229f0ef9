"""Lyapunov exponents against closed forms, numbers in print, Floquet multipliers and two neighbouring motions."""

from __future__ import annotations

import math
import tracemalloc
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import systems
from grouped import Grouped
from oracles.closed_forms import HENON, LOGISTIC, ImpactOrbit, TableJump, two_fields_orbit
from saltus import Average
from saltus.errors import ChatteringError, DivergenceError, InputError
from saltus.flow.event_logs import events_after
from saltus.flow.saltation import saltation_matrix
from saltus.flow.simulation import simulate
from saltus.flow.variational import growth_along
from saltus.orbits.find import find_orbit
from saltus.sweeps.lyapunov import LyapunovSpectrum, lyapunov_spectrum
from saltus.system.hybrid import HybridSystem, Mode, Transition
from systems import settle

CHAOS = {"w": 2.5, "A": 5.4}
BEYOND_GRAZING = {"w": 2.15, "A": 1.001 * ImpactOrbit(w=2.15).A_grazing}
"""Impact oscillators whose attractors are chaotic; there is none without impacts, which ended in a grazing."""


def rates(multipliers, period) -> np.ndarray:
    return np.sort(np.log(np.abs(multipliers)))[::-1] / period


def tanks(rate: float = 1.0 / 3.0) -> HybridSystem:
    """Return three tanks that drain, one of which is filled; the first that is empty is filled next.

    C. Chase, J. Serrano, P. J. Ramadge, Periodicity and chaos from switched flow systems, IEEE Trans. Automat. Control
    38 (1993) 70-83. With equal rates the contents (x, 1 - x) of the two that are not empty have x -> 2 x mod 1 in the
    time 3 min(x, 1 - x), of mean 3/4: the exponent is ln 2 / 0.75, though the Jacobians of all fields vanish.
    """
    names = ("a", "b", "c")
    return HybridSystem(
        names,
        {"rate": rate},
        {f"fill_{i}": Mode({j: "1 - rate" if i == j else "-rate" for j in names}) for i in names},
        [Transition(f"fill_{i}", f"fill_{j}", j, -1) for i in names for j in names if i != j],
        name="three tanks",
    )


def lorenz() -> HybridSystem:
    field = {"x": "10*(y - x)", "y": "x*(28 - z) - y", "z": "x*y - 8*z/3"}
    return HybridSystem(("x", "y", "z"), {}, {"flow": Mode(field)}, name="Lorenz")


@pytest.fixture(scope="module")
def logistic():
    return systems.carried_map(("x",), {"a": 4.0}, LOGISTIC)


@pytest.fixture(scope="module")
def afm2_chaos(afm2):
    """A state on the chaotic attractor of the two-mode cantilever, reached from the side of smaller Omega."""
    x, mode = [0.0, 0.0, 0.0, 0.0], 0
    for Omega in (0.995, 1.005, 1.015, 1.02, 1.021, 1.0215, 1.0222, 1.02296):
        p = afm2.parameter_vector({"Omega": Omega})
        x, mode = settle(afm2, p, x, mode, periods=300, tolerance=(1e-8, 1e-10))
    return p, x, mode


# periodic motions: log|mu| / T


def test_impact_orbits_exponents_are_the_closed_form(impact_oscillator):
    orbit = ImpactOrbit(w=1.1)
    U = 3.7
    A, mu = orbit.amplitude(U), orbit.multipliers(U)
    found = lyapunov_spectrum(
        impact_oscillator, {"w": 1.1, "A": A}, orbit.after_impact(U), average=Average(periods=60, discard=200)
    )
    assert found.exponents == pytest.approx(rates(mu, orbit.period), abs=1e-9)


def test_both_exponents_of_a_complex_pair_are_half_the_determinants(impact_oscillator):
    orbit, periods = ImpactOrbit(w=1.0), 400
    x0 = orbit.after_impact(orbit.speeds(1.0)[1])
    found = lyapunov_spectrum(impact_oscillator, {"A": 1.0}, x0, average=Average(periods=periods, discard=40))
    half = math.log(orbit.det) / (2.0 * orbit.period)
    assert found.sum == pytest.approx(2.0 * half, abs=1e-10)
    # a rotating frame's lengths are bounded by the condition of the eigenvectors, here below e^3
    assert np.abs(found.exponents - half).max() < 3.0 / (periods * orbit.period)
    assert np.all(np.abs(found.exponents - half) < found.errors)


@pytest.mark.parametrize(("al", "be", "guess"), [(1.0, 0.5, 0.58), (1.0, 2.0, 1.93), (0.5, 2.0, 1.63)])
def test_limit_cycle_of_two_fields_has_a_zero_and_the_closed_form(two_fields, al, be, guess):
    r0, _, period, multiplier = two_fields_orbit(al, be, 1.5, guess)
    # over whole periods the lengths of the frame return
    found = lyapunov_spectrum(
        two_fields,
        {"al": al, "be": be},
        [0.0, r0],
        mode="left",
        average=Average(t_end=50 * period, discard=10 * period),
        tolerance=1e-12,
    )
    assert found.exponents == pytest.approx([0.0, math.log(multiplier) / period], abs=1e-9)
    assert found.kaplan_yorke == 1.0


def test_ball_on_a_table_has_the_closed_forms_exponents(ball_on_table):
    jump = TableJump(0.5)
    Gamma = 1.46  # real multipliers
    mu = np.roots([1.0, -jump.trace(Gamma), jump.det])
    found = lyapunov_spectrum(
        ball_on_table, {"a": Gamma}, jump.after_impact(Gamma), average=Average(periods=40, discard=100)
    )
    assert found.per_period == pytest.approx(rates(mu, 1.0), abs=1e-9)


@pytest.mark.parametrize("modes", [1, 2])
def test_tapping_orbits_exponents_are_its_multipliers(afm1, afm2, modes):
    system, Omega = (afm1, 1.04) if modes == 1 else (afm2, 1.0)
    orbit = find_orbit(system, {"Omega": Omega}, [0.0] * len(system.states))
    assert orbit.stable
    expected = rates(orbit.multipliers, orbit.period)
    turns = orbit.form.turns
    found = lyapunov_spectrum(
        system, {"Omega": Omega}, orbit.x0, average=Average(periods=200 * turns, discard=50 * turns)
    )
    # a pair's two are not told apart, their sum is
    pairs = np.isclose(expected[:-1], expected[1:], rtol=0.0, atol=1e-9)
    for i in range(len(expected)):
        paired = slice(i, i + 2) if i < len(pairs) and pairs[i] else slice(i - 1, i + 1) if i and pairs[i - 1] else i
        assert np.sum(found.exponents[paired]) == pytest.approx(np.sum(expected[paired]), abs=1e-7)


# motions whose own error bounds no step: at rest, or hardly bent


@pytest.mark.parametrize("rtol", [1e-12, 1e-8, 1e-3])
@pytest.mark.parametrize("c", [0.0, 1.0])
@pytest.mark.parametrize("k", [4.0, -4.0])
def test_forced_system_at_an_equilibrium_has_its_eigenvalues_real_parts(k, c, rtol):
    field = {"x": "y", "y": "-y - k*(x - c) - (x - c)**3 + A*cos(s)"}
    system = HybridSystem(("x", "y"), {"k": k, "c": c, "A": 0.0}, {"rest": Mode(field)}, phase=("s", "1"))
    found = lyapunov_spectrum(
        system, None, [c, 0.0], average=Average(periods=200, discard=20), tolerance=(rtol, 1e-2 * rtol)
    )
    expected = np.sort(np.roots([1.0, 1.0, k]).real)[::-1]
    # the frame's own tolerance in each part of a step, of which there are fewer than two in a unit of time
    per_time = 2.0 * min(1e3 * rtol, 1e-4)
    assert found.sum == pytest.approx(-1.0, abs=2.0 * per_time)
    # the lengths in a rotating frame are bounded by the condition of the eigenvectors, here below e
    rotation = 1.0 / found.times[-1] if k > 0.0 else 0.0
    assert found.exponents == pytest.approx(expected, abs=per_time + rotation)


def test_motion_that_comes_to_rest_shrinks_at_its_slowest_rate():
    field = {"x": "y", "y": "-y - 4*x - x**3 + A*cos(s)"}
    system = HybridSystem(("x", "y"), {"A": 0.0}, {"rest": Mode(field)}, phase=("s", "1"))
    found = lyapunov_spectrum(
        system, None, [0.5, 0.0], average=Average(periods=100, discard=100), tolerance=(1e-8, 1e-10)
    )
    assert found.exponents == pytest.approx([-0.5, -0.5], abs=1.0 / found.times[-1])


def test_cantilever_that_is_not_driven_loses_half_its_damping(afm1):
    found = lyapunov_spectrum(afm1, {"ybar": 0.0}, [0.0, 0.0], average=Average(periods=100), tolerance=(1e-8, 1e-10))
    assert found.sum == pytest.approx(-0.025, abs=1e-5)
    assert found.exponents == pytest.approx([-0.0125, -0.0125], abs=0.1 / found.times[-1])


def test_fast_contraction_at_rest_is_measured_beside_a_slow_one():
    system = HybridSystem(("x", "y"), {}, {"rest": Mode({"x": "-x + y", "y": "-50*y"})})
    found = lyapunov_spectrum(
        system, None, [0.0, 0.0], average=Average(t_end=200.0, discard=20.0), tolerance=(1e-2, 1e-4)
    )
    # 1e-4 in each part of a step, of which there are fewer than 100 in a unit of time
    assert found.exponents == pytest.approx([-1.0, -50.0], abs=1e-2)


def test_straight_motion_past_a_varying_rate_has_its_mean():
    # x = t is without error in steps of any length; perturbations of y shrink by exp(-2 t - sin t)
    system = HybridSystem(("x", "y"), {}, {"flow": Mode({"x": "1", "y": "-(2 + cos(x))*y"})})
    t = 1000.0 * math.pi
    found = lyapunov_spectrum(
        system, None, [0.0, 0.0], average=Average(t_end=t, discard=20.0 * math.pi), tolerance=(1e-8, 1e-10)
    )
    # 1e-5 in each part of a step, of which there are fewer than five in a unit of time
    assert found.exponents == pytest.approx([0.0, -2.0], abs=5e-5)
    assert found.logs[:, 1] == pytest.approx(-2.0 * np.diff(np.append(0.0, found.times)), abs=5e-5 * t / 500)


def test_rest_where_the_jacobian_is_not_finite_has_no_exponent():
    system = HybridSystem(("x", "y"), {}, {"rest": Mode({"x": "-y", "y": "-sqrt(x)"})})
    found = lyapunov_spectrum(system, None, [0.0, 0.0], average=Average(t_end=10.0))
    assert np.isnan(found.exponents).any()


# rates of volumes


def test_volumes_of_the_tapping_cantilever_shrink_at_the_mean_damping(afm2, afm2_chaos):
    p, x, mode = afm2_chaos
    found = growth_along(afm2, p, x, mode, average=Average(periods=40, discard=0))
    log = events_after(afm2, p, x, mode, periods=40)
    contact, at, now = 0.0, 0.0, mode
    for time, after in zip(log.time, log.mode_after, strict=True):
        contact += (time - at) * (now == 1)
        at, now = time, after
    # damping jumps by a multiple of the velocities, along which the gap does not change: its saltation keeps volumes
    damping = 2.0 * (0.025 * (at - contact) + 4.0 * contact)
    assert found.exponents.sum() * found.times[-1] == pytest.approx(-damping, rel=1e-9)


def test_volumes_follow_divergence_and_saltation_in_impacting_chaos(impact_oscillator):
    p, mode = impact_oscillator.parameter_vector(CHAOS), 0
    x, _ = settle(impact_oscillator, p, [0.0, 0.0], mode, periods=200)
    found = growth_along(impact_oscillator, p, x, mode, average=Average(periods=30, discard=0))
    log = events_after(impact_oscillator, p, x, mode, periods=30)
    jumps = [
        saltation_matrix(impact_oscillator, CHAOS, "impact", before) for before in log.x_before[log.transition >= 0]
    ]
    assert len(jumps) > 10
    volume = -0.1 * log.t_end + sum(math.log(abs(np.linalg.det(jump))) for jump in jumps)
    assert found.logs.sum() == pytest.approx(volume, rel=1e-9)


# chaos with a known exponent


def test_logistic_map_at_four_has_ln_two(logistic):
    found = lyapunov_spectrum(logistic, None, [0.3, 0.0], average=Average(t_end=20_000.0))
    assert found.exponents == pytest.approx([math.log(2.0), 0.0], abs=1e-3)
    assert abs(found.exponents[0] - math.log(2.0)) < found.errors[0]


def test_henon_map_has_the_exponents_in_print():
    henon = systems.carried_map(("x", "y"), {"a": 1.4, "b": 0.3}, HENON)
    found = lyapunov_spectrum(henon, None, [0.1, 0.1, 0.0], average=Average(t_end=40_000.0))
    assert found.sum == pytest.approx(math.log(0.3), abs=1e-12)
    assert found.exponents[1] == 0.0
    assert abs(found.exponents[0] - 0.4192) < found.errors[0] < 0.01
    # 1.258 for the map in print (J. C. Sprott, Chaos and Time-Series Analysis, Oxford 2003), and the clock
    assert found.kaplan_yorke == pytest.approx(2.258, abs=0.005)


def test_lorenz_system_has_the_exponents_in_print():
    found = lyapunov_spectrum(
        lorenz(), None, [1.0, 1.0, 20.0], average=Average(t_end=4000.0, discard=50.0), tolerance=(1e-8, 1e-8)
    )
    # J. C. Sprott, Chaos and Time-Series Analysis, Oxford 2003
    assert np.all(np.abs(found.exponents - [0.9056, 0.0, -14.5723]) < found.errors)
    assert np.all(found.errors < 0.02)
    assert found.sum == pytest.approx(-1.0 - 10.0 - 8.0 / 3.0, abs=1e-6)
    assert found.kaplan_yorke == pytest.approx(2.062, abs=0.002)


def test_switched_tanks_owe_their_exponent_to_saltation_alone():
    found = lyapunov_spectrum(tanks(), None, [0.2, 0.3, 0.5], mode="fill_a", average=Average(t_end=20_000.0))
    expected = math.log(2.0) / 0.75
    assert abs(found.exponents[0] - expected) < found.errors[0] < 0.01
    # the flow's direction, and the total that is kept
    assert found.exponents[1:] == pytest.approx([0.0, 0.0], abs=1e-3)


# two neighbouring motions, an independent way to the largest exponent


def test_impacts_on_a_far_table_have_the_exponent_of_the_standard_map():
    # P. J. Holmes, J. Sound Vib. 84 (1982) 173-189: impacts far above a table that shakes, here with e = 1; that is the
    # standard map of K = 4 a w^2 / g, whose exponent is ln(K / 2) for large K: B. V. Chirikov, Phys. Rep. 52 (1979) 263
    kick, impacts, high = 20.0, 1500, 2000.0
    system = HybridSystem(
        states=("z", "v", "s"),
        parameters={"kick": kick},
        modes={"flight": Mode({"z": "v", "v": "-1", "s": "1"})},
        transitions=[Transition("flight", "flight", "z", -1, {"v": "-v + kick*cos(s)"}, name="impact")],
    )
    x, flight = [0.0, high * kick, 0.5], 2.0 * high * kick
    per_impact = (
        flight
        * growth_along(system, system.parameter_vector({}), x, 0, average=Average(t_end=impacts * flight)).exponents
    )
    # ln|cos| of an even angle spreads by 0.91 an impact, and flights by 2 % while the speed wanders
    assert per_impact[0] == pytest.approx(math.log(kick), abs=4.0 * 0.91 / math.sqrt(impacts) + 0.06)
    assert per_impact[1] == pytest.approx(0.0, abs=0.02)
    assert per_impact.sum() == pytest.approx(0.0, abs=1e-4)


def benettin(system, p, x, mode, periods: int, discard: int, size: float = 1e-8) -> float:
    """Mean rate at which two motions part that are brought back to a distance of `size` after each period."""
    n = len(system.states)
    away = np.zeros(x.size)
    away[:n] = size / math.sqrt(n)
    total, time = 0.0, 2.0 * math.pi / float(system.compiled.field(mode, x, p)[-1])
    other_mode = mode
    for i in range(discard + periods):
        other, other_mode = settle(system, p, x + away, mode, periods=1, tolerance=(1e-13, 1e-15))
        x, mode = settle(system, p, x, mode, periods=1, tolerance=(1e-13, 1e-15))
        assert other_mode == mode
        away = other - x
        length = float(np.linalg.norm(away[:n]))
        total += math.log(length / size) if i >= discard else 0.0
        away *= size / length
    return total / (time * periods)


@pytest.mark.parametrize(("parameters", "tolerance"), [(CHAOS, 1e-4), (BEYOND_GRAZING, 1e-3)])
def test_impacting_chaos_parts_neighbours_at_its_exponent(impact_oscillator, parameters, tolerance):
    p = impact_oscillator.parameter_vector(parameters)
    x, mode = settle(impact_oscillator, p, [0.0, 0.0], 0, periods=300)
    found = growth_along(
        impact_oscillator, p, x, mode, average=Average(periods=16, discard=10), exponents=1, tolerance=(1e-13, 1e-15)
    )
    assert found.exponents[0] == pytest.approx(benettin(impact_oscillator, p, x, mode, 16, 10), abs=tolerance)


def test_tapping_chaos_parts_neighbours_at_its_exponent(afm2, afm2_chaos):
    p, x, mode = afm2_chaos
    found = growth_along(
        afm2, p, x, mode, average=Average(periods=40, discard=30), exponents=1, tolerance=(1e-13, 1e-15)
    )
    assert found.exponents[0] == pytest.approx(benettin(afm2, p, x, mode, 40, 30), abs=1e-4)


def test_chaos_of_the_tapping_cantilever_is_certain(afm2, afm2_chaos):
    p, x, mode = afm2_chaos
    found = growth_along(afm2, p, x, mode, average=Average(periods=1000, discard=100), tolerance=(1e-8, 1e-10))
    assert found.exponents[0] > 5.0 * found.errors[0] > 0.0
    assert found.exponents[1] < -5.0 * found.errors[1]


def test_motion_just_beyond_grazing_is_chaotic_and_just_before_is_not(impact_oscillator):
    after = lyapunov_spectrum(
        impact_oscillator, BEYOND_GRAZING, [0.0, 0.0], average=Average(periods=1000), tolerance=1e-8
    )
    assert after.exponents[0] > 5.0 * after.errors[0]
    assert np.all(np.isfinite(after.logs))
    # without impacts both exponents are the real part -c/2 of the linear oscillator's eigenvalues
    orbit = ImpactOrbit(w=BEYOND_GRAZING["w"])
    A = 0.999 * orbit.A_grazing
    before = lyapunov_spectrum(
        impact_oscillator,
        BEYOND_GRAZING | {"A": A},
        orbit.linear_response(A)[1],
        average=Average(periods=200, discard=0),
    )
    assert before.sum == pytest.approx(-0.1, abs=1e-10)
    assert before.exponents == pytest.approx([-0.05, -0.05], abs=1.0 / before.times[-1])


# directions that are taken away, events that are grazed


def test_sticking_takes_a_direction_away(stick_slip):
    found = lyapunov_spectrum(stick_slip, None, [0.0, 0.3], mode="stick", average=Average(t_end=755.0))
    assert found.exponents[1] == -math.inf
    assert found.exponents[0] == pytest.approx(0.0, abs=1e-3)
    assert np.all(found.errors >= 0.0)
    assert found.kaplan_yorke == 1.0
    assert "-inf" in repr(found)


def test_plastic_impact_leaves_the_exponent_of_its_one_multiplier(impact_oscillator):
    orbit, U = ImpactOrbit(w=2.0, e=0.0), 1.5
    parameters = {"w": 2.0, "e": 0.0, "A": orbit.amplitude(U)}
    found = lyapunov_spectrum(
        impact_oscillator, parameters, orbit.after_impact(U), average=Average(periods=50, discard=20)
    )
    assert found.exponents[0] == pytest.approx(math.log(abs(orbit.trace(U))) / orbit.period, abs=1e-9)
    assert found.exponents[1] == -math.inf


def test_superstable_fixed_point_has_minus_infinity(logistic):
    found = lyapunov_spectrum(logistic, {"a": 2.0}, [0.5, 0.0], average=Average(t_end=100.0))
    assert found.exponents.tolist() == [0.0, -math.inf]
    assert found.errors.tolist() == [0.0, 0.0]
    assert not np.any(np.isnan(found.running))


def test_event_without_normal_velocity_is_counted_and_passed_unchanged():
    system = HybridSystem(
        ("x", "v", "y"),
        {},
        {"low": Mode({"x": "v", "v": "1", "y": "-y"}), "high": Mode({"x": "v", "v": "1", "y": "-y"})},
        [Transition("low", "high", "x", 1)],
    )
    # x = v = 0 and v' = 1: the event happens at once, at a velocity of 0
    found = lyapunov_spectrum(system, None, [0.0, 0.0, 1.0], mode="low", average=Average(t_end=20.0, discard=0.0))
    assert found.mode_end == "high"
    assert found.grazed == 1
    assert found.sum == pytest.approx(-1.0, abs=1e-9)
    assert "1 event grazed" in repr(found)


# what is promised of the numbers


def test_fewer_exponents_are_the_largest_of_all(afm2, afm2_chaos):
    p, x, mode = afm2_chaos
    everything = growth_along(afm2, p, x, mode, average=Average(periods=60, discard=60))
    two = growth_along(afm2, p, x, mode, average=Average(periods=60, discard=60), exponents=2)
    assert two.exponents == pytest.approx(everything.exponents[:2], abs=1e-6)


def test_units_of_the_states_do_not_matter():
    states, a = ("x", "y"), {"a": 1.4, "b": 0.3}
    plain = systems.carried_map(states, a, HENON)
    # y in units of 1/1024: not one bit of x changes
    other = systems.carried_map(states, a, {"x": "a - x**2 + b*(y/1024)", "y": "1024*x"})
    t, discard = 20_000.0, 100.0
    one = lyapunov_spectrum(plain, None, [0.5, 0.25, 0.0], average=Average(t_end=t, discard=discard))
    two = lyapunov_spectrum(other, None, [0.5, 256.0, 0.0], average=Average(t_end=t, discard=discard))
    assert two.x_end[0] == one.x_end[0]
    # only the lengths at both ends differ
    assert np.abs(one.exponents - two.exponents).max() < 2.0 * math.log(1024.0) / t
    assert two.sum == pytest.approx(one.sum, abs=1e-12)


@pytest.mark.campaign
def test_error_is_as_large_as_the_spread_between_runs(logistic):
    starts = np.linspace(0.11, 0.42, 24)
    found = [
        lyapunov_spectrum(logistic, {"a": 3.9}, [x, 0.0], average=Average(t_end=1000.0), exponents=1) for x in starts
    ]
    spread = np.std([each.exponents[0] for each in found], ddof=1)
    # Student's quantile for 19 degrees of freedom is 2.09
    assert np.median([each.errors[0] for each in found]) / 2.09 == pytest.approx(spread, rel=0.5)


def test_running_estimate_ends_at_the_exponents(afm1):
    found = lyapunov_spectrum(afm1, {"Omega": 1.04}, [0.0, 0.0], average=Average(periods=120))
    assert found.running[-1] == pytest.approx(found.exponents, rel=1e-12)
    assert found.times[-1] == pytest.approx(120 * found.period, rel=1e-12)
    assert found.discarded == pytest.approx(60 * found.period, rel=1e-12)
    assert found.per_period == pytest.approx(found.exponents * 2.0 * math.pi / 1.04, rel=1e-12)


def test_end_is_that_of_the_motion(impact_oscillator):
    found = lyapunov_spectrum(impact_oscillator, None, [0.3, 0.2], average=Average(periods=6, discard=2))
    end = simulate(impact_oscillator, None, [0.3, 0.2], periods=8)
    assert found.x_end == pytest.approx(end.x_end, abs=1e-12)
    assert found.mode_end == end.mode_end


def test_periods_begin_at_phase_zero(impact_oscillator):
    found = lyapunov_spectrum(impact_oscillator, None, [0.3, 0.2, 3.0], average=Average(periods=6, discard=0))
    assert found.discarded == pytest.approx(2.0 * math.pi - 3.0, rel=1e-12)
    assert found.x_end[-1] == 0.0


def test_threads_find_what_one_finds(afm2, afm2_chaos):
    p, x, mode = afm2_chaos

    def leading(_: int) -> float:
        return float(growth_along(afm2, p, x, mode, average=Average(periods=30, discard=0), exponents=1).exponents[0])

    with ThreadPoolExecutor(2) as pool:
        assert set(pool.map(leading, range(4))) == {leading(0)}


@pytest.mark.campaign
def test_memory_does_not_grow_with_the_periods(afm1):
    p = afm1.parameter_vector({"Omega": 1.04})

    def peak(periods: int) -> int:
        tracemalloc.start()
        growth_along(afm1, p, [0.0, 0.0], 0, average=Average(periods=periods, discard=0), tolerance=(1e-6, 1e-8))
        top = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return top

    peak(1000)
    assert peak(8000) < peak(1000) + 8 * 7000  # less than one number for each further period


# the result


def test_spectrum_survives_a_file(tmp_path, afm1):
    found = lyapunov_spectrum(afm1, {"Omega": 1.04}, [0.0, 0.0], average=Average(periods=40))
    again = LyapunovSpectrum.from_xarray(found.to_xarray())
    assert again == found
    assert LyapunovSpectrum.load(found.save(tmp_path / "exponents.nc")) == found


def test_repr_tells_exponents_errors_and_span(afm1):
    text = repr(lyapunov_spectrum(afm1, {"Omega": 1.04}, [0.0, 0.0], average=Average(periods=40)))
    assert "LyapunovSpectrum of 'tapping cantilever, n = 1' over t = 241.66" in text
    assert "(40 periods of theta), after 120.8" in text
    assert text.count(" +- ") == 2
    assert "sum -" in text


def test_dimension_is_not_told_from_too_few_exponents():
    assert math.isnan(
        lyapunov_spectrum(lorenz(), None, [1.0, 1.0, 20.0], average=Average(t_end=50.0), exponents=1).kaplan_yorke
    )


# bad input


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({}, "Average.periods, Average.t_end = {'periods': None, 't_end': None}: must be exactly one of the two given"),
        (
            {"periods": 3, "t_end": 1.0},
            "Average.periods, Average.t_end = {'periods': 3, 't_end': 1.0}: must be exactly one of the two given",
        ),
        ({"periods": 1}, "Average.periods = 1: must be an integer >= 2"),
        ({"periods": 2.5}, "Average.periods = 2.5: must be an integer >= 2"),
        ({"t_end": -1.0}, "Average.t_end = -1.0: must be a finite number > 0"),
        ({"periods": 9, "discard": -1}, "Average.discard = -1: must be an integer >= 0, a number of periods"),
        ({"periods": 9, "discard": 0.5}, "Average.discard = 0.5: must be an integer >= 0, a number of periods"),
        ({"t_end": 9.0, "discard": math.inf}, "Average.discard = inf: must be a finite number >= 0"),
        ({"periods": 9, "exponents": 3}, "exponents = 3: must be an integer between 1 and 2, the number of states"),
        ({"periods": 9, "exponents": 0}, "exponents = 0: must be an integer between 1 and 2, the number of states"),
        ({"periods": 9, "tolerance": 0.5}, "tolerance = 0.5: must be a number between 1e-14 and 0.1"),
        ({"periods": 9, "mode": "fly"}, "mode = 'fly': must be one of free"),
    ],
)
def test_bad_arguments_are_named(impact_oscillator, options, message):
    with pytest.raises(InputError) as caught:
        Grouped(lyapunov_spectrum, average=Average)(impact_oscillator, None, [0.0, 0.0], **options)
    assert message in str(caught.value)


def test_periods_need_a_phase(ball):
    with pytest.raises(InputError, match="left out for a system without a phase"):
        lyapunov_spectrum(ball, None, [1.0, 0.0], average=Average(periods=5))
    with pytest.raises(InputError, match="one with a phase"):
        _ = lyapunov_spectrum(lorenz(), None, [1.0, 1.0, 20.0], average=Average(t_end=1.0)).per_period


def test_motion_that_ends_tells_why(ball):
    with pytest.raises(ChatteringError):
        lyapunov_spectrum(ball, None, [1.0, 0.0], average=Average(t_end=10.0))
    runaway = HybridSystem(("x",), {}, {"grow": Mode({"x": "x"})})
    with pytest.raises(DivergenceError, match="a state passes 1e\\+12"):
        lyapunov_spectrum(runaway, None, [1.0], average=Average(t_end=100.0))
