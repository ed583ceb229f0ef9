"""Roots of what may be negative: compiled code takes 0 for them there, and looks at their arguments besides.

Stages of a step and iterates of Newton's method may pass there; what is handed out may not, beyond the errors of its
states.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import sympy

from saltus.system.writing.printer import is_broken

if TYPE_CHECKING:
    from collections.abc import Iterable

    from saltus.system.derivatives import Symbolic

__all__ = ["Root", "roots_of"]


class Root(NamedTuple):
    """A broken power, or one whose exponent may be broken."""

    base: sympy.Expr
    exponent: sympy.Expr


def roots_of(system: Symbolic, expressions: Iterable[sympy.Expr]) -> list[Root]:
    """Return the roots of what depends on the state and may be negative, sorted by their texts.

    Parameters
    ----------
    system : Symbolic
        The definition; its positive parameters are known to be so.
    expressions : iterable of sympy.Expr
        Where they are looked for.
    """
    known = {symbol: sympy.Dummy(positive=True) for symbol in system.p if symbol.name in system.system.positive}
    parameters = set(system.p)

    def counts(power: sympy.Expr) -> bool:
        whole = power.exp.is_integer or (power.exp.is_number and not is_broken(power.exp))
        if whole or power.free_symbols <= parameters:
            return False
        return not power.base.xreplace(known).is_nonnegative

    found = {Root(*power.args) for e in expressions for power in e.atoms(sympy.Pow) if counts(power)}
    return sorted(found, key=str)
