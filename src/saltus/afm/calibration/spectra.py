"""Thermal spectra in files and tables: frequencies, power spectral densities, their units."""

from __future__ import annotations

import os
import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.errors import InputError

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

__all__ = ["PSD_UNITS", "read_spectrum", "spectrum_of"]

PSD_UNITS = {"psd_nm2_Hz": "nm^2/Hz", "psd_V2_Hz": "V^2/Hz"}  # columns of a spectrum beside its frequency
_LEAST_ROWS = 20  # rows of a spectrum, at least
_LARGEST_FILE = 10**8  # bytes of a file, at most
_BRACKETS = re.compile(r"^\s*(.*?)[_ ]*[\(\[](.*)[\)\]]\s*$")  # a name with its unit in brackets
_FREQUENCY = {"Hz": 1e-3, "kHz": 1.0, "MHz": 1e3}
_PREFIXES = {"": 1.0, "m": 1e-3, "u": 1e-6, "n": 1e-9, "p": 1e-12, "f": 1e-15}
_AMPLITUDE = re.compile(r"^([munpf]?)(m|V)/(?:sqrt\(Hz\)|sqrtHz|rtHz|√Hz|Hz\^(?:0\.5|1/2|\(1/2\)))$")
_POWER = re.compile(r"^([munpf]?)(m|V)\^?2/Hz$")
_NAMED = re.compile(r"^(psd|asd)_([munpf]?)(m|V)(2?)_(Hz|rtHz)$")  # a column whose name has its unit


def read_spectrum(
    path: str | os.PathLike[str], columns: Mapping[str, str] | None = None, *, scale: Mapping[str, float] | None = None
) -> pd.DataFrame:
    r"""Return a thermal spectrum from a CSV file: frequencies in kHz, and a power spectral density.

    A header has names with units: ``f_kHz`` or ``f_Hz``, and ``psd_nm2_Hz``, ``psd_pm2_Hz``, ``psd_V2_Hz`` and so on.
    ``asd_pm_rtHz`` or ``asd_V_rtHz`` is an amplitude spectral density, the root of a power spectral density. Names with
    units in brackets are read as well: ``Frequency (Hz),PSD (V^2/Hz)``. Lines that begin with ``#`` are comments.

    Parameters
    ----------
    path : path-like
        The file.
    columns : mapping of str to str, optional
        Names of the file's columns by ``"f_kHz"`` and ``"psd_nm2_Hz"`` or ``"psd_V2_Hz"``, where names do not tell.
    scale : mapping of str to float, optional
        Factors by which numbers of such a column are multiplied, where its unit is not told.

    Returns
    -------
    pandas.DataFrame
        Columns ``f_kHz`` and ``psd_nm2_Hz`` or ``psd_V2_Hz``, by ascending frequency. `saltus.afm.calibrate` takes it.

    Raises
    ------
    InputError
        The file cannot be read, is larger than 100 MB, or has no such columns; a cell is no number; a density is
        negative; there are fewer than 20 rows.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = f"{folder}/thermal.csv"
    ...     with open(file, "w") as stream:
    ...         _ = stream.write("Frequency (Hz),PSD (pm^2/Hz)\n" + "".join(f"{i}e3,4.0\n" for i in range(1, 30)))
    ...     read_spectrum(file).iloc[0].to_dict()
    {'f_kHz': 1.0, 'psd_nm2_Hz': 4e-06}
    """
    from saltus.extras import pd

    file = checks.path("path", path)
    try:
        if file.stat().st_size > _LARGEST_FILE:
            raise InputError("path", str(file), f"a file of at most {_LARGEST_FILE:g} bytes")
        table = pd.read_csv(file, comment="#", skipinitialspace=True)
        if not isinstance(table.index, pd.RangeIndex):  # cells without a name would be an index, and shift all others
            raise ValueError("rows have more cells than the header: commas in numbers, or at the ends of rows?")
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        told = getattr(error, "strerror", None) or str(error)
        raise InputError("path", str(file), "a CSV file that can be read", told) from error
    table.columns = pd.Index([str(name).strip() for name in table.columns])
    factors = checks.mapping("scale", scale, "columns to factors")
    if columns is not None:
        wanted = checks.mapping("columns", columns, "names of a spectrum to names of the file's columns")
        for name, source in wanted.items():
            checks.chosen("columns", name, ("f_kHz", *PSD_UNITS))
            checks.chosen(f"columns[{name!r}]", source, list(table.columns))
        told = {name: table[source].to_numpy() for name, source in wanted.items()}
        for name, source in wanted.items():
            told[name] = _numbers(name, told[name]) * _factor(name, source, factors)
        table = pd.DataFrame(told)
    f, psd, name = spectrum_of(table)
    return pd.DataFrame({"f_kHz": f, name: psd})


def spectrum_of(data: object) -> tuple[NDArray[np.float64], NDArray[np.float64], str]:
    """Return frequencies in kHz, densities, and their column's name, of a table; by ascending frequency.

    Raises
    ------
    InputError
        There is not exactly one column of each kind, a value cannot be used, or there are too few rows.
    """
    table = _columns_of(data)
    frequencies, densities = {}, {}
    for name, values in table.items():
        if (factor := _frequency_unit(name)) is not None:
            frequencies[name] = factor, values
        elif (unit := _density_unit(name)) is not None:
            densities[name] = *unit, values
    if len(frequencies) != 1 or len(densities) != 1:
        hint = "as f_kHz and psd_nm2_Hz or psd_V2_Hz: names tell the units"
        raise InputError("columns", list(table), "one of frequencies and one of densities", hint)
    ((f_name, (f_factor, f_cells)),) = frequencies.items()
    ((name, (power, factor, target, cells)),) = densities.items()
    f, values = f_factor * _numbers(f_name, f_cells), _numbers(name, cells)
    if len(f) != len(values):
        raise InputError("columns", {f_name: len(f), name: len(values)}, "of one length")
    checks.refuse(name, values, values < 0.0, "0 or above in all rows")
    psd = (factor * values) ** power
    kept = np.isfinite(f) & np.isfinite(psd) & (f > 0.0) & (psd > 0.0)
    f, psd = f[kept], psd[kept]
    if len(f) < _LEAST_ROWS:
        raise InputError("spectrum", f"{len(f)} rows", f"at least {_LEAST_ROWS} rows of positive numbers")
    order = np.argsort(f, kind="stable")
    f, psd = f[order], psd[order]
    if not np.all(np.diff(f) > 0.0):
        raise InputError(f_name, float(f[1:][np.diff(f) <= 0.0][0]), "another frequency in each row", "average equals")
    return f, psd, target


def _columns_of(data: object) -> dict[str, NDArray[Any]]:
    """Return the columns of a DataFrame, a Dataset or a mapping."""
    if hasattr(data, "to_dataframe"):
        data = data.to_dataframe().reset_index()
    if not (isinstance(data, Mapping) or hasattr(data, "columns")):
        hint = "read_spectrum reads one from a file"
        raise InputError("spectrum", type(data).__name__, "a table with columns, as a DataFrame or a mapping", hint)
    names = list(data) if isinstance(data, Mapping) else list(data.columns)
    return {str(name): np.asarray(data[name]) for name in names}  # type: ignore[index]


def _frequency_unit(name: str) -> float | None:
    """Return the kHz in the unit of a column of frequencies; None for another column."""
    if name in ("f_kHz", "f_Hz", "f_MHz"):
        return _FREQUENCY[name[2:]]
    found = _BRACKETS.match(name)
    return _FREQUENCY.get(found[2].strip()) if found else None


def _density_unit(name: str) -> tuple[int, float, str] | None:
    """Return power, factor and target name of a column of densities; None for another column."""
    if found := _NAMED.match(name):
        kind, prefix, base, square, per = found.groups()
        if (kind == "psd") != (per == "Hz") or (kind == "psd") != (square == "2"):
            return None
        power = 1 if kind == "psd" else 2
        return power, _PREFIXES[prefix] ** (2 if power == 1 else 1) * _to_target(base, power), _target(base)
    brackets = _BRACKETS.match(name)
    unit = "".join(brackets[2].split()).replace("²", "^2").replace("µ", "u").replace("μ", "u") if brackets else ""
    if found := _POWER.match(unit):
        return 1, _PREFIXES[found[1]] ** 2 * _to_target(found[2], 1), _target(found[2])
    if found := _AMPLITUDE.match(unit):
        return 2, _PREFIXES[found[1]] * _to_target(found[2], 2), _target(found[2])
    return None


def _to_target(base: str, power: int) -> float:
    """Return nm in a metre, 1 for volts; squared for a power spectral density."""
    return 1.0 if base == "V" else (1e18 if power == 1 else 1e9)


def _target(base: str) -> str:
    return "psd_V2_Hz" if base == "V" else "psd_nm2_Hz"


def _factor(name: str, source: str, factors: Mapping[str, float]) -> float:
    """Return by what a chosen column is multiplied."""
    if name in factors:
        return checks.positive(f"scale[{name!r}]", factors[name])
    if name == "f_kHz":
        known = _frequency_unit(source)
    else:
        unit = _density_unit(source)
        known = unit[1] if unit is not None and unit[0] == 1 and unit[2] == name else None
    if known is None:
        hint = f"or give a factor, as scale={{{name!r}: 1.0}}"
        raise InputError("columns", source, f"a column whose name has its unit, {hint}")
    return known


def _numbers(name: str, cells: NDArray[Any]) -> NDArray[np.float64]:
    """Return the numbers of a column; NaN where a cell is empty."""
    try:
        return np.asarray(cells, dtype=np.float64).ravel()
    except (TypeError, ValueError) as error:
        raise InputError(f"column {name!r}", str(error), "numbers in all rows") from None
