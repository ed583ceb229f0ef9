"""A law's force as analytic layers over the gap, each with its derivatives, as functions of arrays."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise
from typing import Any

import numpy as np
import sympy
from numpy.typing import NDArray

from saltus.afm.laws.common_regions import Product, product, sum_of
from saltus.afm.laws.law import Law
from saltus.errors import InputError
from saltus.system.expressions import parse

__all__ = ["Layers", "Values", "layers_of"]

Values = Mapping[str, NDArray[np.float64]]
_STATES = ("D_nm", "V_nm_us")
_ALLOWED = "a law whose force depends on the gap, and on its rate in proportion"
_HINT = "one that depends on the past needs orbits: afm.model with Drive(mode=2, ratio='19/3')"


@dataclass(frozen=True)
class Layers:
    """A force ``F(D) - gamma(D) V``: layer 0 acts above the first level, and layer i below level i as an addition.

    `evaluate[i]` takes the gap and the parameters, and returns force, damping and their derivatives: first those
    along the gap, then those along each parameter.
    """

    names: tuple[str, ...]  # the law's parameters
    levels: tuple[Callable[..., Sequence[Any]], ...]  # of the parameters: level in nm, derivatives along them
    evaluate: tuple[Callable[..., Sequence[Any]], ...]  # layer 0, then one more than there are levels below it
    empty: tuple[bool, ...]  # layers without a force

    def layer(self, i: int, D: NDArray[np.float64], p: Values) -> NDArray[np.float64]:
        """Values and derivatives of a layer's force and damping, shape (2, 2 + parameter, *shape of D)."""
        with np.errstate(all="ignore"):
            found = self.evaluate[i](D, *(p[name] for name in self.names))
        half = len(found) // 2
        out = np.empty((2, half, *D.shape))
        for place, value in enumerate(found):
            out[divmod(place, half)] = value
        return out

    def level(self, i: int, p: Values) -> list[NDArray[np.float64]]:
        """A level and its derivatives along the parameters, each of the parameters' common shape."""
        shape = np.broadcast_shapes(*(np.shape(p[name]) for name in self.names), ())
        return [np.broadcast_to(one, shape) for one in self.levels[i](*(p[name] for name in self.names))]


def layers_of(law: Law, R_nm: float) -> Layers:
    """Return the layers of a law; raise `InputError` where its force depends on the past or bends with the rate."""
    made = product(law.parts, R_nm)
    if made.states:
        raise InputError("law", list(made.states), _ALLOWED, _HINT)
    key = (
        tuple(made.parameters),
        tuple((name, sum_of((one.force, one.impulse_force))) for name, one in made.regions.items()),
        tuple((one.source, one.target, one.level, one.direction) for one in made.crossings),
    )
    return _written(*key, _levels(made))


def _levels(made: Product) -> tuple[str, ...]:
    """Texts of the levels from the farthest; raise `InputError` where contact does not end where it begins."""
    order = list(made.regions)
    levels = []
    for outer, inner in pairwise(order):
        ends = {(one.source, one.target, one.direction): one.level for one in made.crossings}
        down, up = ends.get((outer, inner, -1)), ends.get((inner, outer, 1))
        if down is None or down != up:
            raise InputError("law", [outer, inner], "a law whose contact ends at the gap at which it begins", _HINT)
        levels.append(down)
    if len(made.crossings) != 2 * len(levels):
        raise InputError("law", order, "a law whose regions lie one below the other", _HINT)
    return tuple(levels)


@lru_cache(maxsize=32)
def _written(names: tuple[str, ...], forces: Any, crossings: Any, levels: tuple[str, ...]) -> Layers:
    known = (*_STATES, *names)
    D, V, *p = (sympy.Symbol(name, real=True) for name in known)
    totals = []
    for region, text in forces:
        force = parse(text, known, f"force in region {region!r}")
        damping = -sympy.diff(force, V)
        if damping.has(V):
            raise InputError("law", text, _ALLOWED, _HINT)
        totals.append((force.subs(V, 0), damping))
    changes = [totals[0], *((b[0] - a[0], b[1] - a[1]) for a, b in pairwise(totals))]
    if len(changes) > 1:
        changes[1] = totals[1]  # layer 0 ends at the first level
    evaluate, empty = [], []
    for pair in changes:
        values = [[one, *(sympy.diff(one, symbol) for symbol in (D, *p))] for one in pair]
        evaluate.append(sympy.lambdify([D, *p], [*values[0], *values[1]], "numpy", cse=True))
        empty.append(all(one == 0 for one in pair))
    places = []
    for text in levels:
        level = parse(text, names, "level of a crossing")
        places.append(sympy.lambdify(p, [level, *(sympy.diff(level, symbol) for symbol in p)], "numpy"))
    return Layers(names, tuple(places), tuple(evaluate), tuple(empty))
