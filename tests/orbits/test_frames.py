"""Orbits whose fast segments are followed in frames of linear parts, against explicit steps."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import pytest

from saltus import find_orbit, solve_orbit
from saltus.afm import table1, tapping_mode
from saltus.orbits import discretisation

if TYPE_CHECKING:
    from saltus import PeriodicOrbit

OBSERVABLES = ("mean(z)", "min(z)", "max(q1)")


@pytest.fixture(scope="module")
def orbit() -> PeriodicOrbit:
    """An orbit of three modes with contact."""
    return find_orbit(tapping_mode(table1(), modes=3, parameters={"D_rep": 60.0, "Omega": 1.1}), x0=np.zeros(6))


def by_explicit_steps(orbit: PeriodicOrbit, patch: pytest.MonkeyPatch) -> PeriodicOrbit:
    """The same orbit without frames."""
    with patch.context() as without:
        without.setattr(discretisation, "linear_frames", lambda *_: None)
        return solve_orbit(orbit.system, orbit.parameters, orbit.segments)


def test_the_flight_of_many_modes_is_followed_in_a_frame(orbit: PeriodicOrbit) -> None:
    problem = orbit.problem(("Omega",))
    assert problem.linear is not None
    assert problem.linear.parts[:, 0].tolist() == [6.0, 0.0]
    assert problem.mesh[1][1] < 60  # explicit steps of the flight are 560
    assert problem.surveyed[0].size > problem.mesh[0].size
    one = find_orbit(tapping_mode(table1()), {"Omega": 1.0}, [0.0, 0.0]).problem(("Omega",))
    assert one.linear is None


def test_an_orbit_is_the_same_by_explicit_steps(orbit: PeriodicOrbit, monkeypatch: pytest.MonkeyPatch) -> None:
    other = by_explicit_steps(orbit, monkeypatch)
    assert orbit.unknowns == pytest.approx(other.unknowns, rel=1e-9, abs=1e-12)
    assert np.abs(orbit.multipliers - other.multipliers).max() < 1e-9
    assert orbit.lows == pytest.approx(other.lows, rel=1e-8, abs=1e-11)
    assert orbit.highs == pytest.approx(other.highs, rel=1e-8, abs=1e-11)


def test_second_derivatives_and_variations_are_those_of_explicit_steps(
    orbit: PeriodicOrbit, monkeypatch: pytest.MonkeyPatch
) -> None:
    u = np.append(orbit.unknowns, orbit.parameters["Omega"])
    v = 1e-3 * np.cos(np.arange(u.size)) * np.append(np.tile([1.0, 1e-3, 1e-4, 1.0, 1e-2, 1e-3, 1.0, 1.0], 2), 1.0)
    found = []
    for frames in (True, False):
        with monkeypatch.context() as patch:
            if not frames:
                patch.setattr(discretisation, "linear_frames", lambda *_: None)
            problem = orbit.problem(("Omega",))
            F, J = problem.resolve(u)
            steps, S = problem.steps, problem.second(u, v)
            assert (problem.linear is not None) is frames
            assert problem.steps == steps
            h = 1e-5
            moved = [problem.evaluate(u + k * h * v)[1] for k in (1, -1, 2, -2)]
            slope = (8.0 * (moved[0] - moved[1]) - (moved[2] - moved[3])) / (12.0 * h)
            assert np.abs(S - slope).max() < 1e-5 * np.abs(S).max()
            found.append((F, J, S))
    for mine, other in zip(*found, strict=True):
        assert np.abs(mine - other).max() < 1e-9 * max(np.abs(other).max(), 1.0)


def test_loci_take_explicit_steps(orbit: PeriodicOrbit) -> None:
    problem = orbit.problem(("Omega", "ybar"))
    assert problem.linear is None


def test_sensitivities_of_observables_are_those_of_explicit_steps(
    orbit: PeriodicOrbit, monkeypatch: pytest.MonkeyPatch
) -> None:
    mine = orbit.sensitivity(OBSERVABLES, ["Omega"])
    other = by_explicit_steps(orbit, monkeypatch)
    with monkeypatch.context() as without:
        without.setattr(discretisation, "linear_frames", lambda *_: None)
        theirs = other.sensitivity(OBSERVABLES, ["Omega"])
    for name in OBSERVABLES:
        assert float(mine[name].sel(parameter="Omega")) == pytest.approx(
            float(theirs[name].sel(parameter="Omega")), rel=1e-8
        )


@pytest.mark.campaign
@pytest.mark.parametrize("modes", [5, 10])
def test_an_orbit_of_many_modes_is_found_from_rest(modes: int) -> None:
    """The motion until it settles takes hundreds of thousands of steps, of a fast mode and not of a stiff one."""
    system = tapping_mode(table1(), modes=modes, parameters={"D_rep": 60.0, "Omega": 0.95})
    orbit = find_orbit(system, x0=np.zeros(2 * modes))
    assert orbit.admissible
    assert np.all(np.abs(orbit.multipliers) < 1.0)
    residual, _ = orbit.problem(("Omega",)).resolve(np.append(orbit.unknowns, 0.95))
    assert np.abs(residual).max() < 1e-11
    three = find_orbit(tapping_mode(table1(), modes=3, parameters={"D_rep": 60.0, "Omega": 0.95}), x0=np.zeros(6))
    assert orbit.max["q1"] == pytest.approx(three.max["q1"], rel=1e-2)
