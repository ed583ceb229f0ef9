"""Floor 4: attractors, their basins, and measures of the basins' integrity."""

from saltus.basins.attractors import Attractors, Search, attractors_from, find_attractors
from saltus.basins.basins import Basins, LabelError, Outcomes
from saltus.basins.entropy import BasinEntropy, basin_entropy
from saltus.basins.erosion import ErosionProfile, erosion_profile
from saltus.basins.grid import Grid, Plane
from saltus.basins.integrity import (
    Ball,
    FatalPerturbation,
    Volume,
    global_integrity,
    integrity_factor,
    local_integrity,
    minimal_fatal_perturbation,
)
from saltus.basins.mapping import map_basins
from saltus.basins.stability import Stability, basin_stability
from saltus.basins.uncertainty import UncertaintyExponent, uncertainty_by_neighbours, uncertainty_by_shifts
from saltus.basins.wada import WadaTest, wada_by_merging

__all__ = [
    "Attractors",
    "Ball",
    "BasinEntropy",
    "Basins",
    "ErosionProfile",
    "FatalPerturbation",
    "Grid",
    "LabelError",
    "Outcomes",
    "Plane",
    "Search",
    "Stability",
    "UncertaintyExponent",
    "Volume",
    "WadaTest",
    "attractors_from",
    "basin_entropy",
    "basin_stability",
    "erosion_profile",
    "find_attractors",
    "global_integrity",
    "integrity_factor",
    "local_integrity",
    "map_basins",
    "minimal_fatal_perturbation",
    "uncertainty_by_neighbours",
    "uncertainty_by_shifts",
    "wada_by_merging",
]
