"""The segment equations: their Jacobian, by every kind of segment end, is that of central differences."""

from __future__ import annotations

import numpy as np
import pytest

import systems
from saltus import HybridSystem, Mode, solve_orbit
from saltus.afm import table1, tapping_mode
from saltus.orbits.signature import CLOSED_END, EVENT_END, MEAN_END, PHASE_END


def circle():
    field = {"x": "mu*x*(1 - x**2 - y**2) - 2*y", "y": "mu*y*(1 - x**2 - y**2) + 2*x"}
    return HybridSystem(("x", "y"), {"mu": 1.0}, {"m": Mode(field)})


TAPS = [
    ("flight", "touch", [-0.717, 0.7335], 2.95),
    ("contact", "release", [0.95, 0.85], 0.375),
    ("flight", "theta", [0.9, -0.4], 2.65),
]
STICKS = [("slip", "catch", [0.9, 0.3], 4.0), ("stick", "release", [-0.05, 0.3], 3.0)]
CASES = {
    "taps": (lambda: tapping_mode(table1()), {"Omega": 1.05}, TAPS, "Omega", (EVENT_END, MEAN_END)),
    "sticks": (systems.stick_slip, {}, STICKS, "Fk", (EVENT_END, EVENT_END)),
    "swings": (systems.impact_oscillator, {"A": 0.05}, [("free", "theta", [0.0, 0.5], 6.28)], "w", (PHASE_END,)),
    "turns": (circle, {}, [("m", None, [1.2, 0.1], 3.0)], "mu", (CLOSED_END,)),
}


@pytest.mark.parametrize("case", list(CASES))
@pytest.mark.parametrize("share", [1.0, 1e-2])
def test_jacobian_is_that_of_central_differences(case, share):
    """`share` shortens the last segment: below 0.01 of the period its mean rate is an integral, not a quotient."""
    make, parameters, guess, active, kinds = CASES[case]
    orbit = solve_orbit(make(), parameters, guess)
    assert orbit.form.kinds == kinds
    problem = orbit.problem(active)
    u = np.append(orbit.unknowns, orbit.parameters[active])
    if len(kinds) > 1:
        u[problem.size - 1] *= share
        problem.start(u)
    J = problem.evaluate(u)[1]
    step = 1e-5
    for j in range(u.size):
        shift = np.zeros(u.size)
        shift[j] = step
        sides = [problem.evaluate(u + shift)[0], problem.evaluate(u - shift)[0]]
        # the remainder of second order, grown by the stiff contact; the flow's 1e-12 over the step
        np.testing.assert_allclose(
            J[:, j], (sides[0] - sides[1]) / (2.0 * step), rtol=1e-6, atol=1e-6 * np.abs(J).max()
        )
