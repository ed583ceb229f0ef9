"""What a branch of orbits goes on with where its signature changes."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from saltus.continuation.core.arclength import StepControl, follow
from saltus.continuation.core.monitor import Monitor, at_grazing
from saltus.continuation.core.zero_problem import Event, Examined, Point, start_point
from saltus.continuation.problems.changes import passes_smoothly
from saltus.continuation.problems.ends.accumulating import accumulating
from saltus.continuation.problems.ends.unbounded import period_of
from saltus.continuation.problems.grazing import Neighbour, exchanged_at
from saltus.continuation.problems.margins import rebound_ceases, speed_at
from saltus.continuation.problems.orbit import OrbitZeroProblem
from saltus.continuation.problems.orbit_data import OrbitData
from saltus.continuation.runs.two_sided import OneSide, turned
from saltus.orbits.coincidences import Order, commute, exchanged
from saltus.orbits.cuts import whole
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.rounds import divided
from saltus.orbits.signature import DURATION, ON_BORDER, Signature, Survey
from saltus.orbits.stability.families import of_a_family
from saltus.scales import NO_DURATION, PARTING, RESTS_BEYOND, SAME_POINT, followed
from saltus.system.own_states import absent_states

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "accumulated",
    "beyond_changes",
    "exchanged_freely",
    "gone_on",
    "leaving",
    "more_exactly",
    "parted",
    "summed_late",
    "sums_up",
    "switched",
    "turns_back",
    "without_rounding",
]

Beyond: TypeAlias = tuple[OrbitZeroProblem, Point]
Equations: TypeAlias = "Callable[..., OrbitZeroProblem]"

_CLOSER = (1e-6, 1e-7, 1e-8)  # arclengths from a change of signature, of which one keeps the stability
_LAST = 8  # points of a branch that tell which way its parameter goes
# Why no branch goes on where all orbits of the equations graze.
_TOUCHES = "the motion beyond it touches the surface without speed, so that the event makes no orbit of its own"
# Survey of a point from which a step is tried: its orbit passes as inadmissible, so the step's end may be so too.
_NONE = np.empty(0)
_INADMISSIBLE = Survey(1, False, *(_NONE,) * 8, np.empty(0, dtype=np.int64), _NONE, np.empty((0, 3)))


def accumulated(branch: OrbitZeroProblem, event: Event) -> str | None:
    """Return in words that hits accumulate at a change of signature, or None where a segment vanishes between two."""
    point, name = event.point, event.name
    if name.kind == "rebound" or (name.kind == "duration" and rebound_ceases(branch.problem, point.u, name.segment)):
        return None
    return accumulating(branch.problem, point.u, name)


def leaving(branch: OrbitZeroProblem, event: Event) -> Monitor:
    """Return the monitor function of a grazing by which a branch goes on: a contact that ends comes before a new one.

    Where an orbit arrives at one that repeats itself, a round's contact ends as another round's begins. Which of the
    two is located first is rounding.
    """
    own: Monitor = event.name
    if own.kind != "margin":
        return own
    rounding = NO_DURATION * period_of(branch, event.point)
    monitors: Mapping[Monitor, float] = event.point.examined.monitors
    return next((name for name, value in monitors.items() if name.kind == "duration" and abs(value) <= rounding), own)


def gone_on(found: Sequence[Neighbour | str], problem: OrbitProblem, old: Point, equations: Equations) -> Beyond | str:
    """Return what `switched` does of the first of several neighbouring signatures in which a branch goes on.

    The reason of the first one is told where there is none.
    """
    reasons = []
    for beside in found:
        went = beside if isinstance(beside, str) else switched(beside, problem, old, equations)
        if not isinstance(went, str):
            return went
        reasons.append(went)
    return reasons[0]


def switched(found: Neighbour, problem: OrbitProblem, old: Point, equations: Equations) -> Beyond | str:
    """Return equations and point to go on with in the neighbouring signature, or why no branch does.

    A first step that changes the stability, where the multipliers are continuous, is taken shorter. Where none keeps
    the stability, the change is the point's within rounding.

    Parameters
    ----------
    found : Neighbour
        The orbit of the point in the neighbouring signature.
    problem : OrbitProblem
        Equations of the signature that ends there.
    old : Point
        The point.
    equations : callable
        Returns the equations of a signature near given unknowns.
    """
    sizes = _sizes_of_the_born(problem, found)

    def begun(signature: Signature, u: NDArray[np.float64]) -> OrbitZeroProblem:
        branch = equations(signature, u, sizes)
        if branch.problem.tighten():  # what lies beyond cannot be told at a looser tolerance
            branch.problem.start(u)
        return branch

    branch = begun(found.signature, found.u)
    if (once := divided(branch.problem, found.u, 2, SAME_POINT * branch.problem.state_scale)) is not None:
        found = Neighbour(*once)
        branch = begun(found.signature, found.u)
    try:
        point = start_point(branch, found.u)
    except ValueError as error:
        return f"no branch goes on: {_why_none(problem, branch.problem, found) or error}"
    point.arc = old.arc
    if float(point.weights @ (point.u - found.u) ** 2) > SAME_POINT**2:
        return "no orbit beyond it is its own there"
    touching: list[Point] = []
    item = next(
        filter(None, (_first_beyond(branch, point, old, probe, touching) for probe in (1e-5, 1e-6, 1e-4))), None
    )
    if item is None:
        return _TOUCHES if touching else "no admissible orbit beyond it"
    known = _unstable_at(branch, point, old)
    for probe in _CLOSER if known is not None else ():
        if item.examined.data.unstable == known:
            break
        item = _first_beyond(branch, point, old, probe, touching) or item
    item.arc = old.arc + math.sqrt(float(point.weights @ (item.u - point.u) ** 2))
    return branch, item


def _why_none(old: OrbitProblem, problem: OrbitProblem, found: Neighbour) -> str | None:
    """Return the reason if the orbit on the border is not isolated without the segment that vanishes; else None.

    Where a block that sticks comes to slip all the time without friction, its motion is one of a family.
    """
    fixed = OrbitProblem(problem.system, found.signature, problem.parameters_at(found.u), tol=problem.tol)
    if not of_a_family(fixed, found.u[: fixed.size]):
        return None
    names, gone = problem.system.mode_names, set(old.signature.modes) - set(found.signature.modes)
    without = f"without a stay in {' and '.join(repr(names[mode]) for mode in sorted(gone))} " if gone else ""
    return f"the orbit there {without}is one of a family at the same parameters"


def exchanged_freely(
    branch: OrbitZeroProblem, way: Monitor, found: Neighbour | str, point: Point, equations: Equations
) -> Beyond | None:
    """Return what goes on where two events exchange their order and do not depend on each other, or None.

    The derivative is the same in both orders, so that no special point lies there.
    """
    problem, u = whole(branch.problem, point.u)
    other = exchanged_at(problem, way, u)
    if other is None or isinstance(found, str):
        return None
    behind = way.segment + (way.kind == "ahead")
    own = Order(problem.signature, u[: problem.size].reshape(problem.segments, problem.n + 1))
    if not commute(problem, [own, other], behind - 1, behind):
        return None
    went = switched(found, branch.problem, point, equations)
    return None if isinstance(went, str) else went


def parted(branch: OrbitZeroProblem, point: Point, equations: Equations) -> Beyond | None:
    """Return equations and point in the order that events have which were at one instant, and have parted; or None.

    An event that now comes before the one that is before it in the signature has a negative duration.
    """
    if not point.examined.data.survey.faults & DURATION:
        return None
    problem, u = whole(branch.problem, point.u)
    blocks = u[: problem.size].reshape(problem.segments, problem.n + 1)
    i = int(np.argmin(blocks[:, -1]))
    problem.survey(u)
    near = abs(float(blocks[i, -1])) / float(np.abs(blocks[:, -1]).sum())
    other = exchanged(problem, blocks, i, max(10.0 * near, SAME_POINT)) if near < PARTING else None
    if other is None:
        return None
    found = Neighbour(other.signature, np.append(other.blocks.ravel(), u[problem.size :]))
    fresh = equations(found.signature, found.u)
    try:
        begun = start_point(fresh, found.u)
    except ValueError:
        return None
    begun.examined, begun.arc = fresh.examine(begun, None), point.arc
    if begun.examined.data is None or not beyond_changes(fresh.problem, begun):
        return None
    # all unknowns but those of the segment between both events, and the duration before it, are what they were
    same = np.delete(np.arange(u.size), np.arange(i * (problem.n + 1) - 1, (i + 1) * (problem.n + 1)))
    return fresh, turned(begun, float((point.weights * point.tangent * begun.tangent)[same].sum()), fresh.odd)


def _sizes_of_the_born(problem: OrbitProblem, found: Neighbour) -> NDArray[np.float64]:
    """Return the sizes, shape (states,), that an orbit gave to states of modes without length alone; 0 for others.

    Where the signature changes, what such a state has is rounding, which is no size.
    """
    system, n, count = problem.system, problem.n, len(found.signature)
    durations = np.abs(found.u[n : count * (n + 1) : n + 1])
    shown = np.zeros(len(system.states), dtype=np.bool_)
    for mode, duration in zip(found.signature.modes, durations.tolist(), strict=True):
        if duration > NO_DURATION * durations.sum():
            shown |= ~np.isin(np.arange(shown.size), absent_states(system, mode))
    return np.where(shown, 0.0, problem.state_scale[: shown.size])


def _first_beyond(
    branch: OrbitZeroProblem, point: Point, old: Point, probe: float, touching: list[Point]
) -> Point | None:
    """Return the first point of a branch behind a change of signature, an arclength of `probe` away; None without one.

    Parameters
    ----------
    branch : OrbitZeroProblem
        Equations of the new signature.
    point : Point
        The change in these equations.
    old : Point
        The change in the equations that end there.
    probe : float
        The arclength.
    touching : list of Point
        Points beyond are appended whose orbits meet an event without speed.
    """
    onward = math.copysign(1.0, float(old.tangent[-1]))
    for sign in (onward, -onward):
        start = turned(point, sign, branch.odd)
        start.examined = Examined({}, None, OrbitData(_INADMISSIBLE, np.empty(0, complex), 0))
        control = StepControl(initial=probe, smallest=probe / 4, largest=probe)
        item = next(follow(branch, start, control, log=[]))
        # where the parameter rests at the change its direction there is rounding: a step back to it is none
        if not isinstance(item, Point) or _way(item, old) < _way(point, old) - 0.1 * probe:
            continue
        if beyond_changes(branch.problem, item):
            return item
        if item.examined.data.survey.admissible and _grazes_on(branch.problem, item):
            touching.append(item)
    return None


def _unstable_at(branch: OrbitZeroProblem, point: Point, old: Point) -> int | None:
    """Return the number of unstable multipliers at a change of signature; None where they jump there.

    branch, point: the equations of the new signature, and the change in these.
    """
    n, size = branch.n, branch.problem.size
    durations = np.abs(point.u[n : size : n + 1])
    born = int(np.argmin(durations))
    if durations[born] > NO_DURATION * durations.sum():
        data = branch.examine(point, None).data
    else:
        data = old.examined.data if passes_smoothly(branch.problem, point.u, born) else None
    return None if data is None else int(data.unstable)


def more_exactly(half: OneSide, branch: OrbitZeroProblem, last: Point) -> Point | None:
    """Return the point from which a direction goes on at the finest tolerance; None where that was used.

    A last point may be too far off at a loose tolerance. Then points are dropped back to one from which Newton's method
    comes to the finer orbit, but no special point is.
    """
    point: Point
    problem, fewest = branch.problem, half.specials[-1].after + 1 if half.specials else 1
    if not problem.tighten():
        return None
    for count in range(len(half.points), fewest - 1, -1):
        piece, point = half.points[count - 1]
        if piece is not branch:
            break
        if point.frame is not None:
            problem.phase_plane = point.frame
        branch.depart(point)
        if point.examined.data.tolerance <= problem.tol:
            del half.points[count:]
            return point
    return last


def summed_late(problem: OrbitProblem, u: NDArray[np.float64]) -> bool:
    """Return whether impacts that accumulate could have been summed up two of them before: the last ones are rounding.

    problem, u: equations of the orbit; its unknowns, and the parameter.
    """
    system, signature, condition = problem.system, problem.signature, np.empty(1)
    sums = [i for i, k in enumerate(signature.transitions) if k >= 0 and system.transitions[k].sums]
    if not sums:
        return False
    if signature.is_cut:
        return summed_late(*whole(problem, u))
    problem.survey(u)
    for i in sums:
        k, before = signature.transitions[i], i - 2
        if before >= 0 and signature.modes[before] == signature.modes[before + 1] == signature.modes[i]:
            met = problem.state_on(before, 1.0)
            system.compiled.call("guard", len(system.modes) + k, 0, met, problem.extended, condition)
            if condition[0] > 0.0:
                return True
    return False


def sums_up(problem: OrbitProblem, name: Monitor) -> bool:
    """Return whether a condition is that under which impacts are summed up, with which no motion changes."""
    if name.kind != "condition":
        return False
    return problem.system.transitions[problem.signature.whole.transitions[name.segment]].sums


def turns_back(points: Sequence[tuple[OrbitZeroProblem, Point]], beyond: Point) -> bool:
    """Return whether the parameter goes back behind the last of some points: a non-smooth fold.

    Next to an AS the parameter comes to rest, and the order of the last points is rounding.
    """
    way = points[-1][1].parameter - np.array([point.parameter for _, point in points[-_LAST:-1]])
    if not way.size or not np.any(way):
        return False
    onward = float(way[np.abs(way) > RESTS_BEYOND * np.abs(way).max()][-1])
    return float(beyond.tangent[-1]) * onward < 0.0


def _way(point: Point, old: Point) -> float:
    """Return how far the parameter of a point is from that of another one."""
    return abs(point.parameter - old.parameter)


def beyond_changes(problem: OrbitProblem, point: Point) -> bool:
    """Return whether a point is admissible and all its monitor functions of grazings are on that side.

    A margin within the flow's error is on neither: a surface that is touched at the change as well may be passed.
    """
    transitions, ends = problem.system.transitions, problem.signature.whole.transitions
    grazings = []
    for name, value in point.examined.monitors.items():
        if not at_grazing(name) or math.isnan(value):
            continue
        if name.kind == "rebound":  # a motion may leave to either side
            continue
        # an event in both directions has no admissible side
        event = {"side": name.transition, "rate": ends[name.segment]}.get(name.kind)
        if name.kind == "margin" and value < math.inf:
            value -= followed(problem.tol) * problem.event_size(name.transition, point.u[: problem.n])
        grazings.append(value if event is None or transitions[event].direction else abs(value))
    admissible = point.examined.data.survey.admissible and all(value > 0.0 for value in grazings)
    return admissible and not _grazes_on(problem, point)


def _grazes_on(problem: OrbitProblem, point: Point) -> bool:
    """Return whether an orbit beyond a change meets an event without speed, within the error of its flow.

    Its equations then follow a motion that touches a surface all along, which no impact makes an orbit of its own.
    """
    period = float(np.abs(point.u[problem.n : problem.size : problem.n + 1]).sum())
    ends = [problem.signature.tails[name.segment] for name in point.examined.monitors if name.kind == "rate"]
    return any(
        speed_at(problem, problem.signature.transitions[i], problem.state_on(i, 1.0), period) <= followed(problem.tol)
        for i in ends
    )


def without_rounding(examined: Examined) -> Examined:
    """Return what is known of a point without the faults that are rounding where the signature changes."""
    data: OrbitData = examined.data
    survey = data.survey._replace(faults=data.survey.faults & ~ON_BORDER)
    return replace(examined, data=replace(data, survey=survey))


def as_before(examined: Examined, last: OrbitData) -> Examined:
    """Return the data of a cycle that is a point with the multipliers of the last one that is none."""
    data = replace(examined.data, multipliers=last.multipliers, unstable=last.unstable, known=None)
    return Examined(examined.monitors, examined.fault, data)
