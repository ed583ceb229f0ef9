"""Objects and callables as a user hands them in."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, TypeVar, get_args, overload

import numpy as np

from saltus.errors import InputError

if TYPE_CHECKING:
    from types import UnionType

__all__ = [
    "flag",
    "function",
    "instance",
]

Kind = TypeVar("Kind")

# Where an object of a kind comes from, for the message.
_WHERE_FROM = {
    "Setup": "table1() returns the paper's",
    "PeriodicOrbit": "find_orbit and solve_orbit give one",
    "SpecialPoint": "branch['PD1'] is one",
    "Branch": "continue_orbit gives one",
    "Basins": "map_basins gives one",
    "Attractors": "find_attractors and attractors_from give one",
}


@overload
def instance(name: str, value: object, kind: type[Kind], hint: str = "") -> Kind: ...
@overload
def instance(name: str, value: object, kind: UnionType, hint: str = "") -> Any: ...
def instance(name: str, value: object, kind: type[Any] | UnionType, hint: str = "") -> Any:
    """Return `value` if it is of a kind.

    Parameters
    ----------
    name : str
        The argument, for the message; so in all functions of this module.
    value : object
        The value given.
    kind : type or union of types
        What it must be.
    hint : str, optional
        What to do about it; by default where such an object comes from.

    Raises
    ------
    InputError
        It is of another kind.

    Examples
    --------
    >>> instance("orbit", [0.0], slice)
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: orbit = [0.0]: must be a slice
    """
    if isinstance(value, kind):
        return value
    kinds = get_args(kind) or (kind,)  # those of a union
    wanted = " or ".join(f"{'an' if one.__name__[0] in 'AEIO' else 'a'} {one.__name__}" for one in kinds)
    hint = hint or (f"it is the class, not {wanted}" if any(value is one for one in kinds) else "")
    raise InputError(name, value, wanted, hint or _WHERE_FROM.get(kinds[0].__name__, ""))


def function(name: str, value: object, what: str) -> Any:
    """Return `value` if it can be called, or is None; `what` says with what it is called, as in "of two counts".

    Raises
    ------
    InputError
        It cannot be called.
    """
    if value is not None and not callable(value):
        raise InputError(name, value, f"a function {what}")
    return value


def flag(name: str, value: object) -> bool:
    """Return a truth value.

    Raises
    ------
    InputError
        It is neither True nor False.
    """
    if not isinstance(value, bool | np.bool_):
        raise InputError(name, value, "True or False")
    return bool(value)
