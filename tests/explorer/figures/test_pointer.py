"""What a figure tells at the pointer: one text for all, and no tool of Bokeh's that tells another."""

from bokeh.models import ColumnDataSource, HoverTool, Label

from saltus.explorer.figures.pointer import tell_at_pointer
from saltus.explorer.look import figure_of
from saltus.explorer.views.orbit_view import OrbitView


def test_a_figure_has_one_text_which_goes_with_the_data():
    made, source = figure_of("some"), ColumnDataSource({"x": [0.0], "y": [1.0], "tip": ["here"]})
    tell_at_pointer(made, [source])
    (tip,) = made.select(Label)
    assert (tip.name, tip.visible) == ("some-figure-tip", False)
    assert len(source.js_property_callbacks["change:data"]) == 1
    assert {"mousemove", "mouseleave"} <= set(made.js_event_callbacks)


def test_no_figure_of_a_solution_tells_twice(session, toys, heard):
    view = OrbitView(session, print, toys.readings, lambda x0, span: None)
    view.tabs.active = 1
    for made in (view._portrait, view._series, view.later.made("Multipliers").figure):
        assert [*made.select(HoverTool)] == []
        assert len([*made.select(Label)]) == 1
