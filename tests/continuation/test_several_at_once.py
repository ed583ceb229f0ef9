"""Where several eigenvalues or multipliers become critical at once, the point is located and its multiplicity told."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from saltus import StepControl

SQUARE = saltus.HybridSystem.smooth(
    {"x": "a*x - x**3 - b*x*y**2", "y": "a*y - y**3 - b*y*x**2"}, {"a": -0.5, "b": 0.5}, name="square"
)
TRIANGLE = saltus.HybridSystem.smooth(
    {"x": "a*x + c*(x**2 - y**2) - x*(x**2 + y**2)", "y": "a*y - 2*c*x*y - y*(x**2 + y**2)"}, {"a": -0.5, "c": 1.0}
)
CUBE = saltus.HybridSystem.smooth(
    {name: f"a*{name} - {name}**3 - {name}*(x**2 + y**2 + z**2)" for name in "xyz"}, {"a": -0.5}, name="cube"
)
MAPS = saltus.Map(("x", "y"), {"r": 2.8}, {"x": "r*x*(1 - x)", "y": "r*y*(1 - y)"})
STEPS = [0.03, 0.1, 0.3]


def ring(n):
    field = {}
    for i in range(n):
        left, right = (i - 1) % n, (i + 1) % n
        field |= {
            f"x{i}": f"y{i}",
            f"y{i}": f"(mu - x{i}**2)*y{i} - x{i} + k*(y{left} + y{right} - 2*y{i}) - d*{i}*x{i}",
        }
    return saltus.HybridSystem.smooth(field, {"mu": -0.5, "k": -0.1, "d": 0.0})


def told(branch):
    return [(p.type, p.multiplicity, p.value(branch.varied[0])) for p in branch.special_points]


@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("start", [-0.5, 0.5])
@pytest.mark.parametrize(("system", "count"), [(SQUARE, 2), (TRIANGLE, 2), (CUBE, 3)], ids=["D4", "D3", "cube"])
def test_all_eigenvalues_of_a_symmetric_rest_vanish_at_one_branch_point(system, count, start, step):
    rest = saltus.find_equilibrium(system, {"a": start}, [0.0] * count)
    branch = saltus.continue_equilibrium(rest, "a", (-1.0, 1.0), steps=StepControl(largest=step))
    assert told(branch) == [("BP", count, pytest.approx(0.0, abs=1e-9))]
    assert f"({count} at once)" in repr(branch)
    assert f", {count} at once" in repr(branch["BP1"])
    assert saltus.verify(branch).passed


def test_a_diagram_has_all_branches_of_a_square():
    tree = saltus.diagram(SQUARE, "a", (-1.0, 1.0))
    diagonal = math.sqrt(1.0 / 1.5)
    lines = {tuple(np.abs(np.round(branch.solution(-1).state, 9))) for branch in tree.branches[1:]}
    assert lines == {(1.0, 0.0), (0.0, 1.0), (round(diagonal, 9), round(diagonal, 9))}
    assert len(tree.branches) == 5


@pytest.mark.parametrize("n", [3, 4, 6])
def test_equal_pairs_of_a_ring_cross_at_one_hopf_point(n):
    system = ring(n)
    modes = sorted(round(-0.2 * (1.0 - math.cos(2.0 * math.pi * j / n)), 12) for j in range(n))
    truth = [("HB", modes.count(mu), pytest.approx(mu, abs=1e-8)) for mu in sorted(set(modes))]
    for step in STEPS:
        for start in (-0.5, 0.5):
            rest = saltus.find_equilibrium(system, {"mu": start}, [0.0] * (2 * n))
            branch = saltus.continue_equilibrium(rest, "mu", (-1.0, 1.0), steps=StepControl(largest=step))
            assert told(branch) == truth, (step, start)


@pytest.mark.campaign
@pytest.mark.parametrize("step", STEPS)
def test_hopf_points_of_a_ring_of_different_oscillators_are_those_of_a_scan(step):
    system, n = ring(5), 5
    A = np.zeros((2 * n, 2 * n))
    for i in range(n):
        A[2 * i, 2 * i + 1], A[2 * i + 1, 2 * i] = 1.0, -(1.0 + 0.3 * i)
        for j, share in (((i - 1) % n, -0.1), ((i + 1) % n, -0.1), (i, 0.2)):
            A[2 * i + 1, 2 * j + 1] += share
    grid = np.linspace(-1.0, 1.0, 20001)
    counts = [int(np.sum(np.linalg.eigvals(A + mu * np.diag([0.0, 1.0] * n)).real > 0.0)) for mu in grid]
    places = [0.5 * (grid[i] + grid[i + 1]) for i in range(20000) if counts[i] != counts[i + 1]]
    rest = saltus.find_equilibrium(system, {"d": 0.3}, [0.0] * (2 * n))
    branch = saltus.continue_equilibrium(rest, "mu", (-1.0, 1.0), steps=StepControl(largest=step))
    assert told(branch) == [("HB", 1, pytest.approx(mu, abs=6e-5)) for mu in places]


def test_hopf_points_of_twelve_states_are_not_lost():
    field, names = {}, range(6)
    for i in names:
        left, right = max(i - 1, 0), min(i + 1, 5)
        spread = [f"0.1*({s}{left} + {s}{right} - 2*{s}{i})" for s in "xy"]
        field |= {
            f"x{i}": f"{1 + 0.08 * i} - (B + 1)*x{i} + x{i}**2*y{i} + {spread[0]}",
            f"y{i}": f"B*x{i} - x{i}**2*y{i} + {spread[1]}",
        }
    system = saltus.HybridSystem.smooth(field, {"B": 1.5})
    guess = [value for i in names for value in (1 + 0.08 * i, 1.5 / (1 + 0.08 * i))]
    branch = saltus.continue_equilibrium(saltus.find_equilibrium(system, x0=guess), "B", (1.5, 3.2))
    steps = np.diff(np.sum(branch.eigenvalues.real > 1e-9, axis=1))
    assert steps.sum() == 10
    assert [p.type for p in branch.special_points] == ["HB"] * 5
    for point in branch.special_points:
        values = point.equilibrium.eigenvalues
        assert np.min(np.abs(values.real[values.imag > 0.1])) < 1e-9


@pytest.mark.parametrize("step", STEPS)
def test_two_equal_maps_double_their_period_at_once(step):
    branch = saltus.continue_orbit(
        saltus.solve_orbit(MAPS, x0=[0.64, 0.64]), "r", (2.0, 3.4), steps=StepControl(largest=step)
    )
    assert told(branch) == [("PD", 2, pytest.approx(3.0, abs=1e-9))]
    assert saltus.verify(branch).passed
