"""Lines of the page: how far work under way is, how long it takes yet, what waits; what is selected."""

from __future__ import annotations

from html import escape
from typing import TYPE_CHECKING, Any

from saltus.explorer import look
from saltus.progress import duration_text

if TYPE_CHECKING:
    from saltus.explorer.desk import Work
    from saltus.explorer.steps import Place
    from saltus.progress import Progress

__all__ = ["line_of", "share_of", "title_of"]

_SHORTEST = 1.0  # seconds that are left, from which on they are told


def share_of(progress: Progress | None) -> int:
    """Return which share is done, in percent; -1 where nobody can know.

    Examples
    --------
    >>> from saltus.progress import Progress
    >>> share_of(Progress(3, 10, 1.0)), share_of(None)
    (30, -1)
    """
    return -1 if progress is None or not progress.total else min(round(100 * progress.done / progress.total), 100)


def line_of(work: Work) -> str:
    """Return HTML about the work; empty when all is done.

    Examples
    --------
    >>> from saltus.explorer.desk import Work
    >>> from saltus.progress import Progress
    >>> line_of(Work("branch: saltus.continue_orbit(...)", Progress(3, 10, 0.5, "points"), ("sweep: ...",)))
    'branch 3 of 10 points, 14 s left <span class="queue" title="sweep: ...">1 more waits: sweep</span>'
    """
    if not work.what:
        return ""
    progress = work.progress
    told = escape(_noun(work.what))
    if progress is not None:
        told += f" {progress.done}{f' of {progress.total}' if progress.total else ''} {escape(progress.text)}".rstrip()
        if progress.left is not None and progress.left >= _SHORTEST:
            told += f", {duration_text(progress.left)} left"
    if work.silent:
        told += f", without news for {work.silent} s"
    if work.stopping:
        told += ", stopping"
    if work.waiting:
        nouns = ", ".join(_noun(what) for what in work.waiting)
        count = f"{len(work.waiting)} more wait{'s' if len(work.waiting) == 1 else ''}"
        title = escape(" | ".join(work.waiting))
        told += f' <span class="queue" title="{title}">{count}: {escape(nouns)}</span>'
    return told


def _noun(what: str) -> str:
    return what.partition(":")[0]


def title_of(place: Place, results: Any, solution: Any) -> str:
    """Return HTML that says what is selected.

    Parameters
    ----------
    place : Place
        Where it stands.
    results : mapping of str to Result
        The session's results.
    solution : PeriodicOrbit, Equilibrium or another solution
        What stands there.
    """
    where = place.of
    if place.label is not None:
        point = results[place.of][place.label]
        where += f" {place.label}, {look.meaning_of(point.type, point.locus)}"
    elif place.index is not None:
        where += f" point {place.index}"
    varied = getattr(results[place.of], "varied", ())
    values = ", ".join(f"{look.bare_label(name)} = {solution.parameters[name]:.12g}" for name in varied)
    stable = None if place.label is not None else getattr(solution, "stable", None)
    state = "" if stable is None else ("stable" if stable else "unstable")
    return " · ".join(escape(part) for part in (where, values, state) if part)
