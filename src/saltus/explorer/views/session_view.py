"""The list of sessions: a new one, the name of this one, the others to open or to delete."""

from __future__ import annotations

import json
import time
from html import escape
from pathlib import Path
from typing import TYPE_CHECKING, Any

from saltus.errors import SaltusError
from saltus.explorer import widgets
from saltus.explorer.desk import Desk, Listener

if TYPE_CHECKING:
    from saltus.explorer.office import Listed, Office

__all__ = ["SessionView", "line_of", "link"]

_MOST = 30  # sessions that are listed
_DELETE = "\u2715"  # what a button says before it was pressed
_SURE = "Delete?"  # and after


class SessionView(Listener):
    """The list.

    Parameters
    ----------
    desk : Desk
        The session of this page.
    office : Office
        All sessions.
    """

    def __init__(self, desk: Desk, office: Office) -> None:
        self._desk, self._office, self._session = desk, office, desk.session
        self._name = widgets.text("session-name", "name of this session", 150)
        self._name.value = desk.session.name
        widgets.on_change(self._name, self._named)
        asked = {"system": desk.session.subject.key} if desk.session.subject.key in office.application.titles else {}
        new = link(asked if office.subject is None else {}, "New session", "new-session")
        self._list = widgets.column(name="sessions")
        self.panel = widgets.column(
            widgets.html("heading", "<h2>Sessions</h2>", (8, 8, 0, 8)),
            widgets.row(self._name, widgets.html("new", new)),
            self._list,
        )
        self._show()
        desk.join(self, widgets.poster())

    def _show(self) -> None:
        others = [one for one in self._office.listed() if one.folder != self._session.folder.name]
        self._list[:] = [self._row(one) for one in others[:_MOST]]

    def _row(self, one: Listed) -> Any:
        button = widgets.button(_DELETE, f"delete-{one.folder}", tip="delete this session with all its results")

        def clicked() -> None:
            if button.name == _DELETE:
                button.name = _SURE
                return
            try:
                self._office.delete(one.folder)
            except SaltusError as error:
                self._desk.tell(str(error), error=True)
            self._show()

        widgets.on_click(button, clicked)
        line = widgets.html(f"session-{one.folder}", line_of(one), (4, 4, 0, 8), sizing_mode="stretch_width")
        return widgets.beside(line, button)

    def _named(self, name: str) -> None:
        if name.strip() != self._session.name:
            self._session.name = name.strip()
            self._session.keep()
            self._desk.change(self)

    def changed(self) -> None:
        """Show what another page has changed."""
        self._name.value = self._session.name


def line_of(one: Listed) -> str:
    """Return HTML that names a session, and leads to it.

    Examples
    --------
    >>> from saltus.explorer.office import Listed
    >>> line_of(Listed("0123456789ab", "near the fold", "lever-s", 3, 0.0)).count("near the fold")
    1
    """
    when = time.strftime("%Y-%m-%d %H:%M", time.localtime(one.at))
    system = Path(one.key).name
    told = f"{escape(system)}, " if one.name else ""
    results = f"{one.results} result{'' if one.results == 1 else 's'}"
    return f'{link({"session": one.folder}, one.name or system)} <span class="time">{told}{results}, {when}</span>'


def link(asked: dict[str, str], text: str, name: str = "") -> str:
    """Return a link to a page as HTML; the page's own code adds what an address needs in a frame.

    Parameters
    ----------
    asked : dict of str to str
        The query of its address.
    text : str
        What is shown.
    name : str, optional
        A class by which tests and style sheets find it.

    Examples
    --------
    >>> link({"session": "0123456789ab"}, "open it").partition(" data-go")[0]
    '<a class="" href="?session=0123456789ab"'
    """
    query = "&".join(f"{key}={value}" for key, value in asked.items())
    return f'<a class="{name}" href="?{escape(query)}" data-go="{escape(json.dumps(asked))}">{escape(text)}</a>'
