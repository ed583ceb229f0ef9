"""Periodic orbits of hybrid systems."""

from saltus.orbits.find import find_orbit
from saltus.orbits.orbit import PeriodicOrbit
from saltus.orbits.signature import Segment
from saltus.orbits.solve import solve_orbit

__all__ = ["PeriodicOrbit", "Segment", "find_orbit", "solve_orbit"]
