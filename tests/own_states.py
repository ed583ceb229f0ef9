"""Systems whose modes have states of their own."""

import saltus
from saltus import Mode, Transition


def wall(**reset):
    """Return a driven mass and a wall that is a standard linear solid, whose inner state exists in contact alone."""
    force = "(k0*(x - d) + k1*(x - d - q))"
    free = {"x": "v", "v": "A*cos(theta) - x - c*v"}
    return saltus.HybridSystem(
        ("x", "v", "q"), {"A": 1.0, "c": 0.1, "d": 0.5, "k0": 10.0, "k1": 20.0, "tau": 0.1, "w": 1.2},
        {
            "free": Mode(free, states=("x", "v")),
            "contact": Mode({"x": "v", "v": f"{free['v']} - {force}", "q": "(x - d - q)/tau"}),
        },
        [
            Transition("free", "contact", "x - d", 1, reset or {"q": "0"}, name="touch", when="v"),
            Transition("contact", "free", force, -1, name="release"),
        ],
        phase=("theta", "w"), name="wall",
    )  # fmt: skip


def belt():
    """Return a mass on a belt whose velocity is no state while it sticks."""
    return saltus.HybridSystem(
        ("x", "v"), {"Fs": 1.0, "Fk": 0.5, "v0": 0.2},
        {"stick": Mode({"x": "v0"}, states=("x",)), "slip": Mode({"x": "v", "v": "Fk - x"})},
        [Transition("stick", "slip", "x - Fs", 1, {"v": "v0"}), Transition("slip", "stick", "v - v0", 1)],
        name="belt",
    )  # fmt: skip
