"""Brute-force diagrams: an attractor followed by simulation along a parameter, and labelled at each value.

Rules
-----
* At each value the motion starts from the end of the motion at the value before. If its mode has ended at the new
  value, it starts in the mode that the state allows. If there was no motion at the value before, it starts at `x0`.
* The label ``diverged`` comes with a reason: the motion leaves every bound, takes more than 5000 steps a return, or
  cannot start. So does ``chattering``: events accumulate, or the motion sticks where a field jumps. The next value then
  starts from `x0`.
* The label of a motion follows from `Criteria.looked_at` returns, of which the last are kept.
* A motion that recurs with a positive leading exponent is on an unstable orbit. It is pushed by `Criteria.push` of its
  size, and settles once more.
* A motion without a return for `Criteria.absence` mean return times is taken not to return to the section. The mean
  return time is measured over the first of the dropped returns.
* A motion that cannot be told is followed on, and looked at over `Criteria.patience` times as many returns, then over
  as many times that. So is one that is weakly chaotic or quasi-periodic, once, and a strange one that is not chaotic.
  What cannot be told then is ``unresolved``, with the reason.
* The exponents are measured over as many returns again, after those of the label. Where their error leaves open whether
  a motion without recurrence is chaotic, `Criteria.patience` times as many returns follow.
* The motion of a map returns at each iteration, and its exponents are per iteration.
* The observables are taken over the period of a periodic motion, else over the time of the returns kept.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping, Sequence
from contextlib import closing, suppress
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.progress import Report, Reporter
from saltus.sweeps.gaps import warn_of_gaps
from saltus.sweeps.options import PASSES, SweepOptions
from saltus.sweeps.record import Record
from saltus.sweeps.sweep import Sweep
from saltus.sweeps.task import Task
from saltus.sweeps.workers import Piece, Together, rows_of
from saltus.system import HybridSystem, Map

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

    from saltus.checks.states import StateLike

__all__ = ["run_sweep"]

_TOGETHER = 128  # motions side by side, at most: with more the next look at an interrupt would be far
_FEWEST = 16  # stretches from which on lanes pay
_MANY = 100_000  # returns from which on lanes pay for being compiled
_MANY_MEASURED = 25_000  # returns, over which an exponent is measured, from which on its lanes pay


def run_sweep(
    system: HybridSystem | Map,
    parameter: str,
    values: ArrayLike,
    *,
    parameters: Mapping[str, float] | None = None,
    x0: StateLike | None = None,
    options: SweepOptions | None = None,
    path: str | os.PathLike[str] | None = None,
    progress: bool | Report = False,
) -> Sweep:
    """Return the attractors along a parameter, found by simulation: a brute-force diagram.

    At each value the motion first returns `SweepOptions.discard` times to a section; these returns take no memory. Then
    it returns as often as its label needs, and the last `SweepOptions.keep` points are kept.

    Parameters
    ----------
    system : HybridSystem or Map
        The system.
    parameter : str
        The swept parameter, or a group of parameters.
    values : array_like, shape (value,)
        Its values, ascending.
    parameters : mapping of str to float, optional
        Other values that differ from the defaults.
    x0 : array_like, shape (states,) or (all states,), or mapping of str to float, optional
        State at which the motion starts; by default all states are 0, at phase 0. An equilibrium or orbit there is
        found only if it is an attractor. A value at which no motion can start there is labelled ``diverged``.
    options : SweepOptions, optional
        Which returns are kept, in which direction the values are followed, and what is measured and observed.
    path : path-like, optional
        A file in which the finished values are saved every few seconds. Where the file exists, the sweep resumes from
        it, with the same result as a sweep without interruption.
    progress : bool or callable, optional
        True for a bar on stderr, or a function called with a `saltus.Progress`. It counts values, those of both
        directions.

    Returns
    -------
    Sweep
        An interrupt (Ctrl-C) keeps the finished values; `Sweep.stopped` says so.

    Raises
    ------
    InputError
        An argument that cannot be used, a start that no value admits, or a file with a sweep of other input.

    Warns
    -----
    RuntimeWarning
        `values` is a tuple of two, which looks like bounds; a list of two is taken without a word.
        A quantity or an observable of a motion has no finite value, as a logarithm of what is negative; it tells where.

    Notes
    -----
    With `path`, the finished values are saved whatever ends a sweep early.

    Examples
    --------
    The logistic map:

    >>> from saltus import Map
    >>> logistic = Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"})
    >>> sweep = run_sweep(logistic, "r", [3.2, 3.5, 3.7], x0=[0.3])
    >>> sweep.labels.tolist()
    [['period-2', 'period-4', 'chaotic']]
    """
    if isinstance(values, tuple) and len(values) == 2:
        spread = f"np.linspace({values[0]!r}, {values[1]!r}, 100)"
        told = f"values = {values!r} are two values, no bounds: {spread} spreads values between, a list means two"
        warnings.warn(told, RuntimeWarning, stacklevel=2)
    grid = checks.ascending("values", values, "SweepOptions(follow='down') goes from the last to the first")
    chosen = SweepOptions() if options is None else checks.instance("options", options, SweepOptions)
    task = Task.checked(system, parameter, grid, parameters, x0, chosen)
    anew = chosen.follow == "restart"
    most, what = (1, "as every value starts anew") if anew else (grid.size, "the number of values")
    checks.count("SweepOptions.chunks", chosen.chunks, 1, most, what)
    reporter = Reporter(progress)
    task.load(grid.tolist())
    directions = PASSES[chosen.follow]
    record = Record.begun(task, grid, directions, path, reporter)
    pieces = _pieces(directions, grid.size, grid.size if anew else chosen.chunks)
    lanes = None
    count = grid.size * len(directions)
    if chosen.lanes or (chosen.lanes is None and _lanes_pay(len(pieces), count, chosen)):
        lanes = task.by_lanes(float(grid[0]), growing=_growth_pays(len(pieces), count, chosen))
    together = None if lanes is None else Together(lanes.begun_together, _TOGETHER)
    left = record.left(pieces)
    try:
        with (
            suppress(KeyboardInterrupt),
            closing(rows_of(task.row, grid, left, chosen.workers, chosen.client, together)) as rows,
            reporter,
        ):
            for place, row in rows:
                record.keep(place, row)
    finally:
        if record.fresh:
            record.save()
    found = record.as_sweep()
    warn_of_gaps(found)
    return found


def _lanes_pay(pieces: int, values: int, options: SweepOptions) -> bool:
    """Whether motions side by side save more time than it takes to compile their steps; told by the input alone."""
    returns = options.discard + options.criteria.looked_at(options.keep)
    return pieces >= _FEWEST and values * returns >= _MANY


def _growth_pays(pieces: int, values: int, options: SweepOptions) -> bool:
    """Whether it is so for steps with perturbations, which save more, and take longer to compile."""
    wanted = options.exponents * (options.exponents + 1) // 2
    return pieces >= _FEWEST and values * options.criteria.looked_at(options.keep) >= wanted * _MANY_MEASURED


# the values, in the order in which they are computed


def _pieces(directions: Sequence[str], count: int, chunks: int) -> list[Piece]:
    """Return stretches of values; within a stretch each value starts from the one before."""
    pieces = []
    for row, direction in enumerate(directions):
        parts = [part.tolist() for part in np.array_split(np.arange(count), chunks)]
        pieces += [Piece(row, part[::-1] if direction == "down" else part) for part in parts]
    return pieces
