"""Boundary equilibria: what goes on at the surface at which an equilibrium meets the end of its mode.

docs/theory/equilibria.md, "Boundary equilibria", derives the conditions.

References
----------
di Bernardo, Budd, Champneys, Kowalczyk, Piecewise-smooth Dynamical Systems, Springer 2008, ch. 5. di Bernardo, Pagano,
Ponce, Int. J. Bifurcation Chaos 18 (2008) 1377-1392 (Filippov systems).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.scales import FIELDS_MEET, MET, SINGULAR_AT_ROUNDING

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.zero_problem import Point
    from saltus.equilibria.problem import EquilibriumProblem

__all__ = ["FOLDS", "PERSISTS", "TWO_FOLD", "Crossing", "beyond_boundary", "slope_of"]

PERSISTS = "persistence"
FOLDS = "nonsmooth fold"
TWO_FOLD = "two-fold"


@dataclass(frozen=True, eq=False)
class Crossing:
    """What goes on at a boundary equilibrium.

    Attributes
    ----------
    kind : str
        ``persistence``, ``nonsmooth fold``, ``two-fold``, or empty where none is told.
    beside : AlgebraicProblem
        The equations of the neighbouring mode, or of the neighbouring itinerary of a map.
    u : ndarray, shape (n + 1,), or None
        The equilibrium in the neighbouring mode; None where there is none.
    outwards : ndarray, shape (n + 1,)
        Gradient of the event function in the neighbouring mode's unknowns, towards the regular side of that mode.
    reason : str
        Why no branch goes on.
    """

    kind: str
    beside: Any
    u: NDArray[np.float64] | None
    outwards: NDArray[np.float64]
    reason: str = ""

    def sign(self, point: Point) -> float:
        """Return 1 if the tangent of a point leads to the regular side of the neighbouring mode, else -1."""
        return 1.0 if float(self.outwards @ point.tangent) > 0.0 else -1.0


def beyond_boundary(
    problem: EquilibriumProblem,
    transition: int,
    u: NDArray[np.float64],
    tangent: NDArray[np.float64],
    sizes: NDArray[np.float64],
) -> Crossing:
    """Return what goes on at the boundary equilibrium `u` on the surface of a transition.

    Parameters
    ----------
    problem : EquilibriumProblem
        The equations of the equilibrium's mode, one parameter active.
    transition : int
        The transition.
    u, tangent : ndarray, shape (n + 1,)
        The point and the branch's tangent there.
    sizes : ndarray, shape (n,)
        Typical sizes of the states.
    """
    system, n = problem.system, problem.n
    leaves = system.transitions[transition]
    mode = system.mode_index(leaves.target)
    gradient = problem.event(transition, u)[1]
    # the event function grows into the other mode
    way = float(leaves.direction) or float(np.sign(gradient @ tangent)) or 1.0
    inwards = -way * gradient
    if mode == problem.mode:
        return Crossing("", problem, None, -inwards, f"beyond it {leaves.name} resets the state")
    beside = problem.in_mode(mode)
    landed = problem.reset(transition, u)
    F, J = beside.evaluate(landed)
    own = problem.evaluate(u)[1]
    outwards = _regular_side(beside, landed, sizes, -inwards)
    A = own[:, :n]
    terms = (np.abs(J[:, :n]) + np.abs(A)) @ sizes
    if np.all(np.abs(F) <= FIELDS_MEET * np.maximum(terms, 1e-12 * terms.max())):
        # each branch's parameter, where its own event function grows to its regular side
        sides = [slope_of(A, own, inwards, sizes), slope_of(J[:, :n], J, outwards, sizes)]
        kind = "" if 0.0 in sides else PERSISTS if sides[0] * sides[1] < 0.0 else FOLDS
        return Crossing(kind, beside, landed, outwards)
    if np.array_equal(landed, u):
        weight = float(inwards[:n] @ _moved(A, F, sizes))
        kind = "" if weight == 0.0 else PERSISTS if weight < 0.0 else FOLDS
        return Crossing(kind, beside, None, -inwards, "the field jumps: what goes on is a pseudo-equilibrium")
    return Crossing("", beside, None, -inwards, f"its reset by {leaves.name} is no equilibrium")


def _regular_side(
    beside: EquilibriumProblem, u: NDArray[np.float64], sizes: NDArray[np.float64], otherwise: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the gradient towards the regular side of a mode: that of its own event which is met at `u`.

    A sliding mode ends where a rate vanishes, and the mode beyond it at the surface itself.
    """
    for k in beside.ways_out:
        height, gradient = beside.event(k, u)
        direction = beside.system.transitions[k].direction
        if direction and abs(height) <= MET * float(np.abs(gradient[: beside.n]) @ sizes):
            return -float(direction) * gradient
    return otherwise


def slope_of(
    A: NDArray[np.float64], J: NDArray[np.float64], inwards: NDArray[np.float64], sizes: NDArray[np.float64]
) -> float:
    """Return the sign of the parameter's change for which an equilibrium moves to the regular side; 0 for none."""
    n = A.shape[0]
    return float(np.sign(inwards[:n] @ _moved(A, -J[:, n], sizes) + inwards[n]))


def _moved(A: NDArray[np.float64], F: NDArray[np.float64], sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the states that a matrix takes to `F`, the least ones of several; equations and states in their units."""
    terms = np.abs(A) @ sizes
    rows = np.where(terms > 0.0, terms, float(terms.max()) or 1.0)
    return np.asarray(sizes * np.linalg.lstsq(A * sizes / rows[:, None], F / rows, rcond=SINGULAR_AT_ROUNDING)[0])
