"""Fig. 4: saddle-nodes and period doublings of the saturated branch over the drive's frequency and amplitude, one mode.

The data file has the groups ``response`` (the `Branch` of Fig. 3) and ``responses`` (a `Family` over `ybar`). The
groups ``SN_1``, ``SN_2``, ``SN_3``, ``SN_left``, ``SN_touching``, ``SN_in_flight`` and ``PD`` are each a `Locus` over
`Omega` and `ybar`. `read_results` reads the file.

References
----------
ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Fig. 4 and section 4.1. The points SN_1 to SN_3 are the
paper's: SN_1 ends the saturated branch, SN_2 and SN_3 bound the stable orbits next to the right grazing. The period
doublings within 2e-3 of the grazings, which do not bound the saturated branch, are left out, as in the paper.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.afm.paper.figures.files import write_figure
from saltus.afm.paper.figures.responses import gap_at_contact, repulsive_orbit, response, responses
from saltus.afm.paper.figures.telling import about
from saltus.progress import Report

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from saltus.continuation import Branch, Locus, SpecialPoint
    from saltus.result import Result

__all__ = ["compute", "draw", "run", "summary"]

BOUNDS = {"Omega": (0.8, 1.4), "ybar": (0.09, 0.15)}  # intervals of the loci: Omega in omega_1, ybar in eta

DRIVES = (0.09, 0.1, 0.118, 0.129, 0.14, 0.15)  # values of ybar whose responses are drawn, besides that of Fig. 3

_LARGEST_STEP = 0.02  # in arclength, of the loci

# Saddle-nodes of Fig. 3 by their labels there: the paper's, then those at the left grazing, deepest first.
_SADDLE_NODES = {
    "SN_1": "SN4",
    "SN_2": "SN5",
    "SN_3": "SN6",
    "SN_left": "SN3",
    "SN_touching": "SN2",
    "SN_in_flight": "SN1",
}

_QUANTITIES = ("Omega", "ybar", "min_z")  # axes of the figure
_WINDOW = {"Omega": (0.86, 1.34), "ybar": BOUNDS["ybar"], "min_z": (-0.125, 0.04)}  # intervals of the axes

# Texts beside loci: the locus, the text, at its least or largest drive, offset from there.
_NAMES = (
    ("SN_1", "$SN_1$", np.argmin, (0.012, 0.0, -0.012)),
    ("SN_2", "$SN_{2,3}$", np.argmax, (0.015, 0.0, 0.006)),
)

_VIEW: Mapping[str, Any] = {"elev": 22.0, "azim": -62.0}  # angles in degrees


def run(out: Path, progress: bool | Report = False) -> dict[str, Any]:
    """Compute, draw and write the figure, and return the files and results, as `write_figure` does.

    Parameters
    ----------
    out : Path
        An existing folder, for ``fig4.nc``, ``fig4.json`` (`summary`), ``fig4.png`` and ``fig4.pdf``.
    progress : bool or callable
        True for bars on stderr, or a function called with a `saltus.Progress`.
    """
    return write_figure(out, "fig4", compute, summary, draw, progress)


def compute(progress: bool | Report = False) -> Iterator[tuple[str, Result]]:
    """Go through the results of Fig. 4, with their names, each computed on demand."""
    from saltus.continuation import BranchOptions, StepControl, continue_locus

    steps = StepControl(largest=_LARGEST_STEP)

    def locus(name: str, start: SpecialPoint) -> tuple[str, Locus]:
        return name, continue_locus(
            start,
            ("Omega", "ybar"),
            BOUNDS,
            steps=steps,
            progress=about(progress, name),
        )

    base = response(repulsive_orbit(progress), BOUNDS["Omega"], steps, progress)
    yield "response", base
    family = responses(base.solution(0), {"ybar": DRIVES}, BOUNDS["Omega"], BranchOptions(steps), progress)
    yield "responses", family
    for name, label in _SADDLE_NODES.items():
        yield locus(name, base[label])
    yield locus("PD", _on_saturated_branch(family[-1]))


def _on_saturated_branch(branch: Branch) -> SpecialPoint:
    """Return the period doubling of the deepest orbit, which bounds the saturated branch."""
    return min(branch.special_points.of_type("PD"), key=lambda point: point.orbit.min["z"])


def summary(results: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of ``fig4.json``: the least drive at which the saturated branch doubles its period."""
    varied = {name: list(interval) for name, interval in BOUNDS.items()}
    parameters = dict(results["response"].parameters) | varied
    content: dict[str, Any] = {"figure": "fig4", "parameters": parameters, "pd_onset": None}
    if "PD" in results and (onset := _onset(results["PD"])):
        content["pd_onset"] = {"ybar": onset.parameters["ybar"], "omega": onset.parameters["Omega"]}
    return content


def draw(results: Mapping[str, Any]) -> Figure:
    """Return the figure: stable frequency responses and the loci in space, and the plane at which contact begins."""
    from matplotlib.figure import Figure

    from saltus.plotting import style
    from saltus.plotting.space import coordinates_of, draw_in_space, draw_level

    drawn = [results["response"], *(branch for branch in results["responses"] if branch is not None)]
    with style.publication():
        figure = Figure(figsize=(5.6, 4.5))
        ax: Any = figure.add_axes((0.0, 0.0, 0.95, 1.0), projection="3d", **_VIEW)
        ax.set(xlim=_WINDOW["Omega"], ylim=_WINDOW["ybar"], zlim=_WINDOW["min_z"])
        ax.set_box_aspect((1.25, 1.15, 0.85), zoom=1.0)
        draw_level(ax, gap_at_contact(drawn[0].parameters), label=r"contact begins, $\min\,\bar{z} = \bar{a}_0$")
        for i, branch in enumerate(drawn):
            label = "stable frequency responses" if i == 0 else "_"
            draw_in_space(ax, branch, _QUANTITIES, kinds=("stable",), label=label, linewidth=0.8)
        for name in _SADDLE_NODES:
            label = "SN, saddle-node" if name == "SN_1" else "_"
            draw_in_space(ax, results[name], _QUANTITIES, color=style.SPECIAL["SN"].colour, linewidth=1.6, label=label)
        purple = style.SPECIAL["PD"].colour
        draw_in_space(ax, results["PD"], _QUANTITIES, color=purple, linewidth=1.6, label="PD, period doubling")
        if (onset := _onset(results["PD"])) is not None:
            place = coordinates_of(results["PD"], onset, _QUANTITIES)
            label = rf"PD at the least drive, $\bar{{y}}$ = {place[1]:.4f}"
            ax.plot(*place[:, None], label=label, **replace(style.SPECIAL["PD"], size=5.0).options())
        for name, text, end, offset in _NAMES:
            row = end(results[name].column("ybar"))
            beside = np.array([results[name].column(quantity)[row] for quantity in _QUANTITIES]) + offset
            ax.text(*beside, text, color=style.SPECIAL["SN"].colour, fontsize=8.5)
        ax.set_xlabel(r"drive frequency  $\bar{\Omega} = \Omega/\omega_1$")
        ax.set_ylabel(r"drive amplitude  $\bar{y} = Y/\eta^*$")
        ax.set_zlabel(r"least gap  $\min\,\bar{z}$  (units of $\eta^*$)", labelpad=6.0)
        figure.legend(loc="upper center", ncols=3, columnspacing=2.0)
    return figure


def _onset(locus: Locus) -> SpecialPoint | None:
    """Return the point of least drive of the locus; None without a turning point."""
    turns = [point for point in locus.special_points.of_type("TP") if point.of == "ybar"]
    return min(turns, key=lambda point: point.parameters["ybar"], default=None)
