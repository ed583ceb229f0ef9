"""Fig. 10: six sections of the basins with two modes, as the second mode's displacement grows.

The group ``fig10.zarr`` holds a store for each section, ``q2=-4.39`` and so on, which `saltus.load` opens. The
attractors' orbits are in ``fig10.nc``, which `read_results` reads.

References
----------
ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Fig. 10 and section 4.2.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any

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

__all__ = ["SECTIONS", "V2", "compute", "draw", "run", "summary"]

SECTIONS = (-4.39, -2.89, -1.39, 0.11, 1.61, 3.12)  # values of q2 of the sections

V2 = 0.485640  # second mode's velocity in all sections: that of the paper's repulsive attractor at phase 0

_COLOURS = {"repulsive": "#161616", "attractive": "#ffffff"}  # of the basins


def run(out: Path, progress: bool | Report = False, *, resolution: int = RESOLUTION) -> dict[str, Any]:
    """Compute, draw and write the figure, and return the files and results, as `write_figure` does.

    Parameters
    ----------
    out : Path
        An existing folder, for ``fig10.zarr``, ``fig10.nc``, ``fig10.json`` (`summary`), ``fig10.png`` and
        ``fig10.pdf``. If ``fig10.zarr`` exists, the run resumes from it.
    progress, resolution
        As for `write_sections`, also for errors raised.
    """
    return write_sections(out, "fig10", compute, summary, draw, resolution=resolution, progress=progress)


def compute(store: Path, resolution: int = RESOLUTION, progress: bool | Report = False) -> Iterator[tuple[str, Basins]]:
    """Go through the sections, with their names, each computed on demand."""
    tell(progress, "preparing the model")
    system, axis, attractors = model(2), (*RANGE, resolution), None
    for q2 in SECTIONS:
        name = f"q2={q2}"
        place = group(store) / name
        if attractors is None or place.exists():
            attractors = attractors_of(system, place, progress)
        grid = {"q1": axis, "v1": axis, "q2": q2, "v2": V2}
        yield name, mapped(system, grid, attractors, place, progress, f"q2 = {q2}")


def summary(basins: Mapping[str, Basins]) -> dict[str, Any]:
    """Return the content of ``fig10.json``.

    ``sections`` are as `summary_of` has them, each with its ``q2``. ``repulsive`` has the repulsive basin's share of
    the cells, by ``q2``. ``attractors`` and ``traps`` are common to all sections. ``undecided`` is the sum over all
    sections, ``orbits_per_second`` the mean rate.
    """
    content: dict[str, Any] = {"figure": "fig10", "parameters": dict(PARAMETERS), "sections": [], "repulsive": {}}
    cells, seconds = 0, 0.0
    for section in basins.values():
        told = summary_of(section)
        content |= {"attractors": told.pop("attractors"), "traps": told.pop("traps")}
        q2 = section.grid.fixed["q2"]
        content["sections"].append({"q2": q2, **told})
        content["repulsive"][f"{q2:g}"] = told["fractions"]["repulsive"]
        if told["orbits_per_second"]:
            cells, seconds = cells + section.grid.size, seconds + section.grid.size / told["orbits_per_second"]
    content["undecided"] = sum(told["undecided"] for told in content["sections"])
    content["orbits_per_second"] = cells / seconds if seconds else None
    return content


def draw(basins: Mapping[str, Basins]) -> Figure:
    """Return the figure: a panel for each section, with the repulsive basin's share of the cells."""
    from matplotlib.figure import Figure

    from saltus.plotting import style

    with style.publication():
        figure = Figure(figsize=(7.2, 5.85), layout="constrained")
        panels = figure.subplots(2, 3, sharex=True, sharey=True)
        for letter, ax, section in zip("abcdef", panels.flat, basins.values(), strict=False):
            _draw_section(ax, section, letter)
        for ax in panels[-1]:
            ax.set_xlabel(LABELS["q1"])
        for ax in panels[:, 0]:
            ax.set_ylabel(LABELS["v1"])
        _draw_legend(figure, list(basins.values()))
    return figure


def _draw_section(ax: Axes, section: Basins, letter: str) -> None:
    from saltus.plotting import style
    from saltus.plotting.basin import percent

    section.plot(ax=ax, legend=False, colours=_COLOURS, marks=MARKS)
    part = percent(section.fractions()["repulsive"])
    ax.set_title(f"({letter})", loc="left", fontweight="bold")
    ax.set_title(f"{style.values_of({'q2': section.grid.fixed['q2']}, LABELS)}:  {part}", loc="right")
    ax.set(xlabel="", ylabel="", aspect="equal", xticks=range(-4, 5, 2), yticks=range(-4, 5, 2))


def _draw_legend(figure: Figure, sections: list[Basins]) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    from saltus.plotting import style
    from saltus.plotting.basin import colours_of, mark_of

    parts = [section.fractions() for section in sections]
    named = [name for name in parts[0] if name in _COLOURS or any(part.get(name) for part in parts)]
    colours = colours_of(sections[0], _COLOURS)
    handles: list[Any] = [
        Patch(
            facecolor=colours[name], edgecolor="0.4", linewidth=0.4, label=f"{name} basin" if name in _COLOURS else name
        )
        for name in reversed(named)
    ]
    for regime, colour in MARKS.items():
        handles.append(Line2D([], [], label=f"{regime} orbit, projected", **mark_of(colour, filled=False)))
    everywhere = f"all at {style.values_of({'v2': sections[0].grid.fixed['v2']}, LABELS)}"
    figure.legend(
        handles=handles, loc="outside lower center", ncols=len(handles), columnspacing=2.0, title=everywhere,
        title_fontsize="medium",
    )  # fmt: skip
