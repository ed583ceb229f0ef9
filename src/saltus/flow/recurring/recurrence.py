"""After how many returns a motion recurs: settled to the tolerance, or on its way there."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.scales import EPS

if TYPE_CHECKING:
    from collections.abc import Iterator

    from numpy.typing import NDArray

__all__ = ["Recurrence", "extent_of"]

_SMALLEST = 1e-3  # size of a state, over the largest one's, below which the state is nearly zero throughout
_SHRUNK = 0.9  # ratio of differences in the later half of the returns to the earlier, up to which they shrink
_STEADY = 0.8  # least ratio of the rate at which an extent shrinks later to that before: one that slows has a limit
_HALF = 0.5  # share of differences that is left, from which on they are believed to shrink for good
_LOOKS = 4  # returns at which a count is tried before all are looked at: few counts pass them


class Recurrence:
    """How far points are from those some returns later, in parts of each state's size, which is its least or more.

    Counts are tried at a few returns first, so that the work is in proportion to the points.
    """

    def __init__(self, cloud: NDArray[np.float64], rounding: NDArray[np.float64], recurrence: float) -> None:
        size = np.maximum(np.max(np.abs(cloud), axis=0), np.ptp(cloud, axis=0))
        size = np.maximum(size, np.maximum(rounding / recurrence, max(_SMALLEST * float(size.max()), 1e-300)))
        # rounding of a step may add up over the returns
        self.scaled, self.rounding = cloud / size, rounding / size + EPS * len(cloud)
        self.extent = extent_of(self.scaled)
        steps = np.max(np.abs(np.diff(self.scaled, axis=0)), axis=1)
        self.falling = bool(np.all(np.diff(steps) < 0.0))
        self.longest = max(len(cloud) // 4, min(len(cloud) - 1, 1))  # seen four times

    def settled(self, recurrence: float) -> int:
        """Returns after which the motion recurs, 0 where it does not.

        One that creeps on from each recurrence to the next may turn by nearly a fraction, or pass a bottleneck. It
        recurs only if its steps become shorter at a steady rate.
        """
        for count in self._counts(recurrence):
            apart = self._apart(count)
            if apart[len(apart) // 2 :].max() <= recurrence and (
                not self._creeps(count) or (_dies_out(apart) and self._keeps_up(count, apart))
            ):
                return count
        return 0

    def settling(self, rates: tuple[float, float], settling: float) -> int:
        """Returns after which it will recur, by the shrinking of the differences; 0 where they do not shrink.

        `rates`: the exponent, and that at which differences shrink at the fastest.
        """
        if self._shrinks(1, rates) and self._keeps_up(1, self._apart(1)):
            return 1
        near = settling * self.extent
        for count in self._counts(near):
            if count > 1 and self._shrinks(count, rates):
                apart = self._apart(count)
                if apart[len(apart) // 2 :].max() <= near and self._keeps_up(count, apart):
                    return count
        return 0

    def has_shrunk(self, count: int) -> bool:
        """Whether differences have become less by so much that no slowing of their rate is overlooked."""
        parts = [float(part.max(initial=0.0)) for part in np.array_split(self._apart(count), 3)]
        return parts[2] <= _HALF * parts[0]

    def _keeps_up(self, count: int, apart: NDArray[np.float64]) -> bool:
        """Whether the extent of the points goes where it does on more returns than one, or to 0 on one.

        It shrinks less than half as fast as the differences, or with them, as fast at the end as before.
        """
        extents = [extent_of(part) for part in np.array_split(self.scaled, 3)]
        if count == 1:
            return _is_steady(extents)
        thirds = [float(part.max(initial=0.0)) for part in np.array_split(apart, 3)]
        return extents[2] ** 2 * thirds[0] >= extents[0] ** 2 * thirds[2]

    def leaves(self, count: int, exponent: float) -> bool:
        """Whether a motion that nearly recurs goes away: differences grow at half the exponent, or faster."""
        apart = self._apart(count)
        parts = [float(part.max()) for part in np.array_split(apart, 4)]
        grown = math.exp(0.5 * exponent * 0.75 * len(apart))
        return bool(np.all(np.diff(parts) > 0.0)) and parts[3] >= grown * parts[0]

    def _counts(self, near: float) -> Iterator[int]:
        """Go through the counts after which the motion is near at a few returns of the second half."""
        n = len(self.scaled)
        counts = np.arange(1, self.longest + 1)
        for k in range(_LOOKS):
            ends = np.maximum(n - 1 - k * (n // (4 * _LOOKS)), counts)
            apart = np.max(np.abs(self.scaled[ends] - self.scaled[ends - counts]), axis=1)
            counts = counts[apart <= near]
        yield from counts.tolist()

    def _apart(self, count: int) -> NDArray[np.float64]:
        return np.asarray(np.max(np.abs(self.scaled[count:] - self.scaled[:-count]), axis=1))

    def _shrinks(self, count: int, rates: tuple[float, float]) -> bool:
        """Whether differences shrink steadily, at half the exponent or faster, but no more than twice as fast as it."""
        apart = self._apart(count)
        half = len(apart) // 2
        early, late = float(apart[:half].max(initial=0.0)), float(apart[half:].max())
        slow, fast = math.exp(0.5 * min(rates[0], 0.0) * half), math.exp(2.0 * min(rates[1], 0.0) * half)
        if not (count == 1 and self.falling):
            slow = min(slow, _SHRUNK)
        return half > 0 and fast * early <= late <= slow * early and late < early and _dies_out(apart)

    def _creeps(self, count: int) -> bool:
        """Whether differences after a count add up, beyond rounding: several counts on, the motion is as far again."""
        many = max((len(self.scaled) // 2) // count, 2)
        ends = np.arange(len(self.scaled) - 1, -1, -count)[: many + 1]
        steps = np.diff(self.scaled[ends], axis=0)
        gone = np.abs(steps.sum(axis=0))
        adds = gone >= 0.5 * np.abs(steps).sum(axis=0)
        return bool(np.any(adds & (gone > self.rounding)))


def _dies_out(apart: NDArray[np.float64]) -> bool:
    """Whether differences shrink at a steady rate, so that nothing is left of them."""
    return _is_steady([float(part.max(initial=0.0)) for part in np.array_split(apart, 3)])


def _is_steady(sizes: list[float]) -> bool:
    """Whether three sizes fall, by as large a factor at the end as before."""
    if sizes[2] == 0.0:
        return True
    if not sizes[0] > sizes[1] > sizes[2]:
        return False
    return math.log(sizes[1] / sizes[2]) >= _STEADY * math.log(sizes[0] / sizes[1])


def extent_of(cloud: NDArray[np.float64]) -> float:
    """Return the largest extent of points, 0 of none."""
    return float(np.ptp(cloud, axis=0).max()) if len(cloud) else 0.0
