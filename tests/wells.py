"""A forced oscillator in a double well, whose two attractors have trapping regions made by hand."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from saltus.ensemble.ensemble import Ensemble
from saltus.ensemble.traps import DIVERGED, UNDECIDED, Ellipsoids, Traps
from saltus.progress import Progress
from saltus.system import HybridSystem, Mode

BOX = {"x": (-2.0, 2.0, 30), "v": (-2.0, 2.0, 20)}


def double_well(name: str = "double well") -> HybridSystem:
    """Return x'' + c x' - x + x^3 = A cos s."""
    return HybridSystem(
        ("x", "v"),
        {"c": 0.5, "A": 0.05, "w": 1.0},
        {"well": Mode({"x": "v", "v": "-c*v + x - x**3 + A*cos(s)"})},
        phase=("s", "w"),
        name=name,
    )


@dataclass
class Wells:
    """Two attractors as `map_basins` reads them."""

    system: HybridSystem
    points: dict[str, Any]
    radius: float = 0.2
    parameters: dict[str, float] = field(default_factory=dict)
    interval: None = None
    kinds: dict[str, str] = field(default_factory=lambda: {"right": "period-1", "left": "period-1"})
    notes: dict[str, str] = field(default_factory=lambda: {"right": "a ball", "left": "a ball"})
    labels: dict[str, int] = field(
        default_factory=lambda: {"right": 0, "left": 1, "diverged": DIVERGED, "undecided": UNDECIDED}
    )
    measured_error: float = 0.0
    traps_of: Any = None
    names = ("right", "left")

    @property
    def traps(self) -> Traps:
        if self.traps_of is not None:
            return self.traps_of.traps
        centres = np.concatenate([self.points[name] for name in self.names])
        shapes = np.array([np.eye(2) / self.radius] * 2)
        return Traps(2, Ellipsoids(centres, shapes, np.array([0, 1], np.uint8)))

    def but(self, **changes: Any) -> Wells:
        return replace(self, **changes)


def wells(system: HybridSystem) -> Wells:
    """Return the attractors of `double_well`: what two motions have become after 60 periods."""
    points, _ = Ensemble(system, {}).strobe([[1.0, 0.0], [-1.0, 0.0]], count=60)
    return Wells(system, {"right": points[:1], "left": points[1:]})


class Interrupt:
    """A progress that acts as Ctrl-C does, at the last of some reports of cells."""

    def __init__(self, calls: int) -> None:
        self.left = calls

    def __call__(self, progress: Progress) -> None:
        self.left -= progress.text == "labelling cells"
        if self.left <= 0:
            raise KeyboardInterrupt
