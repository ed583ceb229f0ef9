"""Windows of a way without a followed motion: a motion is carried on along the parameter, place after place."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from saltus.afm.models.settling import periods_of_decay, recurs
from saltus.continuation import Branch
from saltus.errors import SaltusError
from saltus.flow.poincare import iterate
from saltus.orbits import PeriodicOrbit, find_orbit

__all__ = ["Window", "carried_on"]

_FIRST = 5e-4  # first step beyond the end of a stretch, over the range
_GROWTH = 1.35  # ratio of a step and the one before
_LARGEST = 0.025  # largest step, over the range
_DISCARDED = 4.0  # periods at each place that are not looked at, over those in which a free motion falls to 1/e
_FEWEST = 100  # periods at each place that are not looked at, at the least
_KEPT = 100  # periods at each place in which a motion is to repeat
_TOLERANCE = (1e-8, 1e-10)  # of steps; the orbit is solved for anew
_TURNS = 4  # periods of the longest orbit that is found: sheets of longer ones are not followed


class Window(NamedTuple):
    """A part of a way without a motion that is followed."""

    # begin, end: the parameter where the last motion ends, and where the next one is met
    begin: float
    end: float
    words: str  # what the motion does behind its begin


def carried_on(branch: Branch, value: float, before: PeriodicOrbit, end: float, span: float) -> Iterator[PeriodicOrbit]:
    """Yield the orbits of few periods on which a motion settles that is carried from a value to the end of a range.

    A branch keeps what was found, as the ways of a curve are sought again after each new sheet.

    Parameters
    ----------
    branch : Branch
        The branch that ends at the value.
    before : PeriodicOrbit
        Its last motion.
    span : float
        Width of the range, over which steps are measured.
    """
    kept: dict[tuple[float, float, bytes], _March] = vars(branch).setdefault("_marches", {})
    asked = (value, end, before.x0.tobytes())
    if asked not in kept:
        kept[asked] = _March([], _motions(branch, value, before, end, span))
    found, ahead = kept[asked]
    k = 0
    while True:
        if k == len(found):
            following = next(ahead, None)
            if following is None:
                return
            found.append(following)
        yield found[k]
        k += 1


class _March(NamedTuple):
    """The orbits that were found, and the search for further ones."""

    found: list[PeriodicOrbit]
    ahead: Iterator[PeriodicOrbit]


def _motions(branch: Branch, value: float, before: PeriodicOrbit, end: float, span: float) -> Iterator[PeriodicOrbit]:
    system, name, parameters = branch.system, branch.parameter, before.parameters
    discarded = max(_FEWEST, int(_DISCARDED * periods_of_decay(parameters)))
    x, mode = before.x0, system.mode_index(before.segments[0].mode)
    longest = max(_TURNS, before.form.turns)
    for place in _places(value, end, span):
        there = {**parameters, name: place}
        try:
            seen = iterate(
                system, system.parameter_vector(there), x, mode, discard=discarded, keep=_KEPT, tolerance=_TOLERANCE
            )
        except SaltusError:
            return
        x, mode = seen.x_end, seen.mode_end
        if not recurs(system, there, seen, longest):
            continue
        try:
            yield find_orbit(system, there, x, mode=system.mode_names[mode], settle=1.0)
        except SaltusError:
            continue


def _places(value: float, end: float, span: float) -> Iterator[float]:
    """Yield places from a value, exclusive, to the end of a range."""
    sign = 1.0 if end > value else -1.0
    step = _FIRST * span
    place = value + sign * step
    while sign * (end - place) > 0.0:
        yield place
        step = min(_GROWTH * step, _LARGEST * span)
        place += sign * step
    yield end
