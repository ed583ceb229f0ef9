"""Labels of sweeps in all units of states, time and parameter."""

from __future__ import annotations

import functools
import itertools

import pytest

import units
from saltus import run_sweep
from saltus.options import SweepOptions
from selection import guarding

SWEPT = [name for name, case in units.CASES.items() if case.sweep]
KEPT = [("hard stop", "mixed"), ("two wells", "small"), ("delayed logistic", "large"), ("integrate and fire", "slow"),
        ("van der Pol, driven", "mixed")]  # fmt: skip

EVERY = list(itertools.product(SWEPT, units.UNITS))


@functools.cache
def labels(name: str, unit: str) -> list[str]:
    """Return the labels of a case along its values, each from the start."""
    case, new = units.CASES[name], units.NAMED[unit]
    sweep = run_sweep(
        case.system(new), case.parameter, [value * new.parameter for value in case.sweep], x0=case.x0(new),
        options=SweepOptions(follow="restart", discard=300),
    )  # fmt: skip
    return list(sweep.labels.ravel().tolist())


@pytest.mark.parametrize(("name", "unit"), guarding(EVERY, *KEPT, campaign=24, spread=True))
def test_labels_are_the_same_in_all_units(name: str, unit: str) -> None:
    assert labels(name, unit) == labels(name, "one")
