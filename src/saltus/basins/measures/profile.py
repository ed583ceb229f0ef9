"""Erosion of basins: integrity measures along a parameter (docs/theory/integrity.md, "Erosion").

Rules
-----
* At each value the attractors are found and the basins mapped independently of other values.
* An attractor is followed by its name. Where no attractor has the name, its measures are NaN. Names of kinds, as
  "period-1 A", may pass to another attractor when one is born or lost. With `within`, attractors are therefore followed
  by their points. Each gets the name of the nearest attractor at earlier values, if no further than `within`, else a
  new name.
* A measure that is not defined at a value, as the LIM of an attractor outside the window, is NaN, with a note. So are
  all measures at a value where the search for attractors does not converge.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

from saltus import checks
from saltus.basins.map.basins import Basins
from saltus.basins.map.grid import Grid, Plane
from saltus.basins.map.mapping import map_basins
from saltus.basins.map.options import BasinOptions
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
from saltus.progress import Report, Reporter, ended
from saltus.system import HybridSystem, Map
from saltus.system.angles import on_circles
from saltus.system.maps import checked_system

if TYPE_CHECKING:
    import os

    from numpy.typing import ArrayLike, NDArray

__all__ = ["MEASURES", "ErosionOptions", "Reading", "erosion_profile"]

Measure: TypeAlias = Callable[[Basins, str], Any]  # of basins and an attractor's name


class Reading(NamedTuple):
    """What a profile keeps of a measure."""

    value: float  # the measure
    error: float = math.nan  # error of the measure; NaN where unknown
    clipped: bool = False  # whether the window's edge limits the measure
    note: str = ""  # a remark in words


def _entropy(basins: Basins, name: str) -> Reading:
    found = basin_entropy(basins)
    return Reading(found.value, found.error)


def _boundary_entropy(basins: Basins, name: str) -> Reading:
    found = basin_entropy(basins)
    return Reading(found.boundary, found.boundary_error, note="fractal" if found.fractal else "")


def _exponent(basins: Basins, name: str) -> Reading:
    found = uncertainty_by_neighbours(basins)
    return Reading(found.value, found.error)


# Measures by name. S_b and S_bb have boxes of five cells; like the exponent, they are equal for all attractors.
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


@dataclass(frozen=True, kw_only=True)
class ErosionOptions:
    """Options with which `erosion_profile` measures basins along a parameter.

    Parameters
    ----------
    measures : sequence of str, or mapping of str to callable
        Names from `MEASURES`; or functions by name, called with the basins and an attractor's name. They return a
        number, or an object with a `value`, and perhaps `error`, `clipped` and `note`. For example
        ``{"LIM": partial(local_integrity, weights={"x": 1.0, "v": 0.5})}``.
    attractors : callable, optional
        Called with all parameters, returns the attractors; by default `map_basins` finds them.
    within : float, optional
        Largest distance that an attractor may move from one value to the next, the Hausdorff distance of its points. By
        default attractors are followed by their names.
    basins : BasinOptions
        Options of the map at each value.

    Raises
    ------
    InputError
        An option that no profile can have.

    Examples
    --------
    >>> ErosionOptions(measures=["GIM"], within=0.3, basins=BasinOptions(preview=True)).within
    0.3
    """

    measures: Iterable[str] | Mapping[str, Measure] = ("GIM", "LIM", "IF")
    attractors: Callable[[Mapping[str, float]], Any] | None = None
    within: float | None = None
    basins: BasinOptions = field(default_factory=BasinOptions)

    def __post_init__(self) -> None:
        object.__setattr__(self, "measures", _checked_measures(self.measures))
        checks.function("ErosionOptions.attractors", self.attractors, "of the parameters")
        if self.within is not None:
            object.__setattr__(self, "within", checks.positive("ErosionOptions.within", self.within))
        checks.instance("ErosionOptions.basins", self.basins, BasinOptions)


def erosion_profile(
    system: HybridSystem | Map,
    parameter: str,
    values: ArrayLike,
    grid: Mapping[str, Any] | Plane | Grid,
    *,
    parameters: Mapping[str, float] | None = None,
    options: ErosionOptions | None = None,
    path: str | os.PathLike[str] | None = None,
    progress: bool | Report = False,
) -> ErosionProfile:
    """Return integrity measures of the attractors along a parameter.

    Parameters
    ----------
    system : HybridSystem or Map
        The system.
    parameter : str
        The parameter that varies, or a group of parameters.
    values : array_like, shape (value,)
        Its values, ascending.
    grid : mapping, Plane or Grid
        The cells, the same at every value, as for `map_basins`.
    parameters : mapping of str to float, optional
        Other values that differ from the defaults.
    options : ErosionOptions, optional
        What is measured, how attractors are followed, and how the basins are mapped.
    path : path-like, optional
        Folder with one Zarr store of basins for each value, from which an interrupted profile resumes. By default
        basins are held in memory, one after the other.
    progress : bool or callable, optional
        True for a bar on stderr, or a function called with a `saltus.Progress`, which counts values.

    Returns
    -------
    ErosionProfile
        An interrupt (Ctrl-C) keeps the finished values; `ErosionProfile.stopped` says so.

    Raises
    ------
    InputError
        An argument that cannot be used, here or by `map_basins`.

    References
    ----------
    M. S. Soliman, J. M. T. Thompson, Integrity measures quantifying the erosion of smooth and fractal basins of
    attraction, J. Sound Vib. 135 (1989) 453-475; G. Rega, S. Lenci, Dynamical integrity and control of nonlinear
    mechanical oscillators, J. Vib. Control 14 (2008) 159-179.

    Examples
    --------
    >>> import saltus
    >>> basins = saltus.Map(("x",), {"a": 0.5}, {"x": "a*x + x**3"})
    >>> profile = erosion_profile(basins, "a", [0.2, 0.5], {"x": (-2.0, 2.0, 101)})
    >>> profile.values.tolist()
    [0.2, 0.5]
    """
    checked_system(system)
    checks.chosen("parameter", parameter, (*system.parameter_names, *system.groups))
    chosen = ErosionOptions() if options is None else checks.instance("options", options, ErosionOptions)
    swept, asked = checks.ascending("values", values), chosen.measures
    taken = asked if isinstance(asked, Mapping) else {name: MEASURES[name] for name in asked}
    parameters = checks.mapping("parameters", parameters, "names to numbers, or None")
    base = system.resolve({**parameters, parameter: float(swept[0])})
    place = _folder(path)
    known: dict[str, NDArray[np.float64]] = {}
    rows: list[dict[str, list[Reading]] | str] = []
    cells: dict[str, Any] = {}
    with suppress(KeyboardInterrupt), Reporter(progress, swept.size) as reporter:
        for value in swept:
            at = {**parameters, parameter: float(value)}
            store = None if place is None else place / f"{parameter}={value:.12g}.zarr"
            try:
                found = None if chosen.attractors is None else chosen.attractors(system.resolve(at))
                basins = map_basins(system, at, grid, found, options=chosen.basins, path=store)
            except ConvergenceError as error:
                said = str(error)
                rows.append(said)
            else:
                if "interrupted" in basins.stopped:
                    break
                cells = basins.grid.definition()
                called = _called(basins.attractors, known, chosen.within)
                rows.append({called[name]: _row(basins, name, taken) for name in basins.attractors.names})
                said = ", ".join(f"{name} {share:.2%}" for name, share in basins.fractions().items() if share)
            reporter.step(1, f"{parameter} = {value:.6g}: {said}")
    return _profile(system, parameter, swept, base, tuple(taken), rows, cells)


def _profile(
    system: HybridSystem | Map,
    parameter: str,
    values: NDArray[np.float64],
    parameters: Mapping[str, float],
    measures: tuple[str, ...],
    rows: list[dict[str, list[Reading]] | str],
    grid: Mapping[str, Any],
) -> ErosionProfile:
    """Return the profile of the first values, from readings, or a value's reason for having none."""
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
    stopped = ended(len(rows), values.size, "values")
    return ErosionProfile(
        system, parameter, values, parameters, names, measures, found, errors, clipped, notes, grid, stopped
    )  # fmt: skip


def _called(attractors: Any, known: dict[str, NDArray[np.float64]], within: float | None) -> dict[str, str]:
    """Return each attractor's name in the profile; `known` has the last points by name, and is updated."""
    points = {name: np.atleast_2d(attractors.points[name]) for name in attractors.names}
    if within is None:
        return {name: name for name in points}
    circles = attractors.system.angle_places
    pairs = sorted(
        (distance, name, before)
        for name, here in points.items()
        for before, there in known.items()
        if (distance := _apart(here, there, circles)) <= within
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


def _apart(one: NDArray[np.float64], other: NDArray[np.float64], circles: NDArray[np.int64]) -> float:
    """Return the Hausdorff distance of two sets of points, whose angles are seen by cosine and sine."""
    from scipy.spatial.distance import directed_hausdorff

    one, other = (on_circles(points, np.zeros(points.shape[1]), circles)[0] for points in (one, other))
    return max(float(directed_hausdorff(one, other)[0]), float(directed_hausdorff(other, one)[0]))


def _new(name: str, taken: set[str]) -> str:
    """Return a name that is not taken."""
    names = (name if count == 1 else f"{name} ({count})" for count in range(1, len(taken) + 2))
    return next(each for each in names if each not in taken)


def _row(basins: Basins, name: str, measures: Mapping[str, Measure]) -> list[Reading]:
    """Return all measures of an attractor."""
    readings = []
    for measure in measures.values():
        try:
            readings.append(_reading(measure(basins, name)))
        except InputError as error:
            readings.append(Reading(math.nan, note=str(error)))
    return readings


def _reading(found: Any) -> Reading:
    """Return the part of a measure's result that a profile keeps."""
    if isinstance(found, Stability):
        return Reading(found.value, 0.5 * (found.high - found.low))
    if not hasattr(found, "value"):
        return Reading(float(found))
    error, clipped = float(getattr(found, "error", math.nan)), bool(getattr(found, "clipped", False))
    return Reading(float(found.value), error, clipped, str(getattr(found, "note", "")))


def _checked_measures(measures: Iterable[str] | Mapping[str, Measure]) -> tuple[str, ...] | Mapping[str, Measure]:
    """Return the measures, by name or as functions by name."""
    where = "ErosionOptions.measures"
    if isinstance(measures, Mapping):
        taken = checks.mapping(where, measures, "names to functions")
        for name, measure in taken.items():
            if not callable(measure):
                raise InputError(f"{where}[{name!r}]", measure, "a function of the basins and an attractor's name")
        found: tuple[str, ...] | Mapping[str, Measure] = taken
    else:
        given = [measures] if isinstance(measures, str) else measures
        found = checks.names(where, given, f"names of measures: {', '.join(MEASURES)}")
        for name in found:
            checks.chosen(where, name, MEASURES)
    if not found:
        raise InputError(where, measures, "at least one")
    return found


def _folder(path: str | os.PathLike[str] | None) -> Path | None:
    if path is None:
        return None
    folder = checks.path("path", path, "the path of a folder")
    with telling(folder, "path", place="a folder"):
        folder.mkdir(parents=True, exist_ok=True)
    return folder
