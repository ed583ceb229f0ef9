"""Newton's method for algebraic equations, and the sizes of unknowns by which its steps are judged."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.algebraic.bending import bending_sizes
from saltus.errors import ConvergenceError, InputError
from saltus.scales import UNIT_DECADES

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.algebraic.protocol import AlgebraicProblem

__all__ = [
    "ACCEPTED",
    "CONTRACTS",
    "ENDING",
    "ENDLESS_FROM",
    "REMESHED",
    "UNSTABLE",
    "responses",
    "solve_zero",
    "state_sizes",
    "terms_of_rows",
    "why_none",
    "without_rounding",
]

# Of Newton's method in a plane across a branch, compiled or not. Its steps are taken over the unknowns' sizes.
ACCEPTED = 2e-9  # largest step of a converged point
REMESHED = 20  # most further iterations of a converged point while its mesh is refined
UNSTABLE = 2  # most evaluations of a point on meshes too coarse for the flow to be finite
ENDLESS_FROM = 1e6  # step from which on the equations cannot be followed
CONTRACTS = 0.7  # largest ratio of two steps of a method that converges
ENDING = 1e-5  # step up to which a method that does not contract may still end

_ITERATIONS = 100  # most Newton steps
_CONVERGED = 1e-13  # Newton step, over the states' sizes, of a converged equilibrium
_STALLED = 1e-8  # the same where rounding keeps steps from shrinking further
_FLOOR = 1e-3  # size of a state, over its largest on the way, below which its steps are judged by this size
_ROUNDED = 1e-14  # size of a state, over its typical size, up to which it may be rounding of 0
_SINGULAR = 1e-6  # least singular value of the Jacobian, rows of size 1, up to which it is called singular
_SHORTEST = 1e-6  # least share of a Newton step that is tried
_NEARBY = 1.1  # factor on the state nearby at which sizes of terms are taken too
_FUNCTION = {"equilibrium": "field", "orbit": "map"}  # what vanishes, or closes, at a solution
_BALANCINGS = 3  # rounds through the states at rest in 0, in which their sizes are balanced
_SMALL = 1e-8  # size of a state, over the largest, below which its steps are not judged by it alone


def state_sizes(problem: AlgebraicProblem, u: NDArray[np.float64], J: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return typical sizes of the states, shape (n,).

    The size of a state is its modulus. A state at rest in 0 has the size that the others give it through the field.
    Where all states vanish, their sizes are those of the states' responses to the parameters. What moves no state, and
    is moved by none, has the size at which the derivatives are other than at rest.
    """
    n, x = problem.n, np.abs(u[: problem.n])
    if float(x.max()) > 0.0:
        top = float(x.max())
        small = x < _SMALL * top
        if not np.any(small):
            return x
        # nearby, no terms cancel as at a saddle-node
        nearby = np.append(_NEARBY * u[:n], u[n:])
        A = np.abs(J[:, :n])
        A = np.fmax(A, np.abs(problem.evaluate(nearby)[1][:, :n]))
        # a state in other units may be as small, but not its share in the rates of the others
        shares = (A - np.diag(np.diag(A))) * x
        fastest = float(np.abs(np.linalg.eigvals(J[:, :n])).max())
        small &= ~np.any(shares > _SMALL * np.maximum(A @ x, fastest * x)[:, None], axis=0)
        sizes, free = _balanced(A, x, small)
        return np.where(free, _bending(problem, u, J, free, top), sizes) if np.any(free) else sizes
    response = np.abs(J[:, n:]).max(axis=1) if J.shape[1] > n else np.zeros(n)
    if float(response.max(initial=0.0)) > 0.0:
        moved = np.abs(responses(J[:, :n], J[:, n:], np.ones(n))).max(axis=1)
        if float(moved.max()) > 0.0:
            return np.asarray(np.where(moved > _SMALL * moved.max(), moved, moved.max()))
    return _bending(problem, u, J, np.ones(n, dtype=bool), 1.0)


def _bending(
    problem: AlgebraicProblem, u: NDArray[np.float64], J: NDArray[np.float64], free: NDArray[np.bool_], top: float
) -> NDArray[np.float64]:
    """Return sizes of the free states, shape (n,), by where derivatives are other than with these at 0.

    They are `top` but where they are many powers of ten off that. A change by a unit of a parameter is a usual one.
    """
    n, block, count = problem.n, np.ix_(free, free), int(np.count_nonzero(free))

    def slopes(x: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        v = u.copy()
        v[:n][free] = top * x
        return [problem.evaluate(v)[1][block][None]]

    also = np.zeros((1, count, count))
    for k in range(n, u.size):
        for side in (-1.0, 1.0):
            v = u.copy()
            v[k] += side
            with np.errstate(all="ignore"):
                change = problem.evaluate(v)[1][block] - J[block]
            if np.all(np.isfinite(change)):
                also = np.append(also, change[None], axis=0)
    found = bending_sizes(slopes, count, [also])
    sizes = np.full(n, top)
    if np.any(np.abs(np.log10(found)) > UNIT_DECADES):
        sizes[free] *= found
    return sizes


def terms_of_rows(matrix: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the largest entry of each row of a matrix, shape (rows, 1); 1 for a row of zeros."""
    terms = np.abs(matrix).max(axis=1, keepdims=True)
    return np.where(terms > 0.0, terms, 1.0)


def responses(A: NDArray[np.float64], B: NDArray[np.float64], sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the shortest least-squares solution of A X = B, rows of one size and unknowns in units of `sizes`."""
    scaled = A * sizes
    rows = 1.0 / terms_of_rows(scaled)
    return np.asarray(sizes[:, None] * np.linalg.lstsq(scaled * rows, B * rows, rcond=1e-12)[0])


def _balanced(
    A: NDArray[np.float64], x: NDArray[np.float64], small: NDArray[np.bool_]
) -> tuple[NDArray[np.float64], NDArray[np.bool_]]:
    """Return sizes of the states: `x`, but for the small ones those that balance a row and a column of the matrix.

    Which of the small ones nothing balances comes too.

    The rate of a state by the others, over its size, then equals the rates that it causes, over the others' sizes: what
    Osborne's balancing does (J. ACM 7 (1960) 338-345). The units of the states do not matter.
    """
    sizes = np.where(small, float(x.max()), x)
    known = ~small
    for i in np.flatnonzero(small).tolist() * _BALANCINGS:
        others = known & (np.arange(x.size) != i)
        if not np.any(others):
            continue
        caused, causes = float(A[i, others] @ sizes[others]), float(np.sum(A[others, i] / sizes[others]))
        if caused > 0.0 and max(causes, A[i, i]) > 0.0:
            sizes[i] = math.sqrt(caused / causes) if causes > 0.0 else caused / A[i, i]
            known[i] = True
    return sizes, ~known


def solve_zero(
    problem: AlgebraicProblem, x: NDArray[np.float64], what: str, none: str
) -> tuple[NDArray[np.float64], NDArray[np.float64], int]:
    """Return the zero near `x` at fixed parameters, sizes of its unknowns, and the number of Newton steps.

    Unknowns that are rounding of 0 are set to 0.

    Parameters
    ----------
    problem : AlgebraicProblem
        The equations, no parameter active.
    x : ndarray, shape (n,)
        The guess.
    what, none : str
        What is sought, and what a message says of its absence.

    Raises
    ------
    InputError
        The equations have no value at the guess.
    ConvergenceError
        The steps do not converge.
    """
    u = x.astype(np.float64)
    known = np.abs(u)
    F, J = problem.evaluate(u)
    if not (np.isfinite(F).all() and np.isfinite(J).all()):
        raise InputError("x0", x.tolist(), f"a state at which the {_FUNCTION[what]} and its derivatives are finite")
    before = math.inf
    for iteration in range(_ITERATIONS):
        sizes = np.maximum(state_sizes(problem, u, J), _FLOOR * known)
        step = _newton_step(F, J, sizes)
        length = float(np.max(np.abs(step) / sizes))
        if length <= _CONVERGED or (length <= _STALLED and length >= 0.5 * before):
            return without_rounding(problem, u + step, sizes), sizes, iteration
        before = length
        found = _damped(problem, u, F, J, step, sizes)
        if found is None:
            raise ConvergenceError(what, float(np.abs(F).max()), iteration, why_none(J, none))
        u, F, J = found
        known = np.maximum(known, np.abs(u))
    raise ConvergenceError(what, float(np.abs(F).max()), _ITERATIONS, why_none(J, none))


def without_rounding(
    problem: AlgebraicProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return unknowns whose states are set to 0 where they are rounding of 0, if the equations hold as well there."""
    rounded = u.copy()
    states = rounded[: problem.n]
    states[np.abs(states) < _ROUNDED * sizes] = 0.0
    before, after = (float(np.abs(problem.evaluate(v)[0]).max()) for v in (u, rounded))
    return rounded if after <= before else u


def why_none(J: NDArray[np.float64], none: str = "there may be no equilibrium in this mode") -> str:
    """Return why Newton's method may have failed, by the Jacobian where it ended."""
    if np.isfinite(J).all():
        scaled = J / np.maximum(np.abs(J).max(axis=1, keepdims=True), 1e-300)
        if np.linalg.svd(scaled, compute_uv=False)[-1] < _SINGULAR:
            return "the Jacobian is singular there, as at a saddle-node; reach the point along a branch"
    return f"start from a nearer state; {none}"


def _newton_step(F: NDArray[np.float64], J: NDArray[np.float64], sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the Newton step, with rows and columns of the Jacobian scaled; the shortest where it is singular."""
    scaled = J * sizes
    rows = 1.0 / np.maximum(np.abs(scaled).max(axis=1), 1e-300)
    columns = 1.0 / np.maximum((np.abs(scaled) * rows[:, None]).max(axis=0), 1e-300)
    scaled = scaled * rows[:, None] * columns
    return np.asarray(sizes * columns * np.linalg.lstsq(scaled, -F * rows, rcond=1e-15)[0])


def _damped(
    problem: AlgebraicProblem,
    u: NDArray[np.float64],
    F: NDArray[np.float64],
    J: NDArray[np.float64],
    step: NDArray[np.float64],
    sizes: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]] | None:
    """Return unknowns, residual and Jacobian a share of a Newton step ahead; None where no share is an advance.

    The share is halved until the next simplified Newton step is shorter (the natural monotonicity test).
    """
    share = 1.0
    length = float(np.linalg.norm(step / sizes))
    while share > _SHORTEST:
        trial = u + share * step
        there, slope = problem.evaluate(trial)
        if np.isfinite(there).all() and np.isfinite(slope).all():
            simplified = float(np.linalg.norm(_newton_step(there, J, sizes) / sizes))
            if simplified <= (1.0 - 0.25 * share) * length or simplified <= 1e-10:
                return trial, there, slope
        share *= 0.5
    return None
