"""Fields for numbers that a person may set: empty ones are the package's own."""

from __future__ import annotations

from collections.abc import Callable
from math import inf, isfinite
from typing import TYPE_CHECKING, Any

from pydantic import ValidationError

from saltus.errors import InputError
from saltus.explorer import widgets
from saltus.explorer.kinds import kind_of
from saltus.explorer.numerics import Numerics, section_names

if TYPE_CHECKING:
    from saltus.explorer.session import Session

__all__ = ["NumericsView"]

_WIDTH = 112  # pixels of a field
# Title of each field, with the package's own number.
_FIELDS = {
    "largest": "longest step (0.1)",
    "deviation": "deviation (3e-4)",
    "max_points": "points (5000)",
    "settle": "settle for",
    "tolerance": "tolerance",
    "discard": "sweep drops (600)",
    "keep": "sweep keeps (100)",
}
_WHOLE = ("max_points", "discard", "keep")  # fields of whole numbers


class NumericsView:
    """The fields.

    Parameters
    ----------
    session : Session
        Whose numbers they are.
    changed : callable
        Called after a number was changed.
    tell : callable
        Called with a line about a number that is not allowed; the field then shows the number before.
    """

    def __init__(self, session: Session, changed: Callable[[], None], tell: Callable[[str], None]) -> None:
        self._session, self._changed, self._tell = session, changed, tell
        kind = kind_of(session.system)
        self._fields = {name: self._field(name, title) for name, title in _FIELDS.items() if name in kind.numerics}
        names = section_names(session.system)
        usual = names[0] if kind.section else "phase 0"
        self._section = widgets.text("section", f"section of sweeps: {usual}", 236)
        widgets.on_change(self._section, lambda _: self._take())
        self._section.visible = "section" in kind.numerics
        self.panel = widgets.fold("Numerics", widgets.row(*self._fields.values(), wrap=True), self._section)
        self.show()

    def _field(self, name: str, title: str) -> Any:
        made = widgets.number(title, None, _WIDTH, f"numerics-{name}", (1, 4))
        widgets.on_change(made, lambda _: self._take())
        return made

    def _take(self) -> None:
        """Take all fields into the session; what is not allowed is put back."""
        given = {name: field.value for name, field in self._fields.items() if field.value is not None}
        given |= {name: round(given[name]) for name in _WHOLE if isfinite(given.get(name, inf))}
        try:
            found = Numerics(**given, section=self._section.value or "")
        except ValidationError as error:
            first = error.errors()[0]
            title, allowed = _FIELDS[str(first["loc"][0])], first["msg"].removeprefix("Input should be ")
            self._tell(str(InputError(title, first["input"], allowed)))
            self.show()
            return
        if found != self._session.settings.numerics:
            self._session.settings.numerics = found
            self._changed()

    def show(self) -> None:
        """Show the numbers that the session has."""
        numerics = self._session.settings.numerics
        for name, field in self._fields.items():
            if field.value != getattr(numerics, name):
                field.value = getattr(numerics, name)
        if (self._section.value or "") != numerics.section:
            self._section.value = numerics.section
