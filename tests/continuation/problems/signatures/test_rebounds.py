"""Resets that leave the motion on their own surface: branches go on where a second one right behind is born."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.optimize import brentq

import saltus
from selection import guarding

CLEGG = (0.2, 0.0, 1.0)  # decay of the plant, of the controller, and the drive's frequency
BORDERS = (0.9408025436391878, 4.44971436, 10.3044255, 18.3401878)


def loop(a: float, c: float, w: float, size: float = 1.0) -> saltus.HybridSystem:
    """Return x' = q - a x with q' = k (e - c q), where q is reset to 0 whenever the error e = sin(th) - x is 0."""
    field = {"x": "q - a*x", "q": f"k*({size!r}*sin(th) - x) - k*c*q"}
    reset = saltus.Transition("on", "on", event=f"{size!r}*sin(th) - x", direction=0, reset={"q": "0"}, name="reset")
    parameters = {"k": 3.0, "w": w, "a": a, "c": c}
    return saltus.HybridSystem(("x", "q"), parameters, {"on": saltus.Mode(field)}, [reset], phase=("th", "w"))


def after_half_a_period(k: float, th: float, a: float, c: float, w: float) -> float:
    """Return x half a period behind a reset at the phase `th`, there with x = sin(th): the flow is linear."""
    A = np.array([[-a, 1, 0, 0], [-k, -k * c, k, 0], [0, 0, 0, w], [0, 0, -w, 0]])
    return float((expm(A * np.pi / w) @ [np.sin(th), 0.0, np.sin(th), np.cos(th)])[0])


def phases(k: float, a: float, c: float, w: float) -> list[float]:
    """Return the phases of a reset after which x = -sin(th) half a period later: those of symmetric orbits."""
    grid = np.linspace(0.0, np.pi, 200)
    gaps = [after_half_a_period(k, th, a, c, w) + np.sin(th) for th in grid]
    passed = [i for i in range(len(grid) - 1) if gaps[i] * gaps[i + 1] < 0.0]
    return [brentq(lambda th: after_half_a_period(k, th, a, c, w) + np.sin(th), *grid[i : i + 2]) for i in passed]


def slope(k: float, a: float, c: float, w: float) -> float:
    """Return the rate of the error behind the only reset in half a period."""
    th = phases(k, a, c, w)[-1]
    return w * np.cos(th) + a * np.sin(th)


def test_the_integrator_of_clegg_goes_on_through_each_birth_of_a_reset():
    border = brentq(lambda k: slope(k, *CLEGG), 0.9, 0.96, xtol=1e-14)
    assert border == pytest.approx(BORDERS[0], rel=1e-12)
    system = loop(*CLEGG)
    for k, steps in ((3.0, None), (0.6, saltus.StepControl(largest=0.02)), (6.0, saltus.StepControl(largest=0.3))):
        orbit = saltus.find_orbit(system, {"k": k}, x0=[0.3, 0.7])
        branch = saltus.continue_orbit(orbit, "k", (0.1, 20.0), steps=steps)
        assert [point.type for point in branch.special_points] == ["BC"] * 4
        assert [point.parameters["k"] for point in branch.special_points] == pytest.approx(BORDERS, rel=1e-8)
        assert branch["BC1"].parameters["k"] == pytest.approx(border, rel=1e-10)
        assert all("bound reached" in reason for reason in branch.stopped)
        assert branch.audit.breaches == ()
        for value, resets in ((0.5, 2), (2.0, 4)):
            (there,) = branch.at(value)
            assert len(there.segments) == resets
            settled = saltus.simulate(system, {"k": value}, x0=[0.3, 0.7], periods=20).x_end
            assert there.x0 == pytest.approx(settled[:2], abs=1e-9)


@pytest.mark.parametrize("size", [1e-9, 1e9])
def test_a_birth_of_a_reset_is_passed_in_all_units(size):
    orbit = saltus.find_orbit(loop(*CLEGG, size), {"k": 0.6}, x0=[0.3 * size, 0.7 * size])
    branch = saltus.continue_orbit(orbit, "k", (0.5, 2.0))
    assert [point.parameters["k"] for point in branch.special_points] == pytest.approx(BORDERS[:1], rel=1e-10)


@pytest.mark.parametrize(
    "seed", guarding([seed for seed in range(13) if seed != 7], 0, campaign=5)
)  # in 7 none is born
def test_random_loops_with_resets_go_on_from_both_sides(seed):
    rng = np.random.default_rng(seed)
    own = float(rng.uniform(0.05, 0.6)), float(rng.uniform(0.0, 0.3)), float(rng.uniform(0.5, 2.0))
    grid = np.geomspace(0.05, 6.0, 60)
    slopes = [slope(k, *own) if phases(k, *own) else np.nan for k in grid]
    first = next(i for i in range(len(grid) - 1) if slopes[i] * slopes[i + 1] < 0.0)
    border = brentq(lambda k: slope(k, *own), *grid[first : first + 2], xtol=1e-13)
    system, found = loop(*own), []
    for k in (0.8 * border, 1.2 * border):
        orbit = saltus.find_orbit(system, {"k": k}, x0=[0.3, 0.0])
        for steps in (None, saltus.StepControl(largest=0.03)):
            branch = saltus.continue_orbit(orbit, "k", (0.7 * border, 1.3 * border), steps=steps)
            assert all("bound reached" in reason for reason in branch.stopped)
            assert branch.audit.breaches == ()
            found.append([(point.type, point.of) for point in branch.special_points])
            assert [point.parameters["k"] for point in branch.special_points] == pytest.approx([border], rel=1e-9)
    assert found == [[("BC", "")]] * 4
