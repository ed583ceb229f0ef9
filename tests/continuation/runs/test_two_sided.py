"""What one direction of a curve comes to leaves no trace in the other."""

import numpy as np
import pytest

from saltus import (
    HybridSystem,
    Map,
    Mode,
    Transition,
    continue_equilibrium,
    continue_locus,
    continue_orbit,
    find_equilibrium,
    find_orbit,
    solve_orbit,
)


def relay() -> HybridSystem:
    """Return x' = x + m +- 1, switched with hysteresis h; its cycles exist for h < 1 - m, and shrink to 0 at h = 0."""
    return HybridSystem(
        ("x",), {"h": 0.5, "m": 0.1}, {"neg": Mode({"x": "x - 1 + m"}), "pos": Mode({"x": "x + 1 + m"})},
        [Transition("pos", "neg", "x - h", 1, name="a"), Transition("neg", "pos", "x + h", -1, name="b")],
    )  # fmt: skip


def impacts():
    system = HybridSystem(
        ("x", "v"), {"e": 0.8, "w": 1.0, "A": 1.0}, {"free": Mode({"x": "v", "v": "A*cos(s) - 0.1*v - x"})},
        [Transition("free", "free", "x - 1", 1, {"v": "-e*v"}, name="impact")], phase=("s", "w"),
    )  # fmt: skip
    return solve_orbit(system, {}, [("free", "impact", [1.0, -1.3, 0.1], 6.28)])


def of_orbits(directions):
    return continue_orbit(find_orbit(relay(), x0=[0.0], mode="pos"), "h", (0.0, 2.0), directions=directions)


def of_shrinking_cycles(directions):
    brusselator = HybridSystem.smooth({"x": "1-(B+1)*x+x**2*y", "y": "B*x-x**2*y"}, {"B": 2.3})
    return continue_orbit(find_orbit(brusselator, x0=[1.5, 2.0]), "B", (1.5, 4.0), directions=directions)


def of_impacts(directions):
    return continue_orbit(impacts(), "A", (0.05, 1.2), directions=directions)


def of_a_quantity(directions):
    pendulum = HybridSystem.smooth({"x": "v", "v": "-sin(x)"})
    swing = solve_orbit(pendulum, x0=[1.0, 0.0], period=6.7, fix={"max_x": 1.0})
    return continue_orbit(swing, "max_x", (0.1, 3.0), directions=directions)


def of_equilibria(directions):
    cusp = HybridSystem.smooth({"x": "r + h*x - x**3"}, {"r": 0.0, "h": 1.5})
    return continue_equilibrium(find_equilibrium(cusp, x0=[1.2]), "r", (-2.0, 2.0), directions=directions)


def of_a_map(directions):
    logistic = Map(("x",), {"r": 2.8}, {"x": "r*x*(1 - x)"})
    return continue_orbit(find_orbit(logistic, x0=[0.5]), "r", (0.5, 3.9), directions=directions)


def of_a_locus_of_equilibria(directions):
    bounds = {"r": (-2.0, 2.0), "h": (-0.5, 2.5)}
    return continue_locus(of_equilibria("both")["SN1"], ("r", "h"), bounds, directions=directions)


def of_a_locus_of_orbits(directions):
    bounds = {"A": (0.05, 1.2), "e": (0.3, 0.95)}
    return continue_locus(of_impacts("both")["SN1"], ("A", "e"), bounds, directions=directions)


@pytest.mark.parametrize(
    "curve",
    [
        of_orbits, of_shrinking_cycles, of_impacts, of_a_quantity, of_equilibria, of_a_map, of_a_locus_of_equilibria,
        of_a_locus_of_orbits,
    ],
)  # fmt: skip
def test_both_directions_at_once_are_each_alone_bit_for_bit(curve):
    up, down, both = curve("up"), curve("down"), curve("both")
    assert len(both) == len(up) + len(down) - 1
    assert np.array_equal(both.values[len(down) - 1 :], up.values)
    assert np.array_equal(both.values[: len(down)][::-1], down.values)
    assert both.stopped == (down.stopped[1], up.stopped[1])
    found = [*reversed([point.type for point in down.special_points]), *(point.type for point in up.special_points)]
    assert [point.type for point in both.special_points] == found


def test_cycles_go_on_though_those_of_the_other_direction_shrink_to_nothing():
    branch = of_orbits("both")
    assert branch.values.min() < 1e-8
    assert branch.values.max() == pytest.approx(0.9, abs=1e-6)
