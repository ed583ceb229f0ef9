"""Numbers as a user hands them in: checked once, kept as floats in SI units."""

from __future__ import annotations

import contextlib
import math
import operator
from numbers import Real
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import InputError

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["count", "finite_array", "non_negative", "number", "positive", "refuse"]


def positive(name: str, value: object, unit: str = "") -> float:
    """Return `value` as a float, positive and finite.

    Parameters
    ----------
    name : str
        The argument, for the message.
    value : object
        What was given.
    unit : str, optional
        Its unit, for the message.

    Returns
    -------
    float

    Raises
    ------
    InputError
        `value` is no real number, or not positive, or not finite.

    Examples
    --------
    >>> positive("length", 240e-6, "m")
    0.00024
    >>> positive("length", -1, "m")
    Traceback (most recent call last):
    saltus.errors.InputError: length = -1: must be a positive, finite number (in m)
    """
    allowed = "a positive, finite number" + (f" (in {unit})" if unit else "")
    if (checked := number(name, value, allowed)) <= 0.0:
        raise InputError(name, value, allowed)
    return checked


def non_negative(name: str, value: object, unit: str) -> float:
    """Return `value` as a float, zero or positive, and finite.

    Parameters
    ----------
    name : str
        The argument, for the message.
    value : object
        What was given.
    unit : str
        Its unit, for the message.

    Returns
    -------
    float

    Raises
    ------
    InputError
        `value` is no real number, or negative, or not finite.

    Examples
    --------
    >>> non_negative("H", 0, "J")
    0.0
    """
    allowed = f"a finite number, zero or positive (in {unit})"
    if (checked := number(name, value, allowed)) < 0.0:
        raise InputError(name, value, allowed)
    return checked


def number(name: str, value: object, allowed: str) -> float:
    """Return `value` as a float if it is one finite real number.

    Parameters
    ----------
    name : str
        The argument, for the message.
    value : object
        What was given; a truth value is no number.
    allowed : str
        What the message says is allowed.

    Returns
    -------
    float

    Raises
    ------
    InputError
        `value` is no finite real number.

    Examples
    --------
    >>> number("ybar", 1, "a finite number")
    1.0
    >>> number("ybar", "much", "a finite number")
    Traceback (most recent call last):
    saltus.errors.InputError: ybar = 'much': must be a finite number
    """
    if isinstance(value, Real) and not isinstance(value, bool):
        try:
            checked = float(value)
        except OverflowError:
            checked = math.inf
        if math.isfinite(checked):
            return checked
    raise InputError(name, value, allowed)


def finite_array(name: str, value: object) -> NDArray[np.float64]:
    """Return `value` as an array of finite floats.

    Parameters
    ----------
    name : str
        The argument, for the message.
    value : object
        What was given: a number, or numbers in any nesting.

    Returns
    -------
    ndarray, shape of `value`

    Raises
    ------
    InputError
        `value` is not made of real numbers, or one of them is not finite; the message says which.

    Examples
    --------
    >>> finite_array("z", [1, float("nan")])
    Traceback (most recent call last):
    saltus.errors.InputError: z[1] = nan: must be finite
    """
    given: NDArray[np.generic] = np.empty(0, dtype=object)
    with contextlib.suppress(ValueError):  # nested sequences of different lengths
        given = np.asarray(value)
    if given.dtype.kind not in "iuf":
        raise InputError(name, value, "an array of real numbers")
    array = given.astype(np.float64)
    refuse(name, array, ~np.isfinite(array), "finite")
    return array


def refuse(name: str, array: NDArray[np.float64], wrong: NDArray[np.bool_], allowed: str) -> None:
    """Raise `InputError` for the first entry of `array` that is `wrong`; return if there is none.

    Parameters
    ----------
    name : str
        The argument, for the message.
    array : ndarray
        What was given.
    wrong : ndarray of bool, shape of `array`
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
    saltus.errors.InputError: x[1] = 2.0: must be at most 1
    """
    if wrong.any():
        first = tuple(int(i) for i in np.argwhere(wrong)[0])
        where = f"[{', '.join(map(str, first))}]" if first else ""
        raise InputError(name + where, float(array[first]), allowed)


def count(name: str, value: object) -> int:
    """Return `value` as an int, 1 or more.

    Parameters
    ----------
    name : str
        The argument, for the message.
    value : object
        What was given: any integer, but no truth value.

    Returns
    -------
    int

    Raises
    ------
    InputError
        `value` is no integer, or below 1.

    Examples
    --------
    >>> count("modes", 2)
    2
    >>> count("modes", 0)
    Traceback (most recent call last):
    saltus.errors.InputError: modes = 0: must be an integer, 1 or more
    """
    try:
        checked = 0 if isinstance(value, bool) else operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        checked = 0
    if checked < 1:
        raise InputError(name, value, "an integer, 1 or more")
    return checked
