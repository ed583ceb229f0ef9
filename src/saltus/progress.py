"""How far a long computation has come: one report for all of them, and a bar that shows it."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack, contextmanager
from dataclasses import dataclass
from html import escape
from time import monotonic
from types import TracebackType
from typing import Any, Self, TypeAlias

from saltus.errors import InputError
from saltus.extras import check_installed

__all__ = ["Progress", "Report", "Reporter", "duration_text", "ended", "in_notebook", "shown"]

_PACE = 0.1  # seconds between two changes of a bar in a notebook, at least
_SHORTEST = 1e-9  # seconds that a computation takes at the least, as a divisor


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a computation has come: what a `progress` function is called with.

    Attributes
    ----------
    done : int
        What is done: points of a branch, values of a sweep, cells of a map.
    total : int or None
        How many there will be, as far as is known; None where nobody can know.
    rate : float
        How many were done in a second, on average.
    text : str
        What was done last, in words.
    last : object
        What was done last; of a branch of orbits a function without arguments that returns its last orbit.

    Examples
    --------
    >>> Progress(30, 120, 2.0, "w = 0.93").left
    45.0
    """

    done: int
    total: int | None
    rate: float
    text: str = ""
    last: Any = None

    @property
    def left(self) -> float | None:
        """Seconds that the rest takes at the same rate; None where the total or the rate is not known."""
        return (self.total - self.done) / self.rate if self.total is not None and self.rate > 0.0 else None


Report: TypeAlias = Callable[[Progress], object]  # a function that is told how far a computation has come


class Reporter(AbstractContextManager["Reporter"]):
    """Counts what is done, and tells who asked for `progress`.

    Parameters
    ----------
    progress : bool or callable
        True for a bar on stderr, False for nothing, or a function that is called with a `Progress`.
    total : int, optional
        How many there will be.

    Attributes
    ----------
    report : callable or None
        Who is told; a part of the computation takes it as its own `progress`.

    Raises
    ------
    InputError
        Neither a bool nor a callable.

    Examples
    --------
    >>> with Reporter(lambda progress: print(progress.done, progress.total, progress.text), 2) as reporter:
    ...     reporter.step(1, "half")
    1 2 half
    """

    def __init__(self, progress: bool | Report | None, total: int | None = None) -> None:
        if progress is not None and not isinstance(progress, bool) and not callable(progress):
            raise InputError("progress", progress, "True for a bar, or a function of a saltus.Progress")
        self._bar = progress is True
        self._stack = ExitStack()
        self.report: Report | None = progress if callable(progress) else None
        self.done, self.total, self._before, self._started = 0, total, 0, monotonic()

    def __enter__(self) -> Self:
        if self._bar:
            self.report = self._stack.enter_context(shown())
        self._started = monotonic()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.__exit__(kind, error, trace)

    def expect(self, count: int, done: int = 0) -> None:
        """Expect so many more, some of which an earlier run has done; the rate leaves these out."""
        self.total = (self.total or 0) + count
        self.done += done
        self._before += done

    def step(self, count: int = 1, text: str = "", last: Any = None) -> None:
        """Tell that so many more are done; where they are more than were expected, all are."""
        self.done += count
        if self.total is not None:
            self.total = max(self.total, self.done)
        if self.report is not None:
            rate = (self.done - self._before) / max(monotonic() - self._started, _SHORTEST)
            self.report(Progress(self.done, self.total, rate, text, last))

    def finish(self) -> None:
        """Tell that all is done, whatever was expected."""
        if self.total is not None and self.done < self.total:
            self.step(self.total - self.done)


def ended(done: int, total: int, what: str, *, interrupted: bool = False) -> str:
    """Return how a computation of many parts ended, in words.

    Parameters
    ----------
    done, total : int
        Parts that are done, and all of them.
    what : str
        What the parts are, in the plural.
    interrupted : bool, optional
        Whether an interrupt came, be it after the last part.

    Examples
    --------
    >>> ended(3, 3, "values"), ended(2, 3, "values")
    ('all 3 values done', 'interrupted: 2 of 3 values done')
    """
    if done == total and not interrupted:
        return f"all {total} {what} done"
    return f"interrupted: {done} of {total} {what} done"


@contextmanager
def shown(first: str = "starting") -> Iterator[Report]:
    """Show a bar on stderr, or below a notebook's cell, while a computation reports to what this context gives.

    Parameters
    ----------
    first : str, optional
        What stands there until the first report.

    Examples
    --------
    >>> with shown("searching") as report:
    ...     report(Progress(3, 4, 1.0, "w = 0.93"))
    """
    if in_notebook():
        with _shown_below_cell(first) as report:
            yield report
        return
    check_installed("rich")
    from rich.console import Console
    from rich.progress import BarColumn, Progress as Bar, TextColumn

    columns = BarColumn(), TextColumn("{task.description}", markup=False)
    with Bar(*columns, console=Console(file=sys.stderr)) as bar:
        task = bar.add_task(first, total=None)

        def show(progress: Progress) -> None:
            bar.update(task, completed=progress.done, total=progress.total, description=_line(progress))

        yield show


def in_notebook() -> bool:
    """Return whether this runs in the kernel of a notebook."""
    shell = sys.modules.get("IPython")
    return shell is not None and "IPKernelApp" in getattr(shell.get_ipython(), "config", {})


@contextmanager
def _shown_below_cell(first: str) -> Iterator[Report]:
    """Show a bar below a notebook's cell, without widgets, and give what moves it; it stands still at the end."""
    from IPython.display import HTML, display

    handle, at = display(HTML(escape(first)), display_id=True), -_PACE
    last: Progress | None = None
    drawn: Progress | None = None

    def draw(progress: Progress, total: int | None) -> None:
        share = f'value="{progress.done}" max="{total}"' if total else ""
        handle.update(HTML(f"<progress {share}></progress> {escape(_line(progress))}"))

    def show(progress: Progress) -> None:
        nonlocal at, last, drawn
        last = progress
        if monotonic() - at >= _PACE or progress.done == progress.total:
            at, drawn = monotonic(), progress
            draw(progress, progress.total)

    try:
        yield show
    finally:
        if last is not None and (last is not drawn or last.total is None):
            draw(last, last.total or last.done)


def _line(progress: Progress) -> str:
    """Return what stands beside the bar."""
    share = f"{progress.done:,}" if not progress.total else f"{100.0 * progress.done / progress.total:5.1f} %"
    parts = [share, f"{progress.rate:,.0f} a second" if progress.rate >= 100.0 else f"{progress.rate:.3g} a second"]
    if progress.left is not None:
        parts.append(f"{duration_text(progress.left)} left")
    return "  ".join([*parts, progress.text] if progress.text else parts)


def duration_text(seconds: float) -> str:
    """Return a time in two units at most.

    Examples
    --------
    >>> duration_text(3700.0)
    '1 h 2 min'
    """
    if seconds < 59.5:
        return f"{seconds:.2g} s"
    if seconds < 599.5:
        return f"{round(seconds) // 60} min {round(seconds) % 60} s"
    minutes = round(seconds / 60.0)
    if minutes < 60:
        return f"{minutes} min"
    if minutes < 24 * 60:
        return f"{minutes // 60} h {minutes % 60} min"
    return f"{minutes // 1440} d {minutes % 1440 // 60} h"
