"""Tabs whose content is made when a person looks at them."""

import panel as pn

from saltus.explorer import widgets
from saltus.explorer.views.later_tabs import LaterTabs


class View:
    """A view of a tab."""

    def __init__(self) -> None:
        self.panel = widgets.html("late")
        self.drawn = 0

    def draw(self) -> None:
        """Draw it anew."""
        self.drawn += 1


def test_a_tab_is_empty_until_it_is_looked_at_and_is_made_once(heard):
    tabs = widgets.tabs(First=widgets.html("first"))
    later = LaterTabs(tabs)
    later.add("Second", View)
    later.add("Third", View)
    assert (later.made("Second"), [len(part) for part in tabs[1:]]) == (None, [0, 0])
    tabs.active = 2
    made = later.made("Third")
    assert (later.made("Second"), [*tabs[2]]) == (None, [made.panel])
    tabs.active = 0
    tabs.active = 2
    assert later.made("Third") is made
    assert [*tabs[2]] == [made.panel]


def test_tabs_can_stand_between_and_behind(heard):
    tabs = widgets.tabs(First=widgets.html("first"))
    later = LaterTabs(tabs)
    later.add("Second", View)
    tabs.append(("Between", pn.pane.HTML("now")))
    later.add("Last", View)
    tabs.active = 2
    assert (later.made("Second"), later.made("Last")) == (None, None)
    tabs.active = 3
    assert isinstance(later.made("Last"), View)


def test_a_tab_is_drawn_anew_only_while_a_person_looks_at_it(heard):
    tabs = widgets.tabs(First=widgets.html("first"))
    later = LaterTabs(tabs)
    for name in ("Second", "Third"):
        later.add(name, View, View.draw)
    later.redraw("Second", "Third")
    assert later.made("Second") is None
    tabs.active = 1
    second = later.made("Second")
    assert second.drawn == 0
    later.redraw("Second")
    assert second.drawn == 1
    tabs.active = 2
    for _ in range(3):
        later.redraw("Second", "Third")
    assert (second.drawn, later.made("Third").drawn) == (1, 3)
    tabs.active = 1
    assert second.drawn == 2
    tabs.active = 0
    tabs.active = 1
    assert second.drawn == 2
