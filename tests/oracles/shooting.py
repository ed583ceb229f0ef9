"""The cycle next to one that is to be checked, by multiple shooting with SciPy's integrator."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
from scipy.integrate import solve_ivp

from saltus.results import PeriodicOrbit

Field = Callable[[np.ndarray, Mapping[str, float]], np.ndarray]  # rates at a state, by the parameters


def distance(orbit: PeriodicOrbit, field: Field, name: str, pieces: int = 80, tolerance: float = 1e-12) -> float:
    """Return how far a cycle is from the nearest one of its family along a parameter, over the sizes of its states.

    States at `pieces` places, the period and the parameter are corrected once, by the least change that closes all
    gaps between the pieces, each followed by SciPy.
    """
    sampled = orbit.sample(4 * pieces)
    times, at = np.unique(sampled["t"].to_numpy(), return_index=True)
    states = np.column_stack([sampled[state].to_numpy() for state in orbit.system.states])[at]
    places = np.unique(np.searchsorted(times, orbit.period * np.arange(pieces) / pieces).clip(0, times.size - 2))
    starts, count, n = states[places], places.size, states.shape[1]
    lasting = np.diff(np.append(times[places], orbit.period))
    sizes, p = np.abs(states).max(axis=0), dict(orbit.parameters)
    unit = max(abs(p[name]), 1.0)

    def flown(x, duration, values):
        ways = {"rtol": tolerance, "atol": tolerance * 0.1 * sizes.min(), "method": "DOP853"}
        return solve_ivp(lambda _, y: field(y, values), (0.0, duration), x, **ways).y[:, -1]

    A, gaps, step = np.zeros((count * n + 1, count * n + 2)), np.zeros(count * n + 1), 1e-6
    for i, (x, duration) in enumerate(zip(starts, lasting, strict=True)):
        rows, own, after = slice(i * n, i * n + n), i * n, (i + 1) % count * n
        end = flown(x, duration, p)
        gaps[rows] = (end - starts[(i + 1) % count]) / sizes
        for k in range(n):
            ends = [flown(x + sign * step * sizes * np.eye(n)[k], duration, p) for sign in (1.0, -1.0)]
            A[rows, own + k] += (ends[0] - ends[1]) / (2.0 * step * sizes)
        A[rows, after : after + n] -= np.eye(n)
        A[rows, -2] = field(end, p) * duration / sizes
        ends = [flown(x, duration, p | {name: p[name] + sign * step * unit}) for sign in (1.0, -1.0)]
        A[rows, -1] = (ends[0] - ends[1]) / (2.0 * step * sizes)
    A[-1, :n] = field(starts[0], p) / sizes
    return float(np.abs(np.linalg.lstsq(A, -gaps, rcond=1e-15)[0]).max())
