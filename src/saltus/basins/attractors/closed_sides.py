"""Sides of events to which no motion comes: an equilibrium or orbit that lies wholly there is virtual.

An event of direction 1 or -1 has a side beyond. A simulation may start there, and never meets the event then. The side
is closed where no motion comes there from before:

* motions that meet the event change their mode, or are turned back by its reset;
* the event's condition holds wherever motions meet it;
* no other transition into the mode lands beyond, from a state of the region.

All three are looked at from sampled states, so that a narrow gap may be missed. Motions are the better evidence: a side
where one ends that began elsewhere is open (`ClosedSides.watch`).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.starting import allowed_modes, domain_value
from saltus.scales import MET
from saltus.system.angles import TURN
from saltus.system.parts import at_phases

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["ClosedSides"]

_MEETINGS = 256  # states from which a surface is looked for, to see what its event does to motions that meet it
_STEPS = 8  # Newton steps from such a state to the surface


class ClosedSides:
    """The sides beyond events that no motion comes to from before.

    Parameters
    ----------
    system : HybridSystem
    p : ndarray
        All parameters.
    low, high : ndarray, shape (n,)
        The region of the motions.
    scale : ndarray, shape (n,)
        Size of each state.
    """

    def __init__(
        self,
        system: HybridSystem,
        p: NDArray[np.float64],
        low: NDArray[np.float64],
        high: NDArray[np.float64],
        scale: NDArray[np.float64],
    ) -> None:
        self.system, self._given, self.p = system, p, system.compiled.extended(p)
        self.low, self.high, self.scale = low, high, scale
        self._closed: dict[tuple[int, bytes], bool] = {}
        self._passed: set[int] = set()

    def hold(self, points: NDArray[np.float64], mode: str) -> bool:
        """Return whether states of one mode, shape (k, n), all lie beyond one event to whose other side none comes."""
        return bool(self.events(points, mode))

    def events(self, points: NDArray[np.float64], mode: str) -> list[int]:
        """Return the transitions with closed sides beyond which states of one mode, shape (k, n), all lie."""
        points = np.atleast_2d(points)
        ways = (k for k, t in enumerate(self.system.transitions) if t.source == mode and t.direction)
        return [k for k in ways if self.lie_beyond(k, points) and self._is_closed(k, points)]

    def lie_beyond(self, k: int, points: NDArray[np.float64]) -> bool:
        """Return whether states, shape (k, n), all lie beyond the event of a transition."""
        return all(self._is_beyond(k, np.asarray(self.system.full_state(x), dtype=np.float64)) for x in points)

    def watch(self, starts: NDArray[np.float64], ends: NDArray[np.float64], modes: NDArray[np.int64]) -> None:
        """Open the sides where motions end that began elsewhere: in another mode, or not beyond the event.

        Parameters
        ----------
        starts, ends : ndarray, shape (m, n)
            The states of motions at both ends, NaN at those of one that diverges. They start in the first mode that a
            state allows.
        modes : ndarray of int, shape (m,)
            The modes at `ends`.
        """
        system, kept = self.system, np.isfinite(ends).all(axis=1)
        for start, end, mode in zip(starts[kept], ends[kept], modes[kept].tolist(), strict=True):
            name, begun = system.mode_names[mode], None
            for k, transition in enumerate(system.transitions):
                if transition.source != name or not transition.direction or k in self._passed:
                    continue
                if not self.lie_beyond(k, end[None]):
                    continue
                if begun is None:
                    begun = next(allowed_modes(system, system.full_state(start), self._given), -1)
                if begun != mode or not self.lie_beyond(k, start[None]):
                    self._passed.add(k)

    def _is_beyond(self, k: int, x: NDArray[np.float64]) -> bool:
        height, _, gradient = self._height(k, x)
        return height > self._met(k, gradient) and self._is_due(k, x)

    def _is_due(self, k: int, x: NDArray[np.float64]) -> bool:
        when = np.empty(1)
        self.system.compiled.call("guard", len(self.system.modes) + k, 0, x, self.p, when)
        return bool(when[0] > 0.0)

    def _height(self, k: int, x: NDArray[np.float64]) -> tuple[float, float, NDArray[np.float64]]:
        """Return an event function with the sign that is positive beyond, its rate, and its gradient."""
        n, sign = len(x), float(self.system.transitions[k].direction or 1)
        out = np.empty(2 + 2 * n)
        self.system.compiled.call("event_x", k, 0, x, self.p, out)
        return sign * float(out[0]), sign * float(out[1]), sign * out[2 : 2 + n]

    def _is_closed(self, k: int, points: NDArray[np.float64]) -> bool:
        if k in self._passed or at_phases(self.system, self.system.transitions[k]):
            return False
        ends = np.vstack([points, self.low, self.high])
        box = np.array([ends.min(axis=0), ends.max(axis=0)])
        key = k, box.tobytes()
        if key not in self._closed:
            self._closed[key] = self._stops_all(k, box) and not self._is_landed_beyond(k, box)
        return self._closed[key]

    def _stops_all(self, k: int, box: NDArray[np.float64]) -> bool:
        """Return whether all motions that meet an event change their mode there, or are sent back by a reset."""
        transition, met = self.system.transitions[k], False
        for x in self._meetings(k, box):
            met = True
            if not any(self._stops(j, k, x) for j in self._due_on(transition.source, x)):
                return False
        return met or transition.target != transition.source

    def _stops(self, j: int, k: int, x: NDArray[np.float64]) -> bool:
        """Return whether transition `j`, made on the surface of event `k`, lets no motion go on beyond that surface."""
        if self.system.transitions[j].target != self.system.transitions[k].source:
            return True
        height, rate, gradient = self._height(k, self._landed(j, x))
        return not (rate if abs(height) <= self._met(k, gradient) else height) > 0.0

    def _due_on(self, mode: str, x: NDArray[np.float64]) -> list[int]:
        """Return the transitions of a mode that are made at a state: on their surfaces, where their conditions hold."""
        found = []
        for j, transition in enumerate(self.system.transitions):
            if transition.source != mode:
                continue
            height, rate, gradient = self._height(j, x)
            met = abs(height) <= self._met(j, gradient) and (rate > 0.0 or not transition.direction)
            if met and self._is_due(j, x):
                found.append(j)
        return found

    def _is_landed_beyond(self, k: int, box: NDArray[np.float64]) -> bool:
        """Return whether a transition into the mode of an event lands beyond it, made from a state of the box.

        Those from sliding are left out.
        """
        n, margin = len(self.scale), MET * self.scale
        for j, transition in enumerate(self.system.transitions):
            sliding = self.system.modes[transition.source].surface is not None
            if transition.target != self.system.transitions[k].source or sliding:
                continue
            for x in self._meetings(j, box):
                inside = (x[:n] >= box[0] - margin) & (x[:n] <= box[1] + margin)
                if not inside.all() or not self._is_due(j, x):
                    continue
                height, _, gradient = self._height(k, self._landed(j, x))
                if height > self._met(k, gradient):
                    return True
        return False

    def _landed(self, j: int, x: NDArray[np.float64]) -> NDArray[np.float64]:
        landed = np.empty(len(x))
        self.system.compiled.call("reset", j, 0, x, self.p, landed)
        return landed

    def _meetings(self, k: int, box: NDArray[np.float64]) -> Iterator[NDArray[np.float64]]:
        """Go through states on the surface of an event where motions of its mode pass in its direction."""
        transition, rng = self.system.transitions[k], np.random.default_rng(0)
        mode = self.system.mode_index(transition.source)
        for x in rng.uniform(box[0], box[1], (_MEETINGS, len(self.low))):
            at = self._on_surface(k, self._at_any_phase(x, rng))
            if at is None or not domain_value(self.system, mode, at, self._given) > 0.0:
                continue
            if self._height(k, at)[1] > 0.0 or not transition.direction:
                yield at

    def _at_any_phase(self, x: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        full = np.array(self.system.full_state(x), dtype=np.float64)
        if self.system.phase is not None:
            full[-1] = rng.uniform(0.0, TURN)
        return full

    def _sizes(self, k: int, count: int) -> NDArray[np.float64]:
        """Return how far a search for a surface may move each state: not the phase, unless the event knows it alone."""
        sizes = np.zeros(count)
        if at_phases(self.system, self.system.transitions[k]):
            sizes[-1] = TURN
        else:
            sizes[: len(self.scale)] = self.scale
        return sizes

    def _met(self, k: int, gradient: NDArray[np.float64]) -> float:
        """Return the value of an event function up to which it is 0."""
        return MET * float(np.abs(gradient) @ self._sizes(k, len(gradient)))

    def _on_surface(self, k: int, x: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the state on the surface of an event next to a given one, at its phase; None where there is none."""
        sizes = self._sizes(k, len(x))
        for _ in range(_STEPS):
            height, _, gradient = self._height(k, x)
            slopes = gradient * sizes
            if abs(height) <= self._met(k, gradient):
                return x
            if not np.isfinite(height) or not (steepness := float(slopes @ slopes)) > 0.0:
                return None
            x = x - sizes * slopes * (height / steepness)
        return None
