"""Fig. 8: the basin of the repulsive motion with two modes, in the space of q1, q1' and q2.

The labels are in the store ``fig8.zarr``, which `saltus.load` opens. The attractors' orbits are in ``fig8.nc``, which
`read_results` reads.

References
----------
ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Fig. 8 and section 4.2. The basin fills nine tenths of
the box. Panel (a) is the paper's body, cut off at the highlighted section, which the paper shows above the box. Panel
(b) is added: the basin of the attractive motion, as a body in the whole box.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

from saltus.afm.paper.figures.sections import (
    LABELS,
    PARAMETERS,
    RANGE,
    RESOLUTION,
    attractors_of,
    mapped,
    model,
    summary_of,
    write_sections,
)
from saltus.afm.paper.figures.telling import tell
from saltus.progress import Report, Reporter

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.figure import Figure

    from saltus.basins import Basins

__all__ = ["V2", "compute", "draw", "film", "run", "summary"]

V2 = 0.485640  # second mode's velocity: that of the paper's repulsive attractor at phase 0

_REPULSIVE = "#d1495b"  # colour of the repulsive basin
_ATTRACTIVE = "#77aadd"  # colour of the attractive basin: blue, as in the paper

# Colours of the attractors, which stand out against both basins.
_BALLS: Mapping[str, str] = MappingProxyType({"repulsive": "#5a0a18", "attractive": "#1450a3"})

_TURNS = 72  # frames of the film in a whole turn
_RATE = 10  # frames a second
_START = -58.0  # azimuth of the first frame, in degrees
_DPI = 100.0  # pixels an inch


def run(
    out: Path,
    progress: bool | Report = False,
    *,
    resolution: int = RESOLUTION,
    animate: bool = False,
) -> dict[str, Any]:
    """Compute, draw and write the figure, and return the files and results, as `write_figure` does.

    Parameters
    ----------
    out : Path
        An existing folder, for ``fig8.zarr``, ``fig8.nc``, ``fig8.json`` (`summary`), ``fig8.png`` and ``fig8.pdf``. If
        ``fig8.zarr`` exists, the run resumes from it.
    progress : bool or callable
        True for bars on stderr, or a function called with a `saltus.Progress`.
    resolution : int, optional
        Cells along each axis.
    animate : bool, optional
        Whether ``fig8.gif`` is written too, in which the box turns once.

    Raises
    ------
    InputError
        The resolution is no whole number of 2 or more, or an existing store has another resolution.
    SaltusError
        PyVista is not installed, or has nothing to render with.
    """
    from saltus.plotting.volume import check_renderer

    check_renderer()
    written = write_sections(out, "fig8", compute, summary, draw, resolution=resolution, progress=progress)
    if animate and not written["interrupted"]:
        try:
            written["files"].append(film(written["results"]["basins"], out / "fig8.gif", progress))
        except KeyboardInterrupt:
            written["interrupted"] = True
    return written


def compute(store: Path, resolution: int = RESOLUTION, progress: bool | Report = False) -> Iterator[tuple[str, Basins]]:
    """Yield the one result, ``basins``."""
    tell(progress, "preparing the model")
    system, axis = model(2), (*RANGE, resolution)
    grid = {"q1": axis, "v1": axis, "q2": axis, "v2": V2}
    yield "basins", mapped(system, grid, attractors_of(system, store, progress), store, progress, "labels")


def summary(basins: Mapping[str, Basins]) -> dict[str, Any]:
    """Return the content of ``fig8.json``.

    The entries are those of `summary_of`. ``section`` is the highlighted section, at the cells nearest to the repulsive
    attractor: its ``q2``, and the shares of its cells by label.
    """
    found = basins["basins"]
    section = found.section(q2=_height(found))
    told = {"q2": section.grid.fixed["q2"], "fractions": section.fractions()}
    return {"figure": "fig8", "parameters": dict(PARAMETERS), **summary_of(found), "section": told}


def _height(basins: Basins) -> float:
    """Return the repulsive attractor's q2 at phase 0."""
    return float(basins.attractors.points["repulsive"][0][basins.grid.states.index("q2")])


def draw(basins: Mapping[str, Basins]) -> Figure:
    """Return the figure: (a) the repulsive basin below the highlighted section, (b) the attractive basin."""
    figure, show = _stage(basins["basins"], pixels=1400)
    show(_START)
    return figure


def film(basins: Basins, path: Path, progress: bool | Report = False) -> Path:
    """Write the film in which the box turns once, and return its path."""
    from saltus.plotting.movies import write_movie

    figure, show = _stage(basins, pixels=520, turning=True)
    frames = [partial(show, _START + 360.0 * i / _TURNS) for i in range(_TURNS)]
    with Reporter(progress, len(frames)) as reporter:
        write_movie(figure, path, frames, fps=_RATE, dpi=_DPI, reporter=reporter)
    return path


def _stage(basins: Basins, pixels: int, *, turning: bool = False) -> tuple[Figure, Callable[[float], None]]:
    """Return the figure without bodies, and a function that draws them as seen from an azimuth."""
    from matplotlib.figure import Figure
    from matplotlib.layout_engine import ConstrainedLayoutEngine

    from saltus.plotting import style
    from saltus.plotting.basin import percent
    from saltus.plotting.volume import Volume

    repulsive = Volume(
        basins, "repulsive", cut=("q2", _height(basins)), marks=_BALLS,
        colours={"repulsive": _REPULSIVE, "attractive": "white"},
    )  # fmt: skip
    attractive = Volume(basins, "attractive", hollow=True, colours={"attractive": _ATTRACTIVE}, marks=_BALLS)
    parts = basins.fractions()
    with style.publication():
        figure = Figure(figsize=(7.2, 4.0), layout=ConstrainedLayoutEngine(h_pad=0.08))
        axes = figure.subplots(1, 2)
        _draw_legend(figure, basins)

    def show(azimuth: float) -> None:
        with style.publication():
            for ax, volume, letter in zip(axes, (repulsive, attractive), "ab", strict=True):
                volume.draw(ax, azimuth=azimuth, pixels=pixels, turning=turning, names=LABELS)
                ax.set_title(f"({letter})", loc="left", fontweight="bold")
                ax.set_title(f"{volume.name} basin: {percent(parts[volume.name])} of the box", loc="center")

    return figure, show


def _draw_legend(figure: Figure, basins: Basins) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    from saltus.plotting import style

    height = basins.section(q2=_height(basins)).grid.fixed["q2"]
    handles: list[Any] = [
        Patch(
            facecolor=_REPULSIVE,
            edgecolor="0.4",
            linewidth=0.4,
            label=f"repulsive, cut at {style.values_of({'q2': round(height, 3)}, LABELS)}",
        ),
        Patch(facecolor=_ATTRACTIVE, edgecolor="0.4", linewidth=0.4, label="attractive, empty in (a)"),
    ]
    for name, colour in _BALLS.items():
        mark: dict[str, Any] = {"linestyle": "none", "marker": "o", "markersize": 5.5, "color": colour}
        handles.append(Line2D([], [], label=f"{name} orbit", **mark))
    figure.legend(
        handles=handles, loc="outside lower center", ncols=4, columnspacing=1.8, handletextpad=0.5,
        title=f"at {style.values_of(basins.grid.fixed, LABELS)}; orbits projected", title_fontsize="medium",
    )  # fmt: skip
