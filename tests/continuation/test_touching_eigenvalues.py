"""Branch points at which an eigenvalue or multiplier touches its border and curves cross."""

from __future__ import annotations

import pytest

import saltus
from saltus.continuation.switching import other_solutions

# equations, whether as a straight line x = slope r, and the other curves x(r) at r = 0, by closed form
CROSSINGS = {
    "x*(r**2 - x**2)": (0.0, [lambda x, r: r - x, lambda x, r: r + x]),
    "x*(x - r**2)": (0.0, [lambda x, r: x - r**2]),
    "x*(x + r**2)": (0.0, [lambda x, r: x + r**2]),
    "(x - r)*(x + r)*(x - 2*r)": (1.0, [lambda x, r: x + r, lambda x, r: x - 2 * r]),
    "x*(x - r)*(x + 2*r)": (0.0, [lambda x, r: x - r, lambda x, r: x + 2 * r]),
    "x*(x**2 - r**4)": (0.0, [lambda x, r: x - r**2, lambda x, r: x + r**2]),
}
RANGES = [(-0.4, -0.5, 0.6), (0.47, -0.5, 0.6), (-0.37, -0.71, 0.33)]


def straight(equation, slope, unit, of_map, place):
    start, low, high = place
    text = equation.replace("r", f"(r/{unit!r})")
    if of_map:
        found = saltus.solve_orbit(
            saltus.Map(("x",), {"r": unit}, {"x": f"x + {text}"}), {"r": start * unit}, x0=[slope * start]
        )
        return saltus.continue_orbit(found, "r", (low * unit, high * unit))
    system = saltus.HybridSystem.smooth({"x": text}, {"r": unit})
    rest = saltus.find_equilibrium(system, {"r": start * unit}, [slope * start])
    return saltus.continue_equilibrium(rest, "r", (low * unit, high * unit))


def value_of(solution):
    return float(solution.points[0, 0] if solution.system.__class__ is saltus.Map else solution.state[0])


def check(equation, unit, of_map, place):
    slope, curves = CROSSINGS[equation]
    branch = straight(equation, slope, unit, of_map, place)
    assert [point.type for point in branch.special_points] == ["BP"]
    point = branch["BP1"]
    # the eigenvalue is r**2, or r**4: at 1e-5 that is below all rounding
    assert point.parameters["r"] == pytest.approx(0.0, abs=(1e-5 if "r**4" in equation else 1e-6) * unit)
    found = other_solutions(point.solution, point)
    places = [(value_of(solution), solution.parameters["r"] / unit) for solution in found]
    on = [[i for i, curve in enumerate(curves) if abs(curve(x, r)) < 1e-9] for x, r in places]
    assert sorted(on) == [[i] for i in range(len(curves))]


@pytest.mark.parametrize("of_map", [False, True], ids=["equilibria", "map"])
@pytest.mark.parametrize("equation", CROSSINGS)
def test_all_curves_leave_where_an_eigenvalue_touches_zero(equation, of_map):
    check(equation, 1.0, of_map, RANGES[0])


@pytest.mark.campaign
@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
@pytest.mark.parametrize("equation", CROSSINGS)
def test_they_do_so_from_any_bounds_and_in_any_unit(equation, unit):
    for place in RANGES:
        for of_map in (False, True):
            check(equation, unit, of_map, place)


@pytest.mark.parametrize("equation", ["x*(r**2 + x**2)", "x*(r**2 + 1e-8 - x**2)", "x*(x - 1e-7 - r**2)"])
def test_where_no_other_real_curve_meets_there_is_no_point(equation):
    assert list(straight(equation, 0.0, 1.0, False, RANGES[0]).special_points) == []


def test_two_crossings_near_each_other_are_two_points():
    branch = straight("x*(r**2 - 1e-8 - x**2)", 0.0, 1.0, False, RANGES[0])
    assert [point.parameters["r"] for point in branch.special_points] == pytest.approx([-1e-4, 1e-4])


@pytest.mark.campaign
def test_the_pitchfork_of_a_map_is_the_same_from_any_bounds():
    cubic = saltus.Map(("x",), {"r": 0.5}, {"x": "r*x - x**3"})
    for low in (-0.9, -0.5, 0.0, 0.3, 0.9, 0.99):
        for high in (1.01, 1.1, 1.3, 1.7, 2.0, 2.5, 3.1, 6.0):
            for start in (0.5 * (low + 1.0), 0.5 + 0.5 * min(high, 1.9)):
                branch = saltus.continue_orbit(saltus.solve_orbit(cubic, {"r": start}, x0=[0.0]), "r", (low, high))
                assert [p.type for p in branch.special_points] == ["BP"], (low, high, start)
                other = saltus.continue_orbit(saltus.switch_branch(branch["BP1"]), "r", (low, high))
                told = [(p.type, p.parameters["r"]) for p in other.special_points if p.type == "BP"]
                assert told == [("BP", pytest.approx(1.0, abs=1e-8))], (low, high, start)
