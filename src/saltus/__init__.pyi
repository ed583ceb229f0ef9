"""The public names; `__init__.py` reads where each is, and imports it on first use."""

from . import afm as afm
from .basins import (
    Attractors as Attractors,
    BasinOptions as BasinOptions,
    Basins as Basins,
    ErosionOptions as ErosionOptions,
    ErosionProfile as ErosionProfile,
    Plane as Plane,
    erosion_profile as erosion_profile,
    find_attractors as find_attractors,
    map_basins as map_basins,
)
from .continuation import (
    Branch as Branch,
    BranchOptions as BranchOptions,
    Cascade as Cascade,
    Diagram as Diagram,
    DiagramOptions as DiagramOptions,
    EquilibriumBranch as EquilibriumBranch,
    EquilibriumLocus as EquilibriumLocus,
    Family as Family,
    Locus as Locus,
    MapBranch as MapBranch,
    MapCascade as MapCascade,
    MapLocus as MapLocus,
    SpecialPoint as SpecialPoint,
    StepControl as StepControl,
    continue_equilibrium as continue_equilibrium,
    continue_family as continue_family,
    continue_locus as continue_locus,
    continue_orbit as continue_orbit,
    diagram as diagram,
    follow_cascade as follow_cascade,
    grazing_orbits as grazing_orbits,
    switch_branch as switch_branch,
)
from .equilibria import (
    Equilibrium as Equilibrium,
    find_equilibrium as find_equilibrium,
)
from .errors import (
    ChatteringError as ChatteringError,
    ConvergenceError as ConvergenceError,
    DefinitionError as DefinitionError,
    DivergenceError as DivergenceError,
    InputError as InputError,
    MapDivergenceError as MapDivergenceError,
    SaltusError as SaltusError,
    StickingError as StickingError,
    StiffnessError as StiffnessError,
)
from .explorer import (
    explore as explore,
)
from .fitting import (
    Fit as Fit,
    FitOptions as FitOptions,
    MeasuredPoint as MeasuredPoint,
    fit as fit,
)
from .flow import (
    Limits as Limits,
    Trajectory as Trajectory,
    simulate as simulate,
)
from .maps import (
    Iterates as Iterates,
    MapOrbit as MapOrbit,
    iterate as iterate,
)
from .optimisation import (
    Optimum as Optimum,
    OptimumOptions as OptimumOptions,
    optimise as optimise,
)
from .orbits import (
    PeriodicOrbit as PeriodicOrbit,
    find_orbit as find_orbit,
    solve_orbit as solve_orbit,
)
from .progress import Progress as Progress
from .result import (
    Result as Result,
    load as load,
)
from .sweeps import (
    Average as Average,
    Criteria as Criteria,
    LyapunovSpectrum as LyapunovSpectrum,
    Section as Section,
    Sweep as Sweep,
    SweepOptions as SweepOptions,
    lyapunov_spectrum as lyapunov_spectrum,
    run_sweep as run_sweep,
)
from .system import (
    HybridSystem as HybridSystem,
    Map as Map,
    Mode as Mode,
    Piece as Piece,
    Transition as Transition,
)
from .verification import (
    Verification as Verification,
    verify as verify,
)
from .version import __version__ as __version__
