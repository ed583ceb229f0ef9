"""The right side of a page: the selected solution as phase portrait, time series, multipliers, observables."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from typing import TYPE_CHECKING, Any, NamedTuple

from saltus.errors import SaltusError
from saltus.explorer import look, widgets
from saltus.explorer.colours import INK
from saltus.explorer.figures.pointer import tell_at_pointer
from saltus.explorer.figures.spectrum_view import SpectrumView
from saltus.explorer.kinds import kind_of
from saltus.explorer.plane_view import PlaneView
from saltus.explorer.solutions import path_of, quantities_in_plane, readings_of, traits_of
from saltus.explorer.views.later_tabs import LaterTabs

if TYPE_CHECKING:
    from collections.abc import Callable

    from saltus.explorer.session import Session

__all__ = ["OrbitView"]

_SPECTRUM = "Multipliers"  # name on a tab
_READINGS = "Observables"  # the same
_HEIGHT = 235  # pixels of a figure
_LINEARISED = '<p class="hint">Lines: motions of the field linearised at the equilibrium.</p>'
_MOST_EVENTS = 400  # events of a motion that are marked
_MOST_POINTS = 20_000  # points of a map's motion that are drawn
_DOT = 6.0  # pixels of a point where there are few
_SMALL_DOT = 2.0  # pixels of one where there are many
_AID = "#8a94a0"  # of thin curves beside a motion


class Readings(NamedTuple):
    """A table of observables."""

    panel: Any


class OrbitView:
    """The selected solution.

    Parameters
    ----------
    session : Session
        What is shown.
    tell : callable
        Called with an error's line; empty where there is none.
    readings : callable
        Returns what an instrument shows of an orbit, by name.
    simulate : callable
        Called with a start and how long the motion from it is to last, in periods or time.

    Attributes
    ----------
    later : LaterTabs
        Its tabs that are made when they are looked at; others can be added.
    """

    def __init__(
        self,
        session: Session,
        tell: Callable[[str], None],
        readings: Callable[[Any], Mapping[str, Any]],
        simulate: Callable[[tuple[float, ...], float], None],
    ) -> None:
        self._session, self._tell, self._instrument = session, tell, readings
        self._shown: Any = None
        self.title = widgets.html("orbit-title")
        self._portrait, self._series = look.figure_of("portrait", height=_HEIGHT), look.figure_of("series", height=190)
        self._near = widgets.html("nearby", _LINEARISED, (0, 8))
        self._sources = {name: _lines(made) for name, made in (("portrait", self._portrait), ("series", self._series))}
        self._axes = self._choosers()
        self.plane = PlaneView(session, self._portrait, self._series, simulate)
        figures = widgets.pane(self._portrait), self.plane.panel, widgets.pane(self._series)
        one = widgets.column(widgets.row(*self._axes), *figures, self._near)
        self.tabs = widgets.tabs(Orbit=one)
        self.later = LaterTabs(self.tabs)
        self.later.add(_SPECTRUM, self._spectrum_view, self._show_spectrum)
        self.later.add(_READINGS, self._readings_view, self._show_readings)
        self.panel = widgets.column(self.title, self.tabs)
        self.show(None, "")

    def _choosers(self) -> list[Any]:
        system = self._session.system
        names = quantities_in_plane(system)
        x, y = [*system.states, kind_of(system).upwards][:2]
        first = self._session.settings.planes or (x, y, x)
        self._session.settings.planes = tuple(first)
        made = []
        for title, value in zip(("portrait, right", "portrait, up", "over time"), first, strict=True):
            widget = widgets.quantity(title, names, value, 98)
            widgets.on_change(widget, lambda _: self._planes_changed())
            made.append(widget)
        return made

    def _planes_changed(self) -> None:
        now = tuple(widget.value for widget in self._axes)
        if all(now) and now != self._session.settings.planes:
            self._session.settings.planes = now
            self._tell("")
            self._draw()
            self._session.keep()

    def show(self, solution: Any, title: str) -> None:
        """Show an orbit, an equilibrium or a motion.

        Parameters
        ----------
        solution : PeriodicOrbit, Equilibrium, Trajectory or None
            What is shown.
        title : str
            A line of HTML above.
        """
        self._shown, self.title.object = solution, title or "Nothing selected: click on a branch."
        self._draw()
        self.later.redraw(_SPECTRUM, _READINGS)

    def _draw(self) -> None:
        x, y, over = self._session.settings.planes
        system, time = self._session.system, kind_of(self._session.system).time
        self._near.visible = traits_of(self._shown).what == "equilibrium"
        for name, made, names in (("portrait", self._portrait, (x, y)), ("series", self._series, (time, over))):
            made.xaxis.axis_label, made.yaxis.axis_label = (look.time_label(name, system) for name in names)
            curves, events, vertices = self._sources[name]
            try:
                lines, dots = self._lines(names)
            except SaltusError as error:
                self._tell(str(error))
                lines, dots = _NO_LINES, _NO_DOTS
            curves.data, events.data, vertices.data = lines, dots, _vertices(lines)
            look.fit(made, [*chain(*lines["xs"]), *dots["x"]], [*chain(*lines["ys"]), *dots["y"]])
        self.plane.draw()

    def _lines(self, names: tuple[str, str]) -> tuple[dict[str, list[Any]], dict[str, list[Any]]]:
        path = path_of(self._shown, names)
        lines = {
            "xs": [curve[:, 0].tolist() for curve in (*path.aids, *path.curves)],
            "ys": [curve[:, 1].tolist() for curve in (*path.aids, *path.curves)],
            "colour": [*[_AID] * len(path.aids), *(look.colour_of_mode(mode) for mode in path.modes)],
            "mode": [*[""] * len(path.aids), *(self._session.system.mode_names[mode] for mode in path.modes)],
            "width": [*[1.0] * len(path.aids), *[1.8] * len(path.curves)],
        }
        dots = path.events[-(_MOST_POINTS if path.points else _MOST_EVENTS) :]
        size, tip = _DOT if len(dots) <= _MOST_EVENTS else _SMALL_DOT, traits_of(self._shown).point
        both = {"x": dots[:, 0].tolist(), "y": dots[:, 1].tolist()}
        return lines, {**both, "tip": [tip] * len(dots), "size": [size] * len(dots)}

    def _spectrum_view(self) -> SpectrumView:
        made = SpectrumView()
        self._show_spectrum(made)
        return made

    def _show_spectrum(self, view: SpectrumView) -> None:
        view.show(traits_of(self._shown))

    def _readings_view(self) -> Readings:
        made = Readings(widgets.html("readings"))
        self._show_readings(made)
        return made

    def _show_readings(self, view: Readings) -> None:
        view.panel.object = look.table(readings_of(self._shown, self._instrument))


_NO_LINES: dict[str, list[Any]] = {"xs": [], "ys": [], "colour": [], "mode": [], "width": []}
_NO_DOTS: dict[str, list[Any]] = {"x": [], "y": [], "tip": [], "size": []}


def _vertices(lines: dict[str, list[Any]]) -> dict[str, list[Any]]:
    """Return the vertices of curves, each with the name of its mode."""
    named = [row for row in zip(*(lines[key] for key in ("xs", "ys", "mode")), strict=True) if row[2]]
    tips = chain(*([mode] * len(xs) for xs, _, mode in named))
    return {"x": [*chain(*(row[0] for row in named))], "y": [*chain(*(row[1] for row in named))], "tip": [*tips]}


def _lines(made: Any) -> tuple[Any, Any, Any]:
    """Add curves in the colours of their modes, and events, to a figure; return their sources, and that of vertices."""
    from bokeh.models import ColumnDataSource

    made.sizing_mode = "stretch_width"
    curves, events = ColumnDataSource(_NO_LINES), ColumnDataSource(_NO_DOTS)
    look.draw(made, "MultiLine", curves, line_color="colour", line_width="width", name="curves")
    look.draw(made, "Scatter", events, size="size", fill_color=INK, line_color=INK, name="events")
    vertices = ColumnDataSource({"x": [], "y": [], "tip": []})
    tell_at_pointer(made, [events, vertices])
    return curves, events, vertices
