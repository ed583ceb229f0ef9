"""The command ``saltus``: parse, call, print. What is heavy is imported inside the commands."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from saltus.errors import InputError, SaltusError

if TYPE_CHECKING:
    from rich.table import Table

__all__ = ["main"]

_FAILED, _INTERRUPTED = 2, 130
_TABLE_WIDTH = 80
_LONG = ("signature", "value")
"""Columns whose text may go on in the next line, so that numbers beside them are never cut."""

app = typer.Typer(
    name="saltus",
    help="Dynamics of hybrid systems: periodic orbits, their continuation and bifurcations.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main(args: list[str] | None = None) -> None:
    """Run the command with `args` (by default those of the process) and leave with its exit code.

    0: done; 2: an error, told in a line on stderr; 130: interrupted.
    """
    try:
        app(args=args, prog_name="saltus")
    except SaltusError as error:
        _fail(str(error))
    except OSError as error:
        _fail(f"{error.filename}: {error.strerror}" if error.filename else str(error))


def _fail(text: str) -> None:
    typer.echo("saltus: " + " ".join(text.split()), err=True)
    raise SystemExit(_FAILED)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        typer.echo(f"saltus {version('saltus')}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    del version  # its callback has done the work


@app.command(no_args_is_help=True)
def reproduce(
    figure: Annotated[str, typer.Argument(help="Name of the figure, or 'list' to see them all.")],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for what is computed; made if absent.")
    ] = Path("results"),
) -> None:
    """Compute a figure of the paper, with its data and special points."""
    from saltus.afm.figures import FIGURES, runner

    if figure == "list":
        for name, line in FIGURES.items():
            typer.echo(f"{name}  {line}")
        return
    run = runner(figure)
    folder = _writable_folder(out)
    try:
        with _status() as say:
            found = run(folder, say)
    except KeyboardInterrupt:
        typer.echo("saltus: interrupted before there was anything to keep", err=True)
        raise SystemExit(_INTERRUPTED) from None
    _report(found)
    if found["interrupted"]:
        raise SystemExit(_INTERRUPTED)


def _writable_folder(out: Path) -> Path:
    """Return the folder, made if it was absent; raise `InputError` where nothing can be written."""
    there = next((path for path in (out, *out.absolute().parents) if path.exists()), Path("/"))
    if not there.is_dir():
        raise InputError("--out", str(out), "a folder", f"{there} is a file")
    if not os.access(there, os.W_OK | os.X_OK):
        raise InputError("--out", str(out), "a folder that can be written", f"{there} is read-only for this user")
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise InputError("--out", str(out), "a folder that can be written", error.strerror or str(error)) from None
    return out


@contextmanager
def _status() -> Iterator[Callable[[str], None] | None]:
    """Show the line that is said last, with a spinner; nothing where stdout is no terminal."""
    if not (sys.stdout is not None and sys.stdout.isatty()):
        yield None
        return
    from rich.console import Console

    with Console().status("starting") as status:
        yield status.update


def _report(found: dict[str, Any]) -> None:
    """Print the special points, or the numbers that the figure stands for, and which files were written."""
    content = found["content"]
    table = _special_points(content["special_points"]) if "special_points" in content else _numbers(content)
    if table.row_count:
        from rich.console import Console

        console = Console(highlight=False)
        console.width = max(console.width, _TABLE_WIDTH)
        console.print(table)
    if found["interrupted"]:
        typer.echo("saltus: interrupted; kept", err=True)
        for result in found["results"].values():
            typer.echo(f"  {repr(result).splitlines()[0]}", err=True)
    for path in found["files"]:
        typer.echo(f"{'kept' if found['interrupted'] else 'written'}  {path}")


def _special_points(points: list[dict[str, Any]]) -> Table:
    """Return the special points of a branch as a table."""
    table = _table({"type": "left", "Omega": "right", "min z": "right", "signature": "left", "admissible": "left"})
    for point in points:
        path = " ".join(":".join(pair) for pair in point["signature"])
        admissible = "yes" if point["admissible"] else "no"
        table.add_row(point["type"], f"{point['omega']:.10f}", f"{point['min_z']:.9f}", path, admissible)
    return table


def _numbers(content: dict[str, Any]) -> Table:
    """Return the numbers in the content of a figure without special points, a row for those that belong together."""
    table = _table({"what": "left", "value": "left"})
    for name, value in content.items():
        numbers = value if isinstance(value, dict) else {"": value}
        written = [f"{key} = {x:.10g}".removeprefix(" = ") for key, x in numbers.items() if isinstance(x, int | float)]
        if name != "parameters" and written:
            table.add_row(name, ", ".join(written))
    return table


def _table(columns: Mapping[str, Literal["left", "right"]]) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name, justify in columns.items():
        table.add_column(name, justify=justify, no_wrap=name not in _LONG, overflow="fold")
    return table
