"""Picture of a bimodal map: values and readings as images, or along a line of pixels."""

from __future__ import annotations

from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.afm.bimodal.bimodal_map import BimodalMap, reading_of
from saltus.errors import InputError
from saltus.plotting import plot, style

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

__all__ = ["plot_bimodal"]

_WIDTH = 18  # characters of a line of a label beside a curve
_MISSING = "0.75"  # grey of pixels without a value


@plot.register(BimodalMap)
def plot_bimodal(
    result: BimodalMap, columns: str | Sequence[str] | None = None, *, ax: Sequence[Axes] | Axes | None = None
) -> list[Axes]:
    """Draw columns of a bimodal map and return the matplotlib Axes.

    A map with two axes is drawn as images with colour bars, pixels without a value in grey. One with a single axis is
    drawn as curves, with bars of the standard errors where they are known.

    Parameters
    ----------
    columns : str or sequence of str, optional
        What is drawn, as ``("E_GPa", "eta_Pa_s")``; by default all values that were sought, but the mean gap.
    ax : sequence of matplotlib.axes.Axes, optional
        Where to draw, one for each column; by default in a new figure.

    Returns
    -------
    list of matplotlib.axes.Axes

    Raises
    ------
    InputError
        There is no such column, the map has no axis or more than two, or there are not as many Axes as columns.
    """
    if columns is None:
        columns = [name for name in result.found if name != "mean_gap_nm"]
    names = [columns] if isinstance(columns, str) else list(checks.names("columns", columns, "columns", least=1))
    for name in names:
        checks.chosen("columns", name, tuple(result.columns))
    if len(result.shape) not in (1, 2):
        raise InputError("result", result.shape, "a map with one axis or two")
    line = len(result.shape) == 1
    panels = _panels(ax, len(names), line)
    for panel, name in zip(panels, names, strict=True):
        (_draw_line if line else _draw_image)(panel, result, name)
    if line:
        panels[-1].set_xlabel("pixel")
    return panels


def _panels(ax: Sequence[Axes] | Axes | None, count: int, line: bool) -> list[Axes]:
    """The Axes given, or new ones: above each other for lines, beside each other for images."""
    if ax is None:
        if line:
            figure = style.new_figure(figsize=(6.4, 1.0 + 1.6 * count))
            return list(figure.subplots(count, 1, sharex=True, squeeze=False)[:, 0])
        rows = -(-count // 3)
        figure = style.new_figure(figsize=(3.7 * min(count, 3) + 0.3, 3.2 * rows))
        grid = figure.subplots(rows, min(count, 3), squeeze=False).ravel()
        for empty in grid[count:]:
            empty.set_axis_off()
        return list(grid[:count])
    from matplotlib.axes import Axes

    given: list[Any] = [ax] if isinstance(ax, Axes) else list(ax)
    if len(given) != count or not all(isinstance(panel, Axes) for panel in given):
        raise InputError("ax", ax, f"{count} Axes, one for each column")
    return given


def _label(name: str) -> str:
    reading = reading_of(name)
    return f"{reading.long_name} ({reading.unit})" if reading.unit else reading.long_name


def _draw_image(panel: Axes, result: BimodalMap, name: str) -> None:
    values = np.ma.masked_invalid(result[name])
    panel.set_facecolor(_MISSING)
    image = panel.imshow(values, origin="lower", interpolation="nearest")
    panel.figure.colorbar(image, ax=panel, label=_label(name))
    panel.set_xlabel("column")
    panel.set_ylabel("row")
    panel.locator_params(integer=True)


def _draw_line(panel: Axes, result: BimodalMap, name: str) -> None:
    places = np.arange(result.shape[0])
    error = result.sigma.get(name)
    panel.errorbar(places, result[name], error, fmt=".-", capsize=2.0, lw=1.0)
    panel.set_ylabel(fill(_label(name), _WIDTH), fontsize="small")
    panel.ticklabel_format(useOffset=False)
