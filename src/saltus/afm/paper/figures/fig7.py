"""Fig. 7: the response with two modes, the brute-force diagram beyond period one, and phase portraits.

The data file has the groups ``sweep`` (the `Sweep` of panel (b)), ``portrait (c)`` to ``portrait (e)`` (each a
`Trajectory`), and the groups of `fig7a`. `read_results` reads it.

References
----------
ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Fig. 7 and section 4.2. The paper does not name the
velocity of panel (b); here it is the gap's, ``z'``, at phase 0. Phase portraits show ``z'`` over ``z``, with dots at
phase 0. The leading Lyapunov exponent below panel (b) is added.

Notes
-----
The paper names four motions, at Omega = 1.00, 1.02, 1.023 and 1.046. Labels and portraits belong to the nearest of the
300 values of the sweep, within 1e-4. At 1.023 itself lies a narrow window of the chaotic range: after some thousand
periods the motion locks to period 47.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from functools import partial
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.afm.paper.figures import fig7a
from saltus.afm.paper.figures.files import write_figure
from saltus.afm.paper.figures.telling import about, tell
from saltus.progress import Report

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from saltus.flow import Trajectory
    from saltus.result import Result
    from saltus.sweeps import Sweep

__all__ = ["compute", "draw", "run", "summary", "sweep_of"]

COUNT = 300  # values of Omega in the sweep
DISCARDED = 600  # periods dropped at each value
KEPT = 100  # periods kept at each value

NAMED = ("1.00", "1.02", "1.023", "1.046")  # values of Omega at which the paper names the motion, as it prints them

# Panels with phase portraits: Omega as the paper prints it, and periods shown.
PORTRAITS: Mapping[str, tuple[str, int]] = MappingProxyType({"c": ("1.00", 2), "d": ("1.02", 4), "e": ("1.023", KEPT)})

_START = 0.98  # Omega of the orbit from which the sweep starts: stable, of period one

_VELOCITY = "v"  # quantity of the brute-force diagram

_EXPONENTS = (-0.13, 0.09)  # window of the exponents, which fall below it near a superstable orbit

# Sides of those names above panel (b) that would meet in the middle.
_SIDES: Mapping[str, Any] = MappingProxyType({"1.02": "right", "1.023": "left"})

_FEW = 10  # periods up to which a phase portrait has full lines and dots


def run(out: Path, progress: bool | Report = False) -> dict[str, Any]:
    """Compute, draw and write the figure, and return the files and results, as `write_figure` does.

    Parameters
    ----------
    out : Path
        An existing folder, for ``fig7.nc``, ``fig7.json`` (`summary`), ``fig7.png`` and ``fig7.pdf``.
    progress : bool or callable
        True for bars on stderr, or a function called with a `saltus.Progress`.

    Notes
    -----
    During the run the folder also has ``fig7-sweep.nc``, from which the sweep resumes after an interrupt.
    """
    part = out / "fig7-sweep.nc"
    found = write_figure(out, "fig7", partial(compute, part=part), summary, draw, progress)
    if not found["interrupted"]:
        part.unlink(missing_ok=True)
    return found


def compute(progress: bool | Report = False, part: Path | None = None) -> Iterator[tuple[str, Result]]:
    """Go through the results of Fig. 7, with their names, each computed on demand.

    With `part`, the sweep is saved in this file, and resumes from it.
    """
    sweep = sweep_of(COUNT, progress, part)
    yield "sweep", sweep
    for letter, (omega, periods) in PORTRAITS.items():
        tell(progress, f"phase portrait ({letter})")
        yield f"portrait ({letter})", _portrait(sweep, float(omega), periods)
    yield from fig7a.compute(progress)


def sweep_of(count: int, progress: bool | Report = False, part: Path | None = None) -> Sweep:
    """Return the sweep of panel (b), followed upwards from an orbit of period one, with `count` values.

    With `part`, the sweep is saved in this file, and resumes from it.
    """
    from saltus.afm.paper.regimes import settled_orbit
    from saltus.afm.paper.table1 import table1
    from saltus.afm.paper.tapping import tapping_mode
    from saltus.sweeps import SweepOptions, run_sweep

    tell(progress, "preparing the model")
    model = tapping_mode(table1(), modes=2)
    start = settled_orbit(model, {"Omega": _START}, "repulsive")
    return run_sweep(
        model,
        "Omega",
        np.linspace(*fig7a.SWEPT, count),
        x0=start.x0,
        options=SweepOptions(discard=DISCARDED, keep=KEPT, quantities=[_VELOCITY]),
        path=part,
        progress=about(progress, "sweep"),
    )


def _portrait(sweep: Sweep, omega: float, periods: int) -> Trajectory:
    from saltus.flow import simulate
    from saltus.system.maps import flowing

    found = sweep.at(omega)
    return simulate(flowing(sweep.system), found.parameters, found.state, mode=found.mode, periods=periods)


def summary(results: Mapping[str, Any]) -> dict[str, Any]:
    """Return the content of ``fig7.json``.

    ``labels`` and ``periods`` describe the motions that the paper names, by Omega as it prints it. ``at`` is the
    nearest value of the sweep, from which they come. ``sweep`` has each value in order with its label, its period (0
    for none) and the leading Lyapunov exponent. Exponents are per unit of time, ``1 / omega_1``, and null where the
    motion diverged. ``response`` is the content of ``fig7a.json``.
    """
    sweep: Sweep = results["sweep"]
    content: dict[str, Any] = {
        "figure": "fig7",
        "parameters": dict(sweep.parameters) | {"Omega": list(fig7a.SWEPT)},
        "labels": {},
        "periods": {},
        "at": {},
        "sweep": [
            {
                "omega": omega,
                "label": label,
                "period": period,
                "lyapunov": exponent if math.isfinite(exponent) else None,
            }
            for omega, label, period, exponent in zip(
                sweep.values.tolist(),
                sweep.labels[0].tolist(),
                sweep.periods[0].tolist(),
                sweep.exponents[0, :, 0].tolist(),
                strict=True,
            )
            if label
        ],
    }
    for omega in NAMED:
        nearest = int(np.argmin(np.abs(sweep.values - float(omega))))
        if sweep.labels[0, nearest]:
            content["labels"][omega] = str(sweep.labels[0, nearest])
            content["periods"][omega] = int(sweep.periods[0, nearest])
            content["at"][omega] = float(sweep.values[nearest])
    if "one_mode" in results:
        content["response"] = fig7a.summary(results)
    return content


def draw(results: Mapping[str, Any]) -> Figure:
    """Return the figure: (a) responses, (b) the brute-force diagram with exponents, (c) to (e) phase portraits."""
    from matplotlib.figure import Figure

    from saltus.plotting import style

    with style.publication():
        figure = Figure(figsize=(7.2, 9.2), layout="constrained")
        parts: Any = figure.subfigures(3, 1, height_ratios=(4.5, 3.1, 2.1))
        upper, middle, lower = parts
        _letter(fig7a.draw_into(upper, results), "a")
        points, exponents = middle.subplots(2, 1, sharex=True, height_ratios=(3.4, 1.0))
        _draw_sweep(points, exponents, results["sweep"])
        for ax, (letter, (omega, _)) in zip(lower.subplots(1, 3, sharey=True), PORTRAITS.items(), strict=True):
            _draw_portrait(ax, results[f"portrait ({letter})"])
            _letter(ax, letter, rf"$\bar{{\Omega}} = {omega}$, {_in_words(results['sweep'], omega)}")
            if letter == "c":
                ax.set_ylabel(r"velocity  $\bar{z}'$")
    return figure


def _letter(ax: Axes, letter: str, text: str = "") -> None:
    ax.set_title(f"({letter})", loc="left", fontweight="bold")
    ax.set_title(text, loc="center")


def _in_words(sweep: Sweep, omega: str) -> str:
    """Return the kind of the motion, in words, at a value that the paper names."""
    label = sweep.at(float(omega)).label
    return f"period {label.removeprefix('period-')}" if label.startswith("period-") else label


def _draw_sweep(points: Axes, exponents: Axes, sweep: Sweep) -> None:
    """Draw the velocity at phase 0, the places of the named motions, and the leading exponent with its error."""
    from saltus.plotting import style

    sweep.plot(_VELOCITY, ax=points)
    points.set(xlabel="", ylabel=r"velocity  $\bar{z}'$ at phase 0")
    points.tick_params(labelbottom=False)
    _letter(points, "b")
    letters = {omega: f"({letter})" for letter, (omega, _) in PORTRAITS.items()}
    for omega in NAMED:
        text = " ".join(filter(None, (letters.get(omega), _in_words(sweep, omega))))
        edge, side = (float(omega), points.get_ylim()[1]), _SIDES.get(omega, "center")
        points.annotate(text, edge, (0.0, 4.0), textcoords="offset points", ha=side, fontsize=7.0)
        points.axvline(float(omega), color=style.SURFACE, linestyle=":", linewidth=0.9, zorder=0)
        exponents.axvline(float(omega), color=style.SURFACE, linestyle=":", linewidth=0.9, zorder=0)
    leading, error = sweep.exponents[0, :, 0], sweep.errors[0, :, 0]
    exponents.axhline(0.0, color="0.6", linewidth=0.7)
    exponents.fill_between(sweep.values, leading - error, leading + error, color="0.8", linewidth=0.0)
    exponents.plot(sweep.values, leading, color=style.CURVE, linewidth=0.7)
    exponents.set_ylabel(r"exponent $\lambda_1$")
    exponents.set_xlabel(r"drive frequency  $\bar{\Omega} = \Omega/\omega_1$")
    exponents.set_ylim(_EXPONENTS)


def _draw_portrait(ax: Axes, motion: Trajectory) -> None:
    """Draw velocity over gap, and dots at phase 0."""
    motion.plot("z", _VELOCITY, ax=ax, legend=False)
    turns = int(np.sum(motion.events["kind"] == "phase"))
    for line in ax.lines:
        line.set(linewidth=1.0 if turns <= _FEW else 0.25, rasterized=turns > _FEW)
    times = motion.t_end * np.arange(turns) / turns
    size = 3.0 if turns <= _FEW else 1.0
    ax.plot(motion.output("z", times), motion.output(_VELOCITY, times), "o", color="black", markersize=size, zorder=4)
    ax.set(xlabel=r"gap  $\bar{z}$", ylabel="")
