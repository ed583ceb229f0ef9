"""Columns of curves of orbits, from the equations and points of a run."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

if TYPE_CHECKING:
    from saltus.continuation.runs.two_sided import BothSides

__all__ = ["orbit_columns"]

_SURVEYED = "admissible", "residual", "implicit", "lows", "highs", "means", "harmonics"  # columns that surveys have


def orbit_columns(joined: BothSides) -> dict[str, Any]:
    """Return the fields of `OrbitCurve` that a branch and a locus fill in the same way."""
    first = joined.rows[0][0].problem
    states, n = len(first.system.states), first.n
    forms = list(dict.fromkeys(piece.problem.signature for piece, _ in joined.rows))
    data = [point.examined.data for _, point in joined.rows]
    return {
        "x0": np.array([d.survey.x0[:states] for d in data]),
        "multipliers": np.array([d.told for d in data]),
        "stable": np.array([d.unstable == 0 and not np.isnan(d.told).any() for d in data]),
        "period": np.array([abs(point.u[n : piece.problem.size : n + 1].sum()) for piece, point in joined.rows]),
        **{name: np.array([getattr(d.survey, name) for d in data]) for name in _SURVEYED},
        "forms": tuple(forms),
        "form": np.array([forms.index(piece.problem.signature) for piece, _ in joined.rows]),
        "unknowns": tuple(point.u[: piece.problem.size] for piece, point in joined.rows),
    }
