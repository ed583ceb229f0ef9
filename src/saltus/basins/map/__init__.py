"""Maps of basins: labels over a grid of initial conditions, in memory or in a store."""

from saltus.basins.map.basins import Basins
from saltus.basins.map.grid import Grid, Plane
from saltus.basins.map.mapping import map_basins
from saltus.basins.map.outcomes import Outcomes
from saltus.basins.map.wrong_labels import LabelError

__all__ = ["Basins", "Grid", "LabelError", "Outcomes", "Plane", "map_basins"]
