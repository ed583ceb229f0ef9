"""A trapping region made as large as samples allow: an ellipsoid, cut by planes where motions from it end elsewhere."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.basins.attractors.trapping import admits_start
from saltus.errors import ConvergenceError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from saltus.basins.attractors.found import Search
    from saltus.basins.attractors.trapping import OrbitEllipsoids
    from saltus.ensemble.ensemble import Ensemble

__all__ = ["LEFT_OVER", "SOON", "Enlarging", "pieces"]

SOON = 256
"""Strobes within which motions from ellipsoids that are cut come to the whole ones."""

_GROWING = math.sqrt(2.0)
"""Ratio of the radii, squared, by which a region is enlarged."""

_LONG = 4
"""Times as many strobes within which those from the whole ones come to the core, most of them within as many."""

LEFT_OVER = 3
"""Samples that lanes leave over beyond which a trial is not worth its time."""

_FIRST = 16
"""Samples that are followed first, then twice as many: those that lanes leave over take a hundred times as long."""

_GROWN, _SHRINKING = 256, 0.8
"""Samples that try a level of the whole ellipsoids; its factor where samples leave."""

_ENOUGH = 64
"""Samples that leave a region of which planes are made before more are followed."""

_PART, _TRIES, _LAST_TRIES = 4, 8, 12
"""Part of the samples that tries a level with planes; rounds of cuts of such a one, of the last."""

_MOST_PLANES, _LEAST_SHARE, _SHARE_SAMPLES = 32, 0.4, 4000
"""Planes of one ellipsoid, and the least part of its volume that they leave; points that tell it."""

_LEAST = 2.0
"""Level over the core's below which none is measured: what starts in the core says nothing."""


class Enlarging:
    """The ellipsoids of one attractor, enlarged as far as the samples in them end in it.

    Parameters
    ----------
    ensemble : Ensemble
        Tells which samples may start.
    settles : callable
        Which of some states, shape (m, n), come to a region, told next, and to no other attractor, within some strobes,
        told last.
    widest : ndarray, shape (n,)
        Half widths beyond which an ellipsoid is not enlarged.
    others : ndarray, shape (m, n)
        States of other attractors, which no region may hold.
    rng : numpy.random.Generator
    search : Search
        How long samples are followed, and how near to those that end elsewhere planes are set.

    Attributes
    ----------
    samples : int
        How many samples are followed in the end.
    """

    def __init__(
        self,
        ensemble: Ensemble,
        settles: Callable[[NDArray[np.float64], OrbitEllipsoids, int], NDArray[np.bool_]],
        widest: NDArray[np.float64],
        others: NDArray[np.float64],
        rng: np.random.Generator,
        search: Search,
    ) -> None:
        self.ensemble, self.settles, self.widest, self.others = ensemble, settles, widest, others
        self.rng, self.search = rng, search
        self.samples = search.samples or _GROWN

    def grown(self, inner: OrbitEllipsoids) -> OrbitEllipsoids:
        """Return the ellipsoids, without planes, as large as a few samples in each still come to the next smaller ones.

        Parameters
        ----------
        inner : OrbitEllipsoids
            Where samples contract.
        """
        longest, region = min(self.search.longest, _LONG * SOON), inner
        while (larger := self._larger(region)) is not None:
            leaving = self._leaving(larger, region, _GROWN, longest, enough=1)
            if leaving is None or len(leaving):
                break
            region = larger
        return region

    def verified(self, region: OrbitEllipsoids, inner: OrbitEllipsoids, core: OrbitEllipsoids) -> OrbitEllipsoids:
        """Return the ellipsoids of a size, or of a smaller one, from which samples all end in `core`.

        Parameters
        ----------
        region : OrbitEllipsoids
            The largest that may be.
        inner : OrbitEllipsoids
            Where samples contract.
        core : OrbitEllipsoids
            The part of it in which motions are accounted for.

        Raises
        ------
        ConvergenceError
            Samples end elsewhere from ellipsoids that are hardly larger than `core`.
        """
        longest = min(self.search.longest, _LONG * SOON)
        region = region.at(max(self.search.safety * region.level, inner.level))
        while (leaving := self._leaving(region, core, self.samples, longest, enough=1)) is None or len(leaving):
            region = region.at(_SHRINKING * region.level)
            if region.level < min(_LEAST * core.level, inner.level):
                radius = math.sqrt(region.level)
                raise ConvergenceError("trapping region", radius, self.samples, "motions leave it", unit="samples")
        return region

    def beyond(
        self,
        whole: OrbitEllipsoids,
        saved: Callable[[OrbitEllipsoids, OrbitEllipsoids], float],
        spent: Callable[[], float],
    ) -> OrbitEllipsoids:
        """Return still larger ellipsoids, cut by planes so that samples in them all come to `whole`.

        Parameters
        ----------
        whole : OrbitEllipsoids
            Where samples end as they should.
        saved : callable
            What a larger region, told second, saves in all against a smaller one.
        spent : callable
            What has been spent so far, in the same unit: growth ends where a rung has cost more than it saves.
        """
        region = whole
        while (larger := self._larger(region)) is not None:
            before = spent()
            larger = self._cut(larger, region, max(self.samples // _PART, 100), _TRIES)
            if larger is None:
                break
            cost, smaller, region = spent() - before, region, larger
            if saved(smaller, larger) < cost:
                break
        while region.level > whole.level:
            if (found := self._cut(region, whole, self.samples, _LAST_TRIES)) is not None:
                return found
            region = region.at(_SHRINKING * region.level)
        return whole

    def without(self, region: OrbitEllipsoids, x: NDArray[np.float64], whole: OrbitEllipsoids) -> OrbitEllipsoids:
        """Return `region` without some states, shape (m, n), nor what samples show not to come to `whole`."""
        cut = region.cut(x, math.sqrt(self.search.safety))
        found = self._cut(cut, whole, self.samples, _LAST_TRIES)
        return whole if found is None else found

    def elsewhere(self, region: OrbitEllipsoids, core: OrbitEllipsoids, samples: int) -> int:
        """Return how many of fresh samples in a region do not end in `core`."""
        return len(self._bad(region.samples(samples, self.rng), core, self.search.longest))

    def _larger(self, region: OrbitEllipsoids) -> OrbitEllipsoids | None:
        larger = region.at(_GROWING * region.level)
        return None if np.all(larger.half_widths() > self.widest) else larger

    def _leaving(
        self, region: OrbitEllipsoids, within: OrbitEllipsoids, samples: int, longest: int, enough: int
    ) -> NDArray[np.float64] | None:
        """Samples in a region from which motions end elsewhere than `within`; None where lanes leave many over.

        No more are followed once there are enough.
        """
        work, left_over = self.ensemble.work.sum(), self.ensemble.left_over
        found = [self.others[region.holds(self.others)]]
        for count in pieces(samples):
            if sum(map(len, found)) >= enough:
                break
            found.append(self._bad(region.samples(count, self.rng), within, longest))
            if self.ensemble.left_over > left_over + LEFT_OVER and self.ensemble.work.sum() > work:
                return None
        return np.concatenate(found)

    def _bad(self, x: NDArray[np.float64], within: OrbitEllipsoids, longest: int) -> NDArray[np.float64]:
        bad = ~self.settles(x, within, longest)
        bad[bad] = [admits_start(self.ensemble, row) for row in x[bad]]
        return np.asarray(x[bad])

    def _cut(
        self, region: OrbitEllipsoids, within: OrbitEllipsoids, samples: int, tries: int
    ) -> OrbitEllipsoids | None:
        """A region without what leaves it, once no sample does; None where planes leave too little."""
        for _ in range(tries):
            if region.offsets.shape[1] > _MOST_PLANES or region.share(_SHARE_SAMPLES, self.rng) < _LEAST_SHARE:
                return None
            x = self._leaving(region, within, samples, SOON, enough=_ENOUGH)
            if x is None:
                return None
            if not len(x):
                return region
            region = region.cut(x, math.sqrt(self.search.safety))
        return None


def pieces(count: int) -> Iterator[int]:
    """Go through the sizes of the pieces in which some samples are followed."""
    size = _FIRST
    while count > 0:
        yield min(size, count)
        count, size = count - size, 2 * size
