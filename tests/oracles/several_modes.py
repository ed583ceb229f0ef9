"""Modes of a cantilever over a sample, by Runge-Kutta steps in time; nothing here comes from saltus."""

from __future__ import annotations

import math

import numba
import numpy as np


@numba.njit
def harmonics(k, f, Q, A0, Zc, force, levels, steps, turns):
    """First harmonics of each mode at its drive's frequency, cosine and sine, shape (mode, 2), with Hann's window.

    `force` is a compiled function of gap, its rate, and whether contact holds: from where the gap falls below the first
    of `levels` until it rises above the second. A turn of the last mode takes `steps` steps. The first mode makes
    `turns` turns, after five times its quality factor in which the motion settles.
    """
    n, dt, w = len(k), 1.0 / (steps * f[-1]), 2.0 * math.pi * f
    total, start = int((5.0 * Q[0] + turns) / (f[0] * dt)), int(5.0 * Q[0] / (f[0] * dt))
    x, y, slopes, sums, held = np.zeros(2 * n), np.zeros(2 * n), np.zeros((4, 2 * n)), np.zeros((n, 2)), False
    for step in range(total):
        t = step * dt
        if step >= start:
            share = 2.0 * math.sin(math.pi * (step - start) / (total - start)) ** 2
            sums[:, 0] += share * x[::2] * np.cos(w * t)
            sums[:, 1] += share * x[::2] * np.sin(w * t)
        held = Zc + x[::2].sum() < levels[1 if held else 0]
        for stage in range(4):
            ahead = (0.0, 0.5, 0.5, 1.0)[stage] * dt
            y[:] = x + ahead * slopes[stage - 1]
            F = force(Zc + y[::2].sum(), y[1::2].sum(), held)
            drive = A0 / Q * np.cos(w * (t + ahead))
            slopes[stage, ::2] = y[1::2]
            slopes[stage, 1::2] = w**2 * (drive + F / k - y[::2] - y[1::2] / (w * Q))
        x += dt / 6.0 * (slopes[0] + 2.0 * slopes[1] + 2.0 * slopes[2] + slopes[3])
    return 2.0 * sums / (total - start)
