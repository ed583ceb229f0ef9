"""Coexisting attractors, named and labelled, with regions of state space from which a motion's fate is certain."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.basins.cells import boxes_along
from saltus.basins.enlarging import LEFT_OVER, SOON, Enlarging, pieces
from saltus.basins.recurrence import Found, Hunt, Search
from saltus.basins.trap_files import traps_as_variables, traps_from_variables
from saltus.basins.trapping import CONTRACTING, Ellipsoid
from saltus.basins.wilson import wilson
from saltus.errors import ConvergenceError, InputError
from saltus.flow.traps import DIVERGED, UNDECIDED, Cages, Cells, Ellipsoids, Traps
from saltus.orbits import PeriodicOrbit
from saltus.results import Result, frozen
from saltus.system import HybridSystem

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["Attractors", "Search", "attractors_from", "find_attractors"]

_VISITS, _MOST_VISITS, _LONGER = 16, 256, 8
"""Strobes in a row in its boxes after which a motion is an attractor's, at first, at the most; how much the check's."""

_DIGITS = (7, 2)
"""Of a place in parts of the region's half widths, by which attractors are sorted: of a point, of a sample's mean."""

_ENTERING = 8
"""How often at most motions from the region enter the ellipsoids, until all end as they should."""

_TOLERATED = 1e-3
"""Part of the samples in an ellipsoid that is cut that may end elsewhere, or it is not used."""

_LEFT = 0.05
"""Part of the motions that boxes labelled beyond which, if they go elsewhere, what the boxes hold is a transient."""

_REGION_SAMPLES = 5
"""The boxes' rule is checked on a part of the samples: one in so many."""


@dataclass(frozen=True, eq=False, repr=False)
class Attractors(Result):
    """Coexisting attractors of a system, and where motions are certain to end on each.

    Attributes
    ----------
    system : HybridSystem
        The system.
    parameters : mapping of str to float
        All parameters.
    region : mapping of str to (float, float)
        Where motions started.
    interval : float or None
        Time between two strobes of a system without a phase.
    names : tuple of str
        Attractors in the order of their labels 0, 1, ...
    kinds : mapping of str to str
        ``period-N``, ``quasi-periodic``, ``chaotic`` or ``limit cycle``, by name.
    points : mapping of str to ndarray, shape (k, n)
        States at strobes: of a period-N attractor its N points in the order of visits, of others a sample.
    orbits : mapping of str to PeriodicOrbit
        The periodic ones, corrected.
    traps : Traps
        The trapping regions.
    notes : mapping of str to str
        How each attractor's trapping region was made, and what proves it or how many samples it rests on.
    fates : mapping of str to int
        How many of the motions from `region` ended where.
    measured_error : float
        Bound, at 95 % confidence, on the part of any one trapping region that belongs elsewhere; 0 where proven.
    """

    system: HybridSystem
    parameters: Mapping[str, float]
    region: Mapping[str, tuple[float, float]]
    interval: float | None
    names: tuple[str, ...]
    kinds: Mapping[str, str]
    points: Mapping[str, NDArray[np.float64]]
    orbits: Mapping[str, PeriodicOrbit]
    traps: Traps
    notes: Mapping[str, str]
    fates: Mapping[str, int]
    measured_error: float

    def __post_init__(self) -> None:
        for name in ("parameters", "region", "kinds", "orbits", "notes", "fates"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        points = {name: frozen(value) for name, value in self.points.items()}
        object.__setattr__(self, "points", MappingProxyType(points))

    @property
    def labels(self) -> dict[str, int]:
        """The byte of each outcome in a grid: the attractors, then ``diverged`` and ``undecided``."""
        return {name: label for label, name in enumerate(self.names)} | {"diverged": DIVERGED, "undecided": UNDECIDED}

    def to_xarray(self) -> xr.Dataset:
        """Return everything as a Dataset; each orbit's variables begin with ``orbit_``, its label and ``_``."""
        import xarray as xr

        label = np.repeat(np.arange(len(self.names)), [len(self.points[name]) for name in self.names])
        points = np.concatenate([np.empty((0, len(self.system.states))), *(self.points[name] for name in self.names)])
        dataset = xr.Dataset(
            {"point": (("index", "state"), points), "label": ("index", label)},
            coords={"state": list(self.system.states)},
        )
        for name, (dims, values) in traps_as_variables(self.traps).items():
            dataset[name] = (dims, values)
        orbit_attrs = {}
        for name, orbit in self.orbits.items():
            own, key = orbit.to_xarray(), f"orbit_{self.names.index(name)}_"
            orbit_attrs[name] = dict(own.attrs)
            own = own.rename({str(old): f"{key}{old}" for old in (*own.variables, *own.dims)})
            dataset = dataset.merge(own.drop_attrs(deep=False))
        dataset.attrs = {
            "definition": json.dumps(self.system.definition()),
            "parameters": json.dumps(dict(self.parameters)),
            "region": json.dumps({name: list(ends) for name, ends in self.region.items()}),
            "interval": json.dumps(self.interval),
            "names": json.dumps(self.names),
            "kinds": json.dumps(dict(self.kinds)),
            "notes": json.dumps(dict(self.notes)),
            "fates": json.dumps(dict(self.fates)),
            "measured_error": self.measured_error,
            "limit": self.traps.limit,
            "visits": 0 if self.traps.cells is None else self.traps.cells.visits,
            "orbits": json.dumps(orbit_attrs, default=float),
        }
        return dataset

    @classmethod
    def from_xarray(cls, dataset: xr.Dataset) -> Attractors:
        """Return the attractors that `to_xarray` described."""
        attrs = dataset.attrs
        data = {key: json.loads(attrs[key]) for key in ("parameters", "region", "interval", "names", "kinds", "notes",
                                                        "fates", "orbits")}  # fmt: skip
        points, labels = dataset["point"].values, dataset["label"].values
        orbits = {}
        for name, own in data["orbits"].items():
            key = f"orbit_{data['names'].index(name)}_"
            part = dataset[[variable for variable in dataset.variables if str(variable).startswith(key)]]
            part = part.rename({str(old): str(old).removeprefix(key) for old in (*part.variables, *part.dims)})
            orbits[name] = PeriodicOrbit.from_xarray(part.assign_attrs(own))
        return cls(
            HybridSystem.from_definition(json.loads(attrs["definition"])),
            data["parameters"],
            {name: (ends[0], ends[1]) for name, ends in data["region"].items()},
            data["interval"],
            tuple(data["names"]),
            data["kinds"],
            {name: points[labels == label] for label, name in enumerate(data["names"])},
            orbits,
            traps_from_variables(dataset),
            data["notes"],
            data["fates"],
            float(attrs["measured_error"]),
        )

    def __repr__(self) -> str:
        lines = [f"Attractors of {self.system.name or 'a hybrid system'}"]
        for label, name in enumerate(self.names):
            point = ", ".join(f"{value:.6g}" for value in self.points[name][0])
            lines += [f"  {label}  {name}: {self.kinds[name]}, through [{point}]", f"     {self.notes[name]}"]
        return "\n".join(lines)


def find_attractors(
    system: HybridSystem,
    parameters: Mapping[str, float] | None = None,
    region: Mapping[str, tuple[float, float] | float] | None = None,
    *,
    seeds: int = 256,
    interval: float | None = None,
    search: Search | None = None,
) -> Attractors:
    """Return the attractors on which motions from a region end, with their trapping regions.

    Motions from quasi-random states are followed until each has settled; what recurs is handed to the orbit solver, and
    only stable orbits are kept; all other motions are told apart by the states that they visit
    (`saltus.basins.recurrence`), and what they leave within ten times `Search.longest` strobes, on average, is no
    attractor: motions on it that long are undecided. An attractor whose basin is a small part w of the region is missed
    with the probability ``(1 - w)^seeds``, about: ``seeds = 3/w`` finds it at 95 %.

    Parameters
    ----------
    system : HybridSystem
        The system.
    parameters : mapping of str to float, optional
        Parameters that differ from the system's defaults.
    region : mapping of str to (float, float) or float
        For every state the interval in which motions start, at phase 0; or the value at which they do.
    seeds : int, optional
        How many motions.
    interval : float, optional
        Time between two looks, for a system without a phase. It must not be commensurate with the period of a limit
        cycle, which is to be seen as a closed curve.
    search : Search, optional
        How long motions are followed, how many samples the trapping regions rest on, and the like.

    Returns
    -------
    Attractors
        Those that touch nothing first, or in the order of the system's `regimes`; then by period, by size and by place.
        Names are the system's `regimes` by the modes visited, else the kinds, with " A", " B" where one occurs twice.

    Raises
    ------
    InputError
        An argument that cannot be used.
    ConvergenceError
        Motions return to an orbit from no region about it that can be measured.

    Notes
    -----
    Trapping regions, by what there is: (a) a cage, proven (`saltus.basins.cage`); (b) about the points of a periodic
    orbit, ellipsoids in the metric of the discrete Lyapunov equation, cut by planes, as large as no sample inside ends
    elsewhere, nor any motion from `region` that enters them (`saltus.basins.enlarging`); (c) along all other attractors
    boxes, in which a motion has to be seen for many strobes in a row, as many as no sample from `region` needs to be
    told apart (`saltus.basins.cells`).

    References
    ----------
    G. Datseris, A. Wagemakers, Effortless estimation of basins of attraction, Chaos 32 (2022) 023104: recurrences;
    M. Stender, N. Hoffmann, bSTAB: an open-source software for computing the basin stability of multi-stable dynamical
    systems, Nonlinear Dyn. 107 (2022) 1451-1468: features.

    Examples
    --------
    >>> from saltus.system.hybrid import Mode
    >>> wells = HybridSystem(
    ...     ("x", "v"), {"w": 1.0}, {"free": Mode({"x": "v", "v": "x - x**3 - 0.15*v + 0.2*cos(s)"})}, phase=("s", "w")
    ... )
    >>> found = find_attractors(wells, {}, {"x": (-2, 2), "v": (-2, 2)}, seeds=32, search=Search(samples=500))
    >>> found.names
    ('period-1 A', 'period-1 B')
    """
    checks.instance("system", system, HybridSystem)
    parameters = checks.mapping("parameters", parameters, "names to numbers, or None")
    interval = None if interval is None else checks.positive("interval", interval)
    chosen = _checked_search(search)
    count = checks.size("seeds", seeds)
    box = _checked_region(system, region)
    low, high = np.array(list(box.values())).T
    hunt = Hunt(system, parameters, low, high, interval, chosen)
    starts = hunt.seeds(count)
    if not len(starts):
        raise InputError("region", dict(box), "where motions can start: in a mode's domain and before its events")
    hunt.follow(starts)
    if len(hunt.found) < DIVERGED:
        hunt.drop_transients()
    return _assembled(hunt, box, sorted(hunt.found, key=lambda found: _rank(hunt, found)), None, starts)


def attractors_from(
    orbits: Mapping[str, PeriodicOrbit],
    region: Mapping[str, tuple[float, float] | float],
    *,
    search: Search | None = None,
) -> Attractors:
    """Return known orbits as attractors, in the order and by the names given, with their trapping regions.

    Parameters
    ----------
    orbits : mapping of str to PeriodicOrbit
        Stable orbits of one system with a phase, at the same parameters.
    region : mapping of str to (float, float) or float
        For every state the interval that matters; trapping regions are not made much larger.
    search : Search, optional
        As in `find_attractors`.

    Raises
    ------
    InputError
        An orbit that is not stable, is no motion, or belongs to another system or other parameters.
    """
    orbits = checks.mapping("orbits", orbits, "names to PeriodicOrbit")
    if not orbits:
        raise InputError("orbits", {}, "at least one orbit")
    for name, orbit in orbits.items():
        checks.instance(f"orbits[{name!r}]", orbit, PeriodicOrbit)
    first = next(iter(orbits.values()))
    system, parameters = first.system, dict(first.parameters)
    if system.phase is None:
        raise InputError("orbits", list(orbits), "of a system with a phase", "find_attractors finds those of others")
    box = _checked_region(system, region)
    low, high = np.array(list(box.values())).T
    hunt = Hunt(system, parameters, low, high, None, _checked_search(search))
    hunt.find_caged()
    chosen = []
    for name, orbit in orbits.items():
        if orbit.system != system or dict(orbit.parameters) != parameters:
            allowed = f"of the same system and parameters as {next(iter(orbits))!r}"
            raise InputError(f"orbit {name!r}", orbit.system.name, allowed)
        if not orbit.stable or not orbit.admissible:
            said = "unstable" if not orbit.stable else "; ".join(orbit.reasons)
            raise InputError(f"orbit {name!r}", said, "an attractor: a stable orbit that is a motion")
        chosen.append(hunt.as_found(orbit))
    return _assembled(hunt, box, chosen, tuple(orbits), np.empty((0, len(box))))


def _checked_search(search: Search | None) -> Search:
    return Search() if search is None else checks.instance("search", search, Search)


def _checked_region(system: HybridSystem, region: object) -> dict[str, tuple[float, float]]:
    given = checks.mapping("region", region, "each state to an interval or a number", known=system.states)
    box = {}
    for name in system.states:
        if name not in given:
            raise InputError(
                "region", list(given), f"given for each of {', '.join(system.states)}", f"{name!r} is missing"
            )
        where, ends = f"region[{name!r}]", given[name]
        if checks.is_real(ends):
            box[name] = (checks.number(where, ends),) * 2
            continue
        pair = checks.listed(where, ends, "the two ends of an interval, or a number", most=2)
        if len(pair) != 2:
            raise InputError(where, ends, "the two ends of an interval, or a number")
        low, high = (checks.number(where, end) for end in pair)
        if not low <= high:
            raise InputError(where, (low, high), "finite, the lower end first")
        box[name] = (low, high)
    return box


# ---- order and names ----


def _rank(hunt: Hunt, found: Found) -> tuple[Any, ...]:
    """What sorts attractors, the same whichever motion found them."""
    regimes, regime = list(hunt.system.regimes), _regime(hunt.system, found)
    order = regimes.index(regime) if regime else len(regimes)
    centre, digits = (found.points[0], _DIGITS[0]) if found.period else (found.points.mean(axis=0), _DIGITS[1])
    size = float(np.round(np.linalg.norm(centre / hunt.scale), digits))
    place = (np.round(centre / hunt.scale, digits) + 0.0).tolist()
    return order, len(found.visited), found.touches, found.period or np.inf, found.kind, size, place


def _regime(system: HybridSystem, found: Found) -> str:
    return next((name for name, visited in system.regimes.items() if set(visited) == found.visited), "")


def _named(system: HybridSystem, found: list[Found]) -> tuple[str, ...]:
    plain = [_regime(system, each) or each.kind for each in found]
    counts, seen, names = Counter(plain), Counter[str](), []
    for name in plain:
        letter = chr(ord("A") + seen[name]) if seen[name] < 26 else str(seen[name] + 1)
        seen[name] += 1
        names.append(f"{name} {letter}" if counts[name] > 1 else name)
    return tuple(names)


# ---- trapping regions ----


def _assembled(
    hunt: Hunt,
    box: dict[str, tuple[float, float]],
    found: list[Found],
    names: tuple[str, ...] | None,
    starts: NDArray[np.float64],
) -> Attractors:
    if len(found) >= DIVERGED:
        raise InputError("region", box, "one with fewer attractors", f"{len(found)} were found")
    built = _Building(hunt, found)
    traps = built.traps()
    while built.transients:
        found = [each for label, each in enumerate(found) if label not in built.transients]
        built = _Building(hunt, found)
        traps = built.traps()
    names = names or _named(hunt.system, found)
    labels, _ = hunt.ensemble.settle(starts, traps, hunt.search.longest)
    outcomes = dict(enumerate(names)) | {DIVERGED: "diverged", UNDECIDED: "undecided"}
    return Attractors(
        hunt.system,
        hunt.system.resolve(hunt.parameters),
        box,
        hunt.interval,
        names,
        {name: each.kind for name, each in zip(names, found, strict=True)},
        {name: each.points for name, each in zip(names, found, strict=True)},
        {name: each.orbit for name, each in zip(names, found, strict=True) if each.orbit is not None},
        traps,
        {name: built.notes[label] for label, name in enumerate(names)},
        {name: int((labels == label).sum()) for label, name in outcomes.items()},
        built.error,
    )


class _Building:
    """The trapping regions of attractors in the order of their labels, what is said of each, and the largest error.

    `transients` are the labels of those that turned out to be none.
    """

    def __init__(self, hunt: Hunt, found: list[Found]) -> None:
        self.hunt, self.found = hunt, found
        self.notes: dict[int, str] = {}
        self.error = 0.0
        self.transients: set[int] = set()
        self.cores = {label: each.core for label, each in enumerate(found) if each.core is not None}
        self.wholes: dict[int, Ellipsoid] = {}
        self.ellipsoids: dict[int, Ellipsoid] = {}

    def traps(self) -> Traps:
        """Return all trapping regions."""
        enlarging = {}
        for label in self.cores:
            if (made := self._enlarged(label, self.found[label])) is not None:
                enlarging[label] = made
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
        return self._with_cells()

    def _regions(self, ellipsoids: Mapping[int, Ellipsoid], cells: Cells | None = None) -> Traps:
        caged = {label: each.cage for label, each in enumerate(self.found) if each.cage is not None}
        n = len(self.hunt.low)
        return Traps(
            n,
            Ellipsoids.joined([e.as_traps(label) for label, e in ellipsoids.items()]) if ellipsoids else None,
            _stacked(caged, n) if caged else None,
            cells,
            self.hunt.search.limit,
        )

    def _enlarged(self, label: int, found: Found) -> Enlarging | None:
        """Enlarge the ellipsoids of one attractor, while motions are accounted for in the cores of the others.

        Where there is a cage they are to save time: none are made where they would cost it.
        """
        hunt, search = self.hunt, self.hunt.search
        inner, core = found.ellipsoid, found.core
        assert inner is not None
        assert core is not None

        def settles(x: NDArray[np.float64], region: Ellipsoid, longest: int) -> NDArray[np.bool_]:
            labels, _ = hunt.ensemble.settle(x, self._regions({**self.cores, label: region}), longest)
            return np.asarray(labels == label)

        in_lanes = hunt.in_lanes(inner.centres[:1])
        if found.cage is not None and not in_lanes:
            return None
        others = np.concatenate(
            [np.empty((0, len(hunt.low))), *(each.points for each in self.found if each is not found)]
        )
        enlarging = Enlarging(hunt.ensemble, settles, 2.0 * hunt.scale, others, hunt.rng, search)
        try:
            self.wholes[label] = self.ellipsoids[label] = enlarging.whole(inner, core)
        except ConvergenceError:
            if found.cage is None:
                raise
            return None
        if in_lanes:
            self.ellipsoids[label] = enlarging.beyond(self.wholes[label])
        return enlarging

    def _enter(self, enlarging: Mapping[int, Enlarging]) -> dict[int, tuple[int, int]]:
        """Cut the ellipsoids until motions from the region that enter one end in its attractor.

        How many of fresh ones do not in the end, and of how many, for each label whose ellipsoids are cut.
        """
        for _ in range(_ENTERING):
            labels, states, elsewhere = self._entries()
            if not elsewhere.any():
                break
            for label in np.unique(labels[elsewhere]).tolist():
                left_out = states[elsewhere & (labels == label)]
                self.ellipsoids[label] = enlarging[label].without(self.ellipsoids[label], left_out, self.wholes[label])
        else:
            self.ellipsoids = {label: whole for label, whole in self.wholes.items() if self.found[label].cage is None}
        labels, _, elsewhere = self._entries()
        return {
            label: (int((elsewhere & (labels == label)).sum()), int((labels == label).sum()))
            for label in np.unique(labels).tolist()
        }

    def _entries(self) -> tuple[NDArray[np.uint8], NDArray[np.float64], NDArray[np.bool_]]:
        """Labels and states of motions that enter what is cut of ellipsoids, and whether they end elsewhere.

        Fewer motions, where lanes leave many over.
        """
        hunt = self.hunt
        cut = [label for label, region in self.ellipsoids.items() if region is not self.wholes[label]]
        if not cut:
            return np.empty(0, np.uint8), np.empty((0, len(hunt.low))), np.empty(0, bool)
        left_over, found = hunt.ensemble.left_over, []
        for count in pieces(hunt.search.samples):
            x = hunt.rng.uniform(hunt.low, hunt.high, (count, len(hunt.low)))
            labels, states, modes = hunt.ensemble.arrivals(x, self._regions(self.ellipsoids), SOON)
            entering = np.isin(labels, cut)
            labels, states, modes = labels[entering], states[entering], modes[entering]
            ends, periods = hunt.ensemble.settle(states, self._regions(self.wholes), SOON, modes)
            beyond = periods > 0
            found.append((labels[beyond], states[beyond], (ends != labels)[beyond]))
            if hunt.ensemble.left_over > left_over + LEFT_OVER:
                break
        labels, states, elsewhere = (np.concatenate(parts) for parts in zip(*found, strict=True))
        return labels, states, elsewhere

    def _measured(self, label: int, enlarging: Enlarging, entered: tuple[int, int] | None) -> str:
        """Measure how much of an attractor's ellipsoids is another's, and tell.

        Where it is much, they are dropped if there is a cage, else taken as large as they are without planes.
        """
        core, inner = self.cores[label], self.found[label].ellipsoid
        assert inner is not None
        # of what starts in the core, only contraction was seen
        samples = self.hunt.search.samples if core.level < inner.level else min(self.hunt.search.samples, CONTRACTING)
        elsewhere = enlarging.elsewhere(self.ellipsoids[label], core, samples)
        if elsewhere > _TOLERATED * samples:
            if self.found[label].cage is not None:
                del self.ellipsoids[label]
                return ""
            if self.ellipsoids[label] is not self.wholes[label]:
                self.ellipsoids[label], entered = self.wholes[label], None
                elsewhere = enlarging.elsewhere(self.wholes[label], core, samples)
        region = self.ellipsoids[label]
        bound = wilson(elsewhere, samples)[1]
        self.error = max(self.error, bound)
        radius = ", ".join(f"{value:.3g}" for value in region.half_widths()[0])
        points = f"each of {len(region.centres)} points" if len(region.centres) > 1 else "its point"
        planes = f", cut by {region.offsets.shape[1]} planes" if region.offsets.size else ""
        note = (
            f"ellipsoid of the discrete Lyapunov equation about {points}, half widths {radius}{planes}; measured: "
            f"{samples} samples, {elsewhere or 'none'} elsewhere: < {bound:.2g} at 95 %"
        )
        if entered is None:
            return note
        return f"{note}; {entered[0] or 'none'} of {entered[1]} motions that entered it beyond its largest ellipsoid"

    def _with_cells(self) -> Traps:
        clouds = {
            label: each.points for label, each in enumerate(self.found) if each.cage is None and each.ellipsoid is None
        }
        certain = self._regions(self.ellipsoids)
        if not clouds:
            return certain
        hunt, search = self.hunt, self.hunt.search
        elsewhere = [each.points for label, each in enumerate(self.found) if label not in clouds]
        others = np.concatenate([np.empty((0, len(hunt.low))), *elsewhere])
        boxes = boxes_along(hunt.ensemble, clouds, others, hunt.scale, _VISITS, hunt.rng)
        starts = hunt.seeds(max(search.samples // _REGION_SAMPLES, 100))
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
        return traps

    def _left(self, starts: NDArray[np.float64], traps: Traps, cells: Cells) -> dict[int, tuple[int, int]]:
        """How many of the motions that each label's boxes held are others' if they have to stay longer; of how many."""
        hunt, longest = self.hunt, self.hunt.search.longest
        labels, _ = hunt.ensemble.settle(starts, traps, longest)
        boxed = np.isin(labels, np.unique(cells.labels))
        strict = replace(cells, visits=_LONGER * cells.visits)
        again, _ = hunt.ensemble.settle(starts[boxed], self._regions(self.ellipsoids, strict), longest)
        elsewhere, first = (again != labels[boxed]) & (again != UNDECIDED), labels[boxed]
        return {
            int(label): (int(elsewhere[first == label].sum()), int((first == label).sum()))
            for label in np.unique(cells.labels)
        }


def _stacked(caged: Mapping[int, Any], n: int) -> Cages:
    """Cages of several modes as arrays; rows that some lack are zero."""
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
