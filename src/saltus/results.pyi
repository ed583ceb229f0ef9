"""What computations return; `results.py` reads where each is, and imports it on first use."""

from saltus.basins import (
    Attractors as Attractors,
    Basins as Basins,
    ErosionProfile as ErosionProfile,
)
from saltus.continuation import (
    Audit as Audit,
    Branch as Branch,
    Breach as Breach,
    Cascade as Cascade,
    Diagram as Diagram,
    EquilibriumBranch as EquilibriumBranch,
    EquilibriumLocus as EquilibriumLocus,
    Family as Family,
    Locus as Locus,
    MapBranch as MapBranch,
    MapCascade as MapCascade,
    MapLocus as MapLocus,
    SpecialPoint as SpecialPoint,
)
from saltus.equilibria import Equilibrium as Equilibrium
from saltus.fitting import Fit as Fit
from saltus.flow import Trajectory as Trajectory
from saltus.maps import (
    Iterates as Iterates,
    MapOrbit as MapOrbit,
)
from saltus.optimisation import Optimum as Optimum
from saltus.orbits import PeriodicOrbit as PeriodicOrbit
from saltus.result import Result as Result
from saltus.sweeps import (
    LyapunovSpectrum as LyapunovSpectrum,
    Sweep as Sweep,
)
from saltus.verification import Verification as Verification
