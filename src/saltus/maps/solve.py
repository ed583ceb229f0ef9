"""Orbits of maps: Newton's method from a guess, and from a motion that settles on one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from saltus import checks
from saltus.algebraic.newton import solve_zero, state_sizes
from saltus.errors import ConvergenceError, DefinitionError, InputError
from saltus.maps.code import code_of
from saltus.maps.iterates import path_from
from saltus.maps.orbit import MapOrbit, itinerary_of
from saltus.maps.problem import MapOrbitProblem
from saltus.system.angles import wrapped

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.checks.states import StateLike
    from saltus.system.maps import Map

__all__ = ["find_map_orbit", "sizes_of", "solve_map_orbit"]

_MOST = 4000  # unknowns of an orbit, whose equations have a dense Jacobian: 128 MB
_RESIDUAL = 1e-10  # most residual, over the sizes of its terms, of an orbit
_SAME = 1e-8  # distance of two points, over the states' sizes, up to which they are one
_ROUNDS = 8  # most changes of the itinerary to that of the orbit found
_LONGEST = 256  # period of the longest orbit that is looked for
_NEUTRAL = 1e-6  # distance of all multipliers from the unit circle up to which an orbit neither attracts nor repels
_NEAR = 1e-3  # distance of two returns, over the motion's size, within which it recurs
_FIRST = 1000  # iterations before a motion is first looked at
_SETTLE = 200_000  # iterations after which a search is given up
_FAR = 0.1  # distance of an orbit from the motion, over the motion's size, from which on it is another
_LARGE = 1e6  # factor on the guess beyond which its iterates are no guess


def solve_map_orbit(
    system: Map,
    parameters: Mapping[str, float] | None = None,
    itinerary: Sequence[str] | None = None,
    x0: StateLike | None = None,
    period: float | None = None,
) -> MapOrbit:
    """Return the orbit of a map near a guess; `solve_orbit` describes the arguments, `itinerary` as its `segments`."""
    p = system.parameter_vector(parameters)
    pieces = None if itinerary is None else itinerary_of(system, itinerary, "segments")
    guess = np.zeros((1, len(system.states))) if x0 is None else _read_guess(system, x0)
    if x0 is None and pieces is None:
        raise InputError("x0", x0, "a state near the orbit", "or an itinerary, for a map in pieces")
    known = len(pieces) if pieces is not None else len(guess) if len(guess) > 1 else None
    k = checks.count("period", 1 if period is None and known is None else period or known, 1, _MOST // guess.shape[1])
    if known is not None and k != known:
        what = "segments" if pieces is not None else "x0"
        raise InputError("period", k, f"{known}, as {what} has points")
    points, pieces_met = _guessed(system, p, guess, k, pieces)
    found = _converged(MapOrbitProblem(system, pieces_met, p), points)
    return found if pieces is not None else _settled(system, p, found)


def _read_guess(system: Map, x0: StateLike) -> NDArray[np.float64]:
    """Return one state, or one for each point, shape (1 or period, states)."""
    named = isinstance(x0, list | tuple) and any(isinstance(row, Mapping) for row in x0)
    if not named and np.ndim(np.asarray(x0, dtype=object)) < 2:
        return np.array(system.full_state(x0, "x0"), dtype=np.float64)[None]
    listed = checks.listed("x0", np.asarray(x0, dtype=object).tolist(), "a state, or one for each point")
    return np.array([system.full_state(row, "x0") for row in listed], dtype=np.float64)


def _guessed(
    system: Map, p: NDArray[np.float64], guess: NDArray[np.float64], k: int, pieces: tuple[int, ...] | None
) -> tuple[NDArray[np.float64], tuple[int, ...]]:
    """Return a guess of all points and of their pieces."""
    if len(guess) > 1 or k == 1:
        return guess, pieces or tuple(system.piece_index(x, p) for x in guess)
    if pieces is None:
        states, met = path_from(system, p, code_of(system, p), guess[0], 0, k)
        return states, tuple(met.tolist())
    points = np.empty((k, guess.shape[1]))
    points[0] = guess[0]
    for i in range(1, k):
        points[i] = system.compiled.field(pieces[i - 1], points[i - 1], p)
    size = max(float(np.abs(guess).max()), 1.0)
    return np.where(np.abs(points) < _LARGE * size, points, guess), pieces


def sizes_of(problem: MapOrbitProblem, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return typical sizes of the points, shape (n,): for each state the largest one along the orbit."""
    found = state_sizes(problem, u, problem.evaluate(u)[1]).reshape(problem.period, problem.states)
    moduli = np.abs(problem.points(u)).max(axis=0)
    return np.tile(np.where(moduli > 0.0, moduli, found.max(axis=0)), problem.period)


def _converged(problem: MapOrbitProblem, points: NDArray[np.float64]) -> MapOrbit:
    """Return the orbit near the guess of its points, of its least period."""
    if not np.all(np.isfinite(points)):
        raise InputError("x0", points[0].tolist(), "a state whose images are finite")
    none = f"there may be no orbit of period {problem.period} there"
    u, _, iterations = solve_zero(problem, wrapped(points.ravel(), problem.circles), "orbit", none)
    u = wrapped(u, problem.circles)
    sizes = sizes_of(problem, u)
    problem, u = _least(problem, u, sizes)
    found = MapOrbit.from_unknowns(problem, u, sizes[: problem.n])
    if not found.residual <= _RESIDUAL:
        raise ConvergenceError("orbit", found.residual, iterations, none)
    return found


def _least(
    problem: MapOrbitProblem, u: NDArray[np.float64], sizes: NDArray[np.float64]
) -> tuple[MapOrbitProblem, NDArray[np.float64]]:
    """Return the equations and the unknowns of an orbit's first round."""
    points, k, scale = problem.points(u), problem.period, sizes[: problem.states]
    for d in range(1, k):
        apart = np.abs(wrapped(points - np.roll(points, d, axis=0), problem.system.angle_places))
        same = k % d == 0 and problem.itinerary == problem.itinerary[:d] * (k // d)
        if same and np.all(apart <= _SAME * scale):
            return problem.along(problem.itinerary[:d]), points[:d].ravel().copy()
    return problem, u


def _settled(system: Map, p: NDArray[np.float64], found: MapOrbit) -> MapOrbit:
    """Return the orbit whose itinerary is that of its points; the one given where none is found."""
    orbit = found
    for _ in range(_ROUNDS):
        if orbit.regular:
            return orbit
        try:
            pieces = tuple(system.piece_index(x, p) for x in orbit.points)
            orbit = _converged(MapOrbitProblem(system, pieces, p), np.array(orbit.points))
        except (ConvergenceError, DefinitionError):
            break
    return orbit if orbit.regular else found


def find_map_orbit(
    system: Map, parameters: Mapping[str, float] | None = None, x0: StateLike = (), settle: float | None = None
) -> MapOrbit:
    """Return the stable orbit on which a motion of a map settles; `find_orbit` describes the arguments."""
    p, x = system.parameter_vector(parameters), np.array(system.full_state(x0, "x0"))
    most = _SETTLE if settle is None else checks.count("settle", settle, 1, 10**12)
    code, made, stretch, apart = code_of(system, p), 0, _FIRST, np.inf
    while True:
        stretch = min(stretch, most - made)
        kept = min(2 * _LONGEST, stretch + 1)
        states, pieces = path_from(system, p, code, x, stretch + 1 - kept, kept)
        made, x = made + stretch, wrapped(states[-1], system.angle_places)
        found, nearest = _recurring(system, p, states, pieces)
        if found is not None:
            return found
        apart = min(apart, nearest)
        if made >= most:
            hint = f"no period up to {_LONGEST} is seen; the motion is quasi-periodic or chaotic, or its period longer"
            raise ConvergenceError("stable orbit", apart, made, hint)
        stretch *= 2


def _recurring(
    system: Map, p: NDArray[np.float64], states: NDArray[np.float64], pieces: NDArray[np.int64]
) -> tuple[MapOrbit | None, float]:
    """Return the stable orbit near the end of a motion, None where there is none, and how near the motion recurs."""
    places = system.angle_places
    size = np.abs(wrapped(states, places)).max(axis=0)
    size = np.where(size > 0.0, size, 1.0)
    nearest = np.inf
    for d in range(1, min(_LONGEST, (len(states) - 1) // 2) + 1):
        away = float(np.max(np.abs(wrapped(states[-d - 1 :] - states[-2 * d - 1 : -d], places)) / size))
        nearest = min(nearest, away)
        if away > _NEAR:
            continue
        try:
            points = states[-d - 1 : -1]
            orbit = _settled(
                system, p, _converged(MapOrbitProblem(system, tuple(pieces[-d - 1 : -1].tolist()), p), points)
            )
        except (ConvergenceError, DefinitionError):
            continue
        near = np.abs(wrapped(orbit.points[:, None] - points[None], places)).max(axis=2).min() <= _FAR * float(
            size.max()
        )
        if orbit.stable and orbit.regular and near:
            return orbit, nearest
        if near and np.all(np.abs(np.abs(orbit.multipliers) - 1.0) <= _NEUTRAL):
            hint = f"the motion stays at an orbit of period {orbit.period} that is neutral"
            raise ConvergenceError(
                "stable orbit", away, len(states), f"{hint}: solve_orbit(..., period={orbit.period}) gives it"
            )
    return None, nearest
