"""Branches that bend back at a pitchfork: they go on through its vertex, whatever the number of states."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from selection import guarding


def _fork(rates: tuple[float, ...], fed: tuple[float, ...], unit: float = 1.0, pace: float = 1.0):
    """Return a pitchfork x' = mu x - x^3 beside states that decay and are fed by x^2, with all states in a unit."""
    fields = {"x": f"{pace!r}*(mu*x - x**3/{unit**2!r})"}
    for i, (rate, share) in enumerate(zip(rates, fed, strict=True)):
        fields[f"y{i}"] = f"{pace!r}*({-rate!r}*y{i} + {share!r}*x**2/{unit!r})"
    return saltus.HybridSystem.smooth(fields, {"mu": 0.5})


_SYSTEMS = [
    ((), ()),
    ((1.0,), (0.0,)),
    ((3.0,), (1.0,)),
    ((1.0, 2.0), (0.0, 0.0)),
    ((1.0, 3.0), (0.0, 1.0)),
    ((1.0, 2.0, 3.0), (0.0, 0.0, 1.0)),
    ((1.0, 100.0, 1e4), (0.0, 1.0, 3.0)),
    ((0.5, 2.5, 3.5, 7.0, 11.0), (0.0, 1.0, 0.0, 2.0, 0.0)),
]


@pytest.mark.parametrize(
    ("rates", "fed", "unit", "pace"),
    guarding(
        [(*system, *units) for system in _SYSTEMS for units in [(1.0, 1.0), (1e-9, 1e9), (1e9, 1.0), (1.0, 1e9)]]
        + [(*_SYSTEMS[7], 1e9, pace) for pace in (1e-9, 1e5, 1e9)],
        (*_SYSTEMS[4], 1.0, 1.0), (*_SYSTEMS[5], 1e-9, 1e9), (*_SYSTEMS[7], 1e-9, 1e9),
        campaign=8,
    ),
)  # fmt: skip
def test_a_fork_goes_on_through_its_vertex(rates, fed, unit, pace):
    """x is the root of mu: the branch has both signs of x, its vertex at mu = 0, and passes the audit."""
    system, x = _fork(rates, fed, unit, pace), math.sqrt(0.5) * unit
    start = [x, *(share / rate * 0.5 * unit for rate, share in zip(rates, fed, strict=True))]
    branch = saltus.continue_equilibrium(saltus.find_equilibrium(system, x0=start), "mu", (-1.0, 1.0))
    assert branch.stopped == ("mu = 1: bound reached", "mu = 1: bound reached")
    assert [point.type for point in branch.special_points] == ["BP"]
    assert branch["BP1"].value("mu") == pytest.approx(0.0, abs=1e-8)
    along = branch.column("x") / unit
    assert along.min() == pytest.approx(-1.0)
    assert along.max() == pytest.approx(1.0)
    assert np.abs(along**2 - branch.values).max() < 1e-6
    assert branch.audit.passed, branch.audit


def test_the_fork_of_the_branch_at_rest_is_the_same():
    system = _fork(*_SYSTEMS[4])
    rest = saltus.continue_equilibrium(saltus.find_equilibrium(system, x0=[0.0] * 3), "mu", (-1.0, 1.0))
    fork = saltus.continue_equilibrium(saltus.switch_branch(rest["BP1"]), "mu", (-1.0, 1.0))
    assert fork.values.min() == pytest.approx(0.0, abs=1e-4)
    assert (fork.column("x").min(), fork.column("x").max()) == (pytest.approx(-1.0), pytest.approx(1.0))
    assert fork.audit.passed, fork.audit


def test_a_driven_fork_of_three_states_goes_on_through_its_vertex():
    """Averaged over the drive the fork is x^2 = mu; orbits of both signs are one branch through its BP."""
    fields = {"x": "mu*x - x**3*(1 + 0.5*cos(th))", "y": "-y", "z": "-3*z + x**2"}
    system = saltus.HybridSystem.smooth(fields, {"mu": 0.5, "W": 2.0}, phase=("th", "W"))
    branch = saltus.continue_orbit(saltus.find_orbit(system, x0=[0.7, 0.0, 0.2]), "mu", (-0.1, 0.5))
    assert branch.stopped == ("mu = 0.5: bound reached", "mu = 0.5: bound reached")
    assert [point.type for point in branch.special_points] == ["BP"]
    assert branch["BP1"].value("mu") == pytest.approx(0.0, abs=1e-9)
    assert branch.column("x").min() == pytest.approx(-branch.column("x").max(), rel=1e-9)
    assert branch.audit.passed, branch.audit
