"""A soft stop without jump, with a damper, and with a root on its surface (Kelvin-Voigt): orbits, multipliers, loci."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm

import saltus
from selection import guarding

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


@pytest.mark.parametrize("fewer_first", [True, False])
@pytest.mark.parametrize(("e", "q"), [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)])
def test_multipliers_at_a_grazing_are_those_without_the_stop(e: float, q: float, fewer_first: bool) -> None:
    start = {"d": 12.0 if fewer_first else 8.0, "e": e, "q": q}
    branch = saltus.continue_orbit(saltus.find_orbit(STOP, start, [0.0, 0.0]), "d", (8.0, 12.0))
    assert [point.type for point in branch.special_points] == ["GR"]
    at = int(np.argmin(np.abs(branch.values - branch["GR1"].value("d"))))
    own = np.exp(2.0 * math.pi * np.roots([1.0, 0.1, 1.0]))
    for found in (branch.multipliers[at], branch.solution(at).multipliers, branch["GR1"].orbit.multipliers):
        assert np.sort_complex(found) == pytest.approx(np.sort_complex(own), abs=1e-9)
    assert branch.stable[at]


def on_a_spring(k: float, zeta: float, w: float) -> tuple[saltus.HybridSystem, float]:
    """An oscillator beside a spring at x = 1, and the drive at which it grazes."""
    free = {"x": "v", "v": "-x - 2*zeta*v + A*cos(s)"}
    system = saltus.HybridSystem(
        ("x", "v"),
        {"A": 1.0, "zeta": zeta, "w": w, "k": k},
        {"free": saltus.Mode(free), "in": saltus.Mode({**free, "v": free["v"] + " - k*(x - 1)"})},
        [saltus.Transition("free", "in", "x - 1", 1), saltus.Transition("in", "free", "x - 1", -1)],
        phase=("s", "w"),
    )
    return system, math.hypot(1.0 - w * w, 2.0 * zeta * w)


def piecewise_linear(orbit: saltus.PeriodicOrbit) -> np.ndarray:
    """Multipliers from exponentials of the segments' matrices."""
    p, M = orbit.parameters, np.eye(2)
    for part in orbit.segments:
        stiffness = 1.0 + (p["k"] if part.mode == "in" else 0.0)
        M = expm(part.duration * np.array([[0.0, 1.0], [-stiffness, -2.0 * p["zeta"]]])) @ M
    return np.asarray(np.linalg.eigvals(M))


@pytest.mark.parametrize(
    ("k", "zeta", "w", "apart"),
    guarding(
        [
            (10.0, 0.06, 2.02, 5.6e-3), (100.0, 0.03, 2.06, 1.8e-6), (1e3, 0.03, 2.03, 2.7e-8),
            (1e3, 0.06, 2.06, 1.0e-7), (1e4, 0.03, 2.03, 2.7e-10), (1e4, 0.06, 2.06, 1.0e-9),
        ],
        (1e4, 0.03, 2.03, 2.7e-10),
    ),
)  # fmt: skip
def test_a_doubling_next_to_a_grazing_is_found_from_both_sides(k: float, zeta: float, w: float, apart: float) -> None:
    system, drive = on_a_spring(k, zeta, w)
    bounds = 0.5 * drive, 1.3 * drive
    up = saltus.continue_orbit(saltus.find_orbit(system, {"A": 0.9 * drive}, [0.0, 0.0]), "A", bounds)
    down = saltus.continue_orbit(up.solution(-1), "A", bounds)
    for branch in (up, down):
        assert [point.type for point in branch.special_points] == ["GR", "PD", "PD"]
        grazing, near, far = (point.value("A") / drive for point in branch.special_points)
        assert grazing == pytest.approx(1.0, abs=2e-12)
        assert near - grazing == pytest.approx(apart, rel=0.05)
        assert far == pytest.approx(up["PD2"].value("A") / drive, rel=1e-10)
        for point in branch.special_points.of_type("PD"):
            assert np.abs(piecewise_linear(point.orbit) + 1.0).min() < 1e-6
        for i in range(len(branch)):
            counted = int(np.sum(np.abs(piecewise_linear(branch.solution(i))) > 1.0))
            critical = np.abs(branch.values[i] / drive - [grazing, near, far]).min() < 1e-12
            assert critical or branch.stable[i] == (counted == 0)


def random_structure(seed: int) -> saltus.HybridSystem:
    """One to three modes of a structure beside a stop: linear, of Hertz, or linear with a damper."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(1, 4))
    rates, damping, shape = np.sort(rng.uniform(0.5, 4.0, count)), rng.uniform(0.01, 0.1, count), rng.normal(size=count)
    shape[0] = 1.0
    gap, speed = (" + ".join(f"{shape[i]:.5f}*{name}{i}" for i in range(count)) for name in "xv")
    free = {}
    for i in range(count):
        free[f"x{i}"] = f"v{i}"
        own = f"-{rates[i] ** 2:.6f}*x{i} - {2.0 * damping[i] * rates[i]:.6f}*v{i}"
        free[f"v{i}"] = f"{own} + {rng.normal():.4f}*A*cos(s)"
    stiffness, law = float(10.0 ** rng.uniform(-1.0, 3.0)), int(rng.integers(0, 3))
    depth = f"({gap} - 1)"
    push = (f"k*{depth}", f"k*{depth}**(3/2)", f"(k*{depth} + 0.1*({speed}))")[law]
    inside = free | {f"v{i}": f"{free[f'v{i}']} - {shape[i]:.5f}*{push}" for i in range(count)}
    return saltus.HybridSystem(
        tuple(free),
        {"A": 1.0, "w": float(rng.uniform(0.6, 4.0)), "k": stiffness},
        {"free": saltus.Mode(free), "in": saltus.Mode(inside)},
        [saltus.Transition("free", "in", f"{gap} - 1", 1), saltus.Transition("in", "free", f"{gap} - 1", -1)],
        phase=("s", "w"),
    )


@pytest.mark.parametrize("seed", guarding(range(60), campaign=4))
def test_random_structures_have_the_same_points_from_both_ends_and_at_other_steps(seed: int) -> None:
    system = random_structure(seed)
    rest = np.zeros(len(system.states))
    far = saltus.continue_orbit(saltus.find_orbit(system, {"A": 1e-3}, rest), "A", (1e-3, 1e3), stop_at="GR")
    drive = far["GR1"].value("A")
    bounds = 0.4 * drive, 1.6 * drive
    up = saltus.continue_orbit(saltus.find_orbit(system, {"A": 0.5 * drive}, rest), "A", bounds)
    others = [
        saltus.continue_orbit(up.solution(-1), "A", bounds, steps=steps)
        for steps in (saltus.StepControl(), saltus.StepControl(largest=0.02))
    ]
    known, *found = (sorted((p.value("A") / drive, p.type) for p in branch.special_points) for branch in (up, *others))
    for points in found:
        assert [kind for _, kind in points] == [kind for _, kind in known]
        assert [at for at, _ in points] == pytest.approx([at for at, _ in known], abs=1e-8)
