"""Fig. 3: minimum gap between tip and sample against the drive's frequency, one mode, with its special points.

References
----------
ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Fig. 3 and section 4. The figure departs from the
paper's: period doublings are drawn too. Panels (c) and (d) show the points next to the grazings, within 2e-4 of each
other.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from saltus.afm.paper.figures.files import write_figure
from saltus.afm.paper.figures.responses import gap_at_contact, repulsive_orbit, response
from saltus.progress import Report

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from saltus.continuation import Branch

__all__ = ["compute", "draw", "run", "summary"]

BOUNDS = (0.8, 1.4)  # interval of Omega, in omega_1

_LARGEST_STEP = 0.01  # step in arclength with which a picture 1e-3 wide in Omega is smooth

_Window = tuple[tuple[float, float], tuple[float, float]]  # interval of Omega, interval of min z

_WHOLE: _Window = (BOUNDS, (-0.13, 0.8))  # panel (a)
_RESPONSE: _Window = ((0.88, 1.265), (-0.112, 0.042))  # panel (b)
_LEFT: _Window = ((0.91165, 0.91665), (-0.0012, 0.0132))  # panel (c)
_RIGHT: _Window = ((1.0803, 1.0831), (-0.0005, 0.0053))  # panel (d)
_NEAREST: _Window = ((0.912735, 0.912905), (0.003215, 0.003385))  # inset in panel (c)


def run(out: Path, progress: bool | Report = False) -> dict[str, Any]:
    """Compute, draw and write the figure, and return the files and results.

    Parameters
    ----------
    out : Path
        An existing folder, for ``fig3.nc`` (the branch), ``fig3.json`` (its special points), ``fig3.png`` and
        ``fig3.pdf``.
    progress : bool or callable
        True for bars on stderr, or a function called with a `saltus.Progress`.

    Returns
    -------
    dict
        As `write_figure` returns it, and ``branch`` (a `Branch`).
    """
    found = write_figure(
        out, "fig3", _named, lambda results: summary(results[""]), lambda results: draw(results[""]), progress
    )
    return found | {"branch": found["results"][""]}


def _named(progress: bool | Report) -> Iterator[tuple[str, Branch]]:
    yield "", compute(progress)


def compute(progress: bool | Report = False) -> Branch:
    """Return the branch of Fig. 3."""
    from saltus.continuation import StepControl

    return response(repulsive_orbit(progress), BOUNDS, StepControl(largest=_LARGEST_STEP), progress)


def summary(branch: Branch) -> dict[str, Any]:
    """Return the content of ``fig3.json``; the parts of an infinite multiplier are null."""
    points = [
        {
            "type": point.type,
            "omega": point.parameters["Omega"],
            "state": point.orbit.x0.tolist(),
            "multipliers": [[_finite(mu.real), _finite(mu.imag)] for mu in point.orbit.multipliers],
            "min_z": point.orbit.min["z"],
            "signature": [list(pair) for pair in point.orbit.signature],
            "admissible": point.orbit.admissible,
        }
        for point in branch.special_points
    ]
    parameters = dict(branch.parameters) | {"Omega": list(BOUNDS)}
    return {"figure": "fig3", "parameters": parameters, "special_points": points}


def _finite(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def draw(branch: Branch) -> Figure:
    """Return the figure: (a) the whole response, (b) its repulsive part, (c) and (d) the two grazings."""
    from matplotlib.figure import Figure

    from saltus.plotting import style

    with style.publication():
        figure = Figure(figsize=(7.2, 6.2), layout="constrained")
        figure.get_layout_engine().set(h_pad=0.06, w_pad=0.06)  # type: ignore[union-attr, call-arg]
        (a, b), (c, d) = figure.subplots(2, 2)
        for letter, ax, window in (("a", a, _WHOLE), ("b", b, _RESPONSE), ("c", c, _LEFT), ("d", d, _RIGHT)):
            _curve(ax, branch, window)
            ax.set_title(f"({letter})", loc="left", fontweight="bold")
            ax.set_xlabel(r"drive frequency  $\bar{\Omega} = \Omega/\omega_1$")
            ax.set_ylabel(r"least gap  $\min\,\bar{z}$  (units of $\eta^*$)")
            ax.ticklabel_format(useOffset=False)
        _zoomed(b, _LEFT, "(c)", (7.0, 0.0))
        _zoomed(b, _RIGHT, "(d)", (9.0, 3.0))
        inset = c.inset_axes((0.2, 0.51, 0.47, 0.44))
        _curve(inset, branch, _NEAREST)
        inset.tick_params(labelsize=6)
        inset.ticklabel_format(useOffset=False)
        inset.set(xlabel="", ylabel="", xticks=(0.91275, 0.91285), yticks=(0.00325, 0.0033, 0.00335))
        c.indicate_inset_zoom(inset, edgecolor="0.4", linewidth=0.7)
        handles, labels = a.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, handlelength=2.4, columnspacing=2.5)
    return figure


def _curve(ax: Axes, branch: Branch, window: _Window) -> None:
    """Draw the branch and the line at which contact begins."""
    from saltus.plotting import style

    a0 = gap_at_contact(branch.parameters)
    branch.plot("Omega", "min_z", ax=ax, legend=False)
    ax.axhline(a0, color=style.SURFACE, linestyle=":", linewidth=1.1, zorder=1, label=r"contact begins, $\bar{a}_0$")
    for line in ax.lines:
        if str(line.get_label()).startswith("PD"):
            line.set_label("PD, period doubling (not drawn in the paper)")
    ax.set(xlim=window[0], ylim=window[1])


def _zoomed(ax: Axes, window: _Window, letter: str, offset: tuple[float, float]) -> None:
    """Name the panel that enlarges a window, beside it."""
    (low, high), (_, top) = window
    place = (0.5 * (low + high), top)
    ax.annotate(letter, place, xytext=offset, textcoords="offset points", fontsize=7.0)
