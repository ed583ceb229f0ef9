"""Best orbits over parameters under constraints, by exact derivatives."""

from saltus.optimisation.optimum import Optimum
from saltus.optimisation.search import OptimumOptions, optimise

__all__ = ["Optimum", "OptimumOptions", "optimise"]
