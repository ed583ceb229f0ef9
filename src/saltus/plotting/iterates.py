"""Picture of iterates of a map: a series, one quantity against another, or the cobweb of a map of one state."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import InputError
from saltus.maps.iterates import Iterates
from saltus.plotting import plot, style

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from saltus.system import Map

__all__ = ["draw_cobweb", "plot_iterates"]

_COUNTED = "n"  # name of the count of iterations on an axis
_FEW = 400  # states of a series up to which a thin line joins them
_GRAPH = 2000  # places at which the graph of a map of one state is drawn
_ROOM = 0.05  # part of the states' range that a cobweb shows beyond them


@plot.register(Iterates)
def plot_iterates(
    iterates: Iterates,
    x: str = _COUNTED,
    y: str | None = None,
    *,
    cobweb: bool = False,
    ax: Axes | None = None,
    legend: bool = True,
) -> Axes:
    """Draw iterates of a map and return the matplotlib Axes.

    Each state is a point in the colour of its piece. In a series of at most 400 states a thin line joins them. A cobweb
    shows the graph of a map of one state, the diagonal, and the way of the motion between them.

    Parameters
    ----------
    iterates : Iterates
        The motion.
    x, y : str, optional
        ``n``, the count of iterations, or an expression in states, parameters and outputs. By default the first state
        against the count.
    cobweb : bool, optional
        Whether a cobweb is drawn, for a map of one state.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    legend : bool, optional
        Whether a legend names the pieces, where there are several.

    Raises
    ------
    InputError
        A text that is no expression, an unknown name in it, or a cobweb of a map of several states.
    """
    style.check_options(ax, x, y, legend=legend, cobweb=cobweb)
    system = iterates.system
    if cobweb:
        if len(system.states) != 1:
            raise InputError("cobweb", cobweb, f"left out for a map of {len(system.states)} states", "it needs one")
        ax = style.axes(ax)
        x_all = iterates.states[:, 0]
        room = _ROOM * (float(np.ptp(x_all)) or abs(float(x_all[0])) or 1.0)
        low, high = float(x_all.min()) - room, float(x_all.max()) + room
        heights = draw_cobweb(ax, system, iterates.parameters, x_all, (low, high))
        ax.set_ylim(min(float(np.nanmin(heights)), low), max(float(np.nanmax(heights)), high))
    else:
        y = system.states[0] if y is None else y
        n = iterates.steps.astype(np.float64)
        columns = [n if name == _COUNTED else iterates.output(name) for name in (x, y)]
        ax = style.axes(ax)
        _draw_points(ax, iterates, columns, joined=x == _COUNTED)
        ax.set_xlabel("iteration" if x == _COUNTED else style.label_of(x))
        ax.set_ylabel("iteration" if y == _COUNTED else style.label_of(y))
    if legend and len(system.pieces) > 1:
        ax.legend()
    return ax


def _draw_points(ax: Axes, iterates: Iterates, columns: list[NDArray[np.float64]], *, joined: bool) -> None:
    x, y = columns
    if joined and len(x) <= _FEW:
        ax.plot(x, y, color="0.75", linewidth=0.7, zorder=1)
    size = 3.5 if len(x) <= _FEW else 0.8
    for k in np.unique(iterates.pieces):
        own = iterates.pieces == k
        colour, name = style.colour_of_mode(int(k)), style.plain(iterates.system.piece_names[k])
        ax.plot(
            x[own], y[own], linestyle="none", marker="o", markersize=size, markeredgewidth=0.0, color=colour, label=name
        )


def draw_cobweb(
    ax: Axes, system: Map, parameters: Mapping[str, float], x: NDArray[np.float64], window: tuple[float, float]
) -> NDArray[np.float64]:
    """Draw the graph of a map of one state, the diagonal, and a motion between them; return the graph's heights.

    Parameters
    ----------
    ax : matplotlib.axes.Axes
        Where to draw.
    system : Map
        A map of one state.
    parameters : mapping of str to float
        Its parameters.
    x : ndarray, shape (n,)
        States of the motion, each the image of the one before.
    window : (float, float)
        Interval of the state over which the graph is drawn.

    Returns
    -------
    ndarray
        Images along the window, NaN where they are no numbers.
    """
    places = np.linspace(*window, _GRAPH)
    p = system.parameter_vector(parameters)
    pieces = np.array([system.piece_index(np.array([place]), p) for place in places])
    images = np.array(
        [system.compiled.field(int(k), np.array([at]), p)[0] for k, at in zip(pieces, places, strict=True)]
    )
    images = np.where(np.isfinite(images), images, np.nan)
    ax.plot(places, places, color="0.6", linewidth=0.7)
    for k in np.unique(pieces):
        shown = np.where(pieces == k, images, np.nan)
        ax.plot(
            places, shown, color=style.colour_of_mode(int(k)), linewidth=1.6, label=style.plain(system.piece_names[k])
        )
    ax.plot(np.repeat(x, 2)[:-1], np.repeat(x, 2)[1:], color="0.35", linewidth=0.6)
    name = system.states[0]
    ax.set_xlabel(style.label_of(name))
    ax.set_ylabel(f"next {style.label_of(name)}")
    return images
