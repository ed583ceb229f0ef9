"""Fixtures: a double well, its attractors, its basins, and grids cut into many units however small they are."""

from __future__ import annotations

import pytest

import saltus.basins.map.grid
from saltus.basins import Basins, map_basins
from saltus.system import HybridSystem
from wells import BOX, Wells, double_well, wells


@pytest.fixture(scope="session")
def well() -> HybridSystem:
    return double_well()


@pytest.fixture(scope="session")
def both(well: HybridSystem) -> Wells:
    return wells(well)


@pytest.fixture(scope="session")
def basins(well: HybridSystem, both: Wells) -> Basins:
    return map_basins(well, {}, BOX, both)


@pytest.fixture
def small_units(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(saltus.basins.map.grid, "_LEAST", 60)
    monkeypatch.setattr(saltus.basins.map.grid, "_CHUNK", 30)
