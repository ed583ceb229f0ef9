"""Colours, sizes and figures of the page."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Mapping, Sequence
from html import escape
from importlib.resources import files
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.explorer.colours import readable
from saltus.plotting import style

if TYPE_CHECKING:
    from bokeh.plotting import figure
    from numpy.typing import NDArray

    from saltus.system import HybridSystem, Map

__all__ = [
    "DASHES",
    "bare_label",
    "colour_of_mode",
    "complex_text",
    "draw",
    "ends_of",
    "figure_of",
    "fit",
    "frame_of",
    "meaning_of",
    "number",
    "page_script",
    "page_style",
    "rounded_text",
    "table",
    "time_label",
    "widen",
]

DASHES = {"stable": "solid", "unstable": [6, 4], "not admissible": [2, 3], "virtual": [2, 3]}

_LOWERED = str.maketrans("0123456789", "₀₁₂₃₄₅₆₇₈₉")
_TOOLS = "pan,wheel_zoom,box_zoom,reset"
_MARGIN = 0.05  # room about what a figure shows, over its extent
_COMMON = (2.0, 98.0)  # percentiles between which common values lie
_FAR = 30.0  # extent of all values over that of the common ones from which on the rest is left outside
_TIMES = ("t", "period")  # quantities that are times
_FONT = "12px"
_GREY = "#5c6570"
_LINE = "#c3c9d1"


def page_style() -> str:
    """Return the style sheet of the page."""
    return files(__package__).joinpath("page.css").read_text(encoding="utf-8")


def page_script() -> str:
    """Return the script of the page."""
    return files(__package__).joinpath("page.js").read_text(encoding="utf-8")


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
    given = {"sizing_mode": "stretch_both", "toolbar_location": "above", "min_border_right": 12} | ranges | options
    made = figure(name=f"{name}-figure", tools=_TOOLS, **given)
    made.toolbar.active_scroll = next(tool for tool in made.toolbar.tools if isinstance(tool, WheelZoomTool))
    made.toolbar.logo, made.toolbar.autohide = None, True
    made.outline_line_color = _LINE
    made.grid.grid_line_alpha = 0.35
    for axis in made.axis:
        axis.axis_label_text_font_style, axis.axis_label_text_font_size = "normal", _FONT
        axis.major_label_text_font_size, axis.axis_line_color = "11px", _LINE
        axis.major_tick_line_color, axis.minor_tick_line_color = _LINE, None
        axis.axis_label_text_color = axis.major_label_text_color = _GREY
    return made


def draw(made: figure, kind: str, source: Any, *, name: str = "", level: Any = "glyph", **properties: Any) -> Any:
    """Add a glyph to a figure, without those that Bokeh's figures make beside it for places that are not selected.

    Parameters
    ----------
    made : bokeh.plotting.figure
        The figure.
    kind : str
        A class of glyphs in `bokeh.models`.
    source : ColumnDataSource
        What is drawn.
    name : str, optional
        By which tests and scripts find it.
    level : str, optional
        Before or behind what it is drawn.
    **properties : object
        Properties of the glyph.

    Returns
    -------
    bokeh.models.GlyphRenderer
        What draws it.
    """
    import bokeh.models

    return made.add_glyph(source, getattr(bokeh.models, kind)(**properties), name=name or None, level=level)


def frame_of(made: figure, unknown: tuple[float, float]) -> tuple[float, float]:
    """Return width and height of a figure's frame in pixels; `unknown` as long as no browser has told them.

    Examples
    --------
    >>> frame_of(figure_of("some"), (600.0, 340.0))
    (600.0, 340.0)
    """
    from bokeh.core.property.descriptors import UnsetValueError

    try:
        return float(made.inner_width or unknown[0]), float(made.inner_height or unknown[1])
    except UnsetValueError:
        return unknown


def fit(made: figure, x: Sequence[float], y: Sequence[float], margin: float = _MARGIN) -> None:
    """Set both ranges of a figure to `ends_of` what it shows; of nothing they stay as they are.

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
        if (ends := ends_of(values, margin)) is not None:
            axis.update(start=ends[0], end=ends[1], reset_start=ends[0], reset_end=ends[1])


def ends_of(values: Sequence[float] | NDArray[np.float64], margin: float = _MARGIN) -> tuple[float, float] | None:
    """Return the ends of an axis that shows values, with room at both; None where there is no finite value.

    Few values that are far from all others, as where a branch goes to infinity, are left outside.

    Examples
    --------
    >>> ends_of([0.0, 1.0], 0.1), ends_of([])
    ((-0.1, 1.1), None)
    """
    table = np.asarray(values, dtype=np.float64)
    table = table[np.isfinite(table)]
    if not table.size:
        return None
    low, high = (float(value) for value in np.percentile(table, _COMMON))
    if float(np.ptp(table)) <= _FAR * (high - low):
        low, high = float(table.min()), float(table.max())
    room = margin * (high - low) if high > low else 0.1 * abs(high) or 1.0
    return low - room, high + room


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
    """Return the colour of a mode, that of the package's pictures, as far as it is readable."""
    return readable(style.colour_of_mode(mode))


def number(value: float) -> str:
    """Return a number with nine digits, as tables show it."""
    return f"{value:.9g}"


def meaning_of(kind: str, locus: str = "") -> str:
    """Return what a type of special point means on a branch, or on a locus of some type.

    Examples
    --------
    >>> meaning_of("SN")
    'saddle-node'
    """
    return (style.marker_of(kind, locus) or style.EVENT).meaning


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


def rounded_text(value: complex) -> str:
    """Return a complex number with three digits, as it stands in a figure.

    Examples
    --------
    >>> rounded_text(-1.234e15 + 0j), rounded_text(6.5 - 70.0j)
    ('−1.23e15', '6.5 − 70i')
    """
    parts = [re.sub(r"e\+?(-?)0*", r"e\1", f"{abs(part):.3g}") for part in (value.real, value.imag)]
    sign = "−" if value.real < 0.0 else ""
    if value.imag == 0.0:
        return f"{sign}{parts[0]}"
    return f"{sign}{parts[0]} {'+' if value.imag > 0.0 else '−'} {parts[1]}i"


def time_label(name: str, system: HybridSystem | Map) -> str:
    """Return the label of an axis, with the unit of time where the system's names tell it.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> lever = HybridSystem.smooth({"z1_nm": "v1_nm_us", "v1_nm_us": "-z1_nm"})
    >>> time_label("t", lever), time_label("z1_nm", lever), time_label("t", HybridSystem.smooth({"x": "-x"}))
    ('t (us)', 'z₁ (nm)', 't')
    """
    named = (*system.states, *system.output_names, *system.parameter_names)
    if name in _TIMES and any(other.endswith("_us") for other in named):
        return f"{name} (us)"
    return bare_label(name)


def table(rows: Mapping[str, object], head: tuple[str, str] | None = None) -> str:
    """Return HTML of a table of two columns; names and values are shown as they are, never as HTML."""
    top = "" if head is None else f"<thead><tr><th>{escape(head[0])}</th><th>{escape(head[1])}</th></tr></thead>"
    told = {name: number(value) if isinstance(value, float) else f"{value}" for name, value in rows.items()}
    lines = "".join(f"<tr><th>{escape(name)}</th><td>{escape(value)}</td></tr>" for name, value in told.items())
    return "" if not rows else f'<table class="numbers">{top}<tbody>{lines}</tbody></table>'
