"""A multiplier is 0 where a motion forgets a direction, also beside that of the flow."""

import math

import numpy as np
import pytest

import saltus

VALUES = {"E": 12.0, "L": 1e-4, "C1": 1e-5, "C2": 1e-4, "R": 300.0, "D": 0.4, "w": 2.0 * math.pi * 5e4}


def converter(load: float) -> saltus.HybridSystem:
    """Return a converter (SEPIC) whose diode blocks once its currents' sum has fallen to 0, where the sum rests."""
    on = {"i1": "E/L", "i2": "vc/L", "vc": "-i2/C1", "vo": "-vo/(R*C2)"}
    off = {"i1": "(E - vc - vo)/L", "i2": "-vo/L", "vc": "i1/C1", "vo": "(i1 + i2 - vo/R)/C2"}
    blocked = {"i1": "(E - vc)/(2*L)", "i2": "-(E - vc)/(2*L)", "vc": "i1/C1", "vo": "-vo/(R*C2)"}
    modes = {"on": saltus.Mode(on), "off": saltus.Mode(off), "blocked": saltus.Mode(blocked)}
    transitions = [
        saltus.Transition("on", "off", at_phase="2*pi*D", name="opens"),
        saltus.Transition("off", "on", at_phase=0, name="closes"),
        saltus.Transition("off", "blocked", event="i1 + i2", direction=-1, name="empty"),
        saltus.Transition("blocked", "on", at_phase=0, name="closes again"),
    ]
    return saltus.HybridSystem(
        ("i1", "i2", "vc", "vo"), {**VALUES, "R": load}, modes, transitions, phase=("th", "w"), name="SEPIC"
    )


@pytest.mark.parametrize("load", [100.0, 300.0, 480.0])
def test_sum_of_currents_that_the_diode_forgets_has_the_multiplier_zero(load):
    """The row (1, 1, 0, 0) of the map behind the diode's blocking is 0, whatever the load is."""
    orbit = saltus.find_orbit(converter(load), x0=[0.1, -0.1, 12.0, 25.0], mode="on")
    assert [part.mode for part in orbit.segments].count("blocked") == 1
    assert np.sort(np.abs(orbit.multipliers))[0] < 1e-12
    assert saltus.verify(orbit).passed
