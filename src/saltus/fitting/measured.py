"""Measured data as columns: a parameter, observables with their standard errors, the direction of each datum."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus import checks
from saltus.errors import InputError
from saltus.flow.formulas import read_formula
from saltus.orbits.observables.observed import planned

if TYPE_CHECKING:
    import pandas as pd
    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["DIRECTION", "TIME", "Channel", "Measured", "MeasuredPoint", "numbers_of", "read_measured", "read_table"]

DIRECTION = "direction"  # column that says which way a datum was measured on
TIME = "time_s"  # column that says when
_INDEX = "index"  # attribute of a table: columns that were its index
_BEGINNINGS = 3  # values of all observables from which a phase makes a turn, to see what it does to a formula
_ALIKE = 1e-9  # relative difference of angles that is rounding
_HARMONIC = re.compile(r"harmonic\((.*),\s*([^,]+)\)")


class MeasuredPoint(NamedTuple):
    """A measured value of the parameter at a special point, as of a jump or of the first contact.

    Attributes
    ----------
    type : str
        Type of the special point: ``SN``, ``PD``, ``TR`` or ``GR``.
    value : float
        The parameter there.
    sigma : float
        Its standard error.
    direction : str
        The way on which a jump was seen: ``up``, ``down``, or empty. Along a distance ``retract`` and ``approach`` are
        the same.
    reach : float
        How far behind the jump its fold may lie, on the way. Noise makes a motion jump before its fold.

    Examples
    --------
    >>> MeasuredPoint("SN", 1.81, 0.005, "up").sigma
    0.005
    """

    type: str
    value: float
    sigma: float
    direction: str = ""
    reach: float = 0.0


@dataclass(frozen=True)
class Channel:
    """A measured observable."""

    name: str  # its column
    formulas: tuple[str, ...]  # the observable of a model's orbit; amplitude and phase of a complex one
    values: NDArray[Any]  # shape (datum,): the data; complex ones where there are two formulas
    # shape (datum,): standard errors; of complex data those of the real and of the imaginary part
    sigma: NDArray[np.float64]
    turn: float = 0.0  # angle after which the observable repeats; 0 of all others

    @property
    def is_complex(self) -> bool:
        """Whether the data are complex."""
        return len(self.formulas) == 2

    @property
    def rows(self) -> int:
        """Residuals of each datum."""
        return len(self.formulas)

    def model(self, seen: NDArray[np.float64]) -> NDArray[Any]:
        """Return the observable from values of its formulas, shape (formulas, ...)."""
        return np.asarray(seen[0] * np.exp(1j * seen[1]) if self.is_complex else seen[0])

    def residual(
        self, seen: NDArray[np.float64], which: NDArray[np.int64] | int, gain: float = 1.0
    ) -> NDArray[np.float64]:
        """Return model less data over sigma of some data, shape (rows, ...); angles by the shorter way round."""
        away = gain * self.model(seen) - self.values[which]
        if self.turn:
            away = away - self.turn * np.round(away / self.turn)
        parts = [away.real, away.imag] if self.is_complex else [away]
        return np.asarray(np.array(parts) / self.sigma[which])

    def by_gain(self, seen: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of residuals by a factor on the model, shape (rows, datum)."""
        found = self.model(seen)
        return np.asarray(np.array([found.real, found.imag] if self.is_complex else [found]) / self.sigma)

    def slopes(self, seen: NDArray[np.float64], slopes: NDArray[np.float64], which: int) -> NDArray[np.float64]:
        """Return the derivatives of a datum's residuals from those of its formulas, shape (rows, parameters)."""
        if not self.is_complex:
            return np.asarray(slopes / self.sigma[which], dtype=np.float64)
        turned = (slopes[0] + 1j * seen[0] * slopes[1]) * np.exp(1j * seen[1])
        return np.asarray(np.array([turned.real, turned.imag]) / self.sigma[which])


@dataclass(frozen=True)
class Measured:
    """Data of one curve."""

    along: str  # the parameter
    x: NDArray[np.float64]  # shape (datum,): its values
    channels: tuple[Channel, ...]  # the observables
    direction: tuple[str, ...]  # the way of each datum; empty texts where none is told
    points: tuple[MeasuredPoint, ...] = ()  # measured special points
    dropped: int = 0  # rows that were left out, since a number is missing
    unused: tuple[str, ...] = ()  # columns that are not used
    times: NDArray[np.float64] | None = None  # shape (datum,): the column of times; None where there is none

    def __len__(self) -> int:
        return len(self.x)

    @property
    def rows(self) -> int:
        """Residuals of each datum."""
        return sum(channel.rows for channel in self.channels)

    @property
    def count(self) -> int:
        """Residuals of all data and special points."""
        return self.rows * len(self) + len(self.points)

    @property
    def formulas(self) -> tuple[str, ...]:
        """The observables of an orbit that all channels ask for."""
        return tuple(dict.fromkeys(formula for channel in self.channels for formula in channel.formulas))

    @property
    def repeated(self) -> int:
        """Rows that are the same as one before, in all that is fitted."""
        columns = [self.x, *(channel.values for channel in self.channels)]
        rows = set(zip(*(column.tolist() for column in columns), self.direction, strict=True))
        return len(self) - len(rows)

    @property
    def passed(self) -> NDArray[np.float64]:
        """Share of the measurement that has passed at each datum: by its time, else by its place in the table."""
        times = np.arange(len(self), dtype=float) if self.times is None else self.times
        return np.asarray((times - times.min()) / (float(np.ptp(times)) or 1.0))

    @property
    def spacing(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Distance of each datum from the next one below and above; infinite where there is none."""
        places, back = np.unique(self.x, return_inverse=True)
        gaps = np.concatenate([[np.inf], np.diff(places), [np.inf]])
        return gaps[back], gaps[back + 1]

    def check_times(self) -> None:
        """Raise `InputError` where all data have one time, so that nothing can have drifted."""
        if self.times is not None and not np.ptp(self.times) > 0.0:
            hint = "leave the column out, and the place of a datum in the table counts"
            raise InputError(
                f"column {TIME!r}", float(self.times[0]), "times that differ, where a drift is sought", hint
            )

    def passed_at(self, point: MeasuredPoint) -> float:
        """Return which share of the measurement has passed at a measured point, by the data around on its way."""
        ups = ("up", "retract")
        known = {"up": ups, "down": ("down", "approach")}.get(point.direction)
        rows = np.flatnonzero([known is None or way in known for way in self.direction])
        rows = rows if rows.size else np.arange(len(self))
        order = rows[np.argsort(self.x[rows], kind="stable")]
        return float(np.interp(point.value, self.x[order], self.passed[order]))

    def with_points(self, points: Sequence[MeasuredPoint]) -> Measured:
        """Return the same data with measured special points."""
        return replace(self, points=tuple(points))


def read_table(data: object) -> pd.DataFrame:
    """Return data as a table: a DataFrame, a Dataset, or columns by name.

    Raises
    ------
    InputError
        The data are none of these, or columns have different lengths.
    """
    from saltus.extras import pd, xr

    if isinstance(data, pd.DataFrame):
        return _with_index(data)
    if isinstance(data, xr.Dataset):
        return _with_index(data.to_dataframe())
    if not isinstance(data, Mapping):
        raise InputError("data", data, "a pandas DataFrame, an xarray Dataset or columns by name")
    columns = {str(name): _column(str(name), values) for name, values in data.items()}
    if len({values.shape for values in columns.values()}) > 1 or any(v.ndim > 1 for v in columns.values()):
        sizes = {name: values.shape for name, values in columns.items()}
        raise InputError("data", sizes, "columns of one length")
    return pd.DataFrame(columns)


def numbers_of(table: pd.DataFrame, name: str) -> NDArray[np.float64]:
    """Return a column of real numbers; those that are missing are NaN.

    Raises
    ------
    InputError
        The column holds something else, or there are several of this name.
    """
    if table.columns.tolist().count(name) > 1:
        raise InputError("data", table.columns.tolist(), f"with one column {name!r}")
    return np.asarray(_numbers(name, table[name].to_numpy(), complex_too=False), dtype=np.float64)


def _column(name: str, values: object) -> NDArray[Any]:
    """Return a column as an array; numbers that are masked are missing."""
    from saltus.extras import pd

    if isinstance(values, np.ma.MaskedArray) and values.ndim == 1:
        return np.asarray(pd.Series(values))
    try:
        return np.atleast_1d(np.asarray(values))
    except ValueError:
        raise InputError(f"column {name!r}", values, "a number for each row") from None


def _with_index(table: pd.DataFrame) -> pd.DataFrame:
    """Return a table with named levels of its index as columns; attributes tell which these are."""
    names = [name for name in table.index.names if name is not None and name not in table]
    found = table.reset_index(level=names).reset_index(drop=True) if names else table.reset_index(drop=True)
    found.attrs = {**table.attrs, _INDEX: [*table.attrs.get(_INDEX, ()), *names]}
    return found


def read_measured(
    data: object,
    along: str,
    system: HybridSystem,
    sigma: object,
    observables: Mapping[str, str],
    turns: Mapping[str, float],
) -> Measured:
    """Return the data of a table that are to be fitted.

    Parameters
    ----------
    data : object
        As `read_table` takes it.
    along : str
        The column of the parameter.
    system : HybridSystem
        Whose observables are measured.
    sigma : object
        Standard errors by the names of the observables' columns, each a number or one for each row.
    observables : mapping of str to str
        Observables of columns that have other names.
    turns : mapping of str to float
        Angles after which observables repeat.

    Raises
    ------
    InputError
        A column is missing or holds no numbers; a standard error is missing or not positive.
    """
    from saltus.extras import pd

    table = read_table(data)
    errors = checks.mapping("sigma", sigma, "standard errors by column, as {'max(x)': 0.01}")
    if not errors:
        raise InputError("sigma", sigma, "the standard error of at least one column", "without it nothing is fitted")
    checks.mapping("observables", observables, "observables by column", known=list(errors))
    checks.mapping("turns", turns, "angles by column", known=list(errors))
    known = [str(name) for name in table.columns]
    for name in (along, *errors):
        if name not in known:
            raise InputError("data", known, f"with a column {name!r}")
        if known.count(name) > 1:
            raise InputError("data", known, f"with one column {name!r}")
    x = _numbers(along, table[along].to_numpy(), complex_too=False)
    channels = [
        _channel(name, table[name].to_numpy(), errors[name], observables.get(name, name), system) for name in errors
    ]
    channels = [replace(one, turn=_given_turn(one, turns)) for one in channels]
    ways = table[DIRECTION].to_numpy() if DIRECTION in known else np.full(len(x), "", dtype=object)
    times = _numbers(TIME, table[TIME].to_numpy(), complex_too=False) if TIME in known else None
    whole = np.isfinite(x) & (True if times is None else np.isfinite(times))
    for channel in channels:
        whole &= np.isfinite(channel.values)
    if not whole.any():
        raise InputError("data", f"{len(x)} rows", "at least one row without a missing number")
    channels = [replace(one, values=one.values[whole], sigma=one.sigma[whole]) for one in channels]
    unused = tuple(
        name for name in known if name not in (along, DIRECTION, TIME, *table.attrs.get(_INDEX, ()), *errors)
    )
    directions = tuple("" if pd.isna(way) else str(way) for way in ways[whole])
    told = None if times is None else times[whole]
    return Measured(along, x[whole], tuple(channels), directions, (), int((~whole).sum()), unused, told)


def _numbers(name: str, values: NDArray[Any], *, complex_too: bool) -> NDArray[Any]:
    """Return a column of numbers; those that are missing are NaN."""
    from saltus.extras import pd

    if values.dtype.kind == "O":
        values = np.where(pd.isna(values), np.nan, values)
    kind = np.complex128 if complex_too and np.iscomplexobj(values) else np.float64
    try:
        if values.dtype.kind in "bSUmM" or (kind is np.float64 and np.iscomplexobj(values)):
            raise TypeError
        return np.asarray(values, dtype=kind)
    except (TypeError, ValueError):
        wanted = "numbers" if complex_too else "real numbers"
        raise InputError(f"column {name!r}", values[:3].tolist(), wanted) from None


def _channel(name: str, values: NDArray[Any], sigma: object, text: str, system: HybridSystem) -> Channel:
    """Return a measured observable; raise `InputError` where it is none, or its standard error cannot be used."""
    numbers = _numbers(name, values, complex_too=True)
    given = np.asarray(sigma, dtype=object)
    if given.ndim == 0:
        spread = np.full(len(numbers), checks.positive(f"sigma[{name!r}]", sigma))
    else:
        spread = checks.array(f"sigma[{name!r}]", sigma)
        if spread.shape != numbers.shape:
            raise InputError(f"sigma[{name!r}]", spread.shape, f"a number, or one for each of {len(numbers)} rows")
        checks.refuse(f"sigma[{name!r}]", spread, ~(spread > 0.0), "positive")
    found = _HARMONIC.fullmatch(checks.text("observable", text).strip())
    if np.iscomplexobj(numbers) != (found is not None):
        kind, wanted = ("complex", "'harmonic(x, 1)'") if found is None else ("real", "'amplitude(x, 1)'")
        raise InputError(f"observable of column {name!r}", text, f"for {kind} data one such as {wanted}")
    formulas = (text,) if found is None else (f"amplitude({found[1]}, {found[2]})", f"phase({found[1]}, {found[2]})")
    planned(system, formulas)  # raises for what is no observable
    turn = _turn(system, text) if found is None and "phase" in text and "(" in text else 0.0
    return Channel(name, formulas, numbers, spread, turn)


def _turn(system: HybridSystem, text: str) -> float:
    """Return the angle after which an observable repeats, since phases in it do; 0 where it does not.

    It is by what the observable grows with a turn of a phase, wherever that turn begins; of several phases, the largest
    angle that goes into all of these.
    """
    formula = read_formula(system, text)
    if formula.expression is None:
        return formula.turn
    parameters, found = {**system.parameters, "period": 1.0}, 0.0
    for part in formula.parts:
        turn = read_formula(system, part).turn
        rises, sizes = [], []
        for k in range(_BEGINNINGS if turn else 0):
            values = {other: math.sqrt(2.0 + i + 3.0 * k) for i, other in enumerate(formula.parts)}
            before = formula.value(values, parameters)
            with np.errstate(invalid="ignore"):  # of infinite values
                rises.append(abs(formula.value(values | {part: values[part] + turn}, parameters) - before))
            sizes.append(abs(before))
        step = max(rises, default=0.0)
        if step <= _ALIKE * max(sizes, default=0.0):
            continue
        if not np.ptp(rises) <= _ALIKE * step:
            return 0.0
        while step > _ALIKE * found:
            found, step = step, abs(found - step * round(found / step))
    return found


def _given_turn(channel: Channel, turns: Mapping[str, float]) -> float:
    """Return the angle after which a channel repeats: the one that is given, checked, or its own."""
    if channel.name not in turns:
        return channel.turn
    if channel.is_complex:
        raise InputError("turns", channel.name, "columns of real data", "complex ones have no cut")
    return checks.non_negative(f"turns[{channel.name!r}]", turns[channel.name])
