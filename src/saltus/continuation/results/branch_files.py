"""Several branches in one Dataset, one after the other, as contiguous ragged arrays."""

from __future__ import annotations

import json
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.contents import Contents, as_json
from saltus.continuation.results.branch import Branch
from saltus.errors import InputError

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["RAGGED", "branches_of", "branches_together"]

# Text of the attribute ``ragged`` of such a Dataset.
RAGGED = "contiguous ragged arrays: a count's sample_dimension holds the branches one after the other"
_SHARED = ("definition",)  # attributes of a branch's Dataset that all branches share


def branches_together(branches: Sequence[Branch | None], dim: str) -> tuple[dict[str, Any], dict[str, Any]]:
    """Return several branches as variables and coordinates of one Dataset.

    Parameters
    ----------
    branches : sequence of Branch or None
        Of one system, along one parameter; None where there is no branch.
    dim : str
        The dimension along which branches are counted, as ``member``.

    Returns
    -------
    data, coords : dict
        The variables of `Branch.to_xarray`, all branches one after the other. ``count`` and the variables that end in
        ``_count`` give each branch's length along each dimension. ``point_member`` and ``special_member``, with `dim`
        for ``member``, give the branch of each point. ``branch_attributes`` is JSON of each branch's own attributes.
    """
    datasets = {i: _renamed(branch.to_xarray(), dim) for i, branch in enumerate(branches) if branch is not None}
    data: dict[str, Any] = {}
    coords: dict[str, Any] = {}
    attributes = np.full(len(branches), "", dtype=object)
    for i, dataset in datasets.items():
        attributes[i] = json.dumps({key: value for key, value in dataset.attrs.items() if key not in _SHARED})
    if datasets:
        first = next(iter(datasets.values()))
        coords |= {str(name): variable.variable for name, variable in first.coords.items()}
        for name, variable in first.data_vars.items():
            values = np.concatenate([dataset[name].values for dataset in datasets.values()])
            data[str(name)] = (variable.dims, values, variable.attrs)
        for ragged in dict.fromkeys(str(first[name].dims[0]) for name in data):
            sizes = np.zeros(len(branches), dtype=np.int64)
            for i, dataset in datasets.items():
                sizes[i] = dataset.sizes[ragged]
            data["count" if ragged == "point" else f"{ragged}_count"] = (dim, sizes, {"sample_dimension": ragged})
            if ragged in ("point", "special"):
                data[f"{ragged}_{dim}"] = (ragged, np.repeat(np.arange(len(branches)), sizes))
    return data | {"branch_attributes": (dim, attributes)}, coords


def _renamed(dataset: xr.Dataset, dim: str) -> xr.Dataset:
    """Return a branch whose parameter's column is renamed where it clashes with a variable of the common Dataset."""
    taken = ("count", "failure", "branch_attributes", dim, f"point_{dim}", f"special_{dim}")
    (column,) = json.loads(dataset.attrs["columns"])
    if column not in taken and not column.endswith("_count"):
        return dataset
    return dataset.rename({column: f"varied_{column}"}).assign_attrs(columns=json.dumps([f"varied_{column}"]))


def branches_of(held: Contents, dim: str, absent: Sequence[bool], parameter: str) -> list[Branch | None]:
    """Return the branches in a Dataset that `branches_together` describes.

    Parameters
    ----------
    held : Contents
        The Dataset.
    dim : str
        The dimension along which branches are counted.
    absent : sequence of bool
        True at each place along `dim` without a branch.
    parameter : str
        The parameter that varies along all branches.

    Raises
    ------
    InputError
        A variable or attribute is missing, of another shape or out of its range.
    """
    counts = _counts(held, dim)
    for ragged in ("point", "special"):
        wanted, name = np.repeat(np.arange(len(absent)), counts.get(ragged, [0] * len(absent))), f"{ragged}_{dim}"
        if name in held.dataset and not np.array_equal(held.array(name, (ragged,), int), wanted):
            raise InputError(f"variable {name!r}", "another one", f"the {dim} of each {ragged}, as they are counted")
    starts = {ragged: [0, *np.cumsum(sizes).tolist()] for ragged, sizes in counts.items()}
    attributes = held.array("branch_attributes", (dim,), str).tolist()
    shared = {name: held.text(name) for name in _SHARED}
    branches: list[Branch | None] = []
    for i, missing in enumerate(absent):
        if missing:
            if "point" in counts and counts["point"][i] > 0:
                raise InputError(f"count of {dim} {i}", int(counts["point"][i]), "0, as there is no branch")
            branches.append(None)
            continue
        part = held.dataset.isel({ragged: slice(ends[i], ends[i + 1]) for ragged, ends in starts.items()})
        part.attrs = shared | as_json(attributes[i], f"branch_attributes of {dim} {i}", dict)
        branch = Branch.from_xarray(part)
        if branch.parameter != parameter:
            raise InputError("attribute 'parameter'", parameter, "that of all branches")
        branches.append(branch)
    return branches


def _counts(held: Contents, dim: str) -> dict[str, NDArray[np.int64]]:
    """Return each branch's length along each ragged dimension, by the dimension's name."""
    counts = {}
    for name, variable in held.dataset.data_vars.items():
        if "sample_dimension" in variable.attrs:
            ragged = str(variable.attrs["sample_dimension"])
            counts[ragged] = held.array(str(name), (dim,), int, least=0)
            if counts[ragged].sum() != held.size(ragged):
                wanted = f"{held.size(ragged)} in all, as of {ragged!r}"
                raise InputError(f"variable {name!r}", int(counts[ragged].sum()), wanted)
    return counts
