"""Tables of branches, loci and families: a row for each point, in the numbers of the result itself."""

from __future__ import annotations

import sys

import numpy as np
import pytest

import saltus
from saltus import HybridSystem, InputError, Map, SaltusError


@pytest.fixture(scope="module")
def branch():
    spring = HybridSystem.smooth({"x": "v", "v": "-c*v - x + cos(s)"}, {"c": 0.3, "w": 0.6}, phase=("s", "w"))
    return saltus.continue_orbit(saltus.find_orbit(spring, x0=[0.0, 0.0]), "w", (0.6, 1.4))


@pytest.fixture(scope="module")
def family(branch):
    return saltus.continue_family(branch.solution(0), "w", {"c": [0.2, 0.4]}, (0.6, 1.4), workers=1)


def test_a_table_has_a_row_for_each_orbit(branch):
    table = branch.to_dataframe()
    assert len(table) == len(branch)
    assert table.index.name == "point"
    for name in ("w", "x", "period", "max_x", "min_v", "arclength"):
        np.testing.assert_array_equal(table[name], branch.column(name))
    np.testing.assert_array_equal(table["multiplier_1"], branch.multipliers[:, 0])
    assert set(table["signature"]) == {" -> ".join(map(":".join, branch.signature(0)))}


def test_a_table_is_written_as_csv_and_read_again(branch, tmp_path):
    import pandas as pd

    branch.to_dataframe().to_csv(tmp_path / "branch.csv")
    read = pd.read_csv(tmp_path / "branch.csv", index_col="point")
    np.testing.assert_allclose(read["max_x"], branch.column("max_x"), rtol=1e-15)


def test_a_family_s_table_has_the_members_values_in_front(family):
    table = family.to_dataframe()
    assert len(table) == sum(len(branch) for branch in family)
    assert list(table.columns[:2]) == ["c", "w"]
    np.testing.assert_array_equal(table.loc[1, "max_x"], family[1].column("max_x"))
    assert set(table.loc[1, "c"]) == {0.4}


def test_along_a_quantity_the_free_parameter_is_in_the_table(branch):
    held = saltus.solve_orbit(branch.system, dict(branch.parameters), x0=branch.x0[0], fix={"max_x": 1.5}, free="w")
    along = saltus.continue_orbit(held, "max_x", (1.4, 1.6))
    table = along.to_dataframe()
    np.testing.assert_array_equal(table["w"], along.freed)
    np.testing.assert_array_equal(table["max_x"], along.values)


def test_curves_of_every_kind_have_a_table():
    logistic = Map(("x",), {"r": 3.2}, {"x": "r*x*(1 - x)"})
    points = saltus.continue_orbit(saltus.solve_orbit(logistic, {"r": 2.5}, x0=[0.6], period=1), "r", (2.0, 3.4))
    table = points.to_dataframe()
    np.testing.assert_allclose(table["multiplier_1"].to_numpy().real, 2.0 - table["r"], atol=1e-9)
    cusp = HybridSystem.smooth({"x": "r + h*x - x**3"}, {"r": 1.0, "h": 3.0})
    rests = saltus.continue_equilibrium(saltus.find_equilibrium(cusp, {}, [2.0]), "r", (-4.0, 4.0))
    folds = saltus.continue_locus(rests["SN1"], ("r", "h"), {"r": (0.5, 4.0), "h": (2.0, 4.0)})
    np.testing.assert_allclose(folds.to_dataframe()["x"] ** 2 * 3.0, folds.to_dataframe()["h"], atol=1e-9)


def test_a_csv_file_is_answered_with_the_way_to_a_table(branch, tmp_path):
    with pytest.raises(InputError, match=r"; to_dataframe\(\)\.to_csv\(\.\.\.\) writes a table, and plot"):
        branch.save(tmp_path / "branch.csv")
    with pytest.raises(InputError, match=r"to_xarray\(\)\[\['NAME', \.\.\.\]\]\.to_dataframe\(\)\.to_csv"):
        branch.solution(0).save(tmp_path / "orbit.csv")


def test_without_pandas_the_extra_that_brings_it_is_told(branch, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(SaltusError, match=r"needs pandas: pip install 'saltus\[data\]'$"):
        branch.to_dataframe()
