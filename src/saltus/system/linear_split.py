"""Fields that are linear but for a weak rest: steps by the exact flow of the linear part, the rest as kicks.

Where a mode's field is ``A x + forcing(theta) + g(x, theta)`` with a forcing of finitely many harmonics, the linear
part has an exact flow of any length: with the forcing's phasors as further states it is one matrix exponential. The
rest acts as kicks at the three nodes of Gauss's rule along the linear path: an error of sixth order in the step where
g varies slowly, and of second order in g. Where the mode's event functions are linear in the state too, a bound on
their second derivative tells how far a step can go and stay away from them.
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

NODES = (0.5 - 0.15**0.5, 0.5, 0.5 + 0.15**0.5)
WEIGHTS = (5.0 / 18.0, 8.0 / 18.0, 5.0 / 18.0)
"""Gauss's rule with three nodes on [0, 1]."""

RUNGS = 24
RUNGS_AN_OCTAVE = 4
"""Lengths of a step for which the flow is tabulated, and how many of them double it."""

_KEPT = 0.3
"""Part of an event function's value that is left at the end of a step, at the least."""

_QUADRATURE, _FIRST = 0.0034, 0.375
"""Error of Gauss's rule for 1/(1 - r s)^2 on [-1, 1] over the third power of its relative second difference at the
nodes, 3.6 r^2; and what makes the square of the first difference the same."""

_ATTEMPTS = 3


@dataclass(frozen=True)
class Split:
    """A mode's field as a linear part and a rest.

    Attributes
    ----------
    matrix : list of list of sympy.Expr
        The linear flow's generator, square, of the state without the phase, then cos(j theta) and sin(j theta) of each
        harmonic, then 1.
    harmonics : list of int
        The harmonics j.
    rest : dict of int to sympy.Expr
        What is not linear in the equation of a state, with phasors as the symbols of `symbols`.
    symbols : list of sympy.Symbol
        What the generator acts on.
    events : list of list of sympy.Expr
        Each event function of the mode as a row against `symbols`.
    """

    matrix: list[list[sympy.Expr]]
    harmonics: list[int]
    rest: dict[int, sympy.Expr]
    symbols: list[sympy.Expr]
    events: list[list[sympy.Expr]]

    @property
    def n(self) -> int:
        """Count of the states without the phase."""
        return len(self.symbols) - 1 - 2 * len(self.harmonics)

    @property
    def entries(self) -> list[tuple[int, int]]:
        """Entries of the linear flow's matrix that are not zero or one for any parameters: (row, column)."""
        size, n = len(self.symbols), self.n
        reach = [{f for f in range(size) if self.matrix[e][f] != 0 or e == f} for e in range(size)]
        for _ in range(size):
            reach = [set().union(*(reach[f] for f in found)) for found in reach]
        return [(e, f) for e in range(size - 1) for f in sorted(reach[e]) if e < n or f >= n]

    @property
    def kicks(self) -> list[tuple[int, int]]:
        """Entries of that matrix through which the rest acts: (state, state whose equation it is in)."""
        return [(e, f) for e, f in self.entries if e < self.n and f in self.rest]

    @property
    def table_size(self) -> int:
        """Count of the numbers that `lines` reads: see `saltus.flow.far.tables`."""
        return 2 + 3 * len(self.symbols) * len(self.events) + RUNGS * self.rung_size

    @property
    def rung_size(self) -> int:
        """Count of the numbers for one length of a step."""
        return 1 + 4 * len(self.entries) + 3 * len(self.kicks)

    def layout(self) -> dict[str, Any]:
        """Return the sizes that `saltus.flow.far.tables` needs, as plain data."""
        return {
            "size": len(self.symbols),
            "states": self.n,
            "events": len(self.events),
            "entries": self.entries,
            "kicks": self.kicks,
            "table_size": self.table_size,
        }

    def lines(self, base: str, text: Callable[[sympy.Expr], str]) -> list[str]:
        """Return the statements of one step, from ``x`` = [states, phase, rtol, atol] to ``out`` = [length, states].

        Where no step is possible, the length is 0 and behind it stands the shortest. `base` is the place of the tables
        in ``p``, `text` writes an expression in parameters alone.
        """
        return _StepText(self, base, text).lines()


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


class _StepText:
    """Statements of one step by the exact flow."""

    def __init__(self, split: Split, base: str, text: Callable[[sympy.Expr], str]) -> None:
        self.split, self.base, self.text = split, base, text
        self.size = len(split.symbols)
        self.expressions = list(dict.fromkeys(split.rest.values()))
        self.source = {f: self.expressions.index(g) for f, g in split.rest.items()}
        needed = set().union(*(g.free_symbols for g in self.expressions)) if self.expressions else set()
        self.needed = [e for e, symbol in enumerate(split.symbols) if symbol in needed]
        self.moved = [e for e in self.needed if e < split.n]

    def lines(self) -> list[str]:
        s, n = self.split, self.split.n
        lines = [f"z{e} = x[{e}]" for e in range(n)]
        for i, j in enumerate(s.harmonics):
            angle = f"{float(j)!r}*x[{n}]"
            lines += [f"z{n + 2 * i} = math.cos({angle})", f"z{n + 2 * i + 1} = math.sin({angle})"]
        lines += [f"z{self.size - 1} = 1.0", "out[0] = 0.0", f"out[1] = p[{self.base}]", f"h = p[{self.base} + 1]"]
        lines += self.rest("z", "a")
        for i in range(len(s.events)):
            lines += self.reach(i)
        shortest = f"p[{self.base}]"
        lines += [
            f"if not h >= {shortest}:",
            "    return",
            f"r = min(int({float(RUNGS_AN_OCTAVE)!r}*math.log2(h/{shortest}) + 1e-9), {RUNGS - 1})",
            f"for attempt in range({_ATTEMPTS}):",
            *(f"    {line}" for line in self.attempt()),
        ]
        return lines

    def reach(self, i: int) -> list[str]:
        """How far an event function keeps a part of its value: from its value, rate and a bound on its curvature."""
        rows = [f"{self.base} + {2 + (3 * i + r) * self.size}" for r in range(3)]
        each = range(self.size)
        kicked = [f"p[{rows[0]} + {f}]*ag{g}" for f, g in self.source.items()]
        pushed = [f"2.0*abs(p[{rows[1]} + {f}]*ag{g})" for f, g in self.source.items()]
        bent = [f"p[{rows[2]} + {e}]*abs(z{e})" for e in each]
        return [
            f"b = {_sum([f'p[{rows[0]} + {e}]*z{e}' for e in each])}",
            f"d = {_sum([*(f'p[{rows[1]} + {e}]*z{e}' for e in each), *kicked])}",
            f"c = {_sum([*bent, *pushed])} + 1e-300",
            "if b < 0.0:",
            "    b = -b",
            "    d = -d",
            f"h = min(h, (d + math.sqrt(d*d + {2.0 * (1.0 - _KEPT)!r}*c*b))/c)",
        ]

    def rest(self, state: str, prefix: str) -> list[str]:
        """The rest at a state whose components are ``{state}{e}``; it is ``{prefix}g0``, ..."""
        names = {symbol: sympy.Symbol(f"{state}{e}") for e, symbol in enumerate(self.split.symbols[:-1])}
        found = [g.xreplace(names) for g in self.expressions]
        shared, results = sympy.cse(found, symbols=sympy.numbered_symbols(f"{prefix}u"))
        values = [*shared, *((f"{prefix}g{i}", value) for i, value in enumerate(results))]
        return [f"{name} = {self.text(value)}" for name, value in values]

    def attempt(self) -> list[str]:
        s, n = self.split, self.split.n
        entries, kicks = s.entries, s.kicks
        lines = [
            "if r < 0:",
            "    return",
            f"t = {self.base} + {2 + 3 * self.size * len(s.events)} + r*{s.rung_size}",
            "h = p[t]",
        ]
        for node in range(4):
            for e in range(self.size - 1) if node < 3 else range(n):
                if node < 3 and e not in self.needed:
                    continue
                terms = [f"p[t + {1 + node * len(entries) + i}]*z{f}" for i, (row, f) in enumerate(entries) if row == e]
                lines.append(f"n{node}x{e} = {_sum(terms)}")
            if node < 3:
                lines += self.rest(f"n{node}x", f"n{node}")
        start = 1 + 4 * len(entries)
        for e in range(n):
            for node in range(3):
                terms = [
                    f"p[t + {start + node * len(kicks) + i}]*n{node}g{self.source[f]}"
                    for i, (row, f) in enumerate(kicks)
                    if row == e
                ]
                lines += [f"n{node}k{e} = {_sum(terms)}"] if terms else []
        kicked = sorted({e for e, _ in kicks})
        lines += [f"k{e} = n0k{e} + n1k{e} + n2k{e}" for e in kicked]
        done = [
            "out[0] = h",
            *(f"out[{1 + e}] = n3x{e}" + (f" + k{e}" if e in kicked else "") for e in range(n)),
            "return",
        ]
        if not self.expressions:
            return lines + done
        moves = [_sum([f"abs(n{a}x{e} - n{b}x{e})" for e in self.moved]) or "1.0" for a, b in ((1, 0), (2, 1))]
        lines += [
            f"left = 1.0/({moves[0]} + 1e-30)",
            f"right = 1.0/({moves[1]} + 1e-30)",
            f"moved = {_sum([f'abs(k{e})' for e in self.moved if e in kicked]) or '0.0'}",
            "slope = 0.0",
            "error = 0.0",
        ]
        for i in range(len(self.expressions)):
            a, b, c = (f"n{node}g{i}" for node in range(3))
            lines.append(f"slope = max(slope, max(abs({b} - {a})*left, abs({c} - {b})*right))")
        for e in kicked:
            a, b, c = (f"{1.0 / weight!r}*n{node}k{e}" for node, weight in enumerate(WEIGHTS))
            second = " + slope*moved*h" if e in s.rest else ""
            lines += [
                f"a, b, c = {a}, {b}, {c}",
                "d = max(abs(a), max(abs(b), abs(c))) + 1e-300",
                f"q = max(abs(a - 2.0*b + c), {_FIRST!r}*(c - a)*(c - a)/d)/d",
                f"error = max(error, ({_QUADRATURE!r}*d*q*q*q{second})/(x[{n + 2}] + x[{n + 1}]*abs(z{e})))",
            ]
        lines += [
            "if error <= 1.0:",
            *(f"    {line}" for line in done),
            f"r -= {RUNGS_AN_OCTAVE}",
        ]
        return lines


def _sum(terms: list[str]) -> str:
    return " + ".join(terms)
