"""Growth of trapping regions: ellipsoids as large as samples allow, cut by planes: docs/theory/basins.md."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.basins.attractors.pace import WORTH, approach
from saltus.errors import ConvergenceError

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

    from numpy.typing import NDArray

    from saltus.basins.attractors.found import AttractorOptions
    from saltus.basins.attractors.trapping import OrbitEllipsoids
    from saltus.ensemble.ensemble import Ensemble
    from saltus.ensemble.map_ensemble import MapEnsemble

__all__ = ["LEFT_OVER", "SOON", "Enlarging", "pieces"]

SOON = 256  # strobes within which motions from cut ellipsoids reach the whole ones

_GROWING = math.sqrt(2.0)  # factor of a region's level at each trial of a larger one

_LONG = 4  # strobes to reach the core from the whole ellipsoids, in units of `SOON`

LEFT_OVER = 3  # samples left over by lanes beyond which a trial is not worth its time

_FIRST = 16  # samples of the first batch; each batch is twice the last, as a motion left over by lanes takes long

_GROWN = 256  # samples that try a level of the whole ellipsoids
_SHRINKING = 0.8  # factor of a level from which samples leave

_ENOUGH = 64  # samples that leave a region after which planes are made

_PART = 4  # samples of a region for each one that tries a level with planes
_TRIES = 8  # rounds of cuts at such a trial, at most
_LAST_TRIES = 12  # rounds of cuts of the last region, at most

_MOST_PLANES = 32  # planes of one ellipsoid, at most
_LEAST_SHARE = 0.4  # share of an ellipsoid's volume that its planes leave, at least
_SHARE_SAMPLES = 4000  # points that measure this share

_LEAST = 2.0  # level over the core's below which none is measured, as samples would start in the core


class Enlarging:
    """The ellipsoids of one attractor, enlarged as far as the samples in them end in it.

    Parameters
    ----------
    ensemble : Ensemble
        Engine, which tells from which samples motions may start.
    settles : callable
        Called with states, shape (m, n), a region, and a number of strobes. Returns which motions come to the region
        within the strobes, and to no other attractor.
    widest : ndarray, shape (n,)
        Half widths beyond which an ellipsoid is not enlarged.
    others : ndarray, shape (m, n)
        States of other attractors, which must lie outside the region.
    rng : numpy.random.Generator
    options : AttractorOptions
        Longest follow-up of samples, and the places of planes relative to samples that end elsewhere.
    decay : float, optional
        Factor by which distances from the attractor shrink in a strobe: samples have as long as their approach takes.

    Attributes
    ----------
    samples : int
        Count of samples of the final region.
    """

    def __init__(
        self,
        ensemble: Ensemble | MapEnsemble,
        settles: Callable[[NDArray[np.float64], NDArray[np.int64], OrbitEllipsoids, int], NDArray[np.bool_]],
        widest: NDArray[np.float64],
        others: NDArray[np.float64],
        rng: np.random.Generator,
        options: AttractorOptions,
        decay: float = math.nan,
    ) -> None:
        self.ensemble, self.settles, self.widest, self.others = ensemble, settles, widest, others
        self.rng, self.options, self.decay = rng, options, decay
        self.samples = options.samples or _GROWN

    def grown(self, inner: OrbitEllipsoids) -> OrbitEllipsoids:
        """Return the largest ellipsoids without planes from which a few samples still come to the next smaller ones.

        Parameters
        ----------
        inner : OrbitEllipsoids
            Where samples contract.
        """
        region = inner
        while (larger := self._larger(region)) is not None:
            longest = self.patience(larger, region, min(self.options.longest, _LONG * SOON))
            leaving = self._leaving(larger, region, _GROWN, longest, enough=1)
            if leaving is None or len(leaving):
                break
            region = larger
        return region

    def verified(self, region: OrbitEllipsoids, inner: OrbitEllipsoids, core: OrbitEllipsoids) -> OrbitEllipsoids:
        """Return the largest ellipsoids, up to a size, from which all samples end in `core`.

        Parameters
        ----------
        region : OrbitEllipsoids
            The largest ellipsoids to try.
        inner : OrbitEllipsoids
            Where samples contract.
        core : OrbitEllipsoids
            Smaller ellipsoids in which motions count as settled.

        Raises
        ------
        ConvergenceError
            Samples end elsewhere from ellipsoids that are hardly larger than `core`.
        """
        soon = min(self.options.longest, _LONG * SOON)
        region = region.at(max(self.options.safety * region.level, inner.level))
        least = min(_LEAST * core.level, inner.level)
        while True:
            last = _SHRINKING * region.level < least
            longest = self.patience(region, core, soon)
            leaving = self._leaving(region, core, self.samples, longest, enough=1, patient=last)
            if leaving is not None and not len(leaving):
                return region
            region = region.at(_SHRINKING * region.level)
            if last:
                radius = math.sqrt(region.level)
                raise ConvergenceError("trapping region", radius, self.samples, "motions leave it", unit="samples")

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
            Ellipsoids from which samples end in the attractor.
        saved : callable
            Called with a smaller and a larger region, returns the time that the larger one saves.
        spent : callable
            Returns the time spent so far, in the same unit: growth ends once a level costs more than it saves.
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
        """Return `region` cut so that given states, shape (m, n), and samples that miss `whole` are outside."""
        cut = region.cut(x, math.sqrt(self.options.safety))
        found = self._cut(cut, whole, self.samples, _LAST_TRIES)
        return whole if found is None else found

    def elsewhere(self, region: OrbitEllipsoids, core: OrbitEllipsoids, samples: int) -> tuple[int, int]:
        """Return how many fresh samples in a region do not end in `core`, and from how many a motion may start."""
        bad, barred = self._bad(region, samples, core, self.patience(region, core, self.options.longest))
        return len(bad), samples - barred

    def patience(self, region: OrbitEllipsoids, within: OrbitEllipsoids, soon: int) -> int:
        """Return how many strobes motions have from one region to a smaller one: some, or as their decay asks."""
        return max(soon, min(approach(self.decay, math.sqrt(region.level / within.level)), WORTH))

    def _larger(self, region: OrbitEllipsoids) -> OrbitEllipsoids | None:
        larger = region.at(_GROWING * region.level)
        widths = larger.half_widths()
        if np.any(widths[:, larger.circles] > math.pi):  # it would meet itself on the other side
            return None
        return None if np.all(widths > self.widest) else larger

    def _leaving(
        self,
        region: OrbitEllipsoids,
        within: OrbitEllipsoids,
        samples: int,
        longest: int,
        enough: int,
        *,
        patient: bool = False,
    ) -> NDArray[np.float64] | None:
        """Return samples in a region whose motions do not end in `within`.

        The search for such samples ends at `enough`. None where lanes leave many motions over, unless it is patient.
        """
        work, left_over = self.ensemble.work.sum(), self.ensemble.left_over
        found = [self.others[region.holds(self.others)]]
        for count in pieces(samples):
            if sum(map(len, found)) >= enough:
                break
            found.append(self._bad(region, count, within, longest)[0])
            slow = self.ensemble.left_over > left_over + LEFT_OVER and self.ensemble.work.sum() > work
            if slow and not patient:
                return None
        return np.concatenate(found)

    def _bad(
        self, region: OrbitEllipsoids, count: int, within: OrbitEllipsoids, longest: int
    ) -> tuple[NDArray[np.float64], int]:
        """Return samples whose motions do not settle, and the count of those from which no motion may start."""
        x, modes = region.samples(count, self.rng), region.modes_of(count)
        x, modes = x[possible := self.ensemble.allowing(x, modes)], modes[possible]
        bad = ~self.settles(x, modes, within, longest)
        lost = int(bad.sum())
        bad[bad] = [self.ensemble.admits(row) for row in x[bad]]
        return x[bad], lost - int(bad.sum()) + count - len(x)

    def _cut(
        self, region: OrbitEllipsoids, within: OrbitEllipsoids, samples: int, tries: int
    ) -> OrbitEllipsoids | None:
        """Return a region cut until no sample leaves it; None where the planes leave too small a part."""
        for _ in range(tries):
            if region.offsets.shape[1] > _MOST_PLANES or region.share(_SHARE_SAMPLES, self.rng) < _LEAST_SHARE:
                return None
            x = self._leaving(region, within, samples, self.patience(region, within, SOON), enough=_ENOUGH)
            if x is None:
                return None
            if not len(x):
                return region
            region = region.cut(x, math.sqrt(self.options.safety))
        return None


def pieces(count: int) -> Iterator[int]:
    """Go through the sizes of the batches in which samples are followed."""
    size = _FIRST
    while count > 0:
        yield min(size, count)
        count, size = count - size, 2 * size
