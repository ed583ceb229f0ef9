"""Chains of masses, which have many states of which each feels few: closed forms of linear chains, differences."""

from __future__ import annotations

import numpy as np
import pytest

import saltus
from saltus import HybridSystem, Mode, Transition
from saltus.orbits import guesses
from saltus.system.compiled import FLOW
from saltus.system.generated import source_file


def chain(count, gap=0.4, damping=0.3):
    """Masses between two walls, coupled by springs; the first is driven and may hit a wall."""
    field = {f"x{i}": f"v{i}" for i in range(count)}
    for i in range(count):
        left, right = (f"x{i - 1}" if i else "0"), (f"x{i + 1}" if i < count - 1 else "0")
        field[f"v{i}"] = f"k*({left} - x{i}) + k*({right} - x{i}) - c*v{i}" + (" + A*cos(s)" if i == 0 else "")
    impact = Transition("free", "free", "x0 - d", 1, {"v0": "-e*v0"}, name="impact")
    parameters = {"k": 1.0, "c": damping, "A": 0.8, "w": 0.7, "d": gap, "e": 0.8}
    return HybridSystem(tuple(field), parameters, {"free": Mode(field)}, [impact], phase=("s", "w"))


def matrix(count, damping=0.3):
    """The generator of the chain's free motion."""
    stiffness = 2.0 * np.eye(count) - np.eye(count, k=1) - np.eye(count, k=-1)
    return np.block([[np.zeros((count, count)), np.eye(count)], [-stiffness, -damping * np.eye(count)]])


@pytest.mark.parametrize("count", [3, 9, 30])
def test_variations_are_the_chains_matrix_times_the_columns(count):
    system, n = chain(count), 2 * count + 1
    x = np.random.default_rng(1).standard_normal((n, 8))
    out = np.full(8 * n, np.nan)
    full = np.concatenate([np.zeros(n), x[:, :7].ravel()])
    compiled = system.compiled
    compiled.call("vary", 0, 7, full, compiled.extended(system.parameter_vector(None)), out)
    expected = np.zeros((n, 7))  # at phase 0 the drive has no slope
    expected[: 2 * count] = matrix(count) @ x[: 2 * count, :7]
    np.testing.assert_allclose(out[n:].reshape(n, 7), expected, rtol=0.0, atol=1e-14)


@pytest.mark.parametrize("count", [4, 12])
def test_multipliers_of_a_free_chain_are_those_of_its_normal_modes(count):
    """The stiffness has the eigenvalues 4 sin^2(j pi / (2 count + 2))."""
    orbit = saltus.find_orbit(chain(count, gap=1e3), x0=np.zeros(2 * count))
    squares = 4.0 * np.sin(np.arange(1, count + 1) * np.pi / (2 * count + 2)) ** 2
    roots = np.array([np.roots([1.0, 0.3, square]) for square in squares]).ravel()
    expected = np.exp(roots * 2.0 * np.pi / 0.7)
    gaps = np.abs(orbit.multipliers[:, None] - expected[None, :])
    assert gaps.min(axis=0).max() < 1e-9
    assert gaps.min(axis=1).max() < 1e-9


def test_sensitivities_of_an_impacting_chain_are_differences_of_its_motion():
    system = chain(12)
    orbit = saltus.find_orbit(system, x0=np.zeros(24))
    assert "impact" in [name for _, name in orbit.signature]
    period, step = 2.0 * np.pi / 0.7, 1e-6

    def after(x, time):
        return saltus.simulate(system, None, x, t_end=time)(time)[:24]

    start = after(np.zeros(24), 60 * period)
    rows = [after(start + step * unit, period) - after(start - step * unit, period) for unit in np.eye(24)]
    found = np.linalg.eigvals(np.array(rows).T / (2.0 * step))
    found = found[np.abs(found) > 0.05]
    assert len(found) > 4
    assert np.abs(orbit.multipliers[:, None] - found[None, :]).min(axis=0).max() < 1e-5


def test_the_text_of_many_states_grows_with_the_terms_not_with_the_states_squared():
    sizes = [source_file(FLOW, chain(count)).stat().st_size for count in (15, 60)]
    assert sizes[1] < 4.5 * sizes[0]


def test_more_states_than_an_orbits_equations_hold_are_told_before_the_search(monkeypatch):
    monkeypatch.setattr(guesses, "_MOST_UNKNOWNS", 7)
    told = r"^states of the system = 7: must be at most 6 for its orbits; .* is dense: 5\.12e-07 GB$"
    with pytest.raises(saltus.InputError, match=told):
        saltus.find_orbit(chain(3), x0=np.zeros(6))
    with pytest.raises(saltus.InputError, match=told):
        saltus.solve_orbit(chain(3), {}, [("free", "impact", np.zeros(7), 1.0)])
