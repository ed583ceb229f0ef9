"""Fig. 9: the basin of the repulsive motion with one mode and with two, in the plane of the first mode.

The group ``fig9.zarr`` holds the stores ``one_mode`` and ``two_modes``, which `saltus.load` opens. The orbits of their
attractors are in ``fig9.nc``, which `read_results` reads.

References
----------
ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Fig. 9 and section 4.2. Panel (a) is the paper's: light
red below, dark above. Cells of two modes alone are grey here, black in the paper. Panels (b) and (c) are added, since
the upper basin hides most of the other one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.afm.paper.figures.sections import (
    LABELS,
    MARKS,
    PARAMETERS,
    RANGE,
    RESOLUTION,
    attractors_of,
    group,
    mapped,
    model,
    summary_of,
    write_sections,
)
from saltus.afm.paper.figures.telling import tell
from saltus.progress import Report

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from saltus.basins import Basins

__all__ = ["SECOND", "compute", "draw", "run", "summary"]

# The second mode's state in the plane: that of the paper's repulsive attractor at phase 0.
SECOND: Mapping[str, float] = MappingProxyType({"q2": -0.028993, "v2": 0.485640})

# Colours of cells, by the numbers of modes with which they belong to the repulsive basin.
_BOTH = "#161616"  # with one and with two
_ONE = "#f0857a"  # with one
_TWO = "#8a8a8a"  # with two
_NEITHER = "#ffffff"  # with neither

_UNCERTAIN = "#aa3377"  # cells without a label with either number of modes, or divergent

# Marks of the attractors in panel (a) and their sizes in points.
_MARKERS = {"one_mode": ("s", 7.5), "two_modes": ("o", 4.0)}

_TITLES = {"one_mode": "one mode", "two_modes": "two modes"}  # legend of the marks


def run(out: Path, progress: bool | Report = False, *, resolution: int = RESOLUTION) -> dict[str, Any]:
    """Compute, draw and write the figure, and return the files and results, as `write_figure` does.

    Parameters
    ----------
    out : Path
        An existing folder, for ``fig9.zarr``, ``fig9.nc``, ``fig9.json`` (`summary`), ``fig9.png`` and ``fig9.pdf``. If
        ``fig9.zarr`` exists, the run resumes from it.
    progress, resolution
        As for `write_sections`, also for errors raised.
    """
    return write_sections(out, "fig9", compute, summary, draw, resolution=resolution, progress=progress)


def compute(store: Path, resolution: int = RESOLUTION, progress: bool | Report = False) -> Iterator[tuple[str, Basins]]:
    """Go through the basins with one mode and with two, with their names, each computed on demand."""
    axis = (*RANGE, resolution)
    planes: dict[str, tuple[int, dict[str, Any]]] = {
        "one_mode": (1, {"q1": axis, "v1": axis}),
        "two_modes": (2, {"q1": axis, "v1": axis, **SECOND}),
    }
    for name, (modes, grid) in planes.items():
        tell(progress, "preparing the model")
        system, place = model(modes), group(store) / name
        yield name, mapped(system, grid, attractors_of(system, place, progress), place, progress, _TITLES[name])


def summary(basins: Mapping[str, Basins]) -> dict[str, Any]:
    """Return the content of ``fig9.json``.

    ``one_mode`` and ``two_modes`` are as `summary_of` has them. ``agreement`` is the share of the cells whose labels
    have the same name with one mode and with two.
    """
    content: dict[str, Any] = {"figure": "fig9", "parameters": dict(PARAMETERS)}
    content |= {name: summary_of(section) for name, section in basins.items()}
    if len(basins) == len(_TITLES):
        one, two = (_repulsive(basins[name]) for name in _TITLES)
        content["agreement"] = float((one == two).mean())
    return content


def _repulsive(basins: Basins) -> Any:
    """Return which cells belong to the repulsive basin, a row for each velocity."""
    labels = np.asarray(basins.labels[...]).T
    return labels == basins.attractors.labels["repulsive"]


def draw(basins: Mapping[str, Basins]) -> Figure:
    """Return the figure: (a) both basins of the repulsive motion, (b) with one mode, (c) with two."""
    from matplotlib.figure import Figure

    from saltus.plotting import style
    from saltus.plotting.basin import percent

    with style.publication():
        figure = Figure(figsize=(7.2, 4.95), layout="constrained")
        axes = figure.subplot_mosaic([["a", "b"], ["a", "c"]], width_ratios=(2.08, 1.0))
        _draw_both(axes["a"], basins)
        for letter, name, colour in (("b", "one_mode", _ONE), ("c", "two_modes", _BOTH)):
            ax, section = axes[letter], basins[name]
            section.plot(ax=ax, legend=False, colours={"repulsive": colour, "attractive": _NEITHER}, marks=MARKS)
            for line in ax.lines:
                line.set_marker(_MARKERS[name][0])
            part = percent(section.fractions()["repulsive"])
            ax.set_title(f"{_TITLES[name]}: {part}", loc="right")
        for letter, ax in axes.items():
            ax.set_title(f"({letter})", loc="left", fontweight="bold")
            ax.set(
                xlabel=LABELS["q1"], ylabel=LABELS["v1"], aspect="equal", xticks=range(-4, 5, 2), yticks=range(-4, 5, 2)
            )
        _draw_legend(figure, axes["a"], basins)
    return figure


def _draw_both(ax: Axes, basins: Mapping[str, Basins]) -> None:
    from matplotlib.colors import to_rgb

    one, two = (_repulsive(basins[name]) for name in _TITLES)
    colours = np.array([to_rgb(colour) for colour in (_NEITHER, _ONE, _TWO, _BOTH)])
    image = colours[one + 2 * two]
    image[_uncertain(basins)] = to_rgb(_UNCERTAIN)
    ax.imshow(image, extent=(*RANGE, *RANGE), origin="lower", interpolation="nearest")
    ax.set_title("basins of the repulsive motion", loc="right")


def _uncertain(basins: Mapping[str, Basins]) -> Any:
    """Return which cells have no attractor with one mode or with two, a row for each velocity."""
    lost = [
        ~np.isin(np.asarray(b.labels[...]).T, [b.attractors.labels[n] for n in b.attractors.names])
        for b in basins.values()
    ]
    return np.logical_or(*lost)


def _draw_legend(figure: Figure, ax: Axes, basins: Mapping[str, Basins]) -> None:
    """Mark the attractors in panel (a), and name marks and colours below all panels."""
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    from saltus.plotting import style
    from saltus.plotting.basin import places_of

    areas = {"both": _BOTH, "two modes alone": _TWO, "one mode alone": _ONE, "neither": _NEITHER}
    if _uncertain(basins).any():
        areas["no attractor found"] = _UNCERTAIN
    handles: list[Any] = [
        Patch(facecolor=colour, edgecolor="0.4", linewidth=0.4, label=name) for name, colour in areas.items()
    ]
    for name, (marker, size) in _MARKERS.items():
        for regime, colour in MARKS.items():
            options: dict[str, Any] = {
                "linestyle": "none", "marker": marker, "markersize": size, "markeredgecolor": "white",
                "markerfacecolor": colour, "markeredgewidth": 1.1, "zorder": 5,
            }  # fmt: skip
            ax.plot(*places_of(basins[name], regime)[0].T, **options)
            handles.append(Line2D([], [], label=f"{regime} orbit, {_TITLES[name]}", **options | {"markersize": 6.0}))
    frozen = style.values_of(basins["two_modes"].grid.fixed, LABELS) if "two_modes" in basins else ""
    figure.legend(
        handles=handles, loc="outside lower center", ncols=4, columnspacing=1.6, handletextpad=0.5,
        title=f"two modes at {frozen}" if frozen else None, title_fontsize="medium",
    )  # fmt: skip
