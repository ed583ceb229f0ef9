"""Fig. 3: minimum gap between tip and sample against the drive's frequency, one mode, with its special points.

References
----------
ASME J. Comput. Nonlinear Dyn. 18 (2023), doi:10.1115/1.4062228, Fig. 3 and section 4. Departs from it: period
doublings are drawn too, and panels (c) and (d) show the points next to the grazings, within 2e-4 of each other.
"""

from __future__ import annotations

import json
import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from pathlib import Path

    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from saltus.continuation import Branch

__all__ = ["compute", "draw", "run", "summary"]

BOUNDS = (0.8, 1.4)
"""Interval of Omega, in omega_1."""

_START = {"Omega": 1.05}
_GUESS = [
    ("flight", "touch", [-0.717, 0.7335], 2.95),
    ("contact", "release", [0.95, 0.85], 0.375),
    ("flight", "theta", [0.9, -0.4], 2.65),
]
"""An orbit of the repulsive branch at `_START`, roughly."""

_LARGEST_STEP = 0.01
"""Small enough that a picture 1e-3 wide in Omega is smooth to a line's width."""

_Window = tuple[tuple[float, float], tuple[float, float]]

_WHOLE: _Window = (BOUNDS, (-0.13, 0.8))
_RESPONSE: _Window = ((0.88, 1.265), (-0.112, 0.042))
_LEFT: _Window = ((0.91165, 0.91665), (-0.0012, 0.0132))
_RIGHT: _Window = ((1.0803, 1.0831), (-0.0005, 0.0053))
_NEAREST: _Window = ((0.912735, 0.912905), (0.003215, 0.003385))
"""Windows of panels (a) to (d) and of the inset in (c): Omega, then min z."""


def run(out: Path, progress: Callable[[str], None] | None = None) -> dict[str, Any]:
    """Compute and draw the figure, and return what was written.

    Parameters
    ----------
    out : Path
        An existing folder, for ``fig3.nc`` (the branch), ``fig3.json`` (its special points), ``fig3.png`` and
        ``fig3.pdf``.
    progress : callable, optional
        Called with a line of text whenever there is something new to say.

    Returns
    -------
    dict
        ``files`` (paths, in the order written), ``branch`` (a `Branch`), ``special_points`` (as in the JSON file) and
        ``interrupted``: an interrupt (Ctrl-C) ends the work, and what was computed before is in the files.
    """
    say = progress or (lambda _: None)
    branch = compute(say)
    found: dict[str, Any] = {"files": [], "branch": branch, "special_points": [], "interrupted": False}
    found["files"].append(branch.save(out / "fig3.nc"))
    found["interrupted"] = any("interrupted" in reason for reason in branch.stopped)
    try:
        content = summary(branch)
        found["special_points"] = content["special_points"]
        path = out / "fig3.json"
        path.write_text(json.dumps(content, indent=1, allow_nan=False) + "\n", encoding="utf-8")
        found["files"].append(path)
        if found["interrupted"]:
            return found
        say("drawing")
        figure = draw(branch)
        for suffix in ("png", "pdf"):
            path = out / f"fig3.{suffix}"
            figure.savefig(path, dpi=300, metadata={"CreationDate": None} if suffix == "pdf" else None)
            found["files"].append(path)
    except KeyboardInterrupt:
        found["interrupted"] = True
    return found


def compute(say: Callable[[str], None] = lambda _: None) -> Branch:
    """Return the branch of Fig. 3."""
    from saltus.afm.table1 import table1
    from saltus.afm.tapping import tapping_mode
    from saltus.continuation import StepControl, continue_orbit
    from saltus.orbits import solve_orbit

    say("preparing the model")
    model = tapping_mode(table1(), modes=1)
    say("correcting the first orbit")
    orbit = solve_orbit(model, _START, _GUESS)
    return continue_orbit(
        orbit,
        "Omega",
        BOUNDS,
        steps=StepControl(largest=_LARGEST_STEP),
        progress=lambda count, value: say(f"{count} orbits, Omega = {value:.5f}"),
    )


def summary(branch: Branch) -> dict[str, Any]:
    """Return the content of ``fig3.json``; an infinite multiplier's parts are null, for JSON has no infinity."""
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

    a0 = branch.parameters["a0"] / branch.parameters["eta"]
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
