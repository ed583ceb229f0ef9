"""Time and memory against modes, segments, points, cells, threads and workers.

Each row runs in a process of its own, so that the largest memory is the row's. Seconds are those of the processor, by
which rows can be compared on a machine with other work; the rows of threads and workers are by the clock.
"""

from __future__ import annotations

import argparse
import heapq
import json
import resource
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

import numpy as np
from basin_peers import tapping
from measure import machine

import saltus
from saltus import HybridSystem, Mode, Transition, afm
from saltus.afm.paper.figures import sections
from saltus.basins import Grid
from saltus.ensemble.ensemble import Ensemble

MODES = (1, 2, 3, 5)
SEGMENTS = (2, 4, 8, 16, 32, 64)
STEPS = (0.1, 0.01, 0.002)
CELLS = (50, 100, 200, 400)
THREADS = (1, 2)
WORKERS = (1, 8, 64, 512)
CHUNKS, MOTIONS = 48, 2000
"""Chunks of the four-dimensional box that are measured, and motions of each."""

BOX = 400
"""Cells along each coordinate of the box [-5, 5]^4."""

START = 2.0
"""Seconds until a worker has read what is compiled."""


def main() -> None:
    """Print the tables that the command line names; all by default."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("tables", nargs="*", help=f"of {', '.join(TABLES)}; all by default")
    parser.add_argument("--row", nargs=2, metavar=("TABLE", "VALUE"), help="one row, in this process, as JSON")
    options = parser.parse_args()
    if options.row:
        table, value = options.row
        print(json.dumps(TABLES[table][1](json.loads(value)) | {"memory, MiB": round(peak())}))
        return
    print(machine())
    for name in options.tables or TABLES:
        values, _ = TABLES[name]
        rows = [{name: value} | row(name, value) for value in values]
        print(f"\n| {' | '.join(rows[0])} |\n|{'---|' * len(rows[0])}")
        for found in rows:
            print(f"| {' | '.join(map(str, found.values()))} |")


def row(table: str, value: Any) -> dict[str, Any]:
    """Return a row, computed by a process of its own; a process before it compiles what the row needs."""
    command = [sys.executable, __file__, "--row", table, json.dumps(value)]
    subprocess.run(command, check=True, capture_output=True)
    return json.loads(subprocess.run(command, check=True, capture_output=True, text=True).stdout.splitlines()[-1])


def peak() -> float:
    """Return the largest memory of this process, in MiB."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def clocked(work: Callable[[], Any]) -> tuple[float, Any]:
    """Return the seconds of the processor that a work takes, and what it returns."""
    begin = time.process_time()
    found = work()
    return time.process_time() - begin, found


def rounded(seconds: float) -> float:
    """Return seconds with three digits."""
    return float(f"{seconds:.3g}")


def of_modes(modes: int) -> dict[str, Any]:
    """Follow the response of a cantilever of some modes to its excitation."""
    system = afm.tapping_mode(afm.table1(), modes=modes)
    parameters = {"Omega": 0.95, "D_att": 0.025, "D_rep": 60.0}
    orbit = saltus.find_orbit(system, parameters, [0.0] * 2 * modes, settle=2000)
    seconds, branch = clocked(lambda: saltus.continue_orbit(orbit, "Omega", (0.95, 1.25)))
    return {
        "states": 2 * modes,
        "points": len(branch),
        "special points": len(branch.special_points),
        "ms a point": rounded(1e3 * seconds / len(branch)),
    }


def switched(segments: int) -> HybridSystem:
    """Return a linear oscillator whose spring is switched at so many phases of its drive."""
    modes, transitions = {}, []
    for i in range(segments):
        modes[f"m{i}"] = Mode({"x": "v", "v": f"-{1.0 + 0.2 * (i % 2)}*x - 0.3*v + F*cos(theta)"})
        phase = 2.0 * np.pi * (i + 1) / (segments + 1)
        transitions.append(Transition(f"m{i}", f"m{(i + 1) % segments}", at_phase=phase, name=f"s{i}"))
    return HybridSystem(("x", "v"), {"F": 1.0, "w": 0.9}, modes, transitions, phase=("theta", "w"))


def of_segments(segments: int) -> dict[str, Any]:
    """Follow an orbit of many segments over the frequency of its drive."""
    orbit = saltus.find_orbit(switched(segments), {}, [0.0, 0.0])
    seconds, branch = clocked(lambda: saltus.continue_orbit(orbit, "w", (0.5, 2.0)))
    return {"points": len(branch), "ms a point": rounded(1e3 * seconds / len(branch))}


def of_points(largest: float) -> dict[str, Any]:
    """Follow a branch in ever smaller steps."""
    orbit = saltus.find_orbit(switched(2), {}, [0.0, 0.0])
    saltus.continue_orbit(orbit, "w", (0.5, 2.0))
    before = peak()
    control = saltus.StepControl(largest=largest, max_points=100_000)
    seconds, branch = clocked(lambda: saltus.continue_orbit(orbit, "w", (0.5, 2.0), steps=control))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "branch.nc"
        branch.save(file)
        size = file.stat().st_size
    points = len(branch)
    return {
        "points": points,
        "ms a point": rounded(1e3 * seconds / points),
        "kB a point": rounded(1024.0 * (peak() - before) / points),
        "kB a point in a file": rounded(size / 1024.0 / points),
    }


def of_cells(side: int) -> dict[str, Any]:
    """Label a plane of so many cells along each coordinate."""
    model = tapping(2)
    axes = {"q1": (-5.0, 5.0, side), "v1": (-5.0, 5.0, side), "q2": -0.0295, "v2": 0.4841}
    grid = Grid(model.system.states, axes)
    seconds, basins = clocked(lambda: saltus.map_basins(model.system, sections.PARAMETERS, grid, model.attractors))
    return {"cells": basins.grid.size, "us a cell": rounded(1e6 * seconds / basins.grid.size)}


def of_threads(threads: int) -> dict[str, Any]:
    """Follow motions of the box by some threads."""
    model = tapping(2)
    ensemble = model.ensemble(threads=threads)
    points = np.random.default_rng(1).uniform(-5.0, 5.0, (40_000, 4))
    ensemble.settle(points[:100], model.traps)
    begin = time.perf_counter()
    ensemble.settle(points, model.traps)
    return {"us a motion, by the clock": rounded(1e6 * (time.perf_counter() - begin) / len(points))}


def chunk_seconds(model: Any) -> list[float]:
    """Return the seconds of a motion in chunks of neighbouring cells, spread over the box."""
    ensemble: Ensemble = model.ensemble(threads=1)
    rng = np.random.default_rng(2)
    found = []
    for _ in range(CHUNKS):
        corner, side = rng.uniform(-5.0, 3.75, 4), 1.25
        points = rng.uniform(corner, corner + side, (MOTIONS, 4))
        ensemble.settle(points[:50], model.traps)
        seconds, _ = clocked(lambda points=points: ensemble.settle(points, model.traps))
        found.append(seconds / MOTIONS)
    return found


def scheduled(seconds: Iterable[float], workers: int) -> float:
    """Return when the last of some workers ends, each of which takes the next unit as soon as it is free."""
    free = [START] * workers
    for unit in seconds:
        heapq.heappush(free, heapq.heappop(free) + unit)
    return max(free)


def of_workers(workers: int) -> dict[str, Any]:
    """Hand out the units of the four-dimensional box to so many workers of one thread, by measured seconds a motion."""
    measured = np.array(chunk_seconds(tapping(2)))
    unit = 2**20
    count = BOX**4 // unit
    units = unit * np.random.default_rng(3).choice(measured, count)
    hours = scheduled(units, workers) / 3600.0
    return {
        "hours": rounded(hours),
        "of the ideal": f"{100.0 * units.sum() / 3600.0 / workers / hours:.1f} %",
        "us a motion, least to largest chunk": f"{1e6 * measured.min():.3g} to {1e6 * measured.max():.3g}",
    }


TABLES: dict[str, tuple[tuple[Any, ...], Callable[[Any], dict[str, Any]]]] = {
    "modes": (MODES, of_modes),
    "segments": (SEGMENTS, of_segments),
    "largest step": (STEPS, of_points),
    "cells along a coordinate": (CELLS, of_cells),
    "threads": (THREADS, of_threads),
    "workers": (WORKERS, of_workers),
}

if __name__ == "__main__":
    main()
