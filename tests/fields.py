"""Autonomous systems whose equilibria are known in closed form or to many digits, and the same in other coordinates."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from saltus.system.hybrid import HybridSystem, Mode, Transition

TURN = np.array([[0.6, -0.8], [0.8, 0.6]])  # a rotation of the plane
TURN3 = np.array([[2.0, -1.0, 2.0], [2.0, 2.0, -1.0], [-1.0, 2.0, 2.0]]) / 3.0  # and one of space

HOPF = {"x": "mu*x - w*y - x*(x**2 + y**2)", "y": "w*x + mu*y - y*(x**2 + y**2)"}
BAUTIN = {
    "x": "b1*x - y + b2*x*(x**2 + y**2) - x*(x**2 + y**2)**2",
    "y": "x + b1*y + b2*y*(x**2 + y**2) - y*(x**2 + y**2)**2",
}
TAKENS = {"x": "y", "y": "b1 + b2*x + x**2 - x*y"}
LORENZ = {"x": "sigma*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"}
BRUSSELATOR = {"x": "A - (B + 1)*x + x**2*y", "y": "B*x - x**2*y"}
BAZYKIN = {"x": "x - x*y/(1 + al*x) - 0.01*x**2", "y": "-y + x*y/(1 + al*x) - de*y**2"}


def system(field: Mapping[str, str], parameters: Mapping[str, float], name: str = "") -> HybridSystem:
    """Return a smooth system of one mode."""
    return HybridSystem(tuple(field), dict(parameters), {"flow": Mode(dict(field))}, name=name)


class Coordinates:
    """Coordinates X = M x + c of a field; M, its inverse and c are parameters, so that a field is compiled once."""

    def __init__(self, matrix: ArrayLike, shift: ArrayLike) -> None:
        self.matrix, self.shift = np.array(matrix, dtype=float), np.array(shift, dtype=float)
        self.inverse = np.linalg.inv(self.matrix)

    def system(self, field: Mapping[str, str], parameters: Mapping[str, float], name: str = "") -> HybridSystem:
        """Return the field in these coordinates, each state under its own name."""
        names = list(field)
        own: dict[str, float] = {}
        for i in range(len(names)):
            own |= {f"M{i}{j}": float(value) for j, value in enumerate(self.matrix[i])}
            own |= {f"W{i}{j}": float(value) for j, value in enumerate(self.inverse[i])}
            own[f"c{i}"] = float(self.shift[i])
        old = {
            name: "(" + " + ".join(f"W{i}{j}*({other} - c{j})" for j, other in enumerate(names)) + ")"
            for i, name in enumerate(names)
        }
        states = re.compile(r"\b(" + "|".join(names) + r")\b")
        texts = [states.sub(lambda found: old[found.group()], text) for text in field.values()]
        turned = {name: " + ".join(f"M{i}{j}*({text})" for j, text in enumerate(texts)) for i, name in enumerate(names)}
        return system(turned, dict(parameters) | own, name)

    def to(self, x: ArrayLike) -> NDArray[np.float64]:
        """Return the new coordinates of states, shape (..., n)."""
        return np.asarray(np.asarray(x) @ self.matrix.T + self.shift)

    def back(self, X: ArrayLike) -> NDArray[np.float64]:
        """Return the old coordinates of states, shape (..., n)."""
        return np.asarray((np.asarray(X) - self.shift) @ self.inverse.T)


SAME = Coordinates(np.eye(2), [0.0, 0.0])
TURNED = Coordinates(TURN, [1.7, -0.4])
PLANES = {
    "as printed": SAME,
    "rotated and shifted": TURNED,
    "nanometres": Coordinates(1e-9 * TURN, [2e-9, 1e-9]),
    "unlike units": Coordinates(np.diag([1e-9, 1e6]), [1e-9, -3e6]),
}  # coordinates of the plane


def lorenz() -> HybridSystem:
    """Return the Lorenz equations."""
    return system(LORENZ, {"sigma": 10.0, "r": 24.0, "b": 8.0 / 3.0}, "Lorenz")


def chua(**parameters: float) -> HybridSystem:
    """Return Chua's circuit with a bias d: inner, plus (x > 1) and minus (x < -1) regions, continuous."""
    rest = {"y": "x - y + z", "z": "-be*y"}
    fields = {
        "inner": "a*(y - x - m0*x + d)",
        "plus": "a*(y - x - m1*x - (m0 - m1) + d)",
        "minus": "a*(y - x - m1*x + (m0 - m1) + d)",
    }
    transitions = [
        Transition("inner", "plus", "x - 1", 1, name="up"),
        Transition("plus", "inner", "x - 1", -1, name="back"),
        Transition("inner", "minus", "x + 1", -1, name="down"),
        Transition("minus", "inner", "x + 1", 1, name="return"),
    ]
    values = {"a": 9.0, "be": 20.0, "m0": -8.0 / 7.0, "m1": -5.0 / 7.0, "d": 0.0} | parameters
    modes = {name: Mode({"x": text, **rest}) for name, text in fields.items()}
    return HybridSystem(("x", "y", "z"), values, modes, transitions, name="Chua")


def two_slopes() -> HybridSystem:
    """Return a focus that passes a switching line: x' = t x - y, y' = x - m, with t = tl for x < 0, tr for x > 0."""
    return HybridSystem(
        ("x", "y"),
        {"m": -0.5, "tl": -0.5, "tr": 0.2},
        {"left": Mode({"x": "tl*x - y", "y": "x - m"}), "right": Mode({"x": "tr*x - y", "y": "x - m"})},
        [
            Transition("left", "right", "x", 1, name="rightwards"),
            Transition("right", "left", "x", -1, name="leftwards"),
        ],
        name="two slopes",
    )


def places(points: Sequence, *names: str) -> list[tuple]:
    """Return type and parameters of special points."""
    return [(point.type, *(point.parameters[name] for name in names)) for point in points]
