"""Solutions of a branch at a value of its parameter: closed forms, turns, bad input."""

import contextlib
import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.special import ellipk

import saltus
from oracles.closed_forms import ImpactOrbit
from saltus import ConvergenceError, HybridSystem, InputError, Map
from saltus.continuation.results.crossings import covered


@pytest.fixture(scope="module")
def impacting(impact_oscillator):
    closed = ImpactOrbit(1.1)
    guess = [("free", "impact", closed.after_impact(closed.speeds(1.0)[1]), closed.period)]
    orbit = saltus.solve_orbit(impact_oscillator, {"w": 1.1, "A": 1.0}, guess)
    return saltus.continue_orbit(orbit, "A", bounds=(0.05, 2.0))


@pytest.fixture(scope="module")
def fold():
    system = HybridSystem.smooth({"x": "a - x**2", "y": "x - y"}, {"a": 1.0})
    return saltus.continue_equilibrium(saltus.find_equilibrium(system, x0=[1.0, 1.0]), "a", (-1.0, 1e4))


@pytest.mark.parametrize("share", [1e-9, 1e-5, 0.01, 0.3])
def test_orbits_on_both_sides_of_a_fold_are_those_of_the_closed_form(impacting, share):
    turn = impacting["SN1"].parameters["A"]
    A = turn + share * (0.9 - turn)
    found = [orbit for orbit in impacting.at(A) if any(name == "impact" for _, name in orbit.signature)]
    speeds = sorted(orbit.observe("velocity(impact)")["velocity(impact)"] for orbit in found)
    assert speeds == pytest.approx(sorted(U for U in ImpactOrbit(1.1).speeds(A) if U > 0.0), rel=1e-6)
    assert all(orbit.parameters["A"] == A for orbit in found)


def test_a_value_of_a_point_and_of_a_fold_has_the_solution_once(impacting, fold):
    whole = impacting.values.tolist()
    assert any(np.array_equal(orbit.x0, impacting.x0[3]) for orbit in impacting.at(whole[3]))
    at_fold = fold.at(fold["SN1"].parameters["a"])
    assert [found.state.tolist() for found in at_fold] == [fold["SN1"].equilibrium.state.tolist()]


def test_a_value_that_misses_an_end_by_rounding_has_the_solution_of_the_end_once(impacting, fold):
    for branch in (impacting, fold):
        for end, next_to_it in ((0, 1), (-1, -2)):
            value, inner = float(branch.values[end]), float(branch.values[next_to_it])
            missed = math.nextafter(value, math.copysign(math.inf, value - inner))
            assert len(branch.at(missed)) == len(branch.at(value)) >= 1
            with contextlib.suppress(InputError):  # no other part of the branch comes there
                assert len(branch.at(value + 1e-6 * (value - inner))) == len(branch.at(value)) - 1


def test_equilibria_at_a_value_are_in_order_along_the_branch(fold):
    for a in (1e-12, 1e-6, 0.3, 77.7, 9999.0):
        states = np.array([found.state for found in fold.at(a)])
        assert states == pytest.approx(np.array([[-1.0, -1.0], [1.0, 1.0]]) * math.sqrt(a), rel=1e-9)


def test_cycles_of_a_map_at_a_value():
    logistic = Map(("x",), {"r": 3.3}, {"x": "r*x*(1 - x)"})
    two = saltus.continue_orbit(saltus.solve_orbit(logistic, x0=[0.5], period=2), "r", (3.1, 4.0))
    (found,) = two.at(3.7)
    root = math.sqrt(0.7 * 4.7)
    assert sorted(found.points[:, 0]) == pytest.approx([(4.7 - root) / 7.4, (4.7 + root) / 7.4], rel=1e-12)


def test_orbits_at_a_value_of_a_quantity():
    pendulum = HybridSystem.smooth({"x": "v", "v": "-sin(x)"})
    swing = saltus.solve_orbit(pendulum, x0=[1.0, 0.0], period=6.7, fix={"max_x": 1.0})
    (found,) = saltus.continue_orbit(swing, "max_x", (0.5, 2.5)).at(2.0)
    assert found.max["x"] == pytest.approx(2.0, abs=1e-9)
    assert found.period == pytest.approx(4.0 * ellipk(math.sin(1.0) ** 2), abs=1e-8)


def test_stiff_cycles_that_are_cut_are_solved_at_a_value():
    van_der_pol = HybridSystem.smooth({"x": "y", "y": "mu*(1 - x**2)*y - x"}, {"mu": 1.0})
    cycles = saltus.continue_orbit(saltus.find_orbit(van_der_pol, {"mu": 5.0}, [2.0, 0.0]), "mu", bounds=(4.0, 30.0))
    (found,) = cycles.at(10.0)
    assert found.period == pytest.approx(19.07836957, abs=1e-7)


def test_doubled_orbits_with_events_are_solved_at_a_value(impact_oscillator):
    orbit = saltus.find_orbit(impact_oscillator, {"w": 0.7, "c": 0.1, "d": 1.0, "A": 0.4}, [0.0, 0.0])
    branch = saltus.continue_orbit(orbit, "A", bounds=(0.05, 2.0))
    doubled = saltus.continue_orbit(saltus.switch_branch(branch["PD1"]), "A", bounds=(0.5, 0.6), stop_at="PD")
    low, high = sorted((doubled.values[1], doubled.values[-1]))
    for share in (0.1, 0.5, 0.9):
        (found,) = doubled.at(low + share * (high - low))
        assert found.form.turns == 2
        assert found.residual < 1e-12


@pytest.mark.parametrize("end", [1.4, 1.7, 1.9])
def test_an_orbit_solved_at_a_bound_starts_a_branch_away_from_it(impacting, end):
    """The start may miss the bound by rounding; a step away from the bound must not take it for an end."""
    for start in impacting.at(end):
        for miss in (0.0, 3e-11, -3e-11):
            bounds = (0.5, end * (1.0 + miss))
            branch = saltus.continue_orbit(start, "A", bounds=bounds)
            assert branch.values.min() < 0.9 * end
            assert len(branch) > 5


def test_a_value_that_the_branch_does_not_come_to_is_told(fold, impacting):
    with pytest.raises(InputError, match=r"a = -0.5: must be between 0 and 10000, where the branch is"):
        fold.at(-0.5)
    with pytest.raises(InputError, match="value = nan"):
        impacting.at(math.nan)


def test_a_gap_that_newton_does_not_close_is_told(fold, monkeypatch):
    def lost(*_arguments, **_options):
        raise ConvergenceError("equilibrium", 1.0, 3, "lost")

    monkeypatch.setattr("saltus.continuation.results.equilibrium_branch.find_equilibrium", lost)
    with pytest.raises(ConvergenceError, match="solution at a = 0.123, between points at .* and .*: ") as told:
        fold.at(0.123)
    assert "residual 1 after 12 iterations; Newton's method fails from 4 guesses" in str(told.value)
    assert str(told.value).endswith("; trace the branch with shorter steps there")


def test_solutions_of_another_branch_are_told(fold, monkeypatch):
    far = fold.at(1.0)[0]
    monkeypatch.setattr("saltus.continuation.results.equilibrium_branch.find_equilibrium", lambda *_a, **_k: far)
    with pytest.raises(ConvergenceError, match=r"solution at a = 9000.*from 4 it leads to one .* of its size away"):
        fold.at(9000.0)


def test_a_branch_comes_to_the_bound_that_its_start_misses_by_rounding():
    """The nearest point of the branch lies beside a start whose states are not exact."""
    k = 1.3
    driven = HybridSystem.smooth({"x": "v", "v": "cos(s) - k*x - 0.2*v"}, {"k": k, "w": 1.0}, phase=("s", "w"))
    exact = saltus.find_orbit(driven, {}, [0.0, 0.0])
    start = dataclasses.replace(exact, states=exact.states * (1.0 + 3e-10))
    branch = saltus.continue_orbit(start, "k", (1.1, k))
    assert branch.values.max() == k
    (orbit,) = branch.at(k)
    assert orbit.max["x"] == pytest.approx(1.0 / math.hypot(k - 1.0, 0.2), rel=1e-9)


def test_ranges_of_branches_are_joined_where_they_overlap():

    parts = [SimpleNamespace(values=np.array(one)) for one in ([5.0, 7.0, 6.0], [1.0, 2.0], [6.5, 8.0], [2.0, 3.0])]
    assert covered(parts) == [(1.0, 3.0), (5.0, 8.0)]
