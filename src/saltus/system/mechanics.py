"""Fields of mechanical systems: the accelerations that a mass matrix and forces, or a Lagrangian, give.

docs/theory/system.md has the equations. Accelerations are quotients of determinants. Before, common factors of rows and
columns are taken out of the mass matrix, and products of sines and cosines become sums where these are shorter.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING, Any, NamedTuple

from saltus.errors import DefinitionError, nearest
from saltus.system.expressions import NAME, Names, check_name, parse, text_of

if TYPE_CHECKING:
    import sympy

__all__ = ["Held", "lagrangian_field", "mass_matrix_field"]

_MOST = 5  # coordinates: a determinant has a number of terms that grows as the factorial
_NO_CALL = re.compile(NAME.pattern + r"(?!\w|\s*\()")  # a name in a text that is not the name of a function there
_PLACES = 6  # points at which a matrix is looked at
_NOTHING = 1e-14  # determinant over its bound by Hadamard that counts as 0, and so for differences
_DIGITS = 30  # with which both are computed


class Held(NamedTuple):
    """What a Lagrangian's field takes for granted about the system that it will belong to."""

    constant: frozenset[str]  # names in the momenta that were held constant
    read: frozenset[str]  # names in the Lagrangian that were differentiated as they stand
    phase: tuple[str, str] | None  # name and rate of the phase

    def check(self, where: str, states: Iterable[str], phase: tuple[str, str] | None, let: Iterable[str]) -> None:
        """Raise `DefinitionError` where a system lets one of the names vary.

        Parameters
        ----------
        where : str
            Which part of the definition it is, for messages.
        states : iterable of str
            All that varies in time, the phase among them.
        phase : (str, str) or None
            The system's phase.
        let : iterable of str
            Its sub-expressions.
        """
        if named := sorted(self.read & set(let)):
            wanted = "a name that the Lagrangian writes out"
            raise DefinitionError(where, named[0], wanted, "hand let= to Mode.lagrangian, too")
        if self.phase is not None and phase != self.phase:
            raise DefinitionError(where, self.phase, f"the system's phase, {phase!r}, in Mode.lagrangian")
        if varying := sorted(self.constant & set(states)):
            hint = "hand phase= to Mode.lagrangian if it is the phase"
            raise DefinitionError(where, varying[0], "constant in time where a velocity is a factor of it", hint)


def lagrangian_field(
    lagrangian: Any, velocities: Any, forces: Any = None, phase: Any = None, let: Any = None
) -> tuple[dict[str, str], Held]:
    """Return the field of a Lagrangian as texts, and what was held constant for it.

    Parameters
    ----------
    lagrangian : expression
        Kinetic minus potential energy.
    velocities : mapping of str to str
        The velocity of each coordinate.
    forces : mapping of str to expression, optional
        Generalised forces of coordinates.
    phase : (str, expression), optional
        Name and rate of an angle on which the Lagrangian may depend.
    let : mapping of str to expression, optional
        Names of sub-expressions.

    Returns
    -------
    field : dict of str to str
        The rate of each coordinate and velocity.
    held : Held

    Raises
    ------
    DefinitionError
        As `Mode.lagrangian` says.

    Examples
    --------
    >>> lagrangian_field("m*v**2/2 - k*q**2/2", {"q": "v"})[0]
    {'q': 'v', 'v': '-k*q/m'}
    """
    import sympy

    pairs = _pairs(velocities)
    given = {} if forces is None else _forces(forces, pairs, complete=False)
    sub = {} if let is None else dict(_mapping(let, "let", "a mapping of names to expressions"))
    clock = None if phase is None else _clock(phase)
    named = {"lagrangian": lagrangian, **_named("force of", given), **_named("let", sub)}
    reader = _Reader(pairs, {**named, "phase": "0" if clock is None else f"{clock[0]} + {clock[1]}"}, sub)
    q, v = reader.symbols(pairs), reader.symbols(pairs.values())
    energy = _short(reader.read(lagrangian, "lagrangian"), v)
    momenta = [_derivative(energy, symbol) for symbol in v]
    for symbol, momentum in zip(v, momenta, strict=True):
        if not _derivative(momentum, symbol).free_symbols | {*momentum.free_symbols} & set(v):
            raise _without_energy(lagrangian, f"{symbol.name!r} has none")
    rates = dict(zip(q, v, strict=True))
    if clock is not None:
        rates[sympy.Symbol(clock[0], real=True)] = reader.read(clock[1], "phase")
    mass = [[_derivative(momentum, symbol) for symbol in v] for momentum in momenta]
    right = [
        _derivative(energy, symbol)
        - sympy.Add(*(_derivative(momentum, one) * rate for one, rate in rates.items()))
        + reader.read(given.get(symbol.name, 0), f"force of {symbol.name!r}")
        for symbol, momentum in zip(q, momenta, strict=True)
    ]
    if _is_singular(mass):
        raise _without_energy(lagrangian, "its mass matrix is singular everywhere")
    known = {*rates, *v}
    held = Held(
        frozenset(one.name for momentum in momenta for one in momentum.free_symbols - known),
        frozenset(_NO_CALL.findall(text_of(lagrangian, "lagrangian"))) - set(sub),
        clock,
    )
    return _field(pairs, _accelerations(mass, right, v)), held


def mass_matrix_field(mass: Any, forces: Any, velocities: Any) -> dict[str, str]:
    """Return the field of a mass matrix and forces as texts.

    Parameters
    ----------
    mass : sequence of sequences of expression
        The mass matrix.
    forces : mapping of str to expression, or sequence of expression
        The right-hand sides.
    velocities : mapping of str to str
        The velocity of each coordinate.

    Returns
    -------
    dict of str to str
        The rate of each coordinate and velocity.

    Raises
    ------
    DefinitionError
        As `Mode.mass_matrix` says.

    Examples
    --------
    >>> mass_matrix_field([["m"]], ["-k*q"], {"q": "v"})
    {'q': 'v', 'v': '-k*q/m'}
    """
    pairs = _pairs(velocities)
    given = _forces(forces, pairs, complete=True)
    rows = _square(mass, len(pairs))
    entries = {f"mass[{i}][{j}]": entry for i, row in enumerate(rows) for j, entry in enumerate(row)}
    reader = _Reader(pairs, {**_named("force of", given), **entries}, {})
    read = [[reader.read(entry, f"mass[{i}][{j}]") for j, entry in enumerate(row)] for i, row in enumerate(rows)]
    for i in range(len(read)):
        for j in range(i):
            if _differ(read[i][j], read[j][i]):
                value = f"{rows[i][j]} and {rows[j][i]}"
                raise DefinitionError("mass", value, f"symmetric, but mass[{i}][{j}] and mass[{j}][{i}] differ")
    if _is_singular(read):
        allowed = "a matrix that is not singular everywhere"
        raise DefinitionError("mass", str(read), allowed, "its determinant is 0 whatever the coordinates are")
    right = [reader.read(given[name], f"force of {name!r}") for name in pairs]
    return _field(pairs, _accelerations(read, right, reader.symbols(pairs.values())))


# arguments


def _mapping(value: Any, where: str, what: str) -> Mapping[Any, Any]:
    if not isinstance(value, Mapping):
        raise DefinitionError(where, value, what)
    return value


def _pairs(velocities: Any) -> dict[str, str]:
    """Return the velocity of each coordinate."""
    pairs = dict(_mapping(velocities, "velocities", what := "a mapping of coordinates to velocities, as {'q': 'v'}"))
    if not pairs:
        raise DefinitionError("velocities", pairs, f"{what}, at least one")
    if len(pairs) > _MOST:
        raise DefinitionError("velocities", len(pairs), f"those of at most {_MOST} coordinates")
    seen: set[str] = set()
    for coordinate, velocity in pairs.items():
        for name in (check_name(coordinate, "velocities"), check_name(velocity, f"velocity of {coordinate!r}")):
            if name in seen:
                which = "a coordinate and a velocity" if name in pairs else "the velocity of two coordinates"
                raise DefinitionError("velocities", name, f"one of them only, but it is {which}")
            seen.add(name)
    return pairs


def _forces(forces: Any, pairs: dict[str, str], *, complete: bool) -> dict[str, Any]:
    """Return the force of each coordinate, or of some."""
    every = ", ".join(pairs)
    if isinstance(forces, Mapping):
        if extra := [name for name in forces if name not in pairs]:
            hint = nearest(extra[0], pairs)
            if extra[0] in pairs.values():
                hint = "a force has the name of its coordinate, not of the velocity"
            raise DefinitionError("forces", extra[0], f"a coordinate: {every}", hint)
        missing = [name for name in pairs if name not in forces]
        if missing and complete:
            raise DefinitionError("forces", list(forces), f"one for each of {every}", f"{missing[0]!r} is missing")
        return dict(forces)
    if not complete or isinstance(forces, str) or not isinstance(forces, Iterable):
        raise DefinitionError("forces", forces, f"a mapping of coordinates to expressions, for {every}")
    if len(listed := list(forces)) != len(pairs):
        raise DefinitionError("forces", listed, f"{len(pairs)} expressions, one for each of {every}")
    return dict(zip(pairs, listed, strict=True))


def _square(mass: Any, n: int) -> list[list[Any]]:
    """Return the rows of a matrix."""
    wanted = f"a matrix of {n} rows of {n} expressions, one for each coordinate"
    rows = mass.tolist() if hasattr(mass, "tolist") else mass
    if isinstance(rows, str | Mapping) or not isinstance(rows, Iterable):
        raise DefinitionError("mass", mass, wanted)
    read = []
    for row in (listed := list(rows)):
        if isinstance(row, str | Mapping) or not isinstance(row, Iterable):
            raise DefinitionError("mass", mass, wanted, "as in [['m', '0'], ['0', 'm']]")
        read.append(list(row))
    if len(listed) != n or any(len(row) != n for row in read):
        raise DefinitionError("mass", f"rows of {', '.join(str(len(row)) for row in read)}", wanted)
    return read


def _clock(phase: Any) -> tuple[str, str]:
    """Return name and rate of the phase."""
    if not isinstance(phase, tuple | list) or len(phase) != 2:
        raise DefinitionError("phase", phase, "a name and a rate, as in ('theta', 'w')")
    return check_name(phase[0], "phase"), text_of(phase[1], "phase")


def _without_energy(lagrangian: Any, hint: str) -> DefinitionError:
    wanted = "an expression in which each velocity has a kinetic energy of its own"
    return DefinitionError("lagrangian", str(lagrangian), wanted, hint)


def _named(kind: str, expressions: Mapping[str, Any]) -> dict[str, Any]:
    """Return expressions by what messages call them."""
    return {f"{kind} {name!r}": expression for name, expression in expressions.items()}


class _Reader:
    """Expressions in names that nobody has declared: all that are not called."""

    def __init__(self, pairs: dict[str, str], named: Mapping[str, Any], let: Mapping[str, Any]) -> None:
        found = {name for where, one in named.items() for name in _NO_CALL.findall(text_of(one, where))}
        # what is spelled in two ways has the spelling of the coordinates, which come last
        plain = sorted(found - {*pairs, *pairs.values(), *let})
        self.names = Names((*plain, *pairs, *pairs.values())).with_let(let)

    def read(self, expression: Any, where: str) -> sympy.Expr:
        return parse(text_of(expression, where, self.names), self.names, where)

    def symbols(self, names: Iterable[str]) -> list[sympy.Symbol]:
        import sympy

        return [sympy.Symbol(name, real=True) for name in names]


def _field(pairs: dict[str, str], accelerations: list[sympy.Expr]) -> dict[str, str]:
    rates = {v: text_of(rate, f"rate of {v!r}") for v, rate in zip(pairs.values(), accelerations, strict=True)}
    return {**pairs, **rates}


# matrices


def _accelerations(mass: list[list[sympy.Expr]], right: list[sympy.Expr], v: list[sympy.Symbol]) -> list[sympy.Expr]:
    """Return the solution of a linear system, short."""
    import sympy

    n = len(mass)
    of_rows = [_common_factor(row) for row in mass]
    mass = [[sympy.expand(entry / factor) for entry in row] for row, factor in zip(mass, of_rows, strict=True)]
    right = [_short(part / factor, v) for part, factor in zip(right, of_rows, strict=True)]
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
    determinant = minor(every, every)
    return [
        sympy.Add(*((-1) ** (i + j) * minor(without[j], without[i]) * right[j] for j in range(n)))
        / (determinant * of_columns[i])
        for i in range(n)
    ]


def _common_factor(expressions: list[sympy.Expr]) -> sympy.Expr:
    """Return the largest product of powers that is in all terms of all expressions."""
    import sympy

    terms = [t.as_powers_dict() for e in expressions if e != 0 for t in sympy.Add.make_args(sympy.expand(e)) if t != 0]
    bases = set(terms[0]).intersection(*terms[1:]) if terms else set()
    exponents = {base: [term[base] for term in terms] for base in bases if not base.is_number}
    return sympy.Mul(*(base ** min(powers) for base, powers in exponents.items() if all(p.is_number for p in powers)))


def _is_singular(matrix: list[list[sympy.Expr]]) -> bool:
    """Whether a matrix is singular everywhere, by its determinant at some places."""
    import mpmath

    def regular(*entries: Any) -> bool:
        n = len(matrix)
        rows = [entries[i * n : (i + 1) * n] for i in range(n)]
        bound = mpmath.fprod(max(abs(entry) for entry in row) for row in rows)
        return bool(bound > 0 and abs(mpmath.det(mpmath.matrix(rows))) > _NOTHING * bound)

    return not _somewhere(regular, [entry for row in matrix for entry in row])


def _differ(one: sympy.Expr, other: sympy.Expr) -> bool:
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


def _derivative(expression: sympy.Expr, symbol: sympy.Symbol) -> sympy.Expr:
    """Return a derivative without the terms at jumps of signs."""
    import sympy

    found = sympy.diff(expression, symbol)
    found = found.replace(sympy.Heaviside, lambda x, *_: (1 + sympy.sign(x)) / 2)
    found = found.replace(sympy.DiracDelta, lambda *_: sympy.Integer(0))
    if found.has(sympy.Derivative, sympy.re, sympy.im):
        raise DefinitionError("lagrangian", str(expression), f"an expression that has a derivative by {symbol.name!r}")
    return found


def _short(expression: sympy.Expr, v: list[sympy.Symbol]) -> sympy.Expr:
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
