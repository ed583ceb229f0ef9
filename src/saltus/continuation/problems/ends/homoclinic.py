"""Homoclinic orbits at the end of a branch of cycles: located, and told from saddle-nodes on a circle.

docs/theory/continuation.md, "Homoclinic orbits", derives the method.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.problems.ends.connection import Homoclinic
from saltus.continuation.problems.ends.homoclinic_problem import (
    Arc,
    Saddle,
    at_rest,
    divided_up,
    extended,
    saddle_near,
    saddle_node_near,
    solved,
    tangent_spaces,
)
from saltus.continuation.problems.ends.sliding_homoclinic import landing_on, rest_in, slowest_segment
from saltus.continuation.problems.ends.unbounded import period_of
from saltus.equilibria import Equilibrium
from saltus.equilibria.spectrum import NEUTRAL
from saltus.orbits.cuts import whole
from saltus.orbits.signature import CLOSED_END, CUT_END
from saltus.scales import (
    ARC_AGREES,
    ARC_AGREES_AFAR,
    ARC_LOCATED,
    EXTREMES_OF_ARC,
    LEAVES,
    PASSES,
    PASSES_ANOTHER,
    PASSES_SLOWLY,
    SADDLE_NODE_POWER,
)
from saltus.system.angles import wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Point
    from saltus.continuation.problems.orbit import OrbitZeroProblem
    from saltus.equilibria.problem import EquilibriumProblem
    from saltus.orbits.problem import OrbitProblem

    Row = tuple[OrbitZeroProblem, Point]

__all__ = ["NONE_NEAR", "Located", "homoclinic_of", "located"]

NONE_NEAR = "no equilibrium is near the cycle"  # why no homoclinic orbit is located: the period need not be unbounded

_EVENTS = "its cycles have events"
_DISAGREES = "its parameter disagrees with the one extrapolated along the branch"

_FIRST = (4.0, 0.005, 0.2)  # first distance of the arc's ends: factor on the cycle's least one, least, largest
_NEAREST = 1e-6  # distance of the arc's ends from the saddle at last
_NEARER = 10.0  # factor by which the distance shrinks at a time
_PIECES = 8  # pieces into which the first arc is cut, before those that are too sensitive are cut again
_LATE = 2.0  # factor on the period over which the branch is extrapolated


@dataclass(frozen=True, eq=False)
class Located:
    """What a branch of cycles ends at."""

    type: str  # ``HOM`` or ``SNIC``
    end: Homoclinic  # its equilibrium
    error: float  # last change of the parameter while it was located
    arc: Arc | None = None  # the homoclinic orbit; None at a SNIC


@dataclass(frozen=True, eq=False)
class _Cycle:
    """The last cycle of a branch as a table: times, states, typical sizes, and the equilibria's equations."""

    problem: OrbitProblem
    rest: EquilibriumProblem
    parameter: float
    period: float
    times: NDArray[np.float64]
    states: NDArray[np.float64]
    sizes: NDArray[np.float64]

    def distances(self, state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return each state's distance from a given one, in typical sizes."""
        away = wrapped(self.states - state, self.rest.circles)
        return np.asarray(np.abs(away / self.sizes).max(axis=1))


def located(points: list[Row], low: float, high: float) -> Located | str:
    """Return the homoclinic orbit or the saddle-node on a circle at the end of a branch, or why none is located.

    Parameters
    ----------
    points : list of (OrbitZeroProblem, Point)
        Points of the branch in order; the period of the last grows without bound.
    low, high : float
        Bounds of the parameter, in the equations' unit.
    """
    problem = points[-1][0].problem
    if problem.signature.kinds[0] != CLOSED_END or set(problem.signature.kinds[1:]) - {CUT_END}:
        return _with_events(points, low, high)
    cycle = _table(*points[-1])
    places = _slow_places(cycle)
    if not places:
        return _saddle_node(points, cycle, low, high)
    if len(places) > 1:
        return f"the cycle passes near {len(places)} equilibria, as next to a heteroclinic cycle"
    if _passages(cycle.distances(places[0])) > 1:
        return "the cycle passes its equilibrium several times in a period"
    found = _arc(cycle, places[0])
    if isinstance(found, str):
        return found
    arc, error = found
    if not low <= arc.parameter <= high:
        return "it lies outside the parameter's bounds"
    if not _looks_like(cycle, arc):
        return "the arc found is another one"
    values = arc.saddle.values
    if not _agrees(points, arc.parameter, complex(values[np.argmin(np.abs(values.real))])):
        return _DISAGREES
    return Located("HOM", homoclinic_of(cycle.rest, arc.saddle.state, arc.parameter, arc.sizes), error, arc)


def _with_events(points: list[Row], low: float, high: float) -> Located | str:
    """Return what `located` does at the end of a branch of cycles with events.

    The equilibrium is one of the mode in which the cycle stays longest.
    """
    piece, point = points[-1]
    if piece.problem.system.phase is not None:
        return _EVENTS
    problem, u = whole(piece.problem, point.u)
    cycle, segment = _table(piece, point), slowest_segment(problem, u)
    found = landing_on(problem, u, segment, cycle.sizes)
    if isinstance(found, str):
        node = _saddle_node(points, _staying(cycle, problem, u, segment), low, high)
        return _EVENTS if isinstance(node, str) else node
    state, value, saddle, error = found
    if not low <= value <= high:
        return "it lies outside the parameter's bounds"
    unstable = saddle.values[saddle.values.real > 0.0]
    if not _agrees(points, value, complex(unstable[np.argmin(unstable.real)])):
        return _DISAGREES
    return Located("HOM", homoclinic_of(rest_in(problem, segment), state, value, cycle.sizes), error)


def _staying(cycle: _Cycle, problem: OrbitProblem, u: NDArray[np.float64], segment: int) -> _Cycle:
    """Return a cycle's table with the states of one segment, and the equilibria's equations in its mode."""
    problem.survey(u)
    _, starts, nodes, _ = problem.dense()
    return replace(cycle, rest=rest_in(problem, segment), states=nodes[starts[segment] : starts[segment + 1]])


def homoclinic_of(
    rest: EquilibriumProblem, state: NDArray[np.float64], value: float, sizes: NDArray[np.float64]
) -> Homoclinic:
    """Return the result's data of an equilibrium."""
    return Homoclinic(Equilibrium.from_unknowns(rest, np.append(state, value), sizes))


def _table(piece: OrbitZeroProblem, point: Point) -> _Cycle:
    problem, u = piece.problem, point.u
    survey, n = problem.survey(u), problem.n
    places, starts, nodes, _ = problem.dense()
    durations = u[n : problem.size : n + 1]
    times, states, begun = [], [], 0.0
    for i, duration in enumerate(durations.tolist()):
        s, part = places[starts[i] : starts[i + 1]], nodes[starts[i] : starts[i + 1]]
        times.append(begun + duration * (s * s * (3.0 - 2.0 * s))[:-1])
        states.append(part[:-1])
        begun += duration
    span = survey.highs[:n] - survey.lows[:n]
    sizes = np.where(span > NEUTRAL * problem.state_scale, 0.5 * span, problem.state_scale)
    rest = at_rest(problem)
    return _Cycle(problem, rest, point.parameter, begun, np.concatenate(times), np.vstack(states), sizes)


def _slow_places(cycle: _Cycle) -> list[NDArray[np.float64]]:
    """Return the equilibria that a cycle passes near, the nearest first."""
    rates = np.array([cycle.rest.evaluate(np.append(x, cycle.parameter))[0] for x in cycle.states])
    speed = np.linalg.norm(rates / cycle.sizes, axis=1)
    steps = np.linalg.norm(np.diff(np.vstack([cycle.states, cycle.states[:1]]), axis=0) / cycle.sizes, axis=1)
    slow = speed < PASSES_SLOWLY * steps.sum() / cycle.period
    least = slow & (speed <= np.roll(speed, 1)) & (speed <= np.roll(speed, -1))
    found: list[tuple[float, NDArray[np.float64]]] = []
    for i in np.flatnonzero(least):
        state = saddle_near(cycle.rest, cycle.states[i], cycle.parameter, cycle.sizes)
        if state is None or any(
            np.abs(wrapped(state - other, cycle.rest.circles) / cycle.sizes).max() < NEUTRAL**0.5 for _, other in found
        ):
            continue
        found.append((float(cycle.distances(state).min()), state))
    found.sort(key=lambda item: item[0])
    return [state for k, (away, state) in enumerate(found) if away < (PASSES_ANOTHER if k else PASSES)]


def _passages(distances: NDArray[np.float64]) -> int:
    """Return how often a cycle comes near an equilibrium and goes away from it in a period."""
    first = int(np.argmax(distances))
    near, count = False, 0
    for distance in np.roll(distances, -first).tolist():
        if near and distance > LEAVES:
            near = False
        elif not near and distance < PASSES_ANOTHER:
            near, count = True, count + 1
    return max(count, 1)


def _arc(cycle: _Cycle, state: NDArray[np.float64]) -> tuple[Arc, float] | str:
    """Return the homoclinic orbit and the last change of its parameter, or why there is none."""
    A = cycle.rest.evaluate(np.append(state, cycle.parameter))[1][:, : cycle.rest.n]
    saddle = tangent_spaces(A, state, cycle.sizes)
    if isinstance(saddle, str):
        return saddle
    first = _first_arc(cycle, saddle)
    if isinstance(first, str):
        return first
    guess, stay = first
    radius, arc = guess.radius, guess
    made = extended(guess, radius)
    for time in (stay, 2.0 * stay, math.inf):
        if isinstance(made, str):
            return made
        found = solved(*made, arc.saddle.state, radius, cycle.sizes, time)
        if isinstance(found, str):
            return found
        arc, made = found, (found.problem, found.u)
    error = math.inf
    while arc.radius > _NEAREST * _NEARER**0.5:
        made = extended(arc, arc.radius / _NEARER)
        found = made if isinstance(made, str) else solved(*made, arc.saddle.state, arc.radius / _NEARER, cycle.sizes)
        if isinstance(found, str):
            break
        error, arc = abs(found.parameter - arc.parameter), found
    if not error <= ARC_LOCATED * max(1.0, abs(arc.parameter)):
        return "its parameter does not converge"
    return arc, error


def _first_arc(cycle: _Cycle, saddle: Saddle) -> tuple[Arc, float] | str:
    """Return a cycle without its stay at a saddle, as a guess of the arc, and the time of the stay."""
    away = wrapped(cycle.states - saddle.state, cycle.rest.circles)
    out, into = (np.linalg.norm(away @ W.T, axis=1) for W in saddle.coordinates)
    nearest, count = int(np.argmin(out + into)), len(out)
    factor, least, most = _FIRST
    radius = max(factor * float((out + into)[nearest]), least)
    if radius > most:
        return "the cycle does not come near enough to its equilibrium"
    ahead = next((k for k in range(count) if out[(nearest + k) % count] >= radius), count)
    back = next((k for k in range(count) if into[(nearest - k) % count] >= radius), count)
    inner = count - ahead - back
    if inner < _PIECES:
        return "the cycle does not leave its equilibrium"
    picked = np.unique(np.linspace(0, inner, _PIECES + 1).round().astype(int))
    order = (nearest + ahead + picked) % count
    times = cycle.times[order]
    durations = np.diff(times) % cycle.period
    blocks = np.column_stack([cycle.states[order[:-1]], durations])
    turned = cycle.rest.circles  # the arc begins whole turns away from the cycle's table, next to its saddle
    blocks[0, turned] = saddle.state[turned] + away[order[0], turned]
    u = np.append(blocks.ravel(), cycle.parameter)
    made = divided_up(cycle.problem, u)
    if isinstance(made, str):
        return made
    leaves, comes = saddle.coordinates[0] @ away[order[0]], saddle.coordinates[1] @ away[order[-1]]
    guess = Arc(*made, saddle, radius, cycle.sizes, leaves, comes)
    stay = cycle.period - float(durations.sum()) - saddle.time_to(0, leaves, radius) - saddle.time_to(1, comes, radius)
    return guess, max(stay, 1e-3 * cycle.period)


def _looks_like(cycle: _Cycle, arc: Arc) -> bool:
    """Return whether an arc reaches as far as the cycle next to it."""
    survey, n = arc.problem.survey(arc.u), arc.problem.n
    lows, highs = cycle.states.min(axis=0), cycle.states.max(axis=0)
    apart = np.maximum(np.abs(survey.lows[:n] - lows), np.abs(survey.highs[:n] - highs))
    apart[cycle.rest.circles] = 0.0  # the pieces of an arc may lie whole turns apart
    return bool(np.max(apart / cycle.sizes) < EXTREMES_OF_ARC)


def _agrees(points: list[Row], value: float, slowest: complex) -> bool:
    """Return whether a parameter agrees with that of the branch: it tends there like exp(-rate T), or spirals in.

    slowest: the eigenvalue that tells the rate.
    """
    periods = np.array([period_of(piece, point) for piece, point in points])
    values = np.array([point.parameter for _, point in points])
    late = periods * _LATE > periods[-1]
    periods, values = periods[late] - periods[-1], values[late]
    rate, turn = abs(slowest.real), abs(slowest.imag)
    waves = [np.cos(turn * periods), np.sin(turn * periods)] if turn > 0.0 else [np.ones_like(periods)]
    decay = np.exp(-rate * periods)
    if len(values) <= len(waves):
        return False
    basis = np.column_stack([np.ones_like(periods), *(decay * wave for wave in waves)])
    weights = 1.0 / (decay * decay)  # further terms of the expansion are of that size
    limit = float(np.linalg.lstsq(basis * weights[:, None], values * weights, rcond=None)[0][0])
    allowed = ARC_AGREES * max(1.0, abs(value)) + ARC_AGREES_AFAR * abs(value - float(values[-1]))
    return abs(limit - value) <= allowed


def _saddle_node(points: list[Row], cycle: _Cycle, low: float, high: float) -> Located | str:
    """Return the saddle-node on a circle that a branch tends to, or why there is none.

    The period grows like the inverse root of the parameter's distance from the saddle-node.
    """
    rates = np.array([cycle.rest.evaluate(np.append(x, cycle.parameter))[0] for x in cycle.states])
    slowest = cycle.states[int(np.argmin(np.linalg.norm(rates / cycle.sizes, axis=1)))]
    fold = saddle_node_near(cycle.rest, slowest, cycle.parameter, cycle.sizes)
    if fold is None or not float(cycle.distances(fold[:-1]).min()) < PASSES or not low <= fold[-1] <= high:
        return NONE_NEAR
    periods = np.array([period_of(piece, point) for piece, point in points])
    away = np.abs(np.array([point.parameter for _, point in points]) - fold[-1])
    late = periods * _LATE > periods[-1]
    late[-3:] = True  # the period may more than double in a step
    if np.count_nonzero(late) < 3 or not np.all(np.diff(away[late]) < 0.0) or not away[-1] > 0.0:
        return "the branch does not tend to the saddle-node near the cycle"
    slope = float(np.polyfit(np.log(away[late]), np.log(periods[late]), 1)[0])
    if abs(slope + 0.5) > SADDLE_NODE_POWER:
        return f"its period grows like the power {slope:.2g} of the distance from a saddle-node, not -0.5"
    end = homoclinic_of(cycle.rest, fold[:-1], float(fold[-1]), cycle.sizes)
    return Located("SNIC", end, float(away[-1]))
