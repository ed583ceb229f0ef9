"""Picture of a trajectory: quantities against time or each other, each mode in its colour."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.trajectory import Trajectory
from saltus.plotting import plot, style
from saltus.plotting.orbit import draw_curve, draw_jump
from saltus.system.evaluate import evaluate

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

__all__ = ["plot_trajectory"]

_VERTICES_PER_STEP = 6


@plot.register(Trajectory)
def plot_trajectory(
    trajectory: Trajectory, x: str = "t", y: str | None = None, *, ax: Axes | None = None, legend: bool = True
) -> Axes:
    """Draw a trajectory and return the matplotlib Axes.

    The curve has the colour of the mode; dotted lines join the two sides of a reset, and dots mark events that graze.

    Parameters
    ----------
    trajectory : Trajectory
        What is drawn.
    x, y : str, optional
        ``t``, a state, the phase, an output, or any expression in these and the parameters; by default the first state
        against time.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    legend : bool, optional
        Whether the modes are named.

    Raises
    ------
    InputError
        No expression, or a name in it that is not there.
    """
    style.check_options(ax, x, y, legend=legend)
    system = trajectory.system
    y = system.states[0] if y is None else y
    stretches = _stretches(trajectory)
    columns = [_column(trajectory, name, stretches) for name in (x, y)]
    curves = [np.column_stack(pair) for pair in zip(*columns, strict=True)]
    ax = style.axes(ax)
    phase = None if system.phase is None else system.phase[0]
    wrapped = tuple(name == phase for name in (x, y))
    named: set[int] = set()
    for i, (curve, (mode, _, _)) in enumerate(zip(curves, stretches, strict=True)):
        draw_curve(ax, curve, wrapped, mode, "_" if mode in named else system.mode_names[mode])
        named.add(mode)
        if i:
            draw_jump(ax, curves[i - 1][-1], curve[0], wrapped)
    _draw_grazings(ax, trajectory, stretches, curves)
    ax.set_xlabel(style.label_of(x))
    ax.set_ylabel(style.label_of(y))
    if legend and named:
        ax.legend()
    return ax


def _stretches(trajectory: Trajectory) -> list[tuple[int, NDArray[np.float64], NDArray[np.float64]]]:
    """Return (mode, times, states) between one event and the next, the state before an event at each end."""
    events = trajectory.events
    times, before = events["time"], events["before"]
    found = []
    edges = [0.0, *times.tolist(), trajectory.t_end]
    for i, (begin, end) in enumerate(pairwise(edges)):
        if end <= begin:
            continue
        first = int(np.searchsorted(trajectory.step_times, begin, side="left"))
        last = int(np.searchsorted(trajectory.step_times, end, side="left"))
        steps = slice(first, last)
        starts, lengths = trajectory.step_times[steps], trajectory.step_lengths[steps]
        t = (starts[:, None] + lengths[:, None] * np.arange(_VERTICES_PER_STEP) / _VERTICES_PER_STEP).ravel()
        t = np.append(t[t < end], end)
        states = trajectory(t)
        if i < len(times):
            states[-1] = before[i]
        found.append((int(trajectory.step_modes[first]), t, states))
    return found


def _column(
    trajectory: Trajectory, name: str, stretches: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]]
) -> list[NDArray[np.float64]]:
    if name == "t":
        return [t for _, t, _ in stretches]
    lengths = [len(t) for _, t, _ in stretches]
    states = np.concatenate([states for _, _, states in stretches])
    modes = np.repeat([mode for mode, _, _ in stretches], lengths)
    values = evaluate(trajectory.system, name, states, modes, trajectory.parameters)
    return np.split(values, np.cumsum(lengths)[:-1])


def _draw_grazings(
    ax: Axes,
    trajectory: Trajectory,
    stretches: list[tuple[int, NDArray[np.float64], NDArray[np.float64]]],
    curves: list[NDArray[np.float64]],
) -> None:
    grazing = set(trajectory.events["time"][trajectory.events["grazing"]].tolist())
    places = [curve[-1] for (_, t, _), curve in zip(stretches, curves, strict=True) if float(t[-1]) in grazing]
    if places:
        table, marker = np.array(places), style.SPECIAL["GR"]
        ax.plot(table[:, 0], table[:, 1], label="grazing", **marker.options())
