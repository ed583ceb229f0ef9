"""How many multipliers are critical at once: those of Jordan blocks known to the error of a matrix."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipk

import saltus
from saltus.maps.spectrum import multiplicity

ERRORS = (1e-14, 1e-12, 1e-10, 1e-8)
PLACES = {"PD": -1.0, "BP": 1.0, "SN": 1.0}


@pytest.mark.parametrize("seed", range(20))
@pytest.mark.parametrize("error", ERRORS)
def test_a_block_counts_with_all_of_its_multipliers(seed, error):
    draw = np.random.default_rng(seed)
    kind, size, others = draw.choice(list(PLACES)), int(draw.integers(1, 4)), draw.uniform(-0.7, 0.7, 3)
    matrix = np.diag(np.concatenate([np.full(size, PLACES[kind]), others])) + np.diag(
        np.where(np.arange(size + 2) < size - 1, 1.0, 0.0), 1
    )
    basis = np.linalg.qr(draw.standard_normal(matrix.shape))[0]
    noise = error * draw.standard_normal(matrix.shape)
    assert multiplicity(np.linalg.eigvals(basis @ matrix @ basis.T + noise), kind) == size


@pytest.mark.parametrize("beside", [1e-5, 1e-4, 1e-2])
@pytest.mark.parametrize("kind", list(PLACES))
def test_a_multiplier_beside_the_critical_one_does_not_count(kind, beside):
    assert multiplicity(PLACES[kind] * np.array([1.0 + 1e-9, 1.0 - beside, 0.3], complex), kind) == 1


def trace(E: float) -> float:
    """Return the trace of the normal variation along the straight orbit of Henon and Heiles of an energy."""
    low, middle, high = np.sort(np.roots([-1.0 / 3.0, 0.5, 0.0, -E]).real)
    period = 4.0 * np.sqrt(1.5) / np.sqrt(high - low) * ellipk((middle - low) / (high - low))

    def slope(_, z):
        return [z[1], -z[0] + z[0] ** 2, z[3], -(1 + 2 * z[0]) * z[2], z[5], -(1 + 2 * z[0]) * z[4]]

    end = solve_ivp(slope, (0.0, period), [low, 0.0, 1.0, 0.0, 0.0, 1.0], method="DOP853", rtol=1e-13, atol=1e-14)
    return float(end.y[[2, 5], -1].sum())


@pytest.mark.parametrize(("at", "inside"), list(enumerate([(0.135, 0.136), (0.152, 0.153), (0.1655, 0.166)])))
def test_a_pair_of_a_conservative_system_meets_at_minus_one_at_once(straight, at, inside):
    branch, failures = straight
    point = branch.special_points.of_type("PD")[at]
    assert point.value("E") == pytest.approx(brentq(lambda E: trace(E) + 2.0, *inside, xtol=1e-13), abs=1e-9)
    assert point.multiplicity == 2
    assert not [row for row in failures if "multiplier" in row.what]


def test_the_direction_along_a_family_is_no_critical_one(straight):
    assert [point.multiplicity for point in straight[0].special_points.of_type("BP")] == [2, 2]


@pytest.fixture(scope="module")
def straight():
    """The straight orbits of Henon and Heiles along their energy, and what their verification finds wrong."""
    field = {"x": "u", "y": "v", "u": "-x - 2*x*y", "v": "-y - x**2 + y**2"}
    system = saltus.HybridSystem.smooth(field, outputs={"E": "(u**2 + v**2 + x**2 + y**2)/2 + x**2*y - y**3/3"})
    orbit = saltus.solve_orbit(system, x0=[0.0, 0.3, 0.0, 0.0], period=6.4, fix={"E": 0.04})
    branch = saltus.continue_orbit(orbit, "E", (0.03, 0.166))
    return branch, saltus.verify(branch).failures
