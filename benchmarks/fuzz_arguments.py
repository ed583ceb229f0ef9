"""How often a public function called with arguments of wrong kinds answers with anything but a result or one line.

Calls are drawn at random: a function or method, one to three of its arguments replaced by what may be far from what it
takes. What leaks (an error that is not saltus' own), is accepted in silence although no argument takes it, hangs, says
more than 300 characters, or does not survive pickling, is listed.
"""

from __future__ import annotations

import argparse
import os
import resource
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

os.environ.setdefault("MPLBACKEND", "Agg")

from measure import machine

import fuzzing

MEMORY = 6 * 2**30
"""Bytes of memory that the calls may take."""


def main() -> int:
    """Draw calls, make them, print what came of them; the exit status is 1 where one is not good."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--calls", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", default="", help="names that hold this text")
    given = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    from matplotlib import pyplot

    bad: list[fuzzing.Tried] = []
    ends: Counter[str] = Counter()
    slow: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        made = fuzzing.objects()
        listed = fuzzing.calls(made, Path(folder)) | fuzzing.lengthy_calls(made, Path(folder))
        listed = {name: call for name, call in listed.items() if given.only in name}
        refused = [name for name, call in listed.items() if fuzzing.tried(name, call, {}).ended != "returned"]
        begin = time.perf_counter()
        for name, call, replaced in fuzzing.drawn(listed, given.calls, given.seed):
            start = time.perf_counter()
            found = fuzzing.tried(name, call, replaced)
            pyplot.close("all")
            slow[name] = max(slow[name], time.perf_counter() - start)
            ends[found.ended] += 1
            if not found.good:
                bad.append(found)
        took = time.perf_counter() - begin
        os.chdir("/")
    print(machine())
    print(f"{given.calls} calls of {len(listed)} functions and methods in {took:.0f} s, seed {given.seed}")
    print(f"refused as they are: {', '.join(refused)}")
    for ended, count in ends.most_common():
        print(f"  {count:5d} {ended}")
    for found in sorted(bad, key=lambda found: (found.ended, found.said)):
        print(f"  {found.ended}: {found.name}({found.replaced}): {found.said}")
    print("slowest:", ", ".join(f"{name} {seconds:.1f} s" for name, seconds in slow.most_common(5)))
    return 1 if bad else 0


if __name__ == "__main__":
    sys.exit(main())
