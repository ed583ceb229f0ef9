"""Picture of a family of branches, a colour for each member: a waterfall in space, or one plane."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.continuation.results.branch import Branch
from saltus.continuation.results.family import Family
from saltus.errors import InputError
from saltus.plotting import plot, style
from saltus.plotting.branch import pieces_of
from saltus.plotting.ordinates import extremes_first, ordinate_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.colors import ListedColormap
    from numpy.typing import NDArray

__all__ = ["plot_family"]

_COLOURS = ("viridis", 0.0, 0.86)  # colour map of the members and its used part, without yellow: too pale on white
_VIEW = {"elev": 24.0, "azim": -58.0}  # direction from which a waterfall is seen, in degrees
_ZOOM = 1.1  # part of its square that a waterfall fills; with labels it fills a figure of matplotlib's usual shape
_GAP = 0.5  # distance between a waterfall and its bar, in inches, with room for the height's label
_FRONT = 10.0  # zorder of the member in front; members behind it have lower ones
_TICKS = 9  # most values beside the colour bar


@plot.register(Family)
def plot_family(
    family: Family,
    x: str | None = None,
    y: str | None = None,
    *,
    over: str | None = None,
    projection: str | None = None,
    ax: Axes | None = None,
    special: bool = True,
    legend: bool = True,
) -> Axes:
    """Draw all branches of a family and return the matplotlib Axes.

    Lines are those of a branch: solid where stable, dashed where unstable, dotted in grey where orbits are no motion of
    the system. Each member has its colour; a bar beside the picture gives the members' values.

    Parameters
    ----------
    family : Family
        The family; members without a branch are left out.
    x, y : str, optional
        Quantities that `Branch.column` knows. By default the parameter, and ``min_`` of the first output or ``max_`` of
        the first state; another where that does not vary, as of `Branch`. In space `y` is the height.
    over : str, optional
        The members' parameter that gives depth and colour; by default the first.
    projection : {"3d", "2d"}, optional
        A waterfall, or all branches in one plane; by default that of `ax`, else ``"3d"``.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    special, legend : bool, optional
        Whether special points are drawn, and whether a legend and a bar name line kinds, special points and members.

    Raises
    ------
    InputError
        A quantity of another name, or nothing to draw.
    """
    style.check_options(ax, x, y, special=special, legend=legend)
    members = [(i, branch) for i, branch in enumerate(family.branches) if branch is not None]
    if not members:
        hint = next(iter(family.failures.values()), "")
        raise InputError("family", f"{len(family)} members without a branch", "a family with a branch to draw", hint)
    over = next(iter(family.over)) if over is None else checks.chosen("over", over, family.over)
    x = family.parameter if x is None else x
    members.sort(key=lambda member: family.over[over][member[0]])
    values = np.array([family.over[over][i] for i, _ in members])
    branches = [branch for _, branch in members]
    y = ordinate_of(branches, extremes_first(family.system)) if y is None else y
    curves = [pieces_of(branch, x, y) for branch in branches]
    alone = ax is None
    ax, deep = _axes(ax, projection)
    colours = _colours(len(members))
    for rank in reversed(range(len(members))):
        order = _FRONT * (1.0 - rank / len(members))
        for piece in curves[rank]:
            options = dict(style.LINES[piece.kind])
            if piece.kind != "not admissible":
                options["color"] = colours(rank)
            ax.plot(*_placed(piece.x, piece.y, values[rank], deep), zorder=order, **options)
        if special:
            _draw_special(ax, branches[rank], x, y, values[rank], deep, order)
    ax.set_xlabel(style.label_of(x))
    if deep:
        ax.set_ylabel(style.label_of(over), labelpad=8.0)
        ax.locator_params(axis="y", nbins=5)
        ax.set_zlabel(style.label_of(y))  # type: ignore[attr-defined]
    else:
        ax.set_ylabel(style.label_of(y))
    if legend:
        kinds = {piece.kind for pieces in curves for piece in pieces}
        _draw_legend(ax, [kind for kind in style.LINES if kind in kinds], branches if special else [], alone)
        _draw_bar(ax, colours, values, over, deep)
    return ax


def _axes(ax: Axes | None, projection: str | None) -> tuple[Axes, bool]:
    """Return the axes, by default of a new figure, and whether they are in space."""
    if projection is not None:
        checks.chosen("projection", projection, ("2d", "3d"))
    if ax is not None:
        deep = ax.name == "3d"
        if projection is not None and deep != (projection == "3d"):
            made = "subplots(subplot_kw={'projection': '3d'}) makes Axes in space"
            raise InputError("projection", projection, f"that of the Axes, {'3d' if deep else '2d'!r}", made)
        return ax, deep
    if projection == "2d":
        return style.axes(None), False
    space: Any = style.new_figure().add_subplot(projection="3d", **_VIEW)
    space.set_box_aspect((1.3, 1.2, 0.9), zoom=_ZOOM)
    return space, True


def _colours(count: int) -> ListedColormap:
    """Return one colour for each member, by ascending values."""
    import matplotlib
    from matplotlib.colors import ListedColormap

    name, low, high = _COLOURS
    return ListedColormap(matplotlib.colormaps[name](np.linspace(low, high, count)))


def _placed(x: Any, y: Any, depth: float, deep: bool) -> tuple[Any, ...]:
    return (x, np.full(np.shape(x), depth), y) if deep else (x, y)


def _draw_special(ax: Axes, branch: Branch, x: str, y: str, depth: float, deep: bool, order: float) -> None:
    for kind in _kinds([branch]):
        points = [point for point in branch.special_points if point.type == kind]
        places = np.array([[branch.value_at(point, x), branch.value_at(point, y)] for point in points]).T
        ax.plot(*_placed(places[0], places[1], depth, deep), zorder=order, **style.on_branches(kind).options())


def _kinds(branches: list[Branch]) -> list[str]:
    """Return the types of special points that occur, users' events last."""
    found = dict.fromkeys(point.type for branch in branches for point in branch.special_points)
    return [kind for kind in style.SPECIAL if kind in found] + [kind for kind in found if kind not in style.SPECIAL]


def _draw_legend(ax: Axes, kinds: list[str], branches: list[Branch], alone: bool) -> None:
    """Draw the legend of line kinds and special points; above the axes if these are alone in their figure."""
    from matplotlib.lines import Line2D

    handles = [Line2D([], [], label=kind, **style.LINES[kind]) for kind in kinds]
    for kind in _kinds(branches):
        marker = style.on_branches(kind)
        label = f"{kind}, {marker.meaning}" if marker.meaning else style.plain(kind)
        handles.append(Line2D([], [], label=label, **marker.options()))
    if alone:
        ax.figure.legend(handles=handles, loc="outside upper center", ncols=min(3, len(handles)), frameon=False)
    else:
        ax.legend(handles=handles)


def _draw_bar(ax: Axes, colours: ListedColormap, values: NDArray[np.float64], over: str, deep: bool) -> None:
    """Draw a bar with a cell for each member and at most `_TICKS` values beside it."""
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import BoundaryNorm

    count = len(values)
    cells = ScalarMappable(BoundaryNorm(np.arange(count + 1.0), count), colours)
    figure: Any = ax.figure
    gap = _GAP * figure.dpi / ax.get_window_extent().width if deep else 0.02
    bar = figure.colorbar(cells, ax=ax, pad=gap, shrink=0.6 if deep else 1.0)
    named = np.arange(0, count, -(-count // _TICKS))
    bar.set_ticks(named + 0.5, labels=[f"{values[i]:.4g}" for i in named])
    bar.ax.tick_params(which="both", length=0)
    bar.set_label(style.label_of(over))
