"""The command ``saltus basins``: write basins of attraction to a store, or show a store's content."""

from __future__ import annotations

import math
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer
from typer.core import TyperGroup

from saltus.cli.console import (
    INTERRUPTED,
    add_row,
    bar,
    interruptible,
    new_table,
    show,
    size,
    size_text,
    status,
)
from saltus.errors import InputError, nearest
from saltus.progress import duration_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from saltus.basins import BasinOptions, Basins
    from saltus.basins.map.config import Config
    from saltus.system import HybridSystem, Map

__all__ = ["group"]

_MAP = "map"  # command that a configuration alone stands for
_WORKERS = (2, 4, 16, 64, 256)  # machines for which `saltus basins --estimate` tells a time


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


group = typer.Typer(cls=_BasinsGroup, no_args_is_help=True, rich_markup_mode=None)


@group.command(_MAP, hidden=True)
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
    with interruptible():
        from saltus.afm.files.configuration import model_of
        from saltus.afm.paper.variations import tapping_mode_with

        folder = config.absolute().parent
        makers: dict[str, Callable[..., HybridSystem]] = {
            "tapping_mode": tapping_mode_with,
            "afm.model": partial(model_of, folder),
        }
        system = system_of(read, makers, folder)
        if estimate:
            _tell_cost(read, system, engine)
            return
        assert out is not None
        found = _mapped(read, system, out, engine=engine, client=scheduler, preview=preview)
    _tell_basins(found)
    typer.echo(f"{'kept' if 'interrupted' in found.stopped else 'written'}  {out}  ({size_text(size(out))})")
    if "interrupted" in found.stopped:
        typer.echo(f"saltus: {found.stopped}; the same command with --resume goes on", err=True)
        raise SystemExit(INTERRUPTED)


def _checked(
    out: Path | None, engine: str | None, scheduler: str | None, *, resume: bool, estimate: bool, preview: bool
) -> str | None:
    """Return the engine; raise `InputError` for options that exclude each other, before heavy imports."""
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


def _mapped(
    read: Config, system: HybridSystem | Map, out: Path, *, engine: str, client: str | None, preview: bool
) -> Basins:
    """Find the attractors, unless a store has them, and map the basins."""
    from saltus.basins import map_basins

    options = _options(read, engine=engine, client=client, preview=preview)
    with bar("starting" if out.exists() else "looking for attractors") as progress:
        return map_basins(
            system, read.parameters, read.cells, _search(read), options=options, path=out, progress=progress
        )


def _options(read: Config, *, engine: str, client: str | None = None, preview: bool = False) -> BasinOptions:
    """Return the options of a map, from the configuration and the command line."""
    from saltus.basins import BasinOptions

    given = read.engine.model_dump(exclude={"name"}, exclude_none=True)
    return BasinOptions(engine=engine, client=client, preview=preview, interval=read.interval, **given)


def _search(read: Config) -> dict[str, Any]:
    """Return the arguments of the search for attractors."""
    from saltus.basins import AttractorOptions
    from saltus.config_files import called

    search = read.attractors.model_dump(exclude_none=True, exclude={"options"})
    if read.attractors.options is not None:
        search["options"] = called(AttractorOptions, read.attractors.options, "attractors.options")
    return search


def _tell_cost(read: Config, system: HybridSystem | Map, engine: str) -> None:
    """Print the time and size of a configuration's basins, measured on a sample."""
    from saltus.basins.map.cost import estimate_cost

    with status("looking for attractors, then measuring a sample of the cells"):
        options = _options(read, engine="cuda" if engine == "cuda" else "cpu")
        cost = estimate_cost(system, read.parameters, read.cells, _search(read), options=options)
    where = "the graphics cards here" if engine == "cuda" else "this machine"
    table = new_table({"what": "left", "value": "left"})
    add_row(table, "cells", f"{cost.cells:,}")
    add_row(table, "measured", f"{cost.orbits_per_second:,.0f} orbits/s on {where} ({cost.sampled:,} cells)")
    add_row(table, "attractors", f"{duration_text(cost.search_seconds)}, once")
    add_row(table, "time", f"{duration_text(cost.seconds())} in all on {where}")
    for count in _WORKERS:
        add_row(table, "", f"{duration_text(cost.seconds(count))} on {count} such machines")
    add_row(table, "store", f"at most {size_text(cost.cells)}, about {size_text(cost.size)} compressed")
    show(table)


@group.command()
def info(store: Annotated[Path, typer.Argument(metavar="STORE.zarr", help="What `saltus basins` wrote.")]) -> None:
    """Tell what is in a store: grid, attractors, fractions, how much is done, all inputs."""
    from saltus.basins import Basins

    _tell_basins(Basins.open(store), inputs=True)


def _tell_basins(basins: Basins, *, inputs: bool = False) -> None:
    """Print the content of basins: grid, attractors, shares of the cells, and how much is done."""
    grid, outcomes, given = basins.grid, basins.attractors, basins.inputs
    with status("counting cells"):
        shares = basins.fractions()
    table = new_table({"what": "left", "value": "left"})
    if inputs:
        add_row(table, "system", given.get("system", {}).get("name") or "unknown")
        for name, (low, high, count) in zip(grid.names, grid.ranges, strict=True):
            add_row(table, name, f"{low:g} to {high:g}, {count} cells")
        for name, value in grid.fixed.items():
            add_row(table, name, f"{value:.10g}")
    for name, share in shares.items():
        told = [f"{100.0 * share:.4f} % of the cells"]
        if name in outcomes.points:
            told.append(getattr(outcomes, "kinds", {}).get(name, "attractor"))
            told += [f"label {outcomes.labels[name]}"] if inputs else []
        if share or name in outcomes.points:
            add_row(table, name, ", ".join(told))
    for name, note in getattr(outcomes, "notes", {}).items() if inputs else ():
        add_row(table, f"trap of {name}", note)
    if basins.undecided:
        add_row(table, "undecided", basins.undecided)
    if "longest" in given:
        add_row(table, "longest", f"{given['longest']} periods: {given.get('longest_reason', 'as given')}")
    add_row(table, "done", basins.stopped)
    if math.isfinite(basins.orbits_per_second):
        add_row(table, "speed", f"{basins.orbits_per_second:,.0f} orbits/s")
    if error := basins.noted_error:
        anew = f"{error.wrong} of {error.cells} when followed again at tolerance {error.tolerance:g}"
        by_events = f"{error.wrong_by_events} of {error.cells_by_events} followed one by one"
        add_row(table, "wrong labels", f"{anew}: < {error.bound:.2g} at 95 %; {by_events}")
        if error.nowhere:
            add_row(
                table, "on no attractor", f"{error.nowhere} of them; missed: {error.missed or 'none that is known'}"
            )
    if inputs:
        for name in ("engine", "tolerance", "preview", "saltus_version"):
            if name in given:
                add_row(table, name, f"{given[name]}")
        for name, value in given.get("parameters", {}).items():
            add_row(table, name, f"{value:.10g}")
    show(table)
