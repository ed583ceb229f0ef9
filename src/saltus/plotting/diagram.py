"""Picture of a whole diagram: equilibria, and the least and greatest values of cycles, along one parameter."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from saltus import checks
from saltus.continuation.diagram_tree import Diagram
from saltus.continuation.equilibrium_branch import EquilibriumBranch
from saltus.plotting import plot, style
from saltus.plotting.branch import draw_special, pieces_of

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from saltus.continuation.special_points import SpecialPoint

__all__ = ["plot_diagram"]

_CYCLES = "#0f5fa8"  # colour of cycles


@plot.register(Diagram)
def plot_diagram(
    diagram: Diagram, y: str | None = None, *, ax: Axes | None = None, special: bool = True, legend: bool = True
) -> Axes:
    """Draw all branches of a diagram and return the matplotlib Axes.

    Equilibria are black, cycles blue with two lines: the least and the greatest value over the period. Stable solutions
    are solid, unstable ones dashed, those that are no motion of the system dotted in grey.

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
    ax = style.axes(ax)
    named: set[str] = set()
    once: dict[int, list[SpecialPoint[Any]]] = {i: [] for i in range(len(diagram))}
    for i, point in diagram.numbered():
        once[i].append(point)
    for i, branch in enumerate(diagram):
        rest = isinstance(branch, EquilibriumBranch)
        for quantity in [y] if rest else [f"min_{y}", f"max_{y}"]:
            for piece in pieces_of(branch, diagram.parameter, quantity):
                options: dict[str, Any] = dict(style.LINES[piece.kind])
                label = piece.kind
                if piece.kind not in style.FAULTY:
                    options |= {} if rest else {"color": _CYCLES}
                    label = f"{piece.kind} {'equilibria' if rest else 'cycles'}"
                ax.plot(piece.x, piece.y, label="_" if label in named else label, **options)
                named.add(label)
            if special:
                draw_special(ax, branch, diagram.parameter, quantity, once[i])
    ax.set_xlabel(style.label_of(diagram.parameter))
    ax.set_ylabel(style.label_of(y))
    if legend:
        _draw_legend(ax)
    return ax


def _draw_legend(ax: Axes) -> None:
    """Draw a legend in which each label stands once: lines first, then special points."""
    handles, labels = ax.get_legend_handles_labels()
    once = {label: handle for handle, label in zip(handles, labels, strict=True)}
    lines = [label for label in once if "," not in label]
    order = [*lines, *(label for label in once if label not in lines)]
    if order:
        ax.legend([once[label] for label in order], order)
