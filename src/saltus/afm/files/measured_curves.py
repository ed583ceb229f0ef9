"""Measured curves in files: columns whose names have units."""

from __future__ import annotations

import math
import os
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.afm.files.columns import FileColumn, FileContents
from saltus.afm.files.instrument_files import reader_of
from saltus.afm.files.text_tables import cells_of
from saltus.afm.files.unit_conversion import factor_between
from saltus.afm.models.readings import READINGS, readings_of
from saltus.errors import InputError, nearest

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

__all__ = ["read_curve", "read_force_table"]

_ALONG = ("Zc_nm", "f_kHz", "f_Hz")  # columns along which curves are measured
_FORCE = {"deflection_nm": "nm", "force_nN": "nN"}  # columns of force curves, with their units
_TABLE = ("D_nm", "F_nN", "sigma_nN")  # columns of a force over the gap
_DIRECTION = "direction"  # column of the ways
_TIME = "time_s"  # column of the times of the data
_WAYS = ("approach", "retract", "up", "down", "")  # what it holds
_UNIT = re.compile(r"^\s*(.+?)[_ ]*[\(\[](.*)[\)\]]\s*$")  # a name with its unit in brackets
_LINE = re.compile(r"(.*?)\s*#(\d+)")  # a name with the number of a curve


def read_curve(
    path: str | os.PathLike[str],
    columns: Mapping[str, str] | None = None,
    *,
    scale: Mapping[str, float] | None = None,
) -> pd.DataFrame:
    r"""Return a measured curve from a file, as columns whose names have units.

    The columns are one of ``Zc_nm``, ``f_kHz`` and ``f_Hz``; readings, as ``amplitude_nm`` and ``lag_deg``, or
    ``force_nN`` and ``deflection_nm`` of a force curve; and, if it is known, ``direction``: ``approach`` or
    ``retract``, ``up`` or ``down``. ``time_s`` says when a datum was measured.

    A CSV file with these names in its header needs no `columns`. Lines that begin with ``#`` are comments.
    `DataFrame.to_csv` with ``index=False`` writes such a file. Other headers have units in brackets. Semicolons and
    tabs may part the cells, and numbers between them may have decimal commas. The text is UTF-8, or UTF-16 with a byte
    order mark.

    Files of instruments are those of Bruker (``.spm``, ``.pfc``, ``.000`` to ``.999``), JPK (``.jpk-force``,
    ``.jpk-force-map``, ``.jpk-qi-data``), Asylum Research (``.ARDF``, and ``.ibw``, which needs ``saltus[files]``),
    Nanosurf (``.nid``, ``.nhf``) and Gwyddion (``.gwy``), and HDF5 files. `saltus.afm.instrument_file` lists what a
    file has. Names are those of channels, with their way, frame or segment where there are several, as
    ``"approach: Height"``. ``"Amplitude #2"`` is the second of several curves. ``"x"`` are the scaled rows of a wave.

    Parameters
    ----------
    path : path-like
        The file.
    columns : mapping of str to str, optional
        Names of the file's columns by the names of those wanted. Numbers are converted from the units of the file.
    scale : mapping of str to float, optional
        Factors by which numbers of the file are multiplied instead, as ``{"amplitude_nm": 52.0}`` for a detector of 52
        nm/V. A column without a unit needs one.

    Returns
    -------
    pandas.DataFrame
        As `saltus.afm.fit` takes it. An empty cell is NaN. Where `columns` is given, ``attrs`` tells what the file is:
        ``path``, ``format``, ``columns`` and their ``units``. ``constants`` are entries of its header, and
        ``calibration`` has those that `saltus.afm.instrument_file` names.

    Raises
    ------
    InputError
        The file cannot be read, is damaged, too large, or has no such column. A column has no unit, another unit, cells
        that are no finite numbers, or another length. A row is cut. A package that reads the file is missing.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = f"{folder}/tune.csv"
    ...     with open(file, "w") as stream:
    ...         _ = stream.write("Freq (Hz),Amp (pm),direction\n299500,7250,up\n")
    ...     read_curve(file, {"f_kHz": "Freq (Hz)", "amplitude_nm": "Amp (pm)", "direction": "direction"})
       f_kHz  amplitude_nm direction
    0  299.5          7.25        up
    """
    from saltus.extras import pd

    path = checks.path("path", path)
    factors = checks.mapping("scale", scale, "columns to factors")
    reader, lines = reader_of(path), list[int]()
    if reader is not None:
        held = reader(path)
    else:
        cells = cells_of(path)
        if columns is None and not factors:
            return _named(cells)
        held, lines = _text_contents(cells), cells.index.tolist()
    wanted = _wanted(columns, factors, held.columns)
    read: dict[str, list[str] | NDArray[np.float64]] = {}
    units: dict[str, str | None] = {}
    for name, source in wanted.items():
        checks.text(f"columns[{name!r}]", source, "the name of a column of the file")
        if name == _DIRECTION and reader is not None:
            hint = "table.assign(direction='approach') adds it"
            raise InputError("columns", list(wanted), "without 'direction', which only text files have", hint)
        column, values = _picked(source, held.columns)
        units[name] = column.unit
        if name == _DIRECTION:
            read[name] = _ways(values.tolist())
        else:
            read[name] = _factor(name, column, factors, held.columns) * _numbers(column.name, values, lines)
    _check_lengths(read)
    table = pd.DataFrame(read)
    table.attrs = {
        "path": str(path),
        "format": held.format,
        "columns": dict(wanted),
        "units": units,
        "constants": dict(held.constants),
        "calibration": dict(held.calibration),
    }
    return table


def read_force_table(path: str | os.PathLike[str]) -> dict[str, NDArray[np.float64]]:
    r"""Return a force over the gap from a CSV file, as `saltus.afm.Law.tabulated` takes it.

    Parameters
    ----------
    path : path-like
        The file. Its header has ``D_nm`` and ``F_nN`` and, if it is known, ``sigma_nN``. Lines that begin with ``#``
        are comments.

    Returns
    -------
    dict of str to ndarray, shape (row,)
        The columns by their names, in nm and nN.

    Raises
    ------
    InputError
        The file cannot be read, a column is missing or unknown, or a cell is no number.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = f"{folder}/force.csv"
    ...     with open(file, "w") as stream:
    ...         _ = stream.write("D_nm,F_nN\n0.5,-1.6\n1.0,-0.4\n")
    ...     read_force_table(file)["F_nN"].tolist()
    [-1.6, -0.4]
    """
    table = cells_of(checks.path("path", path))
    names = [str(name) for name in table.columns]
    if sorted(names) not in (sorted(_TABLE), sorted(_TABLE[:2])):
        raise InputError("columns", names, f"{_TABLE[0]}, {_TABLE[1]} and, if it is known, {_TABLE[2]}")
    return {name: _numbers(name, table[name].to_numpy(dtype=object), table.index.tolist()) for name in names}


def _named(table: pd.DataFrame) -> pd.DataFrame:
    """Return the table of a CSV file whose header has the names of a curve's columns."""
    _check_names(list(table.columns))
    for name in table.columns:
        if name == _DIRECTION:
            table[name] = _ways(table[name])
        else:
            table[name] = _numbers(name, table[name].to_numpy(dtype=object), table.index.tolist())
    return table.reset_index(drop=True)


def _text_contents(cells: pd.DataFrame) -> FileContents:
    """Return the columns of a text file with the units in their headers; numbers are read when a column is picked."""
    return FileContents("a text file", tuple(_csv_column(str(name), list(cells[name])) for name in cells.columns))


def _csv_column(name: str, cells: Sequence[str]) -> FileColumn:
    """Return a column of a CSV file with the unit in its header."""
    found = _UNIT.match(name)
    unit = found[2] if found else None
    if unit is None and name in (*_ALONG, *READINGS, *_FORCE):
        unit = _unit_of(name)
    return FileColumn(name, unit, (np.array(cells, dtype=object),))


def _wanted(
    columns: Mapping[str, str] | None, factors: Mapping[str, float], found: Sequence[FileColumn]
) -> Mapping[str, str]:
    """Return the names of the file's columns by those wanted, of which factors may be given."""
    if columns is None:
        raise InputError("columns", columns, f"given, by names of the file's columns: {_listed(found)}")
    wanted = checks.mapping("columns", columns, "names that are wanted to names of the file's columns")
    _check_names(list(wanted))
    for name in factors:
        checks.chosen("scale", name, [one for one in wanted if one != _DIRECTION])
    return wanted


def _ways(cells: Sequence[str]) -> list[str]:
    for way in dict.fromkeys(cells):
        checks.chosen(_DIRECTION, way, _WAYS)
    return list(cells)


def _picked(source: str, found: Sequence[FileColumn]) -> tuple[FileColumn, NDArray[Any]]:
    """Return the column of a name, and what it has of one curve."""
    numbered, number = _LINE.fullmatch(source), None
    same = _called(source, found)
    if not same and numbered:
        same, number = _called(numbered[1], found), int(numbered[2])
    if len(same) != 1:
        hint = "" if same else nearest(source, [one.name for one in found])
        raise InputError("column", source, f"one of the file's: {_listed(same or found)}", hint)
    column, count = same[0], len(same[0].lines)
    if number is None and count > 1:
        raise InputError("column", source, f"one of {count} curves", f"name it with its number, as '{source} #1'")
    if number is not None and not 1 <= number <= count:
        raise InputError("column", source, f"one of the curves 1 to {count}")
    return column, column.lines[(number or 1) - 1]


def _check_lengths(read: Mapping[str, Sequence[Any] | NDArray[np.float64]]) -> None:
    """Raise `InputError` where columns are those of different curves."""
    sizes = {name: len(values) for name, values in read.items()}
    if len(set(sizes.values())) > 1:
        raise InputError("columns", sizes, "columns of one length", "they belong to different curves")


def _called(name: str, found: Sequence[FileColumn]) -> list[FileColumn]:
    """Return the columns of a name; else those that have it in their frames or segments."""
    return [one for one in found if one.name == name] or [one for one in found if one.name.endswith(f": {name}")]


def _factor(name: str, column: FileColumn, factors: Mapping[str, float], found: Sequence[FileColumn]) -> float:
    """Return by what the numbers of a column are multiplied."""
    if name in factors:
        factor = checks.number(f"scale[{name!r}]", factors[name])
        if factor == 0.0:
            raise InputError(f"scale[{name!r}]", factor, "another factor than 0")
        return factor
    unit = _unit_of(name)
    hint = f"or give a factor, as scale={{{name!r}: 1.0}}"
    if column.unit is None:
        raise InputError("column", column.name, f"one with a unit, {hint}", f"the file has {_listed(found)}")
    converted = factor_between(column.unit, unit)
    if converted is None:
        raise InputError(f"unit of {column.name!r}", column.unit, f"one of a quantity in {unit or '1 or %'}", hint)
    return converted


def _unit_of(name: str) -> str:
    """Return the unit that the name of a curve's column has."""
    return {"f_Hz": "Hz", _TIME: "s", **_FORCE}.get(name) or readings_of(name).unit


def _listed(columns: Sequence[FileColumn]) -> str:
    """Return the columns of a file as a list with units and numbers of curves."""
    return ", ".join(
        f"{one.name} ({'no unit' if one.unit is None else one.unit})"
        + (f" #1 to #{len(one.lines)}" if len(one.lines) > 1 else "")
        for one in columns
    )


def _numbers(name: str, cells: NDArray[Any], lines: Sequence[int]) -> NDArray[np.float64]:
    """Return the numbers of a column; of a text file, those in its cells, in lines of these numbers."""
    if cells.dtype == float:
        return cells
    return np.array([_number(name, *at) for at in zip(lines, cells.tolist(), strict=True)], dtype=float)


def _number(name: str, line: int, cell: str) -> float:
    """Return the number in a cell, exactly as it is written; NaN for an empty one."""
    try:
        number = float(cell or "nan")
    except ValueError:
        raise InputError(f"column {name!r}, line {line}", cell, "a number") from None
    if math.isinf(number):
        raise InputError(f"column {name!r}, line {line}", cell, "a finite number", "a gap is an empty cell")
    return number


def _check_names(names: Sequence[str]) -> None:
    """Raise `InputError` where the columns are not those of a curve."""
    known = [*_ALONG, *READINGS, *_FORCE, _DIRECTION, _TIME]
    for name in names:
        first = re.sub(r"_[2-9]\d*$", "", name)
        if first in known:
            continue
        bare = found[1] if (found := _UNIT.match(name)) else name
        wanted = [one for one in known if one.split("_")[0].lower() == bare.split("_")[0].lower()]
        hint = f"name it with its unit: {' or '.join(wanted)}" if wanted else nearest(name, known)
        raise InputError("column", name, f"one of {', '.join(known)}", hint)
    along = [name for name in names if name in _ALONG]
    if len(along) != 1:
        raise InputError("columns", names, f"exactly one of {', '.join(_ALONG)}")
    if not any(re.sub(r"_[2-9]\d*$", "", name) in (*READINGS, *_FORCE) for name in names):
        raise InputError("columns", names, f"at least one reading: {', '.join((*READINGS, *_FORCE))}")
