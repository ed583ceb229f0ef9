"""Systems of the textbooks in other units of states, time and parameter: what is found must be the same."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from saltus import (
    HybridSystem,
    Map,
    Mode,
    Transition,
    continue_equilibrium,
    continue_locus,
    continue_orbit,
    filippov,
    find_equilibrium,
    find_orbit,
)

SMALL, LARGE = 1e-9, 1e9
UNITS = ("small", "large", "mixed", "mixed, turned", "fast", "slow", "parameter small", "parameter large")
TOLERANCES = (1e-12, 1e-10, 1e-8, 1e-6, 1e-5)


@dataclass(frozen=True)
class Units:
    """What one is in new units: of each state in turn, of a rate (of all of them), and of the varied parameters."""

    states: tuple[float, ...] = (1.0,)
    rate: float = 1.0
    parameter: float = 1.0

    def of(self, n: int) -> np.ndarray:
        return np.resize(np.array(self.states), n)


NAMED = {
    "one": Units(),
    "small": Units((SMALL,)),
    "large": Units((LARGE,)),
    "mixed": Units((SMALL, LARGE)),
    "mixed, turned": Units((LARGE, 1.0, SMALL)),
    "fast": Units(rate=1e6),
    "slow": Units(rate=1e-6),
    "parameter small": Units(parameter=SMALL),
    "parameter large": Units(parameter=LARGE),
}


def drawn(seed: int) -> Units:
    """Return random units of all kinds at once."""
    draw = np.random.default_rng(seed)
    states = tuple(10.0 ** draw.uniform(-9.0, 9.0, 3))
    return Units(states, 10.0 ** draw.uniform(-6.0, 6.0), 10.0 ** draw.uniform(-9.0, 9.0))


@dataclass(frozen=True)
class Written:
    """A system in texts; transitions: source, target, event, direction, reset. A map has one mode and no name of it."""

    states: tuple[str, ...]
    parameters: dict[str, float]
    modes: dict[str, dict[str, str]]
    start: tuple[float, ...]
    parameter: str
    interval: tuple[float, float]
    transitions: tuple[tuple[str, str, str, int, dict[str, str]], ...] = ()
    phase: tuple[str, str] | None = None
    second: tuple[str, tuple[float, float]] | None = None
    kind: str = "orbit"
    sweep: tuple[float, ...] = ()
    surface: str = ""  # where the two fields of a Filippov system meet

    @property
    def varied(self) -> tuple[str, ...]:
        return (self.parameter,) + ((self.second[0],) if self.second else ())

    def text(self, formula: str) -> str:
        """Return a formula with states and varied parameters in new units, which are parameters themselves."""
        new = {x: f"({x}/U_{x})" for x in self.states} | {p: f"({p}/U_p)" for p in self.varied}
        names = re.compile(r"\b(" + "|".join(new) + r")\b")
        return names.sub(lambda found: new[found.group()], formula)

    def values(self, units: Units) -> dict[str, float]:
        """Return all parameters in new units."""
        own = {p: value * (units.parameter if p in self.varied else 1.0) for p, value in self.parameters.items()}
        sizes = dict(zip((f"U_{x}" for x in self.states), units.of(len(self.states)).tolist(), strict=True))
        return own | sizes | {"U_p": units.parameter} | ({} if self.kind == "map" else {"R": units.rate})

    def system(self, units: Units) -> HybridSystem | Map:
        """Return the system in new units."""
        if self.kind == "map":
            image = {x: f"U_{x}*({self.text(text)})" for x, text in self.modes["map"].items()}
            return Map(self.states, self.values(units), image)
        fields = {
            name: {x: f"U_{x}*R*({self.text(text)})" for x, text in rates.items()} for name, rates in self.modes.items()
        }
        phase = None if self.phase is None else (self.phase[0], f"R*({self.text(self.phase[1])})")
        if self.kind == "filippov":
            given: Any = {"surface": self.event(self.surface), "phase": phase, "pull": "R", **fields}
            return filippov(self.states, self.values(units), **given)
        events = [
            Transition(
                source, target, self.event(event), direction,
                {x: f"U_{x}*({self.text(text)})" for x, text in reset.items()}, name=f"event{i}",
            )
            for i, (source, target, event, direction, reset) in enumerate(self.transitions)
        ]  # fmt: skip
        modes = {name: Mode(rates) for name, rates in fields.items()}
        return HybridSystem(self.states, self.values(units), modes, events, phase=phase)

    def event(self, event: str) -> str:
        """Return an event function in the unit of the first state in it."""
        first = next((x for x in self.states if re.search(rf"\b{x}\b", event)), None)
        return self.text(event) if first is None else f"U_{first}*({self.text(event)})"

    def x0(self, units: Units) -> list[float]:
        return (np.array(self.start) * units.of(len(self.start))).tolist()

    def bounds(self, units: Units) -> tuple[float, float]:
        low, high = self.interval
        return low * units.parameter, high * units.parameter

    def limits(self, units: Units) -> dict[str, tuple[float, float]]:
        """Return the intervals of both parameters of a locus."""
        assert self.second is not None
        low, high = self.second[1]
        return {self.parameter: self.bounds(units), self.second[0]: (low * units.parameter, high * units.parameter)}


def start_of(case: Written, units: Units, tolerance: float) -> Any:
    """Return the orbit or equilibrium that is found at the start."""
    system, x0 = case.system(units), case.x0(units)
    if case.kind == "equilibrium":
        return find_equilibrium(system, x0=x0)
    return find_orbit(system, x0=x0, **({} if case.kind == "map" else {"tolerance": tolerance}))


def branch_of(case: Written, units: Units, tolerance: float) -> Any:
    """Return the branch from the start."""
    follow = continue_equilibrium if case.kind == "equilibrium" else continue_orbit
    return follow(start_of(case, units, tolerance), case.parameter, case.bounds(units))


def loci_of(case: Written, branch: Any, units: Units) -> dict[str, Any]:
    """Return the loci of the first special point of each type."""
    found: dict[str, Any] = {}
    for point in branch.special_points:
        if point.type in ("SN", "PD", "TR", "GR", "HB") and point.type not in found:
            found[point.type] = continue_locus(point, case.varied, case.limits(units))
    return found


NUMBER = re.compile(r"[-+]?\d+\.?\d*(?:e[-+]?\d+)?")


def told(curve: Any, names: tuple[str, ...], units: Units) -> dict[str, Any]:
    """Return special points in units of one, and the words of the ends and of the audit without their numbers."""
    points = [(p.type, *(p.parameters[name] / units.parameter for name in names)) for p in curve.special_points]
    return {
        "points": sorted(points),
        "words": sorted(NUMBER.sub("#", words) for words in curve.stopped),
        "audit": [breach.check for breach in curve.audit.breaches],
    }


def assert_same(one: Mapping[str, Any], other: Mapping[str, Any], error: float) -> None:
    """Assert that what two curves tell is the same, places up to a relative error."""
    assert [p[0] for p in other["points"]] == [p[0] for p in one["points"]], (one["points"], other["points"])
    for (kind, *place), (_, *there) in zip(one["points"], other["points"], strict=True):
        assert np.allclose(there, place, rtol=error, atol=error), (kind, place, there)
    assert other["words"] == one["words"], (one["words"], other["words"])
    assert other["audit"] == one["audit"], (one["audit"], other["audit"])


_IMPACT = (("free", "free", "x - d", 1, {"v": "-e*v"}),)
_DRIVE = ("s", "w")

CASES = {
    "two wells": Written(
        ("x", "v"), {"A": 0.2, "w": 1.0}, {"m": {"x": "v", "v": "A*cos(s) - 0.2*v + x - x**3"}}, (1.0, 0.0),
        "A", (0.05, 0.3), phase=_DRIVE, second=("w", (0.8, 1.3)), sweep=(0.2, 0.26, 0.275, 0.3),
    ),
    "van der Pol": Written(
        ("x", "v"), {"m": 1.0}, {"m": {"x": "v", "v": "m*(1 - x**2)*v - x"}}, (2.0, 0.0), "m", (0.1, 6.0),
    ),
    "van der Pol, driven": Written(
        ("x", "v"), {"A": 1.2, "w": 1.1}, {"m": {"x": "v", "v": "0.4*(1 - x**2)*v - x + A*cos(s)"}}, (1.0, 0.0),
        "w", (0.9, 1.6), phase=_DRIVE, second=("A", (0.3, 1.5)), sweep=(1.0, 1.1, 1.5),
    ),
    "hard stop": Written(
        ("x", "v"), {"A": 1.0, "w": 0.9, "d": 1.0, "e": 0.8}, {"free": {"x": "v", "v": "-x - 0.1*v + A*cos(s)"}},
        (0.0, 0.0), "w", (0.5, 1.4), _IMPACT, _DRIVE, ("A", (0.5, 1.5)), sweep=(0.7, 0.9, 1.2),
    ),
    "hard stop, grazing": Written(
        ("x", "v"), {"A": 0.4, "w": 0.7, "d": 1.0, "e": 0.8}, {"free": {"x": "v", "v": "-x - 0.1*v + A*cos(s)"}},
        (0.0, 0.0), "A", (0.3, 1.2), _IMPACT, _DRIVE, ("w", (0.6, 0.8)),
    ),
    "soft stop": Written(
        ("x", "v"), {"A": 0.3, "w": 0.9, "k": 20.0, "d": 0.5},
        {"free": {"x": "v", "v": "A*cos(s) - 0.1*v - x"},
         "contact": {"x": "v", "v": "A*cos(s) - 0.1*v - x - k*(x - d)"}},
        (0.0, 0.0), "w", (0.6, 1.8),
        (("free", "contact", "x - d", 1, {}), ("contact", "free", "x - d", -1, {})), _DRIVE,
    ),
    "ball": Written(
        ("z", "v"), {"a": 1.2, "e": 0.5, "w": 1.0}, {"flight": {"z": "v", "v": "-1"}}, (0.6, 3.14), "a", (1.05, 2.0),
        (("flight", "flight", "z - a*sin(q)", -1, {"v": "-e*v + (1 + e)*a*w*cos(q)"}),), ("q", "w"), sweep=(1.2, 1.9),
    ),
    "stick-slip": Written(
        ("x", "v"), {"u": 0.5, "f": 1.0, "g": 0.4},
        {"slip": {"x": "v", "v": "-x - 0.05*v + f*(1 - g*(u - v))"}, "stick": {"x": "u", "v": "0"}}, (0.0, 0.0),
        "u", (0.2, 2.0), (("slip", "stick", "v - u", 1, {"v": "u"}), ("stick", "slip", "x - f + 0.05*u", 1, {})),
        second=("g", (0.2, 0.6)),
    ),
    "relay": Written(
        ("x", "y", "z"), {"b": 1.0, "k": 1.0},
        {"up": {"x": "-x + k", "y": "x - y", "z": "y - b*z"}, "down": {"x": "-x - k", "y": "x - y", "z": "y - b*z"}},
        (0.5, 0.2, 0.1), "b", (0.3, 2.0), (("up", "down", "z", 1, {}), ("down", "up", "z", -1, {})),
    ),
    "boost converter": Written(
        ("i", "v"), {"I": 0.4, "E": 10.0, "r": 1.0},
        {"on": {"i": "E/10", "v": "-v*r/24"}, "off": {"i": "(E - v)/10", "v": "(i - v*r/200)*8.3333333"},
         "empty": {"i": "0", "v": "-v*r/24"}},
        (0.3, 13.0), "I", (0.2, 1.4),
        (("on", "off", "i - I", 1, {}), ("off", "on", "sin(s)", 1, {}), ("off", "empty", "i", -1, {"i": "0"}),
         ("empty", "on", "sin(s)", 1, {})), ("s", "6.283185307179586"),
    ),
    "integrate and fire": Written(
        ("u",), {"I": 1.14, "a": 0.2, "w": 3.0}, {"m": {"u": "I - u + a*sin(s)"}}, (0.2,), "I", (0.9, 1.6),
        (("m", "m", "u - 1", 1, {"u": "0"}),), _DRIVE, ("a", (0.1, 0.4)), sweep=(1.14, 1.3),
    ),
    "integrate and fire, adaptive": Written(
        ("u", "y"), {"I": 1.6, "a": 0.3, "b": 0.5}, {"m": {"u": "I - u - y", "y": "-a*y"}}, (0.0, 0.1), "I", (1.1, 3.0),
        (("m", "m", "u - 1", 1, {"u": "0", "y": "y + b"}),),
    ),
    "prey and predator": Written(
        ("x", "y"), {"K": 3.0, "m": 0.5}, {"m": {"x": "x*(1 - x/K) - x*y/(1 + x)", "y": "y*(x/(1 + x) - m)"}},
        (1.0, 1.3), "K", (0.5, 6.0), kind="equilibrium", second=("m", (0.2, 0.8)),
    ),
    "prey and predator, cycles": Written(
        ("x", "y"), {"K": 4.0, "m": 0.5}, {"m": {"x": "x*(1 - x/K) - x*y/(1 + x)", "y": "y*(x/(1 + x) - m)"}},
        (0.5, 1.3), "K", (3.2, 6.0),
    ),
    "Brusselator": Written(
        ("x", "y"), {"b": 1.5, "a": 1.0}, {"m": {"x": "a - (b + 1)*x + x**2*y", "y": "b*x - x**2*y"}}, (1.0, 1.5),
        "b", (1.0, 4.0), kind="equilibrium", second=("a", (0.5, 1.5)),
    ),
    "Brusselator, cycles": Written(
        ("x", "y"), {"b": 2.5}, {"m": {"x": "1 - (b + 1)*x + x**2*y", "y": "b*x - x**2*y"}}, (1.0, 1.0),
        "b", (1.9, 4.0),
    ),
    "Bazykin": Written(
        ("x", "y"), {"a": 0.4, "d": 0.2},
        {"m": {"x": "x - x*y/(1 + a*x) - 0.01*x**2", "y": "-y + x*y/(1 + a*x) - d*y**2"}}, (2.2, 1.8), "a", (0.05, 0.8),
        kind="equilibrium", second=("d", (0.01, 0.6)),
    ),
    "Roessler": Written(
        ("x", "y", "z"), {"c": 2.5, "a": 0.2}, {"m": {"x": "-y - z", "y": "x + a*y", "z": "0.2 + z*(x - c)"}},
        (3.0, 0.0, 0.1), "c", (2.0, 3.2), second=("a", (0.15, 0.25)),
    ),
    "Lorenz": Written(
        ("x", "y", "z"), {"r": 350.0}, {"m": {"x": "10*(y - x)", "y": "x*(r - z) - y", "z": "x*y - 8*z/3"}},
        (10.0, 20.0, 300.0), "r", (150.0, 400.0),
    ),
    "belt": Written(
        ("x", "v"), {"w": 0.6, "F": 0.4, "u": 0.3},
        {"above": {"x": "v", "v": "cos(s) - x - F"}, "below": {"x": "v", "v": "cos(s) - x + F"}},
        (1.0, 0.0), "w", (0.4385, 0.7), phase=_DRIVE, second=("F", (0.3, 0.6)), kind="filippov", surface="v - u",
    ),
    "planar, sliding": Written(
        ("x", "y"), {"mu": 1.1}, {"above": {"x": "x*(mu - x**2 - y**2) - y", "y": "y*(mu - x**2 - y**2) + x"},
                                  "below": {"x": "0", "y": "1"}},
        (1.0, 0.2), "mu", (0.8, 1.3), kind="filippov", surface="y + 1",
    ),
    "relay, sliding": Written(
        ("x", "y", "q"), {"r": 0.8, "l": 0.5},
        {"above": {"x": "-(0.4 + l)*x + y - 1", "y": "-(0.4*l + 1)*x + q + 0.2*r", "q": "-l*x - r**2"},
         "below": {"x": "-(0.4 + l)*x + y + 1", "y": "-(0.4*l + 1)*x + q - 0.2*r", "q": "-l*x + r**2"}},
        (0.5, 0.2, 1.0), "r", (0.7, 1.3), kind="filippov", surface="x", second=("l", (0.4, 0.6)),
    ),
    "Henon": Written(("x", "y"), {"a": 0.2, "b": 0.3}, {"map": {"x": "1 - a*x**2 + y", "y": "b*x"}}, (0.6, 0.2),
                     "a", (0.0, 1.4), kind="map", second=("b", (0.2, 0.4)), sweep=(0.2, 0.6, 1.0, 1.4)),
    "delayed logistic": Written(("x", "y"), {"r": 1.9}, {"map": {"x": "r*x*(1 - y)", "y": "x"}}, (0.47, 0.47),
                                "r", (1.5, 2.5), kind="map", sweep=(1.9, 2.1, 2.25)),
    "logistic": Written(("x",), {"r": 2.8}, {"map": {"x": "r*x*(1 - x)"}}, (0.6,), "r", (0.5, 4.0), kind="map",
                        sweep=(2.8, 3.2, 3.5, 3.83, 4.0)),
}  # fmt: skip
