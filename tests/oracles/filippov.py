"""Motions of Filippov systems with one surface, event by event, by SciPy alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

ABOVE, BELOW, SLIDING = "above", "below", "sliding"
_ROUNDING = 1e-9  # depth beyond a mode's end that is rounding
TOLERANCE = {"method": "DOP853", "rtol": 1e-11, "atol": 1e-12}
Vector = np.ndarray
Field = Callable[[Vector], Vector]


@dataclass(frozen=True)
class Filippov:
    """Fields above and below a surface h = 0, its height h and the gradient of that; a phase is one of the states."""

    above: Field
    below: Field
    height: Callable[[Vector], float]
    gradient: Field

    def rates(self, x: Vector) -> tuple[float, float]:
        """Return the rates of the height along the fields above and below."""
        slope = self.gradient(x)
        return float(slope @ self.above(x)), float(slope @ self.below(x))

    def field(self, mode: str, x: Vector) -> Vector:
        """Return the field of a mode; Filippov's convex combination on the surface."""
        if mode != SLIDING:
            return self.above(x) if mode == ABOVE else self.below(x)
        up, down = self.rates(x)
        share = down / (down - up)
        return share * self.above(x) + (1.0 - share) * self.below(x)

    def onto(self, x: Vector) -> Vector:
        """Return the state moved onto the surface along the gradient."""
        for _ in range(4):
            slope = self.gradient(x)
            x = x - self.height(x) * slope / (slope @ slope)
        return x


@dataclass
class Course:
    """A motion: where its mode changes, its states between, and how near to tangency it came."""

    times: list[float] = field(default_factory=list)
    """Times of the events."""
    modes: list[str] = field(default_factory=list)
    """Modes from the start and from each event."""
    states: list[Vector] = field(default_factory=list)
    """States at the start and at the events."""
    stretches: list[Callable[[float], Vector]] = field(default_factory=list)
    narrow: list[tuple[float, float]] = field(default_factory=list)
    """Times at which the motion comes near to another course, and how near: a rate, or the root of a height."""
    ended: str = ""
    """Why no motion goes on before the end; empty at the end."""
    t_end: float = 0.0

    def __call__(self, t: float) -> Vector:
        """Return the state at a time."""
        return self.stretches[int(np.searchsorted(self.times, t, side="right"))](t)

    def clear_until(self, least: float) -> float:
        """Return the time until which the motion stays farther from any other course than `least`."""
        return min([t for t, slack in self.narrow if slack < least], default=self.t_end)


def course(system: Filippov, x: Vector, t_end: float, mode: str = "", most: int = 400) -> Course:
    """Return the motion from a state off the surface, or on it in a mode that is given."""
    x, t = np.array(x, dtype=float), 0.0
    made = Course(t_end=t_end)
    mode = mode or (ABOVE if system.height(x) > 0.0 else BELOW)
    made.modes.append(mode)
    made.states.append(x)
    for _ in range(most):
        t, x, left = _stretch(system, mode, t, x, t_end, made)
        if not left:
            return made
        if mode == SLIDING:
            mode = left
            up, down = system.rates(x)
            made.narrow.append((t, min(abs(down if mode == ABOVE else up), abs(_bend(system, mode, x)))))
        else:
            x = system.onto(x)
            up, down = system.rates(x)
            own, beyond = (-up, down) if mode == ABOVE else (down, -up)
            made.narrow.append((t, min(abs(own), abs(beyond))))
            mode = SLIDING if beyond > 0.0 else (BELOW if mode == ABOVE else ABOVE)
        made.times.append(t)
        made.modes.append(mode)
        made.states.append(x)
    made.ended, made.t_end = "too many events", t
    return made


def _bend(system: Filippov, mode: str, x: Vector) -> float:
    """Return the second rate of the height along the field of a mode."""
    step = 1e-6
    i = 0 if mode == ABOVE else 1
    f = system.field(mode, x)
    return (system.rates(x + step * f)[i] - system.rates(x - step * f)[i]) / (2.0 * step)


def _bends(system: Filippov, x: Vector) -> Vector:
    """Return how the rates along both fields change along the sliding field."""
    step = 1e-6 * system.field(SLIDING, x)
    return (np.array(system.rates(x + step)) - np.array(system.rates(x - step))) / 2e-6


def _dips(system: Filippov, mode: str, run: Any) -> list[tuple[float, float]]:
    """Return times at which a motion comes nearest to its mode's end, and how near: negative where it was beyond."""
    if mode == SLIDING:
        found = [(s, -system.rates(y)[0]) for s, y in zip(run.t_events[2], run.y_events[2], strict=True)]
        return found + [(s, system.rates(y)[1]) for s, y in zip(run.t_events[3], run.y_events[3], strict=True)]
    sign = 1.0 if mode == ABOVE else -1.0
    return [(s, sign * system.height(y)) for s, y in zip(run.t_events[1], run.y_events[1], strict=True)]


def _events(system: Filippov, mode: str) -> list[Callable[[float, Vector], float]]:
    if mode == SLIDING:
        found = [
            lambda _, x: system.rates(x)[0],
            lambda _, x: system.rates(x)[1],
            lambda _, x: _bends(system, x)[0],
            lambda _, x: _bends(system, x)[1],
        ]
        ways = (1.0, -1.0, -1.0, 1.0)
        ends = (True, True, False, False)
    else:
        i = 0 if mode == ABOVE else 1
        found = [lambda _, x: system.height(x), lambda _, x: system.rates(x)[i]]
        ways = (-1.0, 1.0) if mode == ABOVE else (1.0, -1.0)
        ends = (True, False)
    for event, way, end in zip(found, ways, ends, strict=True):
        event.direction, event.terminal = way, end  # type: ignore[attr-defined]
    return found


def _stretch(system: Filippov, mode: str, t: float, x: Vector, t_end: float, made: Course) -> tuple[float, Vector, str]:
    """Follow one mode to its end: time, state, and the mode to which sliding ends, or the own name; "" at the end."""
    events = _events(system, mode)

    def rate(_: float, y: Vector) -> Vector:
        return system.field(mode, y)

    longest = 0.1
    for _ in range(4):
        run = solve_ivp(rate, (t, t_end), x, events=events, max_step=longest, dense_output=True, **TOLERANCE)
        if run.status < 0:
            made.ended, made.t_end = run.message, run.t[-1]
            return t, x, ""
        last = t_end if run.status == 0 else run.t[-1] - 1e-9
        dips = [dip for dip in _dips(system, mode, run) if t + 1e-9 < dip[0] < last]
        if all(height > -_ROUNDING for _, height in dips):
            break
        longest *= 0.25  # the end was crossed twice within a step
    else:
        made.ended, made.t_end = "a touch that no step resolves", float(dips[0][0])
        return t, x, ""
    made.narrow += [(s, float(np.sqrt(max(height, 0.0)))) for s, height in dips]
    made.stretches.append(_exact(rate, run))
    if run.status == 0:
        return t_end, run.y[:, -1], ""
    if mode == SLIDING:
        which = 0 if len(run.t_events[0]) else 1
        at, x = _polished(rate, run, events[which])
        return at, system.onto(x), (ABOVE, BELOW)[which]
    at, x = _polished(rate, run, events[0])
    return at, x, mode


def _polished(rate: Callable, run: Any, event: Callable) -> tuple[float, Vector]:
    """Return time and state of the event that ended a run, by short integrations in place of the dense output."""
    at = float(run.t[-1])
    begin = max(len(run.t) - 2, 0)
    t0, x0 = float(run.t[begin]), run.y[:, begin]
    step = 1e-6
    x = x0
    for _ in range(4):
        x = solve_ivp(rate, (t0, at), x0, **TOLERANCE).y[:, -1] if at != t0 else x0
        f = rate(at, x)
        slope = (event(at, x + step * f) - event(at, x - step * f)) / (2.0 * step)
        if slope == 0.0:
            break
        at -= event(at, x) / slope
    x = solve_ivp(rate, (t0, at), x0, **TOLERANCE).y[:, -1] if at != t0 else x0
    return at, x


def _exact(rate: Callable, run: Any) -> Callable[[float], Vector]:
    """Return states between a run's steps, integrated from the last step before each time."""

    def at(t: float) -> Vector:
        begin = max(int(np.searchsorted(run.t, t, side="right")) - 1, 0)
        t0, x0 = float(run.t[begin]), run.y[:, begin]
        return x0 if t <= t0 else solve_ivp(rate, (t0, t), x0, **TOLERANCE).y[:, -1]

    return at
