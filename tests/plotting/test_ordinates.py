"""The ordinate that a branch has by default: one that varies, whatever a wall or a reset holds."""

from __future__ import annotations

import numpy as np
import pytest
from matplotlib import pyplot as plt

import saltus
from saltus import HybridSystem, Mode, Transition


def striker(unit: float, outputs: dict[str, str] | None = None) -> HybridSystem:
    """An oscillator that strikes a wall at 1, in a unit of length."""
    return HybridSystem(
        ("x", "v"),
        {"k": 1.0, "c": 0.1, "d": unit, "e": 0.8, "w": 1.1, "A": unit},
        {"free": Mode({"x": "v", "v": "A*cos(s) - c*v - k*x"})},
        [Transition("free", "free", event="x - d", direction=1, reset={"v": "-e*v"}, name="impact")],
        phase=("s", "w"),
        outputs=outputs or {},
    )


def striking(unit: float, tolerance: float, outputs: dict[str, str] | None = None):
    orbit = saltus.find_orbit(striker(unit, outputs), x0=[0.0, 0.0], tolerance=tolerance)
    return saltus.continue_orbit(orbit, "A", (0.5 * unit, 3.0 * unit))


def neuron(tolerance: float):
    """A quadratic neuron that is reset when it spikes, E. M. Izhikevich, IEEE Trans. Neural Netw. 14 (2003) 1569."""
    system = HybridSystem(
        ("v", "u"),
        {"I": 10.0, "a": 0.02, "b": 0.2, "c": -65.0, "d": 8.0},
        {"rest": Mode({"v": "0.04*v**2 + 5*v + 140 - u + I", "u": "a*(b*v - u)"})},
        [Transition("rest", "rest", event="v - 30", direction=1, reset={"v": "c", "u": "u + d"}, name="spike")],
    )
    orbit = saltus.find_orbit(system, x0=[-60.0, -10.0], tolerance=tolerance)
    return saltus.continue_orbit(orbit, "I", (8.0, 16.0))


def integrator():
    """A leaky integrator from 0 to its threshold: both extremes are held."""
    spike = Transition("charge", "charge", event="v - 1", direction=1, reset={"v": "0"}, name="spike")
    system = HybridSystem(("v",), {"I": 2.0}, {"charge": Mode({"v": "I - v"})}, [spike])
    return saltus.continue_orbit(saltus.solve_orbit(system, {}, [("charge", "spike", [0.0], 0.7)]), "I", (1.5, 4.0))


def drawn_range(ax) -> float:
    return float(np.ptp(np.concatenate([line.get_ydata() for line in ax.lines])))


@pytest.mark.parametrize("tolerance", [1e-12, 1e-6])
@pytest.mark.parametrize("unit", [1.0, 1e-9, 1e9])
def test_what_the_wall_holds_is_not_drawn(unit, tolerance):
    ax = striking(unit, tolerance).plot()
    assert ax.get_ylabel() == "min $x$"
    assert drawn_range(ax) > 0.1 * unit


def test_the_least_gap_at_the_wall_is_not_drawn():
    ax = striking(1.0, 1e-12, {"gap": "d - x"}).plot()
    assert ax.get_ylabel() == "max gap"


@pytest.mark.parametrize("tolerance", [1e-12, 1e-9, 1e-6])
def test_what_the_threshold_holds_is_not_drawn(tolerance):
    ax = neuron(tolerance).plot()
    assert ax.get_ylabel() == "min $v$"
    assert drawn_range(ax) > 0.1


def test_where_both_extremes_are_held_the_amplitude_is_drawn():
    ax = integrator().plot()
    assert ax.get_ylabel() == "amplitude(v, 1)"
    assert drawn_range(ax) > 1e-3


def test_axes_that_show_one_of_the_quantities_keep_it():
    branch = striking(1.0, 1e-12)
    _, ax = plt.subplots()
    branch.plot("A", "max_v", ax=ax)
    assert branch.plot(ax=ax).get_ylabel() == "max $v$"


def test_an_equilibrium_is_drawn_by_a_state_that_varies():
    chain = HybridSystem.smooth({"x": "1 - x", "y": "a*x - y"}, {"a": 0.5})
    branch = saltus.continue_equilibrium(saltus.find_equilibrium(chain, x0=[1.0, 0.5]), "a", (0.1, 1.0))
    assert branch.plot().get_ylabel() == "$y$"
