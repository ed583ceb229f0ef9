"""Returns of many motions to a section at once, each with parameters of its own."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from saltus.ensemble.labels import NOT_DONE, REFUSED, Returning, Returns, Section
from saltus.errors import SaltusError
from saltus.flow.motion import EventDrivenMotion, jumps_at_phase_zero, start_state
from saltus.flow.poincare import PoincareReturns
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
_LED = 0.11  # time in periods for which a motion is led off a surface that it starts on


@dataclass(frozen=True)
class Start:
    """Where a motion starts: its parameters, full state, and the index of its mode."""

    p: NDArray[np.float64]
    x: NDArray[np.float64]
    mode: int


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
    """

    system: HybridSystem
    section: tuple[int, ...] | None
    tolerance: tuple[float, float]
    interval: float | None = None
    absence: float = math.inf

    def __getstate__(self) -> dict[str, object]:
        """Return the fields: compiled steps are found anew where the motions are followed."""
        return {field.name: getattr(self, field.name) for field in fields(self)}

    @cached_property
    def _lanes(self) -> CompiledLanes | None:
        from saltus.ensemble.compiled import load_own_lanes

        return load_own_lanes(self.system, _ORDER)

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
        found: list[PoincareReturns | None] = [None] * len(starts)
        starts = [replace(start, x=start_state(self.system, start.x)) for start in starts]
        places = [i for i, start in enumerate(starts) if self._may_be_followed(start)]
        refused = self._followed([starts[i] for i in places], [0.0] * len(places), skip, keep, places, found)
        led = [(i, *ahead) for i in refused if (ahead := self._led(starts[i])) is not None]
        again, times = [ahead for _, ahead, _ in led], [time for *_, time in led]
        self._followed(again, times, skip, keep, [i for i, *_ in led], found)
        return found

    def _followed(
        self,
        starts: Sequence[Start],
        before: Sequence[float],
        skip: int,
        keep: int,
        places: Sequence[int],
        found: list[PoincareReturns | None],
    ) -> list[int]:
        """Write what lanes find of motions into their places of `found`; return the places of those refused.

        before: times that have gone before the starts.
        """
        from saltus.ensemble.kernels.returns import N_CLOCKS, follow_returns

        lanes = self._lanes
        if lanes is None or not starts:
            return []
        m, n = len(starts), len(self.system.states)
        rates = np.array([self._rate(start) for start in starts])
        numbers = np.array([self._own(start.p, rate) for start, rate in zip(starts, rates, strict=True)])
        points, modes = np.array([start.x[:n] for start in starts]), np.array([start.mode for start in starts])
        times = np.array([start.x[-1] for start in starts]) / rates if self.system.phase is not None else np.zeros(m)
        motions = Returning(np.ascontiguousarray(points), modes, times, numbers)
        returns = Returns(
            np.full(m, NOT_DONE, np.uint8), np.zeros(m, np.int64), np.zeros(m), np.empty((m, keep, n)),
            np.empty((m, keep)), np.empty((m, keep)), np.empty((m, keep), np.int64), np.empty((m, n)), np.empty(m),
            np.empty(m, np.int64),
        )  # fmt: skip
        scratch = lanes.scratch(m)
        laws = lanes.with_numbers(np.zeros(1), self._shared)
        follow_returns(laws, motions, self._section(skip, keep), returns, _ALIVE, scratch, np.empty((m, N_CLOCKS)))
        for j, place in enumerate(places):
            mean = returns.times[j, -1] / (skip + keep)
            if returns.labels[j] == 0 and not returns.gaps[j] > self.absence * mean:
                found[place] = self._result(returns, j, float(rates[j]), before[j])
        return [place for j, place in enumerate(places) if returns.labels[j] == REFUSED]

    def _result(self, returns: Returns, j: int, rate: float, before: float) -> PoincareReturns:
        states, x_end = returns.states[j], returns.ends[j]
        if self.system.phase is not None:
            states = np.column_stack([states, rate * returns.phases[j]])
            x_end = np.append(x_end, rate * returns.end_times[j])
        times = before + returns.times[j]
        return PoincareReturns(
            frozen(states), frozen(returns.modes[j], np.int64), frozen(times), frozen(x_end), int(returns.end_modes[j])
        )

    def _may_be_followed(self, start: Start) -> bool:
        """Whether no event of the phase lies at phase 0, where lanes cannot tell its side, and the phase goes on."""
        return 0.0 < self._rate(start) < math.inf and not jumps_at_phase_zero(self.system, start.p)

    def _rate(self, start: Start) -> float:
        if self.system.phase is None:
            return 1.0
        return float(self.system.compiled.field(start.mode, start.x, start.p)[-1])

    def _led(self, start: Start) -> tuple[Start, float] | None:
        """Lead a motion off the surface that it starts on: where it is then, and the time; None where it cannot be."""
        time = _LED * self._period(self._rate(start))
        run = EventDrivenMotion(self.system, start.p, start.x.copy(), start.mode, *self.tolerance)
        try:
            run.follow(time, None, None, keep=False)
        except SaltusError:
            return None
        x = np.array(run.x)
        if self.system.phase is not None:
            x[-1] %= 2.0 * math.pi
        return Start(start.p, x, run.mode), run.time

    def _period(self, rate: float) -> float:
        return 2.0 * math.pi / rate if self.interval is None else self.interval

    def _own(self, p: NDArray[np.float64], rate: float) -> list[float]:
        """Return what a lane has of its own."""
        lanes = self._lanes
        assert lanes is not None
        extended, period = lanes.constants(p), self._period(rate)
        values = {"rate": rate, "period": period, "longest": _LONGEST_STEP * period}
        return [values[name] if name in values else float(extended[_place(name)]) for name in lanes.own]

    @cached_property
    def _shared(self) -> NDArray[np.float64]:
        """Numbers that all lanes share."""
        assert self._lanes is not None
        rtol, atol = self.tolerance
        values = {"limit": _BOUND, "floor": atol / rtol}
        values |= {f"least{k}": _LEAST_TERM for k in range(_ORDER - 2, _ORDER + 1)}
        values |= {f"escale{k}": 1.0 for k in range(len(self.system.transitions))}
        return np.array([values[name] for name in self._lanes.quantities])

    def _section(self, skip: int, keep: int) -> Section:
        lanes = self._lanes
        assert lanes is not None
        transitions = np.zeros(len(self.system.transitions), np.int64)
        transitions[list(self.section or ())] = 1
        first = lanes.module.NF - len(lanes.own)
        return Section(
            transitions, self.section is None, first, lanes.own.index("period"), first - 1, 1.0 / self.tolerance[0],
            skip, keep, _PATIENCE,
        )  # fmt: skip


def _place(name: str) -> int:
    found = re.fullmatch(r"p\[(\d+)\]", name)
    assert found is not None
    return int(found[1])
