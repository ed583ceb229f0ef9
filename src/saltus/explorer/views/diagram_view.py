"""The diagram of a page: branches, loci, special points, sweeps; a click selects a solution."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import SaltusError
from saltus.explorer import colours, look, widgets
from saltus.explorer.drawing import Drawn, default_axes, drawn, extent_of, quantities_of
from saltus.explorer.figures.pointer import TOGETHER, tell_at_pointer
from saltus.explorer.following import followed_axes, told_where_fixed, varied_of
from saltus.explorer.points.label_places import places_beside
from saltus.explorer.points.mark_list import Coincident, MarkList
from saltus.explorer.steps import Place
from saltus.plotting import style

if TYPE_CHECKING:
    from saltus.explorer.session import Session

__all__ = ["DiagramView"]

_COLUMNS = {
    "strands": ("xs", "ys", "colour", "dash", "width", "name"),
    "marks": (
        "x",
        "y",
        "label",
        "told",
        "of",
        "meant",
        "tip",
        "marker",
        "angle",
        "colour",
        "fill",
        "align",
        "aside",
        "below",
    ),
    "points": ("x", "y", "of", "index", "told", "tip"),
    "dots": ("x", "y", "colour", "size"),
    "alone": ("x", "y", "colour"),
    **dict.fromkeys(("chosen", "trail"), ("x", "y")),
}
_UPON = {"x": "to the right", "y": "upwards"}  # what the field of an axis is called
_REACH = 24.0  # pixels from a click within which a solution is selected
_BONUS = 8.0  # pixels by which a special point counts as nearer
_SIZE = (600, 400)  # pixels of a figure whose size is not yet known
_CLOSE = 26.0  # pixels between marks whose labels share one place
_MOST_TOGETHER = 30  # characters of labels that are written in one place
_DOT = 5.5  # pixels of a dot of a sweep where few are above each other: more than a curve's width, to be seen beneath
_SMALL_DOT = 2.5  # pixels where there are many
_FEW = 16  # dots above each other that are few
_LEVELS = 500  # heights over the extent of a sweep that are told apart when dots are counted


class DiagramView:
    """The diagram.

    Parameters
    ----------
    session : Session
        What is shown.
    select : callable
        Called with the `Place` that was clicked.
    tell : callable
        Called with an error's line; empty where there is none.
    changed : callable, optional
        Called when other axes were chosen; by default the session is kept.
    """

    def __init__(
        self,
        session: Session,
        select: Callable[[Place], None],
        tell: Callable[[str], None],
        changed: Callable[[], None] | None = None,
    ) -> None:
        from bokeh.events import RangesUpdate, Tap
        from bokeh.models import ColumnDataSource

        self._session, self._select, self._tell, self._changed = session, select, tell, changed or session.keep
        self._sources = {name: ColumnDataSource(columns) for name, columns in _empty().items()}
        self.unseen: dict[str, str] = {}
        self.figure = look.figure_of("diagram", min_height=300)
        self._draw_glyphs()
        names = quantities_of(session.system)
        axes = session.settings.axes or default_axes(session.system, next(iter(session.system.parameter_names), "t"))
        session.settings.axes = tuple(axes)
        self._axes = [self._axis(letter, names, axis) for letter, axis in zip("xy", axes, strict=True)]
        clicked, moved = widgets.guarded(self._clicked), widgets.guarded(self.name_marks_anew)
        self.figure.on_event(Tap, lambda event: clicked(event.x, event.y, (event.sx, event.sy)))
        self.figure.on_event(RangesUpdate, lambda _: moved())
        self.figure.on_change("inner_width", lambda attr, old, new: moved())
        self.marks = MarkList()
        shown = widgets.column(widgets.pane(self.figure, high=True), self.marks.panel, name="over", high=True)
        self.panel = widgets.column(widgets.row(*self._axes, wrap=True), shown, high=True)
        self.redraw()

    def _axis(self, letter: str, names: list[str], value: str) -> Any:
        widget = widgets.quantity(self._title(letter), names, value, 180, f"axis-{letter}")
        widgets.on_change(widget, lambda name: self._chosen(letter, name))
        return widget

    def _title(self, letter: str) -> str:
        """Return what stands above the field of an axis."""
        return _UPON[letter] + (", fixed" if letter in self._session.settings.fixed else "")

    def _draw_glyphs(self) -> None:
        made, sources = self.figure, self._sources
        look.draw(
            made, "Scatter", sources["dots"], size="size", fill_color="colour", fill_alpha=0.5, line_color=None,
            name="dots",
        )  # fmt: skip
        look.draw(made, "Scatter", sources["alone"], size=7, fill_color="colour", line_color="colour", name="alone")
        look.draw(
            made, "MultiLine", sources["strands"], line_color="colour", line_dash="dash", line_width="width",
            name="strands",
        )  # fmt: skip
        trail = {"fill_color": colours.CHOSEN, "line_color": colours.CHOSEN}
        look.draw(made, "Scatter", sources["trail"], size=3, name="trail", **trail)
        look.draw(made, "Scatter", sources["points"], size=9, fill_alpha=0.0, line_alpha=0.0, name="points")
        look.draw(
            made, "Scatter", sources["marks"], size=10, marker="marker", angle="angle", angle_units="deg",
            line_color="colour", fill_color="fill", name="marks",
        )  # fmt: skip
        look.draw(
            made, "Text", sources["marks"], text="label", x_offset="aside", y_offset="below", text_font_size="11px",
            text_color="colour", text_align="align",
        )  # fmt: skip
        look.draw(
            made, "Scatter", sources["chosen"], size=17, fill_alpha=0.0, line_color=colours.CHOSEN, line_width=2.5,
            name="chosen",
        )  # fmt: skip
        tell_at_pointer(made, [sources["marks"], sources["points"]])

    @property
    def axes(self) -> tuple[str, str]:
        """Abscissa and ordinate."""
        x, y = (widget.value for widget in self._axes)
        return x, y

    def set_axes(self, x: str, y: str) -> None:
        """Show other quantities when the diagram is drawn next."""
        self._session.settings.axes = (x, y)
        for letter, widget, name in zip("xy", self._axes, (x, y), strict=True):
            if name not in widget.options:
                widget.options = widgets.offered([*widget.options, name])
            widget.value, widget.name = name, self._title(letter)

    def follow(self, result: Any) -> None:
        """Show what a result goes along, on axes that the user has not fixed, when the diagram is drawn next."""
        settings = self._session.settings
        x, y = settings.axes
        self.set_axes(*followed_axes(result, (x, y), settings.fixed, self._session.system))
        if told := told_where_fixed(result, self.axes, settings.fixed):
            self._tell(told)

    def follow_newest(self) -> None:
        """Follow the newest of the results that are drawn."""
        entries, hidden = self._session.entries, self._session.settings.hidden
        seen = [entry.result for entry in entries if entry.name not in hidden and varied_of(entry.result)]
        if seen:
            self.follow(seen[-1])
        else:
            self.set_axes(*self._session.settings.axes)

    def _chosen(self, letter: str, name: str) -> None:
        """Fix an axis at what the user has chosen; emptied, it follows the results again."""
        settings, number = self._session.settings, "xy".index(letter)
        if name == settings.axes[number]:
            return
        if name:
            settings.fixed.add(letter)
            self.set_axes(*(name if i == number else axis for i, axis in enumerate(settings.axes)))
        else:
            settings.fixed.discard(letter)
            self.follow_newest()
        self._axes_changed()

    def _axes_changed(self) -> None:
        self.redraw()
        if self._session.entries and len(self.unseen) == len(self._session.entries):
            self._tell(next(iter(self.unseen.values())))
        else:
            self._tell("")
        self._changed()

    def redraw(self) -> None:
        """Draw all results that are not hidden; `unseen` says why others cannot be drawn on these axes."""
        columns, seen = _empty(), []
        self.unseen = {}
        for number, entry in enumerate(self._session.entries):
            if entry.name in self._session.settings.hidden:
                continue
            try:
                found = drawn(entry.result, self._session.settings.axes)
            except SaltusError as error:
                self.unseen[entry.name] = str(error)
                continue
            seen.append(extent_of(found))
            _add(columns, entry.name, found, self.colour(number))
        if seen:
            look.fit(self.figure, *np.vstack(seen).T)
        self._name_marks(columns["marks"])
        self.marks.close()
        for name, table in columns.items():
            if name != "trail":
                self._sources[name].data = table
        x, y = self._session.settings.axes
        self.figure.xaxis.axis_label, self.figure.yaxis.axis_label = look.bare_label(x), look.bare_label(y)
        self.mark_chosen()

    def draw_trail(self, places: Sequence[tuple[float, float]]) -> None:
        """Draw what was found of a branch that is followed."""
        source = self._sources["trail"]
        known = len(source.data["x"])
        if len(places) < known:
            source.data, known = {"x": [], "y": []}, 0
        if len(places) > known:
            x, y = zip(*places[known:], strict=True)
            source.stream({"x": x, "y": y})

    def _name_marks(self, marks: dict[str, list[Any]]) -> None:
        """Write labels beside marks; those of marks that are close share one place."""
        groups: list[list[int]] = []
        across, up = self._scale()
        right = (np.array(marks["x"], float) - self.figure.x_range.start) * across
        down = (self.figure.y_range.end - np.array(marks["y"], float)) * up
        for i in range(len(right)):
            away = [math.hypot(right[i] - right[group[0]], down[i] - down[group[0]]) for group in groups]
            if away and min(away) < _CLOSE:
                groups[int(np.argmin(away))].append(i)
            else:
                groups.append([i])
        many = Counter(marks["told"])
        each = zip(marks["of"], marks["told"], strict=True)
        named = [told if many[told] == 1 else f"{of} {told}" for of, told in each]
        for group in groups:
            told = [*dict.fromkeys(named[i] for i in group)]
            shown = ", ".join(told)
            marks["label"][group[0]] = (
                shown if len(shown) <= _MOST_TOGETHER or len(told) == 1 else f"{told[0]} + {len(told) - 1}"
            )
        first = [group[0] for group in groups]
        labels, places = [marks["label"][i] for i in first], [(right[i], down[i]) for i in first]
        for i, beside in zip(first, places_beside(places, labels, self._frame()), strict=True):
            marks["align"][i], marks["aside"][i], marks["below"][i], _ = beside

    def name_marks_anew(self) -> None:
        """Write labels where there is room for them now: the figure has another size or shows another range."""
        marks = {key: [*column] for key, column in self._sources["marks"].data.items()}
        marks["label"] = [""] * len(marks["label"])
        self._name_marks(marks)
        self._sources["marks"].data = marks

    def colour(self, number: int) -> str:
        """Return the colour of an entry by its place in the list."""
        return colours.colour_of(number, self._session.entries[number].result)

    def mark_chosen(self) -> None:
        """Draw a ring about the solution that is selected."""
        place = self._session.settings.selected
        ring: dict[str, list[Any]] = {"x": [], "y": []}
        if place is not None and place.of not in self._session.settings.hidden:
            key, wanted = ("marks", place.label) if place.label is not None else ("points", place.index or 0)
            data, column = self._sources[key].data, "told" if place.label is not None else "index"
            for x, y, of, value in zip(data["x"], data["y"], data["of"], data[column], strict=True):
                if (of, value) == (place.of, wanted):
                    _append(ring, {"x": x, "y": y})
        self._sources["chosen"].data = ring

    def _clicked(self, x: float, y: float, place: tuple[float, float] | None = None) -> None:
        """Select the solution nearest to a click, special points before others; a list has those at one place.

        Where `place` is given, it is that of the click in pixels, beside which the list opens.
        """
        self.marks.close()
        best, nearest = _REACH, None
        for name, bonus in (("marks", _BONUS), ("points", 0.0)):
            data = self._sources[name].data
            away = self._pixels(np.array(data["x"], float) - x, np.array(data["y"], float) - y) - bonus
            if away.size and float(np.nanmin(away)) < best:
                best, nearest = float(np.nanmin(away)), (name, int(np.nanargmin(away)))
        if nearest is None:
            return
        name, at = nearest
        data = self._sources[name].data
        noun = self._session.entry(data["of"][at]).step.noun
        if name == "points":
            alone = noun in ("orbit", "equilibrium")
            self._select(Place(of=data["of"][at], index=None if alone else int(data["index"][at])))
            return
        together = [i for i in self._together(at) if self._can_be_taken(data["of"][i])]
        if at in together:
            self._select(Place(of=data["of"][at], label=data["told"][at]))
        if len(together) > 1:
            listed = [Coincident(*(data[key][i] for key in ("of", "told", "meant", "colour"))) for i in together]
            self.marks.open(listed, (data["of"][at], data["told"][at]), place)

    def _together(self, at: int) -> list[int]:
        """Return the marks at the place of one, by their numbers."""
        x, y = (np.array(self._sources["marks"].data[axis], float) for axis in "xy")
        return np.flatnonzero(self._pixels(x - x[at], y - y[at]) < TOGETHER).tolist()

    def _can_be_taken(self, name: str) -> bool:
        """Return whether marks of a result can be selected; those of a cascade are on branches that it keeps."""
        return self._session.entry(name).step.noun != "cascade"

    def _frame(self) -> tuple[float, float]:
        """Return width and height of the frame in pixels."""
        return look.frame_of(self.figure, _SIZE)

    def _scale(self) -> tuple[float, float]:
        """Return pixels of the units of both axes."""
        made, frame = self.figure, self._frame()
        wide, high = (float(abs(axis.end - axis.start)) or 1.0 for axis in (made.x_range, made.y_range))
        return frame[0] / wide, frame[1] / high

    def _pixels(self, dx: Any, dy: Any) -> Any:
        """Return lengths on the screen of differences in the axes' units."""
        across, up = self._scale()
        return np.hypot(dx * across, dy * up)


def _empty() -> dict[str, dict[str, list[Any]]]:
    """Return the columns of all glyphs without a row."""
    return {name: {key: [] for key in keys} for name, keys in _COLUMNS.items()}


def _append(table: dict[str, list[Any]], row: dict[str, Any]) -> None:
    for key, value in row.items():
        table[key].append(value)


def _add(columns: dict[str, dict[str, list[Any]]], name: str, found: Drawn, colour: str) -> None:
    """Add a result to the columns of the glyphs."""
    for strand in found.strands:
        sound = strand.kind not in style.FAULTY
        row = {
            "xs": strand.x.tolist(), "ys": strand.y.tolist(), "colour": colour if sound else colours.FAULTY,
            "dash": look.DASHES[strand.kind], "width": 2.0 if strand.kind == "stable" else 1.5, "name": name,
        }  # fmt: skip
        _append(columns["strands"], row)
    for mark in found.marks:
        form = colours.form_of(mark.type, mark.locus)
        marker, angle = colours.MARKERS[form.marker]
        row = {
            "x": mark.x, "y": mark.y, "label": "", "told": mark.label, "of": name, "meant": form.meaning,
            "tip": f"{name} {mark.label}, {form.meaning}", "marker": marker, "angle": angle, "colour": form.colour,
            "fill": form.colour if form.filled else colours.GROUND, "align": "left", "aside": 8.0, "below": -4.0,
        }  # fmt: skip
        _append(columns["marks"], row)
    if not found.strands:
        columns["alone"]["x"] += found.points[:, 0].tolist()
        columns["alone"]["y"] += found.points[:, 1].tolist()
        columns["alone"]["colour"] += [colour] * len(found.points)
    count = found.count or len(found.points)
    for index, ((x, y), stable) in enumerate(zip(found.points.tolist(), found.stable.tolist(), strict=True)):
        told = "stable" if stable else "unstable"
        row = {"x": x, "y": y, "of": name, "index": index % count, "told": told, "tip": f"{name}, {told}"}
        _append(columns["points"], row)
    if len(found.dots):
        x, y = found.dots.T
        levels = np.round(_LEVELS * (y - y.min()) / (float(np.ptp(y)) or 1.0))
        spots = np.unique(np.column_stack([x, levels]), axis=0)  # a periodic motion has the same points again and again
        where, counts = np.unique(spots[:, 0], return_counts=True)
        sizes = np.where(counts[np.searchsorted(where, x)] <= _FEW, _DOT, _SMALL_DOT)
        row = {"x": x.tolist(), "y": y.tolist(), "colour": [colour] * len(x), "size": sizes.tolist()}
        for key, values in row.items():
            columns["dots"][key] += values
