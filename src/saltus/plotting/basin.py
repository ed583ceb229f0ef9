"""Pictures of basins of attraction in a plane or along a line: each cell has the colour of its label."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.basins.map.basins import Basins
from saltus.errors import InputError, nearest
from saltus.plotting import plot, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

__all__ = ["colours_of", "draw_attractors", "labelled_image", "mark_of", "percent", "places_of", "plot_basins"]

# Colours of basins: the scheme "light" of P. Tol (SRON/EPS/TN/09-002), made for areas that carry dark marks.
_LIGHT = ("#77aadd", "#ee8866", "#eedd88", "#ffaabb", "#44bb99", "#bbcc33", "#99ddff", "#aaaa00")
_DARKER = 0.65  # brightness of a colour where it comes again, over that before

# Colours of cells without a basin; "not done" are those that a store lacks still.
_OUTCOMES: Mapping[str, str] = MappingProxyType({"diverged": "#dddddd", "undecided": "#aa3377", "not done": "#ffffff"})

_SIZE = 5.0  # diameter of an attractor's mark, in points
_EDGE = 1.1  # width of the mark's edge, in points
_CLOUD = 12  # points of an attractor up to which marks have their full size
_CLOUD_SIZE = 1.5  # diameter of the marks of an attractor of more points, in points
_DARK = "#1b1b1e"  # colour of the marks


@plot.register(Basins)
def plot_basins(
    basins: Basins,
    x: str | None = None,
    y: str | None = None,
    *,
    ax: Axes | None = None,
    colours: Mapping[str, Any] | None = None,
    marks: Mapping[str, Any] | None = None,
    legend: bool = True,
) -> Axes:
    """Draw basins with one or two free coordinates and return the matplotlib Axes.

    Each cell has its true extent and the colour of its label. The legend gives each label's part of the cells. Dots are
    the attractors' points at phase 0. They are filled within half a cell of the plane, else open and projected onto it.
    With one free coordinate the cells are a band. The title of a new figure gives the values of the frozen coordinates.

    Parameters
    ----------
    basins : Basins
        The basins.
    x, y : str, optional
        Free coordinates that go to the right and upwards; by default in the order of the grid.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    colours : mapping of str to colour, optional
        Colours of labels by name, in place of the usual ones.
    marks : mapping of str to colour, optional
        Colours of the attractors' dots by name; by default dark.
    legend : bool, optional
        Whether a legend names the labels.

    Raises
    ------
    InputError
        More than two free coordinates, no free coordinate of a name, or no label of a name in `colours`.

    Examples
    --------
    >>> import matplotlib
    >>> matplotlib.use("Agg")
    >>> axes = {"q": np.linspace(-0.9, 0.9, 10), "v": np.linspace(-0.9, 0.9, 10)}
    >>> labels = np.add.outer(axes["q"], axes["v"]) > 1e-9
    >>> ax = Basins.from_array(labels, axes, {"left": 0, "right": 1}).plot()
    >>> [text.get_text() for text in ax.get_legend().get_texts()]
    ['left  55.0 %', 'right  45.0 %']
    """
    style.check_options(ax, x, y, legend=legend)
    marks = checks.mapping("marks", marks, "names of attractors to colours")
    names = _order(basins, x, y)
    palette = colours_of(basins, colours)
    labels = np.asarray(basins.labels[...], dtype=np.uint8)
    shown = labels[None, :] if len(names) == 1 else labels if names[0] != basins.grid.names[0] else labels.T
    title = style.values_of(basins.grid.fixed) if ax is None else ""
    ax = style.axes(ax)
    if title:
        ax.set_title(title, loc="right", fontsize="medium")
    edges = [_edges(basins, name) for name in names] + ([] if len(names) == 2 else [(0.0, 1.0)])
    ax.imshow(
        labelled_image(shown, basins, palette),
        extent=(*edges[0], *edges[1]),
        origin="lower",
        interpolation="nearest",
        aspect="auto",
    )
    filled, opened = draw_attractors(ax, basins, names, marks)
    ax.set(xlim=edges[0], ylim=edges[1], xlabel=style.label_of(names[0]))
    if len(names) == 2:
        ax.set_ylabel(style.label_of(names[1]))
    else:
        ax.set_yticks([])
    if legend:
        _draw_legend(ax, _counts(labels, basins), palette, filled=filled, opened=opened)
    return ax


def _order(basins: Basins, x: str | None, y: str | None) -> tuple[str, ...]:
    """Return the free coordinates: the one to the right, then the one upwards."""
    names = basins.grid.names
    if len(names) > 2:
        sections = ", ".join(f"{name}=..." for name in names[2:])
        hint = f"take a section: basins.section({sections}).plot()"
        raise InputError("free coordinates", ", ".join(names), "one or two for a picture", hint)
    for name in (x, y):
        if name is not None and name not in names:
            raise InputError("coordinate", name, f"a free one: {', '.join(names)}", nearest(name, names))
    if x is not None and x == y:
        raise InputError("y", y, "another coordinate than x")
    first = x if x is not None else next(name for name in names if name != y or len(names) == 1)
    return (first, *(name for name in names if name != first))


def colours_of(basins: Basins, chosen: Mapping[str, Any] | None = None) -> dict[str, Any]:
    """Return the colour of each label by name; `chosen` replaces the usual colours.

    Raises
    ------
    InputError
        There is no label of a name in `chosen`.
    """
    named = [name for name in basins.attractors.labels if name not in _OUTCOMES]
    usual = {name: _colour(i) for i, name in enumerate(named)} | dict(_OUTCOMES)
    return usual | checks.mapping("colours", chosen, "labels to colours", known=usual)


def _colour(place: int) -> Any:
    """Return the colour of an attractor by its place: those of the palette, then the same, darker each time."""
    from matplotlib.colors import to_rgb

    colour, rounds = _LIGHT[place % len(_LIGHT)], place // len(_LIGHT)
    return tuple(part * _DARKER**rounds for part in to_rgb(colour)) if rounds else colour


def labelled_image(labels: NDArray[np.uint8], basins: Basins, colours: Mapping[str, Any]) -> NDArray[np.uint8]:
    """Return the picture, shape (row, column, 3), of cells in the colours of their labels.

    Parameters
    ----------
    labels : ndarray of uint8, shape (row, column)
        Labels of cells.
    basins : Basins
        The basins that the labels belong to.
    colours : mapping of str to colour
        As `colours_of` returns them.
    """
    from matplotlib.colors import to_rgb

    table = np.full((256, 3), 255, np.uint8)
    for name, byte in basins.attractors.labels.items():
        table[byte] = np.round(255.0 * np.array(to_rgb(colours[name])))
    return table[labels]


def places_of(basins: Basins, name: str) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return an attractor's points in the free coordinates, and whether each lies in the plane of the grid.

    A point off the plane is projected along the frozen coordinates, onto an oblique plane at right angles.

    Returns
    -------
    places : ndarray, shape (point, free coordinate)
    within : ndarray of bool, shape (point,)
        Whether no state is farther from the plane than half a cell's largest side.
    """
    grid = basins.grid
    points = np.atleast_2d(np.asarray(basins.attractors.points[name], dtype=np.float64)) - grid.origin
    places = np.linalg.lstsq(grid.vectors.T, points.T, rcond=None)[0].T
    apart = np.abs(points - places @ grid.vectors).max(axis=1, initial=0.0)
    return places, apart <= 0.5 * max(grid.spacing)


def draw_attractors(ax: Axes, basins: Basins, names: tuple[str, ...], marks: Mapping[str, Any]) -> tuple[bool, bool]:
    """Mark the attractors' points; return whether any mark is filled, and whether any is open."""
    columns = [basins.grid.names.index(name) for name in names]
    met = [False, False]
    for name in basins.attractors.points:
        places, within = places_of(basins, name)
        for inside in (True, False):
            chosen = places[within == inside][:, columns]
            if chosen.size:
                met[not inside] = True
                across = chosen[:, 0], chosen[:, 1] if len(columns) == 2 else np.full(len(chosen), 0.5)
                options = mark_of(marks.get(name, _DARK), filled=inside)
                if len(places) > _CLOUD:  # the bright edge of one mark must not cover the next mark
                    ax.plot(*across, **options | {"markersize": _CLOUD_SIZE + 2.0 * _EDGE, "markerfacecolor": "white"})
                    options |= {"markersize": _CLOUD_SIZE, "markeredgewidth": 0.0}
                ax.plot(*across, **options)
    return met[0], met[1]


def mark_of(colour: Any, *, filled: bool) -> dict[str, Any]:
    """Return options of `Axes.plot` for an attractor's points, as marks that are visible on every basin.

    Examples
    --------
    >>> mark_of("red", filled=False)["markeredgecolor"], mark_of("red", filled=True)["markerfacecolor"]
    ('red', 'red')
    """
    from matplotlib.patheffects import withStroke

    return {
        "linestyle": "none",
        "marker": "o",
        "markersize": _SIZE,
        "markeredgewidth": _EDGE,
        "zorder": 5,
        "markerfacecolor": colour if filled else "white",
        "markeredgecolor": "white" if filled else colour,
        "path_effects": [] if filled else [withStroke(linewidth=3.0 * _EDGE, foreground="white")],
    }


def _edges(basins: Basins, name: str) -> tuple[float, float]:
    low, high, _ = basins.grid.ranges[basins.grid.names.index(name)]
    return low, high


def _counts(labels: NDArray[np.uint8], basins: Basins) -> dict[str, float]:
    """Return each label's part of the cells, without outcomes that no cell has."""
    found = np.bincount(labels.ravel(), minlength=256) / labels.size
    known = dict(basins.attractors.labels)
    parts = {name: float(found[byte]) for name, byte in known.items() if name not in _OUTCOMES or found[byte] > 0.0}
    rest = 1.0 - sum(float(found[byte]) for byte in known.values())
    return parts | ({"not done": rest} if rest > 0.5 / labels.size else {})


def _draw_legend(
    ax: Axes, parts: Mapping[str, float], colours: Mapping[str, Any], *, filled: bool, opened: bool
) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    handles: list[Any] = [
        Patch(facecolor=colours[name], edgecolor="0.4", linewidth=0.4, label=f"{style.plain(name)}  {percent(part)}")
        for name, part in parts.items()
    ]
    for wanted, name in ((filled, "attractor"), (opened, "attractor, projected")):
        if wanted:
            handles.append(Line2D([], [], label=name, **mark_of(_DARK, filled=name == "attractor")))
    ax.legend(handles=handles, loc="lower left", bbox_to_anchor=(0.0, 1.01), ncols=2, borderaxespad=0.0, frameon=False)


def percent(part: float) -> str:
    """Return a part of the cells as text.

    Examples
    --------
    >>> percent(0.92345), percent(0.0), percent(2e-5)
    ('92.3 %', '0 %', '0.002 %')
    """
    if part in (0.0, 1.0):
        return f"{100.0 * part:.0f} %"
    if min(part, 1.0 - part) >= 0.001:
        return f"{100.0 * part:.1f} %"
    return f"{100.0 * part:.1g} %" if part < 0.5 else f"{100.0 * part:.3f} %"
