"""Fixed points and cycles of maps: equations of their points, multipliers, conditions of their bifurcations."""

from saltus.cycles.orbit import MapOrbit
from saltus.cycles.problem import CycleProblem

__all__ = ["CycleProblem", "MapOrbit"]
