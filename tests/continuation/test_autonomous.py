"""Branches of smooth autonomous cycles: nothing false on them, Hopf points at their ends, closed ones traced once."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from saltus.continuation import Branch, StepControl
from saltus.orbits import PeriodicOrbit, find_orbit, solve_orbit
from saltus.system import HybridSystem, Mode, Transition

STEPS = (None, StepControl(largest=0.03), StepControl(initial=0.05, largest=0.3))
TOR = {
    "x": "(-(0.5 + nu)*x + 0.5*y - 0.328578*x**3 + 0.933578*(y - x)**3)/0.6",
    "y": "0.5*x + 0.1*y - z - 0.933578*(y - x)**3",
    "z": "y",
}


def lure(*transitions: Transition) -> HybridSystem:
    """Return the feedback loop of Lur'e's type, in units `t` of time and `l` of length."""
    field = {"x": "y/t", "y": "z/t", "z": "(-al*z - be*y - x + x**2/l)/t"}
    return HybridSystem(("x", "y", "z"), {"al": 0.8, "be": 1.0, "t": 1.0, "l": 1.0}, {"m": Mode(field)}, transitions)


def found(branch: Branch) -> list[tuple[str, float]]:
    return [(point.type, point.parameters[branch.parameter]) for point in branch.special_points]


@pytest.fixture(scope="module")
def cycle() -> PeriodicOrbit:
    return find_orbit(lure(), x0=[0.1, 0.0, 0.0])


@pytest.mark.campaign
@pytest.mark.parametrize("al", [0.65, 0.7, 0.8, 0.9, 0.98])
def test_lure_cycle_doubles_and_shrinks_at_the_same_places_from_every_start(al: float) -> None:
    orbit = find_orbit(lure(), {"al": al}, x0=[0.1, 0.0, 0.0])
    for steps in STEPS:
        branch = saltus.continue_orbit(orbit, "al", (0.6, 1.2), steps=steps)
        (_, doubling), (_, hopf) = points = found(branch)
        assert [kind for kind, _ in points] == ["PD", "HB"]
        assert doubling == pytest.approx(0.63030200616, abs=1e-9)
        assert hopf == pytest.approx(1.0, abs=1e-12)
        assert branch.stopped == ("al = 0.6: bound reached", "al = 1: the cycle shrinks to an equilibrium")
        assert np.all(np.diff(branch.values) > 0.0)


@pytest.mark.parametrize(("time", "length"), [(1e-6, 1e-9), (1e6, 1e9), (1e-6, 1.0)])
def test_units_of_time_and_length_change_nothing(cycle: PeriodicOrbit, time: float, length: float) -> None:
    guess = [("m", None, np.asarray(cycle.x0) * length, cycle.period * time)]
    branch = saltus.continue_orbit(solve_orbit(lure(), {"t": time, "l": length}, guess), "al", (0.6, 1.2))
    (_, doubling), (_, hopf) = points = found(branch)
    assert [kind for kind, _ in points] == ["PD", "HB"]
    assert doubling == pytest.approx(0.63030200616, abs=1e-9)
    assert hopf == pytest.approx(1.0, abs=1e-12)
    assert branch["HB1"].orbit.period == pytest.approx(2.0 * math.pi * time, rel=1e-12)


def test_a_section_through_the_cycle_changes_nothing() -> None:
    cut = lure(Transition("m", "m", "y", -1))
    branch = saltus.continue_orbit(find_orbit(cut, x0=[0.1, 0.02, 0.0]), "al", (0.65, 1.2))
    assert [(kind, round(value, 11)) for kind, value in found(branch)] == [("HB", 1.0)]


def test_hopf_point_is_an_equilibrium_with_the_multipliers_of_its_linearisation(cycle: PeriodicOrbit) -> None:
    branch = saltus.continue_orbit(cycle, "al", (0.7, 1.2))
    point = branch["HB1"]
    jacobian = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, -1.0, -1.0]])
    decay = min(np.linalg.eigvals(jacobian).real)
    assert point.orbit.x0 == pytest.approx([0.0, 0.0, 0.0], abs=1e-12)
    assert point.orbit.multipliers == pytest.approx([1.0, math.exp(2.0 * math.pi * decay), 1.0], rel=1e-10)
    assert branch.multipliers[-1] == pytest.approx(point.orbit.multipliers)
    assert branch.solution(-1).multipliers == pytest.approx(point.orbit.multipliers, abs=1e-7)
    assert "the cycle shrinks to an equilibrium" in repr(point)


def test_brusselator_cycle_ends_where_b_is_1_plus_a_squared() -> None:
    field = {"x": "A - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"}
    brusselator = HybridSystem(("x", "y"), {"A": 1.0, "B": 3.0}, {"m": Mode(field)})
    for a in (0.5, 1.0, 2.0):
        orbit = find_orbit(brusselator, {"A": a, "B": 1.2 + a * a}, x0=[1.1 * a, (1.2 + a * a) / a])
        branch = saltus.continue_orbit(orbit, "B", (0.5, 1.5 + a * a))
        assert found(branch) == [("HB", pytest.approx(1.0 + a * a, rel=1e-12))]
        assert branch["HB1"].orbit.period == pytest.approx(2.0 * math.pi / a, rel=1e-9)


def test_three_bifurcations_of_the_torus_oscillator_and_none_beside() -> None:
    oscillator = HybridSystem(("x", "y", "z"), {"nu": -0.6}, {"m": Mode(TOR)})
    orbit = find_orbit(oscillator, x0=[0.1, 0.12, 0.1])
    assert orbit.period == pytest.approx(8.97112262183, rel=1e-9)
    branch = saltus.continue_orbit(orbit, "nu", (-0.63, -0.5))
    kinds = dict(found(branch))
    assert set(kinds) == {"PD", "TR", "BP"}
    assert kinds["PD"] == pytest.approx(-0.614955221138, abs=1e-9)
    assert kinds["TR"] == pytest.approx(-0.591650195, abs=1e-8)
    assert kinds["BP"] == pytest.approx(-0.587028974, abs=1e-8)


def isola() -> HybridSystem:
    """Return cycles on r^2 = 2 +- sqrt(1 - mu^2), in coordinates in which they are no circles."""
    rate = "0.05*((x**2 + (v - 0.5*x**2)**2 - 2)**2 + mu**2 - 1)"
    x = f"{rate}*x - (1 + 0.3*x)*(v - 0.5*x**2)"
    y = f"{rate}*(v - 0.5*x**2) + (1 + 0.3*x)*x"
    return HybridSystem(("x", "v"), {"mu": 0.2}, {"m": Mode({"x": x, "v": f"{y} + x*({x})"})})


@pytest.mark.campaign
@pytest.mark.parametrize("steps", STEPS)
def test_closed_branch_of_cycles_is_traced_once(steps: StepControl | None) -> None:
    radius = math.sqrt(2.0 - math.sqrt(1.0 - 0.04))
    orbit = solve_orbit(isola(), {}, [("m", None, [radius, 0.5 * radius**2], 6.6)])
    branch = saltus.continue_orbit(orbit, "mu", (-2.0, 2.0), steps=steps)
    assert branch.stopped == ("the branch is closed", "the branch is closed")
    assert sorted(found(branch)) == [("SN", pytest.approx(-1.0, abs=1e-9)), ("SN", pytest.approx(1.0, abs=1e-9))]


@pytest.mark.campaign
def test_closed_branch_that_exchanges_the_two_phases_of_an_orbit_is_traced_once() -> None:
    # F(z) = -z - h(z) with h odd: the orbits {z, -z} have z^2 = 0.3 + 0.6 exp(i psi), p = cos(psi)
    real, imaginary = "(x**2 - y**2 - 0.3)", "(2*x*y)"
    size, part = f"({real}**2 + {imaginary}**2 - 0.36)", f"({real} - 0.6*p)"
    reset = {"x": f"-x - 0.3*(x*{size} - y*{part})", "y": f"-y - 0.3*(y*{size} + x*{part})", "s": "0"}
    carried = HybridSystem(
        ("x", "y", "s"),
        {"p": 0.3},
        {"carry": Mode({"x": "0", "y": "0", "s": "1"})},
        [Transition("carry", "carry", "s - 1", 1, reset, name="map")],
    )
    z = np.sqrt(0.3 + 0.6 * np.exp(1j * math.acos(0.3)))
    guess = [("carry", "map", [way * z.real, way * z.imag, 0.0], 1.0) for way in (1.0, -1.0)]
    branch = saltus.continue_orbit(solve_orbit(carried, {}, guess), "p", (-2.0, 2.0))
    assert branch.stopped == ("the branch is closed", "the branch is closed")
    assert sorted(found(branch)) == [("SN", pytest.approx(-1.0, abs=1e-9)), ("SN", pytest.approx(1.0, abs=1e-9))]


def test_find_orbit_goes_once_round_whatever_the_start(cycle: PeriodicOrbit) -> None:
    starts = np.random.default_rng(0).normal(0.0, 0.1, (10, 3))
    periods = [find_orbit(lure(), {"al": 0.7}, x0=x).period for x in starts]
    assert periods == pytest.approx([periods[0]] * 10, rel=1e-9)
    assert periods[0] == pytest.approx(6.35, abs=1e-3)


def test_towards_a_homoclinic_orbit_every_point_is_an_orbit_and_the_end_says_so() -> None:
    spiking = HybridSystem(
        ("v", "u"),
        {"a": 0.02, "b": 0.2, "c": -65.0, "d": 8.0, "J": 10.0},
        {"m": Mode({"v": "0.04*v**2 + 5*v + 140 - u + J", "u": "a*(b*v - u)"})},
        [Transition("m", "m", "v - 30", 1, {"v": "c", "u": "u + d"}, name="spike")],
    )
    branch = saltus.continue_orbit(find_orbit(spiking, x0=[-65.0, -13.0]), "J", (3.0, 40.0))
    assert branch.residual.max() < 1e-6
    assert branch.special_points.of_type("SN", "PD", "TR") == []
    assert "the period grows without bound (T = " in branch.stopped[0]
