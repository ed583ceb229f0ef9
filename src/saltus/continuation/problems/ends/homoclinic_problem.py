"""Homoclinic orbits of smooth flows, and cycles next to them, as a boundary value problem with projection conditions.

docs/theory/continuation.md, "Homoclinic orbits", derives the equations.

References
----------
Beyn, IMA J. Numer. Anal. 9 (1990) 379-405. Champneys, Kuznetsov, Sandstede, Int. J. Bifurcation Chaos 6 (1996) 867-887.
"""

from __future__ import annotations

import cmath
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.equilibria.problem import EquilibriumProblem
from saltus.equilibria.spectrum import NEUTRAL
from saltus.orbits.cuts import cut
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, CUT_END, Signature
from saltus.scales import ALGEBRAIC_RESIDUAL, NEWTON_AT_ROUNDING, SKEW, STALLED_AT_ROUNDING, STEP_AT_ROUNDING

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "NO_SADDLE",
    "Arc",
    "Saddle",
    "at_rest",
    "extended",
    "saddle_near",
    "saddle_node_near",
    "scaled_step",
    "solved",
    "tangent_spaces",
    "with_saddle",
]

NO_SADDLE = "its equilibrium is no saddle"  # why no homoclinic orbit is located: nothing leads to it and away again

_ITERATIONS = 25  # most Newton steps to an equilibrium or to an arc
_HALVINGS = 60  # bisections of the time in which the distance to a saddle shrinks to a given one


@dataclass(frozen=True, eq=False)
class Saddle:
    """A hyperbolic equilibrium with coordinates of its unstable and stable tangent spaces."""

    state: NDArray[np.float64]  # shape (n,): the equilibrium
    values: NDArray[np.complex128]  # shape (n,): eigenvalues
    # ways, coordinates: of the unstable and of the stable space: columns that span it, and rows that give a
    # difference's coordinates
    ways: tuple[NDArray[np.float64], NDArray[np.float64]]
    coordinates: tuple[NDArray[np.float64], NDArray[np.float64]]
    # eigenvalues of each space in the order of the coordinates, each with whether it belongs to a pair. Of a pair only
    # the upper one is listed.
    powers: tuple[tuple[tuple[complex, bool], ...], tuple[tuple[complex, bool], ...]]

    @property
    def fastest(self) -> float:
        """Largest real part of the eigenvalues, by which differences grow."""
        return float(self.values.real.max())

    def slowest(self, side: int) -> float:
        """Return the least rate at which coordinates of the unstable space (0) or of the stable one (1) change."""
        return min(abs(power.real) for power, _ in self.powers[side])

    def rates(self, side: int) -> NDArray[np.float64]:
        """Return the matrix of the linear equations in the coordinates of a space."""
        return _blocks(self.powers[side])

    def moved(self, side: int, time: float, spared: float = 0.0) -> NDArray[np.float64]:
        """Return the linear flow over a time in the coordinates of a space, times the exponential of `spared`."""
        return _blocks(tuple((cmath.exp(power * time + spared), paired) for power, paired in self.powers[side]))

    def time_to(self, side: int, at: NDArray[np.float64], distance: float) -> float:
        """Return the time, in the direction towards the saddle, in which coordinates shrink to a distance."""
        sign = -1.0 if side == 0 else 1.0
        high = 1.0 / self.slowest(side)
        while np.linalg.norm(self.moved(side, sign * high) @ at) > distance:
            high *= 2.0
        low = 0.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            near = np.linalg.norm(self.moved(side, sign * middle) @ at) <= distance
            low, high = (low, middle) if near else (middle, high)
        return high


def _blocks(values: tuple[tuple[complex, bool], ...]) -> NDArray[np.float64]:
    """Return the matrix with real numbers, and blocks of complex ones, on its diagonal."""
    parts = [
        np.array([[value.real, value.imag], [-value.imag, value.real]]) if paired else np.array([[value.real]])
        for value, paired in values
    ]
    size, at = sum(len(part) for part in parts), 0
    matrix = np.zeros((size, size))
    for part in parts:
        matrix[at : at + len(part), at : at + len(part)] = part
        at += len(part)
    return matrix


def tangent_spaces(A: NDArray[np.float64], state: NDArray[np.float64], sizes: NDArray[np.float64]) -> Saddle | str:
    """Return the saddle with the Jacobian `A`, in units of the states' sizes; why it is none otherwise."""
    values, vectors = np.linalg.eig(A * sizes / sizes[:, None])
    if np.any(np.abs(values.real) <= NEUTRAL * np.abs(values).max()):
        return "its equilibrium is not hyperbolic"
    if np.all(values.real > 0.0) or np.all(values.real < 0.0):
        return NO_SADDLE
    columns: list[NDArray[np.float64]] = []
    sides: list[bool] = []
    powers: tuple[list[tuple[complex, bool]], list[tuple[complex, bool]]] = ([], [])
    for value, vector in zip(values.tolist(), vectors.T, strict=True):
        if value.imag < 0.0:
            continue
        parts = [vector.real] if value.imag == 0.0 else [vector.real, vector.imag]
        columns += parts
        sides += [value.real < 0.0] * len(parts)
        powers[int(value.real < 0.0)].append((complex(value), value.imag > 0.0))
    V, stable = np.array(columns).T, np.array(sides)
    if not np.linalg.cond(V) < SKEW:
        return "eigenvalues of its equilibrium are too near each other"
    W = np.linalg.inv(V)
    ways = (V * sizes[:, None])[:, ~stable], (V * sizes[:, None])[:, stable]
    rows = (W / sizes)[~stable], (W / sizes)[stable]
    return Saddle(state, values, ways, rows, (tuple(powers[0]), tuple(powers[1])))


def at_rest(problem: OrbitProblem) -> EquilibriumProblem:
    """Return the equations of the equilibria in the mode of a smooth cycle, the parameter in the same unit."""
    mode = int(problem.modes[0])
    kept = problem.conserving.totals
    return EquilibriumProblem(problem.system, mode, problem.p, problem.active, problem.scales, kept)


def saddle_near(
    rest: EquilibriumProblem, x: NDArray[np.float64], value: float, sizes: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the equilibrium that Newton's method finds from a state at one value of the parameter, or None."""
    u = np.append(x, value)
    for _ in range(_ITERATIONS):
        F, J = rest.evaluate(u)
        try:
            step = np.linalg.solve(J[:, : rest.n], -F)
        except np.linalg.LinAlgError:
            return None
        size = float(np.max(np.abs(step) / sizes))
        if not size < 1e3:
            return None
        u[: rest.n] += step * min(1.0, 0.5 / max(size, 1e-300))
        if size < NEWTON_AT_ROUNDING:
            return u[: rest.n].copy()
    return u[: rest.n].copy() if size < STALLED_AT_ROUNDING else None


def saddle_node_near(
    rest: EquilibriumProblem, x: NDArray[np.float64], value: float, sizes: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the state and the parameter of the saddle-node that Newton's method finds from a state, or None."""
    n = rest.n
    A = rest.evaluate(np.append(x, value))[1][:, :n] * sizes / sizes[:, None]
    if not np.all(np.isfinite(A)):
        return None
    v = np.linalg.svd(A)[2][-1] * sizes
    row = v / sizes**2
    u = np.concatenate([x, [value], v])
    scale = np.concatenate([sizes, [max(abs(value), 1.0)], sizes])
    for _ in range(_ITERATIONS):
        F, J = rest.evaluate(u[: n + 1])
        bend = rest.second(u[: n + 1], np.append(u[n + 1 :], 0.0))
        G = np.concatenate([F, J[:, :n] @ u[n + 1 :], [row @ u[n + 1 :] - 1.0]])
        K = np.zeros((2 * n + 1, 2 * n + 1))
        K[:n, : n + 1] = J
        K[n : 2 * n, : n + 1], K[n : 2 * n, n + 1 :] = bend, J[:, :n]
        K[2 * n, n + 1 :] = row
        K *= scale
        rows = np.maximum(np.abs(K).max(axis=1), 1e-300)
        try:
            step = np.linalg.solve(K / rows[:, None], -G / rows)
        except np.linalg.LinAlgError:
            return None
        size = float(np.abs(step).max())
        if not size < 1e3:
            return None
        u = u + step * scale * min(1.0, 0.5 / max(size, 1e-300))
        if size < STALLED_AT_ROUNDING:
            return np.asarray(u[: n + 1])
    return None


@dataclass(frozen=True, eq=False)
class Arc:
    """An arc that leaves a saddle and comes back to it, cut in pieces."""

    problem: OrbitProblem  # the flow in the pieces, as that of a closed orbit; its closing equations are not used
    u: NDArray[np.float64]  # shape (size + 1,): each piece's initial state and duration, and the parameter
    saddle: Saddle  # the equilibrium
    radius: float  # distance of start and end from the saddle, in its coordinates
    sizes: NDArray[np.float64]  # shape (n,): typical sizes of the states
    # leaves, comes: unstable coordinates of the start, and stable coordinates of the end
    leaves: NDArray[np.float64]
    comes: NDArray[np.float64]

    @property
    def parameter(self) -> float:
        """The parameter, in the problem's unit."""
        return float(self.u[-1])

    @property
    def duration(self) -> float:
        """Time along the arc."""
        return float(self.u[self.problem.n : self.problem.size : self.problem.n + 1].sum())


def pieces_of(problem: OrbitProblem, u: NDArray[np.float64], count: int) -> OrbitProblem | None:
    """Return the equations of a closed orbit in `count` pieces like those of `problem`; None if they fail."""
    old = problem.signature
    kinds = (CLOSED_END,) + (CUT_END,) * (count - 1)
    signature = Signature(old.modes[:1] * count, (-1,) * count, kinds, 0)
    p = problem.p.copy()
    p[list(problem.active)] = u[-1:] * problem.scales
    made = OrbitProblem(problem.system, signature, p, problem.active, problem.scales, problem.tol)
    return made if made.start(u) is None else None


def solved(
    problem: OrbitProblem,
    u: NDArray[np.float64],
    state: NDArray[np.float64],
    radius: float,
    sizes: NDArray[np.float64],
    stay: float = math.inf,
) -> Arc | str:
    """Return the arc that closes through a saddle after a stay of a given time there, or why there is none.

    An infinite stay makes it a homoclinic orbit.

    Parameters
    ----------
    problem : OrbitProblem
        The flow in the pieces.
    u : ndarray, shape (size + 1,)
        Guess of the pieces and the parameter.
    state : ndarray, shape (n,)
        Guess of the equilibrium.
    radius : float
        Distance of start and end from the saddle.
    sizes : ndarray, shape (n,)
        Typical sizes of the states.
    stay : float, optional
        Time at the saddle between end and start.
    """
    n, m = problem.n, problem.size
    problem.resolve(u)  # meshes that fit the sensitivities, too
    u, rest = np.concatenate([u, state]), at_rest(problem)
    scale = np.concatenate([np.tile(np.append(sizes, 1.0), problem.segments), [1.0], sizes])
    scale[n : m : n + 1] = float(u[n : m : n + 1].sum())
    scale[m] = max(abs(float(u[m])), 1.0)
    previous = math.inf
    for _ in range(_ITERATIONS):
        found = _equations(problem, rest, u, (radius, stay, sizes))
        if isinstance(found, str):
            return found
        G, J, saddle, ends = found
        fine = problem.refine()
        made = scaled_step(G, J, scale)
        if isinstance(made, str):
            return made
        step, rows, size = made
        # next to the saddle rounding of the states moves the whole arc in time, by their rounding over the radius
        rounded = np.max(np.abs(G) / rows) <= ALGEBRAIC_RESIDUAL * max(1.0, float(np.max(np.abs(u / scale))))
        u = u + step * scale
        stalled = size > 0.3 * previous and size < (STEP_AT_ROUNDING if rounded else STALLED_AT_ROUNDING)
        if fine and (size < NEWTON_AT_ROUNDING or stalled):
            shifted = Saddle(u[m + 1 :], saddle.values, saddle.ways, saddle.coordinates, saddle.powers)
            return Arc(problem, u[: m + 1], shifted, radius, sizes, *ends)
        previous = size
    return "Newton's method does not converge"


def _equations(
    problem: OrbitProblem,
    rest: EquilibriumProblem,
    u: NDArray[np.float64],
    given: tuple[float, float, NDArray[np.float64]],
) -> tuple[NDArray[np.float64], NDArray[np.float64], Saddle, tuple[NDArray[np.float64], NDArray[np.float64]]] | str:
    """Return residual, Jacobian, saddle and the ends' coordinates; the derivative of the tangent spaces is left out."""
    radius, stay, sizes = given
    begun = with_saddle(problem, rest, u, sizes)
    if isinstance(begun, str):
        return begun
    G, K, F, J, saddle = begun
    n, m, state = problem.n, problem.size, saddle.state
    closing = slice(m - n - 1, m - 1)
    to_end = np.zeros((n, u.size))  # derivatives of the end's and the start's differences from the saddle
    to_end[:, : m + 1] = J[closing]
    to_end[:, :n] += np.eye(n)
    to_end[:, m + 1 :] -= np.eye(n)
    to_start = np.zeros((n, u.size))
    to_start[:, :n], to_start[:, m + 1 :] = np.eye(n), -np.eye(n)
    start, end = u[:n] - state, F[closing] + u[:n] - state
    (Wu, Ws), count = saddle.coordinates, len(saddle.coordinates[0])
    Eu, Es = (np.zeros((len(W), len(W))) for W in saddle.coordinates)
    if stay < math.inf:
        Eu, Es = saddle.moved(0, -stay), saddle.moved(1, stay)
    leaves, comes = Wu @ start, Ws @ end
    first = m - n - 1
    G[first : first + count], K[first : first + count] = Wu @ end - Eu @ leaves, Wu @ to_end - Eu @ Wu @ to_start
    G[first + count : first + n] = Ws @ start - Es @ comes
    K[first + count : first + n] = Ws @ to_start - Es @ Ws @ to_end
    G[n], K[n] = 0.5 * (leaves @ leaves / radius - radius), leaves / radius @ (Wu @ to_start)
    G[m], K[m] = 0.5 * (comes @ comes / radius - radius), comes / radius @ (Ws @ to_end)
    return G, K, saddle, (leaves, comes)


def scaled_step(
    G: NDArray[np.float64], K: NDArray[np.float64], scale: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], float] | str:
    """Return Newton's step over the scales of the unknowns, the sizes of the rows, and its size, or why there is none.

    The Jacobian `K` is scaled in place.
    """
    K *= scale
    rows = np.maximum(np.abs(K).max(axis=1), 1e-300)
    try:
        step = np.linalg.solve(K / rows[:, None], -G / rows)
    except np.linalg.LinAlgError:
        return "its equations are singular"
    size = float(np.abs(step).max())
    return (step, rows, size) if size < 10.0 else "Newton's method does not converge"


def with_saddle(
    problem: OrbitProblem, rest: EquilibriumProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64], Saddle] | str:
    """Return residual and Jacobian of an orbit and an equilibrium, those of the orbit, and the saddle, or why not.

    The unknowns are those of the orbit, the parameter, and the equilibrium's state. Row `problem.size` is left 0.
    """
    n, m = problem.n, problem.size
    F, J = problem.evaluate(u[: m + 1])
    if not (np.all(np.isfinite(F)) and np.all(np.isfinite(J))):
        return "its flow cannot be followed"
    state = u[m + 1 :]
    f, A = rest.evaluate(np.append(state, u[m]))
    saddle = tangent_spaces(A[:, :n], state, sizes)
    if isinstance(saddle, str):
        return saddle
    G, K = np.zeros(u.size), np.zeros((u.size, u.size))
    G[:m], K[:m, : m + 1] = F, J
    G[m + 1 :], K[m + 1 :, m], K[m + 1 :, m + 1 :] = f, A[:, n], A[:, :n]
    return G, K, F, J, saddle


def extended(arc: Arc, radius: float) -> tuple[OrbitProblem, NDArray[np.float64]] | str:
    """Return equations and guess of an arc that begins and ends nearer to its saddle, cut where it is sensitive."""
    n, saddle, problem = arc.problem.n, arc.saddle, arc.problem
    rows = arc.u[: problem.size].reshape(problem.segments, n + 1)
    before = saddle.time_to(0, arc.leaves, radius)
    after = saddle.time_to(1, arc.comes, radius)
    begin = saddle.state + saddle.ways[0] @ (saddle.moved(0, -before) @ arc.leaves)
    end = saddle.state + saddle.ways[1] @ arc.comes
    blocks = np.vstack([np.append(begin, before), rows, np.append(end, after)])
    return divided_up(problem, np.append(blocks.ravel(), arc.parameter))


def divided_up(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[OrbitProblem, NDArray[np.float64]] | str:
    """Return equations and unknowns of given pieces, each cut in half while it is too sensitive."""
    made = pieces_of(problem, u, (u.size - 1) // (problem.n + 1))
    if made is None:
        return "its flow cannot be followed"
    return cut(made, u, made.evaluate(u)[1])
