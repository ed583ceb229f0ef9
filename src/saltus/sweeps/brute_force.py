"""Brute-force diagrams: follow an attractor by simulation along a parameter, and say at each value what it is.

Rules
-----
* At each value the motion goes on from the state where it ended at the value before. Where it cannot (its mode has
  ended at the new value) it starts in the mode that the state allows; where there was no motion to go on from, at `x0`.
* A value at which the motion leaves every bound, chatters, sticks where a field jumps, takes more than 5000 steps a
  return, or cannot start, is labelled ``diverged``, with the reason; the others go on, from `x0`.
* What a motion is follows from `Criteria.looked_at` returns, of which the last are kept.
* A motion that recurs although its leading exponent is positive rests on an unstable orbit, as one does that started
  there: it is pushed by `Criteria.push` of its size, and settles once more.
* A motion is taken not to return to a section after `Criteria.absence` of its mean returns, measured over the first of
  those that are dropped.
* A motion that is neither chaotic by its exponent, nor periodic, nor on a closed curve has not settled: it is followed
  as long again, `Criteria.patience` times at most.
* The exponents are measured after the returns looked at, over as many again; of a motion that does not recur, over
  `Criteria.patience` times as many where their error leaves it open whether it is chaotic.
* The observables are those of a periodic motion's period, or else of as much time as the returns kept take.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing, suppress
from time import monotonic
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.errors import InputError
from saltus.flow.motion_kind import Criteria
from saltus.sweeps.record import Record
from saltus.sweeps.section import Section
from saltus.sweeps.sweep import Sweep
from saltus.sweeps.task import Task
from saltus.sweeps.workers import Piece, rows_of
from saltus.system import HybridSystem

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["run_sweep"]

_FOLLOW = {"up": ("up",), "down": ("down",), "both": ("up", "down"), "restart": ("restart",)}


def run_sweep(
    system: HybridSystem,
    parameter: str,
    values: ArrayLike,
    *,
    parameters: Mapping[str, float] | None = None,
    x0: ArrayLike | None = None,
    mode: str | None = None,
    discard: int = 600,
    keep: int = 100,
    follow: str = "up",
    chunks: int = 1,
    section: str | Section | None = None,
    quantities: Sequence[str] | None = None,
    observables: Sequence[str] = (),
    exponents: int = 1,
    criteria: Criteria | None = None,
    tolerance: float | tuple[float, float] = 1e-8,
    workers: int | None = None,
    client: Any = None,
    path: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int, str], None] | None = None,
) -> Sweep:
    """Return the attractors along a parameter, found by simulation: a brute-force diagram.

    At each value the motion is followed until it has returned `discard` times to a section, then as many times more as
    are needed to say what it is; the last `keep` points are kept. What has been dropped takes no memory.

    Parameters
    ----------
    system : HybridSystem
        What moves.
    parameter : str
        What is swept, a parameter or a group of them.
    values : array_like, shape (value,)
        Its values, ascending.
    parameters : mapping of str to float, optional
        Other values that differ from the defaults.
    x0 : array_like, shape (states,) or (all states,), optional
        Where the motion starts; by default all states are 0, at phase 0. An orbit that rests there is found only if it
        is an attractor. A value at which no motion can start there is labelled ``diverged``.
    mode : str, optional
        Mode there; by default the first that the state allows.
    discard, keep : int, optional
        Returns to the section that are dropped at the least, and those that are kept. What the motion is follows from
        `keep` returns, but no fewer than ``Criteria.looked_at``.
    follow : {"up", "down", "both", "restart"}, optional
        Whether the attractor is followed from the first value to the last, from the last to the first, or both, each on
        its own from `x0`; or whether every value starts at `x0`.
    chunks : int, optional
        Stretches into which the values are cut, each followed on its own from `x0`, so that they can be computed at the
        same time. More than 1 may change which attractor is found.
    section : str or Section, optional
        Where points are taken: before a transition, or on a surface of one's own; by default at phase 0.
    quantities : sequence of str, optional
        What is kept of each point, expressions in states, phase, parameters and outputs; by default the states.
    observables : sequence of str, optional
        What is observed at each value, as ``"amplitude(z, 1)"``; see `saltus.flow.observables`.
    exponents : int, optional
        How many Lyapunov exponents, the largest first.
    criteria : Criteria, optional
        Thresholds of the labels.
    tolerance : float or (float, float), optional
        Relative tolerance of a step, or the relative and the absolute one. By default the absolute one is 1e-10, or so
        much smaller as the smallest state where that is below 1e-2 at the first value.
    workers : int, optional
        Threads that compute; by default as many as there are processors for this process. The result is the same.
    client : dask.distributed.Client, optional
        A cluster that computes instead.
    path : path-like, optional
        A file in which what is done is saved every few seconds. Where it exists, the sweep goes on from it, and ends
        with the same result as one that was not interrupted.
    progress : callable, optional
        Called with the count of values that are done, the count of all, and what has just been done in words.

    Returns
    -------
    Sweep
        An interrupt (Ctrl-C) keeps what is done; `Sweep.stopped` says so.

    Raises
    ------
    InputError
        An argument that cannot be used, a start that no value admits, or a file with a sweep of other input.

    Notes
    -----
    Whatever ends a sweep early, what is done is saved where `path` is given.

    Examples
    --------
    The logistic map, carried by a hybrid system:

    >>> from saltus import HybridSystem, Mode, Transition
    >>> carried = HybridSystem(
    ...     ("x", "s"), {"r": 3.2}, {"carry": Mode({"x": "0", "s": "1"})},
    ...     [Transition("carry", "carry", "s - 1", 1, {"x": "r*x*(1 - x)", "s": "0"}, name="map")],
    ... )
    >>> sweep = run_sweep(carried, "r", [3.2, 3.5, 3.7], x0=[0.3, 0.0], section="map", quantities=["x"])
    >>> sweep.labels.tolist()
    [['period-2', 'period-4', 'chaotic']]
    """
    grid = _ascending(values)
    task = Task.checked(
        system, parameter, grid, parameters, x0, mode, discard=discard, keep=keep, section=section,
        quantities=quantities, observables=observables, exponents=exponents, criteria=criteria, tolerance=tolerance,
    )  # fmt: skip
    directions = _directions(follow)
    most, what = (1, "as every value starts anew") if follow == "restart" else (grid.size, "the number of values")
    chunks = checks.count("chunks", chunks, 1, most, what)
    checks.function("progress", progress, "of two counts and a text")
    task.load(float(grid[0]))
    settings = {**task.settings, "follow": follow, "chunks": chunks}
    record = Record.begun(task, grid, directions, settings, path, progress)
    pieces = record.left(_pieces(directions, grid.size, grid.size if follow == "restart" else chunks))
    try:
        with suppress(KeyboardInterrupt), closing(rows_of(task.row, grid, pieces, workers, client)) as rows:
            record.started = monotonic()
            for place, row in rows:
                record.keep(place, row)
    finally:
        if record.fresh:
            record.save()
    return record.as_sweep()


# input


def _ascending(values: ArrayLike) -> NDArray[np.float64]:
    grid = checks.array("values", values, "a sequence of numbers, at least one")
    if grid.ndim != 1 or not grid.size:
        raise InputError("values", values, "a sequence of numbers, at least one")
    if falls := np.flatnonzero(np.diff(grid) <= 0.0).tolist():
        pair = f"{grid[falls[0]]:.12g}, {grid[falls[0] + 1]:.12g}"
        raise InputError("values", pair, "ascending, each once", "follow='down' goes from the last to the first")
    return grid


def _directions(follow: object) -> tuple[str, ...]:
    return _FOLLOW[checks.chosen("follow", follow, _FOLLOW)]


# the values, in the order in which they are computed


def _pieces(directions: Sequence[str], count: int, chunks: int) -> list[Piece]:
    """Stretches of values that are followed one value after the other."""
    pieces = []
    for row, direction in enumerate(directions):
        parts = [part.tolist() for part in np.array_split(np.arange(count), chunks)]
        pieces += [Piece(row, part[::-1] if direction == "down" else part) for part in parts]
    return pieces
