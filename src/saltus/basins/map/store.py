"""Zarr store of basins: labels in chunks, each written once and as a whole, and all inputs."""

from __future__ import annotations

import json
import math
import reprlib
import shutil
import tempfile
import warnings
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any
from uuid import uuid4

import numpy as np

from saltus.basins.map.grid import Grid, tiles
from saltus.ensemble.traps import NOT_DONE
from saltus.errors import InputError
from saltus.extras import check_installed
from saltus.files import flush, telling, whole_file
from saltus.work import interrupt_waits, starting

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Store", "Window", "check_same", "flags"]

_MOST_BYTES = 2**31  # size of the attractors' file, at most

_LABELS = "labels"  # array of the cells' labels
_ATTRACTORS = "attractors"  # array with the bytes of the attractors' file
_METADATA = "zarr.json"  # file of a group's or an array's metadata

# What Zarr and its codecs raise where a checksum, a length or an entry of the metadata is wrong.
_DAMAGE = (ValueError, RuntimeError, TypeError, KeyError, IndexError, AttributeError, MemoryError)


class Store:
    """An open store of basins.

    Attributes
    ----------
    path : Path
        Folder of the store.
    grid : Grid
        Grid of the cells.
    attributes : dict
        All metadata.
    """

    def __init__(self, path: Path, grid: Grid, group: Any) -> None:
        self.path, self.grid = path, grid
        self._group = group
        self.attributes: dict[str, Any] = dict(group.attrs)
        self._array = group[_LABELS]
        self._unit: tuple[int, ...] = self._array.shards or self._array.chunks

    @classmethod
    def create(
        cls,
        path: Path,
        grid: Grid,
        attributes: Mapping[str, Any],
        attractors: bytes,
        tables: Mapping[str, tuple[Any, NDArray[Any], dict[str, Any]]],
    ) -> Store:
        """Create a store without labels; it is written aside, then renamed, so that it is whole or absent.

        The metadata of all arrays stand in that of the group as well, so that other tools read one file.

        Parameters
        ----------
        path : Path
            The folder.
        grid : Grid
            Grid of the cells.
        attributes : mapping
            All metadata.
        attractors : bytes
            Content of the attractors' file.
        tables : mapping of str to (dimensions, ndarray, attributes)
            Arrays for other tools, which `saltus` does not read.

        Raises
        ------
        InputError
            Nothing can be written there.
        """
        check_installed("zarr")
        import zarr
        from zarr.codecs import ZstdCodec

        if not path.absolute().parent.is_dir():
            raise InputError("path", str(path), "in a folder that exists")
        aside = path.with_name(f".{path.name}.{uuid4().hex}.part")
        chunk, unit = grid.layout
        try:
            with interrupt_waits(), _telling(path):
                group = zarr.create_group(aside, zarr_format=3, attributes=dict(attributes))
                group.create_array(
                    _LABELS, shape=grid.shape, dtype="uint8", chunks=chunk, shards=None if unit == chunk else unit,
                    fill_value=NOT_DONE, compressors=ZstdCodec(level=3, checksum=True), dimension_names=grid.names,
                    attributes=flags(attributes["attractors"]["labels"]),
                )  # fmt: skip
                for name, axis in zip(grid.names, grid.axes, strict=True):
                    group.create_array(name, data=np.array(axis), dimension_names=(name,))
                held = np.frombuffer(attractors, np.uint8)
                group.create_array(
                    _ATTRACTORS, data=held, chunks=(max(held.size, 1),), dimension_names=("byte",),
                    compressors=ZstdCodec(level=3, checksum=True),
                )  # fmt: skip
                for name, (dims, values, told) in tables.items():
                    names = (dims,) if isinstance(dims, str) else dims
                    group.create_array(name, data=values, dimension_names=names, attributes=told)
                with warnings.catch_warnings():
                    warnings.filterwarnings("ignore", "Consolidated metadata")
                    zarr.consolidate_metadata(aside, zarr_format=3)
                for part in [*aside.rglob("*"), aside]:
                    flush(part)
                aside.rename(path)
                flush(path.absolute().parent)
        except BaseException:
            shutil.rmtree(aside, ignore_errors=True)
            raise
        return cls.open(path, writable=True)

    @classmethod
    def open(cls, path: Path, *, writable: bool = False) -> Store:
        """Open a store.

        Raises
        ------
        InputError
            It is no store of basins, or it cannot be written where `writable` is asked for.
        """
        check_installed("zarr")
        import zarr

        try:
            group = zarr.open_group(path, mode="r+" if writable else "r", zarr_format=3, use_consolidated=False)
            attributes: dict[str, Any] = dict(group.attrs)
            if attributes["saltus_result"] != "Basins":
                raise InputError("its kind", attributes["saltus_result"], "Basins")
            store = cls(path, Grid.from_definition(attributes["grid"]), group)
            store._check()
        except InputError as error:
            raise InputError("path", str(path), "a store of basins that saltus wrote", str(error)) from error
        except (OSError, RecursionError, *_DAMAGE) as error:
            hint = _what_is(path) or f"{type(error).__name__} {error}"
            raise InputError("path", str(path), "a store of basins that saltus wrote", hint) from error
        if writable:
            with _telling(path), tempfile.TemporaryFile(dir=path):
                pass
        return store

    def _check(self) -> None:
        """Raise `InputError` where the labels do not fit the grid, or the metadata have another type."""
        array, wanted = self._array, (self.grid.shape, np.dtype(np.uint8))
        if (array.shape, array.dtype) != wanted:
            raise InputError("shape and kind of the labels", (array.shape, array.dtype), str(wanted))
        if not all(
            1 <= chunk <= unit and unit % chunk == 0 for chunk, unit in zip(array.chunks, self._unit, strict=True)
        ):
            raise InputError("chunks of the labels", (array.chunks, self._unit), "whole parts of the units of writing")
        for name in ("inputs", "attractors"):
            if not isinstance(self.attributes.get(name), dict):
                raise InputError(f"attribute {name!r}", self.attributes.get(name), "a mapping")

    @property
    def orbits_per_second(self) -> float:
        """Motions followed a second while the labels were computed; NaN where unknown."""
        run = self.attributes.get("run", {})
        known = isinstance(run, dict) and all(isinstance(run.get(key), int | float) for key in ("orbits", "seconds"))
        return float(run["orbits"] / run["seconds"]) if known and run["seconds"] else math.nan

    @property
    def attractors(self) -> bytes:
        """Content of the attractors' file.

        Raises
        ------
        InputError
            It cannot be read.
        """
        try:
            held = self._group[_ATTRACTORS]
            if held.ndim != 1 or held.dtype != np.uint8 or held.size > _MOST_BYTES:
                raise ValueError(f"an array of {held.dtype} and of shape {held.shape}")
            return bytes(np.asarray(held[:]).tobytes())
        except (OSError, *_DAMAGE) as error:
            wanted = "a store with its attractors whole"
            raise InputError("path", str(self.path), wanted, f"what it holds of them is damaged: {error}") from error

    @property
    def labels(self) -> Window:
        """Labels of all cells, read on access."""
        return Window(self.path, self._array, (None,) * len(self.grid.shape), self._unit)

    def write(self, cells: tuple[slice, ...], labels: NDArray[np.uint8]) -> None:
        """Write a unit: Zarr writes aside and renames; a part lost by the disk has a wrong checksum."""
        with interrupt_waits(), _telling(self.path):  # Zarr's own thread would go on, and leave a part behind
            self._array[cells] = labels

    def missing(self) -> list[tuple[slice, ...]]:
        """Return the units that are not done; remove the remains of a unit that was cut off."""
        return [cells for cells in tiles(self.grid.shape, self._unit) if not self._holds(cells)]

    def done(self) -> int:
        """Return the count of cells in finished units."""
        units = tiles(self.grid.shape, self._unit)
        return sum(math.prod(part.stop - part.start for part in cells) for cells in units if self._written(cells))

    def note(self, **attributes: Any) -> None:
        """Add entries to the metadata."""
        with whole_file(self.path / _METADATA, "path") as draft:
            metadata = json.loads((self.path / _METADATA).read_text(encoding="utf-8"))
            metadata["attributes"] |= attributes
            draft.write_text(json.dumps(metadata, indent=2), encoding="utf-8")
        self.attributes |= attributes

    def _file(self, cells: Sequence[slice]) -> Path:
        place = [part.start // size for part, size in zip(cells, self._unit, strict=True)]
        return self.path.joinpath(_LABELS, "c", *map(str, place))

    def _written(self, cells: Sequence[slice]) -> bool:
        file = self._file(cells)
        return file.is_file() and file.stat().st_size > 0

    def _holds(self, cells: tuple[slice, ...]) -> bool:
        if not self._written(cells):
            return False
        try:
            if (self._array[cells] != NOT_DONE).all():
                return True
        except _DAMAGE:
            pass
        with _telling(self.path):
            self._file(cells).unlink()
        return False


class Window:
    """Labels of a store, or of a section through it, read on access.

    It has a shape and a dtype, and is sliced like an array; `numpy.asarray` reads it whole.

    Parameters
    ----------
    path : Path
        The store.
    array : zarr.Array
        Labels of all cells.
    fixed : tuple of int or None
        For each dimension of `array` the index of the section, None for a free dimension.
    unit : tuple of int
        Shape of a unit of `array`.
    """

    dtype = np.dtype(np.uint8)

    def __init__(self, path: Path, array: Any, fixed: tuple[int | None, ...], unit: tuple[int, ...]) -> None:
        self.path, self.fixed = path, fixed
        self._array, self._unit = array, unit
        free = [k for k, index in enumerate(fixed) if index is None]
        self.shape = tuple(int(array.shape[k]) for k in free)
        self.unit = tuple(unit[k] for k in free)
        self.ndim = len(free)
        self.size = math.prod(self.shape)

    def section(self, cells: Mapping[int, int]) -> Window:
        """Return the section at given indices of the dimensions."""
        free = iter(range(self.ndim))
        fixed = tuple(cells.get(next(free)) if index is None else index for index in self.fixed)
        return Window(self.path, self._array, fixed, self._unit)

    def __getitem__(self, key: Any) -> Any:
        parts = list(key) if isinstance(key, tuple) else [key]
        if dots := [i for i, part in enumerate(parts) if part is Ellipsis]:
            parts[dots[0] : dots[0] + 1] = [slice(None)] * (self.ndim - len(parts) + 1)
        parts += [slice(None)] * (self.ndim - len(parts))
        if len(parts) > self.ndim:
            raise IndexError(f"{len(parts)} indices for {self.ndim} dimensions")
        given = iter(parts)
        whole = tuple(next(given) if index is None else index for index in self.fixed)
        one_by_one = any(np.ndim(part) for part in parts) and not any(isinstance(part, slice) for part in parts)
        try:
            return self._array.vindex[tuple(np.broadcast_arrays(*whole))] if one_by_one else self._array[whole]
        except _DAMAGE as error:
            wanted = "a store whose chunks are whole"
            hint = "map_basins with the same input computes what is damaged again"
            raise InputError("path", str(self.path), wanted, f"{error}; {hint}") from error

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> NDArray[Any]:
        return np.asarray(self[...], dtype=dtype)

    def __len__(self) -> int:
        return self.shape[0]

    def __repr__(self) -> str:
        return f"<labels of {' x '.join(map(str, self.shape))} cells in {self.path}>"


def check_same(path: Path, inputs: Mapping[str, Any], kept: Mapping[str, Any]) -> None:
    """Raise `InputError`, with the first differing input and both values, for a store of other inputs."""
    for name, mine, its in _differences(inputs, kept):
        hint = f"its {name} is {_shortened(its)}, not {_shortened(mine)}"
        raise InputError("path", str(path), "a new one, or that of the same input", hint)


def _shortened(value: Any) -> str:
    short = reprlib.Repr()
    short.maxstring = short.maxother = 80
    short.maxlist = short.maxdict = 8
    return short.repr(value)


def _differences(mine: Any, its: Any, name: str = "") -> Iterator[tuple[str, Any, Any]]:
    if isinstance(mine, Mapping) and isinstance(its, Mapping):
        for key in [*mine, *(key for key in its if key not in mine)]:
            yield from _differences(mine.get(key), its.get(key), f"{name}.{key}".removeprefix("."))
    elif mine != its:
        yield name, mine, its


def flags(labels: Mapping[str, int]) -> dict[str, Any]:
    """Return the names of the labels as climate and forecast (CF) files have them."""
    return {
        "long_name": "label of the attractor",
        "flag_values": list(labels.values()),
        "flag_meanings": " ".join(name.replace(" ", "_") for name in labels),
    }


def _what_is(path: Path) -> str:
    """Return what is at a path without a store, where this helps."""
    if not path.exists():
        return "there is nothing"
    if not path.is_dir():
        return "it is a file"
    if (held := sorted(file.parent.name for file in path.glob(f"*/{_METADATA}"))) and _LABELS not in held:
        return f"it holds {', '.join(held)}"
    return "" if (path / _METADATA).exists() else "it is a folder of something else"


@contextmanager
def _telling(path: Path) -> Iterator[None]:
    """Turn an error of the disk, or of Zarr's thread, into an `InputError` of one line."""
    with telling(path, "path", "what is done is kept, and the same call goes on from it", "a folder"), starting():
        yield
