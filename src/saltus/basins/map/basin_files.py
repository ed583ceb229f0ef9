"""Basins as an xarray Dataset, and the metadata of a store."""

from __future__ import annotations

import json
import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.basins.attractors.attractors import Attractors
from saltus.basins.map.grid import Grid
from saltus.basins.map.labelling import Labelling
from saltus.basins.map.outcomes import attractors_bytes, attractors_table, outcomes_from, summary
from saltus.basins.map.store import flags
from saltus.basins.map.wrong_labels import LabelError, label_error_of
from saltus.contents import Contents
from saltus.ensemble.traps import NOT_DONE
from saltus.errors import InputError
from saltus.version import __version__

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["accuracy_of", "attributes_of", "check_belong", "dataset_of", "parts_of"]


def dataset_of(basins: Any) -> xr.Dataset:
    """Return basins as a Dataset; the labels of a store are read on access."""
    from saltus.extras import xr

    attributes = flags(basins.attractors.labels)
    coords: dict[str, Any] = {
        name: np.array(axis) for name, axis in zip(basins.grid.names, basins.grid.axes, strict=True)
    }
    coords |= {name: value for name, value in basins.grid.fixed.items() if name not in coords}
    held = np.frombuffer(attractors_bytes(basins.attractors), np.uint8)
    dataset = xr.Dataset(
        {
            "labels": (basins.grid.names, _lazy(basins), attributes),
            "attractors": ("byte", held),
            **attractors_table(basins.attractors, basins.grid.states),
        },
        coords=coords,
        attrs={
            "grid": json.dumps(basins.grid.definition()),
            "outcomes": json.dumps(summary(basins.attractors)),
            "inputs": json.dumps(dict(basins.inputs)),
            "stopped": basins.stopped,
            "undecided": basins.undecided,
        },
    )
    if basins.noted_error is not None and basins.path is None:
        dataset.attrs["label_error"] = json.dumps(basins.noted_error.as_data())
    dataset["labels"].encoding["_FillValue"] = None
    return dataset


def _lazy(basins: Any) -> Any:
    """Return the labels; those of a store as a variable of xarray that reads them on access."""
    if isinstance(basins.labels, np.ndarray):
        return basins.labels
    from saltus.extras import xr

    with warnings.catch_warnings():
        # a process that was killed leaves the draft of a file, which is no part of the store
        warnings.filterwarnings("ignore", r"Object at \.\S+\.part", UserWarning)
        whole = xr.open_zarr(basins.path, chunks=None, consolidated=False, mask_and_scale=False)["labels"]
    fixed = {name: index for name, index in zip(whole.dims, basins.labels.fixed, strict=True) if index is not None}
    return whole.isel(fixed).variable


def parts_of(held: Contents) -> dict[str, Any]:
    """Return the arguments of the basins that a Dataset describes.

    Raises
    ------
    InputError
        Something is missing, of another shape, out of its range, or not of one system.
    """
    grid, inputs = Grid.from_definition(held.json("grid", dict)), held.json("inputs", dict)
    kept = held.array("attractors", ("byte",), int, least=0, most=255).astype(np.uint8).tobytes()
    outcomes = outcomes_from(kept, held.json("outcomes", dict))
    check_belong(grid, outcomes, inputs)
    held.expect(**dict(zip(grid.names, grid.shape, strict=True)))
    labels = held.array("labels", grid.names, int, least=0, most=NOT_DONE).astype(np.uint8)
    if unnamed := sorted(set(np.unique(labels).tolist()) - {*outcomes.labels.values(), NOT_DONE}):
        raise InputError("variable 'labels'", unnamed[0], f"of outcomes: {sorted(outcomes.labels.values())}")
    why = held.text("undecided") if "undecided" in held.dataset.attrs else ""  # files of version 0.1 lack it
    error = label_error_of(held.json("label_error", dict)) if "label_error" in held.dataset.attrs else None
    return {
        "labels": labels, "grid": grid, "attractors": outcomes, "inputs": inputs, "stopped": held.text("stopped"),
        "undecided": why, "noted_error": error,
    }  # fmt: skip


def attributes_of(inputs: Mapping[str, Any], grid: Grid, attractors: Any) -> dict[str, Any]:
    """Return the metadata of a store."""
    return {
        "saltus_result": "Basins",
        "saltus_version": __version__,
        "inputs": dict(inputs),
        "grid": grid.definition(),
        "attractors": summary(attractors),
        **accuracy_of(inputs, attractors.measured_error),
    }


def accuracy_of(inputs: Mapping[str, Any], measured: float | None, error: LabelError | None = None) -> dict[str, Any]:
    """Return the entry ``accuracy`` of a store: what is known of the errors of its own labels.

    Parameters
    ----------
    inputs : mapping
        Inputs of the labels; empty for an array from another source.
    measured : float or None
        Bound on the share of a trapping region that belongs to another basin.
    error : LabelError, optional
        What `Basins.label_error` said of cells followed again.
    """
    if not inputs:
        return {}
    found = None if error is None else error.as_data()
    return {"accuracy": {"tolerance": inputs["tolerance"], "trapping_regions": measured, "label_error": found}}


def check_belong(grid: Grid, outcomes: Any, inputs: Any) -> None:
    """Raise `InputError` where grid, attractors and inputs in a file are not of one system."""
    if not isinstance(inputs, Mapping):
        raise InputError("inputs", inputs, "a mapping")
    states = [outcomes.system.states] if isinstance(outcomes, Attractors) else []
    states += [Labelling.from_definition(inputs).system.states] if inputs else []
    if any(of_system != grid.states for of_system in states):
        raise InputError("the grid's states", grid.states, f"those of the system: {', '.join(states[0])}")
    if any(held.shape[1] != len(grid.states) for held in outcomes.points.values()):
        raise InputError("points", [held.shape for held in outcomes.points.values()], f"of {len(grid.states)} columns")
