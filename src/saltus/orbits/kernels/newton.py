"""Compiled Newton's method for an orbit's equations in a plane: docs/theory/continuation.md, "Pseudo-arclength"."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.algebraic.newton import ACCEPTED, CONTRACTS, ENDING, ENDLESS_FROM, REMESHED, UNSTABLE
from saltus.orbits.kernels.equation import equations
from saltus.orbits.kernels.mesh import FINEST, inner_error
from saltus.orbits.records import APART, CONVERGED, ENDLESS, LATE, MOVE, SINGULAR, Mesh, Orbit, Phase
from saltus.system.numba_tools.linear import bordered_flat
from saltus.system.numba_tools.machine_code import kernel, njit
from saltus.system.numba_tools.pointers import INNER, pointer

if TYPE_CHECKING:
    from numpy.typing import NDArray

# Where a call goes on: with an evaluation, behind one that was not finite, behind a step; or it only evaluates.
EVALUATE = 0.0
_INFINITE = 1.0
_STEPPED = 2.0
ONCE = 3.0

# Entries of a method's state: where it goes on, iterations, most of them, the step before, iterations on moved meshes,
# evaluations that were not finite, whether moved meshes are fine enough; then sign and logarithm of the determinant,
# size of the step, residual; largest error of a step of the flow.
STAGE = 0
ITERATION = 1
MOST = 2
PREVIOUS = 3
MOVED = 4
TRIED = 5
FINE = 6
SIGN = 7
LOG = 8
SIZE = 9
RESIDUAL = 10
WORST = 11
NUMBERS = 12


@kernel
def newton(orbit, mesh, phase, tolerances, plane, numbers, u, F, J, errors, steps):
    """Correct an orbit in a plane until it has converged, has failed, or its meshes are to be moved; tell which.

    Parameters
    ----------
    orbit, mesh, phase, tolerances
        As `equations` takes them: fields of those records, as tuples.
    plane : guess, row, scale, each (m + 1,)
        A point of the plane, its normal, and sizes of the unknowns.
    numbers : (NUMBERS,)
        State of the method, by the indices above; written.
    u, F, J, errors, steps
        Unknowns (m + 1,), residual (m,), Jacobian (m, m + 1), errors of steps of the flow, and the solutions of
        `bordered`, (m + 1, 2); written.
    """
    orbit, mesh, phase = Orbit(*orbit), Mesh(*mesh), Phase(*phase)
    guess, row, scale = plane
    if numbers[STAGE] == ONCE:
        numbers[WORST] = equations(orbit, mesh, phase, tolerances, u, F, J, errors)
        return CONVERGED
    solves, matrix = False, np.empty(u.size * u.size)
    if numbers[STAGE] == _INFINITE:
        if numbers[FINE] == 0.0:
            numbers[TRIED] += 1.0
        else:
            solves = True
    elif numbers[STAGE] == _STEPPED:
        told = _judged(numbers)
        if told != MOVE:
            return told
    while True:
        if not solves:
            numbers[ITERATION] += 1.0
            if numbers[ITERATION] > numbers[MOST] + REMESHED:
                return LATE
            numbers[WORST] = equations(orbit, mesh, phase, tolerances, u, F, J, errors)
            if numbers[TRIED] < UNSTABLE and not numbers[WORST] <= FINEST and not _finite(J):
                numbers[STAGE] = _INFINITE
                return MOVE
        solves = False
        work, solutions = pointer(matrix, 0), pointer(steps, 0)
        sign, log, size, residual = bordered_flat(J, F, row, u, guess, scale, work, solutions)
        if sign == 0.0 or not math.isfinite(log):
            return SINGULAR
        if not size < ENDLESS_FROM:
            return ENDLESS
        for j in range(u.size):
            u[j] += steps[j, 0]
        numbers[SIGN], numbers[LOG], numbers[SIZE], numbers[RESIDUAL] = sign, log, size, residual
        numbers[STAGE], numbers[FINE] = _STEPPED, 1.0
        if size >= ACCEPTED and numbers[WORST] > FINEST:
            numbers[WORST] = inner_error(orbit.transitions, mesh.starts, numbers[WORST], errors)
        if not numbers[WORST] <= FINEST:
            return MOVE
        told = _judged(numbers)
        if told != MOVE:
            return told


@njit(**INNER)
def _finite(J):
    for i in range(J.shape[0]):
        for j in range(J.shape[1]):
            if not math.isfinite(J[i, j]):
                return False
    return True


@njit(**INNER)
def _judged(numbers):
    """Return what is told behind a step; MOVE where the method goes on."""
    size = numbers[SIZE]
    if numbers[FINE] != 0.0 and size < ACCEPTED:
        return CONVERGED
    if size > CONTRACTS * numbers[PREVIOUS] and size > ENDING:
        return APART
    numbers[MOVED] += 1.0 if size < ACCEPTED else 0.0
    if numbers[ITERATION] - numbers[MOVED] >= numbers[MOST]:
        return LATE
    numbers[PREVIOUS], numbers[STAGE] = size, EVALUATE
    return MOVE


def evaluation() -> NDArray[np.float64]:
    """Return the state of a method that only evaluates."""
    numbers = np.zeros(NUMBERS)
    numbers[STAGE] = ONCE
    return numbers


def beginning(most: int) -> NDArray[np.float64]:
    """Return the state of a method of that many iterations before the first one."""
    numbers = np.zeros(NUMBERS)
    numbers[MOST], numbers[PREVIOUS] = most, np.inf
    return numbers
