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

from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.flow.event_tables import event_table
from saltus.flow.landings import warn_of
from saltus.flow.motion import EventDrivenMotion, how_long, start_state, starting_mode, tolerances_of
from saltus.flow.sizes import RTOL, followed_in_size
from saltus.flow.trajectory import Trajectory
from saltus.results import frozen
from saltus.system.hybrid import HybridSystem

if TYPE_CHECKING:
    from collections.abc import Mapping

    from numpy.typing import ArrayLike

__all__ = ["simulate"]

_STEPS_KEPT = 1024
_MEMORY = 1 << 29  # bytes of dense output at the most


def simulate(
    system: HybridSystem,
    parameters: Mapping[str, float] | None = None,
    x0: ArrayLike = (),
    *,
    mode: str | None = None,
    t_end: float | None = None,
    periods: int | None = None,
    tolerance: float | tuple[float, float] = RTOL,
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
    tolerance : float or (float, float), optional
        Relative tolerance of a step, between 1e-14 and 0.1, or the relative and the absolute one. By default the
        absolute one is 1e-12, or so much smaller as the smallest state where that stays below 1e-2 all along the
        motion.
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
    rtol, atol = tolerances_of(tolerance)
    end, periods = how_long(system, periods, t_end)
    if periods is not None:
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
        events=event_table(system, *run.events()),
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
