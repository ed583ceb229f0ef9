"""Equilibria of systems with linear first integrals: isolated, stable and critical at the totals of their start."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

import networks
import saltus
from saltus import HybridSystem
from selection import guarding

RANGES = {"reversible": (0.2, 5.0), "bistable": (0.5, 8.0), "oscillating": (0.02, 3.0)}
KEPT = (("reversible", 13), ("bistable", 1), ("oscillating", 1), ("oscillating", 14))


def _sorted(values: np.ndarray) -> np.ndarray:
    return np.array(sorted(values.tolist(), key=lambda z: (round(z.real, 6), z.imag)))


def _points(branch: Any) -> tuple[list[str], list[float]]:
    points = branch.special_points
    return [p.type for p in points], [p.solution.parameters[networks.RATE] for p in points]


@pytest.mark.parametrize(("kind", "seed"), guarding(networks.EVERY, *KEPT, campaign=10))
def test_a_network_is_that_with_species_eliminated_by_hand(kind: str, seed: int) -> None:
    network = networks.KINDS[kind](seed)
    system, reduced = network.system, network.reduced
    assert len(system.conserved) == len(network.laws)
    x0 = network.near()
    found = saltus.find_equilibrium(system, x0=x0)
    state, values = network.by_scipy(found.state, network.at)
    np.testing.assert_allclose(network.kept(found.state), state, rtol=1e-8, atol=1e-11)
    np.testing.assert_allclose(_sorted(found.eigenvalues), _sorted(values), rtol=1e-6, atol=1e-8 * abs(values).max())
    np.testing.assert_allclose(network.totals(found.state), network.totals(x0), rtol=1e-12, atol=1e-12)
    branch = saltus.continue_equilibrium(found, networks.RATE, RANGES[kind])
    start = saltus.find_equilibrium(reduced, x0=network.kept(found.state))
    by_hand = saltus.continue_equilibrium(start, networks.RATE, RANGES[kind])
    (types, at), (wanted, places) = _points(branch), _points(by_hand)
    assert types == wanted
    np.testing.assert_allclose(at, places, rtol=1e-7)
    assert branch.stopped == by_hand.stopped
    assert not branch.audit.lines()
    for point, other in zip(branch.special_points, by_hand.special_points, strict=True):
        assert getattr(point.normal_form, "criticality", "") == getattr(other.normal_form, "criticality", "")
    for index in (0, len(branch) // 2, -1):
        solution = branch.solution(index)
        state, values = network.by_scipy(solution.state, solution.parameters[networks.RATE])
        np.testing.assert_allclose(network.kept(solution.state), state, rtol=1e-8, atol=1e-11)
        np.testing.assert_allclose(network.totals(solution.state), network.totals(x0), rtol=1e-12, atol=1e-12)
        assert solution.stable == bool(np.all(values.real < 0.0))


@pytest.mark.parametrize(("kind", "seed"), guarding(networks.EVERY, ("bistable", 3), ("oscillating", 2), campaign=10))
def test_special_points_of_a_network_are_those_of_determinants_by_scipy(kind: str, seed: int) -> None:
    network = networks.KINDS[kind](seed)
    branch = saltus.continue_equilibrium(
        saltus.find_equilibrium(network.system, x0=network.near()), networks.RATE, RANGES[kind]
    )
    start = dataclasses.replace(network, at=float(branch.values[0]))
    if kind == "bistable":  # folded in the rate, not in the enzyme
        amounts, along = branch.states[:, 1] / network.scales[1], "X"
    else:
        amounts, along = branch.values, networks.RATE
    truth = sorted(start.critical(branch.states[0], np.linspace(amounts[0], amounts[-1], 400), along))
    found = sorted(zip(*_points(branch), strict=True))
    assert [kind for kind, _ in found] == [kind for kind, _ in truth]
    np.testing.assert_allclose([at for _, at in found], [at for _, at in truth], rtol=1e-8)


def test_a_closed_reaction_has_one_equilibrium_at_each_total() -> None:
    closed = HybridSystem.smooth({"A": "k2*B - k1*A", "B": "k1*A - k2*B"}, {"k1": 1.0, "k2": 3.0})
    rest = saltus.find_equilibrium(closed, x0=[5.0, 3.0])
    np.testing.assert_allclose(rest.state, [6.0, 2.0], rtol=1e-14)
    np.testing.assert_allclose(rest.eigenvalues, [-4.0], rtol=1e-14)
    assert rest.stable
    assert rest.kind == "stable node"
    assert rest.conserved == {"A + B": pytest.approx(8.0)}
    assert "conserved A + B = 8" in repr(rest)


def test_a_branch_keeps_the_total_and_says_so() -> None:
    closed = HybridSystem.smooth({"A": "B/(0.1+B)-k1*A/(0.1+A)", "B": "k1*A/(0.1+A)-B/(0.1+B)"}, {"k1": 1.0})
    branch = saltus.continue_equilibrium(saltus.find_equilibrium(closed, x0=[0.3, 0.7]), "k1", (0.5, 2.0))
    assert branch.stopped == ("k1 = 0.5: bound reached", "k1 = 2: bound reached")
    assert not branch.special_points
    assert branch.stable.all()
    np.testing.assert_allclose(branch.states.sum(axis=1), 1.0, rtol=1e-14)
    assert "conserved A + B = 1" in repr(branch)
    # k1 A (0.1 + B) = B (0.1 + A) with B = 1 - A, at k1 = 2: A^2 - 1.3 A + 0.1 = 0
    np.testing.assert_allclose(branch.states[-1, 0], 0.65 - np.sqrt(0.65**2 - 0.1), rtol=1e-12)


def test_results_with_conserved_totals_come_back_from_files(tmp_path: Any) -> None:
    network = networks.bistable(0)
    branch = saltus.continue_equilibrium(saltus.find_equilibrium(network.system, x0=network.near()), "k", (0.5, 8.0))
    branch.save(tmp_path / "branch.nc")
    again = saltus.load(tmp_path / "branch.nc")
    np.testing.assert_array_equal(again.eigenvalues, branch.eigenvalues)
    assert repr(again) == repr(branch)
    rest = branch.solution(3)
    rest.save(tmp_path / "rest.nc")
    assert saltus.load(tmp_path / "rest.nc").conserved == rest.conserved


def test_a_locus_of_folds_at_given_totals_is_that_of_the_network_by_hand() -> None:
    texts = {"A": "-a*A*X**2 + k*X - b*A", "X": "a*A*X**2 - k*X + b*A"}
    whole = HybridSystem.smooth(texts, {"a": 1.0, "k": 2.0, "b": 0.05})
    by_hand = HybridSystem.smooth({"X": "a*(4 - X)*X**2 - k*X + b*(4 - X)"}, {"a": 1.0, "k": 2.0, "b": 0.05})
    ends = []
    for system, x0 in ((whole, [3.9, 0.1]), (by_hand, [0.1])):
        branch = saltus.continue_equilibrium(saltus.find_equilibrium(system, x0=x0), "k", (0.1, 6.0))
        fold = branch.special_points[0]
        locus = saltus.continue_locus(fold, ("k", "b"), {"k": (0.1, 6.0), "b": (0.001, 1.0)})
        ends.append([(p.type, *p.solution.parameters.values()) for p in locus.special_points])
    assert [row[0] for row in ends[0]] == [row[0] for row in ends[1]]
    np.testing.assert_allclose([row[1:] for row in ends[0]], [row[1:] for row in ends[1]], rtol=1e-7)
