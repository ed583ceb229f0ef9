"""What is drawn of results, as arrays: curves by kind, marks, points that can be clicked."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation import Branch, Cascade, EquilibriumBranch, EquilibriumLocus, Locus
from saltus.equilibria import Equilibrium
from saltus.errors import InputError
from saltus.flow import Trajectory
from saltus.orbits import PeriodicOrbit
from saltus.plotting.orbit import segments_of, unwrapped_parts
from saltus.plotting.space import coordinates_of, stretches_of
from saltus.plotting.trajectory import flights_of
from saltus.sweeps import Sweep

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem, Map

__all__ = ["Drawn", "Mark", "Path", "Strand", "default_axes", "drawn", "observable_of", "path_of", "quantities_of"]

_EXTREMES = ("min", "max")


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


@dataclass(frozen=True)
class Drawn:
    """A result on the axes of the diagram.

    Attributes
    ----------
    strands : tuple of Strand
        Its curve.
    marks : tuple of Mark
        Its special points.
    points : ndarray, shape (point, 2)
        Places of its points, which can be selected; row `i` is point `i`.
    stable : ndarray of bool, shape (point,)
        Whether each is stable.
    dots : ndarray, shape (dot, 2)
        Points of a sweep.
    """

    strands: tuple[Strand, ...] = ()
    marks: tuple[Mark, ...] = ()
    points: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))
    stable: NDArray[np.bool_] = field(default_factory=lambda: np.empty(0, bool))
    dots: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 2)))


@dataclass(frozen=True)
class Path:
    """A motion as curves in two quantities.

    Attributes
    ----------
    curves : list of ndarray, shape (vertex, 2)
        The curve, cut at events and where an angle passes 2 pi.
    modes : list of int
        The mode of each curve.
    events : ndarray, shape (event, 2)
        Where events are.
    """

    curves: list[NDArray[np.float64]]
    modes: list[int]
    events: NDArray[np.float64]


def default_axes(system: HybridSystem, parameter: str) -> tuple[str, str]:
    """Return what a diagram shows first: the parameter, and an extreme of the first output or state."""
    return parameter, f"min_{system.output_names[0]}" if system.output_names else f"max_{system.states[0]}"


def quantities_of(system: HybridSystem) -> list[str]:
    """Return names that an axis of a diagram may have; formulas in observables are others.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> quantities_of(HybridSystem.smooth({"x": "v", "v": "-sin(x)"}, {"g": 1.0}))
    ['g', 'x', 'v', 'min_x', 'max_x', 'min_v', 'max_v', 'period']
    """
    seen = [*system.states, *system.output_names]
    return [
        *system.parameter_names,
        *system.states,
        *(f"{extreme}_{name}" for name in seen for extreme in _EXTREMES),
        "period",
    ]


def observable_of(name: str, system: HybridSystem | Map) -> str:
    """Return the observable that a name of an axis means for one motion, as ``"max(z)"`` for ``"max_z"``."""
    extreme, _, whose = name.partition("_")
    known = (*system.states, *system.output_names)
    return f"{extreme}({whose})" if extreme in _EXTREMES and whose in known else name


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
    if isinstance(result, PeriodicOrbit | Equilibrium):
        place = [[_reading(result, name) for name in names]]
        return Drawn(points=np.array(place), stable=np.array([result.stable]))
    if isinstance(result, Branch | EquilibriumBranch):
        points = np.column_stack([_column(result, name) for name in names])
        return Drawn(_strands(result, names), _marks(result, result.special_points, names), points, result.stable)
    if isinstance(result, Locus | EquilibriumLocus):
        if not set(names) & set(result.varied):
            raise InputError("axes", ", ".join(names), f"with {' or '.join(result.varied)}")
        return Drawn(_strands(result, names), _marks(result, result.special_points, names))
    if isinstance(result, Cascade):
        marks = [Mark("PD", f"PD{i + 1}", *_of_solution(p.orbit, names)) for i, p in enumerate(result.points)]
        return Drawn(marks=tuple(marks))
    return Drawn(dots=_dots(result, names)) if isinstance(result, Sweep) else Drawn()


def _of_solution(solution: Any, names: Sequence[str]) -> tuple[float, float]:
    x, y = (_reading(solution, name) for name in names)
    return x, y


def _reading(solution: Any, name: str) -> float:
    """Return a quantity of an orbit or an equilibrium, named as a column of a branch."""
    if name in solution.parameters:
        return float(solution.parameters[name])
    system = solution.system
    if isinstance(solution, Equilibrium):
        whose = observable_of(name, system).removeprefix("min(").removeprefix("max(").removesuffix(")")
        if whose in system.states:
            return float(solution.state[system.states.index(whose)])
        raise InputError("axis", name, "a parameter or a state of the equilibrium")
    if name in system.states:
        return float(solution.x0[system.states.index(name)])
    if name == "period":
        return float(solution.period)
    told = observable_of(name, system)
    return float(solution.observe(told)[told])


def _column(branch: Any, name: str) -> NDArray[np.float64]:
    if name in branch.parameters and name not in branch.varied:
        return np.full(len(branch), float(branch.parameters[name]))
    return np.asarray(branch.column(name))


def _strands(curve: Any, names: Sequence[str]) -> tuple[Strand, ...]:
    return tuple(Strand(stretch.kind, *stretch.places) for stretch in stretches_of(curve, names))


def _marks(curve: Any, points: Iterable[Any], names: Sequence[str]) -> tuple[Mark, ...]:
    return tuple(Mark(p.type, p.label, *map(float, coordinates_of(curve, p, names))) for p in points)


def _dots(sweep: Sweep, names: Sequence[str]) -> NDArray[np.float64]:
    x, y = names
    told = observable_of(y, sweep.system)
    if x != sweep.parameter:
        raise InputError("axes", ", ".join(names), f"with {sweep.parameter} to the right for a sweep along it")
    known = (*sweep.quantities, *sweep.observables)
    column = sweep.column(y if y in known else told)
    places = np.broadcast_to(sweep.values.reshape(-1, *(1,) * (column.ndim - 2)), column.shape)
    table = np.column_stack([places.ravel(), column.ravel()])
    return table[np.isfinite(table[:, 1])]


def path_of(motion: PeriodicOrbit | Trajectory, names: tuple[str, str]) -> Path:
    """Return an orbit or a motion as curves in two quantities.

    Parameters
    ----------
    motion : PeriodicOrbit or Trajectory
        The motion.
    names : (str, str)
        ``t``, states, outputs or expressions.

    Raises
    ------
    InputError
        A text that is no expression, or an unknown name in it.

    Examples
    --------
    >>> from saltus import HybridSystem, simulate
    >>> fall = simulate(HybridSystem.smooth({"z": "v", "v": "-1"}), {}, [1.0, 0.0], t_end=1.0)
    >>> path_of(fall, ("t", "z")).curves[0][-1].round(9)
    array([1. , 0.5])
    """
    phase = None if motion.system.phase is None else motion.system.phase[0]
    if isinstance(motion, PeriodicOrbit):
        curves, modes = segments_of(motion, names)
        ends = curves if motion.form.transitions[-1] >= 0 else []
    else:
        curves, modes, _ = flights_of(motion, names)
        ends = [curve for curve, kind in zip(curves, motion.events["kind"], strict=False) if kind == "event"]
    wrapped = [name == phase for name in names]
    cut = [unwrapped_parts(curve, wrapped) for curve in curves]
    told = [mode for mode, parts in zip(modes, cut, strict=True) for _ in parts]
    events = np.reshape([curve[-1] for curve in ends], (-1, 2))
    return Path([part for parts in cut for part in parts], told, events)
