"""What every result can do: become an xarray Dataset, be saved, read again, compared and plotted."""

from __future__ import annotations

import importlib
import json
from abc import ABC, abstractmethod
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from saltus import checks
from saltus.errors import InputError

if TYPE_CHECKING:
    import os

    import xarray as xr

__all__ = ["Result", "frozen", "load"]

_HOMES = {
    "Trajectory": "saltus.flow.simulate",
    "PeriodicOrbit": "saltus.orbits.orbit",
    "Branch": "saltus.continuation.branch",
    "Locus": "saltus.continuation.locus",
    "Family": "saltus.continuation.family",
    "Attractors": "saltus.basins.attractors",
    "Basins": "saltus.basins.basins",
    "ErosionProfile": "saltus.basins.erosion",
    "Sweep": "saltus.sweeps.sweep",
    "LyapunovSpectrum": "saltus.sweeps.lyapunov",
}

_STORE = "zarr.json"
"""The file by which a folder is known as a Zarr store."""


def frozen(array: Any, dtype: Any = np.float64) -> Any:
    """Return a read-only copy of an array.

    Examples
    --------
    >>> frozen([1.0, 2.0]).flags.writeable
    False
    """
    copy = np.array(array, dtype=dtype)
    copy.setflags(write=False)
    return copy


class Result(ABC):
    """Base of all results; each can be saved to NetCDF and read back equal, without the model at hand."""

    @abstractmethod
    def to_xarray(self) -> xr.Dataset:
        """Return everything in the result as a Dataset with named dimensions."""

    @classmethod
    @abstractmethod
    def from_xarray(cls, dataset: xr.Dataset) -> Self:
        """Return the result that `to_xarray` described."""

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the result to a NetCDF file and return its path.

        Raises
        ------
        InputError
            The file cannot be written.
        """
        from importlib.metadata import version

        path = checks.path("path", path)
        dataset = self.to_xarray()
        dataset.attrs |= {"saltus_result": type(self).__name__, "saltus_version": version("saltus")}
        try:
            dataset.to_netcdf(path, engine="h5netcdf")
        except OSError as error:
            raise InputError("path", str(path), "a file that can be written", str(error)) from error
        return path

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Read a result of this kind from a file; see `saltus.load`."""
        result = load(path)
        if not isinstance(result, cls):
            raise InputError("path", str(path), f"the file of a {cls.__name__}", f"it holds a {type(result).__name__}")
        return result

    def plot(self, *args: Any, **options: Any) -> Any:
        """Draw the result; see `saltus.plotting`."""
        from saltus.plotting import plot

        return plot(self, *args, **options)

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self).from_xarray, (self.to_xarray(),)

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        mine, theirs = self.to_xarray(), other.to_xarray()
        return mine.attrs == theirs.attrs and bool(mine.identical(theirs))

    __hash__ = None  # type: ignore[assignment]  # equal results need not be the same object


def load(path: str | os.PathLike[str]) -> Result:
    """Return the result saved in a file, whatever its kind.

    Parameters
    ----------
    path : path-like
        A NetCDF file written by `Result.save`, or a Zarr store of basins, whose labels are read when asked for.

    Raises
    ------
    InputError
        There is no such file or store, or it was not written by saltus.

    Examples
    --------
    >>> load("nowhere.nc")
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: path = 'nowhere.nc': must be a file that exists
    """
    import xarray as xr

    path = checks.path("path", path)
    if (Path(path) / _STORE).is_file():
        return _opened(Path(path))
    if not Path(path).is_file():
        raise InputError("path", str(path), "a file that exists", "it is a folder" if Path(path).is_dir() else "")
    try:
        with xr.open_dataset(path, engine="h5netcdf") as dataset:
            dataset.load()
    except (OSError, ValueError) as error:
        raise InputError("path", str(path), "a NetCDF file", str(error)) from error
    kind = dataset.attrs.pop("saltus_result", None)
    dataset.attrs.pop("saltus_version", None)
    home: type[Result] = _home(kind, path)
    return home.from_xarray(dataset)


def _opened(path: Path) -> Result:
    """Return the result in a Zarr store."""
    try:
        kind = json.loads((path / _STORE).read_text(encoding="utf-8"))["attributes"]["saltus_result"]
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise InputError("path", str(path), "a store written by saltus", f"{type(error).__name__} {error}") from error
    opened: Result = _home(kind, path).open(path)
    return opened


def _home(kind: Any, path: str | os.PathLike[str]) -> Any:
    """Return the class of a kind of result."""
    if kind not in _HOMES:
        raise InputError("path", str(path), "a file written by saltus")
    return getattr(importlib.import_module(_HOMES[kind]), kind)
