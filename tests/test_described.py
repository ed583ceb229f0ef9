"""What `described` adds to the Dataset of a result."""

from __future__ import annotations

import pytest
import xarray as xr

from explained import unexplained
from saltus.described import described
from systems import impact_oscillator


class Told:
    """Something with a system that can be written."""

    system = impact_oscillator()

    def __init__(self, dataset):
        self.dataset = dataset

    @described
    def to_xarray(self):
        return self.dataset


@pytest.mark.parametrize(
    ("name", "long_name", "units"),
    [
        ("period", "period", "unit of time"),
        ("eigenvalue_re", "eigenvalue, real part", "per unit of time"),
        ("v", "state v", "unit of v"),
        ("w", "parameter w", "unit of w"),
        ("max_x", "greatest x", "unit of x"),
        ("special_arclength", "special points: arclength", "1"),
        ("branch3_x0", "branch 3: start", "unit of each state"),
        ("ragged_count", "count along ragged", "1"),
    ],
)
def test_a_name_says_what_a_variable_is(name, long_name, units):
    told = Told(xr.Dataset({name: ("point", [0.0])})).to_xarray()[name].attrs
    assert (told["long_name"], told["units"]) == (long_name, units)
    assert told["description"].endswith(".")


def test_what_a_variable_says_of_itself_stands_and_unknown_ones_are_left_alone():
    own = {"long_name": "gap", "units": "nm"}
    dataset = xr.Dataset({"gap_nm": ("point", [0.0], own), "nobody_knows": ("point", [0.0])})
    told = Told(dataset).to_xarray()
    assert told["gap_nm"].attrs == own | {"description": "Gap."}
    assert unexplained(told) == ["nobody_knows"]
    assert dataset["gap_nm"].attrs == own
