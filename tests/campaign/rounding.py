"""Branches, loci and cascades have the same points and words with several kernels of OpenBLAS, starts and steps.

`make campaign` runs it: a process per kernel, and in each every variant of each subject. OPENBLAS_CORETYPE chooses the
kernel before NumPy is imported, so one process cannot compare two.
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
SAME = 1e-8  # difference of a special point's parameter, over its size, that is allowed
WORDED = 1e-5  # the same of numbers in words, which are rounded
MISSING: dict[str, Any] = {"points": [], "words": ["not computed"]}
PERIOD = re.compile(r" \(T = [^)]*\)")  # of the last cycle before a homoclinic orbit: it depends on the steps
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?")


def measured() -> dict[str, dict[str, Any]]:
    """Return special points and last words of all variants of all subjects, with this process's kernel."""
    from campaign.subjects import SUBJECTS, VARIANTS

    return {
        variant.name: dict(found for subject in SUBJECTS for found in subject(variant)) for variant in VARIANTS
    }  # fmt: skip


def differences(one: dict[str, Any], other: dict[str, Any], *, periods: bool = True) -> list[str]:
    """Return what differs between the points and words of two runs; without `periods` those in words may differ."""
    kinds, other_kinds = ([point[0] for point in run["points"]] for run in (one, other))
    if kinds != other_kinds:
        return [f"special points {one['points']} and {other['points']}"]
    told = [
        f"{kind} at {place!r} and {there!r}"
        for (kind, *place), (_, *there) in zip(one["points"], other["points"], strict=True)
        if not all(abs(a - b) <= SAME * max(1.0, abs(a)) for a, b in zip(place, there, strict=True))
    ]
    texts, other_texts = (" | ".join(run["words"]) for run in (one, other))
    if not periods:
        texts, other_texts = (PERIOD.sub("", text) for text in (texts, other_texts))
    numbers, other_numbers = (list(map(float, NUMBER.findall(text))) for text in (texts, other_texts))
    same = NUMBER.sub("", texts) == NUMBER.sub("", other_texts) and all(
        abs(a - b) <= WORDED * max(1.0, abs(a)) for a, b in zip(numbers, other_numbers, strict=True)
    )
    return told if same else [*told, f"words {texts!r} and {other_texts!r}"]


def runs_here(kernel: str) -> bool:
    """Whether this processor has the instructions of a kernel; without them the first product kills a process."""
    code = "import numpy as np; np.linalg.eigvals(np.outer(range(60), range(60)) % 7.0)"
    surroundings = {**os.environ, "OPENBLAS_CORETYPE": kernel}
    return subprocess.run([sys.executable, "-c", code], env=surroundings, check=False).returncode == 0


def run_with(kernel: str) -> dict[str, dict[str, Any]]:
    """Return what a process with another kernel measures."""
    surroundings = {**os.environ, "OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"}
    surroundings["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    surroundings["PYTHONDONTWRITEBYTECODE"] = ""  # without bytecode each process compiles all modules anew
    command = [sys.executable, __file__, "measure"]
    done = subprocess.run(command, env=surroundings, stdout=subprocess.PIPE, text=True, check=True)
    return dict(json.loads(done.stdout))


def main() -> int:
    """Compare all runs with the first one; return 1 where any differs."""
    kernels = [kernel for kernel in KERNELS if runs_here(kernel)]
    for kernel in set(KERNELS).difference(kernels):
        print(f"{kernel}: left out, this processor lacks its instructions")
    if not kernels:
        print("no kernel of OpenBLAS runs here")
        return 1
    with ThreadPoolExecutor(2) as pool:
        runs = dict(zip(kernels, pool.map(run_with, kernels), strict=True))
    failed = 0
    reference = runs[kernels[0]]["plain"]
    for kernel, variants in runs.items():
        for variant, found in variants.items():
            same_steps = variant in ("plain", "start moved by 1e-13")
            for name in reference.keys() | found.keys():
                pair = reference.get(name, MISSING), found.get(name, MISSING)
                for difference in differences(*pair, periods=same_steps):
                    failed += 1
                    print(f"{kernel}, {variant}, {name}: {difference}")
    count = sum(map(len, runs[kernels[0]].values()))
    print(f"{count} branches, loci and cascades with {', '.join(kernels)}: {failed} differences")
    return int(failed > 0)


if __name__ == "__main__":
    if sys.argv[1:] == ["measure"]:
        json.dump(measured(), sys.stdout)
    else:
        sys.exit(main())
