"""Random hybrid systems, and their motions by SciPy's DOP853 with an event loop of its own.

A system is drawn from (seed, number) alone: 1 to 4 states, 1 to 3 modes, polynomial fields, affine or quadratic events
in any direction, resets and conditions on some, a phase in half of them. Nothing is made to be well posed: events meet,
resets lead beyond events, fields push back to the surface they come from, and some motions grow without bound.

The event loop reads the same texts as Python expressions and obeys the rules in `saltus.flow.simulation`; it shares
no code with it.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from scipy.integrate import DOP853
from scipy.optimize import brentq, minimize_scalar

TOLERANCE = 1e-12  # relative tolerance of a step of DOP853, and a tenth of the absolute one
SHARING = 4  # systems in a row of one structure, so that each is compiled once for several
ON_SURFACE = 1e-11  # an event function below this at the start of a stretch counts as zero there
SAMPLES = 16  # places in a step at which event functions are looked at
LONGEST_STEP = 0.1  # units of time, so that event functions have few extremes in a step
BOUND = 1e5  # a state beyond it has left every bound that the fields' coefficients could set
CROWD = 15  # events in a row, each within CROWD_TIME of the one before, that count as chattering
CROWD_TIME = 1e-7


@dataclass(frozen=True)
class Drawn:
    """A drawn system, the start of its motions and how long they are.

    Attributes
    ----------
    number : int
        With the seed it gives the same system again.
    definition : dict
        As `saltus.HybridSystem.from_definition` takes it.
    x0 : tuple of float
        Start, at phase 0 where there is a phase.
    mode : str or None
        Mode there; None leaves it to the rule.
    span : float
        Length of a motion in time.
    """

    number: int
    definition: dict[str, Any]
    x0: tuple[float, ...]
    mode: str | None
    span: float

    def __str__(self) -> str:
        d = self.definition
        parts = [f"{len(d['states'])} states, {len(d['modes'])} modes, {len(d['transitions'])} transitions"]
        return ", ".join([*parts, "phase" if d["phase"] else "no phase"])


def draw(seed: int, number: int) -> Drawn:
    """Return a random system: `SHARING` numbers in a row share a structure, and each has coefficients of its own."""
    return _Drawing(seed, number).drawn()


class _Drawing:
    """The generators of structure and coefficients, and the coefficients so far."""

    def __init__(self, seed: int, number: int) -> None:
        self.seed, self.number = seed, number
        self.rng = np.random.default_rng((seed, number // SHARING))
        self.values = np.random.default_rng((seed, number // SHARING, number % SHARING))
        self.parameters: dict[str, float] = {}
        self.states = [f"x{i + 1}" for i in range(int(self.rng.integers(1, 5)))]
        self.forced = bool(self.rng.random() < 0.5)

    def drawn(self) -> Drawn:
        """Return the system."""
        rng, values = self.rng, self.values
        names = [f"m{k}" for k in range(int(rng.choice([1, 2, 3], p=[0.45, 0.4, 0.15])))]
        modes = {name: {"field": self._field(), "domain": None} for name in names}
        transitions: list[dict[str, Any]] = []
        if len(names) > 1 and rng.random() < 0.35:  # two fields that meet on one surface
            event = self._event()
            transitions += [_transition("m0", "m1", event, 1, {}, None), _transition("m1", "m0", event, -1, {}, None)]
        for source in names:
            for _ in range(int(rng.integers(0 if transitions else 1, 3))):
                target = str(rng.choice(names))
                event, direction = self._event(), int(rng.choice([-1, 0, 1]))
                when = self._event() if rng.random() < 0.15 else None
                reset = self._reset() if target == source or rng.random() < 0.4 else {}
                transitions.append(_transition(source, target, event, direction, reset, when))
        for i, transition in enumerate(transitions):
            transition["name"] = f"e{i}"
        self.parameters["mu"] = round(float(values.uniform(-0.2, 0.5)), 3)
        if self.forced:
            self.parameters |= {"A": round(float(values.uniform(0.1, 1.5)), 3)}
            self.parameters |= {"w": round(float(values.uniform(0.6, 2.0)), 3)}
        definition = {
            "name": f"random {self.seed}/{self.number}",
            "states": self.states,
            "parameters": self.parameters,
            "phase": ["theta", "w"] if self.forced else None,
            "modes": modes,
            "transitions": transitions,
        }
        x0 = tuple(round(float(x), 4) for x in values.normal(0.0, 0.7, len(self.states)))
        mode = str(values.choice(names)) if values.random() < 0.5 else None
        span = 6.0 * 2.0 * math.pi / self.parameters["w"] if self.forced else 20.0
        return Drawn(self.number, definition, x0, mode, span)

    def _c(self, value: float) -> str:
        """Return the name of a new coefficient of that value."""
        name = f"c{len(self.parameters)}"
        self.parameters[name] = round(float(value), 4)
        return name

    def _field(self) -> dict[str, str]:
        rng, values, states, n = self.rng, self.values, self.states, len(self.states)
        skew = values.normal(0.0, 1.0, (n, n))
        linear = values.normal(0.0, 0.4, (n, n)) + (skew - skew.T) + values.uniform(0.0, 0.6) * np.eye(n)
        squared = " + ".join(f"{s}**2" for s in states)
        confined = rng.random() < 0.85
        found = {}
        for i, state in enumerate(states):
            terms = [f"{self._c(a)}*{s}" for a, s in zip(linear[i], states, strict=True)]
            terms.append(self._c(values.normal(0.0, 0.4)))
            for _ in range(int(rng.integers(0, 3))):
                a, b = rng.choice(states, 2)
                terms.append(f"{self._c(values.normal(0.0, 0.4))}*{a}*{b}")
            if i == 0:
                terms.append(f"mu*{state}")
            if self.forced and (i == n - 1 or rng.random() < 0.2):
                terms.append(f"A*{rng.choice(['sin', 'cos'])}(theta)")
            if confined:
                terms.append(f"-{self._c(abs(values.normal(0.5, 0.2)) + 0.1)}*{state}*({squared})")
            found[state] = " + ".join(terms)
        return found

    def _event(self) -> str:
        rng, values, states = self.rng, self.values, self.states
        if rng.random() < 0.25:
            centres = [f"({s} - {self._c(values.normal(0.0, 0.4))})**2" for s in states]
            return " + ".join(centres) + f" - {self._c(values.uniform(0.1, 1.5))}"
        chosen = [s for s in states if rng.random() < 0.5] or [str(rng.choice(states))]
        text = " + ".join(f"{self._c(values.normal(0.0, 1.0) or 1.0)}*{s}" for s in chosen)
        text += f" - {self._c(values.uniform(-0.5, 0.5))}"
        shaken = self.forced and rng.random() < 0.3
        return text + f" + {self._c(values.normal(0.0, 0.3))}*sin(theta)" if shaken else text

    def _reset(self) -> dict[str, str]:
        rng, values, states = self.rng, self.values, self.states
        found = {}
        for state in [s for s in states if rng.random() < 0.6] or [str(rng.choice(states))]:
            text = f"{self._c(values.uniform(-1.0, 1.0))}*{state}"
            if rng.random() < 0.4:
                text += f" + {self._c(values.normal(0.0, 0.3))}*{rng.choice(states)}"
            if rng.random() < 0.4:
                text += f" + {self._c(values.normal(0.0, 0.5))}"
            found[state] = text
        return found


def _transition(
    source: str, target: str, event: str, direction: int, reset: dict[str, str], when: str | None
) -> dict[str, Any]:
    return {"source": source, "target": target, "event": event, "direction": direction, "reset": reset, "when": when}


@dataclass
class Motion:
    """A motion by SciPy.

    Attributes
    ----------
    events : list of (float, str)
        Time and name of each transition.
    states : ndarray, shape (time, states)
        States at the times asked for, NaN after the end.
    time, x, mode : float, ndarray, str
        Where it ended.
    ended : str
        "" at the time asked for, "chatter" or "diverged" before.
    slowest : float
        Least rate of an event function at an event, in absolute value.
    """

    events: list[tuple[float, str]]
    states: np.ndarray
    time: float
    x: np.ndarray
    mode: str
    ended: str = ""
    slowest: float = math.inf


@dataclass
class Reference:
    """The event loop of one system at given parameters."""

    definition: dict[str, Any]
    parameters: dict[str, float]
    names: list[str] = field(init=False)

    def __post_init__(self) -> None:
        self.parameters = dict(self.definition["parameters"]) | dict(self.parameters)
        self.names = [*self.definition["states"], *([self.definition["phase"][0]] if self.definition["phase"] else [])]

    def _compiled(self, text: str) -> Callable[[Any], Any]:
        body = f"lambda x: (lambda {', '.join(self.names)}: {text})(*x)"
        return eval(body, {"sin": np.sin, "cos": np.cos, **self.parameters})  # our own texts, drawn above

    @cached_property
    def fields(self) -> dict[str, Callable[[float, Any], Any]]:
        """Right-hand side of each mode."""
        found = {}
        for mode, described in self.definition["modes"].items():
            parts = [described["field"][s] for s in self.definition["states"]]
            parts += [str(self.definition["phase"][1])] if self.definition["phase"] else []
            f = self._compiled(f"({', '.join(parts)},)")
            found[mode] = lambda t, x, f=f: f(x)
        return found

    @cached_property
    def transitions(self) -> list[dict[str, Any]]:
        """Transitions with compiled event, condition and reset."""
        found = []
        for t in self.definition["transitions"]:
            reset = [t["reset"].get(name, name) for name in self.names]
            found.append(
                {
                    **t,
                    "h": self._compiled(t["event"]),
                    "when": self._compiled(t["when"]) if t["when"] else lambda x: 1.0,
                    "map": self._compiled(f"({', '.join(reset)},)"),
                }
            )
        return found

    def starting_mode(self, x: np.ndarray) -> str | None:
        """Return the first mode none of whose events to another mode is passed."""
        for mode in self.definition["modes"]:
            away = [t for t in self.transitions if t["source"] == mode != t["target"]]
            if not any(t["h"](x) * t["direction"] > 0.0 and t["when"](x) > 0.0 for t in away):
                return str(mode)
        return None

    def rate(self, t: dict[str, Any], x: np.ndarray, mode: str) -> float:
        """Return the rate of an event function along the field of a mode."""
        f = np.array(self.fields[mode](0.0, x))
        step = 1e-6 / (1.0 + np.max(np.abs(f)))
        return float((t["h"](x + step * f) - t["h"](x - step * f)) / (2.0 * step))

    def run(self, x0: np.ndarray, mode: str, span: float, times: np.ndarray | None = None, fired: str = "") -> Motion:
        """Return the motion from a full state over a span of time; `fired` is the transition that led there."""
        times = np.empty(0) if times is None else times
        motion = Motion([], np.full((times.size, len(self.names)), np.nan), 0.0, np.array(x0, dtype=float), mode)
        crowd = 0
        while not motion.ended and motion.time < span:
            index, when = self._stretch(motion, span, times, fired)
            if index is None:
                break
            t = self.transitions[index]
            crowd = crowd + 1 if motion.events and when - motion.events[-1][0] < CROWD_TIME else 0
            motion.events.append((when, t["name"]))
            motion.slowest = min(motion.slowest, abs(self.rate(t, motion.x, motion.mode)))
            motion.time, motion.x, motion.mode = when, np.array(t["map"](motion.x), dtype=float), t["target"]
            fired = t["name"]
            if crowd > CROWD:
                motion.ended = "chatter"
        if not motion.ended:
            motion.states[times >= motion.time] = motion.x
        return motion

    def _stretch(self, motion: Motion, span: float, times: np.ndarray, fired: str) -> tuple[int | None, float]:
        """Move on to the next transition, and return its index and time; (None, end) where there is none."""
        own = [(i, t) for i, t in enumerate(self.transitions) if t["source"] == motion.mode]
        sides = {}
        for i, t in own:
            value = t["h"](motion.x)
            if abs(value) < ON_SURFACE:
                rate = self.rate(t, motion.x, motion.mode)
                again = t["name"] == fired and t["target"] == t["source"]
                if rate * t["direction"] > 0.0 and not again and t["when"](motion.x) > 0.0 and abs(rate) > ON_SURFACE:
                    return i, motion.time
                value = rate
            sides[i] = math.copysign(1.0, value)
        field = self.fields[motion.mode]
        solver = DOP853(field, motion.time, motion.x, span, rtol=TOLERANCE, atol=0.1 * TOLERANCE, max_step=LONGEST_STEP)
        left = {i: abs(t["h"](motion.x)) >= ON_SURFACE for i, t in own}
        while solver.status == "running":
            solver.step()
            if solver.status == "failed" or not np.all(np.abs(solver.y) < BOUND):
                motion.ended, motion.time, motion.x = "diverged", solver.t, solver.y
                return None, solver.t
            dense = solver.dense_output()
            found = self._first_crossing(own, sides, left, dense, solver.t_old, solver.t)
            end = solver.t if found is None else found[1]
            inside = (times >= solver.t_old) & (times < end)
            if np.any(inside):
                motion.states[inside] = dense(times[inside]).T
            if found is not None:
                motion.x = dense(found[1])
                return found
        motion.time, motion.x = solver.t, solver.y
        return None, solver.t

    def _first_crossing(
        self, own: list[tuple[int, dict[str, Any]]], sides: dict[int, float], left: dict[int, bool],
        dense: Any, begin: float, end: float,
    ) -> tuple[int, float] | None:  # fmt: skip
        """Return index and time of the first transition in a step; `sides` and `left` follow the event functions."""
        grid = np.linspace(begin, end, SAMPLES + 1)
        # next to the ends, so that an extremum between the outermost samples shows
        grid = np.sort(np.append(grid, [begin + 1e-3 * (grid[1] - begin), end - 1e-3 * (end - grid[-2])]))
        dips = [dip for i, t in own if left[i] for dip in _dips(t["h"], sides[i], dense, grid)]
        grid = np.unique(np.append(grid, dips))
        states = dense(grid)
        values = {i: np.broadcast_to(t["h"](states), grid.shape) for i, t in own}
        for j in range(1, grid.size):
            candidates = []
            for i, t in own:
                value = float(values[i][j])
                if not left[i]:
                    left[i] = abs(value) >= ON_SURFACE
                    sides[i] = math.copysign(1.0, value) if left[i] else sides[i]
                    continue
                if value * sides[i] >= 0.0 and value != 0.0:
                    continue
                old, sides[i] = sides[i], -sides[i]
                h = t["h"]
                a, b = grid[j - 1], grid[j]
                low = h(dense(a))
                when = a if low * old <= 0.0 else brentq(lambda s, h=h: h(dense(s)), a, b, xtol=1e-15, rtol=1e-15)
                if t["direction"] * old <= 0.0 and t["when"](dense(when)) > 0.0:
                    candidates.append((when, i))
            if candidates:
                first = min(when for when, _ in candidates)
                return min((i, when) for when, i in candidates if when <= first + 1e-13)
        return None


def _dips(h: Callable[[Any], Any], side: float, dense: Any, grid: np.ndarray) -> list[float]:
    """Return times between samples at which an event function dips through zero and back."""
    height = side * np.broadcast_to(h(dense(grid)), grid.shape)
    found = []
    for j in range(1, grid.size - 1):
        low, high = min(height[j - 1], height[j + 1]), max(height[j - 1], height[j + 1])
        if 0.0 < height[j] <= low and height[j] < high - height[j]:
            least = minimize_scalar(
                lambda s: side * h(dense(s)),
                bounds=(grid[j - 1], grid[j + 1]),
                method="bounded",
                options={"xatol": 1e-12},
            )
            if least.fun < 0.0:
                found.append(float(least.x))
    return found
