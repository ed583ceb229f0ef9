"""What a check of a solution says: one row for each claim, with what an independent computation finds."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from saltus.contents import as_json
from saltus.described import described
from saltus.errors import InputError
from saltus.result import Result
from saltus.scales import LEAST_ALLOWANCE

if TYPE_CHECKING:
    import pandas as pd
    import xarray as xr

    from saltus.contents import Contents

__all__ = [
    "AGREES", "DIFFERS", "UNCHECKED", "Row", "Verification",
    "compared", "equal", "place_of", "placed", "unchecked", "worst",
]  # fmt: skip

AGREES = "agrees"  # verdict: both values are the same within what is allowed
DIFFERS = "differs"  # verdict: they are not
UNCHECKED = "not checked"  # verdict: no independent value is known

_WIDTH = 22  # characters of a value in a `repr`


class Row(NamedTuple):
    """One claim and its check.

    Attributes
    ----------
    what : str
        The claim, as ``multiplier 1``.
    said : float, complex, bool or str
        The value in the result.
    found : float, complex, bool or str
        The value of the independent computation.
    difference : float
        Distance of both; NaN where they are no numbers.
    allowed : float
        Largest difference with which both agree: the accuracy of the check. NaN where they are no numbers.
    verdict : str
        ``agrees``, ``differs``, or ``not checked`` with the reason in `found`.
    place : str
        Which solution of a curve it is; empty for a single one.
    """

    what: str
    said: Any
    found: Any
    difference: float
    allowed: float
    verdict: str
    place: str = ""


@dataclass(frozen=True, eq=False, repr=False)
class Verification(Result):
    """Checks of a solution or a curve by means that share no code with how it was made; `verify` makes it.

    Attributes
    ----------
    subject : str
        What was checked, in words.
    rows : tuple of Row
        The claims, in order.

    Examples
    --------
    >>> import saltus
    >>> fold = saltus.HybridSystem.smooth({"x": "r - x**2"}, {"r": 1.0})
    >>> rest = saltus.find_equilibrium(fold, x0=[1.0])
    >>> checked = saltus.verify(saltus.continue_equilibrium(rest, "r", (-1.0, 2.0)))
    >>> checked.passed
    True
    """

    subject: str
    rows: tuple[Row, ...]

    @property
    def passed(self) -> bool:
        """Whether nothing differs; what could not be checked is in `unchecked`."""
        return not self.failures

    @property
    def failures(self) -> tuple[Row, ...]:
        """The rows whose two values differ."""
        return tuple(row for row in self.rows if row.verdict == DIFFERS)

    @property
    def unchecked(self) -> tuple[Row, ...]:
        """The rows that could not be checked."""
        return tuple(row for row in self.rows if row.verdict == UNCHECKED)

    def __len__(self) -> int:
        return len(self.rows)

    def __iter__(self) -> Iterator[Row]:
        return iter(self.rows)

    def to_dataframe(self) -> pd.DataFrame:
        """Return the table: what, said, found, difference, allowed, verdict and place of each row."""
        from saltus.extras import pd

        return pd.DataFrame(self.rows, columns=list(Row._fields))

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return the table as a Dataset along ``row``; ``said`` and ``found`` are JSON."""
        from saltus.extras import xr

        data: dict[str, Any] = {
            name: ("row", np.array([getattr(row, name) for row in self.rows], dtype=object))
            for name in ("what", "verdict", "place")
        }
        data |= {name: ("row", np.array([_written(getattr(row, name)) for row in self.rows], dtype=object))
                 for name in ("said", "found")}  # fmt: skip
        data |= {name: ("row", np.array([getattr(row, name) for row in self.rows], dtype=float))
                 for name in ("difference", "allowed")}  # fmt: skip
        return xr.Dataset(data, attrs={"subject": self.subject})

    @classmethod
    def _read(cls, held: Contents) -> Self:
        texts = {name: held.array(name, ("row",), str).tolist() for name in ("what", "said", "found", "place")}
        verdicts = held.array("verdict", ("row",), str).tolist()
        if unknown := set(verdicts) - {AGREES, DIFFERS, UNCHECKED}:
            raise InputError("variable 'verdict'", min(unknown), f"{AGREES}, {DIFFERS} or {UNCHECKED}")
        said, found = ([_value(text) for text in texts[name]] for name in ("said", "found"))
        numbers = (held.array(name, ("row",), finite=False).tolist() for name in ("difference", "allowed"))
        rows = zip(texts["what"], said, found, *numbers, verdicts, texts["place"], strict=True)
        return cls(held.text("subject"), tuple(Row(*row) for row in rows))

    def __repr__(self) -> str:
        agreed = len(self.rows) - len(self.failures) - len(self.unchecked)
        head = f"Verification of {self.subject}: {agreed} of {len(self.rows)} claims agree"
        head += f", {len(self.failures)} differ" if self.failures else ""
        head += f", {len(self.unchecked)} not checked" if self.unchecked else ""
        table = [("what", "said", "found", "difference", "verdict", "place")]
        table += [
            (row.what, _short(row.said), _short(row.found), _small(row.difference), row.verdict, row.place)
            for row in self.rows
        ]
        widths = [max(len(line[i]) for line in table) for i in range(len(table[0]))]
        lines = ("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) for line in table)
        return "\n".join([head, *(f"  {line}".rstrip() for line in lines)])


def compared(what: str, said: complex, found: complex, allowed: float) -> Row:
    """Return the row of two numbers that agree within `allowed`; a NaN agrees with nothing."""
    difference = float(abs(said - found))
    return Row(what, said, found, difference, allowed, AGREES if difference <= allowed else DIFFERS)


def equal(what: str, said: Any, found: Any) -> Row:
    """Return the row of two values that must be the same."""
    return Row(what, said, found, math.nan, math.nan, AGREES if said == found else DIFFERS)


def unchecked(what: str, said: Any, reason: str) -> Row:
    """Return the row of a claim that has no check here, for a reason."""
    return Row(what, said, reason, math.nan, math.nan, UNCHECKED)


def worst(rows: Iterable[Row]) -> list[Row]:
    """Return all rows that differ, and of the others the one of each claim that is nearest to its allowance."""
    kept: dict[str, Row] = {}
    failed: list[Row] = []
    first: dict[str, Row] = {}
    for row in rows:
        first.setdefault(row.what, row)
        if row.verdict == DIFFERS:
            failed.append(row)
        elif row.what not in kept or _share(row) > _share(kept[row.what]):
            kept[row.what] = row
    return [*(kept[what] for what in first if what in kept), *failed]


def place_of(curve: Any, index: int) -> str:
    """Return the parameters of a point of a curve as text."""
    values = np.atleast_1d(curve.values[index])
    return ", ".join(f"{name} = {value:.6g}" for name, value in zip(curve.varied, values, strict=True))


def placed(place: str, rows: Iterable[Row]) -> list[Row]:
    """Return rows with the place of their solution."""
    return [row._replace(place=place) for row in rows]


def _written(value: Any) -> str:
    """Return a value of a row as JSON."""
    value = value.item() if isinstance(value, np.generic) else value
    return json.dumps({"re": value.real, "im": value.imag} if isinstance(value, complex) else value)


def _value(text: str) -> Any:
    """Return the value that `_written` wrote."""
    value = as_json(text, "a value of a row", object)
    return complex(value["re"], value["im"]) if isinstance(value, dict) and value.keys() == {"re", "im"} else value


def _share(row: Row) -> float:
    share = row.difference / max(row.allowed, LEAST_ALLOWANCE)
    return share if math.isfinite(share) else -1.0


def _short(value: Any) -> str:
    if isinstance(value, bool | str):
        return str(value)
    if isinstance(value, complex):
        return f"{value.real:.9g}" if value.imag == 0.0 else f"{value.real:.7g}{value.imag:+.7g}i"
    return f"{value:.12g}"[:_WIDTH]


def _small(value: float) -> str:
    return "" if math.isnan(value) else f"{value:.1e}"
