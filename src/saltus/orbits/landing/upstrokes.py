"""Durations of segments whose events are met so steeply that Newton's method does not find them.

An upstroke has a pole right behind the surface. Newton's step in the duration contracts only within the time in which
the rate of the event function doubles. With the event function in place of time as the variable (Henon 1982), the flow
towards the surface is smooth, and has no pole.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.algebraic.newton import ACCEPTED
from saltus.orbits.common_sizes import newton_step
from saltus.orbits.landing.landed import fitted
from saltus.orbits.signature import EVENT_END
from saltus.scales import EPS, RESIDUAL_KEPT, ROUNDINGS, SETTLED, STRAIGHT

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from saltus.orbits.landing.landed import Equations

__all__ = ["ROUNDS", "carried", "shows_last_step", "solved"]

_SHORTER = 6  # shares by which durations are shortened before a pole, from rounding up
_WIDER = 512  # ratio of two such shares
ROUNDS = 8  # of flows to a surface: each begins nearer to it, and what is left is quadratic


def carried(
    problem: Equations, u: NDArray[np.float64], J: NDArray[np.float64] | None = None
) -> NDArray[np.float64] | None:
    """Return unknowns whose segments end on their surfaces, or None where Newton's steps lead there by themselves.

    The unknowns but for the durations stay. It is None, too, where a surface is not reached. What tells an upstroke is
    that the rate of the event function grows along the flow: the surface is met much earlier than Newton's step says.
    Where the Jacobian `J` is given and finite, only rates that are great in it are looked at.
    """
    last = np.arange(problem.n, problem.size, problem.n + 1)
    events = np.flatnonzero(problem.kinds == EVENT_END)
    if J is not None and np.isfinite(J).all() and not shows_last_step(problem, u, J):
        return None
    if not events.size or problem.system.compiled.rooted[problem.modes].any() or not np.isfinite(u).all():
        return None
    moved = u
    for _ in range(ROUNDS):
        if (followed := _followed(problem, moved, last[events])) is None:
            return None
        times = [_late(problem, i, float(followed[last[i]])) for i in events.tolist()]
        late = [found.late for found in times if found is not None]
        if len(late) < events.size:
            return None
        if not any(late):
            return None if followed is u else followed
        moved = followed.copy()
        moved[last[events]] += late
    return _followed(problem, moved, last[events])


def solved(
    problem: Equations,
    u: NDArray[np.float64],
    most: int,
    sizes: Callable[[NDArray[np.float64]], NDArray[np.float64]],
) -> NDArray[np.float64] | None:
    """Return unknowns of an orbit near `u` by Newton steps from surface to surface; None where no upstroke is met.

    It is None, too, where `most` steps do not converge. Meshes are made for the flow up to a rounding before its poles.
    sizes: those of the unknowns, as a function of these.
    """
    started: NDArray[np.float64] | None = None
    for _ in range(ROUNDS):
        if (started := _started(problem, u)) is None:
            return None
        if (further := carried(problem, started)) is None:
            break
        u = further
    if started is None:
        return None
    u, scale = started, sizes(started)
    for k in range(most):
        F, J = fitted(problem, problem.evaluate, u)
        for _ in range(ROUNDS):
            if (further := carried(problem, u, J)) is None:
                break
            u = further
            F, J = fitted(problem, problem.evaluate, u)
        if not np.isfinite(J).all() or (k == 0 and not shows_last_step(problem, u, J)):
            return None
        F = np.where(_met(problem, u), 0.0, F)
        step = newton_step(J, -F, scale)
        length = float(np.max(np.abs(step) / scale))
        if length < SETTLED and problem.refine():
            return u
        u = u + step
    return None


def _started(problem: Equations, u: NDArray[np.float64]) -> NDArray[np.float64] | None:
    """Return unknowns that meshes have been made for: durations up to events are shortened before a pole."""
    last = np.arange(problem.n, problem.size, problem.n + 1)[problem.kinds == EVENT_END]
    for share in _shares() if last.size else ():
        shorter = u.copy()
        shorter[last] *= 1.0 - share
        if problem.start(shorter) is None:
            return shorter
    return None


def _shares() -> list[float]:
    """Return shares by which durations are shortened before a pole: none, a rounding, more up to some hundredths."""
    return [0.0, *(ROUNDINGS * EPS * _WIDER**k for k in range(_SHORTER))]


def _met(problem: Equations, u: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which equations are those of events that are met as nearly as the rounding of a duration allows."""
    problem.survey(u)
    met = np.zeros(problem.size, dtype=bool)
    for i in np.flatnonzero(problem.kinds == EVENT_END).tolist():
        place = i * (problem.n + 1) + problem.n
        found = _late(problem, i, float(u[place]))
        met[place] = found is not None and not _counts(found.time, float(u[place]))
    return met


def shows_last_step(problem: Equations, u: NDArray[np.float64], J: NDArray[np.float64]) -> bool:
    """Return whether the square of a converged Newton step, which it leaves, shows in an event function.

    The rate of an event function may double within the time in which it moves by its own size.
    """
    last, shown = slice(problem.n, problem.size, problem.n + 1), math.sqrt(RESIDUAL_KEPT)
    rates, period = np.abs(J[last, last].diagonal()), float(np.abs(u[last]).sum())
    least = shown * float(problem.state_scale.min())
    if float(rates.max()) * ACCEPTED * period <= least:  # nor do those of events alone
        return False
    moved = np.where(problem.kinds == EVENT_END, rates, 0.0) * ACCEPTED * period
    if not moved.max() > least:
        return False
    return bool(np.any(moved > shown * problem.event_sizes(u)))


def _counts(time: float, duration: float) -> bool:
    """Return whether a time is more than the rounding of a duration."""
    return abs(time) > ROUNDINGS * EPS * abs(duration)


def _followed(problem: Equations, u: NDArray[np.float64], places: NDArray[np.intp]) -> NDArray[np.float64] | None:
    """Return unknowns of a flow with values, surveyed: durations at `places` are shortened before a pole."""
    for share in _shares():
        shorter = u.copy() if share else u
        shorter[places] *= 1.0 - share
        if not all(np.isfinite(found).all() for found in problem.evaluate(shorter)):
            continue
        problem.survey(shorter)
        if np.isfinite(problem.dense()[2]).all():
            return shorter
    return None


class _Late(NamedTuple):
    """When a segment meets its surface, after its end."""

    time: float  # along the flow
    late: float  # the same where a duration is to be changed by it, else 0


def _late(problem: Equations, i: int, duration: float) -> _Late | None:
    """Return the time from a segment's end, as surveyed, along the flow to its surface; None where that is not met.

    A duration is changed where Newton's step may not contract, or where its last step shows.
    """
    from scipy.integrate import solve_ivp

    n, compiled, (_, starts, nodes, _) = problem.n, problem.system.compiled, problem.dense()
    end = nodes[starts[i + 1] - 1].copy()
    mode, transition, p = int(problem.modes[i]), int(problem.transitions[i]), problem.extended
    event, field = np.empty(2 + 2 * n), np.empty(n)
    compiled.call("event_x", transition, 0, end, p, event)
    height, rate = float(event[0]), float(event[1])
    if not (math.isfinite(height) and math.isfinite(rate) and rate != 0.0 and duration > 0.0):
        return None
    straight = -height / rate
    if not _counts(straight, duration):
        return _Late(straight, 0.0)
    fast = abs(rate) * ACCEPTED * duration > math.sqrt(RESIDUAL_KEPT) * problem.event_size(transition, end)
    compiled.call("field", mode, 0, end, p, field)
    grown = float(event[2 + n :] @ field) / rate  # of the rate, per time
    if abs(grown * straight) < STRAIGHT:  # Newton's step contracts
        return _Late(straight, straight if fast else 0.0)
    if not grown > 0.0:  # no upstroke: the surface is met slower and slower
        return None

    def flow(_: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        x = np.ascontiguousarray(y[:n])
        compiled.call("field", mode, 0, x, p, field)
        compiled.call("event_x", transition, 0, x, p, event)
        return np.append(field, 1.0) / event[1] if event[1] * rate > 0.0 else np.full(n + 1, np.nan)

    with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
        rough = math.sqrt(RESIDUAL_KEPT)  # the next flow is shorter by as much
        atol = np.append(rough * problem.state_scale, EPS * duration)
        found = solve_ivp(flow, (height, 0.0), np.append(end, 0.0), method="RK45", rtol=rough, atol=atol)
    time = float(found.y[-1, -1])
    if not (found.success and math.isfinite(time)):
        return None
    changes = _counts(time, duration) and (fast or straight - time > STRAIGHT * abs(straight))
    return _Late(time, time if changes else 0.0)
