"""Sequential quadratic programming within a box that shrinks where a function cannot be evaluated.

Each step is the least place of a quadratic model under linearised constraints. SciPy's SLSQP solves the same models,
but it has no answer to a place that has no value.

References
----------
Nocedal and Wright, Numerical Optimization, Springer 2006, ch. 18 (merit function, second-order corrections); Powell,
Lecture Notes in Mathematics 630 (1978) 144-157 (damped updates).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from saltus.optimisation.quadratic import lagrange_multipliers, least_quadratic, reachable_share

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["ACTIVE", "HELD", "At", "Box", "Ended", "Local", "optimality", "searched", "violation"]

ACTIVE = 1e-6  # height of a constraint, in its unit, up to which it is active
HELD = 1e-9  # multiplier, in units, from which a constraint holds the place
_MET = 1e-9  # violation, in a constraint's unit, that is rounding
_FOUND = 1e-11  # what is left of the gradient, in the objective's unit, at an optimum
_ROUGH = 1e-5  # the same where rounding ends the search
_ROUNDING = 1e-12  # change of the merit function, over its size, that is rounding
_LESS = 0.9  # share of what is left of the gradient to which a step must reduce it where values are rounding
_REFUSED = 1e-9  # size of a step at which nothing is found, in units, that ends the search
_LEAST = 1e-11  # size of any step, in units, that ends the search
_TAKEN = 1e-4  # share of the expected improvement with which a step is taken
_GOOD = 0.75  # the same, with which the box grows
_KEPT = 0.9  # share of what can be repaired in a step that it is asked to repair
_STUCK = 1e-8  # shrinking of a violation, over the step, up to which no step repairs it
_CURVED = 1e-2  # least curvature of a model in widths of the box, over the slope: its own step is 100 widths
_FLAT = 1e-30  # slope of the objective within the box, at the least, as a divisor


@dataclass(frozen=True)
class Local:
    """What is known at a place, to first order."""

    place: NDArray[np.float64]  # shape (n,): the place
    objective: float  # what is to be least
    gradient: NDArray[np.float64]  # shape (n,): its derivatives
    values: NDArray[np.float64]  # shape (m,): constraints, which are to be 0 or above
    jacobian: NDArray[np.float64]  # shape (m, n): their derivatives
    data: Any = None  # what the place stands for


At: TypeAlias = Callable[["NDArray[np.float64]", Local], "Local | str"]  # the place near a known one, or why it is none


@dataclass(frozen=True)
class Box:
    """Bounds of the place, the half width of the first step's box, and how many places are looked at, at most."""

    low: NDArray[np.float64]
    high: NDArray[np.float64]
    reach: float = 0.1
    most: int = 200

    def around(self, place: NDArray[np.float64], radius: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the least and greatest steps from a place."""
        return np.maximum(self.low - place, -radius), np.minimum(self.high - place, radius)

    def rows(self, local: Local) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return all constraints at a place, the bounds last: values and derivatives."""
        one = np.eye(len(self.low))
        lower, upper = np.flatnonzero(np.isfinite(self.low)), np.flatnonzero(np.isfinite(self.high))
        heights = np.concatenate([local.values, (local.place - self.low)[lower], (self.high - local.place)[upper]])
        return heights, np.vstack([local.jacobian, one[lower], -one[upper]])


@dataclass
class Ended:
    """Where a search ended."""

    best: Local  # the last place that was taken
    path: list[Local] = field(default_factory=list)  # all places that were taken, the start first
    looked: int = 0  # places that were looked at
    why: str = "most"  # ``found``, ``refused``, ``stuck``, ``infeasible``, ``most`` or ``interrupted``
    refused: str = ""  # why the last place that was refused is none
    height: float = ACTIVE  # of a constraint, up to which it is active at the end
    corner: bool = False  # whether the objective has no derivatives at the end; those next to it stand there


def violation(local: Local) -> float:
    """Return the largest violation of a constraint."""
    return float(np.max(-local.values, initial=0.0))


def optimality(local: Local, box: Box, height: float = ACTIVE) -> tuple[float, NDArray[np.float64]]:
    """Return what is left of the gradient beside active constraints, and all multipliers, those of bounds last.

    What is left is at least the largest height of a constraint that holds the place: at an optimum this is 0, too.
    """
    heights, rows = box.rows(local)
    active = np.flatnonzero(heights <= height)
    found, left = lagrange_multipliers(local.gradient, rows[active])
    multipliers = np.zeros(len(heights))
    multipliers[active] = found
    away = np.abs(heights[multipliers > HELD])
    return max(float(np.abs(left).max()), float(away.max(initial=0.0))), multipliers


def searched(at: At, start: Local, box: Box) -> Ended:
    """Return where the search for a least value ends.

    Parameters
    ----------
    at : callable
        Returns what is known at a place near one that is known, or why nothing is.
    start : Local
        Where it begins; constraints may be violated.
    box : Box
        Bounds and limits.
    """
    ended = Ended(start, [start])
    search = _Search(at, box, ended, np.eye(len(start.place)), np.zeros(len(start.values)), box.reach)
    try:
        while ended.looked < box.most and search.goes_on():
            pass
    except KeyboardInterrupt:
        ended.why = "interrupted"
    return ended


@dataclass
class _Search:
    """A search under way: model, weights of violations in the merit function, half width of the box."""

    at: At
    box: Box
    ended: Ended
    hessian: NDArray[np.float64]
    weights: NDArray[np.float64]
    radius: float
    updated: bool = False

    def goes_on(self) -> bool:
        """Take or reject one step; return whether the search goes on."""
        here, ended = self.ended.best, self.ended
        if violation(here) <= _MET and optimality(here, self.box)[0] <= _FOUND:
            return self._end(self._settled(here))
        step = self._step(here, here.values)
        if step is None:
            return self._end("infeasible")
        d, multipliers = step
        self.weights = np.maximum(self.weights, 2.0 * multipliers)
        expected = self._expected(here, d)
        size = 1.0 + abs(here.objective)
        if float(np.abs(d).max()) < _LEAST or not expected > 0.0:
            return self._end(self._settled(here))
        there = self._look(here.place + d, here)
        if isinstance(there, str):
            ended.refused, self.radius = there, 0.25 * float(np.abs(d).max())
            return self.radius >= _REFUSED or self._end(self._refused(here))
        gained = self._merit(here) - self._merit(there)
        if gained < _TAKEN * expected and violation(there) > violation(here):
            there = self._corrected(here, there, d) or there
            gained = self._merit(here) - self._merit(there)
        if abs(gained) <= _ROUNDING * size or expected <= _ROUNDING * size:
            if not self._residual(there) < _LESS * self._residual(here):
                return self._end(self._settled(here))
        elif gained < _TAKEN * expected:
            self.radius = 0.25 * float(np.abs(d).max())
            return self.radius >= _LEAST or self._end(self._settled(here))
        self._take(here, there, multipliers)
        if gained > _GOOD * expected and float(np.abs(d).max()) > 0.9 * self.radius:
            self.radius *= 2.0
        return True

    def _end(self, why: str) -> bool:
        self.ended.why = why
        return False

    def _settled(self, here: Local) -> str:
        """Return how a search ended whose steps lead no further."""
        if violation(here) > 1e2 * _MET:
            return "infeasible"
        known = self._beside_corner(here)
        return "found" if optimality(known, self.box)[0] <= _ROUGH else "stuck"

    def _beside_corner(self, here: Local) -> Local:
        """Return a place on bounds with the derivatives next to it, where it has none itself; the search ends there.

        The greatest x of an orbit that shrinks to a rest has a corner there: which of all equal x is the greatest is
        rounding, and so are the derivatives.
        """
        low, high = self.box.around(here.place, _ROUGH)
        inward = np.where(high > -low, high, 0.0) + np.where(high < -low, low, 0.0)
        there = self._look(here.place + inward, here) if np.any(inward) else ""
        if isinstance(there, str) or not there.objective > here.objective:
            return here
        if np.abs(there.gradient - here.gradient).max() <= np.sqrt(_ROUGH) * np.abs(there.gradient).max():
            return here
        known = replace(here, gradient=there.gradient, jacobian=there.jacobian)
        self.ended.best, self.ended.corner = known, True
        return known

    def _refused(self, here: Local) -> str:
        """Return how a search ended next to places that are none: with an optimum, where bounds hold this place.

        A bound may be where orbits end, as at a grazing or at rest: no step comes to it.
        """
        if violation(here) > 1e2 * _MET or optimality(here, self.box, _ROUGH)[0] > _ROUGH:
            return "refused"
        self.ended.height = _ROUGH
        return "found"

    def _residual(self, local: Local) -> float:
        return optimality(local, self.box)[0] + violation(local)

    def _look(self, place: NDArray[np.float64], near: Local) -> Local | str:
        self.ended.looked += 1
        return self.at(np.clip(place, self.box.low, self.box.high), near)

    def _step(self, here: Local, values: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """Return the model's best step and the constraints' multipliers; None where no step repairs a violation."""
        low, high = self.box.around(here.place, self.radius)
        share = reachable_share(values, here.jacobian, low, high)
        short = float(np.max(-values, initial=0.0))
        if short > _MET and share < 0.5 and share * short <= _STUCK * self.radius:
            return None
        left = (0.0 if share == 1.0 else 1.0 - _KEPT * share) * np.minimum(values, 0.0)
        one = np.eye(len(low))
        # in widths of the box, the slope of the objective 1
        wide, steep = self.radius, max(float(np.abs(here.gradient).max()) * self.radius, _FLAT)
        rows = np.vstack([here.jacobian * wide, one, -one])
        least = np.concatenate([left - values, low / wide, -high / wide])
        hessian = _curved(self.hessian * wide**2 / steep)
        found = least_quadratic(hessian, here.gradient * wide / steep, rows, least)
        if found is None:  # rounding of what is just reachable: ask for a little less
            least[: len(values)] -= 1e-9 * (1.0 + np.abs(values))
            found = least_quadratic(hessian, here.gradient * wide / steep, rows, least)
        return None if found is None else (np.clip(found[0] * wide, low, high), steep * found[1][: len(values)])

    def _corrected(self, here: Local, there: Local, d: NDArray[np.float64]) -> Local | None:
        """Return a place with the curvature of the constraints taken into account; None where it is none."""
        step = self._step(here, there.values - here.jacobian @ d)
        found = None if step is None else self._look(here.place + step[0], here)
        return found if isinstance(found, Local) else None

    def _merit(self, local: Local) -> float:
        return local.objective + float(self.weights @ np.maximum(-local.values, 0.0))

    def _expected(self, here: Local, d: NDArray[np.float64]) -> float:
        """Return by how much the model expects the merit function to fall in a step."""
        falls = np.maximum(-here.values, 0.0) - np.maximum(-(here.values + here.jacobian @ d), 0.0)
        return float(self.weights @ falls) - float(here.gradient @ d + 0.5 * d @ self.hessian @ d)

    def _take(self, here: Local, there: Local, multipliers: NDArray[np.float64]) -> None:
        """Go on from the end of a step, with the curvature that was met on it."""
        s = there.place - here.place
        y = there.gradient - here.gradient - (there.jacobian - here.jacobian).T @ multipliers
        along, size = float(s @ y), float(s @ s)
        if not self.updated and along > 0.0:
            self.hessian, self.updated = np.eye(len(s)) * float(y @ y) / along, True
        bent = self.hessian @ s
        curved = float(s @ bent)
        share = 1.0 if along >= 0.2 * curved else 0.8 * curved / (curved - along)
        y = share * y + (1.0 - share) * bent
        if float(s @ y) > _FLAT * size:
            self.hessian = self.hessian - np.outer(bent, bent) / curved + np.outer(y, y) / float(s @ y)
        self.ended.best = replace(there)
        self.ended.path.append(there)


def _curved(hessian: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a model whose own step, without bounds, is not many times longer than the box."""
    sizes, directions = np.linalg.eigh(hessian)
    return np.asarray((directions * np.maximum(sizes, _CURVED)) @ directions.T)
