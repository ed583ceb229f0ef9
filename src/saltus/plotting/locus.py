"""Picture of a locus in the plane or in space: a curve in the colour of its type, with special points."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.results.parameters import TwoParameters
from saltus.errors import InputError
from saltus.plotting import plot, style
from saltus.plotting.space import axes_in_space, coordinates_of, stretches_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_locus"]

_WIDE = 80  # characters of three entries of a legend from which on it has two columns


@plot.register(TwoParameters)
def plot_locus(
    locus: TwoParameters[Any],
    x: str | None = None,
    y: str | None = None,
    *,
    z: str | None = None,
    ax: Axes | None = None,
    special: bool = True,
    legend: bool = True,
    colour: str | None = None,
) -> Axes:
    """Draw a locus of orbits, of equilibria or of orbits of a map and return the matplotlib Axes.

    The curve has the colour of its type's special points. It is solid where all multipliers or eigenvalues but the
    critical ones are stable, else dashed. It is dotted in grey where the solutions are no motion of the system. A GR
    locus, whose multipliers are infinite, is solid. Between its points the curve is interpolated in arclength.

    Parameters
    ----------
    locus : Locus, EquilibriumLocus or MapLocus
        The locus.
    x, y : str, optional
        Quantities that its `column` knows; by default the two parameters.
    z : str, optional
        A third quantity: the height of a picture in space.
    ax : matplotlib.axes.Axes, optional
        Where to draw, in space if `z` is given; by default in a new figure.
    special, legend : bool, optional
        Whether special points are drawn, and whether a legend names the locus and its special points.
    colour : str, optional
        Colour of the curve where it is a motion of the system, as matplotlib takes it; by default that of its type.

    Raises
    ------
    InputError
        A quantity of another name, `z` with axes in the plane, or no colour.
    """
    style.check_options(ax, x, y, z, special=special, legend=legend)
    names = [locus.names[0] if x is None else x, locus.names[1] if y is None else y]
    names += [] if z is None else [z]
    stretches = stretches_of(locus, names)
    alone = ax is None
    ax = _axes(ax, deep=z is not None)
    named: set[str] = set()
    for stretch in stretches:
        options = style.line_of(stretch.kind, colour or style.on_branches(locus.type).colour)
        label = "_" if stretch.kind in named else _meaning(locus, stretch.kind)
        ax.plot(*stretch.places, label=label, **options)
        named.add(stretch.kind)
    if special:
        _draw_special(ax, locus, names)
    for axis, name in zip("xyz", names, strict=False):
        ax.set(**{f"{axis}label": style.label_of(name)})
    if legend and named:
        _draw_legend(ax, alone and z is not None)
    return ax


def _axes(ax: Axes | None, *, deep: bool) -> Axes:
    if ax is not None:
        if deep != (ax.name == "3d"):
            hint = "subplots(subplot_kw={'projection': '3d'}) makes Axes in space, for a picture with z"
            raise InputError("ax", ax.name, "Axes in space" if deep else "Axes in the plane", hint)
        return ax
    return axes_in_space() if deep else style.axes(None)


def _draw_legend(ax: Axes, above: bool) -> None:
    if above:
        handles, labels = ax.get_legend_handles_labels()
        columns = 3 if 3 * max(map(len, labels)) < _WIDE else 2
        ax.figure.legend(handles, labels, loc="outside upper center", ncols=min(columns, len(handles)), frameon=False)
    else:
        style.draw_legend(ax)


def _meaning(locus: TwoParameters[Any], stability: str) -> str:
    if stability in style.FAULTY:
        return stability
    own = locus.type in style.SPECIAL
    known = f"{locus.type}, {style.on_branches(locus.type).meaning}" if own else f"{locus.type} kept"
    return known + (f", of unstable {locus.counted}" if stability == "unstable" else "")


def _draw_special(ax: Axes, locus: TwoParameters[Any], names: list[str]) -> None:
    for kind in dict.fromkeys(point.type for point in locus.special_points):
        marker = style.SPECIAL[kind]
        places = [coordinates_of(locus, point, names) for point in locus.special_points.of_type(kind)]
        ax.plot(*np.transpose(places), label=f"{kind}, {marker.meaning}", zorder=6, **marker.options())
