"""Measured curves in files: columns whose names have units."""

from __future__ import annotations

import os
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from saltus import checks
from saltus.afm.readings import READINGS
from saltus.errors import InputError, nearest

if TYPE_CHECKING:
    import pandas as pd

__all__ = ["read_curve"]

_ALONG = ("Zc_nm", "f_kHz", "f_Hz")  # columns along which curves are measured
_DIRECTION = "direction"  # column of the ways
_WAYS = ("approach", "retract", "up", "down", "")  # what it holds
_UNIT = re.compile(r"^\s*([A-Za-z_]+?)[_ ]*[\(\[](.*)[\)\]]\s*$")  # a name with its unit in brackets


def read_curve(path: str | os.PathLike[str]) -> pd.DataFrame:
    r"""Return a measured curve from a CSV file whose header names quantities with their units.

    The columns are one of ``Zc_nm``, ``f_kHz`` and ``f_Hz``; readings, as ``amplitude_nm`` and ``lag_deg``; and, if it
    is known, ``direction``: ``approach`` or ``retract``, ``up`` or ``down``. Lines that begin with ``#`` are comments.
    `DataFrame.to_csv` with ``index=False`` writes such a file.

    Parameters
    ----------
    path : path-like
        The file.

    Returns
    -------
    pandas.DataFrame
        As `saltus.afm.fit` takes it. An empty cell is NaN.

    Raises
    ------
    InputError
        The file cannot be read. A column has no unit, another unit, or cells that are no numbers.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     file = f"{folder}/tune.csv"
    ...     with open(file, "w") as stream:
    ...         _ = stream.write("f_kHz,amplitude_nm,lag_deg,direction\n299.5,7.25,60.0,up\n")
    ...     read_curve(file)
       f_kHz  amplitude_nm  lag_deg direction
    0  299.5          7.25     60.0        up
    """
    import pandas as pd

    path = checks.path("path", path)
    try:
        table = pd.read_csv(path, comment="#", skipinitialspace=True, dtype=str, keep_default_na=False)
    except (OSError, ValueError) as error:
        told = getattr(error, "strerror", None) or str(error)
        raise InputError("path", str(path), "a CSV file that can be read", told) from error
    names = [str(name).strip() for name in table.columns]
    table.columns = pd.Index(names)
    _check_names(names)
    for name in names:
        cells = [str(cell).strip() for cell in table[name]]
        if name == _DIRECTION:
            for way in dict.fromkeys(cells):
                checks.chosen(_DIRECTION, way, _WAYS)
            table[name] = cells
        else:
            table[name] = pd.Series([_number(name, row, cell) for row, cell in enumerate(cells, 1)], dtype=float)
    return table


def _number(name: str, row: int, cell: str) -> float:
    """Return the number in a cell, exactly as it is written; NaN for an empty one."""
    try:
        return float(cell or "nan")
    except ValueError:
        raise InputError(f"column {name!r}, row {row}", cell, "a number") from None


def _check_names(names: Sequence[str]) -> None:
    """Raise `InputError` where the columns are not those of a curve."""
    known = [*_ALONG, *READINGS, _DIRECTION]
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
    if not any(re.sub(r"_[2-9]\d*$", "", name) in READINGS for name in names):
        raise InputError("columns", names, f"at least one reading: {', '.join(READINGS)}")
