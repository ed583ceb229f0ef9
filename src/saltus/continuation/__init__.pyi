"""Branches and loci of periodic orbits; `__init__.py` reads where each name is, and imports it on first use."""

from saltus.continuation.branches import (
    continue_branch as continue_branch,
    continue_equilibrium as continue_equilibrium,
    continue_orbit as continue_orbit,
)
from saltus.continuation.core.arclength import StepControl as StepControl
from saltus.continuation.loci import continue_locus as continue_locus
from saltus.continuation.many.diagram import (
    DiagramOptions as DiagramOptions,
    diagram as diagram,
)
from saltus.continuation.many.doublings import follow_cascade as follow_cascade
from saltus.continuation.many.members import continue_family as continue_family
from saltus.continuation.results.audit import (
    Audit as Audit,
    Breach as Breach,
)
from saltus.continuation.results.branch import Branch as Branch
from saltus.continuation.results.cascade import Cascade as Cascade
from saltus.continuation.results.diagram import Diagram as Diagram
from saltus.continuation.results.equilibrium_branch import EquilibriumBranch as EquilibriumBranch
from saltus.continuation.results.equilibrium_locus import EquilibriumLocus as EquilibriumLocus
from saltus.continuation.results.family import Family as Family
from saltus.continuation.results.locus import Locus as Locus
from saltus.continuation.results.map_cascade import MapCascade as MapCascade
from saltus.continuation.results.map_curve import MapBranch as MapBranch
from saltus.continuation.results.map_locus import MapLocus as MapLocus
from saltus.continuation.results.orbit_curve import OrbitCurve as OrbitCurve
from saltus.continuation.results.special_points import (
    SpecialPoint as SpecialPoint,
    SpecialPoints as SpecialPoints,
)
from saltus.continuation.runs.options import BranchOptions as BranchOptions
from saltus.continuation.switching import (
    grazing_orbits as grazing_orbits,
    switch_branch as switch_branch,
)
