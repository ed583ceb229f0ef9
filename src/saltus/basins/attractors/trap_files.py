"""Trapping regions in files: as variables of a Dataset, and as plain data."""

from __future__ import annotations

import operator
from collections.abc import Collection, Mapping
from dataclasses import fields
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.contents import Contents
from saltus.ensemble.traps import DIVERGED, Cages, Cells, Ellipsoids, Traps
from saltus.errors import InputError
from saltus.result import frozen
from saltus.system.definition import Definition

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["check_traps", "traps_as_data", "traps_as_variables", "traps_from_data", "traps_from_variables"]

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
    """Return the arrays of all regions with their dimensions, by names in a Dataset; complex arrays have two parts."""
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


def traps_from_variables(held: Contents) -> Traps:
    """Return the regions of which `traps_as_variables` made variables, with the attributes ``visits`` and ``limit``."""
    regions = {}
    for kind, (form, arrays) in _FORMS.items():
        if f"{kind}_labels" not in held.dataset:
            continue
        values = {}
        for name, (dims, dtype) in arrays.items():
            variable = f"{kind}_{name}"
            if dtype is np.complex128:
                value = held.array(f"{variable}_re", dims) + 1j * held.array(f"{variable}_im", dims)
            elif dtype is np.uint8:
                value = held.array(variable, dims, int, least=0, most=DIVERGED - 1)
            else:
                value = held.array(variable, dims, int if dtype is np.int64 else float, finite=dtype is np.int64)
            values[name] = frozen(value, dtype)
        if kind == "cells":
            values["visits"] = held.count("visits", least=1)
        regions[kind] = form(**values)
    return Traps(held.size("state"), **regions, limit=held.number("limit", least=0.0, finite=False))


def check_traps(traps: Traps, system: Definition, labels: Collection[int]) -> None:
    """Raise `InputError` where regions do not fit the system's states, modes and labels.

    Compiled functions trust shapes and indices.
    """
    sizes: dict[str, int] = {"state": len(system.states), "axis": len(system.states)}
    if traps.n != sizes["state"] or not traps.limit > 0.0:
        raise InputError("traps", (traps.n, traps.limit), f"of {sizes['state']} states, with a limit > 0")
    for kind, (_, arrays) in _FORMS.items():
        if (regions := getattr(traps, kind)) is None:
            continue
        for name, (dims, dtype) in arrays.items():
            value, where = getattr(regions, name), f"traps' {kind}_{name}"
            if not isinstance(value, np.ndarray) or value.dtype != dtype or value.ndim != len(dims):
                raise InputError(where, getattr(value, "dtype", value), f"an array of {dtype.__name__} by {dims}")
            for dim, size in zip(dims, value.shape, strict=True):
                if sizes.setdefault(dim, size) != size:
                    raise InputError(f"{where}'s shape", value.shape, f"of {sizes[dim]} along {dim!r}")
            if np.isnan(value).any():
                raise InputError(where, "not a number", "numbers")
        if not set(regions.labels.tolist()) <= set(labels):
            raise InputError(f"traps' {kind}_labels", sorted(set(regions.labels.tolist())), f"of {sorted(labels)}")
        modes = getattr(regions, "modes", np.empty(0))
        if ((modes < -1) | (modes >= len(system.modes))).any():
            raise InputError(f"traps' {kind}_modes", int(modes.max()), f"between -1 and {len(system.modes) - 1}")
    if traps.cells is not None and not ((traps.cells.size > 0.0).all() and traps.cells.visits >= 1):
        raise InputError("traps' cells_size", traps.cells.size.tolist(), "all > 0, with a visit or more")


def traps_as_data(traps: Traps) -> dict[str, Any]:
    """Return the regions as plain data, from which `traps_from_data` makes equal ones."""
    return {part.name: _plain(getattr(traps, part.name)) for part in fields(traps)}


def traps_from_data(data: Mapping[str, Any]) -> Traps:
    """Return the regions that `traps_as_data` described; raise `InputError` where it did not."""
    _check_keys(data, {part.name for part in fields(Traps)}, "traps")
    parts = dict(data)
    for name, (kind, arrays) in _FORMS.items():
        if parts[name] is not None:
            _check_keys(parts[name], {part.name for part in fields(kind)}, f"traps' {name}")
            of_kind = [key for key in parts[name] if key in arrays]
            held: dict[str, Any] = {key: _array(parts[name][key], f"traps' {name}_{key}") for key in of_kind}
            if kind is Cells:
                held["visits"] = checks.count("traps' visits", parts[name]["visits"], 1)
            parts[name] = kind(**held)
    parts["n"], limit = checks.count("traps' n", parts["n"], 1), parts["limit"]
    if isinstance(limit, bool) or not isinstance(limit, int | float):
        raise InputError("traps' limit", limit, "a number")
    return Traps(**parts)


def _check_keys(data: Any, wanted: set[str], where: str) -> None:
    if not isinstance(data, Mapping) or set(data) != wanted:
        raise InputError(where, data, f"a mapping of {', '.join(sorted(wanted))}")


def _plain(value: Any) -> Any:
    if isinstance(value, np.ndarray):
        numbers = value.view(np.float64).ravel() if np.iscomplexobj(value) else value.ravel()
        return {"dtype": value.dtype.name, "shape": list(value.shape), "values": numbers.tolist()}
    if isinstance(value, Ellipsoids | Cages | Cells):
        return {part.name: _plain(getattr(value, part.name)) for part in fields(value)}
    return value


def _array(data: Any, where: str) -> NDArray[Any]:
    _check_keys(data, {"dtype", "shape", "values"}, where)
    kinds = {np.dtype(dtype).name: np.dtype(dtype) for _, arrays in _FORMS.values() for _, dtype in arrays.values()}
    if not isinstance(data["dtype"], str) or data["dtype"] not in kinds:
        raise InputError(where, data["dtype"], f"one of {', '.join(kinds)}")
    dtype = kinds[data["dtype"]]
    try:
        numbers = np.array(data["values"], dtype=np.float64 if dtype.kind == "c" else dtype)
        array: NDArray[Any] = numbers.view(dtype).reshape([operator.index(size) for size in data["shape"]])
    except (TypeError, ValueError, OverflowError) as error:
        raise InputError(
            where, data["shape"], f"the shape of its values, numbers of {dtype.name}", str(error)
        ) from None
    return array
