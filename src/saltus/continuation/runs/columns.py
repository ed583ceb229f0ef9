"""Columns of curves of orbits, from the equations and points of a run, and what is stable along a branch."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.continuation.problems.orbit_data import OrbitData
from saltus.scales import POINT_OF_BRANCH, varied

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.runs.two_sided import BothSides

__all__ = ["orbit_columns", "settled"]

_MEETINGS = ("BP", "SN")  # types of special points at which a value touches its critical place, or passes it

_SURVEYED = "admissible", "residual", "implicit", "lows", "highs", "means", "harmonics"  # columns that surveys have


def orbit_columns(joined: BothSides) -> dict[str, Any]:
    """Return the fields of `OrbitCurve` that a branch and a locus fill in the same way."""
    first = joined.rows[0][0].problem
    states, n = len(first.system.states), first.n
    forms = list(dict.fromkeys(piece.problem.signature for piece, _ in joined.rows))
    data = [point.examined.data for _, point in joined.rows]
    stable = [d.unstable == 0 and not np.isnan(d.told).any() for d in data]
    return {
        "x0": np.array([d.survey.x0[:states] for d in data]),
        "multipliers": np.array([d.told for d in data]),
        "stable": settled(joined, _critical(data), stable),
        "period": np.array([abs(point.u[n : piece.problem.size : n + 1].sum()) for piece, point in joined.rows]),
        **{name: np.array([getattr(d.survey, name) for d in data]) for name in _SURVEYED},
        "forms": tuple(forms),
        "form": np.array([forms.index(piece.problem.signature) for piece, _ in joined.rows]),
        "unknowns": tuple(point.u[: piece.problem.size] for piece, point in joined.rows),
    }


def settled(joined: BothSides, critical: Sequence[bool], stable: Sequence[bool]) -> NDArray[np.bool_]:
    """Return which solutions of a branch are stable, without what rounding tells.

    Next to a branch point or a fold, a value is nearer to its critical place than its error. Between solutions whose
    values are known stability changes at such a point only. A solution at the point itself has that of its neighbours.

    Parameters
    ----------
    joined : BothSides
        The branch.
    critical : sequence of bool
        Whether a value of each solution is critical within its error.
    stable : sequence of bool
        Which are stable by their own values.
    """
    places = [arc for found, _, arc in joined.specials if found.name in _MEETINGS]
    doubtful = [
        doubt or any(abs(arc - place) < POINT_OF_BRANCH for place in places)
        for arc, doubt in zip(joined.arcs, critical, strict=True)
    ]
    told, last = np.array(stable), len(doubtful) - 1
    for doubt, group in groupby(range(len(doubtful)), key=doubtful.__getitem__):
        own = list(group)
        before, after = own[0] - 1, own[-1] + 1
        if not doubt or (before < 0 and after > last):
            continue
        sides = stable[before if before >= 0 else after], stable[after if after <= last else before]
        low, high = joined.arcs[max(before, 0)], joined.arcs[min(after, last)]
        passed = [place for place in places if low <= place <= high]
        for i in own:
            if not passed or joined.arcs[i] <= min(passed):
                told[i] = sides[0]
            elif joined.arcs[i] > max(passed):  # between two such points a solution's own values tell
                told[i] = sides[1]
    return told


def _critical(data: Sequence[Any]) -> list[bool]:
    """Return which orbits have a further real multiplier at 1 within its error, and none beyond it.

    Those that every orbit of the branch has there belong to what is conserved.
    """
    near, grows = zip(*(_near_one(one) for one in data), strict=True)
    return [count > min(near) and not more for count, more in zip(near, grows, strict=True)]


def _near_one(data: Any) -> tuple[int, bool]:
    """Return how many real multipliers of an orbit are at 1 within their error, and whether one is beyond it."""
    if not isinstance(data, OrbitData):
        return 0, False
    values: NDArray[np.complex128] = np.array(data.followed, dtype=np.complex128)
    sizes, error = np.abs(values), varied(data.tolerance)
    near = (values.imag == 0.0) & (np.abs(values - 1.0) <= error * max(1.0, float(sizes.max(initial=0.0))))
    return int(near.sum()), bool(np.any(sizes * (1.0 - error) > 1.0))
