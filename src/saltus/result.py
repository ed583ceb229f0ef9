"""The base of all results: to and from xarray and files, comparison, pictures."""

from __future__ import annotations

import importlib
import json
import math
import os
import subprocess
import sys
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from html import escape
from io import BytesIO
from pathlib import Path
from tempfile import TemporaryDirectory
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, Self

import numpy as np

from saltus import checks
from saltus.contents import Contents
from saltus.errors import InputError, SaltusError
from saltus.extras import check_installed
from saltus.files import checked_seal, is_sealed, write_sealed
from saltus.version import __version__, tell_newer, written_by
from saltus.work import interrupt_waits

if TYPE_CHECKING:
    import xarray as xr

__all__ = ["READ", "Result", "dataset_in", "frozen", "load", "look", "netcdf", "reading", "result_in", "tagged"]

# The module of each kind of result.
_HOMES = {
    "Trajectory": "saltus.flow.trajectory",
    "Iterates": "saltus.maps.iterates",
    "MapOrbit": "saltus.maps.orbit",
    "PeriodicOrbit": "saltus.orbits.orbit",
    "Equilibrium": "saltus.equilibria.equilibrium",
    "EquilibriumBranch": "saltus.continuation.results.equilibrium_branch",
    "Diagram": "saltus.continuation.results.diagram",
    "EquilibriumLocus": "saltus.continuation.results.equilibrium_locus",
    "MapBranch": "saltus.continuation.results.map_curve",
    "MapCascade": "saltus.continuation.results.map_cascade",
    "MapLocus": "saltus.continuation.results.map_locus",
    "Branch": "saltus.continuation.results.branch",
    "SpecialPoint": "saltus.continuation.results.special_points",
    "Locus": "saltus.continuation.results.locus",
    "Family": "saltus.continuation.results.family",
    "Cascade": "saltus.continuation.results.cascade",
    "Attractors": "saltus.basins.attractors.attractors",
    "Basins": "saltus.basins.map.basins",
    "ErosionProfile": "saltus.basins.measures.erosion",
    "Sweep": "saltus.sweeps.sweep",
    "Fit": "saltus.fitting.result",
    "Optimum": "saltus.optimisation.optimum",
    "Curve": "saltus.afm.curves.curve",
    "Bistability": "saltus.afm.curves.bistable_region",
    "Calibration": "saltus.afm.calibration.calibration",
    "BimodalMap": "saltus.afm.bimodal.bimodal_map",
    "FrequencyShift": "saltus.afm.fm.shift_curve",
    "ReconstructedForce": "saltus.afm.reconstruction.force",
    "LyapunovSpectrum": "saltus.sweeps.lyapunov",
    "Verification": "saltus.verification.table",
}
_STORE = "zarr.json"  # file by which a folder is known as a Zarr store
_UNPACKED = 2**28  # bytes to which any file may unpack
_PACKING = 100  # times its own size to which a larger file may unpack; what saltus writes is not packed
_PATIENCE = 30.0  # seconds in which any file without a seal is read
_PACE = 1e7  # bytes a second at which a larger one is read
_TOLD = 200  # characters of another library's message about a damaged file


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


_OTHER_FORMATS = (".csv", ".tsv", ".txt", ".json", ".xlsx", ".npz", ".npy", ".mat", ".png", ".svg", ".pdf", ".pkl")
# suffixes of files that no result is written to
_KNOWN: dict[str, type[Result]] = {}  # classes of other packages, by name; a class registers when it is made


class Result(ABC):
    """Base of all results; each can be saved to NetCDF and read back equal, without the model at hand.

    A class that inherits from it is known to `load` by its name, once its module has been imported.

    Examples
    --------
    >>> import saltus
    >>> oscillator = saltus.HybridSystem.smooth({"x": "v", "v": "mu*(1 - x**2)*v - x"}, {"mu": 1.0})
    >>> orbit = saltus.find_orbit(oscillator, x0=[2.0, 0.0])
    >>> isinstance(orbit, saltus.results.Result), type(orbit.to_xarray()).__name__
    (True, 'Dataset')
    """

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        _KNOWN[cls.__name__] = cls

    @abstractmethod
    def to_xarray(self) -> xr.Dataset:
        """Return everything in the result as a Dataset with named dimensions."""

    @classmethod
    @abstractmethod
    def _read(cls, held: Contents) -> Self:
        """Return the result that checked contents describe."""

    @classmethod
    def from_xarray(cls, dataset: xr.Dataset) -> Self:
        """Return the result that a Dataset describes.

        Parameters
        ----------
        dataset : xarray.Dataset
            As `to_xarray` returns it.

        Returns
        -------
        Result
            Of the class whose method this is.

        Raises
        ------
        InputError
            Something in the Dataset is missing, of another shape or out of its range.
        """
        return cls._read(Contents(dataset))

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Write the result to a NetCDF file.

        The file is written beside its place and then renamed: whatever comes between, either the old one or the new one
        stands there. Its content is made in memory, which takes about twice the room of the result.

        Parameters
        ----------
        path : path-like
            The file; one that is there is replaced.

        Returns
        -------
        Path
            The file.

        Raises
        ------
        InputError
            The file cannot be written, as on a full disk; one that stood there before is left as it was. Its name is
            that of another format, as ``curve.csv``.
        """
        path = checks.path("path", path)
        if path.suffix.lower() in _OTHER_FORMATS:
            tables = "to_dataframe()" if hasattr(self, "to_dataframe") else "to_xarray()[['NAME', ...]].to_dataframe()"
            several = "" if hasattr(self, "to_dataframe") else " of variables with the same dimensions"
            hint = f"{tables}.to_csv(...) writes a table{several}, and plot() a picture"
            raise InputError("path", str(path), "a name of a NetCDF file, as 'result.nc'", hint)
        write_sealed(path, netcdf({"": tagged(self)}))
        return path

    @classmethod
    def load(cls, path: str | os.PathLike[str]) -> Self:
        """Return the result of this kind that a file holds; see `saltus.load`.

        Parameters
        ----------
        path : path-like
            What `save` wrote.

        Returns
        -------
        Result
            Of the class whose method this is.

        Raises
        ------
        InputError
            The file cannot be read, is damaged, or holds a result of another kind.
        """
        result = load(path)
        if not isinstance(result, cls):
            raise InputError(
                "path", os.fspath(path), f"the file of a {cls.__name__}", f"it holds a {type(result).__name__}"
            )
        return result

    def plot(self, *args: Any, **options: Any) -> Any:
        """Draw the result.

        Parameters
        ----------
        *args, **options
            As the kind's module of `saltus.plotting` takes them.

        Returns
        -------
        matplotlib.axes.Axes
            What was drawn on; see `saltus.plotting`.

        Raises
        ------
        InputError
            An option that this kind does not know, or a value that cannot be drawn.
        """
        from saltus.plotting import plot

        return plot(self, *args, **options)

    def _repr_html_(self) -> str:
        from saltus.plotting import picture_in_html

        return f"<pre>{escape(repr(self))}</pre>{picture_in_html(self)}"

    def __reduce__(self) -> tuple[Any, ...]:
        return type(self).from_xarray, (self.to_xarray(),)

    def __eq__(self, other: object) -> bool:
        if type(other) is not type(self):
            return NotImplemented
        return bool(self.to_xarray().identical(other.to_xarray()))

    __hash__ = None  # type: ignore[assignment]  # equal results need not be the same object


def tagged(result: Result) -> xr.Dataset:
    """Return a result as a Dataset from which `load` knows its kind."""
    dataset = result.to_xarray()
    dataset.attrs |= {"saltus_result": type(result).__name__, "saltus_version": __version__}
    return dataset


def netcdf(datasets: Mapping[str, xr.Dataset]) -> memoryview:
    """Return the content of a NetCDF file with a group for each Dataset; that of the name "" is the file itself.

    It is made in memory. HDF5 that writes to a disk loses an interrupt, and may report a full disk only when the file
    is closed.
    """
    check_installed("h5netcdf", "h5py")
    import h5netcdf
    from xarray.backends import H5NetCDFStore

    file = BytesIO()
    with interrupt_waits(), h5netcdf.File(file, "w") as written:
        for name, dataset in datasets.items():
            dataset.dump_to_store(H5NetCDFStore(written.create_group(name) if name else written))
    return file.getbuffer()


def load(path: str | os.PathLike[str]) -> Result:
    """Return the result saved in a file, whatever its kind.

    Parameters
    ----------
    path : path-like
        A NetCDF file written by `Result.save`, or a Zarr store of basins, whose labels are read when asked for.

    Returns
    -------
    Result
        A `PeriodicOrbit`, `Branch`, `Basins` or another kind: the one that was saved.

    Raises
    ------
    InputError
        There is no such file or store, it was not written by saltus, or it is damaged: what is returned has been looked
        at whole, shapes, ranges, names and indices.

    Examples
    --------
    >>> load("nowhere.nc")
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: path = 'nowhere.nc': must be a file that exists
    """
    from saltus.extras import xr

    path = checks.path("path", path)
    if os.path.isfile(path / _STORE):
        return _opened(path)
    with reading(path), xr.open_dataset(path, **READ) as dataset:
        dataset.load()
    if SESSION in dataset.attrs:
        hint = f"this is a session of the explorer: saltus explore --load {path} opens it"
        raise InputError("path", str(path), "the file of one result", hint)
    found: Result = result_in(dataset, path)
    return found


SESSION = "saltus_session"  # attribute of a file that has a whole session of the explorer

# How xarray opens a file; no number in it stands for a time of day.
READ: Mapping[str, Any] = MappingProxyType({"engine": "h5netcdf", "decode_times": False})


@contextmanager
def reading(path: Path) -> Iterator[None]:
    """Check that a NetCDF file is whole and no larger than it looks; turn what goes wrong then into an `InputError`."""
    if not os.path.isfile(path):
        raise InputError("path", str(path), "a file that exists", "it is a folder" if os.path.isdir(path) else "")
    check_installed("h5netcdf", "h5py")
    if not checked_seal(path):
        _look_from_afar(path)
    with _decoding("path", str(path)):
        _check_size(path, path.stat().st_size)
        yield


# What a process does that reads a file; it ends by itself after a time, should its parent be gone.
_LOOK = """
import faulthandler, json, sys
faulthandler.dump_traceback_later(float(sys.argv[3]), exit=True)
sys.path[:] = json.loads(sys.argv[2])
from saltus.result import look
look(sys.argv[1])
"""


def look(path: str) -> None:
    """Read everything in a NetCDF file, and forget it."""
    from saltus.extras import xr

    _check_size(Path(path), os.path.getsize(path))
    with xr.open_datatree(path, **READ) as tree:
        for node in tree.subtree:
            node.to_dataset().load()


def _look_from_afar(path: Path) -> None:
    """Read a file without a seal in a process of its own: HDF5 may never end, or end the process, where it is damaged.

    An error there is raised here again.
    """
    longest = _PATIENCE + path.stat().st_size / _PACE
    command = [sys.executable, "-c", _LOOK, str(path.absolute()), json.dumps(sys.path), str(longest + 1.0)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=longest, check=False)
    except subprocess.TimeoutExpired:
        raise InputError("path", str(path), "a NetCDF file", "it is damaged: reading it does not end") from None
    except OSError as error:
        raise InputError("path", str(path), "read by a process of its own", f"none can be started: {error}") from error
    if done.returncode < 0:
        raise InputError("path", str(path), "a NetCDF file", "it is damaged: a process that reads it dies")


def dataset_in(content: bytes, name: str) -> xr.Dataset:
    """Return the Dataset in the content of a NetCDF file, as `netcdf` makes it; `name` is what messages call it."""
    from saltus.extras import xr

    shown = f"{len(content)} bytes"
    if not is_sealed(BytesIO(content), name, shown):
        with TemporaryDirectory() as folder:
            copy = Path(folder) / "content.nc"
            copy.write_bytes(content)
            _look_from_afar(copy)
    with _decoding(name, shown):
        _check_size(BytesIO(content), len(content))
        with xr.open_dataset(BytesIO(content), **READ) as dataset:
            return dataset.load()


@contextmanager
def _decoding(name: str, value: str) -> Iterator[None]:
    """Turn whatever is raised by the libraries that read NetCDF into an `InputError`."""
    try:
        yield
    except SaltusError:
        raise
    except Exception as error:  # the libraries do not say what they raise where a file is damaged: it may be anything
        told = " ".join(f"{type(error).__name__}: {error}".split())[:_TOLD]
        raise InputError(name, value, "a NetCDF file", told) from error


def _check_size(file: Path | BytesIO, size: int) -> None:
    """Raise `InputError` where a file would take much more memory than it takes on the disk."""
    import h5py

    held = 0

    def count(name: str, item: Any) -> None:
        nonlocal held
        if isinstance(item, h5py.Dataset):
            held += math.prod(item.shape or ()) * item.dtype.itemsize

    with h5py.File(file, "r") as opened:
        opened.visititems(count)
    most = _UNPACKED + _PACKING * size
    if held > most:
        raise InputError("bytes when unpacked", held, f"at most {most}, by the size of the file")


def result_in(dataset: xr.Dataset, path: Path) -> Any:
    """Return the result that a Dataset from a file describes; raise `InputError` where it cannot be one."""
    kind, writer = dataset.attrs.pop("saltus_result", None), dataset.attrs.pop("saltus_version", None)
    home = _home(kind, path, writer)
    try:
        found = home.from_xarray(dataset)
    except InputError as error:
        hint = "; ".join([str(error), *written_by(writer)])
        raise InputError("path", str(path), f"the whole file of a {kind}", hint) from error
    tell_newer(writer, path)
    return found


def _opened(path: Path) -> Result:
    """Return the result in a Zarr store."""
    try:
        attributes = json.loads((path / _STORE).read_text(encoding="utf-8"))["attributes"]
        kind = attributes["saltus_result"]
    except (OSError, ValueError, KeyError, TypeError, RecursionError) as error:
        raise InputError("path", str(path), "a store written by saltus", f"{type(error).__name__} {error}") from error
    writer = attributes.get("saltus_version")
    try:
        opened: Result = _home(kind, path, writer).open(path)
    except InputError as error:
        name, value, allowed, hint = error.args
        raise InputError(name, value, allowed, "; ".join([*filter(None, [hint]), *written_by(writer)])) from error
    tell_newer(writer, path)
    return opened


def _home(kind: Any, path: Path, writer: Any) -> Any:
    """Return the class of a kind of result; no module is imported whose name a file could choose."""
    if not isinstance(kind, str) or (kind not in _HOMES and kind not in _KNOWN):
        hints = [f"import the module that has the class {kind[:_TOLD]}"] if isinstance(kind, str) else []
        raise InputError("path", str(path), "a file written by saltus", "; ".join([*hints, *written_by(writer)]))
    return getattr(importlib.import_module(_HOMES[kind]), kind) if kind in _HOMES else _KNOWN[kind]
