"""How often a drive repeats while its phase turns once, by the harmonics of the phase in all formulas.

A formula is a Laurent polynomial in ``z = exp(i*phase)``, whose coefficients know no phase. Its harmonics are the
exponents. A function of a formula repeats as often as that. Parameters are symbols: a harmonic is absent only where
its coefficient is 0 whatever their values. What is no such polynomial repeats once.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

from saltus.system.expressions import parse
from saltus.system.once import once

if TYPE_CHECKING:
    from collections.abc import Iterator

    import sympy

    from saltus.system.definition import Definition

__all__ = ["drive_repeats"]

_LARGEST = 2000  # operations of a formula from which on its harmonics are not looked for


@once
def drive_repeats(system: Definition) -> int:
    """Return how many times the drive of a forced system repeats while its phase turns once; 1 without a phase.

    Every field, event, condition, reset, domain and output counts.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> drive_repeats(HybridSystem.smooth({"x": "v", "v": "-x - v + sin(s)**2"}, {"w": 1.0}, phase=("s", "w")))
    2
    """
    if system.phase is None:
        return 1
    import sympy

    name = system.phase[0]
    names = (*system.all_states, *system.parameters)
    known = _Harmonics(sympy.Symbol(name, real=True))
    found = 0
    for text in _texts(system):
        if name not in text:
            continue
        found = math.gcd(found, known.repeats(parse(text, names, "formula")))
        if found == 1:
            return 1
    return max(found, 1)


def _texts(system: Definition) -> Iterator[str]:
    """Go through all formulas of a system."""
    for mode in system.modes.values():
        yield from (str(rate) for rate in mode.field.values())
        yield from (str(part) for part in (mode.domain, mode.surface) if part is not None)
    for transition in system.transitions:
        yield str(transition.event)
        yield from (str(value) for value in (transition.reset or {}).values())
        if transition.when is not None:
            yield str(transition.when)
    for by_mode in system.outputs.values():
        yield from (str(text) for text in by_mode.values())
    yield str(system.phase[1]) if system.phase is not None else ""


class _VariesError(Exception):
    """A formula is no polynomial in the phase's exponential."""


class _Harmonics:
    """Formulas as Laurent polynomials in the exponential of a phase."""

    def __init__(self, phase: sympy.Symbol) -> None:
        import sympy

        self.phase, self.z = phase, sympy.Symbol("z", positive=True)
        self._parts: dict[Any, tuple[sympy.Symbol, int]] = {}

    def repeats(self, expression: sympy.Expr) -> int:
        """Return how often a formula repeats in a turn; 0 for one that does not know the phase."""
        if self.phase not in expression.free_symbols:
            return 0
        if expression.count_ops() > _LARGEST:
            return 1
        try:
            return self._common(self._polynomial(expression))
        except _VariesError:
            return 1

    def _common(self, polynomial: sympy.Expr) -> int:
        """Return the greatest common divisor of the harmonics of a polynomial."""
        import sympy

        known, found = dict(self._parts.values()), 0
        for term in sympy.Add.make_args(sympy.expand(polynomial)):
            found = math.gcd(found, int(term.as_coeff_exponent(self.z)[1]))
            for symbol in term.free_symbols & known.keys():
                found = math.gcd(found, known[symbol])
        return found

    def _polynomial(self, e: sympy.Expr) -> sympy.Expr:
        import sympy

        if self.phase not in e.free_symbols:
            return e
        if isinstance(e, sympy.Add | sympy.Mul):
            return sympy.expand(e.func(*(self._polynomial(part) for part in e.args)))
        if isinstance(e, sympy.Pow) and e.exp.is_Integer:
            power = sympy.expand(self._polynomial(e.base) ** abs(int(e.exp)))
            return power if e.exp > 0 else self._part(e, self._common(power))
        if isinstance(e, sympy.sin | sympy.cos):
            return self._wave(e)
        if isinstance(e, sympy.Abs):  # an even function repeats as the square does
            return self._part(e, self._common(self._polynomial(e.args[0] ** 2)))
        if e.is_Symbol:
            raise _VariesError
        common = 0
        for part in e.args:
            if self.phase in part.free_symbols:
                if not isinstance(part, sympy.Expr):
                    raise _VariesError
                common = math.gcd(common, self._common(self._polynomial(part)))
        return self._part(e, common)

    def _wave(self, e: sympy.Expr) -> sympy.Expr:
        """Return a sine or cosine of a multiple of the phase, and of what knows no phase."""
        import sympy

        angle = sympy.expand(e.args[0])
        count, rest = angle.coeff(self.phase), sympy.expand(angle - angle.coeff(self.phase) * self.phase)
        count = sympy.nsimplify(count)
        if not count.is_Integer or self.phase in rest.free_symbols:
            return self._part(e, self._common(self._polynomial(e.args[0])))
        wave = self.z**count
        cosine = (wave + 1 / wave) / 2
        sine = (wave - 1 / wave) / (2 * sympy.I)
        if isinstance(e, sympy.sin):
            return sympy.expand(sine * sympy.cos(rest) + cosine * sympy.sin(rest))
        return sympy.expand(cosine * sympy.cos(rest) - sine * sympy.sin(rest))

    def _part(self, e: sympy.Expr, count: int) -> sympy.Symbol:
        """Return a symbol for a part that repeats so often in a turn."""
        import sympy

        if e not in self._parts:
            self._parts[e] = sympy.Dummy(), count
        return self._parts[e][0]
