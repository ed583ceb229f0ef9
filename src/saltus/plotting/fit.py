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

_LARGE = 15.0  # residual from which residuals are drawn by their logarithm
_LINEAR = 5.0  # up to where they are not
_SHARE = 3.0  # height of that part, in decades
_MARKERS = ("^", "v", "o")  # markers of data, by the order of their directions


@plot.register(Fit)
def plot_fit(
    fit: Fit, channel: str | None = None, *, ax: Sequence[Axes] | None = None, legend: bool = True
) -> tuple[Axes, Axes]:
    """Draw data with the fitted branches, residuals below, and return the two matplotlib Axes.

    The sheets of the model are solid where stable, dashed where unstable, as the fitted origin and gain show them. Of
    complex data the modulus is drawn. Dotted lines are measured special points, with their reach. Residuals are those
    of all columns, in standard errors; where some are large, beyond 5 by their logarithm. Rings are outliers.

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
    ways = list(dict.fromkeys(data["direction"].to_numpy().tolist()))
    for k, way in enumerate(ways):
        of = data["direction"].to_numpy() == way
        marker = _MARKERS[min(k, len(_MARKERS) - 1)]
        options: dict[str, Any] = {
            "markersize": 3.0,
            "linestyle": "none",
            "marker": marker,
            "color": style.colour_of_mode(k),
        }
        upper.plot(data["x"].to_numpy()[of], shown("measured")[of], label=way or "data", **options)
        for number, one in enumerate(names):
            options["color"] = style.colour_of_mode(len(ways) + number) if len(names) > 1 else options["color"]
            for part, row in enumerate(_rows_of(fit, one)):
                label = style.label_of(one) if k == 0 and part == 0 and len(names) > 1 else None
                lower.plot(data["x"].to_numpy()[of], fit.data["residual"].to_numpy()[of, row], label=label, **options)
    _draw_outliers(upper, lower, fit, shown("measured"))
    for value, reach in zip(fit.data["special_value"].to_numpy(), _reaches(fit), strict=True):
        upper.axvline(value, color=style.SURFACE, linestyle=":", linewidth=1.0)
        if reach:
            upper.axvspan(*sorted((value, value + reach)), color=style.SURFACE, alpha=0.08, linewidth=0.0)
    lower.axhline(0.0, color=style.CURVE, linewidth=0.8)
    upper.set_ylabel(style.label_of(name))
    lower.set_ylabel("residual / sigma")
    lower.set_xlabel(style.label_of(fit.along))
    if legend:
        style.draw_legend(upper)
        if len(names) > 1:
            style.draw_legend(lower)
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
        moved, gain = fit.instrument.moved_by, fit.instrument.factor(name)
        pieces = [replace(piece, x=piece.x - moved, y=gain * piece.y) for piece in pieces]
        draw_pieces(ax, pieces)


def _rows_of(fit: Fit, name: str) -> range:
    """Return the columns of the residuals that belong to an observable."""
    start = 0
    for one, formulas in fit.formulas.items():
        if one == name:
            return range(start, start + len(formulas))
        start += len(formulas)
    return range(0)


def _reaches(fit: Fit) -> NDArray[np.float64]:
    """Return how far the folds of measured jumps may lie behind them, with the sign of the way."""
    return fit.data["special_reach"].to_numpy()


def _draw_outliers(upper: Axes, lower: Axes, fit: Fit, shown: NDArray[np.float64]) -> None:
    """Draw rings about data that lie off while all others fit; large residuals by their logarithm."""
    rows, residual = list(fit.outliers), fit.data["residual"].to_numpy()
    ring: dict[str, Any] = {"marker": "o", "markersize": 9.0, "linestyle": "none", "markerfacecolor": "none"}
    if rows:
        x = fit.data["x"].to_numpy()[rows]
        upper.plot(x, shown[rows], color=style.CURVE, label="outlier", **ring)
        lower.plot(
            x, residual[rows][range(len(rows)), np.argmax(np.abs(residual[rows]), axis=1)], color=style.CURVE, **ring
        )
    if float(np.abs(residual).max()) > _LARGE:
        lower.set_yscale("symlog", linthresh=_LINEAR, linscale=_SHARE)
        largest = float(np.abs(residual).max())
        lower.set_ylim(min(-2.0 * _LINEAR, 2.0 * residual.min()), max(2.0 * _LINEAR, 2.0 * residual.max()))
        beyond = 10.0 ** np.arange(1.0, np.log10(2.0 * largest))
        low, high = lower.get_ylim()
        every = (*-beyond[::-1], -_LINEAR, 0.0, _LINEAR, *beyond)
        ticks = [value for value in every if low <= value <= high]
        lower.set_yticks(ticks, [f"{value:g}" for value in ticks], minor=False)
        lower.set_yticks([], minor=True)
