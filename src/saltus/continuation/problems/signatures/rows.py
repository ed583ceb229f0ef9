"""Rows of unknowns, one for each segment, as the signature that they make up; segments cut where they touch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.continuation.problems.ends.excursions import behind, moved
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, EVENT_END, PHASE_END, Signature
from saltus.scales import CONDITIONS_ALIKE

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Found", "Rows", "Touch", "closed", "closes_round", "gathered", "inserted", "joined", "without"]

# a signature, and the segments' states and durations, shape (segments, n + 1)
Found = tuple[Signature, "NDArray[np.float64]"]
# mode, transition, and state with duration of each segment
Rows = list[tuple[int, int, "NDArray[np.float64]"]]


def closed(problem: OrbitProblem, blocks: NDArray[np.float64], u: NDArray[np.float64], i: int) -> Found:
    """Return segment `i` alone, without events, started at phase 0 where the system has a phase."""
    old, n = problem.signature, problem.n
    closing = CLOSED_END if problem.system.phase is None else PHASE_END
    signature = Signature((old.modes[i],), (-1,), (closing,), old.turns)
    row = blocks[i].copy()
    if closing == PHASE_END:
        row[:n] = problem.survey(u).x0
    return signature, row[None, :]


def gathered(rows: Rows, turns: int) -> Found:
    """Return segments that end with events, each with its mode, its transition, its state and its duration."""
    modes, transitions, blocks = zip(*rows, strict=True)
    kinds = (EVENT_END,) * len(rows)
    return Signature(tuple(modes), tuple(transitions), kinds, turns), np.array(blocks)


def joined(problem: OrbitProblem, blocks: NDArray[np.float64], u: NDArray[np.float64], i: int) -> Found:
    """Return the signature in which segment `i` and the next one, which continues it, are one."""
    return without(problem, blocks, u, [i])


def without(problem: OrbitProblem, blocks: NDArray[np.float64], u: NDArray[np.float64], ends: Sequence[int]) -> Found:
    """Return the signature without the events at the ends of some segments, which the next ones continue."""
    old, n, count = problem.signature, problem.n, len(problem.signature)
    kept = [i for i in range(count) if i not in ends]
    if not kept:
        return closed(problem, blocks, u, ends[0])
    rows: Rows = []
    for before, end in zip((kept[-1] - count, *kept[:-1]), kept, strict=True):
        first = (before + 1) % count
        whole = blocks[first].copy()
        for i in range(before + 2, end + 1):
            whole[n] += blocks[i % count, n]
        if first > end and problem.system.phase is not None:  # it begins in the period before
            whole[n - 1] -= problem.system.turn * old.turns
        rows.append((old.modes[first], old.transitions[end], whole))
    return gathered(rows, old.turns)


def closes_round(problem: OrbitProblem, fresh: OrbitProblem, signature: Signature, u: NDArray[np.float64]) -> bool:
    """Return whether unknowns are those of an orbit in a signature: each state leads to the next one.

    A duration at a grazing is as exact as the root of the located point's error.

    Parameters
    ----------
    problem : OrbitProblem
        Equations of the signature that ends, whose sizes hold.
    fresh : OrbitProblem
        Equations of the neighbour, with which its signature was settled.
    signature : Signature
        The neighbour's.
    u : ndarray, shape (size,)
        The unknowns.
    """
    beside = OrbitProblem(fresh.system, signature, fresh.p, tol=fresh.tol)
    beside.start(u)
    count = len(fresh.system.states)
    gaps = beside.evaluate(u)[0].reshape(beside.segments, -1)[:, :count] / problem.state_scale[:count]
    return bool(np.max(np.abs(gaps)) < math.sqrt(CONDITIONS_ALIKE))


class Touch(NamedTuple):
    """Where a segment touches the surface of a transition.

    Attributes
    ----------
    segment : int
    place : float
        From 0 at the segment's start to 1 at its end.
    transition : int
    """

    segment: int
    place: float
    transition: int


def inserted(
    problem: OrbitProblem, blocks: NDArray[np.float64], u: NDArray[np.float64], touches: Sequence[Touch]
) -> Found | str:
    """Cut segments where they touch surfaces, or return why one of them cannot be cut."""
    old, n = problem.signature, problem.n
    rows: Rows = []
    for i, (mode, end) in enumerate(zip(old.modes, old.transitions, strict=True)):
        own = sorted(touch for touch in touches if touch.segment == i)
        pieces = _pieces(problem, blocks, u, own) if own else [(mode, end, blocks[i])]
        if isinstance(pieces, str):
            return pieces
        rows += pieces
    if old.kinds[0] not in (PHASE_END, CLOSED_END):
        return gathered(rows, old.turns)
    first, *others, (mode, _, last) = rows  # without an end of its own the orbit starts behind the last touch
    for _, _, block in others:
        block[n - 1] += problem.system.turn * old.turns
    last[n] = blocks[0, n] - sum(float(block[n]) for _, _, block in others)
    return gathered([(mode, first[1], last), *others], old.turns)


def _pieces(
    problem: OrbitProblem, blocks: NDArray[np.float64], u: NDArray[np.float64], touches: list[Touch]
) -> Rows | str:
    """Return the rows of one segment, cut at its touches in their order."""
    system, n, i = problem.system, problem.n, touches[0].segment
    mode, duration = problem.signature.modes[i], blocks[i, n]
    start, begun, rows = blocks[i, :n], 0.0, []
    for _, place, k in touches:
        met = duration * place * place * (3.0 - 2.0 * place)
        touching = problem.state_on(i, place)
        if not np.all(np.isfinite(touching)):
            return "the flow cannot be followed to it"
        landed = np.empty(n)
        system.compiled.call("reset", k, 0, touching, problem.extended, landed)
        rows.append((mode, k, np.append(start, met - begun)))
        if system.mode_index(system.transitions[k].target) != mode:
            away = behind(problem, u, mode, k, touching, landed)
            if isinstance(away, str):
                return away
            rows += [(source, transition, np.append(x, 0.0)) for source, transition, x in away]
            landed = touching
        elif moved(problem, mode, landed, touching):
            return "the reset moves the state there: no neighbouring signature is continuous"
        start, begun = landed, met
    return [*rows, (mode, problem.signature.transitions[i], np.append(start, duration - begun))]
