"""Many steps along a branch of equilibria in one call, as long as nothing happens on the way.

The steps are those of `saltus.continuation.core.arclength.follow`. docs/theory/equilibria.md, "Values within a step".
"""

from __future__ import annotations

import math

import numpy as np

from saltus.continuation.core.kernels.control import growth, judge, predict
from saltus.continuation.core.verdicts import TAKEN
from saltus.equilibria.kernels.field import field_at
from saltus.scales import NEWTON_ACCEPTED, NEWTON_DIVERGED, RESIDUAL_KEPT
from saltus.system.numba_tools.linear import bordered
from saltus.system.numba_tools.machine_code import njit
from saltus.system.numba_tools.pointers import ARRAYS


@njit(cache=True, error_model="numpy")
def stretch(system, start, before, gap, step, limits, bounds, sizes, origin, found):
    """Take steps until one fails or something may happen in it; return how many were taken and the next step's length.

    Parameters
    ----------
    system : addresses (functions,), mode, p (extended), active (1,), scales (1,), rows (n,)
        The equations, as `field_at` takes them, and units of their rows.
    start, before : point and tangent, (2, n + 1)
        The last two points.
    gap : float
        Arclength between them.
    step : float
        Length of the first step.
    limits : deviation, angle, largest step, most iterations
        Control of the steps.
    bounds : low, high
        Of the parameter.
    sizes, origin : (n,)
        Sizes of the states, which grow with the distance from the origin of the branch.
    found : points (most, 2, n + 1), Jacobians (most, n, n + 1), numbers (most, 5)
        What is written: numbers are sign and log of the determinant, residual, iterations, arclength of the step.
    """
    points, jacobians, numbers = found
    n = sizes.size
    guess, weights, unit = np.empty(n + 1), np.ones(n + 1), np.ones(n + 1)
    F, u, new = np.empty(n), np.empty(n + 1), np.empty((2, n + 1))
    last, back, h = start.copy(), before.copy(), step
    sign = 0.0
    for taken in range(points.shape[0]):
        J = jacobians[taken]
        for i in range(n):
            weights[i], unit[i] = 1.0 / sizes[i] ** 2, sizes[i]
        predict(last, back, gap, h, guess)
        u[:] = guess
        iterations, told = _newton(system, guess, last, weights, unit, limits[3], u, F, J, new)
        if iterations == 0:
            return taken, h
        fault, moved, angle, length = judge(weights, last, new, guess, (limits[0], limits[1]))
        turned = last[1, n] * new[1, n] <= 0.0 or (sign != 0.0 and told[0] * sign < 0.0)
        outside = not bounds[0] + 1e-12 < new[0, n] < bounds[1] - 1e-12
        residual = _residual(F, J, sizes, new)
        if fault != TAKEN or turned or outside or not residual <= RESIDUAL_KEPT:
            return taken, h
        sign = told[0]
        points[taken] = new
        numbers[taken, 0], numbers[taken, 1], numbers[taken, 2] = told[0], told[1], residual
        numbers[taken, 3], numbers[taken, 4] = iterations, length
        back[:], last[:], gap = last, new, length
        size = 0.0
        for i in range(n):
            sizes[i] = max(sizes[i], abs(new[0, i] - origin[i]))
            size += (new[1, i] / sizes[i]) ** 2
        size = math.sqrt(size + new[1, n] ** 2)
        for j in range(n + 1):
            last[1, j] /= size
            points[taken, 1, j] = last[1, j]
        h = min(h * growth(moved, angle, iterations, (limits[0], limits[1])), limits[2])
    return points.shape[0], h


@njit(**ARRAYS)
def _newton(system, guess, last, weights, unit, most, u, F, J, new):
    """Correct u in the hyperplane through the guess; return the iterations, 0 for none, and numbers of the point.

    Point and tangent are written to new, field and derivatives there to F and J.
    """
    functions, mode, p, active, scales, rows = system
    row = weights * last[1]
    previous = np.inf
    for iteration in range(1, int(most) + 1):
        field_at(functions, mode, u, p, active, scales, F, J)
        for i in range(F.size):
            F[i] /= rows[i]
            for j in range(u.size):
                J[i, j] /= rows[i]
        steps, sign, log, size, _ = bordered(J, F, row, u, guess, unit)
        if sign == 0.0 or not math.isfinite(log) or not size < NEWTON_DIVERGED:
            return 0, (0.0, 0.0)
        total = 0.0
        for j in range(u.size):
            u[j] += steps[j, 0]
            total += weights[j] * steps[j, 1] ** 2
        if size < NEWTON_ACCEPTED:
            total = math.sqrt(total)
            for j in range(u.size):
                new[0, j], new[1, j] = u[j], steps[j, 1] / total
            field_at(functions, mode, u, p, active, scales, F, J)
            return iteration, (sign, log)
        if size > 0.7 * previous and size > 1e-5:
            return 0, (0.0, 0.0)
        previous = size
    return 0, (0.0, 0.0)


@njit(**ARRAYS)
def _residual(F, J, sizes, new):
    """Return the largest component of the field, over the sizes of its terms."""
    worst = 0.0
    for i in range(F.size):
        terms = 0.0
        for j in range(F.size):
            terms += abs(J[i, j]) * max(sizes[j], abs(new[0, j]))
        share = abs(F[i]) / terms if F[i] != 0.0 else 0.0
        if not share <= worst:
            worst = share
    return worst
