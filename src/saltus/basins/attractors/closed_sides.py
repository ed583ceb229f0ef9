"""Sides of events to which no motion comes: an equilibrium or orbit that lies wholly there is virtual.

An event of direction 1 or -1 has a side beyond. One that leads to another mode lets no motion of its mode pass. One
that moves the state within the mode, as an impact, may turn all motions back that meet it, or let
some go on. A simulation may start beyond it, and never meets it then.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import MET
from saltus.system.angles import TURN
from saltus.system.parts import at_phases

if TYPE_CHECKING:
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
        self.system, self.p = system, system.compiled.extended(p)
        self.low, self.high, self.scale = low, high, scale
        self._closed: dict[int, bool] = {}

    def hold(self, points: NDArray[np.float64], mode: str) -> bool:
        """Return whether states of one mode, shape (k, n), all lie beyond one event to whose other side none comes."""
        full = [self.system.full_state(x) for x in np.atleast_2d(points)]
        ways = (k for k, t in enumerate(self.system.transitions) if t.source == mode and t.direction)
        return any(all(self._is_beyond(k, x) for x in full) and self._is_closed(k, points) for k in ways)

    def _is_beyond(self, k: int, x: NDArray[np.float64]) -> bool:
        return self._height(k, x)[0] > 0.0 and self._is_due(k, x)

    def _is_due(self, k: int, x: NDArray[np.float64]) -> bool:
        when = np.empty(1)
        self.system.compiled.call("guard", len(self.system.modes) + k, 0, x, self.p, when)
        return bool(when[0] > 0.0)

    def _height(self, k: int, x: NDArray[np.float64]) -> tuple[float, float, NDArray[np.float64]]:
        """Return an event function with the sign that is positive beyond, its rate, and its gradient."""
        n, sign = len(x), float(self.system.transitions[k].direction)
        out = np.empty(2 + 2 * n)
        self.system.compiled.call("event_x", k, 0, x, self.p, out)
        return sign * float(out[0]), sign * float(out[1]), sign * out[2 : 2 + n]

    def _is_closed(self, k: int, points: NDArray[np.float64]) -> bool:
        if k not in self._closed:
            transition = self.system.transitions[k]
            leads_on = transition.target != transition.source
            self._closed[k] = not at_phases(self.system, transition) and (leads_on or self._turns_back(k, points))
        return self._closed[k]

    def _turns_back(self, k: int, points: NDArray[np.float64]) -> bool:
        """Return whether the reset of an event within its mode sends all motions back that meet it in the region."""
        ends = np.vstack([points, self.low, self.high])
        rng, met = np.random.default_rng(0), False
        for x in rng.uniform(ends.min(axis=0), ends.max(axis=0), (_MEETINGS, len(self.low))):
            at = self._on_surface(k, self._at_any_phase(x, rng))
            if at is None or not self._height(k, at)[1] > 0.0 or not self._is_due(k, at):
                continue
            met, landed = True, np.empty(len(at))
            self.system.compiled.call("reset", k, 0, at, self.p, landed)
            height, rate, gradient = self._height(k, landed)
            if (rate if abs(height) <= self._met(gradient) else height) > 0.0:
                return False
        return met

    def _at_any_phase(self, x: NDArray[np.float64], rng: np.random.Generator) -> NDArray[np.float64]:
        full = np.array(self.system.full_state(x), dtype=np.float64)
        if self.system.phase is not None:
            full[-1] = rng.uniform(0.0, TURN)
        return full

    def _met(self, gradient: NDArray[np.float64]) -> float:
        """Return the value of an event function up to which it is 0."""
        return MET * float(np.abs(gradient[: len(self.scale)]) @ self.scale)

    def _on_surface(self, k: int, x: NDArray[np.float64]) -> NDArray[np.float64] | None:
        """Return the state on the surface of an event next to a given one, at its phase; None where there is none."""
        n = len(self.scale)
        for _ in range(_STEPS):
            height, _, gradient = self._height(k, x)
            slopes = gradient[:n] * self.scale
            if abs(height) <= self._met(gradient):
                return x
            if not np.isfinite(height) or not (steepness := float(slopes @ slopes)) > 0.0:
                return None
            x = x.copy()
            x[:n] -= self.scale * slopes * (height / steepness)
        return None
