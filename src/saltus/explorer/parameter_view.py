"""The left side of a page: parameters, the start, and sets of both saved by name."""

from __future__ import annotations

import math
from collections.abc import Callable
from html import escape
from typing import TYPE_CHECKING, Any

from saltus.errors import InputError
from saltus.explorer import look, widgets
from saltus.explorer.kinds import kind_of
from saltus.system.parts import ENDS

if TYPE_CHECKING:
    from saltus.explorer.session import Session

__all__ = ["ParameterView", "range_of"]

_WIDTH = 244  # pixels of a slider
_NO_SET = "saved sets"  # what the list of sets shows first
_TICKS = 200  # steps of a slider over its range


class ParameterView:
    """Parameters and start.

    Parameters
    ----------
    session : Session
        What is shown.
    changed : callable
        Called after a value was changed.
    moved : callable
        Called with the values of all parameters while a slider moves.
    tell : callable
        Called with a line about a value that is not allowed; the field then shows the value before.
    """

    def __init__(
        self,
        session: Session,
        changed: Callable[[], None],
        moved: Callable[[dict[str, float]], None],
        tell: Callable[[str], None],
    ) -> None:
        self._session, self._changed, self._moved, self._tell = session, changed, moved, tell
        self._showing, system = False, session.system
        self._fields = {name: _Field(session, name, self._take, self._slid, tell) for name in system.parameter_names}
        names = [*system.states]
        if len(session.settings.x0) > len(names) and system.phase is not None:
            names.append(system.phase[0])
        self._starts = [self._start(name, value) for name, value in zip(names, session.settings.x0, strict=False)]
        modes = {
            "the first that the state allows": "",
            **{name: name for name in system.mode_names if name not in ENDS},
        }
        self._mode = widgets.choice("mode", modes, session.settings.mode or "", _WIDTH)
        self._mode.visible = len(system.mode_names) > 1 and kind_of(system).chosen_modes
        widgets.on_change(self._mode, lambda _: self._take())
        self._named = widgets.text("set-name", "name of a set", 150)
        save = widgets.button("Save", "save-set", tip="keep these values and the start under the name")
        widgets.on_click(save, self._save)
        self._chosen = widgets.choice("", [_NO_SET, *session.settings.sets], _NO_SET, _WIDTH, "sets")
        widgets.on_change(self._chosen, self._load)
        self.panel = widgets.column(
            _heading("Parameters"), *(field.panel for field in self._fields.values()),
            _heading("Start"), widgets.row(*self._starts, wrap=True), self._mode,
            _heading("Sets"), widgets.row(self._named, save), self._chosen,
        )  # fmt: skip

    def _start(self, name: str, value: float) -> Any:
        widget = widgets.number(look.bare_label(name), value, 112, f"start-{name}", (1, 4))
        widgets.on_change(widget, lambda _: self._take())
        return widget

    def _slid(self, name: str, value: float) -> None:
        """Tell the values while a slider moves; the session takes them when it stands still."""
        self._moved({other: field.value for other, field in self._fields.items()} | {name: value})

    def _take(self) -> None:
        """Take the values of all fields into the session."""
        if self._showing:
            return
        settings, mode = self._session.settings, self._mode.value or None
        parameters = {name: field.value for name, field in self._fields.items()}
        try:
            x0 = tuple(widgets.number_of(f"start {widget.name}", widget.value) for widget in self._starts)
        except InputError as error:
            self._tell(str(error))
            self.show()
            return
        if (parameters, x0, mode) != (settings.parameters, settings.x0, settings.mode):
            settings.parameters, settings.x0, settings.mode = parameters, x0, mode
            self._changed()

    def show(self) -> None:
        """Show the values that the session has."""
        settings, self._showing = self._session.settings, True
        for name, field in self._fields.items():
            field.show(settings.parameters[name])
        for widget, value in zip(self._starts, settings.x0, strict=False):
            widget.value = value
        self._mode.value = settings.mode or ""
        self._chosen.options = [_NO_SET, *settings.sets]
        self._showing = False

    def _save(self) -> None:
        settings, name = self._session.settings, (self._named.value_input or self._named.value or "").strip()
        if name:
            kept = {"parameters": dict(settings.parameters), "x0": list(settings.x0), "mode": settings.mode}
            settings.sets[name] = kept
            self._chosen.options, self._named.value = [_NO_SET, *settings.sets], ""
            self._changed()

    def _load(self, name: str) -> None:
        settings = self._session.settings
        if name in settings.sets:
            kept = settings.sets[name]
            settings.parameters = settings.parameters | kept["parameters"]
            settings.x0, settings.mode = tuple(kept["x0"]), kept["mode"]
            self.show()
            self._chosen.value = _NO_SET
            self._changed()


class _Field:
    """A number field and a slider for one parameter; the slider counts steps over a range, in any units."""

    def __init__(
        self,
        session: Session,
        name: str,
        taken: Callable[[], None],
        moved: Callable[[str, float], None],
        tell: Callable[[str], None],
    ) -> None:
        self._system, self._taken, self._moved, self._name, self._tell = session.system, taken, moved, name, tell
        self.value = self._shown = session.settings.parameters[name]
        self._range = range_of(session, name)
        self._open = name in session.system.positive
        label = widgets.html("parameter-name", escape(look.bare_label(name)), (0, 0, 0, 6), width=118)
        self._number = widgets.number("", self.value, 118, f"parameter-{name}", (1, 4))
        place = self._place(self.value)
        self._slider = widgets.slider(place, _TICKS, _WIDTH - 8, f"slider-{name}", self._range)
        widgets.on_change(self._number, self._typed)
        widgets.on_change(self._slider, self._slides)
        widgets.on_change(self._slider, self._slid, "value_throttled")
        self.panel = widgets.column(widgets.row(label, self._number), self._slider)

    def _place(self, value: float) -> int:
        low, high = self._range
        return round(_TICKS * min(max((value - low) / (high - low), 0.0), 1.0))

    def show(self, value: float) -> None:
        """Show a value."""
        self.value = self._shown = value
        self._number.value, self._slider.value = value, self._place(value)

    def _typed(self, value: float | None) -> None:
        if value == self.value:
            return
        try:
            taken = self._system.resolve({self._name: widgets.number_of(self._name, value)})[self._name]
        except InputError as error:
            self._tell(str(error))
            self.show(self.value)
            return
        self.show(taken)
        self._taken()

    def _slides(self, place: int) -> None:
        """Tell the value that a moving slider shows; the field shows it when the slider stands still."""
        value = self.value if place == self._place(self.value) else self._at(place)
        if value != self._shown:
            self._shown = value
            self._moved(self._name, value)

    def _slid(self, place: int) -> None:
        if place != self._place(self.value):
            self._typed(self._at(place))

    def _at(self, place: int) -> float:
        """Return the value at a place of the slider."""
        low, high = self._range
        return float(f"{low + (high - low) * max(place, 1 if self._open else 0) / _TICKS:.6g}")


def range_of(session: Session, name: str) -> tuple[float, float]:
    """Return a range of a parameter: its bounds, that of the system's builder, or one about its own value.

    Parameters
    ----------
    session : Session
        The session.
    name : str
        The parameter.
    """
    if name in session.subject.ranges:
        low, high = session.subject.ranges[name]
        return low, high
    own = session.system.parameters[name]
    low, high = sorted((0.0, 2.0 * own)) if own else (-1.0, 1.0)
    bounds = session.system.parameter_bounds.get(name, (-math.inf, math.inf))
    return max(low, bounds[0]), min(high, bounds[1])


def _heading(text: str) -> Any:
    return widgets.html("heading", f"<h2>{text}</h2>", (8, 8, 0, 8))
