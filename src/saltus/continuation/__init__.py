"""Branches and loci of periodic orbits by pseudo-arclength continuation."""

from saltus.continuation.branches import continue_branch, continue_equilibrium, continue_orbit
from saltus.continuation.core.arclength import StepControl
from saltus.continuation.loci import continue_locus
from saltus.continuation.many.diagram import DiagramOptions, diagram
from saltus.continuation.many.doublings import follow_cascade
from saltus.continuation.many.members import continue_family
from saltus.continuation.results.branch import Branch
from saltus.continuation.results.cascade import Cascade
from saltus.continuation.results.diagram import Diagram
from saltus.continuation.results.equilibrium_branch import EquilibriumBranch
from saltus.continuation.results.equilibrium_locus import EquilibriumLocus
from saltus.continuation.results.family import Family
from saltus.continuation.results.locus import Locus
from saltus.continuation.results.map_cascade import MapCascade
from saltus.continuation.results.map_curve import MapBranch
from saltus.continuation.results.map_locus import MapLocus
from saltus.continuation.results.orbit_curve import OrbitCurve
from saltus.continuation.results.special_points import SpecialPoint, SpecialPoints
from saltus.continuation.runs.options import BranchOptions
from saltus.continuation.switching import grazing_orbits, switch_branch

__all__ = [
    "Branch",
    "BranchOptions",
    "Cascade",
    "Diagram",
    "DiagramOptions",
    "EquilibriumBranch",
    "EquilibriumLocus",
    "Family",
    "Locus",
    "MapBranch",
    "MapCascade",
    "MapLocus",
    "OrbitCurve",
    "SpecialPoint",
    "SpecialPoints",
    "StepControl",
    "continue_branch",
    "continue_equilibrium",
    "continue_family",
    "continue_locus",
    "continue_orbit",
    "diagram",
    "follow_cascade",
    "grazing_orbits",
    "switch_branch",
]
