"""How far a piece of work has come: what `progress` is called with."""

from __future__ import annotations

from collections.abc import Callable
from time import monotonic
from typing import TypeAlias

__all__ = ["Progress", "Telling"]

Progress: TypeAlias = Callable[[int, int, float, float], None]
"""Called with the count of what is done, of all, what is done a second, and how many seconds are left."""


class Telling:
    """Tells how many motions are done, of how many that are expected so far.

    Parameters
    ----------
    progress : callable or None
        Who is told.
    """

    def __init__(self, progress: Progress | None) -> None:
        self.progress, self.done, self.total, self.started = progress, 0, 0, monotonic()

    def expect(self, count: int) -> None:
        """Expect more motions."""
        self.total += count

    def step(self, count: int) -> None:
        """Some motions are done; where they are more than were expected, all are."""
        self.done += count
        self.total = max(self.total, self.done)
        if self.progress is not None and count:
            rate = self.done / max(monotonic() - self.started, 1e-9)
            self.progress(self.done, self.total, rate, (self.total - self.done) / rate)

    def finish(self) -> None:
        """All is done, whatever was expected."""
        self.step(self.total - self.done)
