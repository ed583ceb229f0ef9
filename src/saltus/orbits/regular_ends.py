"""Ends of an orbit's segments that keep its equations regular: docs/theory/orbits.md."""

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, EVENT_END, MEAN_END, PHASE_END, Signature
from saltus.scales import MET_AT_END, PARALLEL_GRADIENTS

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["settle_signature"]


def settle_signature(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[Signature, NDArray[np.float64]]:
    """Return signature and unknowns, the longest segment first, with mean-rate ends where one starts on its event.

    A segment that starts on the surface on which it ends has the trivial solution of zero length. That would make the
    equations singular at a grazing (docs/theory/orbits.md). The longest segment keeps its event as its end.
    """
    signature, n = problem.signature, problem.n
    blocks = u[: problem.size].reshape(problem.segments, n + 1).copy()
    if signature.is_cut or signature.kinds[0] in (PHASE_END, CLOSED_END):
        return signature, u
    first = int(
        np.argmax(blocks[:, n] >= (1.0 - 1e-6) * blocks[:, n].max())
    )  # ties go to the first, whatever the rounding
    if problem.system.phase is not None:
        blocks[:first, n - 1] += problem.system.turn * signature.turns
    blocks = np.roll(blocks, -first, axis=0)
    if problem.system.phase is not None:
        turn = problem.system.turn
        blocks[:, n - 1] -= turn * math.floor(blocks[0, n - 1] / turn + 1e-12)
    modes = np.roll(signature.modes, -first)
    transitions = np.roll(signature.transitions, -first)
    kinds = [EVENT_END]

    @cache
    def followed() -> OrbitProblem | None:
        """Return the equations, surveyed, on the meshes with which they were solved; None without a flow to follow."""
        apart = problem
        if not problem.meshed:
            apart = OrbitProblem(problem.system, signature, problem.parameters_at(u), tol=problem.tol)
            if apart.start(u) is not None:
                return None
        apart.survey(u)
        return apart

    for i, block in enumerate(blocks[1:]):
        segment = (first + i) % problem.segments
        laid = not _at_once(problem, segment, block) and _laid_on(
            problem, followed, segment, np.ascontiguousarray(block[:n])
        )
        kinds.append(MEAN_END if laid else EVENT_END)
    chosen = Signature(tuple(modes.tolist()), tuple(transitions.tolist()), tuple(kinds), signature.turns)
    return chosen, blocks.ravel()


def _at_once(problem: OrbitProblem, segment: int, block: NDArray[np.float64]) -> bool:
    """Return whether a segment's event follows at once upon the one before: zero length is its end, and a regular one.

    The motion goes through the surface there with a clear rate, whose sign stays. Both events are due in one mode: a
    segment without length in another mode is a border.
    """
    if problem.signature.modes[segment - 1] != problem.signature.modes[segment]:
        return False
    n, compiled, p = problem.n, problem.system.compiled, problem.extended
    x, duration = np.ascontiguousarray(block[:n]), float(block[n])
    own, seen, moved = int(problem.signature.transitions[segment]), np.empty(2 + 2 * n), np.empty(n)
    compiled.call("field", int(problem.signature.modes[segment]), 0, x, p, moved)
    rates = []
    for state in (x, x + duration * moved):
        compiled.call("event_x", own, 0, state, p, seen)
        reach, speed = (float(np.abs(part) @ problem.state_scale) for part in (seen[2 : 2 + n], seen[2 + n :]))
        if not (
            abs(seen[0]) <= MET_AT_END * reach
            and abs(duration * seen[1]) <= MET_AT_END * reach
            and abs(seen[1]) > MET_AT_END * speed
        ):
            return False
        rates.append(float(seen[1]))
    return rates[0] * rates[1] > 0.0


def _laid_on(
    problem: OrbitProblem, followed: Callable[[], OrbitProblem | None], segment: int, x: NDArray[np.float64]
) -> bool:
    """Return whether a segment's transition lays a motion, which goes on from x, on the surface of its next event.

    A motion that leaves a sliding mode is on the surface of its next event, but not since the sliding mode's end says
    so: that is a condition on the velocity. Slopes of the transition are those where the segment ends.
    """
    before, own = (int(problem.signature.transitions[(segment + k) % problem.segments]) for k in (0, 1))
    n, compiled = problem.n, problem.system.compiled
    height, last, moved = np.empty(2 + 2 * n), np.empty(2 + 2 * n), np.empty(n * n)
    compiled.call("event_x", own, 0, x, problem.extended, height)
    slope = height[2 : 2 + n] * problem.state_scale
    size = float(np.linalg.norm(slope))
    if not abs(height[0]) < MET_AT_END * float(np.abs(slope).sum()):
        return False
    apart = followed()
    if apart is None:  # no flow that Newton's method could go on from either
        return False
    arrived = apart.state_on(segment, 1.0)
    compiled.call("event_x", before, 0, arrived, problem.extended, last)
    compiled.call("reset_x", before, 0, arrived, problem.extended, moved)
    through = (moved.reshape(n, n).T @ height[2 : 2 + n]) * problem.state_scale
    other = last[2 : 2 + n] * problem.state_scale
    reach = float(np.linalg.norm(through))
    if reach < PARALLEL_GRADIENTS * size:  # the reset alone lays motions on the surface
        return True
    return abs(float(through @ other)) > (1.0 - PARALLEL_GRADIENTS) * reach * float(np.linalg.norm(other))
