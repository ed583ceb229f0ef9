"""Tables in text files: their encoding, what parts their cells, how their numbers are written."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

from saltus.errors import InputError

if TYPE_CHECKING:
    from pathlib import Path

    import pandas as pd

__all__ = ["cells_of"]

_LARGEST = 2**28  # bytes of a text file, at most
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs"}
_LOOKED_AT = 200  # rows by which the separator is chosen, at most
_DECIMAL_COMMA = re.compile(r"[-+]?\d*,\d*(?:[eE][-+]?\d+)?")
_THOUSANDS = re.compile(r"[-+]?[1-9]\d{0,2}(?:,\d{3})+")  # what may be a whole number with its thousands parted
_MARKS = {codecs.BOM_UTF16_LE: "utf-16", codecs.BOM_UTF16_BE: "utf-16"}  # encodings by a file's first bytes


def cells_of(path: Path) -> pd.DataFrame:
    """Return the cells of a text file as they are written, without spaces around them; its index are the lines.

    Cells are parted by commas, semicolons or tabs. Between semicolons and tabs numbers may have decimal commas, which
    are made points. Lines that begin with ``#`` are comments.

    Raises
    ------
    InputError
        The file cannot be read, is too large, or a row has more or fewer cells than the header. A comma in a number
        may be a decimal one or part thousands.
    """
    from saltus.extras import pd

    try:
        if (size := path.stat().st_size) > _LARGEST:
            raise ValueError(f"it has {size:,} bytes, more than {_LARGEST:,}")
        text = _decoded(path.read_bytes())
        lines = [(n, line) for n, line in enumerate(text.splitlines(), 1) if line.strip() and line.lstrip()[0] != "#"]
        separator = _separator([line for _, line in lines])
        _check_whole(lines, separator)
        source = io.StringIO("\n".join(line for _, line in lines))
        table = pd.read_csv(source, sep=separator, comment="#", skipinitialspace=True, dtype=str, keep_default_na=False)
        if not isinstance(table.index, pd.RangeIndex):  # cells without a name would be an index, and shift all others
            raise ValueError("rows have more cells than the header: commas in numbers, or at the ends of rows?")
        if table.empty:
            raise ValueError("it has no rows")
        if len(table) == len(lines) - 1:
            table.index = pd.Index([number for number, _ in lines[1:]])
        table.columns = pd.Index([str(name).strip() for name in table.columns])
        for name in table.columns:
            table[name] = [str(cell).strip() for cell in table[name]]
        return table if separator == "," else _with_points(table)
    except (OSError, ValueError) as error:
        told = getattr(error, "strerror", None) or str(error)
        raise InputError("path", str(path), "a CSV file that can be read", told) from error


def _decoded(content: bytes) -> str:
    """Return the text of a file: UTF-8, or UTF-16 with a byte order mark."""
    for mark, encoding in _MARKS.items():
        if content.startswith(mark):
            return content.decode(encoding)
    if b"\0" in content:
        raise ValueError("it has zero bytes: text in UTF-16 without a byte order mark, or no text; save it as UTF-8")
    return content.decode("utf-8-sig")


def _separator(lines: Sequence[str]) -> str:
    """Return what parts the cells: what each row has as often as the header, but for the last one, which may be cut."""
    if not lines:
        return ","
    header, rows = lines[0], (lines[1:-1] or lines[1:])[:_LOOKED_AT]
    found = [one for one in _SEPARATORS if one in header and all(row.count(one) == header.count(one) for row in rows)]
    if len(found) > 1:
        told = " or ".join(_SEPARATORS[one] for one in found)
        raise ValueError(f"{told} may part its cells: leave one of them out of the names")
    return found[0] if found else ","


def _check_whole(lines: Sequence[tuple[int, str]], separator: str) -> None:
    """Raise `ValueError` where a row has fewer cells than the header."""
    if not lines:
        return
    header = lines[0][1]
    short = [at for at in lines[1:] if at[1].count(separator) < header.count(separator)]
    wanted = len(next(csv.reader([header], delimiter=separator, skipinitialspace=True)))
    for number, row in short:  # a name in quotes may have separators of its own
        if len(next(csv.reader([row], delimiter=separator, skipinitialspace=True))) < wanted:
            raise ValueError(f"line {number} has fewer cells than the header: is it cut? a gap is an empty cell")


def _with_points(table: pd.DataFrame) -> pd.DataFrame:
    """Return cells whose decimal commas are points; raise `ValueError` where commas may part thousands."""
    cells = [(line, cell) for name in table.columns for line, cell in table[name].items() if "," in cell]
    commas = [(line, cell) for line, cell in cells if any(sign.isdigit() for sign in cell)]
    if not commas:
        return table
    other = next(((line, cell) for line, cell in commas if not _DECIMAL_COMMA.fullmatch(cell)), None)
    if other is not None:
        raise ValueError(f"line {other[0]}: {other[1]!r} is no number with a decimal comma")
    if all(_THOUSANDS.fullmatch(cell) for _, cell in commas):
        line, cell = commas[0]
        raise ValueError(f"line {line}: the comma of {cell!r} may be a decimal one, or part thousands: write points")
    return table.map(lambda cell: cell.replace(",", ".") if _DECIMAL_COMMA.fullmatch(cell) else cell)
