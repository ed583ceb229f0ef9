"""Pictures of equilibria: eigenvalues in the complex plane."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.equilibria import Equilibrium
from saltus.equilibria.spectrum import NEUTRAL
from saltus.plotting import plot, style

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_equilibrium"]

_MARGIN = 0.15  # room round the eigenvalues, over their largest modulus

# Markers of eigenvalues by the sign of their real parts.
_MARKERS = {
    "decays": style.Marker("Re < 0: decays", "o", style.CURVE, size=6.0),
    "critical": style.Marker("Re = 0: critical", "D", "#b35900", filled=False, size=6.0),
    "grows": style.Marker("Re > 0: grows", "o", "#b8101f", filled=False, size=6.0),
}


@plot.register(Equilibrium)
def plot_equilibrium(equilibrium: Equilibrium, *, ax: Axes | None = None, legend: bool = True) -> Axes:
    """Draw the eigenvalues of an equilibrium in the complex plane and return the matplotlib Axes.

    The title has the kind of the equilibrium. Disturbances decay left of the vertical line, and grow right of it.

    Parameters
    ----------
    equilibrium : Equilibrium
        The equilibrium.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    legend : bool, optional
        Whether a legend says which eigenvalues decay, grow or are critical.
    """
    style.check_options(ax, legend=legend)
    ax = style.axes(ax)
    values = equilibrium.eigenvalues
    size = float(np.abs(values).max(initial=0.0)) or 1.0
    ax.axvline(0.0, color="0.6", linewidth=0.9, zorder=1)
    ax.axhline(0.0, color="0.85", linewidth=0.7, zorder=0)
    zero = np.abs(values.real) <= NEUTRAL * size
    groups = {"decays": ~zero & (values.real < 0.0), "critical": zero, "grows": ~zero & (values.real > 0.0)}
    for name, own in groups.items():
        if np.any(own):
            marker = _MARKERS[name]
            ax.plot(values.real[own], values.imag[own], label=marker.meaning, zorder=3, **marker.options())
    for part, limits in ((values.real, ax.set_xlim), (values.imag, ax.set_ylim)):
        low, high = min(float(part.min(initial=0.0)), 0.0), max(float(part.max(initial=0.0)), 0.0)
        limits(low - _MARGIN * size, high + _MARGIN * size)
    ax.set(xlabel="real part", ylabel="imaginary part", title=equilibrium.kind)
    if legend and values.size:
        ax.legend()
    return ax
