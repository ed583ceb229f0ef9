"""Writers of the functions that a flow needs: fields, events, resets, outputs, with first and second derivatives."""

from __future__ import annotations

import itertools
from typing import TYPE_CHECKING

import sympy

from saltus.system.faces import groups_of, kinds_of
from saltus.system.writing.exponents import beyond, exponents_in, kinks_in
from saltus.system.writing.printer import is_broken, without_poles
from saltus.system.writing.regularise import multiple_of
from saltus.system.writing.roots import roots_of
from saltus.system.writing.rounding import LEAST, rounding_lines
from saltus.system.writing.writer import Writer, zeros

if TYPE_CHECKING:
    from collections.abc import Iterator, Sequence

    from saltus.system.derivatives import Symbolic
    from saltus.system.writing.exponents import Exponent

__all__ = ["FlowWriter", "SecondWriter", "ThirdWriter"]


# states up to which the rows of Jacobian times columns are written out: the code of many takes long to compile, and
# meets each column's entries far apart in memory
_WRITTEN_OUT = 16


class FlowWriter(Writer):
    """Texts of fields, events, resets and outputs, and of their first derivatives."""

    def functions(self) -> Iterator[str]:
        """Texts of the module's functions."""
        s = self.system
        modes, transitions = range(len(s.field)), range(len(s.event))
        powers = [self._vanishing_powers(s.field[k]) for k in modes]
        self.numbers["ROOTED"] = tuple(bool(found) for found in powers)
        self.numbers["LIMITS"] = tuple(any(2 * power == 1 for power in found) for found in powers)
        self.numbers["JUMPS"] = tuple(bool(s.jumps(k)) for k in modes)
        self.numbers["TOO_STEEP"] = tuple(_too_steep(found) for found in powers)
        self.numbers["NUMBERS"] = self._sizes_of_numbers()
        self.numbers["KINDS"], self.numbers["GROUPS"] = kinds_of(s), groups_of(s)
        yield self._function("field", {k: self._assign(s.field[k]) for k in modes})
        yield self._function("vary", {k: self._vary(s.field[k]) for k in modes})
        yield self._by_parameter("field_p", {k: s.field[k] for k in modes})
        event = {k: [s.event[k], s.rate[k]] for k in transitions}
        yield self._function("event", {k: self._assign(event[k]) for k in transitions})
        gradient = {k: [*event[k], *(e for row in s.jacobian(event[k]) for e in row)] for k in transitions}
        yield self._function("event_x", {k: self._assign(gradient[k]) for k in transitions})
        yield self._by_parameter("event_p", event)
        yield self._function("reset", {k: self._assign(s.reset[k]) for k in transitions})
        jacobian = {k: [e for row in s.jacobian(s.reset[k]) for e in row] for k in transitions}
        yield self._function("reset_x", {k: self._assign(jacobian[k]) for k in transitions})
        yield self._by_parameter("reset_p", {k: s.reset[k] for k in transitions})
        yield self._function("outputs", {k: self._assign(s.outputs[k]) for k in modes})
        guards = [*s.domain, *s.when, *(condition for part in s.conditions for condition in part)]
        texts = [self._assign([guard]) for guard in guards]
        felt = {k: self._felt(k) for k in modes}
        met = [*felt.values(), *([*s.reset[k], s.when[k]] for k in transitions)]
        self.numbers["UNDER_ROOTS"] = any(roots_of(s, part) for part in met)
        texts += [self._roots(part, widened=widened) for widened in (False, True) for part in met]
        yield self._function("guard", dict(enumerate(texts)))
        phase = s.x[-1] if s.system.phase is not None else None
        exponents = {k: exponents_in(found, self._parameters, phase) for k, found in felt.items()}
        kinks = {k: kinks_in(found, self._parameters) for k, found in felt.items()}
        self.numbers["EXPONENTS"] = any(exponents.values()) or any(kinks.values())
        yield self._function("ways", {k: self._ways(exponents[k], kinks[k]) for k in modes})
        yield self._function("rounding", {k: self._rounding(s.event[k]) for k in transitions})

    def _rounding(self, event: sympy.Expr) -> list[str]:
        """Text of the rounding of an event function, in roundings of 1; behind the states in x are their errors."""
        errors = {symbol: f"x[{self.n + i}]" for i, symbol in enumerate(self.system.x)}
        lines, _, rounding = rounding_lines(self._hoist(event), self._text, errors)
        return [*lines, f"out[0] = {rounding or '0.0'}"]

    def _roots(self, expressions: Sequence[sympy.Expr], *, widened: bool) -> list[str]:
        """Text of the least argument of a root, 1 at the most; widened by the errors behind the states in x."""
        lines = ["out[0] = 1.0"]
        errors = {symbol: f"x[{self.n + i}]" for i, symbol in enumerate(self.system.x)} if widened else {}
        for root in roots_of(self.system, expressions):
            value = self._text(base := self._hoist(root.base))
            if widened:
                body, value, rounding = rounding_lines(base, self._text, errors)
                lines += body
                value = f"({value} + {LEAST}*({rounding or '0.0'}))"
            if not root.exponent.is_number:
                exponent = f"({self._text(self._hoist(root.exponent))})"
                value = f"(1.0 if {exponent} == math.floor({exponent}) else {value})"
            lines.append(f"out[0] = min(out[0], {value})")
        return lines

    def _sizes_of_numbers(self) -> tuple[float, float]:
        """The largest and the least size of the numbers in fields and resets."""
        formulas = [formula for part in (*self.system.field, *self.system.reset) for formula in part]
        sizes = [abs(float(number)) for formula in formulas for number in formula.atoms(sympy.Number) if number != 0]
        return max(sizes, default=1.0), min(sizes, default=1.0)

    def _felt(self, mode: int) -> list[sympy.Expr]:
        """What a mode's motion feels: its field and event functions."""
        s = self.system
        return [*s.field[mode], *(s.event[k] for k, source in enumerate(s.source) if source == mode)]

    def _ways(self, exponents: list[Exponent], kinks: list[sympy.Expr]) -> list[str]:
        """Text of how far exponents go between three states, one behind the other in x, and kinks go unseen."""
        names, lines = self._names, ["out[0] = 0.0"]
        values = [self._hoist(value) for value in (*(exponent.value for exponent in exponents), *kinks)]
        for place, at in enumerate("abc"):
            self._names = names | {symbol: f"x[{place * self.n + i}]" for i, symbol in enumerate(self.system.x)}
            lines += [f"{at}{i} = {self._text(value)}" for i, value in enumerate(values)]
        self._names = names
        found = [e.way(*pair) for i, e in enumerate(exponents) for pair in ((f"a{i}", f"b{i}"), (f"b{i}", f"c{i}"))]
        found += [exponent.woken(f"a{i}", f"b{i}", f"c{i}") for i, exponent in enumerate(exponents)]
        found += [beyond(f"a{i}", f"b{i}", f"c{i}") for i in range(len(exponents), len(values))]
        return lines + [f"out[0] = max(out[0], {text})" for text in found]

    def _by_parameter(self, name: str, expressions: dict[int, list[sympy.Expr]]) -> str:
        branches = {}
        for k, group in expressions.items():
            lines = zeros(len(group))
            first, rooted = True, bool(self._vanishing_powers(group))
            for j in range(len(self.system.p)):
                derivatives = self.system.along(group, j)
                if rooted:
                    derivatives = [without_poles(d) for d in derivatives]
                if all(d == 0 for d in derivatives):
                    continue
                lines.append(f"{'if' if first else 'elif'} m == {j}:")
                lines += [f"    {line}" for line in self._assign(derivatives, keep_zero=False)]
                first = False
            branches[k] = lines
        return self._function(name, branches)

    def _vanishing_powers(self, field: list[sympy.Expr]) -> list[sympy.Expr]:
        """Broken powers below 1 of what vanishes on a surface, where they make the first derivatives infinite."""
        powers = {
            (power.base, power.exp)
            for expression in field
            for power in expression.atoms(sympy.Pow)
            if is_broken(power.exp) and power.exp < 1
        }
        return sorted(
            {
                exponent
                for base, exponent in powers
                if any(multiple_of(self.system, base, event) is not None for event in self.system.event)
            }
        )

    def _vary(self, field: list[sympy.Expr]) -> list[str]:
        n, jacobian = self.n, self.system.jacobian(field)
        if self._vanishing_powers(field):  # elsewhere an infinite derivative is told as one
            jacobian = [[without_poles(entry) for entry in row] for row in jacobian]
        entries = [(i, j) for i in range(n) for j in range(n) if jacobian[i][j] != 0]
        lines = self._assign(field, [jacobian[i][j] for i, j in entries], name="j")
        if n > _WRITTEN_OUT:
            return lines + self._product(entries)
        lines.append("for c in range(m):")
        for i in range(n):
            terms = [f"j{e} * x[{n} + {j} * m + c]" for e, (row, j) in enumerate(entries) if row == i]
            lines.append(f"    out[{n} + {i} * m + c] = {' + '.join(terms) if terms else '0.0'}")
        return lines

    def _product(self, entries: list[tuple[int, int]]) -> list[str]:
        """Product of a sparse matrix, whose entries are j0, j1, ... row by row, with the columns behind the state."""
        n = self.n
        ends = itertools.accumulate((sum(1 for row, _ in entries if row == i) for i in range(n)), initial=0)
        return [
            f"values = ({' '.join(f'j{e},' for e in range(len(entries)))})",
            f"columns = ({' '.join(f'{j},' for _, j in entries)})",
            f"ends = ({' '.join(f'{end},' for end in ends)})",
            f"for i in range({n}):",
            "    for c in range(m):",
            f"        out[{n} + i * m + c] = 0.0",
            "    for e in range(ends[i], ends[i + 1]):",
            "        for c in range(m):",
            f"            out[{n} + i * m + c] = out[{n} + i * m + c] + values[e] * x[{n} + columns[e] * m + c]",
        ]


class SecondWriter(Writer):
    """Texts of the second derivatives in the state and in some parameters, once along a direction."""

    def __init__(self, system: Symbolic, active: tuple[int, ...]) -> None:
        super().__init__(system)
        self._variables = [*system.x, *(system.p[j] for j in active)]
        self._direction = [sympy.Dummy() for _ in self._variables]
        self._names |= {symbol: f"x[{self.n + i}]" for i, symbol in enumerate(self._direction)}

    def functions(self) -> Iterator[str]:
        """Texts of the second derivatives along the direction."""
        s = self.system
        modes, transitions = range(len(s.field)), range(len(s.event))
        yield self._function("field_2", {k: self._assign(self._curvature(s.field[k])) for k in modes})
        events = {k: self._assign(self._curvature([s.event[k], s.rate[k]])) for k in transitions}
        yield self._function("event_2", events)
        yield self._function("reset_2", {k: self._assign(self._curvature(s.reset[k])) for k in transitions})

    def _curvature(self, expressions: list[sympy.Expr]) -> list[sympy.Expr]:
        """Gradients, row by row, of the expressions' derivatives along the direction."""
        slopes = [
            sympy.Add(*(d * g for d, g in zip(self._direction, row, strict=True)))
            for row in self.system.gradients(expressions, self._variables)
        ]
        return [without_poles(g) for row in self.system.gradients(slopes, self._variables) for g in row]


class ThirdWriter(Writer):
    """Texts of the fields' derivatives in the state along three directions."""

    def __init__(self, system: Symbolic) -> None:
        super().__init__(system)
        self._directions = [[sympy.Dummy() for _ in system.x] for _ in range(3)]
        behind = [symbol for direction in self._directions for symbol in direction]
        self._names |= {symbol: f"x[{self.n + i}]" for i, symbol in enumerate(behind)}

    def functions(self) -> Iterator[str]:
        """Text of the third derivatives along the directions."""
        s = self.system
        yield self._function("field_3", {k: self._assign(self._third(field)) for k, field in enumerate(s.field)})

    def _third(self, expressions: list[sympy.Expr]) -> list[sympy.Expr]:
        """Derivatives of the expressions along one direction after the other."""
        for direction in self._directions:
            rows = self.system.jacobian(expressions)
            expressions = [sympy.Add(*(d * g for d, g in zip(direction, row, strict=True))) for row in rows]
        return [without_poles(expression) for expression in expressions]


def _too_steep(powers: Sequence[sympy.Expr]) -> str:
    """The power of those that vanish on a surface with which no sensitivities of a segment are computed, if any is.

    With the power a of an event function, sensitivities grow like s^(2 a - 1) in clustered time: without bound for a
    below 1/2. At 1/2 they have a limit, which is found by extrapolation, unless there are powers besides.
    """
    others = [power for power in powers if 2 * power != 1]
    steep = [power for power in powers if 2 * power < 1]
    return str((steep or others)[0]) if steep or (others and len(others) < len(powers)) else ""
