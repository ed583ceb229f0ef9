"""Tabs whose content is made when a person looks at them first, and drawn anew only while a person looks at them."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from saltus.explorer import widgets

__all__ = ["LaterTabs"]


class _Tab(NamedTuple):
    """A tab that may be empty still."""

    place: Any
    make: Callable[[], Any]
    draw: Callable[[Any], None]


class LaterTabs:
    """Tabs that are empty until each is looked at, and as old as the last look while another tab is on top.

    Parameters
    ----------
    tabs : Tabs
        Panel's tabs, to which they are added.
    """

    def __init__(self, tabs: Any) -> None:
        self._tabs = tabs
        self._added: dict[str, _Tab] = {}
        self._made: dict[str, Any] = {}
        self._old: set[str] = set()
        widgets.on_change(tabs, self._look_at, "active")

    def add(self, name: str, make: Callable[[], Any], draw: Callable[[Any], None] = lambda _: None) -> None:
        """Add a tab; `make` makes its view, an object with a ``panel``, and `draw` draws the view anew."""
        self._added[name] = _Tab(widgets.column(), make, draw)
        self._tabs.append((name, self._added[name].place))

    def redraw(self, *names: str) -> None:
        """Draw views anew: that of the tab on top at once, others when a person looks at them."""
        self._old.update(name for name in names if name in self._made)
        self._look_at(self._tabs.active)

    def _look_at(self, active: int) -> None:
        shown = self._tabs[active]
        for name, tab in self._added.items():
            if tab.place is not shown:
                continue
            if name not in self._made:
                self._made[name] = tab.make()
                tab.place.append(self._made[name].panel)
            elif name in self._old:
                tab.draw(self._made[name])
            self._old.discard(name)

    def made(self, name: str) -> Any:
        """Return a tab's view; None of one that nobody has looked at."""
        return self._made.get(name)
