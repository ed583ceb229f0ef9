"""The largest and the least of expressions, which SymPy compares where they are short: long ones take it minutes."""

from __future__ import annotations

from typing import Any

import sympy

__all__ = ["CHOICES", "Max", "Min"]

_COMPARED = 40  # operations of the arguments in all, up to which they are compared


class Max(sympy.Max):  # type: ignore[misc]
    """The largest of expressions."""

    def __new__(cls, *arguments: Any, **_: Any) -> Any:
        """Return the function, simplified where its arguments are short."""
        return _made(cls, sympy.Max, arguments)


class Min(sympy.Min):  # type: ignore[misc]
    """The least of expressions."""

    def __new__(cls, *arguments: Any, **_: Any) -> Any:
        """Return the function, simplified where its arguments are short."""
        return _made(cls, sympy.Min, arguments)


def _made(cls: Any, base: Any, arguments: tuple[Any, ...]) -> Any:
    """Return the function of a class that is not simplified by itself: SymPy's methods ask which class they are of."""
    if sum(sympy.count_ops(argument) for argument in arguments) <= _COMPARED:
        simple = base(*arguments)
        if not isinstance(simple, base):
            return simple
        arguments = simple.args
    return base.__new__(cls, *arguments, evaluate=False)


CHOICES = {"Max": Max, "Min": Min}
