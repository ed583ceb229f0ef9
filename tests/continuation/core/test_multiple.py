"""Points where several directions cross at once by symmetry: their branches one by one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import saltus
from saltus import InputError, switch_branch


def at_zero(system, parameter, start):
    """A branch point at the parameter's value 0, of the branch of an equilibrium that stays where it is."""
    branch = saltus.continue_equilibrium(
        saltus.find_equilibrium(system, {parameter: -0.5}, start), parameter, (-1.0, 1.0), events={parameter: 0.0}
    )
    point = branch[f"{parameter}1"]
    return replace(point, type="BP", tangent=np.append(np.zeros(len(start)), 1.0))


def all_of(point, count):
    with pytest.raises(InputError, match=f"^which = {count}: must be less than {count}; so many"):
        switch_branch(point, count)
    return [switch_branch(point, which) for which in range(count)]


@pytest.mark.parametrize("unit", [1.0, 1e6])
def test_on_a_square_two_axes_and_two_diagonals_leave(unit):
    """x = +-sqrt(a) on the axes, sqrt(a/(1 + b)) on the diagonals."""
    square = saltus.HybridSystem.smooth(
        {"x": "a*x - x*(x/L)**2 - b*x*(y/L)**2", "y": "a*y - y*(y/L)**2 - b*y*(x/L)**2"},
        {"a": -0.5, "b": 0.5, "L": unit},
    )
    found = all_of(at_zero(square, "a", [0.0, 0.0]), 4)
    directions = np.array([solution.state / np.linalg.norm(solution.state) for solution in found])
    half = np.sqrt(0.5)
    np.testing.assert_allclose(directions, [[1, 0], [half, half], [half, -half], [0, 1]], atol=1e-6)
    for solution, shared in zip(found, (1.0, 0.75, 0.75, 1.0), strict=True):
        assert solution.parameters["a"] == pytest.approx(shared * float(np.sum((solution.state / unit) ** 2)), rel=1e-6)


def test_three_transcritical_branches_leave_a_triangle():
    """x^2 - y^2 + a x = 0, -2 x y + a y = 0: the lines (-a, 0) and (a/2, +-sqrt(3) a/2)."""
    triangle = saltus.HybridSystem.smooth({"x": "a*x + x**2 - y**2", "y": "a*y - 2*x*y"}, {"a": -0.5})
    for solution, line in zip(
        all_of(at_zero(triangle, "a", [0.0, 0.0]), 3),
        ([-1.0, 0.0], [0.5, np.sqrt(0.75)], [0.5, -np.sqrt(0.75)]), strict=True,
    ):  # fmt: skip
        np.testing.assert_allclose(solution.state, np.multiply(line, solution.parameters["a"]), rtol=1e-7, atol=1e-9)


@pytest.mark.campaign
def test_thirteen_axes_leave_a_cube():
    """Three to faces, six to edges, four to corners."""
    cube = saltus.HybridSystem.smooth(
        {x: f"a*{x} - {x}**3 - 0.5*{x}*({y}**2 + {z}**2)" for x, y, z in ("xyz", "yzx", "zxy")}, {"a": -0.5}
    )
    found = all_of(at_zero(cube, "a", [0.0] * 3), 13)
    entries = [int(np.sum(np.abs(solution.state) > 1e-6)) for solution in found]
    assert sorted(entries) == [1] * 3 + [2] * 6 + [3] * 4


def test_where_every_direction_is_one_no_branch_is_made_up():
    circle = saltus.HybridSystem.smooth({"x": "a*x - x*(x**2 + y**2)", "y": "a*y - y*(x**2 + y**2)"}, {"a": -0.5})
    with pytest.raises(saltus.ConvergenceError, match="2 directions cross at once, and no isolated branch leaves"):
        switch_branch(at_zero(circle, "a", [0.0, 0.0]))


@pytest.mark.campaign
def test_two_equal_maps_double_alone_together_and_in_turn():
    pair = saltus.Map(("x", "y"), {"r": 2.8}, {"x": "r*x*(1 - x)", "y": "r*y*(1 - y)"})
    branch = saltus.continue_orbit(saltus.solve_orbit(pair, x0=[0.64, 0.64]), "r", (2.0, 3.4), events={"r": 3.0})
    found = all_of(replace(branch["r1"], type="PD"), 4)
    moves = [np.sign(np.round(np.diff(orbit.points, axis=0)[0], 9)).astype(int).tolist() for orbit in found]
    assert sorted(map(abs, np.prod(moves, axis=1))) == [0, 0, 1, 1]
    for orbit in found:
        r = orbit.parameters["r"]
        single, root = 1.0 - 1.0 / r, np.sqrt((r + 1.0) * (r - 3.0))
        truth = np.array([single, (r + 1.0 + root) / (2.0 * r), (r + 1.0 - root) / (2.0 * r)])
        assert np.abs(orbit.points[..., None] - truth).min(axis=-1).max() < 1e-9


def test_a_simple_point_has_one_other_branch():
    fork = saltus.HybridSystem.smooth({"x": "a*x - x**3"}, {"a": -0.5})
    point = saltus.continue_equilibrium(saltus.find_equilibrium(fork, x0=[0.0]), "a", (-1.0, 1.0))["BP1"]
    (other,) = all_of(point, 1)
    assert other.state[0] ** 2 == pytest.approx(other.parameters["a"], rel=1e-9)
