"""A block on a rough floor, pulled by a spring: its stick-slip orbits end where the stay in stick has no length."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from selection import guarding

# mass, stiffness, speed of the pull, friction that breaks, friction at which the branch starts
BLOCKS = [
    (10.0, 4000.0, 0.01, 0.3, 0.2),
    (1.0, 1.0, 0.1, 0.4, 0.3),
    (2.0, 50.0, 0.3, 0.5, 0.1),
    (10.0, 4000.0, 1e7, 0.3e9, 0.2e9),  # in nm
    (3.0, 700.0, 2e-5, 0.6e-3, 0.5e-3),  # in km
]
G = 9.81


def block(mass: float, stiffness: float, speed: float, static: float, kinetic: float) -> saltus.PeriodicOrbit:
    """Return the stick-slip orbit: u is the spring's length, v the block's speed."""
    system = saltus.HybridSystem(
        ("u", "v"),
        {"mc": kinetic, "ms": static, "V": speed, "m": mass, "k": stiffness},
        {"stick": saltus.Mode({"u": "V", "v": "0"}), "slip": saltus.Mode({"u": "V - v", "v": f"k*u/m - mc*{G}"})},
        [
            saltus.Transition("stick", "slip", f"k*u - ms*m*{G}", 1, name="break"),
            saltus.Transition("slip", "stick", "v", -1, {"v": "0"}, name="hold"),
        ],
    )
    return saltus.find_orbit(system, x0=[0.0, 0.0], mode="stick")


def period(mass: float, stiffness: float, speed: float, static: float, kinetic: float) -> float:
    """Return the period in closed form: slip lasts until v = V (1 - cos) + b sin is 0 again, stick until it breaks."""
    omega, drop = math.sqrt(stiffness / mass), (static - kinetic) * mass * G / stiffness
    slip = (2.0 * math.pi - 2.0 * math.atan(drop * omega / speed)) / omega
    return slip + 2.0 * drop / speed


@pytest.mark.parametrize("parameter", ["mc", "ms"])
@pytest.mark.parametrize("values", guarding([(values,) for values in BLOCKS], (BLOCKS[0],)))
def test_a_branch_ends_where_sticking_has_no_length(values, parameter):
    mass, stiffness, _, static, kinetic = values
    bounds = (0.05 * static, 1.3 * static) if parameter == "mc" else (0.5 * kinetic, 2.0 * static)
    branch = saltus.continue_orbit(block(*values), parameter, bounds)
    (point,) = branch.special_points
    assert point.type == "GR"
    limit = static if parameter == "mc" else kinetic
    assert abs(point.parameters[parameter] - limit) < 1e-6 * (bounds[1] - bounds[0])
    assert point.orbit.period == pytest.approx(2.0 * math.pi * math.sqrt(mass / stiffness), rel=1e-6)
    told = branch.stopped[parameter == "mc"]
    one = "the orbit there without a stay in 'stick' is one of a family at the same parameters"
    assert told.endswith(f"grazing, no branch goes on: {one}")
    pairs = [(static, value) if parameter == "mc" else (value, kinetic) for value in branch.values.tolist()]
    np.testing.assert_allclose(branch.period, [period(*values[:3], *pair) for pair in pairs], rtol=1e-6)
