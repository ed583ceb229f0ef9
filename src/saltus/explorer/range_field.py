"""A parameter and a range of it: a list with two fields, kept in the session by what they are for."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from saltus.explorer import look, widgets
from saltus.explorer.parameter_view import range_of

if TYPE_CHECKING:
    from saltus.explorer.session import Session

__all__ = ["RangeField"]

_WIDTH = 96  # pixels of the field of an end


class RangeField:
    """A parameter with its range.

    Parameters
    ----------
    session : Session
        In whose settings both are kept: the parameter, and the range of each parameter that has been changed.
    purpose : str
        What the range is for, as ``"parameter"``: the title of the list, and its name in the session.
    width : int, optional
        Pixels of the list.
    """

    def __init__(self, session: Session, purpose: str, width: int = 120) -> None:
        self._session, self._purpose = session, purpose
        self._names: Sequence[str] = session.system.parameter_names
        kept = session.settings.chosen.get(purpose)
        first = next((name for name in (kept, *self._names) if name in self._names), None)
        self.chooser = widgets.choice(purpose, _labelled(self._names), first, width, f"select-{purpose}")
        self.ends = [widgets.number(title, 0.0, _WIDTH, f"{purpose}-{title}") for title in ("from", "to")]
        self._resetting = False
        self._reset()
        widgets.on_change(self.chooser, lambda _: self._chosen())
        for end in self.ends:
            widgets.on_change(end, lambda _: self._typed())

    @property
    def name(self) -> str:
        """The parameter."""
        return str(self.chooser.value or "")

    @property
    def bounds(self) -> tuple[float, float]:
        """The range in the fields.

        Raises
        ------
        InputError
            A field is empty, or its number is not finite.
        """
        both = zip(self.ends, ("lower", "upper"), strict=True)
        low, high = (widgets.number_of(f"{title} bound of {self.name}", end.value) for end, title in both)
        return low, high

    def bounds_of(self, name: str) -> tuple[float, float]:
        """Return the range of a parameter, whether it is the one that is chosen or not.

        Raises
        ------
        InputError
            It is the one that is chosen, and a field is empty, or its number is not finite.
        """
        return self.bounds if name == self.name else self._kept(name)

    def leave_out(self, name: str) -> None:
        """Offer all parameters but one; where this one was chosen, another takes its place."""
        rest = [other for other in self._names if other != name]
        chosen = self.name if self.name in rest else (rest[0] if rest else None)
        self.chooser.param.update(options=_labelled(rest), value=chosen)
        self._chosen()

    def _kept(self, name: str) -> tuple[float, float]:
        low, high = self._session.settings.ranges.get(self._purpose, {}).get(name) or range_of(self._session, name)
        return low, high

    def _reset(self) -> None:
        if self.name:
            self._resetting = True
            self.ends[0].value, self.ends[1].value = self._kept(self.name)
            self._resetting = False

    def _chosen(self) -> None:
        if self._session.settings.chosen.get(self._purpose) != self.name:
            self._session.settings.chosen[self._purpose] = self.name
            self._reset()
            self._session.keep()

    def _typed(self) -> None:
        """Keep the range of the parameter where it has been changed, and both ends are numbers."""
        values, kept = [end.value for end in self.ends], self._session.settings.ranges
        if self._resetting:
            return
        if self.name and None not in values and tuple(values) != self._kept(self.name):
            kept.setdefault(self._purpose, {})[self.name] = (float(values[0]), float(values[1]))
            self._session.keep()


def _labelled(names: Sequence[str]) -> dict[str, str]:
    """Return parameters by what a list shows of them."""
    labels = {look.bare_label(name): name for name in names}
    return labels if len(labels) == len(names) else {name: name for name in names}
