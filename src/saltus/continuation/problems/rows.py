"""Rows of unknowns, one for each segment, as the signature that they make up."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, EVENT_END, PHASE_END, Signature
from saltus.scales import CONDITIONS_ALIKE

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Found", "Rows", "closed", "closes_round", "gathered", "joined"]

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
    old, following = problem.signature, (i + 1) % len(problem.signature)
    if following == i:
        return closed(problem, blocks, u, i)
    whole = blocks[i].copy()
    whole[problem.n] += blocks[following, problem.n]
    rows = list(zip(old.modes, old.transitions, blocks, strict=True))
    rows[i] = (old.modes[i], old.transitions[following], whole)
    del rows[following]
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
