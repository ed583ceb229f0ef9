"""A soft stop without jump, with a damper, and with a root on its surface (Kelvin-Voigt): orbits, multipliers, loci."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import saltus

# Beyond x = d a spring of the power 3/2 acts, with a damper, and with one that grows like the contact's radius.
STOP = saltus.HybridSystem(
    ("x", "v"),
    {"w": 1.0, "d": 0.5, "e": 0.0, "q": 1.0},
    {
        "free": saltus.Mode({"x": "v", "v": "cos(s) - 0.1*v - x"}),
        "in": saltus.Mode({"x": "v", "v": "cos(s) - 0.1*v - x - 10*(x - d)**(3/2) - e*v - q*(x - d)**(1/2)*v"}),
    },
    [
        saltus.Transition("free", "in", "x - d", 1, name="touch"),
        saltus.Transition("in", "free", "x - d", -1, name="release"),
    ],
    phase=("s", "w"),
)


def flow(x: np.ndarray, p: dict[str, float]) -> np.ndarray:
    """State after a period of the forcing, its events met by SciPy."""
    t, end, inside = 0.0, 2.0 * math.pi / p["w"], x[0] > p["d"]

    def surface(t: float, x: np.ndarray) -> float:
        return float(x[0] - p["d"])

    surface.terminal = True
    while t < end:
        surface.direction = -1.0 if inside else 1.0

        def field(t: float, x: np.ndarray, inside: bool = inside) -> list[float]:
            depth = max(x[0] - p["d"], 0.0) if inside else 0.0
            push = 10.0 * depth**1.5 + p["q"] * math.sqrt(depth) * x[1] + (p["e"] * x[1] if inside else 0.0)
            return [x[1], math.cos(p["w"] * t) - 0.1 * x[1] - x[0] - push]

        found = solve_ivp(field, (t, end), x, method="DOP853", events=surface, rtol=1e-12, atol=1e-13)
        t, x, inside = found.t[-1], found.y[:, -1], not inside
    return x


@pytest.mark.parametrize(("e", "q"), [(0.0, 1.0), (0.5, 3.0), (0.0, -0.2)])
def test_multipliers_of_a_field_with_a_root_on_the_surface_are_those_of_scipy(e: float, q: float) -> None:
    orbit = saltus.find_orbit(STOP, {"e": e, "q": q}, [0.0, 0.0])
    x, p = np.array(orbit.x0), dict(orbit.parameters)
    assert flow(x, p) == pytest.approx(x, abs=1e-9)
    step, rows = 1e-4, []
    for along in np.eye(2):
        near, far = (flow(x + k * step * along, p) - flow(x - k * step * along, p) for k in (1.0, 2.0))
        rows.append((8.0 * near - far) / (12.0 * step))
    expected = np.linalg.eigvals(np.array(rows).T)
    assert np.prod(orbit.multipliers) == pytest.approx(np.prod(expected), abs=1e-6)
    assert np.sum(orbit.multipliers) == pytest.approx(np.sum(expected), abs=1e-6)


@pytest.mark.parametrize(("e", "q"), [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
def test_grazings_of_a_soft_stop_lie_on_the_resonance_curve(e: float, q: float) -> None:
    orbit = saltus.find_orbit(STOP, {"d": 12.0, "e": e, "q": q}, [0.0, 0.0])
    branch = saltus.continue_orbit(orbit, "d", (1.0, 12.0), directions="down", stop_at="GR")
    locus = saltus.continue_locus(branch["GR1"], ("d", "w"), {"d": (1.0, 12.0), "w": (0.8, 1.2)})
    d, w = locus.values.T
    assert d == pytest.approx(1.0 / np.sqrt((1.0 - w * w) ** 2 + 0.01 * w * w), rel=1e-9)
    assert sorted((w[0], w[-1])) == pytest.approx([0.8, 1.2])
    assert [point.type for point in locus.special_points] == ["TP"]
