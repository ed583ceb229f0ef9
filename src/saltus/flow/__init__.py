"""Compiled flows of hybrid systems.

In all modules `p` is the vector of all parameters, `HybridSystem.parameter_vector`, and a mode is given by its index.
"""

from saltus.system.cache import let_numba_cache

let_numba_cache()

from saltus.flow.saltation import saltation_matrix  # noqa: E402
from saltus.flow.simulation import SimulationOptions, simulate  # noqa: E402
from saltus.flow.trajectory import Trajectory  # noqa: E402

__all__ = ["SimulationOptions", "Trajectory", "saltation_matrix", "simulate"]
