"""The neighbouring signature of an orbit where it changes: segments inserted, removed, joined or moved to another mode.

docs/theory/continuation.md, "Change of signature at a grazing", says which signatures meet.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.core.monitor import Monitor
from saltus.continuation.problems.ends.excursions import gone, moved, turns_back, way_back
from saltus.continuation.problems.margins import (
    grazed_with,
    passing,
    places_touched,
    rebound_ceases,
    touched,
    touches_again,
    vanishing,
    vanishing_with,
    without_speed,
)
from saltus.continuation.problems.signatures.rebounds import born_behind, rebound_without_speed
from saltus.continuation.problems.signatures.rerouting import ceases, leading, reroute, run_out_with
from saltus.continuation.problems.signatures.rows import (
    Found,
    Touch,
    closed,
    closes_round,
    gathered,
    inserted,
    joined,
    without,
)
from saltus.orbits.coincidences import Order, exchanged
from saltus.orbits.cuts import whole
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.records import changes_nothing
from saltus.orbits.regular_ends import settle_signature
from saltus.orbits.signature import CLOSED_END, PHASE_END, TOUCH_END, WHOLE, Signature
from saltus.scales import CONDITIONS_ALIKE

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "Neighbour",
    "exchanged_at",
    "neighbour",
    "neighbours",
    "sides_met",
    "touching",
    "turned",
]


# Why there is no neighbouring signature where the mode of a segment is entered and left at once.
_TURNED = "the event met without velocity changes the mode, but the motion turns back at once"

# Why there is none where a segment's end has no length, and the motion moves on by what its events do.
_MAP_JUMPS = "the map jumps there"  # where the motions on both sides part at a transition
_JUMPS = "the events that happen at once move the state: no neighbouring signature is continuous"


@dataclass(frozen=True, eq=False)
class Neighbour:
    """The same orbit in another signature."""

    signature: Signature
    u: NDArray[np.float64]


def neighbour(
    problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64], others: Sequence[Monitor] = (), *,
    everywhere: bool = False,
) -> Neighbour | str:  # fmt: skip
    """Return an orbit `u` on the border of its signature in the neighbouring one, or the reason why there is none.

    Parameters
    ----------
    problem : OrbitProblem
        Equations of the signature in which the orbit was found.
    monitor : Monitor
        The monitor function that vanishes: a ``margin`` (a segment touches a surface), a ``side`` (a whole segment lies
        on a surface), a ``rate`` (a segment's event is met without velocity), or a ``duration`` (a segment has no
        length). Or a ``condition`` (that of the transition at a segment's end runs out), an ``ahead`` (another event
        happens at a segment's end), a ``behind`` (at its start), or an ``unmet`` (another condition begins to hold). Or
        a ``rebound`` (the event before a segment happens again at once).
    u : ndarray, shape (size + 1,)
        Unknowns of the orbit, and the parameter.
    others : sequence of Monitor, optional
        Further ones of the same kind that vanish there, and change the signature as well: see `neighbours`.
    everywhere : bool, optional
        Whether a segment becomes one that meets a surface wherever it touches that surface, not at one place alone.
    """
    problem, u = whole(problem, u)
    blocks = u[: problem.size].reshape(problem.segments, problem.n + 1).copy()
    # no segment between two events of one instant vanishes: both are met without speed there
    if monitor.kind == "rate" and not any(name.kind == "rate" for name in others):
        monitor = vanishing(problem, blocks, monitor.segment)
    if (other := exchanged_at(problem, monitor, u)) is not None:
        return Neighbour(other.signature, np.append(other.blocks.ravel(), u[problem.size :]))
    if monitor.kind == "margin":
        places = problem.survey(u).places
        touches = [(i, float(places[i, k]), k) for _, i, k, _ in (monitor, *others)]
        if everywhere:
            touches = [(i, at, k) for i, own, k in touches for at in places_touched(problem, i, k, own)]
        found = inserted(problem, blocks, u, [Touch(*touch) for touch in touches])
    elif monitor.kind == "side":
        found = _change_modes(problem, blocks, u, monitor.transition)
    elif monitor.kind == "duration" and _meets_another(problem, monitor.segment):
        found = joined(problem, blocks, u, monitor.segment)
    elif monitor.kind == "duration" and rebound_ceases(problem, u, monitor.segment):
        parts = list(zip(problem.signature.modes, problem.signature.transitions, blocks, strict=True))
        found = gathered(parts[: monitor.segment] + parts[monitor.segment + 1 :], problem.signature.turns)
    elif monitor.kind == "rebound":
        found = born_behind(problem, blocks, sorted({monitor, *rebound_without_speed(problem, u)}))
    elif monitor.kind == "duration":
        found = _remove(problem, blocks, u, monitor.segment)
    elif monitor.kind in ("behind", "unmet"):
        found = _begin(problem, blocks, u, (monitor, *others))
    elif monitor.kind == "condition" and ceases(problem, u, monitor.segment):
        found = without(problem, blocks, u, [monitor.segment, *(name.segment for name in others)])
    elif monitor.kind in ("condition", "ahead"):
        found = reroute(problem, blocks, u, monitor)
    else:
        problem.survey(u)
        found = _merge(problem, blocks, u, monitor.segment)
    if isinstance(found, str):
        return f"{_MAP_JUMPS}: {found}" if monitor.kind in ("condition", "ahead", "behind", "unmet") else found
    signature, rows = found
    fresh = OrbitProblem(problem.system, signature, problem.parameters_at(u), tol=problem.tol)
    fresh.state_scale = problem.state_scale.copy()  # the orbit is the same
    signature, turned = settle_signature(fresh, rows.ravel())
    if not closes_round(problem, fresh, signature, turned):
        return _JUMPS
    beside = Neighbour(signature, np.append(turned, u[problem.size :]))
    if monitor.kind == "rate" and others:
        active = _same_equations(problem, u, beside)
        if slow := without_speed(active, beside.u):
            return neighbour(active, slow[0], beside.u, slow[1:])
    return _alike(problem, monitor, u, beside)


def neighbours(problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64]) -> list[Neighbour | str]:
    """Return what `neighbour` does where several grazings may be one point of the branch, as at two equal stops.

    In the first one all of them change: what is touched is met, and what is met without speed is missed. So each
    signature has one partner, and symmetries are kept. Then each changes alone.
    """
    others = grazed_with(problem, monitor, u) or run_out_with(problem, monitor, u)
    several = bool(others) or touches_again(problem, monitor, u)
    together = [_changed(problem, [monitor, *others], u)] if several else []
    return together + [neighbour(problem, name, u) for name in (monitor, *others)]


def _changed(problem: OrbitProblem, names: list[Monitor], u: NDArray[np.float64]) -> Neighbour | str:
    """Return an orbit in the signature in which all its grazings have changed; names: see `grazed_with`."""
    problem, u = whole(problem, u)
    slow = [name for name in names if name.kind == "rate"]
    if names[0].kind in ("condition", "unmet"):
        return neighbour(problem, names[0], u, names[1:])
    if not slow or len(slow) == len(names):
        return neighbour(problem, names[0], u, names[1:], everywhere=True)
    ends, transitions = problem.signature.transitions, problem.system.transitions
    missed = {transitions[ends[name.segment]].event for name in slow}
    fewer = neighbour(problem, slow[0], u, slow[1:])
    if isinstance(fewer, str):
        return fewer
    active = _same_equations(problem, u, fewer)
    met = [name for name in touched(active, fewer.u) if transitions[name.transition].event not in missed]
    return neighbour(active, met[0], fewer.u, met[1:], everywhere=True) if met else fewer


def _same_equations(problem: OrbitProblem, u: NDArray[np.float64], found: Neighbour) -> OrbitProblem:
    """Return the equations of a neighbour of the orbit `u`, started, with the same active parameters."""
    given = problem.parameters_at(u), problem.active, problem.scales, problem.tol
    active = OrbitProblem(problem.system, found.signature, *given)
    active.start(found.u)
    return active


def exchanged_at(problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64]) -> Order | None:
    """Return an orbit with two events exchanged that a monitor function finds at one instant; None where none are."""
    if monitor.kind not in ("duration", "ahead"):
        return None
    behind = monitor.segment + (monitor.kind == "ahead")
    problem.survey(u)
    blocks = u[: problem.size].reshape(problem.segments, problem.n + 1)
    short = abs(blocks[behind % problem.segments, -1]) < CONDITIONS_ALIKE * np.abs(blocks[:, -1]).sum()
    return exchanged(problem, blocks, behind % problem.segments, CONDITIONS_ALIKE) if short else None


def _alike(problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64], found: Neighbour) -> Neighbour | str:
    """Return the neighbour in which all changes of one kind have happened: both halves of a symmetric orbit change."""
    n, count = problem.n, len(found.signature)
    if monitor.kind != "duration" or count < 2:
        return found
    durations = np.abs(found.u[n : count * (n + 1) : n + 1])
    further = int(np.argmin(durations))
    if not durations[further] < CONDITIONS_ALIKE * float(durations.sum()):
        return found
    return neighbour(_same_equations(problem, u, found), Monitor("duration", further), found.u)


def turned(problem: OrbitProblem, monitor: Monitor, u: NDArray[np.float64]) -> bool:
    """Return whether a vanishing velocity is no grazing: the mode changes, but the motion turns back at once.

    The next segment has then touched its surface before, so the orbit is no motion of the system any more.
    """
    return monitor.kind == "rate" and neighbour(problem, monitor, u) == _TURNED


def _begin(
    problem: OrbitProblem, blocks: NDArray[np.float64], u: NDArray[np.float64], names: Sequence[Monitor]
) -> Found | str:
    """Let events happen at segments' starts or ends, or where segments pass the events' surfaces."""
    problem.survey(u)
    touches = []
    for name in names:
        event = problem.system.transitions[name.transition]
        place = 0.0 if name.kind == "behind" else passing(problem, name.segment, name.transition)
        if place == 1.0:
            return reroute(problem, blocks, u, name)
        if event.target != event.source:
            return f"{event.name!r} begins to happen, and the motion goes on in {event.target!r} from there"
        touches.append(Touch(name.segment, place, name.transition))
    return inserted(problem, blocks, u, touches)


def _change_modes(problem: OrbitProblem, blocks: NDArray[np.float64], u: NDArray[np.float64], k: int) -> Found | str:
    """Move every segment that lies wholly on a surface to the target mode of the surface's transition."""
    system, old, names = problem.system, problem.signature, problem.system.mode_names
    if (first := system.transitions[k]).target == first.source:
        return f"the whole orbit meets the surface of {first.name!r}, and no orbit near it does so"
    modes = list(old.modes)
    for i, j in _on_surfaces(problem, u):
        transition = system.transitions[j]
        if transition.target != transition.source and modes[i] == old.modes[i]:
            if not _rests(problem, i, j):
                return f"the reset of {transition.name!r} moves the state: no neighbouring signature is continuous"
            modes[i] = names.index(transition.target)
    chosen = []
    for i, end in enumerate(old.transitions):
        following = (i + 1) % len(modes)
        like: int | None = end
        if end >= 0 and (modes[i], modes[following]) != (old.modes[i], old.modes[following]):
            like = _same_event(problem, end, modes[i], modes[following], problem.state_on(i, 1.0))
        if like is None:
            return f"no transition out of {names[modes[i]]!r} is like {system.transitions[end].name!r}"
        chosen.append(like)
    signature = Signature(tuple(modes), tuple(chosen), old.kinds, old.turns)
    fresh = OrbitProblem(system, signature, problem.parameters_at(u), tol=problem.tol)
    fresh.start(blocks.ravel())
    gaps = fresh.evaluate(blocks.ravel())[0].reshape(problem.segments, problem.n + 1)[:, : problem.n]
    if not np.max(np.abs(gaps) / problem.state_scale) < CONDITIONS_ALIKE:
        return f"the field jumps on the surface of {first.name!r}, so that no orbit near it goes on beyond"
    return signature, blocks


def _on_surfaces(problem: OrbitProblem, u: NDArray[np.float64]) -> list[tuple[int, int]]:
    """Return (segment, transition) for each segment that lies wholly on the surface of a transition."""
    found, n = [], problem.n
    for i, k in np.argwhere(problem.survey(u).places == WHOLE).tolist():
        distance, gradient = problem.distance(u, i, k)
        if abs(distance) < CONDITIONS_ALIKE * float(
            np.abs(gradient[i * (n + 1) : i * (n + 1) + n]) @ problem.state_scale
        ):
            found.append((i, k))
    return found


def sides_met(problem: OrbitProblem, u: NDArray[np.float64]) -> set[Monitor]:
    """Return the monitor functions of kind ``side`` that vanish at an orbit."""
    return {Monitor("side", i, k) for i, k in _on_surfaces(problem, u)}


def _passes(problem: OrbitProblem, segment: int) -> bool:
    """Return whether the event that ends a segment changes nothing, so that the next segment continues it."""
    return changes_nothing(problem.system.transitions[problem.signature.transitions[segment]])


def _meets_another(problem: OrbitProblem, segment: int) -> bool:
    """Return whether a segment begins on another surface than that of its event, which changes nothing."""
    ends, transitions = problem.signature.transitions, problem.system.transitions
    before = transitions[ends[segment - 1]].event
    return _passes(problem, segment) and before != transitions[ends[segment]].event


def _rests(problem: OrbitProblem, segment: int, transition: int) -> bool:
    """Return whether a reset moves no state of a segment, sampled at seven places of the last survey."""
    after = np.empty(problem.n)
    for place in np.linspace(0.0, 1.0, 7):
        x = problem.state_on(segment, float(place))
        problem.system.compiled.call("reset", transition, 0, x, problem.extended, after)
        if np.max(np.abs(after - x) / problem.state_scale) > CONDITIONS_ALIKE:
            return False
    return True


def _same_event(problem: OrbitProblem, transition: int, source: int, target: int, x: NDArray[np.float64]) -> int | None:
    """Return a transition between two modes with the event and reset of another transition at the state `x`."""
    system, n = problem.system, problem.n
    names, like = system.mode_names, system.transitions[transition]
    event, wanted, after = np.empty(2 + 2 * n), np.empty(n), np.empty(n)
    system.compiled.call("reset", transition, 0, x, problem.extended, wanted)
    for k, other in enumerate(system.transitions):
        if (other.source, other.target, other.direction) != (names[source], names[target], like.direction):
            continue
        system.compiled.call("event_x", k, 0, x, problem.extended, event)
        system.compiled.call("reset", k, 0, x, problem.extended, after)
        near = abs(event[0]) < CONDITIONS_ALIKE * float(np.abs(event[2 : 2 + n]) @ problem.state_scale)
        if near and np.max(np.abs(after - wanted) / problem.state_scale) < CONDITIONS_ALIKE:
            return k
    return None


def touching(problem: OrbitProblem, u: NDArray[np.float64], i: int, k: int) -> Neighbour:
    """Return the orbit cut where segment `i` touches the surface of transition `k`; the mode stays the same."""
    problem, u = whole(problem, u)
    n, old = problem.n, problem.signature
    blocks = u[: problem.size].reshape(problem.segments, n + 1)
    place = problem.survey(u).places[i, k]
    before = blocks[i, n] * place * place * (3.0 - 2.0 * place)
    met = problem.state_on(i, place)
    mode = old.modes[i]
    if old.kinds[0] in (PHASE_END, CLOSED_END):
        signature = Signature((mode,), (k,), (TOUCH_END,), old.turns)
        return Neighbour(signature, np.concatenate([met, [blocks[i, n]], u[problem.size :]]))
    first = np.append(blocks[i, :n], before)
    rest = np.append(met, blocks[i, n] - before)
    rows = [*blocks[:i], first, rest, *blocks[i + 1 :]]
    signature = Signature(
        (*old.modes[:i], mode, *old.modes[i:]),
        (*old.transitions[:i], k, *old.transitions[i:]),
        (*old.kinds[:i], TOUCH_END, *old.kinds[i:]),
        old.turns,
    )
    return Neighbour(signature, np.concatenate([*rows, u[problem.size :]]))


def _remove(problem: OrbitProblem, blocks: NDArray[np.float64], u: NDArray[np.float64], i: int) -> Found | str:
    """Remove segment `i`, which has no length: its two neighbours are joined, or one leads to the other at once.

    Where it is one of several in a row that vanish together, as on the way over further modes, all of them go.
    """
    old = problem.signature
    count = len(old)
    gone = [i]
    if old.modes[i - 1] != old.modes[(i + 1) % count]:
        gone = vanishing_with(problem, blocks, i)
    previous, following = (gone[0] - 1) % count, (gone[-1] + 1) % count
    if old.modes[previous] != old.modes[following]:
        return _skip(problem, blocks, i)
    problem.survey(u)
    if len(gone) > 1 and moved(problem, old.modes[previous], problem.state_on(previous, 1.0), blocks[following, :-1]):
        return "the transitions through modes that vanish together move the state"
    if count == len(gone) + 1:
        return closed(problem, blocks, u, previous)
    whole_one = blocks[previous].copy()
    whole_one[problem.n] += blocks[following, problem.n]
    rows = [(old.modes[j], old.transitions[j], blocks[j]) for j in range(count)]
    rows[previous] = (old.modes[previous], old.transitions[following], whole_one)
    kept = [row for j, row in enumerate(rows) if j not in (*gone, following)]
    return gathered(kept, old.turns)


def _skip(problem: OrbitProblem, blocks: NDArray[np.float64], i: int) -> Found | str:
    """Remove segment `i`, which has no length, with a transition that leads past it."""
    old, n, names = problem.signature, problem.n, problem.system.mode_names
    count = len(old)
    previous, following = (i - 1) % count, (i + 1) % count
    source, target = old.modes[previous], old.modes[following]
    # the zero segment starts where the one before ends
    met = np.ascontiguousarray(blocks[i, :n])
    if problem.system.transitions[old.transitions[previous]].reset:
        return f"the transition into {names[old.modes[i]]!r} moves the state"
    past = leading(problem, source, target, met, blocks[following, :n])
    if not past:
        return f"no transition leads from {names[source]!r} to {names[target]!r} there"
    rows = [(old.modes[j], old.transitions[j], blocks[j]) for j in range(count)]
    rows[previous] = (source, past[0], blocks[previous])
    del rows[i]
    return gathered(rows, old.turns)


def _merge(problem: OrbitProblem, blocks: NDArray[np.float64], u: NDArray[np.float64], i: int) -> Found | str:
    """Join segment `i` with the next one where its event is met without velocity and changes nothing."""
    old, following = problem.signature, (i + 1) % len(problem.signature)
    met, after = problem.state_on(i, 1.0), np.empty(problem.n)
    problem.system.compiled.call("reset", old.transitions[i], 0, met, problem.extended, after)
    if old.modes[i] != old.modes[following]:
        back = way_back(problem, old.modes[following], old.modes[i], after)
        if back is not None and not turns_back(problem, back, old.modes[following], after):
            return gone(problem, old.modes[following])
        return _TURNED
    if old.kinds[i] != TOUCH_END and np.max(np.abs(after - met) / problem.state_scale) > CONDITIONS_ALIKE:
        return "the event met without velocity moves the state"
    return joined(problem, blocks, u, i)
