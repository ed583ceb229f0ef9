"""The command ``saltus``: parse arguments, call the package, print. Heavy modules are imported inside the commands."""

from __future__ import annotations

import sys
from collections.abc import Callable
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

from saltus.cli import afm, basins
from saltus.cli.console import (
    FAILED,
    INTERRUPTED,
    add_row,
    checked_picture,
    interruptible,
    new_table,
    printable,
    show,
    status,
    writable_folder,
    write_picture,
)
from saltus.errors import InputError, SaltusError
from saltus.version import __version__

if TYPE_CHECKING:
    from rich.table import Table


__all__ = ["main"]

# What arguments raise that cannot be parsed: Click's base of all such errors.
_Refused: type[Exception] = typer.BadParameter.__mro__[2]
_TOLD_ELSEWHERE = ("figure", "parameters")  # entries of a figure's content that the table of its numbers leaves out

app = typer.Typer(
    name="saltus",
    help="Dynamics of hybrid systems: periodic orbits, their continuation and bifurcations.",
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

app.add_typer(afm.group, name="afm", help="A probe over a sample: curves, observables, parameter sets.")
app.add_typer(basins.group, name="basins", help="Map basins of attraction into a store, or tell what is in one.")


def main(args: list[str] | None = None) -> None:
    """Run the command with `args` (by default those of the process) and leave with its exit code.

    Exit codes: 0 for success, 2 for an error with one line on stderr, 130 for an interrupt.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal may lack letters that names have
    try:
        code = app(args=args, prog_name="saltus", standalone_mode=False)
    except _Refused as error:
        _refuse(error)
    except SaltusError as error:
        _fail(str(error))
    except OSError as error:
        _fail(f"{error.filename}: {error.strerror}" if error.filename else str(error))
    raise SystemExit(code or 0)


def _refuse(error: Any) -> NoReturn:
    """Tell in a line why arguments are none; of a command that was given none, its help."""
    if type(error).__name__ == "NoArgsIsHelpError":
        error.show()
        raise SystemExit(FAILED)
    command = error.ctx.command_path if getattr(error, "ctx", None) is not None else "saltus"
    _fail(f"{error.format_message().rstrip('.')}; {command} --help tells what is allowed")


def _fail(text: str) -> NoReturn:
    typer.echo("saltus: " + printable(" ".join(text.split())), err=True)
    raise SystemExit(FAILED)


def _print_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"saltus {__version__}")
        raise typer.Exit


@app.callback()
def _options(
    version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and leave.")
    ] = False,
) -> None:
    del version  # its callback has done the work


def _figures(incomplete: str) -> list[str]:
    from saltus.afm.paper.figures import FIGURES

    return [name for name in FIGURES if name.startswith(incomplete)]


def _models(incomplete: str) -> list[str]:
    from saltus.afm.explorer_models import TAPPING

    return [name for name in TAPPING.titles if name.startswith(incomplete)]


@app.command(no_args_is_help=True)
def reproduce(
    figure: Annotated[
        str, typer.Argument(help="Name of the figure, or 'list' to see them all.", autocompletion=_figures)
    ],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="DIR", help="Folder for what is computed; made if absent.")
    ] = Path("results"),
    resolution: Annotated[
        int | None,
        typer.Option(min=2, metavar="N", help="Cells along each axis of fig8, fig9 and fig10; 400 if left out."),
    ] = None,
    animate: Annotated[bool, typer.Option("--animate", help="Film fig8 turning, as well.")] = False,
) -> None:
    """Compute a figure of the paper, with its data and special points."""
    from saltus.afm.paper.figures import FIGURES, runner

    if figure == "list":
        for name, line in FIGURES.items():
            typer.echo(f"{name}  {line}")
        return
    run = runner(figure)
    chosen = {"resolution": resolution, "animate": animate or None}
    options = _taken(figure, run, {name: value for name, value in chosen.items() if value is not None})
    folder = writable_folder(out)
    with interruptible(), status() as progress:
        found = run(folder, progress, **options)
    _report(found)
    if found["interrupted"]:
        raise SystemExit(INTERRUPTED)


def _taken(figure: str, run: Callable[..., Any], options: dict[str, Any]) -> dict[str, Any]:
    """Return the options; raise `InputError` for one that the figure does not take."""
    from inspect import signature

    for name, value in options.items():
        if name not in signature(run).parameters:
            raise InputError(f"--{name}", value, f"left out for {figure}")
    return options


@app.command()
def animate(
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="FILE", help="The film: a .gif, or an .mp4 (extra saltus[video]).")
    ] = Path("tap.gif"),
    omega: Annotated[float, typer.Option(help="Drive frequency, in units of the first natural frequency.")] = 1.0,
    ybar: Annotated[float, typer.Option(help="Drive amplitude, in units of the gap at rest.")] = 0.108,
    modes: Annotated[int, typer.Option(help="Modes of the cantilever, from 1 to 100.")] = 2,
    d_att: Annotated[float, typer.Option("--d-att", help="Damping out of contact.")] = 0.025,
    d_rep: Annotated[float, typer.Option("--d-rep", help="Damping in contact.")] = 4.0,
    orbit: Annotated[str, typer.Option(help="Regime: repulsive (with contact) or attractive (without).")] = "repulsive",
    fps: Annotated[int, typer.Option(help="Frames a second.")] = 25,
    seconds: Annotated[float, typer.Option(help="How long the film lasts.")] = 4.0,
    width: Annotated[int, typer.Option(help="Width in pixels.")] = 800,
) -> None:
    """Film the cantilever, tapping on a periodic orbit, beside its phase portrait and the force."""
    from saltus.plotting.movies import checked_movie

    checked_movie(out, fps)
    with interruptible(), status() as progress:
        from saltus.afm import animate as film, settled_orbit, table1, tapping_mode

        setup = table1()
        parameters = {"Omega": omega, "ybar": ybar, "D_att": d_att, "D_rep": d_rep}
        found = settled_orbit(tapping_mode(setup, modes=modes), parameters, orbit)
        path = film(found, out, setup=setup, fps=fps, seconds=seconds, width=width, progress=progress)
    typer.echo(printable(repr(found)))
    typer.echo(f"written  {path}  ({path.stat().st_size / 1e6:.2f} MB)")


@app.command(no_args_is_help=True)
def plot(
    file: Annotated[Path, typer.Argument(metavar="FILE", help="A saved result: a branch, an orbit, basins, ...")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", metavar="FILE", help="The picture, as .png or .svg; that of the file if left out."),
    ] = None,
) -> None:
    """Draw a saved result."""
    from saltus.result import load

    picture = checked_picture(file.with_suffix(".png") if out is None else out, "--out")
    with interruptible(), status():
        write_picture(load(file), picture, "--out")
    typer.echo(f"written  {picture}")


@app.command()
def explore(
    system: Annotated[
        str | None,
        typer.Argument(
            metavar="[SYSTEM]",
            help="FILE.py:NAME, MODULE:NAME, FILE.txt, or a model of saltus; by default a choice.",
            autocompletion=_models,
        ),
    ] = None,
    load: Annotated[
        Path | None, typer.Option("--load", metavar="FILE", help="A session that was downloaded as NetCDF.")
    ] = None,
    port: Annotated[int | None, typer.Option(min=1, max=65535, help="Port; by default 8710, or any free one.")] = None,
    browser: Annotated[bool, typer.Option(help="Open a browser.")] = True,
    host: Annotated[str, typer.Option(help="Address to listen on; another than this needs --token.")] = "127.0.0.1",
    token: Annotated[str | None, typer.Option(help="What a browser must know; random if left out.")] = None,
) -> None:
    """Explore a system in the browser: diagrams, orbits and basins, from click to click."""
    from saltus.afm.explorer_models import TAPPING
    from saltus.explorer.opening import open_explorer

    subject = None if system is None else TAPPING.named(system)

    def told(url: str) -> None:
        typer.echo(f"saltus explorer at {url}")
        typer.echo("Ctrl-C ends it; sessions are kept.")

    open_explorer(TAPPING, subject, load, host=host, token=token, port=port, browser=browser, told=told)


def _report(found: dict[str, Any]) -> None:
    """Print the special points or the numbers of the figure, and the files written."""
    content = found["content"]
    table = _special_points(content["special_points"]) if "special_points" in content else _numbers(content)
    if table.row_count:
        show(table)
    if found["interrupted"]:
        typer.echo("saltus: interrupted; kept", err=True)
        for result in found["results"].values():
            typer.echo(printable(f"  {repr(result).splitlines()[0]}"), err=True)
    for path in found["files"]:
        typer.echo(f"{'kept' if found['interrupted'] else 'written'}  {path}")


def _special_points(points: list[dict[str, Any]]) -> Table:
    """Return the special points of a branch as a table."""
    table = new_table({"type": "left", "Omega": "right", "min z": "right", "signature": "left", "admissible": "left"})
    for point in points:
        path = " ".join(":".join(pair) for pair in point["signature"])
        admissible = "yes" if point["admissible"] else "no"
        add_row(table, point["type"], f"{point['omega']:.10f}", f"{point['min_z']:.9f}", path, admissible)
    return table


def _numbers(content: dict[str, Any]) -> Table:
    """Return numbers and words of a figure's content as a table, one row for each entry."""
    table = new_table({"what": "left", "value": "left"})
    for name, value in content.items():
        if name in _TOLD_ELSEWHERE:
            continue
        values = value if isinstance(value, dict) else {"": value}
        told = {key: _written(x) for key, x in values.items() if key not in _TOLD_ELSEWHERE}
        written = [f"{key} = {x}".removeprefix(" = ") for key, x in told.items() if x]
        if written:
            add_row(table, name, ", ".join(written))
    return table


def _written(value: object) -> str:
    """Return a number, a word, or numbers by name as the table has them; nothing for what has other parts."""
    if isinstance(value, str):
        return value
    if isinstance(value, dict) and value and all(isinstance(x, int | float) for x in value.values()):
        return ", ".join(f"{key} {x:.10g}" for key, x in value.items())
    return f"{value:.10g}" if isinstance(value, int | float) else ""
