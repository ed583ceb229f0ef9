"""What a person asks for by a key or by a button in a table: the page's script says it, a view listens."""

from __future__ import annotations

import json
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from bokeh.plotting import figure

__all__ = ["Wishes", "wish"]


def wish(kind: str, *said: Any) -> str:
    """Return the attribute of an element of HTML that asks for something when it is clicked, escaped.

    Examples
    --------
    >>> wish("sort", "type")
    'data-wish="[&quot;sort&quot;, &quot;type&quot;]"'
    """
    from html import escape

    return f'data-wish="{escape(json.dumps([kind, *said]))}"'


class Wishes:
    """What the page's script says.

    Parameters
    ----------
    made : bokeh.plotting.figure
        A figure of the page, with which the model travels by which both sides talk.
    """

    def __init__(self, made: figure) -> None:
        from bokeh.models import ColumnDataSource

        from saltus.explorer.look import draw
        from saltus.explorer.widgets import guarded

        take = guarded(self.take)
        self._works: dict[str, Callable[..., object]] = {}
        self.source = ColumnDataSource({"wish": [], "at": []}, name="wishes")
        draw(made, "Scatter", self.source, x="at", y="at").visible = False
        self.source.on_change("data", lambda attribute, before, now: take(now["wish"]))

    def on(self, kind: str, work: Callable[..., object]) -> None:
        """Call a function with what is said after a kind."""
        self._works[kind] = work

    def take(self, texts: list[str]) -> None:
        """Do what is asked for; what nobody knows is left out."""
        for text in texts:
            kind, *said = json.loads(text)
            if kind in self._works:
                self._works[kind](*said)

    def answer(self, mark: str) -> None:
        """Say that all that came before a mark is done."""
        self.source.tags = [mark]
