"""Basins of attraction over a grid of initial conditions: one label a cell, in memory or in a store."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.basins.map.basin_files import accuracy_of, attributes_of, check_belong, dataset_of, parts_of
from saltus.basins.map.grid import Grid, tiles
from saltus.basins.map.labelling import Labelling
from saltus.basins.map.outcomes import (
    Outcomes,
    attractors_bytes,
    attractors_table,
    named_labels,
    outcomes_from,
    points_of,
)  # fmt: skip
from saltus.basins.map.store import Store, Window
from saltus.basins.map.wrong_labels import LabelError, compared, label_error_of
from saltus.described import described
from saltus.ensemble.traps import NOT_DONE, UNDECIDED
from saltus.errors import InputError
from saltus.progress import ended
from saltus.result import Result

if TYPE_CHECKING:
    import os

    import xarray as xr
    from numpy.typing import ArrayLike, NDArray

    from saltus.contents import Contents

__all__ = ["Basins"]


@dataclass(frozen=True, eq=False, repr=False)
class Basins(Result):
    """The attractor of each cell of a grid of initial conditions; made by `map_basins`.

    Attributes
    ----------
    labels : array of uint8, shape of the grid
        One byte a cell, with the meanings in `attractors.labels`; 255 for a cell that is not done. An ndarray in
        memory; in a store, an array that is read where it is sliced.
    grid : Grid
        The cells; a label belongs to its cell's centre.
    attractors : Attractors or Outcomes
        Meanings of the labels, and the attractors.
    inputs : mapping
        All inputs but the grid as plain data: the system's definition, parameters, tolerance, trapping regions, ...
    stopped : str
        Whether all cells are done, in words; a section has the text of the whole grid.
    path : Path or None
        The store.
    orbits_per_second : float
        Motions followed a second when the basins were computed; NaN where unknown.
    undecided : str
        Why cells are undecided, in words; empty where no cell is.
    noted_error : LabelError or None
        The `label_error` that `map_basins` measured when all cells were done.

    Examples
    --------
    >>> x = np.linspace(-0.95, 0.95, 20)
    >>> disc = Basins.from_array(x[:, None] ** 2 + x**2 < 0.36, {"x": x, "y": x}, {"outside": 0, "inside": 1})
    >>> disc.fractions()
    {'outside': 0.72, 'inside': 0.28, 'diverged': 0.0, 'undecided': 0.0}
    >>> disc.section(y=0.42).labels.tolist()
    [0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0]
    """

    labels: NDArray[np.uint8] | Window
    grid: Grid
    attractors: Any
    inputs: Mapping[str, Any] = field(default_factory=dict)
    stopped: str = ""
    path: Path | None = None
    orbits_per_second: float = float("nan")
    undecided: str = ""
    noted_error: LabelError | None = None

    def __post_init__(self) -> None:
        if isinstance(self.labels, np.ndarray):
            self.labels.setflags(write=False)
        object.__setattr__(self, "inputs", MappingProxyType(dict(self.inputs)))

    @classmethod
    def from_array(
        cls,
        labels: ArrayLike,
        axes: Mapping[str, ArrayLike],
        names: Mapping[str, int],
        points: Mapping[str, ArrayLike] | None = None,
    ) -> Basins:
        """Return basins made of an array of labels from another source.

        Parameters
        ----------
        labels : array_like of integers or booleans, shape (len(axes[0]), len(axes[1]), ...)
            The label of each cell, between 0 and 254.
        axes : mapping of str to array_like, shape (count,)
            Centres of the cells along each coordinate, evenly spaced, at least two.
        names : mapping of str to int
            The label of each outcome, between 0 and 252; ``diverged`` is 253 and ``undecided`` 254.
        points : mapping of str to array_like, shape (k, coordinates), optional
            Points of the attractors.

        Returns
        -------
        Basins
            In memory.

        Raises
        ------
        InputError
            Centres that are not evenly spaced, another shape, a label without a name, or names and points that are not
            allowed.
        """
        given = checks.mapping("axes", axes, "coordinates to centres of cells")
        ranges = {name: _range(name, centres) for name, centres in given.items()}
        grid = Grid(tuple(ranges), ranges)
        try:
            array = np.asarray(labels)
        except Exception as error:  # rows of different lengths, or whatever an object's __array__ raises
            raise InputError("labels", labels, "an array of integers or booleans") from error
        if array.dtype.kind not in "biu":
            raise InputError("labels", f"an array of {array.dtype}", "integers or booleans")
        if array.shape != grid.shape:
            raise InputError("labels' shape", array.shape, f"that of the axes, {grid.shape}")
        named = named_labels(checks.mapping("names", names, "outcomes to labels"))
        if unnamed := sorted(set(np.unique(array).tolist()) - set(named.values())):
            raise InputError("labels", unnamed[0], f"labels that are named: {', '.join(map(str, named.values()))}")
        at_strobes = checks.mapping("points", points, "attractors to points")
        held = {name: points_of(name, at, names, grid) for name, at in at_strobes.items()}
        return cls(array.astype(np.uint8), grid, Outcomes(named, held), stopped=ended(array.size, array.size, "cells"))

    @classmethod
    def open(cls, path: str | os.PathLike[str]) -> Basins:
        """Return the basins in a store, as `saltus.load` does.

        Labels are read on access.

        Parameters
        ----------
        path : path-like
            The folder that `map_basins` or `save` wrote.

        Returns
        -------
        Basins
            Whose labels are on the disk.

        Raises
        ------
        InputError
            It is no store of basins.
        """
        store = Store.open(checks.path("path", path, "the path of a folder"))
        held = store.attractors
        try:
            outcomes = outcomes_from(held, store.attributes["attractors"])
            check_belong(store.grid, outcomes, store.attributes["inputs"])
            return cls.of_store(store, outcomes)
        except InputError as error:
            raise InputError("path", str(path), "a whole store of basins", str(error)) from error

    @classmethod
    def of_store(cls, store: Store, attractors: Any, *, interrupted: bool = False) -> Basins:
        """Return the basins in an open store.

        Parameters
        ----------
        store : Store
            With the labels.
        attractors : Attractors or Outcomes
            Whose basins these are.
        interrupted : bool, optional
            Whether an interrupt ended the run.

        Returns
        -------
        Basins

        Raises
        ------
        InputError
            The store's metadata are damaged.
        """
        done, rate = store.done(), store.orbits_per_second
        said = store.attributes.get("stopped") or ended(done, store.grid.size, "cells", interrupted=interrupted)
        why = store.attributes.get("undecided", "")
        for name, text in (("stopped", said), ("undecided", why)):
            if not isinstance(text, str):
                raise InputError(f"attribute {name!r}", text, "a text")
        error = store.attributes.get("label_error")
        noted = None if error is None else label_error_of(error)
        return cls(store.labels, store.grid, attractors, store.attributes["inputs"], said, store.path, rate, why, noted)

    @cached_property
    def names(self) -> Mapping[int, str]:
        """Name of each outcome, by label."""
        return MappingProxyType(
            {label: name for name, label in self.attractors.labels.items()} | {NOT_DONE: "not done"}
        )

    def section(self, **values: float) -> Basins:
        """Return the section at the cells nearest to given values of coordinates, without reading labels.

        Its `grid.fixed` has the coordinates' values on the section: the centres of these cells.

        Parameters
        ----------
        **values : float
            Coordinates by name.

        Returns
        -------
        Basins
            Basins over the coordinates left free.

        Raises
        ------
        InputError
            A coordinate that is not free, a value outside the grid, or no coordinate left free.
        """
        cells = self.grid.nearest(values)
        grid = self.grid.section(cells)
        at = {self.grid.names.index(name): index for name, index in cells.items()}
        if isinstance(self.labels, np.ndarray):
            labels: Any = self.labels[tuple(at.get(k, slice(None)) for k in range(self.labels.ndim))]
        else:
            labels = self.labels.section(at)
        return replace(self, labels=labels, grid=grid)

    def blocks(self) -> Iterator[tuple[tuple[slice, ...], NDArray[np.uint8]]]:
        """Go through the array in blocks of at most half a million cells: the slices and the labels of each.

        Use it for a grid that is larger than memory.
        """
        unit = self.grid.layout[1] if isinstance(self.labels, np.ndarray) else self.labels.unit
        for cells in tiles(self.grid.shape, unit):
            yield cells, self.labels[cells]

    def fractions(self) -> dict[str, float]:
        """Return each outcome's share of the cells, by name, with ``not done`` where cells are not done."""
        counts = np.zeros(256, dtype=np.int64)
        for _, labels in self.blocks():
            counts += np.bincount(labels.ravel(), minlength=256)
        shares = (counts / self.grid.size).tolist()
        found = {name: shares[label] for name, label in self.attractors.labels.items()}
        return found | ({"not done": shares[NOT_DONE]} if counts[NOT_DONE] else {})

    def classify(self, points: ArrayLike, *, engine: str | None = None) -> NDArray[np.uint8]:
        """Return the labels of the motions from given points, on the grid or off it.

        They are computed like those of the cells; `names` has the name of each.

        Parameters
        ----------
        points : array_like, shape (..., n)
            States in the system's order, at phase 0.
        engine : {"cpu", "cuda"}, optional
            Engine; by default that of the grid, with ``"cpu"`` in place of ``"dask"``.

        Returns
        -------
        ndarray of uint8, shape (...)

        Raises
        ------
        InputError
            Another shape, a point that is not finite, an engine that is not available, or basins without a system
            (`from_array`).
        """
        labelling, n = self._labelling, len(self.grid.states)
        if engine is not None:
            checks.chosen("engine", engine, ("cpu", "cuda"))
            labelling = labelling if engine == labelling.engine else replace(labelling, engine=engine)
        wanted = f"an array of shape (..., {n}): {', '.join(self.grid.states)}"
        x = checks.array("points", points, wanted)
        if not x.ndim or x.shape[-1] != n:
            raise InputError("points", x.shape, wanted)
        return np.asarray(labelling.of(x.reshape(-1, n)).reshape(x.shape[:-1]))

    def label_error(
        self, cells: int = 1000, *, by_events: int = 100, tolerance: float = 1e-12, rng: int | np.random.Generator = 0
    ) -> LabelError:
        """Return how many labels of random cells are wrong: their motions are followed anew, more exactly.

        The share depends on the system. With one tolerance, a grid may have no wrong label, and another with long
        chaotic transients one in twenty.

        Motions are followed at a finer tolerance, until they are up to 10 000 times nearer to an attractor than the
        trapping regions reach. So errors of these regions count too. Errors that all lanes share do not; therefore the
        event-driven flow, with steps of another kind, also follows the first of the motions, at 1e-11. The boxes of
        chaotic or quasi-periodic attractors are not checked. For a map, images one by one take the place of the flow.

        A motion that comes near no attractor, however long it is followed, has a wrong label. From such motions a
        search starts anew, and tells the attractors that the first one missed.

        Parameters
        ----------
        cells : int, optional
            Count of the cells drawn, perhaps twice. Cells that are undecided or not done do not count.
        by_events : int, optional
            Count of these cells that the event-driven flow follows, in some milliseconds each.
        tolerance : float, optional
            Tolerance of a step.
        rng : int or numpy.random.Generator, optional
            What random numbers are drawn from, or its seed.

        Returns
        -------
        LabelError
            `map_basins` measures one on fewer cells; see `noted_error`.

        Raises
        ------
        InputError
            No cell, or basins without a system (`from_array`).
        """
        count, few = checks.size("cells", cells), checks.count("by_events", by_events, 0)
        tolerance = checks.between("tolerance", tolerance, 1e-14, 1e-2)
        numbers = checks.generator("rng", rng).integers(0, self.grid.size, count)
        at = np.unravel_index(numbers, self.grid.shape)
        labels = np.asarray(self.labels[at])
        said = (labels != NOT_DONE) & (labels != UNDECIDED)
        labels, points = labels[said], self.grid.at(np.stack(at, axis=-1)[said])
        return compared(labels, points, few, tolerance, self._labelling, self.attractors, self.grid)

    @cached_property
    def _labelling(self) -> Labelling:
        if not self.inputs:
            raise InputError("basins", "from an array", "computed by map_basins", "there is no system to follow")
        return Labelling.from_definition(self.inputs)

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return everything as a Dataset: ``labels`` over the free coordinates, the attractors, all inputs.

        The labels of a store are read on access.
        """
        return dataset_of(self)

    @classmethod
    def _read(cls, held: Contents) -> Basins:
        return cls(**parts_of(held))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the basins to a Zarr store or to a NetCDF file.

        Parameters
        ----------
        path : path-like
            A store if the path ends in ``.zarr``, else a file.

        Returns
        -------
        Path
            The store or file.

        Raises
        ------
        InputError
            It cannot be written, or the store exists.
        """
        path = checks.path("path", path)
        if path.suffix != ".zarr":
            return super().save(path)
        if path.exists():
            raise InputError("path", str(path), "a new folder", "a store is never written over")
        attributes = attributes_of(self.inputs, self.grid, self.attractors)
        tables = attractors_table(self.attractors, self.grid.states)
        store = Store.create(path, self.grid, attributes, attractors_bytes(self.attractors), tables)
        for cells in self.grid.units():
            store.write(cells, np.asarray(self.labels[cells]))
        if self.stopped != ended(store.done(), self.grid.size, "cells"):
            store.note(stopped=self.stopped)
        if self.undecided:
            store.note(undecided=self.undecided)
        if self.noted_error:
            accuracy = accuracy_of(self.inputs, self.attractors.measured_error, self.noted_error)
            store.note(label_error=self.noted_error.as_data(), **accuracy)
        return path

    def __reduce__(self) -> tuple[Any, ...]:
        values = (self.labels, self.grid, self.attractors, dict(self.inputs), self.stopped, self.path)
        return Basins, (*values, self.orbits_per_second, self.undecided, self.noted_error)

    def __eq__(self, other: object) -> bool:
        """Whether grids, labels, attractors and inputs are equal, however many cells were followed again."""
        if not isinstance(other, Basins):
            return NotImplemented
        return super(Basins, replace(self, noted_error=None)).__eq__(replace(other, noted_error=None))

    __hash__ = None  # as of all results

    def __repr__(self) -> str:
        system = self.inputs.get("system", {}).get("name") or "a hybrid system"
        lines = [f"Basins of {system}: {' x '.join(map(str, self.grid.shape))} cells"]
        for name, (low, high, count) in zip(self.grid.names, self.grid.ranges, strict=True):
            lines.append(f"  {name:6s} {low:g} to {high:g}, {count} cells")
        lines += [f"  {name:6s} {value:.6g}" for name, value in self.grid.fixed.items()]
        if isinstance(self.labels, np.ndarray):
            shares = (
                (name, share) for name, share in self.fractions().items() if share or name in self.attractors.names
            )
            lines.append("  " + ", ".join(f"{name} {share:.4%}" for name, share in shares))
        else:
            lines.append(f"  of {', '.join(self.attractors.names)}; in {self.path}")
        if self.undecided:
            lines.append(f"  undecided: {self.undecided}")
        if "longest" in self.inputs:
            lines.append(f"  longest {self.inputs['longest']} periods: {self.inputs.get('longest_reason', 'as given')}")
        if error := self.noted_error:
            lines.append(f"  wrong labels: {error}")
        return "\n".join([*lines, *([f"  {self.stopped}"] if self.stopped else [])])


def _range(name: str, given: ArrayLike) -> tuple[float, float, int]:
    where = f"axes[{name!r}]"
    centres = checks.array(where, given)
    if centres.ndim != 1 or centres.size < 2:
        raise InputError(where, np.shape(centres), "centres of cells, at least two")
    step = (centres[-1] - centres[0]) / (centres.size - 1)
    even = centres[0] + step * np.arange(centres.size)
    if not step > 0.0 or np.abs(centres - even).max() > 1e-6 * step:
        raise InputError(where, centres.tolist()[:3], "ascending centres of cells, evenly spaced")
    return float(centres[0] - step / 2.0), float(centres[-1] + step / 2.0), centres.size
