"""Returns of many motions to a section at once, each with parameters of its own."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.ensemble.labels import NOT_DONE, REFUSED, Returning, Returns, Section
from saltus.errors import SaltusError
from saltus.flow.motion import EventDrivenMotion, start_state
from saltus.flow.poincare import PoincareReturns
from saltus.flow.transition_rows import jumps_at_phase_zero
from saltus.flow.variational import ROWS, Growth
from saltus.result import frozen

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.ensemble.compiled import CompiledLanes
    from saltus.system.hybrid import HybridSystem

__all__ = ["ManyReturns", "Start"]

_ORDER = 14  # last coefficient of the Taylor series
_ALIVE = 256  # motions under way at once, at most
_LONGEST_STEP = 0.125  # longest step, in periods
_LEAST_TERM = 1e-30  # least size of a step's last terms, in tolerances, that lets a step be as long as it may
_BOUND = 1e12  # size of a state beyond which the event-driven flow has to say what becomes of the motion
_PATIENCE = 50  # looks without a return after which a motion is left to others
_STEPS_KEPT = 256  # steps of a motion that are kept in memory at once
_LED = 0.11  # time in periods for which a motion is led off a surface that it starts on


@dataclass(frozen=True)
class Start:
    """Where a motion starts: its parameters, full state, and the index of its mode.

    interval: time between two looks at it, without a phase. before: time that it has gone already.
    """

    p: NDArray[np.float64]
    x: NDArray[np.float64]
    mode: int
    interval: float | None = None
    before: float = 0.0


class _Run(NamedTuple):
    """Returns of a motion: full states, modes, times, the longest gap, growth before each; where it is at the end."""

    states: NDArray[np.float64]
    modes: NDArray[np.int64]
    times: NDArray[np.float64]
    gap: float
    logs: NDArray[np.float64]
    x_end: NDArray[np.float64]
    mode_end: int


@dataclass(frozen=True)
class ManyReturns:
    """Returns of many motions of a system to a section, by lanes, each with parameters of its own.

    Attributes
    ----------
    system : HybridSystem
        The system, without angles.
    section : tuple of int or None
        Transitions that are returns; None for the wraps of the phase.
    tolerance : (float, float)
        Relative and absolute tolerance of a step.
    interval : float, optional
        About the time between two returns, for a system without a phase.
    absence : float, optional
        Longest time between two returns, in mean ones, beyond which lanes leave a motion to others.
    exponents : int, optional
        Perturbations whose growth is measured.
    limit : float, optional
        Size of a state beyond which lanes leave a motion to others, which tell whether it has diverged.
    """

    system: HybridSystem
    section: tuple[int, ...] | None
    tolerance: tuple[float, float]
    interval: float | None = None
    absence: float = math.inf
    exponents: int = 1
    limit: float | None = None

    def __getstate__(self) -> dict[str, object]:
        """Return the fields: compiled steps are found anew where the motions are followed."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @cached_property
    def _lanes(self) -> CompiledLanes | None:
        from saltus.ensemble.compiled import load_own_lanes

        return load_own_lanes(self.system, _ORDER)

    @cached_property
    def _growing(self) -> CompiledLanes | None:
        from saltus.ensemble.compiled import load_own_lanes

        return load_own_lanes(self.system, _ORDER, self.exponents)

    def load(self) -> bool:
        """Compile the steps; return whether the system has any."""
        return self._lanes is not None

    def follow(self, starts: Sequence[Start], skip: int, keep: int) -> list[PoincareReturns | None]:
        """Return the returns of each motion, as `saltus.flow.poincare.iterate` does; None where lanes cannot tell them.

        Parameters
        ----------
        starts : sequence of Start
            The motions.
        skip, keep : int
            Returns that are dropped, at the least, then kept.
        """
        if self._lanes is None:
            return [None] * len(starts)
        section = self._section(self._lanes, self.section, skip, keep)
        found: list[PoincareReturns | None] = []
        for run in self._runs(self._lanes, starts, None, section):
            if run is not None and run.gap > self.absence * run.times[-1] / (skip + keep):
                run = None
            found.append(None if run is None else self._returns(run))
        return found

    def load_growth(self) -> None:
        """Compile the steps of motions with perturbations."""
        _ = self._growing

    def growth(self, starts: Sequence[Start], skip: int, keep: int) -> list[Growth | None]:
        """Return the growth of perturbations of each motion, as `saltus.flow.variational.growth_along` does.

        It is None where lanes cannot tell it. Perturbations are made orthonormal at each look at a motion.

        Parameters
        ----------
        starts : sequence of Start
            The motions.
        skip, keep : int
            Looks that are dropped, at the least, then those between which growth is measured.
        """
        if self._growing is None:
            return [None] * len(starts)
        section = self._section(self._growing, None, max(skip, 1) - 1, keep + 1)
        n = len(self.system.states)
        # any frame that no direction of the system is likely to be orthogonal to
        frame = np.linalg.qr(np.random.default_rng(0).standard_normal((n, self.exponents)))[0]
        return [None if run is None else self._grown(run) for run in self._runs(self._growing, starts, frame, section)]

    def _returns(self, run: _Run) -> PoincareReturns:
        modes, times = frozen(run.modes, np.int64), frozen(run.times)
        return PoincareReturns(frozen(run.states), modes, times, frozen(run.x_end), run.mode_end)

    def _grown(self, run: _Run) -> Growth:
        """Return the growth over rows of looks, of which the first one only begins the first row."""
        n, looks = len(self.system.states), len(run.times) - 1
        edges = np.round(np.linspace(0, looks, min(ROWS, looks) + 1)).astype(np.int64)
        logs = np.add.reduceat(run.logs[1:], edges[:-1], axis=0)
        logs = logs[:, np.argsort(-logs.sum(axis=0), kind="stable")]
        times = run.times - run.times[0]
        x_end = np.append(run.x_end[:n], run.x_end[n * (1 + self.exponents) :])
        return Growth(frozen(times[edges[1:]]), frozen(logs), frozen(x_end), run.mode_end, 0, float(run.times[0]))

    def _runs(
        self, lanes: CompiledLanes, starts: Sequence[Start], frame: NDArray[np.float64] | None, section: Section
    ) -> list[_Run | None]:
        """Return what has become of each motion; those that lanes cannot begin are led off their surface first."""
        found: list[_Run | None] = [None] * len(starts)
        starts = [replace(start, x=start_state(self.system, start.x)) for start in starts]
        places = [i for i, start in enumerate(starts) if self._may_be_followed(start)]
        refused = self._followed(lanes, starts, frame, section, places, found)
        again = []
        for i in refused:
            if (led := self._led(starts[i])) is not None:
                starts[i] = led
                again.append(i)
        self._followed(lanes, starts, frame, section, again, found)
        return found

    def _followed(
        self,
        lanes: CompiledLanes,
        starts: Sequence[Start],
        frame: NDArray[np.float64] | None,
        section: Section,
        places: Sequence[int],
        found: list[_Run | None],
    ) -> list[int]:
        """Follow the motions at some places by lanes, into the same places of `found`; return those refused."""
        from saltus.ensemble.kernels.returns import N_CLOCKS, follow_returns

        if not places:
            return []
        those = [starts[i] for i in places]
        m, n, keep = len(those), len(self.system.states), section.keep
        columns = 0 if frame is None else frame.shape[1]
        rates = np.array([self._rate(start) for start in those])
        points = np.empty((m, n * (1 + columns)))
        points[:, :n] = [start.x[:n] for start in those]
        weights = np.ones((m, n)) if frame is None else np.array([self._weights(start) for start in those])
        points[:, n:] = 0.0 if frame is None else (frame.T / weights[:, None, :]).reshape(m, -1)
        times = np.array([start.x[-1] for start in those]) / rates if self.system.phase is not None else np.zeros(m)
        numbers = np.array([self._own(lanes, start, rate) for start, rate in zip(those, rates, strict=True)])
        motions = Returning(points, np.array([start.mode for start in those]), times, numbers, weights)
        returns = Returns(
            np.full(m, NOT_DONE, np.uint8), np.zeros(m, np.int64), np.zeros(m), np.empty((m, keep, points.shape[1])),
            np.empty((m, keep)), np.empty((m, keep)), np.empty((m, keep), np.int64), np.empty_like(points), np.empty(m),
            np.empty(m, np.int64), np.zeros((m, keep, columns)),
        )  # fmt: skip
        laws = lanes.with_numbers(np.zeros(1), self._shared(lanes))
        follow_returns(laws, motions, section, returns, _ALIVE, lanes.scratch(m), np.empty((m, N_CLOCKS)))
        for j, place in enumerate(places):
            if returns.labels[j] == 0:
                found[place] = self._run(returns, j, float(rates[j]), those[j].before)
        return [place for j, place in enumerate(places) if returns.labels[j] == REFUSED]

    def _run(self, returns: Returns, j: int, rate: float, before: float) -> _Run:
        states, x_end = returns.states[j], returns.ends[j]
        if self.system.phase is not None:
            states = np.column_stack([states, rate * returns.phases[j]])
            x_end = np.append(x_end, rate * returns.end_times[j])
        times, gap = before + returns.times[j], float(returns.gaps[j])
        return _Run(states, returns.modes[j], times, gap, returns.logs[j], x_end, int(returns.end_modes[j]))

    def _may_be_followed(self, start: Start) -> bool:
        """Whether no event of the phase lies at phase 0, where lanes cannot tell its side, and the phase goes on."""
        return 0.0 < self._rate(start) < math.inf and not jumps_at_phase_zero(self.system, start.p)

    def _rate(self, start: Start) -> float:
        if self.system.phase is None:
            return 1.0
        return float(self.system.compiled.field(start.mode, start.x, start.p)[-1])

    def _led(self, start: Start) -> Start | None:
        """Return where a motion is that has been led off the surface it starts on; None where it cannot be."""
        time = _LED * self._period(start, self._rate(start))
        run = EventDrivenMotion(self.system, start.p, start.x.copy(), start.mode, *self.tolerance)
        try:
            run.follow(time, None, None, keep=False)
        except SaltusError:
            return None
        x = np.array(run.x)
        if self.system.phase is not None:
            x[-1] %= self.system.turn
        return replace(start, x=x, mode=run.mode, before=run.time)

    def _period(self, start: Start, rate: float) -> float:
        if self.system.phase is not None:
            return self.system.turn / rate
        interval = self.interval if start.interval is None else start.interval
        assert interval is not None
        return interval

    def _weights(self, start: Start) -> NDArray[np.float64]:
        """Return the inverse units of the perturbations of a motion: the sizes of its states between two looks."""
        from saltus.flow.kernels.shares import weigh

        n, (rtol, atol) = len(self.system.states), self.tolerance
        run = EventDrivenMotion(
            self.system, start.p, start.x.copy(), start.mode, rtol, atol, steps_kept=_STEPS_KEPT, limit=self.limit
        )
        weights = np.ones(n)
        try:
            run.follow(self._period(start, self._rate(start)), None, None)
        except SaltusError:  # the lanes leave it to others, which raise it
            return weights
        weigh(np.abs(run.steps()[2][:, :n]).max(axis=0), weights)
        return weights

    def _own(self, lanes: CompiledLanes, start: Start, rate: float) -> list[float]:
        """Return what a lane has of its own."""
        extended, period = lanes.constants(start.p), self._period(start, rate)
        values = {"rate": rate, "period": period, "longest": _LONGEST_STEP * period}
        return [values[name] if name in values else float(extended[_place(name)]) for name in lanes.own]

    def _shared(self, lanes: CompiledLanes) -> NDArray[np.float64]:
        """Numbers that all lanes share."""
        rtol, atol = self.tolerance
        values = {"limit": _BOUND if self.limit is None else min(_BOUND, self.limit), "floor": atol / rtol}
        values |= {f"least{k}": _LEAST_TERM for k in range(_ORDER - 2, _ORDER + 1)}
        values |= {f"escale{k}": 1.0 for k in range(len(self.system.transitions))}
        return np.array([values[name] for name in lanes.quantities])

    def _section(self, lanes: CompiledLanes, section: tuple[int, ...] | None, skip: int, keep: int) -> Section:
        transitions = np.zeros(len(self.system.transitions), np.int64)
        transitions[list(section or ())] = 1
        first = lanes.module.NF - len(lanes.own)
        return Section(
            transitions, section is None, first, lanes.own.index("period"), first - 1, 1.0 / self.tolerance[0],
            skip, keep, _PATIENCE,
        )  # fmt: skip


def _place(name: str) -> int:
    found = re.fullmatch(r"p\[(\d+)\]", name)
    assert found is not None
    return int(found[1])
