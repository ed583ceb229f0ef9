"""Colours and markers of the page and of its pictures, each readable on its ground."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from functools import cache
from typing import Any

from saltus.plotting import style

__all__ = [
    "CHOSEN",
    "CURVES",
    "FAULTY",
    "GROUND",
    "INK",
    "LEAST",
    "MARKERS",
    "colour_of",
    "contrast",
    "form_of",
    "readable",
]

GROUND = "#ffffff"  # behind figures and tables
INK = "#1b1b1e"
CHOSEN = "#c2410c"  # of what is selected or pointed at
FAULTY = "#6b6b73"  # of curves that are no motion of the system
CURVES = (INK, "#2f6fb0", "#8a4b08", "#4f7326", "#7d3c98", "#b0413e", "#1f7a71", "#806319")  # of results
LEAST = 4.5  # contrast that text needs by WCAG 2.2, 1.4.3

# Bokeh's markers, and by how many degrees they are turned, for those of matplotlib in `saltus.plotting.style`.
MARKERS: Mapping[str, tuple[str, float]] = {
    "o": ("circle", 0.0), "D": ("diamond", 0.0), "s": ("square", 0.0), "*": ("star", 0.0), "^": ("triangle", 0.0),
    "v": ("inverted_triangle", 0.0), "p": ("hex_dot", 0.0), "<": ("triangle", 90.0), ">": ("triangle", -90.0),
    "h": ("hex", 0.0), "X": ("plus", 45.0), "P": ("plus", 0.0),
}  # fmt: skip

# Markers, with their sizes, of types that the package's pictures tell apart by colour alone.
_SHAPES: Mapping[str, tuple[str, float]] = {"GR": ("P", 7.0)}


def _luminance(colour: str) -> float:
    """Return the relative luminance of WCAG 2.2 of ``#rrggbb``."""
    shares = (int(colour[i : i + 2], 16) / 255.0 for i in (1, 3, 5))
    red, green, blue = (c / 12.92 if c <= 0.04045 else ((c + 0.055) / 1.055) ** 2.4 for c in shares)
    return 0.2126 * red + 0.7152 * green + 0.0722 * blue


def contrast(colour: str, ground: str = GROUND) -> float:
    """Return the contrast of two colours, from 1 to 21.

    Parameters
    ----------
    colour, ground : str
        Colours as ``#rrggbb``.

    References
    ----------
    Web Content Accessibility Guidelines (WCAG) 2.2, W3C Recommendation 2023: "contrast ratio", "relative luminance".

    Examples
    --------
    >>> contrast("#000000"), round(contrast("#35b755"), 2)
    (21.0, 2.61)
    """
    dark, light = sorted((_luminance(colour), _luminance(ground)))
    return (light + 0.05) / (dark + 0.05)


@cache
def readable(colour: str) -> str:
    """Return a colour, darkened as far as its contrast on white needs.

    Examples
    --------
    >>> readable("#b8101f"), readable("#35b755")
    ('#b8101f', '#27873e')
    """
    shares, percent = [int(colour[i : i + 2], 16) for i in (1, 3, 5)], 100
    while contrast(found := "#" + "".join(f"{share * percent // 100:02x}" for share in shares)) < LEAST:
        percent -= 1
    return found


def form_of(kind: str, locus: str = "") -> style.Marker:
    """Return how a special point is drawn: as in the package's pictures, but readable, and told apart by its shape.

    locus: type of the locus on which it lies; empty on a branch.

    Examples
    --------
    >>> form_of("SN").marker, form_of("GR").marker
    ('o', 'P')
    """
    known = style.marker_of(kind, locus) or style.EVENT
    marker, size = _SHAPES.get(kind, (known.marker, known.size))
    return replace(known, marker=marker, size=size, colour=readable(known.colour))


def colour_of(number: int, result: Any) -> str:
    """Return the colour of a result: that of its type for a locus, else one by its place in the list."""
    kind = getattr(result, "type", "")
    return form_of(kind).colour if kind in style.SPECIAL else CURVES[number % len(CURVES)]
