"""Events of one instant: segments without length between events that do not depend on each other, and their orders."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple, Protocol

import numpy as np

from saltus.orbits.signature import DURATION, Signature
from saltus.scales import BRIEF, EPS, Verdict, same, zero

if TYPE_CHECKING:
    from collections.abc import Iterable, Iterator

    from numpy.typing import NDArray

    from saltus.orbits.signature import Survey
    from saltus.system import HybridSystem

__all__ = [
    "Order",
    "at_one_instant",
    "chains",
    "commute",
    "exchanged",
    "judged_together",
    "orders",
    "shortest_is_brief",
]

_MOST_ORDERS = 24  # orders of the events of an orbit that are looked at: all of four at one instant


class Equations(Protocol):
    """What is asked here of the equations of an orbit, which has been surveyed last: see `OrbitProblem`."""

    system: HybridSystem
    signature: Signature
    extended: NDArray[np.float64]
    state_scale: NDArray[np.float64]
    tol: float
    size: int
    segments: int
    n: int

    def state_on(self, segment: int, place: float) -> NDArray[np.float64]:
        """Return the full state at a place of a segment."""


class Order(NamedTuple):
    """One order of the events of one instant.

    Attributes
    ----------
    signature : Signature
        The orbit's signature with its events in this order.
    blocks : ndarray, shape (segments, n + 1)
        Its unknowns.
    """

    signature: Signature
    blocks: NDArray[np.float64]


def at_one_instant(problem: Equations, u: NDArray[np.float64]) -> list[int]:
    """Return the segments without length whose event happens at the same instant as the one before, whichever is first.

    The instants are the same if they differ by no more than the error of the later one: that of its event function,
    by the tolerance, over its rate. Both events have to be due before either has happened.
    """
    if problem.segments < 2 or not shortest_is_brief(problem, u) or not np.all(np.isfinite(u)):
        return []
    durations = u[problem.n : problem.size : problem.n + 1]
    short = np.abs(durations) <= BRIEF * np.abs(durations).sum()
    blocks = u[: problem.size].reshape(problem.segments, problem.n + 1)
    found = []
    for i in np.flatnonzero(short).tolist():
        k = problem.signature.transitions[i]
        if k < 0:
            continue
        _, rate, size = _height(problem, k, problem.signature.modes[i], blocks[i, :-1])
        error = _tolerance(problem) * size / abs(rate) if rate != 0.0 else math.inf
        if zero(durations[i], error) is not Verdict.NO and exchanged(problem, blocks, i) is not None:
            found.append(i)
    return found


def shortest_is_brief(problem: Equations, u: NDArray[np.float64]) -> bool:
    """Return whether a segment is so short that its events may happen at one instant: a first, cheap look."""
    durations = np.abs(u[problem.n : problem.size : problem.n + 1])
    return bool(durations.min() <= BRIEF * durations.sum())


def chains(members: Iterable[int], count: int) -> list[tuple[int, int]]:
    """Return (first, last) of segments whose ends happen at one instant; members: those of `count` without length."""
    own = set(members)
    firsts = sorted((i - 1) % count for i in own if (i - 1) % count not in own)
    found = []
    for first in firsts:
        last = first
        while (last + 1) % count in own and last + 1 < first + count:
            last += 1
        found.append((first, last))
    return found


def judged_together(problem: Equations, u: NDArray[np.float64], survey: Survey) -> Survey:
    """Return a survey in which events of one instant are one: none of them is early, and no duration is missing."""
    members = at_one_instant(problem, u)
    if not members:
        return survey
    count, ends, transitions = problem.segments, problem.signature.transitions, problem.system.transitions
    heads, tails = problem.signature.heads, problem.signature.tails
    for first, last in chains(members, count):
        events = {transitions[ends[j % count]].event for j in range(first, last + 1)}
        own = [k for k, transition in enumerate(transitions) if transition.event in events]
        for j in range(first, last + 1):
            survey.ahead[j % count, own] = math.nan
            survey.behind[tails[heads.index((j + 1) % count)], own] = math.nan
    survey.margins[members] = math.inf  # a segment without length has no inside
    durations, faults = u[problem.n : problem.size : problem.n + 1], survey.faults
    if np.all(np.delete(durations, members) > 0.0):
        faults &= ~DURATION
    return survey._replace(faults=faults, together=tuple(tails.index(i) for i in members))


def names_at_once(problem: Equations, survey: Survey) -> tuple[tuple[str, ...], ...]:
    """Return the names of the transitions of each instant at which an orbit has several."""
    names, ends = problem.system.transition_names, problem.signature.whole.transitions
    count = len(ends)
    found = chains(survey.together, count)
    return tuple(tuple(names[ends[j % count]] for j in range(first, last + 1)) for first, last in found)


def exchanged(
    problem: Equations,
    blocks: NDArray[np.float64],
    i: int,
    near: float | None = None,
    *,
    signature: Signature | None = None,
    before: NDArray[np.float64] | None = None,
) -> Order | None:
    """Return an orbit in which the events at the ends of segments `i - 1` and `i` are exchanged; None without one.

    There is one if the later event is due in the mode before, too, and the earlier one behind it. Both orders have to
    lead to the same mode and state.

    Parameters
    ----------
    near : float, optional
        Difference of states and event functions, over their sizes, that counts as none; by default the tolerance.
    signature : Signature, optional
        That of `blocks`, where it is not the problem's.
    before : ndarray, shape (n,), optional
        Full state at the end of segment `i - 1`; by default that of the last survey.
    """
    signature = problem.signature if signature is None else signature
    near = 10.0 * _tolerance(problem) if near is None else near
    count, modes, ends = len(signature), signature.modes, signature.transitions
    first, second = ends[i - 1], ends[i]
    transitions = problem.system.transitions
    if first < 0 or second < 0 or transitions[first].event == transitions[second].event:
        return None
    x = problem.state_on((i - 1) % problem.segments, 1.0) if before is None else before
    goal = _reset(problem, second, _reset(problem, first, x))
    for now in _due(problem, modes[i - 1], transitions[second].event, x, near):
        between, y = problem.system.mode_index(transitions[now].target), _reset(problem, now, x)
        for later in _due(problem, between, transitions[first].event, y, near):
            leads = problem.system.mode_index(transitions[later].target) == modes[(i + 1) % count]
            if leads and _alike(problem, goal, _reset(problem, later, y), near):
                return _other_order(problem, Order(signature, blocks), i, (now, later, between), y)
    return None


def _other_order(problem: Equations, old: Order, i: int, other: tuple[int, int, int], y: NDArray[np.float64]) -> Order:
    """Return an order with two events exchanged; other: the first and the second now, and the mode between."""
    (signature, blocks), n = old, problem.n
    now, later, between = other
    modes, ends, rows = list(signature.modes), list(signature.transitions), blocks.copy()
    ends[i - 1], ends[i], modes[i] = now, later, between
    span = rows[i, n]
    rows[i - 1, n] += span
    rows[i, n] = -span
    own = len(problem.system.states)
    rows[i, :own] = y[:own]
    return Order(Signature(tuple(modes), tuple(ends), signature.kinds, signature.turns), rows)


def orders(problem: Equations, u: NDArray[np.float64], members: list[int]) -> list[Order]:
    """Return the orbit with its events of one instant in each order, its own first; members: `at_one_instant`."""
    blocks = u[: problem.size].reshape(problem.segments, problem.n + 1)
    found = [Order(problem.signature, blocks)]
    seen = {problem.signature.transitions}
    for order in found:
        for other in _next_orders(problem, order, members):
            if other.signature.transitions not in seen and len(found) < _MOST_ORDERS:
                seen.add(other.signature.transitions)
                found.append(other)
    return found


def _next_orders(problem: Equations, order: Order, members: list[int]) -> Iterator[Order]:
    """Yield the orders in which two events of one instant that follow each other are exchanged."""
    for i in members:
        start = i
        while (start % problem.segments) in members:
            start -= 1
        x = problem.state_on(start % problem.segments, 1.0)
        for j in range(start, i - 1):
            x = _reset(problem, order.signature.transitions[j], x)
        other = exchanged(problem, order.blocks, i, signature=order.signature, before=x)
        if other is not None:
            yield other


def commute(problem: Equations, found: list[Order], first: int, last: int) -> bool:
    """Return whether the flow through the events at the ends of segments `first` to `last` has one derivative."""
    x, sizes = problem.state_on(first % problem.segments, 1.0), problem.state_scale
    matrices = [_through(problem, order.signature, first, last, x) * sizes / sizes[:, None] for order in found]
    size = max(float(np.abs(matrix).max()) for matrix in matrices)
    error = problem.n * _tolerance(problem) * size
    return all(same(matrix, matrices[0], error) is not Verdict.NO for matrix in matrices[1:])


def _through(
    problem: Equations, signature: Signature, first: int, last: int, x: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the product of the saltation matrices of segments' ends that happen at one instant, shape (n, n)."""
    n, compiled, product = problem.n, problem.system.compiled, np.eye(problem.n)
    p = problem.extended
    for j in range(first, last + 1):
        k, mode = signature.transitions[j], signature.modes[j]
        following = signature.modes[(j + 1) % len(signature)]
        event, moved, before, after = np.empty(2 + 2 * n), np.empty(n * n), np.empty(n), np.empty(n)
        x = np.ascontiguousarray(x)
        compiled.call("event_x", k, 0, x, p, event)
        compiled.call("reset_x", k, 0, x, p, moved)
        compiled.call("field", mode, 0, x, p, before)
        y = _reset(problem, k, x)
        compiled.call("field", following, 0, y, p, after)
        reset, gradient = moved.reshape(n, n), event[2 : 2 + n]
        product = (reset + np.outer(after - reset @ before, gradient) / float(gradient @ before)) @ product
        x = y
    return product


def _due(problem: Equations, mode: int, event: str, x: NDArray[np.float64], near: float) -> Iterator[int]:
    """Yield the transitions of a mode that watch an event function and are due in a full state."""
    guard = np.empty(1)
    for k, transition in enumerate(problem.system.transitions):
        if transition.source != problem.system.mode_names[mode] or transition.event != event:
            continue
        height, rate, size = _height(problem, k, mode, x)
        problem.system.compiled.call(
            "guard", len(problem.system.modes) + k, 0, np.ascontiguousarray(x), problem.extended, guard
        )
        if abs(height) <= near * size and rate * (transition.direction or rate) > 0.0 and guard[0] > 0.0:
            yield k


def _height(problem: Equations, k: int, mode: int, x: NDArray[np.float64]) -> tuple[float, float, float]:
    """Return an event function at a full state, its rate along the field, and its variation with the states' sizes."""
    n, compiled = problem.n, problem.system.compiled
    event, field, x = np.empty(2 + 2 * n), np.empty(n), np.ascontiguousarray(x)
    compiled.call("event_x", k, 0, x, problem.extended, event)
    compiled.call("field", mode, 0, x, problem.extended, field)
    gradient = event[2 : 2 + n]
    return float(event[0]), float(gradient @ field), float(np.abs(gradient) @ problem.state_scale)


def _reset(problem: Equations, k: int, x: NDArray[np.float64]) -> NDArray[np.float64]:
    after = np.empty(problem.n)
    problem.system.compiled.call("reset", k, 0, np.ascontiguousarray(x), problem.extended, after)
    return after


def _alike(problem: Equations, x: NDArray[np.float64], y: NDArray[np.float64], near: float) -> bool:
    """Return whether two full states are one; phases are not compared, which no reset moves."""
    own = len(problem.system.states)
    return bool(np.max(np.abs(x - y)[:own] / problem.state_scale[:own]) <= near)


def _tolerance(problem: Equations) -> float:
    return max(problem.tol, 64.0 * EPS)
