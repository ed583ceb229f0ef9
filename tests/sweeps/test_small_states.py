"""Labels and numbers of sweeps whose states are far from 1 in size, on invariant planes and off them."""

from __future__ import annotations

import functools

import numpy as np
import pytest
from numpy.typing import NDArray

from saltus import HybridSystem, Mode, Section, Transition, run_sweep
from saltus.options import SweepOptions
from selection import guarding


def stuart_landau(u: float) -> HybridSystem:
    rates = {"x": "x*(m - (x**2 + y**2)/u**2) - w*y", "y": "y*(m - (x**2 + y**2)/u**2) + w*x"}
    return HybridSystem.smooth(rates, {"w": 0.38, "m": 1.0, "u": u}, phase=("s", "1"))


def seasonal_prey(u: float) -> HybridSystem:
    rates = {"N": "N*(1 - N/u)*(1 + e*cos(s)) - 3*N*Q/(N + 0.2*u)", "Q": "Q*(2.4*N/(N + 0.2*u) - 0.9)"}
    return HybridSystem.smooth(rates, {"e": 0.3, "u": u}, phase=("s", "0.7"))


def fed_chain(u: float) -> HybridSystem:
    growth, eaten = "x*2*S/(S + 0.3*u)", "2.2*x*y/(x + 0.2*u)"
    rates = {"S": f"-0.4*S - {growth}", "x": f"{growth} - 0.4*x - {eaten}", "y": f"{eaten} - 0.4*y"}
    fed = Transition("flow", "flow", at_phase="1.3", reset={"S": "S + u"}, name="feed")
    return HybridSystem(("S", "x", "y"), {"P": 8.0, "u": u}, {"flow": Mode(rates)}, [fed], phase=("s", "2*pi/P"))


def lorenz(u: float) -> HybridSystem:
    rates = {"x": "10*(y - x)", "y": "x*(r - z/u) - y", "z": "x*y/u - 8*z/3"}
    return HybridSystem.smooth(rates, {"r": 100.5, "u": u})


def van_der_pol(u: float) -> HybridSystem:
    return HybridSystem.smooth({"x": "y", "y": "m*(1 - (x/u)**2)*y - x"}, {"m": 1.0, "u": u}, phase=("s", "1.3"))


def driven_van_der_pol(u: float) -> HybridSystem:
    rates = {"x": "y", "y": "m*(1 - (x/u)**2)*y - x + 1.2*u*cos(s)"}
    return HybridSystem.smooth(rates, {"m": 1.0, "u": u}, phase=("s", "1.1"))


def rocked_pendulum(u: float) -> HybridSystem:
    rates = {"x": "y", "y": "-0.2*y - (1 + e*cos(s))*u*sin(x/u)"}
    return HybridSystem.smooth(rates, {"e": 0.6, "u": u}, phase=("s", "2"))


# system, parameter, values, start at unit 1, section
CASES = {
    "Stuart and Landau": (stuart_landau, "w", [1 / 7, 1 / 3, (3 - 5**0.5) / 2, 0.5], [0.5, 0.3], None),
    "Stuart and Landau, from rest": (stuart_landau, "m", [-0.2, 0.1, 0.3], [0.0, 0.0], None),
    "predator and prey": (seasonal_prey, "e", [0.1, 0.3, 0.6], [0.5, 0.2], None),
    "a fed chain": (fed_chain, "P", [6.0, 8.0, 10.0], [1.0, 0.3, 0.1], None),
    "Lorenz": (lorenz, "r", [28.0, 100.5, 160.0], [1.0, 1.0, 40.0], Section("z - (r - 1)*u", -1)),
    "van der Pol beside a clock": (van_der_pol, "m", [0.5, 1.0], [1.0, 0.0], None),
    "van der Pol, driven": (driven_van_der_pol, "m", [0.5, 1.0], [1.0, 0.0], None),
    "a pendulum, its support rocked": (rocked_pendulum, "e", [0.1, 0.6, 0.9], [0.3, 0.1], None),
}
TRUTH = {
    "Stuart and Landau": ["period-7", "period-3", "quasi-periodic", "period-2"],
    "predator and prey": ["period-2", "period-2", "period-4"],  # by SciPy's DOP853 at 1e-10
}
UNITS = (1e-12, 1e-9, 1e-7, 1e-5, 1e-3, 1e3, 1e9)
KEPT = [("Stuart and Landau", 1e-9), ("Stuart and Landau, from rest", 1e-12), ("predator and prey", 1e-9)]


@functools.cache
def swept(name: str, unit: float) -> tuple[list[str], NDArray[np.float64]]:
    """Return labels, and the largest first state in units, each value from the start."""
    build, parameter, values, start, section = CASES[name]
    first = build(unit).states[0]
    sweep = run_sweep(
        build(unit), parameter, values, x0=[unit * x for x in start],
        options=SweepOptions(follow="restart", discard=400, section=section, observables=[f"max({first})"]),
    )  # fmt: skip
    return sweep.labels.ravel().tolist(), sweep.observed.ravel() / unit


@pytest.mark.parametrize("name", TRUTH)
def test_labels_of_states_of_size_one_are_those_known(name: str) -> None:
    assert swept(name, 1.0)[0] == TRUTH[name]


@pytest.mark.parametrize(
    ("name", "unit"), guarding([(name, unit) for name in CASES for unit in UNITS], *KEPT, campaign=24, spread=True)
)
def test_labels_and_extremes_do_not_depend_on_the_unit_of_states(name: str, unit: float) -> None:
    labels, extremes = swept(name, unit)
    assert labels == swept(name, 1.0)[0]
    settled = [not label.startswith(("chaotic", "quasi")) for label in labels]
    assert extremes[settled] == pytest.approx(swept(name, 1.0)[1][settled], rel=1e-5, abs=1e-8)


def test_extremes_of_prey_that_falls_to_1e_29_are_those_of_its_simulation() -> None:
    # the points of the section are simulated by relative error; so are the extremes between them
    rates = {"N": "N*(1 - N/15)*(1 + e*cos(s)) - 3*N*Q/(N + 1)", "Q": "Q*(2.4*N/(N + 1) - 0.5)"}
    system = HybridSystem.smooth(rates, {"e": 0.3}, phase=("s", "0.7"))
    options = SweepOptions(observables=["max(N)", "min(N)"], keep=40)
    sweep = run_sweep(system, "e", [0.3], x0=[0.5, 0.2], options=options)
    highest, lowest = sweep.observed[0, 0]
    assert 14.0 < highest < 15.0
    assert 0.0 < lowest < 1e-20


@pytest.mark.parametrize("follow", ["up", "restart"])
def test_a_motion_leaves_an_unstable_torus_on_a_plane(follow: str) -> None:
    # two states forced alike at two rates; their difference d' = m d - d^3 leaves 0 for m > 0
    forced, apart = "cos(s) + cos(t)", "(m + 1)*(x - y)/2 - (x - y)**3/2"
    rates = {"x": f"-x + {forced} + {apart}", "y": f"-y + {forced} - ({apart})", "t": "1.6180339887"}
    system = HybridSystem.smooth(rates, {"m": 0.5}, phase=("s", "1"), angles=("t",))
    sweep = run_sweep(system, "m", [-0.5, 0.5], x0=[0.2, 0.2, 0.0], options=SweepOptions(follow=follow))
    differences = np.abs(sweep.column("x") - sweep.column("y")).max(axis=2)[0]
    assert sweep.labels[0].tolist() == ["quasi-periodic"] * 2
    assert differences == pytest.approx([0.0, 0.5**0.5], abs=1e-6)
