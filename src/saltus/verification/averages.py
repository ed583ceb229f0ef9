"""Means and first harmonics of an orbit that SciPy has followed, by Simpson's rule on its samples."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.orbits.observables.outputs import curved
from saltus.scales import VERIFIED_EXTREME
from saltus.system.angles import TURN
from saltus.verification.table import Row, compared

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.verification.orbits import FollowedOrbit

__all__ = ["average_rows"]

_ESTIMATES = 2.0  # errors of the rule, by every second sample, that are allowed: at a kink it is of second order


def average_rows(curve: Any, index: int, found: FollowedOrbit) -> list[Row]:
    """Return the rows of the means and harmonics that a curve has for a point, at the orbit that was followed."""
    (fine, sizes), (coarse, _) = _moments(curve, found, 1), _moments(curve, found, 2)
    n = len(curve.system.all_states)
    scale = np.maximum(sizes, 0.0)
    scale[:n] = np.maximum(scale[:n], found.sizes[:n] * VERIFIED_EXTREME)
    rows = []
    phase = None if curve.system.phase is None else curve.system.phase[0]
    said = {"mean": curve.means[index] + 0j, "harmonic": curve.harmonics[index]}
    for column, name in enumerate(("mean", "harmonic")):
        for q, quantity in enumerate(curve.quantities):
            if (
                quantity == phase
                or quantity in curved(curve.system)
                or not (np.isfinite(scale[q]) and np.isfinite(fine[q, column]))
            ):
                continue
            allowed = (VERIFIED_EXTREME + found.loose) * scale[q] + _ESTIMATES * abs(
                fine[q, column] - coarse[q, column]
            )
            told, value = complex(said[name][q]), complex(fine[q, column])
            if name == "mean":
                told, value = told.real, value.real
            rows.append(compared(f"{name} {quantity}", told, value, float(allowed)))
    return rows


def _moments(curve: Any, found: FollowedOrbit, every: int) -> tuple[NDArray[np.complex128], NDArray[np.float64]]:
    """Return means and harmonics, shape (quantity, 2), by every so many samples, and the largest moduli."""
    from scipy.integrate import simpson

    system, spans = curve.system, [float(piece.times[-1]) for piece in found.pieces]
    period, begun = sum(spans), 0.0
    total, sizes = np.zeros((len(curve.quantities), 2), dtype=np.complex128), np.zeros(len(curve.quantities))
    for piece, span in zip(found.pieces, spans, strict=True):
        kept = np.unique(np.append(np.arange(0, piece.times.size, every), piece.times.size - 1))
        times, states = piece.times[kept], piece.states[:, kept]
        values = found.reference.quantities(piece.mode, states)
        angle = TURN * (begun + times) / period if system.phase is None else states[-1] * (TURN / system.turn)
        # of a sin(angle + phi): a exp(i phi)
        rows = np.stack([values + 0j, 2.0 * values * (np.sin(angle) + 1j * np.cos(angle))], axis=1)
        if span > 0.0:
            total += simpson(rows, x=times, axis=2) / period
        sizes = np.maximum(sizes, np.abs(values).max(axis=1, initial=0.0))
        begun += span
    return total, sizes
