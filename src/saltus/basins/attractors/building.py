"""Trapping regions of attractors, made and measured within the time that labelling all motions takes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.basins.attractors.found import FEWEST_SAMPLES, LIMIT_CYCLE
from saltus.basins.attractors.pace import SAFETY, WORTH, approach
from saltus.basins.attractors.trap_growth import LEFT_OVER, SOON, Enlarging, pieces
from saltus.basins.attractors.trapping import CONTRACTING, OrbitEllipsoids
from saltus.basins.attractors.visited_boxes import boxes_along
from saltus.basins.wilson import wilson
from saltus.ensemble.traps import UNDECIDED, Cages, Cells, Ellipsoids, Traps
from saltus.errors import ConvergenceError
from saltus.result import frozen

if TYPE_CHECKING:
    from collections.abc import Container, Mapping

    from numpy.typing import NDArray

    from saltus.basins.attractors.following import FollowedMotions
    from saltus.basins.attractors.found import Found

__all__ = ["Building"]

_VISITS = 16  # strobes in a row in its boxes that make a motion an attractor's, at first
_MOST_VISITS = 256  # the same after the last doubling
_LONGER = 8  # factor by which the check of the boxes' rule needs more strobes in a row

_ALONG = 20_000  # states along a cycle of which its boxes are made

_ENTERING = 8  # rounds in which motions from the region enter the ellipsoids, at most

_TOLERATED = 1e-3  # share of the samples of cut ellipsoids that may end elsewhere

_LEFT = 0.05  # share of the motions labelled by boxes beyond which, if they leave, the boxes hold a transient

_REGION_SAMPLES = 5  # samples of an ellipsoid for each motion that checks the boxes' rule


_TIMES = 6.0  # time for measuring regions, planes aside, over the time for labelling all motions, at most

_MOST_SAMPLES = 20_000  # the same, at most

_LEAST_SAMPLES = 100  # the same of attractors so slow that more would take minutes
_ROUNDS = 20  # rounds of samples that making a region takes

_FAR = 100.0  # distance of motions from an attractor, over the size of its region

_PILOT = 64  # motions that tell how much time others take
_PILOT_LONGEST = 1024  # strobes for which such a motion is followed, at most

_TO_THE_CORE = 2.0  # times that each sample is followed to a core, for an estimate of the time
_ENTRIES = 2.0  # times that as many motions are followed until they enter, for the same estimate
_PASSES = 3  # times that each sample is followed, for the total of a progress bar


class Building:
    """Trapping regions of attractors in the order of their labels, a note on each, and the largest error.

    `transients` are the labels of attractors that turned out to be transients.
    """

    def __init__(self, search: FollowedMotions, found: list[Found]) -> None:
        self.search, self.found = search, found
        self.notes: dict[int, str] = {}
        self.error = 0.0
        self.transients: set[int] = set()
        self.cores = {label: each.core for label, each in enumerate(found) if each.core is not None}
        self.wholes: dict[int, OrbitEllipsoids] = {}
        self.ellipsoids: dict[int, OrbitEllipsoids] = {}
        self.cells: Cells | None = None
        self.samples = FEWEST_SAMPLES
        # strobes for which motions are followed: as given, or as long as the slowest attractor asks for
        slowest = max((approach(each.decay, _FAR) for each in found), default=0)
        worth = int(search.budget / max(search.options.starts, 1))
        self.longest = max(search.options.longest, min(slowest, WORTH, worth))
        self.pilots: NDArray[np.float64] | None = None

    def traps(self) -> Traps:
        """Return all trapping regions."""
        begun = self.search.spent
        enlarging = {}
        for label in self.cores:
            if (made := self._enlarging(label, self.found[label])) is not None:
                enlarging[label] = made
        self.samples = self._affordable(begun)
        self.search.reporter.expect(_PASSES * len(enlarging) * self.samples)
        enlarging = {label: made for label, made in enlarging.items() if self._enlarged(label, made)}
        entered = self._enter(enlarging)
        for label, each in enumerate(self.found):
            notes = []
            if each.cage is not None:
                distance = ", ".join(f"{value:.4g}" for value in each.cage.distances)
                notes.append(
                    f"cage, a theorem: the weighted modal amplitudes stay below {each.cage.bound:.6g} and every event "
                    f"function at least {distance} from 0; contraction {each.cage.contraction:.3g} < 1"
                )
            if label in self.ellipsoids:
                notes.append(self._measured(label, enlarging[label], entered.get(label)))
            self.notes[label] = "; ".join(filter(None, notes))
        self.cells = self._visited()
        return self._regions(self.ellipsoids, self.cells, real=True)

    @property
    def with_virtual(self) -> Traps:
        """All trapping regions, and those of virtual sets, where motions settle as well; their labels come behind."""
        return self._regions(self.ellipsoids, self.cells)

    def _regions(
        self, ellipsoids: Mapping[int, OrbitEllipsoids], cells: Cells | None = None, *, real: bool = False
    ) -> Traps:
        """Return trapping regions of the attractors, and unless they are to be `real`, of virtual sets."""
        ellipsoids, n = dict(ellipsoids), len(self.search.low)
        caged = {label: each.cage for label, each in enumerate(self.found) if each.cage is not None}
        for label, each in enumerate([] if real else self.search.virtual, len(self.found)):
            if each.core is not None:
                ellipsoids[label] = each.core
            if each.cage is not None:
                caged[label] = each.cage
        return Traps(
            n,
            Ellipsoids.joined([e.as_traps(label) for label, e in ellipsoids.items()]) if ellipsoids else None,
            _stacked(caged, n) if caged else None,
            cells,
            self.search.limit,
        )

    def _enlarging(self, label: int, found: Found) -> Enlarging | None:
        """Return what enlarges the ellipsoids of one attractor; motions to other attractors end in their cores.

        None for an attractor with a cage that lanes cannot follow: ellipsoids would not save time there.
        """
        search = self.search
        inner, core = found.ellipsoid, found.core
        assert inner is not None
        assert core is not None

        def settles(
            x: NDArray[np.float64], modes: NDArray[np.int64], region: OrbitEllipsoids, longest: int
        ) -> NDArray[np.bool_]:
            labels, _ = search.ensemble.settle(x, self._regions({**self.cores, label: region}), longest, modes)
            search.reporter.step(len(x), "measuring trapping regions")
            return np.asarray(labels == label)

        if found.cage is not None and not search.in_lanes(inner.centres[:1]):
            return None
        enlarging = Enlarging(
            search.ensemble, settles, 2.0 * search.scale, self._others({label}), search.rng, search.options, found.decay
        )
        self.wholes[label] = enlarging.grown(inner)
        return enlarging

    def _affordable(self, begun: float) -> int:
        """Return the samples of each region whose time is `_TIMES` that of labelling all motions."""
        search, longest = self.search, min(self.search.options.longest, _PILOT_LONGEST)
        if search.options.samples is not None:
            return search.options.samples
        halving = max((approach(self.found[label].decay, 2.0) for label in self.wholes), default=0)
        most = _MOST_SAMPLES if halving < SOON else int(search.budget / (_ROUNDS * halving / SAFETY))
        most = int(np.clip(most, _LEAST_SAMPLES, _MOST_SAMPLES))
        spent = search.spent - begun
        each = 0.0
        for whole in self.wholes.values():
            before = search.spent
            search.ensemble.settle(whole.samples(_PILOT, search.rng), self._regions(self.cores), longest)
            each += (search.spent - before) / _PILOT
        labelled = self._labelled(self.wholes, longest)
        left = _TIMES * labelled - spent
        cost = _TO_THE_CORE * each + _ENTRIES * labelled / search.motions
        return min(int(np.clip(left / max(cost, 1.0), FEWEST_SAMPLES, _MOST_SAMPLES)), most)

    def _labelled(self, regions: Mapping[int, OrbitEllipsoids], longest: int) -> float:
        """Return the periods of lanes to label all motions with given regions, estimated from a few motions."""
        search = self.search
        if self.pilots is None:
            self.pilots = search.starts(_PILOT)
        before = search.spent
        search.ensemble.settle(self.pilots, self._regions(regions), longest)
        return (search.spent - before + len(self.pilots)) * search.motions / max(len(self.pilots), 1)

    def _enlarged(self, label: int, enlarging: Enlarging) -> bool:
        """Verify one attractor's ellipsoids, and enlarge them by planes while this saves time."""
        search, found, core = self.search, self.found[label], self.cores[label]
        inner = found.ellipsoid
        assert inner is not None
        enlarging.samples = self.samples
        try:
            whole = enlarging.verified(self.wholes[label], inner, core)
        except ConvergenceError:
            if found.cage is None:
                raise
            del self.wholes[label]
            return False
        self.wholes[label] = self.ellipsoids[label] = whole
        if search.in_lanes(inner.centres[:1]):

            def saved(smaller: OrbitEllipsoids, larger: OrbitEllipsoids) -> float:
                before, after = (self._labelled({**self.wholes, label: r}, SOON) for r in (smaller, larger))
                return before - after

            self.ellipsoids[label] = enlarging.beyond(whole, saved, lambda: search.spent)
        return True

    def _enter(self, enlarging: Mapping[int, Enlarging]) -> dict[int, tuple[int, int]]:
        """Cut the ellipsoids until motions from the region that enter one end in its attractor.

        Return for each label with cut ellipsoids: fresh motions that end elsewhere, and all that entered.
        """
        cut = False
        for _ in range(_ENTERING):
            labels, states, elsewhere = self._entries(enlarging)
            if not elsewhere.any():
                break
            cut = True
            for label in np.unique(labels[elsewhere]).tolist():
                left_out = states[elsewhere & (labels == label)]
                self.ellipsoids[label] = enlarging[label].without(self.ellipsoids[label], left_out, self.wholes[label])
        else:
            self.ellipsoids = {label: whole for label, whole in self.wholes.items() if self.found[label].cage is None}
        if cut:  # by these motions regions were cut: fresh ones measure
            labels, _, elsewhere = self._entries(enlarging)
        return {
            label: (int((elsewhere & (labels == label)).sum()), int((labels == label).sum()))
            for label in np.unique(labels).tolist()
        }

    def _entries(
        self, enlarging: Mapping[int, Enlarging]
    ) -> tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.bool_]]:
        """Return labels and states of motions that enter cut ellipsoids, and whether they end elsewhere.

        There are fewer motions where lanes leave many over.
        """
        search = self.search
        cut = [label for label, region in self.ellipsoids.items() if region is not self.wholes[label]]
        if not cut:
            return np.empty(0, np.uint8), np.empty((0, len(search.low))), np.empty(0, bool)
        left_over, found = search.ensemble.left_over, []
        soon = max(enlarging[label].patience(self.ellipsoids[label], self.wholes[label], SOON) for label in cut)
        for count in pieces(self.samples):
            x = search.rng.uniform(search.low, search.high, (count, len(search.low)))
            labels, states, modes = search.ensemble.arrivals(x, self._regions(self.ellipsoids), SOON)
            entering = np.isin(labels, cut)
            labels, states, modes = labels[entering], states[entering], modes[entering]
            ends, periods = search.ensemble.settle(states, self._regions(self.wholes), soon, modes)
            beyond = periods > 0
            found.append((labels[beyond], states[beyond], (ends != labels)[beyond]))
            if search.ensemble.left_over > left_over + LEFT_OVER:
                break
        labels, states, elsewhere = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return labels, states, elsewhere

    def _measured(self, label: int, enlarging: Enlarging, entered: tuple[int, int] | None) -> str:
        """Measure and note the share of an attractor's ellipsoids that belongs to another basin.

        Where the share is too large, the ellipsoids are dropped if there is a cage, else used without planes.
        """
        core, inner = self.cores[label], self.found[label].ellipsoid
        assert inner is not None
        # of what starts in the core, only contraction was seen
        samples = self.samples if core.level < inner.level else min(self.samples, CONTRACTING)
        elsewhere, followed = enlarging.elsewhere(self.ellipsoids[label], core, samples)
        if elsewhere > _TOLERATED * followed or not followed:
            if self.found[label].cage is not None:
                del self.ellipsoids[label]
                return ""
            if not followed:
                size = math.sqrt(self.ellipsoids[label].level)
                hint = "motions may start from none of them"
                raise ConvergenceError("trapping region", size, samples, hint, unit="samples")
            if self.ellipsoids[label] is not self.wholes[label]:
                self.ellipsoids[label], entered = self.wholes[label], None
                elsewhere, followed = enlarging.elsewhere(self.wholes[label], core, samples)
        region = self.ellipsoids[label]
        bound = wilson(elsewhere, followed)[1]
        self.error = max(self.error, bound)
        radius = ", ".join(f"{value:.3g}" for value in (region.half_widths() * ~region.absent)[0])
        points = f"each of {len(region.centres)} points" if len(region.centres) > 1 else "its point"
        planes = f", cut by {region.offsets.shape[1]} planes" if region.offsets.size else ""
        note = (
            f"ellipsoid of the discrete Lyapunov equation about {points}, half widths {radius}{planes}; measured: "
            f"{followed} samples, {elsewhere or 'none'} elsewhere: < {bound:.2g} at 95 %"
        )
        if entered is None:
            return note
        return f"{note}; {entered[0] or 'none'} of {entered[1]} motions that entered it beyond its largest ellipsoid"

    def _others(self, own: Container[int]) -> NDArray[np.float64]:
        """Return states on all attractors but those of some labels, and on virtual sets."""
        others = [each.points for label, each in enumerate([*self.found, *self.search.virtual]) if label not in own]
        return np.concatenate([np.empty((0, len(self.search.low))), *others])

    def _visited(self) -> Cells | None:
        """Return the boxes along attractors without another region; None where there are no such attractors."""
        clouds = {
            label: each.points for label, each in enumerate(self.found) if each.cage is None and each.ellipsoid is None
        }
        if not clouds:
            return None
        search = self.search
        curves = {label: self.found[label].along(_ALONG) for label in clouds if self.found[label].kind == LIMIT_CYCLE}
        boxes = boxes_along(search.ensemble, clouds, self._others(clouds), search.scale, _VISITS, search.rng, curves)
        starts = search.starts(max(self.samples // _REGION_SAMPLES, 100))
        visits, leaving = _VISITS, dict.fromkeys(clouds, False)
        while True:
            cells = replace(boxes.cells, visits=visits)
            traps = self._regions(self.ellipsoids, cells)
            left = self._left(starts, traps, cells)
            wrong, told = (sum(counts) for counts in zip(*left.values(), strict=True))
            # where no motion stays long enough any more, what those did that stayed shorter counts
            leaving |= {label: gone > _LEFT * of for label, (gone, of) in left.items() if of}
            if not wrong or visits >= _MOST_VISITS:
                break
            visits *= 2
        self.transients = {label for label, leaves in leaving.items() if leaves}
        bound = wilson(wrong, max(told, 1))[1]
        self.error = max(self.error, bound)
        for label in clouds:
            self.notes[label] = (
                f"{int((cells.labels == label).sum())} boxes, which hold {boxes.covered[label]:.4f} of its strobes, "
                f"{visits} of them in a row; measured: {told} motions from the region so labelled, {wrong} of them "
                f"elsewhere after {_LONGER} times as many: < {bound:.2g} at 95 %"
            )
            if (stay := self.found[label].stay) is not None:
                self.notes[label] += f"; {stay}"
        return cells

    def _left(self, starts: NDArray[np.float64], traps: Traps, cells: Cells) -> dict[int, tuple[int, int]]:
        """Return for each label: motions labelled by its boxes that get another label by longer stays, and all."""
        search, longest = self.search, self.longest
        labels, _ = search.ensemble.settle(starts, traps, longest)
        boxed = np.isin(labels, np.unique(cells.labels))
        strict = replace(cells, visits=_LONGER * cells.visits)
        again, _ = search.ensemble.settle(starts[boxed], self._regions(self.ellipsoids, strict), longest)
        elsewhere, first = (again != labels[boxed]) & (again != UNDECIDED), labels[boxed]
        return {
            int(label): (int(elsewhere[first == label].sum()), int((first == label).sum()))
            for label in np.unique(cells.labels)
        }


def _stacked(caged: Mapping[int, Any], n: int) -> Cages:
    """Return cages of several modes as arrays, padded by rows of zeros."""
    most = max(len(cage.rows) for cage in caged.values())
    rows = np.zeros((len(caged), most, n), dtype=np.complex128)
    floors = np.zeros((len(caged), most))
    for i, cage in enumerate(caged.values()):
        rows[i, : len(cage.rows)], floors[i, : len(cage.rows)] = cage.rows, cage.floors
    return Cages(
        frozen([cage.centre for cage in caged.values()]),
        frozen(rows, np.complex128),
        frozen(floors),
        frozen([cage.bound for cage in caged.values()]),
        frozen([cage.mode for cage in caged.values()], np.int64),
        frozen(list(caged), np.uint8),
    )
