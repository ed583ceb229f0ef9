"""Branches of equilibria per 200 points, and whole diagrams of four textbook systems, warm."""

from __future__ import annotations

from statistics import median
from time import perf_counter
from typing import TYPE_CHECKING

from measure import machine

import saltus

if TYPE_CHECKING:
    from collections.abc import Callable

REPEATS = 9
POINTS = 200
GATE = "(1 + tanh((V - {}) / {}))/2"


def smooth(field: dict[str, str], parameters: dict[str, float], name: str) -> saltus.HybridSystem:
    """Return a system of one smooth mode."""
    return saltus.HybridSystem.smooth(field, parameters=parameters, name=name)


def systems() -> dict[str, tuple[saltus.HybridSystem, str, tuple[float, float], list[float]]]:
    """Return each system with its parameter, bounds and a state near an equilibrium."""
    current = f"I0 - gL*(V - VL) - gCa*{GATE.format('V1', 'V2')}*(V - VCa) - gK*w*(V - VK)"
    gate = f"phi*({GATE.format('V3', 'V4')} - w)*cosh((V - V3)/(2*V4))"
    lecar = {"I0": 0.0, "gL": 2.0, "gCa": 4.4, "gK": 8.0, "VL": -60.0, "VCa": 120.0, "VK": -84.0}
    lecar |= {"V1": -1.2, "V2": 18.0, "V3": 2.0, "V4": 30.0, "phi": 0.04, "C": 20.0}
    return {
        "Lur'e": (
            smooth({"x": "y", "y": "z", "z": "-al*z - be*y - x + x**2"}, {"al": 1.2, "be": 1.0}, "Lur'e"),
            "al", (0.5, 1.5), [0.0, 0.0, 0.0],
        ),
        "Chua, cubic": (
            smooth({"x": "a*(y - x**3/16 + x/6)", "y": "x - y + z", "z": "-b*y"}, {"a": 2.0, "b": 14.0}, "Chua"),
            "a", (1.0, 8.0), [1.6, 0.0, -1.6],
        ),
        "FitzHugh-Nagumo": (
            smooth({"v": "v - v**3/3 - w + I0", "w": "tau*(v + a - b*w)"},
                   {"I0": 0.0, "a": 0.7, "b": 0.8, "tau": 0.08}, "FitzHugh-Nagumo"),
            "I0", (-1.0, 3.0), [-1.2, -0.6],
        ),
        "Morris-Lecar": (
            smooth({"V": f"({current})/C", "w": gate}, lecar, "Morris-Lecar"), "I0", (0.0, 300.0), [-60.0, 0.0],
        ),
    }  # fmt: skip


def timed(work: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Return least and median seconds of a piece of work, warm."""
    work()
    seconds = []
    for _ in range(repeats):
        start = perf_counter()
        work()
        seconds.append(perf_counter() - start)
    return min(seconds), median(seconds)


def main() -> None:
    """Print the tables."""
    print(machine())
    lorenz = smooth(
        {"x": "sigma*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"}, {"sigma": 10.0, "r": 24.0, "b": 8 / 3}, "Lorenz"
    )
    rest = saltus.find_equilibrium(lorenz, x0=[8.0, 8.0, 23.0])
    steps = saltus.StepControl(largest=0.008)

    def branch() -> saltus.results.EquilibriumBranch:
        return saltus.continue_equilibrium(rest, "r", (1.5, 30.0), steps=steps)

    per = 1e3 * POINTS / len(branch())
    least, middle = timed(branch, REPEATS)
    print(f"{POINTS} points of Lorenz' equilibria, HB located: {least * per:.1f} ms, median {middle * per:.1f} ms")
    for name, (system, parameter, bounds, x0) in systems().items():
        found = saltus.diagram(system, parameter, bounds, x0=x0)
        least, middle = timed(lambda given=(system, parameter, bounds, x0): saltus.diagram(*given[:3], x0=given[3]), 3)
        points = ", ".join(point.label for point in found.special_points)
        print(f"diagram of {name}: {least:.2f} s, median {middle:.2f} s; {len(found)} branches: {points}")


if __name__ == "__main__":
    main()
