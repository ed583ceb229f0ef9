"""`verify` finds right results right and falsified ones false."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import saltus
from saltus.continuation.results.special_points import SpecialPoints

IMPACT = saltus.HybridSystem(
    ("x", "v"), {"A": 0.5, "w": 0.8, "e": 0.5, "z": 0.1, "g": 0.4},
    {"m": saltus.Mode({"x": "v", "v": "-z*v - x + A*cos(th)"})},
    [saltus.Transition("m", "m", "x - g", 1, {"v": "-e*v"}, name="hit")],
    phase=("th", "w"), outputs={"energy": "v**2 + x**2"},
)  # fmt: skip
CYCLE = saltus.HybridSystem.smooth({"x": "1 - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"}, {"B": 1.5})
LOGISTIC = saltus.Map(("x",), {"r": 2.8}, {"x": "r*x*(1 - x)"})


@pytest.fixture(scope="module")
def impacts():
    return saltus.continue_orbit(saltus.find_orbit(IMPACT, x0=[0.0, 0.0]), "g", (0.1, 3.0))


@pytest.fixture(scope="module")
def equilibria():
    return saltus.continue_equilibrium(saltus.find_equilibrium(CYCLE, x0=[1.0, 1.5]), "B", (1.0, 4.0))


def left_out(checked):
    """Return what is told to be unchecked, but for variables that no check reads."""
    return {row.what for row in checked.unchecked if not row.what.startswith("variable ")}


def differing(result):
    return {row.what for row in saltus.verify(result).failures}


def test_a_branch_with_impacts_a_doubling_and_grazings_passes(impacts):
    checked = saltus.verify(impacts)
    assert checked.passed, checked
    # of the grazing without speed
    assert left_out(checked) == {"multipliers", "column multipliers"}
    assert "critical multiplier, from -1" in {row.what for row in checked}
    assert len(checked.to_dataframe()) == len(checked)


def test_a_moved_state_does_not_close(impacts):
    orbit = impacts.solution(3)
    states = orbit.states.copy()
    states[0, 0] += 1e-6
    assert any(what.startswith("gap behind segment") for what in differing(replace(orbit, states=states)))


def test_a_wrong_duration_is_found_at_the_event(impacts):
    orbit = impacts.solution(3)
    assert "time of hit" in differing(replace(orbit, durations=orbit.durations * (1.0 + 1e-6)))


@pytest.mark.parametrize("name", ["lows", "highs"])
def test_wrong_extremes_of_an_output_are_found(impacts, name):
    orbit = impacts.solution(3)
    values = getattr(orbit, name).copy()
    values[-1] += 1e-4
    assert differing(replace(orbit, **{name: values})) == {f"{'min' if name == 'lows' else 'max'} energy", name}


def test_wrong_multipliers_are_found(impacts):
    orbit = impacts.solution(3)
    assert differing(replace(orbit, multipliers=orbit.multipliers * (1.0 + 1e-5))) >= {"multiplier 1", "multiplier 2"}


def test_an_orbit_that_passes_its_wall_is_not_admissible(impacts):
    orbit = saltus.find_orbit(IMPACT, {"g": 3.0}, x0=[0.0, 0.0])
    assert saltus.verify(orbit).passed
    within = saltus.solve_orbit(IMPACT, {"g": 1.0}, [("m", None, orbit.x0, orbit.period)])
    assert not within.admissible
    assert saltus.verify(within).passed
    assert differing(replace(within, faults=0)) == {"admissible", "faults"}


@pytest.mark.campaign
def test_a_missing_special_point_leaves_a_change_unexplained(impacts, equilibria):
    for branch, label in ((impacts, "PD1"), (equilibria, "HB1")):
        kept = [point for point in branch.special_points if point.label != label]
        without = replace(branch, special_points=SpecialPoints(kept, branch.varied))
        assert "change of the unstable directions" in differing(without)


def test_a_false_special_point_is_not_critical(impacts, equilibria):
    doubling = impacts["PD1"]
    assert "critical multiplier, from 1" in differing(replace(doubling, type="SN"))
    assert "critical eigenvalue" in differing(replace(equilibria["HB1"], type="SN"))


def test_equilibria_and_their_hopf_point_pass(equilibria):
    assert saltus.verify(equilibria).passed
    wrong = replace(equilibria.solution(0), state=equilibria.solution(0).state + 1e-5)
    assert "distance from Newton's solution" in differing(wrong)


@pytest.mark.campaign
def test_a_branch_of_cycles_from_its_hopf_point_passes(equilibria):
    cycles = saltus.continue_orbit(saltus.switch_branch(equilibria["HB1"]), "B", (1.0, 3.0))
    checked = saltus.verify(cycles)
    assert checked.passed, checked
    assert not left_out(checked)


def test_cycles_of_a_map_pass_and_a_wrong_multiplier_does_not():
    branch = saltus.continue_orbit(saltus.solve_orbit(LOGISTIC, x0=[0.64]), "r", (1.5, 3.9))
    assert saltus.verify(branch).passed
    orbit = branch.solution(0)
    assert differing(replace(orbit, multipliers=orbit.multipliers + 1e-5)) == {"multiplier 1", "multipliers"}


@pytest.mark.campaign
def test_loci_are_critical_all_along(impacts, equilibria):
    for locus in (
        saltus.continue_locus(impacts["PD1"], ("g", "e"), {"g": (0.5, 1.5), "e": (0.4, 0.6)}),
        saltus.continue_locus(impacts["GR1"], ("g", "e"), {"g": (0.1, 1.5), "e": (0.45, 0.55)}),
    ):
        checked = saltus.verify(locus, points=4)
        assert checked.passed, checked
        assert any(row.what.startswith(("critical multiplier", "least distance")) for row in checked)


def test_small_multipliers_beside_large_ones_have_their_digits():
    from saltus.verification.spectra import spectrum

    steps = [np.diag([1e4, 1e-6]), np.array([[1.0, 0.5], [0.0, 1.0]]), np.diag([1e4, 1e-6])]
    values, _ = spectrum(steps, np.ones(2))
    assert values.real == pytest.approx([1e8, 1e-12], rel=1e-9)


def test_a_single_eigenvalue_of_any_size_is_checked():
    """A plant of one state with a relay in large units: the boundary equilibrium at h = U has the eigenvalue -7e5."""
    relay = saltus.HybridSystem(
        ("x",), {"a": 0.7e6, "h": 3e8, "U": 1e9},
        {"on": saltus.Mode({"x": "a*(U - x)"}), "off": saltus.Mode({"x": "a*(-U - x)"})},
        [
            saltus.Transition("on", "off", "x - h", 1, name="high"),
            saltus.Transition("off", "on", "x + h", -1, name="low"),
        ],
    )  # fmt: skip
    branch = saltus.continue_orbit(saltus.find_orbit(relay, x0=[0.0], mode="on"), "h", (1e8, 1.5e9))
    assert branch["BC1"].parameters["h"] == pytest.approx(1e9, rel=1e-12)
    assert saltus.verify(branch).passed


def test_another_kind_of_result_is_refused():
    with pytest.raises(saltus.InputError, match="result = 'Trajectory': must be an orbit, an equilibrium"):
        saltus.verify(saltus.simulate(CYCLE, x0=[1.0, 1.0], t_end=1.0))
