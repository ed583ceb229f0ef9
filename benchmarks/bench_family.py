"""A family of 50 branches in this process, and in two: started for the call, and at rest from the one before."""

from __future__ import annotations

import time

import numpy as np
from measure import machine
from peers import tapping_orbit

from saltus import continue_family, processes

YBAR = np.linspace(0.09, 0.13, 50)


def main() -> None:
    """Print the table."""
    print(machine())
    orbit = tapping_orbit()

    def seconds(workers: int) -> float:
        begin = time.perf_counter()
        continue_family(orbit, "Omega", {"ybar": YBAR}, (0.8, 1.4), workers=workers)
        return time.perf_counter() - begin

    seconds(1)
    print("one process, two that start, two that rest, in seconds; the gains over one")
    for _ in range(3):
        processes.resting.end()
        one, started, rested = seconds(1), seconds(2), seconds(2)
        print(f"  {one:.1f}, {started:.1f}, {rested:.1f}; {one / started:.2f}, {one / rested:.2f}", flush=True)


if __name__ == "__main__":
    main()
