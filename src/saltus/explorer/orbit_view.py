"""The right side of a page: the selected solution as phase portrait, time series, multipliers, observables."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import chain
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import SaltusError
from saltus.explorer import look, widgets
from saltus.explorer.plane_view import PlaneView
from saltus.explorer.solutions import path_of, readings_of, traits_of

if TYPE_CHECKING:
    from collections.abc import Callable

    from saltus.explorer.session import Session

__all__ = ["OrbitView"]

_CIRCLE = np.linspace(0.0, 2.0 * np.pi, 181)
_HEIGHT = 235  # pixels of a figure
_MOST_EVENTS = 400  # events of a motion that are marked


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
        self._circle = look.figure_of("multipliers", height=_HEIGHT, match_aspect=True)
        self._numbers, self._readings = widgets.html("multiplier-table"), widgets.html("readings")
        self._sources = {name: _lines(made) for name, made in (("portrait", self._portrait), ("series", self._series))}
        self._values = _values(self._circle)
        self._axes = self._choosers()
        self.plane = PlaneView(session, self._portrait, self._series, simulate)
        figures = widgets.pane(self._portrait), self.plane.panel, widgets.pane(self._series)
        one = widgets.column(widgets.row(*self._axes), *figures)
        two = widgets.column(widgets.pane(self._circle), self._numbers)
        self.tabs = widgets.tabs(Orbit=one, Multipliers=two, Observables=self._readings)
        self.panel = widgets.column(self.title, self.tabs)
        self.show(None, "")

    def _choosers(self) -> list[Any]:
        system = self._session.system
        phase = [] if system.phase is None else [system.phase[0]]
        names = ["t", *system.states, *phase, *system.output_names]
        first = self._session.settings.planes or (system.states[0], (*system.states[1:], "t")[0], system.states[0])
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
        self._tell_numbers()

    def _draw(self) -> None:
        x, y, over = self._session.settings.planes
        for name, made, names in (("portrait", self._portrait, (x, y)), ("series", self._series, ("t", over))):
            made.xaxis.axis_label, made.yaxis.axis_label = map(look.bare_label, names)
            curves, events = self._sources[name]
            try:
                lines, dots = self._lines(names)
            except SaltusError as error:
                self._tell(str(error))
                lines, dots = _NO_LINES, _NO_DOTS
            curves.data, events.data = lines, dots
            look.fit(made, [*chain(*lines["xs"]), *dots["x"]], [*chain(*lines["ys"]), *dots["y"]])
        self.plane.draw()

    def _lines(self, names: tuple[str, str]) -> tuple[dict[str, list[Any]], dict[str, list[Any]]]:
        path = path_of(self._shown, names)
        lines = {
            "xs": [curve[:, 0].tolist() for curve in path.curves],
            "ys": [curve[:, 1].tolist() for curve in path.curves],
            "colour": [look.colour_of_mode(mode) for mode in path.modes],
            "mode": [self._session.system.mode_names[mode] for mode in path.modes],
        }
        ends = path.events[-_MOST_EVENTS:]
        return lines, {"x": ends[:, 0].tolist(), "y": ends[:, 1].tolist()}

    def _tell_numbers(self) -> None:
        shown = self._shown
        traits = traits_of(shown)
        values, self._circle.title.text = traits.values, traits.spectrum
        finite = values[np.isfinite(values)]
        self._values.data = {"x": finite.real.tolist(), "y": finite.imag.tolist()}
        span = max(1.0, *np.abs([*finite.real, *finite.imag, 0.0]).tolist()) * 1.15
        look.fit(self._circle, [-span, span], [-span, span], 0.0)
        told = {f"{i + 1}": f"{look.complex_text(value)}   |·| = {abs(value):.9g}" for i, value in enumerate(values)}
        self._numbers.object = look.table(told, ("", "value and modulus")) if told else ""
        self._readings.object = look.table(readings_of(shown, self._instrument))


_NO_LINES: dict[str, list[Any]] = {"xs": [], "ys": [], "colour": [], "mode": []}
_NO_DOTS: dict[str, list[Any]] = {"x": [], "y": []}


def _lines(made: Any) -> tuple[Any, Any]:
    """Add curves in the colours of their modes, and events, to a figure; return their sources."""
    from bokeh.models import ColumnDataSource, HoverTool

    made.sizing_mode = "stretch_width"
    curves, events = ColumnDataSource(_NO_LINES), ColumnDataSource(_NO_DOTS)
    lines = made.multi_line("xs", "ys", source=curves, line_color="colour", line_width=1.8, name="curves")
    made.scatter("x", "y", source=events, size=6, color="#1b1b1e")
    made.add_tools(HoverTool(renderers=[lines], tooltips=[("", "@mode"), ("", "($x, $y)")]))
    return curves, events


def _values(made: Any) -> Any:
    """Add the unit circle and multipliers to a figure; return the source of these."""
    from bokeh.models import ColumnDataSource, HoverTool

    made.sizing_mode = "stretch_width"
    made.line(np.cos(_CIRCLE), np.sin(_CIRCLE), line_color="#8a94a0", line_width=1.2)
    source = ColumnDataSource(_NO_DOTS)
    dots = made.scatter("x", "y", source=source, size=9, fill_color="#e8820c", line_color="#1b1b1e", name="values")
    made.add_tools(HoverTool(renderers=[dots], tooltips=[("", "@x{0.000000000} + @y{0.000000000} i")]))
    made.xaxis.axis_label, made.yaxis.axis_label = "real part", "imaginary part"
    made.title.text_font_size, made.title.text_font_style = "12px", "normal"
    return source
