"""Coexisting attractors: names, labels, and trapping regions, in which a motion's attractor is certain."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.basins.attractors.trap_files import check_traps, traps_as_variables, traps_from_variables
from saltus.contents import Contents
from saltus.described import described
from saltus.ensemble.traps import DIVERGED, UNDECIDED, Traps
from saltus.errors import InputError
from saltus.orbits import PeriodicOrbit
from saltus.result import Result, frozen
from saltus.system import HybridSystem, Map
from saltus.system.definition import Definition
from saltus.system.plain import held_any, held_parameters

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

__all__ = ["Attractors", "lettered"]


def lettered(names: Iterable[str]) -> tuple[str, ...]:
    """Return names with letters where one occurs twice.

    Examples
    --------
    >>> lettered(["rest", "period-1", "period-1"])
    ('rest', 'period-1 A', 'period-1 B')
    """
    plain = tuple(names)
    counts, seen, found = Counter(plain), Counter[str](), []
    for name in plain:
        letter = chr(ord("A") + seen[name]) if seen[name] < 26 else str(seen[name] + 1)
        seen[name] += 1
        found.append(f"{name} {letter}" if counts[name] > 1 else name)
    return tuple(found)


@dataclass(frozen=True, eq=False, repr=False)
class Attractors(Result):
    """Coexisting attractors of a system, and their trapping regions.

    Attributes
    ----------
    system : HybridSystem or Map
        The system.
    parameters : mapping of str to float
        All parameters.
    region : mapping of str to (float, float)
        Interval of each state in which motions started.
    interval : float or None
        Time between two strobes of a system without a phase.
    names : tuple of str
        Attractors in the order of their labels 0, 1, ...
    kinds : mapping of str to str
        Kind of each attractor, by name: ``rest``, ``period-N``, ``limit cycle``, or a label of a sweep as ``chaotic``.
        ``rest``: no state moves and no event is met, also in a forced system.
    points : mapping of str to ndarray, shape (k, n)
        States at strobes: the N points of a period-N attractor in the order of visits, a sample of any other.
    orbits : mapping of str to PeriodicOrbit
        The periodic attractors, as the orbit solver returned them; none of a map.
    traps : Traps
        The trapping regions.
    notes : mapping of str to str
        How each attractor's trapping region was made, and its proof or its number of samples.
    fates : mapping of str to int
        How many of the motions from `region` ended on each attractor, diverged, or stayed undecided.
    decays : mapping of str to float
        Asymptotic factor by which distances from an attractor shrink in a period, where there are multipliers.
    slowest : int
        Periods after which the last of the motions from `region` was in a trapping region.
    unsettled : ndarray, shape (k, n)
        States at which some of the motions from `region` are that reached no trapping region in time, 8 at most. NaN
        where one could not be followed so long.
    scale : tuple of float or None
        Size of each state: half the region's width, or for a frozen state the distance that motions go.
    measured_error : float
        Bound, at 95 % confidence, on the share of any one trapping region that belongs to another basin; 0 where
        proven.

    Examples
    --------
    >>> import saltus
    >>> wells = saltus.HybridSystem.smooth({"x": "v", "v": "x - x**3 - 0.35*v + 0.2*cos(s)"}, phase=("s", 1.0))
    >>> found = saltus.find_attractors(wells, {}, {"x": (-2, 2), "v": (-2, 2)})
    >>> found.names
    ('period-1 A', 'period-1 B')
    """

    system: HybridSystem | Map
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
    decays: Mapping[str, float] = field(default_factory=dict)
    slowest: int = 0
    scale: tuple[float, ...] | None = None
    unsettled: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))

    def __post_init__(self) -> None:
        for name in ("parameters", "region", "kinds", "orbits", "notes", "fates", "decays"):
            object.__setattr__(self, name, MappingProxyType(dict(getattr(self, name))))
        points = {name: frozen(value) for name, value in self.points.items()}
        object.__setattr__(self, "points", MappingProxyType(points))
        object.__setattr__(self, "unsettled", frozen(np.reshape(self.unsettled, (-1, len(self.system.states)))))

    @property
    def labels(self) -> dict[str, int]:
        """The byte of each outcome in a grid: the attractors, then ``diverged`` and ``undecided``."""
        return {name: label for label, name in enumerate(self.names)} | {"diverged": DIVERGED, "undecided": UNDECIDED}

    def renamed(self, names: Iterable[str]) -> Attractors:
        """Return the attractors under other names, in the same order.

        Parameters
        ----------
        names : iterable of str
            One for each attractor. Letters are added where one occurs twice.

        Returns
        -------
        Attractors
            With the same labels and trapping regions.

        Raises
        ------
        InputError
            Another count of names, or a name of another outcome: ``diverged`` or ``undecided``.
        """
        told = [checks.text("names", name) for name in checks.listed("names", names, "names")]
        new = lettered(told)
        if len(new) != len(self.names) or set(new) & {"diverged", "undecided"}:
            raise InputError("names", told, f"{len(self.names)} names, none of them diverged or undecided")
        by_old = dict(zip(self.names, new, strict=True))
        changed: dict[str, Any] = {
            table: {by_old.get(name, name): value for name, value in getattr(self, table).items()}
            for table in ("kinds", "points", "orbits", "notes", "fates", "decays")
        }
        return replace(self, names=new, **changed)

    @described
    def to_xarray(self) -> xr.Dataset:
        """Return everything as a Dataset; each orbit's variables begin with ``orbit_``, its label and ``_``."""
        from saltus.extras import xr

        label = np.repeat(np.arange(len(self.names)), [len(self.points[name]) for name in self.names])
        points = np.concatenate([np.empty((0, len(self.system.states))), *(self.points[name] for name in self.names)])
        meanings = " ".join(name.replace(" ", "_") for name in self.names)
        flags = {"flag_values": list(range(len(self.names))), "flag_meanings": meanings}
        dataset = xr.Dataset(
            {"point": (("index", "state"), points), "label": ("index", label, flags)},
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
        if self.unsettled.size:
            dataset["unsettled"] = (("motion", "state"), np.array(self.unsettled))
        dataset.attrs = {
            "definition": json.dumps(self.system.definition()),
            "parameters": json.dumps(dict(self.parameters)),
            "region": json.dumps({name: list(ends) for name, ends in self.region.items()}),
            "interval": json.dumps(self.interval),
            "names": json.dumps(self.names),
            "kinds": json.dumps(dict(self.kinds)),
            "notes": json.dumps(dict(self.notes)),
            "fates": json.dumps(dict(self.fates)),
            "decays": json.dumps(dict(self.decays)),
            "slowest": self.slowest,
            "scale": json.dumps(self.scale),
            "measured_error": self.measured_error,
            "limit": self.traps.limit,
            "visits": 0 if self.traps.cells is None else self.traps.cells.visits,
            "orbits": json.dumps(orbit_attrs, default=float),
        }
        if self.system.drive_repeats > 1:
            dataset.attrs["drive_repeats"] = self.system.drive_repeats
        return dataset

    @classmethod
    def _read(cls, held: Contents) -> Attractors:
        system, names = held_any(held), tuple(held.texts("names"))
        held.names("state", system.states)
        if len(set(names)) < len(names) or len(names) > DIVERGED:
            raise InputError("attribute 'names'", names, f"names, each once, at most {DIVERGED}")
        known = int(held.dataset.attrs.get("drive_repeats", 1))
        if known != system.drive_repeats:
            wanted = f"{system.drive_repeats}, as often as the drive repeats"
            raise InputError("attribute 'drive_repeats'", known, wanted, "its points are a turn apart: find them anew")
        points = held.array("point", ("index", "state"))
        labels = held.array("label", ("index",), int, least=0, most=len(names) - 1)
        if set(labels.tolist()) != set(range(len(names))):
            raise InputError("variable 'label'", sorted(set(labels.tolist())), "one of each attractor or more")
        traps = traps_from_variables(held)
        check_traps(traps, system, range(len(names)))
        parameters = held_parameters(held, system)
        said = {key: held.json(key, dict) for key in ("kinds", "notes", "fates", "region", "orbits")}
        _check_said(said, names, system)
        interval = held.json("interval", float, int, type(None))
        if interval is not None and not 0.0 < interval < np.inf:
            raise InputError("attribute 'interval'", interval, "finite and > 0")
        orbits = {name: _orbit_in(held.dataset, names.index(name), own) for name, own in said["orbits"].items()}
        for name, orbit in orbits.items():
            if orbit.system != system or dict(orbit.parameters) != parameters:
                raise InputError(f"orbit of {name!r}", orbit.system.name, "of the same system and parameters")
        return cls(
            system,
            parameters,
            {name: (float(low), float(high)) for name, (low, high) in said["region"].items()},
            interval,
            names,
            said["kinds"],
            {name: points[labels == label] for label, name in enumerate(names)},
            orbits,
            traps,
            said["notes"],
            said["fates"],
            held.number("measured_error", least=0.0, finite=False),
            *_patience(held, names, len(system.states)),
            *([held.array("unsettled", ("motion", "state"), finite=False)] if "unsettled" in held.dataset else []),
        )

    def __repr__(self) -> str:
        lines = [f"Attractors of {self.system.name or self.system.unnamed}"]
        for label, name in enumerate(self.names):
            point = ", ".join(f"{value:.6g}" for value in self.points[name][0])
            lines += [f"  {label}  {name}: {self.kinds[name]}, through [{point}]", f"     {self.notes[name]}"]
        if undecided := self.fates.get("undecided", 0):
            lines.append(
                f"  {undecided} of {sum(self.fates.values())} motions from the region reach no trapping region"
            )
            stay = [", ".join(f"{value:.6g}" for value in x) for x in self.unsettled if np.isfinite(x).all()]
            if stay:
                lines.append(f"     such are at {', '.join(f'[{place}]' for place in stay)} in the end")
        return "\n".join(lines)


def _check_said(said: Mapping[str, dict[str, Any]], names: tuple[str, ...], system: Definition) -> None:
    """Raise `InputError` where a file's entries on attractors have other names or another type."""
    for key in ("kinds", "notes"):
        if set(said[key]) != set(names) or not all(isinstance(text, str) for text in said[key].values()):
            raise InputError(f"attribute {key!r}", sorted(said[key]), f"a text for each of {', '.join(names)}")
    if not all(isinstance(count, int) and count >= 0 for count in said["fates"].values()):
        raise InputError("attribute 'fates'", said["fates"], "counts")
    if not set(said["orbits"]) <= set(names) or not all(isinstance(own, dict) for own in said["orbits"].values()):
        raise InputError("attribute 'orbits'", sorted(said["orbits"]), f"attributes of orbits, of {', '.join(names)}")
    for name, ends in said["region"].items():
        pair = (
            isinstance(ends, list) and len(ends) == 2 and all(checks.is_real(end) and np.isfinite(end) for end in ends)
        )
        if name not in system.states or not pair:
            raise InputError(f"region[{name!r}]", ends, f"two ends, of one of {', '.join(system.states)}")


def _patience(held: Contents, names: tuple[str, ...], states: int) -> tuple[Any, ...]:
    """Return a file's decays, slowest motion and scale; earlier files lack all three."""
    if "decays" not in held.dataset.attrs:
        return {}, 0, None
    decays, scale = held.json("decays", dict), held.json("scale", list, type(None))
    if not set(decays) <= set(names):
        raise InputError("attribute 'decays'", sorted(decays), f"of some of {', '.join(names)}")
    decays = {name: checks.number("decay", value, finite=False) for name, value in decays.items()}
    if scale is not None:
        if len(scale) != states:
            raise InputError("attribute 'scale'", scale, f"{states} sizes")
        scale = tuple(checks.positive("scale", size) for size in scale)
    return decays, held.count("slowest"), scale


def _orbit_in(dataset: xr.Dataset, label: int, attributes: dict[str, Any]) -> PeriodicOrbit:
    """Return the orbit of one attractor from a file with the variables of all."""
    key = f"orbit_{label}_"
    part = dataset[[variable for variable in dataset.variables if str(variable).startswith(key)]]
    part = part.rename({str(old): str(old).removeprefix(key) for old in (*part.variables, *part.dims)})
    return PeriodicOrbit.from_xarray(part.assign_attrs(attributes))
