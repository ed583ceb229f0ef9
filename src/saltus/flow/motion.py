"""A motion under way by Runge-Kutta steps: where it may start, how long it lasts, what ends it early."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.errors import ChatteringError, DivergenceError, InputError, SaltusError, StickingError, StiffnessError
from saltus.flow.shares import limit_of, shares_of, small_groups, with_shares
from saltus.flow.starting import phase_rate, told_root
from saltus.flow.sticking import sticking_surface
from saltus.flow.stiffness import fastest_in_words, may_be_implicit, worth
from saltus.flow.transition_rows import clocks, ends_of, opposites
from saltus.system.filippov import lines_of
from saltus.system.parts import ENDS, TWO_FOLD, at_phases

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.checks.states import StateLike
    from saltus.system.hybrid import HybridSystem

__all__ = ["EventDrivenMotion", "check_tolerances", "how_long", "start_state", "tolerances_of"]

_EVENTS_KEPT = 1024  # events between two clearances of their buffer
_BUDGET = 1 << 12  # steps of one call of the kernel
_MOST = np.iinfo(np.int64).max  # a count that is never reached
_WATCHED = 2048  # steps tried between two looks at whether a motion sticks
_HUGE = 1e250  # value beyond which an event function is not finite: sums of some of its values overflow
_CHOSEN = 500  # steps tried between two looks at whether stability limits them
_FAST = 1.0  # mean step, times the rate of the fastest decay, from which on stability limits explicit ones
_LOOKS = 3  # looks in a row at which a motion that sticks is held


class EventDrivenMotion:
    """A motion under way: the kernel's arrays, and what it has written so far.

    Parameters
    ----------
    system : HybridSystem
        The system.
    p : ndarray, shape (parameters,)
        `HybridSystem.parameter_vector`.
    x : ndarray, shape (all states,)
        Start; the run's own from here on.
    mode : int
        Index of the mode there.
    rtol, atol : float
        Tolerances of a step.
    steps_kept : int, optional
        Steps of dense output between two clearances of the buffer; none is kept for 0.
    most_steps : int, optional
        Steps that may be tried in all before a `StiffnessError`.
    room : int, optional
        Steps of dense output in all, at which the motion stops.
    whole : bool, optional
        Whether the absolute tolerance holds for every state, also for those that never cross zero.
    limit : float, optional
        Size of a state at which the motion diverges; by default that of `limit_of`.

    Notes
    -----
    A motion may start on the surface of an event. Before the first step, `side` then holds what is known of its side.
    For an event function of the phase alone it is the side from which the phase comes. A transition that changes
    nothing (a section, a counter) does not happen there. The side of other events is not known.

    Raises
    ------
    InputError
        The phase's rate is not positive.
    """

    def __init__(
        self,
        system: HybridSystem,
        p: NDArray[np.float64],
        x: NDArray[np.float64],
        mode: int,
        rtol: float,
        atol: float,
        *,
        steps_kept: int = 0,
        most_steps: int | None = None,
        room: int | None = None,
        whole: bool = False,
        limit: float | None = None,
    ) -> None:
        from saltus.flow.kernels import state as kernels
        from saltus.flow.kernels.event import run_kernel

        compiled, n = system.compiled, x.size
        self.kernels, self._run = kernels, run_kernel
        self.system, self.rtol, self.atol = system, float(rtol), float(atol)
        self.p = compiled.extended(np.ascontiguousarray(p, dtype=np.float64))
        self.limit = limit_of(compiled, self.p, x) if limit is None else limit
        self._full = compiled.whole.copy() if whole else shares_of(compiled, self.p)
        self._sizes = np.abs(x)
        self.shares = self._full.copy() if whole else small_groups(compiled, self._sizes, self._full)
        self.addresses = with_shares(compiled.motion, self.shares)
        self.x = x
        self.rate = 0.0
        self.offset = 0.0
        if system.phase is not None:
            self.rate = phase_rate(system, p, x, mode)
        self.transitions, count = ends_of(system), len(system.transitions)
        self.offset = max(float(x[-1]), 0.0) if self.rate > 0.0 else 0.0
        self.room, self._chosen, self._chosen_at = math.inf if room is None else room, 0, 0.0
        self._watched = self._looks = 0
        self.most_steps, self.budget, self._looked = most_steps, _CHOSEN, (0, -math.inf)
        # the time of an explicit step before implicit ones, and the steps behind which these are thought of again
        self._implicit, self._explicit, self._again = False, 0.0, 0.0
        self.implicit_steps, self.stiff = 0, False  # of the steps kept; whether stability held them when last looked at
        self.least_decay = 0.0  # rate of decay below which steps stay explicit, however many
        self.slopes, self.size, self._guess = np.zeros(16 * n), np.abs(x), np.zeros(14 * n)
        if system.phase is not None:
            self.size[-1] = system.turn
        self.numbers = np.zeros(kernels.N_NUMBERS)
        self.counts = np.zeros(kernels.N_COUNTS, np.int64)
        self.counts[kernels.MODE], self.counts[kernels.STARTING] = mode, 1
        self.counts[kernels.FIRED] = self.counts[kernels.MODE_BEFORE] = -1
        self.side, self.on = self._start_sides(mode), np.zeros(count, np.int64)
        self.n_touched, self.touched = np.zeros(count, np.int64), np.zeros((count, 2))
        self.value, self.first_steps = np.zeros(count), np.zeros(len(system.modes))
        m = steps_kept
        self.step_buffers = (np.empty((m, 2)), np.empty(m, np.int64), np.empty((m, n)), np.empty((m, 7, n)))
        m = _EVENTS_KEPT
        self.event_buffers = (np.empty(m), np.empty((m, 3), np.int64), np.empty((m, 2, n)), np.empty(m))
        self.kept_steps: list[tuple[NDArray[Any], ...]] = []
        self.kept_events: list[tuple[NDArray[Any], ...]] = []

    @cached_property
    def records(self) -> tuple[Any, ...]:
        """What the kernels are handed: system, tolerances, state, buffers of the steps and of the events."""
        kernels, system, n = self.kernels, self.system, self.x.size
        states = n - 1 if self.rate > 0.0 else n
        counts = n, states, len(system.modes), len(system.transitions)
        return (
            kernels.System(
                self.addresses, self.transitions, clocks(system), opposites(system), self.p, self.rate,
                system.turn, *counts,
            ),
            kernels.Tolerances(self.rtol, self.atol, self.limit, *self._ways),
            kernels.State(
                self.x, self.slopes, self.size, self.numbers, self.counts, self.side, self.on, self.value,
                self.first_steps, self._guess, self.n_touched, self.touched, np.zeros(n),
            ),
            kernels.Steps(len(self.step_buffers[0]), *self.step_buffers),
            kernels.Events(len(self.event_buffers[0]), *self.event_buffers),
        )  # fmt: skip

    @property
    def _ways(self) -> tuple[int, int, int]:
        """Addresses of implicit steps, of parts of them, and of those with a frame; 0 where steps are explicit."""
        if not self._implicit:
            return 0, 0, 0
        from saltus.flow.kernels import implicit_motion as kernels

        return kernels.attempt.address, kernels.within.address, kernels.carry.address

    def _start_sides(self, mode: int) -> NDArray[np.int64]:
        """Known side of each event, which counts if the motion starts on its surface.

        A start at phase 0 comes before the events of the phase alone that lie there to rounding, as the strobe does.
        """
        side = np.zeros(len(self.system.transitions), np.int64)
        source = self.system.mode_names[mode]
        for k, transition in enumerate(self.system.transitions):
            if transition.source != source:
                continue
            if transition.target == source and not transition.reset:
                side[k] = self.kernels.PASSES
            elif at_phases(self.system, transition):
                out, near = np.empty(2), self.kernels.AT_WRAP
                self.system.compiled.call("event", k, 0, self.x, self.p, out)
                side[k] = -np.sign(out[1])
                past = self.rate * out[0] / out[1] if out[1] else 0.0
                if abs(self.x[-1]) <= near and 0.0 < past <= near:
                    self.x[-1] -= past
        return side

    @property
    def time(self) -> float:
        """Time since the start."""
        return float(self.numbers[self.kernels.T] + self.numbers[self.kernels.T_LOW])

    @property
    def mode(self) -> int:
        """Index of the mode now."""
        return int(self.counts[self.kernels.MODE])

    @property
    def wraps(self) -> int:
        """Wraps of the phase passed so far."""
        return int(self.counts[self.kernels.WRAPS])

    def went_round(self, periods: int) -> bool:
        """Whether `periods` periods are over since the start."""
        at_phase = float(self.x[-1]) > self.offset - self.kernels.AT_WRAP
        return self.wraps > periods or (self.wraps == periods and at_phase)

    @property
    def events_passed(self) -> int:
        """Transitions passed so far."""
        return int(self.counts[self.kernels.EVENTS])

    def follow(self, t_end: float, periods: int | None, n_events: int | None, *, keep: bool = True) -> None:
        """Go on until the time, the number of periods or that of transitions; `periods` end at the phase of the start.

        `keep` False forgets the events.
        """
        most = _MOST
        self._follow(t_end, most if periods is None else periods, most if n_events is None else n_events, keep)
        if periods is not None and self.offset > 0.0 and self.wraps >= periods:
            self._follow(
                min(t_end, self.time + self.offset / self.rate), most, most if n_events is None else n_events, keep
            )

    def follow_for(self, tries: int, n_events: int, *, t_end: float = math.inf, keep: bool = True) -> None:
        """Go on until `tries` further steps, `n_events` further transitions, or a time, whichever comes first.

        `keep` False forgets the events.
        """
        self._follow(t_end, _MOST, self.events_passed + n_events, keep, self.tries + tries)

    @property
    def tries(self) -> int:
        """Steps tried so far."""
        return int(self.counts[self.kernels.TRIES])

    def watch(self) -> None:
        """Look at a motion that is still under way: whether it sticks, or has taken all the steps that it may.

        Raises
        ------
        ChatteringError, StickingError, StiffnessError
            It does.
        DivergenceError
            An event function is not finite.
        """
        if self.tries - self._watched < _WATCHED:
            self.budget = max(self.budget, _WATCHED)
        else:
            self._watched = self.tries
            surface, accumulates = self._sticks_on(), self._accumulates()
            self._looks = self._looks + 1 if surface is not None else 0
            self.budget = _WATCHED if surface is not None else _BUDGET
            if accumulates and surface is None:
                raise self.error(self.kernels.CHATTERING)
            if (infinite := self._infinite_event()) is not None:
                raise DivergenceError(self.time, self.x, self.system.mode_names[self.mode], infinite)
            if surface is not None and self._looks >= _LOOKS:
                raise self._sticking(surface)
        if self.tries - self._chosen >= _CHOSEN:
            self._choose_steps()
            self._chosen, self._chosen_at = self.tries, self.time
        if self.most_steps is not None and self.tries > self.most_steps and not self._looks:
            raise self.too_stiff()

    def _accumulates(self) -> bool:
        """Return whether events came as fast since the last look, on average, as when they chatter."""
        passed, elapsed = self.events_passed - self._looked[0], self.time - self._looked[1]
        self._looked = self.events_passed, self.time
        shortest = self.kernels.CHATTERING_DURATION * float(self.numbers[self.kernels.LONGEST])
        return bool(passed > self.kernels.CHATTERING_RUN and elapsed <= passed * shortest)

    def too_stiff(self) -> StiffnessError:
        """Return the error of a motion that takes too many steps, with the fastest rate at its state."""
        hint = fastest_in_words(self.system.compiled, self.mode, self.x, self.p, len(self.system.states))
        return StiffnessError(self.time, self.x, self.system.mode_names[self.mode], self.tries, hint, self.stiff)

    def _choose_steps(self) -> None:
        """Go on by implicit steps where stability limits explicit ones; go back where they are not worth their time."""
        if self.tries < self._again:
            return
        before, pace = self._implicit, (self.time - self._chosen_at) / (self.tries - self._chosen)
        if self._implicit:
            self._implicit = pace > worth(self.x.size) * self._explicit
            self._again = 0.0 if self._implicit else 2.0 * self.tries
        else:
            J = self.system.compiled.linearised(self.mode, self.x, self.p)[1]
            fast = False
            if not pace * float(np.abs(J).sum(axis=1).max()) <= _FAST:  # no eigenvalue is beyond that norm
                if not np.isfinite(J).all():
                    return
                decay = -float(np.linalg.eigvals(J).real.min(initial=0.0))
                fast = decay > self.least_decay and pace * decay > _FAST
            compiled, count = self.system.compiled, len(self.system.states)
            modes = range(len(self.system.modes))
            self._implicit = fast and all(may_be_implicit(compiled, mode, self.x, self.p, count) for mode in modes)
            self.stiff = fast and not self._implicit
            self._explicit = pace
            self._again = 0.0 if self._implicit else 1.5 * self.tries
        if self._implicit != before:
            self.budget = _CHOSEN  # they are soon held against the others
            compiled = self.system.compiled
            self.let_shares_grow(all_of_them=self._implicit)
            self.addresses = with_shares(compiled.addresses if self._implicit else compiled.motion, self.shares)
            self.__dict__.pop("records", None)

    def _sticking(self, surface: str) -> StickingError:
        """Return the error of a motion that a jump of its field holds."""
        lines = lines_of(self.system, self.mode, surface)
        return StickingError(self.time, self.x, self.system.mode_names[self.mode], surface, lines)

    def _sticks_on(self) -> str | None:
        """Expression at whose zero the field jumps and holds the motion; None where it is not held."""
        step = max(float(self.numbers[place]) for place in (self.kernels.STEP, self.kernels.STEP_BEFORE))
        return sticking_surface(self.system, self.mode, self.x, self.p, step)

    def _follow(self, t_end: float, wraps: int, n_events: int, keep: bool, last_try: float = math.inf) -> None:
        status = self.kernels.AGAIN
        while status == self.kernels.AGAIN and self.tries < last_try and self.room > 0:
            budget = int(min(self.budget, last_try - self.tries, self.room))
            goal = self.kernels.Goal(t_end, wraps, n_events, budget)
            laws, tolerances, *buffers = self.records
            status = self._run(laws, tolerances, goal, *buffers)
            if keep:
                m, k = (int(self.counts[place]) for place in (self.kernels.N_STEPS, self.kernels.N_EVENTS))
                self.room -= m
                self.implicit_steps += m if self._implicit else 0
                self.kept_steps.append(tuple(buffer[:m].copy() for buffer in self.step_buffers))
                self.kept_events.append(tuple(buffer[:k].copy() for buffer in self.event_buffers))
            if status == self.kernels.AGAIN:
                self.let_shares_grow()
                self.watch()
        if status not in (self.kernels.DONE, self.kernels.AGAIN):
            raise self.error(status)

    def let_shares_grow(self, *, all_of_them: bool = False) -> None:
        """Let small states that have grown have their share of the absolute tolerance, in place: kernels know where."""
        if self.system.compiled.grouped and (self.shares < 0.0).any():
            np.maximum(self._sizes, np.abs(self.x), out=self._sizes)
            groups = self._full if all_of_them else small_groups(self.system.compiled, self._sizes, self._full)
            self.shares[:] = np.where(self.shares < 0.0, groups, self.shares)

    def _infinite_event(self) -> str | None:
        """Which event function of the mode is not finite, or will be in a step, in words; None where all are."""
        source, out, ahead = self.system.mode_names[self.mode], np.empty(2), self.x + self._ahead()
        for k, transition in enumerate(self.system.transitions):
            if transition.source != source:
                continue
            for x in (self.x, ahead):
                self.system.compiled.call("event", k, 0, x, self.p, out)
                if not abs(out[0]) < _HUGE:
                    return f"the event function of {transition.name!r}, {transition.event}, is not finite"
        return None

    def _ahead(self) -> NDArray[np.float64]:
        """How far the motion goes in a step that could not be taken."""
        slope, step = self.slopes[: self.x.size], 2.0 * float(self.numbers[self.kernels.STEP])
        return np.multiply(step, slope, out=np.zeros(slope.size), where=slope != 0.0)  # at rest steps may be infinite

    def steps(self) -> tuple[NDArray[Any], ...]:
        """Times and lengths, modes, starts and dense coefficients of the steps."""
        return tuple(np.concatenate(parts) for parts in zip(*self.kept_steps, strict=True))

    def events(self) -> tuple[NDArray[Any], ...]:
        """Times, transitions with modes, states on both sides, and rates of the events."""
        nothing = tuple(buffer[:0] for buffer in self.event_buffers)
        return tuple(np.concatenate(parts) for parts in zip(nothing, *self.kept_events, strict=True))

    def error(self, status: int) -> SaltusError:
        """Return the error that a status of the kernel other than DONE stands for."""
        kernels, t, mode = self.kernels, self.time, self.system.mode_names[self.mode]
        if status == kernels.CHATTERING:
            last = self.system.transitions[self.counts[kernels.FIRED]]
            slides = any(known.surface == last.event for known in self.system.modes.values())
            two_fold = DivergenceError(t, self.x, mode, TWO_FOLD.format(last.event))
            return two_fold if slides else ChatteringError(t, self.x, mode, last.name)
        if status == kernels.STEP_UNDERFLOW and (surface := self._sticks_on()) is not None:
            return self._sticking(surface)
        if status == kernels.EVENT_NOT_FINITE:
            return DivergenceError(t, self.x, mode, self._infinite_event() or "an event function is not finite")
        step, left = self.numbers[kernels.STEP], self.system.modes[mode]
        if status == kernels.LEFT_DOMAIN and mode in ENDS:
            return DivergenceError(t, self.x, self.system.transitions[self.counts[kernels.FIRED]].source, ENDS[mode])
        if status == kernels.NEGATIVE_ROOT:
            return DivergenceError(t, self.x, mode, told_root(self.system, self.mode, self.x, self.p))
        left_it = f"it leaves the domain of the mode, {left.domain} > 0"
        reason = {
            kernels.UNBOUNDED: f"a state passes {self.limit:.3g}",
            kernels.STEP_UNDERFLOW: f"the step falls to {step:.3g}, as it does before a singularity",
            kernels.LEFT_DOMAIN: left_it if left.surface is None else TWO_FOLD.format(left.surface),
            kernels.FIELD_NOT_FINITE: "the vector field is not finite",
            kernels.RESET_NOT_FINITE: "a reset is not finite",
        }[status]
        return DivergenceError(t, self.x, mode, reason)


def start_state(system: HybridSystem, x0: StateLike, mode: str | None = None) -> NDArray[np.float64]:
    """Return a full state at which a motion may be started, its phase within the first period of the drive.

    A phase at the end of the period but for rounding becomes one just below 0, before the events at phase 0.
    """
    from saltus.flow.kernels.state import AT_WRAP

    x = system.full_state(x0, mode=mode)
    if system.phase is not None:
        x[-1] %= system.turn
        if x[-1] > system.turn - AT_WRAP:
            x[-1] -= system.turn
    return x


def check_tolerances(tolerance: tuple[float, float]) -> None:
    """Raise `InputError` where a relative or an absolute tolerance cannot be used."""
    checks.between("tolerance[0]", tolerance[0], 1e-14, 0.1)
    checks.positive("tolerance[1]", tolerance[1])


def tolerances_of(tolerance: object, name: str = "tolerance") -> tuple[float, float | None]:
    """Return the relative tolerance of a step and the absolute one, None where it is to fit the states.

    Parameters
    ----------
    tolerance : float or (float, float)
        The relative one, between 1e-14 and 0.1; or both.
    name : str, optional
        What a message calls them.

    Raises
    ------
    InputError
        It is neither, or out of range.

    Examples
    --------
    >>> tolerances_of(1e-8), tolerances_of((1e-8, 1e-20))
    ((1e-08, None), (1e-08, 1e-20))
    """
    if not isinstance(tolerance, tuple | list):
        return checks.between(name, tolerance, 1e-14, 0.1), None
    if len(tolerance) != 2:
        raise InputError(name, tolerance, "a number, or a relative and an absolute one")
    relative, absolute = tolerance
    return checks.between(f"{name}[0]", relative, 1e-14, 0.1), checks.positive(f"{name}[1]", absolute)


def how_long(system: HybridSystem, periods: int | None, t_end: float | None) -> tuple[float, int | None]:
    """Return the time and the number of periods after which a motion ends; exactly one of the two is given."""
    if (periods is None) == (t_end is None):
        given = {"t_end": t_end, "periods": periods}
        raise InputError("t_end, periods", given, "exactly one of the two given")
    if periods is not None and system.phase is None:
        raise InputError("periods", periods, "left out for a system without a phase", "give t_end")
    return math.inf if t_end is None else checks.positive("t_end", t_end), periods
