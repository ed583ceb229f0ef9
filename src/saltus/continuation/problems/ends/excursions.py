"""What a motion does behind a surface that an orbit touches: found by following motions that pass it a little."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import SaltusError
from saltus.flow.event_logs import events_after
from saltus.scales import EXCURSION_SHRINKS, FINEST, ON_SURFACE, ONE_STATE
from saltus.system.own_states import absent_states

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = ["behind", "gone", "moved", "turns_back", "way_back"]

_MOST = 8  # transitions of an excursion
_STEPS = 200_000  # of a motion that is looked at, at most: as a motion on and off a surface may take without end
_PUSH = 1e-3  # velocity with which the surface is passed, over its variation with the states' sizes
_LESS = 1 / 16  # the same of a second motion, over that of the first


def behind(
    problem: OrbitProblem, u: NDArray[np.float64], mode: int, k: int, touching: NDArray[np.float64],
    landed: NDArray[np.float64],
) -> list[tuple[int, int, NDArray[np.float64]]] | str:  # fmt: skip
    """Return the segments without length behind a surface that leads to another mode, or why no orbit passes it."""
    names, target = problem.system.mode_names, problem.system.mode_index(problem.system.transitions[k].target)
    back, still = way_back(problem, target, mode, landed), not moved(problem, mode, landed, touching)
    if back is not None and still and turns_back(problem, back, target, landed):
        return [(target, back, landed)]
    away = _excursion(problem, u, mode, k, touching)
    if away is not None:
        return away
    if not still:
        return "the reset moves the state there: no neighbouring signature is continuous"
    if back is not None:
        return gone(problem, target)
    return f"motions that pass the surface do not come back from {names[target]!r} at once, so no orbit near it goes on"


def _excursion(
    problem: OrbitProblem, u: NDArray[np.float64], mode: int, k: int, touching: NDArray[np.float64]
) -> list[tuple[int, int, NDArray[np.float64]]] | None:
    """Return (mode, transition, state) of the segments without length that lie behind a surface which is touched.

    Two motions next to the one that touches pass the surface with small velocities, and all events that they meet
    count: the mode behind it may be left tangentially, transversally, by a timer, or over further modes. None where
    they do not come back to the mode, or their time away does not vanish with the velocity. Nor may a motion that
    touches come back elsewhere.

    Parameters
    ----------
    problem : OrbitProblem
        Equations of the orbit that touches, started there.
    u : ndarray, shape (size + active,)
        Its unknowns.
    mode, k : int
        The mode in which it touches the surface of transition `k`.
    touching : ndarray, shape (n,)
        Its full state there.
    """
    first, second = (_away(problem, u, mode, k, touching, push) for push in (_PUSH, _PUSH * _LESS))
    if first is None or second is None or first[0] != second[0] or not second[1] <= EXCURSION_SHRINKS * first[1]:
        return None
    x, rows = _reset(problem, k, touching), []
    for source, transition in first[0]:
        rows.append((source, transition, x))
        x = _reset(problem, transition, x)
    return None if moved(problem, mode, x, touching) else rows


def moved(problem: OrbitProblem, mode: int, x: NDArray[np.float64], y: NDArray[np.float64]) -> bool:
    """Return whether two full states differ in a state that a mode has, beyond the tolerance of their equations.

    Phases are not compared: no reset moves them, and they may differ by whole turns.
    """
    own = np.setdiff1d(np.arange(len(problem.system.states)), absent_states(problem.system, mode))
    return bool(np.max(np.abs(x - y)[own] / problem.state_scale[own]) > ONE_STATE)


def _reset(problem: OrbitProblem, k: int, x: NDArray[np.float64]) -> NDArray[np.float64]:
    after = np.empty(problem.n)
    problem.system.compiled.call("reset", k, 0, np.ascontiguousarray(x), problem.extended, after)
    return after


def _away(
    problem: OrbitProblem, u: NDArray[np.float64], mode: int, k: int, touching: NDArray[np.float64], push: float
) -> tuple[list[tuple[int, int]], float] | None:
    """Return the segments of a motion that passes the surface with a velocity, and for how long it is away."""
    start = _pushed(problem, mode, k, touching, push)
    period = float(np.abs(u[problem.n : problem.size : problem.n + 1]).sum())
    tolerance = FINEST, FINEST * float(problem.state_scale.min())
    try:
        p = problem.parameters_at(u)
        log = events_after(
            problem.system, p, start, mode, t_end=period, n_events=_MOST, tolerance=tolerance, most_steps=_STEPS
        )
    except SaltusError:  # a motion that cannot be followed shows no way back
        return None
    own = np.flatnonzero(log.transition >= 0)
    if not own.size or log.transition[own[0]] != k:
        return None
    segments: list[tuple[int, int]] = []
    for i in own[1:].tolist():
        segments.append((int(log.mode_before[i]), int(log.transition[i])))
        if log.mode_after[i] == mode:
            return segments, float(log.time[i] - log.time[own[0]])
    return None


def _pushed(
    problem: OrbitProblem, mode: int, k: int, touching: NDArray[np.float64], push: float
) -> NDArray[np.float64]:
    """Return a state a little before a surface, from which the motion passes it with a small velocity."""
    n, system, sizes = problem.n, problem.system, problem.state_scale.copy()
    sizes[absent_states(system, mode)] = 0.0
    if system.phase is not None:
        sizes[-1] = 0.0
    gradient, field = np.empty(2 + 2 * n), np.empty(n)
    system.compiled.call("event_x", k, 0, np.ascontiguousarray(touching), problem.extended, gradient)
    system.compiled.call("field", mode, 0, np.ascontiguousarray(touching), problem.extended, field)
    across, bend = gradient[2 : 2 + n] * sizes, gradient[2 + n :] * sizes
    curvature = float(gradient[2 + n :] @ field)
    square = float(across @ across)
    along = bend - (float(bend @ across) / square if square > 0.0 else 0.0) * across
    way = float(system.transitions[k].direction) or -math.copysign(1.0, curvature)
    speed = push * float(np.linalg.norm(along))
    x = touching + sizes * along * (way * push / max(float(np.linalg.norm(along)), 1e-300))
    if square > 0.0 and curvature != 0.0:
        # so far before the surface that the velocity there is nine tenths of it
        x -= sizes * across * (way * 0.095 * speed * speed / (abs(curvature) * square))
    if system.phase is not None:
        x[-1] %= system.turn
    return x


def gone(problem: OrbitProblem, mode: int) -> str:
    """Return the reason why no branch goes on where both modes bend the motion away from the surface."""
    return f"the motion in {problem.system.mode_names[mode]!r} does not turn back, so no orbit near it goes on"


def way_back(problem: OrbitProblem, source: int, target: int, x: NDArray[np.float64]) -> int | None:
    """Return a transition between two modes on whose surface a full state lies; None without one."""
    n = problem.n
    out = np.empty(2 + 2 * n)
    names = problem.system.mode_names
    for k, transition in enumerate(problem.system.transitions):
        if transition.source == names[source] and transition.target == names[target]:
            problem.system.compiled.call("event_x", k, 0, np.ascontiguousarray(x), problem.extended, out)
            if abs(out[0]) < ON_SURFACE * float(np.abs(out[2 : 2 + n]) @ problem.state_scale):
                return k
    return None


def turns_back(problem: OrbitProblem, back: int, mode: int, x: NDArray[np.float64]) -> bool:
    """Return whether a mode's field bends a motion that touches the surface of transition `back` towards it."""
    n, compiled = problem.n, problem.system.compiled
    gradient, field = np.empty(2 + 2 * n), np.empty(n)
    compiled.call("event_x", back, 0, np.ascontiguousarray(x), problem.extended, gradient)
    compiled.call("field", mode, 0, np.ascontiguousarray(x), problem.extended, field)
    return float(gradient[2 + n :] @ field) * (problem.system.transitions[back].direction or 1) > 0.0
