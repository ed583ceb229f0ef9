"""The public names; `__init__.py` reads where each is, and imports it on first use."""

from . import afm as afm, errors as errors, options as options, results as results
from .basins import (
    Plane as Plane,
    erosion_profile as erosion_profile,
    find_attractors as find_attractors,
    map_basins as map_basins,
)
from .continuation import (
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
from .equilibria import find_equilibrium as find_equilibrium
from .errors import (
    ConvergenceError as ConvergenceError,
    InputError as InputError,
    SaltusError as SaltusError,
)
from .exploring import explore as explore
from .fitting import (
    MeasuredPoint as MeasuredPoint,
    fit as fit,
)
from .flow import simulate as simulate
from .maps import iterate as iterate
from .optimisation import optimise as optimise
from .orbits import (
    find_orbit as find_orbit,
    solve_orbit as solve_orbit,
)
from .progress import Progress as Progress
from .result import load as load
from .sweeps import (
    Average as Average,
    Section as Section,
    lyapunov_spectrum as lyapunov_spectrum,
    run_sweep as run_sweep,
)
from .system import (
    HybridSystem as HybridSystem,
    Map as Map,
    Mode as Mode,
    Piece as Piece,
    Transition as Transition,
    filippov as filippov,
)
from .verification import verify as verify
from .version import __version__ as __version__
