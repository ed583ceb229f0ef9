"""Attractors and their trapping regions."""

from saltus.basins.attractors.attractors import Attractors, Search, attractors_from, find_attractors

__all__ = ["Attractors", "Search", "attractors_from", "find_attractors"]
