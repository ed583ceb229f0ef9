"""Growth of small perturbations along a motion: its variational equations, with saltation at every event and QR."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.errors import InputError
from saltus.flow.motion import EventDrivenMotion, check_tolerances, start_state
from saltus.flow.shares import with_shares
from saltus.flow.sticking import check_continuous
from saltus.result import frozen

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import ArrayLike, NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = ["BATCHES", "CONFIDENCE", "ROWS", "Average", "Growth", "frame_tolerance", "grown", "growth_along"]

BATCHES = 20  # batches into which a stretch is cut for the errors of its exponents
CONFIDENCE = 0.95  # probability that an exponent lies within its error, were the batches independent and normal
ROWS = 25 * BATCHES  # stretches of which the growth is kept, at most
_FEWEST_ROWS = 3  # ends of rows, from which on the growth in two rows tells an error
_STEPS_KEPT = 256  # steps of dense output between two clearances of the buffer
_DECAY = 1e7  # decay over a motion, in factors e, up to which explicit steps resolve it
_STEPS_A_PERIOD = 50_000  # steps of a period, beyond which a motion is stiff
_SHRUNK = 100.0  # factor by which the steps of a stiff motion without a period are shorter than before
_STIFF_STEPS = 1_000_000  # such short steps, beyond which the motion is stiff


@dataclass(frozen=True, kw_only=True)
class Average:
    """Over how long Lyapunov exponents are averaged; exactly one of `periods` and `t_end`.

    Parameters
    ----------
    periods : int, optional
        Periods of the phase, at least 2, counted from phase 0 on; for a map, iterations.
    t_end : float, optional
        A time.
    discard : int or float, optional
        How long before, in the same unit, the motion settles and the frame turns into the directions that grow; by
        default half of what is measured.

    Raises
    ------
    InputError
        Both of them are given, or none; one of them is no such number.

    Examples
    --------
    >>> Average(periods=500, discard=100)
    Average(periods=500, t_end=None, discard=100)
    """

    periods: int | None = None
    t_end: float | None = None
    discard: float | None = None

    def __post_init__(self) -> None:
        if (self.periods is None) == (self.t_end is None):
            given = {"periods": self.periods, "t_end": self.t_end}
            raise InputError("Average.periods, Average.t_end", given, "exactly one of the two given")
        discard = self.discard
        if self.periods is None:
            object.__setattr__(self, "t_end", checks.positive("Average.t_end", self.t_end))
            discard = None if discard is None else checks.non_negative("Average.discard", discard)
        else:
            object.__setattr__(self, "periods", checks.count("Average.periods", self.periods, 2))
            if discard is not None:
                discard = checks.count("Average.discard", discard, 0, what="a number of periods")
        object.__setattr__(self, "discard", discard)


@dataclass(frozen=True)
class Growth:
    """How perturbations grew along a motion; made by `growth_along`."""

    # shape (row,): ends of the rows, the stretches of time one after the other, counted from the first one's start
    times: NDArray[np.float64]
    # shape (row, exponent): logarithm of the growth in each row of each orthogonal direction, the one that grows most
    # over all rows first; ``-inf`` for a direction that was collapsed
    logs: NDArray[np.float64]
    x_end: NDArray[np.float64]  # shape (all states,): full state at the end
    mode_end: int  # index of the mode there
    grazed: int  # events without a saltation matrix, over which the perturbations were carried unchanged
    discarded: float  # time before the first row

    @property
    def exponents(self) -> NDArray[np.float64]:
        """Lyapunov exponents per unit of time, largest first, shape (exponent,)."""
        return np.asarray(self.logs.sum(axis=0) / self.times[-1])

    @property
    def errors(self) -> NDArray[np.float64]:
        """Half widths of the exponents' confidence intervals, from the spread of batch means, shape (exponent,).

        The rows are gathered into at most `BATCHES` batches of nearly equal length. With the standard deviation s of
        their B means, the half width is ``t s / sqrt(B)``. There t is the quantile of Student's distribution with B - 1
        degrees of freedom for `CONFIDENCE`. The half width of an exponent of ``-inf`` is 0.

        References
        ----------
        A. M. Law, W. D. Kelton, Simulation Modeling and Analysis, 3rd edition, McGraw-Hill 2000, chapter 9.
        """
        from scipy.special import stdtrit

        count = min(BATCHES, self.times.size)
        edges = np.round(np.linspace(0, self.times.size, count + 1)).astype(int)
        spans = np.diff(np.append(0.0, self.times)[edges])
        finite = np.isfinite(self.logs).all(axis=0)
        errors = np.zeros(finite.size)
        means = np.add.reduceat(self.logs[:, finite], edges[:-1], axis=0) / spans[:, None]
        quantile = float(stdtrit(count - 1, 0.5 + 0.5 * CONFIDENCE))
        errors[finite] = quantile * means.std(axis=0, ddof=1) / math.sqrt(count)
        return errors


def frame_tolerance(rtol: float) -> float:
    """Return the relative tolerance of the frame along a motion whose steps have the tolerance `rtol`."""
    from saltus.flow.kernels import variational as kernels

    return min(kernels.LOOSER * rtol, kernels.LOOSEST)


def growth_along(
    system: HybridSystem,
    p: NDArray[np.float64],
    x: ArrayLike,
    mode: int,
    *,
    average: Average,
    exponents: int | None = None,
    tolerance: tuple[float, float] = (1e-10, 1e-12),
    interrupted: Sequence[float] = (),
    limit: float | None = None,
) -> Growth:
    """Return the growth of perturbations along a motion, from which its Lyapunov exponents follow.

    An orthonormal frame is carried by the variational equations along the steps of the motion, and by the saltation
    matrix over events. A step that is too long for the frame is taken in parts. After each part and event the frame is
    made orthonormal, in units of the states' sizes. The system's phase is not perturbed. No more than some hundred
    steps are in memory at a time.

    Parameters
    ----------
    x : array_like, shape (states,) or (all states,)
        Start, best on the attractor.
    average : Average
        How long it is measured.
    exponents : int, optional
        How many, the largest; by default as many as there are states without the phase.
    tolerance : (float, float), optional
        Relative and absolute tolerance of a step of the motion; that of the frame is 1000 times the relative one, at
        most 1e-4.
    interrupted : sequence of float, optional
        Has an entry as soon as the motion shall end: what `saltus.work.interrupt_noted` gives.
    limit : float, optional
        Size beyond which a state that grows has diverged, as in `simulate`.

    Returns
    -------
    Growth
        With logarithms of ``nan`` where a Jacobian is not finite.

    Raises
    ------
    InputError
        An argument that cannot be used.
    ChatteringError, DivergenceError
        As `simulate`.
    DefinitionError
        The motion passes a jump of its mode's field; a power below 1/2 vanishes on a surface of a mode.
    StiffnessError
        It takes more than 50 000 steps a period; without a phase, a million steps a hundred times shorter than before.

    References
    ----------
    G. Benettin, L. Galgani, A. Giorgilli, J.-M. Strelcyn, Lyapunov characteristic exponents for smooth dynamical
    systems and for Hamiltonian systems, Meccanica 15 (1980) 9-30; P. C. Müller, Calculation of Lyapunov exponents for
    dynamic systems with discontinuities, Chaos, Solitons & Fractals 5 (1995) 1671-1681.
    """
    check_tolerances(tolerance)
    system.compiled.check_powers(system, range(len(system.modes)))
    if average.periods is not None and system.phase is None:
        raise InputError("Average.periods", average.periods, "left out for a system without a phase", "give t_end")
    periods, length = average.periods, math.inf if average.t_end is None else average.t_end
    n, most = len(system.states), np.iinfo(np.int64).max
    columns = n if exponents is None else checks.count("exponents", exponents, 1, n, "the number of states")
    run = EventDrivenMotion(system, p, start_state(system, x), mode, *tolerance, steps_kept=_STEPS_KEPT, limit=limit)
    if periods is None:
        first_time = 0.5 * length if average.discard is None else average.discard
        row_times = first_time + np.linspace(0.0, length, ROWS + 1)
        row_wraps = np.full(row_times.size, most)
        run.least_decay = _DECAY / float(row_times[-1])
    else:
        dropped = periods // 2 if average.discard is None else int(average.discard)
        first = max(dropped, 1 if run.offset > 0.0 else 0)
        row_wraps = first + np.round(np.linspace(0, periods, min(ROWS, periods) + 1)).astype(np.int64)
        row_times = np.full(row_wraps.size, math.inf)
        run.most_steps = _STEPS_A_PERIOD * int(row_wraps[-1])
        run.least_decay = _DECAY / (system.turn * int(row_wraps[-1]) / run.rate)
    frame = np.zeros((len(system.all_states), columns))
    # any frame that no direction of the system is likely to be orthogonal to
    frame[:n] = np.linalg.qr(np.random.default_rng(0).standard_normal((n, columns)))[0]
    ends, logs, grazed = _run_rows(run, row_times, row_wraps, frame, interrupted)
    return Growth(*grown(ends, logs), frozen(run.x), run.mode, grazed, float(ends[0]))


def grown(ends: NDArray[np.float64], logs: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return times and logarithms of the rows that are measured, the direction that grows most first.

    Raises
    ------
    KeyboardInterrupt
        So few rows were finished before an interrupt that they tell no error.
    """
    if len(ends) < _FEWEST_ROWS:
        raise KeyboardInterrupt
    order = np.argsort(-logs[1:].sum(axis=0), kind="stable")
    return frozen(ends[1:] - ends[0]), frozen(logs[1:, order])


def _run_rows(
    run: EventDrivenMotion, row_times: NDArray[np.float64], row_wraps: NDArray[np.int64], frame: NDArray[np.float64],
    interrupted: Sequence[float],
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:  # fmt: skip
    """Ends of the rows, logarithms of growth in each, and the count of events grazed."""
    from saltus.flow.kernels import variational as kernels

    places = np.zeros(kernels.N_PLACES, np.int64)
    places[kernels.LIVE] = frame.shape[1]
    logs, ends = np.zeros((row_times.size, frame.shape[1])), np.zeros(row_times.size)
    rows = kernels.Rows(row_times, row_wraps, logs, ends)
    caps = np.full(run.x.size, math.inf)
    caps[run.system.angle_places], caps[len(run.system.states) :] = math.pi, 0.0
    units = kernels.Units(caps, np.zeros(run.x.size), np.ones(run.x.size), np.ones(run.x.size))
    again, done = run.kernels.AGAIN, run.kernels.DONE
    status, longest, stiff = again, 0.0, 0
    while status == again and not interrupted:
        tries, time = run.tries, run.time
        laws, tolerances, *buffers = run.records
        laws = laws._replace(addresses=with_shares(run.system.compiled.addresses, run.shares))  # derivatives too
        status = kernels.growth_kernel(laws, tolerances, run.budget, *buffers, rows, frame, units, places)
        if status == again:
            run.watch()
            step = (run.time - time) / max(run.tries - tries, 1)
            longest = max(longest, step)
            stiff = stiff + run.tries - tries if step < longest / _SHRUNK else 0
            if run.rate == 0.0 and stiff > _STIFF_STEPS:
                raise run.too_stiff()
        count = int(run.counts[run.kernels.N_STEPS])
        check_continuous(run.system, run.step_buffers[1][:count], run.step_buffers[2][:count], run.p)
    if status not in (done, again):
        raise run.error(status)
    finished = int(places[kernels.ROW])
    return ends[:finished], logs[:finished], int(places[kernels.GRAZED])
