"""The equations of the system or the map as text: to read, to change, to keep in a file."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from io import BytesIO
from typing import TYPE_CHECKING

from saltus.errors import SaltusError
from saltus.explorer import widgets
from saltus.explorer.equations import LONGEST, equations_of, read_equations
from saltus.explorer.subjects import Subject, of_system
from saltus.explorer.views.session_view import link

if TYPE_CHECKING:
    from saltus.explorer.session import Session

__all__ = ["EquationsView"]

_ROWS = 24  # lines of the field


class EquationsView:
    """The equations.

    Parameters
    ----------
    session : Session
        Whose system is shown.
    defined : callable
        Called with the `Subject` that was written; returns the name of a new session of it.
    """

    def __init__(self, session: Session, defined: Callable[[Subject], str]) -> None:
        self._session, self._defined = session, defined
        self._field = widgets.lines("equations", equations_of(session.system), _ROWS, LONGEST)
        use = widgets.button("Use these equations", "use-equations", kind="primary", tip="in a new session")
        widgets.on_click(use, self._use)
        keep = widgets.download("Save", "equations.txt", lambda: BytesIO(self._field.value.encode()))
        self._told = widgets.html("equations-told")
        hint = "<span class='hint'>Saved as a file: <code>saltus explore equations.txt</code></span>"
        self.panel = widgets.column(
            widgets.row(use, keep), self._told, self._field, widgets.html("equations-hint", hint)
        )

    def _use(self) -> None:
        """Open a session of what is written, or say where it cannot be read."""
        try:
            subject = self._subject()
            where = self._defined(subject)
        except SaltusError as error:
            self._told.css_classes = ["equations-told", "error"]
            self._told.object = escape(str(error))
            return
        self._told.css_classes = ["equations-told"]
        self._told.object = f"The equations are read: {link({'session': where}, 'open them')}"

    def _subject(self) -> Subject:
        """Return what is written, with the start of this session where the states are the same."""
        system = read_equations(self._field.value or "")
        subject = of_system(system)
        own = self._session.system
        same = (system.part, system.states) == (own.part, own.states)
        return subject._replace(x0=self._session.settings.x0) if same else subject
