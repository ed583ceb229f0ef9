"""What a branch holds of the orbit at which it ends: right, or unknown, never rounding."""

from __future__ import annotations

import numpy as np
import pytest

import saltus
from selection import guarding

_UNITS = [(1.0, 1.0), (1e-9, 1.0), (1e9, 1e9), (1.0, 1e-9)]  # of states and of rates


def _relay(seed: int, unit: float, pace: float) -> tuple[saltus.HybridSystem, float]:
    """Return a planar relay with a stable focus or node, and the trace of its matrix, which both modes share."""
    rng = np.random.default_rng(seed)
    a, c, d = rng.uniform(0.5, 1.5), rng.uniform(0.1, 0.5), rng.uniform(0.1, 0.6)
    g = a * rng.uniform(0.8, 1.3)

    def mode(push: float) -> saltus.Mode:
        return saltus.Mode({"x": f"({-a!r}*x + {g!r}*y)*{pace!r}", "y": f"({-c!r}*x - {d!r}*y + {push!r})*{pace!r}"})

    return saltus.HybridSystem(
        ("x", "y"),
        {"h": 0.1 * unit},
        {"p": mode(unit), "m": mode(-unit)},
        [
            saltus.Transition("p", "m", "x - h", 1, name="down"),
            saltus.Transition("m", "p", "x + h", -1, name="up"),
        ],
    ), -(a + d) * pace


@pytest.mark.parametrize(
    ("seed", "unit", "pace"),
    guarding(
        [(seed, *units) for seed in (1, 2, 6, 8, 9) for units in _UNITS],
        (1, 1.0, 1e-9), (2, 1e-9, 1.0),
        campaign=6,
    ),
)  # fmt: skip
def test_a_relay_keeps_its_product_of_multipliers_up_to_its_grazing(seed, unit, pace):
    """Both fields have one rate across the surface, so events enlarge no area: the multiplier is exp(trace T)."""
    relay, trace = _relay(seed, unit, pace)
    branch = saltus.continue_orbit(saltus.find_orbit(relay, x0=[0.0, 0.0], mode="p"), "h", (0.05 * unit, 5.0 * unit))
    truth = np.exp(trace * branch.period)
    assert np.abs(branch.multipliers[:, 0] - truth).max() < 1e-9
    assert branch.stable.all()
    assert any("grazing" in reason for reason in branch.stopped)
    last = branch["GR1"].orbit
    assert last.multipliers[0].real == pytest.approx(np.exp(trace * last.period), rel=1e-6)
    assert last.stable


def _forced(rate: float, push: float) -> saltus.HybridSystem:
    """Return a forced relay of one state, whose field jumps where its surface is grazed."""
    fields = [{"x": f"{-rate!r}*x + A*cos(th) + {side!r}"} for side in (push, -push)]
    return saltus.HybridSystem(
        ("x",),
        {"A": 2.0, "w": 1.0, "h": 0.3},
        dict(zip("pm", map(saltus.Mode, fields), strict=True)),
        [
            saltus.Transition("p", "m", "x - h", 1, name="down"),
            saltus.Transition("m", "p", "x + h", -1, name="up"),
        ],
        phase=("th", "w"),
    )


def test_a_pole_of_the_multiplier_is_told_at_the_grazing():
    """The field jumps across the surface: the derivative of the return grows like the inverse of the speed."""
    branch = saltus.continue_orbit(saltus.find_orbit(_forced(0.7, 0.2), x0=[0.0], mode="p"), "A", (0.05, 3.0))
    assert abs(branch["GR1"].orbit.multipliers[0]) > 1e10
    assert not branch.stable[0]


@pytest.mark.parametrize("restitution", [0.6, 0.9])
def test_a_self_excited_impact_oscillator_keeps_the_square_of_its_restitution(restitution):
    """At the grazing the motion with the impact has the cycle's own multiplier, times that of the impact's areas."""
    oscillator = saltus.HybridSystem(
        ("x", "v"),
        {"c": 1.0, "e": restitution},
        {"m": saltus.Mode({"x": "v", "v": "-x + 0.3*v*(1 - x**2)"})},
        [saltus.Transition("m", "m", "x - c", 1, {"v": "-e*v"}, name="hit")],
    )
    branch = saltus.continue_orbit(saltus.find_orbit(oscillator, x0=[0.5, 0.0]), "c", (0.9, 3.0))
    free = branch.multipliers[-1, 0].real
    assert branch["GR1"].orbit.multipliers[0].real == pytest.approx(restitution**2 * free, rel=1e-6)
