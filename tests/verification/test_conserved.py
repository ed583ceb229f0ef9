"""Equilibria of systems that conserve totals are checked at these totals."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from saltus import HybridSystem, find_equilibrium, verify
from saltus.result import frozen

# a + b <-> c conserves a + c and b + c
BINDING = HybridSystem.smooth({"a": "-k*a*b + r*c", "b": "-k*a*b + r*c", "c": "k*a*b - r*c"}, {"k": 2.0, "r": 0.5})


def place(equilibrium):
    return next(row for row in verify(equilibrium).rows if "Newton" in row.what or row.what == "place")


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e6])
def test_place_at_given_totals_is_checked(unit):
    found = find_equilibrium(BINDING, {"k": 2.0 / unit}, x0=np.array([1.0, 2.0, 0.0]) * unit)
    # k (A - c) (B - c) = r c with A = 1 and B = 2
    c = (3.25 - np.sqrt(3.25**2 - 8.0)) / 2.0
    assert found.state[2] / unit == pytest.approx(c, rel=1e-12)
    assert place(found).verdict == "agrees"


@pytest.mark.parametrize("way", [[1.0, 0.0, 0.0], [1.0, 1.0, -1.0]])
def test_place_that_is_none_differs(way):
    found = find_equilibrium(BINDING, x0=[1.0, 2.0, 0.0])
    moved = replace(found, state=frozen(found.state + 1e-5 * np.array(way)))
    assert place(moved).verdict == "differs"
