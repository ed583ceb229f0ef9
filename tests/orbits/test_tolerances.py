"""The same orbits at every tolerance: never gone round twice, as near to the exact ones as the tolerance says."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import tolerances
from saltus import HybridSystem, find_orbit
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, Signature
from saltus.orbits.solve import converge
from selection import guarding

EVERY = list(itertools.product(tolerances.CASES, tolerances.TOLERANCES))
KEPT = [("Roessler", 1e-6), ("Roessler", 1e-5), ("hard stop", 1e-5), ("stick-slip", 1e-5)]


@pytest.mark.parametrize(("name", "tolerance"), guarding(EVERY, *KEPT))
def test_one_orbit_is_found_once_round_at_every_tolerance(name: str, tolerance: float) -> None:
    start = tolerances.CASES[name][1]
    exact, found = (find_orbit(tolerances.system(name), x0=start, tolerance=tol) for tol in (1e-12, tolerance))
    assert (found.rounds, found.signature) == (exact.rounds, exact.signature)
    assert found.period == pytest.approx(exact.period, rel=100.0 * tolerance, abs=1e-10)
    assert found.stable == exact.stable


@pytest.mark.parametrize("tolerance", guarding(tolerances.TOLERANCES, 1e-6))
def test_period_of_roesslers_cycle_is_that_of_another_solver(tolerance: float) -> None:
    def returned(t: float, u: np.ndarray) -> float:
        return float(u[1])

    returned.direction = 1.0  # type: ignore[attr-defined]
    motion = solve_ivp(
        lambda t, u: [-u[1] - u[2], u[0] + 0.2 * u[1], 0.2 + u[2] * (u[0] - 2.5)],
        (0.0, 400.0), [3.0, 0.0, 0.1], method="DOP853", rtol=1e-11, atol=1e-13, events=returned,
    )  # fmt: skip
    truth = float(np.diff(motion.t_events[0])[-1])
    found = find_orbit(tolerances.system("Roessler"), x0=[3.0, 0.0, 0.1], tolerance=tolerance)
    assert found.period == pytest.approx(truth, rel=max(1e-9, 10.0 * tolerance))


@pytest.mark.parametrize(("rounds", "tolerance"), guarding(list(itertools.product((2, 3, 4), (1e-6, 1e-5))), (2, 1e-5)))
def test_rounds_of_an_orbit_solved_at_a_loose_tolerance_are_counted(rounds: int, tolerance: float) -> None:
    roessler = tolerances.system("Roessler")
    once = find_orbit(roessler, x0=[3.0, 0.0, 0.1])
    signature = Signature(once.form.modes, once.form.transitions, (CLOSED_END,), 0)
    guess = np.append(once.states[0], rounds * once.period)
    several = converge(roessler, signature, guess, roessler.parameter_vector(None), tolerance)
    assert several.period == pytest.approx(rounds * once.period, rel=1e-3)
    assert several.rounds == rounds


@pytest.mark.parametrize("tolerance", guarding(tolerances.TOLERANCES, 1e-5))
def test_an_orbit_of_truly_doubled_period_is_one_round(tolerance: float) -> None:
    # at c = 2.84 the period has doubled at 2.8324: the two rounds differ by a few hundredths
    orbit = find_orbit(tolerances.system("Roessler"), {"c": 2.84}, x0=[3.0, 0.0, 0.1], tolerance=tolerance)
    assert orbit.rounds == 1
    assert orbit.period == pytest.approx(11.54, abs=0.02)
    assert orbit.stable


@pytest.mark.parametrize("unit", guarding((1e-9, 1.0, 1e9), 1e9))
@pytest.mark.parametrize("tolerance", guarding(tolerances.TOLERANCES, 1e-5))
def test_units_of_the_states_change_no_count_of_rounds(unit: float, tolerance: float) -> None:
    field = {"x": "-y - z", "y": "x + 0.2*y", "z": "0.2*L + z*(x/L - 2.5)"}
    orbit = find_orbit(HybridSystem.smooth(field, {"L": unit}), x0=[3.0 * unit, 0.0, 0.1 * unit], tolerance=tolerance)
    assert orbit.period == pytest.approx(5.748991, rel=100.0 * tolerance, abs=1e-5)


def test_a_tightened_problem_says_what_it_knows() -> None:
    orbit = find_orbit(tolerances.system("Roessler"), x0=[3.0, 0.0, 0.1], tolerance=1e-6)
    problem: OrbitProblem = orbit.problem()
    assert problem.known.tolerance == 1e-6
    assert problem.tighten()
    assert not problem.tighten()
    assert problem.known.tolerance == 1e-12
