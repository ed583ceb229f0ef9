"""Fields with roots that vanish on an event surface, made analytic there: w = sqrt|h| as a state, dt = w dsigma.

Let a field have a half-integer power of an event function h, such as a contact law with the power 3/2. It is only once
differentiable on the surface h = 0. Every method of high order loses its order there. Let w = sqrt(s h), where s is the
sign of h in the mode, and let sigma be the time with dt = w dsigma. The powers become powers of w, and dw/dsigma = s
h'/2. Every equation is analytic on the surface and beyond, where w has the other sign. So the event is a simple zero of
w. See docs/theory/series.md.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import sympy

from saltus.system.expansion import can_be_expanded, expanded

if TYPE_CHECKING:
    from saltus.system.derivatives import Symbolic

__all__ = ["Regularised", "multiple_of", "regularised"]


_PLACES = (0.71, 1.13)  # value of the first state at which expressions are compared; the others lie beyond
_PARAMETER = 0.4142  # value of the first parameter there; the others are multiples
_ALIKE = 1e-6  # difference of two ratios, relative, that rounding may make


@dataclass(frozen=True)
class Regularised:
    """A mode's field in the time sigma about one of its event surfaces."""

    transition: int  # index of the transition whose event function h has the roots
    sign: int  # sign of h in the mode
    w: sympy.Symbol  # ``sqrt(sign * h)``, whose derivative in sigma is ``sign * h' / 2``
    field: list[sympy.Expr]  # the mode's field in time, with powers of `w`; in sigma it is `w` times that

    def solved(self, system: Symbolic) -> tuple[int, sympy.Expr] | None:
        """Return a state that follows from w and the other states: its index, and ``sign * w**2 = h`` solved for it.

        It is that with the largest coefficient, a number, of those that h is linear in: a small one would make large
        errors of small ones. None where there is no such state, or where the phase occurs otherwise than as sines and
        cosines of its multiples.
        """
        event = system.event[self.transition]
        theta = system.x[-1] if system.system.phase is not None else None
        states = system.x[:-1] if theta is not None else system.x
        phasors = {a: sympy.Dummy() for a in event.atoms(sympy.sin, sympy.cos) if theta in a.free_symbols}
        if any(not sympy.diff(a.args[0], theta).is_number for a in phasors):
            return None
        plain = event.xreplace(phasors)
        slopes = {i: sympy.diff(plain, symbol) for i, symbol in enumerate(states)}
        slopes = {i: slope for i, slope in slopes.items() if slope.is_number and slope != 0}
        if not slopes or theta in plain.free_symbols:
            return None
        i = max(slopes, key=lambda i: (abs(slopes[i]), i))
        rest = expanded(event - slopes[i] * states[i])
        return i, expanded((self.sign * self.w**2 - rest) / slopes[i])


def regularised(system: Symbolic, mode: int) -> Regularised | None:
    """Return the mode's field with powers of w, or None where no root in it vanishes on one of its event surfaces.

    Where roots of several event functions occur, those of the first in the definition become powers of w; the others
    stay roots.

    Examples
    --------
    >>> from saltus.system.derivatives import Symbolic
    >>> from saltus.system.hybrid import HybridSystem, Mode, Transition
    >>> spring = HybridSystem(
    ...     states=("x", "v"),
    ...     parameters={"d": 1.0},
    ...     modes={"free": Mode({"x": "v", "v": "-x"}), "contact": Mode({"x": "v", "v": "-x - (x - d)**(3/2)"})},
    ...     transitions=[Transition("free", "contact", "x - d", 1), Transition("contact", "free", "x - d", -1)],
    ... )
    >>> found = regularised(Symbolic(spring), 1)
    >>> found.transition, found.sign, found.field[1]
    (1, 1, -w**3 - x)
    """
    field = system.field[mode]
    roots = {
        power.base
        for expression in field
        for power in expression.atoms(sympy.Pow)
        if power.exp.is_Rational and power.exp.q == 2 and power.base.free_symbols & set(system.x)
    }
    for k, source in enumerate(system.source):
        if source != mode:
            continue
        ratios = {base: ratio for base in roots if (ratio := multiple_of(system, base, system.event[k])) is not None}
        signs = {sign for _, sign in ratios.values()}
        if len(signs) != 1:
            continue
        sign, w = signs.pop(), sympy.Symbol("w", real=True)
        if w in {*system.x, *system.p}:
            w = sympy.Dummy("w", real=True)
        powers = {
            power: (sign * ratio) ** power.exp * w ** (2 * power.exp)
            for expression in field
            for power in expression.atoms(sympy.Pow)
            for base, (ratio, _) in ratios.items()
            if power.base == base and power.exp.is_Rational and power.exp.q == 2
        }
        return Regularised(k, sign, w, [expression.xreplace(powers) for expression in field])
    return None


def multiple_of(system: Symbolic, base: sympy.Expr, event: sympy.Expr) -> tuple[sympy.Expr, int] | None:
    """What `base` is a multiple of `event` by, and its sign, where that is a constant of known sign; None otherwise."""
    if _varies(system, base, event):
        return None
    positive = {symbol: sympy.Dummy(positive=True) for symbol in system.p if symbol.name in system.system.positive}
    base, event = expanded(base.xreplace(positive)), expanded(event.xreplace(positive))
    for symbol in system.x:
        slope = sympy.diff(event, symbol)
        if slope == 0:
            continue
        ratio = sympy.diff(base, symbol) / slope
        ratio = sympy.cancel(ratio) if can_be_expanded(ratio) else ratio
        if ratio.free_symbols & set(system.x) or not (ratio.is_positive or ratio.is_negative):
            return None
        if expanded(base - ratio * event) != 0:
            return None
        sign = 1 if ratio.is_positive else -1
        return ratio.xreplace({dummy: symbol for symbol, dummy in positive.items()}), sign
    return None


def _varies(system: Symbolic, base: sympy.Expr, event: sympy.Expr) -> bool:
    """Whether the ratio of two expressions differs between two states, by numbers: nested roots cancel only slowly.

    Numbers may be complex, for which there is no atan2: then, and where a number is infinite, the ratio is not told.
    """
    if base.has(sympy.atan2) or event.has(sympy.atan2):
        return False
    names = [*system.x, *system.p]
    values = sympy.lambdify(names, [base, event], "mpmath")
    p = [_PARAMETER * (j + 1) for j in range(len(system.p))]
    ratios = []
    for place in _PLACES:
        try:
            above, below = values(*(place + 0.37 * i for i in range(len(system.x))), *p)
            ratios.append(complex(above / below))
        except (ArithmeticError, ValueError):
            return False
    first, other = ratios
    return abs(first - other) > _ALIKE * max(abs(first), abs(other))
