"""What a figure tells of the place at the pointer: one text, gone when the pointer or what is drawn goes."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.resources import files
from typing import TYPE_CHECKING, Any

from saltus.explorer.colours import CHOSEN, GROUND, INK
from saltus.explorer.look import draw

if TYPE_CHECKING:
    from bokeh.plotting import figure

__all__ = ["TOGETHER", "tell_at_pointer"]

TOGETHER = 8.0  # pixels within which marks are at one place
_REACH = 16.0  # pixels from the pointer within which a place is told
_BONUS = 6.0  # pixels by which a place of a source given first counts as nearer


def tell_at_pointer(made: figure, sources: Sequence[Any]) -> None:
    """Let a figure tell the nearest place at the pointer.

    Parameters
    ----------
    made : bokeh.plotting.figure
        The figure.
    sources : sequence of ColumnDataSource
        Places with columns ``x``, ``y`` and ``tip``, what is told of each. Where two are given, the first has marks:
        all of them at one place are told, before places of the second.
    """
    from bokeh.events import MouseLeave, MouseMove
    from bokeh.models import ColumnDataSource, CustomJS, Label

    ring = ColumnDataSource({"x": [], "y": []})
    draw(made, "Scatter", ring, size=11, fill_color=CHOSEN, fill_alpha=0.4, line_color=CHOSEN, name="pointed")
    tip = Label(
        x=0.0, y=0.0, text="", visible=False, name=f"{made.name}-tip", padding=5, border_radius=3, text_color=INK,
        text_font_size="11px", text_line_height=1.3, background_fill_color=GROUND, background_fill_alpha=0.94,
        border_line_color="#8a94a0",
    )  # fmt: skip
    made.add_layout(tip)
    code = files(__package__).joinpath("pointer.js").read_text(encoding="utf-8")
    given = {"figure": made, "sources": [*sources], "tip": tip, "ring": ring}
    look = CustomJS(args=given | {"reach": _REACH, "bonus": _BONUS, "together": TOGETHER}, code=code)
    made.js_on_event(MouseMove, look)
    made.js_on_event(MouseLeave, look)
    gone = CustomJS(args={"tip": tip, "ring": ring}, code="tip.visible = false; ring.data = {x: [], y: []}")
    for source in sources:
        source.js_on_change("data", gone)
