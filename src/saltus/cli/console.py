"""Output of the commands: tables, progress bars, and readable sizes."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from saltus.progress import Report, shown

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

    from saltus.progress import Progress, Report

__all__ = [
    "FAILED",
    "INTERRUPTED",
    "add_row",
    "bar",
    "cell",
    "interruptible",
    "new_table",
    "printable",
    "show",
    "size",
    "size_text",
    "status",
]

FAILED = 2  # exit code of an error, which is told in a line
INTERRUPTED = 130  # exit code of an interrupt

_TABLE_WIDTH = 80  # columns of a table, at least
_LONG = ("signature", "value")  # columns whose text may wrap, so that numbers beside them are never cut


@contextmanager
def interruptible() -> Iterator[None]:
    """Exit with code `INTERRUPTED` at an interrupt before there is a result."""
    try:
        yield
    except KeyboardInterrupt:
        typer.echo("saltus: interrupted before there was anything to keep", err=True)
        raise SystemExit(INTERRUPTED) from None


@contextmanager
def status(first: str = "starting") -> Iterator[bool | Report]:
    """Show the latest progress in one line, `first` before any; nothing where stdout is no terminal."""
    if not (sys.stdout is not None and sys.stdout.isatty()):
        yield False
        return
    from rich.console import Console

    with Console().status(first) as line:
        yield lambda progress: line.update(cell(_line(progress)))


def _line(progress: Progress) -> str:
    """Return the count that is done, where there is a count, and the latest report's text."""
    done = f"{progress.done:,}" if progress.done else ""
    if progress.total is not None:
        done = f"{progress.done:,} of {progress.total:,}"
    return "  ".join(part for part in (done, progress.text) if part)


def show(table: Table) -> None:
    """Print a table, at least 80 columns wide."""
    from rich.console import Console

    console = Console(highlight=False)
    console.width = max(console.width, _TABLE_WIDTH)
    console.print(table)


@contextmanager
def bar(first: str = "starting") -> Iterator[Report | Literal[False]]:
    """Show a bar with the share that is done and the time left; nothing where stderr is no terminal.

    Parameters
    ----------
    first : str, optional
        Text before the first report.
    """
    if not (sys.stderr is not None and sys.stderr.isatty()):
        yield False
        return
    with shown(first) as report:
        yield report


def add_row(table: Table, *texts: str) -> None:
    """Add a row of texts without markup or terminal codes, which names from a file may hold."""
    table.add_row(*map(cell, texts))


def cell(text: str) -> Text:
    """Return a text as a cell of a table, without markup."""
    from rich.text import Text

    return Text(printable(text))


def printable(text: str) -> str:
    """Return a text with its control characters, line ends excepted, as backslash escapes."""
    return "".join(x if x.isprintable() or x == "\n" else x.encode("unicode_escape").decode() for x in text)


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
