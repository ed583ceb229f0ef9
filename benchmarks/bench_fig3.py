"""Fig. 3 of the paper: its impacting branch with five folds, the whole of it, and what a process pays to start."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from measure import interleaved, machine, show
from peers import tapping_orbit

import saltus

AUTO = 0.061
"""Seconds, on another day, of AUTO-07p for the impacting branch with its five folds: 69 points, no multipliers."""

FIRST_USE = (
    "import saltus; from saltus import afm; "
    "saltus.find_orbit(afm.tapping_mode(afm.table1()), {'Omega': 1.05}, [-0.67, 0.75])"
)


def main() -> None:
    """Print the tables."""
    print(machine())
    branches()
    processes()


def branches() -> None:
    """Time the branches, and show what is on them."""
    orbit = tapping_orbit()
    works = {
        "impacting branch": lambda: saltus.continue_orbit(orbit, "Omega", (0.8, 1.4), stop_at="GR"),
        "whole of Fig. 3": lambda: saltus.continue_orbit(orbit, "Omega", (0.8, 1.4)),
    }
    notes = {}
    for name, work in works.items():
        branch = work()
        labels = [point.type for point in branch.special_points]
        found = ", ".join(f"{labels.count(kind)} {kind}" for kind in dict.fromkeys(labels))
        notes[name] = f"{len(branch)} orbits with multipliers, {found}, {len(branch.rejected)} steps rejected"
    seconds = interleaved(works, 15)
    show("branches in a process under way", seconds, {}, notes)
    ratio = AUTO / min(seconds["impacting branch"])
    print(f"  impacting branch against AUTO-07p's recorded {AUTO * 1e3:.0f} ms: {ratio:.2f} times faster")


def processes() -> None:
    """Time whole processes: with warm caches, then with empty ones."""
    seconds = {
        "import saltus": [_process("import saltus") for _ in range(7)],
        "the same without it": [_process("pass") for _ in range(7)],
    }
    _process(FIRST_USE)
    seconds["first orbit, caches warm"] = [_process(FIRST_USE) for _ in range(3)]
    with tempfile.TemporaryDirectory() as folder:
        empty = {"SALTUS_CACHE_DIR": f"{folder}/saltus", "NUMBA_CACHE_DIR": f"{folder}/numba"}
        if importlib.util.find_spec("saltus.cli") is None:
            seconds["first orbit, caches empty"] = [_process(FIRST_USE, **empty)]
        else:
            figure = "import sys; from saltus.cli import main; sys.argv[0] = 'saltus'; main()"
            arguments = ("reproduce", "fig3", "-o", f"{folder}/results")
            seconds["saltus reproduce fig3, caches empty"] = [_process(figure, *arguments, **empty)]
            seconds["saltus reproduce fig3, caches warm"] = [_process(figure, *arguments, **empty) for _ in range(3)]
    show("processes from start to end", seconds, {}, {})


def _process(code: str, *arguments: str, **environment: str) -> float:
    home = Path(saltus.__file__).parent.parent
    path = os.pathsep.join([str(home), *filter(None, [os.environ.get("PYTHONPATH")])])
    begin = time.perf_counter()
    subprocess.run(
        [sys.executable, "-c", code, *arguments],
        check=True, stdout=subprocess.DEVNULL, env={**os.environ, "PYTHONPATH": path, **environment},
    )  # fmt: skip
    return time.perf_counter() - begin


if __name__ == "__main__":
    main()
