"""Pairs of multipliers that turn past 1 and -1: what they leave of products of multipliers' distances.

Multipliers of modes that ring between touches turn with the period. Each time that such a pair passes the real axis,
the products that vanish at 1 or at -1 dip. docs/theory/continuation.md, "Special points", explains the test.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, NamedTuple

from saltus.continuation.problems.guards import INFINITE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from saltus.continuation.core.monitor import Monitor

__all__ = ["Pair", "followed_pairs", "products"]

_COMPLEX = 1e-12  # least imaginary part of a multiplier of a pair, over its size
_FAR = 1.5  # angle in a step, in radians, from which on a pair is not followed
_SAFE = 2.0  # factor on the parting that a pair's angles leave room for


class Pair(NamedTuple):
    """A pair of complex multipliers, followed through the real axis."""

    name: int
    value: complex  # the one above the axis
    angle: float  # of the one that is followed, in radians
    rate: float  # at which it turns along the branch; NaN where it is not known
    steady: bool  # whether it turned on in the step to here, so that neither reached 1 or -1


def followed_pairs(before: Sequence[Pair], values: Sequence[complex], step: float) -> tuple[Pair, ...]:
    """Return the pairs among multipliers, followed from those at the point before by the rates at which they turned.

    Parameters
    ----------
    before : sequence of Pair
        Pairs at the point before.
    values : sequence of complex
        Multipliers.
    step : float
        Arclength from the point before.
    """
    above = [value for value in values if value.imag > _COMPLEX * abs(value)]
    ways = []
    for i, pair in enumerate(before):
        expected = pair.angle + (pair.rate * step if math.isfinite(pair.rate) else 0.0)
        for j, value in enumerate(above):
            angle = math.atan2(value.imag, value.real)
            off = min((math.remainder(side - expected, 2.0 * math.pi) for side in (angle, -angle)), key=abs)
            ways.append((abs(off), i, j, expected + off))
    found: dict[int, Pair] = {}
    taken = set[int]()
    for off, i, j, angle in sorted(ways):
        if i in taken or j in found:
            continue
        taken.add(i)
        pair = before[i]
        steady = math.isfinite(pair.rate) and _turns_on(pair, above[j], angle, off)
        found[j] = Pair(pair.name, above[j], angle, (angle - pair.angle) / step if step > 0.0 else math.nan, steady)
    name = max((pair.name for pair in before), default=-1)
    for j, value in enumerate(above):
        if j not in found:
            name += 1
            found[j] = Pair(name, value, math.atan2(value.imag, value.real), math.nan, False)
    return tuple(sorted(found.values()))


def _turns_on(pair: Pair, value: complex, angle: float, off: float) -> bool:
    """Whether a pair has turned on to an angle, `off` the expected one, so that neither multiplier reached 1 or -1.

    Near the axis the cosine of a pair's angle is smooth. If it passes 1 by d, the pair parts, and angles a and b at
    both ends lack d / a and d / b.
    """
    first, last = math.floor(pair.angle / math.pi), math.floor(angle / math.pi)
    if abs(angle - pair.angle) > _FAR or abs(last - first) > 1:
        return False
    a, b = (abs(math.remainder(end, math.pi)) for end in (pair.angle, angle))
    if first == last:
        return off < min(a, b)
    away = min(abs(abs(pair.value) - 1.0), abs(abs(value) - 1.0))
    return _SAFE * off * a * b < (a + b) * away * away / (2.0 * abs(value))


def products(
    pairs: Sequence[Pair], values: Sequence[complex], places: Mapping[Monitor, float]
) -> dict[Monitor, tuple[tuple[int, ...], float]]:
    """Return for each monitor which pairs turned on, and the product of all others' differences from a real number.

    There are none where a multiplier is infinite.

    Parameters
    ----------
    pairs : sequence of Pair
        What `followed_pairs` returns.
    values : sequence of complex
        All multipliers.
    places : mapping of Monitor to float
        The numbers, 1 or -1.
    """
    if not all(abs(value) < INFINITE for value in values):
        return {}
    steady = [pair for pair in pairs if pair.steady]
    names = tuple(pair.name for pair in steady)
    apart = {pair.value for pair in steady} | {pair.value.conjugate() for pair in steady}
    others = [value for value in values if value not in apart]
    return {
        monitor: (names, math.prod((value - at for value in others), start=1.0 + 0.0j).real)
        for monitor, at in places.items()
    }
