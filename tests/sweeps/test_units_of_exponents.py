"""All Lyapunov exponents in all units of the states: of linear laws, and of textbooks' systems in units of one."""

from __future__ import annotations

import math

import numpy as np
import pytest

import units
from saltus import Average, HybridSystem, Map, lyapunov_spectrum, run_sweep
from saltus.options import SweepOptions
from selection import guarding

SEEDS = range(24)
KEPT = (0, 1, 2)


def linear(seed: int) -> tuple[np.ndarray, np.ndarray, dict[str, str]]:
    """Return eigenvalues, sizes of states from 1e-9 to 1e9, and the rows of a matrix with them in those units.

    All eigenvalues are real and apart, so that a frame turns into its directions exponentially.
    """
    draw = np.random.default_rng(seed)
    n = int(draw.integers(2, 7))
    values = -0.2 - np.sort(draw.uniform(0.0, 0.3, n) + 0.4 * np.arange(n))
    vectors = np.linalg.qr(draw.standard_normal((n, n)))[0] + 0.1 * draw.standard_normal((n, n))
    sizes = 10.0 ** draw.uniform(-9.0, 9.0, n)
    matrix = sizes[:, None] * (vectors @ np.diag(values) @ np.linalg.inv(vectors)) / sizes
    rows = {f"x{i}": " + ".join(f"({matrix[i, j]!r})*x{j}" for j in range(n)) for i in range(n)}
    return values, sizes, {x: row.replace("np.float64", "") for x, row in rows.items()}


def driven(rows: dict[str, str], sizes: np.ndarray) -> HybridSystem:
    field = {x: f"{row} + w*{size!r}*cos(s)" for (x, row), size in zip(rows.items(), sizes.tolist(), strict=True)}
    return HybridSystem.smooth(field, {"w": 1.0}, phase=("s", "3"))


@pytest.mark.parametrize("seed", guarding(SEEDS, *KEPT, campaign=8))
def test_a_driven_linear_flow_has_its_eigenvalues_in_all_units(seed):
    values, sizes, rows = linear(seed)
    found = lyapunov_spectrum(driven(rows, sizes), x0=sizes, average=Average(periods=40, discard=60))
    np.testing.assert_allclose(found.exponents, values, atol=1e-5)


@pytest.mark.parametrize("seed", guarding(SEEDS, *KEPT, campaign=8))
def test_a_linear_map_has_the_logarithms_of_its_eigenvalues_in_all_units(seed):
    values, sizes, rows = linear(seed)
    image = {x: f"{row} + {size!r}" for (x, row), size in zip(rows.items(), sizes.tolist(), strict=True)}
    inside = np.abs(values) < 1.0
    found = lyapunov_spectrum(
        Map(tuple(rows), {}, {x: f"0.3*({row})" for x, row in image.items()}),
        x0=0.0 * sizes, average=Average(periods=200, discard=200),
    )  # fmt: skip
    assert inside.any()
    np.testing.assert_allclose(found.exponents, np.sort(np.log(0.3 * np.abs(values)))[::-1], atol=1e-6)


@pytest.mark.parametrize("lanes", [False, True])
@pytest.mark.parametrize("seed", guarding(SEEDS, 3, campaign=4))
def test_sweeps_measure_the_eigenvalues_in_all_units(seed, lanes):
    values, sizes, rows = linear(seed)
    options = SweepOptions(follow="restart", discard=40, keep=10, exponents=len(values), lanes=lanes)
    sweep = run_sweep(driven(rows, sizes), "w", [0.5, 1.0, 2.0], x0=sizes, options=options)
    np.testing.assert_allclose(sweep.exponents.reshape(3, -1), np.tile(values, (3, 1)), atol=1e-4)


@pytest.mark.parametrize("unit", units.UNITS[:4])
@pytest.mark.parametrize(
    ("name", "parameters", "total"),
    [
        ("Henon", {"a": 1.4}, math.log(0.3)),
        ("van der Pol, driven", {"w": 1.5}, None),
        ("hard stop", {"w": 0.7}, None),
    ],
)
def test_a_spectrum_is_the_same_in_all_units(name, parameters, total, unit):
    case = units.CASES[name]
    average = Average(periods=2000 if case.kind == "map" else 200, discard=200)
    one, other = (
        lyapunov_spectrum(
            case.system(new), {p: value * new.parameter for p, value in parameters.items()}, case.x0(new),
            average=average,
        )
        for new in (units.Units(), units.NAMED[unit])
    )  # fmt: skip
    assert np.all(np.abs(other.exponents - one.exponents) <= 2.0 * (one.errors + other.errors) + 1e-3)
    assert other.sum == pytest.approx(one.sum if total is None else total, abs=1e-6 if total else 3e-3)


@pytest.mark.parametrize("sizes", [(1.0, 1.0), (1e-9, 1e9), (1e9, 1e-9), (1e9, 1e9)])
def test_a_state_that_grows_from_nothing_is_measured_by_its_size(sizes):
    # x' = x - x^3 falls by exp(-2 t) at 1, y' = -3 y + x by exp(-3 t)
    X, Y = sizes
    field = {"x": f"x - x**3/{X!r}**2", "y": f"-3*y + {Y!r}*x/{X!r}"}
    system = HybridSystem.smooth(field, {})
    found = lyapunov_spectrum(system, x0=[1e-15 * X, 0.0], average=Average(t_end=50.0, discard=60.0))
    np.testing.assert_allclose(found.exponents, [-2.0, -3.0], atol=1e-6)
