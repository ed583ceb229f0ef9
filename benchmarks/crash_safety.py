"""Processes killed at random moments of everything that writes files: is the old file or the new one whole, always?

Each kind of writing is ended by SIGKILL, SIGTERM and SIGINT at random moments. Then what stands there is read, a sweep
and a map go on from it, and what comes out is compared with that of one that nobody killed.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
from measure import machine

sys.path.insert(0, str(Path(__file__).parent.parent / "tests"))


def main() -> None:
    import killed

    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--moments", type=int, default=20, help="of each kind and signal")
    parser.add_argument("--longest", type=float, default=1.0, help="seconds until the last of them")
    parser.add_argument("--seed", type=int, default=1)
    options = parser.parse_args()
    print(machine(), f"{options.moments} moments, --longest {options.longest} --seed {options.seed}", sep="\n")
    print("| kind | signal | whole | longest way to the end | left a hidden file |\n|---|---|---|---|---|")
    random, troubles = np.random.default_rng(options.seed), []
    with tempfile.TemporaryDirectory() as folder:
        for name, made in killed.KINDS.items():
            kind = made()
            for sent in killed.SIGNALS:
                taken, left, whole = 0.0, 0, 0
                for after in random.uniform(0.0, options.longest, options.moments):
                    try:
                        seconds, hidden = killed.killed(kind, Path(folder) / "work", sent, float(after))
                    except Exception as error:
                        troubles.append(f"{name}, {sent} after {after:.4f} s: {type(error).__name__}: {error}")
                        continue
                    whole, taken, left = whole + 1, max(taken, seconds), left + bool(hidden)
                    if sent == "SIGINT" and (hidden or seconds > killed.WAITED):
                        troubles.append(f"{name}, {sent} after {after:.4f} s: {seconds:.1f} s, left {hidden}")
                print(f"| {name} | {sent} | {whole} of {options.moments} | {taken:.2f} s | {left} |", flush=True)
    print(*troubles, f"{len(troubles)} in trouble", sep="\n")
    raise SystemExit(bool(troubles))


if __name__ == "__main__":
    main()
