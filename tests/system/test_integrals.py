"""Linear first integrals: sums of states that no field and no reset changes, and the states of given totals."""

from __future__ import annotations

import numpy as np
import pytest

from saltus import HybridSystem, Mode, Transition
from saltus.system.integrals.laws import Leaf


def test_integrals_are_found_whatever_their_coefficients() -> None:
    series = {"u1": "i/C1", "u2": "i/C2", "i": "1 - u1 - u2 - 0.5*i"}
    assert HybridSystem.smooth(series, {"C1": 1.0, "C2": 2.0}).conserved == ("C1*u1 - C2*u2",)
    assert HybridSystem.smooth({"x": "y", "y": "-x"}).conserved == ()
    assert HybridSystem.smooth({"A": "A/(K+A) - 1", "B": "K/(K+A)"}, {"K": 1.0}).conserved == ("A + B",)
    assert HybridSystem.smooth({"A": "0.1*B - 0.3*A", "B": "3*(0.1*A) - 0.1*B"}).conserved == ("A + B",)


def test_what_a_reset_changes_is_not_conserved() -> None:
    modes = {"f": Mode({"z": "v", "v": "-g", "m": "0"})}
    jump = [Transition("f", "f", "z", -1, {"v": "-e*v"}, name="hit")]
    counted = [Transition("f", "f", "z", -1, {"v": "-e*v", "m": "m + 1"}, name="hit")]
    assert HybridSystem(("z", "v", "m"), {"g": 1.0, "e": 0.5}, modes, jump).conserved == ("m",)
    assert HybridSystem(("z", "v", "m"), {"g": 1.0, "e": 0.5}, modes, counted).conserved == ()


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_units_do_not_hide_an_integral(unit: float) -> None:
    there, back = f"0.37*A*B/{unit!r}", "0.11*C"
    network = HybridSystem.smooth(
        {"A": f"{back} - {there}", "B": f"{unit!r}*({back} - {there})", "C": f"{there} - {back}"}
    )
    assert len(network.conserved) == 2


@pytest.mark.parametrize("seed", range(5))
def test_a_leaf_has_the_eigenvalues_that_are_not_zero(seed: int) -> None:
    rng = np.random.default_rng(seed)
    L = rng.integers(-2, 3, (2, 6)).astype(float) + np.eye(2, 6) * 5.0
    A = (np.eye(6) - np.linalg.pinv(L) @ L) @ rng.normal(size=(6, 6))
    within = Leaf(L, 10.0 ** rng.uniform(-3, 3, 6)).within(A)
    values = np.linalg.eigvals(A)
    values = values[np.argsort(np.abs(values))][2:]
    found = np.linalg.eigvals(within)
    np.testing.assert_allclose(np.sort_complex(found), np.sort_complex(values), rtol=1e-8)
