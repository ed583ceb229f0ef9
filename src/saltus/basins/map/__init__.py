"""Maps of basins: labels over a grid of initial conditions, in memory or in a store."""

from saltus.basins.map.basins import Basins, LabelError, Outcomes
from saltus.basins.map.grid import Grid, Plane
from saltus.basins.map.mapping import map_basins

__all__ = ["Basins", "Grid", "LabelError", "Outcomes", "Plane", "map_basins"]
