"""Fig. 6: the saddle-node SN1 at the saturated branch's end, against both dampings: isolines and their folds.

The saddle-nodes are a surface over the plane of the two dampings. It folds in two ways. Isolines of fixed damping in
air turn back in Omega, at points that form one smooth curve. Isolines of fixed damping in contact turn back where a
cusp point (CP) ends the saddle-node. These points form a curve with a cusp of its own (a swallowtail). For stronger
damping in contact no isoline folds: the paper's cusp catastrophe.

The data file has the groups ``response`` (the `Branch` that ends at SN1) and ``reference`` (the `PeriodicOrbit` that
the paper marks). Each other group is a `Locus` of saddle-nodes at the damping of its name, as ``D_rep_1=4``.
`read_results` reads the file.

References
----------
ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Fig. 6 and section 4.1. The figure departs from the
paper's: the curves of turning points and of cusp points are drawn too.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.afm.paper.figures.files import write_figure
from saltus.afm.paper.figures.responses import gap_at_contact, repulsive_orbit
from saltus.afm.paper.figures.telling import tell
from saltus.progress import Report

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from saltus.continuation import Locus, SpecialPoint
    from saltus.result import Result

__all__ = ["compute", "draw", "run", "summary"]

# Intervals of the three parameters that vary, in omega_1.
BOUNDS: Mapping[str, tuple[float, float]] = {"Omega": (0.98, 1.3), "D_att_1": (0.005, 0.2), "D_rep_1": (0.1, 100.0)}

# Dampings of the isolines.
FIXED: Mapping[str, tuple[float, ...]] = {
    "D_rep_1": (0.1, 0.5, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 10.0, 20.0, 30.0, 100.0),
    "D_att_1": (0.005, 0.025, 0.06, 0.1, 0.13, 0.15, 0.16, 0.165, 0.17),
}

# Dampings in air whose saddle-nodes at weak damping in contact are isolines of their own, with their turning points.
ISLANDS = (0.1667, 0.168, 0.1685)

NEAR_CUSP = (1.7, 2.1, 2.2, 2.23, 2.25)  # dampings in contact of the short isolines that resolve the cusps

# Bounds of the short isolines.
NEARBY: Mapping[str, tuple[float, float]] = {"Omega": (1.005, 1.06), "D_att_1": (0.156, 0.172)}

REFERENCE = {"D_att_1": 0.025, "D_rep_1": 30.0}  # point that the paper marks

_SPINE = 0.16  # damping in air of the isoline on which those of fixed damping in contact start

_LARGEST_STEP = 0.03  # in arclength, of the isolines
_SHORT_STEP = 0.012  # in arclength, of the short isolines: no two cusp points lie within it

_ROUNDING = 1e-9  # relative difference of two values that is none
_COINCIDENT = 1e-4  # arclength within which two special points are one

_FITTED = 5  # pairs of cusp points from which their meeting point is extrapolated

_LABELLED = 4.0  # damping in contact below which isolines leave the chart together: first and last are named

# Colours of an isoline, by what is fixed along it: the paper's dark red and blue.
_COLOURS = {"D_rep_1": "#8c0d1a", "D_att_1": "#1c4fa0"}

_TURNING = "#d98c00"  # colour of turning points
_CUSPS = "#1b1b1e"  # colour of cusp points

_Window = tuple[tuple[float, float], tuple[float, float]]  # interval of Omega, interval of min z

_CHART: _Window = ((0.955, 1.3), (-0.1465, 0.0165))  # panel (a)
_FOLD: _Window = ((0.9905, 1.0405), (-0.0165, 0.0045))  # inset (b)


def run(out: Path, progress: bool | Report = False) -> dict[str, Any]:
    """Compute, draw and write the figure, and return the files and results, as `write_figure` does.

    Parameters
    ----------
    out : Path
        An existing folder, for ``fig6.nc``, ``fig6.json`` (`summary`), ``fig6.png`` and ``fig6.pdf``.
    progress : bool or callable
        True for bars on stderr, or a function called with a `saltus.Progress`.
    """
    return write_figure(out, "fig6", compute, summary, draw, progress)


def compute(progress: bool | Report = False) -> Iterator[tuple[str, Result]]:
    """Go through the results of Fig. 6, with their names, each computed on demand."""
    from saltus.continuation import continue_orbit

    response = continue_orbit(repulsive_orbit(progress), "Omega", BOUNDS["Omega"], directions="up", stop_at="SN")
    yield "response", response
    across = _isoline(response["SN1"], "D_rep_1", progress)
    yield "D_rep_1=4", across
    spine = _isoline(_at(across, "D_att_1", _SPINE), "D_att_1", progress)
    yield f"D_att_1={_SPINE:g}", spine
    contact = {4.0: across}
    for value in FIXED["D_rep_1"]:
        if value not in contact:
            contact[value] = _isoline(_at(spine, "D_rep_1", value), "D_rep_1", progress)
            yield f"D_rep_1={value:g}", contact[value]
    for value in NEAR_CUSP:
        start = _at(spine, "D_rep_1", value)
        yield f"D_rep_1={value:g}", _isoline(start, "D_rep_1", progress, bounds=NEARBY, largest=_SHORT_STEP)
    for value in FIXED["D_att_1"]:
        if value != _SPINE:
            yield f"D_att_1={value:g}", _isoline(_at(across, "D_att_1", value), "D_att_1", progress)
    for value in ISLANDS:
        start = _at(contact[FIXED["D_rep_1"][0]], "D_att_1", value)
        yield f"D_att_1={value:g}", _isoline(start, "D_att_1", progress, largest=_SHORT_STEP)
    yield "reference", _at(contact[REFERENCE["D_rep_1"]], "D_att_1", REFERENCE["D_att_1"]).orbit


def _isoline(
    start: SpecialPoint,
    fixed: str,
    progress: bool | Report,
    *,
    bounds: Mapping[str, tuple[float, float]] = BOUNDS,
    largest: float = _LARGEST_STEP,
) -> Locus:
    """Return the saddle-nodes with one damping fixed, while Omega and the other damping vary."""
    from saltus.continuation import StepControl, continue_locus

    tell(progress, f"isoline {fixed} = {start.parameters[fixed]:g}")
    varied = ("Omega", "D_att_1" if fixed == "D_rep_1" else "D_rep_1")
    return continue_locus(start, varied, {name: bounds[name] for name in varied}, steps=StepControl(largest=largest))


def _at(isoline: Locus, name: str, value: float) -> SpecialPoint:
    """Return the point of the first sheet of an isoline at a value of the damping that varies along it."""
    from saltus.continuation import continue_locus

    low, high = _first_sheet(isoline)
    rows = np.flatnonzero((isoline.arclength >= low) & (isoline.arclength <= high))
    row = int(rows[np.argmin(np.abs(isoline.column(name)[rows] - value))])
    point, begin = isoline.point(row), float(isoline.column(name)[row])
    if not np.isclose(begin, value, rtol=_ROUNDING, atol=0.0):
        bounds = {"Omega": BOUNDS["Omega"], name: (min(begin, value), max(begin, value))}
        way = continue_locus(point, isoline.names, bounds)
        if any("interrupted" in reason for reason in way.stopped):
            raise KeyboardInterrupt
        point = way.point(int(np.argmin(np.abs(way.column(name) - value))))
    return replace(point, solution=replace(point.orbit, parameters={**point.parameters, name: value}))


def _first_sheet(isoline: Locus) -> tuple[float, float]:
    """Return the interval of arclength that is SN1: from the deepest end to the first CP or turn of the damping.

    Beyond its edge the isoline is another saddle-node, which SN1 meets there.
    """
    depth, s = isoline.column("min_z"), isoline.arclength
    edges = [point.arclength for point in isoline.special_points if point.type == "CP" or _turns_damping(point)]
    if depth[0] < depth[-1]:
        return float(s[0]), min(edges, default=float(s[-1]))
    return max(edges, default=float(s[0])), float(s[-1])


def _turns_damping(point: SpecialPoint) -> bool:
    return point.type == "TP" and point.of != "Omega"


def _turning_points(isoline: Locus) -> list[SpecialPoint]:
    """Return the points at which only Omega turns: not CPs, nor grazings at an isoline's end."""
    others = [p.arclength for p in isoline.special_points if p.type in ("CP", "GR") or _turns_damping(p)]
    return [
        point
        for point in isoline.special_points.of_type("TP")
        if point.of == "Omega" and all(abs(point.arclength - s) > _COINCIDENT for s in others)
    ]


def summary(results: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of ``fig6.json``.

    ``sn1`` are the isolines' points on SN1, ``folded`` those beyond its edge, both without the grazings at their ends.
    ``turning_points`` are the points at which isolines of fixed damping in air turn back in Omega. ``cusps`` are the
    CPs of isolines of fixed damping in contact, and ``cusp`` is the cusp of their curve. ``turning_points_cusp`` is
    null: along the curve of turning points the damping in air grows, and the damping in contact falls.
    """
    isolines = _isolines(results)
    sn1: list[dict[str, float]] = []
    folded: list[dict[str, float]] = []
    for isoline in isolines:
        low, high = _first_sheet(isoline)
        grazings = [point.arclength for point in isoline.special_points.of_type("GR")]
        for row, s in enumerate(isoline.arclength.tolist()):
            if all(abs(s - end) > _COINCIDENT for end in grazings):
                (sn1 if low <= s <= high else folded).append(_row(isoline, row))
    turning = [
        _place(point) for isoline in isolines if "D_rep_1" in isoline.names for point in _turning_points(isoline)
    ]
    parameters = dict(results["response"].parameters) | {name: list(interval) for name, interval in BOUNDS.items()}
    return {
        "figure": "fig6",
        "parameters": parameters,
        "reference": _reference(results),
        "cusp": _meeting(isolines),
        "turning_points_cusp": None,
        "remarks": [
            "turning_points: Omega turns along isolines of fixed D_att_1; one smooth curve, without a cusp: D_att_1 "
            "grows along it and D_rep_1 falls, down to the least that was computed",
            "cusps: along isolines of fixed D_rep_1 SN1 ends at a CP, where Omega and D_att_1 turn together",
            "cusp: where the two cusps of an isoline meet (a swallowtail); for larger D_rep_1 no isoline folds",
        ],
        "sn1": sn1,
        "folded": folded,
        "turning_points": sorted(turning, key=lambda place: place["D_att_1"]),
        "cusps": [_place(point) for point in _cusps(isolines)],
    }


def _isolines(results: Mapping[str, Any]) -> list[Locus]:
    return [result for name, result in results.items() if name.startswith("D_")]


def _row(isoline: Locus, row: int) -> dict[str, float]:
    values = dict(isoline.parameters) | dict(zip(isoline.names, isoline.values[row].tolist(), strict=True))
    return {
        "D_att_1": values["D_att_1"],
        "D_rep_1": values["D_rep_1"],
        "omega": values["Omega"],
        "min_z": float(isoline.column("min_z")[row]),
    }


def _place(point: SpecialPoint) -> dict[str, float]:
    values = point.parameters
    return {
        "D_att_1": values["D_att_1"],
        "D_rep_1": values["D_rep_1"],
        "omega": values["Omega"],
        "min_z": point.orbit.min["z"],
    }


def _reference(results: Mapping[str, Any]) -> dict[str, float] | None:
    if "reference" not in results:
        return None
    orbit = results["reference"]
    return REFERENCE | {"omega": orbit.parameters["Omega"], "min_z": orbit.min["z"]}


def _cusps(isolines: list[Locus]) -> list[SpecialPoint]:
    """Return the cusp points of the isolines of fixed damping in contact, along their curve."""
    points = [p for isoline in isolines if "D_att_1" in isoline.names for p in isoline.special_points.of_type("CP")]
    return sorted(points, key=lambda point: point.orbit.min["z"])


def _meeting(isolines: list[Locus]) -> dict[str, float] | None:
    """Return the meeting point of an isoline's two cusp points as the damping in contact grows.

    The cusp points differ by a root of the damping's distance from the meeting. Their mean and the damping are
    therefore smooth in the square of the difference, and are extrapolated to zero difference.
    """
    pairs = {}
    for isoline in isolines:
        places = [_place(point) for point in isoline.special_points.of_type("CP")]
        if "D_att_1" in isoline.names and len(places) == 2:
            pairs[isoline.parameters["D_rep_1"]] = [list(place.values()) for place in places]
    if len(pairs) < _FITTED:
        return None
    table = np.array([pairs[value] for value in sorted(pairs)[-_FITTED:]])
    apart = (table[:, 0, 3] - table[:, 1, 3]) ** 2
    limit = np.polyfit(apart / apart.max(), table.mean(axis=1), _FITTED - 1)[-1]
    return dict(zip(("D_att_1", "D_rep_1", "omega", "min_z"), limit.tolist(), strict=True))


def draw(results: Mapping[str, Any]) -> Figure:
    """Return the figure: (a) the isolines, and as an inset (b) the folds."""
    from matplotlib.figure import Figure

    from saltus.plotting import style

    isolines = _isolines(results)
    content = summary(results)
    with style.publication():
        figure = Figure(figsize=(7.2, 5.6), layout="constrained")
        ax = figure.subplots()
        inset = ax.inset_axes((0.075, 0.075, 0.345, 0.43))
        for axes, window in ((ax, _CHART), (inset, _FOLD)):
            _chart(axes, isolines, content, results["response"].parameters)
            axes.set(xlim=window[0], ylim=window[1])
            axes.ticklabel_format(useOffset=False)
        ax.set_title("(a)", loc="left", fontweight="bold")
        inset.set_title("(b)", loc="left", fontweight="bold", fontsize=8.0, pad=2.0)
        inset.set(xticks=(1.0, 1.02, 1.04), yticks=(-0.015, -0.01, -0.005, 0.0))
        ax.set_xlabel(r"drive frequency at the saddle-node  $\bar{\Omega} = \Omega/\omega_1$")
        ax.set_ylabel(r"least gap  $\min\,\bar{z}$  (units of $\eta^*$)")
        inset.tick_params(labelsize=6.5)
        ax.indicate_inset_zoom(inset, edgecolor="0.4", linewidth=0.7)
        _name_isolines(ax, isolines)
        _name_folds(inset, isolines)
        handles, labels = ax.get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=3, handlelength=2.2, columnspacing=2.0)
    return figure


def _chart(ax: Axes, isolines: list[Locus], content: Mapping[str, Any], parameters: Mapping[str, float]) -> None:
    """Draw the isolines, the curves of turning points and of cusp points, and all marks."""
    from saltus.plotting import style

    a0 = gap_at_contact(parameters)
    ax.axhline(a0, color=style.SURFACE, linestyle=":", linewidth=1.1, zorder=1, label=r"contact begins, $\bar{a}_0$")
    labels = {
        ("D_rep_1", False): r"$\mathrm{SN}_1$ at fixed $D_1^{rep}$",
        ("D_att_1", False): r"$\mathrm{SN}_1$ at fixed $D_1^{att}$",
        ("D_rep_1", True): r"saddle-nodes that $\mathrm{SN}_1$ meets",
    }
    for isoline in isolines:
        fixed = _fixed(isoline)
        if fixed == "D_rep_1" and isoline.parameters[fixed] not in FIXED[fixed]:
            continue
        for curve, folded in _curves(isoline):
            label = labels.pop((fixed, folded), "_")
            width, shade = (0.6, 0.65) if folded else (1.0, 1.0)
            ax.plot(*curve, color=_COLOURS[fixed], linewidth=width, alpha=shade, label=label, zorder=2)
    turning, cusps = content["turning_points"], content["cusps"]
    ax.plot(*_through(turning), color=_TURNING, linewidth=1.6, linestyle=(0, (4.0, 1.3)), zorder=3,
            label=r"$\bar{\Omega}$ turns at fixed $D_1^{att}$")  # fmt: skip
    ax.plot(*_through(cusps), color=_CUSPS, linewidth=1.6, linestyle=(0, (1.2, 0.9)), zorder=3,
            label=r"CP, cusp points at fixed $D_1^{rep}$")  # fmt: skip
    if content["cusp"] is not None:
        marker = style.SPECIAL["CP"]
        ax.plot(content["cusp"]["omega"], content["cusp"]["min_z"], zorder=6, label="where the cusp points meet",
                **marker.options())  # fmt: skip
    mark = content["reference"]
    ax.plot(mark["omega"], mark["min_z"], linestyle="none", marker="o", markersize=6.0, zorder=6,
            markerfacecolor=style.SPECIAL["SN"].colour, markeredgecolor="white", markeredgewidth=0.6,
            label=f"$D_1^{{rep}} = {REFERENCE['D_rep_1']:g}$, $D_1^{{att}} = {REFERENCE['D_att_1']:g}$")  # fmt: skip


def _fixed(isoline: Locus) -> str:
    return "D_att_1" if "D_rep_1" in isoline.names else "D_rep_1"


def _curves(isoline: Locus) -> list[tuple[NDArray[np.float64], bool]]:
    """Return the isoline as smooth curves of shape (2, vertex), and whether each lies beyond SN1's edge."""
    from saltus.plotting.space import stretches_of

    low, high = _first_sheet(isoline)
    found = []
    for stretch in stretches_of(isoline, ["Omega", "min_z", "arclength"]):
        s = stretch.places[2]
        for mask, folded in (((s >= low) & (s <= high), False), (s >= high, True), (s <= low, True)):
            if np.count_nonzero(mask) > 1:
                found.append((stretch.places[:2, mask], folded))
    return found


def _through(places: list[dict[str, float]]) -> NDArray[np.float64]:
    """Return a smooth curve of shape (2, vertex) through places in order, parametrised by the chords on the chart."""
    from scipy.interpolate import Akima1DInterpolator

    table = np.array([[place["omega"], place["min_z"]] for place in places]).reshape(-1, 2)
    if len(table) < 3:
        return table.T
    sizes = np.ptp(_FOLD, axis=1)
    s = np.append(0.0, np.cumsum(np.hypot(*(np.diff(table, axis=0) / sizes).T)))
    return np.asarray(Akima1DInterpolator(s, table, method="makima")(np.linspace(0.0, s[-1], 40 * len(s)))).T


def _name_isolines(ax: Axes, isolines: list[Locus]) -> None:
    """Write the fixed dampings at the isolines' ends: in contact on the right, in air on top."""
    right, top = BOUNDS["Omega"][1], BOUNDS["D_rep_1"][1]
    bundle = [v for v in FIXED["D_rep_1"] if v < _LABELLED]
    for isoline in isolines:
        fixed = _fixed(isoline)
        value = isoline.parameters[fixed]
        omega, depth = isoline.column("Omega"), isoline.column("min_z")
        if fixed == "D_rep_1" and value in FIXED[fixed]:
            row = int(np.argmax(omega))
            if omega[row] < right - _ROUNDING or value in (bundle[0], bundle[-1]):
                text = f"$D_1^{{rep}} = {value:g}$" if value == REFERENCE[fixed] else f"{value:g}"
                _write(ax, text, (omega[row], depth[row]), (4.0, -2.5), fixed)
        elif value in FIXED[fixed]:
            row = int(np.argmax(isoline.column("D_rep_1")))
            text = f"$D_1^{{att}} = {value:g}$" if value == FIXED[fixed][0] else f"{value:g}"
            if isoline.column("D_rep_1")[row] > top - _ROUNDING:
                _write(ax, text, (omega[row], depth[row]), (0.0, 3.0), fixed, rotation=60.0)


def _name_folds(ax: Axes, isolines: list[Locus]) -> None:
    """Write the fixed damping in contact where an isoline reaches its cusp point."""
    for isoline in isolines:
        if _fixed(isoline) == "D_rep_1" and isoline.parameters["D_rep_1"] in FIXED["D_rep_1"]:
            for point in isoline.special_points.of_type("CP")[:1]:
                place = (point.parameters["Omega"], point.orbit.min["z"])
                _write(ax, f"{isoline.parameters['D_rep_1']:g}", place, (-4.0, -9.0), "D_rep_1", ha="right")


def _write(
    ax: Axes, text: str, place: tuple[float, float], offset: tuple[float, float], fixed: str, **options: Any
) -> None:
    """Write a damping beside a point, in its isolines' colour, with a white rim."""
    from matplotlib.patheffects import withStroke

    note = ax.annotate(
        text, place, offset, textcoords="offset points", fontsize=6.0, color=_COLOURS[fixed], zorder=7, **options
    )
    note.set_path_effects([withStroke(linewidth=1.6, foreground="white")])
