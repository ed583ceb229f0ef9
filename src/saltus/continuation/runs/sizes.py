"""Sizes of states that rest at 0 at a special point, as in an invariant plane, or that are small beside it.

docs/theory/loci.md, "Other branches", explains them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import TYPE_CHECKING, Generic, TypeVar

import numpy as np

from saltus.continuation.core.zero_problem import correct
from saltus.errors import ConvergenceError
from saltus.orbits.resting import kept_at_zero
from saltus.scales import FARTHER, ONE_VALUE, SOLUTION_APART

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import ZeroProblem
    from saltus.continuation.problems.algebraic import AlgebraicZeroProblem
    from saltus.continuation.problems.orbit import OrbitZeroProblem
    from saltus.orbits.signature import Signature

__all__ = ["algebraic_beside_rest", "beside_rest", "other_than", "upwards"]

_GUESSES = tuple(
    10.0**k for k in (0, 3, 6, 9, 12, 15, 18, -3, -6, -9, -12, -15, -18)
)  # size of a state at rest, over the largest, in turn

_FARTHEST = 32  # times that a branch is looked at farther from a rest; where it has not bent by then, it never does
_NEAREST = 3  # the same nearer to it: sizes shrink to a hundredth by themselves
_ITERATIONS = 10  # most Newton steps to such a solution

Result = TypeVar("Result")
Equations = TypeVar("Equations", bound="ZeroProblem")


def other_than(
    sizes: NDArray[np.float64],
    resting: NDArray[np.bool_],
    step: Callable[[NDArray[np.float64] | None], tuple[Result, float, float]],
    what: str,
) -> Result:
    """Return a solution on another branch; states at rest are given sizes until it is one.

    Parameters
    ----------
    sizes : ndarray, shape (n,)
        Sizes of the states along the known branch.
    resting : ndarray of bool, shape (n,)
        Which states rest at 0 there, so that their sizes are rounding.
    step : callable
        Takes sizes, None for those known, and returns a solution a step along the other branch. Two distances from
        the special point come with it: of the parameter, in its unit, and of the states.
    what : str
        What the solution is.

    Raises
    ------
    ConvergenceError
        The equations cannot tell any solution from the known branch.
    """
    top, kept = float(sizes.max()), []
    guesses = [np.where(resting, guess * top, sizes) for guess in _GUESSES] if np.any(resting) else [None]
    reason = "it cannot be told from the known branch"
    for guess in guesses:
        try:
            found, moved, apart = step(guess)
        except ConvergenceError as error:
            if len(guesses) == 1:
                raise
            reason = str(error)
            continue
        if moved > ONE_VALUE:
            return found
        if apart > SOLUTION_APART * top:
            kept.append(found)
    if kept:
        return kept[0]
    raise ConvergenceError(what, 0.0, len(guesses), reason)


def upwards(direction: NDArray[np.float64], shares: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a direction or its opposite, so that the first of the large shares is positive.

    States that rest at 0 are often amounts that cannot be negative.
    """
    large = np.flatnonzero(np.abs(shares) >= 0.5 * float(np.abs(shares).max()))
    return -direction if shares[large[0]] < 0.0 else direction


def beside_rest(
    equations: Callable[..., OrbitZeroProblem], signature: Signature, u: NDArray[np.float64], longest: float
) -> tuple[OrbitZeroProblem, float | None]:
    """Return the equations of a branch of orbits, and its first step if that is not the usual one.

    A branch that comes from a rest has sizes up to which it leaves it straight. Next to the rest the first step is long
    enough to pass it: a short one would end where rounding tells multipliers.

    Parameters
    ----------
    equations : callable
        Makes equations for a signature, unknowns and known sizes of the states.
    signature : Signature
        That of the start.
    u : ndarray, shape (m + 1,)
        The start.
    longest : float
        How far the longest step moves the parameter.
    """
    first = equations(signature, u)
    problem = first.problem
    count, cut = len(problem.system.states), signature.is_cut or problem.slides
    if first.further or cut or not kept_at_zero(problem, u[: problem.n], np.arange(problem.n) < count).any():
        return first, None

    def begin(v: NDArray[np.float64]) -> OrbitZeroProblem:
        return equations(signature, v)

    places = np.arange(problem.size).reshape(problem.segments, problem.n + 1)[:, :count]
    places = _resting(begin(u), u, places)
    if not places.size or (found := _Ladder(begin, places, longest).bend(u, nearer=True)) is None:
        return first, None
    sizes, kept = np.zeros(count), places[0]
    sizes[kept] = found.problem.state_scale[kept]
    branch = equations(signature, u, sizes)
    return branch, _first_step(branch, u, places, longest)


def algebraic_beside_rest(
    begin: Callable[[NDArray[np.float64]], AlgebraicZeroProblem],
    first: AlgebraicZeroProblem,
    u: NDArray[np.float64],
    longest: float,
) -> float | None:
    """Give the unknowns of a branch the sizes up to which it leaves a rest straight; return its first step.

    Parameters
    ----------
    begin : callable
        Makes equations for unknowns.
    first : AlgebraicZeroProblem
        Those of the start; their sizes are written.
    u, longest
        As `beside_rest` takes them.
    """
    problem = first.problem
    places = _resting(begin(u), u, np.arange(problem.n).reshape(problem.period, -1))
    if not places.size or not np.any(u[places]):
        return None
    if (found := _Ladder(begin, places, longest).bend(u, nearer=False)) is None:
        return None
    usual = first.sizes.copy()
    first.sizes[places] = np.maximum(usual, found.sizes)[places]
    if (step := _first_step(first, u, places, longest)) is None:  # a start far from the rest has its own sizes
        first.sizes[:] = usual
    return step


def _first_step(branch: ZeroProblem, u: NDArray[np.float64], places: NDArray[np.intp], longest: float) -> float | None:
    """Return the longest step where it leads as far beyond a rest as the start is before it; None elsewhere."""
    size = math.sqrt(float(branch.metric(u)[places].ravel() @ u[places].ravel() ** 2))
    return longest if 2.0 * size <= longest else None


class _Ladder(Generic[Equations]):
    """Solutions of a branch at distances from a rest that go by a factor, the parameter free.

    A solution beside a branching from a rest is small, and a poor unit: steps in it creep. The size to take is the
    distance at which the branch has bent: from there on the next one moves the parameter more than the longest step.

    Parameters
    ----------
    begin : callable
        Makes equations for unknowns.
    places : ndarray of int, shape (copies, states)
        Where the states that may rest are among the unknowns.
    longest : float
        How far the longest step moves the parameter.
    """

    def __init__(
        self, begin: Callable[[NDArray[np.float64]], Equations], places: NDArray[np.intp], longest: float
    ) -> None:
        self._begin, self._places, self._longest = begin, places.ravel(), longest

    def bend(self, u: NDArray[np.float64], *, nearer: bool) -> Equations | None:
        """Return equations made for the farthest solution up to which the branch from a start is straight.

        A branch that never bends has none. Where the start is farther, the first such solution on the way to the rest
        is taken if `nearer` is true.
        """
        start, branch = u, self._begin(u)
        for _ in range(_FARTHEST):
            further = self._at(branch, u, FARTHER)
            if further is None or not self._straight(u, further):
                return branch if u is not start else self._nearer(branch, u) if nearer else None
            u = further
            branch = self._begin(u)
        return None

    def _nearer(self, branch: Equations, u: NDArray[np.float64]) -> Equations | None:
        """Return the same on the way to the rest, within the size that the start tells; None where there is none."""
        for _ in range(_NEAREST):
            nearer = self._at(branch, u, 1.0 / FARTHER)
            if nearer is None or self._straight(u, nearer):
                return None if nearer is None else branch
            u = nearer
            branch = self._begin(u)
        return None

    def _straight(self, u: NDArray[np.float64], other: NDArray[np.float64]) -> bool:
        return abs(float(other[-1] - u[-1])) <= self._longest

    def _at(self, branch: ZeroProblem, u: NDArray[np.float64], factor: float) -> NDArray[np.float64] | None:
        """Return the solution whose states that may rest are that many times as large, the parameter being free."""
        weights, way, guess = branch.metric(u), np.zeros_like(u), u.copy()
        way[self._places] = u[self._places]
        size = math.sqrt(float(weights @ way**2))
        if not size > 0.0:
            return None
        guess[self._places] *= factor
        found = correct(branch, guess, way / size, weights, _ITERATIONS)
        return None if isinstance(found, str) else found.u


def _resting(branch: ZeroProblem, u: NDArray[np.float64], places: NDArray[np.intp]) -> NDArray[np.intp]:
    """Return the places of those states that may all rest at 0, whatever the others do: their equations hold there."""
    while places.size:
        still = u.copy()
        still[places] = 0.0
        hold = np.all(branch.evaluate(still)[0][places] == 0.0, axis=0)
        if hold.all():
            break
        places = places[:, hold]
    return places
