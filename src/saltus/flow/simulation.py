"""Event-driven simulation: one motion from a state, through every transition, to a time or phase.

docs/theory/flow.md, "Event-driven simulation", explains the method.

Rules
-----
* A transition happens where its event function changes sign in its direction and its condition `when` is positive.
* The change of sign is one above the rounding of the function. Where the function touches 0, or stays at 0, to its
  rounding, there is no event: `Trajectory.touches` names such places.
* Where several happen at the same time, the first in the definition comes first. Another follows at once if, after the
  reset, the mode is still its source and its event function still passes zero. A `RuntimeWarning` names two that would
  lead elsewhere in the other order.
* A motion that starts on an event surface leaves it to one side. If this is the side of the event's direction, the
  event happens at once; an event of direction 0 does not.
* A transition that changes nothing (a counter on a section) does not happen at a start, whatever its direction. It also
  does not happen a second time at the same place, tangentially or not.
* Events at phase 0 of functions of the phase alone happen at once in a motion that starts at phase 0, in either
  direction.
* A `ChatteringError` is raised in four cases. More than 50 events in a row each follow after less than 1e-10 of the
  time scale, and these times shrink. Time stands still for 50 events. The motion hops from an event to the same event,
  by less than rounding, four times in a row. Four events in a row each follow after less than 1e-30 of the time scale,
  at shrinking intervals. The time scale is the period of the phase; without a phase it is the
  longest time between events so far.
* After an event that stays in its mode, a motion is on the side of the surface from which it came. If it leaves to the
  other side, the event happens once more, unless the motion passes a threshold: docs/theory/flow.md.
* A change of sign of an event function at which it is not zero, a jump or a pole, is no event.
* A transition may land beyond an event of its target mode. `RuntimeWarning` and `Trajectory.landings_beyond` report it,
  and the motion goes on in the target mode.
* A field that jumps, as ``sign(v)`` at v = 0, may be passed. Where it would hold the motion, a `StickingError` names
  the place.
* The phase runs on [0, 2 pi). Its wrap is landed on exactly and recorded as an event of kind ``"phase"``.
* A wrap comes before the events at phase 0, and before events up to 1e-9 (as an angle) earlier, which rounding may put
  on either side. A motion of whole periods ends before the events at phase 0.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.flow.event_tables import event_table
from saltus.flow.instants import warn_of_clashes
from saltus.flow.landings import warn_behind_wall, warn_of
from saltus.flow.motion import EventDrivenMotion, how_long, start_state, tolerances_of
from saltus.flow.sizes import RTOL, followed_in_size
from saltus.flow.starting import starting_mode
from saltus.flow.touches import touches_of
from saltus.flow.trajectory import Trajectory
from saltus.result import frozen
from saltus.system.hybrid import HybridSystem
from saltus.system.maps import flowing
from saltus.work import interrupt_noted

if TYPE_CHECKING:
    from collections.abc import Mapping

    from saltus.checks.states import StateLike


__all__ = ["SimulationOptions", "simulate"]

_STEPS_KEPT = 1024  # steps for which a motion has room at first; the room grows with the motion
_MEMORY = 1 << 29  # most memory of dense output, in bytes


@dataclass(frozen=True, kw_only=True)
class SimulationOptions:
    """Numbers of events and steps at which `simulate` ends a motion early, and the size of a state that has diverged.

    `Trajectory.stopped` says which number was reached.

    Parameters
    ----------
    max_events : int
        Most transitions.
    max_steps : int, optional
        Most steps; by default as many as fit into 512 MiB, some 3 million for two states.
    limit : float, optional
        Size beyond which a state that grows has diverged. By default 1e12, or a million times the largest size of the
        problem: the start, or the largest number or parameter over the least.

    Raises
    ------
    InputError
        A number is no count, or the limit is not above 0.

    Examples
    --------
    >>> SimulationOptions(max_events=4)
    SimulationOptions(max_events=4, max_steps=None, limit=None)
    """

    max_events: int = 100_000
    max_steps: int | None = None
    limit: float | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "max_events", checks.count("SimulationOptions.max_events", self.max_events))
        if self.max_steps is not None:
            object.__setattr__(self, "max_steps", checks.count("SimulationOptions.max_steps", self.max_steps))
        if self.limit is not None:
            object.__setattr__(self, "limit", checks.positive("SimulationOptions.limit", self.limit))


def simulate(
    system: HybridSystem,
    parameters: Mapping[str, float] | None = None,
    x0: StateLike = (),
    *,
    mode: str | None = None,
    t_end: float | None = None,
    periods: int | None = None,
    tolerance: float | tuple[float, float] = RTOL,
    options: SimulationOptions | None = None,
) -> Trajectory:
    """Return the motion of a hybrid system from a state.

    Parameters
    ----------
    system : HybridSystem
        The system.
    parameters : mapping of str to float, optional
        Values that differ from the defaults.
    x0 : array_like, shape (states,) or (all states,), or mapping of str to float
        State at time 0. Without a value for the phase, the motion starts at phase 0.
    mode : str, optional
        Mode at time 0. By default the first mode whose domain holds the state and whose events to other modes are all
        still to come.
    t_end : float
        End of the motion as a time.
    periods : int
        End of the motion as a number of periods of the drive. Exactly one of `t_end` and `periods` is given.
    tolerance : float or (float, float), optional
        Relative tolerance of a step, between 1e-14 and 0.1, or a pair of relative and absolute tolerance. By default
        the absolute tolerance is 1e-12. Where a state stays below 1e-2 all along the motion, 1e-12 is
        multiplied by the size of the smallest state. States that never cross zero, as populations, have none then.
    options : SimulationOptions, optional
        Numbers of transitions and steps after which the motion ends early, and the size beyond which it diverges.

    Returns
    -------
    Trajectory
        The motion with its events; `Trajectory.stopped` says why it ended. An interrupt (Ctrl-C) keeps what was
        followed.

    Raises
    ------
    InputError
        An argument cannot be used, or the start lies outside the mode's domain.
    ChatteringError
        Events accumulate. As a `StickingError`: the field jumps and holds the motion at a place.
    DivergenceError
        The state grows beyond all bounds or leaves the domain of its mode, or an event function is not finite.

    Warns
    -----
    RuntimeWarning
        A transition lands beyond an event of its target mode; see `Trajectory.landings_beyond`. Or the start lies
        behind an event whose reset throws motions back, as below a table. Or two transitions are due at the same time,
        and lead elsewhere in the other order.

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
    flowing(system, "iterate")
    p = system.parameter_vector(parameters)
    x = start_state(system, x0, mode)
    rtol, atol = tolerances_of(tolerance)
    end, periods = how_long(system, periods, t_end)
    if periods is not None:
        periods = checks.count("periods", periods)
    options = SimulationOptions() if options is None else checks.instance("options", options, SimulationOptions)
    most_steps = _MEMORY // (8 * (8 * x.size + 4)) if options.max_steps is None else options.max_steps
    start = starting_mode(system, x, p, mode)
    warn_behind_wall(system, p, x, start)

    given, kept = atol is not None, min(_STEPS_KEPT, most_steps)
    runs: list[EventDrivenMotion] = []

    def begun(atol: float) -> EventDrivenMotion:
        run = EventDrivenMotion(
            system, p, x.copy(), start, rtol, atol, steps_kept=kept, room=most_steps, whole=given, limit=options.limit
        )
        runs.append(run)
        return run

    def follow(run: EventDrivenMotion) -> None:
        # after an interrupt a finer motion goes as far as the coarser one before it
        reached = runs[-2].time if interrupted and len(runs) > 1 else end
        run.follow(min(end, reached), periods, options.max_events)

    def end_soon() -> None:
        for run in runs[-1:]:
            run.room = 0  # the steps under way are its last

    with interrupt_noted(end_soon) as interrupted:
        if atol is None:
            run = followed_in_size(begun, follow)
        else:
            run = begun(atol)
            follow(run)
    if not run.kept_steps:
        raise KeyboardInterrupt
    full = run.time
    short = ""
    if full < end and (periods is None or not run.went_round(periods)):
        short = f"{options.max_events} events" if run.events_passed >= options.max_events else f"{most_steps} steps"
    stopped = f"t_end = {end:.12g} reached" if periods is None else f"{periods} periods reached"
    if short:
        stopped = f"interrupted at t = {full:.12g}" if interrupted else f"{short} reached at t = {full:.12g}"
    times, modes, starts, dense = run.steps()
    seen, kinds, sides, rates = run.events()
    motion = Trajectory(
        system=system,
        parameters=system.resolve(parameters),
        t_end=full if periods is not None or short else end,
        x_end=frozen(run.x),
        mode_end=system.mode_names[run.mode],
        events=event_table(system, seen, kinds, sides, rates, run.p, starts, full),
        stopped=stopped,
        step_times=frozen(times[:, 0]),
        step_lengths=frozen(times[:, 1]),
        step_modes=frozen(modes, np.int64),
        step_starts=frozen(starts),
        step_dense=frozen(dense),
        tolerance=(run.rtol, run.atol),
        implicit_steps=run.implicit_steps,
        touches=touches_of(system, run.n_touched, run.touched),
    )
    warn_of(motion.landings_beyond)
    warn_of_clashes(system, motion.parameters, motion.events)
    return motion
