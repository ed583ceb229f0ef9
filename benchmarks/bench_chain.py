"""Chains of impacting masses: from the definition to the first orbit, and a point of a branch, with growing count.

Each count runs in a process of its own whose folder of generated code is empty; the package's own kernels are known.
Seconds are those of the processor, all threads together. `--counts` chooses how many masses, `--points` of the branch.
"""

from __future__ import annotations

import argparse
import itertools
import os
import resource
import subprocess
import sys
import tempfile
import time

from measure import machine

import saltus

PARTS = ("definition", "motion", "first orbit", "orbit again", "point of a branch", "MiB")


def main() -> None:
    """Print the table."""
    asked = argparse.ArgumentParser()
    asked.add_argument("--counts", type=int, nargs="+", default=[5, 10, 20, 40, 100])
    asked.add_argument("--points", type=int, default=10)
    asked.add_argument("--here", type=int, help=argparse.SUPPRESS)
    given = asked.parse_args()
    if given.here is not None:
        measure(given.here, given.points)
        return
    print(machine())
    print("masses  " + "  ".join(f"{part:>18}" for part in PARTS))
    for count in given.counts:
        with tempfile.TemporaryDirectory() as folder:
            command = [sys.executable, __file__, "--here", str(count), "--points", str(given.points)]
            ran = subprocess.run(
                command, env=os.environ | {"SALTUS_CACHE_DIR": folder}, capture_output=True, check=True
            )
        print(f"{count:>6}  " + "  ".join(f"{float(value):>18.3g}" for value in ran.stdout.split()))


def chain(count: int) -> saltus.HybridSystem:
    """Masses between two walls, coupled by springs; the first is driven and hits a wall."""
    field = {f"x{i}": f"v{i}" for i in range(count)}
    for i in range(count):
        left, right = (f"x{i - 1}" if i else "0"), (f"x{i + 1}" if i < count - 1 else "0")
        field[f"v{i}"] = f"k*({left} - x{i}) + k*({right} - x{i}) - c*v{i}" + (" + A*cos(s)" if i == 0 else "")
    impact = saltus.Transition("free", "free", "x0 - d", 1, {"v0": "-e*v0"}, name="impact")
    parameters = {"k": 1.0, "c": 0.3, "A": 0.8, "w": 0.7, "d": 0.4, "e": 0.8}
    return saltus.HybridSystem(tuple(field), parameters, {"free": saltus.Mode(field)}, [impact], phase=("s", "w"))


def measure(count: int, points: int) -> None:
    """Print the seconds of each part."""
    small = chain(1)  # reads the kernels
    saltus.simulate(small, {}, [0.0, 0.0], t_end=1.0)
    saltus.continue_orbit(saltus.find_orbit(small, {}, [0.0, 0.0]), "A", (0.79, 0.81))
    at, steps = [time.process_time()], saltus.StepControl(max_points=points)

    def ended() -> None:
        at.append(time.process_time())

    system, start = chain(count), [0.0] * (2 * count)
    ended()
    saltus.simulate(system, {}, start, t_end=100.0)
    ended()
    saltus.find_orbit(system, {}, start)
    ended()
    orbit = saltus.find_orbit(system, {}, start)
    ended()
    branch = saltus.continue_orbit(orbit, "A", (0.5, 1.2), steps=steps, directions="up")
    ended()
    seconds = [end - begin for begin, end in itertools.pairwise(at)]
    seconds[-1] /= len(branch)
    print(*seconds, resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024)


if __name__ == "__main__":
    main()
