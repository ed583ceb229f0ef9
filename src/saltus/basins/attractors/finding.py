"""Attractors, found from a region or made of known orbits, with their trapping regions."""

from __future__ import annotations

import math
from collections.abc import Mapping
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus import checks
from saltus.basins.attractors.attractors import Attractors, lettered
from saltus.basins.attractors.building import Building
from saltus.basins.attractors.found import AttractorOptions, Found
from saltus.basins.attractors.map_search import MapSearch
from saltus.basins.attractors.search import AttractorSearch
from saltus.ensemble.traps import DIVERGED, UNDECIDED
from saltus.errors import InputError
from saltus.orbits import PeriodicOrbit
from saltus.progress import Report, Reporter
from saltus.system import HybridSystem, Map
from saltus.system.definition import Definition
from saltus.system.maps import checked_system

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["attractors_from", "find_attractors", "search_of"]

# Digits of a place, in half widths of the region, by which attractors are sorted: a point's, a sample mean's.
_DIGITS = (7, 2)

_TOLD = 8  # motions that have not settled whose last states are kept


def find_attractors(
    system: HybridSystem | Map,
    parameters: Mapping[str, float] | None = None,
    region: Mapping[str, tuple[float, float] | float] | None = None,
    *,
    options: AttractorOptions | None = None,
    progress: bool | Report = False,
) -> Attractors:
    """Return the attractors on which motions from a region end, with their trapping regions.

    Motions from quasi-random states are followed until each has settled. Recurrent motions go to the orbit solver, and
    only stable orbits are kept. All other motions are told apart by the states that they visit
    (`saltus.basins.attractors.search`). A set that motions leave within ten times `longest` strobes of the options, on
    average, is no attractor; motions that stay on it are undecided. docs/theory/basins.md derives the method.

    Parameters
    ----------
    system : HybridSystem or Map
        The system.
    parameters : mapping of str to float, optional
        Parameters that differ from the system's defaults.
    region : mapping of str to (float, float) or float
        For every state the interval or the single value from which motions start, at phase 0.
    options : AttractorOptions, optional
        How many motions start, how long they are followed, how trapping regions are measured, random numbers.
    progress : bool or callable, optional
        True for a bar on stderr, or a function called with a `saltus.Progress`. It counts the motions followed, out of
        all expected so far.

    Returns
    -------
    Attractors
        In the order of the system's `regimes`, then by the number of modes visited, without events first, by period,
        size and place. Names are the system's `regimes` by the modes visited, else the kinds, with " A", " B" where one
        occurs twice. Where an angle rotates, a name is ``rotation 1/2``: turns, over strobes or periods of a cycle.

    Raises
    ------
    InputError
        An argument that cannot be used.
    ConvergenceError
        An orbit has no measurable region about it from which motions return.

    Notes
    -----
    There are three kinds of trapping regions, which docs/theory/basins.md derives.

    (a) A cage is an invariant set, by a theorem (`saltus.basins.attractors.invariant_set`).

    (b) Ellipsoids about the points of a periodic orbit have the metric of the discrete Lyapunov equation, and are cut
    by planes. They are so large that no sample inside ends elsewhere, nor any motion from `region` that enters them
    (`saltus.basins.attractors.trap_growth`).

    (c) Boxes along all other attractors catch a motion that is in them for many strobes in a row. The number of strobes
    follows from samples from `region` (`saltus.basins.attractors.visited_boxes`).

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
    >>> few = AttractorOptions(starts=32, samples=500)
    >>> found = find_attractors(wells, {}, {"x": (-2, 2), "v": (-2, 2)}, options=few)
    >>> found.names
    ('period-1 A', 'period-1 B')
    """
    checked_system(system)
    parameters = checks.mapping("parameters", parameters, "names to numbers, or None")
    chosen = _checked_options(options)
    box = _checked_region(system, region)
    low, high = np.array(list(box.values())).T
    with Reporter(progress) as reporter:
        search = search_of(system)(system, parameters, low, high, chosen, reporter)
        starts = np.concatenate([search.starts(chosen.starts), _further(search, chosen)])
        if not len(starts):
            raise InputError("region", dict(box), "where motions can start: in a mode's domain and before its events")
        search.follow(starts)
        if len(search.found) < DIVERGED:
            search.drop_transients()
        search.drop_virtual(starts)
        return _assembled(search, box, sorted(search.found, key=lambda found: _rank(search, found)), None, starts)


@singledispatch
def search_of(system: HybridSystem | Map) -> type[AttractorSearch]:
    """Return the search that follows the motions of a system."""
    return AttractorSearch


@search_of.register(Map)
def search_of_map(system: Map) -> type[AttractorSearch]:
    return MapSearch


def attractors_from(
    orbits: Mapping[str, PeriodicOrbit],
    region: Mapping[str, tuple[float, float] | float],
    *,
    options: AttractorOptions | None = None,
) -> Attractors:
    """Return known orbits as attractors, in the order and by the names given, with their trapping regions.

    Parameters
    ----------
    orbits : mapping of str to PeriodicOrbit
        Stable orbits of one system with a phase, at the same parameters.
    region : mapping of str to (float, float) or float
        For every state the interval of interest; trapping regions are not made much larger.
    options : AttractorOptions, optional
        As in `find_attractors`; no motions start, so `starts` and `interval` have no part.

    Raises
    ------
    InputError
        An orbit that is not stable, is not admissible, or belongs to another system or other parameters.
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
    search = AttractorSearch(system, parameters, low, high, _checked_options(options))
    search.find_caged()
    chosen = []
    for name, orbit in orbits.items():
        if orbit.system != system or dict(orbit.parameters) != parameters:
            allowed = f"of the same system and parameters as {next(iter(orbits))!r}"
            raise InputError(f"orbit {name!r}", orbit.system.name, allowed)
        if not orbit.stable or not orbit.admissible:
            said = "unstable" if not orbit.stable else "; ".join(orbit.reasons)
            raise InputError(f"orbit {name!r}", said, "an attractor: a stable orbit that is a motion")
        chosen.append(search.as_found(orbit))
    return _assembled(search, box, chosen, tuple(orbits), np.empty((0, len(box))))


def _checked_options(options: AttractorOptions | None) -> AttractorOptions:
    return AttractorOptions() if options is None else checks.instance("options", options, AttractorOptions)


def _further(search: AttractorSearch, options: AttractorOptions) -> NDArray[np.float64]:
    """Return the states from which motions start besides those of the region."""
    states = search.system.states
    for state in options.also:
        if len(state) != len(states) or not search.ensemble.admits(np.array(state)):
            allowed = f"states from which motions can start, each of {', '.join(states)}"
            raise InputError("AttractorOptions.also", state, allowed)
    return np.reshape(options.also, (len(options.also), len(states))).astype(np.float64)


def _checked_region(system: Definition, region: object) -> dict[str, tuple[float, float]]:
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


def _rank(search: AttractorSearch, found: Found) -> tuple[Any, ...]:
    """Return the key that sorts attractors, whichever motion found them."""
    regimes, regime = list(search.system.regimes), _regime(search.system, found)
    order = regimes.index(regime) if regime else len(regimes)
    centre, digits = (found.points[0], _DIGITS[0]) if found.period else (found.points.mean(axis=0), _DIGITS[1])
    size = float(np.round(np.linalg.norm(centre / search.scale), digits))
    place = (np.round(centre / search.scale, digits) + 0.0).tolist()
    return order, len(found.visited), found.touches, found.period or np.inf, found.kind, size, place


def _regime(system: Definition, found: Found) -> str:
    return next((name for name, visited in system.regimes.items() if set(visited) == found.visited), "")


def _named(system: Definition, found: list[Found]) -> tuple[str, ...]:
    return lettered([_regime(system, each) or each.name for each in found])


def _assembled(
    search: AttractorSearch,
    box: dict[str, tuple[float, float]],
    found: list[Found],
    names: tuple[str, ...] | None,
    starts: NDArray[np.float64],
) -> Attractors:
    if len(found) >= DIVERGED:
        raise InputError("region", box, "one with fewer attractors", f"{len(found)} were found")
    built = Building(search, found)
    traps = built.traps()
    while built.transients:
        found = [each for label, each in enumerate(found) if label not in built.transients]
        built = Building(search, found)
        traps = built.traps()
    names = names or _named(search.system, found)
    labels, periods = search.ensemble.settle(starts, built.with_virtual, built.longest)
    labels[(labels >= len(found)) & (labels < DIVERGED)] = UNDECIDED
    lost = starts[labels == UNDECIDED][:_TOLD]
    _, unsettled, _ = search.ensemble.arrivals(lost, built.with_virtual, built.longest)
    search.reporter.finish()
    outcomes = dict(enumerate(names)) | {DIVERGED: "diverged", UNDECIDED: "undecided"}
    return Attractors(
        search.system,
        search.system.resolve(search.parameters),
        box,
        search.interval,
        names,
        {name: each.kind for name, each in zip(names, found, strict=True)},
        {name: each.points for name, each in zip(names, found, strict=True)},
        {name: each.orbit for name, each in zip(names, found, strict=True) if each.orbit is not None},
        traps,
        {name: built.notes[label] for label, name in enumerate(names)},
        {name: int((labels == label).sum()) for label, name in outcomes.items()},
        built.error,
        {name: each.decay for name, each in zip(names, found, strict=True) if math.isfinite(each.decay)},
        int(periods[labels < DIVERGED].max(initial=0)),
        tuple(search.scale.tolist()),
        unsettled,
    )
