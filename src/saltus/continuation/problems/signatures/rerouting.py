"""Another transition at the end of a segment whose condition runs out, or that meets a further event there."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.problems.ends.excursions import moved
from saltus.continuation.problems.margins import holds_at, run_out, same_phase
from saltus.continuation.problems.signatures.rows import Found, Rows, gathered
from saltus.orbits.cuts import whole
from saltus.orbits.records import changes_nothing
from saltus.scales import CONDITIONS_ALIKE

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.monitor import Monitor
    from saltus.orbits.problem import OrbitProblem

__all__ = ["ceases", "leading", "reroute", "run_out_with"]


def run_out_with(problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64]) -> list[Monitor]:
    """Return the other conditions that vanish with one, on the same side: those of both halves of a symmetric orbit."""
    if monitor.kind not in ("condition", "unmet"):
        return []
    problem, u = whole(problem, u)
    found = run_out(problem, u, problem.survey(u))
    return [name for name in found if name.kind == monitor.kind and name != monitor]


def ceases(problem: OrbitProblem, u: NDArray[np.float64], segment: int) -> bool:
    """Return whether the event that ends a segment, and whose condition runs out there, simply happens no more.

    So it is where it changes nothing, or its reset moves no state of this orbit, and no other event takes over.
    """
    end, mode = problem.signature.transitions[segment], problem.signature.modes[segment]
    transition = problem.system.transitions[end]
    problem.survey(u)
    if transition.target != transition.source or _taken_over(problem, segment):
        return False
    met, after = problem.state_on(segment, 1.0), np.empty(problem.n)
    problem.system.compiled.call("reset", end, 0, met, problem.extended, after)
    return changes_nothing(transition) or not moved(problem, mode, after, met)


def reroute(
    problem: OrbitProblem, blocks: NDArray[np.float64], u: NDArray[np.float64], monitor: Monitor
) -> Found | str:
    """Let the segment of a monitor function, and those like it, end with another transition at the same place.

    Where both halves of a symmetric orbit change, they change at once.
    """
    old = problem.signature
    rows: Rows = [(old.modes[j], old.transitions[j], blocks[j]) for j in range(len(old))]
    alike = [name for name in run_out(problem, u, problem.survey(u)) if name.kind == monitor.kind]
    ways = sorted({monitor, *alike}, key=lambda name: -name.segment)
    reasons = []
    for name in ways:
        found = _rerouted(problem, blocks, name.segment, name.transition)
        if isinstance(found, str):
            reasons.append(found)
        else:
            rows[name.segment : name.segment + 1] = found
    if reasons:
        return min(reasons)  # whichever of them was located
    return gathered(rows, old.turns)


def _rerouted(problem: OrbitProblem, blocks: NDArray[np.float64], i: int, instead: int) -> Rows | str:
    """Return segment `i` with another transition at its end: `instead`, or any other where that is -1.

    Where this leads to another mode, a segment without length follows, from which the motion goes on as before.
    """
    old, n, names = problem.signature, problem.n, problem.system.mode_names
    own, following = old.transitions[i], (i + 1) % len(old)
    met, wanted = problem.state_on(i, 1.0), blocks[following, :n]
    for mode in range(len(names)):
        for other in leading(problem, old.modes[i], mode, met, None, besides=own):
            if instead not in (-1, other):
                continue
            landed, here = np.empty(n), (old.modes[i], other, blocks[i])
            problem.system.compiled.call("reset", other, 0, met, problem.extended, landed)
            if mode == old.modes[following]:
                if _same_state(problem, landed, wanted):
                    return [here]
                continue
            for back in leading(problem, mode, old.modes[following], landed, wanted):
                if not same_phase(problem.system, other, back):
                    return [here, (mode, back, np.append(landed, 0.0))]
    name = problem.system.transitions[own].name
    if instead >= 0:
        return f"no transition leads on behind {problem.system.transitions[instead].name!r}, which happens first"
    if others := _taken_over(problem, i):
        return f"{problem.system.transitions[others[0]].name!r} happens instead of {name!r}"
    return f"the condition of {name!r} runs out, and no other transition happens there"


def _taken_over(problem: OrbitProblem, i: int) -> list[int]:
    """Return the transitions that take over from that of segment `i` where its condition runs out, on its surface."""
    transitions, own = problem.system.transitions, problem.signature.transitions[i]
    now = transitions[own]
    rivals = [
        k
        for k, other in enumerate(transitions)
        if k != own and (other.source, other.event) == (now.source, now.event) and other.direction in (0, now.direction)
    ]
    return [k for k in rivals if holds_at(problem, k, problem.state_on(i, 1.0))]


def _same_state(problem: OrbitProblem, x: NDArray[np.float64], y: NDArray[np.float64]) -> bool:
    """Return whether two full states are equal; their phases may differ by whole turns."""
    count = len(problem.system.states)
    return bool(np.max(np.abs(x - y)[:count] / problem.state_scale[:count]) < CONDITIONS_ALIKE)


def leading(
    problem: OrbitProblem, source: int, target: int, x: NDArray[np.float64], to: NDArray[np.float64] | None,
    besides: int = -1,
) -> list[int]:  # fmt: skip
    """Return the transitions between two modes that happen at the state x, and whose resets lead `to` a state."""
    found, system, names = [], problem.system, problem.system.mode_names
    x = np.ascontiguousarray(x)
    for k, transition in enumerate(system.transitions):
        if (transition.source, transition.target) == (names[source], names[target]) and k != besides:
            after = np.empty(problem.n)
            system.compiled.call("reset", k, 0, x, problem.extended, after)
            if _meets(problem, k, x) and (to is None or _same_state(problem, after, to)):
                found.append(k)
    return found


def _meets(problem: OrbitProblem, transition: int, x: NDArray[np.float64]) -> bool:
    """Return whether a full state lies on the surface of a transition."""
    out = np.empty(2 + 2 * problem.n)
    problem.system.compiled.call("event_x", transition, 0, x, problem.extended, out)
    return bool(abs(out[0]) < CONDITIONS_ALIKE * float(np.abs(out[2 : 2 + problem.n]) @ problem.state_scale))
