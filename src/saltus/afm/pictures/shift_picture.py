"""Picture of frequency modulation: frequency shift over excitation, along the distance."""

from __future__ import annotations

from typing import TYPE_CHECKING

from saltus.afm.fm.shift_curve import SHIFT_READINGS, FrequencyShift
from saltus.plotting import plot, style

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

__all__ = ["plot_shift"]


@plot.register(FrequencyShift)
def plot_shift(
    curve: FrequencyShift, y: str = "shift_Hz", second: str = "excitation_nm", *, ax: Sequence[Axes] | None = None
) -> tuple[Axes, Axes]:
    """Draw frequency shift and excitation along the distance and return the two matplotlib Axes.

    Parameters
    ----------
    y, second : str, optional
        The readings in the upper and the lower panel.
    ax : sequence of two matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure with a common axis below.

    Returns
    -------
    tuple of two matplotlib.axes.Axes
        The upper and the lower panel.

    Raises
    ------
    InputError
        There is no such reading, or not two Axes.
    """
    shown = [(name, curve.column(name)) for name in (y, second)]
    upper, lower = style.panels_of(ax)
    for panel, (name, values) in zip((upper, lower), shown, strict=True):
        reading = SHIFT_READINGS[name]
        panel.plot(curve.column("Zc_nm"), values, ".-")
        panel.set_ylabel(f"{reading.long_name} ({reading.unit})")
    lower.set_xlabel("distance $Z_c$ (nm)")
    return upper, lower
