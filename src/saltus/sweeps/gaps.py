"""Quantities and observables that have no finite value along a sweep, although there is a motion."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.formulas import read_formula

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from saltus.sweeps.sweep import Sweep

__all__ = ["warn_of_gaps"]

_LISTED = 3  # values that a warning lists, at most
_ABSENT = ("phase", "velocity")  # observables that are NaN where there is no harmonic, or no such event


def warn_of_gaps(sweep: Sweep) -> None:
    """Warn of each quantity and observable that has no finite value somewhere, whoever called the caller."""
    moves = np.isfinite(sweep.return_times)
    for name, lost in _lost(sweep):
        at = sweep.values[np.flatnonzero((lost & moves).any(axis=0))]
        if at.size:
            listed = ", ".join(f"{value:.6g}" for value in at[:_LISTED])
            more = f" and {at.size - _LISTED} more" if at.size > _LISTED else ""
            told = f"{name!r} has no finite value at {sweep.parameter} = {listed}{more}, of {sweep.values.size} values"
            warnings.warn(f"saltus: {told}", RuntimeWarning, stacklevel=3)


def _lost(sweep: Sweep) -> Iterator[tuple[str, NDArray[np.bool_]]]:
    """Go through quantities and observables, and tell where each is not finite, shape (direction, value)."""
    for column, name in enumerate(sweep.quantities):
        yield name, np.asarray((~np.isfinite(sweep.points[..., column])).any(axis=2))
    for column, name in enumerate(sweep.observables):
        values = sweep.observed[..., column]
        absent = any(part.kind in _ABSENT for part in read_formula(sweep.system, name).parts.values())
        yield name, np.isinf(values) if absent else ~np.isfinite(values)
