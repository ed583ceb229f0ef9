"""Fig. 7(a): the saturated branch with two modes of the cantilever, by the second mode's damping in contact.

The data file, which `read_results` reads, has the groups ``one_mode`` and ``two_modes``. Each is a `Branch`: the whole
response, with two modes at the paper's damping. ``beside PD4`` and the like are each a `Branch`: a stretch of
``two_modes`` with special points that larger steps pass over. ``responses`` is a `Family` over `D_rep_2`; ``SN`` and
``TR`` are each a `Locus` over `Omega` and `D_rep_2`.

References
----------
ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Fig. 7(a) and section 4.2. The figure departs from the
paper's: the branch does not end in the region marked (b). It continues through the region, unstable and with two
touches a period.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.afm.paper.figures import fig3
from saltus.afm.paper.figures.files import write_figure
from saltus.afm.paper.figures.responses import gap_at_contact, repulsive_orbit, response, responses
from saltus.afm.paper.figures.telling import tell
from saltus.progress import Report

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure, FigureBase
    from numpy.typing import NDArray

    from saltus.continuation import Branch, Locus, SpecialPoint
    from saltus.orbits import PeriodicOrbit
    from saltus.result import Result

__all__ = ["SWEPT", "compute", "draw", "draw_into", "run", "summary"]

BOUNDS = (0.88, 1.28)  # interval of Omega, in omega_1

# Values of D_rep_2 besides the paper's 4. At the last one the stable response is that of one mode to a line's width.
DAMPINGS = (6.0, 10.0, 20.0, 60.0, 1500.0)

SWEPT = (0.995, 1.05)  # interval of Omega of Fig. 7(b), marked in the picture

COMPARED = (0.93, 1.16)  # interval of Omega in which responses are compared

_START = {"Omega": 1.15}  # parameters of `_GUESS`

# An orbit of the saturated branch at `_START`, roughly.
_GUESS = [
    ("flight", "touch", [-1.239, -0.0295, 0.403, 0.484], 1.932),
    ("contact", "release", [0.973, -0.062, 1.187, 0.35], 0.277),
    ("flight", "theta", [1.02, -0.0835, -0.408, -0.178], 3.255),
]

_TOLERANCE = 1e-10  # of the responses in `DAMPINGS`, which are stiff and only drawn

_STEP_ONE_MODE = 0.02  # largest step in arclength, one mode
_STEP_TWO_MODES = 0.05  # largest step in arclength, two modes
_DEVIATION = 3e-3  # `StepControl.deviation` of the responses in `DAMPINGS`
_BESIDE = 1e-5  # distance in Omega from each SN and PD within which other special points are sought
_STEP_BESIDE = 0.1  # largest step there, in arclength

_SAME = 1e-9  # distance in Omega within which two special points of one type are one

_EDGE = -0.002  # min z at which the responses in `DAMPINGS` end, next to their grazings

_SN_BOUNDS = {"Omega": (1.1, 1.28), "D_rep_2": (4.0, DAMPINGS[-1])}  # of the locus of saddle-nodes
_TR_BOUNDS = {"Omega": (1.0, 1.1), "D_rep_2": (2.0, 8.0)}  # of the locus of torus bifurcations

_Window = tuple[tuple[float, float], tuple[float, float]]  # interval of Omega, interval of min z

_CHART: _Window = ((0.9, 1.265), (-0.1155, 0.0135))  # the picture
_TORUS: _Window = ((1.0325, 1.0555), (-0.0485, -0.0378))  # its inset


_ONE_MODE = "#f2b277"  # colour of the response with one mode
_COLOURS = ("viridis", 0.0, 0.8)  # colour map of the dampings, the least first, and the part of it that is used


def run(out: Path, progress: bool | Report = False) -> dict[str, Any]:
    """Compute, draw and write the figure, and return the files and results, as `write_figure` does.

    Parameters
    ----------
    out : Path
        An existing folder, for ``fig7a.nc``, ``fig7a.json`` (`summary`), ``fig7a.png`` and ``fig7a.pdf``.
    progress : bool or callable
        True for bars on stderr, or a function called with a `saltus.Progress`.
    """
    return write_figure(out, "fig7a", compute, summary, draw, progress)


def compute(progress: bool | Report = False) -> Iterator[tuple[str, Result]]:
    """Go through the results of Fig. 7(a), with their names, each computed on demand."""
    from saltus.continuation import BranchOptions, StepControl, continue_locus

    coarse = StepControl(deviation=_DEVIATION)
    yield "one_mode", response(repulsive_orbit(progress), BOUNDS, StepControl(largest=_STEP_ONE_MODE), progress)
    branch = response(_saturated_orbit(progress), BOUNDS, StepControl(largest=_STEP_TWO_MODES), progress)
    yield "two_modes", branch
    yield from _beside(branch, progress)
    steps = StepControl(largest=_STEP_TWO_MODES, deviation=_DEVIATION)  # between their points splines are taken
    options = BranchOptions(steps, events={"min_z": _EDGE}, stop_at="min_z")
    start = _saturated_orbit(tolerance=_TOLERANCE)
    yield "responses", responses(start, {"D_rep_2": DAMPINGS}, BOUNDS, options, progress)
    tell(progress, "locus of the saddle-node")
    yield "SN", continue_locus(_end(branch), ("Omega", "D_rep_2"), _SN_BOUNDS, steps=coarse)
    tell(progress, "locus of the torus bifurcation")
    yield "TR", continue_locus(_torus(branch), ("Omega", "D_rep_2"), _TR_BOUNDS)


def _saturated_orbit(progress: bool | Report = False, tolerance: float = 1e-12) -> PeriodicOrbit:
    from saltus.afm.paper.table1 import table1
    from saltus.afm.paper.tapping import tapping_mode
    from saltus.orbits import solve_orbit

    tell(progress, "correcting the first orbit of two modes")
    return solve_orbit(tapping_mode(table1(), modes=2), _START, _GUESS, tolerance=tolerance)


def _beside(branch: Branch, progress: bool | Report) -> Iterator[tuple[str, Branch]]:
    """Follow the branch beside each SN and PD; yield the stretches with special points that the branch lacks."""
    from saltus.continuation import StepControl, continue_orbit

    steps = StepControl(largest=_STEP_BESIDE)
    for point in branch.special_points.of_type("SN", "PD"):
        tell(progress, f"beside {point.label}")
        omega = point.parameters["Omega"]
        stretch = continue_orbit(point.orbit, "Omega", (omega - _BESIDE, omega + _BESIDE), steps=steps)
        if any("interrupted" in reason for reason in stretch.stopped):
            raise KeyboardInterrupt
        if any(not _is_among(other, branch) for other in stretch.special_points):
            yield f"beside {point.label}", stretch


def _is_among(point: SpecialPoint, branch: Branch) -> bool:
    omega = point.parameters["Omega"]
    return any(abs(other.parameters["Omega"] - omega) < _SAME for other in branch.special_points.of_type(point.type))


def _end(branch: Branch) -> SpecialPoint:
    """Return the saddle-node that ends the saturated branch."""
    return max(branch.special_points.of_type("SN"), key=lambda point: point.parameters["Omega"])


def _torus(branch: Branch) -> SpecialPoint:
    """Return the deepest TR at which stable orbits end."""
    edges = [p for p in branch.special_points.of_type("TR") if np.abs(p.orbit.multipliers).max() < 1.0 + 1e-6]
    return min(edges, key=lambda point: point.orbit.min["z"])


def summary(results: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of ``fig7a.json``.

    ``special_points`` are those of the response at ``D_rep_2 = 4``, in the order and with the keys of ``fig3.json``.
    ``distance_to_sdof`` pairs each `D_rep_2` with the mean difference of min z between its response and that of one
    mode. The mean is over values of Omega in `COMPARED`, 0.001 apart, at which all responses are stable.
    ``largest_difference`` pairs it with the largest difference. ``saddle_nodes`` are the ends of the saturated
    branches: `D_rep_2`, Omega, min z. ``one_mode`` is the end with one mode.
    """
    content: dict[str, Any] = {
        "figure": "fig7a",
        "parameters": dict(results["one_mode"].parameters) | {"Omega": list(BOUNDS)},
        "special_points": [],
        "one_mode": None,
        "saddle_nodes": [],
        "distance_to_sdof": [],
        "largest_difference": [],
    }
    if "two_modes" in results:
        content["parameters"] = dict(results["two_modes"].parameters) | {"Omega": list(BOUNDS)}
        content["special_points"] = fig3.summary(_complete(results))["special_points"]
    if "responses" in results:
        end, branches = _end(results["one_mode"]), _two_modes(results)
        apart = _differences(results["one_mode"], branches)
        ends = {value: _end(branch) for value, branch in branches.items()}
        content["parameters"]["D_rep_2"] = list(branches)
        content["one_mode"] = {"omega": end.parameters["Omega"], "min_z": end.orbit.min["z"]}
        content["saddle_nodes"] = [[value, p.parameters["Omega"], p.orbit.min["z"]] for value, p in ends.items()]
        content["distance_to_sdof"] = [[value, float(gaps.mean())] for value, gaps in apart.items()]
        content["largest_difference"] = [[value, float(gaps.max())] for value, gaps in apart.items()]
    return content


def _two_modes(results: Mapping[str, Any]) -> dict[float, Branch]:
    """Return the responses of two modes by `D_rep_2`."""
    family = results["responses"]
    pairs = zip(family.over["D_rep_2"].tolist(), family, strict=True)
    found = {results["two_modes"].parameters["D_rep_2"]: results["two_modes"]}
    return found | {value: branch for value, branch in pairs if branch is not None}


def _complete(results: Mapping[str, Any]) -> Branch:
    """Return the response at the paper's damping, with the special points of the stretches in order."""
    from saltus.continuation import SpecialPoints

    branch: Branch = results["two_modes"]
    found = [(point.position, point) for point in branch.special_points]
    for host in branch.special_points:
        stretch = results.get(f"beside {host.label}")
        for point in () if stretch is None else stretch.special_points:
            if not _is_among(point, branch):
                ahead = np.dot(_place(point.orbit) - _place(host.orbit), _direction(branch, host))
                found.append((host.position + 0.1 * float(np.sign(ahead)), point))
    points = [point for _, point in sorted(found, key=lambda pair: pair[0])]
    return replace(branch, special_points=SpecialPoints(points, branch.varied))


def _place(orbit: PeriodicOrbit) -> NDArray[np.float64]:
    return np.append(orbit.x0, orbit.parameters["Omega"])


def _direction(branch: Branch, point: SpecialPoint) -> NDArray[np.float64]:
    """Return the vector from the branch's point before a special point to the next point after it."""
    before, after = int(np.floor(point.position)), int(np.ceil(point.position))
    return _place(branch.solution(after)) - _place(branch.solution(before))


def _differences(one_mode: Branch, branches: Mapping[float, Branch]) -> dict[float, NDArray[np.float64]]:
    """Return the differences of min z from one mode, by `D_rep_2`, where all responses are stable."""
    omega = np.arange(COMPARED[0], COMPARED[1], 1e-3)
    reference = _stable_depth(one_mode, omega)
    apart = {value: np.abs(_stable_depth(branch, omega) - reference) for value, branch in branches.items()}
    everywhere = np.isfinite(np.array(list(apart.values()))).all(axis=0)
    return {value: gaps[everywhere] for value, gaps in apart.items()}


def _stable_depth(branch: Branch, omega: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return min z of the stable orbits in contact, by cubic splines along Omega; NaN without any."""
    from scipy.interpolate import CubicSpline

    depth, found = branch.column("min_z"), np.full(omega.shape, np.nan)
    rows = np.flatnonzero(branch.stable & branch.admissible & (depth < 0.0))
    for part in np.split(rows, np.flatnonzero(np.diff(rows) > 1) + 1):
        last = int(np.argmax(branch.values[part]))
        rising = part[: last + 1]
        if len(rising) > 1 and np.all(np.diff(branch.values[rising]) > 0.0):
            inside = (omega >= branch.values[rising[0]]) & (omega <= branch.values[rising[-1]])
            found[inside] = CubicSpline(branch.values[rising], depth[rising])(omega[inside])
    return found


def draw(results: Mapping[str, Any]) -> Figure:
    """Return the figure: the responses, the loci of SN and TR, and as an inset the surroundings of the latter."""
    from matplotlib.figure import Figure

    from saltus.plotting import style

    with style.publication():
        figure = Figure(figsize=(7.2, 5.0), layout="constrained")
        draw_into(figure, results)
    return figure


def draw_into(figure: FigureBase, results: Mapping[str, Any]) -> Axes:
    """Draw the responses, the loci and the legend into a figure, or a part of one, and return the Axes."""
    import matplotlib

    from saltus.plotting import style

    branches = _two_modes(results)
    name, low, high = _COLOURS
    shades = matplotlib.colormaps[name](np.linspace(low, high, len(branches)))
    ax: Axes = figure.subplots()
    inset = ax.inset_axes((0.068, 0.075, 0.302, 0.35))
    for axes, window in ((ax, _CHART), (inset, _TORUS)):
        axes.axvspan(*SWEPT, color="0.93", linewidth=0.0, zorder=0)
        _response(axes, results["one_mode"], r"one mode", color=_ONE_MODE, linewidth=3.4)
        for (value, branch), shade in zip(branches.items(), shades, strict=True):
            _response(axes, branch, f"$D_2^{{rep}} = {value:g}$", color=shade, linewidth=1.1)
        _loci(axes, results)
        _mark(axes, results)
        axes.set(xlim=window[0], ylim=window[1])
        axes.ticklabel_format(useOffset=False)
    a0 = gap_at_contact(results["one_mode"].parameters)
    ax.axhline(a0, color=style.SURFACE, linestyle=":", linewidth=1.1, zorder=1, label=r"contact begins, $\bar{a}_0$")
    ax.annotate("(b)", (sum(SWEPT) / 2.0, _CHART[1][1]), (0.0, -9.0), textcoords="offset points", ha="center")
    ax.set_xlabel(r"drive frequency  $\bar{\Omega} = \Omega/\omega_1$")
    ax.set_ylabel(r"least gap  $\min\,\bar{z}$  (units of $\eta^*$)")
    inset.tick_params(labelsize=6.5)
    inset.set(xticks=(1.04, 1.05), yticks=(-0.045, -0.04))
    _name_ends(inset, results["TR"])
    ax.indicate_inset_zoom(inset, edgecolor="0.4", linewidth=0.7)
    handles, labels = ax.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=4, handlelength=2.2, columnspacing=2.0)
    return ax


def _response(ax: Axes, branch: Branch, label: str, **line: Any) -> None:
    """Draw a branch in one colour: solid where stable, dashed where not."""
    from saltus.plotting import style
    from saltus.plotting.branch import pieces_of

    for piece in pieces_of(branch, "Omega", "min_z"):
        solid = piece.kind == "stable"
        options = {**line, "linestyle": style.LINES[piece.kind]["linestyle"]}
        if not solid:
            options["linewidth"] = 0.75 * line["linewidth"]
        ax.plot(piece.x, piece.y, label=label if solid else "_", zorder=2, **options)
        label = "_" if solid else label


def _loci(ax: Axes, results: Mapping[str, Any]) -> None:
    from saltus.plotting import style
    from saltus.plotting.space import stretches_of

    for kind in ("SN", "TR"):
        label = f"{kind} as $D_2^{{rep}}$ varies"
        for stretch in stretches_of(results[kind], ["Omega", "min_z"]):
            ax.plot(*stretch.places, color=style.SPECIAL[kind].colour, linewidth=1.7, label=label, zorder=3)
            label = "_"


def _mark(ax: Axes, results: Mapping[str, Any]) -> None:
    """Mark the special points at the paper's damping, and the ends of the saturated branches."""
    from saltus.plotting import style

    points = _complete(results).special_points
    for kind in ("SN", "GR", "PD", "TR"):
        marker = style.SPECIAL[kind]
        places = [(point.parameters["Omega"], point.orbit.min["z"]) for point in points.of_type(kind)]
        ax.plot(*np.transpose(places), label=f"{kind}, {marker.meaning}", zorder=5, **marker.options())
    ends = [_end(branch) for branch in (results["one_mode"], *_two_modes(results).values())]
    places = [(point.parameters["Omega"], point.orbit.min["z"]) for point in ends]
    ax.plot(*np.transpose(places), zorder=5, label="_", **style.SPECIAL["SN"].options())


def _name_ends(ax: Axes, locus: Locus) -> None:
    """Write the damping at a locus' two ends."""
    from saltus.plotting import style

    for row, offset in ((0, (4.0, -1.0)), (-1, (-3.0, 4.0))):
        value, place = locus.column("D_rep_2")[row], (locus.column("Omega")[row], locus.column("min_z")[row])
        ax.annotate(
            f"{value:.2g}", place, offset, textcoords="offset points", fontsize=6.0, color=style.SPECIAL["TR"].colour
        )
