"""Modules of public names: each name is imported from its home on first use, and none else is there."""

from __future__ import annotations

import importlib
from pathlib import Path

import pytest

import saltus

DOORS = sorted(file.stem for file in Path(saltus.__file__).parent.glob("*.pyi") if file.stem != "__init__")


@pytest.mark.parametrize("name", DOORS)
def test_every_name_of_a_door_is_there(name):
    door = importlib.import_module(f"saltus.{name}")
    assert len(door.__all__) > 1
    assert [one for one in door.__all__ if not hasattr(door, one)] == []
    assert set(door.__all__) <= set(dir(door))


@pytest.mark.parametrize("name", DOORS)
def test_a_name_that_is_none_is_told(name):
    with pytest.raises(AttributeError, match=f"No saltus.{name} attribute nonsense"):
        importlib.import_module(f"saltus.{name}").nonsense  # noqa: B018


def test_no_name_stands_behind_two_doors():
    names = [one for name in DOORS for one in importlib.import_module(f"saltus.{name}").__all__]
    assert len(names) == len(set(names))
    assert not set(names) & set(saltus.__all__)


@pytest.mark.parametrize(
    ("door", "name", "said"),
    [
        ("saltus.options", "StepControl", "; it is saltus.StepControl"),
        ("saltus.results", "SweepOptions", "; it is saltus.options.SweepOptions"),
        ("saltus.options", "SweepOption", "; did you mean 'SweepOptions'?"),
        ("saltus", "find_orbits", "; did you mean 'find_orbit'?"),
        ("saltus", "nonsense", ""),
    ],
)
def test_a_name_at_the_wrong_door_or_nearly_right_is_told(door, name, said):
    with pytest.raises(AttributeError) as told:
        getattr(importlib.import_module(door), name)
    assert str(told.value) == f"No {door} attribute {name}{said}"
