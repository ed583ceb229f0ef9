"""All derivatives of a definition, symbolically."""

from __future__ import annotations

import html
from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import sympy

from saltus.errors import DefinitionError
from saltus.system.expressions import parse
from saltus.system.powers import opened, slope_of

if TYPE_CHECKING:
    from saltus.system.definition import Definition

__all__ = ["Symbolic"]

_ANGLES = (0.3, 1.7, 4.1)  # phases, in radians, at which a formula is compared with itself one turn later


class Symbolic:
    """A definition parsed and differentiated.

    Every list is indexed by mode or transition in the order of definition; the modes of a map are its pieces. `rate` is
    the Lie derivative of an event function along the field of its source mode. `conditions` has those of each piece.
    """

    def __init__(self, system: Definition) -> None:
        self.system = system
        names = (*system.all_states, *system.parameters)
        self.x = [sympy.Symbol(name, real=True) for name in system.all_states]
        self.p = [sympy.Symbol(name, real=True) for name in system.parameters]
        phase_rate = [] if system.phase is None else [self._read(system.phase[1], tuple(system.parameters), "phase")]
        self.field = []
        self.domain = []
        self.surface: list[sympy.Expr | None] = []
        for key, mode in system.modes.items():
            where = f"{system.part} {key!r}"
            self.field.append([self._read(mode.field[name], names, where) for name in system.states] + phase_rate)
            self.domain.append(sympy.Integer(1) if mode.domain is None else self._read(mode.domain, names, where))
            surface = mode.surface
            self.surface.append(None if surface is None else self._read(surface, names, where))
        self.event, self.reset, self.when = [], [], []
        for transition in system.transitions:
            where = f"transition {transition.name!r}"
            self.event.append(self._read(transition.event, names, where))
            new = {name: self._read(value, names, where) for name, value in transition.reset.items()}
            self.reset.append([new.get(symbol.name, symbol) for symbol in self.x])
            when = transition.when
            self.when.append(sympy.Integer(1) if when is None else self._read(when, names, where))
            if not self.event[-1].free_symbols & set(self.x):
                raise DefinitionError(where, transition.event, "an event function of the state")
        self.outputs = [
            [self._read(by_mode[mode], names, f"output {key!r}") for key, by_mode in system.outputs.items()]
            for mode in system.modes
        ]
        self.source = [system.mode_names.index(t.source) for t in system.transitions]
        self.conditions = [
            [self._read(text, names, f"{system.part} {key!r}") for text in texts]
            for key, texts in system.conditions.items()
        ]

    def _read(self, text: str, names: tuple[str, ...], where: str) -> sympy.Expr:
        expression = parse(text, names, where)
        phase = self.system.phase
        if phase is not None and expression.has(theta := sympy.Symbol(phase[0], real=True)):
            jump = expression - expression.subs(theta, theta + 2 * sympy.pi)
            varying = expression - expression.subs(theta, 0)
            if jump != 0 and any(
                abs(_sampled(jump, theta, angle)) > 1e-9 * abs(_sampled(varying, theta, angle)) for angle in _ANGLES
            ):
                wanted = f"of period 2 pi in {theta}"
                hint = f"{theta} is an angle, as in cos({theta}); a time that does not repeat is a state t with t' = 1"
                raise DefinitionError(where, text, wanted, hint)
        return expression

    def jumps(self, mode: int) -> list[sympy.Expr]:
        """Return expressions at whose zeros the field of a mode may jump: arguments of signs, moduli and angles."""
        arguments = {
            call.args[0]
            for rate in self.field[mode]
            for call in rate.atoms(sympy.sign, sympy.Abs, sympy.atan2)
            if call.args[0].free_symbols & set(self.x)
        }
        return sorted(arguments, key=str)

    @cached_property
    def rate(self) -> list[sympy.Expr]:
        """Lie derivative of each event function along its source's field."""
        return [
            sum(opened(_smooth_diff(h, symbol)) * f for symbol, f in zip(self.x, self.field[mode], strict=True))
            for h, mode in zip(self.event, self.source, strict=True)
        ]

    def jacobian(self, expressions: list[sympy.Expr]) -> list[list[sympy.Expr]]:
        """Derivatives of expressions with respect to the full state, shape (expression, state)."""
        return self.gradients(expressions, self.x)

    def gradients(self, expressions: list[sympy.Expr], variables: list[sympy.Symbol]) -> list[list[sympy.Expr]]:
        """Derivatives of expressions with respect to some variables, shape (expression, variable)."""
        places = {symbol: i for i, symbol in enumerate(variables)}
        rows = []
        for expression in expressions:
            row = [sympy.S.Zero] * len(variables)
            for symbol in sorted(_symbols_and_corners(expression)[0] & places.keys(), key=places.__getitem__):
                row[places[symbol]] = _smooth_diff(expression, symbol)
            rows.append(row)
        return rows

    def along(self, expressions: list[sympy.Expr], parameter: int) -> list[sympy.Expr]:
        """Derivatives of expressions with respect to one parameter."""
        return [_smooth_diff(expression, self.p[parameter]) for expression in expressions]

    def as_html(self, title: str) -> str:
        """Equations as HTML with TeX, for a notebook; names and equations are escaped: a file may bring any."""
        escape, latex = html.escape, sympy.latex
        rows = [f"<b>{escape(title)}</b>"]
        holds = [[domain] if domain != 1 else [] for domain in self.domain]
        form = r"\dot{{{}}} &= {}"
        if self.conditions:
            holds, form = self.conditions, r"{} &\mapsto {}"
        for key, field, positive in zip(self.system.modes, self.field, holds, strict=True):
            lines = [form.format(latex(s), latex(f)) for s, f in zip(self.x, field, strict=True)]
            where = escape(f", where {', '.join(f'${latex(c)} > 0$' for c in positive)}") if positive else ""
            body = r" \\ ".join(lines)
            equations = escape(f"$$\\begin{{aligned}}{body}\\end{{aligned}}$$")
            rows.append(f"{self.system.part} <code>{escape(key)}</code>{where}: {equations}")
        for t, event, reset in zip(self.system.transitions, self.event, self.reset, strict=True):
            jumps = [rf"{latex(s)} \mapsto {latex(g)}" for s, g in zip(self.x, reset, strict=True) if g != s]
            arrow = {-1: r"\downarrow 0", 0: "= 0", 1: r"\uparrow 0"}[t.direction]
            where = escape(f"${latex(event)} {arrow}$" + (f", ${', '.join(jumps)}$" if jumps else ""))
            rows.append(f"<code>{escape(t.name)}</code>: {escape(t.source)} &rarr; {escape(t.target)} at {where}")
        return "<br>".join(rows)


@lru_cache(maxsize=512)
def _symbols_and_corners(expression: sympy.Expr) -> tuple[frozenset[sympy.Symbol], frozenset[sympy.Expr]]:
    """Return an expression's symbols, and its moduli and signs of what SymPy does not know to be real."""
    corners = {a for a in expression.atoms(sympy.Abs, sympy.sign) if not a.args[0].is_extended_real}
    return frozenset(expression.free_symbols), frozenset(corners)


def _smooth_diff(expression: sympy.Expr, symbol: sympy.Symbol) -> sympy.Expr:
    """Derivative without the terms at jumps of signs."""
    symbols, corners = _symbols_and_corners(expression)
    if symbol not in symbols:
        return sympy.S.Zero
    if not corners:
        derivative = slope_of(expression, symbol)
        if derivative.has(sympy.Heaviside) and expression.has(sympy.Max, sympy.Min):
            derivative = derivative.replace(sympy.Heaviside, lambda x, *_: (1 + sympy.sign(x)) / 2)
        if derivative.has(sympy.DiracDelta) and expression.has(sympy.sign):
            return derivative.replace(sympy.DiracDelta, lambda *args: sympy.Integer(0))
        return derivative
    # SymPy takes abs(log(x)) for that of a complex number, since x may be negative
    stands_for = {corner: sympy.Dummy(real=True) for corner in corners}
    smooth = expression.xreplace(stands_for)
    terms = [_smooth_diff(smooth, symbol)]
    for corner, dummy in stands_for.items():
        if corner.func is sympy.Abs and smooth.has(dummy):
            inner = corner.args[0]
            terms.append(_smooth_diff(smooth, dummy) * sympy.sign(inner) * _smooth_diff(inner, symbol))
    return sympy.Add(*terms).xreplace({dummy: corner for corner, dummy in stands_for.items()})


def _sampled(expression: sympy.Expr, theta: sympy.Symbol, angle: float) -> complex:
    others = sorted(expression.free_symbols - {theta}, key=str)
    values = {symbol: sympy.Float(0.37 + 0.11 * i) for i, symbol in enumerate(others)}
    return complex(expression.subs({theta: angle, **values}).evalf())
