"""The diagram of a session as a picture for print, by the package's own drawing."""

from __future__ import annotations

from contextlib import suppress
from io import BytesIO
from typing import TYPE_CHECKING

from saltus.errors import InputError, SaltusError

if TYPE_CHECKING:
    from saltus.explorer.session import Session

__all__ = ["picture_of"]

_DRAWN = ("branch", "locus", "sweep")
_DPI = 200


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
    ax, count = figure.add_subplot(), 0
    x, y = session.settings.axes
    for entry in session.entries:
        if entry.step.noun in _DRAWN and entry.name not in session.settings.hidden:
            with suppress(SaltusError):  # of other axes: the list of results says so
                if entry.step.noun == "sweep":
                    from saltus.explorer.drawing import drawn

                    dots = drawn(entry.result, (x, y)).dots
                    ax.plot(dots[:, 0], dots[:, 1], ".", markersize=2.0, zorder=0)
                else:
                    entry.result.plot(x, y, ax=ax)
                count += 1
    if not count:
        raise InputError("axes", f"{x}, {y}", "with a branch, a locus or a sweep to draw")
    found = BytesIO()
    figure.savefig(found, format=kind, dpi=_DPI)
    found.seek(0)
    return found
