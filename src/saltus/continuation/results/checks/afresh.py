"""Orbits of a curve simulated afresh: a motion from each segment's start meets no event before the segment's end."""

from __future__ import annotations

import math
from functools import cached_property
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.core.point_types import ACCUMULATION
from saltus.errors import SaltusError
from saltus.flow.motion import EventDrivenMotion
from saltus.orbits.signature import CUT_END
from saltus.scales import FINEST, NO_DURATION, SPEEDLESS, TOUCHING, followed

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.signature import Signature

__all__ = ["afresh"]

_ROWS = 24  # most points of a curve whose hops are estimated, to find the shortest
_EACH = 8  # points of a curve for one of them
_MOST = 3  # most orbits of a curve that are simulated
_FOR_ONE = 40  # points of a curve for one more
_SEGMENTS = 24  # most segments of an orbit that are simulated: those with the shortest hops


def afresh(curve: Any) -> tuple[list[tuple[float, str]], int]:
    """Return where a simulation from a segment's start meets an event before the segment ends, and how many are made.

    They are made of orbits with events: at both ends of a curve, and of the one with the shortest hop at a start. Of a
    short curve it is one end alone, whose hop is shorter.
    """
    if not hasattr(curve, "means"):  # no orbits of a flow
        return [], 0
    count, most = 2 + min(_ROWS, len(curve) // _EACH), min(_MOST, 1 + len(curve) // _FOR_ONE)
    first, *middle, last = np.unique(np.linspace(0, len(curve) - 1, count).astype(int)).tolist()
    chosen: list[_Orbit] = []
    for rows in ([first, last], middle):  # those in the middle are looked at where the ends leave room for one
        if len(chosen) < most:
            orbits = [_Orbit(curve, i) for i in rows if _told(curve, i)]
            chosen += sorted(orbits, key=lambda orbit: orbit.shortest)[: most - len(chosen)]
    told = [(float(orbit.row), orbit.contradicted()) for orbit in chosen]
    return [(row, text) for row, text in told if text is not None], len(chosen)


def _told(curve: Any, i: int) -> bool:
    """Return whether an orbit of a curve is called admissible and has events; its flights may be in pieces."""
    form = curve.forms[curve.form[i]]
    if any(point.type == ACCUMULATION and point.value(curve.varied[0]) == curve.values[i] for point in _ends(curve)):
        return False  # of its hits some are left out
    hits = max(form.transitions) >= 0 and CUT_END not in form.kinds
    return bool(hits and curve.admissible[i] and not curve.implicit[i])


def _ends(curve: Any) -> list[Any]:
    """Return the special points of a branch; of a locus none, on which the letters of an accumulation mean another."""
    return list(curve.special_points) if len(curve.varied) == 1 else []


class _Orbit:
    """One orbit of a curve: its segments' starts and durations."""

    def __init__(self, curve: Any, row: int) -> None:
        self.curve, self.row, self.system = curve, row, curve.system
        named = curve._parameters_at(row)
        self.p = np.array([named[name] for name in self.system.parameter_names])
        self.form: Signature = curve.forms[curve.form[row]]
        blocks = curve.unknowns[row].reshape(len(self.form), -1)
        self.starts, self.durations = np.ascontiguousarray(blocks[:, :-1]), blocks[:, -1]
        n = self.starts.shape[1]
        self.sizes = np.maximum(np.abs(curve.lows[row]), np.abs(curve.highs[row]))[:n]
        self.period = float(np.abs(self.durations).sum())

    @cached_property
    def hops(self) -> list[float]:
        """When each segment comes back to the surface on which it starts, by a parabola, over its duration."""
        compiled, n, heads = self.system.compiled, self.sizes.size, self.form.heads
        found, p, event, rate = [math.inf] * len(self.form), compiled.extended(self.p), np.empty(2 + 2 * n), np.empty(n)
        slope = event[2 + n :]
        for i in heads:
            before, duration = self.form.transitions[i - 1], float(self.durations[i])
            if before < 0 or not duration > 0.0:
                continue
            compiled.call("event_x", before, 0, self.starts[i], p, event)
            compiled.call("field", self.form.modes[i], 0, self.starts[i], p, rate)
            speed, bend = float(event[1]), float(slope @ rate)
            if speed * bend < 0.0:
                found[i] = -2.0 * speed / bend / duration
        return found

    @property
    def shortest(self) -> float:
        """The shortest of its hops."""
        return min(self.hops)

    def contradicted(self) -> str | None:
        """Return in words what a simulation from a segment's start meets before the segment ends; None if nothing."""
        for i in np.argsort(self.hops, kind="stable")[:_SEGMENTS].tolist():
            if (told := self._simulated(i)) is not None:
                return told
        return None

    def _simulated(self, i: int) -> str | None:
        """Return what a simulation from the start of segment i meets with speed before its end, or None."""
        rtol = max(self.curve.tolerance, FINEST)
        # a surface that is met slowly is met sooner or later by half of the flow's digits
        end = float(self.durations[i]) - max(TOUCHING, math.sqrt(followed(rtol))) * self.period
        if not end > 0.0:
            return None
        atol = rtol * float(self.sizes[self.sizes > 0.0].min(initial=1.0))
        mode = self.form.modes[i]
        try:
            motion = EventDrivenMotion(self.system, self.p, self.starts[i].copy(), mode, rtol, atol)
            motion.follow(end, None, 1)
        except SaltusError:  # it cannot be simulated: nothing is told
            return None
        if not motion.events_passed:
            return None
        times, which, sides, _ = (column[-1:] for column in motion.events())  # the phase may have gone back before
        if not times.size or which[0, 0] < 0 or not NO_DURATION * self.period < times[0] < end:
            return None
        k, n, event = int(which[0, 0]), self.sizes.size, np.empty(2 + 2 * self.sizes.size)
        self.system.compiled.call("event_x", k, 0, np.ascontiguousarray(sides[0, 0]), motion.p, event)
        speed = abs(float(event[1])) * self.period / (float(np.abs(event[2 : 2 + n]) @ self.sizes) or math.inf)
        if not speed > max(SPEEDLESS, math.sqrt(followed(rtol))):
            return None
        if not self._happens(k, np.ascontiguousarray(sides[0, 0]), motion.p):
            return None
        met, last = self.system.transition_names[k], float(self.durations[i])
        return f"a simulation from segment {i} meets {met!r} after {times[0]:.6g}, before its end at {last:.6g}"

    def _happens(self, k: int, x: NDArray[np.float64], p: NDArray[np.float64]) -> bool:
        """Return whether the condition of a transition holds in a state and next to it, as it does off a border."""
        if self.system.transitions[k].when is None:
            return True
        held, at = np.empty(1), len(self.system.modes) + k
        for move in np.concatenate([np.diag(self.sizes), -np.diag(self.sizes)]) * TOUCHING:
            moved = x.copy()
            moved[: self.sizes.size] += move
            self.system.compiled.call("guard", at, 0, moved, p, held)
            if not held[0] > 0.0:
                return False
        return True
