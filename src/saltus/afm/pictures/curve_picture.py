"""Picture of a curve of an instrument: readings over distance or frequency, one above the other."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.curves.curve import Curve
from saltus.afm.models.readings import readings_of
from saltus.plotting import plot, style
from saltus.plotting.branch import draw_pieces, draw_special, pieces_of

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

__all__ = ["plot_curve"]

# The readings of each kind of picture, from the upper to the lower panel.
PANELS = {
    "apd": ("amplitude_nm", "lag_deg"),
    "tune": ("amplitude_nm", "lag_deg"),
    "energy": ("E_ts_eV", "virial_eV"),
    "force": ("peak_force_nN", "min_force_nN"),
}
_ALONG = {"Zc_nm": "distance $Z_c$ (nm)", "f_kHz": "frequency (kHz)"}
_TRIANGLES = 9  # triangles along each way of an experiment
_COLOURS = ("tab:blue", "tab:orange")  # of the ways to lower and to higher values


@plot.register(Curve)
def plot_curve(
    curve: Curve,
    kind: str | None = None,
    *,
    ax: Sequence[Axes] | None = None,
    ways: bool = True,
    special: bool = True,
    legend: bool = True,
) -> tuple[Axes, Axes]:
    """Draw a curve and return the two matplotlib Axes.

    Stable orbits are solid, unstable ones dashed. Triangles show the ways that an experiment takes, dotted lines their
    jumps.

    Parameters
    ----------
    kind : {"apd", "tune", "energy", "force"}, optional
        Amplitude over lag, energy to the sample over virial, or the greatest over the least force. By default amplitude
        over lag.
    ax : sequence of two matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure with a common axis below.
    ways, special, legend : bool, optional
        Whether the ways of an experiment and the special points are drawn, and whether a legend names what is drawn.

    Returns
    -------
    tuple of two matplotlib.axes.Axes

    Raises
    ------
    InputError
        There is no such kind, or not two Axes.
    """
    kind = "apd" if kind is None else kind
    first, second = PANELS[checks.chosen("kind", kind, PANELS)]
    if curve.phase_convention != "lag90":
        second = second.replace("lag_deg", "shown_phase_deg")
    style.check_options(None, ways=ways, special=special, legend=legend)
    upper, lower = style.panels_of(ax)
    for panel, name in ((upper, first), (lower, second)):
        text = curve.formula(name)
        draw_pieces(panel, [piece for branch in curve.branches for piece in pieces_of(branch, curve.along, text)])
        if ways:
            _draw_ways(panel, curve, name)
        if special:
            for branch in curve.branches:
                draw_special(panel, branch, curve.along, text)
        reading = readings_of(name, curve.phase_convention)
        panel.set_ylabel(f"{reading.long_name} ({reading.unit})" if reading.unit else reading.long_name)
        panel.ticklabel_format(useOffset=False)
    lower.set_xlabel(_ALONG.get(curve.along, style.label_of(curve.along)))
    if legend:
        style.draw_legend(upper)
    return upper, lower


def _draw_ways(panel: Axes, curve: Curve, name: str) -> None:
    """Draw both ways of an experiment: triangles along them, dotted lines where they jump."""
    low, high = curve.bounds
    for direction, marker, colour in zip(curve.directions, "<>", _COLOURS, strict=True):
        path = curve.path(direction)
        x, y = path[curve.along].values, path[name].values
        if not len(x):
            continue
        behind = np.flatnonzero(path["jump"].values)
        shift = 0.25 if marker == "<" else 0.75  # triangles of the two ways do not cover each other
        places = low + (high - low) * (np.arange(_TRIANGLES) + shift) / _TRIANGLES
        parts = np.split(np.arange(len(x)), behind)
        shown = [
            (place, float(np.interp(place, np.sort(x[part]), y[part][np.argsort(x[part])])))
            for part in parts
            for place in places
            if len(part) and x[part].min() <= place <= x[part].max()
        ]
        if shown:
            panel.plot(*zip(*shown, strict=True), marker, ms=5, mfc="none", color=colour, label=direction, zorder=4)
        for at in behind:
            panel.plot([x[at - 1], x[at]], [y[at - 1], y[at]], ":", color=colour, lw=1.0, zorder=3)
