"""Attractors and basins; `__init__.py` reads where each name is, and imports it on first use."""

from saltus.basins.attractors.attractors import Attractors as Attractors
from saltus.basins.attractors.finding import (
    attractors_from as attractors_from,
    find_attractors as find_attractors,
)
from saltus.basins.attractors.found import AttractorOptions as AttractorOptions
from saltus.basins.map.basins import Basins as Basins
from saltus.basins.map.grid import (
    Grid as Grid,
    Plane as Plane,
)
from saltus.basins.map.mapping import map_basins as map_basins
from saltus.basins.map.options import BasinOptions as BasinOptions
from saltus.basins.map.outcomes import Outcomes as Outcomes
from saltus.basins.map.wrong_labels import LabelError as LabelError
from saltus.basins.measures.entropy import (
    BasinEntropy as BasinEntropy,
    basin_entropy as basin_entropy,
)
from saltus.basins.measures.erosion import ErosionProfile as ErosionProfile
from saltus.basins.measures.integrity import (
    Ball as Ball,
    FatalPerturbation as FatalPerturbation,
    Volume as Volume,
    global_integrity as global_integrity,
    integrity_factor as integrity_factor,
    local_integrity as local_integrity,
    minimal_fatal_perturbation as minimal_fatal_perturbation,
)
from saltus.basins.measures.profile import (
    ErosionOptions as ErosionOptions,
    erosion_profile as erosion_profile,
)
from saltus.basins.measures.stability import (
    Stability as Stability,
    basin_stability as basin_stability,
)
from saltus.basins.measures.uncertainty import (
    UncertaintyExponent as UncertaintyExponent,
    uncertainty_by_neighbours as uncertainty_by_neighbours,
    uncertainty_by_shifts as uncertainty_by_shifts,
)
from saltus.basins.measures.wada import (
    WadaTest as WadaTest,
    wada_by_merging as wada_by_merging,
)
