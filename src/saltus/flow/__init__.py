"""Floor 2: compiled flows of hybrid systems."""

from saltus.flow.saltation import saltation_matrix
from saltus.flow.simulate import Trajectory, simulate

__all__ = ["Trajectory", "saltation_matrix", "simulate"]
