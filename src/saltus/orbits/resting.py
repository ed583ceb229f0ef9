"""Which states of a motion rest at zero, so that they have no size of their own."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Protocol

import numpy as np

from saltus.algebraic.bending import bending_sizes
from saltus.flow.invariant_planes import driven, staying
from saltus.flow.shares import shares_of
from saltus.scales import (
    MOVES_NOTHING,
    NEAR_ZERO,
    NEARBY,
    NEAREST_TO_ZERO,
    ORBIT_NOTHING,
    RECURS,
    RESTING,
    UNIT_DECADES,
    Verdict,
    followed,
    zero,
)

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.signature import Signature, Survey
    from saltus.system import HybridSystem

__all__ = [
    "at_rest",
    "guess_on_plane",
    "kept_at_zero",
    "mark_driven",
    "mark_moved",
    "nearest_to_zero",
    "on_its_plane",
    "sizes_nearby",
]

_PHASES = 16  # phases at which derivatives of fields and resets are looked at
_PLACES = 5  # in a segment, at which they are looked at beside states that move


class Equations(Protocol):
    """What is asked here of the equations of an orbit: see `OrbitProblem`."""

    system: HybridSystem
    signature: Signature
    tol: float
    active: Sequence[int]
    modes: NDArray[np.int64]
    extended: NDArray[np.float64]
    state_scale: NDArray[np.float64]
    bent: NDArray[np.float64]
    moved_by: NDArray[np.bool_]
    begun_durations: NDArray[np.float64]
    slides: bool
    size: int
    segments: int
    n: int

    @property
    def begun(self) -> Survey:
        """Survey of the orbit that the equations were made to fit."""

    def start(self, u: NDArray[np.float64]) -> int | None:
        """Make the equations fit an orbit; return a segment that cannot be followed."""

    def evaluate(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residual and Jacobian."""

    def resolve(self, u: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return residual and Jacobian on meshes fine enough for the sensitivities."""

    def state_on(self, segment: int, place: float) -> NDArray[np.float64]:
        """Return the full state at a clustered time of a segment, as last surveyed."""


def at_rest(sizes: NDArray[np.float64], moves: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which states rest at zero: they are small, and no state that does not rest moves them.

    Parameters
    ----------
    sizes : ndarray, shape (states,)
        Sizes of the states.
    moves : ndarray of bool, shape (n, n)
        Whether the state of a column is in the rate of the state of a row; the phase may be the last of them.

    Examples
    --------
    >>> oscillators = np.array([[0, 1, 0, 0], [1, 1, 0, 0], [0, 0, 0, 1], [0, 0, 1, 1]], dtype=bool)
    >>> at_rest(np.array([1.0, 1.0, 1e-30, 0.0]), oscillators).tolist()
    [False, False, True, True]
    """
    from saltus.orbits.kernels import sizes as kernels

    return np.asarray(kernels.resting(sizes, moves, RESTING) != 0)


def mark_driven(
    problem: Equations, moves: NDArray[np.bool_], x: NDArray[np.float64], sizes: NDArray[np.float64]
) -> None:
    """Mark small states that a constant, a drive or a reset takes from zero as moved by all: they do not rest.

    A state in a unit of its own is small by itself, as a charge in coulombs beside a voltage.

    Parameters
    ----------
    moves : ndarray of bool, shape (n, n)
        See `at_rest`; written.
    x : ndarray, shape (n or more,)
        Full state on the orbit.
    sizes : ndarray, shape (n or more,)
        Sizes of the states on it.
    """
    count = len(problem.system.states)
    own = sizes[:count]
    if not own.min() < RESTING * own.max():
        return
    zeros = np.append(sizes[:count] < RESTING * float(sizes[:count].max()), np.zeros(problem.n - count, dtype=np.bool_))
    zeros &= ~moves.all(axis=1)
    if zeros.any():
        ends = [k for k in problem.signature.transitions if k >= 0]
        x = np.ascontiguousarray(x[: problem.n])
        moves[driven(problem.system.compiled, problem.modes.tolist(), ends, x, problem.extended, zeros, count)] = True


def mark_moved(problem: Equations, moves: NDArray[np.bool_], blocks: NDArray[np.float64]) -> None:
    """Mark which states resets, constants and drives move, and that those with sizes by what bends do not rest.

    Parameters
    ----------
    moves : ndarray of bool, shape (n, n)
        See `at_rest`; written.
    blocks : ndarray, shape (segments, n + 1)
        State at each segment's start, and its duration.
    """
    _mark_reset(problem, moves, blocks)
    mark_driven(problem, moves, blocks[0, : problem.n], np.abs(blocks[:, : problem.n]).max(axis=0))
    moves[np.flatnonzero(problem.bent > 0.0)] = True


def _mark_reset(problem: Equations, moves: NDArray[np.bool_], blocks: NDArray[np.float64]) -> None:
    """Mark which states the resets at the segments' ends make of which, as fields do.

    A state that is 0 at all starts, beside others that are not, has no size by which a reset moves it.
    """
    n, moved, sized = problem.n, np.empty(problem.n**2), np.any(blocks[:, : problem.n] != 0.0, axis=0)
    sized |= not np.any(sized[: len(problem.system.states)])
    for transition, block in zip(problem.signature.transitions, blocks, strict=True):
        if transition >= 0:
            state = np.ascontiguousarray(block[:n])
            problem.system.compiled.call("reset_x", transition, 0, state, problem.extended, moved)
            moves |= (np.abs(moved.reshape(n, n)) > MOVES_NOTHING) & sized[:, None]


def sizes_nearby(
    problem: Equations, u: NDArray[np.float64], survey: Survey, given: NDArray[np.float64] | None
) -> NDArray[np.float64] | None:
    """Return the states' sizes on the branch of an orbit that rests in the origin, or too near to have any itself.

    They are what a unit of the active parameters moves in a period. Where that moves none they are those at which
    fields or resets bend, in powers of ten. So are those of states that rest beside others; `bent` keeps them.

    Parameters
    ----------
    problem : OrbitProblem
        The equations; `bent` is written.
    u : ndarray
        The orbit.
    survey : Survey
        Its extremes.
    given : ndarray, shape (states,), optional
        Sizes that are known.

    Returns
    -------
    ndarray, shape (states,)
        None where the sizes in use are right.
    """
    if problem.slides:  # a plane across the flow fixes its start, by sizes on the cycle itself
        return None
    at_origin = _sizes_at_origin(problem, u, survey)
    return _sizes_beside(problem, survey, given) if at_origin is None else at_origin


def _sizes_beside(problem: Equations, survey: Survey, given: NDArray[np.float64] | None) -> NDArray[np.float64] | None:
    """Return the states' sizes where some rest beside others, and what bends them is many powers of ten off those.

    Sizes are 0 where the orbit or the equations tell them.
    """
    count = len(problem.system.states)
    own = np.maximum(np.abs(survey.lows[:count]), np.abs(survey.highs[:count]))
    known = own if given is None else np.maximum(own, given)
    if not np.isfinite(known).all() or not known.min() < RESTING * known.max():
        return None
    free = at_rest(known, problem.moved_by) & np.isnan(problem.bent[:count])
    if not free.any() or not known.max() > ORBIT_NOTHING:
        return None
    top = float(known.max())
    found = top * _bending_beside(problem, free, known, top)
    told = np.abs(np.log10(found / top)) > UNIT_DECADES
    problem.bent[np.flatnonzero(free)] = np.where(told, found, 0.0)
    if not told.any():
        return None
    sizes = np.zeros(count) if given is None else given.copy()
    sizes[free] = np.where(told, found, top)
    return sizes


def _bending_beside(
    problem: Equations, free: NDArray[np.bool_], sizes: NDArray[np.float64], top: float
) -> NDArray[np.float64]:
    """Return sizes of the free states, over the largest of the others, by what bends them or moves the others.

    As `_bending`, along the orbit. What free states change in the rates and images of the others counts over the sizes
    of these.
    """
    compiled, count, n = problem.system.compiled, free.size, problem.n
    segments = range(problem.segments)
    lasting = max(float(problem.begun_durations.sum()), 0.0) or 1.0
    within = [
        (problem.modes[i], problem.state_on(i, place)) for i in segments for place in np.linspace(0.0, 1.0, _PLACES)
    ]
    ends = [(k, problem.state_on(i, 1.0)) for i, k in enumerate(problem.signature.transitions) if k >= 0]
    places, others, moved = np.flatnonzero(free), np.flatnonzero(~free), np.empty(n * n)

    def reset(transition: int, state: NDArray[np.float64]) -> NDArray[np.float64]:
        compiled.call("reset_x", transition, 0, state, problem.extended, moved)
        return moved.reshape(n, n).copy()

    def slopes(x: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        def at(state: NDArray[np.float64]) -> NDArray[np.float64]:
            beside = state.copy()
            beside[places] = top * x
            return beside

        found = [lasting * compiled.linearised(mode, at(state), problem.extended)[1] for mode, state in within]
        resets = [reset(k, at(state)) for k, state in ends]
        kinds = [np.array(matrices)[:, :count, :count] for matrices in (found, resets) if matrices]
        shares = [np.abs(kind[:, others[:, None], places]) * np.abs(top * x) / sizes[others, None] for kind in kinds]
        blocks = [kind[:, places[:, None], places] for kind in kinds]
        return [*blocks, *((np.eye(places.size) * share.max(axis=(0, 1)))[None] for share in shares)]

    also = np.eye(places.size)[None]
    return bending_sizes(slopes, places.size, [also] * (4 if ends else 2))


def _sizes_at_origin(problem: Equations, u: NDArray[np.float64], survey: Survey) -> NDArray[np.float64] | None:
    """Return `sizes_nearby` of an orbit that rests in the origin, or too near to have any itself."""
    count = len(problem.system.states)
    lows, highs = survey.lows[:count], survey.highs[:count]
    known = problem.state_scale[:count]
    # what is left of a rest by rounding moves, where a drive does
    if not np.max(highs - lows) <= max(RESTING * float(known.max()), ORBIT_NOTHING):
        return None
    moved = np.zeros(count)
    if len(problem.active):
        J = problem.resolve(u)[1]
        if np.all(np.isfinite(J)):
            moved = np.abs(J[:, problem.size :]).reshape(problem.segments, problem.n + 1, -1).max(axis=(0, 2))[:count]
    top = float(moved.max())
    if known.max() > NEARBY * top:
        if not _at_origin(problem, u, float(known.max())):
            return None
        top = 0.0  # what the parameters move is rounding of the origin
    return (
        np.where(moved > RESTING * top, moved, top)
        if top > 0.0
        else _bending(problem, count, float(np.abs(u[problem.n : problem.size : problem.n + 1]).sum()))
    )


def _bending(problem: Equations, count: int, period: float) -> NDArray[np.float64]:
    """Return sizes of the states near the origin by which fields and resets bend: see `bending_sizes`.

    What a field changes in a period counts as the derivatives of resets do: over those in the origin, or over 1.
    """
    compiled, lasting = problem.system.compiled, period if period > 0.0 else 1.0
    turns = np.linspace(0.0, problem.system.turn, _PHASES, endpoint=False) if problem.n > count else np.zeros(1)
    modes = dict.fromkeys(problem.modes.tolist())
    ends = [k for k in dict.fromkeys(problem.signature.transitions) if k >= 0]
    moved = np.empty(problem.n * problem.n)

    def reset(transition: int, state: NDArray[np.float64]) -> NDArray[np.float64]:
        compiled.call("reset_x", transition, 0, state, problem.extended, moved)
        return moved.reshape(problem.n, problem.n).copy()

    def slopes(x: NDArray[np.float64]) -> list[NDArray[np.float64]]:
        full = [np.append(x, np.full(problem.n - count, turn)) for turn in turns.tolist()]
        found = [lasting * compiled.linearised(mode, state, problem.extended)[1] for mode in modes for state in full]
        resets = [reset(k, state) for k in ends for state in full]
        return [np.array(matrices)[:, :count, :count] for matrices in (found, resets) if matrices]

    also = np.eye(count)[None] if period > 0.0 else np.zeros((1, count, count))
    return bending_sizes(slopes, count, [also, np.eye(count)[None]][: 2 if ends else 1])


def _at_origin(problem: Equations, u: NDArray[np.float64], size: float) -> bool:
    """Whether an orbit of that size is the rest in the origin, but for rounding."""
    if size > ORBIT_NOTHING:
        return False
    origin = u.copy()
    for i in range(len(problem.system.states)):
        origin[i : problem.size : problem.n + 1] = 0.0
    gaps = problem.evaluate(origin)[0].reshape(problem.segments, problem.n + 1)[:, : len(problem.system.states)]
    return bool(np.max(np.abs(gaps)) <= NEARBY * size)


def nearest_to_zero(problem: Equations, survey: Survey) -> float:
    """Return how near states come to 0 that can grow from nothing but themselves, over their largest moduli.

    Their zeros are an invariant plane, as of populations. Answered with 1 where none comes near.
    """
    count = len(problem.system.states)
    lows, highs = survey.lows[:count], survey.highs[:count]
    ends = np.abs(np.stack([lows, highs]))
    shares = ends.min(axis=0) / np.maximum(ends.max(axis=0), 1e-300)
    near = (np.sign(lows) * np.sign(highs) > 0.0) & (shares < NEAR_ZERO)
    x = np.append(lows, np.zeros(problem.n - count))
    zeros = kept_at_zero(problem, x, np.append(near, np.zeros(problem.n - count, dtype=np.bool_)))
    return max(float(np.min(shares, where=zeros[:count], initial=1.0)), NEAREST_TO_ZERO)


def kept_at_zero(problem: Equations, x: NDArray[np.float64], zeros: NDArray[np.bool_]) -> NDArray[np.bool_]:
    """Return which of some states the fields of an orbit's modes keep at 0 where all of these are 0, shape (n,).

    Their zeros are an invariant plane. A place on a wall, or a phase at 0, is moved on.

    Parameters
    ----------
    problem : OrbitProblem
        The equations.
    x : ndarray, shape (n,)
        Full state, of which the others are taken: none of these may be 0 by chance.
    zeros : ndarray of bool, shape (n,)
        These states; a phase is none of them.
    """
    modes, count = dict.fromkeys(problem.modes.tolist()), len(problem.system.states)
    while zeros.any():
        stay = [staying(problem.system.compiled, mode, x, problem.extended, zeros, count) for mode in modes]
        if np.all(stay == zeros):
            break
        zeros = np.logical_and.reduce(stay)
    return zeros


def on_its_plane(problem: Equations, u: NDArray[np.float64], survey: Survey) -> NDArray[np.float64] | None:
    """Return an orbit moved into the invariant plane in which it lies but for rounding; None where there is none.

    States of an orbit in the plane are 0, and Newton's method leaves some rounding of them. It solves no equations in
    its own size: what is left of them is as large. A state that is small in earnest, as a population, solves them.
    The plane is the origin where all states are rounding in the sizes in which the orbit was solved.

    Parameters
    ----------
    problem : OrbitProblem
        The equations.
    u : ndarray, shape (size,) or longer
        The orbit.
    survey : Survey
        Its extremes.
    """
    sizes, places = _small(problem, survey, float(problem.state_scale[: len(problem.system.states)].max()))
    if not places.size:
        return None
    moved = _without(problem, u, places)
    there, left = _residual(problem, moved, places), _residual(problem, u, places)
    in_plane = not np.any(there) and zero(left, followed(problem.tol) * sizes[places]) is Verdict.NO
    return moved if in_plane else None


def guess_on_plane(problem: Equations, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a guess of an orbit moved into an invariant plane that it leaves nowhere by more than `RESTING`.

    States that recur in their own sizes are no rounding of others, but small by their units: they stay. A state that is
    the factor of its own rate keeps its size: there only a solution tells what is rounding. The plane may be crossed
    where several states are 0 together, as a place and its speed, and so small a distance is none.
    """
    count = len(problem.system.states)
    sizes = np.abs(u[: problem.size].reshape(problem.segments, problem.n + 1)[:, :count]).max(axis=0)
    if not np.any((sizes > 0.0) & (sizes < RESTING * float(sizes.max()))) or problem.start(u) is not None:
        return u
    places = _small(problem, problem.begun)[1]
    places = places[shares_of(problem.system.compiled, problem.extended)[places] > 0.0]
    if not places.size:
        return u
    moved = _without(problem, u, places)
    if np.any(_residual(problem, moved, places)):
        return u
    recurs = np.all(np.abs(_residual(problem, u, places)) <= RECURS * sizes[places])
    return u if recurs else moved


def _residual(problem: Equations, u: NDArray[np.float64], places: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return what is left of the equations of some states, shape (segments, places)."""
    wide = problem.size + len(problem.active)
    return problem.evaluate(u[:wide])[0].reshape(problem.segments, problem.n + 1)[:, places]


def _small(problem: Equations, survey: Survey, top: float = 0.0) -> tuple[NDArray[np.float64], NDArray[np.intp]]:
    """Return the sizes of an orbit's states, and the places of those that are small but for 0.

    They are small beside the largest of them, or beside `top` if that has them all small.
    """
    count = len(problem.system.states)
    sizes = np.maximum(np.abs(survey.lows[:count]), np.abs(survey.highs[:count]))
    largest = float(sizes.max())
    largest = top if largest < RESTING * top else largest
    return sizes, np.flatnonzero((sizes < RESTING * largest) & (sizes > 0.0))


def _without(problem: Equations, u: NDArray[np.float64], places: NDArray[np.intp]) -> NDArray[np.float64]:
    """Return unknowns with some states 0."""
    moved = u.copy()
    for i in places.tolist():
        moved[i : problem.size : problem.n + 1] = 0.0
    return moved
