"""Floor 4: branches of periodic orbits by pseudo-arclength continuation."""

from saltus.continuation.arclength import StepControl
from saltus.continuation.branch import Branch, SpecialPoint, SpecialPoints
from saltus.continuation.orbits import continue_orbit

__all__ = ["Branch", "SpecialPoint", "SpecialPoints", "StepControl", "continue_orbit"]
