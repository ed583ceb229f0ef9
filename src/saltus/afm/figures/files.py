"""The files of a figure: its data, the numbers it stands for, and the picture; written as far as the work got.

Each result has a group of its own in the NetCDF file, by the name under which the figure computes it; `read_results`
gives them back. A result without a name (the empty string) is the whole file, as `Result.save` writes it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from importlib import import_module
from typing import TYPE_CHECKING, Any

from saltus.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from saltus.results import Result

__all__ = ["read_results", "write_figure"]

_HOMES = {
    "Branch": "saltus.continuation",
    "Locus": "saltus.continuation",
    "Family": "saltus.continuation",
    "PeriodicOrbit": "saltus.orbits",
    "Sweep": "saltus.sweeps",
    "Trajectory": "saltus.flow",
}


def write_figure(
    out: Path,
    name: str,
    results: Iterable[tuple[str, Result]],
    content: Callable[[Mapping[str, Any]], dict[str, Any]],
    draw: Callable[[Mapping[str, Any]], Figure],
    say: Callable[[str], None],
) -> dict[str, Any]:
    """Compute a figure and write its files; an interrupt (Ctrl-C) ends the work and keeps what is done.

    Parameters
    ----------
    out : Path
        An existing folder, for ``<name>.nc``, ``<name>.json``, ``<name>.png`` and ``<name>.pdf``.
    name : str
        Of the figure.
    results : iterable of (str, Result)
        What the figure is made of, with names; a generator, which computes each when it is asked for it.
    content : callable
        Returns the content of the JSON file, from the results by name; some are missing after an interrupt.
    draw : callable
        Returns the picture, from the results by name; called if all are there.
    say : callable
        Called with a line of text whenever there is something new to say.

    Returns
    -------
    dict
        ``files`` (paths, in the order written), ``results`` (by name), ``content`` (of the JSON file) and
        ``interrupted``.

    Raises
    ------
    KeyboardInterrupt
        The interrupt came before the first result.
    """
    kept, interrupted = _gathered(results)
    found: dict[str, Any] = {"files": [], "results": kept, "content": {}, "interrupted": interrupted}
    found["files"].append(_write_data(kept, out / f"{name}.nc"))
    try:
        found["content"] = content(kept)
        path = out / f"{name}.json"
        path.write_text(json.dumps(found["content"], indent=1, allow_nan=False) + "\n", encoding="utf-8")
        found["files"].append(path)
        if interrupted:
            return found
        say("drawing")
        figure = draw(kept)
        for suffix in ("png", "pdf"):
            path = out / f"{name}.{suffix}"
            figure.savefig(path, dpi=300, metadata={"CreationDate": None} if suffix == "pdf" else None)
            found["files"].append(path)
    except KeyboardInterrupt:
        found["interrupted"] = True
    return found


def _gathered(results: Iterable[tuple[str, Result]]) -> tuple[dict[str, Result], bool]:
    """Return the results by name, and whether an interrupt cut them short."""
    kept: dict[str, Result] = {}
    try:
        for name, result in results:
            kept[name] = result
            if _is_cut_short(result):
                return kept, True
    except KeyboardInterrupt:
        if not kept:
            raise
        return kept, True
    return kept, False


def _is_cut_short(result: Any) -> bool:
    """Whether a curve, a family or a sweep ended at an interrupt, which it answers with what it has."""
    stopped = getattr(result, "stopped", ())
    stopped = (stopped,) if isinstance(stopped, str) else stopped
    return bool(getattr(result, "interrupted", False)) or any("interrupted" in reason for reason in stopped)


def _write_data(results: Mapping[str, Result], path: Path) -> Path:
    if "" in results:
        return results[""].save(path)
    import xarray as xr

    datasets = {}
    for name, result in results.items():
        datasets[name] = result.to_xarray()
        datasets[name].attrs["saltus_result"] = type(result).__name__
    tree = xr.DataTree.from_dict(datasets)
    try:
        tree.to_netcdf(path, engine="h5netcdf")
    except OSError as error:
        raise InputError("path", str(path), "a file that can be written", str(error)) from error
    return path


def read_results(path: str | Path) -> dict[str, Result]:
    """Return the results in a figure's data file with groups, by name, in the order in which they were computed.

    Raises
    ------
    InputError
        The file is none of a figure's, or has no groups: then `saltus.load` reads it.
    """
    import xarray as xr

    try:
        with xr.open_datatree(path, engine="h5netcdf") as tree:
            datasets = {name: node.to_dataset().load() for name, node in tree.children.items()}
    except (OSError, ValueError) as error:
        raise InputError("path", str(path), "a figure's data file", str(error)) from error
    kinds = {name: str(dataset.attrs.get("saltus_result")) for name, dataset in datasets.items()}
    if not kinds or not set(kinds.values()) <= set(_HOMES):
        raise InputError("path", str(path), "a figure's data file with groups")
    return {
        name: getattr(import_module(_HOMES[kind]), kind).from_xarray(datasets[name]) for name, kind in kinds.items()
    }
