"""The audit of a locus: it passes where nothing is wrong, and tells each fault that is put into a locus on purpose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from saltus import HybridSystem, continue_equilibrium, continue_locus, continue_orbit, find_equilibrium, find_orbit
from saltus.continuation.results.auditing import audited
from saltus.continuation.results.special_points import SpecialPoints


@pytest.fixture(scope="module")
def folds():
    """Folds of Duffing's oscillator, which meet in a cusp."""
    spring = HybridSystem.smooth(
        {"x": "v", "v": "-0.1*v - x - x**3 + F*cos(theta)"}, {"w": 1.0, "F": 0.5}, phase=("theta", "w")
    )
    branch = continue_orbit(find_orbit(spring, {"w": 1.2}, [0.0, 0.0]), "w", (1.0, 2.5))
    return continue_locus(branch["SN1"], ("w", "F"), {"w": (1.0, 2.5), "F": (0.01, 0.6)})


@pytest.fixture(scope="module")
def hopf_points():
    """Hopf points with the normal form r' = r (m + (K - m) r^2 - r^4): the first coefficient vanishes at K = m = 0."""
    square = "(x**2 + y**2)"
    grows = f"(m + (K - 2*m)*{square} - {square}**2)"
    system = HybridSystem.smooth(
        {"x": f"x*{grows} - y", "y": f"y*{grows} + x", "z": "-z + 0.1*x**2"}, {"m": -0.5, "K": 0.4}
    )
    branch = continue_equilibrium(find_equilibrium(system, x0=[0.0, 0.0, 0.0]), "m", (-1.0, 1.0))
    return continue_locus(branch["HB1"], ("m", "K"), {"m": (-1.0, 1.0), "K": (-0.5, 0.5)})


def _checks(locus):
    return {breach.check for breach in audited(locus).audit.breaches}


def _without(locus, kind):
    kept = [point for point in locus.special_points if point.type != kind]
    return replace(locus, special_points=SpecialPoints(kept, locus.varied))


def test_loci_without_faults_pass(folds, hopf_points):
    assert [point.type for point in folds.special_points if point.type != "TP"] == ["CP"]
    assert [point.type for point in hopf_points.special_points] == ["GH"]
    for locus in (folds, hopf_points):
        assert locus.audit.passed
        counts = dict(locus.audit.checked)
        assert all(counts[name] > 0 for name in ("condition", "coefficient", "other values"))


def test_a_coefficient_that_changes_its_sign_without_a_point_is_told(folds, hopf_points):
    assert "coefficient" in _checks(_without(folds, "CP"))
    assert "coefficient" in _checks(_without(hopf_points, "GH"))


def test_a_point_whose_coefficient_keeps_its_sign_is_told(folds, hopf_points):
    for locus in (folds, hopf_points):
        assert "coefficient" in _checks(replace(locus, coefficient=np.abs(locus.coefficient)))


def test_points_without_a_critical_value_are_told(folds, hopf_points):
    values = folds.multipliers.copy()
    values[3] = 0.9 * values[3]
    assert "condition" in _checks(replace(folds, multipliers=values))
    values = hopf_points.eigenvalues.copy()
    values[1] = values[1] + 0.01
    assert "condition" in _checks(replace(hopf_points, eigenvalues=values))


def test_other_values_that_become_unstable_without_a_point_are_told(folds, hopf_points):
    values = hopf_points.eigenvalues.copy()
    middle = len(values) // 4
    values[:middle] = np.where(np.abs(values[:middle].imag) > 0.5, values[:middle], 1.0)
    assert "other values" in _checks(replace(hopf_points, eigenvalues=values))
    values = folds.multipliers.copy()
    far = np.abs(values - 1.0) > 1e-3
    values[:5] = np.where(far[:5], 1.5, values[:5])
    assert "other values" in _checks(replace(folds, multipliers=values))
