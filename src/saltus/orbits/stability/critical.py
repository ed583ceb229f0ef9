"""Conditions that make a periodic orbit critical: scalar equations with exact gradients, beside those of the orbit.

Each condition is a few scalars that vanish at a saddle-node, a period doubling, a torus bifurcation, a branch point or
a grazing. Conditions on multipliers come from bordered matrices of the linearised segment equations, durations not
eliminated. Let A be the derivative of all equations in this period's unknowns, and B that of the closing equations in
the next period's start. A multiplier mu makes A - mu B singular, and the scalar vanishes. Its gradient needs the second
derivatives of the equations along the null vector alone. See docs/theory/loci.md.

References
----------
Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, SIAM 2000, ch. 3 and 4 (bordered
matrices); Govaerts, Kuznetsov and Dhooge, SIAM J. Sci. Comput. 27 (2005) 231-252 (cycles). Departs from
them in the matrix: segment equations of a hybrid orbit take the place of the collocated boundary value problem, and
torus bifurcations are 2 m + 2 real equations in the cosine of the angle, regular at the resonances R1 and R2.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.records import events_of
from saltus.orbits.signature import EVENT_END, MEAN_END, SECTION, WHOLE, Survey
from saltus.scales import NEWTON_CONVERGED, TOUCHING, UNFORCED

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem
    from saltus.orbits.signature import EVENT_END, MEAN_END, SECTION, WHOLE, Survey

__all__ = [
    "Branching", "Critical", "Grazing", "TorusCondition", "closing", "openness", "scaling",
    "solve_branch_point", "touched", "vanishing_segment",
]  # fmt: skip

_DIFFERENCE = 2e-5  # change of an unknown, over its size, in differences of a condition

_ITERATIONS = 12  # Newton steps to a branch point, at most


def closing(problem: OrbitProblem) -> NDArray[np.float64]:
    """Return B, shape (size, size): minus the derivative of the closing equations in the next period's start."""
    B = np.zeros((problem.size, problem.size))
    last = problem.size - problem.n - 1
    B[last : last + problem.n, : problem.n] = np.eye(problem.n)
    return B


def scaling(problem: OrbitProblem, J: NDArray[np.float64], u: NDArray[np.float64]) -> tuple[
    NDArray[np.float64], NDArray[np.float64]
]:  # fmt: skip
    """Return typical sizes of the unknowns and the inverse ones of the equations, both of shape (size,)."""
    period = float(np.abs(u[problem.n : problem.size : problem.n + 1]).sum())
    columns = np.tile(np.append(problem.state_scale, period), problem.segments)
    rows = np.tile(np.append(problem.state_scale, 1.0), problem.segments)
    ends = np.abs(J[problem.n :: problem.n + 1, : problem.size] * columns).max(axis=1)
    rows[problem.n :: problem.n + 1] = np.where(ends > 0.0, ends, 1.0)
    return columns, 1.0 / rows


def _scaled(
    problem: OrbitProblem,
    mu: float,
    J: NDArray[np.float64],
    B: NDArray[np.float64],
    columns: NDArray[np.float64],
    equations: NDArray[np.float64],
) -> NDArray[np.float64]:
    """Return A - mu B in units of the unknowns and of the equations, shape (size, size)."""
    A = J[:, : problem.size] + (1.0 - mu) * B
    return np.asarray(equations[:, None] * A * columns)


def openness(problem: OrbitProblem, mu: float, u: NDArray[np.float64], J: NDArray[np.float64]) -> float:
    """Return the least singular value of A - mu B over the largest, in scaled unknowns and equations."""
    columns, equations = scaling(problem, J, u)
    values = np.linalg.svd(_scaled(problem, mu, J, closing(problem), columns, equations), compute_uv=False)
    return float(values[-1] / values[0])


class Critical:
    """A multiplier at 1 (``mu=1``: saddle-node) or at -1 (``mu=-1``: period doubling).

    Parameters
    ----------
    problem : OrbitProblem
        The equations.
    mu : float
        The critical multiplier.
    u, J : ndarray
        An orbit near the critical one, and the Jacobian there.

    Attributes
    ----------
    right, left : ndarray, shape (size,)
        Null vectors of A - mu B, of unit length in scaled unknowns and equations.
    bend : ndarray, shape (size, size + active)
        Derivative of the Jacobian times `right`.
    """

    extra, rows = 0, 1

    def __init__(self, problem: OrbitProblem, mu: float, u: NDArray[np.float64], J: NDArray[np.float64]) -> None:
        self.problem, self.mu = problem, mu
        self._B = closing(problem)
        self.columns, self._equations = scaling(problem, J, u)
        left, _, right = np.linalg.svd(self._matrix(J))
        self._b, self._c = left[:, -1], right[-1]

    def _matrix(self, J: NDArray[np.float64]) -> NDArray[np.float64]:
        return _scaled(self.problem, self.mu, J, self._B, self.columns, self._equations)

    def evaluate(
        self, u: NDArray[np.float64], extra: NDArray[np.float64], J: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the scalar and its gradient."""
        size = self.problem.size
        inverse = np.linalg.inv(_bordered(self._matrix(J), self._b[:, None], self._c[None, :]))
        v, w = inverse[:-1, -1], inverse[-1, :-1]
        self._v, self._w = v / np.linalg.norm(v), w / np.linalg.norm(w)
        self.right, self.left = self.columns * self._v, self._equations * self._w
        direction = np.zeros(u.size)
        direction[:size] = self.right
        self.bend = self.problem.second(u, direction)
        gradient = -(float(np.linalg.norm(v) * np.linalg.norm(w)) * self.left) @ self.bend
        return np.asarray(inverse[-1:, -1]), gradient[None, :], np.empty((1, 0))

    def adjust(self) -> None:
        """Take the borders from the null vectors last computed."""
        self._b, self._c = self._w, self._v

    def turn(self, u: NDArray[np.float64]) -> None:
        """Free the right border from shifts along the flow at `u`, before a cycle gets another phase plane.

        There the null vector is another by such a shift, and its product with the border stays positive: `twist` keeps
        its sign. The left null vector is orthogonal to shifts and stays.
        """
        problem, n = self.problem, self.problem.n
        durations = u[n : problem.size : n + 1]
        lasting = (self.mu - 1.0) * durations / durations.sum()
        sizes = 1.0 + np.append(0.0, np.cumsum(lasting)[:-1])
        shift = np.column_stack([sizes[:, None] * problem.flows_at_starts(u), lasting]).ravel() / self.columns
        across = self._c - float(shift @ self._c) / float(shift @ shift) * shift
        self._c = across / np.linalg.norm(across)

    def distance(self, J: NDArray[np.float64]) -> float:
        """Return how far A - mu B is from being singular: its least singular value over the next one."""
        values = np.linalg.svd(self._matrix(J), compute_uv=False)
        return float(values[-1] / values[-2])

    @property
    def twist(self) -> float:
        """Product of the left with the right null vector by B: zero where the multiplier is a double one."""
        return float(self._w @ (self._equations * (self._B @ self.right)))

    @property
    def curvature(self) -> float:
        """Second derivative of the equations, twice along the right null vector and by the left one: zero at a cusp."""
        return float(self.left @ self.bend[:, : self.problem.size] @ self.right)


class TorusCondition:
    """A pair of multipliers of product 1 and sum 2 kappa: on the unit circle where ``abs(kappa) < 1``.

    The further unknown is kappa, the cosine of the pair's angle. With a and b this period's and the next one's part of
    the critical plane, A a = B b and A b = B (2 kappa b - a).

    Parameters
    ----------
    problem : OrbitProblem
        The equations.
    kappa : float
        A guess.
    u, J : ndarray
        An orbit near the critical one, and the Jacobian there.
    """

    extra, rows = 1, 2

    def __init__(self, problem: OrbitProblem, kappa: float, u: NDArray[np.float64], J: NDArray[np.float64]) -> None:
        self.problem = problem
        self._B = closing(problem)
        self.columns, self._equations = scaling(problem, J, u)
        left, _, right = np.linalg.svd(self._matrix(J, kappa))
        self._b, self._c = left[:, -2:], right[-2:]

    def _matrix(self, J: NDArray[np.float64], kappa: float) -> NDArray[np.float64]:
        size = self.problem.size
        A = self._equations[:, None] * (J[:, :size] + self._B) * self.columns
        B = self._equations[:, None] * self._B * self.columns
        return np.block([[A, -B], [B, A - 2.0 * kappa * B]])

    def evaluate(
        self, u: NDArray[np.float64], extra: NDArray[np.float64], J: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the two scalars and their gradients.

        All four entries of the bordered matrix' Schur complement vanish together; the first column does so only then.
        """
        size, kappa = self.problem.size, float(extra[0])
        inverse = np.linalg.inv(_bordered(self._matrix(J, kappa), self._b, self._c))
        self._v, self._w = inverse[: 2 * size, -2:], inverse[-2:, : 2 * size]
        a, b = self.columns * self._v[:size, 0], self.columns * self._v[size:, 0]
        slopes = []
        for part in (a, b):
            direction = np.zeros(u.size)
            direction[:size] = part
            slopes.append(self._equations[:, None] * self.problem.second(u, direction))
        gradient = -(self._w[:, :size] @ slopes[0] + self._w[:, size:] @ slopes[1])
        turned = 2.0 * self._w[:, size:] @ (self._equations * (self._B @ b))
        return np.asarray(inverse[-2:, -2]), gradient, turned[:, None]

    def adjust(self) -> None:
        """Take the borders from the null spaces last computed."""
        self._b, self._c = np.linalg.qr(self._w.T)[0], np.linalg.qr(self._v)[0].T


class Branching:
    """A branch point: the Jacobian in the unknowns and one parameter has lost rank.

    The further unknown is an artificial forcing of the equations, by the left null vector; on a branch point it is 0.

    Parameters
    ----------
    problem : OrbitProblem
        The equations.
    active : int
        Index of the active parameter along which the branches run.
    u, J : ndarray
        An orbit near the branch point, and the Jacobian there.

    References
    ----------
    Moore, in Numerical Methods for Bifurcation Problems, Birkhaeuser 1984, 355-367 (unfolding by a forcing).
    """

    extra, rows = 1, 2

    def __init__(self, problem: OrbitProblem, active: int, u: NDArray[np.float64], J: NDArray[np.float64]) -> None:
        self.problem, self._at = problem, problem.size + active
        columns, self._equations = scaling(problem, J, u)
        self.columns = np.append(columns, 1.0)
        left, _, right = np.linalg.svd(self._matrix(J))
        self._b, self._c = left[:, -1], right[-2:]
        self.forcing = self._b / self._equations

    def _matrix(self, J: NDArray[np.float64]) -> NDArray[np.float64]:
        size = self.problem.size
        chosen = np.column_stack([J[:, :size], J[:, self._at]])
        return np.asarray(self._equations[:, None] * chosen * self.columns)

    def distance(self, J: NDArray[np.float64]) -> float:
        """Return how far the equations are from losing rank: their least singular value over the next one."""
        values = np.linalg.svd(self._matrix(J), compute_uv=False)
        return float(values[-1] / values[-2])

    def evaluate(
        self, u: NDArray[np.float64], extra: NDArray[np.float64], J: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the two scalars and their gradients."""
        size = self.problem.size
        inverse = np.linalg.inv(_bordered(self._matrix(J), self._b[:, None], self._c))
        self._v, w = inverse[:-1, -2:], inverse[-1, :-2]
        self.left = self._equations * w
        gradients, self.right = [], []
        for k in range(2):
            direction = np.zeros(u.size)
            direction[:size] = (self.columns * self._v[:, k])[:size]
            direction[self._at] = self._v[-1, k]
            self.right.append(direction)
            gradients.append(-self.left @ self.problem.second(u, direction))
        self._w = w / np.linalg.norm(w)
        return np.asarray(inverse[-1, -2:]), np.array(gradients), np.zeros((2, 1))

    def adjust(self) -> None:
        """Take the borders from the null spaces last computed."""
        self._b, self._c = self._w, np.linalg.qr(self._v)[0].T
        self.forcing = self._b / self._equations


class Grazing:
    """An orbit on the border of its signature.

    A segment has no length, or lies on a surface as a whole. Or an event is met without velocity, or where another one
    happens, or where the condition of its transition runs out. Or the condition of another transition begins to hold.

    Parameters
    ----------
    problem : OrbitProblem
        The equations.
    kind : {"duration", "side", "rate", "condition", "ahead", "behind", "unmet"}
        The quantity that vanishes.
    segment : int
        Index of its segment.
    transition : int, optional
        On whose surface the segment lies.
    """

    extra, rows = 0, 1

    def __init__(self, problem: OrbitProblem, kind: str, segment: int, transition: int = -1) -> None:
        self.problem, self.kind, self.segment, self.transition = problem, kind, segment, transition
        self.place = segment * (problem.n + 1) + problem.n

    def evaluate(
        self, u: NDArray[np.float64], extra: NDArray[np.float64], J: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the scalar and its gradient."""
        if self.kind == "duration":
            value, gradient = float(u[self.place]), np.zeros(u.size)
            gradient[self.place] = 1.0
        elif self.kind == "side":
            value, gradient = self.problem.distance(u, self.segment, self.transition)
        elif self.kind == "rate":
            value, gradient = self.problem.rate(u, self.segment)
        else:
            value, gradient = self._condition(u), self._slopes(u)
        return np.array([value]), gradient[None, :], np.empty((1, 0))

    def _condition(self, u: NDArray[np.float64]) -> float:
        survey = self.problem.survey(u)
        if self.kind == "condition":
            return float(survey.rates[self.segment, 3])
        return float(getattr(survey, self.kind)[self.segment, self.transition])

    def _slopes(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return central differences of the condition, whose derivatives are not compiled."""
        problem, count = self.problem, u.size - len(self.problem.active)
        period = float(np.abs(u[problem.n : problem.size : problem.n + 1]).sum())
        sizes = np.tile(np.append(problem.state_scale, period), problem.segments)
        steps = _DIFFERENCE * np.append(sizes, np.ones(u.size - count))
        gradient = np.empty(u.size)
        for k, step in enumerate(steps.tolist()):
            there = np.zeros(u.size)
            there[k] = step
            gradient[k] = (self._condition(u + there) - self._condition(u - there)) / (2.0 * step)
        problem.set_parameters(u)
        return gradient

    def left(self, survey: Survey) -> bool:
        """Whether an orbit that was on a surface as a whole has left it."""
        return self.kind == "side" and survey.places[self.segment, self.transition] != WHOLE

    def adjust(self) -> None:
        """Do nothing: there are no borders."""


def _bordered(
    matrix: NDArray[np.float64], columns: NDArray[np.float64], rows: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the matrix with columns to its right, rows below it, and zeros in the corner."""
    m, n = matrix.shape
    out = np.zeros((m + rows.shape[0], n + columns.shape[1]))
    out[:m, :n], out[:m, n:], out[m:, :n] = matrix, columns, rows
    return out


def solve_branch_point(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]
) -> NDArray[np.float64] | None:
    """Return the branch point near an orbit with one active parameter, shape (size + 1,); None where none persists.

    Where branches only come near each other, the equations meet the conditions under a forcing alone.
    """
    size = problem.size
    condition = Branching(problem, 0, u, J)
    scale, z = np.append(condition.columns, 1.0), np.append(u, 0.0)
    for _ in range(_ITERATIONS):
        F, J = problem.evaluate(z[: size + 1])
        values, gradient, further = condition.evaluate(z[: size + 1], z[size + 1 :], J)
        matrix = np.block([[J, condition.forcing[:, None]], [gradient, further]])
        residual = np.append(F + z[-1] * condition.forcing, values)
        try:
            step = np.linalg.solve(matrix, -residual)
        except np.linalg.LinAlgError:
            return None
        z += step
        if not np.all(np.isfinite(z)):
            return None
        length = float(np.max(np.abs(step) / scale))
        if length < NEWTON_CONVERGED and problem.refine():
            return z[: size + 1] if abs(z[-1]) < UNFORCED else None
        condition.adjust()
    return None


def vanishing_segment(problem: OrbitProblem, u: NDArray[np.float64], survey: Survey) -> tuple[str, int] | None:
    """Return kind and segment of the first vanishing duration, or else rate; None where none vanishes."""
    durations = np.abs(u[problem.n : problem.size : problem.n + 1])
    period = float(durations.sum())
    for i, kind in enumerate(problem.signature.kinds if problem.segments > 1 else ()):
        if kind in (EVENT_END, MEAN_END) and durations[i] < TOUCHING * period:
            return "duration", i
    for i, transition in enumerate(problem.signature.transitions):
        if transition >= 0:
            size = problem.event_size(transition, u[: problem.n])
            if abs(survey.rates[i, 0]) * period < TOUCHING * size:
                return "rate", i
    return None


def touched(problem: OrbitProblem, u: NDArray[np.float64], survey: Survey) -> str:
    """Return how an orbit touches a surface beyond which motions have other events; empty where it does not."""
    names = problem.system.transition_names
    if (vanishing := vanishing_segment(problem, u, survey)) is not None:
        kind, i = vanishing
        what = "has no duration" if kind == "duration" else "ends at its event without velocity"
        return f"segment {i}, up to {names[problem.signature.transitions[i]]!r}, {what}"
    least = np.abs(survey.margins).min(axis=0)
    for k in np.flatnonzero(np.isfinite(least)).tolist():
        size = problem.event_size(k, u[: problem.n])
        if least[k] < TOUCHING * size and events_of(problem.system).surfaces[k] != SECTION:
            return f"it touches the surface of {names[k]!r}"
    return ""
