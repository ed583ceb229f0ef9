"""Pairs of multipliers that turn past 1 and -1: whether they may have parted there, and products without them.

Multipliers of modes that ring between touches turn with the period. Each time that such a pair passes the real axis,
the products that vanish at 1 or at -1 dip. docs/theory/continuation.md, "Special points", explains the test.
"""

from __future__ import annotations

import cmath
import math
from typing import TYPE_CHECKING, NamedTuple

from saltus.continuation.core.locating import CROWDED
from saltus.continuation.problems.guards import INFINITE

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from saltus.continuation.core.monitor import Monitor

__all__ = ["Pair", "followed_pairs", "longest_step", "parting", "products"]

_COMPLEX = 1e-12  # least imaginary part of a multiplier of a pair, over its size
_FAR = 1.5  # angle in a step, in radians, from which on a pair is not followed
_NEARLY = 0.7  # share of that angle by which the next step may turn a pair
_SAFE = 2.0  # factor on the parting that a pair's angles leave room for
_LITTLE = 0.75  # change of an angle, over its distance from the axis, up to which it has not passed the axis
_MOST = 0.25 * _SAFE * math.pi**2  # most that a pair's angles leave room to part by, all of them as bad as can be
_FINE = 0.02  # angle in a step, in radians, up to which a pair that parts and comes back would be another one


class Pair(NamedTuple):
    """A pair of complex multipliers, followed through the real axis."""

    name: int
    value: complex  # the one above the axis
    angle: float  # of the one that is followed, in radians
    rate: float  # at which it turned in the step to here; NaN where it is not known
    bend: float  # by which the rate changes along the branch; 0 where it is not known
    step: float  # arclength of the step to here
    turned: float  # angle that it turned in the step to here, at most
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
        expected = _foretold(pair, step)
        place = cmath.rect(abs(pair.value), expected)
        for j, value in enumerate(above):
            side = value if abs(value - place) <= abs(value.conjugate() - place) else value.conjugate()
            off = math.remainder(cmath.phase(side) - expected, 2.0 * math.pi)
            ways.append((abs(side - place), i, j, expected + off, off))
    found: dict[int, Pair] = {}
    taken = set[int]()
    for _, i, j, angle, off in sorted(ways):
        if i in taken or j in found:
            continue
        taken.add(i)
        pair = before[i]
        known, turned = math.isfinite(pair.rate), abs(angle - pair.angle)
        if known:
            turns = _turns_on(pair, above[j], angle, abs(off))
        else:
            ends = _off_axis(pair.angle), _off_axis(angle)
            turns, turned = turned < _LITTLE * min(ends), max(turned, sum(ends))
        rate, bend = (angle - pair.angle) / step if turns and step > 0.0 else math.nan, 0.0
        if turns and known:
            bend = 2.0 * (rate - pair.rate) / (step + pair.step)
        steady = turns or _room(pair.value, above[j]) > _MOST
        found[j] = Pair(pair.name, above[j], angle, rate, bend, step, turned, steady)
    name = max((pair.name for pair in before), default=-1)
    for j, value in enumerate(above):
        if j not in found:
            name += 1
            found[j] = Pair(name, value, cmath.phase(value), math.nan, 0.0, step, 0.0, False)
    return tuple(sorted(found.values()))


def _foretold(pair: Pair, step: float) -> float:
    """Return the angle to which a pair turns in a step by its rate and the change of this; its own if not known."""
    if not math.isfinite(pair.rate):
        return pair.angle
    return pair.angle + (pair.rate + 0.5 * pair.bend * (pair.step + step)) * step


def longest_step(pairs: Sequence[Pair]) -> float:
    """Return the longest step in which no pair turns so far that it is not followed, as far as its rate tells."""
    turning = [pair for pair in pairs if math.isfinite(pair.rate) and _room(pair.value, pair.value) <= _MOST]
    return min((_step_to_turn(pair) for pair in turning), default=math.inf)


def _step_to_turn(pair: Pair) -> float:
    """Return the step in which a pair is foretold to turn as far as a step may turn it, by its rate and its bend."""
    most, bend = _NEARLY * _FAR, 0.5 * pair.bend
    rate = pair.rate + bend * pair.step
    if rate < 0.0:
        rate, bend = -rate, -bend
    steady = most / abs(pair.rate) if pair.rate != 0.0 else math.inf
    onward = rate * rate + 4.0 * bend * most
    if onward >= 0.0:
        total = rate + math.sqrt(onward)
        return min(steady, 2.0 * most / total) if total > 0.0 else steady
    # it turns back before, and passes as far on the other side
    return min(steady, (rate + math.sqrt(rate * rate - 4.0 * bend * most)) / (-2.0 * bend))


def _off_axis(angle: float) -> float:
    """Return how far an angle is from the real axis."""
    return abs(math.remainder(angle, math.pi))


def parting(pairs: Sequence[Pair]) -> str | None:
    """Return that one of the pairs may have parted to 1 or -1 and come back in the step to here; None if none may."""
    if any(not pair.steady and pair.turned > _FINE and pair.step > CROWDED for pair in pairs):
        return "events: a pair of multipliers may part to 1 or -1 and come back within the step"
    return None


def _turns_on(pair: Pair, value: complex, angle: float, off: float) -> bool:
    """Whether a pair has turned on to an angle, `off` the expected one, so that neither multiplier reached 1 or -1.

    Near the axis the cosine of a pair's angle is smooth. If it passes 1 by d, the pair parts, and angles a and b at
    both ends lack d / a and d / b.
    """
    first, last = math.floor(pair.angle / math.pi), math.floor(angle / math.pi)
    if abs(angle - pair.angle) > _FAR or abs(last - first) > 1:
        return False
    a, b = _off_axis(pair.angle), _off_axis(angle)
    if first == last:
        return off < min(a, b)
    return _SAFE * off * a * b < (a + b) * _room(pair.value, value)


def _room(first: complex, last: complex) -> float:
    """Return by how much the cosine of a pair's angle passes 1 at least where one of both reaches 1 or -1."""
    away = min(abs(abs(first) - 1.0), abs(abs(last) - 1.0))
    return away * away / (2.0 * max(abs(first), abs(last)))


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
