"""The type of the special point at which the signature of an orbit changes, and the multipliers of the orbit there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.continuation.problems.grazing import Neighbour, neighbour
from saltus.continuation.problems.margins import rebound_ceases, speed_at, vanishing, vanishing_with
from saltus.orbits.cuts import whole
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.stability.floquet import multipliers
from saltus.scales import CONDITIONS_ALIKE, FIELDS_ALIKE, SPEEDLESS
from saltus.system.angles import wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["limits_of_multipliers", "passes_smoothly", "type_of_change"]


def type_of_change(problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64], found: Neighbour | str) -> str:
    """Return the type of the special point at which an orbit's signature changes.

    A sliding segment that is born where a motion touches is a GS, between two motions across the surface a CS. A
    segment off the surface that is born between sliding segments is an AS, beside one of them an SS. Where nothing
    slides, a motion that touches grazes (GR), and all else is a BC.

    Parameters
    ----------
    problem : OrbitProblem
        Equations of the signature in which the orbit was found.
    monitor : Monitor
        The monitor function that vanishes.
    u : ndarray, shape (size + 1,)
        Unknowns of the orbit, and the parameter.
    found : Neighbour or str
        What `neighbour` returns for it.

    References
    ----------
    M. di Bernardo, C. J. Budd, A. R. Champneys, P. Kowalczyk, Piecewise-smooth Dynamical Systems, Springer 2008, ch. 8.
    """
    problem, u = whole(problem, u)
    system = problem.system
    touches = monitor.kind in ("margin", "rate", "side")
    around = _born(problem, monitor, u, found)
    if monitor.kind == "duration" and rebound_ceases(problem, u, monitor.segment):
        return "BC"
    if around is None:
        return "GR" if touches else "BC"
    born, before, after = (system.modes[system.mode_names[mode]].surface is not None for mode in around)
    if born:
        return "GS" if around[1] == around[2] else "CS" if not before and not after else "BC"
    if before and after:
        return "AS"
    if before or after:
        return "SS"
    touches = touches or _closes_smoothly(problem, monitor, u) or _meets_without_velocity(problem, monitor, u)
    return "GR" if touches and around[1] == around[2] else "BC"


def limits_of_multipliers(
    problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64]
) -> NDArray[np.complex128] | None:
    """Return the multipliers at a grazing where a segment vanishes, shape (states,); None where they have no limits.

    They have limits where the field is continuous on the surface and no reset moves the state: those of the orbit
    without the segment. The segment's own saltations are quotients of rounding there.

    Parameters
    ----------
    problem : OrbitProblem
        Equations of the signature with the segment.
    monitor : Monitor
        The monitor function that vanishes.
    u : ndarray, shape (size + 1,)
        Unknowns of the orbit, and the parameter.
    """
    if monitor.kind not in ("duration", "rate"):
        return None
    problem, u = whole(problem, u)
    blocks = u[: problem.size].reshape(problem.segments, problem.n + 1)
    born = vanishing(problem, blocks, monitor.segment) if monitor.kind == "rate" else monitor
    if born.kind != "duration" or not passes_smoothly(problem, u, born.segment):
        return None
    found = neighbour(problem, born, u)
    if isinstance(found, str) or len(found.signature) >= problem.segments:
        return None
    fewer = OrbitProblem(
        problem.system, found.signature, problem.parameters_at(u), problem.active, problem.scales, problem.tol
    )  # fmt: skip
    fewer.start(found.u)
    return multipliers(fewer, found.u, fewer.resolve(found.u)[1])


def passes_smoothly(problem: OrbitProblem, u: NDArray[np.float64], segment: int) -> bool:
    """Return whether no reset moves the state around a segment without length, and the fields there are one.

    Segments that vanish with it are looked at, too.
    """
    system, signature, n = problem.system, problem.signature, problem.n
    gone = vanishing_with(problem, u[: problem.size].reshape(problem.segments, n + 1), segment)
    if any(system.transitions[signature.transitions[i]].reset for i in (gone[0] - 1, *gone)):
        return False
    x, fields = np.ascontiguousarray(u[segment * (n + 1) :][:n]), np.empty((1 + len(gone), n))
    for i, field in zip((gone[0] - 1, *gone), fields, strict=True):
        system.compiled.call("field", signature.modes[i], 0, x, problem.extended, field)
    apart, size = (float(np.max(np.abs(f) / problem.state_scale)) for f in (fields[1:] - fields[0], fields[0]))
    return apart <= FIELDS_ALIKE * size


def _closes_smoothly(problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64]) -> bool:
    """Return whether the only other segment is a smooth closed orbit where one vanishes.

    It meets the surface at a single place, so it touches it there: however near the point was located, its distance
    from a crossing is the square of that.
    """
    n, system = problem.n, problem.system
    if monitor.kind != "duration" or problem.segments != 2:
        return False
    other = 1 - monitor.segment
    problem.survey(u)
    apart = wrapped(problem.state_on(other, 1.0) - u[other * (n + 1) :][:n], system.angle_places)[: len(system.states)]
    return bool(np.max(np.abs(apart) / problem.state_scale[: apart.size]) < CONDITIONS_ALIKE)


def _meets_without_velocity(problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64]) -> bool:
    """Return whether a segment whose duration vanishes begins or ends with an event that is met without velocity.

    The mode behind a surface that is touched may be left tangentially, or transversally by another event.
    """
    i, n = monitor.segment, problem.n
    if monitor.kind != "duration":
        return False
    blocks, period = (
        u[: problem.size].reshape(problem.segments, n + 1),
        float(np.abs(u[n : problem.size : n + 1]).sum()),
    )
    if _slow(problem, problem.signature.transitions[i], blocks[i, :n], period):
        return True
    problem.survey(u)
    before = vanishing_with(problem, blocks, i)[0] - 1
    return _slow(
        problem, problem.signature.transitions[before], problem.state_on(before % problem.segments, 1.0), period
    )


def _slow(problem: OrbitProblem, transition: int, x: NDArray[np.float64], period: float) -> bool:
    """Return whether an event is met without velocity in a full state."""
    return transition >= 0 and speed_at(problem, transition, x, period) < SPEEDLESS


def _born(
    problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64], found: Neighbour | str
) -> tuple[int, int, int] | None:
    """Return the modes of the segment that is born or vanishes, of the one before and the one behind it."""
    if monitor.kind == "margin":
        target = problem.system.transitions[monitor.transition].target
        mode = problem.signature.modes[monitor.segment]
        return problem.system.mode_index(target), mode, mode
    n, size = problem.n, problem.size
    if monitor.kind in ("condition", "ahead", "behind", "unmet", "rebound"):
        if isinstance(found, str) or len(found.signature) <= len(problem.signature):
            return None
        modes = found.signature.modes
        place = int(np.argmin(np.abs(found.u[n : len(modes) * (n + 1) : n + 1])))
    else:
        blocks, modes, place = u[:size].reshape(problem.segments, n + 1), problem.signature.modes, monitor.segment
        if monitor.kind == "rate":
            behind = vanishing(problem, blocks, place)
            if behind.kind == "rate":
                return None
            place = behind.segment
        elif monitor.kind == "side":
            return None
        if modes[place - 1] != modes[(place + 1) % len(modes)]:
            together = vanishing_with(problem, blocks, place)
            around = modes[together[0] - 1], modes[(together[-1] + 1) % len(modes)]
            if around[0] == around[1]:
                return modes[together[0]], *around
    return modes[place], modes[place - 1], modes[(place + 1) % len(modes)]
