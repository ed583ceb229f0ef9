"""Random approaches to walls: how many motions end beyond one, and how many come to rest without a word.

Walls at 0 and away from it, at rest and moving, flat and curved; restitution from 0 to 1, heights from 1e-12 to 1,
forced bodies and free ones, units of length and of time from 1e-9 to 1e6. Truth: none is ever beyond.

    python benchmarks/random_approaches.py --count 100000
"""

from __future__ import annotations

import argparse
from collections import Counter
from collections.abc import Iterator, Mapping

import numpy as np

from saltus import HybridSystem, Mode, Transition, simulate
from saltus.errors import ChatteringError
from saltus.options import SimulationOptions

PARAMETERS = {"g": 1.0, "e": 0.5, "d": 0.0, "a": 0.0, "c": 0.0, "f": 0.0, "w": 1.0}
UNITS = (0.0, 0.0, 0.0, -9.0, -6.0, 3.0, 6.0)  # powers of ten
RATE = "(v - c*x*u - a*w*cos(th))"


def body_above_a_wall(direction: int = -1) -> HybridSystem:
    """A body above the wall y = d + c x^2/2 + a sin(th), with restitution e along the wall's normal, and a force."""
    wall = Transition(
        "flight",
        "flight",
        "y - d - c*x**2/2 - a*sin(th)",
        direction,
        {"u": f"u + (1 + e)*{RATE}*c*x/(1 + (c*x)**2)", "v": f"v - (1 + e)*{RATE}/(1 + (c*x)**2)"},
        name="impact",
    )
    field = {"x": "u", "y": "v", "u": "f*cos(th)", "v": "-g + f*sin(2*th)"}
    return HybridSystem(("x", "y", "u", "v"), PARAMETERS, {"flight": Mode(field)}, [wall], phase=("th", "w"))


def gap(p: Mapping[str, float], x: np.ndarray) -> np.ndarray:
    """Height of a body over the wall below it."""
    return x[..., 1] - p["d"] - p["c"] * x[..., 0] ** 2 / 2 - p["a"] * np.sin(x[..., 4])


def approaches(count: int, seed: int) -> Iterator[tuple[dict[str, float], list[float], float, float]]:
    """Parameters, start, time to follow and unit of length of random approaches."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        length, time = 10.0 ** rng.choice(UNITS, 2)
        while length / time > 1e9:  # a speed of 1e12 would be a divergence
            length, time = 10.0 ** rng.choice(UNITS, 2)
        p = {
            "g": rng.uniform(0.5, 2.0),
            "e": float(rng.choice([0.0, 1.0, rng.uniform(0.0, 1.0), rng.uniform(0.0, 0.1)], p=[0.2, 0.1, 0.4, 0.3])),
            "d": float(rng.choice([0.0, 1.0, rng.uniform(-3.0, 3.0), 1000.0])),
            "a": float(rng.choice([0.0, rng.uniform(0.0, 0.9), rng.uniform(0.9, 3.0)], p=[0.4, 0.4, 0.2])),
            "c": float(rng.choice([0.0, rng.uniform(-1.0, 1.0)])),
            "f": float(rng.choice([0.0, rng.uniform(0.0, 1.0)])),
            "w": rng.uniform(0.5, 2.0),
        }
        x, th = rng.uniform(-1.0, 1.0), rng.uniform(0.0, 6.28)
        height = 0.0 if rng.random() < 0.1 else 10.0 ** rng.uniform(-12.0, 0.0)
        moving = rng.random() < 0.5
        u = rng.uniform(-1.0, 1.0) if moving else 0.0
        along = p["c"] * x * u + p["a"] * p["w"] * np.cos(th)
        v = along + (10.0 ** rng.uniform(-9.0, 0.3) * rng.choice([-1.0, 1.0]) if moving else 0.0)
        y = p["d"] + p["c"] * x**2 / 2 + p["a"] * np.sin(th) + height
        speed = length / time
        units = {"g": speed / time, "d": length, "a": length, "c": 1.0 / length, "f": speed / time, "w": 1.0 / time}
        p = {name: value * units.get(name, 1.0) for name, value in p.items()}
        yield p, [x * length, y * length, u * speed, v * speed, th], 20.0 * time, length


def outcome(system: HybridSystem, p: dict[str, float], x0: list[float], t_end: float, unit: float) -> str:
    """``told``, ``above`` or ``beyond``: what became of an approach, by its gaps at 60 times."""
    start = gap(p, np.array(x0))
    rounding = 1e-9 * (unit + abs(p["d"]))
    try:
        motion = simulate(system, p, x0, t_end=t_end, options=SimulationOptions(max_events=2000))
    except ChatteringError as error:
        return "told" if gap(p, np.array(error.state)) > min(start, 0.0) - rounding else "beyond"
    lowest = gap(p, motion(np.linspace(0.0, motion.t_end, 60))).min()
    return "above" if lowest > min(start, 0.0) - rounding - 1e-6 * unit else "beyond"


def main() -> None:
    """Print what became of many approaches, and the first ten that went beyond."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100_000)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    system, found = body_above_a_wall(), Counter()
    for p, x0, t_end, unit in approaches(options.count, options.seed):
        became = outcome(system, p, x0, t_end, unit)
        found[became] += 1
        if became == "beyond" and found[became] <= 10:
            print(f"beyond: {p} {x0} {t_end}")
    print(f"{options.count} approaches: {dict(found)}")


if __name__ == "__main__":
    main()
