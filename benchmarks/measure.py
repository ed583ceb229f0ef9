"""Repeats and tables for the benchmarks: minimum and median over interleaved repeats."""

from __future__ import annotations

import platform
import statistics
import sys
import time
from collections.abc import Callable, Mapping, Sequence
from importlib.metadata import PackageNotFoundError, version
from typing import Any


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
