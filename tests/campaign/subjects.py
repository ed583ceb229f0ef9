"""Branches, loci and cascades whose points and words must not depend on rounding, on the steps or on the start.

Nothing is compared here: each function yields what one variant of a subject has, by the subject's name.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

import sliding as sliding_systems
import systems
from oracles.tapping import Tapping
from oracles.textbook import TEXTBOOK
from saltus import (
    HybridSystem,
    Map,
    StepControl,
    continue_equilibrium,
    continue_locus,
    continue_orbit,
    find_equilibrium,
    find_orbit,
    follow_cascade,
    solve_orbit,
    switch_branch,
)
from saltus.afm import table1, tapping_mode

CYCLES = (
    "Brusselator",
    "FitzHugh-Nagumo",
    "Rosenzweig-MacArthur",
    "Holling-Tanner",
    "Sel'kov",
    "Bogdanov-Takens normal form",
    "Morris-Lecar, Hopf",
)
LOCI = {
    "Brusselator": ("A", (0.5, 2.0)),
    "FitzHugh-Nagumo": ("b", (0.3, 1.5)),
    "Rosenzweig-MacArthur": ("m", (0.2, 0.8)),
    "Bazykin": ("d", (0.01, 0.6)),
    "Morris-Lecar, SNIC": ("phi", (0.02, 0.5)),
    "Lorenz, convection": ("s", (5.0, 20.0)),
    "Holling-Tanner": ("h", (0.45, 1.5)),
}
"""Textbook systems whose special points are followed in a second parameter, and its interval."""
HOMOCLINIC = {
    "membrane": (
        {
            "V": "(I - 2*(V + 60) - 2*(1 + tanh((V + 1.2)/18))*(V - 120) - 8*w*(V + 84))/20",
            "w": "phi*(0.5*(1 + tanh((V - 12)/17.4)) - w)*cosh((V - 12)/34.8)",
        },
        {"I": 60.0, "phi": 0.23},
        ("I", (-100.0, 300.0)),
        [0.0, 0.2],
    ),
    "jerk": (
        {"x": "y", "y": "z", "z": "-z - b*y + a*x*(1 - x)"},
        {"a": 0.9, "b": 1.0},
        ("a", (0.2, 9.0)),
        [1.0, 0.0, 0.0],
    ),
}
"""Fields, parameters, the one that varies with its interval, and a start, of cycles that end at homoclinic orbits."""


@dataclass(frozen=True)
class Variant:
    """How a subject is computed: the relative move of its start, the factor of its steps, and from which end."""

    name: str
    moved: float = 0.0
    stretch: float = 1.0
    far: bool = False

    @property
    def steps(self) -> StepControl:
        """The sizes of steps."""
        plain = StepControl()
        return StepControl(initial=plain.initial * self.stretch, largest=plain.largest * self.stretch)


VARIANTS = (
    Variant("plain"),
    Variant("start moved by 1e-13", moved=1e-13),
    Variant("steps longer by 1 %", stretch=1.01),
    Variant("from another point", far=True),
)

Found = Iterator[tuple[str, dict[str, Any]]]


def told(result: Any, names: tuple[str, ...]) -> dict[str, Any]:
    """Return the special points, in an order that no direction decides, and the words of both ends."""
    points = [[point.type, *(point.parameters[name] for name in names)] for point in result.special_points]
    return {"points": sorted(points), "words": sorted(result.stopped)}


def followed(variant: Variant, follow: Any, start: Any, parameter: str, bounds: tuple[float, float]) -> Any:
    """Return a branch; for the variant from another point it is followed again from a place near its end."""
    branch = follow(start, parameter, bounds, steps=variant.steps)
    if not variant.far:
        return branch
    index = int(0.8 * (len(branch) - 1))
    return follow(branch.solution(index), parameter, bounds, steps=variant.steps)


def first_cycle(branch: Any) -> Any:
    """Return the cycle born at the Hopf point of the lowest parameter, whichever way the branch runs."""
    (name,) = branch.varied
    return switch_branch(min(branch.special_points.of_type("HB"), key=lambda point: point.parameters[name]))


def textbook(variant: Variant) -> Found:
    """Branches of equilibria of all textbook systems, of cycles of some, and loci of some."""
    for item in TEXTBOOK.values():
        system = HybridSystem.smooth(item.field, item.parameters, name=item.name)
        start = [x * (1.0 + variant.moved) for x in item.start]
        rest = find_equilibrium(system, {item.parameter: item.value * (1.0 + variant.moved)}, start)
        branch = followed(variant, continue_equilibrium, rest, item.parameter, item.bounds)
        yield f"{item.name}, equilibria", told(branch, (item.parameter,))
        if item.name in CYCLES:
            cycles = followed(variant, continue_orbit, first_cycle(branch), item.parameter, item.bounds)
            yield f"{item.name}, cycles", told(cycles, (item.parameter,))
        if item.name in LOCI:
            yield from textbook_loci(variant, item, branch)


def textbook_loci(variant: Variant, item: Any, branch: Any) -> Found:
    """Loci of all saddle-nodes and Hopf points of a branch."""
    second, interval = LOCI[item.name]
    points = [point for point in branch.special_points if point.type in ("SN", "HB")]
    for i, point in enumerate(sorted(points, key=lambda point: (point.type, point.parameters[item.parameter]))):
        names = (item.parameter, second)
        locus = continue_locus(point, names, {item.parameter: item.bounds, second: interval}, steps=variant.steps)
        yield f"{item.name}, locus {i + 1}, {point.type}", told(locus, names)


def homoclinic(variant: Variant) -> Found:
    """Cycles that end at a homoclinic orbit."""
    for name, (field, parameters, (parameter, bounds), start) in HOMOCLINIC.items():
        system = HybridSystem.smooth(field, parameters, name=name)
        rest = find_equilibrium(system, {}, [x * (1.0 + variant.moved) for x in start])
        branch = continue_equilibrium(rest, parameter, bounds, steps=variant.steps)
        yield (
            f"{name}, cycles",
            told(followed(variant, continue_orbit, first_cycle(branch), parameter, bounds), (parameter,)),
        )


def impacts(variant: Variant) -> Found:
    """A branch of an impact oscillator, and the loci of its points."""
    orbit = find_orbit(systems.impact_oscillator(), {"w": 0.9 * (1.0 + variant.moved)}, [0.0, 0.0])
    branch = followed(variant, continue_orbit, orbit, "w", (0.5, 1.4))
    yield "impact oscillator", told(branch, ("w",))
    yield from loci(variant, "impact oscillator", branch, ("w", "A"), {"w": (0.5, 1.4), "A": (0.5, 1.5)})


def tapping(variant: Variant) -> Found:
    """The paper's branch in frequency, and loci of its points."""
    Omega, x = 1.0, np.array([-0.48489216, 0.8003283])
    system = tapping_mode(table1(), modes=1)
    _, ((t1, touch), (t2, release)) = Tapping(1, Omega).map(x, 1e-7)
    end = 2.0 * math.pi / Omega - t2
    segments = [
        ("flight", "touch", x * (1.0 + variant.moved), t1),
        ("contact", "release", touch, t2 - t1),
        ("flight", "theta", release, end),
    ]
    branch = followed(variant, continue_orbit, solve_orbit(system, {"Omega": Omega}, segments), "Omega", (0.85, 1.3))
    yield "tapping cantilever", told(branch, ("Omega",))
    bounds = {"Omega": (0.8, 1.4), "ybar": (0.03, 0.25)}
    yield from loci(variant, "tapping cantilever", branch, ("Omega", "ybar"), bounds)


def loci(
    variant: Variant, name: str, branch: Any, names: tuple[str, str], bounds: dict[str, tuple[float, float]]
) -> Found:
    """Loci of one special point of each type of a branch of orbits."""
    for kind in ("SN", "PD", "TR", "GR"):
        points = sorted(branch.special_points.of_type(kind), key=lambda point: point.parameters[names[0]])
        if points:
            locus = continue_locus(points[0], names, bounds, steps=variant.steps)
            yield f"{name}, locus of {kind}", told(locus, names)


def cascades(variant: Variant) -> Found:
    """Cascades of a map, of a map carried by a flow, and of a forced oscillator."""
    henon = Map(("x", "y"), {"a": 0.2, "b": 0.3}, {"x": "1 - a*x**2 + y", "y": "b*x"})
    logistic = systems.carried_map(("x",), {"a": 2.8}, {"x": "a*x*(1 - x)"})
    starts = {
        "Henon": (find_orbit(henon, {"a": 0.2 * (1.0 + variant.moved)}, [0.6, 0.2]), "a", (0.0, 1.4)),
        "logistic": (
            solve_orbit(logistic, {}, [("carry", "map", [0.64 * (1.0 + variant.moved), 0.0], 1.0)]), "a", (2.5, 4.0),
        ),
    }  # fmt: skip
    for name, (orbit, parameter, bounds) in starts.items():
        branch = followed(variant, continue_orbit, orbit, parameter, bounds)
        yield name, told(branch, (parameter,))
        cascade = follow_cascade(branch["PD1"], bounds, doublings=3, steps=variant.steps)
        points = [["PD", float(value)] for value in cascade.values]
        yield f"{name}, cascade", {"points": points, "words": [cascade.stopped]}


def sliding(variant: Variant) -> Found:
    """Branches of orbits that slide or come to rest, of pseudo-equilibria, and the loci of sliding bifurcations."""
    cases = {
        "belt": (sliding_systems.belt(), {"w": 0.6}, [1.0, 0.0], "w", (0.4385, 0.7)),
        "belt at rest": (sliding_systems.belt(), {"w": 0.8, "u": 0.0, "F": 0.9}, [1.0, 0.1], "F", (0.7, 0.94)),
        "planar": (sliding_systems.planar(), {}, [1.0, 0.2], "mu", (0.8, 1.3)),
        "relay": (sliding_systems.relay(), {}, [0.5, 0.2, 1.0], "r", (0.7, 1.3)),
        "harvested": (sliding_systems.harvested(), {}, [0.3, 1.0], "P", (1.4, 2.7)),
        "table": (sliding_systems.table(), {}, [0.0, 5.0], "e", (0.3, 0.6)),
    }
    for name, (system, values, x0, parameter, bounds) in cases.items():
        start = [x * (1.0 + variant.moved) for x in x0]
        orbit = find_orbit(system, values, start)
        branch = followed(variant, continue_orbit, orbit, parameter, bounds)
        yield name, told(branch, (parameter,))
        if name == "belt":
            limits = {"w": (0.3, 0.8), "F": (0.3, 0.6)}
            for kind in ("AS", "SS", "GS", "CS"):
                (point,) = branch.special_points.of_type(kind)
                locus = continue_locus(point, ("w", "F"), limits, steps=variant.steps)
                yield f"{name}, locus of {kind}", told(locus, ("w", "F"))
    rest = find_equilibrium(sliding_systems.harvested(), {"P": 1.1}, [0.6, 1.1], mode="sliding")
    branch = followed(variant, continue_equilibrium, rest, "P", (0.5, 2.0))
    yield "harvested, equilibria", told(branch, ("P",))


SUBJECTS = (textbook, homoclinic, impacts, tapping, cascades, sliding)
