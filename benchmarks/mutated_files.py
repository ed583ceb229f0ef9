"""What comes of files that are damaged or made to do harm: `saltus.load` of results, each with one thing changed in it.

A process of its own loads and uses each file, so that one that never ends, or ends the interpreter, is seen too.
"""

from __future__ import annotations

import argparse
import multiprocessing
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
from measure import machine

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))

LONGEST = 60.0
"""Seconds after which a file counts as one that hangs."""


def work(pipe: Any, folder: str) -> None:
    """Mutate, load and use, as often as asked for."""
    import warnings

    import mutated

    warnings.simplefilter("ignore")
    held = mutated.samples()
    pipe.send(list(held))
    path = Path(folder) / "mutated.nc"
    while (asked := pipe.recv()) is not None:
        name, seed = asked
        said = mutated.mutate(held[name], np.random.default_rng(seed), path)
        pipe.send(said)
        pipe.send(mutated.tried(path, held[name]))


class Worker:
    """A process that can be lost."""

    def __init__(self, folder: str) -> None:
        context = multiprocessing.get_context("spawn")
        self.pipe, theirs = context.Pipe()
        self.process = context.Process(target=work, args=(theirs, folder), daemon=True)
        self.process.start()
        theirs.close()
        self.names: list[str] = self.pipe.recv()

    def tried(self, name: str, seed: int) -> tuple[str, str]:
        """Return what was changed, and what came of it."""
        self.pipe.send((name, seed))
        said = "?"
        try:
            said = self.pipe.recv()
            return said, self.pipe.recv() if self.pipe.poll(LONGEST) else "hang"
        except EOFError:
            return said, "crash"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--files", type=int, default=1500)
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    print(machine(), f"{options.files} files, --seed {options.seed}", sep="\n")
    begun, counts, troubles = time.perf_counter(), {}, []
    with tempfile.TemporaryDirectory() as folder:
        worker = Worker(folder)
        for k in range(options.files):
            name, seed = worker.names[k % len(worker.names)], options.seed * 1_000_000 + k
            said, outcome = worker.tried(name, seed)
            kind = outcome.split(":")[0]
            counts.setdefault(name, Counter())[kind] += 1
            if kind not in ("told", "used", "told at use", "another system"):
                troubles.append(f"{name} {seed}: {said}: {outcome}")
                print(troubles[-1], flush=True)
            if kind in ("hang", "crash"):
                worker.process.kill()
                worker = Worker(folder)
        worker.pipe.send(None)
    total = sum(counts.values(), Counter())
    print("| result | " + " | ".join(total) + " |\n|---" * 1 + "|---" * len(total) + "|")
    for name, count in [*counts.items(), ("all", total)]:
        print(f"| {name} | " + " | ".join(str(count[kind]) for kind in total) + " |")
    print(f"{len(troubles)} in trouble, {time.perf_counter() - begun:.0f} s")
    raise SystemExit(bool(troubles))


if __name__ == "__main__":
    main()
