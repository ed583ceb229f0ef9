"""Textbook systems at tolerances from the finest to loose ones: for tests of several floors."""

from __future__ import annotations

import functools

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit
from saltus.continuation import Branch

TOLERANCES = (1e-12, 1e-10, 1e-8, 1e-6, 1e-5)


def roessler() -> HybridSystem:
    field = {"x": "-y - z", "y": "x + a*y", "z": "b + z*(x - c)"}
    return HybridSystem.smooth(field, {"a": 0.2, "b": 0.2, "c": 2.5}, name="Roessler")


def two_wells() -> HybridSystem:
    field = {"x": "v", "v": "A*cos(s) - 0.2*v + x - x**3"}
    return HybridSystem.smooth(field, {"A": 0.2, "w": 1.0}, phase=("s", "w"), name="Duffing")


def soft_stop() -> HybridSystem:
    """Return a driven oscillator beside a spring; its damping is 0.1 everywhere."""
    return HybridSystem(
        ("x", "v"), {"k": 20.0, "c": 0.1, "d": 0.5, "w": 0.9, "A": 0.3},
        {"free": Mode({"x": "v", "v": "A*cos(s) - c*v - x"}),
         "contact": Mode({"x": "v", "v": "A*cos(s) - c*v - x - k*(x - d)"})},
        [Transition("free", "contact", "x - d", 1), Transition("contact", "free", "x - d", -1)], phase=("s", "w"),
    )  # fmt: skip


def hard_stop() -> HybridSystem:
    return HybridSystem(
        ("x", "v"), {"c": 0.1, "d": 1.0, "e": 0.8, "w": 0.7, "A": 0.4},
        {"free": Mode({"x": "v", "v": "A*cos(s) - c*v - x"})},
        [Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="impact")], phase=("s", "w"),
    )  # fmt: skip


def ball() -> HybridSystem:
    return HybridSystem(
        ("z", "v"), {"g": 1.0, "e": 0.5, "a": 1.2, "w": 1.0}, {"flight": Mode({"z": "v", "v": "-g"})},
        [Transition("flight", "flight", "z - a*sin(q)", -1, {"v": "-e*v + (1+e)*a*w*cos(q)"}, name="hit")],
        phase=("q", "w"),
    )  # fmt: skip


def van_der_pol() -> HybridSystem:
    return HybridSystem.smooth({"x": "v", "v": "m*(1 - x**2)*v - x"}, {"m": 1.0})


def brusselator() -> HybridSystem:
    return HybridSystem.smooth({"x": "a - (b+1)*x + x**2*y", "y": "b*x - x**2*y"}, {"a": 1.0, "b": 2.5})


def lorenz() -> HybridSystem:
    field = {"x": "s*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"}
    return HybridSystem.smooth(field, {"s": 10.0, "r": 350.0, "b": 8.0 / 3.0})


def stick_slip() -> HybridSystem:
    """Return a mass on a belt whose friction falls with the speed of slip; it sticks until the spring pulls it off."""
    return HybridSystem(
        ("x", "v"), {"u": 0.5, "f": 1.0, "g": 0.4, "c": 0.05},
        {"slip": Mode({"x": "v", "v": "-x - c*v + f*(1 - g*(u - v))"}), "stick": Mode({"x": "u", "v": "0"})},
        [Transition("slip", "stick", "v - u", 1, {"v": "u"}), Transition("stick", "slip", "x - f + c*u", 1)],
    )  # fmt: skip


# name: system, start, parameter, interval
CASES = {
    "Roessler": (roessler, [3.0, 0.0, 0.1], "c", (2.0, 3.2)),
    "two wells": (two_wells, [1.0, 0.0], "A", (0.05, 0.3)),
    "soft stop": (soft_stop, [0.0, 0.0], "w", (0.6, 1.8)),
    "hard stop": (hard_stop, [0.0, 0.0], "A", (0.3, 1.2)),
    "ball": (ball, [0.6, 3.14], "a", (1.05, 2.0)),
    "van der Pol": (van_der_pol, [2.0, 0.0], "m", (0.1, 6.0)),
    "Brusselator": (brusselator, [1.0, 1.0], "b", (1.9, 4.0)),
    "Lorenz": (lorenz, [10.0, 20.0, 300.0], "r", (150.0, 400.0)),
    "stick-slip": (stick_slip, [0.0, 0.0], "u", (0.2, 2.0)),
}


@functools.cache
def system(name: str) -> HybridSystem:
    """Return the system of a case."""
    return CASES[name][0]()


@functools.cache
def branch(name: str, tolerance: float) -> Branch:
    """Return the branch of a case from the orbit that is found at its start."""
    _, x0, parameter, interval = CASES[name]
    return continue_orbit(find_orbit(system(name), x0=x0, tolerance=tolerance), parameter, interval)
