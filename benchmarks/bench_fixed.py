"""Orbits of which an extreme is fixed, branches and loci along one: processor time, minimum and median."""

from __future__ import annotations

import statistics
import sys
import time
from collections.abc import Callable

from measure import machine

import saltus

REPEATS = 5


def works() -> dict[str, Callable[[], object]]:
    """Return what is measured by name."""
    pendulum = saltus.HybridSystem.smooth({"x": "v", "v": "-sin(x)"})
    values = {"A": 0.3, "w": 1.2, "c": 0.1}
    duffing = saltus.HybridSystem.smooth({"x": "v", "v": "-c*v - x - x**3 + A*cos(s)"}, values, phase=("s", "w"))
    swing = saltus.solve_orbit(pendulum, x0=[0.5, 0.0], period=6.38, fix={"max_x": 0.5})
    driven = saltus.solve_orbit(duffing, x0=[0.5, 0.0])
    near = saltus.continue_orbit(driven, "A", (0.25, 0.35), events={"max_x": driven.max["x"]})
    label = next(point.label for point in near.special_points if point.type == "max_x")
    ranges = {"A": (0.2, 0.5), "w": (1.0, 1.4)}

    def refused() -> str:
        try:
            saltus.solve_orbit(pendulum, x0=[2.0, 0.0], period=9.0, fix={"max_x": 4.0})
        except saltus.ConvergenceError as error:
            return str(error)
        raise AssertionError

    return {
        "pendulum, `max_x = 4`: no orbit": refused,
        "pendulum, `max_x = 3` from a swing of 2": lambda: saltus.solve_orbit(
            pendulum, x0=[2.0, 0.0], period=8.3, fix={"max_x": 3.0}
        ),
        "pendulum, branch along `max_x` from 0.5 to 3": lambda: saltus.continue_orbit(swing, "max_x", (0.4, 3.0)),
        "Duffing, `max_x = 0.9` by `free='A'`": lambda: saltus.solve_orbit(
            duffing, x0=[0.5, 0.0], fix={"max_x": 0.9}, free="A"
        ),
        "Duffing, locus of equal `max_x` in A and w": lambda: saltus.continue_locus(near[label], ("A", "w"), ranges),
        "Duffing, branch with extrema of `max_x`": lambda: saltus.continue_orbit(
            driven, "w", (0.5, 2.5), events={"max_x": "extremum"}
        ),
    }


def main() -> None:
    """Print the table of benchmarks/README.md."""
    print(machine(), saltus.__file__)
    for name, work in works().items():
        if len(sys.argv) > 1 and sys.argv[1] not in name:
            continue
        work()
        times = []
        for _ in range(REPEATS):
            begin = time.process_time()
            work()
            times.append(time.process_time() - begin)
        print(f"| {name} | {1e3 * min(times):.0f} ms | {1e3 * statistics.median(times):.0f} ms |", flush=True)


if __name__ == "__main__":
    main()
