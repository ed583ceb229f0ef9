"""A zero problem with one unknown more than equations, and the points of its branch.

docs/theory/continuation.md, "Pseudo-arclength", derives predictor and corrector.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

from saltus.algebraic.newton import ACCEPTED, CONTRACTS, ENDING, ENDLESS_FROM, REMESHED, UNSTABLE
from saltus.scales import EPS, PARAMETER_RESTS, REGULAR_TRIANGLE, STEP_AT_ROUNDING, Verdict, zero

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Line = tuple[NDArray[np.float64], NDArray[np.float64]] | NDArray[np.float64]  # a point and its tangent
    Share = float | NDArray[np.float64]  # of one step, or of many

__all__ = [
    "Event",
    "Examined",
    "Point",
    "Unsolved",
    "ZeroProblem",
    "correct",
    "cubic",
    "hermite",
    "hermite_slope",
    "start_point",
]


class Unsolved:
    """Why Newton's method finds no point."""

    SINGULAR = "Newton: the equations are singular there"
    INFINITE = "Newton: the equations have no finite values there"
    ENDLESS = "Newton: a step leads far away from there"
    APART = "Newton: no contraction"
    LATE = "Newton: too many iterations"


class ZeroProblem(Protocol):
    """F(u) = 0 with one unknown more than equations; the last unknown is the parameter.

    Monitor functions have names that are hashable and have a text. A problem may have a method ``corrected`` besides,
    with the arguments of `correct`: what that returns in compiled code, or None where there is no such code.
    It may have a method ``carried``: for unknowns, and the Jacobian where it is known, it returns unknowns from which
    Newton's method contracts, or None where it knows no better.
    It may have a method ``error``: how far a monitor function, given its name, may be wrong at an examined point.

    Attributes
    ----------
    singular : frozenset
        Names of the monitor functions at whose zeros the equations bordered by a plane are singular.
    noise : mapping of name to float
        Rounding of some monitor functions at their zeros, over their size nearby.
    continuous : tuple of str
        Kinds of monitor functions without poles: where one changes its sign in a short step, it vanishes there,
        whether Newton's method finds the place or not.
    """

    singular: frozenset[Any]
    continuous: tuple[str, ...]
    noise: Mapping[Any, float]

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the residual, shape (m,), and the Jacobian, shape (m, m + 1)."""

    def accurate(self, *, met: bool = True) -> bool:
        """Return whether the discretisation was fine enough at the last evaluation; refine it where it was not.

        met: whether the equations were met there but for little.
        """

    def metric(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return weights, shape (m + 1,): the squared arclength of du is sum weights du^2."""

    def scale(self) -> NDArray[np.float64]:
        """Return typical sizes of the unknowns, shape (m + 1,), for Newton's criterion."""

    def examine(self, point: Point, before: Point | None) -> Examined:
        """Return monitor functions and data of a corrected point, and the fault if it may not follow `before`."""

    def depart(self, point: Point) -> None:
        """Normalise the equations at a point before a step starts there; update the point accordingly."""

    def recover(self, point: Point) -> bool:
        """Refine the discretisation after a failed step from `point`; return whether it is finer now."""

    def leading(self, names: list[Any]) -> list[Any]:
        """Return the monitor functions to be located, of those that change sign in a step."""

    def sort_out(self, events: list[Event]) -> list[Event] | str:
        """Return the events of one step, in order, without shadows of others, or the reason to reject the step.

        The step ends at the point examined last as the successor of another.
        """

    def crowded(self, names: list[Any]) -> bool:
        """Return whether one step has too many events, so that a shorter one must be taken."""

    def monitor(self, name: Any, point: Point) -> float:
        """Return one monitor function at a point that may be corrected roughly only."""


@dataclass(frozen=True)
class Examined:
    """Result of examining a point."""

    monitors: Mapping[Any, float]  # monitor functions
    fault: str | None = None  # why the point may not follow the point before
    data: Any = None  # what the problem knows of the point
    # names of the monitor functions that are known to touch 0 in the step to the point, without changing their sign
    doubled: frozenset[Any] = frozenset()
    # names of those that are known to vanish once at most in the step to the point
    once: frozenset[Any] = frozenset()
    # names of those whose sign is that of a point before, as they are within their errors since then
    carried: frozenset[Any] = frozenset()


@dataclass(eq=False)
class Point:
    """A point of a branch."""

    u: NDArray[np.float64]  # shape (m + 1,): unknowns, the parameter last
    J: NDArray[np.float64]  # shape (m, m + 1): Jacobian
    tangent: NDArray[np.float64]  # shape (m + 1,): tangent of unit arclength
    weights: NDArray[np.float64]  # shape (m + 1,): weights of the arclength
    # sign, log: sign and logarithm of the determinant of the Jacobian bordered by the tangent
    sign: float
    log: float
    residual: float  # residual of the equations
    iterations: int = 0  # Newton iterations to the point
    arc: float = 0.0  # arclength from the start
    examined: Examined = field(default_factory=lambda: Examined({}))  # result of `ZeroProblem.examine`
    frame: Any = None  # data of the problem that normalises its equations at the point, as a phase plane

    @property
    def parameter(self) -> float:
        """The last unknown."""
        return float(self.u[-1])

    @property
    def line(self) -> NDArray[np.float64]:
        """The point and its tangent, shape (2, m + 1)."""
        return np.array((self.u, self.tangent))


@dataclass(frozen=True, eq=False)
class Event:
    """A zero of a monitor function, located."""

    name: Any
    point: Point
    value: float


def correct(
    problem: ZeroProblem,
    guess: NDArray[np.float64],
    tangent: NDArray[np.float64],
    weights: NDArray[np.float64],
    iterations: int,
) -> Point | str:
    """Return the branch's point in the hyperplane through `guess` normal to `tangent`, or why there is none."""
    compiled, carried = getattr(problem, "corrected", None), getattr(problem, "carried", None)
    found = None if compiled is None else compiled(guess, tangent, weights, iterations)
    if found is None:
        found = _newton(problem, guess, guess.copy(), (tangent, weights, iterations))
    if isinstance(found, str) and carried is not None and (u := carried(guess)) is not None:
        return _newton(problem, guess, u, (tangent, weights, iterations), carried)
    return found


def _newton(
    problem: ZeroProblem,
    guess: NDArray[np.float64],
    u: NDArray[np.float64],
    plane: tuple[NDArray[np.float64], NDArray[np.float64], int],
    carried: Callable[..., NDArray[np.float64] | None] | None = None,
) -> Point | str:
    """Return what `correct` does, by Newton's method from `u`; each of its steps is carried on by `carried`, if given.

    plane: tangent, weights and most iterations.
    """
    from saltus.system.numba_tools.linear import bordered

    (tangent, weights, iterations), scale = plane, problem.scale()
    row = weights * tangent
    previous, remeshed, unstable = math.inf, 0, 0
    for iteration in range(1, iterations + REMESHED + 1):
        F, J = problem.evaluate(u)
        if unstable < UNSTABLE and not np.isfinite(J).all() and not problem.accurate():
            unstable += 1
            continue
        if carried is not None and not np.isfinite(J).all() and (further := carried(u)) is not None:
            u = further
            F, J = problem.evaluate(u)
        steps, sign, log, size, residual = bordered(J, F, row, u, guess, scale)
        if sign == 0.0 or not math.isfinite(log):
            return Unsolved.SINGULAR if np.isfinite(J).all() else Unsolved.INFINITE
        if not size < ENDLESS_FROM:
            return Unsolved.ENDLESS
        u = u + steps[:, 0]
        met = size < ACCEPTED or _at_rounding(problem, u - steps[:, 0], steps[:, 0], row, previous)
        if problem.accurate(met=met) and met:
            direction = steps[:, 1] / math.sqrt(float(weights @ steps[:, 1] ** 2))
            return Point(u, J, direction, weights, sign, log, residual, iteration)
        if size > CONTRACTS * previous and size > ENDING:
            return Unsolved.APART
        remeshed += met
        if iteration - remeshed >= iterations:
            break
        previous = size
        if carried is not None and not met and (further := carried(u)) is not None:
            u = further
    return Unsolved.LATE


def _at_rounding(
    problem: ZeroProblem, u: NDArray[np.float64], step: NDArray[np.float64], row: NDArray[np.float64], previous: float
) -> bool:
    """Return whether a Newton step from unknowns that have stopped to get better is the rounding of the equations.

    Where a formula loses digits, as x/(exp(x) - 1) near x = 0 does, steps shrink down to what its rounding makes of
    them. Unknowns that are the same but for their last digits then have another step.
    """
    from saltus.system.numba_tools.linear import bordered

    scale = problem.scale()
    size = float(np.abs(step / scale).max())
    if not CONTRACTS * previous < size < STEP_AT_ROUNDING:
        return False
    for signs in (1.0, -1.0):
        beside = u * (1.0 + signs * EPS)
        F, J = problem.evaluate(beside)
        other = bordered(J, F, row, u, u, scale)[0][:, 0]
        if zero(size, float(np.abs((other - step) / scale).max())) is not Verdict.NO:
            return True
    return False


def start_point(problem: ZeroProblem, u: NDArray[np.float64], orientation: float = 1.0) -> Point:
    """Return the point nearest to `u` on the branch through it; the parameter grows along it if `orientation` > 0.

    Raises
    ------
    ValueError
        There is no branch near `u`.
    """
    weights = problem.metric(u)
    root = np.sqrt(np.maximum(weights, 1e-12))
    J, carried = np.empty(0), getattr(problem, "carried", None)
    for _ in range(6 + REMESHED):
        F, J = problem.evaluate(u)
        if carried is not None and (further := carried(u, J)) is not None:
            u = further
            F, J = problem.evaluate(u)
        fine = problem.accurate()
        if not np.isfinite(J).all():  # on meshes too coarse for the flow, which are finer now
            continue
        step = _nearest(J / root, -F)[0] / root
        u = u + step
        if fine and np.abs(step / problem.scale()).max() < ACCEPTED:
            break
    if not np.isfinite(J).all():
        raise ValueError("Newton: the equations have no finite values")
    null = _nearest(J / root, np.zeros(len(J)))[1] / root
    null /= math.sqrt(float(weights @ null**2))
    null *= math.copysign(1.0, orientation * null[_leading(null * root)])
    point = correct(problem, u, null, weights, 7)
    if isinstance(point, str):
        raise ValueError(point)
    return point


def _leading(null: NDArray[np.float64]) -> int:
    """Return which component gives a tangent its sign: the parameter's, or the first large one where that rests."""
    sizes = np.abs(null)
    return -1 if sizes[-1] > PARAMETER_RESTS * sizes.max() else int(np.argmax(sizes > 0.5 * sizes.max()))


def _nearest(A: NDArray[np.float64], b: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the least solution of A x = b, one unknown more than equations, and a null vector of A of unit length."""
    from scipy.linalg import solve_triangular

    Q, R = np.linalg.qr(A.T, mode="complete")
    sizes = np.abs(np.diagonal(R))
    if not sizes.min(initial=1.0) > REGULAR_TRIANGLE * sizes.max(initial=0.0):
        return np.asarray(np.linalg.lstsq(A, b, rcond=None)[0]), np.asarray(np.linalg.svd(A)[2][-1])
    return np.asarray(Q[:, :-1] @ solve_triangular(R[:-1], b, trans="T")), np.asarray(Q[:, -1])


def hermite(a: Point, b: Point, length: float, s: Share) -> NDArray[np.float64]:
    """Return the cubic through both points and their tangents at the fraction `s` of a step of arclength `length`."""
    return cubic((a.u, a.tangent), (b.u, b.tangent), length, s)


def cubic(a: Line, b: Line, length: Share, s: Share) -> NDArray[np.float64]:
    """Return `hermite` of two points that are given with their tangents."""
    end, off = s * s * (3.0 - 2.0 * s), s * (1.0 - s) * length
    return (1.0 - end) * a[0] + end * b[0] + ((1.0 - s) * off) * a[1] - (s * off) * b[1]


def hermite_slope(a: Point, b: Point, length: float, s: Share) -> NDArray[np.float64]:
    """Return the derivative of the cubic `hermite` with respect to the fraction `s`."""
    left, right = (1.0 - s) * (1.0 - 3.0 * s) * length, s * (3.0 * s - 2.0) * length
    return (6.0 * s * (1.0 - s)) * (b.u - a.u) + left * a.tangent + right * b.tangent
