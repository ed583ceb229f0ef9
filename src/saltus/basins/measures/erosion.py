"""Erosion profiles: integrity measures along a parameter, as a result."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.basins.map.grid import Grid
from saltus.contents import Contents
from saltus.described import described
from saltus.errors import InputError
from saltus.result import Result, frozen
from saltus.system import HybridSystem, Map
from saltus.system.plain import held_any, held_parameters, swept_parameter

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["ErosionProfile"]


@dataclass(frozen=True, eq=False, repr=False)
class ErosionProfile(Result):
    """Integrity measures along a parameter; made by `erosion_profile`.

    Attributes
    ----------
    system : HybridSystem or Map
        The system.
    parameter : str
        The parameter that varies.
    values : ndarray, shape (value,)
        Its values, ascending.
    parameters : mapping of str to float
        All parameters at the first value.
    attractors : tuple of str
        Names of all attractors, in the order of their first appearance.
    measures : tuple of str
        Names of the measures.
    found, errors : ndarray, shape (value, attractor, measure)
        Values of the measures, and their errors; NaN where there is none.
    clipped : ndarray of bool, shape (value, attractor, measure)
        Where the window's edge limits the measure, so that the value is only a bound.
    notes : ndarray of str, shape (value, attractor, measure)
        Remark on a value, or the reason why there is none.
    grid : mapping
        The grid, as `Grid.definition` has it.
    stopped : str
        Why it ended, in words.

    Examples
    --------
    >>> import saltus
    >>> basins = saltus.Map(("x",), {"a": 0.5}, {"x": "a*x + x**3"})
    >>> profile = saltus.erosion_profile(basins, "a", [0.2, 0.5], {"x": (-2.0, 2.0, 101)})
    >>> profile.values.tolist()
    [0.2, 0.5]
    """

    system: HybridSystem | Map
    parameter: str
    values: NDArray[np.float64]
    parameters: Mapping[str, float]
    attractors: tuple[str, ...]
    measures: tuple[str, ...]
    found: NDArray[np.float64]
    errors: NDArray[np.float64]
    clipped: NDArray[np.bool_]
    notes: NDArray[np.str_]
    grid: Mapping[str, Any]
    stopped: str

    def __post_init__(self) -> None:
        for name, kind in (
            ("values", float), ("found", float), ("errors", float), ("clipped", np.bool_), ("notes", str)
        ):  # fmt: skip
            object.__setattr__(self, name, frozen(getattr(self, name), kind))
        for name in ("parameters", "grid"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))

    def of(self, measure: str, attractor: str) -> NDArray[np.float64]:
        """Return a measure of an attractor at every value.

        Parameters
        ----------
        measure : str
            One of `measures`.
        attractor : str
            Its name.

        Returns
        -------
        ndarray, shape (value,)
            NaN where the attractor is not there.

        Raises
        ------
        InputError
            An unknown measure or attractor.
        """
        i, k = self._place("attractor", attractor), self._place("measure", measure)
        return self.found[:, i, k]

    def _place(self, kind: str, name: str) -> int:
        known = self.attractors if kind == "attractor" else self.measures
        return known.index(checks.chosen(kind, name, known))

    def __repr__(self) -> str:
        title = self.system.name or self.system.unnamed
        lines = [
            f"ErosionProfile of {title}: {self.parameter} from {self.values[0]:.6g} to {self.values[-1]:.6g}, "
            f"{self.values.size} {'value' if self.values.size == 1 else 'values'}"
        ]
        for i, name in enumerate(self.attractors):
            for k, measure in enumerate(self.measures):
                column = self.found[:, i, k]
                known = column[np.isfinite(column)]
                span = f"{known.min():.4g} to {known.max():.4g}" if known.size else "not measured"
                clipped = int(self.clipped[:, i, k].sum())
                missing = column.size - known.size
                lines.append(
                    f"  {name:16s} {measure:10s} {span}"
                    + (f", {clipped} clipped by the window" if clipped else "")
                    + (f", {missing} missing" if missing and known.size else "")
                )
        return "\n".join([*lines, f"  {self.stopped}"])

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return everything as a Dataset with the dimensions value, attractor and measure."""
        from saltus.extras import xr

        each = ("value", "attractor", "measure")
        return xr.Dataset(
            {
                "found": (each, np.array(self.found)),
                "error": (each, np.array(self.errors)),
                "clipped": (each, np.array(self.clipped)),
                "note": (each, self.notes.astype(object)),
            },
            coords={
                "value": ("value", np.array(self.values), {"parameter": self.parameter}),
                "attractor": np.array(self.attractors, dtype=object),
                "measure": np.array(self.measures, dtype=object),
            },
            attrs={
                "parameter": self.parameter,
                "definition": json.dumps(self.system.definition()),
                "parameters": json.dumps(dict(self.parameters)),
                "grid": json.dumps(dict(self.grid)),
                "stopped": self.stopped,
            },
        )

    @classmethod
    def _read(cls, held: Contents) -> ErosionProfile:
        system, each = held_any(held), ("value", "attractor", "measure")
        grid = held.json("grid", dict)
        if Grid.from_definition(grid).states != system.states:
            raise InputError("the grid's states", grid["states"], f"those of the system: {', '.join(system.states)}")
        return cls(
            system,
            swept_parameter(held, system),
            checks.ascending("variable 'value'", held.array("value", ("value",))),
            held_parameters(held, system),
            tuple(held.array("attractor", ("attractor",), str).tolist()),
            tuple(held.array("measure", ("measure",), str).tolist()),
            held.array("found", each, finite=False),
            held.array("error", each, finite=False),
            held.array("clipped", each, bool),
            held.array("note", each, str),
            grid,
            held.text("stopped"),
        )
