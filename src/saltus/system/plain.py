"""Definitions and parameters from outside, as plain data: checked before a system is made of them."""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.errors import DefinitionError, InputError, nearest

if TYPE_CHECKING:
    from saltus.contents import Contents
    from saltus.system.definition import Definition
    from saltus.system.hybrid import HybridSystem
    from saltus.system.maps import Map

__all__ = [
    "all_parameters",
    "check_plain",
    "expect_values",
    "held_any",
    "held_map",
    "held_parameters",
    "held_system",
    "swept_parameter",
    "system_from",
]

_PARTS = ("_re", "_im")  # ends of the names of variables that hold complex values

# Kinds of values in `_FORM`.
_TEXT = (str,)
_NUMBER = (int, float)
_TEXTS = [(str,)]
_OPTIONAL = (str, type(None))
_ANY = (str, int, float, bool, type(None), list, tuple, Mapping)  # whatever JSON holds
# Keys that must be there.
_NEEDED = ("states", "parameters", "modes", "transitions", "field", "source", "target", "event", "pieces", "image")

# What `HybridSystem.definition` returns: a tuple holds kinds, a list what its entries are, a mapping what stands under
# each key, or under every key ("").
_FORM: Mapping[str, Any] = {
    "name": _TEXT,
    "states": _TEXTS,
    "parameters": {"": _NUMBER},
    "phase": [_OPTIONAL],
    "modes": {"": {"field": {"": _TEXT}, "domain": _OPTIONAL, "surface": _OPTIONAL, "states": _TEXTS}},
    "transitions": [
        {
            "source": _TEXT, "target": _TEXT, "event": _TEXT, "direction": (int,), "reset": {"": _TEXT},
            "when": _OPTIONAL, "name": _TEXT, "sums": (bool,),
        }
    ],
    "outputs": {"": {"": _TEXT}},
    "groups": {"": _TEXTS},
    "positive": _TEXTS,
    "parameter_bounds": {"": [_NUMBER]},
    "regimes": {"": _TEXTS},
    "angles": _TEXTS,
    "made_of": {"": _ANY},
}  # fmt: skip

# What `Map.definition` returns, in the same form.
_MAP_FORM: Mapping[str, Any] = {
    **{key: _FORM[key] for key in ("name", "states", "parameters")},
    "pieces": {"": {"image": {"": _TEXT}, "where": _TEXTS}},
    **{key: _FORM[key] for key in ("outputs", "groups", "positive", "parameter_bounds", "angles")},
}


def check_plain(definition: Any) -> None:
    """Raise `DefinitionError` where plain data are not what `HybridSystem.definition` or `Map.definition` returns.

    Examples
    --------
    >>> check_plain({"states": ["x", 3]})
    Traceback (most recent call last):
        ...
    saltus.errors.DefinitionError: definition's 'states' = 3: must be str
    """
    if not isinstance(definition, Mapping):
        raise DefinitionError("definition", definition, "a mapping")
    form = _MAP_FORM if "pieces" in definition else _FORM
    for key, value in definition.items():
        if key not in form:
            raise DefinitionError("definition", key, f"one of {', '.join(form)}", nearest(str(key), form))
        if key != "phase" or value is not None:
            _check(value, form[key], f"definition's {key!r}")
    _check_needed(definition, form, "definition")


def _check(value: Any, form: Any, where: str) -> None:
    if isinstance(form, tuple):
        if not isinstance(value, form) or (isinstance(value, bool) and bool not in form):
            raise DefinitionError(where, value, " or ".join(kind.__name__ for kind in form))
    elif isinstance(form, list):
        if not isinstance(value, list | tuple):
            raise DefinitionError(where, value, "a list")
        for part in value:
            _check(part, form[0], where)
    else:
        if not isinstance(value, Mapping):
            raise DefinitionError(where, value, "a mapping")
        for key, part in value.items():
            if not isinstance(key, str) or ("" not in form and key not in form):
                raise DefinitionError(where, key, f"of {', '.join(form)}" if "" not in form else "a text as a key")
            _check(part, form.get(key, form.get("")), f"{where}, {key!r}")
        _check_needed(value, form, where)


def _check_needed(value: Mapping[str, Any], form: Mapping[str, Any], where: str) -> None:
    needed = [
        key for key in form if key in _NEEDED and not (key == "states" and "field" in form)
    ]  # a mode may say none
    if missing := [key for key in needed if key not in value]:
        raise DefinitionError(where, list(value), f"a mapping with {missing[0]!r}")


def system_from(definition: Any) -> HybridSystem | Map:
    """Return the hybrid system or the map of a definition from outside."""
    from saltus.system.hybrid import HybridSystem
    from saltus.system.maps import Map

    check_plain(definition)
    return Map.from_definition(definition) if "pieces" in definition else HybridSystem.from_definition(definition)


def held_any(contents: Contents) -> HybridSystem | Map:
    """Return the hybrid system or the map in a result's file."""
    return system_from(contents.json("definition", dict))


def held_system(contents: Contents) -> HybridSystem:
    """Return the hybrid system in a result's file; raise `InputError` where there is a map."""
    from saltus.system.maps import flowing

    return flowing(held_any(contents))


def held_map(contents: Contents) -> Map:
    """Return the map in a result's file; raise `InputError` where there is a hybrid system."""
    from saltus.system.maps import Map

    return checks.instance("system", held_any(contents), Map)


def held_parameters(contents: Contents, system: Definition) -> dict[str, float]:
    """Return all parameters in a result's file; raise `InputError` where one is missing or cannot be."""
    return all_parameters(contents.json("parameters", dict), system)


def swept_parameter(contents: Contents, system: Definition) -> str:
    """Return the name in the attribute ``parameter``; raise `InputError` where no parameter and no group has it."""
    name, known = contents.text("parameter"), (*system.parameter_names, *system.groups)
    if name not in known:
        raise InputError("attribute 'parameter'", name, f"one of {', '.join(known)}", nearest(name, known))
    return name


def all_parameters(given: Mapping[str, Any], system: Definition) -> dict[str, float]:
    """Return the values of all parameters; raise `InputError` where one is missing, unknown, or cannot be."""
    if set(given) != set(system.parameter_names):
        raise InputError("parameters", sorted(given), f"values of all of {', '.join(system.parameter_names)}")
    for name, value in given.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise InputError(f"parameter {name!r}", value, "a number")
    values = system.resolve(given)
    return {name: values[name] for name in given}


def expect_values(contents: Contents, system: HybridSystem, dim: str, at: float) -> None:
    """Raise `InputError` where a result's file has not as many values as states of given totals have directions.

    Up to version 0.1 each conserved total had a value of its own: an eigenvalue of 0, a multiplier of 1. They are left
    out, of each row those nearest to it; a `RuntimeWarning` says so.

    Parameters
    ----------
    dim : str
        Dimension of the values; their variables end in ``_re`` and ``_im``.
    at : float
        The value that stands for a total.
    """
    held, count = contents.dataset, len(system.laws)
    if not count or held.sizes.get(dim) != len(system.states):
        contents.expect(**{dim: system.freedom})
        return
    names = [name.removesuffix("_re") for name in map(str, held) if name.endswith("_re") and dim in held[name].dims]
    if {f"{name}{end}" for name in names for end in ("_re", "_im")} != {str(n) for n in held if dim in held[n].dims}:
        contents.expect(**{dim: system.freedom})
    kept: dict[str, Any] = {}
    for name in names:
        parts = [np.moveaxis(held[f"{name}{end}"].to_numpy(), held[f"{name}_re"].dims.index(dim), -1) for end in _PARTS]
        order = np.argsort(np.hypot(parts[0] - at, parts[1]), axis=-1, kind="stable")
        left = np.sort(order[..., count:], axis=-1)
        dims = (*(d for d in held[f"{name}_re"].dims if d != dim), dim)
        for end, part in zip(_PARTS, parts, strict=True):
            kept[f"{name}{end}"] = (dims, np.take_along_axis(part, left, axis=-1))
    contents.dataset = held.drop_dims(dim).assign(kept)
    told = f"{count} {dim}{'s' if count > 1 else ''} of {at:g} left out: one for each of {', '.join(system.laws.names)}"
    warnings.warn(f"saved by an earlier version; {told}, which the system conserves", RuntimeWarning, stacklevel=2)
