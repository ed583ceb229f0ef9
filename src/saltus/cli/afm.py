"""The command ``saltus afm``: curves, fits, observables and films of a probe over a sample; named parameter sets."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated
from warnings import catch_warnings, filterwarnings

import typer

from saltus.cli.console import (
    INTERRUPTED,
    MISFIT,
    add_row,
    bar,
    checked_picture,
    interruptible,
    new_table,
    printable,
    show,
    writable_folder,
    write_picture,
)
from saltus.errors import InputError

if TYPE_CHECKING:
    from saltus.afm.curves.curve import Curve
    from saltus.afm.curves.stable_orbits import StableOrbits
    from saltus.fitting import Fit

__all__ = ["group"]

group = typer.Typer(no_args_is_help=True, rich_markup_mode=None)

_FPS = 25  # frames a second of a film
_CONFIG = typer.Argument(
    metavar="CONFIG.toml",
    help="Probe, laws, drive, place and curve. A law of type 'module:Class' runs a module: that beside this file, "
    "else one that Python finds.",
)

_PLOT = typer.Option("--plot", metavar="FILE", help="A picture of it as well, as .png or .svg.")


@group.command(no_args_is_help=True)
def curve(
    config: Annotated[Path, _CONFIG],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE.nc", help="The curve, which saltus.load reads.")
    ] = None,
    plot: Annotated[Path | None, _PLOT] = None,
) -> None:
    """Follow all orbits along distance or frequency: jumps, grazings, the ways in and out.

    An interrupt (Ctrl-C) keeps the sheets so far.
    """
    out = _checked_out(out, plot)
    with interruptible():
        from saltus.afm.files.configuration import read_experiment

        experiment = read_experiment(config)
        with bar("from afar") as progress:
            found = experiment.traced(progress)
        _write(found, out, plot)
    if any(told.startswith("interrupted") for _, told in found.failures):
        typer.echo("saltus: interrupted; kept the sheets so far", err=True)
        raise SystemExit(INTERRUPTED)


@group.command(no_args_is_help=True)
def fit(
    data: Annotated[
        Path,
        typer.Argument(metavar="DATA", help="A measured curve: .csv with units, or a file of an instrument."),
    ],
    config: Annotated[Path, _CONFIG],
    out: Annotated[
        Path | None, typer.Option("--out", "-o", metavar="FILE.nc", help="The fit, which saltus.load reads.")
    ] = None,
    plot: Annotated[Path | None, _PLOT] = None,
) -> None:
    """Find the parameters with which a measured curve fits; the table [fit] has vary and sigma.

    Its columns name those of DATA, as columns = {f_kHz = "Dim0", amplitude_nm = "Amplitude"}. An interrupt (Ctrl-C)
    keeps the best so far. The exit code is 3 where nothing fits.
    """
    out = _checked_out(out, plot)
    with interruptible():
        from saltus.afm.files.configuration import read_experiment

        with bar("the first curve") as progress, catch_warnings():
            filterwarnings("ignore", "saltus: the data do not fit", RuntimeWarning)  # told below
            found = read_experiment(config).fitted(data, progress)
        _write(found, out, plot)
    if any(told.startswith("interrupted") for told in (found.stopped, *found.notes)):
        typer.echo("saltus: interrupted; kept the best so far", err=True)
        raise SystemExit(INTERRUPTED)
    if found.misfit:
        typer.echo(f"saltus: {found.misfit}", err=True)
        raise SystemExit(MISFIT)


@group.command("show", no_args_is_help=True)
def show_file(
    file: Annotated[
        Path,
        typer.Argument(metavar="FILE", help="A file of an instrument: .spm, .pfc, .jpk-force, .ARDF, .ibw, .nid, ..."),
    ],
) -> None:
    """Tell what the file of an instrument holds: channels, units, points, calibration constants."""
    with interruptible():
        from saltus.afm.files.instrument_files import instrument_file

        found = instrument_file(file)
    for line in repr(found).splitlines():
        typer.echo(printable(line))


def _write(found: Curve | Fit, out: Path, plot: Path | None) -> None:
    """Write a result and its picture, and print what they are."""
    found.save(out)
    if plot is not None:
        write_picture(found, plot, "--plot")
    typer.echo(printable(repr(found)))
    for path in (out, *([] if plot is None else [plot])):
        typer.echo(f"written  {path}")


def _checked_out(out: Path | None, plot: Path | None) -> Path:
    """Return the file that a command writes; raise `InputError` where it or the picture cannot be written."""
    if out is None:
        raise InputError("--out", None, "given: the file that is written", "add -o FILE.nc")
    if out.suffix != ".nc":
        raise InputError("--out", str(out), "a file whose name ends in .nc")
    writable_folder(out.parent)
    if plot is not None:
        checked_picture(plot, "--plot")
    return out


@group.command(no_args_is_help=True)
def observe(
    config: Annotated[Path, _CONFIG],
    at: Annotated[
        float | None,
        typer.Option(metavar="VALUE", help="Distance in nm or frequency in kHz, as [curve] has it; else the file's."),
    ] = None,
) -> None:
    """Tell the observables of the stable orbits at a place.

    They are those on the curve of the file, or else on a distance curve far around the place. Motions from 17 starts
    that settle elsewhere add more. One with a small basin that no way from afar reaches may be missed.
    """
    with interruptible():
        from saltus.afm.curves.stable_orbits import stable_orbits
        from saltus.afm.files.configuration import read_experiment

        experiment = read_experiment(config)
        with bar("from afar") as progress:
            found, place = experiment.around(at, progress)
        seen = stable_orbits(found, place)
    if not seen.orbits:
        hint = f"found: {seen.unstable} unstable ones; {seen.unsettled} motions settle on no periodic orbit"
        raise InputError(found.along, place, "where an orbit is stable", hint)
    _tell_observables(found, seen)


def _tell_observables(curve: Curve, found: StableOrbits) -> None:
    """Print the observables of orbits, one a column."""
    from saltus.afm.models.orbit_observables import observables
    from saltus.afm.models.readings import readings_of

    place = ", ".join(f"{name} = {found.orbits[0].parameters[name]:.10g}" for name in ("Zc_nm", "f_kHz"))
    told = [f"{len(found.orbits)} stable"] + [f"{found.unstable} unstable"] * bool(found.unstable)
    told += [f"{found.beside} on no sheet of the curve"] * bool(found.beside)
    told += [f"{found.unsettled} motions settle on no periodic orbit"] * bool(found.unsettled)
    typer.echo(f"{place}: {', '.join(told)}")
    seen = [observables(orbit, of=curve.of, phase_convention=curve.phase_convention) for orbit in found.orbits]
    table = new_table({"observable": "left", "unit": "left", **{f"orbit {k + 1}": "right" for k in range(len(seen))}})
    add_row(table, "regime", "", *(one["regime"] for one in seen))
    for name in seen[0]:
        values = [one[name] for one in seen]
        if name not in ("regime", "stable") and not all(value != value for value in values):
            add_row(table, name, readings_of(name).unit, *(f"{value:.9g}" for value in values))
    show(table)


@group.command(no_args_is_help=True)
def animate(
    config: Annotated[Path, _CONFIG],
    out: Annotated[
        Path, typer.Option("--out", "-o", metavar="FILE", help="The film: a .gif, or an .mp4 (extra saltus[video]).")
    ] = Path("tap.gif"),
    at: Annotated[float | None, typer.Option(metavar="VALUE", help="Place, as of `saltus afm observe`.")] = None,
    regime: Annotated[
        str | None, typer.Option(help="repulsive or attractive, by the virial; by default that of the first orbit.")
    ] = None,
    seconds: Annotated[float, typer.Option(help="How long the film lasts.")] = 4.0,
) -> None:
    """Film a stable orbit: the cantilever, its phase portrait and the force."""
    from saltus.plotting.movies import checked_movie

    checked_movie(out, _FPS)
    with interruptible():
        from saltus.afm import animate as film, observables
        from saltus.afm.curves.stable_orbits import stable_orbits
        from saltus.afm.files.configuration import read_experiment

        with bar("from afar") as progress:
            curve, place = read_experiment(config).around(at, progress)
        orbits = {observables(orbit)["regime"]: orbit for orbit in stable_orbits(curve, place).orbits[::-1]}
        if not orbits or (regime is not None and regime not in orbits):
            there = f"a regime with a stable orbit at {curve.along} = {place:.9g}"
            raise InputError("--regime", regime, f"{there}: {', '.join(orbits) or 'there is none'}")
        with bar("frames") as progress:
            film(orbits[regime or next(reversed(orbits))], out, fps=_FPS, seconds=seconds, progress=progress)
    typer.echo(f"written  {out}  ({out.stat().st_size / 1e6:.2f} MB)")


@group.command()
def sets(
    name: Annotated[str | None, typer.Argument(metavar="NAME", help="Set that is printed as TOML.")] = None,
) -> None:
    """List named parameter sets with their sources, or print one as a file for the other commands."""
    from saltus.afm.files.sets import entries_of, names, text_of

    if name is not None:
        typer.echo(text_of(name), nl=False)
        return
    table = new_table({"name": "left", "title": "left", "source": "left"})
    for one in names():
        entries = entries_of(one)
        add_row(table, one, entries["title"], entries["source"])
    show(table)
