"""Event-driven simulation: follow a hybrid system from a state, through every transition, to a time or phase.

Rules
-----
* A transition happens where its event function changes sign in its direction and its condition `when` is positive.
* Where several happen at the same time, the first in the definition comes first; another follows at once if, after the
  reset, the mode is still its source and its event function still passes zero there.
* A motion that starts on an event surface leaves it to one side. If that is the side of the event's direction, the
  event happens at once; an event of direction 0 does not. A transition that changes nothing (a counter on a section)
  does not happen at a start, whatever its direction, nor a second time where it has just happened, tangentially or not.
* A start at phase 0 comes before the events there of functions of the phase alone: these happen at once, of whatever
  direction.
* Chattering is told where more than 50 events in a row each follow after less than 1e-10 of the time scale (the period
  of the phase, or else the longest time between events so far) and these times shrink, where time stands still for
  50 events, or where the motion hops from an event to the same one below rounding four times in a row.
* A transition that lands beyond an event of its target mode is told by a `RuntimeWarning` and by
  `Trajectory.landings_beyond`; the motion goes on in that mode.
* A field that jumps, as by ``sign(v)`` at v = 0, may be passed but must not hold the motion: that ends it with the
  place where it is held.
* The phase runs on [0, 2 pi); its wrap is landed on exactly and recorded as an event of kind ``"phase"``.
* The strobe looks before the jump: a wrap comes before the events at phase 0, and before those up to 1e-9 earlier (as
  an angle), which rounding may put on either side. A motion of whole periods ends before the events at phase 0.
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from saltus import checks
from saltus.contents import Contents
from saltus.errors import InputError
from saltus.flow.landings import Landing, landings_beyond, warn_of
from saltus.flow.motion import EventDrivenMotion, check_tolerances, how_long, start_state, starting_mode
from saltus.flow.observables import Motion, dense_states, observe
from saltus.flow.sizes import ATOL, RTOL, followed_in_size
from saltus.results import Result, frozen
from saltus.system.evaluate import evaluate
from saltus.system.hybrid import HybridSystem
from saltus.system.plain import held_parameters, held_system

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from saltus.flow.amplitude_spectrum import Window

__all__ = ["GRAZING_SPEED", "EventLog", "Trajectory", "event_log", "events_after", "settle", "simulate"]

GRAZING_SPEED = 1e-6
"""An event at which the event function changes more slowly than this, in its units per time, is marked as grazing."""

_STEPS_KEPT = 1024
_MEMORY = 1 << 29  # bytes of dense output at the most
_COEFFICIENTS = 7  # of the dense output in a step


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Result):
    """A motion of a hybrid system, known at every time from 0 to `t_end`.

    Call it with times; at an event it has the state after. `simulate` makes it.

    Parameters
    ----------
    system : HybridSystem
        What moves.
    parameters : mapping of str to float
        All its parameters.
    t_end : float
        Last time.
    x_end : ndarray, shape (all states,)
        Full state then, after any event at that time.
    mode_end : str
        Mode then.
    events : structured ndarray, shape (event,)
        Fields `time`, `kind` ("event", or "phase" for a wrap of the phase), `name` (of the transition or the phase),
        `mode_before`, `mode_after`, `before` and `after` (full states), `normal_velocity` (rate of the event function
        along the motion before) and `grazing` (its size is below `GRAZING_SPEED`).
    stopped : str
        Why it ended, in words.
    step_times, step_lengths : ndarray, shape (step,)
        Start and length of each step.
    step_modes : ndarray of int, shape (step,)
        Index of the mode of each step.
    step_starts : ndarray, shape (step, all states)
        State at the start of each step.
    step_dense : ndarray, shape (step, 7, all states)
        Coefficients of the dense output, of order 7.
    rtol, atol : float
        Tolerances it was computed with.
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    t_end: float
    x_end: NDArray[np.float64]
    mode_end: str
    events: NDArray[np.void]
    stopped: str
    step_times: NDArray[np.float64] = field(repr=False)
    step_lengths: NDArray[np.float64] = field(repr=False)
    step_modes: NDArray[np.int64] = field(repr=False)
    step_starts: NDArray[np.float64] = field(repr=False)
    step_dense: NDArray[np.float64] = field(repr=False)
    rtol: float = 1e-10
    atol: float = 1e-12

    def __call__(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return the full state at times `t`, shape (all states,) for a number, (time, all states) for an array.

        Raises
        ------
        InputError
            A time before 0 or after `t_end`.
        """
        times = self._times(t)
        flat = np.atleast_1d(times)
        at = self._steps_at(flat)
        fractions = np.clip((flat - self.step_times[at]) / self.step_lengths[at], 0.0, 1.0)
        states = self._states(at, fractions)
        states[flat >= self.t_end] = self.x_end
        return states if times.ndim else states[0]

    def mode_at(self, t: ArrayLike) -> Any:
        """Return the name of the mode at times `t`, right-continuous; an array of names for an array."""
        times = self._times(t)
        names = np.array(self.system.mode_names)[self._modes_at(np.atleast_1d(times))]
        return names if times.ndim else str(names[0])

    def output(self, expression: str, t: ArrayLike) -> Any:
        """Return an output, or any expression, at times `t`, a number or shape (time,).

        Parameters
        ----------
        expression : str
            In the states, the phase, the parameters and the outputs, as `saltus.system.evaluate.evaluate` reads it.
        t : array_like
            Times; at an event the value is that after it.

        Raises
        ------
        InputError
            The text is no expression or uses a name that is not there, or a time is out of range.
        """
        times = self._times(t)
        flat = np.atleast_1d(times)
        values = evaluate(self.system, expression, self(flat), self._modes_at(flat), self.parameters)
        return values if times.ndim else float(values[0])

    @cached_property
    def landings_beyond(self) -> tuple[Landing, ...]:
        """Transitions that led beyond an event of their target mode, in order of time.

        Such a motion goes on in the mode as if the event were still to come: the definition lacks a transition, or a
        reset goes too far.
        """
        log = self.events[self.events["kind"] == "event"]
        sizes = np.abs(self.step_starts).max(axis=0, initial=0.0)
        return landings_beyond(self.system, self.parameters, log, sizes)

    def motion(self, t_start: float | None = None, t_end: float | None = None) -> Motion:
        """Return a stretch of the trajectory as `saltus.flow.observables` takes it; by default all of it.

        Raises
        ------
        InputError
            A time out of range, or no time between the two.
        """
        begin, end = self._stretch(t_start, t_end)
        first = int(self._steps_at(np.array([begin]))[0])
        last = max(int(np.searchsorted(self.step_times, end, side="left")) - 1, first)
        steps = slice(first, last + 1)
        starts, lengths = self.step_times[steps], self.step_lengths[steps]
        spans = np.tile([0.0, 1.0], (starts.size, 1))
        spans[0, 0] = (begin - starts[0]) / lengths[0]
        spans[-1, 1] = min((end - starts[-1]) / lengths[-1], 1.0)
        names, events = self.system.transition_names, self.events
        inside = events[(events["kind"] == "event") & (events["time"] > begin) & (events["time"] <= end)]
        crossings = [
            (time, names.index(name), rate) for time, name, rate in inside[["time", "name", "normal_velocity"]].tolist()
        ]
        turn = 2.0 * math.pi / (end - begin)
        angle = (-turn * begin, turn)
        if self.system.phase is not None:
            p = self.system.parameter_vector(self.parameters)
            rate = self.system.compiled.field(int(self.step_modes[0]), self.step_starts[0].copy(), p)[-1]
            angle = (float(self.step_starts[0, -1]), float(rate))
        return Motion(
            system=self.system,
            parameters=self.parameters,
            modes=self.step_modes[steps],
            clocks=np.column_stack([starts, lengths, np.zeros((starts.size, 2))]),
            spans=spans,
            states=lambda at, fractions: self._states(at + first, fractions),
            crossings=crossings,
            angle=angle,
        )

    def observe(self, *names: str, t_start: float | None = None, t_end: float | None = None) -> dict[str, float]:
        """Return observables of a stretch, by default of the whole trajectory, by name.

        Parameters
        ----------
        *names : str
            As in ``"max(force)"`` or ``"amplitude(z, 1)"``; `saltus.flow.observables` lists them. A harmonic is taken
            over the last whole periods of the phase within the stretch.
        t_start, t_end : float, optional
            The stretch.

        Raises
        ------
        InputError
            A name that is no observable, a time out of range, or a harmonic of less than its period.
        """
        return observe(self.motion(t_start, t_end), names)

    def spectrum(
        self,
        expression: str,
        *,
        t_start: float | None = None,
        t_end: float | None = None,
        samples: int | None = None,
        window: Window | None = None,
    ) -> xr.DataArray:
        """Return the one-sided amplitude spectrum of an output, or of any expression.

        Parameters
        ----------
        expression : str
            As `output` takes it.
        t_start, t_end : float, optional
            The stretch; by default the last whole periods of the phase, or everything where there is no phase or
            not a whole period of it.
        samples : int, optional
            Count of equidistant times, 2 or more; by default 256 a period of the phase, or 8 a step without a phase.
        window : {"none", "hann"}, optional
            What the samples are multiplied by. By default none where the stretch is a whole number of periods, else
            Hann's, by which a line is spread over three frequencies, and what is far from it loses its leakage.

        Returns
        -------
        xarray.DataArray
            Amplitudes: of a line, that of its sine; the mean at frequency 0. Against ``order``, the frequency over the
            rate of the phase, with ``frequency``, the angular frequency, beside it; without a phase against
            ``frequency``. Attributes tell the stretch, the window and the count of samples.
            ``motion.spectrum("z").plot(yscale="log")`` draws it.

        Raises
        ------
        InputError
            The text is no expression, or a time or an option cannot be used.
        """
        from saltus.flow.amplitude_spectrum import spectrum

        return spectrum(self, expression, t_start=t_start, t_end=t_end, samples=samples, window=window)

    def __repr__(self) -> str:
        kinds = self.events["kind"]
        names, counts = np.unique(self.events["name"][kinds == "event"], return_counts=True)
        told = ", ".join(f"{count} {name}" for name, count in zip(names, counts, strict=True)) or "no event"
        told += f" ({grazing} grazing)" if (grazing := int(self.events["grazing"].sum())) else ""
        wraps = int(np.sum(kinds == "phase"))
        told += f", {wraps} periods of {self.system.phase[0]}" if self.system.phase is not None else ""
        title = repr(self.system.name) if self.system.name else "a system"
        beyond = "".join(f"\n  {landing}" for landing in self.landings_beyond[:1])
        beyond += f", and {more} more like it" if (more := len(self.landings_beyond) - 1) > 0 else ""
        end = ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.system.all_states, self.x_end, strict=True))
        return (
            f"Trajectory of {title} over 0 <= t <= {self.t_end:.10g}: {self.step_times.size} steps, {told}\n"
            f"  ends in mode {self.mode_end!r} at {end}\n"
            f"  {self.stopped}{beyond}"
        )

    def to_xarray(self) -> xr.Dataset:
        """Return everything as a Dataset with dimensions event, step, coefficient and state."""
        import xarray as xr

        modes = self.system.mode_names
        log = self.events
        variables: dict[str, Any] = {
            "x_end": ("state", np.array(self.x_end)),
            "event_time": ("event", np.array(log["time"])),
            "event_transition": (
                "event",
                np.array([_code(self.system, e["kind"], e["name"]) for e in log], dtype=np.int64),
                _flags((-1, *range(len(self.system.transitions))), ("phase_wrap", *self.system.transition_names)),
            ),
            "event_mode_before": ("event", _indices(modes, log["mode_before"]), _flags(range(len(modes)), modes)),
            "event_mode_after": ("event", _indices(modes, log["mode_after"]), _flags(range(len(modes)), modes)),
            "event_before": (("event", "state"), np.array(log["before"])),
            "event_after": (("event", "state"), np.array(log["after"])),
            "event_normal_velocity": ("event", np.array(log["normal_velocity"])),
            "event_grazing": ("event", np.array(log["grazing"])),
            "step_time": ("step", np.array(self.step_times)),
            "step_length": ("step", np.array(self.step_lengths)),
            "step_mode": ("step", np.array(self.step_modes), _flags(range(len(modes)), modes)),
            "step_start": (("step", "state"), np.array(self.step_starts)),
            "step_dense": (("step", "coefficient", "state"), np.array(self.step_dense)),
        }
        attrs = {
            "definition": json.dumps(self.system.definition()),
            "parameters": json.dumps(dict(self.parameters)),
            "t_end": self.t_end,
            "mode_end": self.mode_end,
            "stopped": self.stopped,
            "rtol": self.rtol,
            "atol": self.atol,
        }
        return xr.Dataset(variables, coords={"state": list(self.system.all_states)}, attrs=attrs)

    @classmethod
    def from_xarray(cls, dataset: xr.Dataset) -> Self:
        """Return the trajectory that `to_xarray` described; raise `InputError` where it cannot be one."""
        held = Contents(dataset)
        system = held_system(held)
        held.expect(state=len(system.all_states), coefficient=_COEFFICIENTS)
        held.names("state", system.all_states)
        t_end = held.number("t_end", least=0.0)
        held.size("step", least=1 if t_end else 0)
        event, step, last = ("event",), ("step",), len(system.modes) - 1
        first = 0 if system.phase is None else -1
        which = [held.array("event_transition", event, int, least=first, most=len(system.transitions) - 1)]
        which += [held.array(f"event_mode_{side}", event, int, least=0, most=last) for side in ("before", "after")]
        ends = [held.array(f"event_{side}", ("event", "state")) for side in ("before", "after")]
        times = held.array("event_time", event, least=0.0)
        rates = held.array("event_normal_velocity", event, finite=False)
        begun = held.array("step_time", step, least=0.0)
        if (np.diff(times) < 0.0).any() or (np.diff(begun) < 0.0).any():
            raise InputError("event_time, step_time", "not in order", "times that ascend")
        lengths = held.array("step_length", step, least=0.0)
        if np.any(np.diff(np.append(begun, t_end)) > lengths * (1.0 + 1e-9) + 1e-12 * t_end):
            raise InputError("step_length", "gaps between steps", "lengths of steps that cover the time")
        return cls(
            system=system,
            parameters=held_parameters(held, system),
            t_end=t_end,
            x_end=frozen(held.array("x_end", ("state",))),
            mode_end=system.mode_names[system.mode_index(held.text("mode_end"))],
            events=_event_table(system, times, np.stack(which, axis=1), np.stack(ends, axis=1), rates),
            stopped=held.text("stopped"),
            step_times=frozen(begun),
            step_lengths=frozen(lengths),
            step_modes=frozen(held.array("step_mode", step, int, least=0, most=last), np.int64),
            step_starts=frozen(held.array("step_start", ("step", "state"))),
            step_dense=frozen(held.array("step_dense", ("step", "coefficient", "state"))),
            rtol=held.number("rtol", least=0.0),
            atol=held.number("atol", least=0.0),
        )

    def _times(self, t: ArrayLike) -> NDArray[np.float64]:
        times = checks.array("t", t, "a number or a list of numbers", finite=False)
        if times.ndim > 1:
            raise InputError("t", f"an array of shape {times.shape}", "a number or a list of numbers")
        outside = ~((times >= 0.0) & (times <= self.t_end))
        if np.any(outside):
            raise InputError("t", float(times[outside][0]), f"between 0 and t_end = {self.t_end:.12g}")
        return times

    def _stretch(self, t_start: float | None, t_end: float | None) -> tuple[float, float]:
        allowed = f"between 0 and {self.t_end:.12g}, where the trajectory ends"
        begin = 0.0 if t_start is None else checks.number("t_start", t_start, allowed)
        end = self.t_end if t_end is None else checks.number("t_end", t_end, allowed)
        for name, time in (("t_start", begin), ("t_end", end)):
            if not 0.0 <= time <= self.t_end:
                raise InputError(name, time, allowed)
        if begin >= end:
            raise InputError("t_start", begin, f"less than t_end = {end:.12g}")
        return begin, end

    def _steps_at(self, times: NDArray[np.float64]) -> NDArray[np.intp]:
        return np.maximum(np.searchsorted(self.step_times, times, side="right") - 1, 0)

    def _modes_at(self, times: NDArray[np.float64]) -> NDArray[np.int64]:
        at_end = self.system.mode_names.index(self.mode_end)
        return np.where(times >= self.t_end, at_end, self.step_modes[self._steps_at(times)])

    def _states(self, at: NDArray[np.intp], fractions: NDArray[np.float64]) -> NDArray[np.float64]:
        return dense_states(self.step_starts[at], self.step_dense[at], fractions)


@dataclass(frozen=True)
class EventLog:
    """Events of a motion, wraps of the phase among them, and where it ends; made by `events_after`.

    Parameters
    ----------
    time : ndarray, shape (event,)
        Times since the start.
    transition : ndarray of int, shape (event,)
        Index of the transition, -1 for a wrap of the phase.
    x_before, x_after : ndarray, shape (event, all states)
        Full states on both sides of the event.
    mode_before, mode_after : ndarray of int, shape (event,)
        Indices of the modes on both sides.
    normal_velocity : ndarray, shape (event,)
        Rate of the event function along the motion before; of the phase for a wrap.
    t_end : float
        Time at the end.
    x_end : ndarray, shape (all states,)
        Full state at the end.
    mode_end : int
        Index of the mode at the end.
    """

    time: NDArray[np.float64]
    transition: NDArray[np.int64]
    x_before: NDArray[np.float64]
    x_after: NDArray[np.float64]
    mode_before: NDArray[np.int64]
    mode_after: NDArray[np.int64]
    normal_velocity: NDArray[np.float64]
    t_end: float
    x_end: NDArray[np.float64]
    mode_end: int


def simulate(
    system: HybridSystem,
    parameters: Mapping[str, float] | None = None,
    x0: ArrayLike = (),
    *,
    mode: str | None = None,
    t_end: float | None = None,
    periods: int | None = None,
    rtol: float = RTOL,
    atol: float | None = None,
    max_events: int = 100_000,
    max_steps: int | None = None,
) -> Trajectory:
    """Return the motion of a hybrid system from a state.

    Parameters
    ----------
    system : HybridSystem
        What moves.
    parameters : mapping of str to float, optional
        Values that differ from the defaults.
    x0 : array_like, shape (states,) or (all states,)
        State at time 0; without the phase it starts at phase 0.
    mode : str, optional
        Mode at time 0; by default the first whose domain holds and none of whose events that lead to another mode is
        passed already.
    t_end : float
        How long; or
    periods : int
        for how many periods of the phase. Exactly one of the two.
    rtol, atol : float, optional
        Relative and absolute tolerance of a step; `rtol` between 1e-14 and 0.1. By default the second is 1e-12, or so
        much smaller as the smallest state where that stays below 1e-2 all along the motion.
    max_events : int, optional
        The motion ends early after so many transitions; `stopped` says so.
    max_steps : int, optional
        The motion ends early after so many steps; `stopped` says so. By default as many as fit into 512 MiB, some
        3 million for two states.

    Returns
    -------
    Trajectory

    Raises
    ------
    InputError
        An argument that cannot be used; a start outside the mode's domain.
    ChatteringError
        Events accumulate; as a `StickingError`, the field jumps where the motion is and holds it there.
    DivergenceError
        The state leaves every bound, or the domain of its mode; an event function is not finite.

    Warns
    -----
    RuntimeWarning
        A transition lands beyond an event of its target mode; see `Trajectory.landings_beyond`.

    References
    ----------
    E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd edition, Springer 1993, sections
    II.4 to II.6 (steps of order 8, dense output of order 7).

    Examples
    --------
    >>> from saltus.system.hybrid import HybridSystem, Mode, Transition
    >>> ball = HybridSystem(
    ...     states=("z", "v"),
    ...     parameters={"g": 1.0, "e": 0.5},
    ...     modes={"flight": Mode({"z": "v", "v": "-g"})},
    ...     transitions=[Transition("flight", "flight", "z", -1, {"v": "-e*v"}, name="impact")],
    ...     name="ball",
    ... )
    >>> fall = simulate(ball, {"e": 0.8}, [0.5, 0.0], t_end=2.0)
    >>> print(round(fall.events["time"][0], 12), fall(1.5).round(12))
    1.0 [0.275 0.3  ]
    """
    checks.instance("system", system, HybridSystem)
    p = system.parameter_vector(parameters)
    x = start_state(system, x0)
    check_tolerances(rtol, ATOL if atol is None else atol)
    if (t_end is None) == (periods is None):
        given = {"t_end": t_end, "periods": periods}
        raise InputError("t_end, periods", given, "exactly one of the two given")
    end = math.inf if t_end is None else checks.positive("t_end", t_end)
    if periods is not None:
        if system.phase is None:
            raise InputError("periods", periods, "left out for a system without a phase", "give t_end")
        periods = checks.count("periods", periods)
    max_events = checks.count("max_events", max_events)
    room = _MEMORY // (8 * (8 * x.size + 4))
    most_steps = room if max_steps is None else checks.count("max_steps", max_steps)
    start = starting_mode(system, x, p, mode)

    def begun(atol: float) -> EventDrivenMotion:
        return EventDrivenMotion(
            system, p, x.copy(), start, rtol, atol, steps_kept=min(_STEPS_KEPT, most_steps), room=most_steps
        )

    if atol is None:
        run = followed_in_size(begun, lambda run: run.follow(end, periods, max_events))
    else:
        run = begun(atol)
        run.follow(end, periods, max_events)
    full = run.time
    short = ""
    if full < end and (periods is None or not run.went_round(periods)):
        short = f"max_events = {max_events}" if run.events_passed >= max_events else f"max_steps = {most_steps}"
    stopped = f"t_end = {end:.12g} reached" if periods is None else f"{periods} periods reached"
    stopped = f"{short} reached at t = {full:.12g}" if short else stopped
    times, modes, starts, dense = run.steps()
    motion = Trajectory(
        system=system,
        parameters=system.resolve(parameters),
        t_end=full if periods is not None or short else end,
        x_end=frozen(run.x),
        mode_end=system.mode_names[run.mode],
        events=_event_table(system, *run.events()),
        stopped=stopped,
        step_times=frozen(times[:, 0]),
        step_lengths=frozen(times[:, 1]),
        step_modes=frozen(modes, np.int64),
        step_starts=frozen(starts),
        step_dense=frozen(dense),
        rtol=run.rtol,
        atol=run.atol,
    )
    warn_of(motion.landings_beyond)
    return motion


def settle(
    system: HybridSystem,
    p: NDArray[np.float64],
    x: ArrayLike,
    mode: int,
    *,
    periods: int | None = None,
    t: float | None = None,
    rtol: float = 1e-10,
    atol: float = 1e-12,
) -> tuple[NDArray[np.float64], int]:
    """Return the full state and the index of the mode after some periods or a time, and keep nothing else.

    Parameters
    ----------
    system : HybridSystem
        What moves.
    p : ndarray, shape (parameters,)
        `HybridSystem.parameter_vector`.
    x : array_like, shape (states,) or (all states,)
        Start; it may lie on the boundary of the mode's domain.
    mode : int
        Index of the mode there.
    periods, t : int, float
        How long; exactly one of the two.
    rtol, atol : float, optional
        Tolerances of a step.

    Raises
    ------
    InputError, ChatteringError, DivergenceError
        As `simulate`.
    """
    check_tolerances(rtol, atol)
    run = EventDrivenMotion(system, p, start_state(system, x), mode, rtol, atol)
    run.follow(*how_long(system, periods, t), None, keep=False)
    return run.x.copy(), run.mode


def events_after(
    system: HybridSystem,
    p: NDArray[np.float64],
    x: ArrayLike,
    mode: int,
    *,
    periods: int | None = None,
    t: float | None = None,
    n_events: int | None = None,
    rtol: float = 1e-10,
    atol: float = 1e-12,
) -> EventLog:
    """Return all events of a motion, without its dense output.

    Parameters
    ----------
    system, p, x, mode, rtol, atol
        As in `settle`.
    periods, t : int, float
        How long; exactly one of the two.
    n_events : int, optional
        The motion ends early after so many transitions.

    Raises
    ------
    InputError, ChatteringError, DivergenceError
        As `simulate`.
    """
    check_tolerances(rtol, atol)
    run = EventDrivenMotion(system, p, start_state(system, x), mode, rtol, atol)
    run.follow(*how_long(system, periods, t), n_events)
    return event_log(run)


def event_log(run: EventDrivenMotion) -> EventLog:
    """Return the events that a run has kept, and where it is."""
    times, which, ends, rates = run.events()
    return EventLog(
        time=frozen(times),
        transition=frozen(which[:, 0], np.int64),
        x_before=frozen(ends[:, 0]),
        x_after=frozen(ends[:, 1]),
        mode_before=frozen(which[:, 1], np.int64),
        mode_after=frozen(which[:, 2], np.int64),
        normal_velocity=frozen(rates),
        t_end=run.time,
        x_end=frozen(run.x),
        mode_end=run.mode,
    )


def _event_table(
    system: HybridSystem,
    times: NDArray[np.float64],
    which: NDArray[np.int64],
    ends: NDArray[np.float64],
    rates: NDArray[np.float64],
) -> NDArray[np.void]:
    n = len(system.all_states)
    names = (*system.transition_names, "" if system.phase is None else system.phase[0])
    modes = np.array(system.mode_names)
    longest = max(1, *map(len, names))
    table = np.zeros(
        times.size,
        dtype=[
            ("time", "f8"), ("kind", "U5"), ("name", f"U{longest}"), ("mode_before", modes.dtype),
            ("mode_after", modes.dtype), ("before", "f8", (n,)), ("after", "f8", (n,)), ("normal_velocity", "f8"),
            ("grazing", "?"),
        ],
    )  # fmt: skip
    wraps = which[:, 0] < 0
    table["time"], table["before"], table["after"], table["normal_velocity"] = times, ends[:, 0], ends[:, 1], rates
    table["kind"] = np.where(wraps, "phase", "event")
    table["name"] = np.array(names)[which[:, 0]]
    table["mode_before"], table["mode_after"] = modes[which[:, 1]], modes[which[:, 2]]
    table["grazing"] = ~wraps & (np.abs(rates) < GRAZING_SPEED)
    table.setflags(write=False)
    return table


def _code(system: HybridSystem, kind: str, name: str) -> int:
    return -1 if kind == "phase" else system.transition_names.index(name)


def _indices(names: tuple[str, ...], chosen: NDArray[np.str_]) -> NDArray[np.int64]:
    return np.array([names.index(name) for name in chosen], dtype=np.int64)


def _flags(values: Any, names: tuple[str, ...]) -> dict[str, str]:
    """How the numbers of a variable are named."""
    return {"meaning": json.dumps({str(value): name for value, name in zip(values, names, strict=True)})}
