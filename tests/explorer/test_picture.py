"""The diagram as a picture for print."""

from xml.etree import ElementTree

import pytest
from PIL import Image

from saltus.errors import InputError
from saltus.explorer.picture import picture_of


def test_a_picture_is_a_png_or_an_svg_of_the_same_shape(session):
    session.settings.axes = ("a", "max_z")
    image = Image.open(picture_of(session, "png"))
    assert image.format == "PNG"
    assert image.size == (1400, 900)  # 7 x 4.5 inches at 200 dots
    root = ElementTree.parse(picture_of(session, "svg")).getroot()
    assert root.tag.endswith("svg")
    wide, high = (float(root.get(side).removesuffix("pt")) for side in ("width", "height"))
    assert wide / high == pytest.approx(7.0 / 4.5)


def test_what_is_hidden_is_not_drawn(session):
    session.settings.axes = ("a", "z")
    whole = picture_of(session, "png").getvalue()
    session.settings.hidden.add("sweep1")
    assert picture_of(session, "png").getvalue() != whole
    session.settings.hidden |= {"branch1", "locus1"}
    with pytest.raises(InputError, match="axes = 'a, z': must be with a branch, a locus or a sweep to draw"):
        picture_of(session, "png")


def test_an_axis_that_nothing_has_is_told(session):
    session.settings.axes = ("a", "nothing")
    with pytest.raises(InputError, match="axes = 'a, nothing'"):
        picture_of(session, "png")


def test_a_session_without_curves_has_no_picture(empty):
    empty.settings.axes = ("a", "max_z")
    with pytest.raises(InputError):
        picture_of(empty, "svg")
