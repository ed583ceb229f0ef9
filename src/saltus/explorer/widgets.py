"""Widgets in the page's look; a name is a class by which tests and style sheets find each."""

from __future__ import annotations

import logging
from collections.abc import Callable, Mapping, Sequence
from functools import cache
from importlib.resources import files
from typing import Any, ParamSpec
from weakref import WeakKeyDictionary, WeakMethod

import panel as pn
from panel.io.state import set_curdoc

from saltus import checks

__all__ = [
    "bar",
    "beside",
    "button",
    "checkbox",
    "choice",
    "column",
    "count",
    "download",
    "film",
    "fold",
    "guarded",
    "html",
    "lines",
    "number",
    "number_of",
    "offered",
    "on_change",
    "on_click",
    "on_seen_click",
    "pane",
    "poster",
    "quantity",
    "row",
    "settler",
    "side_by_side",
    "slider",
    "tabs",
    "tell_faults",
    "text",
    "tick",
    "upload",
]

_FILM = 640  # pixels of a film's width
_TURNS = 4  # turns of the server's loop that a change and those that it makes may need
_SLIDES = 10  # milliseconds after which a slider's value is taken in
_MARGIN = (2, 4)  # pixels above and below, left and right
_TIP = ":host { max-width: 104px; white-space: normal; }"  # so that it is whole below a button at the window's edge
_P = ParamSpec("_P")
_LOG = logging.getLogger(__name__)
_TOLD: WeakKeyDictionary[Any, WeakMethod[Any]] = WeakKeyDictionary()  # by document: who tells what went wrong


@cache
def _sheets() -> list[str]:
    return [files(__package__).joinpath("widgets.css").read_text(encoding="utf-8")]


def button(text: str, name: str, *, kind: str = "default", tip: str = "") -> Any:
    """Return a button; `tip` is shown below when the pointer rests on it: beside it the next button stands."""
    from bokeh.models import Tooltip

    options = {"button_type": kind, "css_classes": [name], "margin": (2, 3), "stylesheets": _sheets()}
    shown = Tooltip(content=tip, position="bottom", stylesheets=[_TIP]) if tip else None
    return pn.widgets.Button(name=text, description=shown, **options)


def on_click(made: Any, work: Callable[[], object]) -> None:
    """Do work when a button is clicked, with the document's lock."""
    made.on_click(_locked(lambda _: work()))


def on_seen_click(made: Any, kind: str) -> None:
    """Let a click say a wish of a kind, with the button's tag that the browser shows then.

    What the server would do with the click may have changed since the person looked: it can compare the tag.
    """
    made.js_on_click(code=f"wish(['{kind}', source.tags[0]])")  # Panel keeps what is handed over, for good


def on_change(made: Any, work: Callable[[Any], object], what: str = "value") -> None:
    """Do work with a widget's new value when this changes, with the document's lock.

    A value that has changed again meanwhile is passed over: two pages would send each other their old values for ever.
    """
    made.param.watch(_locked(lambda event: work(event.new) if getattr(made, what) == event.new else None), what)


def poster() -> Callable[[Callable[[], None]], object]:
    """Return a function that does work soon, with the lock of the page that is made now; at once without a server."""
    document = pn.state.curdoc
    if document is None:
        return lambda work: work()

    def post(work: Callable[[], None]) -> None:
        done = guarded(work)

        def here() -> None:
            # Panel would take the page that asks, and put changes off, behind later ones
            with set_curdoc(document):
                done()

        document.add_next_tick_callback(here)

    return post


def settler() -> Callable[[Callable[[], None]], object]:
    """Return a function that does work once all changes of widgets that a page has sent so far are taken in.

    Panel hands a change on after a pause, and a change that makes another needs more turns of the server's loop.
    """
    document, post = pn.state.curdoc, poster()

    def after(turns: int, work: Callable[[], None]) -> None:
        if turns == 0:
            work()
        else:
            post(lambda: after(turns - 1, work))

    if document is None:
        return post
    pause = pn.reactive.Syncable._debounce
    return lambda work: document.add_timeout_callback(lambda: after(_TURNS, work), pause)


def _locked(work: Callable[[Any], object]) -> Any:
    """Return a coroutine function that Panel calls with the document's lock.

    A click that comes right after a change is handled without the lock, where a figure's data cannot be set.
    """
    careful = guarded(work)

    async def called(event: Any) -> None:
        careful(event)

    return pn.io.with_lock(called)


def tell_faults(tell: Callable[[Exception], None]) -> None:
    """Let a method of the page that is made now tell what goes wrong in work that is guarded."""
    if pn.state.curdoc is not None:
        _TOLD[pn.state.curdoc] = WeakMethod(tell)


def guarded(work: Callable[_P, object]) -> Callable[_P, None]:
    """Return work of which an error is told in the page that asks for it, and in the log; raised without a page.

    What the work changes in the page goes to its browser in one message, in order: it is painted once.
    """

    def done(*given: _P.args, **options: _P.kwargs) -> None:
        try:
            with pn.io.unlocked():
                work(*given, **options)
        except Exception as error:
            found = _TOLD.get(pn.state.curdoc) if pn.state.curdoc is not None else None
            tell = None if found is None else found()
            if tell is None:
                raise
            _LOG.exception("what a person asked for has failed")
            tell(error)

    return done


def html(name: str, text: str = "", margin: tuple[int, ...] = (4, 8), **options: Any) -> Any:
    """Return a piece of HTML; whoever gives it escapes it."""
    return pn.pane.HTML(text, css_classes=[name], margin=margin, stylesheets=_sheets(), **options)


def fold(title: str, *parts: Any) -> Any:
    """Return parts below each other, which a click on their title shows and hides; hidden at first."""
    options = {"collapsed": True, "margin": (8, 4), "sizing_mode": "stretch_width", "css_classes": ["fold"]}
    return pn.Card(*parts, title=title, stylesheets=_sheets(), **options)


def number(
    title: str,
    value: float | None,
    width: int,
    name: str = "",
    margin: tuple[int, ...] = _MARGIN,
    ends: tuple[float | None, float | None] = (None, None),
) -> Any:
    """Return a field for a number, between two ends where they are given."""
    options: dict[str, Any] = {"css_classes": [name] if name else [], "margin": margin, "stylesheets": _sheets()}
    options |= {"start": ends[0], "end": ends[1]}
    return pn.widgets.FloatInput(name=title, value=value, width=width, **options)


def number_of(name: str, value: float | None) -> float:
    """Return the number in a field, whose value is given.

    Raises
    ------
    InputError
        The field is empty, or its number is not finite; `name` says which field.
    """
    return checks.number(name, "empty" if value is None else value)


def count(title: str, value: int, width: int, ends: tuple[int, int], name: str) -> Any:
    """Return a field for a whole number between two ends."""
    options = {"css_classes": [name], "start": ends[0], "end": ends[1], "margin": _MARGIN, "stylesheets": _sheets()}
    return pn.widgets.IntInput(name=title, value=value, width=width, **options)


def slider(value: int, end: int, width: int, name: str, shown: tuple[float, float]) -> Any:
    """Return a slider that counts steps from 0 to an end, and shows a value between two others while it moves."""
    from bokeh.models import CustomJSTickFormatter

    low, high = shown
    code = f"return String(Number(({low!r} + {high - low!r} * tick / {end}).toPrecision(6)))"
    options = {"css_classes": [name], "margin": (0, 12), "stylesheets": _sheets(), "show_value": False}
    options |= {"format": CustomJSTickFormatter(code=code)}
    made = pn.widgets.IntSlider(value=value, start=0, end=end, width=width, **options)
    made._debounce = _SLIDES  # after Panel's own pause of 50 ms a third of the values would not be drawn
    return made


def choice(title: str, options: Mapping[str, Any] | Sequence[str], value: Any, width: int, name: str = "") -> Any:
    """Return a list of which one entry is chosen."""
    given = {"css_classes": [name] if name else [], "margin": _MARGIN, "stylesheets": _sheets()}
    listed = dict(options) if isinstance(options, Mapping) else list(options)
    return pn.widgets.Select(name=title, options=listed, value=value, width=width, **given)


def quantity(title: str, names: Sequence[str], value: str, width: int, name: str = "") -> Any:
    """Return a field for a quantity: one of the names, or a formula."""
    given = {"css_classes": [name] if name else [], "margin": _MARGIN, "stylesheets": _sheets()}
    search = {"restrict": False, "min_characters": 0, "case_sensitive": False, "search_strategy": "includes"}
    return pn.widgets.AutocompleteInput(name=title, value=value, options=offered(names), width=width, **given, **search)


def offered(names: Sequence[str]) -> list[str]:
    """Return names as a field for a quantity offers them: what is typed whole comes first, an empty text too.

    The field takes the first name that has what is typed in it, where there is one.
    """
    return ["", *sorted(dict.fromkeys(name for name in names if name), key=len)]


def checkbox(value: bool, name: str) -> Any:
    """Return a box to tick, without a text."""
    options = {"css_classes": [name], "margin": (5, 2, 0, 8), "stylesheets": _sheets()}
    return pn.widgets.Checkbox(value=value, width=18, **options)


def tick(text: str, value: bool) -> Any:
    """Return a box to tick, with a text, which is its name, too."""
    options = {"css_classes": [f"tick-{text}"], "margin": (4, 6, 6, 4), "stylesheets": _sheets()}
    return pn.widgets.Checkbox(name=text, value=value, **options)


def text(name: str, placeholder: str, width: int) -> Any:
    """Return a field for a text."""
    options = {"css_classes": [name], "margin": (2, 4, 2, 8), "stylesheets": _sheets()}
    return pn.widgets.TextInput(placeholder=placeholder, width=width, **options)


def lines(name: str, value: str, rows: int, longest: int) -> Any:
    """Return a field for a text of many lines, as wide as there is room."""
    options = {"css_classes": [name], "margin": (4, 8), "stylesheets": _sheets(), "sizing_mode": "stretch_width"}
    return pn.widgets.TextAreaInput(value=value, rows=rows, max_length=longest, **options)


def download(label: str, filename: str, callback: Any) -> Any:
    """Return a button that gives a file; `callback` returns its content when it is asked for."""
    kind = filename.rpartition(".")[2]
    options = {"css_classes": [f"download-{kind}"], "margin": (2, 3), "height": 30, "stylesheets": _sheets()}
    return pn.widgets.FileDownload(callback=callback, filename=filename, label=label, **options)


def upload(name: str) -> Any:
    """Return a field for a NetCDF file of the user."""
    options = {"css_classes": [name], "margin": (2, 8), "stylesheets": _sheets()}
    return pn.widgets.FileInput(accept=".nc", multiple=False, width=240, **options)


def bar() -> Any:
    """Return a bar of progress, not shown at first.

    It stands still: Panel's moving stripes draw the page anew in each frame, beside the process that works.
    """
    return pn.indicators.Progress(value=0, max=100, width=150, margin=(10, 8), visible=False, active=False)


def pane(made: Any, *, high: bool = False, fixed: bool = False) -> Any:
    """Return a figure as a part of a page, as wide as there is room; `high`: as high, too; `fixed`: of its own size."""
    mode = "fixed" if fixed else ("stretch_both" if high else "stretch_width")
    return pn.pane.Bokeh(made, sizing_mode=mode, margin=0)


def row(*parts: Any, name: str = "", wrap: bool = False) -> Any:
    """Return parts beside each other, aligned below; `wrap`: on more lines where there is no room."""
    classes = [name] if name else []
    if wrap:
        return pn.FlexBox(*parts, margin=(0, 4), css_classes=classes, align_items="flex-end")
    for part in parts:
        part.align = "center" if isinstance(part, pn.pane.HTML) else "end"
    return pn.Row(*parts, margin=(0, 4), css_classes=classes)


def beside(*parts: Any) -> Any:
    """Return parts beside each other, as wide as there is room."""
    return pn.Row(*parts, margin=0, sizing_mode="stretch_width")


def side_by_side(*parts: Any) -> Any:
    """Return parts beside each other, as wide and high as there is room; further ones can be appended."""
    return pn.Row(*parts, margin=0, sizing_mode="stretch_both")


def column(*parts: Any, name: str = "", high: bool = False) -> Any:
    """Return parts below each other, as wide as there is room."""
    mode = "stretch_both" if high else "stretch_width"
    return pn.Column(*parts, margin=0, sizing_mode=mode, css_classes=[name] if name else [])


def tabs(**parts: Any) -> Any:
    """Return parts of which one is shown, by the names on their tabs."""
    options = {"sizing_mode": "stretch_width", "margin": 0, "stylesheets": _sheets()}
    return pn.Tabs(*parts.items(), dynamic=False, **options)


def film() -> Any:
    """Return a place for a film, empty: it has its own size, in which its texts are legible, and scrolls."""
    shown = pn.pane.GIF(None, sizing_mode="fixed", width=_FILM, margin=8)
    return pn.Column(shown, margin=0, sizing_mode="stretch_width", styles={"overflow-x": "auto"}, css_classes=["film"])
