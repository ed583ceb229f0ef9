"""Landings of an orbit's segments on surfaces: their residuals are measured in time, as where they are met steeply.

The duration of a segment has the rounding of its number. An upstroke may pass an event's surface at a rate of 1e15. No
duration brings the event function nearer to 0 there than this rounding times the rate.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias

import numpy as np

from saltus.errors import ConvergenceError
from saltus.orbits.common_sizes import left_by_rounding
from saltus.orbits.signature import EVENT_END
from saltus.scales import (
    EPS,
    ON_SURFACE,
    RESIDUAL_KEPT,
    RESIDUAL_SMALL,
    ROUNDINGS,
    STEP_AT_ROUNDING,
    UNFIT,
    followed,
)
from saltus.system.angles import TURN

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from saltus.orbits.signature import Signature, Survey
    from saltus.system import HybridSystem

    _Evaluated: TypeAlias = tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
    _Evaluate: TypeAlias = Callable[[NDArray[np.float64]], tuple[NDArray[np.float64], NDArray[np.float64]]]

__all__ = ["Landed", "before_poles", "fitted", "on_surfaces", "rounded", "steeply_met", "within_reach"]

_REMESHED = 12  # most times that meshes are moved
_MARGIN = 2.0  # distance from a pole of the field, over the least at which the flow has values
_FAR = 1e-6  # share of a duration within which a surface is searched for next to a step of Newton's method


class Equations(Protocol):
    """The equations of an orbit, as `saltus.orbits.problem.OrbitProblem` has them."""

    system: HybridSystem
    signature: Signature
    active: Sequence[int]
    scales: NDArray[np.float64]
    n: int
    size: int
    kinds: NDArray[np.int64]
    modes: NDArray[np.int64]
    transitions: NDArray[np.int64]
    extended: NDArray[np.float64]
    state_scale: NDArray[np.float64]
    tol: float

    @property
    def worst(self) -> float:
        """Largest error of a step."""

    def start(self, u: NDArray[np.float64]) -> int | None:
        """Make meshes."""

    def refine(self) -> bool:
        """Move meshes."""

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residual and Jacobian."""

    def parameters_at(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return all parameters."""

    def event_sizes(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return how much events vary."""

    def survey(self, u: NDArray[np.float64]) -> Survey:
        """Return what a dense look shows."""

    def event_size(self, transition: int, x: NDArray[np.float64]) -> float:
        """Return how much one event varies."""

    def dense(self) -> tuple[NDArray[np.float64], NDArray[np.int64], NDArray[np.float64], NDArray[np.float64]]:
        """Return the dense output."""


class Landed:
    """Events of an orbit that are met as exactly as the rounding of their segments' durations allows."""

    def __init__(self, problem: Equations) -> None:
        self.problem = problem
        self._last = np.arange(problem.n, problem.size, problem.n + 1)
        self._events = problem.kinds == EVENT_END
        self._met = np.zeros(self._last.size, dtype=bool)
        self.follows = False  # whether durations are sought in each step

    def left(self, F: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the residual `F` with 0 for events that are met."""
        if not self._met.any():
            return F
        left = F.copy()
        left[self._last[self._met]] = 0.0
        return left

    def within(self, u: NDArray[np.float64], F: NDArray[np.float64], J: NDArray[np.float64]) -> bool:
        """Return whether a residual is nothing but events within rounding of their time, which are met from now on."""
        met, last = self._met, self._last
        with np.errstate(invalid="ignore"):
            near = np.abs(F[last]) <= ROUNDINGS * EPS * np.abs(J[last, last]) * np.abs(u[last])
        self._met = met | (near & self._events)
        if float(np.abs(self.left(F)).max()) < RESIDUAL_SMALL:
            return True
        self._met = met
        return False

    def steep(self, u: NDArray[np.float64], J: NDArray[np.float64]) -> bool:
        """Return whether an event is met as `steeply_met` tells."""
        return bool(steeply_met(self.problem, u, J[self._last, self._last]).size)

    def on_any_mesh(self, u: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return unknowns whose flow has values on meshes made for them, too; `u` where it has."""
        held: Any = self.problem
        fresh = type(held)(held.system, held.signature, held.parameters_at(u), held.active, held.scales, held.tol)
        return before_poles(fresh, fresh.evaluate, u, followed(held.tol), afresh=True)[0]

    def sought(self, evaluate: _Evaluate, at: _Evaluated, step: NDArray[np.float64]) -> _Evaluated | None:
        """Return unknowns, residual and Jacobian next before a surface that no duration reaches; None where one does.

        Newton's step leads beyond the surface, or far before it, as a rounding of the duration does: the field has a
        pole right behind. Next to the step's own duration the surface's is searched for, by doubles and by halves.
        """
        u, F, J = at
        row = int(np.argmax(np.abs(F[self._last]) * self._events))
        place = self._last[row]
        if not (self._events[row] and float(np.abs(np.delete(self.left(F), place)).max(initial=0.0)) < RESIDUAL_SMALL):
            return None
        trial, sign = u + step, -np.sign(J[place, place])
        safe, end = ROUNDINGS * EPS * float(u[place]), float(trial[place])
        below, above, back = end, end, safe

        def before(duration: float) -> bool:
            trial[place] = duration
            value = float(fitted(self.problem, evaluate, trial)[0][place])
            return math.isfinite(value) and np.sign(value) == sign

        beyond = False
        while not before(below) and back < abs(step[place]) + _FAR * end:
            below, above, back, beyond = end - back, below, 2.0 * back, True
        back = safe
        while not beyond and before(above) and back < abs(step[place]) + _FAR * end:
            below, above, back = above, end + back, 2.0 * back
        while above - below > 2.0 * safe:
            middle = 0.5 * (below + above)
            below, above = (middle, above) if before(middle) else (below, middle)
        trial[place] = below - 2.0 * safe
        F, J = fitted(self.problem, evaluate, trial)
        if not (np.isfinite(F).all() and np.isfinite(J).all()):
            return None
        self._met[row] = self.follows = True
        return trial, F, J


def steeply_met(problem: Equations, u: NDArray[np.float64], rates: NDArray[np.float64]) -> NDArray[np.intp]:
    """Return the segments whose event function the flow's error in time moves by more than the size of its states.

    Parameters
    ----------
    rates : ndarray, shape (segments,)
        Rates of the event functions at their ends.
    """
    least, error, period = float(problem.state_scale.min()), followed(problem.tol), _period(problem, u)
    known = zip(problem.signature.kinds, rates.tolist(), strict=True)
    if not any(kind == EVENT_END and abs(rate) * error * period > least for kind, rate in known):
        return np.empty(0, dtype=np.intp)
    return np.flatnonzero(_moved(problem, u, rates) > problem.event_sizes(u))


def _moved(problem: Equations, u: NDArray[np.float64], rates: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far the flow's error in time moves the event functions; 0 of segments that end without one."""
    with np.errstate(invalid="ignore", over="ignore"):
        return np.where(problem.kinds == EVENT_END, np.abs(rates) * followed(problem.tol) * _period(problem, u), 0.0)


def _period(problem: Equations, u: NDArray[np.float64]) -> float:
    return float(np.abs(u[problem.n : problem.size : problem.n + 1]).sum())


def on_surfaces(problem: Equations, u: NDArray[np.float64], survey: Survey) -> Survey:
    """Return a survey whose residuals of events are in time, and whose extremes are on their surfaces.

    So it is where more is left than is kept, and the rate at the surface tells the time. A fast passage magnifies the
    rounding of a start. Gaps of the states stay what they are. The residuals there are shares of the period, in units
    of the largest state; all others stay. The state on the surface is taken along the flow, from where the segment
    ends.
    """
    left, least = survey.rates[:, 2], RESIDUAL_KEPT * float(problem.state_scale.min())
    if not any(value > least for value in left.tolist()):
        return survey
    period, n = _period(problem, u), problem.n
    with np.errstate(invalid="ignore", over="ignore"):
        off = (problem.kinds == EVENT_END) & (left > least) & (left <= _FAR * period * np.abs(survey.rates[:, 0]))
    if not off.any():
        return survey
    sizes, moved = problem.event_sizes(u), _moved(problem, u, survey.rates[:, 0])
    places = np.flatnonzero(off & (left > RESIDUAL_KEPT * sizes))
    lows, highs, rates = survey.lows.copy(), survey.highs.copy(), survey.rates.copy()
    _, starts, nodes, _ = problem.dense()
    compiled, p = problem.system.compiled, problem.extended
    for i in places.tolist():
        end, mode, event = np.ascontiguousarray(nodes[starts[i + 1] - 1]), int(problem.modes[i]), np.empty(2 + 2 * n)
        field = np.empty(n)
        compiled.call("event_x", int(problem.transitions[i]), 0, end, p, event)
        compiled.call("field", mode, 0, end, p, field)
        late = float(event[0] / event[1])
        there = end - field * late
        for bounds in (lows, highs):
            bounds[:n] = np.where(bounds[:n] == end, there, bounds[:n])
        if rates[i, 2] == abs(event[0]):
            share = abs(late) / period * float(problem.state_scale.max())
            # on a surface that the flow's error in time leads away from, the states' gap is that of this error
            steep = moved[i] > ON_SURFACE * sizes[i]
            rates[i, 2] = share if steep else max(share, _gap(problem, u, i, there))
    return survey._replace(lows=lows, highs=highs, rates=rates)


def _gap(problem: Equations, u: NDArray[np.float64], i: int, there: NDArray[np.float64]) -> float:
    """Return how far a segment misses the start of the next one, from a state on its surface, but for the phase."""
    system, n, count = problem.system, problem.n, len(problem.modes)
    after, following = np.empty(n), (i + 1) % count * (n + 1)
    system.compiled.call("reset", int(problem.transitions[i]), 0, there, problem.extended, after)
    apart = after - u[following : following + n]
    apart[system.angle_places] -= TURN * np.round(apart[system.angle_places] / TURN)
    return float(np.abs(apart[: len(system.states)]).max(initial=0.0))


def before_poles(
    problem: Equations, evaluate: _Evaluate, u: NDArray[np.float64], most: float, *, afresh: bool = False
) -> _Evaluated:
    """Return unknowns, residual and Jacobian with durations up to events shortened until the flow has values.

    Another mesh leaves another error in the time of a pole, which may lie less than that behind a surface.

    Parameters
    ----------
    most : float
        Largest share by which durations are shortened.
    afresh : bool, optional
        Whether meshes are made for these.
    """
    last = np.arange(problem.n, problem.size, problem.n + 1)[problem.kinds == EVENT_END]
    given, share, settled = u, 0.5 * ROUNDINGS * EPS, False
    while True:
        blocked = problem.start(u) if afresh else None
        F, J = fitted(problem, evaluate, u)
        finite = blocked is None and bool(np.isfinite(F).all() and np.isfinite(J).all())
        if settled or not last.size or share > most:
            return u, F, J
        settled = finite and u is not given
        if finite and u is given:
            return u, F, J
        share *= _MARGIN if finite else 2.0
        u = given.copy()
        u[last] *= 1.0 - share


def fitted(
    problem: Equations,
    evaluate: _Evaluate,
    u: NDArray[np.float64],
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return what `evaluate` does, on meshes moved until they are not far too coarse for the sensitivities."""
    F, J = evaluate(u)
    for _ in range(_REMESHED):
        if not UNFIT < problem.worst < np.inf:
            break
        problem.refine()
        F, J = evaluate(u)
    return F, J


def rounded(problem: Equations, length: float, left: float, found: tuple[NDArray[np.float64], ...]) -> bool:
    """Return whether a step of a length leaves a residual that need not fall any more; found: F, J, unknowns' sizes."""
    least = RESIDUAL_SMALL * float(problem.state_scale.max())
    return (length < STEP_AT_ROUNDING and left < least) or left_by_rounding(*found)


def within_reach(problem: Equations, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return unknowns whose flow can be followed: durations that run into a singularity of the field are shortened."""
    u = u.copy()
    for _ in range(40):
        blocked = problem.start(u)
        if blocked is None:
            return u
        u[blocked * (problem.n + 1) + problem.n] *= 0.97
    hint = "the field is singular or the state diverges there"
    raise ConvergenceError("flow of a segment", math.inf, 0, hint)
