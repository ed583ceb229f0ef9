"""Picture of Lyapunov exponents: their running estimates against time."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.plotting import plot, style
from saltus.sweeps.lyapunov import LyapunovSpectrum

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_lyapunov"]

_SETTLED = 10  # the first tenth of the rows, where estimates may be far off, does not set the vertical axis


@plot.register(LyapunovSpectrum)
def plot_lyapunov(spectrum: LyapunovSpectrum, *, ax: Axes | None = None, legend: bool = True) -> Axes:
    """Draw the running estimates of the exponents against time, and return the matplotlib Axes.

    A band is the final estimate with its error, a thin line marks zero. Exponents of ``-inf`` are in the legend only.

    Parameters
    ----------
    spectrum : LyapunovSpectrum
        The exponents.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    legend : bool, optional
        Whether a legend gives the values.
    """
    style.check_options(ax, legend=legend)
    ax = style.axes(ax)
    forced = spectrum.system.phase is not None
    t = spectrum.times / spectrum.period if forced else spectrum.times
    running, shown = spectrum.running, t.size // _SETTLED
    edges: list[float] = []
    for i, (value, error) in enumerate(zip(spectrum.exponents, spectrum.errors, strict=True)):
        if not np.isfinite(value):
            ax.plot([], [], linestyle="none", label=rf"$\lambda_{{{i + 1}}} = -\infty$")
            continue
        colour = style.colour_of_mode(i)
        ax.axhspan(value - error, value + error, color=colour, alpha=0.15, linewidth=0.0)
        ax.plot(t, running[:, i], color=colour, linewidth=1.1, label=_label(i, value, error))
        edges += [value - error, value + error, float(running[shown:, i].min()), float(running[shown:, i].max())]
    ax.axhline(0.0, color="0.4", linewidth=0.6, zorder=0)
    low, high = min(*edges, 0.0), max(*edges, 0.0)
    room = 0.06 * (high - low) or 1.0
    ax.set_xlim(0.0, float(t[-1]))
    ax.set_ylim(low - room, high + room)
    ax.set_xlabel("periods" if forced else style.label_of(spectrum.system.clock))
    ax.set_ylabel(f"Lyapunov exponents per {spectrum.system.time_unit}")
    if legend:
        ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2)
    return ax


def _label(i: int, value: float, error: float) -> str:
    """Return an exponent to the second digit of its error; without the error where it is exact to 6 digits."""
    symbol = rf"\lambda_{{{i + 1}}}"
    if error <= 1e-6 * abs(value):
        return f"${symbol} = {value:.6g}$"
    places = max(1 - math.floor(math.log10(error)), 0)
    return rf"${symbol} = {value:.{places}f} \pm {error:.{places}f}$"
