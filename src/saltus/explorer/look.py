"""Colours, sizes and figures of the page."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.plotting import style

if TYPE_CHECKING:
    from bokeh.plotting import figure
    from numpy.typing import NDArray

__all__ = [
    "CURVES",
    "DASHES",
    "MARKERS",
    "bare_label",
    "colour_of_mode",
    "complex_text",
    "figure_of",
    "fit",
    "meaning_of",
    "number",
    "page_style",
    "table",
    "widen",
]

CURVES = ("#1b1b1e", "#2f6fb0", "#8a4b08", "#5b7f2b", "#7d3c98", "#b0413e", "#2a8c82", "#8c6d1f")  # of branches
DASHES = {"stable": "solid", "unstable": [6, 4], "not admissible": [2, 3], "virtual": [2, 3]}

# Bokeh's markers for those of matplotlib in `saltus.plotting.style.SPECIAL`.
MARKERS: Mapping[str, str] = {
    "o": "circle", "D": "diamond", "s": "square", "*": "star", "^": "triangle", "v": "inverted_triangle",
    "p": "hex", "<": "triangle_pin", ">": "triangle_dot", "h": "hex", "X": "x", "P": "cross",
}  # fmt: skip

_LOWERED = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_TOOLS = "pan,wheel_zoom,box_zoom,reset"
_MARGIN = 0.05  # room about what a figure shows, over its extent
_COMMON = (2.0, 98.0)  # percentiles between which common values lie
_FAR = 30.0  # extent of all values over that of the common ones from which on the rest is left outside
_FONT = "12px"
_GREY = "#5c6570"
_LINE = "#c3c9d1"


def page_style() -> str:
    """Return the style sheet of the page."""
    return files(__package__).joinpath("page.css").read_text(encoding="utf-8")


def figure_of(name: str, **options: Any) -> figure:
    """Return an empty figure in the page's look.

    Parameters
    ----------
    name : str
        By which tests and style sheets find it.
    **options : object
        Options of `bokeh.plotting.figure`.
    """
    from bokeh.models import Range1d, WheelZoomTool
    from bokeh.plotting import figure

    ranges = {"x_range": Range1d(-1.0, 1.0), "y_range": Range1d(-1.0, 1.0)}
    given = {"sizing_mode": "stretch_both"} | ranges | options
    made = figure(name=f"{name}-figure", tools=_TOOLS, toolbar_location="above", **given)
    made.toolbar.active_scroll = made.select_one(WheelZoomTool)
    made.toolbar.logo, made.toolbar.autohide = None, True
    made.outline_line_color, made.min_border_right = _LINE, 12
    made.grid.grid_line_alpha = 0.35
    for axis in made.axis:
        axis.axis_label_text_font_style, axis.axis_label_text_font_size = "normal", _FONT
        axis.major_label_text_font_size, axis.axis_line_color = "11px", _LINE
        axis.major_tick_line_color, axis.minor_tick_line_color = _LINE, None
        axis.axis_label_text_color = axis.major_label_text_color = _GREY
    return made


def fit(made: figure, x: Sequence[float], y: Sequence[float], margin: float = _MARGIN) -> None:
    """Set both ranges of a figure to what it shows; of nothing they stay as they are.

    Few values that are far from all others, as where a branch goes to infinity, are left outside.

    Parameters
    ----------
    made : figure
        The figure.
    x, y : sequence of float
        Coordinates of what it shows.
    margin : float, optional
        Room on each side, over the extent.
    """
    for axis, values in ((made.x_range, x), (made.y_range, y)):
        table = np.asarray(values, dtype=np.float64)
        table = table[np.isfinite(table)]
        if table.size:
            low, high = (float(value) for value in np.percentile(table, _COMMON))
            if float(np.ptp(table)) <= _FAR * (high - low):
                low, high = float(table.min()), float(table.max())
            room = margin * (high - low) or 0.1 * abs(high) or 1.0
            axis.update(start=low - room, end=high + room, reset_start=low - room, reset_end=high + room)


def widen(made: figure, places: NDArray[np.float64]) -> None:
    """Widen both ranges of a figure so that they hold further places; they never shrink here.

    Parameters
    ----------
    made : figure
        The figure.
    places : ndarray, shape (place, 2)
        Coordinates; those that are not finite do not count.
    """
    found = places[np.all(np.isfinite(places), axis=1)]
    for axis, values in zip((made.x_range, made.y_range), found.T, strict=True):
        if values.size:
            low, high = float(values.min()), float(values.max())
            room = _MARGIN * (max(high, axis.end) - min(low, axis.start))
            if low < axis.start or high > axis.end:
                axis.update(
                    start=low - room if low < axis.start else axis.start,
                    end=high + room if high > axis.end else axis.end,
                )


def bare_label(name: str) -> str:
    r"""Return the label of an axis as plain text, since a figure in the browser has no TeX.

    Examples
    --------
    >>> bare_label("z1_nm"), bare_label("min_z"), bare_label("Omega"), bare_label("period")
    ('z₁ (nm)', 'min z', 'Ω', 'period')
    """
    told = style.label_of(name)
    if "$" not in told:
        return told
    told = re.sub(r"\\([A-Za-z]+)", lambda found: _letter(found[1]), told)
    told = re.sub(r"_\{(\d+)\}", lambda found: found[1].translate(_LOWERED), told)
    return re.sub(r"_\{([^}]*)\}", r"_\1", told).replace("$", "")


def _letter(name: str) -> str:
    """Return the Greek letter that TeX calls so; the Unicode standard writes lamda."""
    size = "CAPITAL" if name[0].isupper() else "SMALL"
    return unicodedata.lookup(f"GREEK {size} LETTER {name.upper().replace('LAMBDA', 'LAMDA')}")


def colour_of_mode(mode: int) -> str:
    """Return the colour of a mode, that of the package's pictures."""
    return style.colour_of_mode(mode)


def number(value: float) -> str:
    """Return a number with nine digits, as tables show it."""
    return f"{value:.9g}"


def meaning_of(kind: str) -> str:
    """Return what a type of special point means.

    Examples
    --------
    >>> meaning_of("SN")
    'saddle-node'
    """
    return style.SPECIAL[kind].meaning if kind in style.SPECIAL else "event"


def complex_text(value: complex) -> str:
    """Return a complex number, real ones without their imaginary part.

    Examples
    --------
    >>> complex_text(0.5 + 0j), complex_text(0.5 - 0.25j)
    ('0.5', '0.5 − 0.25i')
    """
    if value.imag == 0.0:
        return number(value.real)
    return f"{number(value.real)} {'+' if value.imag > 0 else '−'} {number(abs(value.imag))}i"


def table(rows: Mapping[str, object], head: tuple[str, str] | None = None) -> str:
    """Return HTML of a table of two columns; names and values are shown as they are, never as HTML."""
    top = "" if head is None else f"<thead><tr><th>{escape(head[0])}</th><th>{escape(head[1])}</th></tr></thead>"
    told = {name: number(value) if isinstance(value, float) else f"{value}" for name, value in rows.items()}
    lines = "".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in told.items())
    return "" if not rows else f'<table class="numbers">{top}<tbody>{lines}</tbody></table>'
