"""Systems with known answers, used by tests of every floor; `conftest` offers each as a fixture."""

from __future__ import annotations

import numpy as np

from saltus.flow.event_logs import events_after
from saltus.system.hybrid import HybridSystem, Mode, Transition

# the n = 1 and n = 2 coefficients of the paper's Table 1
K = (1.0, 39.2739482)
B = (1.56598351, -0.86787179)
C = -2.35038841e-6
G = 247.16423658
A0 = 1.0 / 300.0


def afm(n: int = 1) -> HybridSystem:
    """Return the tapping cantilever with `n` modes (1 or 2), in the coefficients of the paper's Table 1."""
    indices = range(1, n + 1)
    states = tuple(f"q{i}" for i in indices) + tuple(f"v{i}" for i in indices)
    z = "1 - " + " - ".join(f"q{i}" for i in indices) + " - ybar*sin(theta)"
    forces = {"flight": f"C/({z})**2", "contact": f"C/a0**2 + G*(a0 - ({z}))**(3/2)"}
    dampings = {"flight": "D_att", "contact": "D_rep"}
    modes = {}
    for mode, force in forces.items():
        field = {f"q{i}": f"v{i}" for i in indices}
        for i in indices:
            drive = f"B{i}*Omega**2*ybar*sin(theta)"
            field[f"v{i}"] = f"-{dampings[mode]}*v{i} - K{i}*q{i} + C - ({force}) + {drive}"
        modes[mode] = Mode(field, domain=z if mode == "flight" else None)
    parameters = {"Omega": 1.0, "ybar": 0.108, "D_att": 0.025, "D_rep": 4.0, "C": C, "G": G, "a0": A0}
    parameters |= {f"K{i}": K[i - 1] for i in indices} | {f"B{i}": B[i - 1] for i in indices}
    return HybridSystem(
        states,
        parameters,
        modes,
        [
            Transition("flight", "contact", f"{z} - a0", -1, name="landing"),
            Transition("contact", "flight", f"{z} - a0", 1, name="liftoff"),
        ],
        phase=("theta", "Omega"),
        outputs={"z": z},
        name=f"tapping cantilever, n = {n}",
    )


def ball() -> HybridSystem:
    """Return a ball on a fixed floor."""
    return HybridSystem(
        ("z", "v"),
        {"g": 1.0, "e": 0.5},
        {"flight": Mode({"z": "v", "v": "-g"})},
        [Transition("flight", "flight", "z", -1, {"v": "-e*v"}, name="impact")],
        outputs={"energy": "v**2/2 + g*z"},
        positive=("g",),
        name="bouncing ball",
    )


def ball_on_table() -> HybridSystem:
    """Return a ball on a table at a sin(theta), height above the table's rest."""
    return HybridSystem(
        ("z", "v"),
        {"g": 1.0, "e": 0.5, "a": 1.1, "w": 1.0},
        {"flight": Mode({"z": "v", "v": "-g"})},
        [
            Transition(
                "flight",
                "flight",
                "z - a*sin(theta)",
                -1,
                {"v": "-e*v + (1 + e)*a*w*cos(theta)"},
                name="impact",
            )
        ],
        phase=("theta", "w"),
        name="ball on a table",
    )


def impact_oscillator() -> HybridSystem:
    """Return the linear forced oscillator with a stop at x = d."""
    return HybridSystem(
        ("x", "v"),
        {"k": 1.0, "c": 0.1, "d": 1.0, "e": 0.8, "w": 1.0, "A": 1.0},
        {"free": Mode({"x": "v", "v": "-k*x - c*v + A*cos(theta)"})},
        [Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="impact")],
        phase=("theta", "w"),
        name="impact oscillator",
    )


def duffing() -> HybridSystem:
    """Return a driven oscillator with a hardening spring; `A` and `g` enter only as a product."""
    return HybridSystem.smooth(
        {"x": "v", "v": "-c*v - k*x - b*x**3 + A*g*cos(s)"},
        {"k": 1.0, "c": 0.1, "b": 1.0, "A": 0.5, "g": 1.0, "w": 1.0},
        phase=("s", "w"),
        name="Duffing",
    )


def two_fields() -> HybridSystem:
    """Return two planar fields that meet at x1 = 0 (Recipes for Continuation, ex. 9.2)."""
    r = "sqrt(x1**2 + x2**2)"
    return HybridSystem(
        ("x1", "x2"),
        {"al": 1.0, "be": 2.0, "ga": 1.5},
        {
            "left": Mode({"x1": f"(1 - {r})*x1 - x2", "x2": f"x1 + (1 - {r})*x2"}),
            "right": Mode(
                {
                    "x1": f"al*(be - {r})*x1 - (ga + be - {r})*x2",
                    "x2": f"al*(be - {r})*x2 + (ga + be - {r})*x1",
                }
            ),
        },
        [
            Transition("left", "right", "x1", 1, name="to_right"),
            Transition("right", "left", "x1", -1, name="to_left"),
        ],
        name="two planar fields",
    )


def stick_slip() -> HybridSystem:
    """Return a block on a belt that sticks and slips."""
    return HybridSystem(
        ("x", "v"),
        {"Fs": 1.0, "Fk": 0.5, "v0": 0.3},
        {"slip": Mode({"x": "v", "v": "-x + Fk"}), "stick": Mode({"x": "v0", "v": "0"})},
        [
            Transition("slip", "stick", "v - v0", 1, {"v": "v0"}, name="catch"),
            Transition("stick", "slip", "x - Fs", 1, name="release"),
        ],
        name="block on a belt",
    )


def relay() -> HybridSystem:
    """Return relay feedback on 1/(s + 1)^3."""
    modes = {name: Mode({"x1": f"-x1 + ({u})", "x2": "x1 - x2", "y": "x2 - y"}) for name, u in _RELAY.items()}
    return HybridSystem(
        ("x1", "x2", "y"),
        {"gain": 1.0},
        modes,
        [
            Transition("up", "down", "y", 1, name="switch_down"),
            Transition("down", "up", "y", -1, name="switch_up"),
        ],
        name="relay feedback",
    )


_RELAY = {"down": "-gain", "up": "gain"}


def carried_map(states: tuple[str, ...], parameters: dict[str, float], image: dict[str, str]) -> HybridSystem:
    """Return the hybrid system whose Poincare map is `image`: states rest while a clock runs from 0 to 1."""
    return HybridSystem(
        (*states, "s"),
        parameters,
        {"carry": Mode(dict.fromkeys(states, "0") | {"s": "1"})},
        [Transition("carry", "carry", "s - 1", 1, image | {"s": "0"}, name="map")],
        name="carried map",
    )


def settle(system, p, x, mode, **how):
    """Return the full state and the index of the mode where a motion ends."""
    log = events_after(system, p, x, mode, **how)
    return np.array(log.x_end), log.mode_end
