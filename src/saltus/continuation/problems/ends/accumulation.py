"""The orbit whose hits accumulate just where the surface lets it go, located from an orbit near it.

docs/theory/chatter.md, "Where motions stop resting", derives the equations.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.problems.ends.release import Accumulation, accumulation
from saltus.orbits.common_sizes import newton_step
from saltus.orbits.cuts import whole
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.regular_ends import settle_signature
from saltus.orbits.signature import EVENT_END, WHEN, Signature
from saltus.scales import ACCUMULATION_SETTLED, EPS, FOLLOWED_GROWTH, HOP_ROUNDING, NEWTON_CONVERGED

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Accumulated", "Accumulating", "accumulated_near", "hits_of"]

_NONE = np.empty(0)
_PARTS = 24  # steps of a hop that is followed for a guess, and of Newton's method, at most

Row = tuple[int, int, "NDArray[np.float64]"]  # mode, transition, and state and duration of a segment


@dataclass(frozen=True, eq=False)
class Accumulated:
    """An orbit at the accumulation, in the form of those that rest."""

    problem: OrbitProblem  # of a system in which motions rest; one parameter or two are active
    u: NDArray[np.float64]  # shape (size + active,)
    known: Accumulation  # the condition
    impact: int  # the transition of the hits, in the system of the orbits nearby
    hits: int  # how many in a row are followed one by one
    value: float  # what is left of the condition
    first: int  # the segment of the flight behind the rest

    @property
    def stops(self) -> int:
        """The segment behind the last hit that is followed, at whose start the condition holds."""
        return (self.first - 2) % self.problem.segments

    def among_flights(self) -> tuple[Signature, NDArray[np.float64]]:
        """Return signature and unknowns in the form of orbits that do not rest.

        The flight behind the last hit that is followed goes on to that behind the rest. The infinitely many hops
        between are left out: what is left of the equations is the square of their time.
        """
        n, count, system = self.problem.n, self.problem.segments, self.problem.system
        blocks, form = self.u[: self.problem.size].reshape(count, n + 1).copy(), self.problem.signature
        if system.phase is not None:
            blocks[: self.first, n - 1] += system.turn * form.turns
        order = [(self.first + i) % count for i in range(count)]
        flights, stops = order[:-2], self.stops
        start, rested = blocks[stops].copy(), float(blocks[order[-2:], n].sum())
        if system.phase is not None:
            start[n - 1] -= system.turn * form.turns
        start[n] = rested + blocks[flights[0], n]
        rows = np.array([start, *blocks[flights[1:]]])
        ends = [form.transitions[i] for i in flights[:-1]]
        signature = Signature(
            tuple(form.modes[i] for i in flights), (*ends, self.impact), (EVENT_END,) * len(flights), form.turns
        )
        problem = OrbitProblem(system, signature, self.problem.parameters_at(self.u), tol=self.problem.tol)
        problem.state_scale = self.problem.state_scale.copy()  # the orbit is the same
        u = rows.ravel()
        if problem.start(u) is None:  # the flight meets its event: its push stands for the hops that are left out
            F, J = problem.evaluate(u)
            way = self.known.way(u[:n], problem.p)
            u[:n] -= way * float(F[n] / (J[n, :n] @ way))
        signature, u = settle_signature(problem, u)
        return signature, np.append(u, self.u[self.problem.size :])


class Accumulating:
    """The hits accumulate just where the surface lets go: a `Condition` of orbits that rest.

    Parameters
    ----------
    problem : OrbitProblem
        The equations.
    known : Accumulation
        What vanishes.
    at : int
        The segment behind the last hit that is followed.
    """

    extra, rows = 0, 1

    def __init__(self, problem: OrbitProblem, known: Accumulation, at: int) -> None:
        self.problem, self.known = problem, known
        self.place = slice(at * (problem.n + 1), at * (problem.n + 1) + problem.n)

    def evaluate(
        self, u: NDArray[np.float64], extra: NDArray[np.float64], J: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the scalar and its gradient."""
        problem, n = self.problem, self.problem.n
        x, p = u[self.place], problem.parameters_at(u)
        slopes, gradient = self.known.slopes(x, p), np.zeros(u.size)
        gradient[self.place] = slopes[:n]
        gradient[problem.size :] = slopes[n + np.asarray(problem.active)] * problem.scales
        return self.known.values(x, p)[:1], gradient[None, :], np.empty((1, 0))

    def adjust(self) -> None:
        """Do nothing: there are no borders."""


def hits_of(problem: OrbitProblem) -> dict[int, list[int]]:
    """Return the segments between two hits of one transition back into its mode, for each such transition.

    problem: of segments in one piece each. Behind the last hit that is followed, others may be summed up.
    """
    transitions, ends = problem.system.transitions, problem.signature.transitions
    found: dict[int, list[int]] = {}
    for i, k in enumerate(ends):
        before = ends[i - 1]
        if k < 0 or before < 0 or len(ends) < 2:
            continue
        own, last = transitions[before], transitions[k]
        plain = own.source == own.target and bool(own.reset) and not own.sums
        if plain and (k == before or (last.sums and (last.source, last.event) == (own.source, own.event))):
            found.setdefault(before, []).append(i)
    return found


def accumulated_near(
    problem: OrbitProblem, u: NDArray[np.float64], own: Accumulation | None = None
) -> Accumulated | None:
    """Return the orbit at an accumulation near the orbit `u`, of one active parameter; None where none is found.

    own: the condition of the hits that are looked at, if it is known.
    """
    problem, u = whole(problem, u)
    blocks = u[: problem.size].reshape(problem.segments, problem.n + 1)
    for impact, hops in hits_of(problem).items():
        if own is not None and own.impact != impact:
            continue
        if (known := own or accumulation(problem.system, impact)) is None:
            continue
        shortest = min(hops, key=lambda i: float(blocks[i, -1]))
        for rows in _guesses(problem, u, known, impact, shortest):
            if (found := _followed(problem, known, rows, float(u[-1]))) is not None:
                return Accumulated(found[0], found[1], known, impact, *found[2:])
    return None


def _guesses(
    problem: OrbitProblem, u: NDArray[np.float64], known: Accumulation, impact: int, shortest: int
) -> list[list[Row]]:
    """Return guesses of the orbit, as segments that begin with the flight behind the rest and end with the rest.

    shortest: the shortest hop of the orbit `u`. Behind one of the hits before it the motion is taken to rest.
    """
    n, signature = problem.n, problem.signature
    ends, count = signature.transitions, problem.segments
    shift = np.zeros(n + 1)
    if problem.system.phase is not None:
        shift[n - 1] = problem.system.turn * signature.turns
    blocks = u[: problem.size].reshape(count, n + 1)
    rests = [i for i in range(count) if signature.modes[i - 1] in known.rests and signature.modes[i] not in known.rests]
    # the first segment of the flight behind the rest, or behind the hits
    first = rests[0] if rests else (shortest + 1) % count
    order = [(first + i) % count for i in range(count)]
    states = [blocks[i] + (shift if i < first else 0.0) for i in order]
    p = problem.parameters_at(u)
    sums = [k for k, t in enumerate(problem.system.transitions) if t.sums and t.event == known.event]
    hits = [i for i, k in enumerate(order) if ends[k] == impact or ends[k] in sums]
    behind = [(i, (states[(i + 1) % count] + (shift if i + 1 == count else 0.0))[:n]) for i in hits]
    measured = [(i, x, known.values(x, p)) for i, x in behind]
    near = [item for item in measured if np.isfinite(item[2]).all() and item[2][1] > 0.0 and item[2][2] > 0.0]
    near = sorted(near, key=lambda item: abs(float(item[2][0])))
    return [_rows(problem, known, (order, states), i, x, p) for i, x, _ in near[: problem.n]]


def _rows(
    problem: OrbitProblem, known: Accumulation, along: tuple[Sequence[int], Sequence[NDArray[np.float64]]], last: int,
    x: NDArray[np.float64], p: NDArray[np.float64],
) -> list[Row]:  # fmt: skip
    """Return the segments of an orbit up to a hit, behind which it rests in the state `x` up to its release."""
    (order, states), n, signature = along, problem.n, problem.signature
    rows: list[Row] = [
        (signature.modes[k], signature.transitions[k], state.copy())
        for k, state in zip(order[: last + 1], states[: last + 1], strict=True)
    ]
    mode, _, block = rows[-1]
    rows[-1] = (mode, known.last, block)
    resting = _resting(known, x, p)
    mode, _, block = resting[-1]
    release = _along(known, mode, block[:n], float(block[-1]), p)
    start = rows[0][2]
    if problem.system.phase is not None:
        turn = problem.system.turn * signature.turns
        release[-1] -= turn
        rate = float(known.system.compiled.field(rows[0][0], release, p)[-1])
        start[n] += (start[n - 1] - release[-1]) / rate
    start[:n] = release
    return [*rows, *resting]


def _resting(known: Accumulation, x: NDArray[np.float64], p: NDArray[np.float64]) -> list[Row]:
    """Return the segments behind the last hit that is followed: the velocity dies away, and the motion rests."""
    system = known.system
    _, left, rate, growth, _ = known.values(x, p).tolist()
    stops, rest = system.mode_index(system.transitions[known.last].target), system.mode_index(known.rest)
    ends = [
        next(k for k, t in enumerate(system.transitions) if t.source == system.mode_names[m]) for m in (stops, rest)
    ]
    time = left * (1.0 - math.sqrt(max(1.0 - 2.0 * rate / (growth * left**2), 0.25)))
    still = _along(known, stops, x, time, p)
    return [(stops, ends[0], np.append(x, time)), (rest, ends[1], np.append(still, left - time))]


def _along(
    known: Accumulation, mode: int, x: NDArray[np.float64], time: float, p: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the state some time later in a mode, by Runge-Kutta steps: so many are right for hops of any size."""
    field, step = known.system.compiled.field, time / _PARTS
    x = x.copy()
    for _ in range(_PARTS):
        a = field(mode, x, p)
        b = field(mode, x + 0.5 * step * a, p)
        c = field(mode, x + 0.5 * step * b, p)
        d = field(mode, x + step * c, p)
        x = x + step * (a + 2.0 * b + 2.0 * c + d) / 6.0
    return x


def _followed(
    near: OrbitProblem, known: Accumulation, rows: list[Row], parameter: float
) -> tuple[OrbitProblem, NDArray[np.float64], int, float, int] | None:
    """Return what `Accumulated` has of an orbit, without the impact, with as many hits as its place asks for."""
    found, before, most = None, math.inf, math.inf
    while len(rows) < most:
        solved = _solved(near, known, rows, parameter)
        if solved is None:
            return None if found is None else found
        problem, u, rows, first = solved
        place = len(rows) - 3
        behind = rows[place + 1][2][: problem.n]
        p = problem.parameters_at(u)
        value, left, _, growth, ratio = known.values(behind, p).tolist()
        most = min(most, len(rows) + math.log(EPS) / math.log(ratio))  # the time left is rounding of the first one then
        found = problem, u, place + 1, float(value), first
        moved, before, parameter = abs(float(u[-1]) - before), float(u[-1]), float(u[-1])
        if moved <= ACCUMULATION_SETTLED * max(abs(parameter), 1.0):
            return found
        size = problem.event_size(known.last, behind)
        if EPS * size > HOP_ROUNDING * growth * left**3 * ratio:
            return found
        rows = _further(problem, known, rows, p, max(1, int(math.log(FOLLOWED_GROWTH) / math.log(_repels(ratio)))))
    return found


def _repels(ratio: float) -> float:
    """Return the factor by which a motion beside the accumulation leaves it from hit to hit."""
    return (2.0 + ratio) ** 2 / (ratio * (1.0 + 2.0 * ratio) ** 2)


def _further(
    problem: OrbitProblem, known: Accumulation, rows: list[Row], p: NDArray[np.float64], count: int
) -> list[Row]:
    """Return an orbit's segments with some more hits followed one by one."""
    n, extended = problem.n, problem.extended
    flying = rows[-3][0]
    head, x = [*rows[:-3], (flying, known.impact, rows[-3][2])], rows[-2][2][:n]
    for _ in range(count):
        _, left, _, _, ratio = known.values(x, p).tolist()
        time = left * (1.0 - ratio)
        met, after = _along(known, flying, x, time, p), np.empty(n)
        known.system.compiled.call("reset", known.last, 0, met, extended, after)
        if not known.values(after, p)[1] > 0.0:
            break
        head.append((flying, known.impact, np.append(x, time)))
        x = after
    mode, _, block = head[-1]
    head[-1] = (mode, known.last, block)
    return [*head, *_resting(known, x, p)]


def _solved(
    near: OrbitProblem, known: Accumulation, rows: list[Row], parameter: float
) -> tuple[OrbitProblem, NDArray[np.float64], list[Row], int] | None:
    """Return equations, unknowns, segments, and the first one's place, of the orbit at the condition; or None."""
    modes, ends = tuple(row[0] for row in rows), tuple(row[1] for row in rows)
    form = Signature(modes, ends, (EVENT_END,) * len(rows), near.signature.turns)
    p = near.parameters_at(np.append(np.zeros(near.size), parameter))
    problem = OrbitProblem(known.system, form, p, near.active, near.scales, near.tol)
    u = np.append(np.concatenate([row[2] for row in rows]), parameter)
    if problem.start(u) is not None:
        return None
    form, blocks = settle_signature(problem, u[: problem.size])
    at = next(
        i for i in range(len(rows)) if np.allclose(rows[i][2][: near.n - 1], blocks[: near.n - 1], rtol=0, atol=0)
    )
    problem = OrbitProblem(known.system, form, p, near.active, near.scales, near.tol)
    u = np.append(blocks, parameter)
    last = (len(rows) - 2 - at) % len(rows)  # the segment behind the last hit, on which the condition is
    if not _newton(problem, known, u, last):
        return None
    own = u[: problem.size].reshape(problem.segments, -1)
    shift = near.system.turn * form.turns if near.system.phase is not None else 0.0
    turned = []
    for i in range(len(rows)):
        j = (i - at) % len(rows)
        block = own[j].copy()
        if near.system.phase is not None and i < at:
            block[near.n - 1] -= shift
        turned.append((modes[i], ends[i], block))
    return problem, u, turned, (-at) % len(rows)


def _newton(problem: OrbitProblem, known: Accumulation, u: NDArray[np.float64], at: int) -> bool:
    """Solve the orbit's equations with the condition behind the last hit, whose segment is `at`; `u` is written."""
    n, condition = problem.n, Accumulating(problem, known, at)
    if problem.start(u) is not None:
        return False
    for _ in range(_PARTS):
        F, J = problem.evaluate(u)
        value, row, _ = condition.evaluate(u, _NONE, J)
        matrix, left = np.vstack([J, row]), np.append(F, value)
        if not (np.isfinite(matrix).all() and np.isfinite(left).all()):
            return False
        period = float(np.abs(u[n : problem.size : n + 1]).sum())
        sizes = np.append(np.tile(np.append(problem.state_scale, period), problem.segments), 1.0)
        try:
            step = newton_step(matrix, -left, sizes)
        except np.linalg.LinAlgError:
            return False
        u += step
        length = float(np.max(np.abs(step) / sizes))
        if not math.isfinite(length) or length > 1e3:
            return False
        if length < NEWTON_CONVERGED and problem.refine():
            durations = u[n : problem.size : n + 1]
            survey = problem.survey(u)
            return bool(np.all(durations > 0.0)) and not survey.faults & ~WHEN
        if length > 1e-3:
            problem.start(u)
    return False
