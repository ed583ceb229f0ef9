"""The list of results: what each is, why it ended, whether it is drawn."""

from __future__ import annotations

from collections.abc import Callable
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.explorer import widgets
from saltus.explorer.session import told_end
from saltus.progress import duration_text
from saltus.sweeps import Sweep

if TYPE_CHECKING:
    from saltus.explorer.session import Entry, Session

__all__ = ["ListView", "line_of"]

# Kinds of results that are drawn in a colour, and whether as dots.
_COLOURED = {"branch": False, "locus": False, "motion": False, "sweep": True, "orbit": True, "equilibrium": True}


class ListView:
    """The list.

    Parameters
    ----------
    session : Session
        What is shown.
    changed : callable
        Called when a result is hidden or shown.
    """

    def __init__(self, session: Session, changed: Callable[[], None]) -> None:
        self._session, self._changed = session, changed
        self.panel = widgets.column(name="results")

    def show(self, colour: Callable[[int], str], unseen: dict[str, str]) -> None:
        """Show all results.

        Parameters
        ----------
        colour : callable
            Returns the colour of a result's curve by its place in the list.
        unseen : dict of str to str
            Why results cannot be drawn on the diagram's axes.
        """
        entries = [*enumerate(self._session.entries)]
        self.panel[:] = [self._row(entry, colour(number), unseen.get(entry.name, "")) for number, entry in entries]
        if not entries:
            text = "<p class='hint'>No results yet. Find an orbit, then continue it in a parameter.</p>"
            self.panel[:] = [widgets.html("no-results", text)]

    def _row(self, entry: Entry, colour: str, unseen: str) -> Any:
        shown = widgets.checkbox(entry.name not in self._session.settings.hidden, f"show-{entry.name}")
        widgets.on_change(shown, lambda seen: self._hide(entry.name, not seen))
        line = line_of(entry, colour, unseen)
        text = widgets.html(f"result-{entry.name}", line, (4, 8, 0, 2), sizing_mode="stretch_width")
        return widgets.beside(shown, text)

    def _hide(self, name: str, hidden: bool) -> None:
        chosen = self._session.settings.hidden
        if hidden:
            chosen.add(name)
        else:
            chosen.discard(name)
        self._changed()


def line_of(entry: Entry, colour: str, unseen: str = "") -> str:
    """Return HTML that says what a result is, how long it took, and why it ended.

    Parameters
    ----------
    entry : Entry
        The result.
    colour : str
        Colour of its curve.
    unseen : str, optional
        Why it cannot be drawn on the diagram's axes.
    """
    first, ends, lost = repr(entry.result).splitlines()[0], told_end(entry.result), _told_lost(entry.result)
    shape = " round" if _COLOURED.get(entry.step.noun) else ""
    swatch = f'<span class="swatch{shape}" style="background:{colour}"></span>' if entry.step.noun in _COLOURED else ""
    parts = [
        f"{swatch}<b>{escape(entry.name)}</b> {escape(first)}",
        f'<span class="end">{escape(ends)}</span>' if ends else "",
        f'<span class="time">{escape(duration_text(entry.seconds))}</span>' if entry.seconds else "",
        *(f'<span class="note">{escape(note)}</span>' for note in entry.notes),
        f'<span class="note">{escape(lost)}</span>' if lost else "",
        f'<span class="note">not on these axes: {escape(unseen)}</span>' if unseen else "",
    ]
    return f'<div class="result" title="{escape(entry.step.text())}">{" ".join(part for part in parts if part)}</div>'


def _told_lost(result: Any) -> str:
    """Return at how many values a sweep has no motion, and why at the first of them; empty of all else."""
    if not isinstance(result, Sweep) or not (lost := result.reasons != "").any():
        return ""
    row, place = np.argwhere(lost)[0]
    where = f"{result.parameter} = {result.values[place]:.6g}"
    return f"no motion at {lost.sum()} of {lost.size} values; at {where}: {result.reasons[row, place]}"
