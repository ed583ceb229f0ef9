"""Random Filippov systems with one surface, as `saltus.filippov` and as the oracle take them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy

import saltus
from oracles.filippov import Filippov

RATE = 1.1  # of the phase


@dataclass(frozen=True)
class Drawn:
    """Texts of a random system, with the parameter ``b`` in its fields, and a start off the surface."""

    seed: int
    states: tuple[str, ...]
    surface: str
    above: dict[str, str]
    below: dict[str, str]
    forced: bool
    x0: np.ndarray
    """Full state, the phase included."""

    def system(self, b: float = 0.0) -> saltus.HybridSystem:
        """Return the system."""
        phase = ("theta", "w") if self.forced else None
        return saltus.filippov(
            self.states, {"b": b, "w": RATE}, surface=self.surface, above=self.above, below=self.below, phase=phase
        )

    def oracle(self, b: float = 0.0) -> Filippov:
        """Return the same for the oracle."""
        names = (*self.states, *(("theta",) if self.forced else ()))
        x = sympy.symbols(names)
        known = {**dict(zip(names, x, strict=True)), "b": sympy.Float(b)}
        height = sympy.sympify(self.surface, known)
        fields = []
        for texts in (self.above, self.below):
            rates = [sympy.sympify(texts[name], known) for name in self.states]
            fields.append(_vector(x, [*rates, *((sympy.Float(RATE),) if self.forced else ())]))
        return Filippov(*fields, sympy.lambdify([x], height, "math"), _vector(x, [height.diff(s) for s in x]))

    def __str__(self) -> str:
        return (
            f"saltus.filippov({self.states}, {{'b': 0.0, 'w': {RATE}}}, surface={self.surface!r},\n    "
            f"above={self.above},\n    below={self.below},\n    phase={('theta', 'w') if self.forced else None})"
            f"  # seed {self.seed}, x0 = {self.x0.tolist()}"
        )


def _vector(x: Any, parts: list[Any]) -> Any:
    found = sympy.lambdify([x], parts, "math")
    return lambda at: np.array(found(at), dtype=float)


def drawn(seed: int) -> Drawn:
    """Return the random system of a seed."""
    rng = np.random.default_rng(seed)
    count, forced = int(rng.integers(2, 4)), bool(rng.integers(2))
    states = ("x", "y", "z")[:count]
    cubic, mild = bool(rng.integers(2)), rng.uniform(0.3, 0.8)
    shared = rng.normal(size=(count, count))
    fields = []
    own = bool(rng.integers(2))  # whether each side has a matrix of its own
    for _ in range(2):
        matrix = rng.normal(size=(count, count)) if own else shared
        if not cubic:  # linear fields that contract
            matrix = matrix - (np.max(np.linalg.eigvals(matrix).real) + mild) * np.eye(count)
        offset = rng.uniform(-2.0, 2.0, size=count)
        field = {}
        for i, name in enumerate(states):
            terms = [f"{matrix[i, j]:+.3f}*{other}" for j, other in enumerate(states)]
            if cubic:
                terms += [f"{rng.uniform(-0.3, 0.3):+.3f}*{states[rng.integers(count)]}*{states[rng.integers(count)]}"]
                terms += [f"-{rng.uniform(0.2, 0.6):.3f}*{name}**3"]
            field[name] = "".join([*terms, f"{offset[i]:+.3f}"])
        fields.append(field)
    fields[0]["x"] += " + b"
    if forced:
        push = rng.normal(scale=1.5, size=count)
        for field in fields:
            for name, size in zip(states, push, strict=True):
                field[name] += f"{size:+.3f}*cos(theta)"
    normal = rng.normal(size=count)
    normal /= np.linalg.norm(normal)
    level = rng.uniform(-0.4, 0.4)
    surface = "".join(f"{part:+.3f}*{name}" for part, name in zip(normal, states, strict=True)) + f"{level:+.3f}"
    kind = rng.integers(6)
    if kind == 0:
        surface = "x"
    elif kind == 1:
        surface += f"{rng.uniform(-0.3, 0.3):+.3f}*{states[rng.integers(count)]}**2"
    elif kind == 2:
        surface = "x**2 + y**2 - 1"
    elif kind == 3:
        surface += f"+0.4*sin({states[-1]})"
    if forced and rng.integers(3) == 0:
        surface += f"{rng.uniform(-0.5, 0.5):+.3f}*cos(theta)"
    if rng.integers(4):  # both fields push towards the surface
        at = sympy.lambdify([sympy.symbols(("x", "y", "z", "theta"))], sympy.sympify(surface), "math")
        push = rng.uniform(0.5, 3.0, size=2)
        gradient = [at((*np.eye(3)[i], 0.0)) - at((0.0, 0.0, 0.0, 0.0)) for i in range(count)]
        for field, size in zip(fields, (-push[0], push[1]), strict=True):
            for name, part in zip(states, gradient, strict=True):
                field[name] += f"{size * part:+.3f}"
    x0 = np.append(rng.uniform(-1.5, 1.5, size=count), [0.0] * forced)
    return Drawn(seed, states, surface, *fields, forced, x0)
