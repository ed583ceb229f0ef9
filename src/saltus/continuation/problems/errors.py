"""How far monitor functions of bifurcations may be wrong: by how much they change where what they follow from errs.

Of an algebraic problem unknowns and derivatives err by their rounding. Of orbits the derivatives of the flow err by
its tolerance. The changes are those of two fixed patterns of signs.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.equilibria.spectrum import sized_eigenvalues
from saltus.orbits.stability.floquet import multiplier_errors, nontrivial, with_errors
from saltus.scales import EPS, Verdict, zero

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.continuation.core.monitor import Monitor
    from saltus.continuation.core.zero_problem import Point
    from saltus.orbits.problem import OrbitProblem

__all__ = ["algebraic_error", "clear_of_one", "orbit_error", "spectral_error"]

_PATTERNS = (3, 5)  # multiplier in a pattern of signs
_OF_TANGENT = ("SN", "BP")  # kinds of monitor functions of the bordered Jacobian; all others evaluate the equations


def algebraic_error(self: Any, name: Monitor, point: Point) -> float:
    """Return how far a monitor function of algebraic equations may be wrong at a point."""
    if name.kind not in (*self.critical, "zeros", "flips", "pairs"):
        return 0.0
    at = _at if name.kind in _OF_TANGENT else _beside
    own = self.monitor(name, at(self, point, point.u, 0))
    if not math.isfinite(own):
        return math.inf
    nudged = (at(self, point, u, pattern) for u, pattern in zip(_nudged(self, point), _PATTERNS, strict=True))
    return float(max(abs(self.monitor(name, beside) - own) for beside in nudged))


def spectral_error(
    self: Any, point: Point, of: Callable[[NDArray[np.float64], NDArray[np.complex128]], float]
) -> float | None:
    """Return what `algebraic_error` does of a function of unknowns and eigenvalues of an equilibrium without laws.

    The eigenvalues are found at once. None where a derivative is not finite.
    """
    places = np.array([point.u, *_nudged(self, point)])
    matrices = self.problem.matrices(places)
    if not np.isfinite(matrices).all():
        return None
    rows = np.linalg.eigvals(matrices).astype(np.complex128)
    own, *others = (
        of(u, sized_eigenvalues(A, partial(self.terms, u), values)[0])
        for u, A, values in zip(places, matrices, rows, strict=True)
    )
    return max(abs(other - own) for other in others) if math.isfinite(own) else math.inf


def _nudged(self: Any, point: Point) -> Iterator[NDArray[np.float64]]:
    """Go through the unknowns of a point, changed by rounding in each pattern of signs."""
    scale = np.maximum(np.abs(point.u), EPS * self.scale())
    for pattern in _PATTERNS:
        yield point.u + EPS * _signs((point.u.size,), pattern) * scale


def _beside(self: Any, point: Point, u: NDArray[np.float64], pattern: int) -> Point:
    """Return a point with other unknowns, for monitor functions that evaluate the equations there themselves."""
    return replace(point, u=u)


def _at(self: Any, point: Point, u: NDArray[np.float64], pattern: int) -> Point:
    """Return a point with other unknowns, its derivatives changed by rounding in a pattern of signs; 0 for none."""
    from saltus.system.numba_tools.linear import bordered

    F, J = self.evaluate(u)
    J = J * (1.0 + EPS * _signs(J.shape, pattern)) if pattern else J
    steps, sign, log, _, _ = bordered(J, F, point.weights * point.tangent, u, u, self.scale())
    length = math.sqrt(float(point.weights @ steps[:, 1] ** 2))
    direction = steps[:, 1] / length if 0.0 < length < math.inf else point.tangent
    return replace(point, u=u, J=J, tangent=direction, sign=sign, log=log)


@lru_cache(maxsize=64)
def _signs(shape: tuple[int, ...], pattern: int) -> NDArray[np.float64]:
    places = np.arange(math.prod(shape)).reshape(shape)
    return np.where(pattern * places % 7 % 2, 1.0, -1.0)


def orbit_error(self: Any, name: Monitor, point: Point) -> float:
    """Return how far a monitor function of an orbit's bifurcations may be wrong at a point.

    Where no multiplier is at 1 within its error, the sign of the fold's function is clear. The parameter may move as
    slowly there as along a canard.
    """
    if name.kind != "SN" or point.examined.data is None:
        return 0.0
    J = self.own(point.J)
    if clear_of_one(self.problem, point.u, J, point.examined.data.multipliers):
        return 0.0
    if self.problem.signature.is_cut:  # the function is the product of the multipliers' distances from 1
        return math.inf
    along = [self.monitor(name, _turned(self, point, J)) for J in (point.J, with_errors(self.problem, point.J))]
    return abs(along[1] - along[0]) if all(map(math.isfinite, along)) else math.inf


def clear_of_one(
    problem: OrbitProblem,
    u: NDArray[np.float64],
    J: NDArray[np.float64],
    values: NDArray[np.complex128],
    least: float = 0.0,
) -> bool:
    """Return whether no multiplier but the trivial one is at 1 within its error, which is no less than `least`.

    At a grazing no multipliers are known, and none is clear.
    """
    if not values.size:
        return False
    inner = nontrivial(values, autonomous=problem.system.phase is None)
    errors = np.maximum(multiplier_errors(problem, u, J, values)[: inner.size], least)
    return all(zero(abs(v - 1.0), e) is Verdict.NO for v, e in zip(inner, errors, strict=True))


def _turned(self: Any, point: Point, J: NDArray[np.float64]) -> Point:
    """Return a point with the tangent that belongs to other derivatives."""
    from saltus.system.numba_tools.linear import bordered

    row, u = point.weights * point.tangent, point.u
    steps, sign, log, _, _ = bordered(J, np.zeros(len(J)), row, u, u, self.scale())
    direction = steps[:, 1] / math.sqrt(float(point.weights @ steps[:, 1] ** 2))
    return replace(point, J=J, tangent=direction, sign=sign, log=log)
