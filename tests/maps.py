"""Maps in closed form, to be followed as an ensemble of motions is, and discs about their points."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from saltus import HybridSystem, Mode
from saltus.basins.attractors.trapping import OrbitEllipsoids


def strobed(image, states=("x",)):
    """A map, to be followed as an ensemble is; motions may start anywhere."""
    system = HybridSystem(states, {}, {"rest": Mode(dict.fromkeys(states, "0"))})

    def strobe(points, modes=None, count=1):
        x = np.array(points, dtype=float)
        for _ in range(count):
            x = image(x)
        return x, np.zeros(len(x), np.int64)

    work = np.zeros(1, np.int64)
    p = system.parameter_vector({})
    anywhere = {
        "admits": lambda x: True,
        "allowing": lambda points, modes: np.ones(len(points), bool),
        "lacked": lambda points, modes=None: np.zeros(np.shape(points), bool),
    }
    return SimpleNamespace(strobe=strobe, system=system, p=p, work=work, left_over=0, **anywhere)


def round_about(point, radius):
    point = np.atleast_1d(point).astype(float)
    return OrbitEllipsoids(point[None], np.eye(point.size)[None], radius**2)
