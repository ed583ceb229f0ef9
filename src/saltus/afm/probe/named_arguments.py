"""Records whose arguments have names with units: a wrong name is told with the right one."""

from __future__ import annotations

from inspect import Parameter, Signature, signature
from typing import TYPE_CHECKING

from saltus.errors import InputError, nearest

if TYPE_CHECKING:
    from typing import Self

__all__ = ["NamedArguments"]


class _OfInit:
    """The signature of a class: that of its ``__init__``, which `NamedArguments.__new__` would hide."""

    def __get__(self, _: object, kind: type[object]) -> Signature:
        found = signature(kind.__init__)
        return found.replace(parameters=list(found.parameters.values())[1:])


class NamedArguments:
    """Base of dataclasses; an argument of a wrong name is an `InputError` whose hint has the nearest name.

    Examples
    --------
    >>> from saltus import afm
    >>> afm.Probe(k=3.0)
    Traceback (most recent call last):
        ...
    saltus.errors.InputError: argument of Probe = 'k': must be one of k_N_m, ...; did you mean 'k_N_m'?
    """

    __signature__ = _OfInit()

    def __new__(cls, *_: object, **given: object) -> Self:
        """Return a record without values, once the names of the arguments are known."""
        own = signature(cls).parameters.values()
        if not any(one.kind is Parameter.VAR_KEYWORD for one in own):
            known = tuple(one.name for one in own if one.kind is not Parameter.VAR_POSITIONAL)
            for name in given:
                if name not in known:
                    begun = [one for one in known if one.startswith(f"{name}_")]
                    hint = f"did you mean {begun[0]!r}?" if begun else nearest(name, known)
                    raise InputError(f"argument of {cls.__name__}", name, f"one of {', '.join(known)}", hint)
        return super().__new__(cls)
