"""Small sections of the paper's basins for the tests of Figs. 8 to 10, without computing any label."""

from __future__ import annotations

import numpy as np

from saltus.basins import Basins, Grid
from saltus.basins.map.outcomes import Outcomes

STATES = {1: ("q1", "v1"), 2: ("q1", "q2", "v1", "v2")}
REPULSIVE = {1: (-1.18, 0.40), 2: (-1.24, -0.03, 0.40, 0.48)}
ATTRACTIVE = {1: (-0.06, -0.79), 2: (-0.06, 0.0, -0.79, 0.0)}
LABELS = {"attractive": 0, "repulsive": 1, "diverged": 253, "undecided": 254}


def made(labels, modes: int = 2, **frozen: float) -> Basins:
    """Return basins whose free coordinates, q1, v1 and q2 in this order, have the labels given."""
    labels = np.asarray(labels, np.uint8)
    free = ("q1", "v1", "q2")[: labels.ndim]
    axes = {name: (-5.0, 5.0, count) for name, count in zip(free, labels.shape, strict=True)}
    points = {
        "attractive": np.array([ATTRACTIVE[modes]]),
        "repulsive": np.array([REPULSIVE[modes]]),
    }
    return Basins(labels, Grid(STATES[modes], axes | frozen), Outcomes(LABELS, points))
