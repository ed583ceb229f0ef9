"""Whether a period or a state that grows ever faster goes to infinity, or to a finite end; what is said there."""

import math

import numpy as np
import pytest

from saltus import (
    HybridSystem,
    Map,
    Mode,
    StepControl,
    Transition,
    continue_equilibrium,
    continue_orbit,
    find_equilibrium,
    find_orbit,
)
from saltus.continuation.problems.ends.unbounded import levels_off
from saltus.equilibria import Equilibrium
from saltus.equilibria.problem import EquilibriumProblem
from saltus.maps.orbit import MapOrbit
from saltus.maps.problem import MapOrbitProblem
from selection import guarding

CLOCK = HybridSystem(
    ("x", "v"), {"F": 0.05, "W": 0.6, "u": 1.0},
    {"p": Mode({"x": "v", "v": "-x - F*u"}), "n": Mode({"x": "v", "v": "-x + F*u"})},
    [
        Transition("p", "n", "v", -1, name="top"),
        Transition("n", "p", "v", 1, name="bottom"),
        Transition("p", "p", "x", 1, {"v": "sqrt(v**2 + W*u**2)"}, name="kick"),
    ],
)  # fmt: skip


@pytest.mark.parametrize(
    ("law", "finite"),
    [
        (lambda d: -np.log(d), False),
        (lambda d: 3.0 - 0.1 * np.log(d), False),
        (lambda d: 5.0 + d**-0.5, False),
        (lambda d: 1.0 / d, False),
        (lambda d: 7.0 - np.sqrt(d), True),
        (lambda d: 7.0 - d**0.75, True),
    ],
)
@pytest.mark.parametrize("share", [0.1, 0.4, 0.7])
@pytest.mark.parametrize("missed", [0.0, 1e-9])
def test_growth_of_a_period_is_told_from_its_steps(law, finite, share, missed):
    distance = share ** np.arange(int(-17.0 / math.log(share))) + missed
    assert levels_off(3.0 - distance, law(distance)) is finite
    assert levels_off(3.0 + 1e6 * distance, 1e-3 * law(distance)) is finite


@pytest.mark.parametrize(
    ("start", "bounds", "unit"),
    [
        (0.05, (0.01, 0.3), 1.0),
        (0.05, (0.01, 0.3), 1e-9),
        (0.05 * (1.0 + 1e-13), (0.01, 0.3), 1.0),
        (0.1, (0.01, 0.3), 1.0),
        (0.1, (0.01, 0.3), 1e6),
        (0.15, (0.01, 2.0), 1.0),
        (0.12, (0.1, 0.17), 1.0),
        (0.05, (0.0, 1.0), 1.0),
    ],
)
def test_a_clock_ends_at_the_grazing_at_which_its_swing_no_longer_passes_the_middle(start, bounds, unit):
    """The amplitude is W/(8 F) + F; the swing passes x = 0 again until it is 4 F, at F = sqrt(W/24)."""
    orbit = find_orbit(CLOCK, {"F": start, "u": unit}, x0=[0.0, unit], mode="p")
    branch = continue_orbit(orbit, "F", bounds)
    assert branch["GR1"].parameters["F"] == pytest.approx(math.sqrt(0.6 / 24.0), rel=1e-10)
    usual = branch.values > 1e-3
    F = branch.values[usual]
    assert branch.highs[usual, 0] == pytest.approx(unit * (0.6 / (8.0 * F) + F), rel=1e-6)
    # half a turn about F, half a turn about -F, then from x = 0 to the top at 4 F: acos(1/5)
    assert branch["GR1"].orbit.period == pytest.approx(2.0 * math.pi + math.acos(0.2), rel=1e-8)
    assert "grazing" in branch.stopped[1]
    assert not any("period grows without bound" in end for end in branch.stopped)


def test_a_clock_without_friction_swings_without_bound():
    """Its amplitude W/(8 F) + F goes to infinity at F = 0, long before the bound is reached by rounding."""
    for bound in (0.0, -1.0, 1e-9):
        branch = continue_orbit(find_orbit(CLOCK, x0=[0.0, 1.0], mode="p"), "F", (bound, 1.0), directions="down")
        assert "the orbit grows without bound" in branch.stopped[1]
        beyond = branch.highs[:, 0] - branch.values
        assert branch.values == pytest.approx(0.6 / (8.0 * beyond), rel=1e-6, abs=1e-6)


# the parameter's end, where a state goes to infinity, and a start
RUNS = {
    "exp(-x) - p": (0.0, [0.0]),
    "p - x/(1 + x)": (1.0, [0.0]),
    "p**2*x - 1": (0.0, [1.0]),
    "exp(-x**2) - p": (0.0, [0.8]),
}


@pytest.mark.parametrize("largest", guarding([0.05, 0.3], 0.3))
@pytest.mark.parametrize("field", RUNS)
def test_an_equilibrium_that_runs_to_infinity_passes_no_fold_and_says_so(field, largest):
    system = HybridSystem.smooth({"x": field, "y": "x - 2*y"}, {"p": 0.5})
    end, x0 = RUNS[field]
    rest = find_equilibrium(system, {"p": 1.0 if field == "p**2*x - 1" else 0.5}, x0=[*x0, 0.5 * x0[0]])
    branch = continue_equilibrium(rest, "p", (-1.0, 2.0), steps=StepControl(largest=largest))
    told = [reason for reason in branch.stopped if "the equilibrium grows without bound" in reason]
    assert told
    assert all(float(reason.split(" ")[2].rstrip(":")) == pytest.approx(end, abs=1e-4) for reason in told)
    assert [point.type for point in branch.special_points] == (["SN"] if field == "exp(-x**2) - p" else [])


@pytest.mark.parametrize("power", [4, 6])
def test_a_fold_of_higher_order_is_located_once(power):
    system = HybridSystem.smooth({"x": f"p - (x - 0.3)**{power}"}, {"p": 1.0})
    (fold,) = continue_equilibrium(find_equilibrium(system, x0=[1.3]), "p", (-1.0, 2.0)).special_points
    assert fold.type == "SN"
    assert fold.parameters["p"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("aside", [1e-3, 1e-5, 1e-7, -1e-7, -1e-5])
def test_a_branch_that_starts_next_to_its_fold_has_the_fold(aside):
    system = HybridSystem.smooth({"x": "p - (x - 1)**2", "y": "x - y"}, {"p": aside**2})
    start = find_equilibrium(system, x0=[1.0 + aside, 1.0 + aside])
    (fold,) = continue_equilibrium(start, "p", (-1.0, 1.0)).special_points
    assert fold.type == "SN"
    assert fold.parameters["p"] == pytest.approx(0.0, abs=1e-10)


# fields with a fold at 0, and the branch through it
FOLDS = {
    "one state": ({"x": "p - x**2"}, lambda a: (a**2, [a])),
    "downwards": ({"x": "-p - x**2"}, lambda a: (-(a**2), [a])),
    "far off 0": ({"x": "p - 1000 - x**2"}, lambda a: (1000.0 + a**2, [a])),
    "a state that follows": ({"x": "p - x**2", "y": "x - 2*y"}, lambda a: (a**2, [a, 0.5 * a])),
    "one that follows its square": ({"x": "p - x**2", "z": "x**2 - z"}, lambda a: (a**2, [a, a**2])),
    "of fourth order": ({"x": "p - x**4"}, lambda a: (a**4, [a])),
    "in nanometres": ({"x": "1e-9*p - 1e9*x**2"}, lambda a: (a**2, [1e-9 * a])),
}


@pytest.mark.campaign
@pytest.mark.parametrize("largest", [0.05, 0.3])
@pytest.mark.parametrize("aside", [0.0, 1e-12, 1e-10, -1e-10, 1e-9, 1e-6, -1e-6, 1e-3, 1e-2])
@pytest.mark.parametrize("field", FOLDS)
def test_a_branch_that_starts_at_a_fold_at_0_or_next_to_it_has_the_fold(field, aside, largest):
    """A state next to 0 has the size of its way along the branch, not of its modulus there."""
    formulas, at = FOLDS[field]
    p, x = at(aside)
    problem = EquilibriumProblem(HybridSystem.smooth(formulas, {"p": p}), 0, np.array([p]))
    start = Equilibrium.from_unknowns(problem, np.array(x), np.ones(len(x)))
    middle = at(0.0)[0]
    branch = continue_equilibrium(start, "p", (middle - 1.0, middle + 1.0), steps=StepControl(largest=largest))
    (fold,) = branch.special_points
    assert fold.type == "SN"
    assert fold.parameters["p"] == pytest.approx(middle, abs=1e-9 * max(middle, 1.0))
    assert branch.stopped == (f"p = {branch.values[0]:g}: bound reached",) * 2


@pytest.mark.parametrize(("field", "at"), [("p*x - x**2", 1), ("p*x - x**3", 2)])
@pytest.mark.parametrize("aside", [1e-10, -1e-6, 1e-6, 1e-3])
def test_a_branch_that_starts_next_to_a_branch_point_at_0_has_the_branch_point(field, at, aside):
    system = HybridSystem.smooth({"x": field, "y": "1 - y"}, {"p": aside**at})
    problem = EquilibriumProblem(system, 0, np.array([aside**at]))
    start = Equilibrium.from_unknowns(problem, np.array([aside, 1.0]), np.ones(2))
    (point,) = continue_equilibrium(start, "p", (-1.0, 1.0)).special_points
    assert point.type == "BP"
    assert point.parameters["p"] == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize("aside", [0.0, 1e-9, -1e-7, 1e-7, 1e-5, 1e-3])
def test_a_branch_of_a_map_that_starts_next_to_its_fold_has_the_fold(aside):
    tent = Map(("x", "y"), {"p": 0.0}, {"x": "x + p - x**2", "y": "x - y/2"})
    problem = MapOrbitProblem(tent, (0,), np.array([aside**2]))
    start = MapOrbit.from_unknowns(problem, np.array([aside, 2.0 / 3.0 * aside]), np.ones(2))
    (fold,) = continue_orbit(start, "p", (-0.5, 0.5)).special_points
    assert fold.type == "SN"
    assert fold.parameters["p"] == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize("largest", [0.05, 0.3])
@pytest.mark.parametrize("mean", guarding(["1 + cos(s)", "1"], "1 + cos(s)"))
def test_an_orbit_whose_mean_runs_to_infinity_ends_at_once(mean, largest):
    field = Mode({"x": "v", "v": f"-k*x - v + {mean}", "z": "cos(s) - z"})
    system = HybridSystem(("x", "v", "z"), {"k": 1.0}, {"m": field}, phase=("s", "1"))
    orbit = find_orbit(system, x0=[1.0, 0.0, 0.0])
    branch = continue_orbit(orbit, "k", (-1.0, 2.0), steps=StepControl(largest=largest))
    reason, other = branch.stopped
    assert "the orbit grows without bound (x moves by" in reason
    assert 0.0 < branch.values[0] < 1e-6  # the mean of x is 1/k
    assert other == "k = 2: bound reached"
    assert len(branch) < 600
