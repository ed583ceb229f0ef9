"""What readers of instruments' files give: columns with units, constants, calibration; how no file takes memory."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, NamedTuple, overload

from numpy.typing import NDArray

from saltus.afm.files.unit_conversion import factor_between
from saltus.errors import InputError

__all__ = ["FileColumn", "FileContents", "Lines", "bounded", "in_ways", "numbers_of", "parsed", "whole"]

_WHOLE = 2**30  # bytes of a file that is read as a whole, at most
_TOLD = 60  # constants that are printed, at most
_NUMBER = re.compile(r"\s*([-+]?\d+\.?\d*(?:[eE][-+]?\d+)?)(.*)")  # of an entry, with its unit


class Lines(Sequence[NDArray[Any]]):
    """Curves of a column, each of which is read when it is asked for.

    Parameters
    ----------
    sizes : sequence of int
        Points of each curve.
    read : callable
        Gives the numbers of a curve by its index.
    """

    def __init__(self, sizes: Sequence[int], read: Callable[[int], NDArray[Any]]) -> None:
        self.sizes = tuple(int(size) for size in sizes)
        self._read = read

    def __len__(self) -> int:
        return len(self.sizes)

    @overload
    def __getitem__(self, index: int) -> NDArray[Any]: ...
    @overload
    def __getitem__(self, index: slice) -> Sequence[NDArray[Any]]: ...
    def __getitem__(self, index: int | slice) -> NDArray[Any] | Sequence[NDArray[Any]]:
        if isinstance(index, slice):
            return [self[i] for i in range(*index.indices(len(self)))]
        at = range(len(self))[index]
        values = self._read(at)
        if len(values) != self.sizes[at]:
            raise ValueError(f"curve {at + 1} has {len(values)} points, and its header tells {self.sizes[at]}")
        return values


class FileColumn(NamedTuple):
    """A column of a file."""

    name: str  # its name in the file
    unit: str | None  # its unit as the file has it; None where the file has none
    lines: Sequence[NDArray[Any]]  # its numbers, one array a curve; of a text file its cells

    @property
    def sizes(self) -> tuple[int, ...]:
        """Points of each curve."""
        return self.lines.sizes if isinstance(self.lines, Lines) else tuple(len(line) for line in self.lines)


@dataclass(frozen=True)
class FileContents:
    """What a file of an instrument holds; printed, it lists columns, points, units and constants.

    Examples
    --------
    >>> import numpy as np
    >>> from saltus.afm.files.columns import FileColumn
    >>> column = FileColumn("approach: Height", "nm", (np.zeros(3), np.zeros(2)))
    >>> print(FileContents("a map", (column,), {"Operator": "A. N."}, {"k_N_m": 0.05}))
    a map
      approach: Height     nm  2 curves of 2 to 3 points
      calibration  k_N_m = 0.05
      Operator     A. N.
    """

    format: str
    """What kind of file it is."""
    columns: tuple[FileColumn, ...]
    """The columns, with units and curves."""
    constants: Mapping[str, str] = field(default_factory=dict)
    """Entries of the header as they are written, by their names in the file."""
    calibration: Mapping[str, float] = field(default_factory=dict)
    """Constants of the probe and its detector that the file has: ``k_N_m``, ``invols_nm_V``, ``f0_kHz``, ``Q``, ..."""

    def __repr__(self) -> str:
        width = max((len(column.name) for column in self.columns), default=0)
        units = [("no unit" if column.unit is None else column.unit) for column in self.columns]
        space = max(map(len, units), default=0)
        lines = [self.format]
        for column, unit in zip(self.columns, units, strict=True):
            lines.append(f"  {column.name:{width}}  {unit:>{space}}  {_points(column.sizes)}")
        rows = [("calibration", f"{name} = {value:.10g}") for name, value in self.calibration.items()]
        rows += list(self.constants.items())[:_TOLD]
        width = max((len(name) for name, _ in rows), default=0)
        lines += [f"  {name:{width}}  {text}" for name, text in rows]
        left = len(self.constants) - _TOLD
        return "\n".join(lines + [f"  and {left} more constants"] * (left > 0))


def _points(sizes: Sequence[int]) -> str:
    """Return how many curves there are, and of how many points."""
    if not sizes:
        return "no curve"
    points = f"{sizes[0]:,}" if len(set(sizes)) == 1 else f"{min(sizes):,} to {max(sizes):,}"
    return f"{points} points" if len(sizes) == 1 else f"{len(sizes):,} curves of {points} points"


def in_ways(columns: Sequence[FileColumn], parts: Mapping[str, slice]) -> list[FileColumn]:
    """Return columns of which each has one way only, as ``approach: Defl``."""
    return [
        FileColumn(f"{way}: {column.name}", column.unit, tuple(line[part] for line in column.lines))
        for way, part in parts.items()
        for column in columns
    ]


def numbers_of(entries: Mapping[str, str], wanted: Mapping[str, tuple[str, str, str]]) -> dict[str, float]:
    """Return positive numbers of entries, by the name wanted: (entry, its unit where the entry tells none, unit)."""
    found = {}
    for name, (entry, usual, unit) in wanted.items():
        number = _NUMBER.match(entries.get(entry, ""))
        if number is None:
            continue
        factor = _factor(number[2].strip() or usual, unit)
        value = float(number[1]) * factor if factor else 0.0
        if 0.0 < value < math.inf:
            found[name] = float(f"{value:.15g}")  # a factor of ten adds no digits
    return found


def _factor(unit: str, wanted: str) -> float | None:
    """Return by what a number in a unit is multiplied; None where the units do not agree."""
    above, below = unit.partition("/")[0], unit.partition("/")[2]
    return factor_between(above, wanted.partition("/")[0]) if below == wanted.partition("/")[2] else None


def bounded(text: Any) -> str:
    """Return an entry of a header as one line of at most 200 characters."""
    return " ".join(str(text).split())[:200]


def whole(path: str | Path) -> bytes:
    """Return the content of a file; raise `ValueError` where the file is too large to be read as a whole."""
    size = Path(path).stat().st_size
    if size > _WHOLE:
        raise ValueError(f"it has {size:,} bytes, more than {_WHOLE:,}")
    return Path(path).read_bytes()


def parsed(path: Path, kind: str, read: Callable[[Any], Any]) -> Any:
    """Return what is read from a file; raise `InputError` where it cannot be read, for whatever reason."""
    try:
        with open(path, "rb"):
            pass
    except OSError as error:
        raise InputError("path", str(path), f"{kind} that can be read", error.strerror or str(error)) from error
    try:
        return read(str(path))
    except InputError:
        raise
    except Exception as error:  # the libraries raise what comes, from AssertionError to struct.error
        first = next(iter(str(error).splitlines()), "")
        hint = f"it is another file, or a part is missing ({type(error).__name__}: {first})"
        raise InputError("path", str(path), kind, hint) from error
