"""Returns of a motion to a section by Taylor series generated for the system: the fast way through many periods."""

from __future__ import annotations

import math
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import StiffnessError
from saltus.flow.motion import EventDrivenMotion

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.compiled import CompiledSeries
    from saltus.system.hybrid import HybridSystem

__all__ = ["ORDER", "STEPS_A_RETURN", "TaylorRun"]

ORDER = 16  # of the series: from 1e-6 to 1e-13 within a fifth of the best order's time (docs/decisions)
STEPS_A_RETURN = 5000  # steps for each return to a section, beyond which a motion is stiff
_BUDGET = 1 << 16  # steps of one call of the kernel


@cache
def bernstein_table(order: int) -> NDArray[np.float64]:
    """Return the change from powers to Bernstein's basis of degree `order`, then `order - 1`, flat.

    Row i of each table holds ``C(i, j) / C(degree, j)``; G. Farin, Curves and Surfaces for CAGD, section 6.5.
    """
    tables = np.zeros((2, order + 1, order + 1))
    for table, degree in zip(tables, (order, order - 1), strict=True):
        for i in range(degree + 1):
            for j in range(i + 1):
                table[i, j] = math.comb(i, j) / math.comb(degree, j)
    return tables.ravel()


class TaylorRun:
    """A motion under way by Taylor series, from return to return to a section.

    Parameters
    ----------
    system : HybridSystem
        The system.
    series : CompiledSeries
        Its series.
    p : ndarray, shape (parameters,)
        `HybridSystem.parameter_vector`.
    x : ndarray, shape (all states,)
        Start.
    mode : int
        Index of the mode there.
    section : tuple of int or None
        Transitions that are returns; None for the wraps of the phase.
    rtol, atol : float
        Tolerances of a step.
    """

    def __init__(
        self,
        system: HybridSystem,
        series: CompiledSeries,
        p: NDArray[np.float64],
        x: NDArray[np.float64],
        mode: int,
        section: tuple[int, ...] | None,
        rtol: float,
        atol: float,
    ) -> None:
        from saltus.flow.kernels import state as times, taylor_step as kernels
        from saltus.flow.kernels.taylor import follow_kernel

        self.kernels, self.times, self._run = kernels, times, follow_kernel
        self.system, self.series = system, series
        self.p, self.tolerances = p, (float(rtol), float(atol))
        self._helped, self._most = 0, 0
        # what a motion is, and what is refused, is the Runge-Kutta flow's to say
        first = EventDrivenMotion(system, p, x.copy(), mode, rtol, atol)
        first.let_shares_grow(all_of_them=True)
        self._shares = first.shares  # of which kernels know the address
        self._limit = first.limit  # that of the start: a motion that is helped on begins anew, larger each time
        self.rate = first.rate
        self.extended_series = series.constants(p)
        self.laws, self.step_tolerances, *_ = first.records
        self.section = np.zeros(len(system.transitions), np.int64)
        for transition in section or ():
            self.section[transition] = 1
        self.at_wrap = section is None
        self.x = np.append(first.x, 0.0)
        self.numbers, self.counts = np.zeros(kernels.N_NUMBERS), np.zeros(kernels.N_COUNTS, np.int64)
        self.counts[kernels.MODE], self.counts[kernels.STARTING] = mode, 1
        self.counts[kernels.FIRED] = self.counts[kernels.MODE_BEFORE] = -1
        self.side, self.on = first.side.copy(), np.zeros_like(self.section)

    @property
    def mode(self) -> int:
        """Index of the mode now."""
        return int(self.counts[self.kernels.MODE])

    def follow(
        self, discard: int, keep: int, longest: float
    ) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]]:
        """Return states, modes and times of the returns after the first `discard`; see `poincare.iterate`."""
        kernels, n = self.kernels, self.x.size - 1
        kept = np.empty((keep, n)), np.empty(keep, np.int64), np.empty(keep)
        wanted = discard + keep
        self.counts[kernels.RETURNS] = 0
        self._most = STEPS_A_RETURN * max(wanted, 1)
        series = kernels.Series(
            self.series.addresses[1], self.series.order, self.series.stride, self.series.ways, self.series.forms,
            bernstein_table(self.series.order), self.extended_series,
        )  # fmt: skip
        returns = kernels.Returns(self.at_wrap, self.section, discard, longest, keep, *kept)
        motion = kernels.Motion(self.x, self.numbers, self.counts, self.side, self.on)
        tolerances = self.step_tolerances
        status = kernels.AGAIN
        while status != kernels.DONE:
            status = self._run(self.laws, series, tolerances, returns, _BUDGET, motion)
            if status == kernels.HELP and self.counts[kernels.RETURNS] < wanted:
                self._be_helped(discard, kept, longest)
            if (steps := int(self.counts[kernels.STEPS]) + self._helped) > self._most:
                raise StiffnessError(self.numbers[self.times.T], self.x[:-1], self.system.mode_names[self.mode], steps)
        found = max(int(self.counts[kernels.RETURNS]) - discard, 0)
        return kept[0][:found], kept[1][:found], kept[2][:found]

    def _be_helped(
        self, discard: int, kept: tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]], longest: float
    ) -> None:
        """Go on by Runge-Kutta steps to the next wrap or event, and past the crowd of others that follow it."""
        kernels, counts, numbers = self.kernels, self.counts, self.numbers
        left = max(self._most - int(counts[kernels.STEPS]) - self._helped, 1)
        x, limit = self.x[:-1].copy(), self._limit
        run = EventDrivenMotion(self.system, self.p, x, self.mode, *self.tolerances, most_steps=left, limit=limit)
        run.counts[[run.kernels.FIRED, run.kernels.MODE_BEFORE]] = counts[[kernels.FIRED, kernels.MODE_BEFORE]]
        run.side[:] = self.side
        run.numbers[[run.kernels.T, run.kernels.T_LOW]] = numbers[[self.times.T, self.times.T_LOW]]
        run.offset = 0.0
        wanted = discard + kept[2].size
        wait = math.inf
        while counts[kernels.RETURNS] < wanted:
            events = run.events_passed
            end = min(float(numbers[kernels.RETURNED]) + longest, run.time + wait)
            wrap = run.wraps + 1 if self.rate > 0.0 else None
            run.follow(max(end, math.nextafter(run.time, math.inf)), wrap, events + 1)
            self._keep_returns(run, discard, kept)
            if wait < math.inf and run.events_passed == events:
                break
            scale = self.system.turn / self.rate if self.rate > 0.0 else max(run.time, run.numbers[run.kernels.STEP])
            wait = kernels.CROWD * scale
        self._helped += run.tries
        self.x[:-1] = run.x
        numbers[[self.times.T, self.times.T_LOW]] = run.numbers[[run.kernels.T, run.kernels.T_LOW]]
        numbers[self.times.DURATION] = 0.0
        counts[[kernels.MODE, kernels.STARTING, kernels.SMALL_RUN]] = run.mode, 1, 0
        counts[[kernels.FIRED, kernels.MODE_BEFORE]] = run.counts[[run.kernels.FIRED, run.kernels.MODE_BEFORE]]
        self.side[:] = run.side

    def _keep_returns(
        self,
        run: EventDrivenMotion,
        discard: int,
        kept: tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64]],
    ) -> None:
        """Count the returns that the run has passed since last asked, and keep those that are wanted."""
        counts, numbers = self.counts, self.numbers
        times, which, ends, _ = run.events()
        run.kept_events.clear()
        run.kept_steps.clear()
        for time, (transition, mode, _), (before, after) in zip(times, which, ends, strict=True):
            if not (self.section[transition] if transition >= 0 else self.at_wrap):
                continue
            place = int(counts[self.kernels.RETURNS]) - discard
            counts[self.kernels.RETURNS] += 1
            numbers[self.kernels.RETURNED] = time
            if 0 <= place < kept[2].size:
                kept[0][place], kept[1][place] = after if transition < 0 else before, mode
                kept[2][place] = time
