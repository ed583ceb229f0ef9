"""States whose rate has them as a factor: where they are 0 they stay, and they never cross it, as populations.

Their zeros are an invariant face. What is near it may grow again from the size that it is there, however small. States
may also have such a factor together, as the two parts of a complex amplitude: where all of them are 0 they stay.

A rate has the factor where each of its terms is seen to have it. Then its rounding has the factor, too: that of
``exp(x) - 1`` has not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import sympy

if TYPE_CHECKING:
    from saltus.system.derivatives import Symbolic

__all__ = ["EXPONENTIAL", "FACE", "PLAIN", "SUPPLIED", "groups_of", "kinds_of"]

PLAIN = 0  # none of the following
FACE = 1  # in every mode the rate is the state times what is finite
SUPPLIED = 2  # but for a part that depends on parameters alone, as immigration
EXPONENTIAL = 3  # the rate is the state times what depends on parameters alone, in every mode

_EXPANDED = 200  # operations of a term up to which it is multiplied out, to see which of its parts have the factor
_ODD = (sympy.sin, sympy.tan, sympy.sinh, sympy.tanh, sympy.asin, sympy.atan, sympy.asinh, sympy.atanh, sympy.erf,
        sympy.Abs)  # fmt: skip # functions that vanish with their argument, in proportion to it
_POLE = (sympy.zoo, sympy.nan, sympy.oo, -sympy.oo)


def kinds_of(system: Symbolic) -> tuple[int, ...]:
    """Return the kind of each state, as one of the four numbers above."""
    states = _states(system)
    return tuple(_kind(system, e) if x in states else PLAIN for e, x in enumerate(system.x))


def groups_of(system: Symbolic) -> tuple[int, ...]:
    """Return for each state the least state of the group that stays at 0 together with it; -1 where there is none."""
    states, alone = _states(system), set[sympy.Symbol]()
    first = {x: e for e, x in enumerate(states)}
    for x in states:
        group = _group(system, x, alone)
        if group is None:
            alone.add(x)
            continue
        joined = {first[other] for other in group}  # with all groups that it meets
        first = {other: min(joined) if e in joined else e for other, e in first.items()}
    return tuple(first[x] if x in first and x not in alone else -1 for x in system.x)


def _states(system: Symbolic) -> list[sympy.Symbol]:
    return system.x if system.system.phase is None else system.x[:-1]


def _kind(system: Symbolic, e: int) -> int:
    x, rates, parameters = system.x[e], [field[e] for field in system.field], set(system.p)
    rests = [rest for rate in rates for rest in _without_factor(rate, x)]
    if not any(rates) or any(not rest.free_symbols <= parameters for rest in rests):
        return PLAIN
    if rests:
        return SUPPLIED
    return EXPONENTIAL if all((rate / x).expand().free_symbols <= parameters for rate in rates) else FACE


def _without_factor(rate: sympy.Expr, x: sympy.Symbol) -> list[sympy.Expr]:
    """Terms of a rate that have not the state as a factor."""
    terms = [term for term in sympy.Add.make_args(rate) if not vanishes(term, {x})]
    long = [term for term in terms if x in term.free_symbols and term.count_ops() < _EXPANDED]
    parts = [part for term in long for part in sympy.Add.make_args(term.expand()) if not vanishes(part, {x})]
    return [term for term in terms if term not in long and term != 0] + [part for part in parts if part != 0]


def vanishes(expression: sympy.Expr, states: set[sympy.Symbol]) -> bool:
    """Whether an expression is seen to vanish with some states in proportion to them, at least."""
    if expression == 0 or expression in states:
        return True
    if not expression.free_symbols & states:
        return False
    if expression.is_Add or isinstance(expression, sympy.Max | sympy.Min):
        return all(vanishes(term, states) for term in expression.args)
    if expression.is_Mul:
        others = [factor for factor in expression.args if not vanishes(factor, states)]
        return len(others) < len(expression.args) and not any(_has_pole(factor, states) for factor in others)
    if expression.is_Pow:
        return bool(expression.exp.is_number) and expression.exp >= 1 and vanishes(expression.base, states)
    return isinstance(expression, _ODD) and vanishes(expression.args[0], states)


def _has_pole(factor: sympy.Expr, states: set[sympy.Symbol]) -> bool:
    """Whether a factor is infinite where some states are 0, and more so than a logarithm."""
    if not factor.free_symbols & states:
        return False
    value = factor.replace(sympy.log, lambda _: sympy.S.One).subs(dict.fromkeys(states, 0))
    return value.has(*_POLE) or any(power.base == 0 for power in value.atoms(sympy.Pow))


def _group(system: Symbolic, x: sympy.Symbol, alone: set[sympy.Symbol]) -> set[sympy.Symbol] | None:
    """The least states, this one among them, that all stay at 0 where all are; None where none are.

    alone: states that are known to be in no group.
    """
    states = {state: e for e, state in enumerate(_states(system))}
    group, new = {x}, [x]
    while new:
        at = states[new.pop()]
        for term in (term for field in system.field for term in sympy.Add.make_args(field[at])):
            if vanishes(term, group):
                continue
            others = sorted(term.free_symbols & states.keys() - group, key=states.__getitem__)
            further = [other for other in others if vanishes(term, {*group, other})]
            if not further or further[0] in alone:
                return None
            group.add(further[0])
            new.append(further[0])
    return group
