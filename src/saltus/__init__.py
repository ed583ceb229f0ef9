"""Dynamics of hybrid (piecewise-smooth) systems: orbits, stability, bifurcations, with tapping-mode AFM built in."""

from __future__ import annotations

import importlib
from typing import Any

_HOMES = {
    "saltus.system": ("HybridSystem", "Mode", "Transition"),
    "saltus.flow": ("Trajectory", "simulate"),
    "saltus.orbits": ("PeriodicOrbit", "find_orbit", "solve_orbit"),
    "saltus.continuation": (
        "Branch",
        "Cascade",
        "Family",
        "Locus",
        "SpecialPoint",
        "StepControl",
        "continue_family",
        "continue_locus",
        "continue_orbit",
        "follow_cascade",
        "switch_branch",
    ),
    "saltus.sweeps": (
        "Criteria",
        "LyapunovSpectrum",
        "Section",
        "StickingError",
        "StiffnessError",
        "Sweep",
        "lyapunov_spectrum",
        "run_sweep",
    ),
    "saltus.basins": (
        "Attractors",
        "Basins",
        "ErosionProfile",
        "Plane",
        "erosion_profile",
        "find_attractors",
        "map_basins",
    ),
    "saltus.results": ("Result", "load"),
    "saltus.errors": (
        "ChatteringError",
        "ConvergenceError",
        "DefinitionError",
        "DivergenceError",
        "InputError",
        "SaltusError",
        "StickingError",
        "StiffnessError",
    ),
}
_HOME_OF = {name: home for home, names in _HOMES.items() for name in names}

__all__ = [
    "Attractors",
    "Basins",
    "Branch",
    "Cascade",
    "ChatteringError",
    "ConvergenceError",
    "Criteria",
    "DefinitionError",
    "DivergenceError",
    "ErosionProfile",
    "Family",
    "HybridSystem",
    "InputError",
    "Locus",
    "LyapunovSpectrum",
    "Mode",
    "PeriodicOrbit",
    "Plane",
    "Result",
    "SaltusError",
    "Section",
    "SpecialPoint",
    "StepControl",
    "Sweep",
    "Trajectory",
    "Transition",
    "__version__",
    "continue_family",
    "continue_locus",
    "continue_orbit",
    "erosion_profile",
    "find_attractors",
    "find_orbit",
    "follow_cascade",
    "load",
    "lyapunov_spectrum",
    "map_basins",
    "run_sweep",
    "simulate",
    "solve_orbit",
    "switch_branch",
]


def __getattr__(name: str) -> Any:
    if name == "__version__":
        from importlib.metadata import version

        return version("saltus")
    if name in _HOME_OF:
        value = getattr(importlib.import_module(_HOME_OF[name]), name)
        globals()[name] = value
        return value
    raise AttributeError(f"module 'saltus' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted(__all__)
