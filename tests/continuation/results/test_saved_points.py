"""A special point is saved and read back equal, and branches start at what was read."""

import pickle

import pytest

import saltus
from explained import unexplained
from saltus import HybridSystem, InputError, Map


def _of_equilibria():
    lorenz = HybridSystem.smooth({"x": "10*(y - x)", "y": "x*(r - z) - y", "z": "x*y - 8*z/3"}, {"r": 0.5})
    return saltus.continue_equilibrium(saltus.find_equilibrium(lorenz), "r", (0.0, 3.0))


def _of_maps():
    logistic = Map(("x",), {"r": 2.8}, {"x": "r*x*(1 - x)"})
    return saltus.continue_orbit(saltus.find_orbit(logistic, x0=[0.6]), "r", (2.5, 3.5))


def _of_cycles():
    bogdanov = HybridSystem.smooth({"x": "y", "y": "mu*y + x - x**2 + x*y"}, {"mu": -0.9})
    rests = saltus.continue_equilibrium(saltus.find_equilibrium(bogdanov, x0=[1.0, 0.0]), "mu", (-1.2, -0.5))
    return saltus.continue_orbit(saltus.switch_branch(rests["HB1"]), "mu", (-1.2, -0.5))


@pytest.mark.parametrize("made", [_of_equilibria, _of_maps, _of_cycles])
def test_each_point_of_a_branch_is_read_back_equal(made, tmp_path):
    points = made().special_points
    assert points
    for point in points:
        again = saltus.load(point.save(tmp_path / "point.nc"))
        assert again == point
        assert hash(again) == hash(point)
        assert repr(again) == repr(point)
        assert pickle.loads(pickle.dumps(point)) == point
        assert unexplained(point.to_xarray()) == []


def test_a_branch_starts_at_a_point_that_was_read(tmp_path):
    point = _of_maps()["PD1"]
    doubled = [saltus.switch_branch(held) for held in (point, saltus.load(point.save(tmp_path / "point.nc")))]
    assert doubled[0] == doubled[1]


def test_a_file_without_a_solution_is_told(tmp_path):
    dataset = _of_maps()["PD1"].to_xarray()
    dataset.attrs["solutions"] = "[]"
    with pytest.raises(InputError, match="a solution"):
        saltus.results.SpecialPoint.from_xarray(dataset)


def test_a_table_of_checks_is_read_back_equal(tmp_path):
    checked = saltus.verify(_of_maps()["PD1"])
    again = saltus.load(checked.save(tmp_path / "checks.nc"))
    assert again == checked
    assert repr(again) == repr(checked)
    assert again.rows[0] == checked.rows[0]
