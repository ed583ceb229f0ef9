"""Many points of a branch of equilibria at once: what the kernel has found, looked at as a whole.

docs/theory/equilibria.md, "Values within a step", explains what must not happen on the way.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.algebraic.products import combined, pairs
from saltus.continuation.core.monitor import Monitor
from saltus.continuation.core.value_tests import border_tests
from saltus.continuation.core.within_step import searched
from saltus.continuation.core.zero_problem import Examined, Point, cubic
from saltus.continuation.problems.point_data import PointData
from saltus.equilibria.spectrum import FAINT, NEUTRAL, sized_eigenvalues, terms_at
from saltus.scales import AXIS_REACHED, PARAMETER_RESTS, SEPARATED, TWO_ZEROS

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.arclength import StepControl
    from saltus.continuation.core.interest import Interest
    from saltus.equilibria.problem import EquilibriumProblem

__all__ = ["Stretch", "spectra"]

_MOST = 256  # points of one stretch
_LONG = 0.02  # arclength of a step from which on its ends do not tell how far values move within


class Stretch:
    """Points found by one call of the kernel, from the last two points of a branch.

    Parameters
    ----------
    problem : EquilibriumProblem
        The equations, one parameter active.
    before, point : Point
        The last two points.
    step : float
        Length of the first step.
    control : StepControl
        Sizes of the steps.
    branch : (Interest, sizes, origin, rows)
        Bounds, sizes of the states, the state at the start of the branch, and units of the equations' rows.

    Attributes
    ----------
    taken : int
        Points found.
    step : float
        Length of the step behind the last one.
    sizes : ndarray, shape (taken, n)
        Sizes of the states at each point.
    numbers : ndarray, shape (taken, 5)
        Sign and logarithm of the determinant, residual, iterations, arclength of the step.
    """

    def __init__(
        self,
        problem: EquilibriumProblem,
        before: Point,
        point: Point,
        step: float,
        control: StepControl,
        branch: tuple[Interest, NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]],
    ) -> None:
        from saltus.continuation.problems.kernels import stretch as kernels

        interest, sizes, origin, rows = branch
        n = problem.n
        self._interest, self._problem, self._rows = interest, problem, rows
        self._points, self._jacobians = np.empty((_MOST, 2, n + 1)), np.empty((_MOST, n, n + 1))
        numbers = np.empty((_MOST, 5))
        p = problem.compiled.extended(problem.p)
        active = np.array(problem.active, dtype=np.int64)
        system = (problem.compiled.addresses, problem.mode, p, active, problem.scales, rows)
        limits = (control.deviation, control.angle, control.largest, float(control.iterations))
        bounds = (interest.low, interest.high)
        found = (self._points, self._jacobians, numbers)
        gap = point.arc - before.arc
        self.taken, self.step = kernels.stretch(
            system, point.line, before.line, gap, step, limits, bounds, sizes.copy(), origin, found
        )
        self.numbers = numbers[: self.taken]
        away = np.abs(self._points[: self.taken, 0, :n] - origin)
        self.sizes = np.maximum.accumulate(np.vstack([sizes, away]), axis=0)[1:]
        self.values, self.unstable, self.top = _spectra(self._jacobians[: self.taken, :, :n])

    def quiet(self, before: Point, point: Point, log: float, names: tuple[Monitor, ...]) -> int:
        """Return how many of the points follow each other without any event, as far as can be told.

        Parameters
        ----------
        before, point : Point
            The last two points.
        log : float
            Logarithm of the determinant at the start of the branch.
        names : tuple of Monitor
            Test functions SN, BP, HB and the bounds, in this order.
        """
        t, n = self._points[: self.taken, :, -1], self._points.shape[2] - 1
        tests = np.empty((self.taken, len(names)))
        tests[:, 0] = np.where(np.abs(t[:, 1]) > PARAMETER_RESTS, t[:, 1], 0.0)
        tests[:, 1] = self.numbers[:, 0] * np.exp(np.clip(self.numbers[:, 1] - log, -600.0, 600.0))
        tests[:, 2] = _pair_products(self.values) if n > 1 else 1.0
        for k, bound in ((3, self._interest.low), (4, self._interest.high)):
            away = t[:, 0] - bound
            tests[:, k] = np.where(np.abs(away) > 1e-12, away, 0.0)
        self.tests = {name: tests[:, k] for k, name in enumerate(names) if n > 1 or name.kind != "HB"}
        known = [[old.examined.monitors.get(name, 1.0) for name in names] for old in (before, point)]
        table = np.vstack([known, tests])
        arcs = np.concatenate([[before.arc - point.arc, 0.0], np.cumsum(self.numbers[:, 4])])
        signs = np.sign(table)
        still = ((signs[1:] == signs[:-1]) & (signs[1:] != 0.0)).all(axis=1)[1:]
        still &= (np.abs(tests[:, 2]) > FAINT) & ~self._uneven()
        still &= self.unstable == np.concatenate([[point.examined.data.unstable], self.unstable[:-1]])
        still &= ~_returning(table, arcs)
        # a step is final when the next one does not show that zeros were passed over; so is the step to `point`
        passed = _returning(table[::-1], -arcs[::-1])[::-1]
        if passed.size and passed[0]:
            return 0
        still &= ~np.append(passed[1:], False)
        kept = int(np.argmin(still)) if not still.all() else self.taken
        return self._before_return(point, kept)

    def _uneven(self) -> NDArray[np.bool_]:
        """Return at which points some values are so slow that they have sizes of their own."""
        found = np.abs(self.values).min(axis=1, initial=np.inf) < SEPARATED * self.top
        for i in np.flatnonzero(found).tolist():
            terms = partial(terms_at, self._problem, self._points[i, 0])
            found[i] = bool(np.ptp(sized_eigenvalues(self._jacobians[i, :, :-1], terms)[1]) > 0.0)
            if found[i]:
                break  # no point behind it is kept
        return np.asarray(found)

    def _before_return(self, last: Point, kept: int) -> int:
        """Return how many of the first points come before a step in which values become critical at several places."""
        lengths = self.numbers[:kept, 4]
        unit = float(np.abs(last.examined.data.values).max(initial=0.0)) or 1.0
        table = np.asarray(np.vstack([last.examined.data.values, self.values[:kept]]) / unit, dtype=np.complex128)
        lines = np.concatenate([last.line[None], self._points[:kept]])
        for i in np.flatnonzero(_doubtful(table, lengths)).tolist():
            along = partial(cubic, lines[i], lines[i + 1], float(lengths[i]))
            within = partial(self._spectra_at, along, unit)
            if searched(within, [*table[i : i + 2]], (float(lengths[i]),), border_tests) is not False:
                return i
        return kept

    def _spectra_at(
        self, along: Callable[[NDArray[np.float64]], NDArray[np.float64]], unit: float, shares: NDArray[np.float64]
    ) -> NDArray[np.complex128]:
        return spectra(self._problem, along(shares[:, None])) / unit

    def points(self, last: Point, count: int) -> list[Point]:
        """Return the first `count` points, examined; `last` is the point before them."""
        arcs = last.arc + np.cumsum(self.numbers[:count, 4])
        weights = np.column_stack([1.0 / self.sizes[:count] ** 2, np.ones(count)])
        rows: list[Any] = self.numbers[:count].tolist()
        jacobians = self._jacobians[:count] / self._rows[:, None]
        columns = {name: values[:count].tolist() for name, values in self.tests.items()} if count else {}
        found = []
        for i, (sign, log, residual, iterations, _) in enumerate(rows):
            data = PointData(self.values[i], int(self.unstable[i]), np.full(self.values.shape[1], self.top[i]))
            examined = Examined({name: values[i] for name, values in columns.items()}, None, data)
            u, tangent = self._points[i]
            found.append(
                Point(
                    u, jacobians[i], tangent, weights[i], sign, log, residual, int(iterations), float(arcs[i]),
                    examined, last.frame,
                )
            )  # fmt: skip
        return found


def spectra(problem: EquilibriumProblem, places: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the eigenvalues at unknowns (places, n + 1), in any order; NaN where the Jacobian is not finite."""
    matrices = problem.matrices(places)
    finite = np.isfinite(matrices).all(axis=(1, 2))
    if finite.all():
        return np.linalg.eigvals(matrices).astype(np.complex128)
    values = np.full(matrices.shape[:2], complex(np.nan))
    values[finite] = np.linalg.eigvals(matrices[finite])
    return values


def _doubtful(values: NDArray[np.complex128], lengths: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return which steps are long, or have values near the imaginary axis for how far they move there and beside."""
    moved = np.abs(np.diff(values, axis=0)).max(axis=1, initial=0.0)
    most = np.maximum(moved, np.maximum(np.append(moved[1:], 0.0), np.append(0.0, moved[:-1])))
    near = np.abs(values.real).min(axis=1, initial=np.inf)
    return np.asarray((lengths > _LONG) | (np.minimum(near[:-1], near[1:]) < AXIS_REACHED * most))


def _spectra(
    matrices: NDArray[np.float64],
) -> tuple[NDArray[np.complex128], NDArray[np.int64], NDArray[np.float64]]:
    """Return the eigenvalues of matrices, the largest real part first, the counts of unstable ones, the top moduli."""
    if not len(matrices):
        return np.empty((0, matrices.shape[1]), complex), np.empty(0, np.int64), np.empty(0)
    values = np.linalg.eigvals(matrices).astype(np.complex128)
    order = np.lexsort((-values.imag, -values.real), axis=-1)
    values = np.take_along_axis(values, order, axis=-1)
    top = np.abs(values).max(axis=1, keepdims=True)
    return values, np.sum(values.real > NEUTRAL * top, axis=1), top[:, 0]


def _pair_products(values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return `saltus.equilibria.spectrum.pair_product` of many spectra."""
    first, second = pairs(values.shape[1])
    sizes = np.abs(values[:, first]) + np.abs(values[:, second])
    return combined((values[:, first] + values[:, second]) / np.where(sizes > 0.0, sizes, np.inf))


def _returning(table: NDArray[np.float64], arcs: NDArray[np.float64]) -> NDArray[np.bool_]:
    """Return for each step behind the first whether a test function may vanish twice in it.

    A parabola through three points, its curvature doubled, gives the least value of a function within the last step:
    as `saltus.continuation.core.arclength` judges a single step.
    """
    lengths = np.abs(arcs[1:] - arcs[:-1])[:, None]
    back, ahead = lengths[:-1], lengths[1:]
    moves = table[1:] - table[:-1]
    start, change = table[1:-1], moves[1:]
    dip = TWO_ZEROS * (change / ahead - moves[:-1] / back) / (ahead + back) * ahead * ahead
    side = np.where(start < 0.0, -1.0, 1.0)
    start, change, dip = start * side, change * side, dip * side
    least = 0.25 * (dip + change * change / np.where(dip > 0.0, dip, 1.0))
    turns = (start > 0.0) & (start > -change) & (np.abs(change) < dip) & (start + 0.5 * change < least)
    return np.asarray(turns.any(axis=1))
