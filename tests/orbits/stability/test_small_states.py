"""Multipliers of cycles on which a state falls to 1e-120 and grows again, against its logarithm by SciPy."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import saltus

PUMP, LOSS, SATURATION = 6.5, 5.0, 10.0
LASER = saltus.HybridSystem.smooth(  # a laser with a saturable absorber: intensity, gain and absorption
    {
        "I": "I*(-1 + A - B)",
        "A": f"g*({PUMP} - A - A*I)",
        "B": f"g*({LOSS} - B - {SATURATION}*B*I)",
    },
    {"g": 0.01},
)


def _rates(_: float, y: np.ndarray, g: float) -> np.ndarray:
    """Return the rates of log(I), A, B and of their derivatives in the start."""
    intensity, (_, gain, absorption), changes = math.exp(y[0]), y[:3], y[3:].reshape(3, 3)
    matrix = np.array(
        [
            [0.0, 1.0, -1.0],
            [-g * gain * intensity, -g * (1.0 + intensity), 0.0],
            [-g * SATURATION * absorption * intensity, 0.0, -g * (1.0 + SATURATION * intensity)],
        ]
    )
    rates = [
        -1.0 + gain - absorption,
        g * (PUMP - gain - gain * intensity),
        g * (LOSS - absorption - SATURATION * absorption * intensity),
    ]
    return np.concatenate([rates, (matrix @ changes).ravel()])


def _multiplier(g: float, orbit: saltus.results.PeriodicOrbit) -> float:
    """Return the one that is neither 1 nor 0: the trace of the linearised return of log(I), A and B, less 1."""
    start = np.concatenate([[math.log(orbit.x0[0])], orbit.x0[1:], np.eye(3).ravel()])
    found = solve_ivp(_rates, (0.0, orbit.period), start, args=(g,), method="LSODA", rtol=1e-11, atol=1e-13)
    assert found.y[0, -1] == pytest.approx(start[0], abs=1e-5)
    return float(np.trace(found.y[3:, -1].reshape(3, 3)) - 1.0)


@pytest.mark.parametrize("g", [0.02, 0.005, 0.0015])
def test_multipliers_of_pulses_that_grow_from_almost_nothing(g):
    orbit = saltus.find_orbit(LASER, {"g": g}, x0=[1e-2, 6.0, 4.0])
    assert orbit.stable
    assert orbit.multipliers[0].real == pytest.approx(_multiplier(g, orbit), rel=1e-4, abs=1e-5)
    assert abs(orbit.multipliers[1]) < 1e-8


@pytest.mark.parametrize("unit", [1e-9, 1e9])
def test_they_do_not_depend_on_the_unit(unit):
    laser = saltus.HybridSystem.smooth(
        {
            "I": "I*(-1 + A - B)",
            "A": f"g*({PUMP} - A - A*I/{unit!r})",
            "B": f"g*({LOSS} - B - {SATURATION}*B*I/{unit!r})",
        },
        {"g": 0.005},
    )
    orbit = saltus.find_orbit(laser, x0=[1e-2 * unit, 6.0, 4.0])
    assert orbit.stable
    assert orbit.multipliers[0].real == pytest.approx(0.0205194, rel=1e-4)
