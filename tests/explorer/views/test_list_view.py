"""The list of results: a line for each, and a box that hides it."""

import re

import pytest

from saltus.explorer.views.list_view import ListView, line_of

pytestmark = pytest.mark.usefixtures("heard")


def grey(number: int) -> str:
    """Return the colour of a curve in these tests."""
    return f"#00000{number}"


def test_a_line_tells_what_a_result_is_and_why_it_ended(session):
    entry = session.entry("branch1")
    line = line_of(entry, "#123456")
    assert 'style="background:#123456"' in line
    assert f"<b>branch1</b> Branch of ball on a table: {len(entry.result)} orbits" in line
    assert re.search(r'<span class="end">[^<]+</span>', line)
    assert "saltus.continue_orbit(orbit1, &#x27;a&#x27;, (0.9, 1.8))" in line


def test_what_is_drawn_has_a_colour_round_where_it_is_dots(session):
    lines = {entry.name: line_of(entry, "#123456") for entry in session.entries}
    coloured = [name for name, line in lines.items() if "swatch" in line]
    assert coloured == ["orbit1", "branch1", "locus1", "sweep1", "motion1"]
    assert [name for name, line in lines.items() if "swatch round" in line] == ["orbit1", "sweep1"]


def test_notes_and_reasons_are_written_as_text(session):
    step, result = session.entries[0].step, session.entries[0].result
    entry = session.add(step, result, 61.0, ("<i>slow</i>",))
    line = line_of(entry, "", "<b>other axes</b>")
    assert '<span class="note">&lt;i&gt;slow&lt;/i&gt;</span>' in line
    assert '<span class="note">not on these axes: &lt;b&gt;other axes&lt;/b&gt;</span>' in line
    assert '<span class="time">1 min' in line
    assert 'class="end"' not in line


def test_an_empty_list_says_what_to_do(empty):
    shown = ListView(empty, lambda: None)
    shown.show(grey, {})
    assert len(shown.panel) == 1
    assert "Find an orbit" in shown.panel[0].object


def test_a_box_hides_a_result_and_shows_it_again(session):
    changes: list[set[str]] = []
    shown = ListView(session, lambda: changes.append(set(session.settings.hidden)))
    session.settings.hidden.add("locus1")
    shown.show(grey, {"sweep1": "no z"})
    boxes = [row[0] for row in shown.panel]
    assert [box.value for box in boxes] == [True, True, False, True, True]
    boxes[1].value = False
    boxes[2].value = True
    assert changes == [{"branch1", "locus1"}, {"branch1"}]
    assert ["not on these axes" in row[1].object for row in shown.panel] == [False, False, False, True, False]


def test_a_sweep_tells_where_it_has_no_motion(session):
    sweep = session.entry("sweep1")
    assert "no motion" not in line_of(sweep, "")
    step = sweep.step.model_copy(update={"parameter": "w", "bounds": (0.0, 1.0)})
    entry = session.add(step, step.run(session.system, {}, False))
    told = "no motion at 1 of 2 values; at w = 0: rate of the phase theta = 0.0: must be &gt; 0 and finite"
    assert f'<span class="note">{told}</span>' in line_of(entry, "")


def test_a_box_shows_what_another_page_has_changed_back(session):
    shown = ListView(session, lambda: None)
    shown.show(grey, {})
    shown.panel[1][0].value = False
    assert session.settings.hidden == {"branch1"}
    session.settings.hidden.clear()
    shown.show(grey, {})
    assert [row[0].value for row in shown.panel] == [True] * len(session.entries)
