"""Basins of attraction over a plane through the selected orbit; a click on a cell runs its motion."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.explorer import look, widgets
from saltus.explorer.kinds import kind_of
from saltus.explorer.solutions import traits_of
from saltus.plotting.basin import colours_of, labelled_image, percent, places_of

if TYPE_CHECKING:
    from saltus.basins import Basins
    from saltus.explorer.session import Session

__all__ = ["BasinView"]

_COARSE = 50  # cells along each side of the first picture
_FINE = {"100 x 100": 100, "200 x 200": 200, "400 x 400": 400}
_MARGIN = 0.6  # by how much of its size an orbit's surroundings are larger than the orbit, on each side


class BasinView:
    """Basins.

    Parameters
    ----------
    session : Session
        What is shown.
    wanted : callable
        Called with free coordinates and their ranges, frozen ones and their values, and counts of cells along a side,
        when basins are asked for.
    clicked : callable
        Called with a full start state when a cell is clicked.
    """

    def __init__(
        self,
        session: Session,
        wanted: Callable[[dict[str, tuple[float, float]], dict[str, float], tuple[int, int]], None],
        clicked: Callable[[list[float]], None],
    ) -> None:
        from bokeh.events import Tap
        from bokeh.models import ColumnDataSource

        self._session, self._wanted, self._clicked = session, wanted, clicked
        self._solution: Any = None
        self._basins: Basins | None = None
        states = list(session.system.states)
        self._pair = [self._select("to the right", states, 0), self._select("upwards", states, min(1, len(states) - 1))]
        self._ends = [widgets.number(title, 0.0, 92) for title in ("from", "to", "from", "to")]
        self._cells = widgets.choice("cells", _FINE, 100, 96)
        go = widgets.button("Map basins", "map-basins", kind="primary")
        widgets.on_click(go, self._go)
        self.figure = look.figure_of("basins", height=330, sizing_mode="stretch_width")
        self._image = ColumnDataSource({"image": [], "x": [], "y": [], "dw": [], "dh": []})
        self._dots = ColumnDataSource({"x": [], "y": [], "name": []})
        look.draw(self.figure, "ImageRGBA", self._image, name="image")
        look.draw(self.figure, "Scatter", self._dots, size=8, fill_color="#ffffff", line_color="#1b1b1e")
        tapped = widgets.guarded(self._cell)
        self.figure.on_event(Tap, lambda event: tapped(event.x, event.y))
        self._legend = widgets.html("basin-legend")
        first, second = (widgets.row(one, *ends) for one, ends in self._sides())
        self.panel = widgets.column(
            first, second, widgets.row(self._cells, go), widgets.pane(self.figure), self._legend
        )
        self._frame()

    def _sides(self) -> Iterator[tuple[Any, list[Any]]]:
        """Go through the choosers of both coordinates, each with the fields of its range."""
        return zip(self._pair, (self._ends[:2], self._ends[2:]), strict=True)

    def _select(self, title: str, states: list[str], index: int) -> Any:
        widget = widgets.choice(title, states, states[index], 100)
        widgets.on_change(widget, lambda _: self._frame())
        return widget

    def solution_is(self, solution: Any) -> None:
        """Take the orbit or the equilibrium through which the plane goes."""
        before, self._solution = self._solution, solution
        if before is None or [*before.x0] != [*solution.x0] or before.parameters != solution.parameters:
            self._frame()

    @property
    def interval(self) -> float | None:
        """Time between two looks at a motion where time has no unit of its own: a period of the solution."""
        return traits_of(self._solution).interval if kind_of(self._session.system).own_time else None

    def _frame(self) -> None:
        """Set the ranges to the surroundings of the orbit."""
        for chooser, ends in self._sides():
            low, high = self._surroundings(chooser.value)
            ends[0].value, ends[1].value = float(f"{low:.4g}"), float(f"{high:.4g}")

    def _surroundings(self, name: str) -> tuple[float, float]:
        index, solution = self._session.system.states.index(name), self._solution
        if solution is None:
            return -1.0, 1.0
        low, high = (float(ends[index]) for ends in solution.extremes)
        wide = (high - low) or 2.0 * abs(high) or 1.0
        return low - _MARGIN * wide, high + _MARGIN * wide

    def _go(self) -> None:
        x, y = (chooser.value for chooser in self._pair)
        low_x, high_x, low_y, high_y = (float("nan" if widget.value is None else widget.value) for widget in self._ends)
        states = self._session.system.states
        solution, start = self._solution, self._session.settings.x0
        if solution is not None:
            start = tuple(solution.x0)
        frozen = {name: float(start[i]) for i, name in enumerate(states) if name not in (x, y)}
        free = {x: (low_x, high_x)} | ({y: (low_y, high_y)} if y != x else {})
        self._wanted(free, frozen, (_COARSE, int(self._cells.value)))

    def region(self, free: dict[str, tuple[float, float]]) -> dict[str, tuple[float, float]]:
        """Return a box of all states about a plane, in which attractors are looked for."""
        return {name: free.get(name, self._surroundings(name)) for name in self._session.system.states}

    def show(self, basins: Basins) -> None:
        """Show basins over two coordinates."""
        if basins is self._basins:
            return
        self._basins = basins
        x, y = basins.grid.names
        (left, right), (low, high) = ((float(axis[0]), float(axis[-1])) for axis in basins.grid.axes)
        dx, dy = basins.grid.spacing
        image = labelled_image(np.asarray(basins.labels).T, basins, colours_of(basins))
        rgba = np.dstack([image, np.full(image.shape[:2], 255, np.uint8)])
        packed = np.ascontiguousarray(rgba).view(np.uint32).reshape(image.shape[:2])
        self._image.data = {
            "image": [packed], "x": [left - 0.5 * dx], "y": [low - 0.5 * dy],
            "dw": [right - left + dx], "dh": [high - low + dy],
        }  # fmt: skip
        ends = [left - 0.5 * dx, right + 0.5 * dx], [low - 0.5 * dy, high + 0.5 * dy]
        look.fit(self.figure, *ends, 0.0)
        dots: dict[str, list[Any]] = {"x": [], "y": [], "name": []}
        for name in basins.attractors.points:
            for a, b in places_of(basins, name)[0].tolist():
                dots["x"].append(a)
                dots["y"].append(b)
                dots["name"].append(name)
        self._dots.data = dots
        self.figure.xaxis.axis_label, self.figure.yaxis.axis_label = look.bare_label(x), look.bare_label(y)
        self._legend.object = _legend(basins)

    def _cell(self, x: float, y: float) -> None:
        """Run the motion from the centre of the cell that was clicked."""
        if self._basins is None or x is None:
            return
        grid = self._basins.grid
        start = {**grid.fixed}
        for name, axis, value in zip(grid.names, grid.axes, (x, y), strict=True):
            start[name] = float(axis[int(np.argmin(np.abs(axis - value)))])
        self._clicked([start[name] for name in self._session.system.states])


def _legend(basins: Basins) -> str:
    """Return HTML that names attractors with their colours and shares."""
    from matplotlib.colors import to_hex

    colours, shares = colours_of(basins), basins.fractions()
    rows = [
        f'<li><span class="swatch" style="background:{to_hex(colours[name])}"></span>{escape(name)} '
        f"<b>{escape(percent(share))}</b></li>"
        for name, share in shares.items()
        if share > 0.0
    ]
    shape = " x ".join(f"{count}" for count in np.shape(basins.labels))
    return f"<ul>{''.join(rows)}</ul><p>{shape} cells; click on one to follow its motion.</p>"
