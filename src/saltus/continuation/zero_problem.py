"""A zero problem with one unknown more than equations, and the points of its branch: docs/theory/continuation.md."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Event", "Examined", "Point", "ZeroProblem", "correct", "hermite", "start_point"]

_ACCEPT, _REMESHED = 2e-9, 20
"""Newton step at which a point is taken; evaluations more in which the mesh may become fine enough for a point that is
found."""


class ZeroProblem(Protocol):
    """F(u) = 0 with one unknown more than equations; the last unknown is the parameter.

    Its monitor functions go by whatever can be hashed and told. `singular` names those at whose zeros the equations
    bordered by a plane are singular, `noise` gives what rounding leaves of some at their zeros, over their size nearby.
    """

    singular: frozenset[Any]
    noise: Mapping[Any, float]

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the residual, shape (m,), and the Jacobian, shape (m, m + 1)."""

    def accurate(self) -> bool:
        """Return whether the discretisation was fine enough at the last evaluation; refine it where it was not."""

    def metric(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return weights, shape (m + 1,): the squared arclength of du is sum weights du^2."""

    def scale(self) -> NDArray[np.float64]:
        """Return typical sizes of the unknowns, shape (m + 1,), for Newton's criterion."""

    def examine(self, point: Point, before: Point | None) -> Examined:
        """Return what is to be known of a corrected point, and whether it may follow the one before."""

    def depart(self, point: Point) -> None:
        """Normalise the equations at a point from which a step is to go; renew what of it depends on that."""

    def recover(self, point: Point) -> bool:
        """Make the discretisation finer where no point is found a step from `point`; return whether it is finer."""

    def leading(self, names: list[Any]) -> list[Any]:
        """Return those of the monitor functions that change sign in a step which are to be located."""

    def sort_out(self, events: list[Event]) -> list[Event] | str:
        """Return the events of one step, in order, without those that are the shadow of another, or why not to take it.

        The step is that between the two points examined last, the second as the successor of the first.
        """

    def crowded(self, names: list[Any]) -> bool:
        """Return whether the events of one step are so many that a shorter one is due."""

    def monitor(self, name: Any, point: Point) -> float:
        """Return one monitor function at a point that need not be quite corrected."""


@dataclass(frozen=True)
class Examined:
    """What a problem says of a point: values of its monitor functions, a fault that forbids it, anything it keeps."""

    monitors: Mapping[Any, float]
    fault: str | None = None
    data: Any = None


@dataclass(eq=False)
class Point:
    """A point of a branch with its tangent (unit arclength) and the sign and log of the bordered determinant.

    `frame` is what the problem normalised its equations by, where it does so from place to place.
    """

    u: NDArray[np.float64]
    J: NDArray[np.float64]
    tangent: NDArray[np.float64]
    weights: NDArray[np.float64]
    sign: float
    log: float
    residual: float
    iterations: int = 0
    arc: float = 0.0
    examined: Examined = field(default_factory=lambda: Examined({}))
    frame: Any = None

    @property
    def parameter(self) -> float:
        """The last unknown."""
        return float(self.u[-1])


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
    """Return the point of the branch in the hyperplane through `guess` normal to `tangent`, or why there is none."""
    from saltus.flow._linear_kernels import bordered

    u = guess.copy()
    row, scale = weights * tangent, problem.scale()
    previous, remeshed = math.inf, 0
    for iteration in range(1, iterations + _REMESHED + 1):
        F, J = problem.evaluate(u)
        steps, sign, log, size, residual = bordered(J, F, row, u, guess, scale)
        if sign == 0.0 or not math.isfinite(log):
            return "Newton: the equations are singular there"
        if not size < 1e6:
            return "Newton: the flow cannot be followed there"
        u = u + steps[:, 0]
        if problem.accurate() and size < _ACCEPT:
            direction = steps[:, 1] / math.sqrt(float(weights @ steps[:, 1] ** 2))
            return Point(u, J, direction, weights, sign, log, residual, iteration)
        if size > 0.7 * previous and size > 1e-5:
            return "Newton: no contraction"
        remeshed += size < _ACCEPT
        if iteration - remeshed >= iterations:
            break
        previous = size
    return "Newton: too many iterations"


def start_point(problem: ZeroProblem, u: NDArray[np.float64], orientation: float = 1.0) -> Point:
    """Return the point nearest to `u` on the branch through it; the parameter grows along it if `orientation` > 0.

    Raises
    ------
    ValueError
        There is no branch near `u`.
    """
    weights = problem.metric(u)
    root = np.sqrt(np.maximum(weights, 1e-12))
    J = np.empty(0)
    for _ in range(6 + _REMESHED):
        F, J = problem.evaluate(u)
        fine = problem.accurate()
        step = np.linalg.lstsq(J / root, -F, rcond=None)[0] / root
        u = u + step
        if fine and np.abs(step / problem.scale()).max() < _ACCEPT:
            break
    null = np.linalg.svd(J / root)[2][-1] / root
    null *= np.sign(orientation * null[-1]) or 1.0
    null /= math.sqrt(float(weights @ null**2))
    point = correct(problem, u, null, weights, 7)
    if isinstance(point, str):
        raise ValueError(point)
    return point


def hermite(a: Point, b: Point, length: float, s: float) -> NDArray[np.float64]:
    """Return the cubic through both points with their tangents, at a fraction of the step."""
    end, off = s * s * (3.0 - 2.0 * s), s * (1.0 - s) * length
    return (1.0 - end) * a.u + end * b.u + ((1.0 - s) * off) * a.tangent - (s * off) * b.tangent
