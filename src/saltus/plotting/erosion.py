"""Picture of an erosion profile: integrity measures against a parameter."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.basins.measures.erosion import ErosionProfile
from saltus.plotting import plot, style

if TYPE_CHECKING:
    from collections.abc import Sequence

    from matplotlib.axes import Axes

__all__ = ["plot_erosion"]

_LINES = ("-", "--", ":", "-.")  # line styles of the measures
_MARKERS = ("o", "s", "^", "D", "v", "P", "X", "h")  # markers of the measures


@plot.register(ErosionProfile)
def plot_erosion(
    profile: ErosionProfile, measure: str | None = None, *, ax: Axes | None = None, legend: bool = True
) -> Axes:
    """Draw measures against the parameter and return the matplotlib Axes.

    A single measure is drawn in its own unit, with a band for its error. Of several measures each is divided by its
    largest value for the attractor. Colours distinguish the attractors, markers and line styles the measures. An open
    marker is a bound: the window's edge clipped the value.

    Parameters
    ----------
    profile : ErosionProfile
        The profile.
    measure : str, optional
        The measure to draw; by default all.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    legend : bool, optional
        Whether a legend names the lines.

    Raises
    ------
    InputError
        The profile lacks the measure.
    """
    style.check_options(ax, legend=legend)
    shown = profile.measures if measure is None else (checks.chosen("measure", measure, profile.measures),)
    ax, alone = style.axes(ax), len(shown) == 1
    for i in range(len(profile.attractors)):
        colour = style.colour_of_mode(i)
        for k, column in enumerate(shown):
            j = profile.measures.index(column)
            known = profile.found[:, i, j]
            if not np.isfinite(known).any():
                continue
            most = float(np.nanmax(np.abs(known)))
            size = 1.0 if alone or most == 0.0 else most
            ax.plot(profile.values, known / size, _LINES[k % len(_LINES)], color=colour, linewidth=1.2)
            for clipped in (False, True):
                at = profile.clipped[:, i, j] == clipped
                ax.plot(
                    profile.values[at], known[at] / size, linestyle="none", marker=_MARKERS[k % len(_MARKERS)],
                    markersize=3.6, color=colour, markerfacecolor="white" if clipped else colour,
                )  # fmt: skip
            if alone:
                error = np.nan_to_num(profile.errors[:, i, j])
                ax.fill_between(profile.values, known - error, known + error, color=colour, alpha=0.15, linewidth=0.0)
    ax.set_xlabel(style.label_of(profile.parameter))
    ax.set_ylabel(style.plain(shown[0]) if alone else "share of the largest value")
    if float(np.nanmin(profile.found, initial=0.0)) >= 0.0:
        ax.set_ylim(bottom=0.0)
    if legend and profile.attractors:
        _legend(ax, profile.attractors, () if alone else shown)
    return ax


def _legend(ax: Axes, attractors: Sequence[str], measures: Sequence[str]) -> None:
    """Draw the legend: colours of the attractors, then line styles of the measures."""
    for i, name in enumerate(attractors):
        ax.plot([], [], "-", color=style.colour_of_mode(i), linewidth=1.6, label=style.plain(name))
    for k, measure in enumerate(measures):
        kind = _LINES[k % len(_LINES)]
        ax.plot(
            [], [], kind, marker=_MARKERS[k % len(_MARKERS)], markersize=3.6, color="0.35", label=style.plain(measure)
        )
    ax.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3)
