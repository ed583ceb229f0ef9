"""Random hybrid oscillators, and two of each that springs or resistors couple: in phase the pair is the one."""

from __future__ import annotations

import re
from dataclasses import dataclass

import numpy as np

from saltus import HybridSystem, Mode, Transition

Draw = np.random.Generator


@dataclass(frozen=True)
class Oscillator:
    """Texts of rates and hits (event, direction, reset), and the parameter that is varied, within an interval."""

    kind: str
    field: dict[str, str]
    hits: list[tuple[str, int, dict[str, str]]]
    parameters: dict[str, float]
    varied: str
    coupled: str  # the state whose difference drives the other oscillator
    driven: str  # the state whose rate it adds to
    start: tuple[float, ...]

    @property
    def bounds(self) -> tuple[float, float]:
        value = self.parameters[self.varied]
        return 0.85 * value, 1.25 * value

    def system(self, count: int = 1, coupling: float = 0.3) -> HybridSystem:
        """Return so many oscillators, each coupled with each."""
        states = re.compile(r"\b(" + "|".join(self.field) + r")\b")
        field, hits = {}, []
        for i in range(count):

            def own(text, i=i):
                return states.sub(lambda found: f"{found.group()}{i}", text)

            for x, rate in self.field.items():
                others = [f" - k*({self.coupled}{i} - {self.coupled}{j})" for j in range(count) if j != i]
                field[f"{x}{i}"] = own(rate) + ("".join(others) if x == self.driven else "")
            for n, (event, direction, reset) in enumerate(self.hits):
                jumps = {f"{x}{i}": own(text) for x, text in reset.items()}
                hits.append(Transition("m", "m", own(event), direction, jumps, name=f"hit{n}_{i}"))
        phase = ("th", "w") if "w" in self.parameters else None
        parameters = self.parameters | ({"k": coupling} if count > 1 else {})
        return HybridSystem(tuple(field), parameters, {"m": Mode(field)}, hits, phase=phase)


def _stop(draw: Draw) -> Oscillator:
    p = {"A": draw.uniform(0.6, 1.2), "w": draw.uniform(1.2, 1.7), "e": draw.uniform(0.5, 0.9)}
    d = draw.uniform(0.3, 0.6)
    field = {"x": "v", "v": "A*cos(th) - x - 0.1*v"}
    return Oscillator("stop", field, [(f"x - {d!r}", 1, {"v": "-e*v"})], p, "w", "x", "v", (0.0, 0.0))


def _hardening(draw: Draw) -> Oscillator:
    p = {"A": draw.uniform(0.5, 1.0), "w": draw.uniform(1.2, 2.0), "e": draw.uniform(0.4, 0.9)}
    b, d = draw.uniform(0.2, 1.5), draw.uniform(0.2, 0.5)
    field = {"x": "v", "v": f"A*cos(th) - x - {b!r}*x**3 - 0.15*v"}
    return Oscillator("hardening", field, [(f"x + {d!r}", -1, {"v": "-e*v"})], p, "w", "v", "v", (0.0, 0.0))


def _two_stops(draw: Draw) -> Oscillator:
    p = {"A": draw.uniform(0.8, 1.5), "w": draw.uniform(0.9, 1.6), "e": draw.uniform(0.4, 0.8)}
    low, high = draw.uniform(0.3, 0.8, 2).tolist()
    field = {"x": "v", "v": "A*cos(th) - 0.5*x - 0.2*v"}
    hits = [(f"x - {high!r}", 1, {"v": "-e*v"}), (f"x + {low!r}", -1, {"v": "-e*v"})]
    return Oscillator("two stops", field, hits, p, "w", "x", "v", (0.0, 0.0))


def _pendulum(draw: Draw) -> Oscillator:
    p = {"A": draw.uniform(0.3, 0.8), "w": draw.uniform(0.6, 1.4), "e": draw.uniform(0.4, 0.8)}
    d = draw.uniform(-0.3, 0.5)
    field = {"x": "v", "v": "A*cos(th) - sin(x) - 0.2*v"}
    return Oscillator("pendulum", field, [(f"x - {d!r}", 1, {"v": "-e*v"})], p, "w", "x", "v", (d - 0.5, 0.0))


def _neuron(draw: Draw) -> Oscillator:
    """A quadratic one that adapts."""
    a, b, d = draw.uniform(0.03, 0.2), draw.uniform(0.1, 0.5), draw.uniform(0.1, 0.6)
    back = draw.uniform(-0.5, 1.0)
    field = {"V": "V**2 - u + J", "u": f"{a!r}*({b!r}*V - u)"}
    hits = [("V - 5", 1, {"V": repr(back), "u": f"u + {d!r}"})]
    return Oscillator("neuron", field, hits, {"J": draw.uniform(2.0, 5.0)}, "J", "V", "V", (0.0, 0.0))


def _resonator(draw: Draw) -> Oscillator:
    """A linear neuron with a slow current."""
    g, a, d = draw.uniform(0.5, 1.5), draw.uniform(0.1, 0.5), draw.uniform(0.05, 0.3)
    field = {"V": f"J - {g!r}*V - u", "u": f"{a!r}*(0.5*V - u)"}
    hits = [("V - 1", 1, {"V": "0", "u": f"u + {d!r}"})]
    return Oscillator("resonator", field, hits, {"J": draw.uniform(3.0, 6.0)}, "J", "V", "V", (0.1, 0.0))


KINDS = (_stop, _hardening, _two_stops, _pendulum, _neuron, _resonator)


def drawn(seed: int) -> Oscillator:
    """Return a random oscillator; kinds take turns."""
    return KINDS[seed % len(KINDS)](np.random.default_rng(seed))
