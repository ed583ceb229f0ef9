"""Tabs whose content is made when a person looks at them first: a page is shown sooner without it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from saltus.explorer import widgets

__all__ = ["LaterTabs"]


class LaterTabs:
    """Tabs that are empty until each is looked at.

    Parameters
    ----------
    tabs : Tabs
        Panel's tabs, to which they are added.
    """

    def __init__(self, tabs: Any) -> None:
        self._tabs = tabs
        self._added: list[tuple[str, Any, Callable[[], Any]]] = []  # name, place, and what makes the view
        self._made: dict[str, Any] = {}
        widgets.on_change(tabs, self._look_at, "active")

    def add(self, name: str, make: Callable[[], Any]) -> None:
        """Add a tab; `make` makes its view, an object with a ``panel``."""
        place = widgets.column()
        self._added.append((name, place, make))
        self._tabs.append((name, place))

    def _look_at(self, active: int) -> None:
        shown = self._tabs[active]
        for name, place, make in self._added:
            if place is shown and name not in self._made:
                self._made[name] = make()
                place.append(self._made[name].panel)

    def made(self, name: str) -> Any:
        """Return a tab's view; None of one that nobody has looked at."""
        return self._made.get(name)
