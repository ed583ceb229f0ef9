"""Picture of a cascade: the tree of all returns, the doublings at its forks, and the limit of the doublings."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.results.branch import Branch
from saltus.continuation.results.cascade import Cascade
from saltus.continuation.results.map_cascade import MapCascade
from saltus.continuation.results.map_curve import MapBranch
from saltus.continuation.results.special_points import SpecialPoint, SpecialPoints
from saltus.flow import simulate
from saltus.maps import MapOrbit
from saltus.plotting import plot, style
from saltus.plotting.branch import draw_pieces, pieces_of
from saltus.plotting.map_orbit import at_each_point, turned_orbit
from saltus.plotting.ordinates import ordinate_of
from saltus.system.angles import TURN

if TYPE_CHECKING:
    from collections.abc import Mapping, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["plot_cascade"]


@plot.register(Cascade)
@plot.register(MapCascade)
def plot_cascade(
    cascade: Cascade | MapCascade,
    x: str | None = None,
    y: str | None = None,
    *,
    ax: Axes | None = None,
    special: bool = True,
    legend: bool = True,
) -> Axes:
    """Draw a cascade and return the matplotlib Axes.

    Lines are those of `saltus.plotting.branch`. A state is drawn at every return, so an orbit of four times the first
    period has four curves. Returns are counted from phase 0, or without a phase from the first segment's start. Each
    iteration of a map is a return. With the parameter on the horizontal axis, a dotted line marks the limit of the
    doublings.

    Parameters
    ----------
    cascade : Cascade or MapCascade
        The cascade.
    x, y : str, optional
        Quantities that `Branch.column` or `MapBranch.column` knows; by default the parameter, and the first state that
        varies.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    special, legend : bool, optional
        Whether doublings and their limit are drawn, and whether a legend names line kinds and doublings.

    Raises
    ------
    InputError
        A quantity of another name.
    """
    style.check_options(ax, x, y, special=special, legend=legend)
    branches: Sequence[Any] = cascade.branches
    x = cascade.parameter if x is None else x
    if y is None:
        y = ordinate_of(branches, cascade.system.states, ax) if branches else cascade.system.states[0]
    tree = {x, y} & set(cascade.system.states)
    levels = [_sheets(branch, 2 ** (k + 1)) if tree else [branch] for k, branch in enumerate(branches)]
    pieces = [
        piece
        for first, sheets in zip(branches, levels, strict=True)
        for j, branch in enumerate(sheets)
        for piece in pieces_of(branch, x, y, _wound(first) * j / len(sheets))
    ]
    places = _doublings(cascade, levels, x, y) if special else []
    ax = style.axes(ax)
    draw_pieces(ax, pieces)
    if places:
        marker = style.SPECIAL["PD"]
        ax.plot(*zip(*places, strict=True), label=f"PD, {marker.meaning}", zorder=6, **marker.options())
    if special and x == cascade.parameter and math.isfinite(cascade.limit):
        ax.axvline(cascade.limit, color="0.5", linestyle=":", linewidth=1.0, zorder=1, label="limit")
    ax.set_xlabel(style.label_of(x))
    ax.set_ylabel(style.label_of(y))
    if legend and (pieces or places):
        ax.legend()
    return ax


def _doublings(cascade: Cascade | MapCascade, levels: list[Any], x: str, y: str) -> list[tuple[float, float]]:
    """Return the coordinates of the doublings; the first is the beginning of the first branch."""
    if not levels:
        return []
    first = cascade.branches[0]
    start: SpecialPoint[Any] = replace(cascade.start, arclength=float(first.arclength[0]))
    starts = [replace(start, solution=solution) for solution in _turned(start.solution)]
    ends = [(branch, branch.special_points.of_type("PD")[:1]) for sheets in levels for branch in sheets]
    owners = [*((first, point) for point in starts), *((branch, point) for branch, found in ends for point in found)]
    return [(branch.value_at(point, x), branch.value_at(point, y)) for branch, point in owners]


@singledispatch
def _turned(solution: Any) -> list[Any]:
    """Return a solution once for each return at which a first doubling is drawn."""
    return [solution]


@_turned.register(MapOrbit)
def _(solution: MapOrbit) -> list[MapOrbit]:
    return [turned_orbit(solution, k) for k in range(solution.period)]


@singledispatch
def _wound(branch: Any) -> float:
    """Return the angle by which the phase goes on in the period of a branch's orbits."""
    return TURN


@_wound.register(Branch)
def _(branch: Branch) -> float:
    return float(branch.system.turn) * (max(branch.forms[0].turns, 1) if branch.forms else 1)


@singledispatch
def _sheets(branch: Any, count: int) -> Sequence[Any]:
    """Return a branch `count` times, its states those at each return; once where returns are unknown."""
    return [branch]


@_sheets.register(MapBranch)
def _(branch: MapBranch, count: int) -> Sequence[MapBranch]:
    return at_each_point(branch)


@_sheets.register(Branch)
def _(branch: Branch, count: int) -> Sequence[Branch]:
    system, names = branch.system, (branch.parameter,)
    wide = len(system.all_states) + 1
    points = list(branch.special_points)
    orbits: list[tuple[Mapping[str, float], NDArray[np.float64], NDArray[np.float64], int]] = [
        ({**branch.parameters, branch.parameter: value}, x0, u.reshape(-1, wide), branch.forms[form].turns)
        for value, x0, u, form in zip(branch.values.tolist(), branch.x0, branch.unknowns, branch.form, strict=True)
    ]
    orbits += [(o.parameters, o.x0, o.states, o.form.turns) for o in (point.orbit for point in points)]
    found = [table for orbit in orbits if (table := _returns(system, *orbit, count)) is not None]
    if len(found) < len(orbits):
        return [branch]
    table, at = np.array(found[: len(branch)]), found[len(branch) :]
    sheets = []
    for j in range(count):
        moved = [
            replace(point, solution=replace(point.orbit, x0=mark[j])) for point, mark in zip(points, at, strict=True)
        ]
        sheets.append(replace(branch, x0=table[:, j], special_points=SpecialPoints(moved, names)))
    return sheets


def _returns(
    system: HybridSystem,
    parameters: Mapping[str, float],
    x0: NDArray[np.float64],
    starts: NDArray[np.float64],
    turns: int,
    count: int,
) -> NDArray[np.float64] | None:
    """Return an orbit's states at its returns, shape (return, state); None where its segments do not give them.

    Parameters
    ----------
    system : HybridSystem
        The system.
    parameters : mapping of str to float
        All its parameters.
    x0 : ndarray, shape (state,)
        State at phase 0.
    starts : ndarray, shape (segment, all states or more)
        States at the segments' starts.
    turns : int
        Periods of the phase in the orbit's period.
    count : int
        Number of returns in the period.
    """
    n = len(system.states)
    if system.phase is None:
        return starts[:: len(starts) // count, :n] if len(starts) % count == 0 else None
    motion = simulate(system, parameters, x0, periods=turns)
    return np.array([motion(motion.t_end * j / count)[:n] for j in range(count)])
