"""Tables of a mode's exact linear flow, for the steps of `saltus.system.linear_split`."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.system.linear_split import NODES, RUNGS, RUNGS_AN_OCTAVE, WEIGHTS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.compiled import CompiledLinear, CompiledSeries

__all__ = ["tables"]

_REACH = 8.0
_MARGIN = 1.1


def tables(
    linear: CompiledLinear, series: CompiledSeries, p: NDArray[np.float64], period: float
) -> NDArray[np.float64]:
    """Return parameters, constants and behind them the tables of every mode whose field splits.

    For each such mode: the shortest and the longest step; for each event function its row against the state and the
    phasors, that of its rate, and bounds on that of its second derivative; for each length of a step, the length, the
    entries of the linear flow at the nodes of Gauss's rule and at the end, and the kicks' ways from there to the end.

    Parameters
    ----------
    linear : CompiledLinear
        The linear parts of the system's modes.
    series : CompiledSeries
        Its series.
    p : ndarray, shape (parameters,)
        `HybridSystem.parameter_vector`.
    period : float
        Period of the phase; infinite without one.
    """
    from scipy.linalg import matrix_balance

    from saltus.flow._far_kernels import exponentials

    parts = [series.constants(p)]
    for mode, layout in enumerate(linear.splits):
        if layout is None:
            continue
        generator, events = linear.at(mode, p)
        n, entries, kicks = layout["states"], layout["entries"], layout["kicks"]
        balanced, (scale, _) = matrix_balance(generator, permute=False, separate=True)
        size = float(np.abs(balanced[:n, :n]).max())
        speed = max(float(np.abs(np.linalg.eigvals(balanced[:n, :n])).max()), 1e-3 * size)
        longest = min(_REACH / speed if speed > 0.0 else math.inf, 0.5 * period)
        if not longest < math.inf:
            # nothing moves: a shortest step that is never reached
            parts.append(np.full(layout["table_size"], math.inf))
            continue
        lengths = longest * 2.0 ** (np.arange(1 - RUNGS, 1) / RUNGS_AN_OCTAVE)
        fractions = np.array([*NODES, 1.0])
        back = scale[:, None] / scale[None, :]
        flows = exponentials(balanced, np.outer(lengths, fractions).ravel()) * back
        rest = exponentials(balanced, np.outer(lengths, 1.0 - fractions[:3]).ravel()) * back
        m = layout["size"]
        flows, rest = flows.reshape(RUNGS, 4, m, m), rest.reshape(RUNGS, 3, m, m)
        rate = events @ generator
        curvature = np.abs(rate @ generator @ flows).max(axis=(0, 1)) if len(events) else rate
        curvature = _MARGIN * np.maximum(curvature, np.abs(rate @ generator))
        rows, columns = np.array(entries, dtype=np.intp).reshape(-1, 2).T
        at, of = np.array(kicks, dtype=np.intp).reshape(-1, 2).T
        weights = np.outer(lengths, WEIGHTS)[:, :, None]
        rungs = np.concatenate(
            [
                lengths[:, None],
                flows[:, :, rows, columns].reshape(RUNGS, -1),
                (weights * rest[:, :, at, of]).reshape(RUNGS, -1),
            ],
            axis=1,
        )
        told = [row for triple in zip(events, rate, curvature, strict=True) for row in triple]
        parts += [np.array([lengths[0], math.inf if not len(kicks) else lengths[-1]]), *told, rungs.ravel()]
    return np.concatenate(parts)
