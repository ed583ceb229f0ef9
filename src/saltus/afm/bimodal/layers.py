"""A law's force as analytic terms over the gap, each with its derivatives, as functions of arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import sympy
from numpy.typing import NDArray

from saltus.afm.laws.common_regions import Product, product, sum_of
from saltus.afm.laws.law import Law
from saltus.errors import InputError
from saltus.system.expressions import parse

__all__ = ["Function", "Layers", "Memory", "Values", "layers_of"]

Values = Mapping[str, NDArray[np.float64]]
_STATES = ("D_nm", "V_nm_us")
_ALLOWED = "a law whose force depends on the gap, and on its rate in proportion"
_CHAIN = "a law whose regions lie one below the other"
_HINT = "one that depends on the past needs orbits: afm.model with Drive(mode=2, ratio='19/3')"


Function = Callable[..., Sequence[Any]]  # of numbers or arrays: a value and its derivatives


@dataclass(frozen=True)
class Memory:
    """What acts above a level, from where the tip rises through it until it comes to the level at which this ends."""

    level: int  # number of the level at which it begins
    end: Function  # of the parameters: the other level in nm, derivatives along them
    force: Function  # as those of `Layers`


@dataclass(frozen=True)
class Layers:
    """A force ``F(D) - gamma(D) V`` as a sum of terms, each of which acts above a level or below it.

    A term is a function of the gap and the parameters. It returns force, damping and their derivatives: first those
    along the gap, then those along each parameter. It is None where nothing acts.
    """

    names: tuple[str, ...]  # the law's parameters
    levels: tuple[Function, ...]  # of the parameters: level in nm, derivatives along them; the farthest first
    above: tuple[Function | None, ...]  # of each level; of a law without levels, what acts everywhere
    below: tuple[Function | None, ...]  # of each level
    memories: tuple[Memory, ...] = ()  # where regions end at another level than they begin

    def values(self, term: Function, D: NDArray[np.float64], p: Values) -> NDArray[np.float64]:
        """Values and derivatives of a term's force and damping, shape (2, 2 + parameter, *shape of D)."""
        with np.errstate(all="ignore"):
            found = term(D, *(p[name] for name in self.names))
        half = len(found) // 2
        out = np.empty((2, half, *D.shape))
        for place, value in enumerate(found):
            out[divmod(place, half)] = value
        return out

    def place(self, level: Function, p: Values) -> list[NDArray[np.float64]]:
        """A level and its derivatives along the parameters, each of the parameters' common shape."""
        shape = np.broadcast_shapes(*(np.shape(p[name]) for name in self.names), ())
        return [np.broadcast_to(one, shape) for one in level(*(p[name] for name in self.names))]


class _Step(NamedTuple):
    """A crossing on the way in."""

    # outer, inner, back: regions before it and behind it, and that in which the tip goes back above it
    outer: str
    inner: str
    back: str
    begin: str
    end: str  # level at which the outer region is met again


def layers_of(law: Law, R_nm: float) -> Layers:
    """Return the layers of a law; raise `InputError` where it has states of its own or bends with the rate."""
    made = product(law.parts, R_nm)
    if made.states:
        raise InputError("law", list(made.states), _ALLOWED, _HINT)
    forces = tuple((name, sum_of((one.force, one.impulse_force))) for name, one in made.regions.items())
    touching = frozenset(name for name, one in made.regions.items() if one.indentation)
    return _written(tuple(made.parameters), forces, touching, _steps(made))


def _steps(made: Product) -> tuple[_Step, ...]:
    """Return the crossings on the way in; raise `InputError` where the way out has others than theirs."""
    ends = {(one.source, one.target, one.direction): one.level for one in made.crossings}
    inwards = {one.source: one for one in made.crossings if one.direction < 0}
    region, used = next(iter(made.regions)), 0
    found: list[_Step] = []
    while region in inwards and len(found) < len(made.regions):
        inner, begin = inwards[region].target, inwards[region].level
        if end := ends.get((inner, region, 1)):
            back, used = inner, used + 2
        else:  # a law of the sum ends where it begins, another one later
            back = next((one for one in made.regions if ends.get((inner, one, 1)) == begin), "")
            end, used = ends.get((back, region, 1), ""), used + 4
            if not end or ends.get((back, inner, -1)) != begin:
                raise InputError("law", list(made.regions), _CHAIN, _HINT)
        found.append(_Step(region, inner, back, begin, end))
        region = inner
    if used != len(made.crossings):
        raise InputError("law", list(made.regions), _CHAIN, _HINT)
    return tuple(found)


@lru_cache(maxsize=32)
def _written(names: tuple[str, ...], forces: Any, touching: frozenset[str], steps: tuple[_Step, ...]) -> Layers:
    known = (*_STATES, *names)
    D, V, *p = (sympy.Symbol(name, real=True) for name in known)
    totals = {}
    for region, text in forces:
        force = parse(text, known, f"force in region {region!r}")
        damping = -sympy.diff(force, V)
        if damping.has(V):
            raise InputError("law", text, _ALLOWED, _HINT)
        totals[region] = sympy.Matrix([force.subs(V, 0), damping])

    def term(pair: sympy.Matrix) -> Function | None:
        if all(one == 0 for one in pair):
            return None
        values = [[one, *(sympy.diff(one, symbol) for symbol in (D, *p))] for one in pair]
        written: Function = sympy.lambdify([D, *p], [*values[0], *values[1]], "numpy", cse=True)
        return written

    def level(text: str) -> Function:
        place = parse(text, names, "level of a crossing")
        written: Function = sympy.lambdify(p, [place, *(sympy.diff(place, symbol) for symbol in p)], "numpy")
        return written

    memories = []
    for i, step in enumerate(steps):
        if step.end != step.begin and (force := term(totals[step.back] - totals[step.outer])):
            memories.append(Memory(i, level(step.end), force))
    whole = [totals[region] for region in (*(one.outer for one in steps), *(one.inner for one in steps[-1:]))]
    if not steps:
        return Layers(names, (), (term(totals[forces[0][0]]),), ())
    # formulas of regions apart hold farther off, and have poles nearer; those of regions in contact hold nearer
    apart = max(i for i, one in enumerate(steps) if i == 0 or one.outer not in touching)
    none = sympy.zeros(2, 1)
    above = [whole[i] - (whole[i + 1] if i < apart else none) if i <= apart else none for i in range(len(steps))]
    below = [whole[i + 1] - (whole[i] if i > apart else none) if i >= apart else none for i in range(len(steps))]
    return Layers(
        names,
        tuple(level(one.begin) for one in steps),
        tuple(map(term, above)),
        tuple(map(term, below)),
        tuple(memories),
    )
