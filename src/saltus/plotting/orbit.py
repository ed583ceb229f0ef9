"""Picture of a periodic orbit: a closed curve in the colours of its modes."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits import PeriodicOrbit
from saltus.orbits.observables.sampling import followed
from saltus.plotting import plot, style
from saltus.system import angles
from saltus.system.angles import TURN
from saltus.system.periodicity import evaluate_along

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from saltus.system import HybridSystem

__all__ = ["circles_of", "draw_curves", "draw_jump", "on_sheets", "plot_orbit", "segments_of", "unwrapped_parts"]

_SLIDING = "sliding"  # word of a legend for modes whose motions slide along a surface
_THICKER = 2.5  # times that their lines are wider than others


@plot.register(PeriodicOrbit)
def plot_orbit(
    orbit: PeriodicOrbit, x: str | None = None, y: str | None = None, *, ax: Axes | None = None, legend: bool = True
) -> Axes:
    """Draw a periodic orbit and return the matplotlib Axes.

    The curve has the colour of the mode, and is thick where the motion slides. Dots mark the ends of segments. Dotted
    lines join the two sides of a reset.

    Parameters
    ----------
    orbit : PeriodicOrbit
        The orbit.
    x, y : str, optional
        ``t``, a state, the phase, an output, or any expression in these and the parameters. By default the first two
        states.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    legend : bool, optional
        Whether a legend names the modes.

    Raises
    ------
    InputError
        A text that is no expression, or an unknown name in it.
    """
    style.check_options(ax, x, y, legend=legend)
    system = orbit.system
    x = system.states[0] if x is None else x
    y = (system.states[1] if len(system.states) > 1 else "t") if y is None else y
    parts, modes = segments_of(orbit, (x, y))
    ax = style.axes(ax)
    wrapped = draw_curves(ax, system, (x, y), parts, modes)
    parts = [angles.wrapped(part[[0, -1]], circles_of(system, (x, y))) for part in parts]
    _draw_ends(ax, orbit, parts, closed=x != "t" and y != "t", wrapped=wrapped)
    if legend:
        ax.legend()
    return ax


def segments_of(orbit: PeriodicOrbit, names: Sequence[str]) -> tuple[list[NDArray[np.float64]], list[int]]:
    """Return the segments of an orbit as curves in some quantities, each of shape (vertex, name), and their modes.

    Parameters
    ----------
    orbit : PeriodicOrbit
        The orbit.
    names : sequence of str
        Quantities that `plot_orbit` takes.

    Raises
    ------
    InputError
        A text that is no expression, or an unknown name in it.
    """
    system = orbit.system
    times, states, modes_at = followed(orbit.problem(), orbit.unknowns)
    if system.phase is not None:
        states[:, -1] %= system.turn
    columns = [
        times if name == "t" else evaluate_along(system, name, states, modes_at, orbit.parameters) for name in names
    ]
    ends = np.flatnonzero(np.diff(times) <= 0.0) + 1
    return np.split(np.column_stack(columns), ends), [int(part[0]) for part in np.split(modes_at, ends)]


def _draw_ends(
    ax: Axes, orbit: PeriodicOrbit, parts: list[NDArray[np.float64]], *, closed: bool, wrapped: tuple[bool, ...]
) -> None:
    if orbit.form.transitions[-1] < 0:
        return
    ends = np.array([part[-1] for part in parts])
    ax.plot(ends[:, 0], ends[:, 1], "o", color="black", markersize=3.5, zorder=4, label="segment ends")
    following = [*parts[1:], parts[0]] if closed else parts[1:]
    for part, after in zip(parts, following, strict=False):
        draw_jump(ax, part[-1], after[0], wrapped)


def draw_curves(
    ax: Axes, system: HybridSystem, names: tuple[str, str], curves: Sequence[NDArray[np.float64]], modes: Sequence[int]
) -> tuple[bool, ...]:
    """Draw curves in the colours of their modes, and name both axes; return whether each coordinate is an angle.

    Each mode has one label for the legend.
    """
    phase = None if system.phase is None else system.phase[0]
    wrapped = tuple(name == phase for name in names)
    circles = circles_of(system, names)
    named: set[int] = set()
    for curve, mode in zip(curves, modes, strict=True):
        for part in on_sheets(curve, circles):
            _draw_curve(ax, system, part, wrapped, mode, named=mode in named)
            named.add(mode)
    ax.set_xlabel(style.label_of(names[0]))
    ax.set_ylabel(style.label_of(names[1]))
    return tuple(name == phase or name in system.angles for name in names)


def circles_of(system: HybridSystem, names: tuple[str, str]) -> NDArray[np.int64]:
    """Return which of the two coordinates are angles among the states."""
    return np.array([i for i, name in enumerate(names) if name in system.angles], dtype=np.int64)


def on_sheets(curve: NDArray[np.float64], circles: NDArray[np.int64]) -> list[NDArray[np.float64]]:
    """Return a curve, shape (vertex, 2), between -pi and pi in some coordinates: cut where it passes there."""
    parts = [curve]
    for column in circles.tolist():
        parts = [piece for part in parts for piece in _cut_at_pi(part, column)]
    return parts


def _cut_at_pi(curve: NDArray[np.float64], column: int) -> list[NDArray[np.float64]]:
    sheets = np.floor((curve[:, column] + math.pi) / TURN)
    parts: list[NDArray[np.float64]] = []
    first, rows = 0, np.empty((0, 2))
    for i in [*np.flatnonzero(np.diff(sheets)).tolist(), len(curve) - 1]:
        rows, edge = np.vstack([rows, curve[first : i + 1]]), np.empty((0, 2))
        if i + 1 < len(curve):
            left, right = curve[i], curve[i + 1]
            at = TURN * max(sheets[i], sheets[i + 1]) - math.pi
            edge = (left + (at - left[column]) / (right[column] - left[column]) * (right - left))[None]
            edge[0, column] = at
        part = np.vstack([rows, edge])
        part[:, column] -= TURN * sheets[i]
        parts.append(part)
        first, rows = i + 1, edge
    return parts


def _draw_curve(
    ax: Axes, system: HybridSystem, curve: NDArray[np.float64], wrapped: Iterable[bool], mode: int, *, named: bool
) -> None:
    """Draw a curve, shape (vertex, 2), in the colour of a mode, cut where the phase wraps; thick where sliding."""
    from matplotlib import rcParams

    name = system.mode_names[mode]
    slides = system.modes[name].surface is not None
    label = "_" if named else name if name == _SLIDING or not slides else f"{name} ({_SLIDING})"
    width = rcParams["lines.linewidth"] * (_THICKER if slides else 1.0)
    for part in unwrapped_parts(curve, wrapped, system.turn):
        ax.plot(part[:, 0], part[:, 1], color=style.colour_of_mode(mode), linewidth=width, label=style.plain(label))
        label = "_"


def draw_jump(ax: Axes, before: NDArray[np.float64], after: NDArray[np.float64], wrapped: Iterable[bool]) -> None:
    """Join the two sides of a reset by a dotted line, unless they are equal but for a wrapped angle."""
    apart = np.abs(after - before) > 1e-9 * (1.0 + np.abs(before))
    if any(moved and not angle for moved, angle in zip(apart, wrapped, strict=True)):
        ax.plot([before[0], after[0]], [before[1], after[1]], ":", color="0.5", linewidth=0.9, label="_", zorder=1)


def unwrapped_parts(
    curve: NDArray[np.float64], wrapped: Iterable[bool], turn: float = TURN
) -> list[NDArray[np.float64]]:
    """Return a curve, shape (vertex, quantity), cut where an angle passes `turn`; parts are extended to it and to 0."""
    breaks: set[int] = set()
    for column, angle in enumerate(wrapped):
        if angle:
            breaks |= set((np.flatnonzero(np.diff(curve[:, column]) < -0.5 * turn) + 1).tolist())
    parts = [part.copy() for part in np.split(curve, sorted(breaks))]
    for column, angle in enumerate(wrapped):
        for i in range(len(parts) - 1 if angle else 0):
            left, right = parts[i][-1], parts[i + 1][0]
            ahead = right.copy()
            ahead[column] += turn
            share = (turn - left[column]) / max(ahead[column] - left[column], 1e-300)
            middle = left + min(max(share, 0.0), 1.0) * (ahead - left)
            middle[column] = turn
            parts[i] = np.vstack([parts[i], middle])
            middle = middle.copy()
            middle[column] = 0.0
            parts[i + 1] = np.vstack([middle, parts[i + 1]])
    return parts
