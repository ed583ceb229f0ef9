"""Transitions with a condition, and modes with states of their own, in lanes against one motion at a time."""

import numpy as np
import pytest

import saltus
from own_states import belt, wall
from saltus import Mode, Transition
from saltus.ensemble.ensemble import Ensemble

_STARTS = np.random.default_rng(1).uniform([-1.0, -1.0], [0.25, 1.0], (60, 2))


def gate():
    """Return a driven mass that a wall turns back, where the wall is closed."""
    return saltus.HybridSystem(
        ("x", "v"), {"w": 1.1, "c": 0.1},
        {"free": Mode({"x": "v", "v": "cos(theta) - x - c*v"})},
        [Transition("free", "free", "x - 0.3", 1, {"v": "-0.7*v"}, when="sin(theta) - 0.2*v", name="hit")],
        phase=("theta", "w"), name="gate",
    )  # fmt: skip


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore:saltus. 'release' lands beyond")
@pytest.mark.parametrize(
    ("system", "parameters", "starts", "alone"),
    [
        (gate(), {}, _STARTS, 6),
        (wall(), {"A": 0.2}, np.column_stack([_STARTS, np.zeros(60)]), 0),
        (wall(), {"A": 0.6, "w": 0.9}, np.column_stack([_STARTS, np.zeros(60)]), 0),
    ],
)
def test_a_surface_that_is_passed_while_its_condition_fails_is_met_from_the_other_side(
    system, parameters, starts, alone
):
    ensemble = Ensemble(system, parameters, tolerance=1e-11)
    ends, modes = ensemble.strobe(starts, count=7)
    motions = [saltus.simulate(system, parameters, x, periods=7) for x in starts]
    assert sum(int((motion.events["kind"] == "event").sum()) for motion in motions) > 50
    np.testing.assert_allclose(ends, [motion.x_end[: starts.shape[1]] for motion in motions], atol=1e-8)
    assert [system.mode_names[mode] for mode in modes] == [motion.mode_at(motion.t_end) for motion in motions]
    assert ensemble.left_over <= alone  # to the event-driven flow


def oscillator(*transitions):
    """Return an oscillator between modes that differ in stiffness."""
    fields = {name: {"x": "v", "v": f"0.2 - {k}*x - c*v"} for name, k in (("soft", 1.0), ("stiff", 1.7), ("hard", 2.5))}
    modes = {name: Mode(field) for name, field in fields.items()}
    return saltus.HybridSystem(("x", "v"), {"c": 0.1}, modes, transitions, name="oscillator")


@pytest.mark.campaign
@pytest.mark.parametrize(
    "transitions",
    [
        pytest.param(
            [
                Transition("soft", "soft", "x - 0.3", 1, {"v": "-0.7*v"}, when="v - 0.8", name="bounce"),
                Transition("soft", "stiff", "x - 0.3", 1, {"v": "0.9*v"}, when="0.4 - v", name="enter"),
                Transition("stiff", "soft", "x + 0.1", -1),
            ],
            id="two conditions at one surface, both of which may fail",
        ),
        pytest.param(
            [
                Transition("soft", "soft", "x - 0.3", 1, when="x", name="counted"),
                Transition("soft", "soft", "0.6 - 2*x", -1, {"v": "0.8*v"}, when="v - 0.2", name="slowed"),
            ],
            id="one event after the other at one surface",
            marks=pytest.mark.campaign,
        ),
        pytest.param(
            [
                Transition("soft", "stiff", "x - 0.3", 0, when="v*v - 0.1"),
                Transition("stiff", "hard", "x - 0.3", -1, {"v": "0.9*v"}, when="-v - 0.6"),
                Transition("stiff", "soft", "x - 0.3", -1, {"v": "0.5*v"}, when="-v"),
                Transition("hard", "soft", "x + 0.2", -1),
            ],
            id="an event of the mode to which the one before leads",
            marks=pytest.mark.campaign,
        ),
        pytest.param(
            [
                Transition("soft", "soft", "x", 1, {"v": "0.5 - 2*v"}, when="0.7 - v", name="turned"),
                Transition("soft", "stiff", "x", 1, {"v": "0.9*v"}, when="v - 0.7"),
                Transition("stiff", "soft", "x", 0, {"v": "0.8*v"}, when="1.1 - v*v"),
            ],
            id="a reset that turns speeds about, and thresholds",
            marks=pytest.mark.campaign,
        ),
    ],
)
def test_transitions_that_share_a_surface_happen_as_those_of_single_motions(transitions):
    system = oscillator(*transitions)
    starts = np.random.default_rng(2).uniform(-1.5, 1.5, (40, 2))
    ensemble = Ensemble(system, {}, tolerance=1e-11, interval=1.7)
    ends, modes = ensemble.strobe(starts, count=4)
    motions = [saltus.simulate(system, {}, x, t_end=6.8) for x in starts]
    names = [transition.name for transition in system.transitions]
    happened = {name for motion in motions for name in motion.events["name"]}
    assert happened == set(names)
    np.testing.assert_allclose(ends, [motion.x_end for motion in motions], atol=1e-8)
    assert [system.mode_names[mode] for mode in modes] == [motion.mode_at(motion.t_end) for motion in motions]


def test_a_motion_starts_before_an_event_of_the_phase_alone():
    fields = {name: {"x": "v", "v": f"cos(theta) - {k}*x - 0.1*v"} for name, k in (("soft", 1.0), ("stiff", 1.7))}
    system = saltus.HybridSystem(
        ("x", "v"), {"w": 1.3}, {name: Mode(field) for name, field in fields.items()},
        [
            Transition("soft", "stiff", at_phase=4.0, when="v", otherwise="soft"),
            Transition("stiff", "soft", at_phase=5.5),
            Transition("soft", "soft", at_phase=1.0, reset={"v": "v + 0.1"}, name="kick"),
        ],
        phase=("theta", "w"),
    )  # fmt: skip
    starts = np.random.default_rng(3).uniform(-1.0, 1.0, (20, 2))
    ensemble = Ensemble(system, {}, tolerance=1e-11)
    ends = ensemble.strobe(starts, count=3)[0]
    np.testing.assert_allclose(ends, [saltus.simulate(system, {}, x, periods=3).x_end[:2] for x in starts], atol=1e-8)
    assert ensemble.left_over == 0


@pytest.mark.campaign
def test_a_motion_starts_in_no_mode_that_lacks_a_state_which_it_has():
    system = belt()
    ensemble = Ensemble(system, {}, tolerance=1e-11, interval=1.0)
    starts = np.array([[0.1, -0.2], [0.4, -0.5], [0.1, 0.0], [0.9, 0.0], [1.1, 0.0]])
    ends = ensemble.strobe(starts, count=20)[0]
    motions = [saltus.simulate(system, {}, x, t_end=20.0) for x in starts]
    assert [motion.mode_at(0.0) for motion in motions] == ["slip", "slip", "stick", "stick", "slip"]
    np.testing.assert_allclose(ends, [motion.x_end for motion in motions], atol=1e-8)
    assert ensemble.left_over == 0


@pytest.mark.campaign
@pytest.mark.filterwarnings("ignore:saltus. 'release' lands beyond")
def test_basins_in_a_mode_that_lacks_a_state_are_those_of_single_motions():
    system, parameters = wall(), {"A": 0.2}
    found = saltus.find_attractors(system, parameters, {"x": (-1.0, 0.49), "v": (-1.0, 1.0), "q": 0.0})
    labels = saltus.map_basins(system, parameters, {"x": (-1.0, 0.49, 30), "v": (-1.0, 1.0, 30), "q": 0.0}, found)
    data = labels.to_xarray().squeeze()
    points = found.to_xarray()["point"].values
    rng = np.random.default_rng(0)
    for i, j in rng.integers(30, size=(20, 2)).tolist():
        start = [float(data["x"][i]), float(data["v"][j]), 0.0]
        motion = saltus.simulate(system, parameters, start, mode="free", periods=300)
        apart = np.abs(points - motion.x_end[:3]).max(axis=1)
        assert apart.min() < 1e-6
        assert int(data["labels"][i, j]) == int(np.argmin(apart))
