"""Writer of the values and gradients of expressions along a motion, and of formulas in what is made of them."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import sympy

from saltus.system.expressions import parse
from saltus.system.writing.printer import is_broken
from saltus.system.writing.writer import Writer

if TYPE_CHECKING:
    from collections.abc import Iterator

    from saltus.system.derivatives import Symbolic

__all__ = ["GradientWriter"]


class GradientWriter(Writer):
    """Texts of expressions with their gradients.

    Parameters
    ----------
    system : Symbolic
        The definition.
    expressions : tuple of str
        Expressions in states, phase, parameters and outputs.
    formulas : tuple of (str, tuple of str)
        Formulas in parameters and further names, with these names.
    """

    def __init__(
        self, system: Symbolic, expressions: tuple[str, ...], formulas: tuple[tuple[str, tuple[str, ...]], ...]
    ) -> None:
        super().__init__(system)
        self._expressions, self._formulas = expressions, formulas

    def functions(self) -> Iterator[str]:
        """Texts of the values, behind them the gradients row by row and what vanishes where they have corners."""
        definition = self.system.system
        named = [sympy.Symbol(name, real=True) for name in definition.output_names]
        names = (*definition.all_states, *definition.parameters, *definition.output_names)
        written = [parse(text, names, "expression") for text in self._expressions]
        variables, branches, cornered = [*self.system.x, *self.system.p], {}, False
        for k, outputs in enumerate(self.system.outputs):
            known = dict(zip(named, outputs, strict=True))
            here = [expression.xreplace(known) for expression in written]
            slopes = [slope for row in self.system.gradients(here, variables) for slope in row]
            corners = [sympy.Mul(*self._corners(expression)) for expression in here]
            cornered = cornered or any(corner != 1 for corner in corners)
            branches[k] = self._assign([*here, *slopes, *corners])
        self.numbers["CORNERED"] = cornered
        yield self._function("readings", branches)
        branches = {}
        for k, (text, further) in enumerate(self._formulas):
            behind = [sympy.Symbol(name, real=True) for name in further]
            self._names |= {symbol: f"x[{i}]" for i, symbol in enumerate(behind)}
            formula = [parse(text, (*further, *definition.parameters), "observable")]
            (slopes,) = self.system.gradients(formula, [*behind, *self.system.p])
            branches[k] = self._assign([*formula, *slopes])
        yield self._function("formulas", branches)

    def _corners(self, expression: sympy.Expr) -> list[sympy.Expr]:
        """What vanishes where an expression has a corner or jumps: arguments of moduli, signs, angles, low powers."""
        found = {call.args[0] for call in expression.atoms(sympy.Abs, sympy.sign, sympy.atan2)}
        found |= {power.base for power in expression.atoms(sympy.Pow) if is_broken(power.exp) and abs(power.exp) < 2}
        for choice in expression.atoms(sympy.Max, sympy.Min):
            found |= {one - other for one, other in itertools.combinations(choice.args, 2)}
        return sorted((one for one in found if one.free_symbols & set(self.system.x)), key=str)
