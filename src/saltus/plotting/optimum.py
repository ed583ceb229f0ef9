"""Picture of an optimum: the way of the search, and the bounds of the parameters."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.optimisation.optimum import Optimum
from saltus.plotting import plot, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

__all__ = ["plot_optimum"]

_WAY = style.colour_of_mode(0)  # colour of the search


@plot.register(Optimum)
def plot_optimum(
    optimum: Optimum, x: str | None = None, y: str | None = None, *, ax: Axes | None = None, legend: bool = True
) -> Axes:
    """Draw the way of the search and return the matplotlib Axes.

    The start is an open circle, the optimum a filled one. Dotted lines are bounds that are active there.

    Parameters
    ----------
    optimum : Optimum
        The optimum.
    x, y : str, optional
        A parameter that varies, or the objective; by default the first two parameters, or one and the objective.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    legend : bool, optional
        Whether a legend names start and optimum.

    Raises
    ------
    InputError
        There is no such quantity.
    """
    style.check_options(ax, x, y, legend=legend)
    known = {name: optimum.path[:, i] for i, name in enumerate(optimum.over)}
    known.setdefault(optimum.objective, optimum.path_objective)
    names = [*optimum.over, optimum.objective]
    x = names[0] if x is None else checks.chosen("quantity", x, known)
    y = names[1] if y is None else checks.chosen("quantity", y, known)
    ax = style.axes(ax)
    ax.plot(known[x], known[y], ".-", color=_WAY, linewidth=0.8, markersize=5.0)
    _mark(ax, known[x][0], known[y][0], "start", "white")
    _mark(ax, known[x][-1], known[y][-1], "optimum" if "is found" in optimum.stopped else "end", _WAY)
    active = optimum.multipliers != 0.0
    for name, draw in ((x, ax.axvline), (y, ax.axhline)):
        for limit in _limits(optimum, name, active):
            draw(limit, color=style.SURFACE, linestyle=":", linewidth=1.0)
    ax.set_xlabel(style.label_of(x))
    ax.set_ylabel(style.label_of(y))
    if legend:
        style.draw_legend(ax)
    return ax


def _mark(ax: Axes, x: float, y: float, name: str, face: str) -> None:
    ax.plot([x], [y], "o", color=_WAY, markerfacecolor=face, markersize=7.0, zorder=4.0, label=name)


def _limits(optimum: Optimum, name: str, active: NDArray[np.bool_]) -> list[float]:
    """Return the active bounds of a quantity."""
    rows = zip(optimum.constraints, optimum.limits.tolist(), active.tolist(), strict=True)
    return [limit for constraint, limit, holds in rows if constraint == name and holds]
