"""Amplitude spectrum of a quantity along a trajectory."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np

from saltus import checks

if TYPE_CHECKING:
    from collections.abc import Callable

    import xarray as xr
    from numpy.typing import NDArray

    from saltus.flow.stretch import Motion

__all__ = ["Window", "spectrum"]

Window = Literal["none", "hann"]  # what samples are multiplied by before the transform
_EACH_PERIOD = 256  # samples in a period of the phase
_EACH_STEP = 8  # samples in a step of a motion without a phase


def spectrum(
    motion: Motion,
    expression: str,
    values_at: Callable[[NDArray[np.float64]], NDArray[np.float64]],
    *,
    samples: int | None = None,
    window: Window | None = None,
) -> xr.DataArray:
    """Return the one-sided amplitude spectrum of an expression along a motion; `Trajectory.spectrum` tells more.

    Samples at equidistant times go through a fast Fourier transform. Frequencies above half the rate of the samples are
    folded back. Amplitudes of a quantity that jumps at impacts, as a velocity does, are true only at orders far below
    ``samples / (2 periods)``. ``Trajectory.observe`` takes amplitudes of any order from integrals.

    Parameters
    ----------
    expression : str
        What is transformed, for the labels.
    values_at : callable
        Its values at times of the stretch, shape (time,).
    samples : int, optional
        Count of equidistant times.
    window : {"none", "hann"}, optional
        What the samples are multiplied by.

    References
    ----------
    F. J. Harris, On the use of windows for harmonic analysis with the discrete Fourier transform, Proc. IEEE 66 (1978)
    51-83: Hann's window, and amplitudes divided by its mean.

    Examples
    --------
    >>> from saltus.flow.simulation import simulate
    >>> from saltus.system.hybrid import HybridSystem, Mode
    >>> driven = HybridSystem(
    ...     ("x",), {"w": 2.0}, {"free": Mode({"x": "-x + sin(theta) + 0.5*cos(2*theta)"})}, phase=("theta", "w")
    ... )
    >>> lines = simulate(driven, {}, [0.0], periods=4).spectrum("sin(theta) + 0.5*cos(2*theta)")
    >>> print(lines.sel(order=[0.0, 1.0, 1.5, 2.0]).round(9).values)
    [0.  1.  0.  0.5]
    """
    from saltus.extras import xr

    phase = motion.system.phase
    begin, end = motion.begin, motion.end
    periods = (end - begin) * motion.angle[1] / (2.0 * math.pi)
    fits = phase is not None and motion.whole() is motion
    if window is None:
        window = "none" if fits else "hann"
    checks.chosen("window", window, get_args(Window))
    if samples is None:
        samples = _EACH_STEP * len(motion.modes) if phase is None else _EACH_PERIOD * max(round(periods), 1)
    samples = checks.size("samples", samples, 2)
    places = np.arange(samples) / samples
    times = np.minimum(begin + (end - begin) * places, end)
    weights = np.ones(samples) if window == "none" else 0.5 - 0.5 * np.cos(2.0 * math.pi * places)
    amplitudes = 2.0 * np.abs(np.fft.rfft(values_at(times) * weights)) / weights.sum()
    amplitudes[0] /= 2.0
    if samples % 2 == 0:
        amplitudes[-1] /= 2.0
    lines = np.arange(amplitudes.size)
    frequency = (2.0 * math.pi * lines / (end - begin), {"long_name": "angular frequency"})
    coords: dict[str, Any] = {"frequency": ("frequency", *frequency)}
    if phase is not None:
        orders = lines / (round(periods) if fits else periods)
        count = motion.system.drive_repeats
        angle = phase[0] if count == 1 else f"{count}*{phase[0]}"
        coords = {
            "order": ("order", orders, {"long_name": f"frequency / rate of {angle}"}),
            "frequency": ("order", *frequency),
        }
    attrs = {
        "long_name": f"amplitude of {expression}",
        "t_start": begin,
        "t_end": end,
        "window": window,
        "samples": samples,
    }
    return xr.DataArray(amplitudes, coords, [next(iter(coords))], "amplitude", attrs)
