"""Events of one instant: a segment that lasts no longer than the error of its time, and whether its events commute."""

from __future__ import annotations

from typing import TYPE_CHECKING, Protocol

import numpy as np

from saltus.orbits.signature import EVENT_END, MEAN_END
from saltus.scales import Verdict, zero

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from saltus.orbits.signature import Signature
    from saltus.verification.motion import Piece
    from saltus.verification.reference import Reference

__all__ = ["Followed", "without_length"]


class Followed(Protocol):
    """What is asked here of an orbit that was followed."""

    @property
    def reference(self) -> Reference:
        """The system."""

    @property
    def sizes(self) -> NDArray[np.float64]:
        """Sizes of the states, shape (states,)."""

    @property
    def pieces(self) -> tuple[Piece, ...]:
        """The segments."""

    @property
    def growth(self) -> NDArray[np.float64]:
        """By how much errors of each segment grow up to its end, shape (segments,)."""

    @property
    def error(self) -> float:
        """What the flow leaves of its tolerance for each unit of growth."""


def without_length(found: Followed, form: Signature, i: int, duration: float) -> Verdict:
    """Return whether a segment that does not last is none: both its events are of one instant, in either order.

    The instant is known to the error of the state over the rate at which the event is met. *No* where the duration is
    clearly negative; it cannot be told where the order of the events matters.
    """
    reference, k = found.reference, form.transitions[i]
    if not (form.kinds[i] in (EVENT_END, MEAN_END) and form.kinds[i - 1] in (EVENT_END, MEAN_END)):
        return Verdict.NO
    start = found.pieces[i].states[:, 0]
    gradient = reference.event_slope(k, start)
    rate = abs(float(gradient @ reference.field(form.modes[i], start)))
    met = found.error * float(found.growth[i - 1]) * float(np.abs(gradient) @ found.sizes)
    if rate == 0.0 or zero(rate * duration, met) is Verdict.NO:
        return Verdict.NO
    return Verdict.YES if _commute(found, form, i) else Verdict.UNCLEAR


def _commute(found: Followed, form: Signature, i: int) -> bool:
    """Return whether the events before and behind a segment without length lead to one state in either order."""
    reference, ways = found.reference, found.reference.system.transitions
    one, other = form.transitions[i - 1], form.transitions[i]
    before = found.pieces[i - 1].end
    told = _behind(reference, (one, other), before)
    error = found.error * float(found.growth[i - 1]) * found.sizes
    for first in _like(reference, other, ways[one].source):
        for second in _like(reference, one, ways[first].target):
            if ways[second].target != ways[other].target:
                continue
            turned = _behind(reference, (first, second), before)
            if np.all(np.abs(turned - told) <= error):
                return True
    return False


def _like(reference: Reference, k: int, source: str) -> Sequence[int]:
    """Return the transitions that leave a mode as a given one leaves its own: by its event and reset."""
    ways = reference.system.transitions
    own = ways[k].event, ways[k].direction, dict(ways[k].reset)
    return [
        j for j, way in enumerate(ways) if way.source == source and (way.event, way.direction, dict(way.reset)) == own
    ]


def _behind(reference: Reference, both: tuple[int, int], x: NDArray[np.float64]) -> NDArray[np.float64]:
    for k in both:
        x = reference.reset(k, x)
    return x
