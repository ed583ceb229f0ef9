"""Several curves in one Dataset, whose variables and dimensions have a prefix each."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from saltus.contents import Contents, as_json

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["own_attributes", "prefixed_part", "side_by_side"]


def own_attributes(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the attributes of a curve's Dataset that the curves of one system do not share."""
    return {key: value for key, value in dataset.attrs.items() if key != "definition"}


def side_by_side(datasets: Sequence[xr.Dataset], prefix: str) -> xr.Dataset:
    """Return several curves as one Dataset: variables and dimensions of curve `i` begin with `prefix`, `i` and ``_``.

    Parameters
    ----------
    datasets : sequence of xarray.Dataset
        The curves; their attributes are left out.
    prefix : str
        What a curve is, as ``branch``.
    """
    from saltus.extras import xr

    data: dict[str, Any] = {}
    coordinates: dict[str, Any] = {}
    for i, dataset in enumerate(datasets):
        for name, variable in dataset.variables.items():
            dims = [f"{prefix}{i}_{dim}" for dim in variable.dims]
            held = coordinates if name in dataset.coords else data
            held[f"{prefix}{i}_{name}"] = (dims, variable.values, variable.attrs)
    return xr.Dataset(data, coords=coordinates)


def prefixed_part(held: Contents, prefix: str, index: int, attributes: Any) -> xr.Dataset:
    """Return the Dataset of one curve within that of several.

    Parameters
    ----------
    held : Contents
        What `side_by_side` made, with the attribute ``definition`` of the curves' system.
    prefix : str
        What a curve is.
    index : int
        Which one.
    attributes : object
        Its own attributes, as they were read.

    Raises
    ------
    InputError
        They are no attributes.
    """
    begin = f"{prefix}{index}_"
    names = {name: str(name).removeprefix(begin) for name in held.dataset.variables if str(name).startswith(begin)}
    part = held.dataset[[*names]]
    dims = {dim: str(dim).removeprefix(begin) for dim in part.dims if dim not in names}
    dataset = part.rename(names | dims)
    own = as_json(json.dumps(attributes), f"attributes of {prefix} {index}", dict)
    dataset.attrs = own | {"definition": held.text("definition")}
    return dataset
