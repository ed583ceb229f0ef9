"""Pictures of orbits of maps: a cobweb or points in the plane, and branches along a parameter."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.results.map_curve import MapBranch
from saltus.continuation.results.special_points import SpecialPoints
from saltus.maps import MapOrbit
from saltus.maps.orbit import itinerary_of
from saltus.plotting import plot, style
from saltus.plotting.branch import draw_branch
from saltus.plotting.iterates import draw_cobweb
from saltus.plotting.ordinates import ordinate_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

__all__ = ["at_each_point", "leave_out_the_unbounded", "plot_map_branch", "plot_map_orbit", "turned_orbit"]

_STEEP = 0.05  # part of the parameter's range, next to an unbounded end, whose orbits do not set the axis' limits
_MARGIN = 0.05  # room above and below the orbits shown, over their range
_ROOM = 0.5  # part of the points' range, or of a fixed point, that a cobweb shows beyond them


@plot.register(MapOrbit)
def plot_map_orbit(
    orbit: MapOrbit, x: str | None = None, y: str | None = None, *, ax: Axes | None = None, legend: bool = True
) -> Axes:
    """Draw an orbit of a map and return the matplotlib Axes.

    An orbit of one state is a cobweb: the graph of the map, the diagonal, and the way between the points. That of
    several states is drawn as points in the plane of two quantities, with thin lines from each point to its image. Each
    point has the colour of its piece. It is filled where the orbit is stable, else open.

    Parameters
    ----------
    orbit : MapOrbit
        The orbit.
    x, y : str, optional
        Expressions in states, parameters and outputs. By default the first two states, for one state a cobweb.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    legend : bool, optional
        Whether a legend names the pieces, where there are several.

    Raises
    ------
    InputError
        A text that is no expression, or an unknown name in it.
    """
    style.check_options(ax, x, y, legend=legend)
    system = orbit.system
    if x is None and y is None and len(system.states) == 1:
        ax = style.axes(ax)
        _draw_closed_cobweb(ax, orbit)
    else:
        names = [system.states[0] if x is None else x, system.states[:2][-1] if y is None else y]
        columns = [orbit.output(name) for name in names]
        ax = style.axes(ax)
        if orbit.period > 1:
            ax.plot(*(np.append(column, column[0]) for column in columns), color="0.75", linewidth=0.7, zorder=1)
        _draw_points(ax, orbit, columns[0], columns[1])
        ax.set_xlabel(style.label_of(names[0]))
        ax.set_ylabel(style.label_of(names[1]))
    stable = "stable" if orbit.stable else "unstable"
    ax.set_title(f"{stable} fixed point" if orbit.period == 1 else f"{stable} orbit of period {orbit.period}")
    if legend and system.is_piecewise:
        style.draw_legend(ax)
    return ax


def _draw_closed_cobweb(ax: Axes, orbit: MapOrbit) -> None:
    """Draw the cobweb of an orbit of one state, its points on the graph."""
    x = orbit.points[:, 0]
    room = _ROOM * (float(np.ptp(x)) or abs(float(x[0])) or 1.0)
    low, high = float(x.min()) - room, float(x.max()) + room
    draw_cobweb(ax, orbit.system, orbit.parameters, np.append(x, x[0]), (low, high))
    _draw_points(ax, orbit, x, np.roll(x, -1), named=False)
    ax.set(xlim=(low, high), ylim=(low, high))


def _draw_points(
    ax: Axes, orbit: MapOrbit, x: NDArray[np.float64], y: NDArray[np.float64], *, named: bool = True
) -> None:
    """Draw the points of an orbit in the colours of their pieces."""
    pieces = np.array(itinerary_of(orbit.system, orbit.itinerary))
    for k in np.unique(pieces).tolist():
        marker = style.Marker(orbit.system.piece_names[k], "o", style.colour_of_mode(k), filled=orbit.stable, size=6.0)
        label = style.plain(marker.meaning) if named else "_"
        ax.plot(x[pieces == k], y[pieces == k], label=label, zorder=3, **marker.options())


@plot.register(MapBranch)
def plot_map_branch(
    branch: MapBranch,
    x: str | None = None,
    y: str | None = None,
    *,
    ax: Axes | None = None,
    special: bool = True,
    legend: bool = True,
    colour: str | None = None,
) -> Axes:
    """Draw a branch of orbits of a map and return the matplotlib Axes.

    Stable orbits are solid, unstable ones dashed, virtual ones dotted in grey. An orbit of period k has k curves, one
    for each point. Curves are interpolated between their points as that of a `Branch`, with corners at border
    collisions. Where a branch runs to infinity, the axis of a new figure ends before it.

    Parameters
    ----------
    branch : MapBranch
        The branch.
    x, y : str, optional
        Quantities that `MapBranch.column` knows. By default the parameter, and the first output or state that varies.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    special, legend : bool, optional
        Whether special points are drawn, and whether a legend names line kinds and special points.
    colour : str, optional
        Colour of the curve where it is a motion of the system, as matplotlib takes it; by default black.

    Raises
    ------
    InputError
        A quantity of another name, or no colour.
    """
    style.check_options(ax, x, y, special=special, legend=legend)
    x = branch.parameter if x is None else x
    sheets = at_each_point(branch)
    y = ordinate_of(sheets, [*branch.system.output_names, *branch.system.states], ax) if y is None else y
    drawn = draw_branch(sheets, x, y, ax, special=special, legend=legend, colour=colour)
    if ax is None and x == branch.parameter:
        leave_out_the_unbounded(drawn, [branch], y)
    return drawn


def leave_out_the_unbounded(ax: Axes, branches: Sequence[Any], y: str) -> None:
    """Limit the axis to where branches that run to infinity still depend on the parameter."""
    shown, hidden = [np.empty(0)], False
    for branch in branches:
        values, near = branch.values, np.zeros(len(branch), bool)
        for end, reason in zip((0, -1), branch.stopped, strict=True):
            if "without bound" in reason:
                near |= np.abs(values - values[end]) < _STEEP * float(np.ptp(values))
        hidden |= bool(np.any(near))
        shown += [sheet.column(y)[~near] for sheet in at_each_point(branch)]
    heights = np.concatenate(shown)
    if hidden and heights.size:
        low, high = float(heights.min()), float(heights.max())
        room = _MARGIN * ((high - low) or abs(high) or 1.0)
        ax.set_ylim(low - room, high + room)


def at_each_point(branch: MapBranch) -> list[MapBranch]:
    """Return a branch of orbits once for each point of an orbit, which stands first."""
    found = []
    for k in range(branch.period):
        points = [replace(point, solution=turned_orbit(point.map_orbit, k)) for point in branch.special_points]
        found.append(
            replace(
                branch,
                points=np.roll(branch.points, -k, axis=1),
                forms=tuple((*form[k:], *form[:k]) for form in branch.forms),
                special_points=SpecialPoints(points, branch.varied),
            )
        )
    return found


def turned_orbit(orbit: MapOrbit, first: int) -> MapOrbit:
    """Return the same orbit, another of its points the first one."""
    itinerary = (*orbit.itinerary[first:], *orbit.itinerary[:first])
    return replace(orbit, points=np.roll(orbit.points, -first, axis=0), itinerary=itinerary)
