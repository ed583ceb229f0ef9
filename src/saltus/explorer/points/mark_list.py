"""A list that opens where special points coincide, so that each can be chosen."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import Any, NamedTuple

from saltus.explorer import widgets
from saltus.explorer.points.wishes import wish

__all__ = ["Coincident", "MarkList"]

_WIDTH = 300  # pixels
_AWAY = 14  # pixels between the place and the list


class Coincident(NamedTuple):
    """A special point at a place where there are others."""

    of: str  # name of its result
    label: str  # as ``"PD1"``
    told: str  # what it means
    colour: str  # of its marker


class MarkList:
    """The list, closed at first."""

    def __init__(self) -> None:
        self.panel = widgets.html("mark-list", "", (0, 0))
        self.panel.visible = False

    def open(self, marks: Sequence[Coincident], chosen: tuple[str, str], place: tuple[float, float] | None) -> None:
        """Show special points to choose from.

        Parameters
        ----------
        marks : sequence of Coincident
            The points.
        chosen : (str, str)
            Result and label of the one that is selected already.
        place : (float, float) or None
            Where on the figure, in pixels from its upper left corner; None where this is not known.
        """
        x, y = place or (60.0, 20.0)
        rows = [
            f'<li><button class="mark-entry" {wish("take", mark.of, mark.label)}'
            f"{' aria-current=true' if (mark.of, mark.label) == chosen else ''}>"
            f'<span class="swatch round" style="background:{mark.colour}"></span>'
            f"<b>{escape(mark.of)} {escape(mark.label)}</b> {escape(mark.told)}</button></li>"
            for mark in marks
        ]
        close = f'<button class="mark-close" {wish("close")} aria-label="close the list">×</button>'
        head = f"<div class='mark-head'>{len(marks)} points at one place {close}</div>"
        self.panel.object = f'{head}<ul role="list">{"".join(rows)}</ul>'
        self.panel.styles = _place(x, y)
        self.panel.visible = True

    def close(self) -> None:
        """Close the list."""
        self.panel.visible = False


def _place(x: float, y: float) -> dict[str, Any]:
    """Return the style of a list beside a place, on that side where there is room."""
    left = f"max(4px, min({x + _AWAY:.0f}px, calc(100% - {_WIDTH + 8}px)))"
    return {
        "position": "absolute", "left": left, "top": f"min({y + _AWAY:.0f}px, 55%)", "width": f"min({_WIDTH}px, 92%)",
        "max-height": "42%", "overflow": "auto", "z-index": "20", "background": "#ffffff", "border-radius": "5px",
        "border": "1px solid #8a94a0", "box-shadow": "0 3px 10px rgba(0, 0, 0, 0.22)",
    }  # fmt: skip
