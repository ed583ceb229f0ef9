"""Transitions at a phase, their otherwise, and a surface that is watched both ways."""

import math

import numpy as np
import pytest

import saltus
from saltus import Mode, Transition
from saltus.errors import DefinitionError

RISES, FALLS = Mode({"x": "1"}), Mode({"x": "-1"})


def switched(*transitions, **kwargs):
    """Return a state that rises or falls."""
    return saltus.HybridSystem(
        ("x",), {"D": 0.3, "w": 2.0 * math.pi}, {"up": RISES, "down": FALLS, "still": Mode({"x": "0"})}, transitions,
        phase=kwargs.get("phase", ("theta", "w")),
    )  # fmt: skip


def test_an_event_at_a_phase_happens_once_a_period():
    system = switched(Transition("up", "down", at_phase="2*pi*D"), Transition("down", "up", at_phase=0))
    motion = saltus.simulate(system, {}, [0.0], mode="up", periods=3)
    times = motion.events["time"][motion.events["kind"] == "event"]
    np.testing.assert_allclose(times, [0.3, 1.0, 1.3, 2.0, 2.3], atol=1e-12)
    orbit = saltus.solve_orbit(
        switched(Transition("up", "down", at_phase="2*pi*D"), Transition("down", "up", at_phase=0, reset={"x": "x/2"})),
        {}, segments=[("up", "up_to_down", [0.0], 0.3), ("down", "down_to_up", [0.3], 0.7)],
    )  # fmt: skip
    assert orbit.admissible
    assert orbit.multipliers[0] == pytest.approx(0.5)
    assert not orbit.landings_beyond


def test_phases_of_two_events_may_be_anywhere():
    for first, second in ((0.1, 0.6), (0.7, 0.2), (0.55, 0.9)):
        system = switched(
            Transition("up", "down", at_phase=2 * math.pi * first),
            Transition("down", "up", at_phase=2 * math.pi * second, reset={"x": "0"}),
        )
        orbit = saltus.find_orbit(system, {}, [0.0])
        assert orbit.admissible
        durations = {part.mode: part.duration for part in orbit.segments}
        assert durations["up"] == pytest.approx((first - second) % 1.0)


@pytest.mark.parametrize(("x", "mode"), [(0.5, "up"), (-0.5, "down"), (0.0, "down")])
def test_a_decision_has_two_ways(x, mode):
    system = switched(Transition("still", "up", at_phase="pi", when="x", otherwise="down"))
    assert system.transition_names == ("still_to_up", "still_to_down")
    motion = saltus.simulate(system, {}, [x], mode="still", t_end=0.9)
    assert motion.mode_end == mode


def test_a_surface_is_watched_both_ways_by_two_transitions():
    system = saltus.HybridSystem(
        ("x", "y"), {}, {"free": Mode({"x": "y", "y": "-x"}), "a": Mode({"x": "0", "y": "0"}),
                         "b": Mode({"x": "0", "y": "0"})},
        [Transition("free", "a", "x - 0.5", 1), Transition("free", "b", "x - 0.5", -1)],
    )  # fmt: skip
    assert saltus.simulate(system, {}, [0.0, 1.0], mode="free", t_end=9.0).mode_end == "a"
    assert saltus.simulate(system, {}, [1.0, 0.0], mode="free", t_end=9.0).mode_end == "b"


@pytest.mark.parametrize(
    ("transition", "kwargs", "words"),
    [
        (Transition("up", "down", "x", at_phase=0), {}, "left out beside at_phase"),
        (Transition("up", "down", direction=1, at_phase=0), {}, "left out beside at_phase"),
        (Transition("up", "down", at_phase=0), {"phase": None}, "without a phase"),
        (Transition("up", "down", "x", otherwise="still"), {}, "pass when="),
        (Transition("up", "down", "x", when="x", otherwise="nowhere"), {}, "a mode"),
        (Transition("up", "down"), {}, "an expression"),
    ],
)
def test_what_a_transition_cannot_be_is_told(transition, kwargs, words):
    with pytest.raises(DefinitionError, match=words):
        switched(transition, **kwargs)


def test_an_event_at_a_phase_does_not_happen_again_at_once_in_the_next_mode():
    fields = {"on": Mode({"T": "2 - T"}), "off": Mode({"T": "-T"})}
    for at in (0, 1.0):
        toggles = [Transition("on", "off", at_phase=at), Transition("off", "on", at_phase=at)]
        system = saltus.HybridSystem(("T",), {"w": 2.0 * math.pi}, fields, toggles, phase=("theta", "w"))
        names = saltus.simulate(system, {}, [0.5], periods=5).events["name"]
        assert names[names != "theta"].tolist() == (["on_to_off", "off_to_on"] * 3)[: np.sum(names != "theta")]
    decided = saltus.HybridSystem(
        ("T",), {"low": 1.0, "w": 2.0 * math.pi}, fields,
        [
            Transition("on", "off", at_phase=0, when="T - low", otherwise="on"),
            Transition("off", "on", at_phase=0, when="low - T", otherwise="off"),
        ],
        phase=("theta", "w"),
    )  # fmt: skip
    orbit = saltus.find_orbit(decided, {}, [0.5])
    assert orbit.form.turns == 2
    assert orbit.max["T"] == pytest.approx(2.0 * math.e / (math.e + 1.0), abs=1e-11)
