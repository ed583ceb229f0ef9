"""The ordinate that a picture of solutions has by default: the first quantity of a list that varies along them."""

from __future__ import annotations

from functools import singledispatch
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.results.branch import Branch
from saltus.plotting import style
from saltus.scales import FINEST, ILL_CONDITIONED, Verdict, followed, zero

if TYPE_CHECKING:
    from collections.abc import Iterable, Sequence

    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from saltus.continuation.results.parameters import OneParameter
    from saltus.system import HybridSystem

__all__ = ["extremes_first", "first_that_varies", "instead_of_held", "ordinate_of"]


def extremes_first(system: HybridSystem) -> list[str]:
    """Return quantities of periodic orbits in the order in which they are drawn by default.

    The state that comes first may be held: its greatest value by a wall, its least by a reset. Then its other extreme,
    amplitude or mean tells what the orbits do; then their period; then other outputs and states.

    Examples
    --------
    >>> from saltus import HybridSystem
    >>> extremes_first(HybridSystem.smooth({"x": "v", "v": "-x"}))
    ['max_x', 'min_x', 'amplitude(x, 1)', 'mean(x)', 'period', 'max_v', 'min_v']
    """
    first, *others = list(dict.fromkeys([*system.output_names, *system.states]))
    sides = ("min", "max") if system.output_names else ("max", "min")
    turning = first in system.angles
    means = [] if turning else [f"amplitude({first}, 1)", f"mean({first})"]
    return [
        *(f"{side}_{first}" for side in sides), *means, "period",
        *(f"{side}_{name}" for name in others for side in sides),
    ]  # fmt: skip


def ordinate_of(branches: Sequence[OneParameter[Any]], names: Sequence[str], ax: Axes | None = None) -> str:
    """Return the name to draw: on Axes the one that they are labelled with, else one that varies, else the first.

    Orbits of each signature count by themselves: before a grazing the greatest value varies, and then the wall holds
    it. Of two names that vary among orbits of as many signatures the first is drawn.

    Parameters
    ----------
    branches : sequence of Branch or another
        What is drawn together.
    names : sequence of str
        Quantities that `column` knows, in the order of preference.
    ax : matplotlib.axes.Axes, optional
        Where it is drawn.
    """
    labelled = None if ax is None else ax.get_ylabel()
    if labelled and (shared := [name for name in names if style.label_of(name) == labelled]):
        return shared[0]
    alike = [(b, np.flatnonzero(b.equations == k)) for b in branches for k in np.unique(b.equations)]
    stretches = [(branch, rows) for branch, rows in alike if rows.size > 1]
    found, most = names[0], 0
    for name in names:
        varied = sum(_varies(branch, rows, name) for branch, rows in stretches)
        if varied > most:
            found, most = name, varied
        if most == len(stretches):
            break
    return found


def instead_of_held(branch: Branch, name: str) -> str:
    """Return the name, or what is drawn by default where it is an extreme that does not vary along the branch."""
    known = extremes_first(branch.system)
    if name not in known or ordinate_of([branch], [name, *known]) == name:
        return name
    held = [np.flatnonzero(branch.equations == k) for k in np.unique(branch.equations)]
    return name if any(_varies(branch, rows, name) for rows in held) else ordinate_of([branch], known)


def first_that_varies(columns: Iterable[tuple[str, NDArray[np.float64]]], rtol: float, atol: float) -> str:
    """Return the first name whose values differ by more than a flow of those tolerances errs, else the first of all."""
    first = None
    for name, values in columns:
        first = name if first is None else first
        if _spread(values, max(followed(rtol) * _size(values), atol)):
            return name
    assert first is not None
    return first


def _spread(values: NDArray[np.float64], error: float) -> bool:
    """Return whether the values differ by clearly more than their error."""
    known = values[np.isfinite(values)]
    return known.size > 0 and zero(np.ptp(known), error) is Verdict.NO


def _size(values: NDArray[np.float64]) -> float:
    known = values[np.isfinite(values)]
    return float(np.abs(known).max(initial=0.0))


@singledispatch
def _varies(branch: OneParameter[Any], rows: NDArray[np.int64], name: str) -> bool:
    """Return whether a quantity varies over rows of a branch; algebraic equations are solved to rounding."""
    values = branch.column(name)[rows]
    return _spread(values, followed(FINEST) * _size(values))


@_varies.register(Branch)
def _(branch: Branch, rows: NDArray[np.int64], name: str) -> bool:
    values = branch.column(name)[rows]
    observable = name if "(" in name else "{}({})".format(*name.split("_", 1)) if "_" in name else ""
    if not observable:
        return _spread(values, followed(branch.tolerance) * _size(values))
    of = branch.quantities.index(observable[observable.index("(") + 1 : -1].split(",")[0])
    extent = float((branch.highs - branch.lows)[rows, of].max())
    if not _spread(values, 0.0) or _spread(values, ILL_CONDITIONED * extent):
        return _spread(values, 0.0)  # half of the digits are no rounding: no errors are asked for
    found = [branch.solution(i).observe(observable, errors=True)[observable].error for i in rows.tolist()]
    return _spread(values, max(found))
