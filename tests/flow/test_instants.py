"""An instant is a set: all transitions that are due at one time are made, in the order of the definition."""

from __future__ import annotations

import math
import warnings

import numpy as np
import pytest

from saltus.continuation import continue_orbit
from saltus.flow.simulation import simulate
from saltus.orbits.find import find_orbit
from saltus.system.hybrid import HybridSystem, Mode, Transition

AT_PHASE, BY_SINE = {"at_phase": 0}, {"event": "sin(th)", "direction": 1}
PAIRS = {
    "at one phase, twice": (AT_PHASE, AT_PHASE),
    "one function, twice": (BY_SINE, BY_SINE),
    "at phases that are equal": ({"at_phase": "a"}, {"at_phase": "b"}),
    "at a phase, and by a function": (AT_PHASE, BY_SINE),
    "by a function, and at a phase": (BY_SINE, AT_PHASE),
}


def doses(first, second, resets=({"d": "d + 100"}, {"c": "c + 100"})):
    """Two doses of a medicine in each period of 12: into the gut, and into the blood."""
    modes = {"m": Mode({"d": "-0.11*d", "c": "0.11*d - 0.1*c"})}
    transitions = [
        Transition("m", "m", reset=reset, name=name, **kind)
        for reset, name, kind in zip(resets, ("gut", "blood"), (first, second), strict=True)
    ]
    parameters = {"w": 2.0 * math.pi / 12.0, "a": 0.0, "b": 0.0}
    return HybridSystem(("d", "c"), parameters, modes, transitions, phase=("th", "w"))


def steady():
    """Gut and blood just after both doses, in closed form."""
    A, B = math.exp(-0.11 * 12.0), math.exp(-0.1 * 12.0)
    d = 100.0 / (1.0 - A)
    through = 0.11 * d / (0.1 - 0.11) * (A - B)
    return d, (100.0 + through) / (1.0 - B)


@pytest.mark.parametrize("pair", PAIRS)
def test_both_transitions_of_an_instant_are_made(pair):
    motion = simulate(doses(*PAIRS[pair]), None, [0.0, 0.0], t_end=30.0)
    made = [(time, name) for time, name, kind in motion.events[["time", "name", "kind"]].tolist() if kind == "event"]
    assert made == [(pytest.approx(12.0 * i, abs=1e-12), name) for i in range(3) for name in ("gut", "blood")]


@pytest.mark.parametrize("pair", PAIRS)
def test_an_orbit_has_both_transitions_of_an_instant(pair):
    orbit = find_orbit(doses(*PAIRS[pair]), x0=[0.0, 0.0])
    assert sorted(orbit.signature) == [("m", "blood"), ("m", "gut")]
    assert orbit.admissible
    assert (orbit.max["d"], orbit.max["c"]) == pytest.approx(steady(), rel=1e-9)
    assert sorted(orbit.multipliers.real) == pytest.approx([math.exp(-1.32), math.exp(-1.2)], rel=1e-8)


@pytest.mark.parametrize("pair", ["at one phase, twice", "at a phase, and by a function"])
def test_a_branch_keeps_both_transitions_of_an_instant(pair):
    system = doses(*PAIRS[pair])
    branch = continue_orbit(find_orbit(system, x0=[0.0, 0.0]), "w", (0.4, 0.7))
    assert [point.type for point in branch.special_points] == []
    assert branch.admissible.all()
    assert branch.multipliers[:, 0].real == pytest.approx(np.exp(-0.1 * 2.0 * np.pi / branch.values), rel=1e-7)


def test_transitions_that_do_not_commute_are_told():
    system = doses(AT_PHASE, AT_PHASE, ({"d": "d + 100"}, {"d": "d/2"}))
    told = r"transitions 'gut' and 'blood' of mode 'm' are due at the same time, t = 0, .* in the other order"
    with pytest.warns(RuntimeWarning, match=told):
        motion = simulate(system, None, [10.0, 0.0], t_end=1.0)
    assert motion.events["after"][-1][0] == 55.0


def test_transitions_that_commute_are_not_told():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        simulate(doses(AT_PHASE, AT_PHASE, ({"d": "d/3"}, {"d": "d/2"})), None, [10.0, 0.0], t_end=30.0)


def test_one_of_two_ways_out_of_a_mode_is_told():
    """Both surfaces are met at t = 1: the first way in the definition is taken."""
    modes = {"m": Mode({"x": "1"}), "left": Mode({"x": "0"}), "right": Mode({"x": "0"})}
    ways = [Transition("m", "left", "x - 1", 1), Transition("m", "right", "x**2 - 1", 1)]
    with pytest.warns(RuntimeWarning, match=r"'m_to_left' and 'm_to_right' of mode 'm' .* t = 1,"):
        assert simulate(HybridSystem(("x",), {}, modes, ways), None, [0.0], t_end=2.0).mode_end == "left"
