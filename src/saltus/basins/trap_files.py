"""Trapping regions on their way into files and back: as variables of a Dataset, and as plain data."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.flow.traps import Cages, Cells, Ellipsoids, Traps
from saltus.results import frozen

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["traps_as_data", "traps_as_variables", "traps_from_data", "traps_from_variables"]

_FORMS: dict[str, tuple[type[Any], dict[str, tuple[tuple[str, ...], type]]]] = {
    "ellipsoids": (
        Ellipsoids,
        {
            "centres": (("ellipsoid", "state"), np.float64),
            "shapes": (("ellipsoid", "axis", "state"), np.float64),
            "labels": (("ellipsoid",), np.uint8),
            "normals": (("ellipsoid", "plane", "state"), np.float64),
            "offsets": (("ellipsoid", "plane"), np.float64),
            "modes": (("ellipsoid",), np.int64),
        },
    ),
    "cages": (
        Cages,
        {
            "centres": (("cage", "state"), np.float64),
            "rows": (("cage", "row", "state"), np.complex128),
            "floors": (("cage", "row"), np.float64),
            "bounds": (("cage",), np.float64),
            "modes": (("cage",), np.int64),
            "labels": (("cage",), np.uint8),
        },
    ),
    "cells": (
        Cells,
        {
            "origin": (("state",), np.float64),
            "size": (("state",), np.float64),
            "boxes": (("box", "state"), np.int64),
            "labels": (("box",), np.uint8),
        },
    ),
}


def traps_as_variables(traps: Traps) -> dict[str, tuple[tuple[str, ...], NDArray[Any]]]:
    """Return the arrays of all regions with their dimensions, complex ones in two parts, by the names in a Dataset."""
    variables = {}
    for kind, (_, arrays) in _FORMS.items():
        regions = getattr(traps, kind)
        for name, (dims, _dtype) in arrays.items() if regions is not None else ():
            value = getattr(regions, name)
            if np.iscomplexobj(value):
                variables[f"{kind}_{name}_re"], variables[f"{kind}_{name}_im"] = (dims, value.real), (dims, value.imag)
            else:
                variables[f"{kind}_{name}"] = dims, value
    return variables


def traps_from_variables(dataset: xr.Dataset) -> Traps:
    """Return the regions of which `traps_as_variables` made variables, with the attributes ``visits`` and ``limit``."""
    regions = {}
    for kind, (form, arrays) in _FORMS.items():
        if f"{kind}_labels" not in dataset:
            continue
        values = {}
        for name, (_, dtype) in arrays.items():
            if dtype is np.complex128:
                value = dataset[f"{kind}_{name}_re"].values + 1j * dataset[f"{kind}_{name}_im"].values
            else:
                value = dataset[f"{kind}_{name}"].values
            values[name] = frozen(value, dtype)
        if kind == "cells":
            values["visits"] = int(dataset.attrs["visits"])
        regions[kind] = form(**values)
    return Traps(int(dataset.sizes["state"]), **regions, limit=float(dataset.attrs["limit"]))


def traps_as_data(traps: Traps) -> dict[str, Any]:
    """Return the regions as plain data, from which `traps_from_data` makes equal ones."""
    return {part.name: _plain(getattr(traps, part.name)) for part in fields(traps)}


def traps_from_data(data: Mapping[str, Any]) -> Traps:
    """Return the regions that `traps_as_data` described."""
    parts = dict(data)
    for name, (kind, _) in _FORMS.items():
        if parts[name] is not None:
            held = parts[name].items()
            parts[name] = kind(**{key: _array(value) if isinstance(value, dict) else value for key, value in held})
    return Traps(**parts)


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        numbers = value.view(np.float64).ravel() if np.iscomplexobj(value) else value.ravel()
        return {"dtype": value.dtype.name, "shape": list(value.shape), "values": numbers.tolist()}
    if isinstance(value, Ellipsoids | Cages | Cells):
        return {part.name: _plain(getattr(value, part.name)) for part in fields(value)}
    return value


def _array(data: Mapping[str, Any]) -> NDArray[Any]:
    dtype = np.dtype(data["dtype"])
    numbers = np.array(data["values"], dtype=np.float64 if dtype.kind == "c" else dtype)
    array: NDArray[Any] = numbers.view(dtype).reshape(data["shape"])
    return array
