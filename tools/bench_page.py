"""Write docs/benchmarks_over_time.md from benchmarks/history.csv: python tools/bench_page.py."""

from __future__ import annotations

import csv
from pathlib import Path

ROOT = Path(__file__).parents[1]
HISTORY = ROOT / "benchmarks" / "history.csv"
PAGE = ROOT / "docs" / "benchmarks_over_time.md"
SHOWN = 6
"""Runs that the page shows, the newest ones."""

Row = dict[str, str]


def page(history: Path = HISTORY) -> str:
    """Return the text of the page: the runs, then a table for each benchmark with a column for each run."""
    with history.open(encoding="utf-8", newline="") as file:
        rows = [*csv.DictReader(file)]
    every = [*dict.fromkeys(_run(row) for row in rows)]
    runs = {run: number for number, run in enumerate(every, 1) if number > len(every) - SHOWN}
    lines = [
        "# Benchmarks over time",
        "",
        "`make bench` appends each measured quantity to `benchmarks/history.csv`, with date, commit and machine.",
        "`tools/bench_page.py` writes this page from it. A cell is the minimum over interleaved repeats.",
        "In brackets stands how many times faster it is than its peer in the same run.",
        "Machines differ: compare ratios before seconds. The load is how many processes wanted a core, at most.",
        "Above one, times and ratios of that run are those of a busy machine.",
        "Results with their reasons stand in the [benchmarks](../benchmarks/README.md).",
        "",
        "| run | date | commit | machine | versions | load |",
        "|---|---|---|---|---|---|",
        *(f"| {number} | {' | '.join(run)} | {_busiest(rows, run)} |" for run, number in runs.items()),
    ]
    for benchmark in dict.fromkeys(row["benchmark"] for row in rows if _run(row) in runs):
        here = [row for row in rows if row["benchmark"] == benchmark and _run(row) in runs]
        shown = [run for run in runs if any(_run(row) == run for row in here)]
        heads = "".join(f" run {runs[run]} |" for run in shown)
        lines += ["", f"## {_cell(benchmark)}", "", f"| quantity | peer |{heads}", f"|---|---|{'---|' * len(shown)}"]
        for quantity in dict.fromkeys(row["quantity"] for row in here):
            mine = {_run(row): row for row in here if row["quantity"] == quantity}
            peer = next((row["peer"] for row in mine.values() if row["peer"]), "")
            cells = (_told(mine[run]) if run in mine else "" for run in shown)
            lines.append(f"| {_cell(quantity)} | {_cell(peer)} | {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def _run(row: Row) -> tuple[str, ...]:
    return tuple(_cell(row[name]) for name in ("date", "commit", "machine", "versions"))


def _busiest(rows: list[Row], run: tuple[str, ...]) -> str:
    loads = [float(row["load"]) for row in rows if _run(row) == run and row["load"]]
    return f"{max(loads):.1f}" if loads else ""


def _told(row: Row) -> str:
    seconds = float(row["min_s"])
    factor, unit = next(((f, u) for f, u in ((1.0, "s"), (1e3, "ms"), (1e6, "us")) if seconds * f >= 1.0), (1e9, "ns"))
    return f"{seconds * factor:.3g} {unit}" + (f" ({float(row['ratio']):.3g})" if row["ratio"] else "")


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
