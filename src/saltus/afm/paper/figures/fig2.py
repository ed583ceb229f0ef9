"""Fig. 2: two orbits of period one in the phase space, two modes: one that hits the sample, one close to grazing.

The data file has the groups ``impacting`` and ``non_impacting`` (each a `PeriodicOrbit`) and ``response`` (a `Branch`
from the second orbit to its grazing). `read_results` reads it.

References
----------
ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Fig. 2, section 3 and Eqs. (12)-(18). Where two orbits
without contact exist, as at the paper's ``Omega = 0.916``, the stable one is drawn. Panel (b) is added here: contact
takes up a fiftieth of the height of panel (a).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.afm.paper.figures.files import write_figure
from saltus.afm.paper.figures.responses import gap_at_contact, response
from saltus.afm.paper.figures.telling import tell
from saltus.progress import Report

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from numpy.typing import NDArray

    from saltus.continuation import Branch, SpecialPoint
    from saltus.orbits import PeriodicOrbit
    from saltus.result import Result

__all__ = ["Segment", "compute", "draw", "run", "segments_of", "summary"]

IMPACTING = 0.98  # Omega of the orbit in contact, in omega_1
NON_IMPACTING = 0.916  # Omega of the orbit without contact, in omega_1

_BOUNDS = (0.9, 0.92)  # interval of Omega in which the orbit without contact is continued to its grazing

# Colours of the segments, distinguishable by the colour-blind.
_COLOURS = {"I1": "#0072b2", "I2": "#009e73", "I3": "#d55e00"}

# Entries of the legend, by segment.
_MEANINGS = {
    "I1": rf"$\bar{{\Omega}} = {IMPACTING}$, $I_1$: no contact, to the phase reset",
    "I2": rf"$\bar{{\Omega}} = {IMPACTING}$, $I_2$: no contact, to the touch",
    "I3": rf"$\bar{{\Omega}} = {IMPACTING}$, $I_3$: contact, to the release",
}

_SPACE = ((-1.45, 1.45), (-0.1, 2.2))  # window of panel (a): velocity, then gap
_ZOOM = ((-0.8, 0.6), (-0.05, 0.04))  # window of panel (b): velocity, then gap

# Places of the segments' names in panel (a): share of the segment's time, and offset from there.
_NAMED_IN_SPACE = {"I1": (0.32, (0.0, 0.0, -0.24)), "I2": (0.5, (-0.25, 0.0, -0.12)), "I3": (0.5, (0.0, 0.0, -0.27))}

# Places of the segments' names in panel (b): velocity, then gap.
_NAMED_IN_PLANE = {"I1": (0.3, 0.022), "I2": (-0.63, 0.022), "I3": (0.36, -0.022)}

# Events named in panel (b), and the offset of the name, in points.
_EVENTS = {"touch": (-14.0, 4.0), "release": (18.0, 4.0)}

_VIEW: Mapping[str, Any] = {"elev": 20.0, "azim": -60.0}  # angles of panel (a), in degrees

_POINTS = 2000  # times a period at which an orbit is drawn
_FEWEST = 200  # times in a segment, at least

_NAMES = ("impacting", "non_impacting")  # the two results


def run(out: Path, progress: bool | Report = False) -> dict[str, Any]:
    """Compute, draw and write the figure, and return the files and results, as `write_figure` does.

    Parameters
    ----------
    out : Path
        An existing folder, for ``fig2.nc``, ``fig2.json`` (`summary`), ``fig2.png`` and ``fig2.pdf``.
    progress : bool or callable
        True for bars on stderr, or a function called with a `saltus.Progress`.
    """
    return write_figure(out, "fig2", compute, summary, draw, progress)


def compute(progress: bool | Report = False) -> Iterator[tuple[str, Result]]:
    """Go through the results of Fig. 2, with their names, each computed on demand."""
    from saltus.afm.paper.regimes import settled_orbit
    from saltus.afm.paper.table1 import table1
    from saltus.afm.paper.tapping import tapping_mode

    tell(progress, "preparing the model")
    model = tapping_mode(table1(), modes=2)
    tell(progress, f"orbit in contact, Omega = {IMPACTING}")
    yield "impacting", settled_orbit(model, {"Omega": IMPACTING}, "repulsive")
    tell(progress, f"orbit without contact, Omega = {NON_IMPACTING}")
    near = settled_orbit(model, {"Omega": NON_IMPACTING}, "attractive")
    yield "non_impacting", near
    yield "response", response(near, _BOUNDS, progress=progress)


class Segment(NamedTuple):
    """A smooth piece of an orbit of period one, cut at the phase reset too.

    Attributes
    ----------
    name : str
        Name in the paper: I1 ends with the phase reset, I2 with the touch, I3 is the contact.
    mode, ends : str
        Hybrid mode of the segment, and the transition or the phase at its end.
    start : ndarray, shape (all states,)
        Full state at the start, phase last.
    duration : float, in 1/omega_1
        Duration of the segment.
    curve : ndarray, shape (3, time)
        Phase, velocity z' and gap z, in units of ``1 / omega_1`` and `eta`.
    """

    name: str
    mode: str
    ends: str
    start: NDArray[np.float64]
    duration: float
    curve: NDArray[np.float64]


def segments_of(orbit: PeriodicOrbit) -> list[Segment]:
    """Return the segments of an orbit of period one in the order of the paper's names: I1 to I3, or I1 alone."""
    from saltus.flow import simulate

    motion = simulate(orbit.system, orbit.parameters, orbit.x0, periods=1)
    found: list[Segment] = []
    begin, start = 0.0, motion(0.0)
    for event in motion.events:
        end = float(event["time"])
        t = np.linspace(begin, end, max(_FEWEST, math.ceil(_POINTS * (end - begin) / motion.t_end)))
        t[-1] = np.nextafter(end, begin)  # at the end itself the phase is reset
        curve = np.array([motion(t)[:, -1], motion.output("v", t), motion.output("z", t)])
        found.append(Segment("", str(event["mode_before"]), str(event["name"]), start, end - begin, curve))
        begin, start = end, event["after"]
    return [segment._replace(name=f"I{i}") for i, segment in enumerate([found[-1], *found[:-1]], start=1)]


def summary(results: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of ``fig2.json``.

    Each orbit has ``omega``, ``period``, ``min_z``, ``signature``, ``x0``, ``multipliers`` and ``segments``.
    ``above_contact`` is the least gap less the gap at which contact begins; it is negative for a tip that touches. A
    segment has its name in the paper, mode, duration, and state at the start (phase last). ``grazing`` is the grazing
    of the orbit without contact as `Omega` varies.
    """
    content: dict[str, Any] = {"figure": "fig2", "parameters": {}}
    for name in _NAMES:
        if name in results:
            content["parameters"] = dict(results[name].parameters) | {"Omega": [IMPACTING, NON_IMPACTING]}
            content[name] = _told(results[name])
    if "response" in results and (point := _grazing(results["response"])) is not None:
        content["grazing"] = {"omega": point.parameters["Omega"], "min_z": point.orbit.min["z"]}
    return content


def _told(orbit: PeriodicOrbit) -> dict[str, Any]:
    return {
        "omega": orbit.parameters["Omega"],
        "period": orbit.period,
        "min_z": orbit.min["z"],
        "above_contact": orbit.min["z"] - gap_at_contact(orbit.parameters),
        "signature": [list(pair) for pair in orbit.signature],
        "x0": orbit.x0.tolist(),
        "multipliers": [[float(mu.real), float(mu.imag)] for mu in orbit.multipliers],
        "segments": [
            {"name": s.name, "mode": s.mode, "ends": s.ends, "duration": s.duration, "start": s.start.tolist()}
            for s in segments_of(orbit)
        ],
    }


def _grazing(branch: Branch) -> SpecialPoint | None:
    """Return the grazing of the orbits without contact; None if the branch ends before it."""
    return next(iter(branch.special_points.of_type("GR")), None)


def draw(results: Mapping[str, Any]) -> Figure:
    """Return the figure: (a) both orbits over phase, velocity and gap, with the surface of contact; (b) its side."""
    from matplotlib.figure import Figure

    from saltus.plotting import style
    from saltus.plotting.space import draw_level

    orbits = {name: segments_of(results[name]) for name in _NAMES}
    a0 = gap_at_contact(results["impacting"].parameters)
    with style.publication():
        figure = Figure(figsize=(7.2, 4.0))
        space: Any = figure.add_axes((-0.03, 0.13, 0.64, 0.87), projection="3d", computed_zorder=False, **_VIEW)
        space.set(xlim=(0.0, 2.0 * math.pi), ylim=_SPACE[0], zlim=_SPACE[1])
        space.set_box_aspect((1.4, 1.0, 0.95), zoom=1.03)
        plane = figure.add_axes((0.725, 0.25, 0.26, 0.66))
        plane.axhline(a0, color=style.PLANE["edgecolor"], linewidth=0.8, zorder=1)
        for name, segments in orbits.items():
            for segment in segments:
                line = _line(name, segment)
                space.plot(*segment.curve, zorder=1 if segment.mode == "contact" else 3, **line)
                plane.plot(*segment.curve[1:], zorder=3, **line)
        _mark_space(space, orbits)
        _mark_plane(plane, orbits, a0)
        for place, letter in ((0.02, "(a)"), (0.64, "(b)")):
            figure.text(place, 0.94, letter, fontsize=9.0, fontweight="bold")
        draw_level(space, a0, label=r"$\Sigma$, contact begins: $\bar{z} = \bar{a}_0$", zorder=2)
        handles, labels = space.get_legend_handles_labels()
        figure.legend(handles, labels, loc="lower center", ncols=3, handlelength=2.2, columnspacing=2.0)
    return figure


def _line(name: str, segment: Segment) -> dict[str, Any]:
    """Return how a segment is drawn: solid in its colour, or dashed where the orbit has no contact."""
    from saltus.plotting import style

    if name == "non_impacting":
        return {
            "color": style.CURVE,
            "linestyle": (0, (4.0, 1.6)),
            "linewidth": 1.0,
            "label": rf"$\bar{{\Omega}} = {NON_IMPACTING}$: no contact, close to grazing",
        }
    return {"color": _COLOURS[segment.name], "linewidth": 1.6, "label": _MEANINGS[segment.name]}


def _mark_space(ax: Any, orbits: Mapping[str, list[Segment]]) -> None:
    """Join both sides of the phase resets, mark the events, name the segments, and describe the axes."""
    for name, segments in orbits.items():
        _, velocity, gap = segments[0].curve[:, -1]
        reset: dict[str, Any] = {"linestyle": ":", "color": "0.5", "linewidth": 0.8}
        reset["label"] = "phase reset" if name == "impacting" else "_"
        ax.plot((0.0, 2.0 * math.pi), (velocity,) * 2, (gap,) * 2, zorder=2.5, **reset)
    for segment in orbits["impacting"]:
        ax.plot(*segment.curve[:, -1:], "o", color="black", markersize=3.0, zorder=5)
        along, offset = _NAMED_IN_SPACE[segment.name]
        place = segment.curve[:, int(along * segment.curve.shape[1])] + offset
        ax.text(*place, f"$I_{segment.name[1]}$", color=_COLOURS[segment.name], fontsize=10.0, ha="center", zorder=6)
    ax.set_xlabel(r"phase  $x_5 = \bar{\Omega}\tau$ mod $2\pi$", labelpad=-1.0)
    ax.set_ylabel(r"velocity  $\bar{z}'$", labelpad=-2.0)
    ax.set_zlabel(r"gap  $\bar{z}$  (units of $\eta^*$)", labelpad=-1.0)
    ax.tick_params(pad=0.0)
    ax.set_xticks([0.0, 0.5 * math.pi, math.pi, 1.5 * math.pi, 2.0 * math.pi])
    ax.set_xticklabels(["0", r"$\pi/2$", r"$\pi$", r"$3\pi/2$", r"$2\pi$"])
    ax.set_yticks([-1.0, 0.0, 1.0])


def _mark_plane(ax: Axes, orbits: Mapping[str, list[Segment]], a0: float) -> None:
    """Mark the events on the surface, name it and the segments, and describe the axes."""
    from saltus.plotting import style

    for segment in orbits["impacting"]:
        if segment.ends in _EVENTS:
            _, velocity, gap = segment.curve[:, -1].tolist()
            ax.plot(velocity, gap, "o", color="black", markersize=3.0, zorder=4)
            ax.annotate(
                segment.ends,
                (velocity, gap),
                _EVENTS[segment.ends],
                textcoords="offset points",
                ha="center",
                fontsize=7.0,
            )
        ax.text(*_NAMED_IN_PLANE[segment.name], f"$I_{segment.name[1]}$", color=_COLOURS[segment.name], fontsize=10.0)
    ax.text(-0.05, a0 + 0.0012, r"$\Sigma$", color=style.PLANE["edgecolor"], fontsize=9.0)
    ax.set(xlim=_ZOOM[0], ylim=_ZOOM[1])
    ax.set_xlabel(r"velocity  $\bar{z}'$  (units of $\omega_1\eta^*$)")
    ax.set_ylabel(r"gap  $\bar{z}$  (units of $\eta^*$)")
