"""Branches and loci of periodic orbits by pseudo-arclength continuation."""

from saltus.continuation.arclength import StepControl
from saltus.continuation.branch import Branch
from saltus.continuation.cascade import Cascade
from saltus.continuation.diagram_tracing import DiagramOptions, diagram
from saltus.continuation.diagram_tree import Diagram
from saltus.continuation.doublings import follow_cascade
from saltus.continuation.equilibria import continue_equilibrium
from saltus.continuation.equilibrium_branch import EquilibriumBranch
from saltus.continuation.equilibrium_locus import EquilibriumLocus
from saltus.continuation.family import Family
from saltus.continuation.loci import continue_locus
from saltus.continuation.locus import Locus
from saltus.continuation.map_cascade import MapCascade
from saltus.continuation.map_curve import MapBranch
from saltus.continuation.map_locus import MapLocus
from saltus.continuation.members import continue_family
from saltus.continuation.options import BranchOptions
from saltus.continuation.orbit_curve import OrbitCurve
from saltus.continuation.orbits import continue_orbit
from saltus.continuation.special_points import SpecialPoint, SpecialPoints
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
    "continue_equilibrium",
    "continue_family",
    "continue_locus",
    "continue_orbit",
    "diagram",
    "follow_cascade",
    "grazing_orbits",
    "switch_branch",
]
