"""Fields that are linear but for a weak rest, which lanes follow by the exact flow of the linear part.

Where a mode's field is ``A x + forcing(theta) + g(x, theta)`` with a forcing of finitely many harmonics, the linear
part has an exact flow of any length: with the forcing's phasors as further states it is one matrix exponential. The
rest acts as kicks at the three nodes of Gauss's rule along the linear path: an error of sixth order in the step where g
varies slowly, and of second order in g. Where the mode's event functions are linear in the state too, their second
derivative has a bound. The bound tells how long a step may be that stays away from their surfaces. See
docs/theory/lanes.md.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import sympy

from saltus.system.expansion import can_be_expanded

if TYPE_CHECKING:
    from saltus.system.derivatives import Symbolic

__all__ = ["NODES", "WEIGHTS", "Split", "split_of_mode"]

NODES = (0.5 - 0.15**0.5, 0.5, 0.5 + 0.15**0.5)  # of Gauss's rule on [0, 1]
WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)  # of Gauss's rule on [0, 1]


@dataclass(frozen=True)
class Split:
    """A mode's field as a linear part and a rest."""

    # the linear flow's generator, square. It acts on the state without the phase, on cos(j theta) and sin(j theta) of
    # each harmonic, and on 1.
    matrix: list[list[sympy.Expr]]
    harmonics: list[int]  # the harmonics j
    # the part of a state's equation that is not linear; `symbols` has the symbols of the phasors
    rest: dict[int, sympy.Expr]
    symbols: list[sympy.Expr]  # the components that the generator acts on
    events: list[list[sympy.Expr]]  # each event function of the mode as a row against `symbols`

    @property
    def n(self) -> int:
        """Count of the states without the phase."""
        return len(self.symbols) - 1 - 2 * len(self.harmonics)

    def layout(self) -> dict[str, Any]:
        """Return what the generated module of linear parts says of this one, as plain data."""
        return {
            "size": len(self.symbols),
            "states": self.n,
            "events": len(self.events),
            "rest": sorted(self.rest),
        }


def split_of_mode(system: Symbolic, mode: int) -> Split | None:
    """Return the linear part and the rest of a mode's field, or None where it has no such form.

    Examples
    --------
    >>> from saltus.system.derivatives import Symbolic
    >>> from saltus.system.hybrid import HybridSystem, Mode
    >>> field = {"z": "v", "v": "1 - z - 1/z**2 + cos(s)"}
    >>> tip = HybridSystem(("z", "v"), {"w": 1.0}, {"far": Mode(field)}, phase=("s", "w"))
    >>> found = split_of_mode(Symbolic(tip), 0)
    >>> found.matrix[1], found.rest
    ([-1, 0, 1, 0, 1], {1: -1/z**2})
    """
    theta = system.x[-1] if system.system.phase is not None else None
    states = system.x[:-1] if theta is not None else list(system.x)
    parts = _Parts(states, theta, set(system.p))
    rows = [parts.of(expression) for expression in system.field[mode][: len(states)]]
    events = [parts.of(system.event[k]) for k, source in enumerate(system.source) if source == mode]
    if any(row is None for row in (*rows, *events)) or any(row is not None and row[1] != 0 for row in events):
        return None
    symbols = parts.symbols()
    size, n = len(symbols), len(states)
    matrix = [[sympy.Integer(0)] * size for _ in symbols]
    rest = {}
    for e, row in enumerate(rows):
        assert row is not None
        matrix[e] = [row[0].get(symbol, sympy.Integer(0)) for symbol in symbols]
        if row[1] != 0:
            rest[e] = row[1]
    rate = system.field[mode][-1] if theta is not None else sympy.Integer(0)
    for i, j in enumerate(parts.harmonics):
        cosine, sine = n + 2 * i, n + 2 * i + 1
        matrix[cosine][sine], matrix[sine][cosine] = -j * rate, j * rate
    if not any(matrix[e][f] != 0 for e in range(n) for f in range(n)):
        return None
    if any(not term.free_symbols & set(states) for g in rest.values() for term in sympy.Add.make_args(g)):
        return None  # a pulse of the phase could hide between the nodes
    lines = [[row[0].get(symbol, sympy.Integer(0)) for symbol in symbols] for row in events if row is not None]
    return Split(matrix, parts.harmonics, rest, symbols, lines)


class _Parts:
    """Takes expressions apart into terms that are linear in the states and the phasors, and the rest."""

    def __init__(self, states: list[sympy.Symbol], theta: sympy.Symbol | None, parameters: set[sympy.Symbol]) -> None:
        self.states, self.theta, self.parameters = states, theta, parameters
        self.phasors: dict[int, tuple[sympy.Symbol, sympy.Symbol]] = {}

    @property
    def harmonics(self) -> list[int]:
        return sorted(self.phasors)

    def symbols(self) -> list[sympy.Expr]:
        pairs = [symbol for j in self.harmonics for symbol in self.phasors[j]]
        return [*self.states, *pairs, sympy.Integer(1)]

    def of(self, expression: sympy.Expr) -> tuple[dict[sympy.Expr, sympy.Expr], sympy.Expr] | None:
        """Coefficients of the linear terms, and the rest; None where the phase occurs in another way than as sines."""
        if self.theta is not None:
            expression = expression.replace(sympy.sin, lambda a: self._turning(a, sympy.sin))
            expression = expression.replace(sympy.cos, lambda a: self._turning(a, sympy.cos))
            if expression.has(self.theta):
                return None
        linear: dict[sympy.Expr, sympy.Expr] = {}
        rest = sympy.Integer(0)
        varying = {*self.states, *(symbol for pair in self.phasors.values() for symbol in pair)}
        terms = [
            sympy.expand_mul(term, deep=False) if can_be_expanded(term) else term
            for term in sympy.Add.make_args(expression)
        ]
        for term in (part for total in terms for part in sympy.Add.make_args(total)):
            found = term.free_symbols & varying
            if not found:
                linear[sympy.Integer(1)] = linear.get(sympy.Integer(1), sympy.Integer(0)) + term
                continue
            (symbol, *others) = found
            coefficient = sympy.cancel(term / symbol) if not others and can_be_expanded(term) else term
            if others or coefficient.free_symbols & varying:
                rest += term
            else:
                linear[symbol] = linear.get(symbol, sympy.Integer(0)) + coefficient
        return linear, rest

    def _symbol(self, name: str) -> sympy.Symbol:
        symbol = sympy.Symbol(name, real=True)
        return sympy.Dummy(name, real=True) if symbol in {*self.states, *self.parameters} else symbol

    def _turning(self, argument: sympy.Expr, function: Callable[..., sympy.Expr]) -> sympy.Expr:
        turns = sympy.diff(argument, self.theta)
        if not (turns.is_Integer and turns != 0 and argument.free_symbols <= self.parameters | {self.theta}):
            return function(argument)
        j = abs(int(turns))
        if j not in self.phasors:
            self.phasors[j] = (self._symbol(f"cos_{j}_theta"), self._symbol(f"sin_{j}_theta"))
        cosine, sine = self.phasors[j]
        sine = sine if turns > 0 else -sine
        offset = argument.subs(self.theta, 0)
        if function is sympy.sin:
            return sine * sympy.cos(offset) + cosine * sympy.sin(offset)
        return cosine * sympy.cos(offset) - sine * sympy.sin(offset)
