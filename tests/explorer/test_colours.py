"""Colours that are readable on their ground, markers that differ by their shape."""

import re
from importlib.resources import files

import numpy as np
import pytest

from saltus.explorer import colours, look
from saltus.plotting import style

_PAPER = "#f3f4f6"  # behind the page's sections
_TEXT = re.compile(r"(?<![-\w])color: (#[0-9a-f]{6})")


def luminance(colour: str) -> float:
    """Return the relative luminance of WCAG 2.2, written anew."""
    c = np.array([int(colour[i : i + 2], 16) for i in (1, 3, 5)]) / 255.0
    linear = np.where(c <= 0.04045, c / 12.92, ((c + 0.055) / 1.055) ** 2.4)
    return float(linear @ [0.2126, 0.7152, 0.0722])


def contrast(one: str, other: str) -> float:
    """Return the contrast of WCAG 2.2, written anew."""
    low, high = sorted([luminance(one), luminance(other)])
    return (high + 0.05) / (low + 0.05)


def test_contrast_is_that_of_the_guidelines():
    assert colours.contrast("#000000", "#ffffff") == 21.0
    assert colours.contrast("#777777") == pytest.approx(4.48, abs=5e-3)  # known to fail by little
    for one in ("#b8101f", "#1a5fb4", "#fdeee6"):
        assert colours.contrast(one, "#1b1b1e") == pytest.approx(contrast(one, "#1b1b1e"), rel=1e-12)


def test_every_mark_and_curve_is_readable_on_white():
    marks = {form: colours.form_of(form).colour for form in (*style.SPECIAL, "a user's event")}
    modes = {f"mode {i}": look.colour_of_mode(i) for i in range(7)}
    curves = {f"result {i}": colour for i, colour in enumerate(colours.CURVES)}
    others = {"faulty": colours.FAULTY, "chosen": colours.CHOSEN, "ink": colours.INK}
    low = {
        name: round(contrast(colour, colours.GROUND), 2)
        for name, colour in (marks | modes | curves | others).items()
        if contrast(colour, colours.GROUND) < 4.5
    }
    assert low == {}


def test_every_text_of_the_style_sheets_is_readable_on_every_ground_of_the_page():
    sheet = look.page_style() + files("saltus.explorer").joinpath("widgets.css").read_text()
    found = set(_TEXT.findall(sheet))
    assert len(found) >= 4
    grounds = ("#ffffff", "#fafbfc", _PAPER, "#fdeee6", "#eef1f5", "#f5f7fa")
    assert {(text, ground) for text in found for ground in grounds if contrast(text, ground) < 4.5} == set()


def test_a_readable_colour_stays_and_others_are_darkened_no_more_than_needed():
    assert colours.readable("#b8101f") == "#b8101f"
    for colour in ("#35b755", "#56b4e9", "#e69f00"):
        found = colours.readable(colour)
        assert 4.5 <= colours.contrast(found) < 4.7
        assert np.argmax([int(found[i : i + 2], 16) for i in (1, 3, 5)]) == np.argmax(
            [int(colour[i : i + 2], 16) for i in (1, 3, 5)]
        )


def test_bifurcations_of_branches_differ_by_shape():
    shapes = {
        kind: (colours.form_of(kind).marker, colours.form_of(kind).filled) for kind in ("SN", "GR", "TR", "BP", "HB")
    }
    assert len(set(shapes.values())) == len(shapes)
    drawn = {kind: colours.MARKERS[shape] for kind, (shape, _) in shapes.items()}
    assert drawn["SN"] != drawn["GR"]


def test_every_marker_of_the_pictures_has_one_on_the_page():
    assert {colours.form_of(kind).marker for kind in (*style.SPECIAL, "")} <= set(colours.MARKERS)


def test_a_locus_has_the_colour_of_its_type_and_others_one_by_their_place(results):
    assert colours.colour_of(7, results["locus1"]) == colours.form_of("SN").colour
    assert colours.colour_of(1, results["branch1"]) == colours.CURVES[1]
    assert colours.colour_of(len(colours.CURVES), results["branch1"]) == colours.CURVES[0]
