"""Branches of tapping mode with many modes of the cantilever, warm: points, processor time, special points.

``--modes 1 2 3 5`` chooses; ten modes take a minute or more.
"""

from __future__ import annotations

import argparse
import time

import numpy as np
from measure import machine

from saltus import continue_orbit, find_orbit
from saltus.afm import table1, tapping_mode

OMEGA = (0.95, 1.25)


def main() -> None:
    """Print the table of benchmarks/README.md."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--modes", type=int, nargs="+", default=[1, 2, 3, 5])
    parser.add_argument("--repeats", type=int, default=3)
    asked = parser.parse_args()
    print(machine())
    print("| modes | from rest, s | points | rejected | branch, s | a point, ms | special points |")
    print("|---|---|---|---|---|---|---|")
    for modes in asked.modes:
        system = tapping_mode(table1(), modes=modes, parameters={"D_rep": 60.0, "Omega": OMEGA[0]})
        find_orbit(system, x0=np.zeros(2 * modes))
        begun = time.process_time()
        orbit = find_orbit(system, x0=np.zeros(2 * modes))
        rest, times = time.process_time() - begun, []
        for _ in range(asked.repeats):
            begun = time.process_time()
            branch = continue_orbit(orbit, "Omega", OMEGA)
            times.append(time.process_time() - begun)
        least, count = min(times), len(branch)
        places = " ".join(f"{point.type} {point.parameters['Omega']:.10f}" for point in branch.special_points)
        print(
            f"| {modes} | {rest:.2f} | {count} | {len(branch.rejected)} | {least:.2f} | {1e3 * least / count:.1f} "
            f"| {places} |",
            flush=True,
        )


if __name__ == "__main__":
    main()
