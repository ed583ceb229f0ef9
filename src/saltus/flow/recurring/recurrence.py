"""After how many returns a motion recurs: settled to the tolerance, or on its way there."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.recurring.rivals import dies, prime_factors
from saltus.scales import EPS, NO_NEARER, Verdict

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

        One that creeps on from each recurrence to the next may turn by nearly a fraction, or pass a bottleneck. It does
        not recur, unless it is `settling`.
        """
        creeping: list[int] = []
        for count in self._counts(recurrence):
            if any(count % other == 0 for other in creeping):
                continue
            apart = self._apart(count)
            if apart[len(apart) // 2 :].max() <= recurrence:
                if not self._creeps(count):
                    return count
                creeping.append(count)
        return 0

    def settling(self, rates: tuple[float, float, float], settling: float, recurrence: float) -> int:
        """Returns after which it will recur, by the shrinking of the differences; 0 where they do not shrink.

        `rates`: the exponent, that at which differences shrink at the fastest, and that at the slowest.
        """
        if self._shrinks(1, rates, recurrence) and self._keeps_up() and self._has_come(1, settling):
            return 1
        near = settling * self.extent
        failed = [1]
        for count in self._counts(max(near, recurrence)):
            if any(count % other == 0 and self._is_no_nearer(count, other) for other in failed):
                continue
            apart = self._apart(count)
            is_near = apart[len(apart) // 2 :].max() <= max(near, recurrence)
            if is_near and self._shrinks(count, rates, recurrence) and self._has_come(count, settling):
                return count
            failed.append(count)
        return 0

    def _has_come(self, count: int, settling: float) -> bool:
        """Whether a motion that settles has come far, or has little left to go, by the rate at which it settles.

        One that turns by nearly a fraction settles as little as it turns. Where it alternates, twice the count tells.
        """
        counts = [count, 2 * count][: 1 + (2 * count <= self.longest)]
        return any(self._halves(one) or self._left(one) <= settling for one in counts)

    def _halves(self, count: int) -> bool:
        """Whether differences shrink to half over all the points."""
        early, late = (float(part.max(initial=0.0)) for part in np.array_split(self._apart(count), 2))
        return late**2 <= _HALF * early**2

    def _left(self, count: int) -> float:
        """How far a motion will go in steps of so many returns, if they go on to shrink as they do."""
        early, late = (float(part.max(initial=0.0)) for part in np.array_split(self._apart(count), 2))
        if not early > late:
            return math.inf
        if late == 0.0:
            return 0.0
        halves = 2.0 * count / max(len(self.scaled) - count, 1)  # of the distances, that a step takes
        return late / -math.expm1(-halves * math.log(early / late))

    def _is_no_nearer(self, count: int, other: int) -> bool:
        """Whether the last point is no nearer to the one a count earlier than to that another count earlier."""
        apart = [float(np.max(np.abs(self.scaled[-1] - self.scaled[-1 - earlier]))) for earlier in (count, other)]
        return apart[0] >= NO_NEARER * apart[1]

    def least(self, count: int) -> tuple[int, int]:
        """Return the fewest returns after which a motion recurs that settles to recur after so many, and its rival.

        The rival is a count of returns that may be the period as well, 0 where there is none.
        """
        rounding = float(self.rounding.max())
        for factor in prime_factors(count):
            verdict = dies(self._apart, count // factor, count, rounding)
            if verdict is not Verdict.NO:
                return self.least(count // factor) if verdict else (count // factor, count)
        if 2 * count > self.longest:
            return count, 0
        verdict = dies(self._apart, count, 2 * count, rounding)
        if verdict is Verdict.NO:
            return self._doubled(2 * count, rounding)
        return count, 0 if verdict else 2 * count

    def _doubled(self, count: int, rounding: float) -> tuple[int, int]:
        """Return what `least` does where no part of the count is the period."""
        while 2 * count <= self.longest:
            verdict = dies(self._apart, count, 2 * count, rounding)
            if verdict is not Verdict.NO:
                return count, 0 if verdict else 2 * count
            count *= 2
        return count, 0

    def has_shrunk(self, count: int) -> bool:
        """Whether differences have become less by so much that no slowing of their rate is overlooked."""
        parts = [float(part.max(initial=0.0)) for part in np.array_split(self._apart(count), 3)]
        return parts[2] <= _HALF * parts[0]

    def _keeps_up(self) -> bool:
        """Whether the extent of the points goes to 0, as fast at the end as before."""
        return _is_steady([extent_of(part) for part in np.array_split(self.scaled, 3)])

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

    def _shrinks(self, count: int, rates: tuple[float, float, float], recurrence: float) -> bool:
        """Whether differences shrink steadily, at half the exponent or faster, but no more than twice as fast as it.

        Where the exponent does not tell that they shrink, or they are large, they have to do so clearly.
        """
        apart = self._apart(count)
        half = len(apart) // 2
        early, late = float(apart[:half].max(initial=0.0)), float(apart[half:].max())
        slow, fast = math.exp(0.5 * min(rates[0], 0.0) * half), math.exp(2.0 * min(rates[1], 0.0) * half)
        if rates[2] >= 0.0 or not (late <= recurrence or (count == 1 and self.falling)):
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
