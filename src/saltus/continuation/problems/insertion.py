"""Segments of an orbit cut where they touch surfaces: one touch, or all those of one orbit at once."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.continuation.problems.ends.excursions import behind, moved
from saltus.continuation.problems.rows import Found, Rows, gathered
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, PHASE_END

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Touch", "inserted"]


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
    problem: OrbitProblem, blocks: NDArray[np.float64], u: NDArray[np.float64], touches: Iterable[Touch]
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
        block[n - 1] += 2.0 * math.pi * old.turns
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
