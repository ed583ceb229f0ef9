"""The command ``saltus``: parse, call, print. What is heavy is imported inside the commands."""

from __future__ import annotations

import math
import os
import sys
import tempfile
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from io import TextIOWrapper
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer
from typer.core import TyperGroup

from saltus.errors import InputError, SaltusError, nearest

if TYPE_CHECKING:
    from rich.table import Table
    from rich.text import Text

    from saltus.basins import Basins
    from saltus.basins.map.config import Config
    from saltus.system import HybridSystem

__all__ = ["main"]

_FAILED, _INTERRUPTED = 2, 130
_TABLE_WIDTH = 80
_LONG = ("signature", "value")
"""Columns whose text may go on in the next line, so that numbers beside them are never cut."""
_TOLD_ELSEWHERE = ("figure", "parameters")
"""Entries of a figure's content that the table of its numbers leaves out."""

app = typer.Typer(
    name="saltus",
    help="Dynamics of hybrid systems: periodic orbits, their continuation and bifurcations.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
    rich_markup_mode=None,
    context_settings={"help_option_names": ["-h", "--help"]},
)

_MAP = "map"
_WORKERS = (2, 4, 16, 64, 256)
"""Machines for which `saltus basins --estimate` tells how long a grid takes."""


class _BasinsGroup(TyperGroup):
    """A group whose first argument is a configuration, unless it is the name of a command."""

    def parse_args(self, ctx: Any, args: list[str]) -> list[str]:
        if args and args[0] not in (*self.commands, *ctx.help_option_names):
            args = [_MAP, *args]
        rest: list[str] = super().parse_args(ctx, args)
        return rest

    def format_usage(self, ctx: Any, formatter: Any) -> None:
        formatter.write_usage(ctx.command_path, "CONFIG.toml -o STORE.zarr [OPTIONS]")
        formatter.write_usage(ctx.command_path, "info STORE.zarr")

    def format_options(self, ctx: Any, formatter: Any) -> None:
        self.commands[_MAP].format_options(ctx, formatter)
        self.format_commands(ctx, formatter)


_basins = typer.Typer(cls=_BasinsGroup, no_args_is_help=True, rich_markup_mode=None)
app.add_typer(_basins, name="basins", help="Map basins of attraction into a store, or tell what is in one.")


def main(args: list[str] | None = None) -> None:
    """Run the command with `args` (by default those of the process) and leave with its exit code.

    0: done; 2: an error, told in a line on stderr; 130: interrupted.
    """
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")  # a terminal may lack letters that names have
    try:
        app(args=args, prog_name="saltus")
    except SaltusError as error:
        _fail(str(error))
    except OSError as error:
        _fail(f"{error.filename}: {error.strerror}" if error.filename else str(error))


def _fail(text: str) -> None:
    typer.echo("saltus: " + _printable(" ".join(text.split())), err=True)
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
    resolution: Annotated[
        int | None,
        typer.Option(min=2, metavar="N", help="Cells along each axis of fig8, fig9 and fig10; 400 if left out."),
    ] = None,
    animate: Annotated[bool, typer.Option("--animate", help="Film fig8 turning, as well.")] = False,
) -> None:
    """Compute a figure of the paper, with its data and special points."""
    from saltus.afm.figures import FIGURES, runner

    if figure == "list":
        for name, line in FIGURES.items():
            typer.echo(f"{name}  {line}")
        return
    run = runner(figure)
    chosen = {"resolution": resolution, "animate": animate or None}
    options = _taken(figure, run, {name: value for name, value in chosen.items() if value is not None})
    folder = _writable_folder(out)
    with _interruptible(), _status() as say:
        found = run(folder, say, **options)
    _report(found)
    if found["interrupted"]:
        raise SystemExit(_INTERRUPTED)


def _taken(figure: str, run: Callable[..., Any], options: dict[str, Any]) -> dict[str, Any]:
    """Return the options, all of which a figure takes; raise `InputError` if not."""
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
    modes: Annotated[int, typer.Option(help="Modes of the cantilever.")] = 2,
    d_att: Annotated[float, typer.Option("--d-att", help="Damping out of contact.")] = 0.025,
    d_rep: Annotated[float, typer.Option("--d-rep", help="Damping in contact.")] = 4.0,
    orbit: Annotated[str, typer.Option(help="Regime: repulsive (with contact) or attractive (without).")] = "repulsive",
    fps: Annotated[int, typer.Option(help="Frames a second.")] = 25,
    seconds: Annotated[float, typer.Option(help="How long the film lasts.")] = 4.0,
    width: Annotated[int, typer.Option(help="Width in pixels.")] = 800,
) -> None:
    """Film the cantilever, tapping on a periodic orbit, beside its phase portrait and the force."""
    from saltus.afm.movies import checked_movie

    checked_movie(out, fps)
    with _interruptible(), _status() as say:
        from saltus.afm import animate as film
        from saltus.afm import settled_orbit, table1, tapping_mode

        setup = table1()
        parameters = {"Omega": omega, "ybar": ybar, "D_att": d_att, "D_rep": d_rep}
        found = settled_orbit(tapping_mode(setup, modes=modes), parameters, orbit)
        told = None if say is None else lambda done, total: say(f"frame {done} of {total}")
        path = film(found, out, setup=setup, fps=fps, seconds=seconds, width=width, progress=told)
    typer.echo(_printable(repr(found)))
    typer.echo(f"written  {path}  ({path.stat().st_size / 1e6:.2f} MB)")


@_basins.command(_MAP, hidden=True)
def map_(
    config: Annotated[Path, typer.Argument(metavar="CONFIG.toml", help="System, parameters, grid and options.")],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="STORE.zarr", help="The store that is written.")
    ] = None,
    engine: Annotated[
        str | None, typer.Option(metavar="NAME", help="cpu, cuda or dask; in place of the configuration's.")
    ] = None,
    scheduler: Annotated[
        str | None, typer.Option(metavar="ADDRESS", help="Of a Dask cluster, for the engine dask: tcp://host:8786.")
    ] = None,
    resume: Annotated[bool, typer.Option("--resume", help="Go on with a store, if it exists.")] = False,
    estimate: Annotated[
        bool, typer.Option("--estimate", help="Measure a sample of the cells, tell time and size, and leave.")
    ] = False,
    preview: Annotated[
        bool, typer.Option("--preview", help="Refine only where labels differ: quick, with some cells wrong.")
    ] = False,
) -> None:
    """Map the basins of a configuration."""
    engine = _checked(out, engine, scheduler, resume=resume, estimate=estimate, preview=preview)
    from saltus.basins.map.config import read_config, system_of

    read = read_config(config)
    engine = engine or read.engine.name
    if (engine == "dask") != (scheduler is not None) and not estimate:
        raise InputError("--scheduler", scheduler, "given for the engine dask, and for no other")
    with _interruptible():
        from saltus.afm.variations import tapping_mode_with

        system = system_of(read, {"tapping_mode": tapping_mode_with}, config.absolute().parent)
        if estimate:
            _tell_cost(read, system, engine)
            return
        assert out is not None
        found = _mapped(read, system, out, engine=engine, client=scheduler, preview=preview)
    _tell_basins(found)
    typer.echo(f"{'kept' if 'interrupted' in found.stopped else 'written'}  {out}  ({_bytes(_size(out))})")
    if "interrupted" in found.stopped:
        typer.echo(f"saltus: {found.stopped}; the same command with --resume goes on", err=True)
        raise SystemExit(_INTERRUPTED)


def _checked(
    out: Path | None, engine: str | None, scheduler: str | None, *, resume: bool, estimate: bool, preview: bool
) -> str | None:
    """Return the engine, raising `InputError` where options do not belong together, before anything is imported."""
    engines = ("cpu", "cuda", "dask")
    if engine is not None and engine not in engines:
        raise InputError("--engine", engine, f"one of {', '.join(engines)}", nearest(engine, engines))
    if estimate:
        if preview:
            raise InputError(
                "--preview", True, "left out with --estimate", "its cost follows from the basins' boundary"
            )
        return engine
    if out is None:
        raise InputError("--out", None, "given: the store that is written", "add -o STORE.zarr, or --estimate alone")
    if not out.absolute().parent.is_dir():
        raise InputError("--out", str(out), "in a folder that exists")
    if out.exists() and not resume:
        raise InputError("--out", str(out), "new", "it exists: --resume goes on with it")
    if scheduler is not None and engine not in ("dask", None):
        raise InputError("--scheduler", scheduler, "given for the engine dask, and for no other")
    return engine


def _mapped(read: Config, system: HybridSystem, out: Path, *, engine: str, client: str | None, preview: bool) -> Basins:
    """Find the attractors, unless a store has them, and map the basins."""
    from saltus.basins import map_basins

    with _bar("starting" if out.exists() else "looking for attractors") as progress:
        return map_basins(
            system, read.parameters, read.cells, _search(read), store=out, client=client, preview=preview,
            engine=engine, interval=read.interval, progress=progress, **_engine_options(read),
        )  # fmt: skip


def _engine_options(read: Config) -> dict[str, Any]:
    return read.engine.model_dump(exclude={"name"}, exclude_none=True)


def _search(read: Config) -> dict[str, Any]:
    """Return the options with which attractors are looked for."""
    from saltus.basins import Search
    from saltus.basins.map.config import called

    options = read.attractors.model_dump(exclude_none=True, exclude={"search"})
    if read.attractors.search is not None:
        options["search"] = called(Search, read.attractors.search, "attractors.search")
    return options


def _tell_cost(read: Config, system: HybridSystem, engine: str) -> None:
    """Print what the basins of a configuration cost, measured on a sample."""
    from saltus.basins.map.cost import estimate_cost

    with _status() as say:
        if say is not None:
            say("looking for attractors, then measuring a sample of the cells")
        cost = estimate_cost(
            system, read.parameters, read.cells, _search(read), engine=engine, interval=read.interval,
            **_engine_options(read),
        )  # fmt: skip
    where = "the graphics cards here" if engine == "cuda" else "this machine"
    table = _table({"what": "left", "value": "left"})
    _add_row(table, "cells", f"{cost.cells:,}")
    _add_row(table, "measured", f"{cost.orbits_per_second:,.0f} orbits/s on {where} ({cost.sampled:,} cells)")
    _add_row(table, "attractors", f"{_duration(cost.search_seconds)}, once")
    _add_row(table, "time", f"{_duration(cost.seconds())} in all on {where}")
    for count in _WORKERS:
        _add_row(table, "", f"{_duration(cost.seconds(count))} on {count} such machines")
    _add_row(table, "store", f"at most {_bytes(cost.cells)}, about {_bytes(cost.size)} compressed")
    _print(table)


@_basins.command()
def info(store: Annotated[Path, typer.Argument(metavar="STORE.zarr", help="What `saltus basins` wrote.")]) -> None:
    """Tell what is in a store: grid, attractors, fractions, how much is done, all inputs."""
    from saltus.basins import Basins

    _tell_basins(Basins.open(store), inputs=True)


@contextmanager
def _interruptible() -> Iterator[None]:
    """Leave with its exit code where an interrupt comes before there is a result."""
    try:
        yield
    except KeyboardInterrupt:
        typer.echo("saltus: interrupted before there was anything to keep", err=True)
        raise SystemExit(_INTERRUPTED) from None


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
        yield lambda text: status.update(_cell(text))


def _report(found: dict[str, Any]) -> None:
    """Print the special points, or the numbers that the figure stands for, and which files were written."""
    content = found["content"]
    table = _special_points(content["special_points"]) if "special_points" in content else _numbers(content)
    if table.row_count:
        _print(table)
    if found["interrupted"]:
        typer.echo("saltus: interrupted; kept", err=True)
        for result in found["results"].values():
            typer.echo(_printable(f"  {repr(result).splitlines()[0]}"), err=True)
    for path in found["files"]:
        typer.echo(f"{'kept' if found['interrupted'] else 'written'}  {path}")


def _special_points(points: list[dict[str, Any]]) -> Table:
    """Return the special points of a branch as a table."""
    table = _table({"type": "left", "Omega": "right", "min z": "right", "signature": "left", "admissible": "left"})
    for point in points:
        path = " ".join(":".join(pair) for pair in point["signature"])
        admissible = "yes" if point["admissible"] else "no"
        _add_row(table, point["type"], f"{point['omega']:.10f}", f"{point['min_z']:.9f}", path, admissible)
    return table


def _numbers(content: dict[str, Any]) -> Table:
    """Return numbers and words in the content of a figure without special points, a row for what belongs together."""
    table = _table({"what": "left", "value": "left"})
    for name, value in content.items():
        if name in _TOLD_ELSEWHERE:
            continue
        values = value if isinstance(value, dict) else {"": value}
        told = {key: _written(x) for key, x in values.items() if key not in _TOLD_ELSEWHERE}
        written = [f"{key} = {x}".removeprefix(" = ") for key, x in told.items() if x]
        if written:
            _add_row(table, name, ", ".join(written))
    return table


def _written(value: object) -> str:
    """Return a number, a word, or numbers by name as the table has them; nothing for what has other parts."""
    if isinstance(value, str):
        return value
    if isinstance(value, dict) and value and all(isinstance(x, int | float) for x in value.values()):
        return ", ".join(f"{key} {x:.10g}" for key, x in value.items())
    return f"{value:.10g}" if isinstance(value, int | float) else ""


def _tell_basins(basins: Basins, *, inputs: bool = False) -> None:
    """Print what basins hold: how the grid is, its attractors and their parts, and how much is done."""
    grid, outcomes, given = basins.grid, basins.attractors, basins.inputs
    with _status() as say:
        if say is not None:
            say("counting cells")
        shares = basins.fractions()
    table = _table({"what": "left", "value": "left"})
    if inputs:
        _add_row(table, "system", given.get("system", {}).get("name") or "unknown")
        for name, (low, high, count) in zip(grid.names, grid.ranges, strict=True):
            _add_row(table, name, f"{low:g} to {high:g}, {count} cells")
        for name, value in grid.fixed.items():
            _add_row(table, name, f"{value:.10g}")
    for name, share in shares.items():
        told = [f"{100.0 * share:.4f} % of the cells"]
        if name in outcomes.points:
            told.append(getattr(outcomes, "kinds", {}).get(name, "attractor"))
            told += [f"label {outcomes.labels[name]}"] if inputs else []
        if share or name in outcomes.points:
            _add_row(table, name, ", ".join(told))
    for name, note in getattr(outcomes, "notes", {}).items() if inputs else ():
        _add_row(table, f"trap of {name}", note)
    if basins.undecided:
        _add_row(table, "undecided", basins.undecided)
    if "longest" in given:
        _add_row(table, "longest", f"{given['longest']} periods: {given.get('longest_reason', 'as given')}")
    _add_row(table, "done", basins.stopped)
    if math.isfinite(basins.orbits_per_second):
        _add_row(table, "speed", f"{basins.orbits_per_second:,.0f} orbits/s")
    if error := basins.noted_error:
        anew = f"{error.wrong} of {error.cells} when followed again at tolerance {error.tolerance:g}"
        by_events = f"{error.wrong_by_events} of {error.cells_by_events} by the event-driven flow"
        _add_row(table, "wrong labels", f"{anew}: < {error.bound:.2g} at 95 %; {by_events}")
    if inputs:
        for name in ("engine", "tolerance", "preview", "saltus_version"):
            if name in given:
                _add_row(table, name, f"{given[name]}")
        for name, value in given.get("parameters", {}).items():
            _add_row(table, name, f"{value:.10g}")
    _print(table)


def _print(table: Table) -> None:
    from rich.console import Console

    console = Console(highlight=False)
    console.width = max(console.width, _TABLE_WIDTH)
    console.print(table)


@contextmanager
def _bar(first: str = "starting") -> Iterator[Callable[[int, int, float, float], None] | None]:
    """Show a bar with orbits a second and the time left; nothing where stdout is no terminal."""
    if not (sys.stdout is not None and sys.stdout.isatty()):
        yield None
        return
    from rich.progress import BarColumn, Progress, TextColumn

    with Progress(BarColumn(), TextColumn("{task.percentage:5.1f} %  {task.fields[told]}")) as bar:
        task = bar.add_task("", total=None, told=first)

        def show(done: int, total: int, rate: float, left: float) -> None:
            bar.update(task, completed=done, total=total, told=f"{rate:,.0f} orbits/s  {_duration(left)} left")

        yield show


def _add_row(table: Table, *texts: str) -> None:
    """Add a row of texts as they are: names may come from a file, and hold markup or the codes of a terminal."""
    table.add_row(*map(_cell, texts))


def _cell(text: str) -> Text:
    from rich.text import Text

    return Text(_printable(text))


def _printable(text: str) -> str:
    """Return a text with its control characters, line ends excepted, as backslash escapes."""
    return "".join(x if x.isprintable() or x == "\n" else x.encode("unicode_escape").decode() for x in text)


def _duration(seconds: float) -> str:
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


def _bytes(count: float) -> str:
    """Return an amount of data with its unit."""
    for unit in ("B", "kB", "MB", "GB"):
        if count < 1000.0:
            return f"{count:.3g} {unit}"
        count /= 1000.0
    return f"{count:.3g} TB"


def _size(store: Path) -> int:
    return sum(path.stat().st_size for path in store.rglob("*") if path.is_file())


def _table(columns: Mapping[str, Literal["left", "right"]]) -> Table:
    from rich import box
    from rich.table import Table

    table = Table(box=box.SIMPLE_HEAD, pad_edge=False)
    for name, justify in columns.items():
        table.add_column(name, justify=justify, no_wrap=name not in _LONG, overflow="fold")
    return table
