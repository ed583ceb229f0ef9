"""What is computed once for each definition, and forgotten with it."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps
from typing import Any, TypeVar

__all__ = ["once"]

_Found = TypeVar("_Found")


def once(function: Callable[..., _Found]) -> Callable[..., _Found]:
    """Return a function of a definition that computes once for each definition, and each further arguments.

    What it returns is kept by the definition: a cache of the function's own would keep every definition alive.
    """

    @wraps(function)
    def known(system: Any, *others: Any) -> _Found:
        kept = vars(system).setdefault("_once", {})
        key = (function, others)
        if key not in kept:
            kept[key] = function(system, *others)
        found: _Found = kept[key]
        return found

    return known
