"""Branches of relaxation cycles at a loose tolerance: all points of a canard explosion, in any units.

The oracle is SciPy's: folds of cycles by shooting with variational equations, Hopf points by the trace at the rest.
"""

from __future__ import annotations

import numpy as np
import pytest

import saltus
from selection import guarding

# Where the monodromy matrix has the trace 2: DOP853 at 1e-12 for (w, T, I) at a fixed voltage, then `fsolve`.
FOLDS = (88.29325054, 216.89980139)
# Where the trace at the rest vanishes: `brentq` along the branch of rests.
HOPF = (93.8576184, 212.0188161)

UNITS = [
    (1e9, 1e-9),
    (1.0, 13518.798588791862),
    (435375.82017489936, 26890593.710110366),
    (2466.273010498994, 0.01001349376237058),
    (19.38817598540516, 0.0006217975970453871),
    (1.0, 26890593.710110366),
    (890797201.925222, 451893503.5930771),
    (1.0, 164.95618514250182),
    (0.12767580350375807, 215693.4043891993),
    (1.0, 1.0),
]


def neuron(voltage: float, time: float) -> saltus.HybridSystem:
    """Return Morris and Lecar's neuron, a millivolt and a millisecond in the given units."""
    v = f"(v/{voltage!r})"
    current = f"(I - 2*({v}+60) - 4.4*0.5*(1+tanh(({v}+1.2)/18))*({v}-120) - 8*w*({v}+84))/20"
    gate = f"0.04*(0.5*(1+tanh(({v}-2)/30))-w)*cosh(({v}-2)/60)"
    return saltus.HybridSystem.smooth({"v": f"{voltage / time!r}*{current}", "w": f"{1 / time!r}*{gate}"}, {"I": 95.0})


@pytest.mark.campaign
@pytest.mark.parametrize(("voltage", "time"), guarding(UNITS, UNITS[0], campaign=4))
def test_a_canard_is_passed_at_a_loose_tolerance(voltage: float, time: float) -> None:
    orbit = saltus.find_orbit(neuron(voltage, time), x0=[0.0, 0.4], tolerance=1e-5)
    branch = saltus.continue_orbit(orbit, "I", (60.0, 300.0))
    points = [(point.type, point.parameters["I"]) for point in branch.special_points]
    assert [kind for kind, _ in points] == ["HB", "SN", "SN", "HB"]
    np.testing.assert_allclose([value for _, value in points], [HOPF[0], *FOLDS, HOPF[1]], rtol=1e-8)
    assert all(words.endswith("the cycle shrinks to an equilibrium") for words in branch.stopped)
    assert branch.audit.passed, branch.audit
