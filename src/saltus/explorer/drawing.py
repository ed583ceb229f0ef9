"""What is drawn of results, as arrays: curves by kind, marks, points that can be clicked."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.results.cascade import Doublings
from saltus.continuation.results.curve import SolutionCurve
from saltus.continuation.results.map_curve import MapBranch
from saltus.errors import InputError
from saltus.explorer.kinds import kind_of
from saltus.explorer.solutions import EXTREMES, observable_of, quantity_of
from saltus.plotting.map_orbit import at_each_point
from saltus.plotting.space import coordinates_of, stretches_of
from saltus.solution import Solution
from saltus.sweeps import Sweep

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem, Map

__all__ = ["Drawn", "Mark", "Strand", "default_axes", "drawn", "extent_of", "quantities_of", "sheets_of"]


_UNBOUNDED = "without bound"  # in the words of why a branch ended
_STEEP = 0.05  # part of the range of a parameter, next to such an end, that sets no limits


@dataclass(frozen=True)
class Strand:
    """A stretch of a curve of one kind: ``stable``, ``unstable`` or no motion of the system."""

    kind: str
    x: NDArray[np.float64]
    y: NDArray[np.float64]


@dataclass(frozen=True)
class Mark:
    """A special point."""

    type: str
    label: str
    x: float
    y: float
    locus: str = ""  # type of the locus on which it lies; empty on a branch


@dataclass(frozen=True)
class Drawn:
    """A result on the axes of the diagram."""

    strands: tuple[Strand, ...] = ()  # its curve
    marks: tuple[Mark, ...] = ()  # its special points
    # shape (point, 2): places of its points, which can be selected; row `i` is point `i`
    points: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    # shape (point,): whether each is stable
    stable: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, bool))
    count: int = 0  # points of the curve, where rows of `points` beyond are further places of the same ones
    # shape (point, 2): the points that set an axis' limits, where others run to infinity; None for all
    bounded: NDArray[np.float64] | None = None
    dots: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))  # shape (dot, 2): points of a sweep


def default_axes(system: HybridSystem | Map, parameter: str) -> tuple[str, str]:
    """Return what a diagram shows first: the parameter, and the first output or state, or an extreme of it."""
    if not kind_of(system).extremes:
        return parameter, [*system.output_names, *system.states][0]
    return parameter, f"min_{system.output_names[0]}" if system.output_names else f"max_{system.states[0]}"


def quantities_of(system: HybridSystem | Map) -> list[str]:
    """Return names that an axis of a diagram may have; formulas in observables are others.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> quantities_of(HybridSystem.smooth({"x": "v", "v": "-sin(x)"}, {"g": 1.0}))
    ['g', 'x', 'v', 'min_x', 'max_x', 'min_v', 'max_v', 'period']
    """
    seen = [*system.states, *system.output_names]
    if not kind_of(system).extremes:
        return [*system.parameter_names, *seen]
    return [
        *system.parameter_names,
        *system.states,
        *(f"{extreme}_{name}" for name in seen for extreme in EXTREMES),
        "period",
    ]


@singledispatch
def drawn(result: Any, names: Sequence[str]) -> Drawn:
    """Return a result on axes.

    Parameters
    ----------
    result : Result
        An orbit, an equilibrium, a branch, a locus, a cascade or a sweep; others have nothing to draw here.
    names : (str, str)
        Abscissa and ordinate: parameters, quantities, or formulas in observables.

    Raises
    ------
    InputError
        The result has no such quantity.

    Examples
    --------
    >>> from saltus import HybridSystem, find_orbit
    >>> spring = HybridSystem.smooth({"x": "v", "v": "cos(s) - x - v"}, {"w": 1.0}, phase=("s", "w"))
    >>> drawn(find_orbit(spring, x0=[0.0, 0.0]), ("w", "max_x")).points.round(6)
    array([[1., 1.]])
    """
    return Drawn()


@drawn.register
def _(solution: Solution, names: Sequence[str]) -> Drawn:
    return Drawn(points=np.array([_place(solution, names)]), stable=np.array([solution.stable]))


@drawn.register(SolutionCurve)
def _(curve: Any, names: Sequence[str]) -> Drawn:
    along_one = len(curve.varied) == 1
    if not along_one and not set(names) & set(curve.varied):
        raise InputError("axes", ", ".join(names), f"with {' or '.join(curve.varied)}")
    sheets = sheets_of(curve, names)
    strands = tuple(Strand(stretch.kind, *stretch.places) for sheet in sheets for stretch in stretches_of(sheet, names))
    places = [(p, *coordinates_of(curve, p, names).tolist()) for p in curve.special_points]
    marks = tuple(Mark(p.type, p.label, x, y, p.locus) for p, x, y in places)
    if not along_one:
        return Drawn(strands, marks)
    points = np.vstack([np.column_stack([_column(sheet, name) for name in names]) for sheet in sheets])
    stable = np.tile(curve.stable, len(sheets))
    near = np.zeros(len(curve), bool)
    for end, reason in zip((0, -1), curve.stopped, strict=True):
        if _UNBOUNDED in reason:
            near |= np.abs(curve.values - curve.values[end]) < _STEEP * float(np.ptp(curve.values))
    bounded = points[~np.tile(near, len(sheets))] if near.any() and not near.all() else None
    return Drawn(strands, marks, points, stable, len(curve), bounded)


def extent_of(found: Drawn) -> NDArray[np.float64]:
    """Return the places of a result that set the limits of axes, shape (place, 2)."""
    curves = [np.column_stack([strand.x, strand.y]) for strand in found.strands] if found.bounded is None else []
    marks = np.reshape([(mark.x, mark.y) for mark in found.marks], (-1, 2))
    return np.vstack([*curves, marks, found.points if found.bounded is None else found.bounded, found.dots])


@singledispatch
def sheets_of(curve: Any, names: Sequence[str]) -> list[Any]:
    """Return a branch or a locus once for each curve that it has over some quantities."""
    return [curve]


@sheets_of.register
def _(branch: MapBranch, names: Sequence[str]) -> list[Any]:
    moving = {*branch.system.states, *branch.system.output_names}
    return [*at_each_point(branch)] if moving & set(names) else [branch]


@drawn.register
def _(cascade: Doublings, names: Sequence[str]) -> Drawn:
    places = (_place(point.solution, names) for point in cascade.points)
    return Drawn(marks=tuple(Mark("PD", f"PD{i}", x, y) for i, (x, y) in enumerate(places, 1)))


@drawn.register
def _(sweep: Sweep, names: Sequence[str]) -> Drawn:
    x, y = names
    if x != sweep.parameter:
        raise InputError("axes", ", ".join(names), f"with {sweep.parameter} to the right for a sweep along it")
    known = (*sweep.quantities, *sweep.observables)
    column = sweep.column(y if y in known else observable_of(y, sweep.system))
    places = np.broadcast_to(sweep.values.reshape(-1, *(1,) * (column.ndim - 2)), column.shape)
    table = np.column_stack([places.ravel(), column.ravel()])
    return Drawn(dots=table[np.isfinite(table[:, 1])])


def _place(solution: Any, names: Sequence[str]) -> list[float]:
    return [quantity_of(solution, name) for name in names]


def _column(branch: Any, name: str) -> NDArray[np.float64]:
    if name in branch.parameters and name not in branch.varied:
        return np.full(len(branch), float(branch.parameters[name]))
    return np.asarray(branch.column(name))
