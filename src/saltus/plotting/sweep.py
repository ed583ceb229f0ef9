"""Picture of a sweep: the brute-force diagram, a strip of labels, and the leading Lyapunov exponent."""

from __future__ import annotations

from collections.abc import Iterable
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.errors import InputError
from saltus.flow.motion_kind import (
    CHAOTIC,
    CHATTERING,
    DIVERGED,
    NO_RETURN,
    QUASI_PERIODIC,
    STRANGE,
    UNRESOLVED,
)  # fmt: skip
from saltus.plotting import plot, style
from saltus.plotting.ordinates import first_that_varies
from saltus.sweeps.sweep import Sweep

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, SubFigure
    from numpy.typing import NDArray

__all__ = ["PANELS", "plot_sweep"]

PANELS = ("labels", "exponent")  # panels that can stand under the diagram
_DIRECTIONS = {"up": "#0a3d7a", "down": "#d55e00", "restart": "#1b1b1e"}  # colours of the passes

# Colours of labels in the strip.
_KINDS = {
    "period-1": "#d9e6f2",
    "period-2": "#a9c8e2",
    "period-4": "#6fa3cd",
    "period-8, -16, ...": "#3c78ad",
    "other periods": "#8cc7b5",
    "locked": "#d8d48a",
    QUASI_PERIODIC: "#f0c04a",
    STRANGE: "#e07b39",
    CHAOTIC: "#b8101f",
    UNRESOLVED: "#f2f2f2",
    NO_RETURN: "#dddddd",
    DIVERGED: "#555555",
    CHATTERING: "#7a5c3e",
}

_STRIP = 0.16  # height of a pass in the strip, in inches
_SIZE = (6.4, 4.8)  # width and height of a figure without panels, in inches
_HEIGHTS = {"labels": 0.0, "exponent": 1.15}  # height that a panel adds to the figure, strips aside, in inches


@plot.register(Sweep)
def plot_sweep(
    sweep: Sweep,
    y: str | None = None,
    *,
    panels: Iterable[str] | None = None,
    ax: Axes | None = None,
    legend: bool = True,
    colour: str | None = None,
) -> Axes:
    """Draw a brute-force diagram and return the matplotlib Axes of its points.

    Parameters
    ----------
    sweep : Sweep
        The sweep.
    y : str, optional
        A quantity or an observable of the sweep; by default the first quantity that varies.
    panels : iterable of str, optional
        Panels under the diagram. ``"labels"`` is a strip of the motions' labels, a row for each pass. ``"exponent"`` is
        the leading Lyapunov exponent per return with its error. Without a phase the flow's own exponent, which is 0, is
        left out: ``SweepOptions(exponents=2)`` has that of periodic motions. By default both, and none in given Axes.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    legend : bool, optional
        Whether a legend names passes and labels.
    colour : str, optional
        Colour of the points, as matplotlib takes it; by default one for each pass.

    Raises
    ------
    InputError
        A quantity that was not recorded, a panel of another name, panels in given Axes, or no colour.
    """
    style.check_options(ax, y, legend=legend)
    name = _quantity(sweep) if y is None else y
    column = sweep.column(name)
    chosen = (PANELS if ax is None else ()) if panels is None else checks.names("panels", panels, "names of panels")
    for panel in chosen:
        checks.chosen("panels", panel, PANELS)
    if ax is not None and chosen:
        raise InputError("panels", list(chosen), "left out where Axes are given", "they have axes of their own")
    axes = _new_axes(sweep, chosen) if ax is None else [ax]
    _draw_points(axes[0], sweep, column, colour)
    axes[0].set_ylabel(style.label_of(name))
    for panel, own in zip(chosen, axes[1:], strict=True):
        if panel == "labels":
            _draw_strip(own, sweep, legend)
        else:
            _draw_exponent(own, sweep)
    axes[-1].set_xlabel(style.label_of(sweep.parameter))
    if legend and colour is None and len(sweep.directions) > 1:
        _name_directions(axes[0], sweep)
    return axes[0]


def _quantity(sweep: Sweep) -> str:
    """Return the first quantity that varies from point to point: on a section a state may be held."""
    if not sweep.quantities:
        return sweep.observables[0]
    settings = sweep.settings
    columns = ((name, sweep.column(name)) for name in sweep.quantities)
    return first_that_varies(columns, settings.get("rtol") or 0.0, settings.get("atol") or 0.0)


def _new_axes(sweep: Sweep, panels: tuple[str, ...]) -> list[Axes]:
    """Return the Axes of the diagram and, below it, of the panels, in a new figure."""
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    strip = _STRIP * len(sweep.directions)
    heights = [strip if panel == "labels" else _HEIGHTS[panel] for panel in panels]
    size = (_SIZE[0], _SIZE[1] + sum(heights) - strip * ("labels" in panels))
    figure = style.new_figure(figsize=size, layout=ConstrainedLayoutEngine(h_pad=0.02, hspace=0.02))
    axes = figure.subplots(
        1 + len(panels), 1, sharex=True, squeeze=False, height_ratios=[size[1] - sum(heights), *heights]
    )
    for own in axes[:-1, 0]:
        own.tick_params(labelbottom=False)
    return list(axes[:, 0])


def _draw_points(ax: Axes, sweep: Sweep, column: NDArray[np.float64], colour: str | None) -> None:
    """Draw the points of each pass over those of the pass before; the fewer points, the larger they are."""
    share = max(float(np.sum(np.isfinite(column))) / len(sweep.directions), 1.0)
    size = float(np.clip(3.0 - 0.42 * np.log10(share), 0.5, 2.2))
    for row, direction in enumerate(sweep.directions):
        values = column[row]
        places = np.broadcast_to(sweep.values.reshape(-1, *(1,) * (values.ndim - 1)), values.shape)
        ax.plot(
            places.ravel(), values.ravel(), linestyle="none", marker=".", markersize=2.0 * size, markeredgewidth=0.0,
            color=style.chosen_colour(colour, _DIRECTIONS[direction]), alpha=0.75, rasterized=values.size > 20_000,
            gid=direction,
        )  # fmt: skip
    edge = 0.01 * max(float(np.ptp(sweep.values)), 1e-300)
    ax.set_xlim(float(sweep.values[0]) - edge, float(sweep.values[-1]) + edge)


def _name_directions(ax: Axes, sweep: Sweep) -> None:
    from matplotlib.lines import Line2D

    handles = [
        Line2D([], [], linestyle="none", marker="o", markersize=4.0, color=_DIRECTIONS[name], label=name)
        for name in sweep.directions
    ]
    ax.legend(handles=handles, loc="best")


def _draw_strip(ax: Axes, sweep: Sweep, legend: bool) -> None:
    """Draw a row of coloured cells for each pass, the first pass on top."""
    from matplotlib.colors import ListedColormap

    count, names = len(sweep.directions), list(_KINDS)
    kinds = [[_kind(str(label)) for label in row] for row in sweep.labels]
    seen = {kind for row in kinds for kind in row if kind}
    codes = np.array([[names.index(kind) if kind else np.nan for kind in row] for row in kinds])
    colours = ListedColormap(list(_KINDS.values()))
    edges = _edges(sweep.values)
    ax.pcolormesh(edges, np.arange(count, -1, -1), codes, cmap=colours, vmin=-0.5, vmax=len(names) - 0.5)
    ax.set_ylim(0.0, count)
    ax.set_yticks(np.arange(count) + 0.5, sweep.directions[::-1] if count > 1 else [""])
    ax.tick_params(axis="y", length=0.0)
    for row in range(1, count):
        ax.axhline(row, color="white", linewidth=0.8)
    if legend and seen:
        from matplotlib.patches import Patch

        handles = [Patch(facecolor=colour, label=kind) for kind, colour in _KINDS.items() if kind in seen]
        _figure(ax).legend(
            handles=handles, loc="outside upper center", ncols=len(handles), frameon=False,
            fontsize="small", handlelength=0.9, handleheight=0.9, handletextpad=0.4, columnspacing=0.9,
        )  # fmt: skip


def _figure(ax: Axes) -> Figure | SubFigure:
    figure: Any = ax.figure
    return figure  # type: ignore[no-any-return]


def _kind(label: str) -> str:
    """Return the key of `_KINDS` to which a label belongs."""
    if label.startswith("locked-"):
        return "locked"
    if not label.startswith("period-"):
        return label
    period = int(label.removeprefix("period-"))
    if period >= 8 and period & (period - 1) == 0:
        return "period-8, -16, ..."
    return label if label in _KINDS else "other periods"


def _edges(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the edges of cells around values: half way between neighbours."""
    if values.size == 1:
        return np.array([values[0] - 0.5, values[0] + 0.5])
    middle = 0.5 * (values[1:] + values[:-1])
    return np.concatenate([[1.5 * values[0] - 0.5 * values[1]], middle, [1.5 * values[-1] - 0.5 * values[-2]]])


def _leading(sweep: Sweep) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the leading exponent per return that is not the flow's own, and its error, shape (direction, value).

    Without a phase one exponent is 0, that of the flow's direction: of those that are known the one nearest to 0 in
    its errors. Where it is the only one, the others are below it and none is told.
    """
    exponents, errors = np.array(sweep.exponents), np.array(sweep.errors)
    if _flows_alone(sweep):
        with np.errstate(divide="ignore", invalid="ignore"):
            away = np.where(exponents == 0.0, 0.0, np.abs(exponents) / errors)
        known = np.isfinite(away)
        nearest = np.argmin(np.where(known, away, np.inf), axis=-1)[..., None]
        own = known & (np.arange(exponents.shape[-1]) == nearest)
        if exponents.shape[-1] == 1:
            own &= np.abs(exponents) <= errors
        exponents[own] = -np.inf
    leading = np.argmax(np.where(np.isfinite(exponents), exponents, -np.inf), axis=-1)[..., None]
    found, error = (
        np.take_along_axis(values, leading, -1)[..., 0] * sweep.return_times for values in (exponents, errors)
    )
    return np.where(np.isfinite(found), found, np.nan), error


def _flows_alone(sweep: Sweep) -> bool:
    """Return whether the system has no clock, neither a phase nor iterations: one exponent is 0 by itself."""
    return sweep.system.iteration is None and sweep.system.phase is None


def _draw_exponent(ax: Axes, sweep: Sweep) -> None:
    """Draw the leading exponent per return, with its error as a band."""
    ax.axhline(0.0, color="0.6", linewidth=0.7)
    for direction, leading, error in zip(sweep.directions, *_leading(sweep), strict=True):
        colour = _DIRECTIONS[direction]
        ax.fill_between(sweep.values, leading - error, leading + error, color=colour, alpha=0.2, linewidth=0.0)
        ax.plot(sweep.values, leading, color=colour, linewidth=0.9, gid=direction)
    ax.set_ylabel("$\\lambda$ per return,\nflow left out" if _flows_alone(sweep) else "$\\lambda_{1}$ per return")
