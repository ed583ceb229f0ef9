"""Output of the commands: tables, progress bars, and readable sizes."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import typer

from saltus.errors import InputError
from saltus.progress import Report, shown

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

    from saltus.progress import Progress, Report
    from saltus.result import Result

__all__ = [
    "FAILED",
    "INTERRUPTED",
    "MISFIT",
    "add_row",
    "bar",
    "cell",
    "checked_picture",
    "interruptible",
    "new_table",
    "printable",
    "show",
    "size",
    "size_text",
    "status",
    "writable_folder",
    "write_picture",
]

FAILED = 2  # exit code of an error, which is told in a line
MISFIT = 3  # exit code of a fit to data that nothing fits
INTERRUPTED = 130  # exit code of an interrupt

_TABLE_WIDTH = 80  # columns of a table, at least
_LONG = (
    "signature",
    "value",
    "title",
    "source",
)  # columns whose text may wrap, so that no number is cut


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


def writable_folder(out: Path, name: str = "--out") -> Path:
    """Return the folder, created and told if absent; raise `InputError` where nothing can be written."""
    there = next((path for path in (out, *out.absolute().parents) if path.exists()), Path("/"))
    if not there.is_dir():
        raise InputError(name, str(out), "a folder", f"{there} is a file")
    if not os.access(there, os.W_OK | os.X_OK):
        raise InputError(name, str(out), "a folder that can be written", f"{there} is read-only for this user")
    try:
        if not out.exists():
            out.mkdir(parents=True, exist_ok=True)
            typer.echo(f"folder   {printable(str(out))}")
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise InputError(name, str(out), "a folder that can be written", error.strerror or str(error)) from None
    return out


def checked_picture(picture: Path, option: str) -> Path:
    """Return the path of a picture; raise `InputError` where its kind is unknown or nothing can be written."""
    import matplotlib

    matplotlib.use("agg")
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    kinds = FigureCanvasAgg.filetypes
    if picture.suffix[1:].lower() not in kinds:
        raise InputError(option, str(picture), f"a picture: .{', .'.join(sorted(kinds))}")
    writable_folder(picture.parent, option)
    return picture


def write_picture(result: Result, picture: Path, option: str) -> None:
    """Draw a result into a file, whole: an interrupt or an error leaves the folder as it was."""
    from saltus.files import whole_file

    drawn = result.plot()
    ax = drawn[0] if isinstance(drawn, tuple) else drawn
    with whole_file(picture, option) as draft:
        ax.figure.savefig(draft)
