"""Picture of a force that was made of data: over the gap, with its errors, and laws beside it."""

from __future__ import annotations

from itertools import cycle
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.afm.laws.law import Law
from saltus.afm.reconstruction.force import ReconstructedForce
from saltus.plotting import plot, style

if TYPE_CHECKING:
    from collections.abc import Mapping

    from matplotlib.axes import Axes

__all__ = ["plot_force"]

_GAPS = 600  # at which a law is drawn


@plot.register(ReconstructedForce)
def plot_force(force: ReconstructedForce, laws: Mapping[str, Law] | None = None, *, ax: Axes | None = None) -> Axes:
    """Draw the force over the gap with a band of two standard errors, and return the matplotlib Axes.

    Parameters
    ----------
    laws : mapping of str to Law, optional
        Laws to draw beside it, by their names in the legend.
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        One of `laws` is none, or `ax` is no Axes.
    """
    beside = checks.mapping("laws", laws, "names to laws")
    for name, law in beside.items():
        checks.instance(f"laws[{name!r}]", law, Law)
    style.check_options(ax)
    axes = style.axes(ax)
    D, F, two = force.D_nm, force.F_nN, 2.0 * force.sigma_nN
    axes.fill_between(D, F - two, F + two, alpha=0.3, label="two standard errors")
    axes.plot(D, F, ".-", markersize=3, label=f"from data, {force.method}")
    gaps = np.linspace(D[0], D[-1], _GAPS)
    for (name, law), line in zip(beside.items(), cycle(("--", ":", "-.")), strict=False):
        axes.plot(gaps, law.force_nN(gaps, R_nm=force.R_nm), line, label=name)
    for one in force.inflections:
        if one.ill_posed:
            axes.axvline(one.D_nm, linestyle=":", color="0.4", label=f"inflection with S = {one.S:.2g}")
    axes.axhline(0.0, linewidth=0.5, color="0.6")
    axes.set_xlabel("gap $D$ (nm)")
    axes.set_ylabel("force (nN)")
    style.draw_legend(axes)
    return axes
