"""Erosion of basins: integrity measures along a parameter.

Rules
-----
* At each value the attractors are found again and the basins mapped again, from nothing.
* An attractor is followed by its name. Where no attractor has the name, its measures are NaN. Names that come from what
  attractors look like, as "period-1 A", may pass from one to another when one is born or lost; then `within` follows
  them by their points: each has the name of the nearest one at a value before, if no further than `within`, or else
  one of its own that is new.
* A measure that cannot be taken at a value, as the LIM of an attractor outside the window, is NaN, with a note. So are
  all measures at a value where the search for attractors does not converge.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from saltus import checks
from saltus.basins.map.basins import Basins
from saltus.basins.map.grid import Grid, Plane
from saltus.basins.map.mapping import map_basins
from saltus.basins.measures.entropy import basin_entropy
from saltus.basins.measures.erosion import ErosionProfile
from saltus.basins.measures.integrity import (
    global_integrity,
    integrity_factor,
    local_integrity,
    minimal_fatal_perturbation,
)
from saltus.basins.measures.stability import Stability, basin_stability
from saltus.basins.measures.uncertainty import uncertainty_by_neighbours
from saltus.errors import ConvergenceError, InputError
from saltus.files import telling
from saltus.system import HybridSystem

if TYPE_CHECKING:
    import os

    from numpy.typing import ArrayLike, NDArray

__all__ = ["MEASURES", "Reading", "erosion_profile"]

Measure: TypeAlias = Callable[[Basins, str], Any]


class Reading(NamedTuple):
    """What a profile keeps of a measure.

    Attributes
    ----------
    value : float
        The measure.
    error : float
        What it is known to; NaN where that is not known.
    clipped : bool
        Whether the window's edge matters.
    note : str
        What to know besides, in words.
    """

    value: float
    error: float = math.nan
    clipped: bool = False
    note: str = ""


def _entropy(basins: Basins, name: str) -> Reading:
    found = basin_entropy(basins)
    return Reading(found.value, found.error)


def _boundary_entropy(basins: Basins, name: str) -> Reading:
    found = basin_entropy(basins)
    return Reading(found.boundary, found.boundary_error, note="fractal" if found.fractal else "")


def _exponent(basins: Basins, name: str) -> Reading:
    found = uncertainty_by_neighbours(basins)
    return Reading(found.value, found.error)


_OPTIONS = ("engine", "client", "longest", "tolerance", "preview", "interval")
"""Options that `erosion_profile` passes on to `map_basins`."""
MEASURES: Mapping[str, Measure] = MappingProxyType(
    {
        "GIM": global_integrity,
        "LIM": local_integrity,
        "IF": integrity_factor,
        "stability": basin_stability,
        "fatal": minimal_fatal_perturbation,
        "S_b": _entropy,
        "S_bb": _boundary_entropy,
        "exponent": _exponent,
    }
)
"""Measures by name: of integrity, basin stability, the minimal fatal perturbation, and, the same for all attractors,
entropies over boxes of five cells and the uncertainty exponent by neighbours."""


def erosion_profile(
    system: HybridSystem,
    parameter: str,
    values: ArrayLike,
    grid: Mapping[str, Any] | Plane | Grid,
    measures: Iterable[str] | Mapping[str, Measure] = ("GIM", "LIM", "IF"),
    *,
    parameters: Mapping[str, float] | None = None,
    attractors: Callable[[Mapping[str, float]], Any] | None = None,
    within: float | None = None,
    path: str | os.PathLike[str] | None = None,
    progress: Callable[[int, int, str], None] | None = None,
    **options: Any,
) -> ErosionProfile:
    """Return integrity measures of the attractors along a parameter.

    Parameters
    ----------
    system : HybridSystem
        What moves.
    parameter : str
        What varies, a parameter or a group of them.
    values : array_like, shape (value,)
        Its values, ascending.
    grid : mapping, Plane or Grid
        The cells, the same at every value, as for `map_basins`.
    measures : sequence of str, or mapping of str to callable, optional
        Names from `MEASURES`; or functions of the basins and an attractor's name, each with the name it is to have.
        They return a number, or something with a `value`, and perhaps `error`, `clipped` and `note`: as
        ``{"LIM": partial(local_integrity, weights={"x": 1.0, "v": 0.5})}``.
    parameters : mapping of str to float, optional
        Other values that differ from the defaults.
    attractors : callable, optional
        Called with all parameters, returns the attractors there; by default those that `map_basins` finds.
    within : float, optional
        How far an attractor may move from one value to the next, as the largest distance of a point of one from the
        points of the other. By default attractors are followed by their names.
    path : path-like, optional
        Where each value's basins are stored, one Zarr store each; a profile that ended early goes on from them. Without
        it they are held in memory, one after the other.
    progress : callable, optional
        Called with the count of values that are done, the count of all, and what has just been done in words.
    **options
        Passed on to `map_basins`: ``engine``, ``client``, ``longest``, ``tolerance``, ``preview``, ``interval``.

    Returns
    -------
    ErosionProfile
        An interrupt (Ctrl-C) keeps the values that are done; `ErosionProfile.stopped` says so.

    Raises
    ------
    InputError
        An argument that cannot be used, here or by `map_basins`.

    References
    ----------
    M. S. Soliman, J. M. T. Thompson, Integrity measures quantifying the erosion of smooth and fractal basins of
    attraction, J. Sound Vib. 135 (1989) 453-475; G. Rega, S. Lenci, Dynamical integrity and control of nonlinear
    mechanical oscillators, J. Vib. Control 14 (2008) 159-179.
    """
    checks.instance("system", system, HybridSystem)
    checks.chosen("parameter", parameter, (*system.parameter_names, *system.groups))
    checks.mapping("options", options, "names to options of map_basins", known=_OPTIONS)
    swept, taken = _ascending(values), _taken(measures)
    parameters = checks.mapping("parameters", parameters, "names to numbers, or None")
    base = system.resolve({**parameters, parameter: float(swept[0])})
    checks.function("attractors", attractors, "of the parameters")
    checks.function("progress", progress, "of two counts and a text")
    within = None if within is None else checks.positive("within", within)
    place = _folder(path)
    known: dict[str, NDArray[np.float64]] = {}
    rows: list[dict[str, list[Reading]] | str] = []
    cells: dict[str, Any] = {}
    with suppress(KeyboardInterrupt):
        for value in swept:
            at = {**parameters, parameter: float(value)}
            store = None if place is None else place / f"{parameter}={value:.12g}.zarr"
            try:
                found = None if attractors is None else attractors(system.resolve(at))
                basins = map_basins(system, at, grid, found, path=store, **options)
            except ConvergenceError as error:
                said = str(error)
                rows.append(said)
            else:
                if "interrupted" in basins.stopped:
                    break
                cells = basins.grid.definition()
                called = _called(basins.attractors, known, within)
                rows.append({called[name]: _row(basins, name, taken) for name in basins.attractors.names})
                said = ", ".join(f"{name} {share:.2%}" for name, share in basins.fractions().items() if share)
            if progress is not None:
                progress(len(rows), swept.size, f"{parameter} = {value:.6g}: {said}")
    return _profile(system, parameter, swept, base, tuple(taken), rows, cells)


def _profile(
    system: HybridSystem,
    parameter: str,
    values: NDArray[np.float64],
    parameters: Mapping[str, float],
    measures: tuple[str, ...],
    rows: list[dict[str, list[Reading]] | str],
    grid: Mapping[str, Any],
) -> ErosionProfile:
    """The profile of what has been read at the first values, or why there is nothing at one of them."""
    names = tuple(dict.fromkeys(name for row in rows if not isinstance(row, str) for name in row))
    shape = (values.size, len(names), len(measures))
    found, errors = np.full(shape, np.nan), np.full(shape, np.nan)
    clipped, notes = np.zeros(shape, np.bool_), np.full(shape, "not computed", dtype=object)
    for j, row in enumerate(rows):
        reason, read = (row, {}) if isinstance(row, str) else ("there is no attractor of this name", row)
        missing = [Reading(math.nan, note=reason)] * len(measures)
        for i, name in enumerate(names):
            for k, reading in enumerate(read.get(name, missing)):
                found[j, i, k], errors[j, i, k], clipped[j, i, k], notes[j, i, k] = reading
    done, total = len(rows), values.size
    stopped = f"all {total} values done" if done == total else f"interrupted: {done} of {total} values done"
    return ErosionProfile(
        system, parameter, values, parameters, names, measures, found, errors, clipped, notes, grid, stopped
    )  # fmt: skip


def _called(attractors: Any, known: dict[str, NDArray[np.float64]], within: float | None) -> dict[str, str]:
    """The name in the profile of each attractor; `known` has the last points of each, and gets these."""
    points = {name: np.atleast_2d(attractors.points[name]) for name in attractors.names}
    if within is None:
        return {name: name for name in points}
    pairs = sorted(
        (distance, name, before)
        for name, here in points.items()
        for before, there in known.items()
        if (distance := _apart(here, there)) <= within
    )
    called: dict[str, str] = {}
    for _, name, before in pairs:
        if name not in called and before not in called.values():
            called[name] = before
    for name in points:
        if name not in called:
            called[name] = _new(name, {*known, *called.values()})
    known.update({called[name]: here for name, here in points.items()})
    return called


def _apart(one: NDArray[np.float64], other: NDArray[np.float64]) -> float:
    """Hausdorff distance of two sets of points."""
    from scipy.spatial.distance import directed_hausdorff

    return max(float(directed_hausdorff(one, other)[0]), float(directed_hausdorff(other, one)[0]))


def _new(name: str, taken: set[str]) -> str:
    """A name that is not taken."""
    names = (name if count == 1 else f"{name} ({count})" for count in range(1, len(taken) + 2))
    return next(each for each in names if each not in taken)


def _row(basins: Basins, name: str, measures: Mapping[str, Measure]) -> list[Reading]:
    """All measures of an attractor."""
    readings = []
    for measure in measures.values():
        try:
            readings.append(_reading(measure(basins, name)))
        except InputError as error:
            readings.append(Reading(math.nan, note=str(error)))
    return readings


def _reading(found: Any) -> Reading:
    """What a profile keeps of what a measure returned."""
    if isinstance(found, Stability):
        return Reading(found.value, 0.5 * (found.high - found.low))
    if not hasattr(found, "value"):
        return Reading(float(found))
    error, clipped = float(getattr(found, "error", math.nan)), bool(getattr(found, "clipped", False))
    return Reading(float(found.value), error, clipped, str(getattr(found, "note", "")))


def _taken(measures: Iterable[str] | Mapping[str, Measure]) -> dict[str, Measure]:
    """The measures by name."""
    if isinstance(measures, Mapping):
        taken = checks.mapping("measures", measures, "names to functions")
        for name, measure in taken.items():
            if not callable(measure):
                raise InputError(f"measures[{name!r}]", measure, "a function of the basins and an attractor's name")
    else:
        given = [measures] if isinstance(measures, str) else measures
        named = checks.names("measures", given, f"names of measures: {', '.join(MEASURES)}")
        taken = {name: MEASURES[checks.chosen("measures", name, MEASURES)] for name in named}
    if not taken:
        raise InputError("measures", measures, "at least one")
    return taken


def _ascending(values: ArrayLike) -> NDArray[np.float64]:
    array = np.atleast_1d(checks.array("values", values, "finite numbers, ascending"))
    if array.ndim != 1 or not array.size or not (np.diff(array) > 0.0).all():
        raise InputError("values", values, "finite numbers, ascending")
    return array


def _folder(path: str | os.PathLike[str] | None) -> Path | None:
    if path is None:
        return None
    folder = checks.path("path", path, "the path of a folder")
    with telling(folder, "path", place="a folder"):
        folder.mkdir(parents=True, exist_ok=True)
    return folder
