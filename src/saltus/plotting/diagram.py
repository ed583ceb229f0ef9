"""Picture of a whole diagram: equilibria and extremes of cycles, or all points of map orbits."""

from __future__ import annotations

from functools import singledispatch
from typing import TYPE_CHECKING, Any

from saltus import checks
from saltus.continuation.results.diagram import Diagram, DiagramBranch
from saltus.continuation.results.map_curve import MapBranch
from saltus.plotting import plot, style
from saltus.plotting.branch import draw_special, pieces_of
from saltus.plotting.map_orbit import at_each_point, leave_out_the_unbounded

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from saltus.continuation.results.special_points import SpecialPoint

__all__ = ["plot_diagram"]

_CYCLES = "#0f5fa8"  # colour of cycles and of map orbits
_MOVING = {"orbits": "cycles", "map orbits": "orbits"}  # what the legend calls them; autonomous orbits are cycles


@plot.register(Diagram)
def plot_diagram(
    diagram: Diagram, y: str | None = None, *, ax: Axes | None = None, special: bool = True, legend: bool = True
) -> Axes:
    """Draw all branches of a diagram and return the matplotlib Axes.

    Equilibria are black, cycles blue with two lines: the least and the greatest value over the period. Of a map, fixed
    points are black, and orbits blue with a line for each point. Stable solutions are solid, unstable ones dashed. What
    is no motion of the system is dotted in grey.

    Parameters
    ----------
    diagram : Diagram
        The diagram.
    y : str, optional
        A state or an output; by default the first output, or the first state.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    special, legend : bool, optional
        Whether special points are drawn, and whether a legend names line kinds and special points.

    Raises
    ------
    InputError
        A quantity of another name.
    """
    style.check_options(ax, y, special=special, legend=legend)
    known = [*diagram.system.output_names, *diagram.system.states]
    y = known[0] if y is None else checks.chosen("y", y, known)
    alone, ax = ax is None, style.axes(ax)
    named: set[str] = set()
    once: dict[int, list[SpecialPoint[Any]]] = {i: [] for i in range(len(diagram))}
    for i, point in diagram.numbered():
        once[i].append(point)
    for i, branch in enumerate(diagram):
        what = branch.called if branch.at_rest else _MOVING[branch.counted]
        for shown, quantity, points in _curves(branch, y, once[i]):
            for piece in pieces_of(shown, diagram.parameter, quantity):
                options: dict[str, Any] = dict(style.LINES[piece.kind])
                label = piece.kind
                if piece.kind not in style.FAULTY:
                    options |= {} if branch.at_rest else {"color": _CYCLES}
                    label = f"{piece.kind} {what}"
                ax.plot(piece.x, piece.y, label="_" if label in named else label, **options)
                named.add(label)
            if special:
                draw_special(ax, shown, diagram.parameter, quantity, points)
    if alone and diagram.system.iteration is not None:
        leave_out_the_unbounded(ax, diagram.branches, y)
    ax.set_xlabel(style.label_of(diagram.parameter))
    ax.set_ylabel(style.label_of(y))
    if legend:
        _draw_legend(ax)
    return ax


@singledispatch
def _curves(
    branch: DiagramBranch, y: str, points: list[SpecialPoint[Any]]
) -> list[tuple[DiagramBranch, str, list[SpecialPoint[Any]]]]:
    """Return the curves of a branch, each as a branch and a quantity, with those special points that are drawn."""
    names = [y] if branch.at_rest else [f"min_{y}", f"max_{y}"]
    return [(branch, name, points) for name in names]


@_curves.register(MapBranch)
def _(
    branch: MapBranch, y: str, points: list[SpecialPoint[Any]]
) -> list[tuple[DiagramBranch, str, list[SpecialPoint[Any]]]]:
    drawn = [k for k, own in enumerate(branch.special_points) if any(own.solution is p.solution for p in points)]
    return [(sheet, y, [sheet.special_points[k] for k in drawn]) for sheet in at_each_point(branch)]


def _draw_legend(ax: Axes) -> None:
    """Draw a legend in which each label stands once: lines first, then special points."""
    handles, labels = ax.get_legend_handles_labels()
    once = {label: handle for handle, label in zip(handles, labels, strict=True)}
    lines = [label for label in once if "," not in label]
    order = [*lines, *(label for label in once if label not in lines)]
    if order:
        ax.legend([once[label] for label in order], order)
