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
        return sympy.Max.__new__(cls, *arguments, evaluate=_short(arguments))


class Min(sympy.Min):  # type: ignore[misc]
    """The least of expressions."""

    def __new__(cls, *arguments: Any, **_: Any) -> Any:
        """Return the function, simplified where its arguments are short."""
        return sympy.Min.__new__(cls, *arguments, evaluate=_short(arguments))


def _short(arguments: tuple[Any, ...]) -> bool:
    return bool(sum(sympy.count_ops(argument) for argument in arguments) <= _COMPARED)


CHOICES = {"Max": Max, "Min": Min}
