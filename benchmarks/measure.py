"""Repeats and tables for the benchmarks: minimum and median over interleaved repeats, and their history."""

from __future__ import annotations

import csv
import datetime
import os
import platform
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

COLUMNS = (
    *("date", "commit", "machine", "versions", "benchmark", "quantity", "min_s", "median_s", "peer"),
    *("ratio", "load"),
)
"""Columns of the history: times in s, how many times faster than the peer in the same run, waiting processes."""


def interleaved(works: Mapping[str, Callable[[], Any]], repeats: int) -> dict[str, list[float]]:
    """Seconds of each work, in rounds, so that a slow minute of the machine meets all of them alike."""
    for work in works.values():
        work()
    seconds: dict[str, list[float]] = {name: [] for name in works}
    for _ in range(repeats):
        for name, work in works.items():
            begin = time.perf_counter()
            work()
            seconds[name].append(time.perf_counter() - begin)
    return seconds


def show(
    title: str, seconds: Mapping[str, Sequence[float]], peers: Mapping[str, str], notes: Mapping[str, str]
) -> None:
    """Print a table: minimum, median, how many times faster than the peer (by minima), and a note for each row."""
    print(f"\n{title}")
    wide = max(map(len, seconds))
    print(f"  {'':{wide}}  {'min':>10}  {'median':>10}  {'times faster than its peer':<26}  note")
    for name, values in seconds.items():
        peer = peers.get(name, "")
        ratio = f"{min(seconds[peer]) / min(values):.1f} ({peer})" if peer in seconds else ""
        note = notes.get(name, "")
        print(f"  {name:{wide}}  {_time(min(values)):>10}  {_time(statistics.median(values)):>10}  {ratio:<26}  {note}")
    if "BENCH_HISTORY" in os.environ:
        record(Path(os.environ["BENCH_HISTORY"]), title, seconds, peers)


def record(
    history: Path, title: str, seconds: Mapping[str, Sequence[float]], peers: Mapping[str, str], commit: str = ""
) -> None:
    """Append a table to the history, a row for each quantity; `commit` is that of this checkout if left out."""
    known = history.exists()
    load = f"{os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    run = (datetime.datetime.now(datetime.UTC).date().isoformat(), commit or _commit(), processor(), machine())
    with history.open("a", newline="", encoding="utf-8") as file:
        rows = csv.writer(file, lineterminator="\n")
        if not known:
            rows.writerow(COLUMNS)
        for name, values in seconds.items():
            peer = peers.get(name, "")
            ratio = f"{min(seconds[peer]) / min(values):.3g}" if peer in seconds else ""
            times = (f"{min(values):.4g}", f"{statistics.median(values):.4g}")
            rows.writerow([*run, title, name, *times, peer if ratio else "", ratio, load])


def processor() -> str:
    """Processor and number of cores."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
        name = next(line.partition(":")[2].strip() for line in lines if line.startswith("model name"))
    except (OSError, StopIteration):  # not Linux
        name = platform.processor() or platform.machine()
    return f"{name}, {os.cpu_count()} cores"


def _commit() -> str:
    """Return the commit of the checkout, with a plus sign where files differ from it."""
    folder = Path(__file__).parent
    told = [
        subprocess.run(["git", *command], cwd=folder, capture_output=True, text=True, check=False).stdout.strip()
        for command in (("rev-parse", "--short", "HEAD"), ("status", "--porcelain", "--untracked-files=no", "../src"))
    ]
    return f"{told[0] or 'unknown'}{'+' if told[1] else ''}"


def machine() -> str:
    """Processor, interpreter and versions, in one line."""
    names = ("saltus", "numba", "numpy", "scipy", "sympy", "heyoka")
    found = []
    for name in names:
        try:
            found.append(f"{name} {version(name)}")
        except PackageNotFoundError:
            found.append(f"{name} absent")
    return f"{platform.machine()}, Python {sys.version.split()[0]}, {', '.join(found)}"


def _time(seconds: float) -> str:
    for factor, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "us")):
        if seconds * factor >= 1.0:
            return f"{seconds * factor:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"
