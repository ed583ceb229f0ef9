"""The files of a figure: its data, the numbers it stands for, and the picture; written as far as the work got.

Each result has a group of its own in the NetCDF file, by the name under which the figure computes it; `read_results`
gives them back. A result without a name (the empty string) is the whole file, as `Result.save` writes it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from saltus import checks
from saltus.errors import InputError
from saltus.files import whole_file, write_sealed
from saltus.plotting.style import check_matplotlib
from saltus.results import READ, netcdf, reading, result_in, tagged

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from saltus.results import Result

__all__ = ["read_results", "write_figure"]


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
    check_matplotlib()
    kept, interrupted = _gathered(results)
    found: dict[str, Any] = {"files": [], "results": kept, "content": {}, "interrupted": interrupted}
    found["files"].append(_write_data(kept, out / f"{name}.nc"))
    try:
        found["content"] = content(kept)
        path = out / f"{name}.json"
        with whole_file(path) as draft:
            draft.write_text(json.dumps(found["content"], indent=1, allow_nan=False) + "\n", encoding="utf-8")
        found["files"].append(path)
        if interrupted:
            return found
        say("drawing")
        figure = draw(kept)
        for suffix in ("png", "pdf"):
            path = out / f"{name}.{suffix}"
            with whole_file(path) as draft:
                figure.savefig(draft, dpi=300, metadata={"CreationDate": None} if suffix == "pdf" else None)
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
    write_sealed(path, netcdf({name: tagged(result) for name, result in results.items()}))
    return path


def read_results(path: str | Path) -> dict[str, Result]:
    """Return the results in a figure's data file with groups, by name, in the order in which they were computed.

    Raises
    ------
    InputError
        The file is none of a figure's, or has no groups: then `saltus.load` reads it.
    """
    import xarray as xr

    path = checks.path("path", path)
    with reading(path), xr.open_datatree(path, **READ) as tree:
        datasets = {name: node.to_dataset().load() for name, node in tree.children.items()}
    if not datasets:
        raise InputError("path", str(path), "a figure's data file with groups")
    return {name: result_in(dataset, path) for name, dataset in datasets.items()}
