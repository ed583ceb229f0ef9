"""Long smooth orbits, and flights up to events, cut into pieces that each magnify a change of their start by little.

The sensitivities of a smooth orbit in one piece grow with its period, and equations, multipliers and determinants lose
as many digits. In pieces, each with its own initial state among the unknowns, they lose those of one piece only
(multiple shooting). The pieces' shares of the period are those of the moment at which the orbit was cut.

References
----------
Ascher, Mattheij and Russell, Numerical Solution of Boundary Value Problems for Ordinary Differential Equations, SIAM
1995, ch. 4 (multiple shooting); Kressner, Numerical Methods for General and Structured Eigenvalue Problems, Springer
2005, sec. 3.2 (eigenvalues of products).
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.errors import ConvergenceError
from saltus.orbits.maps import (
    across_flow,
    check_measured,
    flight_growth,
    landing_maps,
    most_grown,
    piece_maps,
)
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import CLOSED_END, CUT_END, PHASE_END, Signature
from saltus.scales import EPS, SETTLED

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

__all__ = [
    "MOST_PIECES",
    "STRETCHED",
    "TAUT",
    "clustered",
    "cut",
    "cut_again",
    "cut_within",
    "grows_within",
    "held",
    "in_shares",
    "merged",
    "squeezed",
    "started_elsewhere",
    "stretched",
    "whole",
]

STRETCHED = 1e3  # growth of a sensitivity over a piece, in the states' units, at which an orbit is cut
TAUT = 30.0  # growth above which a piece is cut again once any is
_FLOWN = SETTLED / EPS  # growth over a flight at which it is cut: a start's rounding becomes a converged Newton step
_SLACK = 1e-4  # contraction below which a piece is cut again once any is
_SQUEEZED = 0.5  # share of its duration at the cut below which a piece is joined with its neighbour
_TAME = 3.0  # growth up to which a start is good enough
_PLACES = 12  # places on an orbit, at equal times, at which it may start
_FOLLOWED = 1e6  # growth over a piece up to which Newton's method leads from such a guess to the orbit
_LOOKED = 8  # pieces, at least, in which an orbit is looked at for growth on the way
MOST_PIECES = 128  # pieces of an orbit, beyond which its equations would be larger than they are worth


def _growth(problem: OrbitProblem, J: NDArray[np.float64]) -> NDArray[np.float64]:
    return np.asarray(np.abs(piece_maps(problem, J)).max(axis=(1, 2)))


def stretched(problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]) -> bool:
    """Return whether an orbit has a piece over which sensitivities grow so far that it is to be cut.

    So is a piece of a smooth orbit, once there are several, over which they shrink so far that their product loses its
    digits. A flight counts where much of what grows is left behind its event: an upstroke alone magnifies time.
    """
    if problem.segments >= MOST_PIECES:
        return False
    if problem.signature.flies:
        return _flies_apart(problem, u, J)
    if problem.signature.kinds[0] not in (PHASE_END, CLOSED_END):
        return False
    if CUT_END in problem.signature.kinds and not problem.relaxes:
        return float(_need(piece_maps(problem, J)).max()) > STRETCHED
    scale, entries = problem.common_scale, np.abs(J[:, : problem.size])
    if (float(entries.max()) + 1.0) * float(scale.max()) <= STRETCHED * float(scale.min()):
        return False
    return float(_growth(problem, J).max()) > STRETCHED


def _flies_apart(problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]) -> bool:
    """Return whether a change grows over a flight, and moves its landing, so far that the flight is to be cut."""
    if problem.n == 1:  # a change along the motion alone
        return False
    most = STRETCHED if problem.signature.is_cut else _FLOWN
    if most_grown(problem, u, J) <= most or problem.conserving:
        return False
    return float(flight_growth(problem, u).max()) > most


def grows_within(problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]) -> bool:
    """Return whether sensitivities grow on the way round a smooth orbit in one piece, though not over all of it.

    So they do along a canard that ends in a jump: what grew is forgotten behind the jump, but for its time. The orbit's
    end then depends on parameters far more than the field does, which is the first, cheap look.
    """
    n, count = problem.n, len(problem.active)
    if problem.signature.kinds not in ((PHASE_END,), (CLOSED_END,)) or not count or n < 2:
        return False
    columns = np.abs(J[:n, problem.size : problem.size + count]) / problem.common_scale[:, None]
    if not np.all(np.isfinite(columns)) or float(columns.max()) <= STRETCHED:
        return False
    try:
        finer, moved = cut(problem, u, J, fewest=_LOOKED, contraction=False)
    except ConvergenceError:  # beyond all numbers: there are no pieces in which to go on
        return False
    maps = across_flow(finer, moved, piece_maps(finer, finer.evaluate(moved)[1]))
    grown, most = maps[:0], 0.0
    for matrix in maps:  # products of the pieces up to this one, from each of them
        grown = np.concatenate([matrix @ grown, matrix[None]])
        if np.all(np.isfinite(grown)):  # eigenvalues, which no units of the states change
            most = max(most, float(np.abs(np.linalg.eigvals(grown)).max()))
    return most > STRETCHED


def cut_within(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]
) -> tuple[OrbitProblem, NDArray[np.float64]]:
    """Return what `cut` does of an orbit that `grows_within`, in several pieces though little grows over all of it."""
    finer = cut(problem, u, J)
    return finer if finer[0].segments > problem.segments else _cut_for_growth(problem, u, J, _LOOKED)


def _need(maps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far each piece is to be cut: its growth, or its contraction where that is as bad."""
    with np.errstate(invalid="ignore", over="ignore"):
        growth = np.abs(maps).max(axis=(1, 2))
    if not np.all(np.isfinite(growth)):
        return np.asarray(growth)
    return _with_contraction(growth, np.linalg.svd(maps, compute_uv=False)[:, -1])


def _with_contraction(growth: NDArray[np.float64], least: NDArray[np.floating[Any]]) -> NDArray[np.float64]:
    """Return the growth of pieces, or their contraction where it is as bad: beside growth it is lost in rounding."""
    return np.asarray(np.maximum(growth, TAUT * _SLACK / np.maximum(least, 1e-300)))


def cut(
    problem: OrbitProblem,
    u: NDArray[np.float64],
    J: NDArray[np.float64],
    *,
    fewest: int = 1,
    contraction: bool = True,
) -> tuple[OrbitProblem, NDArray[np.float64]]:
    """Return the equations and unknowns of an orbit in more pieces, each cut in half while it is too sensitive.

    Parameters
    ----------
    problem : OrbitProblem
        Its equations, meshes made for it.
    J : ndarray, shape (size, size + active)
        Jacobian there.
    fewest : int, optional
        Pieces that there are to be in any case.
    contraction : bool, optional
        Whether pieces are also cut for what they contract. None is where that takes too many, as of a fast state that
        follows a slow one.
    """
    n, begun = problem.n, (problem, u, J)
    while problem.segments < MOST_PIECES:
        maps = piece_maps(problem, J)
        check_measured(maps)
        growth = np.abs(maps).max(axis=(1, 2)).astype(np.float64)
        if problem.signature.flies:
            growth = flight_growth(problem, u)
        elif problem.segments < fewest:
            growth = np.full(problem.segments, math.inf)
        elif contraction:
            least = np.linalg.svd(maps, compute_uv=False)[:, -1]
            if _pieces_that_contract(growth, least.astype(np.float64)) > MOST_PIECES:
                return _cut_for_growth(*begun)
            growth = _with_contraction(growth, least)
        if not growth.max() > TAUT:
            break
        problem.survey(u)
        rows = []
        for i, row in enumerate(u[: problem.size].reshape(problem.segments, n + 1)):
            if growth[i] > TAUT:
                half = 0.5 * row[n]
                rows += [np.append(row[:n], half), np.append(problem.state_on(i, 0.5), half)]
            else:
                rows.append(row)
        finer = _alike(problem, u, problem.signature.halved(np.flatnonzero(growth > TAUT).tolist()))
        moved = np.concatenate([*rows, u[problem.size :]])
        if finer.start(moved) is not None:
            break
        problem, u = finer, moved
        J = problem.evaluate(u)[1]
    return problem, u


def _pieces_that_contract(growth: NDArray[np.float64], least: NDArray[np.float64]) -> float:
    """Return how many pieces at least contract so little that nothing is lost in their rounding.

    growth, least : ndarray, shape (pieces,)
        Largest entry and least singular value of each piece's map; the second one is rounding where it is too small.
    """
    known = np.maximum(least, EPS * growth)
    return float(np.maximum(np.log(np.minimum(known, 1.0)) / math.log(_SLACK), 1.0).sum())


def squeezed(problem: OrbitProblem, u: NDArray[np.float64]) -> bool:
    """Return whether a piece between two planes has become short, as the orbit draws back from where it was cut."""
    if problem.phase_plane.size <= 2 * problem.n:
        return False
    durations = u[problem.n : problem.size : problem.n + 1]
    return bool(np.any(durations < _SQUEEZED * problem.begun_durations))


def cut_again(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]
) -> tuple[OrbitProblem, NDArray[np.float64]] | None:
    """Return the equations and unknowns of an orbit in pieces, cut anew for its growth; None without room.

    Pieces over which little grows together are joined, and what still grows is cut.
    """
    form, n = problem.signature, problem.n
    heads = _heads(landing_maps(problem, u, J) if form.flies else piece_maps(problem, J), form.heads)
    if len(heads) == problem.segments or 2 * len(heads) > MOST_PIECES:
        return None
    rows = u[: problem.size].reshape(problem.segments, n + 1)
    fewer = rows[heads].copy()
    fewer[:, n] = np.add.reduceat(rows[:, n], heads)
    joined, moved = _alike(problem, u, form.joined(heads)), np.concatenate([fewer.ravel(), u[problem.size :]])
    if joined.start(moved) is not None:
        return None
    J = joined.evaluate(moved)[1]
    return cut(joined, moved, J) if form.flies else _cut_for_growth(joined, moved, J)


def _cut_for_growth(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64], fewest: int = 1
) -> tuple[OrbitProblem, NDArray[np.float64]]:
    """Return what `cut` does, pieces cut for what grows alone."""
    finer, moved = cut(problem, u, J, fewest=fewest, contraction=False)
    finer.relaxes = True
    return finer, moved


def _heads(maps: NDArray[np.float64], begins: Sequence[int]) -> list[int]:
    """Return the first of each row of pieces that may be one, since little grows over any of them.

    begins: pieces that no cut is before.
    """
    heads, grown = [0], maps[:1]
    for i in range(1, len(maps)):
        grown = np.concatenate([maps[i] @ grown, maps[i : i + 1]])  # contraction hides what grows behind it
        if i in begins or not float(np.abs(grown).max()) <= TAUT:
            heads.append(i)
            grown = maps[i : i + 1]
    return heads


def started_elsewhere(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[OrbitProblem, NDArray[np.float64]] | None:
    """Return equations and unknowns of a closed smooth orbit that starts where a change of the start grows least.

    A stiff orbit magnifies a change of some of its states, as before a jump, and forgets that of others at once. None
    where the orbit magnifies a change of each of them too much.
    """
    if problem.signature.kinds != (CLOSED_END,) or float(_growth(problem, problem.evaluate(u)[1]).max()) <= _TAME:
        return None
    n, best, least = problem.n, None, TAUT
    problem.survey(u)
    for i in range(1, _PLACES):
        there = u.copy()
        there[:n] = problem.state_on(0, clustered(i / _PLACES))
        moved = _alike(problem, u, problem.signature)
        if moved.start(there) is None and (growth := float(_growth(moved, moved.evaluate(there)[1]).max())) < least:
            best, least = (moved, there), growth
        if least <= _TAME:
            break
    return best


def held(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[OrbitProblem, NDArray[np.float64]] | None:
    """Return the equations of a forced smooth orbit in pieces that all start at the guess's own state, and a guess.

    Where the flow from the guess leaves it at once, no later place on it is a guess of anything. The pieces are so
    short that each can be followed. None where that takes too many, or where two are short enough.

    Parameters
    ----------
    problem : OrbitProblem
        The equations in one piece.
    u : ndarray, shape (size + active,)
        The guess.
    """
    n, form, count = problem.n, problem.signature, 1
    while (count := 2 * count) <= MOST_PIECES:
        row = u[: n + 1].copy()
        row[n] /= count
        rows = np.tile(row, (count, 1))
        rows[:, n - 1] += problem.system.turn * form.turns * np.arange(count) / count
        kinds = (form.kinds[0],) + (CUT_END,) * (count - 1)
        finer = _alike(problem, u, Signature(form.modes * count, form.transitions * count, kinds, form.turns))
        guess = np.concatenate([rows.ravel(), u[problem.size :]])
        if finer.start(guess) is None:
            growth = float(_growth(finer, finer.evaluate(guess)[1]).max())
            if count == 2 and growth <= TAUT:
                break
            if growth <= TAUT or (count == MOST_PIECES and growth < _FOLLOWED):
                return finer, guess
    return None


def whole(problem: OrbitProblem, u: NDArray[np.float64]) -> tuple[OrbitProblem, NDArray[np.float64]]:
    """Return the equations and unknowns of an orbit whose segments are in one piece each."""
    form = problem.signature
    if not form.is_cut:
        return problem, u
    joined = _alike(problem, u, form.whole)
    moved = np.concatenate([merged(form, u[: problem.size]), u[problem.size :]])
    joined.start(moved)
    return joined, moved


def merged(form: Signature, u: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the unknowns of a signature as those of its segments in one piece each."""
    rows = u.reshape(len(form), -1)
    found = rows[list(form.heads)].copy()
    found[:, -1] = np.add.reduceat(rows[:, -1], form.heads)
    return found.ravel()


def clustered(share: float) -> float:
    """Return the clustered time s at which s^2 (3 - 2 s) is `share`."""
    return 0.5 - math.sin(math.asin(1.0 - 2.0 * share) / 3.0)


def in_shares(
    problem: OrbitProblem, u: NDArray[np.float64], like: OrbitProblem, other: NDArray[np.float64], first: int = 0
) -> NDArray[np.float64]:
    """Return an orbit, gone round as often as one near it in several pieces, in that one's pieces.

    Parameters
    ----------
    problem, like : OrbitProblem
        The equations of both; a smooth orbit is in one piece.
    u, other : ndarray
        Their unknowns, with the active parameters.
    first : int, optional
        Segment with which the orbit begins, where it has events.
    """
    if like.signature.flies:
        return _flights_in_shares(problem, u, like, other, first)
    n, phase = problem.n, problem.system.phase
    rows = other[: like.size].reshape(like.segments, n + 1).copy()
    period, total = float(u[n]), float(rows[:, n].sum())
    rounds = round(total / period)
    begins = (np.cumsum(rows[:, n]) - rows[:, n]) / total * rounds
    problem.survey(u)
    for row, begin in zip(rows, begins.tolist(), strict=True):
        gone, share = divmod(begin, 1.0)
        row[:n] = problem.state_on(0, clustered(share))
        if phase is not None:
            row[n - 1] += problem.system.turn * problem.signature.turns * gone
        row[n] *= rounds * period / total
    return np.concatenate([rows.ravel(), u[problem.size :]])


def _flights_in_shares(
    problem: OrbitProblem, u: NDArray[np.float64], like: OrbitProblem, other: NDArray[np.float64], first: int
) -> NDArray[np.float64]:
    """Return what `in_shares` does of an orbit with events; it may be in pieces itself."""
    n, form, wound = problem.n, problem.signature, problem.signature.turns * problem.system.turn
    own, rows = u[: problem.size].reshape(-1, n + 1), other[: like.size].reshape(-1, n + 1).copy()
    heads, tails, count = form.heads, form.tails, len(form.heads)
    problem.survey(u)
    for k, (begin, end) in enumerate(zip(like.signature.heads, like.signature.tails, strict=True), first):
        a, lasting = heads[k % count], own[heads[k % count] : tails[k % count] + 1, n]
        pieces, ends = rows[begin : end + 1], np.cumsum(lasting) / lasting.sum()
        pieces[:, n] *= lasting.sum() / pieces[:, n].sum()
        shares = np.append(0.0, np.cumsum(pieces[:-1, n])) / lasting.sum()
        at = np.minimum(np.searchsorted(ends, shares, side="right"), lasting.size - 1)
        within = np.clip(1.0 - (ends[at] - shares) * lasting.sum() / lasting[at], 0.0, 1.0)
        pieces[0, :n] = own[a, :n]
        for piece, j, place in zip(pieces[1:], at[1:].tolist(), within[1:].tolist(), strict=True):
            piece[:n] = problem.state_on(a + j, clustered(place))
        if problem.system.phase is not None:
            pieces[:, n - 1] += wound * (k // count)
    return np.concatenate([rows.ravel(), u[problem.size :]])


def _alike(problem: OrbitProblem, u: NDArray[np.float64], signature: Signature) -> OrbitProblem:
    """Return the equations of another signature with the same parameters."""
    p, kept = problem.parameters_at(u), problem.conserving
    return OrbitProblem(problem.system, signature, p, problem.active, problem.scales, problem.tol, kept)
