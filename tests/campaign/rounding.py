"""Branches of textbook systems with several kernels of OpenBLAS and with moved starts have the same points and words.

`make campaign` runs it: a process per kernel, and in each every branch twice, the second time from a start moved by
1e-13 of its size. OPENBLAS_CORETYPE chooses the kernel before NumPy is imported, so one process cannot compare two.
"""

from __future__ import annotations

import json
import os
import re
import subprocess
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

KERNELS = ("Prescott", "Haswell", "SkylakeX")
MOVES = (0.0, 1e-13)
CYCLES = (
    "Brusselator",
    "FitzHugh-Nagumo",
    "Rosenzweig-MacArthur",
    "Holling-Tanner",
    "Sel'kov",
    "Bogdanov-Takens normal form",
    "Morris-Lecar, Hopf",
)
SAME = 1e-8  # difference of a special point's parameter, over its size, that is allowed
WORDED = 1e-5  # the same of numbers in words, which are rounded
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?")


def measured() -> dict[str, dict[str, Any]]:
    """Return special points and last words of all branches, with this process's kernel."""
    from oracles.textbook import TEXTBOOK
    from saltus import HybridSystem, continue_equilibrium, continue_orbit, find_equilibrium, switch_branch

    found = {}
    for item in TEXTBOOK.values():
        system = HybridSystem.smooth(item.field, item.parameters, name=item.name)
        for moved in MOVES:
            start = [x * (1.0 + moved) for x in item.start]
            rest = find_equilibrium(system, {item.parameter: item.value * (1.0 + moved)}, start)
            branches = {"equilibria": continue_equilibrium(rest, item.parameter, item.bounds)}
            if item.name in CYCLES:
                cycles = switch_branch(branches["equilibria"]["HB1"])
                branches["cycles"] = continue_orbit(cycles, item.parameter, item.bounds)
            for kind, branch in branches.items():
                points = [[point.label, point.parameters[item.parameter]] for point in branch.special_points]
                found[f"{item.name}, {kind}, moved by {moved:g}"] = {"points": points, "words": list(branch.stopped)}
    return found


def differences(one: dict[str, Any], other: dict[str, Any]) -> list[str]:
    """Return what differs between the points and words of two runs of one branch."""
    labels, other_labels = ([label for label, _ in run["points"]] for run in (one, other))
    if labels != other_labels:
        return [f"special points {labels} and {other_labels}"]
    told = [
        f"{label} at {value!r} and {there!r}"
        for (label, value), (_, there) in zip(one["points"], other["points"], strict=True)
        if not abs(value - there) <= SAME * max(1.0, abs(value))
    ]
    texts, other_texts = " | ".join(one["words"]), " | ".join(other["words"])
    numbers, other_numbers = (list(map(float, NUMBER.findall(text))) for text in (texts, other_texts))
    same = NUMBER.sub("", texts) == NUMBER.sub("", other_texts) and all(
        abs(a - b) <= WORDED * max(1.0, abs(a)) for a, b in zip(numbers, other_numbers, strict=True)
    )
    return told if same else [*told, f"words {texts!r} and {other_texts!r}"]


def run_with(kernel: str) -> dict[str, dict[str, Any]]:
    """Return what a process with another kernel measures."""
    surroundings = {**os.environ, "OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"}
    surroundings["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    command = [sys.executable, __file__, "measure"]
    done = subprocess.run(command, env=surroundings, stdout=subprocess.PIPE, text=True, check=True)
    return dict(json.loads(done.stdout))


def main() -> int:
    """Compare all runs with the first one; return 1 where any differs."""
    with ThreadPoolExecutor(2) as pool:
        runs = dict(zip(KERNELS, pool.map(run_with, KERNELS), strict=True))
    failed = 0
    reference = runs[KERNELS[0]]
    for kernel, found in runs.items():
        for name, result in found.items():
            like = f"{name.rpartition(', moved')[0]}, moved by {MOVES[0]:g}"
            for difference in differences(reference[like], result):
                failed += 1
                print(f"{kernel}, {name}: {difference}")
    print(f"{len(reference)} branches with {', '.join(KERNELS)}: {failed} differences")
    return int(failed > 0)


if __name__ == "__main__":
    if sys.argv[1:] == ["measure"]:
        json.dump(measured(), sys.stdout)
    else:
        sys.exit(main())
