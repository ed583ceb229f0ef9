"""Numbers, counts, intervals and arrays as a user hands them in."""

from __future__ import annotations

import math
import operator
import sys
from decimal import Decimal
from numbers import Real
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.checks.textual import listed
from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "array",
    "ascending",
    "between",
    "count",
    "generator",
    "interval",
    "is_real",
    "non_negative",
    "number",
    "positive",
    "refuse",
    "size",
]

LARGEST_COUNT = 2**53  # largest count: larger floats are not exact, and no computation ends
LARGEST_LIST = 10**7  # largest count of things that are held in memory at once


def is_real(value: object) -> bool:
    """Return whether a value is a real number, NaN and infinities among them, as this module's title says.

    Examples
    --------
    >>> from fractions import Fraction
    >>> [is_real(value) for value in (1, np.float32(0.5), Fraction(1, 3), Decimal("0.1"), np.array(2.0))]
    [True, True, True, True, True]
    >>> [is_real(value) for value in (True, 1j, "1", b"1", None, np.timedelta64(1), np.array([1.0]))]
    [False, False, False, False, False, False, False]
    """
    if type(value) in (float, int):
        return True
    if isinstance(value, np.generic | np.ndarray):
        if value.dtype.kind == "O" and value.shape == ():
            return is_real(value.item())
        return value.shape == () and value.dtype.kind in "iuf" and value is not np.ma.masked
    if isinstance(value, bool):
        return False
    if isinstance(value, Real | Decimal):
        return True
    sympy = sys.modules.get("sympy")  # where it is not imported, none of its numbers is at hand
    if sympy is not None and isinstance(value, sympy.Expr):
        return bool(value.is_number and value.is_extended_real)
    try:
        kind, shape = value.dtype.kind, value.shape  # type: ignore[attr-defined]
    except Exception:  # no array of any library; an object may raise what it likes
        return False
    return isinstance(shape, tuple) and not shape and isinstance(kind, str) and kind in ("i", "u", "f")


def number(name: str, value: object, allowed: str = "a finite number", *, finite: bool = True, unit: str = "") -> float:
    """Return a real number as a float.

    Parameters
    ----------
    allowed : str, optional
        What the message says is allowed.
    finite : bool, optional
        Whether an infinity is refused; NaN is refused always.
    unit : str, optional
        Its unit, for the message.

    Raises
    ------
    InputError
        It is no real number, or not finite, or too large for a float.

    Examples
    --------
    >>> number("t_end", "much")
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: t_end = 'much': must be a finite number
    """
    allowed += f" (in {unit})" if unit else ""
    if not is_real(value):
        raise InputError(name, value, allowed)
    try:
        found = float(value)  # type: ignore[arg-type]
    except OverflowError:
        raise InputError(name, value, allowed, "it is beyond the range of floating-point numbers") from None
    except Exception as error:  # what a number of one's own raises, or a signalling NaN
        raise InputError(name, value, allowed, f"float says: {error}") from error
    if math.isnan(found) or (finite and math.isinf(found)):
        raise InputError(name, value, allowed)
    return found


def positive(name: str, value: object, unit: str = "") -> float:
    """Return a finite number above zero.

    Raises
    ------
    InputError
        It is no number, or not above zero.

    Examples
    --------
    >>> positive("length", 240e-6, "m")
    0.00024
    >>> positive("length", -1, "m")
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: length = -1: must be a finite number > 0 (in m)
    """
    return _at_least(name, value, "a finite number > 0", math.ulp(0.0), unit)


def non_negative(name: str, value: object, unit: str = "") -> float:
    """Return a finite number, zero or above.

    Raises
    ------
    InputError
        It is no number, or below zero.

    Examples
    --------
    >>> non_negative("H", 0, "J")
    0.0
    """
    return _at_least(name, value, "a finite number >= 0", 0.0, unit)


def _at_least(name: str, value: object, allowed: str, least: float, unit: str) -> float:
    if (found := number(name, value, allowed, unit=unit)) < least:
        raise InputError(name, value, allowed + (f" (in {unit})" if unit else ""))
    return found


def between(name: str, value: object, least: float, most: float, *, strict: bool = False) -> float:
    """Return a number in a closed interval; between its ends with `strict`.

    Raises
    ------
    InputError
        It is none.

    Examples
    --------
    >>> between("tol", 0.1, 1e-14, 1e-3)
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: tol = 0.1: must be a number between 1e-14 and 0.001
    """
    allowed = f"a number between {least:g} and {most:g}"
    found = number(name, value, allowed)
    if not (least < found < most if strict else least <= found <= most):
        raise InputError(name, value, allowed)
    return found


def count(name: str, value: object, least: int = 1, most: int | None = None, what: str = "") -> int:
    """Return a count as an integer.

    Parameters
    ----------
    name : str
        What is counted.
    value : object
        The value given.
    least, most : int, optional
        Bounds, included; the upper one is `LARGEST_COUNT` for None.
    what : str, optional
        What the upper bound is, in words.

    Raises
    ------
    InputError
        It is no integer, or out of bounds.

    Examples
    --------
    >>> count("keep", np.int64(3))
    3
    >>> count("chunks", 2, 1, 1, "the number of values")
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: chunks = 2: must be 1, the number of values
    """
    found = _whole(value)
    if found is not None and least <= found <= (LARGEST_COUNT if most is None else most):
        return found
    if most is None and found is not None and found > LARGEST_COUNT:
        most = LARGEST_COUNT
    allowed = f"an integer >= {least}"
    if most is not None:
        allowed = f"an integer between {least} and {most}" if most > least else f"{least}"
    raise InputError(name, value, ", ".join(filter(None, (allowed, what))))


def generator(name: str, value: object) -> np.random.Generator:
    """Return the generator of random numbers that is given, or that of a seed.

    Raises
    ------
    InputError
        It is neither a generator nor an integer >= 0.

    Examples
    --------
    >>> generator("rng", 3).integers(10)
    np.int64(8)
    """
    return value if isinstance(value, np.random.Generator) else np.random.default_rng(count(name, value, 0))


def size(name: str, value: object, least: int = 1, most: int = LARGEST_LIST) -> int:
    """Return a count of things that are held in memory at once.

    Raises
    ------
    InputError
        It is no integer, below `least`, or too large for the memory of any machine.

    Examples
    --------
    >>> size("keep", 10**12)
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: keep = 1000000000000: must be at most 10000000, as all are held in memory
    """
    if (found := count(name, value, least)) > most:
        raise InputError(name, value, f"at most {most}, as all are held in memory")
    return found


def _whole(value: object) -> int | None:
    """Return an integer; None for what is none."""
    if isinstance(value, bool | np.bool_) or not is_real(value):
        return None
    try:
        return operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        return None


def interval(name: str, value: object, *, finite: bool = False) -> tuple[float, float]:
    """Return the two ends of an interval, the lower first; with `finite` neither may be infinite.

    Raises
    ------
    InputError
        They are none.

    Examples
    --------
    >>> interval("bounds", (1, 0))
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: bounds = (1, 0): must be two numbers, the lower first
    """
    allowed = "two finite numbers, the lower first" if finite else "two numbers, the lower first"
    ends = listed(name, value, allowed, most=2)
    if len(ends) != 2:
        raise InputError(name, value, allowed)
    try:
        low, high = (number(name, end, finite=finite) for end in ends)
    except InputError:
        raise InputError(name, value, allowed) from None
    if not low < high:
        raise InputError(name, value, allowed)
    return low, high


def array(
    name: str, value: object, allowed: str = "an array of real numbers", *, finite: bool = True
) -> NDArray[np.float64]:
    """Return numbers in any nesting as an array of floats of the same shape, a copy.

    Parameters
    ----------
    name : str
        The argument.
    value : object
        What was given: a number, a sequence, an array.
    allowed : str, optional
        What the message says is allowed where something else than numbers is given.
    finite : bool, optional
        Whether infinities and NaN are refused; the message says which they are.

    Raises
    ------
    InputError
        It is not made of real numbers, or one of them is not finite.

    Examples
    --------
    >>> array("z", [1, float("nan")])
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: z[1] = nan: must be finite
    """
    found = _floats(name, value, allowed)
    if finite:
        refuse(name, found, ~np.isfinite(found), "finite")
    return found


def _floats(name: str, value: object, allowed: str) -> NDArray[np.float64]:
    if isinstance(value, np.ndarray) and value.dtype == np.float64 and not isinstance(value, np.ma.MaskedArray):
        return np.array(value, dtype=np.float64)
    try:
        given = value if isinstance(value, np.ndarray) else np.asarray(value)
        if given.dtype.kind in "iuf" and isinstance(value, list | tuple):
            given = np.asarray(value, dtype=object)  # in which truth values are still what they are
    except Exception as error:  # rows of different lengths, or whatever an object's __array__ raises
        raise InputError(name, value, allowed) from error
    if given.dtype.kind not in "iufO" or isinstance(value, bytearray | memoryview):
        raise InputError(name, value, allowed)
    if given.dtype.kind == "O" and not {float, int}.issuperset(map(type, given.flat)):
        return _of_objects(name, value, given, allowed)
    try:
        with np.errstate(over="ignore"):  # of numbers longer than a float; what is too large is not finite
            found = np.array(given, dtype=np.float64)
    except OverflowError:
        return _of_objects(name, value, given, allowed)
    if isinstance(given, np.ma.MaskedArray):
        found[np.ma.getmaskarray(given)] = math.nan
    return found


def _of_objects(name: str, value: object, given: NDArray[Any], allowed: str) -> NDArray[np.float64]:
    found = np.full(given.shape, math.nan)
    for place in np.ndindex(given.shape):
        entry = given[place]
        if not is_real(entry):
            raise InputError(name, value, allowed)
        where = f"{name}[{', '.join(map(str, place))}]" if place else name
        try:
            found[place] = float(entry)
        except Exception:  # told as for a number by itself
            number(where, entry)
    return found


def ascending(name: str, value: object, hint: str = "") -> NDArray[np.float64]:
    """Return numbers that ascend, each once, as an array of shape (value,); at least one.

    Parameters
    ----------
    name : str
        The argument.
    value : object
        What was given: a sequence of numbers.
    hint : str, optional
        What to do about numbers that do not ascend.

    Raises
    ------
    InputError
        It is no such sequence; the message has the first two numbers that do not ascend.

    Examples
    --------
    >>> ascending("values", [0.1, 0.3, 0.2])
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: values = '0.3, 0.2': must be ascending, each once
    """
    allowed = "a sequence of numbers, at least one"
    found = array(name, value, allowed)
    if found.ndim != 1 or not found.size:
        raise InputError(name, value, allowed)
    if falls := np.flatnonzero(np.diff(found) <= 0.0).tolist():
        pair = f"{found[falls[0]]:.12g}, {found[falls[0] + 1]:.12g}"
        raise InputError(name, pair, "ascending, each once", hint)
    return found


def refuse(name: str, found: NDArray[np.float64], wrong: NDArray[np.bool_], allowed: str) -> None:
    """Raise `InputError` for the first entry of an array that is `wrong`; return if there is none.

    Parameters
    ----------
    name : str
        The argument.
    found : ndarray
        The value given.
    wrong : ndarray of bool, shape of `found`
        Which entries cannot be used.
    allowed : str
        What the message says is allowed.

    Raises
    ------
    InputError
        An entry is wrong.

    Examples
    --------
    >>> refuse("x", np.array([0.5, 2.0]), np.array([False, True]), "at most 1")
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: x[1] = 2.0: must be at most 1
    """
    if wrong.any():
        first = tuple(int(i) for i in np.argwhere(wrong)[0])
        where = f"[{', '.join(map(str, first))}]" if first else ""
        raise InputError(name + where, float(found[first]), allowed)
