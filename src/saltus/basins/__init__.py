"""Attractors, their basins, and measures of the basins' integrity."""

from saltus.basins.attractors.attractors import Attractors
from saltus.basins.attractors.finding import attractors_from, find_attractors
from saltus.basins.attractors.found import AttractorOptions
from saltus.basins.map.basins import Basins
from saltus.basins.map.grid import Grid, Plane
from saltus.basins.map.mapping import map_basins
from saltus.basins.map.options import BasinOptions
from saltus.basins.map.outcomes import Outcomes
from saltus.basins.map.wrong_labels import LabelError
from saltus.basins.measures.entropy import BasinEntropy, basin_entropy
from saltus.basins.measures.erosion import ErosionProfile
from saltus.basins.measures.integrity import (
    Ball,
    FatalPerturbation,
    Volume,
    global_integrity,
    integrity_factor,
    local_integrity,
    minimal_fatal_perturbation,
)
from saltus.basins.measures.profile import ErosionOptions, erosion_profile
from saltus.basins.measures.stability import Stability, basin_stability
from saltus.basins.measures.uncertainty import UncertaintyExponent, uncertainty_by_neighbours, uncertainty_by_shifts
from saltus.basins.measures.wada import WadaTest, wada_by_merging

__all__ = [
    "AttractorOptions",
    "Attractors",
    "Ball",
    "BasinEntropy",
    "BasinOptions",
    "Basins",
    "ErosionOptions",
    "ErosionProfile",
    "FatalPerturbation",
    "Grid",
    "LabelError",
    "Outcomes",
    "Plane",
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
