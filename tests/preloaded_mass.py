"""A mass that a force presses to a stop: its definition, its flights in closed form, and where it stops resting."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.optimize import brentq

import saltus

PRELOADED = 2.184239668172  # the force below which a mass with e = 0.2 rests on its stop, by motions of exact flights


@dataclass(frozen=True)
class Mass:
    """A mass that a constant force p presses to a stop at 0, driven by F cos(w t): its flights are in closed form."""

    e: float  # restitution
    p: float
    w: float

    def system(self, rests: bool) -> saltus.HybridSystem:
        """Return the definition, with a mode in which the mass rests or without one."""
        own = {"rests": "rest"} if rests else {}
        modes = {"fly": saltus.Mode({"x": "v", "v": "-p + F*cos(th)"})}
        transitions = [saltus.Transition("fly", "fly", "x", -1, {"v": "-e*v"}, name="hit", **own)]
        if rests:
            modes["rest"] = saltus.Mode({"x": "0", "v": "0"}, surface="x")
            transitions.append(saltus.Transition("rest", "fly", "-p + F*cos(th)", 1, name="leave"))
        values = {"F": 2.5 * self.p, "e": self.e, "p": self.p, "w": self.w}
        return saltus.HybridSystem(("x", "v"), values, modes, transitions, phase=("th", "w"))

    def flight(self, v: float, at: float, force: float) -> tuple[float, float] | None:
        """Return phase and velocity at the next hit, of a flight from the stop at a phase; in units of p and 1/w."""

        def height(u: float) -> float:  # over the time
            if abs(u) < 1e-3:
                c, s = math.cos(at), math.sin(at)
                series = (c - 1.0 / force) / 2.0, -s / 6.0, -c / 24.0, s / 120.0
                return v + force * sum(part * u ** (k + 1) for k, part in enumerate(series))
            return v - u / 2.0 - (force * (math.cos(at + u) - math.cos(at)) + force * math.sin(at) * u) / u

        times = np.concatenate([np.geomspace(1e-12, 1e-2, 200), np.linspace(1e-2, 8.0 * math.pi, 6000)[1:]])
        heights = [height(float(u)) for u in times]
        begun = next((i for i, value in enumerate(heights) if value > 0.0), None)
        if begun is None:
            return None
        end = next((i for i in range(begun, len(times)) if heights[i] < 0.0), None)
        if end is None:
            return None
        u = brentq(height, times[end - 1] if end > begun or end == 0 else 1e-16, times[end], xtol=1e-300, rtol=1e-15)
        return at + u, v - u + force * (math.sin(at + u) - math.sin(at))

    def accumulates_at(self, low: float, high: float) -> float:
        """Return the force between two at which a mass that leaves the stop does not come to rest before it again."""
        low, high = low / self.p, high / self.p
        rests = self.rests(low)
        assert rests != self.rests(high)
        while high - low > 1e-13:
            middle = 0.5 * (low + high)
            low, high = (middle, high) if self.rests(middle) == rests else (low, middle)
        return 0.5 * (low + high) * self.p

    def rests(self, force: float) -> bool:
        """Return whether a mass that leaves the stop comes to rest before the force pushes it off again."""
        release = math.acos(1.0 / force)
        at, v, end = -release, 0.0, 2.0 * math.pi - release
        for _ in range(2000):
            met = self.flight(v, at, force)
            if met is None or met[0] >= end:
                return False
            at, v = met[0], -self.e * met[1]
            pull, left = 1.0 - force * math.cos(at), end - at
            if 2.0 * v / (pull * (1.0 - self.e)) < 1e-3 * left:
                return True
            if v > pull * left:  # no parabola of the pull at its start comes back before the release
                return False
        return False


def above(mass: Mass, rests: bool, share: float) -> saltus.PeriodicOrbit:
    """Return an orbit with one hit a period, at a force over that of its fold."""
    force, turn = share * math.pi * (1.0 - mass.e) / (1.0 + mass.e) * mass.p, 2.0 * math.pi / mass.w
    v = mass.e * mass.p * turn / (1.0 + mass.e)
    # over a period x(T) = v T - p T^2/2 - F sin(th) T/w vanishes
    phase = math.asin(mass.w * (v - mass.p * turn / 2.0) / force)
    return saltus.solve_orbit(mass.system(rests), {"F": force}, segments=[("fly", "hit", [0.0, v, phase], turn)])
