"""Arguments as a user hands them in: one check for each kind, with the same words wherever it is asked for.

Each function returns the argument as what it stands for (a float, an integer, an array, a path), or raises
`InputError`. Its first parameter `name` is what the message calls the argument, the second is the value given.

A *real number* is an integer, a float, a fraction, a decimal, or a real number of NumPy or of SymPy. So is whatever is
registered as `numbers.Real`. Booleans, complex numbers, texts, bytes, dates and durations are none, whatever `float`
makes of them.
"""

from saltus.checks.numeric import (
    LARGEST_COUNT,
    LARGEST_LIST,
    array,
    ascending,
    between,
    count,
    generator,
    interval,
    is_real,
    non_negative,
    number,
    positive,
    refuse,
    size,
)
from saltus.checks.objects import flag, function, instance
from saltus.checks.textual import chosen, listed, mapping, named_values, names, path, text

__all__ = [
    "LARGEST_COUNT",
    "LARGEST_LIST",
    "array",
    "ascending",
    "between",
    "chosen",
    "count",
    "flag",
    "function",
    "generator",
    "instance",
    "interval",
    "is_real",
    "listed",
    "mapping",
    "named_values",
    "names",
    "non_negative",
    "number",
    "path",
    "positive",
    "refuse",
    "size",
    "text",
]
