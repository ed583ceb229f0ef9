"""Picture of a trajectory: quantities against time or each other, in the colours of the modes."""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING

import numpy as np

from saltus.flow.trajectory import Trajectory
from saltus.plotting import plot, style
from saltus.plotting.orbit import circles_of, draw_curves, draw_jump
from saltus.system import angles
from saltus.system.periodicity import evaluate_along

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

__all__ = ["flights_of", "plot_trajectory"]

_VERTICES_PER_STEP = 6  # vertices of the curve in each step of the motion


@plot.register(Trajectory)
def plot_trajectory(
    trajectory: Trajectory, x: str = "t", y: str | None = None, *, ax: Axes | None = None, legend: bool = True
) -> Axes:
    """Draw a trajectory and return the matplotlib Axes.

    The curve has the colour of the mode, and is thick where the motion slides. Dotted lines join the two sides of a
    reset. Dots mark events that graze.

    Parameters
    ----------
    trajectory : Trajectory
        The trajectory.
    x, y : str, optional
        ``t``, a state, the phase, an output, or any expression in these and the parameters. By default the first state
        against time.
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
    system = trajectory.system
    y = system.states[0] if y is None else y
    curves, modes, grazing = flights_of(trajectory, (x, y))
    ax = style.axes(ax)
    wrapped = draw_curves(ax, system, (x, y), curves, modes)
    circles = circles_of(system, (x, y))
    grazing = angles.wrapped(grazing, circles) if len(grazing) else grazing
    for before, after in pairwise([angles.wrapped(curve[[0, -1]], circles) for curve in curves]):
        draw_jump(ax, before[-1], after[0], wrapped)
    if len(grazing):
        ax.plot(grazing[:, 0], grazing[:, 1], label="grazing", **style.SPECIAL["GR"].options())
    if legend and curves:
        ax.legend()
    return ax


def flights_of(
    trajectory: Trajectory, names: Sequence[str]
) -> tuple[list[NDArray[np.float64]], list[int], NDArray[np.float64]]:
    """Return a motion between its events as curves in some quantities.

    Parameters
    ----------
    trajectory : Trajectory
        The motion.
    names : sequence of str
        Quantities that `plot_trajectory` takes.

    Returns
    -------
    curves : list of ndarray, shape (vertex, name)
    modes : list of int
        The mode of each curve.
    grazing : ndarray, shape (event, name)
        Where events graze.

    Raises
    ------
    InputError
        A text that is no expression, or an unknown name in it.
    """
    stretches = _stretches(trajectory)
    columns = [_column(trajectory, name, stretches) for name in names]
    curves = [np.column_stack(pair) for pair in zip(*columns, strict=True)]
    times = set(trajectory.events["time"][trajectory.events["grazing"]].tolist())
    places = [curve[-1] for (_, t, _), curve in zip(stretches, curves, strict=True) if float(t[-1]) in times]
    return curves, [mode for mode, _, _ in stretches], np.reshape(places, (-1, len(names)))


def _stretches(trajectory: Trajectory) -> list[tuple[int, NDArray[np.float64], NDArray[np.float64]]]:
    """Return (mode, times, states) of each stretch between two events; its last state is that before the event."""
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
    values = evaluate_along(trajectory.system, name, states, modes, trajectory.parameters)
    return np.split(values, np.cumsum(lengths)[:-1])
