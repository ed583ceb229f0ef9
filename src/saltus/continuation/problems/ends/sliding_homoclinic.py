"""Cycles with events whose period grows without bound, as they come to an equilibrium of one of their modes.

A segment may begin ever nearer to an equilibrium from which all motions of its mode depart, as next to a pseudo-saddle.
Or it passes ever more slowly where a saddle-node of equilibria is about to appear.
docs/theory/continuation.md, "Homoclinic orbits with events", derives the equations.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from saltus.continuation.problems.ends.homoclinic_problem import saddle_near, scaled_step, tangent_spaces, with_saddle
from saltus.equilibria.problem import EquilibriumProblem
from saltus.orbits.problem import OrbitProblem
from saltus.scales import NEWTON_AT_ROUNDING, PASSES, STALLED_AT_ROUNDING

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.problems.ends.homoclinic_problem import Saddle

__all__ = ["landing_on", "rest_in", "slowest_segment"]

_ITERATIONS = 25  # most Newton steps


def slowest_segment(problem: OrbitProblem, u: NDArray[np.float64]) -> int:
    """Return the segment of a cycle with events that lasts longest."""
    return int(np.argmax(u[problem.n : problem.size : problem.n + 1]))


def rest_in(problem: OrbitProblem, segment: int) -> EquilibriumProblem:
    """Return the equations of the equilibria in a segment's mode, the parameter in the same unit."""
    mode, kept = int(problem.modes[segment]), problem.conserving.totals
    return EquilibriumProblem(problem.system, mode, problem.p, problem.active, problem.scales, kept)


def landing_on(
    problem: OrbitProblem, u: NDArray[np.float64], segment: int, sizes: NDArray[np.float64]
) -> tuple[NDArray[np.float64], float, Saddle, float] | str:
    """Return the orbit whose segment begins at an equilibrium from which all motions of its mode depart.

    Parameters
    ----------
    problem : OrbitProblem
        Equations of the cycles, without cuts.
    u : ndarray, shape (size + 1,)
        The last cycle of a branch.
    segment : int
        The segment that lasts ever longer.
    sizes : ndarray, shape (n,)
        Typical sizes of the states.

    Returns
    -------
    tuple of (ndarray, float, Saddle, float)
        The equilibrium, the parameter, its tangent spaces, and the parameter's last change. Where there is none, why.
    """
    n, size = problem.n, problem.size
    rest = rest_in(problem, segment)
    begins = segment * (n + 1)
    state = saddle_near(rest, u[begins : begins + n], float(u[size]), sizes)
    if state is None or not float(np.max(np.abs(state - u[begins : begins + n]) / sizes)) < PASSES:
        return "no equilibrium is near the cycle"
    saddle = tangent_spaces(rest.evaluate(np.append(state, u[size]))[1][:, :n], state, sizes)
    if isinstance(saddle, str):
        return saddle
    # across a sliding surface motions are pulled back to it: that direction is no motion's of the mode
    if len(saddle.coordinates[0]) != n - int(_slides(problem, segment)):
        return "motions of its mode come to the equilibrium, too"
    guess = _away(problem, u, segment, saddle)
    return guess if isinstance(guess, str) else _solved(*guess, rest, segment, (saddle, sizes))


def _slides(problem: OrbitProblem, segment: int) -> bool:
    system = problem.system
    return system.modes[system.mode_names[problem.modes[segment]]].surface is not None


def _away(
    problem: OrbitProblem, u: NDArray[np.float64], segment: int, saddle: Saddle
) -> tuple[OrbitProblem, NDArray[np.float64], float] | str:
    """Return equations, the cycle without its stay at the equilibrium, and how far from it the segment then begins."""
    n = problem.n
    problem.survey(u)
    places, starts, nodes, _ = problem.dense()
    own = slice(starts[segment], starts[segment + 1])
    far = np.linalg.norm((nodes[own] - saddle.state) @ saddle.coordinates[0].T, axis=1)
    if not far[0] < far.max() or int(np.argmax(far)) < 1:
        return "the cycle does not leave the equilibrium"
    most = int(np.argmax(far))
    at = int(np.argmin(np.abs(np.log(far[:most] / math.sqrt(far[0] * far[most])))))
    s = float(places[own][at])
    begins, moved = segment * (n + 1), u.copy()
    moved[begins : begins + n] = nodes[own][at]
    moved[begins + n] *= 1.0 - s * s * (3.0 - 2.0 * s)
    p = problem.parameters_at(u)
    made = OrbitProblem(problem.system, problem.signature, p, problem.active, problem.scales, problem.tol)
    if made.start(moved) is not None:
        return "its flow cannot be followed"
    return made, moved, float(far[at])


def _solved(
    problem: OrbitProblem,
    u: NDArray[np.float64],
    radius: float,
    rest: EquilibriumProblem,
    segment: int,
    given: tuple[Saddle, NDArray[np.float64]],
) -> tuple[NDArray[np.float64], float, Saddle, float] | str:
    """Return what `landing_on` does, from a guess without the stay.

    The segment begins at a given distance in the unstable space, and its own landing has no unstable coordinate.
    """
    saddle, sizes = given
    n, m = problem.n, problem.size
    problem.resolve(u)
    u = np.append(u, saddle.state)
    scale = np.concatenate([np.tile(np.append(sizes, 1.0), problem.segments), [1.0], sizes])
    scale[n : m : n + 1] = np.maximum(np.abs(u[n : m : n + 1]), float(u[n : m : n + 1].sum()) / problem.segments)
    scale[m] = max(abs(float(u[m])), 1.0)
    previous = math.inf
    for _ in range(_ITERATIONS):
        made = _equations(problem, rest, u, segment, (radius, sizes))
        if isinstance(made, str):
            return made
        G, K, saddle = made
        fine = problem.refine()
        taken = scaled_step(G, K, scale)
        if isinstance(taken, str):
            return taken
        step, _, size = taken
        u = u + step * scale
        stalled = size > 0.3 * previous and size < STALLED_AT_ROUNDING
        if fine and (size < NEWTON_AT_ROUNDING or stalled):
            return u[m + 1 :], float(u[m]), saddle, float(abs(step[m]) * scale[m])
        previous = size
    return "Newton's method does not converge"


def _equations(
    problem: OrbitProblem,
    rest: EquilibriumProblem,
    u: NDArray[np.float64],
    segment: int,
    given: tuple[float, NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.float64], Saddle] | str:
    """Return residual, Jacobian and saddle; the derivative of the tangent spaces is left out."""
    radius, sizes = given
    begun = with_saddle(problem, rest, u, sizes)
    if isinstance(begun, str):
        return begun
    G, K, F, J, saddle = begun
    n, m, state = problem.n, problem.size, saddle.state
    begins = segment * (n + 1)
    closing = slice((begins - n - 1) % m, (begins - n - 1) % m + n)  # how far the landing is from the segment's start
    to_start = np.zeros((n, u.size))
    to_start[:, begins : begins + n], to_start[:, m + 1 :] = np.eye(n), -np.eye(n)
    to_landing = to_start.copy()
    to_landing[:, : m + 1] += J[closing]
    start = u[begins : begins + n] - state
    landing = F[closing] + start
    Wu, Ws = saddle.coordinates
    count, leaves = len(Wu), Wu @ start
    first = closing.start
    G[first : first + count], K[first : first + count] = Wu @ landing, Wu @ to_landing
    G[first + count : first + n], K[first + count : first + n] = Ws @ start, Ws @ to_start
    G[m], K[m] = 0.5 * (leaves @ leaves / radius - radius), leaves / radius @ (Wu @ to_start)
    return G, K, saddle
