"""Maps: iterates, fixed points and orbits, multipliers, conditions of their bifurcations."""

from saltus.system.cache import let_numba_cache

let_numba_cache()

from saltus.maps.iterates import Iterates, iterate  # noqa: E402
from saltus.maps.orbit import MapOrbit  # noqa: E402
from saltus.maps.problem import MapOrbitProblem  # noqa: E402

__all__ = ["Iterates", "MapOrbit", "MapOrbitProblem", "iterate"]
