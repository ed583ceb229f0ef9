"""Run pytest for rooms of the lower floors, for those of the upper ones, then for all else.

Compiled code stays in a process, and one worker for all would need 2 GiB. The arguments are those of pytest, the same
for all runs. The exit status is the first that is neither success nor "no test selected", which is fine in some of
them. Bytecode is written, whatever PYTHONDONTWRITEBYTECODE says: without it each process compiles all modules and tests
anew, 45 s of the processor a process.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

ROOMS = (
    {"algebraic", "continuation", "equilibria", "flow", "maps", "orbits", "system"},
    {"afm", "basins", "ensemble", "fitting", "optimisation", "sweeps", "verification"},
)
TESTS = Path(__file__).resolve().parents[1] / "tests"
NOTHING_SELECTED = 5


def main(arguments: list[str]) -> int:
    """Run all, and return the exit status."""
    rooms = {path.name for path in TESTS.iterdir() if path.is_dir() or path.name.startswith("test_")}
    grouped = set().union(*ROOMS)
    if unknown := grouped - rooms:
        raise SystemExit(f"tools/run_tests.py: no rooms in tests/: {', '.join(sorted(unknown))}")
    surroundings = {**os.environ, "PYTHONDONTWRITEBYTECODE": ""}
    parts = [(rooms - group, ["--ignore-glob=src/*"]) for group in ROOMS]
    statuses = []
    for left_out, more in [*parts, (grouped, [])]:
        ignored = [f"--ignore=tests/{room}" for room in sorted(left_out)]
        try:
            command = [sys.executable, "-m", "pytest", *ignored, *more, *arguments]
            statuses.append(subprocess.call(command, cwd=TESTS.parent, env=surroundings))
        except KeyboardInterrupt:
            return 130
    failed = [status for status in statuses if status not in (0, NOTHING_SELECTED)]
    return failed[0] if failed else min(statuses)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
