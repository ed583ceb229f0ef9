"""Fig. 5: influence of the damping in air and in contact on the saturated branch, one mode.

The data file, which `read_results` reads, has the groups ``response`` (the `Branch` of Fig. 3) and ``responses`` (a
`Family` over `D_att_1` and `D_rep_1`). All other groups are each a `Locus`. ``SN_1``, ``SN_2`` and ``grazing`` vary
`Omega` and `D_att_1` at ``D_rep_1 = 4``. ``SN_1_D_rep_0.1`` and ``SN_1_D_rep_30`` do so at the damping in contact of
their names. ``SN_1_D_att_0.025`` and ``SN_1_D_att_0.14`` vary `Omega` and `D_rep_1` at the damping in air of their
names.

References
----------
ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Fig. 5 and section 4.1. The figure departs from the
paper's: SN_2 ends in a cusp with SN_3, at ``D_att_1 = 0.0399``. For more damping the response folds back at its
grazing, which is drawn dashed up to SN_1. The paper's heavily damped cantilever, ``D_att_1 = 0.04`` with
``D_rep_1 = 0.1``, penetrates deeper than Fig. 3's. It reaches SN_1 at ``Omega = 1.67``, beyond the picture. The reduced
penetration of the paper's text belongs to ``D_att_1 = 0.14``, which is drawn as well.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.afm.paper.figures.files import write_figure
from saltus.afm.paper.figures.responses import gap_at_contact, repulsive_orbit, response, responses
from saltus.afm.paper.figures.telling import about
from saltus.progress import Report

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from saltus.continuation import Branch, Locus, SpecialPoint
    from saltus.result import Result

__all__ = ["compute", "draw", "run", "summary"]

# Intervals of the loci: Omega in omega_1, dampings in omega_1 and modal masses.
BOUNDS = {"Omega": (0.8, 1.4), "D_att_1": (0.01, 0.2), "D_rep_1": (0.1, 30.0)}

# Pairs of `D_att_1` and `D_rep_1` whose frequency responses are drawn, besides those of Fig. 3.
DAMPINGS = (
    *((0.05, 4.0), (0.08, 4.0), (0.11, 4.0), (0.14, 4.0), (0.17, 4.0)),
    *((0.025, 10.0), (0.025, 30.0)),
    *((0.04, 0.1), (0.14, 0.1)),
)

_LARGEST_STEP = 0.02  # in arclength, of the loci

_QUANTITIES = ("Omega", "min_z", "D_att_1")  # axes of the figure
_WINDOW = {"Omega": (0.88, 1.28), "min_z": (-0.105, 0.03), "D_att_1": (0.0, 0.18)}  # intervals of the axes
_RED = "#9b0d18"  # colour of loci of the damping in air
_BLUE = "#1f4fb4"  # colour of loci of the damping in contact

# The loci as they are drawn: name, label, line.
_LOCI = (
    ("SN_1_D_att_0.025", r"$SN_1$, $D_1^{att}$ = 0.025, 0.14", {"color": _BLUE, "linewidth": 1.3}),
    ("SN_1_D_att_0.14", "_", {"color": _BLUE, "linewidth": 1.3}),
    ("SN_1_D_rep_0.1", r"$SN_1$, $D_1^{rep}$ = 0.1, 30", {"color": _RED, "linewidth": 0.9}),
    ("SN_1_D_rep_30", "_", {"color": _RED, "linewidth": 0.9}),
    (
        "grazing",
        "fold at the grazing, $D_1^{rep}$ = 4",
        {"color": _RED, "linewidth": 1.8, "linestyle": (0, (3.0, 1.0))},
    ),
    ("SN_2", "_", {"color": _RED, "linewidth": 1.8}),
    ("SN_1", r"$SN_1$ and $SN_2$, $D_1^{rep}$ = 4", {"color": _RED, "linewidth": 1.8}),
)

_COLOURS = {0.1: "#d98200", 4.0: "#1b1b1e", 10.0: "#3f8f8a", 30.0: "#1f6f4a"}  # of a response, by `D_rep_1`

_VIEW: Mapping[str, Any] = {"elev": 20.0, "azim": -116.0}  # angles in degrees


def run(out: Path, progress: bool | Report = False) -> dict[str, Any]:
    """Compute, draw and write the figure, and return the files and results, as `write_figure` does.

    Parameters
    ----------
    out : Path
        An existing folder, for ``fig5.nc``, ``fig5.json`` (`summary`), ``fig5.png`` and ``fig5.pdf``.
    progress : bool or callable
        True for bars on stderr, or a function called with a `saltus.Progress`.
    """
    return write_figure(out, "fig5", compute, summary, draw, progress)


def compute(progress: bool | Report = False) -> Iterator[tuple[str, Result]]:
    """Go through the results of Fig. 5, with their names, each computed on demand."""
    from saltus.continuation import BranchOptions, StepControl, continue_locus

    steps = StepControl(largest=_LARGEST_STEP)

    def locus(name: str, start: SpecialPoint, damping: str) -> tuple[str, Locus]:
        return name, continue_locus(
            start,
            ("Omega", damping),
            {varied: BOUNDS[varied] for varied in ("Omega", damping)},
            steps=steps,
            progress=about(progress, name),
        )

    base = response(repulsive_orbit(progress), BOUNDS["Omega"], steps, progress)
    yield "response", base
    in_air, in_contact = zip(*DAMPINGS, strict=True)
    over = {"D_att_1": in_air, "D_rep_1": in_contact}
    family = responses(base.solution(0), over, BOUNDS["Omega"], BranchOptions(steps), progress)
    yield "responses", family
    yield locus("SN_1", base["SN4"], "D_att_1")
    yield locus("SN_2", base["SN5"], "D_att_1")
    yield locus("grazing", base["GR2"], "D_att_1")
    yield locus("SN_1_D_rep_0.1", _deepest(family[DAMPINGS.index((0.14, 0.1))]), "D_att_1")
    yield locus("SN_1_D_rep_30", _deepest(family[DAMPINGS.index((0.025, 30.0))]), "D_att_1")
    yield locus("SN_1_D_att_0.025", base["SN4"], "D_rep_1")
    yield locus("SN_1_D_att_0.14", _deepest(family[DAMPINGS.index((0.14, 4.0))]), "D_rep_1")


def _deepest(branch: Branch) -> SpecialPoint:
    """Return the saddle-node that ends the saturated branch."""
    return min(branch.special_points.of_type("SN"), key=lambda point: point.orbit.min["z"])


def _maximum(locus: Locus) -> SpecialPoint | None:
    """Return the point of largest `D_att_1` of the locus; None without a turning point."""
    turns = [point for point in locus.special_points.of_type("TP") if point.of == "D_att_1"]
    return max(turns, key=lambda point: point.parameters["D_att_1"], default=None)


def summary(results: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of ``fig5.json``: the largest damping in air at which the saturated branch folds."""
    varied = {name: list(interval) for name, interval in BOUNDS.items()}
    parameters = dict(results["response"].parameters) | varied
    content: dict[str, Any] = {"figure": "fig5", "parameters": parameters, "sn_locus_max": None}
    if "SN_1" in results and (most := _maximum(results["SN_1"])):
        content["sn_locus_max"] = {"D_att_1": most.parameters["D_att_1"], "omega": most.parameters["Omega"]}
    return content


def draw(results: Mapping[str, Any]) -> Figure:
    """Return the figure: (a) responses and loci in space, (b) their projection; contact begins at gap zero in both."""
    from matplotlib.figure import Figure

    from saltus.plotting import style

    with style.publication():
        figure = Figure(figsize=(7.4, 4.4), layout="constrained")
        figure.get_layout_engine().set(wspace=0.1)  # type: ignore[union-attr, call-arg]
        grid = figure.add_gridspec(1, 2, width_ratios=(1.5, 1.0))
        space: Any = figure.add_subplot(grid[0], projection="3d", **_VIEW)
        plane = figure.add_subplot(grid[1])
        _draw_space(space, results)
        _draw_plane(plane, results)
        handles, labels = plane.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, columnspacing=2.5)
    return figure


def _origin(results: Mapping[str, Any]) -> NDArray[np.float64]:
    """Return the offsets of `_QUANTITIES`: the gap counts from the beginning of contact."""
    return np.array([0.0, gap_at_contact(results["response"].parameters), 0.0])


@dataclass(frozen=True)
class _Line:
    """A line of both panels: Omega, min z less its value at contact, D_att_1, and the line's style."""

    places: NDArray[np.float64]
    label: str
    options: Mapping[str, Any]


def _lines(results: Mapping[str, Any]) -> Iterator[_Line]:
    """Go through all lines in the order of drawing, each with its label."""
    from saltus.plotting import style
    from saltus.plotting.space import stretches_of

    origin = _origin(results)[:, None]
    for branch in (results["response"], *(member for member in results["responses"] if member is not None)):
        in_contact = branch.parameters["D_rep_1"]
        for stretch in stretches_of(branch, _QUANTITIES):
            label = f"response, $D_1^{{rep}}$ = {in_contact:g}" if stretch.kind == "stable" else "_"
            options = {**style.LINES[stretch.kind], "linewidth": 0.9, "color": _COLOURS[in_contact]}
            yield _Line(stretch.places - origin, label, options)
    for name, label, style_of_line in _LOCI:
        for stretch in stretches_of(results[name], _QUANTITIES):
            places = stretch.places - origin
            if name == "grazing":  # its other half bounds the response on the left
                places = places[:, places[0] >= float(results["SN_1"].column("Omega").min())]
            yield _Line(places, label, style_of_line)


def _draw_space(ax: Any, results: Mapping[str, Any]) -> None:
    ax.set(xlim=_WINDOW["Omega"], ylim=_WINDOW["min_z"], zlim=_WINDOW["D_att_1"])
    ax.set_box_aspect((1.2, 1.2, 1.25), zoom=1.07)
    ax.set_yticks([-0.1, -0.05, 0.0])
    for line in _lines(results):
        ax.plot(*line.places, axlim_clip=True, **line.options)
    _mark_maximum(ax, results)
    ax.set_title("(a)", loc="left", fontweight="bold")
    ax.set_xlabel(r"drive frequency  $\bar{\Omega}$", labelpad=2.0)
    ax.set_ylabel(r"$\min\,\bar{z} - \bar{a}_0$", labelpad=3.0)
    ax.set_zlabel(r"damping in air  $D_1^{att}$")


def _mark_maximum(ax: Axes, results: Mapping[str, Any]) -> None:
    """Mark where SN_1 has its largest damping in air, in space or in the plane."""
    from saltus.plotting import style
    from saltus.plotting.space import coordinates_of

    locus = results["SN_1"]
    most = _maximum(locus)
    if most is not None:
        place = coordinates_of(locus, most, _QUANTITIES) - _origin(results)
        label = f"$SN_1$ at its largest $D_1^{{att}}$, {place[2]:.4f}"
        marker = replace(style.SPECIAL["SN"], colour=_RED, size=6.0).options()
        ax.plot(*place[: 3 if ax.name == "3d" else 2, None], label=label, zorder=6, **marker)


def _draw_plane(ax: Axes, results: Mapping[str, Any]) -> None:
    named: set[str] = set()
    for line in _lines(results):
        ax.plot(*line.places[:2], label="_" if line.label in named else line.label, **line.options)
        named.add(line.label)
    _mark_maximum(ax, results)
    ax.set(xlim=_WINDOW["Omega"], ylim=_WINDOW["min_z"])
    ax.set_title("(b)", loc="left", fontweight="bold")
    ax.set_xlabel(r"drive frequency  $\bar{\Omega}$")
    ax.set_ylabel(r"least gap less that at contact  $\min\,\bar{z} - \bar{a}_0$")
