"""Loci of what users' events ask for, against closed forms."""

import numpy as np
import pytest

import saltus
from saltus.errors import InputError


def columns(locus, *names):
    return (locus.values[:, locus.names.index(name)] for name in names)


@pytest.fixture(scope="module")
def oscillations():
    system = saltus.HybridSystem(
        ("x", "v"), {"k": 1.0, "c": 0.1, "A": 1.0, "w": 1.1},
        {"on": saltus.Mode({"x": "v", "v": "A*cos(theta) - c*v - k*x"})}, phase=("theta", "w"),
    )  # fmt: skip
    events = {"max_x": 2.0, "amplitude(v, 1)": 3.0, "x": 1.5, "w": 1.3}
    return saltus.continue_orbit(saltus.find_orbit(system, {}, [0.0, 0.0]), "w", (1.05, 1.6), events=events)


@pytest.mark.parametrize("name", ["max_x", "amplitude(v, 1)"])
def test_a_quantity_of_orbits_keeps_its_value(oscillations, name):
    (point,) = oscillations.special_points.of_type(name)
    locus = saltus.continue_locus(point, ("w", "A"), {"w": (1.05, 1.6), "A": (0.2, 2.0)})
    w, A = columns(locus, "w", "A")
    size = A / np.sqrt((1.0 - w**2) ** 2 + (0.1 * w) ** 2)
    np.testing.assert_allclose(size if name == "max_x" else size * w, point.orbit.observe("amplitude(x, 1)")[
        "amplitude(x, 1)"] * (1.0 if name == "max_x" else point.value("w")), rtol=1e-10)  # fmt: skip
    assert locus.type == name
    locus.plot()


def test_a_state_or_an_output_of_equilibria_keeps_its_value():
    system = saltus.HybridSystem.smooth({"x": "r + h*x - x**3"}, {"r": 0.1, "h": 1.0}, outputs={"y": "x**2 + h"})
    start = saltus.find_equilibrium(system, {}, [1.2])
    branch = saltus.continue_equilibrium(start, "r", (-1.0, 3.0), events={"x": 1.5, "y": 3.0})
    bounds = {"r": (-5.0, 5.0), "h": (-1.0, 2.5)}
    locus = saltus.continue_locus(branch["x1"], ("r", "h"), bounds)
    r, h = columns(locus, "r", "h")
    np.testing.assert_allclose(r, 1.5**3 - 1.5 * h, atol=1e-11)
    locus = saltus.continue_locus(branch["y1"], ("r", "h"), bounds)
    r, h = columns(locus, "r", "h")
    np.testing.assert_allclose(r, (3.0 - h) ** 1.5 - h * np.sqrt(3.0 - h), atol=1e-8)


def test_a_state_of_map_orbits_keeps_its_value():
    system = saltus.Map(("x",), {"r": 2.5, "q": 0.0}, {"x": "r*x*(1 - x) + q"})
    branch = saltus.continue_orbit(saltus.find_orbit(system, {}, [0.3]), "r", (2.0, 3.0), events={"x": 0.55})
    locus = saltus.continue_locus(branch["x1"], ("r", "q"), {"r": (2.0, 3.0), "q": (-0.2, 0.2)})
    r, q = columns(locus, "r", "q")
    np.testing.assert_allclose(q, 0.55 - r * 0.55 * 0.45, atol=1e-12)


def test_a_name_that_means_two_quantities_is_refused(oscillations):
    with pytest.raises(InputError, match="min_x or max_x"):
        saltus.continue_locus(
            oscillations.special_points.of_type("x")[0], ("w", "A"), {"w": (1.05, 1.6), "A": (0.2, 2.0)}
        )


@pytest.mark.campaign
def test_a_locus_of_a_quantity_comes_back_from_a_file(oscillations, tmp_path):
    (point,) = oscillations.special_points.of_type("max_x")
    locus = saltus.continue_locus(point, ("w", "A"), {"w": (1.05, 1.6), "A": (0.2, 2.0)})
    locus.save(tmp_path / "locus.nc")
    np.testing.assert_array_equal(saltus.load(tmp_path / "locus.nc").values, locus.values)
