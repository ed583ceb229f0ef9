"""Sliding along several surfaces at once, where there is one way to do so: as of frictions that stick together.

At an intersection of surfaces Filippov's convex combinations leave a choice. It makes no difference where two things
hold. The jumps of the field at the surfaces add up. Each surface is reached at rates that know nothing of the sides of
the others. Then each weight follows from its own surface, as if it were alone.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Callable

    import sympy

    Field = list[sympy.Expr]
    Along = Callable[[sympy.Expr, Field], sympy.Expr]

__all__ = ["ABOVE", "BELOW", "ON", "fields_at_intersections", "filled", "rates_at", "short", "with_sign"]

ABOVE = "+"
BELOW = "-"
ON = "0"
_LONG = 120  # operations of a quotient above which it is left as it is


def with_sign(word: str, i: int, sign: str) -> str:
    """Return a region's or sliding mode's word with another sign of surface i.

    Examples
    --------
    >>> with_sign("+-", 1, "0")
    '+0'
    """
    return word[:i] + sign + word[i + 1 :]


def filled(word: str, sign: str) -> str:
    """Return the region beside a sliding mode on one side of all its surfaces.

    Examples
    --------
    >>> filled("0-0", "+")
    '+-+'
    """
    return word.replace(ON, sign)


def rates_at(
    word: str, i: int, heights: list[sympy.Expr], known: Mapping[str, Field], along: Along
) -> tuple[sympy.Expr, sympy.Expr]:
    """Return the rates of surface i along the fields above and below it, beside a sliding mode."""
    above, below = (along(heights[i], known[filled(with_sign(word, i, sign), ABOVE)]) for sign in (ABOVE, BELOW))
    return above, below


def fields_at_intersections(
    heights: list[sympy.Expr],
    known: Mapping[str, Field],
    sliding: Mapping[str, Field],
    x: list[sympy.Symbol],
    along: Along,
    pull: sympy.Expr,
) -> dict[str, Field]:
    """Return the fields of motions that slide along several surfaces at once, where there is one way to do so.

    Parameters
    ----------
    heights : list of expressions
        The surfaces.
    known, sliding : mapping of str to field
        Fields of the regions, and of sliding along one surface.
    x : list of symbols
        The states.
    along : callable
        Rate of a function along a field.
    pull : expression
        As of `filippov`.
    """
    found = {}
    for word in _words(known, len(heights)):
        on = [i for i, sign in enumerate(word) if sign == ON]
        alone = all(filled(with_sign(word, i, "?"), ABOVE).replace("?", ON) in sliding for i in on)
        if alone and _is_decided(word, on, heights, known, x, along):
            found[word] = _field(word, on, heights, known, x, along, pull)
    return found


def _words(known: Mapping[str, Field], count: int) -> Iterator[str]:
    """Go through the intersections of two surfaces or more all of whose regions are known."""
    for size in range(2, count + 1):
        for on in itertools.combinations(range(count), size):
            words = {"".join(ON if i in on else sign for i, sign in enumerate(word)) for word in known}
            yield from sorted(word for word in words if all(region in known for region in _corners(word)))


def _corners(word: str) -> list[str]:
    """Return all regions beside a sliding mode."""
    choices = [(ABOVE, BELOW) if sign == ON else (sign,) for sign in word]
    return ["".join(signs) for signs in itertools.product(*choices)]


def _is_decided(
    word: str, on: list[int], heights: list[sympy.Expr], known: Mapping[str, Field], x: list[sympy.Symbol], along: Along
) -> bool:
    """Return whether jumps add up, rates at each surface know no other surface, and all are at right angles."""
    import sympy

    for i, j in itertools.permutations(on, 2):
        for sign in (ABOVE, BELOW):
            beside = [along(heights[i], known[region]) for region in _corners(with_sign(word, i, sign))]
            if any(sympy.expand(rate - beside[0]) != 0 for rate in beside[1:]):
                return False
        for region in _corners(with_sign(with_sign(word, i, ABOVE), j, ABOVE)):
            both, one, other, none = (
                known[with_sign(with_sign(region, i, a), j, b)] for a, b in itertools.product((ABOVE, BELOW), repeat=2)
            )
            if any(sympy.expand(p - q - r + s) != 0 for p, q, r, s in zip(both, one, other, none, strict=True)):
                return False
        if sympy.expand(sum(sympy.diff(heights[i], symbol) * sympy.diff(heights[j], symbol) for symbol in x)) != 0:
            return False
    return True


def _field(
    word: str,
    on: list[int],
    heights: list[sympy.Expr],
    known: Mapping[str, Field],
    x: list[sympy.Symbol],
    along: Along,
    pull: sympy.Expr,
) -> Field:
    """Return the field of an intersection: each surface has its own weight."""
    import sympy

    below = filled(word, BELOW)
    field = list(known[below])
    for i in on:
        rise, fall = rates_at(word, i, heights, known, along)
        weight = short(fall / (fall - rise))
        jump = [a - b for a, b in zip(known[with_sign(below, i, ABOVE)], known[below], strict=True)]
        slope = [sympy.diff(heights[i], symbol) for symbol in x]
        steep = sum(part**2 for part in slope)
        field = [
            rate + (weight * part if sympy.expand(part) != 0 else 0) - pull * heights[i] * toward / steep
            for rate, part, toward in zip(field, jump, slope, strict=True)
        ]
    return field


def short(expression: sympy.Expr) -> sympy.Expr:
    """Return a quotient in lowest terms where it is short: those of long polynomials take minutes, and are long."""
    import sympy

    if sympy.count_ops(expression) > _LONG:
        return expression
    return min(sympy.cancel(sympy.together(expression)), expression, key=sympy.count_ops)
