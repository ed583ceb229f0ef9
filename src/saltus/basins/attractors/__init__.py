"""Attractors and their trapping regions."""

from saltus.basins.attractors.attractors import Attractors
from saltus.basins.attractors.finding import attractors_from, find_attractors
from saltus.basins.attractors.found import AttractorOptions

__all__ = ["AttractorOptions", "Attractors", "attractors_from", "find_attractors"]
