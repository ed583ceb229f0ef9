"""Branches and loci over three quantities, as two parameters and an extreme; a drag turns them, in the browser."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.results.curve import SolutionCurve
from saltus.errors import SaltusError
from saltus.explorer import colours, look, widgets
from saltus.explorer.drawing import default_axes, quantities_of, sheets_of
from saltus.explorer.points.label_places import places_beside
from saltus.plotting import style
from saltus.plotting.space import coordinates_of, stretches_of

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.explorer.session import Session

__all__ = ["SpaceView", "projected"]

_AZIMUTH = -58.0  # degrees from which space is seen at first
_ELEVATION = 24.0  # likewise
_EDGES = ((0, 1), (0, 2), (0, 4), (1, 3), (1, 5), (2, 3), (2, 6), (3, 7), (4, 5), (4, 6), (5, 7), (6, 7))  # of a cube
_HALF = 1.9  # half of what the figure shows; the cube's corners are at -1 and 1

_SIZE = (600.0, 340.0)  # pixels of a frame whose size is not yet known
_NAMED = ("ends", "marks")  # tables with labels; those of the first ones take their places first

# what `projected` does, for each table; what is drawn is changed in place, and only the last direction is told
_TURN = """
view.turned ??= {azimuth: view.data.azimuth[0], elevation: view.data.elevation[0]}
if (cb_obj.event_name == 'pan') {
  view.turned.azimuth -= 0.4 * cb_obj.delta_x
  view.turned.elevation = Math.max(-90, Math.min(90, view.turned.elevation - 0.4 * cb_obj.delta_y))
}
const a = view.turned.azimuth * Math.PI / 180, e = view.turned.elevation * Math.PI / 180
const right = (x, y) => y * Math.cos(a) - x * Math.sin(a)
const up = (x, y, z) => z * Math.cos(e) - (x * Math.cos(a) + y * Math.sin(a)) * Math.sin(e)
for (const table of tables) {
  const {x, y, z, u, v} = table.data
  for (let i = 0; i < x.length; i++) {
    if (typeof x[i] == 'number') { u[i] = right(x[i], y[i]); v[i] = up(x[i], y[i], z[i]) }
    else for (let k = 0; k < x[i].length; k++) {
      u[i][k] = right(x[i][k], y[i][k]); v[i][k] = up(x[i][k], y[i][k], z[i][k])
    }
  }
  table.change.emit()
}
if (cb_obj.event_name != 'pan') {
  view.data = {azimuth: [view.turned.azimuth], elevation: [view.turned.elevation]}
  view.turned = null
}
"""


def projected(places: NDArray[np.float64], azimuth: float, elevation: float) -> NDArray[np.float64]:
    """Return places in space as seen from far away.

    Parameters
    ----------
    places : ndarray, shape (3, place)
        Coordinates.
    azimuth, elevation : float
        Direction from which they are seen, in degrees.

    Returns
    -------
    ndarray, shape (2, place)
        To the right and upwards.

    Examples
    --------
    >>> projected(np.eye(3), 0.0, 0.0)  # seen along the first axis
    array([[0., 1., 0.],
           [0., 0., 1.]])
    """
    a, e = math.radians(azimuth), math.radians(elevation)
    right = [-math.sin(a), math.cos(a), 0.0]
    up = [-math.cos(a) * math.sin(e), -math.sin(a) * math.sin(e), math.cos(e)]
    return np.array([right, up]) @ places + 0.0


class SpaceView:
    """The diagram over three quantities.

    Parameters
    ----------
    session : Session
        What is shown.
    colour : callable
        Returns the colour of a result's curve by its place in the list.
    """

    def __init__(self, session: Session, colour: Callable[[int], str]) -> None:
        self._session, self._colour = session, colour
        names = quantities_of(session.system)
        first, *others = session.system.parameter_names or ("t",)
        _, height = default_axes(session.system, first)
        self._axes = [
            widgets.quantity(title, names, value, 104, f"space-{letter}")
            for letter, title, value in zip(
                "xyz", ("first", "second", "height"), (first, (others or [first])[0], height), strict=True
            )
        ]
        for widget in self._axes:
            widgets.on_change(widget, lambda _: self.redraw())
        self.figure = look.figure_of("space", height=380, max_width=620, sizing_mode="stretch_width")
        self._tables = self._glyphs()
        self._text = widgets.html("space-text")
        self.panel = widgets.column(widgets.row(*self._axes), widgets.pane(self.figure), self._text)
        self.redraw()

    def _glyphs(self) -> dict[str, Any]:
        from bokeh.events import Pan, PanEnd, RangesUpdate, Reset
        from bokeh.models import ColumnDataSource, CustomJS, HoverTool, PanTool

        made = self.figure
        tables = {name: ColumnDataSource(_empty(name)) for name in _COLUMNS}
        look.draw(made, "MultiLine", tables["box"], xs="u", ys="v", line_color="#c3c9d1", line_width=1.0)
        lines = look.draw(
            made, "MultiLine", tables["curves"], xs="u", ys="v", line_color="colour", line_dash="dash", line_width=2.0,
            name="curves",
        )  # fmt: skip
        marks = look.draw(
            made, "Scatter", tables["marks"], x="u", y="v", size=8, marker="marker", line_color="colour",
            fill_color="fill", name="marks",
        )  # fmt: skip
        for name in _NAMED:
            look.draw(
                made, "Text", tables[name], x="u", y="v", text="label", x_offset="aside", y_offset="below",
                text_align="align", text_font_size="10px", text_color="colour", name=f"{name}-labels",
            )  # fmt: skip
        made.add_tools(HoverTool(renderers=[marks, lines], tooltips=[("", "@name")]))
        made.toolbar.tools = [tool for tool in made.toolbar.tools if not isinstance(tool, PanTool)]
        made.toolbar.active_drag = None
        made.axis.visible = made.grid.visible = False
        look.fit(made, [-_HALF, _HALF], [-_HALF, _HALF], 0.0)
        self._view = ColumnDataSource({"azimuth": [_AZIMUTH], "elevation": [_ELEVATION]})
        turn = CustomJS(args={"tables": list(tables.values()), "view": self._view}, code=_TURN)
        for event in (Pan, PanEnd, Reset):
            made.js_on_event(event, turn)
        turned = widgets.guarded(self._turned)
        self._view.on_change("data", lambda attribute, before, now: turned())
        made.on_event(RangesUpdate, lambda _: turned())
        made.on_change("inner_width", lambda attribute, before, now: turned())
        return tables

    def redraw(self) -> None:
        """Draw all branches and loci that are not hidden and have the three quantities."""
        names = [widget.value for widget in self._axes]
        if not all(names):
            return
        curves, marks, unseen = [], [], []
        for number, entry in enumerate(self._session.entries):
            if entry.name in self._session.settings.hidden or not isinstance(entry.result, SolutionCurve):
                continue
            try:
                sheets = sheets_of(entry.result, names)
                found = (stretch for sheet in sheets for stretch in stretches_of(sheet, names))
                curves += [(stretch, self._colour(number), entry.name) for stretch in found]
                points = entry.result.special_points
                marks += [(p, coordinates_of(entry.result, p, names), entry.name) for p in points]
            except SaltusError as error:
                unseen.append(f"{entry.name}: {error}")
        self._text.object = "<br>".join(map(escape, unseen))
        self._show(curves, marks, names)

    def _show(self, curves: list[Any], marks: list[Any], names: list[str]) -> None:
        places = [stretch.places for stretch, _, _ in curves] + [place[:, None] for _, place, _ in marks]
        every = np.hstack(places) if places else np.zeros((3, 0))
        every = every[:, np.all(np.isfinite(every), axis=0)]
        low, high = (every.min(axis=1), every.max(axis=1)) if every.size else (np.zeros(3), np.ones(3))
        wide = np.where(high > low, high - low, 1.0)[:, None]
        tables = {name: _empty(name) for name in _COLUMNS}
        for stretch, colour, name in curves:
            sound = stretch.kind not in style.FAULTY
            told = {"name": name, "dash": look.DASHES[stretch.kind], "colour": colour if sound else "#999999"}
            _add(tables["curves"], 2.0 * (stretch.places - low[:, None]) / wide - 1.0, **told)
        for point, place, _ in marks:
            form = style.SPECIAL.get(point.type, style.EVENT)
            told = {"name": point.label, "marker": colours.MARKERS[form.marker], "colour": form.colour}
            told["fill"] = form.colour if form.filled else "#ffffff"
            _add(tables["marks"], 2.0 * (place - low) / wide[:, 0] - 1.0, **told)
        for place, text in _box_texts(names, low, high):
            _add(tables["ends"], place, name=text, colour="#5c6570")
        corners = np.array([[2.0 * (k >> axis & 1) - 1.0 for k in range(8)] for axis in range(3)])
        for first, last in _EDGES:
            _add(tables["box"], corners[:, [first, last]])
        self._name({name: tables[name] for name in _NAMED})
        for name, table in tables.items():
            self._tables[name].data = table
        if every.size:
            self._view.data = {"azimuth": [_AZIMUTH], "elevation": [_ELEVATION]}

    def _turned(self) -> None:
        """Place labels anew: space is seen from elsewhere, or by another size."""
        tables = {name: {key: [*column] for key, column in self._tables[name].data.items()} for name in _NAMED}
        (azimuth,), (elevation,) = self._view.data["azimuth"], self._view.data["elevation"]
        for table in tables.values():
            places = np.array([table[axis] for axis in "xyz"], dtype=np.float64)
            table["u"], table["v"] = projected(places, azimuth, elevation).tolist()
        self._name(tables)
        for name, table in tables.items():
            self._tables[name].data = table

    def _name(self, tables: dict[str, dict[str, list[Any]]]) -> None:
        """Write labels where there is room; one without stays away, and the pointer tells it."""
        size = look.frame_of(self.figure, _SIZE)
        x, y = self.figure.x_range, self.figure.y_range
        across, down = size[0] / (float(x.end - x.start) or 1.0), size[1] / (float(y.end - y.start) or 1.0)
        seen = [
            ((u - x.start) * across, (y.end - v) * down)
            for table in tables.values()
            for u, v in zip(table["u"], table["v"], strict=True)
        ]
        beside = iter(places_beside(seen, [name for table in tables.values() for name in table["name"]], size))
        for table in tables.values():
            found = [next(beside) for _ in table["name"]]
            for key in ("align", "aside", "below"):
                table[key] = [getattr(one, key) for one in found]
            table["label"] = [name if one.free else "" for name, one in zip(table["name"], found, strict=True)]


_PLACES = ("x", "y", "z", "u", "v")
_LABEL = ("label", "align", "aside", "below")
_COLUMNS = {
    "box": _PLACES,
    "curves": (*_PLACES, "name", "colour", "dash"),
    "marks": (*_PLACES, "name", "colour", "marker", "fill", *_LABEL),
    "ends": (*_PLACES, "name", "colour", *_LABEL),
}


def _empty(name: str) -> dict[str, list[Any]]:
    return {column: [] for column in _COLUMNS[name]}


def _add(table: dict[str, list[Any]], places: NDArray[np.float64], **told: str) -> None:
    """Add a curve, shape (3, vertex), or a place, shape (3,), seen from the first direction."""
    for column, values in zip(_PLACES, (*places, *projected(places, _AZIMUTH, _ELEVATION)), strict=True):
        table[column].append(values.tolist())
    for column, value in told.items():
        table[column].append(value)


def _box_texts(
    names: list[str], low: NDArray[np.float64], high: NDArray[np.float64]
) -> Iterator[tuple[NDArray[np.float64], str]]:
    """Go through the texts at the cube's edges: what each axis shows, and from where to where."""
    for axis, name in enumerate(names):
        for share, text in ((0.0, f"{low[axis]:.4g}"), (0.5, look.bare_label(name)), (1.0, f"{high[axis]:.4g}")):
            place = np.array([1.15, -1.15, -1.15]) if axis < 2 else np.array([1.15, 1.15, 0.0])
            place[axis] = 2.0 * share - 1.0
            yield place, text
