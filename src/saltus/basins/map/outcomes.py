"""Meanings of labels: the attractors of basins, in memory and in a store."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.basins.attractors.attractors import Attractors
from saltus.basins.map.grid import Grid
from saltus.basins.map.store import flags
from saltus.contents import checked_texts
from saltus.ensemble.traps import DIVERGED, NOT_DONE, UNDECIDED
from saltus.errors import InputError
from saltus.files import sealed
from saltus.result import dataset_in, frozen, netcdf

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

__all__ = ["Outcomes", "attractors_bytes", "attractors_table", "named_labels", "outcomes_from", "points_of", "summary"]


@dataclass(frozen=True, eq=False)
class Outcomes:
    """Meanings of the labels of an array from another source.

    Attributes
    ----------
    labels : mapping of str to int
        The byte of each outcome.
    points : mapping of str to ndarray, shape (k, n)
        Points of the attractors, where they are known.
    kinds, notes : mapping of str to str
        Kind of each attractor, and a note on its trapping region.
    measured_error : float or None
        Bound on the share of a trapping region that belongs to another basin, where measured.
    """

    labels: Mapping[str, int]
    points: Mapping[str, NDArray[np.float64]] = field(default_factory=dict)
    kinds: Mapping[str, str] = field(default_factory=dict)
    notes: Mapping[str, str] = field(default_factory=dict)
    measured_error: float | None = None

    @property
    def names(self) -> tuple[str, ...]:
        """The attractors: outcomes other than divergence and indecision."""
        return tuple(name for name, label in self.labels.items() if label < DIVERGED)


def summary(attractors: Any) -> dict[str, Any]:
    """Return a summary of the attractors as plain data."""
    told = {
        "labels": dict(attractors.labels),
        "points": {name: np.asarray(points).tolist() for name, points in attractors.points.items()},
        "kinds": dict(attractors.kinds),
        "notes": dict(attractors.notes),
        "measured_error": attractors.measured_error,
    }
    return dict(json.loads(json.dumps(told, default=str)))


def attractors_bytes(attractors: Any) -> bytes:
    """Return the attractors as the bytes of a NetCDF file; empty for `Outcomes`."""
    if not isinstance(attractors, Attractors):
        return b""
    return sealed(netcdf({"": attractors.to_xarray()}))


def attractors_table(attractors: Any, states: Sequence[str]) -> dict[str, tuple[Any, NDArray[Any], dict[str, Any]]]:
    """Return points of the attractors and their labels as arrays that other tools read: dimensions, values, attributes.

    `outcomes_from` does not read them.
    """
    points = [np.empty((0, len(states))), *attractors.points.values()]
    rows = [np.full(len(held), attractors.labels[name], np.uint8) for name, held in attractors.points.items()]
    labels = np.concatenate([np.empty(0, np.uint8), *rows])
    return {
        "attractor_point": (
            ("attractor_index", "attractor_state"),
            np.concatenate(points),
            {"long_name": "points of the attractors", "states": " ".join(states)},
        ),
        "attractor_label": ("attractor_index", labels, flags(attractors.labels)),
    }


def outcomes_from(held: bytes, said: Mapping[str, Any]) -> Any:
    """Return the attractors of a store; raise `InputError` where they are incomplete."""
    return Attractors.from_xarray(dataset_in(held, "attractors")) if held else _outcomes(said)


def _outcomes(said: Mapping[str, Any]) -> Outcomes:
    """Return the outcomes that `summary` described."""
    labels, error = said.get("labels"), said.get("measured_error")
    if not isinstance(labels, Mapping) or not all(
        type(label) is int and 0 <= label < NOT_DONE for label in labels.values()
    ):
        raise InputError("outcomes' labels", labels, f"labels between 0 and {NOT_DONE - 1} by name")
    for key in ("kinds", "notes", "points"):
        if not isinstance(said.get(key), Mapping) or not set(said[key]) <= set(labels):
            raise InputError(f"outcomes' {key}", said.get(key), f"a mapping of some of {', '.join(labels)}")
    for key in ("kinds", "notes"):
        checked_texts(list(said[key].values()), f"outcomes' {key}")
    if error is not None and not checks.is_real(error):
        raise InputError("outcomes' measured_error", error, "a number, or none")
    try:
        points = {name: frozen(points) for name, points in said["points"].items()}
    except (TypeError, ValueError) as wrong:
        raise InputError("outcomes' points", type(said["points"]).__name__, "rows of numbers", str(wrong)) from None
    if any(held.ndim != 2 or not np.isfinite(held).all() for held in points.values()):
        raise InputError("outcomes' points", [held.shape for held in points.values()], "rows of finite numbers")
    return Outcomes(dict(labels), points, said["kinds"], said["notes"], error)


def named_labels(names: Mapping[str, int]) -> dict[str, int]:
    """Return the label of each outcome; raise `InputError` where two have one."""
    named = {"diverged": DIVERGED, "undecided": UNDECIDED}
    for name, label in names.items():
        if name not in named:
            checks.count(f"names[{name!r}]", label, 0, DIVERGED - 1)
        else:
            checks.count(f"names[{name!r}]", label, named[name], named[name])
    found = {**names, **named}
    if len(set(found.values())) < len(found):
        raise InputError("names", dict(names), "a label of its own for each")
    return found


def points_of(name: str, points: ArrayLike, names: Mapping[str, int], grid: Grid) -> NDArray[np.float64]:
    """Return checked points of an attractor, rows of a grid's states; raise `InputError` for invalid ones."""
    checks.chosen("points", name, names)
    where, allowed = f"points[{name!r}]", f"rows of finite {', '.join(grid.states)}"
    found: NDArray[np.float64] = frozen(np.atleast_2d(checks.array(where, points, allowed)))
    if found.ndim != 2 or found.shape[1] != len(grid.states):
        raise InputError(where, points, allowed)
    return found
