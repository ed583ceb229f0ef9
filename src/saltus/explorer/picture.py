"""The diagram of a session as a picture for print, in the colours of the page."""

from __future__ import annotations

from contextlib import suppress
from io import BytesIO
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.errors import InputError, SaltusError
from saltus.explorer import look
from saltus.explorer.colours import FAULTY, INK, colour_of, form_of
from saltus.explorer.drawing import Drawn, drawn, extent_of
from saltus.plotting import style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from saltus.explorer.session import Session

__all__ = ["picture_of"]

_DRAWN = ("branch", "locus", "sweep")
_DPI = 200


class _Named(NamedTuple):
    results: dict[str, Any]  # what the legend names, with how it is drawn
    kinds: dict[str, Any]  # kinds of curves
    types: dict[str, Any]  # types of special points


def picture_of(session: Session, kind: str) -> BytesIO:
    """Return the diagram of a session as a file's content.

    Parameters
    ----------
    session : Session
        The session.
    kind : {"png", "svg"}
        Format of the picture.

    Raises
    ------
    InputError
        Nothing can be drawn on the axes.
    """
    import matplotlib
    from matplotlib.figure import Figure

    matplotlib.use("agg")
    figure = Figure(figsize=(7.0, 4.5), layout="constrained")
    ax, named = figure.add_subplot(), _Named({}, {}, {})
    x, y = session.settings.axes
    seen: list[np.ndarray] = []
    for number, entry in enumerate(session.entries):
        if entry.step.noun in _DRAWN and entry.name not in session.settings.hidden:
            with suppress(SaltusError):  # of other axes: the list of results says so
                found = drawn(entry.result, (x, y))
                seen.append(extent_of(found))
                _draw(ax, found, entry.name, colour_of(number, entry.result), named)
    if not named.results:
        raise InputError("axes", f"{x}, {y}", "with a branch, a locus or a sweep to draw")
    ax.set(xlabel=style.label_of(x), ylabel=style.label_of(y))
    across, upwards = np.vstack(seen).T
    ax.set(xlim=look.ends_of(across), ylim=look.ends_of(upwards))
    legend = {name: handle for part in named for name, handle in part.items()}
    figure.legend(
        [*legend.values()], [*legend], loc="outside right upper", frameon=False, fontsize="small", handlelength=2.6
    )
    content = BytesIO()
    figure.savefig(content, format=kind, dpi=_DPI)
    content.seek(0)
    return content


def _draw(ax: Axes, found: Drawn, name: str, colour: str, named: _Named) -> None:
    """Draw a result, and add what the legend names."""
    from matplotlib.lines import Line2D

    if len(found.dots):
        dots: dict[str, Any] = {
            "linestyle": "none",
            "marker": "o",
            "color": colour,
            "markersize": 3.4,
            "markeredgewidth": 0.0,
        }
        ax.plot(*found.dots.T, alpha=0.5, zorder=1, **dots)
        named.results[name] = Line2D([], [], **dots)
    for strand in found.strands:
        sound = strand.kind not in style.FAULTY
        line = dict(style.LINES[strand.kind]) | {"color": colour if sound else FAULTY}
        ax.plot(strand.x, strand.y, zorder=2, **line)
        named.results.setdefault(name, Line2D([], [], color=colour, linewidth=1.8))
        if strand.kind != "stable":
            named.kinds.setdefault(strand.kind, Line2D([], [], **{**line, "color": INK if sound else FAULTY}))
    for mark in found.marks:
        form = form_of(mark.type, mark.locus)
        (drawn_mark,) = ax.plot([mark.x], [mark.y], zorder=5, **form.options())
        known = f"{mark.type}, {form.meaning}" if mark.type in style.SPECIAL else style.plain(mark.type)
        named.types.setdefault(known, drawn_mark)
