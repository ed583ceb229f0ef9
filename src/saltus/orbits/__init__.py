"""Periodic orbits of hybrid systems.

In all modules `u` is the vector of an orbit's unknowns, shape (size + active,), and `J` the Jacobian of its equations
there, shape (size, size) or wider.
"""

from saltus.orbits.find import find_orbit, orbit_near
from saltus.orbits.orbit import PeriodicOrbit
from saltus.orbits.signature import Segment
from saltus.orbits.solve import solve_orbit

__all__ = ["PeriodicOrbit", "Segment", "find_orbit", "orbit_near", "solve_orbit"]
