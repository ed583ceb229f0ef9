"""Pictures of results by matplotlib, one module for each kind of result.

`result.plot()` calls `plot`, which dispatches on the kind of result. The module that draws a kind is imported when the
first result of that kind is drawn; so is matplotlib. docs/theory/plotting.md says what each picture shows.
"""

from __future__ import annotations

from functools import singledispatch
from importlib import import_module
from typing import Any

from saltus.errors import InputError, SaltusError
from saltus.plotting.style import check_matplotlib

__all__ = ["picture_in_html", "plot"]

_SMALL = (4.0, 2.6)  # size of a small picture in inches
_DPI = 80  # its pixels in an inch
_MOST_DRAWN = 2e7  # bytes of a result of which a small picture is made

# The module that draws each kind of result, by the kind's full name.
_HOMES = {
    "saltus.continuation.results.branch.Branch": "saltus.plotting.branch",
    "saltus.orbits.orbit.PeriodicOrbit": "saltus.plotting.orbit",
    "saltus.flow.trajectory.Trajectory": "saltus.plotting.trajectory",
    "saltus.maps.iterates.Iterates": "saltus.plotting.iterates",
    "saltus.continuation.results.diagram.Diagram": "saltus.plotting.diagram",
    "saltus.continuation.results.family.Family": "saltus.plotting.family",
    "saltus.continuation.results.cascade.Cascade": "saltus.plotting.cascade",
    "saltus.equilibria.equilibrium.Equilibrium": "saltus.plotting.equilibrium",
    "saltus.continuation.results.locus.Locus": "saltus.plotting.locus",
    "saltus.continuation.results.equilibrium_branch.EquilibriumBranch": "saltus.plotting.branch",
    "saltus.continuation.results.equilibrium_locus.EquilibriumLocus": "saltus.plotting.locus",
    "saltus.continuation.results.map_locus.MapLocus": "saltus.plotting.locus",
    "saltus.maps.orbit.MapOrbit": "saltus.plotting.map_orbit",
    "saltus.continuation.results.map_curve.MapBranch": "saltus.plotting.map_orbit",
    "saltus.continuation.results.map_cascade.MapCascade": "saltus.plotting.cascade",
    "saltus.sweeps.sweep.Sweep": "saltus.plotting.sweep",
    "saltus.sweeps.lyapunov.LyapunovSpectrum": "saltus.plotting.lyapunov",
    "saltus.basins.map.basins.Basins": "saltus.plotting.basin",
    "saltus.fitting.result.Fit": "saltus.plotting.fit",
    "saltus.optimisation.optimum.Optimum": "saltus.plotting.optimum",
    "saltus.afm.curves.curve.Curve": "saltus.afm.pictures.curve_picture",
    "saltus.afm.curves.bistable_region.Bistability": "saltus.afm.pictures.bistable_picture",
    "saltus.afm.calibration.calibration.Calibration": "saltus.afm.pictures.spectrum_picture",
    "saltus.afm.bimodal.bimodal_map.BimodalMap": "saltus.afm.pictures.bimodal_picture",
    "saltus.afm.fm.shift_curve.FrequencyShift": "saltus.afm.pictures.shift_picture",
    "saltus.afm.reconstruction.force.ReconstructedForce": "saltus.afm.pictures.force_picture",
    "saltus.basins.measures.erosion.ErosionProfile": "saltus.plotting.erosion",
}

# The same of branches and loci of any other kind of solution, by their bases.
_BASES = {
    "saltus.continuation.results.parameters.OneParameter": "saltus.plotting.branch",
    "saltus.continuation.results.parameters.TwoParameters": "saltus.plotting.locus",
}


@singledispatch
def plot(result: Any, *args: Any, **options: Any) -> Any:
    """Draw a result and return the matplotlib Axes.

    Parameters
    ----------
    result : Result
        A result of one of the kinds that docs/theory/plotting.md lists. Functions `plot_...` in
        `saltus.plotting.branch`, `.cascade`, `.locus`, `.family`, `.orbit`, `.equilibrium`, `.map_orbit`, `.diagram`,
        `.trajectory`, `.iterates`, `.sweep`, `.lyapunov`, `.basin` and `.erosion` list the options of each kind.
    *args, **options
        Names of the quantities on the axes, and ``ax``, the Axes to draw into; by default in a new figure.

    Raises
    ------
    InputError
        There is no picture of this kind of result, or a quantity has another name.
    """
    kinds = (f"{kind.__module__}.{kind.__qualname__}" for kind in type(result).__mro__)
    homes = _HOMES | _BASES
    home = next((homes[kind] for kind in kinds if kind in homes), None)
    if home is None:
        drawn = ", ".join(kind.rsplit(".", 1)[1] for kind in _HOMES)
        raise InputError("result", type(result).__name__, f"a result that can be drawn: {drawn}")
    check_matplotlib()
    import_module(home)
    return plot.dispatch(type(result))(result, *args, **options)


def picture_in_html(result: Any) -> str:
    """Return a small picture of a result as HTML; empty of what has none, has much to draw, or lacks packages."""
    try:
        check_matplotlib()
        if result.to_xarray().nbytes > _MOST_DRAWN:
            return ""
    except SaltusError:  # no matplotlib, or no xarray
        return ""
    from base64 import b64encode
    from io import BytesIO

    from matplotlib.figure import Figure

    figure, content = Figure(figsize=_SMALL, layout="constrained"), BytesIO()
    try:
        plot(result, ax=figure.add_subplot())
    except SaltusError:
        return ""
    figure.savefig(content, format="png", dpi=_DPI)
    return f'<img alt="" src="data:image/png;base64,{b64encode(content.getvalue()).decode()}">'
