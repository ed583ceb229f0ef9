"""A motion of a hybrid system as a result: its dense output, its events, its values at any time."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass, field
from functools import cached_property, partial
from typing import TYPE_CHECKING, Any, Literal, Self, overload

import numpy as np

from saltus import checks
from saltus.contents import Contents
from saltus.described import described
from saltus.errors import InputError
from saltus.flow.amplitude_spectrum import Window, spectrum
from saltus.flow.event_tables import code_of, event_table, indices_of
from saltus.flow.landings import Landing, landings_beyond
from saltus.flow.observables import Estimate, estimate, observe
from saltus.flow.stretch import Motion, angle_of, dense_states
from saltus.flow.touches import Touch, held_touches, touch_table
from saltus.result import Result, frozen
from saltus.system.hybrid import HybridSystem
from saltus.system.own_states import absent_states
from saltus.system.periodicity import evaluate_along
from saltus.system.plain import held_parameters, held_system

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Trajectory"]

_COEFFICIENTS = 7  # coefficients of the dense output in a step


@dataclass(frozen=True, eq=False, repr=False)
class Trajectory(Result):
    """A motion of a hybrid system, known at every time from 0 to `t_end`.

    `trajectory(t)` is the state at times `t`; at an event the state after the event. `simulate` returns trajectories.

    Parameters
    ----------
    system : HybridSystem
        The system.
    parameters : mapping of str to float
        All parameters.
    t_end : float
        Last time.
    x_end : ndarray, shape (all states,)
        Full state at `t_end`, after any event at that time.
    mode_end : str
        Mode at `t_end`.
    events : structured ndarray, shape (event,)
        Fields `time`, `kind` ("event", or "phase" for a wrap of the phase), `name` (of the transition or the phase),
        `mode_before`, `mode_after`, `before` and `after` (full states). `normal_velocity` is the rate of the event
        function before the event. `grazing` is true where it makes less in a flight than 1e-6 of the states' sizes.
    stopped : str
        Why the motion ended.
    step_times, step_lengths : ndarray, shape (step,)
        Start and length of each step.
    step_modes : ndarray of int, shape (step,)
        Index of the mode of each step.
    step_starts : ndarray, shape (step, all states)
        State at the start of each step.
    step_dense : ndarray, shape (step, 7, all states)
        Coefficients of the dense output, of order 7.
    tolerance : (float, float)
        Relative and absolute tolerance of a step.
    implicit_steps : int
        How many of the steps were implicit ones, of a stiff stretch.
    touches : tuple of `saltus.flow.touches.Touch`
        Events whose functions are zero to rounding at some places without a change of sign: these are no events.

    Examples
    --------
    >>> import saltus
    >>> oscillator = saltus.HybridSystem.smooth({"x": "v", "v": "mu*(1 - x**2)*v - x"}, {"mu": 1.0})
    >>> motion = saltus.simulate(oscillator, x0=[2.0, 0.0], t_end=10.0)
    >>> motion(10.0).round(4)
    array([-2.0083,  0.0329])
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
    tolerance: tuple[float, float] = (1e-10, 1e-12)
    implicit_steps: int = 0
    touches: tuple[Touch, ...] = ()

    def __call__(self, t: ArrayLike) -> NDArray[np.float64]:
        """Return the full state at times `t`, shape (all states,) for a number, (time, all states) for an array.

        A state that the mode lacks is NaN.

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
        modes = self._modes_at(flat)
        for mode in np.unique(modes).tolist():
            states[np.ix_(modes == mode, absent_states(self.system, mode))] = math.nan
        return states if times.ndim else states[0]

    def mode_at(self, t: ArrayLike) -> Any:
        """Return the name of the mode at times; at an event the mode after the event.

        Parameters
        ----------
        t : array_like
            Times between 0 and `t_end`.

        Returns
        -------
        str or ndarray of str
            One for each time.

        Raises
        ------
        InputError
            A time out of range.
        """
        times = self._times(t)
        names = np.array(self.system.mode_names)[self._modes_at(np.atleast_1d(times))]
        return names if times.ndim else str(names[0])

    def output(self, expression: str, t: ArrayLike) -> Any:
        """Return an output, or any expression, at times.

        Parameters
        ----------
        expression : str
            Expression in the states, the phase, the parameters and the outputs, as for `saltus.system.evaluate`.
        t : array_like
            Times; at an event the value is that after the event.

        Returns
        -------
        float or ndarray, shape of `t`
            In the units of the definition.

        Raises
        ------
        InputError
            The text is no expression, a name in it is unknown, or a time is out of range.
        """
        times = self._times(t)
        flat = np.atleast_1d(times)
        values = evaluate_along(self.system, expression, self(flat), self._modes_at(flat), self.parameters)
        return values if times.ndim else float(values[0])

    @cached_property
    def landings_beyond(self) -> tuple[Landing, ...]:
        """Transitions that led beyond an event of their target mode, in order of time.

        The motion goes on in the target mode as if the event were still to come. The definition lacks a transition, or
        a reset goes too far.
        """
        log = self.events[self.events["kind"] == "event"]
        sizes = np.abs(self.step_starts).max(axis=0, initial=0.0)
        return landings_beyond(self.system, self.parameters, log, sizes)

    def motion(self, t_start: float | None = None, t_end: float | None = None) -> Motion:
        """Return a stretch of the trajectory as a `Motion`, from which observables are computed.

        Parameters
        ----------
        t_start, t_end : float, optional
            Begin and end of the stretch; by default the whole trajectory.

        Returns
        -------
        Motion
            The stretch.

        Raises
        ------
        InputError
            A time is out of range, or the stretch is empty.
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
            angle = angle_of(self.system, float(self.step_starts[0, -1]), float(rate))
        return Motion(
            system=self.system,
            parameters=self.parameters,
            modes=self.step_modes[steps],
            clocks=np.column_stack([starts, lengths, np.zeros((starts.size, 2))]),
            spans=spans,
            states=lambda at, fractions: self._states(at + first, fractions),
            crossings=crossings,
            angle=angle,
            tolerance=self.tolerance[0],
            errors=self._errors(steps),
        )

    def _errors(self, steps: slice) -> NDArray[np.float64]:
        """Return the errors of the states over some steps, shape (all states,): those that each step may leave."""
        sizes = np.abs(self.step_starts[steps]).max(axis=0)
        return np.asarray(self.tolerance[0] * sizes + self.tolerance[1])

    @overload
    def observe(
        self, *names: str, t_start: float | None = None, t_end: float | None = None, errors: Literal[False] = False
    ) -> dict[str, float]: ...

    @overload
    def observe(
        self, *names: str, t_start: float | None = None, t_end: float | None = None, errors: Literal[True]
    ) -> dict[str, Estimate]: ...

    def observe(
        self, *names: str, t_start: float | None = None, t_end: float | None = None, errors: bool = False
    ) -> dict[str, float] | dict[str, Estimate]:
        """Return observables of a stretch of the trajectory by name.

        Parameters
        ----------
        *names : str
            As ``"max(force)"`` or ``"amplitude(z, 1)"``; `saltus.flow.observables` lists them. A harmonic is taken
            over the last whole periods of the drive within the stretch.
        t_start, t_end : float, optional
            Begin and end of the stretch; by default the whole trajectory.
        errors : bool, optional
            Whether each value comes with an estimate of its error, as ``Estimate(value, error)``.

        Returns
        -------
        dict of str to float or Estimate
            In the order of the names. What does not converge is NaN, and a warning names it.

        Raises
        ------
        InputError
            A name is no observable, a time is out of range, or the stretch is shorter than a harmonic's period.
        """
        return (estimate if errors else observe)(self.motion(t_start, t_end), names)

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
            Begin and end of the stretch. By default the last whole periods of the drive; the whole trajectory without a
            phase or a whole period.
        samples : int, optional
            Number of equidistant times, 2 or more; by default 256 a period of the drive, or 8 a step without a phase.
        window : {"none", "hann"}, optional
            Window that multiplies the samples. By default none where the stretch is a whole number of periods, else
            Hann's. Hann's window spreads a line over three frequencies and removes its leakage far away.

        Returns
        -------
        xarray.DataArray
            Amplitudes: of a line that of its sine, at frequency 0 the mean. They are against ``order``, the frequency
            over that of the drive; ``frequency`` is the angular frequency. Without a phase they are against
            ``frequency``. Attributes give the stretch, the window and the number of samples.
            ``motion.spectrum("z").plot(yscale="log")`` draws the spectrum.

        Raises
        ------
        InputError
            The text is no expression, or a time or an option cannot be used.
        """
        motion = self.motion(t_start, t_end)
        if t_start is None and self.system.phase is not None:
            motion = motion.whole() or motion
        return spectrum(motion, expression, partial(self.output, expression), samples=samples, window=window)

    def __repr__(self) -> str:
        kinds = self.events["kind"]
        names, counts = np.unique(self.events["name"][kinds == "event"], return_counts=True)
        told = ", ".join(f"{count} {name}" for name, count in zip(names, counts, strict=True)) or "no event"
        told += f" ({grazing} grazing)" if (grazing := int(self.events["grazing"].sum())) else ""
        wraps = int(np.sum(kinds == "phase"))
        told += f", {wraps} periods of {self.system.phase[0]}" if self.system.phase is not None else ""
        steps = (
            f"{self.step_times.size} steps{f', {self.implicit_steps} of them implicit' if self.implicit_steps else ''}"
        )
        title = repr(self.system.name) if self.system.name else "a system"
        beyond = "".join(f"\n  {landing}" for landing in self.landings_beyond[:1])
        beyond += f", and {more} more like it" if (more := len(self.landings_beyond) - 1) > 0 else ""
        beyond += "".join(f"\n  {touch}" for touch in self.touches)
        end = ", ".join(f"{n} = {v:.6g}" for n, v in zip(self.system.all_states, self.x_end, strict=True))
        return (
            f"Trajectory of {title} over 0 <= t <= {self.t_end:.10g}: {steps}, {told}\n"
            f"  ends in mode {self.mode_end!r} at {end}\n"
            f"  {self.stopped}{beyond}"
        )

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return everything as a Dataset with dimensions event, step, coefficient and state."""
        from saltus.extras import xr

        modes, log = self.system.mode_names, self.events
        variables: dict[str, Any] = {
            "x_end": ("state", np.array(self.x_end)),
            "event_time": ("event", np.array(log["time"])),
            "event_transition": (
                "event",
                np.array([code_of(self.system, e["kind"], e["name"]) for e in log], dtype=np.int64),
                _flags((-1, *range(len(self.system.transitions))), ("phase_wrap", *self.system.transition_names)),
            ),
            "event_mode_before": ("event", indices_of(modes, log["mode_before"]), _flags(range(len(modes)), modes)),
            "event_mode_after": ("event", indices_of(modes, log["mode_after"]), _flags(range(len(modes)), modes)),
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
        if self.touches:
            variables["touches"] = (("touch", "touch_field"), touch_table(self.system, self.touches))
        attrs = {
            "definition": json.dumps(self.system.definition()),
            "parameters": json.dumps(dict(self.parameters)),
            "t_end": self.t_end,
            "mode_end": self.mode_end,
            "stopped": self.stopped,
            **dict(zip(("rtol", "atol"), self.tolerance, strict=True)),
            "implicit_steps": self.implicit_steps,
        }
        return xr.Dataset(variables, coords={"state": list(self.system.all_states)}, attrs=attrs)

    @classmethod
    def _read(cls, held: Contents) -> Self:
        system = held_system(held)
        held.expect(state=len(system.all_states), coefficient=_COEFFICIENTS)
        held.names("state", system.all_states)
        t_end = held.number("t_end", least=0.0)
        held.size("step", least=1 if t_end else 0)
        event, step, last, first = ("event",), ("step",), len(system.modes) - 1, 0 if system.phase is None else -1
        which = [held.array("event_transition", event, int, least=first, most=len(system.transitions) - 1)]
        which += [held.array(f"event_mode_{side}", event, int, least=0, most=last) for side in ("before", "after")]
        ends = np.stack([held.array(f"event_{side}", ("event", "state")) for side in ("before", "after")], axis=1)
        times = held.array("event_time", event, least=0.0)
        rates = held.array("event_normal_velocity", event, finite=False)
        begun = held.array("step_time", step, least=0.0)
        if (np.diff(times) < 0.0).any() or (np.diff(begun) < 0.0).any():
            raise InputError("event_time, step_time", "not in order", "times that ascend")
        lengths = held.array("step_length", step, least=0.0)
        if np.any(np.diff(np.append(begun, t_end)) > lengths * (1.0 + 1e-9) + 1e-12 * t_end):
            raise InputError("step_length", "gaps between steps", "lengths of steps that cover the time")
        parameters, starts = held_parameters(held, system), held.array("step_start", ("step", "state"))
        p = system.parameter_vector(parameters)
        return cls(
            system=system,
            parameters=parameters,
            t_end=t_end,
            x_end=frozen(held.array("x_end", ("state",))),
            mode_end=system.mode_names[system.mode_index(held.text("mode_end"))],
            events=event_table(system, times, np.stack(which, axis=1), ends, rates, p, starts, t_end),
            stopped=held.text("stopped"),
            step_times=frozen(begun),
            step_lengths=frozen(lengths),
            step_modes=frozen(held.array("step_mode", step, int, least=0, most=last), np.int64),
            step_starts=frozen(starts),
            step_dense=frozen(held.array("step_dense", ("step", "coefficient", "state"))),
            tolerance=(held.number("rtol", least=0.0), held.number("atol", least=0.0)),
            # absent from earlier files
            implicit_steps=held.count("implicit_steps") if "implicit_steps" in held.dataset.attrs else 0,
            touches=held_touches(system, held),
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


def _flags(values: Any, names: tuple[str, ...]) -> dict[str, str]:
    """Return the attribute that names the values of a variable."""
    return {"meaning": json.dumps({str(value): name for value, name in zip(values, names, strict=True)})}
