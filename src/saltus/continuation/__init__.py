"""Floor 4: branches and loci of periodic orbits by pseudo-arclength continuation."""

from saltus.continuation.arclength import StepControl
from saltus.continuation.branch import Branch
from saltus.continuation.family import Family
from saltus.continuation.loci import continue_locus
from saltus.continuation.locus import Locus
from saltus.continuation.members import continue_family
from saltus.continuation.orbit_curve import OrbitCurve
from saltus.continuation.orbits import continue_orbit
from saltus.continuation.special_points import SpecialPoint, SpecialPoints
from saltus.continuation.switching import Cascade, follow_cascade, switch_branch

__all__ = [
    "Branch",
    "Cascade",
    "Family",
    "Locus",
    "OrbitCurve",
    "SpecialPoint",
    "SpecialPoints",
    "StepControl",
    "continue_family",
    "continue_locus",
    "continue_orbit",
    "follow_cascade",
    "switch_branch",
]
