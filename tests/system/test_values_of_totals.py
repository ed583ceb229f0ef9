"""Files in which conserved totals have eigenvalues and multipliers of their own, as versions up to 0.1 saved them."""

from __future__ import annotations

import math

import numpy as np
import pytest

from saltus import HybridSystem, Mode, find_equilibrium, solve_orbit
from saltus.contents import Contents
from saltus.errors import InputError

BINDING = HybridSystem.smooth(
    {"a": "-k*a*b + r*c", "b": "-k*a*b + r*c", "c": "k*a*b - r*c"}, {"k": 2.0, "r": 0.5}
)  # fmt: skip
# the fields of the drive and of its strength: e is conserved
DRIVEN = HybridSystem(
    ("q", "v", "e"), {"w": 1.1}, {"m": Mode({"q": "v", "v": "-q - v/5 + e*cos(s)", "e": "0"})}, phase=("s", "w")
)


def with_values(result, dim, values):
    """Return what an earlier version would have saved, with further values at some places."""
    dataset = result.to_xarray()
    names = [name for name in dataset if dim in dataset[name].dims]
    held = {}
    for name in names:
        part = dataset[name].to_numpy()
        for place, value in values:
            part = np.insert(part, place, value.real if name.endswith("_re") else value.imag)
        held[name] = (dim, part)
    return dataset.drop_dims(dim).assign(held)


def test_eigenvalues_of_totals_are_left_out():
    found = find_equilibrium(BINDING, x0=[1.0, 2.0, 0.0])
    older = with_values(found, "eigenvalue", [(0, 4e-17 + 0j), (1, -1e-17 + 0j)])
    with pytest.warns(RuntimeWarning, match=r"2 eigenvalues of 0 left out: one for each of a \+ c, b \+ c"):
        loaded = type(found)._read(Contents(older))
    assert loaded == found
    assert loaded.kind == "stable node"


def test_multipliers_of_totals_are_left_out():
    segment = ("m", None, [0.1, 0.0, 1.0, 0.0], 2.0 * math.pi / 1.1)
    found = solve_orbit(DRIVEN, segments=[segment])
    # of the oscillator alone: exp(-T/10) in modulus
    assert np.abs(found.multipliers) == pytest.approx([math.exp(-0.1 * found.period)] * 2)
    older = with_values(found, "multiplier", [(0, 1.0 + 0j)])
    with pytest.warns(RuntimeWarning, match="1 multiplier of 1 left out: one for each of e"):
        loaded = type(found)._read(Contents(older))
    assert loaded == found


def test_other_counts_of_values_are_refused():
    found = find_equilibrium(BINDING, x0=[1.0, 2.0, 0.0])
    with pytest.raises(InputError, match="'eigenvalue' = 2: must be of size 1"):
        type(found)._read(Contents(with_values(found, "eigenvalue", [(0, 0j)])))
