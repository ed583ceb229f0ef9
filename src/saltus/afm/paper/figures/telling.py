"""Progress of a figure: reports of its steps, and of the results under way."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

from saltus.progress import Progress, Report

__all__ = ["about", "tell"]


def tell(progress: bool | Report, text: str) -> None:
    """Report the step that begins, if `progress` is a function.

    Examples
    --------
    >>> tell(lambda progress: print(progress.text), "preparing the model")
    preparing the model
    """
    if callable(progress):
        progress(Progress(0, None, 0.0, text))


def about(progress: bool | Report, what: str) -> bool | Report:
    """Return a `progress` whose reports begin with the name of a result.

    Examples
    --------
    >>> about(lambda progress: print(progress.text), "SN_1")(Progress(3, None, 1.0, "Omega = 1.1"))
    SN_1: Omega = 1.1
    """
    return partial(_named, progress, what) if callable(progress) else progress


def _named(report: Report, what: str, progress: Progress) -> None:
    report(replace(progress, text=f"{what}: {progress.text}" if progress.text else what))
