"""A trapping region made as large as samples allow: an ellipsoid, cut by planes where motions from it end elsewhere."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.basins.trapping import admits_start
from saltus.errors import ConvergenceError

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from saltus.basins.recurrence import Search
    from saltus.basins.trapping import Ellipsoid
    from saltus.flow.ensemble import Ensemble

__all__ = ["SOON", "Enlarging"]

SOON = 256
"""Strobes within which motions from ellipsoids that are cut come to the whole ones."""

_GROWING, _GROWTHS = math.sqrt(2.0), 120
"""Ratio of the radii, squared, by which a region is enlarged; how often at most."""

_SHARE, _SHRINKING = 20, 0.8
"""Part of the samples that tries a level of the whole ellipsoids; its factor where samples leave."""

_PART, _TRIES, _LAST_TRIES = 4, 8, 12
"""Part of the samples that tries the last whole level, and each with planes; how often that is cut; and the last one."""

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
    rng : numpy.random.Generator
    search : Search
        How many samples are followed in the end, how long, and how near to those that end elsewhere planes are set.
    """

    def __init__(
        self,
        ensemble: Ensemble,
        settles: Callable[[NDArray[np.float64], Ellipsoid, int], NDArray[np.bool_]],
        widest: NDArray[np.float64],
        rng: np.random.Generator,
        search: Search,
    ) -> None:
        self.ensemble, self.settles, self.widest, self.rng, self.search = ensemble, settles, widest, rng, search

    def whole(self, inner: Ellipsoid, core: Ellipsoid) -> Ellipsoid:
        """Return the ellipsoids, without planes, so large that samples in them still all end in `core`.

        Parameters
        ----------
        inner : Ellipsoid
            Where samples contract.
        core : Ellipsoid
            The part of it in which motions are accounted for.

        Raises
        ------
        ConvergenceError
            Samples end elsewhere from ellipsoids that are hardly larger than `core`.
        """
        samples, longest = max(self.search.samples // _PART, 100), self.search.longest
        few = max(self.search.samples // _SHARE, 100)
        region = inner
        for _ in range(_GROWTHS):
            larger = self._larger(region)
            if larger is None or len(self._leaving(larger, region, few, longest)[0]):
                break
            region = larger
        while len(self._leaving(region, core, samples, longest)[0]):
            region = region.at(_SHRINKING * region.level)
            if region.level < min(_LEAST * core.level, inner.level):
                raise ConvergenceError(
                    "trapping region", math.sqrt(region.level), samples, "motions leave it", unit="samples"
                )
        return region

    def beyond(self, whole: Ellipsoid) -> Ellipsoid:
        """Return still larger ellipsoids, cut by planes so that samples in them all come to `whole`."""
        region = whole
        while (larger := self._larger(region)) is not None:
            larger = self._cut(larger, region, max(self.search.samples // _PART, 100), _TRIES)
            if larger is None:
                break
            region = larger
        while region.level > whole.level:
            if (found := self._cut(region, whole, self.search.samples, _LAST_TRIES)) is not None:
                return found
            region = region.at(_SHRINKING * region.level)
        return whole

    def without(self, region: Ellipsoid, x: NDArray[np.float64], whole: Ellipsoid) -> Ellipsoid:
        """Return `region` without some states, shape (m, n), nor what samples show not to come to `whole`."""
        found = self._cut(self._parted(region, x, region.about(x)), whole, self.search.samples, _LAST_TRIES)
        return whole if found is None else found

    def measured(self, region: Ellipsoid, core: Ellipsoid, samples: int) -> int:
        """Return how many of fresh samples in a region do not end in `core`: none of those by which it was made."""
        return len(self._leaving(region, core, samples, self.search.longest)[0])

    def _larger(self, region: Ellipsoid) -> Ellipsoid | None:
        larger = region.at(_GROWING * region.level)
        return None if np.all(larger.half_widths() > self.widest) else larger

    def _leaving(
        self, region: Ellipsoid, within: Ellipsoid, samples: int, longest: int
    ) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """Samples in a region from which motions end elsewhere than `within`, and about which point each lies."""
        x, which = region.samples(samples, self.rng)
        bad = ~self.settles(x, within, longest)
        bad[bad] = [admits_start(self.ensemble, row) for row in x[bad]]
        return x[bad], which[bad]

    def _cut(self, region: Ellipsoid, within: Ellipsoid, samples: int, tries: int) -> Ellipsoid | None:
        """A region without what leaves it, once no sample does; None where planes leave too little."""
        for _ in range(tries):
            if region.offsets.shape[1] > _MOST_PLANES or region.share(_SHARE_SAMPLES, self.rng) < _LEAST_SHARE:
                return None
            x, which = self._leaving(region, within, samples, SOON)
            if not len(x):
                return region
            region = self._parted(region, x, which)
        return None

    def _parted(self, region: Ellipsoid, x: NDArray[np.float64], which: NDArray[np.int64]) -> Ellipsoid:
        return region.cut(x, which, math.sqrt(self.search.safety))
