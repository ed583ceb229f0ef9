"""The list of special points at one place."""

from saltus.explorer.points.mark_list import Coincident, MarkList

MARKS = [Coincident("branch1", "PD1", "period doubling", "#112233"), Coincident("branch2", "BP1", "<b>", "#445566")]


def test_each_point_is_a_button_that_selects_it():
    shown = MarkList()
    assert not shown.panel.visible
    shown.open(MARKS, ("branch2", "BP1"), (10.0, 20.0))
    told = shown.panel.object
    assert shown.panel.visible
    assert told.count('class="mark-entry"') == 2
    assert told.index("aria-current") > told.index("branch2")
    assert "&lt;b&gt;" in told
    assert shown.panel.styles["position"] == "absolute"
    shown.close()
    assert not shown.panel.visible


def test_a_list_has_a_place_without_a_click():
    shown = MarkList()
    shown.open(MARKS, ("branch1", "PD1"), None)
    assert "60" in shown.panel.styles["left"] or "74" in shown.panel.styles["left"]
