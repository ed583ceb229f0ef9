"""Picture of a curve of an instrument: readings over distance or frequency, one above the other."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.curves.curve import Curve
from saltus.afm.models.readings import readings_of
from saltus.errors import InputError, nearest
from saltus.plotting import plot, style
from saltus.plotting.branch import draw_pieces, draw_special, pieces_of

if TYPE_CHECKING:
    from collections.abc import Mapping

    import xarray as xr
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from saltus.afm.curves.routes import Way

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


# Special points in an instrument's words, for the legend.
_WORDS = {
    "SN": "jump (SN)", "GR": "onset of contact (GR)", "PD": "period doubling (PD)", "TR": "onset of modulation (TR)",
    "BP": "branch point (BP)",
}  # fmt: skip


@plot.register(Curve)
def plot_curve(
    curve: Curve,
    kind: str | Sequence[str] | None = None,
    *,
    ax: Sequence[Axes] | Axes | None = None,
    ways: bool = True,
    special: bool = True,
    legend: bool = True,
) -> tuple[Axes, ...]:
    """Draw a curve and return the matplotlib Axes, from the upper to the lower one.

    Stable orbits are solid, unstable ones dashed. Triangles show the ways that an experiment takes, dotted lines their
    jumps. A grey band is a window of motions that are not followed. A cross is where a way ends within the range.

    Parameters
    ----------
    kind : {"apd", "tune", "energy", "force"}, str or sequence of str, optional
        Amplitude over lag, energy over virial, or the greatest over the least force. Or readings of the
        curve, as ``"contact_fraction"`` or ``("amplitude_nm_2", "lag_deg_2")``, or formulas that `Curve.column` takes:
        one panel each. By default amplitude and lag of each drive.
    ax : sequence of matplotlib.axes.Axes, optional
        Where to draw, one for each panel; by default in a new figure with a common axis below.
    ways, special, legend : bool, optional
        Whether the ways of an experiment and the special points are drawn, and whether a legend names what is drawn.

    Returns
    -------
    tuple of matplotlib.axes.Axes

    Raises
    ------
    InputError
        There is no such kind or reading, or not as many Axes as panels.
    """
    names = [_shown(curve, name) for name in _panels(curve, kind, ax)]
    style.check_options(None, ways=ways, special=special, legend=legend)
    panels = style.panels_of(ax, len(names))
    paths = {direction: curve.path(direction) for direction in curve.directions} if ways else {}
    for panel, name in zip(panels, names, strict=True):
        text = curve.formula(name)
        draw_pieces(panel, [piece for branch in curve.branches for piece in pieces_of(branch, curve.along, text)])
        if ways:
            _draw_ways(panel, curve, name, paths)
        if special:
            for branch in curve.branches:
                draw_special(panel, branch, curve.along, text, words=_WORDS)
        panel.set_ylabel(_label(curve, name))
        panel.ticklabel_format(useOffset=False)
    panels[-1].set_xlabel(_ALONG.get(curve.along, style.label_of(curve.along)))
    if legend:
        style.draw_legend(panels[0])
    return panels


def _panels(curve: Curve, kind: str | Sequence[str] | None, ax: object) -> tuple[str, ...]:
    """Return the readings that are drawn, from the upper to the lower panel."""
    if kind is None:
        more = [name for name in curve.readings if name.startswith("amplitude_nm_")] if ax is None else []
        return (*PANELS["apd"], *(one for name in more for one in (name, name.replace("amplitude_nm", "lag_deg"))))
    if not isinstance(kind, str):
        names = tuple(checks.text("kind", name) for name in checks.listed("kind", kind, "names of readings"))
        for name in names:
            curve.column(name)  # raises where there is none
        if not names:
            raise InputError("kind", kind, "at least one reading")
        return names
    if kind in curve.readings or "(" in kind:
        return (kind,)
    hint = f"or readings, as {curve.readings[0]!r}"
    return PANELS[checks.chosen("kind", kind, PANELS, hint=nearest(kind, curve.readings) or hint)]


def _shown(curve: Curve, name: str) -> str:
    """Return a reading as the curve's convention of phases has it."""
    return name if curve.phase_convention == "lag90" else name.replace("lag_deg", "shown_phase_deg")


def _label(curve: Curve, name: str) -> str:
    """Return the label of an axis: the reading in words, of which drive, and its unit."""
    if name not in curve.readings:
        return name
    reading = readings_of(name, curve.phase_convention)
    number = re.search(r"(?<=_)[2-9]\d*$", name)
    words = reading.long_name
    if number:
        drive = f"drive {number[0]}"
        words = words.replace("the drive", drive) if "the drive" in words else f"{words}, {drive}"
    return f"{words} ({reading.unit})" if reading.unit else words


def _draw_ways(panel: Axes, curve: Curve, name: str, paths: Mapping[str, xr.Dataset]) -> None:
    """Draw both ways of an experiment: triangles along them, dotted lines where they jump, crosses where they end."""
    low, high = curve.bounds
    for way, (direction, path), marker, colour in zip(curve.ways, paths.items(), "<>", _COLOURS, strict=True):
        for window in way.windows:
            panel.axvspan(window.begin, window.end, color="0.9", label="window of other motions", zorder=0)
        x, y, behind = _on_way(curve, way, path, name)
        if not len(x):
            continue
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
        if "end of the range" not in way.stopped:
            panel.plot(x[-1:], y[-1:], "x", ms=9, mew=2, color=colour, label=f"{direction} ends here", zorder=7)


def _on_way(
    curve: Curve, way: Way, path: xr.Dataset, name: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]:
    """Return places and values of a reading or formula along a way, and the points behind jumps."""
    if name in curve.readings:
        return path[curve.along].values, path[name].values, np.flatnonzero(path["jump"].values)
    starts = np.cumsum([0, *(len(branch) for branch in curve.branches)])
    rows = [int(starts[sheet]) + point for sheet, point in way.points]
    behind = np.array([at for at in way.first_behind if 0 < at < len(rows)], dtype=np.int64)
    return curve.values[rows], curve.column(name)[rows], behind
