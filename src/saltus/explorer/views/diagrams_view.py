"""Further diagrams beside the first one: the same results on other axes."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from saltus.explorer import widgets
from saltus.explorer.views.diagram_view import DiagramView

if TYPE_CHECKING:
    from saltus.explorer.session import Session, Settings
    from saltus.explorer.steps import Place

__all__ = ["DiagramsView"]

_MOST = 3  # diagrams beside the first one


class _OwnAxes:
    """The settings of a session, but for the axes of one further diagram."""

    def __init__(self, settings: Settings, number: int) -> None:
        self._settings, self._number = settings, number
        self.fixed = {"x", "y"}

    def __getattr__(self, name: str) -> Any:
        return getattr(self._settings, name)

    @property
    def axes(self) -> tuple[str, ...]:
        """Abscissa and ordinate."""
        return self._settings.more_axes[self._number]

    @axes.setter
    def axes(self, axes: tuple[str, ...]) -> None:
        shown = self._settings.more_axes
        self._settings.more_axes = [*shown[: self._number], axes, *shown[self._number + 1 :]]


class _Beside:
    """A session as a further diagram sees it."""

    def __init__(self, session: Session, number: int) -> None:
        self._session, self.settings = session, _OwnAxes(session.settings, number)

    def __getattr__(self, name: str) -> Any:
        return getattr(self._session, name)


class DiagramsView:
    """The diagrams.

    Parameters
    ----------
    session : Session
        What is shown.
    first : DiagramView
        The diagram that is always there.
    select : callable
        Called with the `Place` that was clicked.
    tell : callable
        Called with an error's line; empty where there is none.
    changed : callable
        Called when there is one more, one less, or another axis.
    """

    def __init__(
        self,
        session: Session,
        first: DiagramView,
        select: Callable[[Place], None],
        tell: Callable[[str], None],
        changed: Callable[[], None],
    ) -> None:
        self._session, self._first, self._select, self._tell, self._changed = session, first, select, tell, changed
        self._others: list[DiagramView] = []
        self._more = widgets.button("+ diagram", "more-diagrams", tip="the same results on other axes, beside this one")
        self._less = widgets.button("− diagram", "fewer-diagrams", tip="close the last one")
        widgets.on_click(self._more, self._add)
        widgets.on_click(self._less, self._drop)
        self._row = widgets.side_by_side(first.panel)
        self.panel = widgets.column(widgets.row(self._more, self._less), self._row, high=True)
        self._match()

    def _show_buttons(self) -> None:
        self._more.disabled, self._less.visible = len(self._others) >= _MOST, bool(self._others)

    def _open(self, number: int) -> None:
        beside: Any = _Beside(self._session, number)
        made = DiagramView(beside, self._select, self._tell, self._changed)
        made.figure.name = f"diagram{number + 2}-figure"
        self._others.append(made)
        self._row.append(made.panel)

    def _add(self) -> None:
        settings = self._session.settings
        settings.more_axes = [*settings.more_axes, settings.axes]
        self._match()
        self._changed()

    def _drop(self) -> None:
        self._session.settings.more_axes = self._session.settings.more_axes[:-1]
        self._match()
        self._changed()

    def _match(self) -> None:
        """Open and close diagrams until they are those of the settings, which another page may have changed."""
        shown = self._session.settings.more_axes
        while len(self._others) > len(shown):
            self._others.pop()
            self._row.pop(-1)
        for number, axes in enumerate(shown):
            if number == len(self._others):
                self._open(number)
            elif self._others[number].axes != axes:
                x, y = axes
                self._others[number].set_axes(x, y)
        self._show_buttons()

    def redraw(self) -> None:
        """Draw all results that are not hidden, in each diagram."""
        self._match()
        for view in (self._first, *self._others):
            view.redraw()

    def close_lists(self) -> None:
        """Close the lists of marks that coincide, in each diagram."""
        for view in (self._first, *self._others):
            view.marks.close()

    def mark_chosen(self) -> None:
        """Draw a ring about the selected solution, in each diagram."""
        for view in (self._first, *self._others):
            view.mark_chosen()
