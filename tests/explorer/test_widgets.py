"""Widgets: each is found by its class, and tells a change to whoever listens."""

import gc
import weakref

import panel as pn
import pytest
from bokeh.document import Document
from panel.io.state import set_curdoc

from saltus.explorer import widgets

pytestmark = pytest.mark.usefixtures("heard")


@pytest.mark.parametrize(
    ("made", "value"),
    [
        (lambda: widgets.number("a", 1.0, 90, "mine"), 2.5),
        (lambda: widgets.count("n", 3, 90, (2, 9), "mine"), 4),
        (lambda: widgets.slider(10, 200, 90, "mine", (0.0, 1.0)), 20),
        (lambda: widgets.choice("c", ["up", "down"], "up", 90, "mine"), "down"),
        (lambda: widgets.choice("c", {"above": "up", "below": "down"}, "up", 90, "mine"), "down"),
        (lambda: widgets.quantity("q", ["x", "v"], "x", 90, "mine"), "mean(x)"),
        (lambda: widgets.checkbox(True, "mine"), False),
        (lambda: widgets.text("mine", "a name", 90), "near the fold"),
    ],
)
def test_a_change_is_told_with_the_new_value(made, value):
    widget, heard = made(), []
    widgets.on_change(widget, heard.append)
    assert "mine" in widget.css_classes
    widget.value = value
    widget.value = value
    assert heard == [value]


def test_a_click_is_told():
    made, heard = widgets.button("Go", "go", kind="primary", tip="and come back"), []
    widgets.on_click(made, lambda: heard.append("clicked"))
    made.clicks += 1
    assert heard == ["clicked"]
    assert (made.button_type, made.css_classes) == ("primary", ["go"])
    tip = made.description
    assert (tip.content, tip.position) == ("and come back", "bottom")  # beside it the next button stands


def test_a_count_stays_between_its_ends():
    assert (widgets.count("n", 3, 90, (2, 9), "n").start, widgets.count("n", 3, 90, (2, 9), "n").end) == (2, 9)


def test_a_file_is_made_when_it_is_asked_for():
    asked = []
    made = widgets.download("NetCDF", "session.nc", lambda: asked.append("content"))
    assert made.css_classes == ["download-nc"]
    assert asked == []


def test_only_netcdf_is_uploaded():
    assert widgets.upload("open-session").accept == ".nc"


def test_parts_in_a_row_are_aligned_below_but_texts_in_the_middle():
    field, told = widgets.number("a", 1.0, 90), widgets.html("text", "<b>a</b>")
    made = widgets.row(field, told, name="both")
    assert [*made] == [field, told]
    assert (field.align, told.align, made.css_classes) == ("end", "center", ["both"])
    assert widgets.row(field, wrap=True).align_items == "flex-end"


def test_parts_of_a_page_take_the_room_that_there_is():
    assert widgets.column(widgets.bar()).sizing_mode == "stretch_width"
    assert widgets.column(high=True).sizing_mode == "stretch_both"
    assert widgets.beside().sizing_mode == "stretch_width"
    assert not widgets.bar().visible


def test_tabs_are_named():
    made = widgets.tabs(Orbit=widgets.html("one"), Film=widgets.film())
    assert made._names == ["Orbit", "Film"]


def test_a_quantity_that_is_typed_whole_comes_before_those_that_have_it_in_them():
    names = widgets.quantity("x", ["max_z", "z", "x*z", "z"], "z", 100).options
    for typed in ("", *names):
        assert next(name for name in names if typed in name) == typed


def broken(*given) -> None:
    raise TypeError("no number")


class Teller:
    """A page that notes what it is told."""

    def __init__(self) -> None:
        self.told: list[Exception] = []

    def tell(self, error: Exception) -> None:
        self.told.append(error)


@pytest.fixture
def document():
    made = Document()
    with set_curdoc(made):
        yield made


@pytest.mark.usefixtures("document")
def test_an_error_is_told_in_the_page_and_in_the_log(caplog):
    page = Teller()
    widgets.tell_faults(page.tell)
    widgets.guarded(broken)("1")
    assert [str(error) for error in page.told] == ["no number"]
    assert "TypeError: no number" in caplog.text


@pytest.mark.usefixtures("document")
def test_an_error_without_a_page_is_raised():
    with pytest.raises(TypeError, match="no number"):
        widgets.guarded(broken)("1")
    widgets.tell_faults(Teller().tell)  # a page that is gone
    with pytest.raises(TypeError, match="no number"):
        widgets.guarded(broken)("1")


def test_a_button_that_is_gone_is_forgotten():
    made = widgets.button("Undo", "undo")
    widgets.on_seen_click(made, "undo")
    gone = weakref.ref(made)
    del made
    gc.collect()
    assert gone() is None


def test_work_for_a_page_is_done_as_this_page_whichever_asks():
    """Panel puts off changes of a page that is not the one at work: they would come behind later ones."""
    asking, asked, seen = Document(), Document(), []
    with set_curdoc(asked):
        post = widgets.poster()
    with set_curdoc(asking):
        post(lambda: seen.append(pn.state.curdoc))
        (callback,) = asked.session_callbacks
        callback.callback()
    assert seen == [asked]
