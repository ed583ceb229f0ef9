"""Taylor series of a motion, as straight-line text: one recurrence for each operation of the definition.

Every expression of a mode's field and of its event functions is taken apart into operations. A linear combination acts
on each coefficient alone. A product is a convolution. A quotient, a power or a function follows from the differential
equation that it satisfies. Coefficient k of everything comes from coefficients up to k, and coefficient k + 1 of the
state from coefficient k of the field.

References
----------
A. Jorba, M. Zou, A software package for the numerical integration of ODEs by means of high-order Taylor methods,
Experimental Mathematics 14 (2005) 99-117, section 2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, NamedTuple

import sympy

from saltus.errors import NotAnalyticError
from saltus.system.writing.exponents import exponent_of

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from saltus.system.derivatives import Symbolic
    from saltus.system.writing.regularise import Regularised

__all__ = ["Series", "series_of_mode"]


class _Linear(NamedTuple):
    """A linear combination of series, and a constant."""

    terms: dict[str, sympy.Expr]
    constant: sympy.Expr


class Series(NamedTuple):
    """The series of one mode."""

    constants: list[str]  # statements that make local variables of what depends on parameters alone
    lines: list[str]  # statements behind them, in order; those of order 0 start from the state
    # names of the series that are returned: states without the phase, w and the time (in sigma), then the event
    # functions of the mode. Coefficient k of ``a`` is the local variable ``a_k``.
    columns: list[str]
    # names of the series of the sines and cosines of the phase in the state without a series
    phasors: dict[sympy.Expr, str]
    # for each order from 1 on the exponents' coefficients, over the way that a step may go; [] without exponents
    ways: list[list[str]]


def series_of_mode(
    system: Symbolic,
    mode: int,
    order: int,
    text: Callable[[sympy.Expr], str],
    form: Regularised | None = None,
    read: Callable[[int], str] = "x[{}]".format,
    solved: tuple[int, sympy.Expr] | None = None,
) -> Series:
    """Return the statements that compute the Taylor series of a mode.

    Parameters
    ----------
    order : int
        Last coefficient.
    text : callable
        Writes an expression in parameters alone.
    form : Regularised, optional
        The mode's field in sigma; by default the series are in time.
    read : callable, optional
        Writes component i of the full state, with w behind it.
    solved : tuple of int and sympy.Expr, optional
        A state without a series of its own, and what it is: see `Regularised.solved`.

    Raises
    ------
    NotAnalyticError
        The mode has no Taylor series.
    """
    return _Tape(system, mode, order, text, form, read, solved).written()


class _Tape:
    """The operations of one mode, each once, in an order in which they can be computed."""

    def __init__(
        self,
        system: Symbolic,
        mode: int,
        order: int,
        text: Callable[[sympy.Expr], str],
        form: Regularised | None,
        read: Callable[[int], str],
        solved: tuple[int, sympy.Expr] | None,
    ) -> None:
        self.form, self.read = form, read
        self.system, self.mode, self.order, self.text = system, mode, order, text
        self.parameters = set(system.p)
        has_phase = system.system.phase is not None
        self.theta = system.x[-1] if has_phase else None
        self.states = system.x[:-1] if has_phase else list(system.x)
        self.rate = system.field[mode][-1] if has_phase else sympy.Integer(0)
        # no variable is assigned in two forms: the compiler would look at all lines again for each that is
        self.prefix = f"m{mode}" if form is None else f"s{mode}"
        self.solved = {} if solved is None else {self.states[solved[0]]: solved[1]}
        self.moving = [i for i in range(len(self.states)) if solved is None or i != solved[0]]
        self.positions = [f"{self.prefix}x{i}" for i in self.moving]
        series = zip(self.moving, self.positions, strict=True)
        self.names: dict[sympy.Expr, str] = {self.states[i]: name for i, name in series}
        self.operations: list[tuple[str, ...]] = []
        self.known: dict[tuple[str, ...], str] = {}
        self.coefficients: dict[str, sympy.Expr] = {}
        self.starts: list[str] = [f"{name}_0 = {read(i)}" for i, name in zip(self.moving, self.positions, strict=True)]
        self.w = f"{self.prefix}w" if form is not None else ""
        if form is not None:
            self.names[form.w] = self.w
            self.starts += [f"{self.w}_0 = {read(len(system.x))}", f"{self.prefix}t_0 = 0.0"]
        self.written_coefficients: dict[str, str] = {}
        self.watched: dict[tuple[str, str], None] = {}  # series of exponents, and weights; one may have several

    def written(self) -> Series:
        s, form = self.system, self.form
        field = s.field[self.mode] if form is None else form.field
        slopes = [self.single(field[i]) for i in self.moving]
        events = [
            form.sign * form.w if form is not None and k == form.transition else s.event[k]
            for k, source in enumerate(s.source)
            if source == self.mode
        ]
        moving = list(self.positions)
        if form is not None:
            gradient = [sympy.diff(s.event[form.transition], symbol) for symbol in s.x]
            rate = sympy.Add(*(g * f for g, f in zip(gradient, field, strict=True)))
            slopes = [self.operation("mul", self.w, name) for name in slopes]
            slopes += [self.single(sympy.Rational(form.sign, 2) * rate), self.w]
            moving += [self.w, f"{self.prefix}t"]
        columns = [*moving, *(self.single(event) for event in events)]
        waves = [a for value in self.solved.values() for a in value.atoms(sympy.sin, sympy.cos)]
        phasors = {a: self.single(a) for a in waves if self.theta in a.free_symbols}
        lines = list(self.starts)
        for k in range(self.order + 1):
            for operation in self.operations:
                lines += self.emit(operation, k)
            if k < self.order:
                part = f"*{1.0 / (k + 1)!r}" if k else ""
                lines += [f"{x}_{k + 1} = {name}_{k}{part}" for x, name in zip(moving, slopes, strict=True)]
        constants = [f"{name} = {value}" for name, value in self.written_coefficients.items()]
        weights = [f"{self.prefix}way{i}" for i in range(len(self.watched))]
        lines += [f"{weight} = {text}" for weight, (_, text) in zip(weights, self.watched, strict=True)]
        ways = [
            [f"abs({name}_{k})*{weight}" for (name, _), weight in zip(self.watched, weights, strict=True)]
            for k in range(1, self.order + 1)
        ]
        return Series(constants, lines, columns, phasors, ways if self.watched else [])

    def linear(self, expression: sympy.Expr) -> _Linear:
        """Take a linear combination apart; what is not linear becomes a series of its own."""
        if expression.free_symbols <= self.parameters:
            return _Linear({}, expression)
        if expression == self.theta:
            return _Linear({self.operation("phase", self.coefficient(self.rate)): sympy.Integer(1)}, sympy.Integer(0))
        if expression in self.names:
            return _Linear({self.names[expression]: sympy.Integer(1)}, sympy.Integer(0))
        if expression.is_Add:
            terms: dict[str, sympy.Expr] = {}
            constant = sympy.Integer(0)
            for argument in expression.args:
                part = self.linear(argument)
                constant += part.constant
                for name, coefficient in part.terms.items():
                    terms[name] = terms.get(name, sympy.Integer(0)) + coefficient
            return _Linear({name: c for name, c in terms.items() if c != 0}, constant)
        if expression.is_Mul:
            fixed = [a for a in expression.args if a.free_symbols <= self.parameters]
            varying = [a for a in expression.args if not a.free_symbols <= self.parameters]
            factor = sympy.Mul(*fixed)
            if len(varying) == 1:
                part = self.linear(varying[0])
                return _Linear({n: factor * c for n, c in part.terms.items()}, factor * part.constant)
            self.watch(sympy.Mul(*varying))
            return _Linear({self.product(varying): factor}, sympy.Integer(0))
        return _Linear({self.function(expression): sympy.Integer(1)}, sympy.Integer(0))

    def single(self, expression: sympy.Expr) -> str:
        """Name of the series of an expression."""
        return self.combined(self.linear(expression.xreplace(self.solved)))

    def combined(self, parts: _Linear) -> str:
        if parts.constant == 0 and len(parts.terms) == 1:
            ((name, coefficient),) = parts.terms.items()
            if coefficient == 1:
                return name
        terms = [f"{self.coefficient(c)}*{name}" for name, c in sorted(parts.terms.items())]
        return self.operation("linear", self.coefficient(parts.constant), *terms)

    def coefficient(self, expression: sympy.Expr) -> str:
        """A number, or the name of a local variable that holds a constant."""
        value = self.text(expression)
        try:
            return repr(float(value))
        except ValueError:
            for name, known in self.written_coefficients.items():
                if known == value:
                    return name
            name = f"{self.prefix}k{len(self.written_coefficients)}"
            self.written_coefficients[name] = value
            return name

    def operation(self, kind: str, *arguments: str) -> str:
        key = (kind, *(sorted(arguments) if kind == "mul" else arguments))
        if key not in self.known:
            name = f"{self.prefix}u{len(self.known)}"
            self.known[key] = name
            self.operations.append((name, *key))
        return self.known[key]

    def product(self, factors: list[sympy.Expr]) -> str:
        names = [self.single(factor) for factor in factors]
        while len(names) > 1:
            names = [self.operation("mul", names[0], names[1]), *names[2:]]
        return names[0]

    def function(self, expression: sympy.Expr) -> str:
        if expression.is_Pow and not expression.exp.free_symbols <= self.parameters:
            expression = sympy.exp(expression.exp * sympy.log(expression.base), evaluate=False)
        if self.watch(expression) and expression.is_Pow and not expression.exp.is_negative:
            raise NotAnalyticError(f"where its base vanishes, the series of a power {expression.exp} begins too late")
        if expression.is_Pow:
            return self.power(*expression.as_base_exp())
        argument = expression.args[0]
        match expression.func.__name__:
            case "exp":
                return self.operation("exp", self.single(argument))
            case "sin" | "cos":
                return self.circular(argument, expression.func.__name__)
            case "sinh" | "cosh":
                a = self.single(argument)
                even, odd = self.operation("cosh", a), self.operation("sinh", a)
                return odd if expression.func is sympy.sinh else even
            case "tan" | "tanh" | "erf":
                a = self.single(argument)
                name = self.operation(expression.func.__name__, a)
                if expression.func is sympy.erf:
                    self.slope_of(name, self.single(2 / sympy.sqrt(sympy.pi) * sympy.exp(-(argument**2))))
                else:
                    square = self.operation("mul", name, name)
                    weight = "1.0" if expression.func is sympy.tan else "-1.0"
                    self.slope_of(name, self.operation("linear", "1.0", f"{weight}*{square}"))
                return name
            case "log":
                return self.operation("quotient", "log", self.single(argument), self.single(argument), "1.0")
            case "asin" | "acos":
                v = self.single(sympy.sqrt(1 - argument**2))
                sign = "1.0" if expression.func is sympy.asin else "-1.0"
                return self.operation("quotient", expression.func.__name__, self.single(argument), v, sign)
            case "atan":
                return self.operation("quotient", "atan", self.single(argument), self.single(1 + argument**2), "1.0")
            case "asinh":
                v = self.single(sympy.sqrt(1 + argument**2))
                return self.operation("quotient", "asinh", self.single(argument), v, "1.0")
            case "acosh":
                v = self.single(sympy.sqrt(argument**2 - 1))
                return self.operation("quotient", "acosh", self.single(argument), v, "1.0")
            case "atanh":
                return self.operation("quotient", "atanh", self.single(argument), self.single(1 - argument**2), "1.0")
            case "atan2":
                y, x = expression.args
                return self.operation("atan2", self.single(y), self.single(x), self.single(x**2 + y**2))
            case name:
                raise NotAnalyticError(f"{name} has no Taylor series where its argument changes sign")

    def watch(self, expression: sympy.Expr) -> bool:
        """Watch the exponent of a function or a product; return whether it has one."""
        exponent = exponent_of(expression, self.parameters, self.theta)
        if exponent is not None:
            name = self.single(exponent.value)
            self.watched[name, exponent.weight(f"{name}_0")] = None
        return exponent is not None

    def slope_of(self, name: str, factor: str) -> None:
        """Note that a function's derivative is `factor` times its argument's."""
        for i, operation in enumerate(self.operations):
            if operation[0] == name and len(operation) == 3:
                self.operations[i] = (*operation, factor)

    def circular(self, argument: sympy.Expr, kind: str) -> str:
        """Sine or cosine; of the phase, a phasor that turns at a constant rate."""
        theta = self.theta
        if theta is not None:
            turns = sympy.diff(argument, theta)
            if turns.is_number and argument.free_symbols <= self.parameters | {theta}:
                offset = sympy.expand(argument - turns * theta)
                speed = self.coefficient(turns * self.rate)
                start = self.coefficient(turns), self.coefficient(offset)
                both = self.operation("turn_sin", speed, *start), self.operation("turn_cos", speed, *start)
                return both[0] if kind == "sin" else both[1]
        a = self.single(argument)
        both = self.operation("sin", a), self.operation("cos", a)
        return both[0] if kind == "sin" else both[1]

    def power(self, base: sympy.Expr, exponent: sympy.Expr) -> str:
        if exponent.is_Integer:
            count = abs(int(exponent))
            name = self.single(base)
            if exponent < 0:
                name = self.operation("inverse", name)
            return self.whole_power(name, count)
        return self.operation("power", self.single(base), self.coefficient(exponent))

    def whole_power(self, name: str, count: int) -> str:
        if count == 1:
            return name
        half = self.whole_power(name, count // 2)
        square = self.operation("mul", half, half)
        return self.operation("mul", square, name) if count % 2 else square

    def emit(self, operation: tuple[str, ...], k: int) -> Iterator[str]:
        """Coefficient k of one operation."""
        name, kind, *arguments = operation
        target = f"{name}_{k}"
        match kind:
            case "linear":
                constant, *parts = arguments
                terms = [(0, coefficient, f"{series}_{k}") for coefficient, series in (p.split("*") for p in parts)]
                rest = f" + {constant}" if k == 0 and constant != "0.0" else ""
                yield f"{target} = {_products(terms)}{rest}"
            case "mul":
                yield f"{target} = {_convolution(arguments[0], arguments[1], k)}"
            case "inverse":
                (a,) = arguments
                terms = [(max(j, k - j), f"{a}_{j}", f"{name}_{k - j}") for j in range(1, k + 1)]
                yield f"{target} = 1.0/{a}_0" if k == 0 else f"{target} = -{name}_0*({_products(terms)})"
            case "power":
                a, alpha = arguments
                if k == 0:
                    yield f"{target} = {_first_power(f'{a}_0', alpha)}"
                    yield f"{name}_s = 1.0/{a}_0"
                else:
                    terms = [
                        (max(j, k - j), f"{_weight(alpha, j, k)}*{a}_{j}", f"{name}_{k - j}") for j in range(1, k + 1)
                    ]
                    yield f"{target} = {1.0 / k!r}*{name}_s*({_products(terms)})"
            case "phase":
                (speed,) = arguments
                later = f"{speed}*{self.prefix}t_{k}" if self.w else (speed if k == 1 else "0.0")
                yield f"{target} = {self.read(len(self.states))}" if k == 0 else f"{target} = {later}"
            case "turn_sin" | "turn_cos":
                speed, turns, offset = arguments
                sine, cosine = (self.known[(which, *arguments)] for which in ("turn_sin", "turn_cos"))
                function, other, sign = ("sin", cosine, "") if kind == "turn_sin" else ("cos", sine, "-")
                if k == 0:
                    angle = f"{turns}*{self.read(len(self.states))} + {offset}"
                    yield f"{target} = math.{function}({angle})"
                else:
                    rest = _convolution(self.w, other, k - 1) if self.w else f"{other}_{k - 1}"
                    yield f"{target} = {sign}{1.0 / k!r}*{speed}*({rest})"
            case "sin" | "cos":
                (a,) = arguments
                sine, cosine = (self.known[(which, a)] for which in ("sin", "cos"))
                other, sign = (cosine, "") if kind == "sin" else (sine, "-")
                yield f"{target} = {_slope(kind, a, other, k, sign)}"
            case "sinh" | "cosh":
                (a,) = arguments
                other = self.known[("cosh" if kind == "sinh" else "sinh", a)]
                yield f"{target} = {_slope(kind, a, other, k)}"
            case "exp":
                yield f"{target} = {_slope('exp', arguments[0], name, k)}"
            case "tan" | "tanh" | "erf":
                a, factor = arguments
                yield f"{target} = {_slope(kind, a, factor, k)}"
            case "quotient":
                function, a, v, sign = arguments
                if k == 0:
                    yield f"{target} = math.{function}({a}_0)"
                    yield f"{name}_s = 1.0/{v}_0"
                else:
                    terms = [(max(j, k - j), f"{float(j)!r}*{name}_{j}", f"{v}_{k - j}") for j in range(1, k)]
                    yield f"{target} = {name}_s*({sign}*{a}_{k} - {1.0 / k!r}*({_products(terms)}))"
            case "atan2":
                y, x, v = arguments
                if k == 0:
                    yield f"{target} = math.atan2({y}_0, {x}_0)"
                    yield f"{name}_s = 1.0/{v}_0"
                else:
                    orders = range(1, k + 1)
                    terms = [(max(j, k - j), f"{float(j)!r}*{x}_{k - j}", f"{y}_{j}") for j in orders]
                    terms += [(max(j, k - j), f"-{float(j)!r}*{y}_{k - j}", f"{x}_{j}") for j in orders]
                    terms += [(max(j, k - j), f"-{float(j)!r}*{name}_{j}", f"{v}_{k - j}") for j in range(1, k)]
                    yield f"{target} = {1.0 / k!r}*{name}_s*({_products(terms)})"


def _products(terms: list[tuple[int, str, str]]) -> str:
    """Sum of products, each with the order that it waits for."""
    if not terms:
        return "0.0"
    terms = sorted(terms, key=lambda term: term[0])
    if len(terms) == 1:
        return f"{terms[0][1]}*{terms[0][2]}"
    return f"products({', '.join(f'{a}, {b}' for _, a, b in terms)})"


def _first_power(base: str, alpha: str) -> str:
    """A power, by a root and products where it is half of a small odd number."""
    try:
        whole = float(alpha) - 0.5
    except ValueError:
        return f"{base}**{alpha}"
    if not (whole.is_integer() and 0.0 <= whole <= 4.0):
        return f"{base}**{alpha}"
    return "*".join([*[base] * int(whole), f"math.sqrt({base})"])


def _weight(alpha: str, j: int, k: int) -> str:
    """Factor alpha j - (k - j) of a power's recurrence, as a number where alpha is one."""
    try:
        return f"({float(alpha) * j - (k - j)!r})"
    except ValueError:
        return f"({alpha}*{float(j)!r} - {float(k - j)!r})"


def _convolution(a: str, b: str, k: int) -> str:
    """Coefficient k of a product; of a square, each pair once."""
    if a != b:
        return _products([(max(j, k - j), f"{a}_{j}", f"{b}_{k - j}") for j in range(k + 1)])
    if k == 0:
        return f"{a}_0*{a}_0"
    pairs = _products([(k - j, f"{a}_{j}", f"{a}_{k - j}") for j in range((k + 1) // 2)])
    return f"2.0*({pairs})" + (f" + {a}_{k // 2}*{a}_{k // 2}" if k % 2 == 0 else "")


def _slope(function: str, a: str, factor: str, k: int, sign: str = "") -> str:
    """Coefficient k of a function whose derivative is sign * factor times that of its argument."""
    if k == 0:
        return f"math.{function}({a}_0)"
    terms = [(max(j, k - j), f"{float(j)!r}*{a}_{j}", f"{factor}_{k - j}") for j in range(1, k + 1)]
    return f"{sign}{1.0 / k!r}*({_products(terms)})"
