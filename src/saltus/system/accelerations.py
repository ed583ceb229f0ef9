"""Accelerations that solve a mass matrix: quotients of determinants, as short expressions.

Before, common factors of rows and columns are taken out of the matrix. Products of sines and cosines become sums where
these are shorter. A matrix of relative angles becomes one of angles from one direction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import TYPE_CHECKING, Any

from saltus.errors import DefinitionError

if TYPE_CHECKING:
    import sympy

__all__ = ["accelerations", "derivative", "differ", "is_singular", "short"]

_PLACES = 6  # points at which a matrix is looked at
_NOTHING = 1e-14  # determinant over its bound by Hadamard that counts as 0, and so for differences
_DIGITS = 30  # with which both are computed


def accelerations(mass: list[list[sympy.Expr]], right: list[sympy.Expr], v: list[sympy.Symbol]) -> list[sympy.Expr]:
    """Return the solution of a linear system with a symmetric matrix, as short expressions.

    Parameters
    ----------
    mass : list of lists of sympy.Expr
        The matrix.
    right : list of sympy.Expr
        The right-hand side.
    v : list of sympy.Symbol
        Velocities, by whose powers right-hand sides are sorted.

    Returns
    -------
    list of sympy.Expr
        Quotients of determinants that are not multiplied out.

    Examples
    --------
    >>> import sympy
    >>> m, k, q, p = sympy.symbols("m k q p", real=True)
    >>> accelerations([[m, sympy.Integer(0)], [sympy.Integer(0), 2*m]], [-k*q, -k*p], [])
    [-k*q/m, -k*p/(2*m)]
    """
    moves: list[tuple[int, int, int]] = []
    if len(mass) > 2:
        mass, moves = _simpler(mass)
    right = list(right)
    for i, j, sign in moves:
        right[i] += sign * right[j]
    numerators, determinant = _quotients(mass, right, v)
    for i, j, sign in reversed(moves):
        numerators[j] += sign * numerators[i]
    return [part / determinant for part in numerators]


def _simpler(mass: list[list[sympy.Expr]]) -> tuple[list[list[sympy.Expr]], list[tuple[int, int, int]]]:
    """Return a congruent matrix of fewer terms, and what was done in turn: row and column j added to i, with a sign.

    So angles that are relative to each other become angles from one direction.
    """
    import sympy

    n = len(mass)
    moves: list[tuple[int, int, int]] = []
    terms = [[_sums_of_harmonics(sympy.expand(entry)) for entry in row] for row in mass]
    while True:
        best, fewest = None, sum(_count(entry) for row in terms for entry in row)
        for i, j, sign in ((i, j, sign) for i in range(n) for j in range(n) if i != j for sign in (-1, 1)):
            new = [row[:] for row in terms]
            new[i] = [a + sign * b for a, b in zip(new[i], new[j], strict=True)]
            for row in new:
                row[i] = sympy.expand(row[i] + sign * row[j])
            count = sum(_count(entry) for row in new for entry in row)
            if count < fewest:
                best, fewest = (new, (i, j, sign)), count
        if best is None:
            return terms, moves
        terms = best[0]
        moves.append(best[1])


def _count(expression: sympy.Expr) -> int:
    """Return the number of terms of a sum."""
    return len(expression.args) if expression.is_Add else int(expression != 0)


def _quotients(
    mass: list[list[sympy.Expr]], right: list[sympy.Expr], v: list[sympy.Symbol]
) -> tuple[list[sympy.Expr], sympy.Expr]:
    """Return numerators and the common denominator of a solution."""
    import sympy

    n = len(mass)
    of_rows = [_common_factor(row) for row in mass]
    mass = [[sympy.expand(entry / factor) for entry in row] for row, factor in zip(mass, of_rows, strict=True)]
    right = [short(part / factor, v) for part, factor in zip(right, of_rows, strict=True)]
    of_columns = [_common_factor([row[j] for row in mass]) for j in range(n)]
    mass = [[_shortest(entry / factor) for entry, factor in zip(row, of_columns, strict=True)] for row in mass]

    @cache
    def minor(rows: tuple[int, ...], columns: tuple[int, ...]) -> sympy.Expr:
        if not rows:
            return sympy.S.One
        row = mass[rows[0]]
        return sympy.Add(
            *(
                (-1) ** k * row[j] * minor(rows[1:], columns[:k] + columns[k + 1 :])
                for k, j in enumerate(columns)
                if row[j] != 0
            )
        )

    every = tuple(range(n))
    without = [every[:i] + every[i + 1 :] for i in range(n)]
    numerators = [
        sympy.Add(*((-1) ** (i + j) * minor(without[j], without[i]) * right[j] for j in range(n))) / of_columns[i]
        for i in range(n)
    ]
    return numerators, minor(every, every)


def _common_factor(expressions: list[sympy.Expr]) -> sympy.Expr:
    """Return the largest product of powers that is in all terms of all expressions."""
    import sympy

    terms = [t.as_powers_dict() for e in expressions if e != 0 for t in sympy.Add.make_args(sympy.expand(e)) if t != 0]
    bases = set(terms[0]).intersection(*terms[1:]) if terms else set()
    exponents = {base: [term[base] for term in terms] for base in bases if not base.is_number}
    return sympy.Mul(*(base ** min(powers) for base, powers in exponents.items() if all(p.is_number for p in powers)))


def is_singular(matrix: list[list[sympy.Expr]]) -> bool:
    """Whether a matrix is singular everywhere, by its determinant at some places."""
    import mpmath

    def regular(*entries: Any) -> bool:
        n = len(matrix)
        rows = [entries[i * n : (i + 1) * n] for i in range(n)]
        bound = mpmath.fprod(max(abs(entry) for entry in row) for row in rows)
        return bool(bound > 0 and abs(mpmath.det(mpmath.matrix(rows))) > _NOTHING * bound)

    return not _somewhere(regular, [entry for row in matrix for entry in row])


def differ(one: sympy.Expr, other: sympy.Expr) -> bool:
    """Whether two expressions differ somewhere."""
    return one != other and _somewhere(lambda a, b: abs(a - b) > _NOTHING * (abs(a) + abs(b)), [one, other], False)


def _somewhere(holds: Callable[..., bool], expressions: list[sympy.Expr], otherwise: bool = True) -> bool:
    """Whether something holds of the values of expressions at one place or another; `otherwise` if they have none."""
    import mpmath
    import sympy

    names = sorted(set().union(*(e.free_symbols for e in expressions)), key=str)
    values = sympy.lambdify(names, expressions, "mpmath")
    looked = False
    with mpmath.workdps(_DIGITS):
        for k in range(_PLACES):
            # in (0, 1) first, where roots and logarithms are real; then beyond
            fractions = [mpmath.frac((i + 1) * mpmath.sqrt(2) + (k + 1) * mpmath.sqrt(3)) for i in range(len(names))]
            place = fractions if k < _PLACES // 2 else [8 * x - 4 for x in fractions]
            try:
                found = [mpmath.mpmathify(value) for value in values(*place)]
                if all(mpmath.isfinite(value) for value in found):
                    looked = True
                    if holds(*found):
                        return True
            except (ArithmeticError, TypeError, ValueError):
                continue
    return not looked and otherwise


# expressions


def derivative(expression: sympy.Expr, symbol: sympy.Symbol) -> sympy.Expr:
    """Return a derivative without the terms at jumps of signs."""
    import sympy

    found = sympy.diff(expression, symbol)
    found = found.replace(sympy.Heaviside, lambda x, *_: (1 + sympy.sign(x)) / 2)
    found = found.replace(sympy.DiracDelta, lambda *_: sympy.Integer(0))
    if found.has(sympy.Derivative, sympy.re, sympy.im):
        raise DefinitionError("lagrangian", str(expression), f"an expression that has a derivative by {symbol.name!r}")
    return found


def short(expression: sympy.Expr, v: list[sympy.Symbol]) -> sympy.Expr:
    """Return an expression by powers of velocities, if that is shorter."""
    import sympy

    terms: dict[sympy.Expr, list[sympy.Expr]] = {}
    for term in sympy.Add.make_args(sympy.expand(expression)):
        inner, outer = term.as_independent(*v, as_Add=False)
        terms.setdefault(outer, []).append(inner)
    by_powers = sympy.Add(*(_shortest(sympy.Add(*inner)) * outer for outer, inner in terms.items()))
    return min((expression, by_powers, sympy.factor_terms(by_powers)), key=sympy.count_ops)


def _shortest(expression: sympy.Expr) -> sympy.Expr:
    """Return the shortest way to write an expression, of some."""
    import sympy

    return min(_ways(expression), key=sympy.count_ops)


def _ways(expression: sympy.Expr) -> Iterator[sympy.Expr]:
    import sympy

    yield expression
    if not expression.is_Atom:
        yield (products := sympy.expand(expression))
        yield sympy.factor_terms(products)
        sums = _sums_of_harmonics(products)
        if sums != products:
            yield sums
            yield sympy.factor_terms(sums)


def _sums_of_harmonics(expression: sympy.Expr) -> sympy.Expr:
    """Return a sum whose products of sines and cosines are sums of them."""
    import sympy

    half = sympy.Rational(1, 2)
    terms = []
    for term in sympy.Add.make_args(expression):
        sums = [(sympy.S.One, sympy.S.Zero, True)]  # factor, angle, whether a cosine
        rest = []
        for base, power in term.as_powers_dict().items():
            if not (isinstance(base, sympy.sin | sympy.cos) and power.is_Integer and power > 0):
                rest.append(base**power)
                continue
            a, is_cos = base.args[0], isinstance(base, sympy.cos)
            for _ in range(int(power)):
                if sums == [(1, 0, True)]:
                    sums = [(sympy.S.One, a, is_cos)]
                    continue
                # cos cos and sin sin are cosines of difference and sum, the others sines
                sums = [
                    (factor * half * sign, b + way * a, was_cos == is_cos)
                    for factor, b, was_cos in sums
                    for way in (-1, 1)
                    for sign in (_sign(was_cos, is_cos, way),)
                ]
        harmonics = [factor * (sympy.cos(b) if is_cos else sympy.sin(b)) for factor, b, is_cos in sums]
        terms += [sympy.Mul(*rest, one) for one in harmonics]
    return sympy.Add(*terms)


def _sign(first_is_cos: bool, second_is_cos: bool, way: int) -> int:
    """Return the sign with which b + way*a occurs in twice the product of functions of b and of a."""
    if first_is_cos and second_is_cos:
        return 1
    if not first_is_cos and not second_is_cos:
        return -way
    return way if first_is_cos else 1
