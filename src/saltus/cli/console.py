"""What the commands print: tables, bars, durations and sizes as people read them."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

__all__ = [
    "FAILED",
    "INTERRUPTED",
    "add_row",
    "bar",
    "cell",
    "duration_text",
    "interruptible",
    "new_table",
    "printable",
    "show",
    "size",
    "size_text",
    "status",
]

FAILED, INTERRUPTED = 2, 130
"""Exit codes: an error told in a line; an interrupt."""

_TABLE_WIDTH = 80
_LONG = ("signature", "value")
"""Columns whose text may go on in the next line, so that numbers beside them are never cut."""


@contextmanager
def interruptible() -> Iterator[None]:
    """Leave with its exit code where an interrupt comes before there is a result."""
    try:
        yield
    except KeyboardInterrupt:
        typer.echo("saltus: interrupted before there was anything to keep", err=True)
        raise SystemExit(INTERRUPTED) from None


@contextmanager
def status() -> Iterator[Callable[[str], None] | None]:
    """Show the line that is said last, with a spinner; nothing where stdout is no terminal."""
    if not (sys.stdout is not None and sys.stdout.isatty()):
        yield None
        return
    from rich.console import Console

    with Console().status("starting") as line:
        yield lambda text: line.update(cell(text))


def show(table: Table) -> None:
    """Print a table, at least 80 columns wide."""
    from rich.console import Console

    console = Console(highlight=False)
    console.width = max(console.width, _TABLE_WIDTH)
    console.print(table)


@contextmanager
def bar(first: str = "starting") -> Iterator[Callable[[int, int, float, float], None] | None]:
    """Show a bar with orbits a second and the time left; nothing where stdout is no terminal."""
    if not (sys.stdout is not None and sys.stdout.isatty()):
        yield None
        return
    from rich.progress import BarColumn, Progress, TextColumn

    with Progress(BarColumn(), TextColumn("{task.percentage:5.1f} %  {task.fields[told]}")) as bar:
        task = bar.add_task("", total=None, told=first)

        def show(done: int, total: int, rate: float, left: float) -> None:
            bar.update(task, completed=done, total=total, told=f"{rate:,.0f} orbits/s  {duration_text(left)} left")

        yield show


def add_row(table: Table, *texts: str) -> None:
    """Add a row of texts as they are: names may come from a file, and hold markup or the codes of a terminal."""
    table.add_row(*map(cell, texts))


def cell(text: str) -> Text:
    """Return a text as a cell of a table, without markup."""
    from rich.text import Text

    return Text(printable(text))


def printable(text: str) -> str:
    """Return a text with its control characters, line ends excepted, as backslash escapes."""
    return "".join(x if x.isprintable() or x == "\n" else x.encode("unicode_escape").decode() for x in text)


def duration_text(seconds: float) -> str:
    """Return a time in two units at most."""
    if seconds < 59.5:
        return f"{seconds:.2g} s"
    if seconds < 599.5:
        return f"{round(seconds) // 60} min {round(seconds) % 60} s"
    minutes = round(seconds / 60.0)
    if minutes < 60:
        return f"{minutes} min"
    if minutes < 24 * 60:
        return f"{minutes // 60} h {minutes % 60} min"
    return f"{minutes // 1440} d {minutes % 1440 // 60} h"


def size_text(count: float) -> str:
    """Return an amount of data with its unit."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000.0:
            return f"{count:.3g} {unit}"
        count /= 1000.0
    return f"{count:.3g} TB"


def size(store: Path) -> int:
    """Return the bytes of all files in a folder."""
    return sum(path.stat().st_size for path in store.rglob("*") if path.is_file())


def new_table(columns: Mapping[str, Literal["left", "right"]]) -> Table:
    """Return an empty table with these columns and their alignments."""
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name, justify in columns.items():
        table.add_column(name, justify=justify, no_wrap=name not in _LONG, overflow="fold")
    return table
