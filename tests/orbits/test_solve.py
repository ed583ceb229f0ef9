"""Periodic orbits against closed forms and printed digits: problems A to E."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import systems
from oracles.closed_forms import ImpactOrbit, TableJump, two_fields_orbit
from saltus import HybridSystem, Mode, Transition, continue_orbit, solve_orbit
from saltus.errors import InputError

FLOW = 1e-10
"""Error allowed to states and durations of size one: tens of steps at a tolerance of 1e-12, with growth."""

# A: two planar fields


@pytest.mark.parametrize(
    ("al", "be", "r0", "r1", "period"),
    [
        (1.0, 0.5, 0.583821306681, 0.970115433417, 5.574534498412),
        (1.0, 2.0, 1.934147003190, 1.021316191287, 4.810271605994),
        (1.0, 5.0, 4.905118551832, 1.035629758769, 4.199141383946),
        (0.5, 2.0, 1.634046186660, 1.017053918799, math.pi + 1.462196263879),
    ],
)
def test_two_fields_have_the_printed_orbit(al, be, r0, r1, period):
    guess = [("left", "to_right", [0.0, 1.1 * r0], 3.0), ("right", "to_left", [0.0, -1.1 * r1], period - 3.0)]
    orbit = solve_orbit(systems.two_fields(), {"al": al, "be": be}, guess)
    left, right = sorted(orbit.segments, key=lambda part: part.mode)
    np.testing.assert_allclose(
        left.state, [0.0, r0], atol=5e-12
    )  # half a unit of the last digit in print, and the flow's
    np.testing.assert_allclose(right.state, [0.0, -r1], atol=5e-12)
    assert left.duration == pytest.approx(math.pi, abs=5e-12)
    assert orbit.period == pytest.approx(period, abs=5e-12)
    assert orbit.stable
    assert orbit.admissible
    assert orbit.max["x2"] >= r0 - 1e-10


@pytest.mark.parametrize(("al", "be", "guess"), [(1.0, 0.5, 0.58), (1.0, 2.0, 1.93), (1.0, 5.0, 4.9), (0.5, 2.0, 1.63)])
def test_two_fields_have_the_multiplier_of_the_closed_form(al, be, guess):
    r0, r1, period, multiplier = two_fields_orbit(al, be, 1.5, guess)
    segments = [("left", "to_right", [0.0, r0], 3.0), ("right", "to_left", [0.0, -r1], period - 3.0)]
    orbit = solve_orbit(systems.two_fields(), {"al": al, "be": be}, segments)
    assert orbit.period == pytest.approx(period, abs=5e-12)
    np.testing.assert_allclose(orbit.multipliers, [multiplier, 1.0], atol=2e-12)


# B: linear forced impact oscillator


def clock_oscillator() -> HybridSystem:
    """The impact oscillator with its phase as an ordinary state, put back by an event of its own."""
    return HybridSystem(
        ("x", "v", "s"),
        {"k": 1.0, "c": 0.1, "d": 1.0, "e": 0.8, "w": 1.0, "A": 1.0},
        {"free": Mode({"x": "v", "v": "-k*x - c*v + A*cos(s)", "s": "w"})},
        [
            Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="impact"),
            Transition("free", "free", "s - 2*pi", 1, {"s": "s - 2*pi"}, name="turn"),
        ],
        name="impact oscillator with a clock",
    )


def oscillator_orbit(form: ImpactOrbit, U: float, wrong: float = 1.0):
    """The orbit of a closed form from a guess whose numbers are wrong by a factor."""
    state = form.after_impact(U) * [1.0, wrong, 1.0] + [0.0, 0.0, wrong - 1.0]
    parameters = {"w": form.w, "A": form.amplitude(U), "k": form.k, "c": form.c, "d": form.d, "e": form.e}
    return solve_orbit(systems.impact_oscillator(), parameters, [("free", "impact", state, form.period)])


def sorted_complex(values):
    return np.array(sorted(values, key=lambda mu: (round(mu.real, 9), mu.imag)))


def test_impact_oscillator_has_the_printed_orbit():
    form = ImpactOrbit(1.0)
    orbit = oscillator_orbit(form, form.speeds(1.0)[1], 1.05)
    assert orbit.parameters["A"] == pytest.approx(1.0, abs=1e-13)
    state = orbit.segments[0].state
    assert -state[1] / 0.8 == pytest.approx(1.6957329376, abs=1e-10)
    np.testing.assert_allclose(state, [1.0, -1.35658635, 0.07595216], atol=5e-9)
    expected = [-0.58429531 - 0.00560035j, -0.58429531 + 0.00560035j]
    np.testing.assert_allclose(sorted_complex(orbit.multipliers), expected, atol=5e-9)
    assert orbit.stable
    assert orbit.admissible
    assert orbit.max["x"] == pytest.approx(1.0, abs=1e-11)


@pytest.mark.parametrize("m", [1, 2, 3])
@pytest.mark.parametrize("w", [0.7, 1.1, 1.4, 2.2, 2.5])
@pytest.mark.parametrize("U", [0.02, 0.3, 1.0, 5.0])
def test_impact_orbits_are_the_closed_form(w, m, U):
    form = ImpactOrbit(w, m)
    orbit = oscillator_orbit(form, U)
    scale = max(1.0, form.amplitude(U), 1.0 / U)
    assert np.abs(orbit.segments[0].state - form.after_impact(U)).max() < FLOW * scale
    product, total = np.prod(orbit.multipliers), np.sum(orbit.multipliers)
    assert abs(product - form.det) < FLOW * scale * max(1.0, abs(form.trace(U)))
    assert abs(total - form.trace(U)) < FLOW * scale * max(1.0, abs(form.trace(U)))


@pytest.mark.parametrize(
    ("k", "c", "d", "e"), [(4.0, 0.3, 0.5, 0.6), (1.0, 0.0, 1.0, 0.9), (1.0, 0.1, 0.0, 0.7), (0.5, 0.2, -0.5, 0.95)]
)
def test_impact_orbits_are_the_closed_form_for_other_constants(k, c, d, e):
    form = ImpactOrbit(1.7, 1, k, c, d, e)
    orbit = oscillator_orbit(form, 1.0)
    assert np.abs(orbit.segments[0].state - form.after_impact(1.0)).max() < FLOW
    assert abs(np.prod(orbit.multipliers) - form.det) < FLOW * 10
    assert abs(np.sum(orbit.multipliers) - form.trace(1.0)) < FLOW * 10


def test_an_orbit_with_negative_impact_speed_is_no_motion():
    form = ImpactOrbit(1.0)
    U = form.speeds(0.11)[0]  # beyond the grazing at A = 0.1, on the branch that reaches it
    assert U < 0.0
    orbit = oscillator_orbit(form, U)
    np.testing.assert_allclose(orbit.segments[0].state, form.after_impact(U), atol=FLOW)
    assert not orbit.admissible
    assert "an event is crossed in the wrong direction" in orbit.reasons


@pytest.mark.parametrize(("w", "m", "U", "admissible"), [
    (0.7, 1, 0.1115656248, True), (1.1, 1, 0.3137472285, True), (1.1, 1, 6.7604231253, True),
    (1.4, 1, 1.3078973885, True), (2.2, 1, 0.8312195956, True), (2.5, 2, 0.8272847357, True),
    (2.5, 2, 1.1409288496, True), (1.4, 2, 0.4783111079, False),
])  # fmt: skip
def test_admissible_is_as_in_the_table(w, m, U, admissible):
    orbit = oscillator_orbit(ImpactOrbit(w, m), 1.01 * U)
    assert orbit.admissible == admissible
    assert orbit.reasons == (() if admissible else ("another event lies inside a segment",))


@pytest.mark.parametrize(("w", "m", "U"), [(1.0, 1, 1.6957329376), (2.2, 1, 0.5), (2.5, 2, 0.9), (1.4, 1, 0.6)])
def test_a_clock_carried_as_a_state_gives_the_same_orbit(w, m, U):
    form = ImpactOrbit(w, m)
    x, v, s = form.after_impact(U)
    s %= 2.0 * math.pi
    first = (2.0 * math.pi - s) / w
    by_phase = oscillator_orbit(form, U)
    at_turn = by_phase.x0
    segments = [("free", "turn", [x, v, s], first)]
    if m == 2:
        segments.append(("free", "turn", [*at_turn, 0.0], 2.0 * math.pi / w))
        at_turn = flow_without_impact(form, form.amplitude(U), at_turn, 2.0 * math.pi / w)
    segments.append(("free", "impact", [*at_turn, 0.0], s / w))
    orbit = solve_orbit(clock_oscillator(), {"w": w, "A": form.amplitude(U)}, segments)
    assert orbit.period == pytest.approx(form.period, abs=FLOW)
    hit = [part.transition for part in orbit.segments].index("impact")
    after = orbit.segments[(hit + 1) % len(orbit.segments)].state
    np.testing.assert_allclose(after, [x, v, s], atol=FLOW)
    assert orbit.multipliers[-1] == 1.0
    np.testing.assert_allclose(
        sorted_complex(orbit.multipliers[:-1]), sorted_complex(form.multipliers(U)), atol=1e-9
    )  # a pair near coincidence amplifies by the square root: here they are 1e-2 apart or more
    assert orbit.stable == by_phase.stable
    assert orbit.admissible == by_phase.admissible


def flow_without_impact(form: ImpactOrbit, A: float, state, time: float):
    """State a time after phase 0: the linear response, and what decays of the difference to it."""
    z = A / complex(form.k - form.w**2, form.c * form.w)
    then = z * np.exp(1j * form.w * time)
    decay = expm(np.array([[0.0, 1.0], [-form.k, -form.c]]) * time)
    return [then.real, -form.w * then.imag] + decay @ (state - np.array([z.real, -form.w * z.imag]))


# C: ball on a table


@pytest.mark.parametrize("saddle", [False, True])
@pytest.mark.parametrize(("e", "n"), [(0.5, 1), (0.8, 2), (0.3, 1), (0.9, 3)])
def test_table_jumps_are_the_closed_form(e, n, saddle):
    form = TableJump(e, n)
    Gamma = 1.1 * form.fold
    x = form.after_impact(Gamma, saddle)
    guess = [("flight", "impact", x * [1.0, 1.02, 1.0], 2.0 * math.pi * n * 1.001)]
    orbit = solve_orbit(systems.ball_on_table(), {"e": e, "a": Gamma}, guess)
    np.testing.assert_allclose(orbit.segments[0].state, x, atol=FLOW)
    assert abs(np.prod(orbit.multipliers) - form.det) < FLOW
    assert abs(np.sum(orbit.multipliers) - form.trace(Gamma, saddle)) < FLOW * 10
    assert orbit.stable == (not saddle)


# D: stick-slip


@pytest.mark.parametrize("first", [0, 1])
def test_stick_slip_has_the_printed_orbit(first):
    guess = [("slip", "catch", [0.9, 0.3], 4.0), ("stick", "release", [-0.05, 0.3], 3.0)]
    orbit = solve_orbit(systems.stick_slip(), {}, guess[first:] + guess[:first])
    durations = {part.mode: part.duration for part in orbit.segments}
    assert durations["slip"] == pytest.approx(4.222431654131, abs=2e-12)
    assert durations["stick"] == pytest.approx(10.0 / 3.0, abs=2e-12)
    assert orbit.min["x"] == pytest.approx(-0.083095189485, abs=2e-12)
    assert orbit.max["x"] == pytest.approx(1.083095189485, abs=2e-12)
    np.testing.assert_allclose(orbit.multipliers, [0.0, 1.0], atol=1e-12)
    assert orbit.stable
    assert orbit.admissible


# E: relay feedback


@pytest.mark.parametrize("wrong", [0.8, 1.0, 1.3])
def test_relay_feedback_has_the_printed_orbit(wrong):
    guess = [
        ("down", "switch_up", [0.72 * wrong, 0.29 / wrong, 0.0], 1.84 * wrong),
        ("up", "switch_down", [-0.72, -0.29, 0.0], 1.84),
    ]
    orbit = solve_orbit(systems.relay(), {}, guess)
    assert orbit.period == pytest.approx(3.679750670865, abs=2e-12)
    down = next(part for part in orbit.segments if part.mode == "down")
    np.testing.assert_allclose(down.state, [0.725867926, 0.290630922, 0.0], atol=1e-9)
    np.testing.assert_allclose(orbit.multipliers, [0.147448764, 1.0891122e-4, 1.0], atol=1e-9)
    assert orbit.multipliers[1] == pytest.approx(1.0891122e-4, abs=1e-11)
    assert orbit.admissible


# orbits on which nothing moves


def meissner(c: float = 0.05) -> HybridSystem:
    """Hill's equation with a square wave, x = 0 its trivial solution."""
    return HybridSystem(
        ("x", "v", "s"),
        {"d": 1.0, "eps": 0.3, "c": c},
        {
            "stiff": Mode({"x": "v", "v": "-(d + eps)*x - c*v", "s": "1"}),
            "soft": Mode({"x": "v", "v": "-(d - eps)*x - c*v", "s": "1"}),
        },
        [
            Transition("stiff", "soft", "s - pi", 1, name="soften"),
            Transition("soft", "stiff", "s - 2*pi", 1, {"s": "0"}, name="stiffen"),
        ],
    )


@pytest.mark.parametrize("d", [0.25, 1.0, 4.0, 16.0])
def test_multipliers_of_the_trivial_solution_of_meissners_equation(d):
    soft, stiff = (expm(np.pi * np.array([[0.0, 1.0], [-(d + s * 0.3), -0.05]])) for s in (-1.0, 1.0))
    expected = sorted_complex(np.linalg.eigvals(soft @ stiff))
    guess = [("stiff", "soften", [0.0, 0.0, 0.0], 3.1), ("soft", "stiffen", [0.0, 0.0, 3.1], 3.1)]
    orbit = solve_orbit(meissner(), {"d": d}, guess)
    np.testing.assert_allclose(sorted_complex(orbit.multipliers[:-1]), expected, atol=1e-9)


@pytest.mark.parametrize("w", [0.5, 1.0, 3.0])
def test_multiplier_of_a_forced_equilibrium_is_the_exponential(w):
    still = HybridSystem(("x",), {"w": 1.0}, {"m": Mode({"x": "1 - x**2"})}, phase=("s", "w"))
    orbit = solve_orbit(still, {"w": w}, [("m", "s", [0.9], 2.0 * math.pi / w)])
    assert orbit.x0[0] == pytest.approx(1.0, abs=1e-12)
    assert orbit.multipliers[0] == pytest.approx(math.exp(-4.0 * math.pi / w), abs=1e-10)


def test_an_autonomous_cycle_without_events_is_the_unit_circle():
    system = HybridSystem(
        ("x", "y"),
        {"mu": 1.0, "w": 2.0},
        {"m": Mode({"x": "mu*x*(1 - x**2 - y**2) - w*y", "y": "mu*y*(1 - x**2 - y**2) + w*x"})},
    )
    orbit = solve_orbit(system, {}, [("m", None, [1.2, 0.1], 3.0)])
    assert orbit.period == pytest.approx(math.pi, abs=FLOW)
    assert math.hypot(*orbit.x0) == pytest.approx(1.0, abs=FLOW)
    np.testing.assert_allclose(orbit.multipliers, [math.exp(-2.0 * math.pi), 1.0], atol=1e-10)
    assert orbit.max["x"] == pytest.approx(1.0, abs=1e-10)


def test_brentq_agrees_with_the_slip_time():
    """The oracle of D, found a second way: the slip phase is a harmonic about x = Fk."""
    x0, v0 = 1.0 - 0.5, 0.3
    slip = brentq(lambda t: -x0 * math.sin(t) + v0 * math.cos(t) - v0, 3.0, 6.0, xtol=1e-14)
    assert slip == pytest.approx(4.222431654131, abs=1e-12)


@pytest.mark.parametrize("further", [False, True], ids=["one mode", "two modes"])
def test_a_cycle_without_events_of_a_system_with_events_needs_no_segments(further):
    field = {"x": "v", "v": "m*(1 - x**2)*v - x"}
    smooth = solve_orbit(HybridSystem.smooth(field, {"m": 1.0}), x0=[2.0, 0.0], period=6.6)
    modes = {"a": Mode(field)} | ({"b": Mode({"x": "v", "v": "-x"})} if further else {})
    stop = Transition("a", "b", "x - d", 1) if further else Transition("a", "a", "x - d", 1, {"v": "-v"})
    transitions = [stop, *([Transition("b", "a", "x - d", -1)] if further else [])]
    system = HybridSystem(("x", "v"), {"m": 1.0, "d": 5.0}, modes, transitions)
    orbit = solve_orbit(system, x0=[2.0, 0.0], period=6.6)
    assert orbit.period == pytest.approx(smooth.period, rel=1e-11)
    assert orbit.signature == (("a", ""),)
    branch = continue_orbit(orbit, "m", (0.5, 2.0))
    assert all("bound reached" in reason for reason in branch.stopped)
    with pytest.raises(InputError, match="that meets no event in a period; .* meets a_to_"):
        solve_orbit(system, {"d": 1.5}, x0=[0.5, 0.0], period=6.6)
