"""A periodic orbit as a table: states, outputs and mode against time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.errors import InputError

if TYPE_CHECKING:
    import xarray as xr
    from numpy.typing import NDArray

    from saltus.orbits.orbit import PeriodicOrbit

__all__ = ["sample_orbit"]

_FEWEST = 16
"""Steps in a segment at the least, so that a short one is still a curve."""


def sample_orbit(orbit: PeriodicOrbit, points: int = 400) -> xr.Dataset:
    """Return an orbit over one period, from its segments' dense output.

    Parameters
    ----------
    orbit : PeriodicOrbit
        The orbit.
    points : int, optional
        About how many times, shared out by the segments' durations, 17 or more a segment.

    Returns
    -------
    xarray.Dataset
        Against the dimension ``t``, which starts at 0 with the first segment: every state (the phase modulo 2 pi),
        every output, and ``mode``, the index of the mode. Both ends of every segment are among the times, so that
        the time of an event occurs twice: before the reset, then after it. Times are closer near a segment's ends.

    Raises
    ------
    InputError
        `points` is no whole number, or less than 2.
    """
    import xarray as xr

    if not isinstance(points, int | np.integer) or isinstance(points, bool) or points < 2:
        raise InputError("points", points, "a whole number, 2 or more")
    system = orbit.system
    times, states, modes = _follow(orbit, int(points))
    outputs = _outputs(orbit, states, modes)
    if system.phase is not None:
        states[:, -1] %= 2.0 * math.pi
    columns = dict(zip(system.all_states, states.T, strict=True)) | dict(
        zip(system.output_names, outputs.T, strict=True)
    )
    dataset = xr.Dataset({name: ("t", column) for name, column in columns.items()}, coords={"t": times})
    dataset["mode"] = ("t", modes)
    dataset["mode"].attrs["names"] = ", ".join(system.mode_names)
    return dataset


def _follow(orbit: PeriodicOrbit, points: int) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Return times, full states (time, state) and modes' indices, one segment after the other."""
    problem, u = orbit.problem(), orbit.unknowns
    problem.survey(u)
    begun = 0.0
    times, states, modes = [], [], []
    for index, (mode, duration) in enumerate(zip(orbit.form.modes, orbit.durations, strict=True)):
        count = max(_FEWEST, round(points * abs(duration) / max(float(np.abs(orbit.durations).sum()), 1e-300)))
        places = np.linspace(0.0, 1.0, count + 1)
        times.append(begun + duration * places**2 * (3.0 - 2.0 * places))
        states.append([problem.state_on(index, float(place)) for place in places])
        modes.append(np.full(count + 1, mode))
        begun += duration
        times[-1][-1] = begun
    return np.concatenate(times), np.concatenate(states), np.concatenate(modes)


def _outputs(orbit: PeriodicOrbit, states: NDArray[np.float64], modes: NDArray[np.int64]) -> NDArray[np.float64]:
    """Return the named outputs, shape (time, output)."""
    compiled = orbit.system.compiled
    extended = compiled.extended(orbit.system.parameter_vector(orbit.parameters))
    values = np.empty((len(states), len(orbit.system.output_names)))
    if values.shape[1]:
        for mode, x, row in zip(modes, states, values, strict=True):
            compiled.call("outputs", int(mode), 0, np.ascontiguousarray(x), extended, row)
    return values
