"""Results whose Datasets are falsified, one variable at a time: `verify` must see it, or `from_xarray` refuse it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import xarray as xr

from saltus import SaltusError, verify

NOTHING = "passed"
"""What is told of a falsified result that passes."""


def falsifications(dataset: xr.Dataset) -> Iterator[tuple[str, str]]:
    """Yield the variables of a Dataset with values, and how each is falsified: everywhere, or at one place."""
    for name, variable in dataset.data_vars.items():
        if variable.size:
            yield str(name), "all"
            if variable.shape[0] > 2:
                yield str(name), "one"


def falsified(dataset: xr.Dataset, name: str, how: str) -> xr.Dataset:
    """Return a copy of a Dataset with one variable falsified: numbers by their size, flags and texts turned."""
    variable = dataset[name]
    values = np.array(variable.values)
    at: Any = ... if how == "all" else len(values) // 2
    values[at] = _other(values)[at]
    changed = dataset.copy(deep=True)
    changed[name] = (variable.dims, values, variable.attrs)
    return changed


def _other(values: np.ndarray) -> np.ndarray:
    """Return other values of the same kind: a tenth more and a tenth of the largest besides, or of 1 for rounding."""
    if values.dtype.kind == "f":
        top = float(np.abs(values[np.isfinite(values)]).max(initial=0.0))
        top = top if top > 1e-6 else 1.0
        return np.where(np.isfinite(values), values + 0.1 * np.abs(values) + 0.1 * top, 0.5)
    if values.dtype.kind in "iu":
        return np.where(values == 0, 1, 0).astype(values.dtype)
    others = {"SN": "PD", "PD": "SN", "HB": "SN", "GR": "SN", "BP": "SN"}
    return np.array([others.get(str(text), f"{text}x") for text in values.ravel()], dtype=object).reshape(values.shape)


def told(result: Any, name: str, how: str) -> str:
    """Return what is told of a falsified result: a refusal in one line, or what differs; `NOTHING` where it passes."""
    try:
        checked = verify(type(result).from_xarray(falsified(result.to_xarray(), name, how)))
    except SaltusError as error:
        lines = str(error).splitlines()
        return f"refused: {lines[0]}" if len(lines) == 1 else f"told in {len(lines)} lines"
    return NOTHING if checked.passed else "; ".join(sorted({row.what for row in checked.failures}))
