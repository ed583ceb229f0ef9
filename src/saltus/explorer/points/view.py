"""The table of special points on the page: sorted by a click on a head, a row selects, normal forms come on demand."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from html import escape
from typing import TYPE_CHECKING, Any

from saltus.explorer import widgets
from saltus.explorer.points.table import COLUMNS, Row, rows_of, sorted_rows, table_of, text_of

if TYPE_CHECKING:
    from saltus.explorer.session import Session

__all__ = ["PointView"]


class PointView:
    """The table.

    Parameters
    ----------
    session : Session
        What is shown.
    forms_of : callable
        Called with the name of a result whose normal forms are wanted, and a function that takes them by label.
    """

    def __init__(self, session: Session, forms_of: Callable[[str, Callable[[dict[str, str]], None]], None]) -> None:
        self._session, self._forms_of = session, forms_of
        self._forms: dict[tuple[str, str], str] = {}
        self._asked: set[str] = set()
        self._known: tuple[Any, list[Row]] | None = None  # rows, and what they are made of
        self._column, self._seen = "result", False
        self._table = widgets.html("point-table", "", (0, 4), sizing_mode="stretch_width")
        self.panel = widgets.column(self._table, name="points")

    def seen(self) -> None:
        """Show the table from now on, with normal forms."""
        self._seen = True
        self._asked = {of for of, _ in self._forms}
        self.show()

    def sort(self, column: str) -> None:
        """Sort by a column; where the table is sorted by it, the other way round."""
        if column in COLUMNS:
            self._column = f"-{column}" if self._column == column else column
            self.show()

    def show(self) -> None:
        """Show the special points of all results."""
        rows, axes = self._rows(), self._axes()
        table = table_of(rows, axes, self._column, self._session.settings.selected)
        self._table.object = f"{_head(text_of(rows, axes)) if rows else ''}{table}"
        if self._seen:
            self._ask()

    def _axes(self) -> tuple[str, str]:
        x, y = self._session.settings.axes
        return x, y

    def _rows(self) -> list[Row]:
        results, axes = self._session.results, self._axes()
        key = (axes, tuple(results), len(self._forms))
        if self._known is None or self._known[0] != key:
            self._known = (key, rows_of(results, axes, self._forms))
        return sorted_rows(self._known[1], self._column.removeprefix("-"), falling=self._column.startswith("-"))

    def _ask(self) -> None:
        """Ask for normal forms that are not known yet."""
        wanted = {row.of for row in self._rows()} - self._asked
        self._asked |= wanted
        for name in sorted(wanted):
            self._forms_of(name, partial(self._take, name, self._session.results[name]))

    def _take(self, name: str, result: Any, forms: dict[str, str]) -> None:
        """Take the normal forms of a result, unless it was dropped meanwhile."""
        if self._session.results.get(name) is result:
            self._forms |= {(name, label): told for label, told in forms.items()}
            self.show()

    def forget_gone(self) -> None:
        """Forget the normal forms of results that are gone."""
        results = self._session.results
        self._asked.intersection_update(results)
        self._forms = {key: told for key, told in self._forms.items() if key[0] in results}


def _head(text: str) -> str:
    """Return HTML that stands above the table: a button that copies a text, and what keys do."""
    return (
        f'<div class="over-table"><button class="copy-points" data-copy="{escape(text)}">Copy as text</button> '
        '<span class="hint">Keys on the diagram: ← → step along the branch, ↑ ↓ to its special points.</span></div>'
    )
