"""Branches, loci and cascades have the same points and words with several kernels of OpenBLAS, starts and steps.

`make campaign` runs every variant of each subject with the first kernel, and with the others the plain one. `make
thorough` adds `--all`: every variant with every kernel. OPENBLAS_CORETYPE chooses the kernel before NumPy is imported,
so one process cannot compare two.
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
EACH = 2  # variants of a process: halves of one kernel's then keep two processors busy
MISSING: dict[str, Any] = {"points": [], "words": ["not computed"]}
PERIOD = re.compile(r" \(T = [^)]*\)")  # of the last cycle before a homoclinic orbit: it depends on the steps
NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?")


def measured(places: list[int]) -> dict[str, dict[str, Any]]:
    """Return special points and last words of some variants of all subjects, with this process's kernel."""
    from campaign.subjects import SUBJECTS, VARIANTS

    chosen = [VARIANTS[place] for place in places]
    return {variant.name: dict(found for subject in SUBJECTS for found in subject(variant)) for variant in chosen}


def tasks(kernels: list[str], *, every: bool) -> list[tuple[str, list[int]]]:
    """Return kernels with the places of variants, one for each process: of the first kernel all, of others one or all.

    Examples
    --------
    >>> tasks(["one", "other"], every=False)
    [('one', [0, 1]), ('one', [2, 3]), ('other', [0])]
    """
    from campaign.subjects import VARIANTS

    found = []
    for kernel in kernels:
        places = list(range(len(VARIANTS))) if every or kernel == kernels[0] else [0]
        found += [(kernel, places[i : i + EACH]) for i in range(0, len(places), EACH)]
    return found


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


def run_with(kernel: str, places: list[int]) -> dict[str, dict[str, Any]]:
    """Return what a process with another kernel measures of some variants."""
    surroundings = {**os.environ, "OPENBLAS_CORETYPE": kernel, "OPENBLAS_NUM_THREADS": "1"}
    surroundings["PYTHONPATH"] = os.pathsep.join([str(Path(__file__).parents[1]), os.environ.get("PYTHONPATH", "")])
    surroundings["PYTHONDONTWRITEBYTECODE"] = ""  # without bytecode each process compiles all modules anew
    command = [sys.executable, __file__, "measure", *map(str, places)]
    done = subprocess.run(command, env=surroundings, stdout=subprocess.PIPE, text=True, check=True)
    return dict(json.loads(done.stdout.splitlines()[-1]))  # LAPACK may have told of matrices without values before


def main(*, every: bool) -> int:
    """Compare all runs with the first one; return 1 where any differs."""
    sys.path.insert(0, str(Path(__file__).parents[1]))
    kernels = [kernel for kernel in KERNELS if runs_here(kernel)]
    for kernel in set(KERNELS).difference(kernels):
        print(f"{kernel}: left out, this processor lacks its instructions")
    if not kernels:
        print("no kernel of OpenBLAS runs here")
        return 1
    wanted = tasks(kernels, every=every)
    with ThreadPoolExecutor(2) as pool:
        runs = list(zip(wanted, pool.map(run_with, *zip(*wanted, strict=True)), strict=True))
    failed = 0
    reference = runs[0][1]["plain"]
    for (kernel, _), variants in runs:
        for variant, found in variants.items():
            same_steps = variant in ("plain", "start moved by 1e-13")
            for name in reference.keys() | found.keys():
                pair = reference.get(name, MISSING), found.get(name, MISSING)
                for difference in differences(*pair, periods=same_steps):
                    failed += 1
                    print(f"{kernel}, {variant}, {name}: {difference}")
    count = sum(len(found) for (kernel, _), variants in runs if kernel == kernels[0] for found in variants.values())
    print(f"{count} branches, loci and cascades with {', '.join(kernels)}: {failed} differences")
    return int(failed > 0)


if __name__ == "__main__":
    if sys.argv[1:2] == ["measure"]:
        json.dump(measured([int(place) for place in sys.argv[2:]]), sys.stdout)
    else:
        sys.exit(main(every=sys.argv[1:] == ["--all"]))
