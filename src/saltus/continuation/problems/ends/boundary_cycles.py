"""Cycles that are born at a boundary equilibrium, by the linear flows on both sides of its surface.

docs/theory/equilibria.md, "Cycles at a boundary equilibrium", derives the equations.

References
----------
Simpson and Meiss, Phys. Lett. A 371 (2007) 213-220 (continuous fields). Kuznetsov, Rinaldi and Gragnani, Int. J.
Bifurcation Chaos 13 (2003) 2157-2188 (planar Filippov systems).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from scipy.linalg import expm
from scipy.optimize import brentq

from saltus.errors import ConvergenceError, InputError
from saltus.orbits.solve import solve_orbit
from saltus.scales import FIELDS_MEET, MET, SOLVED, TURN_GROWN, TURN_RESTS

if TYPE_CHECKING:
    from collections.abc import Callable, Sequence

    from numpy.typing import NDArray

    from saltus.equilibria import Equilibrium
    from saltus.equilibria.problem import EquilibriumProblem
    from saltus.orbits.orbit import PeriodicOrbit

    _Way = Callable[[NDArray[np.float64]], "_Turn | None"]
    _Place = Callable[["_Turn"], NDArray[np.float64]]

__all__ = ["cycles_at_boundary"]

_STEPS = 16  # places, in a unit of time of the fastest rate, at which a linear flow is looked at
_MOST = 20000  # places at which it is looked at, at most
_STARTS = 48  # starts on a section, at most
_ROUNDS = 200  # returns in which a motion settles, at most


@dataclass(frozen=True, eq=False)
class _Side:
    """The linear flow of a mode next to a boundary equilibrium, in states over their sizes.

    The last coordinate is the parameter's change, which is constant: z' = M z.
    """

    mode: str
    leaves: str  # transition that ends the mode
    M: NDArray[np.float64]  # shape (n + 1, n + 1)
    row: NDArray[np.float64]  # shape (n + 1,): the event function of that transition
    way: float  # sign of the event function's rate there
    flow: NDArray[np.float64]  # M over the time between two places
    step: float

    def end(self, z: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]] | None:
        """Return when and where a motion leaves the mode; None where it does not."""
        before, first, time = z, float(np.abs(z).max()), 0.0
        inside = False
        for _ in range(_MOST):
            after = self.flow @ before
            height = self.way * float(self.row @ after)
            if height < 0.0:
                inside = True
            elif not inside:
                return None  # it would leave at once
            else:
                return self._located(before, time)
            size = float(np.abs(after).max())
            if not size < TURN_GROWN * first or float(np.abs(after - before).max()) < TURN_RESTS * size:
                return None
            before, time = after, time + self.step
        return None

    def _located(self, z: NDArray[np.float64], time: float) -> tuple[float, NDArray[np.float64]]:
        def height(share: float) -> float:
            return self.way * float(self.row @ (expm(share * self.step * self.M) @ z))

        share = brentq(height, 0.0, 1.0, xtol=SOLVED) if height(0.0) < 0.0 < height(1.0) else 1.0
        return time + share * self.step, expm(share * self.step * self.M) @ z


@dataclass(frozen=True, eq=False)
class _Turn:
    """One way round: start, landing, return, and how long each side lasts."""

    states: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]
    lasts: tuple[float, float]

    @property
    def size(self) -> float:
        return float(max(np.abs(z[:-1]).max() for z in self.states))


def cycles_at_boundary(
    equilibrium: Equilibrium, parameter: str, event: str, sizes: NDArray[np.float64], shares: Sequence[float]
) -> list[PeriodicOrbit]:
    """Return a small cycle of each branch of cycles that is born at a boundary equilibrium.

    Parameters
    ----------
    equilibrium : Equilibrium
        The boundary equilibrium, located.
    parameter : str
        The parameter that is free.
    event : str
        The transition on whose surface it lies.
    sizes : ndarray, shape (n,)
        Sizes of the states along the equilibrium's branch.
    shares : sequence of float
        Sizes of the cycle over these, tried in turn.

    Raises
    ------
    InputError
        Motions do not come back from the other side of the surface.
    ConvergenceError
        The linear flows have a cycle, and no cycle of the system was found near it.
    """
    rest = equilibrium.problem(parameter)
    u = np.append(equilibrium.state, equilibrium.parameters[parameter])
    first, second = _sides(rest, u, event, sizes)
    modes = rest.system.modes
    if modes[first.mode].surface is not None:
        first, second = second, first
    section = [second.row] + ([first.row] if modes[second.mode].surface is not None else [])
    found = []
    for sign in (1.0, -1.0):
        turns = _turns(first, second, np.array(section), sign)
        found += [_corrected(equilibrium, parameter, (first, second), turn, (sizes, shares)) for turn in turns]
    return found


def _sides(
    rest: EquilibriumProblem, u: NDArray[np.float64], event: str, sizes: NDArray[np.float64]
) -> tuple[_Side, _Side]:
    """Return the linear flow of the equilibrium's mode, and that of the mode beyond its surface."""
    system, n = rest.system, rest.n
    leaves = system.transitions[system.transition_names.index(event)]
    if leaves.target == leaves.source or not np.array_equal(rest.reset(system.transition_names.index(event), u), u):
        raise InputError("point", "BE", "one whose motions go on where they are", f"{event} moves the state")
    beyond = rest.in_mode(system.mode_index(leaves.target))
    F, J = beyond.evaluate(u)
    terms = np.abs(J[:, :n]) @ sizes
    if not np.all(np.abs(F) <= FIELDS_MEET * np.maximum(terms, MET * terms.max())):
        raise InputError("point", "BE", "one on a surface to which motions come back", f"{event} leads away from it")
    back = [k for k in beyond.ways_out if system.transitions[k].target == leaves.source and _met(beyond, k, u, sizes)]
    if not back:
        raise InputError("point", "BE", "one on a surface to which motions come back", f"{event} leads away from it")
    return _side(rest, system.transition_names.index(event), u, sizes), _side(beyond, back[0], u, sizes)


def _met(problem: EquilibriumProblem, transition: int, u: NDArray[np.float64], sizes: NDArray[np.float64]) -> bool:
    height, gradient = problem.event(transition, u)
    return abs(height) <= MET * float(np.abs(gradient[: problem.n]) @ sizes)


def _side(problem: EquilibriumProblem, transition: int, u: NDArray[np.float64], sizes: NDArray[np.float64]) -> _Side:
    n, leaves = problem.n, problem.system.transitions[transition]
    units = np.append(sizes, 1.0)
    M = np.zeros((n + 1, n + 1))
    M[:n] = problem.evaluate(u)[1] * units / sizes[:, None]
    row = problem.event(transition, u)[1] * units
    step = 1.0 / (_STEPS * float(np.abs(np.linalg.eigvals(M)).max()))
    return _Side(leaves.source, leaves.name, M, row, float(leaves.direction), expm(step * M), step)


def _turns(first: _Side, second: _Side, section: NDArray[np.float64], sign: float) -> list[_Turn]:
    """Return the cycles of two linear flows on one side of the parameter.

    section : ndarray, shape (conditions, n + 1)
        Rows that vanish where a motion goes from the second side to the first.
    """
    n = section.shape[1] - 1
    origin = np.append(np.linalg.lstsq(section[:, :n], -sign * section[:, n], rcond=None)[0], sign)
    along = np.linalg.svd(section[:, :n])[2][len(section) :]

    def turn(w: NDArray[np.float64]) -> _Turn | None:
        z = origin + np.append(along.T @ w, 0.0)
        out = first.end(z)
        back = None if out is None else second.end(out[1])
        return None if out is None or back is None else _Turn((z, out[1], back[1]), (out[0], back[0]))

    def place(made: _Turn) -> NDArray[np.float64]:
        return np.asarray(along @ (made.states[2] - origin)[:n])

    if not len(along):
        made = turn(np.zeros(0))
        return [] if made is None else [made]
    rests = np.linalg.lstsq(first.M[:n, :n], -sign * first.M[:n, n], rcond=None)[0]
    unit = max(float(np.abs(origin[:n]).max()), float(np.abs(rests).max()))
    lengths = unit * np.geomspace(1.0 / _STEPS**2, _STEPS**2, _STARTS // 2)
    if len(along) == 1:
        return _along_line(turn, place, np.concatenate([-lengths[::-1], lengths]))
    found: list[_Turn] = []
    for way in (*along @ along.T, *-(along @ along.T)):
        made = _settled(turn, place, unit * way)
        if made is not None and not any(_same(made, other) for other in found):
            found.append(made)
    return found


def _along_line(turn: _Way, place: _Place, starts: NDArray[np.float64]) -> list[_Turn]:
    """Return the cycles among motions that start on a line: zeros of how far each comes back from where it began."""

    def away(w: float) -> float:
        made = turn(np.array([w]))
        return math.nan if made is None else float(place(made)[0]) - w

    values = [away(w) for w in starts.tolist()]
    found = []
    for low, high, a, b in zip(starts[:-1].tolist(), starts[1:].tolist(), values[:-1], values[1:], strict=True):
        if not a * b < 0.0:
            continue
        made = turn(np.array([_zero(away, low, high, a)]))
        if made is not None and np.abs(made.states[2] - made.states[0]).max() <= TURN_RESTS**0.5 * made.size:
            found.append(made)
    return found


def _zero(away: Callable[[float], float], low: float, high: float, value: float) -> float:
    """Return a zero between two places by bisection, also where some motion between does not come back."""
    while abs(high - low) > SOLVED * max(abs(low), abs(high)):
        middle = 0.5 * (low + high)
        if middle in (low, high):
            break
        now = away(middle)
        if math.isnan(now):
            return low
        low, high = (middle, high) if now * value > 0.0 else (low, middle)
    return 0.5 * (low + high)


def _settled(turn: _Way, place: _Place, w: NDArray[np.float64]) -> _Turn | None:
    """Return the cycle to which a motion settles; None where it settles to none."""
    for _ in range(_ROUNDS):
        made = turn(w)
        if made is None:
            return None
        again = place(made)
        if np.abs(again - w).max() <= TURN_RESTS * made.size:
            return made
        w = again
    return None


def _same(made: _Turn, other: _Turn) -> bool:
    return bool(np.abs(made.states[0] - other.states[0]).max() <= TURN_RESTS**0.5 * made.size)


def _corrected(
    equilibrium: Equilibrium,
    parameter: str,
    sides: tuple[_Side, _Side],
    turn: _Turn,
    given: tuple[NDArray[np.float64], Sequence[float]],
) -> PeriodicOrbit:
    """Return the system's cycle near one of the linear flows."""
    sizes, shares = given
    sign, reason = float(turn.states[0][-1]), ""
    for share in shares:
        change = share / turn.size
        value = equilibrium.parameters[parameter] + sign * change
        guess = [
            (side.mode, side.leaves, equilibrium.state + change * z[:-1] * sizes, lasts)
            for side, z, lasts in zip(sides, turn.states, turn.lasts, strict=False)
        ]
        try:
            found = solve_orbit(equilibrium.system, {**equilibrium.parameters, parameter: value}, guess)
        except (ConvergenceError, InputError) as error:
            reason = str(error)
            continue
        if not found.admissible:
            reason = "; ".join(found.reasons)
        elif abs(found.period - sum(turn.lasts)) > 0.5 * sum(turn.lasts):
            reason = "the cycle found is another one"
        else:
            return found
    raise ConvergenceError("cycle at the boundary equilibrium", shares[-1], len(shares), reason)
