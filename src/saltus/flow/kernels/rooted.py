"""Compiled look at the arguments of roots: whether one is negative beyond the errors of the states."""

from __future__ import annotations

from saltus.flow.kernels.state import EPSILON, NEGATIVE_ROOT, UNDER, T, advance
from saltus.scales import STEPS_TOGETHER
from saltus.system.compiled import FUNCTIONS, SHARES
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import INNER, PART, call, numbers_at, outlined

GUARD = FUNCTIONS.index("guard")


@njit(**PART)
def under_root(system, tolerances, state, place, x, size, room):
    """Whether an argument of a root is negative at a state, beyond its error.

    place: a mode, or behind the modes a transition, whose roots are looked at. size: (n,), sizes of the states there.
    """
    first = system.n_modes + system.n_transitions + place
    call(system.addresses[GUARD], first, 0, x, 0, system.p, room.guard, 0)
    if room.guard[0] >= 0.0:
        state.counts[UNDER] = 0
        return False
    return _beyond(system, tolerances, state, first, x, size, room)


@njit(**INNER)
def _beyond(system, tolerances, state, first, x, size, room):
    """Whether the argument is negative beyond what the errors of the states make of it.

    The step that brought it below 0 may have left as much as its size allows; states that rest there keep that.
    """
    outlined()
    n, sized, shares = system.n, room.sized, numbers_at(system.addresses[SHARES])
    under = state.counts[UNDER] == 1
    soonest = 4.0 * state.numbers[T]  # no step is below four roundings of the time
    for e in range(n):
        reach = max(size[e], state.reach[e]) if under else size[e]
        share = min(abs(shares[e]), 1.0) if e < system.n_states else 0.0
        sized[e] = x[e]
        error = tolerances.atol * share + tolerances.rtol * reach
        sized[n + e] = STEPS_TOGETHER / EPSILON * error + soonest * abs(state.slopes[e])
    call(system.addresses[GUARD], first + system.n_modes + system.n_transitions, 0, sized, 0, system.p, sized, 2 * n)
    if sized[2 * n] < 0.0:
        return True
    for e in range(n):
        state.reach[e] = max(size[e], state.reach[e]) if under else size[e]
    state.counts[UNDER] = 1
    return False


@njit(**PART)
def passes_root(system, tolerances, state, mode, dt, end, room):
    """Whether a step of length dt ends where the argument of a root is negative, beyond what its error may be."""
    size = room.after
    for e in range(system.n):
        size[e] = max(abs(state.x[e]), abs(end[e]), dt * abs(state.slopes[e]))
    return under_root(system, tolerances, state, mode, end, size, room)


@njit(**INNER)
def behind_root(state, n, dt, end):
    """Take the state to the end of a step behind the zero of a root's argument, of which none is shorter; the status."""
    outlined()
    advance(state.numbers, dt)
    for e in range(n):
        state.x[e] = end[e]
    return NEGATIVE_ROOT
