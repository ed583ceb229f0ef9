"""Picture of a fit: data on the sheets of the model, and residuals below."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.fitting.result import Fit
from saltus.plotting import plot, style
from saltus.plotting.branch import draw_pieces, pieces_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

__all__ = ["plot_fit"]

_MARKERS = ("^", "v", "o")  # markers of data, by the order of their directions


@plot.register(Fit)
def plot_fit(
    fit: Fit, channel: str | None = None, *, ax: Sequence[Axes] | None = None, legend: bool = True
) -> tuple[Axes, Axes]:
    """Draw data with the fitted branches, residuals below, and return the two matplotlib Axes.

    The sheets of the model are solid where stable, dashed where unstable. Of complex data the modulus is drawn. Dotted
    lines are measured special points. Residuals are in standard errors.

    Parameters
    ----------
    fit : Fit
        The fit.
    channel : str, optional
        The observable; by default the first one.
    ax : sequence of two matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure with a common axis below.
    legend : bool, optional
        Whether a legend names the lines.

    Raises
    ------
    InputError
        There is no such observable, or not two Axes.
    """
    style.check_options(None, legend=legend)
    names = [str(name) for name in fit.data["channel"].to_numpy()]
    name = names[0] if channel is None else checks.chosen("channel", channel, names)
    upper, lower = style.panels_of(ax)
    data = fit.data.sel(channel=name)
    is_complex = bool(np.any(data["measured_im"]))

    def shown(which: str) -> NDArray[np.float64]:
        values = data[which].to_numpy()
        return np.hypot(values, data[f"{which}_im"].to_numpy()) if is_complex else values

    _draw_sheets(upper, fit, name)
    for k, way in enumerate(dict.fromkeys(data["direction"].to_numpy().tolist())):
        of = data["direction"].to_numpy() == way
        marker = _MARKERS[min(k, len(_MARKERS) - 1)]
        options: dict[str, Any] = {
            "markersize": 3.0,
            "linestyle": "none",
            "marker": marker,
            "color": style.colour_of_mode(k),
        }
        upper.plot(data["x"].to_numpy()[of], shown("measured")[of], label=way or "data", **options)
        for row in _rows_of(fit, name):
            lower.plot(data["x"].to_numpy()[of], fit.data["residual"].to_numpy()[of, row], **options)
    for value in fit.data["special_value"].to_numpy():
        upper.axvline(value, color=style.SURFACE, linestyle=":", linewidth=1.0)
    lower.axhline(0.0, color=style.CURVE, linewidth=0.8)
    upper.set_ylabel(style.label_of(name))
    lower.set_ylabel("residual / sigma")
    lower.set_xlabel(style.label_of(fit.along))
    if legend:
        style.draw_legend(upper)
    return upper, lower


def _draw_sheets(ax: Axes, fit: Fit, name: str) -> None:
    """Draw the model's branches, an angle in the turn of the data."""
    formulas, turn = fit.formulas[name], float(fit.data["turn"].sel(channel=name))
    measured = float(np.median(fit.data["model"].sel(channel=name)))
    for branch in fit.branches:
        pieces = pieces_of(branch, fit.along, formulas[0])
        if turn:
            shift = turn * round((measured - float(np.nanmedian(branch.column(formulas[0])))) / turn)
            pieces = [replace(piece, y=piece.y + shift) for piece in pieces]
        draw_pieces(ax, pieces)


def _rows_of(fit: Fit, name: str) -> range:
    """Return the columns of the residuals that belong to an observable."""
    start = 0
    for one, formulas in fit.formulas.items():
        if one == name:
            return range(start, start + len(formulas))
        start += len(formulas)
    return range(0)
