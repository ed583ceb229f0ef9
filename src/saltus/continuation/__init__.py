"""Branches and loci of periodic orbits by pseudo-arclength continuation; each name is imported on first use."""

from saltus.doors import opened

__getattr__, __dir__, __all__ = opened(__name__, __file__)
