"""Picture of the folds of distance curves over free amplitude and distance."""

from __future__ import annotations

from typing import TYPE_CHECKING

from saltus.afm.curves.bistable_region import PLANE, Bistability
from saltus.plotting import plot, style
from saltus.plotting.locus import plot_locus

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["plot_bistability"]


@plot.register(Bistability)
def plot_bistability(region: Bistability, *, ax: Axes | None = None, special: bool = True, legend: bool = True) -> Axes:
    """Draw where distance curves fold, over the free amplitude, and return the matplotlib Axes.

    Parameters
    ----------
    ax : matplotlib.axes.Axes, optional
        Where to draw; by default in a new figure.
    special, legend : bool, optional
        Whether cusp and critical amplitude are marked, and whether a legend names what is drawn.

    Returns
    -------
    matplotlib.axes.Axes

    Raises
    ------
    InputError
        An option that cannot be used.
    """
    style.check_options(ax, special=special, legend=legend)
    ax = style.axes(ax)
    for locus in region.loci:
        plot_locus(locus, *PLANE, ax=ax, special=False, legend=False)
    if special:
        if region.cusps:
            ax.plot(*zip(*region.cusps, strict=True), ls="none", marker="^", color="black", label="cusp", zorder=6)
        if region.critical is not None:
            A0, Zc = (region.critical.value(name) for name in PLANE)
            label = f"critical amplitude, {A0:.4g} nm"
            ax.plot(A0, Zc, ls="none", marker="o", color="black", label=label, zorder=6)
    ax.set(xlabel="free amplitude $A_0$ (nm)", ylabel="distance $Z_c$ (nm)")
    if legend:
        style.draw_legend(ax)
    return ax
