"""Files that instruments write: which reader reads which, and what a file holds."""

from __future__ import annotations

import os
from collections.abc import Callable
from pathlib import Path

from saltus import checks
from saltus.afm.files.ardf import read_ardf
from saltus.afm.files.bruker import read_nanoscope
from saltus.afm.files.columns import FileContents
from saltus.afm.files.gwyddion import read_gwyddion
from saltus.afm.files.hdf5 import read_hdf5
from saltus.afm.files.igor_waves import read_wave
from saltus.afm.files.jpk import read_jpk
from saltus.afm.files.nanosurf import read_nhf, read_nid
from saltus.errors import InputError

__all__ = ["READERS", "instrument_file", "reader_of"]

READERS: dict[str, Callable[[Path], FileContents]] = {
    ".spm": read_nanoscope,
    ".pfc": read_nanoscope,
    ".jpk-force": read_jpk,
    ".jpk-force-map": read_jpk,
    ".jpk-qi-data": read_jpk,
    ".ardf": read_ardf,
    ".ibw": read_wave,
    ".nid": read_nid,
    ".nhf": read_nhf,
    ".gwy": read_gwyddion,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
}


def reader_of(path: Path) -> Callable[[Path], FileContents] | None:
    """Return the reader of a file by its suffix; ``.000`` to ``.999`` are NanoScope's. None where there is none."""
    suffix = path.suffix.lower()
    numbered = len(suffix) == 4 and suffix[1:].isdecimal()
    return read_nanoscope if numbered else READERS.get(suffix)


def instrument_file(path: str | os.PathLike[str]) -> FileContents:
    r"""Return what the file of an instrument holds: columns with units and points, constants, calibration.

    Curves are read when they are asked for, as ``contents.columns[0].lines[0]``, so that a large map takes no memory.

    Parameters
    ----------
    path : path-like
        A file as `saltus.afm.read_curve` takes it, but for text files.

    Returns
    -------
    FileContents
        Printed, it lists all. ``calibration`` has the constants under saltus's names: ``k_N_m``, ``invols_nm_V``,
        ``amplitude_invols_nm_V``, ``f_kHz`` (of the drive), ``f0_kHz``, ``Q``, ``R_nm``, as far as the file has them.

    Raises
    ------
    InputError
        The file cannot be read, is damaged, too large, or of another kind. A package that reads it is missing.

    Examples
    --------
    >>> import h5py, numpy as np, tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     with h5py.File(f"{folder}/curve.h5", "w") as file:
    ...         file["height"] = np.linspace(0.0, 5e-8, 6)
    ...         file["height"].attrs["unit"] = "m"
    ...     print(instrument_file(f"{folder}/curve.h5"))
    an HDF5 file
      height  m  6 points
    """
    path = checks.path("path", path)
    reader = reader_of(path)
    if reader is None:
        known = ", ".join([*READERS, ".000 to .999"])
        raise InputError("path", str(path), f"a file of an instrument: {known}", "read_curve reads text files")
    return reader(path)
