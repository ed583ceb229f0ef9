"""Fields of mechanical systems: the accelerations that a mass matrix and forces, or a Lagrangian, give.

docs/theory/system.md has the equations.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

from saltus.errors import DefinitionError, nearest
from saltus.system.accelerations import accelerations, derivative, differ, is_singular, short
from saltus.system.expressions import NAME, Names, check_name, parse, text_of

if TYPE_CHECKING:
    import sympy

__all__ = ["Held", "lagrangian_field", "mass_matrix_field"]

_MOST = 5  # coordinates: a determinant has a number of terms that grows as the factorial
_NO_CALL = re.compile(NAME.pattern + r"(?!\w|\s*\()")  # a name in a text that is not the name of a function there


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
    from sympy.core.function import AppliedUndef

    if isinstance(lagrangian, sympy.Expr) and lagrangian.has(sympy.Derivative, AppliedUndef):
        wanted = "an expression in symbols of coordinates and velocities"
        raise DefinitionError("lagrangian", str(lagrangian), wanted, "q and v in place of q(t) and its derivative")
    pairs = _pairs(velocities)
    given = {} if forces is None else _forces(forces, pairs, complete=False)
    sub = {} if let is None else dict(_mapping(let, "let", "a mapping of names to expressions"))
    clock = None if phase is None else _clock(phase)
    named = {"lagrangian": lagrangian, **_named("force of", given), **_named("let", sub)}
    reader = _Reader(pairs, {**named, "phase": "0" if clock is None else f"{clock[0]} + {clock[1]}"}, sub)
    q, v = reader.symbols(pairs), reader.symbols(pairs.values())
    energy = short(reader.read(lagrangian, "lagrangian"), v)
    momenta = [derivative(energy, symbol) for symbol in v]
    for symbol, momentum in zip(v, momenta, strict=True):
        if not derivative(momentum, symbol).free_symbols | {*momentum.free_symbols} & set(v):
            raise _without_energy(lagrangian, f"{symbol.name!r} has none")
    rates = dict(zip(q, v, strict=True))
    if clock is not None:
        rates[sympy.Symbol(clock[0], real=True)] = reader.read(clock[1], "phase")
    mass = [[derivative(momentum, symbol) for symbol in v] for momentum in momenta]
    right = [
        derivative(energy, symbol)
        - sympy.Add(*(derivative(momentum, one) * rate for one, rate in rates.items()))
        + reader.read(given.get(symbol.name, 0), f"force of {symbol.name!r}")
        for symbol, momentum in zip(q, momenta, strict=True)
    ]
    if is_singular(mass):
        raise _without_energy(lagrangian, "its mass matrix is singular everywhere")
    known = {*rates, *v}
    held = Held(
        frozenset(one.name for momentum in momenta for one in momentum.free_symbols - known),
        frozenset(name for one in (lagrangian, *sub.values()) for name in _NO_CALL.findall(text_of(one, "let")))
        - set(sub),
        clock,
    )
    return _field(pairs, accelerations(mass, right, v)), held


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
            if differ(read[i][j], read[j][i]):
                value = f"{rows[i][j]} and {rows[j][i]}"
                raise DefinitionError("mass", value, f"symmetric, but mass[{i}][{j}] and mass[{j}][{i}] differ")
    if is_singular(read):
        allowed = "a matrix that is not singular everywhere"
        raise DefinitionError("mass", str(read), allowed, "its determinant is 0 whatever the coordinates are")
    right = [reader.read(given[name], f"force of {name!r}") for name in pairs]
    return _field(pairs, accelerations(read, right, reader.symbols(pairs.values())))


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


def _field(pairs: dict[str, str], found: list[sympy.Expr]) -> dict[str, str]:
    rates = {v: text_of(rate, f"rate of {v!r}") for v, rate in zip(pairs.values(), found, strict=True)}
    return {**pairs, **rates}
