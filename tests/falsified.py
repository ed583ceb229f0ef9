"""Results whose Datasets are falsified, one variable at a time: `verify` must see it, or `from_xarray` refuse it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from saltus import SaltusError, verify

NOTHING = "passed"
"""What is told of a falsified result that passes."""

WAYS = ("all", "first", "one", "last", "sign", "nan", "turned", "swapped")
"""How a variable is falsified: everywhere, at one place, its sign, a NaN for a number, the order of its entries."""

ROUNDED = 1e-9
"""Change of a number, over the variable's size or 1, up to which it is rounding and falsifies nothing."""


def falsifications(dataset: xr.Dataset, ways: tuple[str, ...] = WAYS) -> Iterator[tuple[str, str]]:
    """Yield the variables of a Dataset with values, and how each is falsified, where that changes it."""
    for name, variable in dataset.data_vars.items():
        for how in ways:
            if variable.size and not _alike(dataset, str(name), _changed(np.array(variable.values), how)):
                yield str(name), how


def falsified(dataset: xr.Dataset, name: str, how: str) -> xr.Dataset:
    """Return a copy of a Dataset with one variable falsified: numbers by their size, flags and texts turned."""
    variable = dataset[name]
    changed = dataset.copy(deep=True)
    changed[name] = (variable.dims, _changed(np.array(variable.values), how), variable.attrs)
    return changed


def _changed(values: np.ndarray, how: str) -> np.ndarray:
    """Return values that are changed in one of the `WAYS`; the same where it does not apply."""
    numbers = values.dtype.kind == "f"
    found = values.copy()
    if how in ("turned", "swapped"):
        i, j = (0, -1) if how == "turned" else (len(values) // 2 - 1, len(values) // 2)
        if len(values) > 1:
            found[[i, j]] = found[[j, i]]
    elif how == "sign":
        found = -values if numbers else found
    elif how == "nan":
        if numbers and np.isfinite(values).any():
            finite = np.flatnonzero(np.isfinite(values))
            found.flat[finite[len(finite) // 2]] = np.nan
    else:
        at: Any = {"all": ..., "first": 0, "one": len(values) // 2, "last": -1}[how]
        found[at] = _other(values)[at]
    return found


def _other(values: np.ndarray) -> np.ndarray:
    """Return other values of the same kind: 0.001 more, over themselves and the largest, or over 1 for rounding."""
    if values.dtype.kind == "f":
        return np.where(np.isfinite(values), values + 1e-3 * np.abs(values) + 1e-3 * _top(values), 0.5)
    if values.dtype.kind in "iu":
        return np.where(values == 0, 1, 0).astype(values.dtype)
    others = {"SN": "PD", "PD": "SN", "HB": "SN", "GR": "SN", "BP": "SN"}
    return np.array([others.get(str(text), f"{text}x") for text in values.ravel()], dtype=object).reshape(values.shape)


def _top(values: np.ndarray) -> float:
    top = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
    return top if top > 1e-6 else 1.0


def _alike(dataset: xr.Dataset, name: str, values: np.ndarray) -> bool:
    """Return whether values are those of a variable but for rounding, or the same pairs of complex numbers."""
    own = dataset[name].values
    if own.dtype.kind != "f":
        return np.array_equal(own, values)
    if not np.array_equal(np.isnan(own), np.isnan(values)):
        return False
    if not np.any(np.abs(own - values) > ROUNDED * _top(own)):
        return True
    real = dataset[f"{name[:-3]}_re"].values if name.endswith("_im") else None
    if real is None:
        return False
    rows = (len(own), -1) if own.ndim > 1 else (1, -1)
    one, other = (np.sort_complex((real + 1j * part).reshape(rows)) for part in (own, values))
    return bool(np.allclose(one, other, rtol=ROUNDED, atol=ROUNDED, equal_nan=True))


def told(result: Any, name: str, how: str, points: int = 9) -> str:
    """Return what is told of a falsified result: a refusal in one line, or what differs; `NOTHING` where it passes.

    A variable that is made anew when it is read does no harm. One that no check reads is named, or is undetermined.
    """
    try:
        found = type(result).from_xarray(falsified(result.to_xarray(), name, how))
        if found == result:
            return "not read"
        checked = verify(found, points=points)
    except SaltusError as error:
        lines = str(error).splitlines()
        return f"refused: {lines[0]}" if len(lines) == 1 else f"told in {len(lines)} lines"
    own = name.removeprefix("orbit0_").removeprefix("start.")
    if checked.passed and {f"variable {own}", f"column {own}"} & {row.what for row in checked.unchecked}:
        return "not checked, and named"
    return NOTHING if checked.passed else "; ".join(sorted({row.what for row in checked.failures}))
