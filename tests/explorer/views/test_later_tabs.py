"""Tabs whose content is made when a person looks at them."""

import panel as pn

from saltus.explorer import widgets
from saltus.explorer.views.later_tabs import LaterTabs


class View:
    """A view of a tab."""

    def __init__(self) -> None:
        self.panel = widgets.html("late")


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
