"""Options of computations; `options.py` reads where each is, and imports it on first use."""

from saltus.basins import (
    AttractorOptions as AttractorOptions,
    BasinOptions as BasinOptions,
    ErosionOptions as ErosionOptions,
)
from saltus.continuation import (
    BranchOptions as BranchOptions,
    DiagramOptions as DiagramOptions,
)
from saltus.fitting import FitOptions as FitOptions
from saltus.flow import SimulationOptions as SimulationOptions
from saltus.optimisation import OptimumOptions as OptimumOptions
from saltus.sweeps import (
    Criteria as Criteria,
    SweepOptions as SweepOptions,
)
