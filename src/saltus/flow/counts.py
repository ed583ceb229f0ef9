"""The one rule for counts that are asked for: integers, NumPy's among them, and no booleans."""

from __future__ import annotations

import numpy as np

from saltus.errors import InputError

__all__ = ["checked_count"]


def checked_count(name: str, value: object, least: int, most: int | None = None, what: str = "") -> int:
    """Return a count as an integer.

    Parameters
    ----------
    name : str
        What is counted.
    value : object
        What was given.
    least, most : int
        Bounds, included; no upper one for None.
    what : str, optional
        What the upper bound is, in words.

    Raises
    ------
    InputError
        It is no integer, or out of bounds.

    Examples
    --------
    >>> checked_count("keep", np.int64(3), 1)
    3
    >>> checked_count("chunks", 2, 1, 1, "the number of values")
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: chunks = 2: must be 1, the number of values
    """
    whole = isinstance(value, int | np.integer) and not isinstance(value, bool)
    if whole and least <= value and (most is None or value <= most):  # type: ignore[operator]
        return int(value)  # type: ignore[call-overload, no-any-return]
    allowed = f"an integer >= {least}"
    if most is not None:
        allowed = f"an integer between {least} and {most}" if most > least else f"{least}"
    raise InputError(name, value, ", ".join(filter(None, (allowed, what))))
