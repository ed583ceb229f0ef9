"""The phase plane: direction field, nullclines and event surfaces below the portrait, motions kept, a start by a click.

What moves with a slider is drawn here, too: the motion from the start, and the orbit that is carried along.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import SaltusError
from saltus.explorer import look, widgets
from saltus.explorer.kinds import kind_of
from saltus.explorer.live import Frame, Wish
from saltus.explorer.plane import Window, directions, full_start, nullclines, surfaces
from saltus.explorer.solutions import path_of
from saltus.system.maps import flowing

if TYPE_CHECKING:
    from saltus.explorer.session import Session

__all__ = ["LAYERS", "PlaneView", "colour_of_motion"]

LAYERS = ("field", "nullclines", "surfaces", "live")  # what can be ticked
_SHAPE = (330, 180)  # pixels of a portrait whose size is not yet known
_LONGEST = 100_000.0  # periods, time or iterations
_NULLCLINES = ("#b8860b", "#2a8c82")  # colours: of the state to the right, of that upwards
_SURFACE = "#7d3c98"
_MOST_POINTS = 20_000  # points of a map's motion that are drawn
_LIVE = "#e8820c"
_CARRIED = "#1b1b1e"
_MOTIONS = ("#2f6fb0", "#5b7f2b", "#b0413e", "#8a4b08", "#7d3c98", "#2a8c82")


def colour_of_motion(session: Session, name: str) -> str:
    """Return the colour of a motion in the portrait and in the list."""
    names = [entry.name for entry in session.entries if entry.step.noun == "motion"]
    return _MOTIONS[names.index(name) % len(_MOTIONS)]


class PlaneView:
    """What is drawn in the portrait besides the selected solution, and what starts motions.

    Parameters
    ----------
    session : Session
        What is shown.
    portrait, series : bokeh.plotting.figure
        Where it is drawn.
    simulate : callable
        Called with a start and how long the motion lasts, in periods or time.
    """

    def __init__(
        self, session: Session, portrait: Any, series: Any, simulate: Callable[[tuple[float, ...], float], None]
    ) -> None:
        self._session, self._portrait, self._series = session, portrait, series
        self._simulate = simulate
        self._values: dict[str, float] = dict(session.settings.parameters)
        self._sources = _glyphs(portrait, series)
        kind = kind_of(session.system)
        self._boxes = {name: widgets.tick(name, name in session.settings.layers) for name in kind.layers}
        for box in self._boxes.values():
            widgets.on_change(box, lambda _: self._ticked())
        self._span = widgets.number(kind.unit, kind.span, 84, "span", ends=(1e-9, _LONGEST))
        go = widgets.button(
            "Simulate", "simulate", tip="the motion from the start; a click in the portrait starts there"
        )
        widgets.on_click(go, lambda: self.start(session.settings.x0))
        self._text, self._live_text = widgets.html("plane-text"), widgets.html("live-text")
        self._told: dict[str, str] = {}
        self.panel = widgets.column(
            widgets.row(self._span, go, *self._boxes.values(), wrap=True), self._text, self._live_text
        )
        self._watch()

    def _watch(self) -> None:
        from bokeh.events import RangesUpdate, Tap

        clicked, moved = widgets.guarded(self._clicked), widgets.guarded(self.draw_layers)
        self._portrait.on_event(Tap, lambda event: clicked(event.x, event.y))
        self._portrait.on_event(RangesUpdate, lambda _: moved())

    @property
    def live(self) -> bool:
        """Whether the motion is drawn while a slider moves."""
        return "live" in self._boxes and bool(self._boxes["live"].value)

    @property
    def span(self) -> float:
        """How long motions last: periods of the drive, or time."""
        return float(self._span.value or 1.0)

    def _ticked(self) -> None:
        ticked = tuple(name for name, box in self._boxes.items() if box.value)
        if ticked != self._session.settings.layers:
            self._session.settings.layers = ticked
            if not self.live:
                self.clear()
            self.draw_layers()
            self._session.keep()

    def start(self, x0: Sequence[float]) -> None:
        """Simulate the motion from a start."""
        self._simulate(tuple(x0), self.span)

    def _clicked(self, x: float | None, y: float | None) -> None:
        """Start a motion where the portrait was clicked."""
        names = self._plane()
        if names is None:
            self._tell("A click starts a motion where both axes are states.")
            return
        if x is not None and y is not None:
            start = full_start(self._session.system, self._session.settings.x0)
            start.update(zip(names, map(_short, (x, y)), strict=True))
            self.start([start[name] for name in self._session.system.all_states][: len(self._session.settings.x0)])

    def _plane(self) -> tuple[str, str] | None:
        """Return the states along both axes of the portrait; None where they are no two states."""
        x, y = self._session.settings.planes[:2]
        states = self._session.system.states
        return (x, y) if x in states and y in states and x != y else None

    def _tell(self, line: str) -> None:
        self._text.object = escape(line)

    # ---- layers ----

    def values_are(self, parameters: dict[str, float]) -> None:
        """Draw the layers at other values of the parameters."""
        self._values = dict(parameters)
        self.draw_layers()

    def draw_layers(self) -> None:
        """Draw the direction field, nullclines and surfaces that are ticked, as far as the portrait shows the plane."""
        field, nulls, borders = (_no_rows(name) for name in LAYERS[:3])
        names, told = self._plane(), ""
        wanted = [name for name in LAYERS[:3] if name in self._boxes and self._boxes[name].value]
        if wanted and names is None:
            told = "Field, nullclines and surfaces need two states as the portrait's axes."
        elif wanted and names is not None:
            window = self._window(names)
            found: list[Any] = []
            try:
                if "field" in wanted:
                    field = self._field(window)
                if "nullclines" in wanted:
                    nulls = _curves(
                        (curve, f"{look.bare_label(names[number])}′ = 0", _NULLCLINES[number])
                        for number, curve in nullclines(flowing(self._session.system), window)
                    )
                if "surfaces" in wanted:
                    found = [*surfaces(flowing(self._session.system), window)]
                    borders = _curves((curve, f"{name}: {event} = 0", _SURFACE) for name, event, curve in found)
                told = self._where(names, [f"{name}: {event} = 0" for name, event, _ in found])
            except SaltusError as error:
                told, names = str(error), None
        for name, table in zip(LAYERS[:3], (field, nulls, borders), strict=True):
            if table["xs"] or self._sources[name].data["xs"]:
                self._sources[name].data = table
        self._text.object = told if wanted and names is not None else escape(told)

    def _window(self, names: tuple[str, str]) -> Window:
        made, settings = self._portrait, self._session.settings
        x, y = ((float(axis.start), float(axis.end)) for axis in (made.x_range, made.y_range))
        return Window(names, x, y, full_start(self._session.system, settings.x0), self._values)

    def _field(self, window: Window) -> dict[str, list[Any]]:
        shape = look.frame_of(self._portrait, _SHAPE)
        xs, ys, modes = directions(flowing(self._session.system), window, shape)
        told = [self._session.system.mode_names[mode] for mode in modes]
        return {"xs": xs, "ys": ys, "name": told, "colour": [look.colour_of_mode(mode) for mode in modes]}

    def _where(self, names: tuple[str, str], borders: list[str]) -> str:
        """Return HTML that says through which states the plane goes, and which curve is which."""
        start = full_start(self._session.system, self._session.settings.x0)
        fixed = ", ".join(
            f"{look.bare_label(name)} = {value:.6g}" for name, value in start.items() if name not in names
        )
        keys = []
        if self._boxes["nullclines"].value:
            pairs = zip(names, _NULLCLINES, strict=True)
            keys += [(f"{look.bare_label(name)}′ = 0", colour) for name, colour in pairs]
        keys += [(border, _SURFACE) for border in borders]
        told = " ".join(f'<span style="color:{colour}">— {escape(key)}</span>' for key, colour in keys)
        return f"{told} <span class='hint'>{escape(f'at {fixed}, ' if fixed else '')}at the values on the left</span>"

    # ---- motions ----

    def draw(self) -> None:
        """Draw everything but what moves with a slider, and make room for it."""
        self.clear()
        for curve in self.draw_motions():
            look.widen(self._portrait, curve)
        self.draw_layers()

    def draw_motions(self) -> list[np.ndarray]:
        """Draw the motions that are kept and ticked, and the start; return their places in the portrait."""
        tables: list[dict[str, list[Any]]] = [_no_rows("motions"), _no_rows("motions")]
        dots: list[dict[str, list[Any]]] = [{"x": [], "y": [], "colour": []} for _ in tables]
        settings, seen, time = self._session.settings, [], kind_of(self._session.system).time
        chosen = None if settings.selected is None else settings.selected.of
        for entry in self._session.entries:
            if entry.step.noun != "motion" or entry.name in settings.hidden or entry.name == chosen:
                continue
            x, y, over = settings.planes
            try:
                both = [path_of(entry.result, names) for names in ((x, y), (time, over))]
            except SaltusError:  # the selected solution tells it
                continue
            colour = colour_of_motion(self._session, entry.name)
            for table, dotted, path in zip(tables, dots, both, strict=True):
                drawn = path.aids if path.points else path.curves
                for key, value in _curves((curve, entry.name, colour) for curve in drawn).items():
                    table[key] += value
                points = path.events[-_MOST_POINTS:] if path.points else path.events[:0]
                for key, value in zip(dotted, (*points.T.tolist(), [colour] * len(points)), strict=True):
                    dotted[key] += value
            seen += [*both[0].curves, *([both[0].events] if both[0].points else [])]
        for suffix, table, dotted in zip(("", "_over_time"), tables, dots, strict=True):
            self._sources["motions" + suffix].data, self._sources["visits" + suffix].data = table, dotted
        self._draw_start()
        return seen

    def _draw_start(self) -> None:
        names = self._plane()
        start = full_start(self._session.system, self._session.settings.x0)
        places = [] if names is None else [[start[name]] for name in names]
        self._sources["start"].data = dict(zip("xy", places or [[], []], strict=True))

    # ---- what moves with a slider ----

    def wish(self, parameters: dict[str, float], *, shown: bool = True) -> Wish:
        """Return what is to be drawn at values of the parameters."""
        settings = self._session.settings
        x, y, over = settings.planes
        definition = self._session.subject.definition
        return Wish(definition, dict(parameters), settings.x0, settings.mode, (x, y, over), self.span, shown)

    def show_frame(self, frame: Frame) -> None:
        """Show what was drawn for a slider."""
        if not self.live:
            return
        name = "live" if frame.part == "motion" else "carried"
        places = (("", self._portrait, frame.portrait), ("_over_time", self._series, frame.series))
        for suffix, made, curve in places:
            self._sources[name + suffix].data = {"x": curve[:, 0], "y": curve[:, 1]}
            look.widen(made, curve)
        self._told[frame.part] = frame.told
        if frame.part == "motion":
            self.values_are(frame.wish.parameters)
        self._say()

    def _say(self) -> None:
        told = "; ".join(line for line in self._told.values() if line)
        self._live_text.object = escape(told)

    def clear(self) -> None:
        """Take away what moves with a slider."""
        for name in ("live", "carried"):
            for suffix in ("", "_over_time"):
                if len(self._sources[name + suffix].data["x"]):
                    self._sources[name + suffix].data = {"x": [], "y": []}
        self._told.clear()
        self._say()


def _short(value: float) -> float:
    """Return a coordinate of a click with as many digits as a hand can mean."""
    return float(f"{value:.4g}")


def _no_rows(name: str) -> dict[str, list[Any]]:
    return {"xs": [], "ys": [], "name": [], "colour": []}


def _curves(rows: Any) -> dict[str, list[Any]]:
    """Return the columns of curves, each with a name and a colour."""
    table = _no_rows("")
    for curve, name, colour in rows:
        for key, value in (("xs", curve[:, 0].tolist()), ("ys", curve[:, 1].tolist()), ("name", name)):
            table[key].append(value)
        table["colour"].append(colour)
    return table


def _glyphs(portrait: Any, series: Any) -> dict[str, Any]:
    """Add the glyphs of all layers to both figures; return their sources."""
    from bokeh.models import ColumnDataSource

    made: dict[str, Any] = {}
    forms = {
        "field": (portrait, {"line_width": 1.0, "line_alpha": 0.45, "level": "underlay"}),
        "nullclines": (portrait, {"line_width": 1.5, "level": "underlay"}),
        "surfaces": (portrait, {"line_width": 1.5, "line_dash": "6 3", "level": "underlay"}),
        "motions": (portrait, {"line_width": 1.2, "line_alpha": 0.8, "level": "underlay"}),
        "motions_over_time": (series, {"line_width": 1.2, "line_alpha": 0.8, "level": "underlay"}),
    }
    for name, (figure, look_of) in forms.items():
        made[name] = ColumnDataSource(_no_rows(name))
        look.draw(figure, "MultiLine", made[name], line_color="colour", name=name, **look_of)
    for suffix, figure in (("", portrait), ("_over_time", series)):
        name = "visits" + suffix
        made[name] = ColumnDataSource({"x": [], "y": [], "colour": []})
        filled = {"fill_color": "colour", "line_color": "colour"}
        look.draw(figure, "Scatter", made[name], size=3, level="underlay", name=name, **filled)
    for name, colour, width in (("live", _LIVE, 1.0), ("carried", _CARRIED, 2.2)):
        for suffix, figure in (("", portrait), ("_over_time", series)):
            made[name + suffix] = ColumnDataSource({"x": [], "y": []})
            look.draw(figure, "Line", made[name + suffix], line_color=colour, line_width=width, name=name + suffix)
    made["start"] = ColumnDataSource({"x": [], "y": []})
    look.draw(portrait, "Scatter", made["start"], size=9, marker="cross", line_color=_LIVE, line_width=2, name="start")
    return made
