"""What the page shows of a solution or a motion: a kind registers here what it is, its numbers and its curves."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.equilibria import Equilibrium
from saltus.errors import InputError
from saltus.explorer.kinds import kind_of
from saltus.explorer.visits import Path, names_of, visited
from saltus.flow import Trajectory
from saltus.maps import Iterates, MapOrbit
from saltus.orbits import PeriodicOrbit
from saltus.plotting.linear_motions import linear_motions
from saltus.plotting.orbit import segments_of, unwrapped_parts
from saltus.plotting.trajectory import flights_of
from saltus.solution import Solution
from saltus.system import Map

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = [
    "EXTREMES",
    "Path",
    "Traits",
    "observable_of",
    "path_of",
    "quantities_in_plane",
    "quantity_of",
    "readings_of",
    "traits_of",
]

EXTREMES = ("min", "max")
_MOST_STEPS = 100_000  # steps of a motion that is drawn: the server would stand still, 64 s for 2.4 million
_ZERO = 1e-12  # size of a mean, over that of the extremes, below which it is rounding


@dataclass(frozen=True)
class Traits:
    """What the page must know of a solution to go on from it."""

    what: str = ""  # what a branch through it is a branch of, as ``"orbit"``; empty where none can be followed
    spectrum: str = ""  # what the numbers are called that decide whether it is stable
    values: NDArray[np.complex128] = field(default_factory=lambda: np.empty(0, complex))  # these numbers
    interval: float = 2.0 * np.pi  # time between two looks at motions nearby, where time has no unit of its own
    circle: bool = False  # whether a modulus of 1 of these numbers is critical, and not a real part of 0
    point: str = "event"  # what a point is that is marked on its curves


@singledispatch
def traits_of(solution: Any) -> Traits:
    """Return what the page must know of a solution, or of a motion, to go on from it."""
    return Traits()


@traits_of.register
def _(orbit: PeriodicOrbit) -> Traits:
    return Traits("orbit", "Floquet multipliers", orbit.multipliers, float(orbit.period), circle=True)


@traits_of.register
def _(rest: Equilibrium) -> Traits:
    fastest = float(np.abs(rest.eigenvalues).max())
    interval = 2.0 * np.pi / fastest if fastest > 0.0 else 1.0
    return Traits("equilibrium", "Eigenvalues", rest.eigenvalues, interval, point="equilibrium")


@traits_of.register
def _(orbit: MapOrbit) -> Traits:
    return Traits("map_orbit", "Multipliers", orbit.multipliers, circle=True, point="point")


@traits_of.register
def _(motion: Iterates) -> Traits:
    return Traits(point="point")


@singledispatch
def path_of(motion: Any, names: Sequence[str]) -> Path:
    """Return a solution or a motion as curves in some quantities.

    Parameters
    ----------
    motion : PeriodicOrbit, Equilibrium, Trajectory or another
        The motion; of what is none, there are no curves.
    names : sequence of str
        ``t``, states, outputs or expressions.

    Raises
    ------
    InputError
        A text that is no expression, or an unknown name in it; a motion that is too long to be drawn.

    Examples
    --------
    >>> from saltus import HybridSystem, simulate
    >>> fall = simulate(HybridSystem.smooth({"z": "v", "v": "-1"}), {}, [1.0, 0.0], t_end=1.0)
    >>> path_of(fall, ("t", "z")).curves[0][-1].round(9)
    array([1. , 0.5])
    """
    return Path()


@path_of.register
def _(orbit: PeriodicOrbit, names: Sequence[str]) -> Path:
    curves, modes = segments_of(orbit, names)
    return _cut(orbit.system, names, curves, modes, curves if orbit.form.transitions[-1] >= 0 else [])


@path_of.register
def _(motion: Trajectory, names: Sequence[str]) -> Path:
    if len(motion.step_times) > _MOST_STEPS:
        allowed = f"of at most {_MOST_STEPS} steps to be drawn"
        raise InputError("motion", f"{len(motion.step_times)} steps", allowed, "it is kept")
    curves, modes, _ = flights_of(motion, names)
    ended = zip(curves, motion.events["kind"], strict=False)
    return _cut(motion.system, names, curves, modes, [curve for curve, kind in ended if kind == "event"])


@path_of.register
def _(rest: Equilibrium, names: Sequence[str]) -> Path:
    curves, mode = linear_motions(rest, names), rest.system.mode_index(rest.mode)
    return Path(curves, [mode] * len(curves), _at_rest(rest, names))


@path_of.register
def _(orbit: MapOrbit, names: Sequence[str]) -> Path:
    return visited(orbit, names, closed=True)


@path_of.register
def _(motion: Iterates, names: Sequence[str]) -> Path:
    return visited(motion, names, closed=False)


@path_of.register
def _(solution: Solution, names: Sequence[str]) -> Path:
    return Path(events=_at_rest(solution, names))


def _at_rest(solution: Solution, names: Sequence[str]) -> NDArray[np.float64]:
    """Return where a solution is in two quantities; shape (place, 2)."""
    places, states = solution.states_along()
    columns = {"t": places, **dict(zip(solution.system.states, states.T, strict=True))}
    if unknown := [name for name in names if name not in columns]:
        raise InputError("quantity", unknown[0], f"one of {', '.join(columns)} for {solution.noun}")
    return np.column_stack([columns[name] for name in names])


def _cut(
    system: HybridSystem,
    names: Sequence[str],
    curves: list[NDArray[np.float64]],
    modes: list[int],
    ends: list[NDArray[np.float64]],
) -> Path:
    """Return curves, cut where the phase goes back to 0, with the last vertices of those that end at events."""
    phase = None if system.phase is None else system.phase[0]
    cut = [unwrapped_parts(curve, [name == phase for name in names], system.turn) for curve in curves]
    told = [mode for mode, parts in zip(modes, cut, strict=True) for _ in parts]
    return Path(
        [part for parts in cut for part in parts], told, np.reshape([curve[-1] for curve in ends], (-1, len(names)))
    )


@singledispatch
def readings_of(shown: Any, instrument: Callable[[Any], Mapping[str, Any]]) -> Mapping[str, Any]:
    """Return observables of a solution or a motion by name.

    Parameters
    ----------
    shown : PeriodicOrbit, Equilibrium, Trajectory or another
        The solution.
    instrument : callable
        Returns what an instrument shows of an orbit, by name.

    Examples
    --------
    >>> from saltus import HybridSystem, find_equilibrium
    >>> found = find_equilibrium(HybridSystem.smooth({"x": "a - x"}, {"a": 2.0}), x0=[1.0])
    >>> readings_of(found, dict)
    {'x': 2.0, 'stable': True, 'mode': 'smooth', 'regular': True, 'a': 2.0}
    """
    return {}


@readings_of.register
def _(orbit: PeriodicOrbit, instrument: Callable[[Any], Mapping[str, Any]]) -> Mapping[str, Any]:
    path = " ".join(":".join(pair) for pair in orbit.signature)
    names = [*orbit.system.states, *orbit.system.output_names]
    texts = [f"{kind}({name})" for name in names for kind in (*EXTREMES, "mean")]
    texts += [f"{kind}({name}, 1)" for name in names[:1] for kind in ("amplitude", "phase")]
    found = orbit.observe(*texts)
    for name in names:  # what is rounding beside the extremes reads 0
        kinds = [f"{kind}({name})" for kind in (*EXTREMES, "mean")]
        size = max(abs(found[kind]) for kind in kinds)
        found |= {kind: 0.0 for kind in kinds if abs(found[kind]) < _ZERO * size}
    own = {"period": orbit.period, "signature": path, **found}
    return {**instrument(orbit), **own, **orbit.parameters}


@readings_of.register
def _(solution: Solution, instrument: Callable[[Any], Mapping[str, Any]]) -> Mapping[str, Any]:
    return {**solution.row(), **solution.parameters}


@readings_of.register
def _(motion: Iterates, instrument: Callable[[Any], Mapping[str, Any]]) -> Mapping[str, Any]:
    names = [*motion.system.states, *motion.system.output_names]
    found = motion.observe(*(f"{kind}({name})" for name in names for kind in (*EXTREMES, "mean")))
    ends = zip(motion.system.states, motion.x_end.tolist(), strict=True)
    return {**{f"{name} at the end": x for name, x in ends}, **found, **motion.parameters}


@readings_of.register
def _(motion: Trajectory, instrument: Callable[[Any], Mapping[str, Any]]) -> Mapping[str, Any]:
    ends = zip(motion.system.all_states, motion.x_end.tolist(), strict=True)
    return {**{f"{name} at the end": x for name, x in ends}, "events": len(motion.events), **motion.parameters}


def observable_of(name: str, system: HybridSystem | Map) -> str:
    """Return the observable that a name of an axis means for one motion, as ``"max(z)"`` for ``"max_z"``."""
    extreme, _, whose = name.partition("_")
    known = (*system.states, *system.output_names)
    return f"{extreme}({whose})" if extreme in EXTREMES and whose in known else name


@singledispatch
def quantities_in_plane(system: Any) -> list[str]:
    """Return names of quantities that the axes of a portrait offer, time first.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> quantities_in_plane(HybridSystem.smooth({"x": "v", "v": "-x"}))
    ['t', 'x', 'v']
    """
    phase = [] if system.phase is None else [system.phase[0]]
    return [kind_of(system).time, *system.states, *phase, *system.output_names]


@quantities_in_plane.register
def _(system: Map) -> list[str]:
    return names_of(system)


def quantity_of(solution: Any, name: str) -> float:
    """Return a quantity of a solution, named as a column of a branch.

    Parameters
    ----------
    solution : PeriodicOrbit, Equilibrium or another
        The solution.
    name : str
        A parameter, a state at phase 0, an extreme such as ``max_x``, or what else its kind knows.

    Raises
    ------
    InputError
        The solution has no such quantity.
    """
    states = solution.system.states
    if name in solution.parameters:
        return float(solution.parameters[name])
    if name in states:
        return float(solution.x0[states.index(name)])
    side, _, rest = observable_of(name, solution.system).partition("(")
    if side in EXTREMES and (whose := rest.removesuffix(")")) in states:
        return float(solution.extremes[EXTREMES.index(side)][states.index(whose)])
    return _observed(solution, name)


@singledispatch
def _observed(solution: Any, name: str) -> float:
    raise InputError("axis", name, "a parameter, a state or an extreme of it")


@_observed.register
def _(orbit: MapOrbit, name: str) -> float:
    return float(orbit.output(name)[0])


@_observed.register
def _(orbit: PeriodicOrbit, name: str) -> float:
    told = observable_of(name, orbit.system)
    return float(orbit.period if name == "period" else orbit.observe(told)[told])
