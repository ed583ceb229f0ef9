"""Calls of functions that take a dataclass of options, with all arguments side by side."""

from __future__ import annotations

from collections.abc import Callable
from inspect import signature
from typing import Any


class Grouped:
    """A function whose options are given as if they were its own arguments; each goes to the class that has it.

    Parameters
    ----------
    function : callable
        What is called.
    **parts : callable
        What makes an argument of it, by name: a dataclass, or another `Grouped`.
    """

    def __init__(self, function: Callable[..., Any], **parts: Callable[..., Any]) -> None:
        self.function, self.parts = function, parts
        self.names = {name for name in signature(function).parameters if name not in parts}
        self.names |= {name for part in parts.values() for name in _names(part)}

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        for name, part in self.parts.items():
            own = {key: options.pop(key) for key in list(options) if key in _names(part)}
            options[name] = part(**own)
        return self.function(*arguments, **options)


def _names(part: Callable[..., Any]) -> set[str]:
    return part.names if isinstance(part, Grouped) else set(signature(part).parameters)
