"""Files of a figure: its data, its numbers, and the picture, also after an interrupt.

Each result has a group of its own in the NetCDF file, by the result's name in the figure; `read_results` reads them. A
result with the empty name is the whole file, as `Result.save` writes it.
"""

from __future__ import annotations

import json
from collections.abc import Callable, Iterable, Mapping
from typing import TYPE_CHECKING, Any

from saltus import checks
from saltus.afm.paper.figures.telling import tell
from saltus.errors import InputError
from saltus.files import whole_file, write_sealed
from saltus.plotting.style import check_matplotlib
from saltus.progress import Report, Reporter
from saltus.result import READ, netcdf, reading, result_in, tagged

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from saltus.result import Result

__all__ = ["read_results", "write_figure"]


def write_figure(
    out: Path,
    name: str,
    compute: Callable[[bool | Report], Iterable[tuple[str, Result]]],
    content: Callable[[Mapping[str, Any]], dict[str, Any]],
    draw: Callable[[Mapping[str, Any]], Figure],
    progress: bool | Report,
) -> dict[str, Any]:
    """Compute a figure and write its files; an interrupt (Ctrl-C) keeps the finished results.

    Parameters
    ----------
    out : Path
        An existing folder, for ``<name>.nc``, ``<name>.json``, ``<name>.png`` and ``<name>.pdf``.
    name : str
        Of the figure.
    compute : callable
        Called with `progress`, a generator of names and results, which computes each result on demand.
    content : callable
        Returns the content of the JSON file from the results by name, some of which an interrupt may leave out.
    draw : callable
        Returns the picture from the results by name; called only with all of them.
    progress : bool or callable
        True for a bar on stderr, or a function called with a `saltus.Progress`. It counts the points, members or cells
        of the computation under way.

    Returns
    -------
    dict
        ``files`` (paths, in the order written), ``results`` (by name), ``content`` (of the JSON file) and
        ``interrupted``.

    Raises
    ------
    KeyboardInterrupt
        The interrupt came before the first result.
    InputError
        `progress` is neither a bool nor a callable.
    """
    check_matplotlib()
    with Reporter(progress) as reporter:
        told = reporter.report or False
        kept, interrupted = _gathered(compute(told))
        found: dict[str, Any] = {"files": [], "results": kept, "content": {}, "interrupted": interrupted}
        found["files"].append(_write_data(kept, out / f"{name}.nc"))
        try:
            found["content"] = content(kept)
            path = out / f"{name}.json"
            with whole_file(path) as draft:
                draft.write_text(json.dumps(found["content"], indent=1, allow_nan=False) + "\n", encoding="utf-8")
            found["files"].append(path)
            if not interrupted:
                tell(told, "drawing")
                _write_picture(draw(kept), out / name, found["files"])
        except KeyboardInterrupt:
            found["interrupted"] = True
        return found


def _write_picture(figure: Figure, stem: Path, written: list[Path]) -> None:
    """Write a picture in both formats, and add the files to those that are written."""
    for suffix in ("png", "pdf"):
        path = stem.with_name(f"{stem.name}.{suffix}")
        with whole_file(path) as draft:
            figure.savefig(draft, dpi=300, metadata={"CreationDate": None} if suffix == "pdf" else None)
        written.append(path)


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
    """Return whether a curve, a family or a sweep is one that an interrupt ended early."""
    stopped = getattr(result, "stopped", ())
    stopped = (stopped,) if isinstance(stopped, str) else stopped
    return bool(getattr(result, "interrupted", False)) or any("interrupted" in reason for reason in stopped)


def _write_data(results: Mapping[str, Result], path: Path) -> Path:
    write_sealed(path, netcdf({name: tagged(result) for name, result in results.items()}))
    return path


def read_results(path: str | Path) -> dict[str, Result]:
    """Return the results in a figure's data file by name, in the order of their computation.

    Raises
    ------
    InputError
        The file is no figure's, or has no groups (`saltus.load` reads it).
    """
    from saltus.extras import xr

    path = checks.path("path", path)
    with reading(path), xr.open_datatree(path, **READ) as tree:
        datasets = {name: node.to_dataset().load() for name, node in tree.children.items()}
    if not datasets:
        raise InputError("path", str(path), "a figure's data file with groups")
    return {name: result_in(dataset, path) for name, dataset in datasets.items()}
