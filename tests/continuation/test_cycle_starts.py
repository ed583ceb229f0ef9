"""Branches of autonomous cycles have the same special points from every start, by every step: those in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import saltus
from saltus.continuation import StepControl
from saltus.system import HybridSystem, Mode

SLOW = 0.3  # rate of the recovery in FitzHugh and Nagumo's equations


@pytest.fixture(scope="module")
def bautin() -> HybridSystem:
    """Return r' = r (mu + r^2 - r^4), angle' = 1 in a tilted plane of three dimensions, across which all decays."""
    u, across = "(0.6*x + 0.8*z)", "(0.6*z - 0.8*x)"
    growth = f"(mu + ({u}**2 + y**2) - ({u}**2 + y**2)**2)"
    du, dv, dw = f"({growth}*{u} - y)", f"{growth}*y + {u}", f"(-{across})"
    field = {"x": f"0.6*{du} - 0.8*{dw}", "y": dv, "z": f"0.8*{du} + 0.6*{dw}"}
    return HybridSystem(("x", "y", "z"), {"mu": 0.1}, {"flow": Mode(field)})


@pytest.fixture(scope="module")
def fitzhugh_nagumo() -> HybridSystem:
    field = {"v": "v - v**3/3 - w + i0", "w": "e*(v + 0.7 - 0.8*w)"}
    return HybridSystem(("v", "w"), {"i0": 0.8, "e": SLOW}, {"flow": Mode(field)})


@pytest.mark.parametrize("mu", [-0.23, -0.05, 0.3, 0.9])
@pytest.mark.parametrize("largest", [0.04, 0.25])
def test_bautin_cycle_folds_at_minus_a_quarter_and_ends_at_zero(
    bautin: HybridSystem, mu: float, largest: float
) -> None:
    orbit = saltus.find_orbit(bautin, {"mu": mu}, x0=[0.7 + 0.1 * mu, 0.1, 0.8])
    branch = saltus.continue_orbit(orbit, "mu", (-0.5, 1.0), steps=StepControl(largest=largest))
    points = sorted((p.type, p.parameters["mu"]) for p in branch.special_points)
    assert [kind for kind, _ in points] == ["HB", "SN"]
    assert [value for _, value in points] == pytest.approx([0.0, -0.25], abs=1e-10)
    assert sorted(end.split(": ")[1] for end in branch.stopped) == [
        "bound reached",
        "the cycle shrinks to an equilibrium",
    ]


def test_multipliers_along_the_bautin_cycle_are_the_closed_form(bautin: HybridSystem) -> None:
    branch = saltus.continue_orbit(saltus.find_orbit(bautin, x0=[0.7, 0.1, 0.8]), "mu", (-0.5, 1.0))
    for i in range(1, len(branch), 6):
        orbit = branch.solution(i)
        along, y = 0.6 * orbit.x0[0] + 0.8 * orbit.x0[2], orbit.x0[1]
        r2, mu = along**2 + y**2, orbit.parameters["mu"]
        assert r2**2 - r2 == pytest.approx(mu, abs=1e-10)
        assert orbit.period == pytest.approx(2.0 * math.pi, rel=1e-11)
        exact = [1.0, math.exp(-2.0 * math.pi), math.exp(4.0 * math.pi * r2 * (1.0 - 2.0 * r2))]
        assert sorted(orbit.multipliers.real) == pytest.approx(sorted(exact), rel=1e-9, abs=1e-12)
        assert np.max(np.abs(orbit.multipliers.imag)) < 1e-9
        assert sorted(branch.multipliers[i].real) == pytest.approx(sorted(exact), rel=1e-6, abs=1e-12)


@pytest.mark.campaign
@pytest.mark.parametrize("i0", [0.44, 0.7, 1.0, 1.3])
def test_fitzhugh_nagumo_cycle_ends_at_both_hopf_points_past_its_folds(
    fitzhugh_nagumo: HybridSystem, i0: float
) -> None:
    rest = np.array([-1.0, 1.0]) * math.sqrt(1.0 - 0.8 * SLOW)  # the trace 1 - v^2 - 0.8 e vanishes
    hopf = (rest + 0.7) / 0.8 - rest + rest**3 / 3.0
    orbit = saltus.find_orbit(fitzhugh_nagumo, {"i0": i0}, x0=[2.0, 0.0])
    for largest in (0.05, 0.2):
        branch = saltus.continue_orbit(orbit, "i0", (0.0, 2.0), steps=StepControl(largest=largest))
        found = {kind: [p.parameters["i0"] for p in branch.special_points.of_type(kind)] for kind in ("HB", "SN")}
        assert len(branch.special_points) == 4
        assert sorted(found["HB"]) == pytest.approx(hopf.tolist(), abs=1e-11)
        assert sorted(found["SN"]) == pytest.approx([0.41674735995, 1.33325264005], abs=1e-10)
        # v -> -v turns the equations over, with i0 -> 1.75 - i0
        assert sum(found["SN"]) == pytest.approx(1.75, abs=1e-11)


def test_scipy_confirms_the_fold_of_the_fitzhugh_nagumo_cycle(fitzhugh_nagumo: HybridSystem) -> None:
    orbit = saltus.find_orbit(fitzhugh_nagumo, x0=[2.0, 0.0])
    fold = saltus.continue_orbit(orbit, "i0", (0.0, 0.8))["SN1"].orbit
    i0 = fold.parameters["i0"]

    def rates(_: float, y: np.ndarray) -> list[float]:
        v, w, _ = y
        return [v - v**3 / 3.0 - w + i0, SLOW * (v + 0.7 - 0.8 * w), 1.0 - v**2 - 0.8 * SLOW]

    once = solve_ivp(rates, (0.0, fold.period), [*fold.states[0], 0.0], method="DOP853", rtol=1e-12, atol=1e-13)
    assert once.y[:2, -1] == pytest.approx(fold.states[0], abs=1e-9)
    assert once.y[2, -1] == pytest.approx(0.0, abs=1e-8)  # the integral of the divergence: the multiplier is 1
