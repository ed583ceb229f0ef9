"""Floquet multipliers and test functions from the linearised segment equations."""

from __future__ import annotations

import itertools
import math
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus import scales
from saltus.orbits.coincidences import at_one_instant, chains, commute, orders, shortest_is_brief
from saltus.orbits.maps import across_flow, landing_maps, own_units, piece_maps, reflector
from saltus.orbits.signature import CLOSED_END, PHASE_END
from saltus.system.integrals.laws import Leaf

if TYPE_CHECKING:
    from collections.abc import Sequence

    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem

__all__ = [
    "Passage",
    "distance_from_circle",
    "doubling_determinant",
    "height",
    "multiplier_errors",
    "multipliers",
    "multipliers_by_order",
    "nontrivial",
    "passage",
    "undecided",
    "unstable_count",
    "with_errors",
]

_ROUNDS = 60  # most rounds of orthogonal iteration: what has not parted by then has sizes within a factor of two


def multipliers(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64], flows: NDArray[np.float64] | None = None
) -> NDArray[np.complex128]:
    """Return the Floquet multipliers of an orbit, largest modulus first.

    Where several events happen at one instant, and their orders have different derivatives, they are those of the
    order with the largest multiplier.

    They are the generalised eigenvalues of P v = mu R v (docs/theory/orbits.md). Durations have been eliminated by
    reflections, not by dividing by normal velocities, so multipliers can be followed through a grazing. There one is
    infinite (in floating point: beyond 1e10), and the others are not determined. The direction of the flow is taken out
    by its vector. A forced system's stroboscopic map has no such multiplier; for an autonomous system its multiplier 1
    is put back, last. Multipliers of a smooth cycle that are below the error of its linearised flow are 0.

    Parameters
    ----------
    flows : ndarray, shape (pieces, states), optional
        Directions of the flow where the pieces of a smooth cycle start; by default those of the field there. Rounding
        leaves the field none at a piece that rests at an equilibrium.

    Returns
    -------
    ndarray of complex, shape (states less conserved,)

    References
    ----------
    Dankowicz and Schilder, Recipes for Continuation, SIAM 2013, ch. 9; Leine and Nijmeijer, Dynamics and Bifurcations
    of Non-Smooth Mechanical Systems, Springer 2004, ch. 7.
    """
    if problem.signature.is_cut:
        problem.set_parameters(u)
        return _of_pieces(problem, u, J, flows)
    own = _of_segments(problem, u, J)
    return max([own, *multipliers_by_order(problem, u, J).values()], key=lambda values: abs(values[0]))


def multipliers_by_order(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]
) -> dict[tuple[str, ...], NDArray[np.complex128]]:
    """Return the multipliers of an orbit for each order of its events of one instant; nothing where all are alike.

    The flow through events of one instant is piecewise linear: a motion beside the orbit meets them in one order. Where
    resets and fields commute, all orders have one derivative. An order is told by the names of all transitions.

    References
    ----------
    S. A. Burden, S. S. Sastry, D. E. Koditschek, S. Revzen, Event-selected vector field discontinuities yield
    piecewise-differentiable flows, SIAM J. Appl. Dyn. Syst. 15 (2016).
    """
    if problem.segments < 2 or not shortest_is_brief(problem, u):
        return {}
    problem.survey(u)
    members = at_one_instant(problem, u)
    found = orders(problem, u, members)
    if len(found) < 2 or all(commute(problem, found, *chain) for chain in chains(members, problem.segments)):
        return {}
    values, names = [_of_segments(problem, u, J)], problem.system.transition_names
    for signature, blocks in found[1:]:
        other = type(problem)(problem.system, signature, problem.parameters_at(u), tol=problem.tol)
        own = blocks.ravel()
        other.start(own)
        values.append(_of_segments(other, own, other.resolve(own)[1]))
    problem.set_parameters(u)
    return {
        tuple(names[k] for k in order.signature.transitions if k >= 0): one
        for order, one in zip(found, values, strict=True)
    }


def _of_segments(problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the multipliers of an orbit that is not cut."""
    n, sizes = problem.n, problem.state_scale
    closing, autonomous = problem.signature.kinds[0], problem.system.phase is None
    if autonomous or closing != PHASE_END:
        flow = problem.flow_at_start(u) / sizes
    else:  # no event but the period's end: no flow is taken out
        problem.set_parameters(u)
        flow = np.zeros(n)
    period = float(np.abs(u[n : problem.size : n + 1]).sum())
    if problem.conserving:
        J, left = problem.conserving.reduced(J[:, : problem.size], problem.parameters_at(u), sizes, n)
        flow, sizes, n = flow[left], sizes[left], left.size
    P, R = np.empty((n, n)), np.empty((n, n))
    problem.pencils.pencil(J, problem.kinds, n, flow, sizes, period, P, R)
    if closing == PHASE_END:
        values = np.linalg.eigvals(P[:-1, :-1]).astype(np.complex128)
    elif closing == CLOSED_END:
        values = _across(*_without_rounding(P, flow, sizes), period)
        values[np.abs(values) < scales.MULTIPLIER_LOST * problem.tol * float(np.abs(P).max())] = 0.0
    elif n == 3:
        values = np.empty(2, dtype=np.complex128)
        problem.pencils.pair(P, R, 1, values)
    else:
        values = _eigenvalues(P[1:, 1:], R[1:, 1:])
    if n > 3 or closing in (PHASE_END, CLOSED_END):
        values = values[np.argsort(-np.abs(values), kind="stable")]
    return np.append(values, 1.0) if autonomous else values


def multiplier_errors(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64], values: NDArray[np.complex128]
) -> NDArray[np.float64]:
    """Return by how much each multiplier may be wrong, shape (states,): by its change where the Jacobian errs.

    Every entry of the Jacobian is changed by ten times the flow's tolerance of itself, in a fixed pattern of signs.
    Infinite multipliers err by infinity.

    Parameters
    ----------
    values : ndarray of complex, shape (states,)
        What `multipliers` returns for it.
    """
    other = multipliers(problem, u, with_errors(problem, J))
    errors = np.full(values.size, math.inf)
    finite = np.isfinite(values)
    gaps = np.abs(values[finite][:, None] - other[np.isfinite(other)][None, :])
    errors[finite] = gaps.min(axis=1, initial=math.inf)
    if problem.system.phase is None:
        errors[-1] = 0.0
    return errors


def with_errors(problem: OrbitProblem, J: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return a Jacobian, each entry changed by ten times the flow's tolerance of it, in a fixed pattern of signs."""
    rows, columns = np.indices(J.shape)
    signs = np.where((3 * rows + 5 * columns + rows * columns) % 7 % 2, 1.0, -1.0)
    return np.asarray(J * (1.0 + scales.MATRIX_ERROR * max(problem.tol, 1e-14) * signs))


def undecided(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64], values: NDArray[np.complex128]
) -> bool:
    """Return whether multipliers are too inexact at a loose tolerance to be counted, or to be told on from there.

    Where branches meet at a multiplier 1, errors part them: it then comes near 1 and turns back. At the finest
    tolerance nothing can be computed more exactly, and the answer is no.
    """
    if problem.tol <= scales.FINEST:
        return False
    inner = nontrivial(values, autonomous=problem.system.phase is None)
    errors = multiplier_errors(problem, u, J, values)[: inner.size]
    sizes = np.abs(inner)
    if not np.all(errors <= scales.ROUGH * np.maximum(sizes, 1.0)):
        return True
    if np.any(np.abs(inner - 1.0) <= scales.critical_error(problem.tol)):
        return True
    return any(
        scales.zero(size - 1.0, error) is not scales.Verdict.NO for size, error in zip(sizes, errors, strict=True)
    )


def _across(P: NDArray[np.float64], flow: NDArray[np.float64], period: float) -> NDArray[np.complex128]:
    """Return a closed curve's multipliers but the trivial one; at an equilibrium that is the one nearest to 1."""
    if np.linalg.norm(flow) * period > scales.UNMOVED:
        return np.linalg.eigvals(_quotient(P, flow)).astype(np.complex128)
    values = np.linalg.eigvals(P).astype(np.complex128)
    return np.delete(values, int(np.argmin(np.abs(values - 1.0))))


def _without_rounding(
    P: NDArray[np.float64], flow: NDArray[np.float64], sizes: NDArray[np.float64]
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the linearised flow and the flow's direction, without states that are rounding of 0.

    An orbit in an invariant plane has such states. In units of their own sizes the flow along them is arbitrary, and so
    is what moves them. They are left out if the flow then is the better eigenvector.
    """
    resting = sizes < scales.SIZE_LOST * float(sizes.max())
    if not np.any(resting):
        return P, flow
    bare, apart = np.where(resting, 0.0, flow), P.copy()
    apart[np.ix_(resting, ~resting)] = 0.0
    before = np.linalg.norm(P @ flow - flow) * np.linalg.norm(bare)
    after = np.linalg.norm(apart @ bare - bare) * np.linalg.norm(flow)
    return (apart, bare) if after < before else (P, flow)


def _of_pieces(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64], flows: NDArray[np.float64] | None
) -> NDArray[np.complex128]:
    """Return the multipliers of an orbit that is cut, largest modulus first, the trivial one last."""
    if problem.signature.flies:
        maps = landing_maps(problem, u, J)
        if not np.all(np.isfinite(maps)):
            return np.full(problem.n, np.nan + 0j)[problem.system.phase is not None :]
        values = _of_product(across_flow(problem, u, maps))
        return np.append(values, 1.0) if problem.system.phase is None else values
    maps, scale = piece_maps(problem, J), problem.common_scale
    left, units = np.arange(problem.n), own_units(problem, u)
    if units is not None:
        starts, ends = units
        maps, scale = maps * (starts / scale)[:, None, :] * (scale / ends)[:, :, None], starts
    if problem.conserving:
        laws, sizes = problem.system.laws, scale[: len(problem.system.states)]
        leaf = Leaf(laws.matrix(problem.parameters_at(u)) * sizes, np.ones(sizes.size))
        maps, left = leaf.within(maps), leaf.widened(problem.n)
    if not np.isfinite(maps).all():  # on a mesh too coarse for the sensitivities
        return np.full(maps.shape[1] - (problem.system.phase is not None), np.nan + 0j)
    if problem.system.phase is not None:
        return _of_product(maps[:, :-1, :-1])
    if flows is None:
        flows = problem.flows_at_starts(u)
    turns = [reflector(flow[left]) for flow in flows / scale]
    turned = [turns[(i + 1) % len(maps)] @ matrix @ turns[i] for i, matrix in enumerate(maps)]
    values = _of_product(np.array(turned)[:, 1:, 1:])
    if values[-1].imag == 0.0 and abs(values[-1]) < 1.0:
        # the least multiplier follows from the product of all, which the flow's error in its own direction spares
        with np.errstate(divide="ignore"):  # maps of a long stay at a saddle may have no determinant within the floats
            signs, logs = np.linalg.slogdet(maps)
        others = complex(np.prod(values[:-1])).real
        if 0.0 < abs(others) < math.inf:
            values[-1] = math.copysign(
                math.exp(float(logs.sum()) - math.log(abs(others))), float(signs.prod()) * others
            )
    if problem.relaxes:  # as many multipliers are error as directions that a piece contracts below its own error
        stretches = np.linalg.svd(maps, compute_uv=False)
        lost = int(np.sum(stretches < scales.MULTIPLIER_LOST * problem.tol * stretches[:, :1], axis=1).max())
        values[values.size - lost :] = 0.0
    return np.append(values, 1.0)


def _of_product(blocks: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the eigenvalues of blocks[-1] ... blocks[0], largest first, each to digits of its own."""
    from saltus.orbits.kernels.cyclic import triangularise

    count, n = len(blocks), blocks.shape[1]
    triangles, turn = np.empty((count, n, n)), np.empty((n, n))
    triangularise(np.ascontiguousarray(blocks), _ROUNDS, scales.DECOUPLED, triangles, turn)
    parts = [0, *(s for s in range(1, n) if np.abs(turn[s:, :s]).max() < scales.DECOUPLED), n]
    values: list[complex] = []
    for low, high in itertools.pairwise(parts):
        # those of sizes too near each other to part are eigenvalues of a product of small matrices, scaled on the way
        product, exponent = turn[low:high, low:high], 0
        for triangle in triangles[::-1]:
            product = product @ triangle[low:high, low:high]
            shift = math.frexp(float(np.abs(product).max()))[1]
            product, exponent = np.ldexp(product, -shift), exponent + shift
        found = np.linalg.eigvals(product).tolist()
        values += [complex(_scaled(v.real, exponent), _scaled(v.imag, exponent)) for v in found]
    every = np.array(values, dtype=np.complex128)
    return every[np.argsort(-np.abs(every), kind="stable")]


def _scaled(value: float, exponent: int) -> float:
    """Return value times 2 ** exponent, infinite where that is too large."""
    try:
        return math.ldexp(value, exponent)
    except OverflowError:
        return math.copysign(math.inf, value)


def _quotient(P: NDArray[np.float64], flow: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivative of the return to the plane across the flow.

    What leaves the plane comes back along the flow's image: an orbit closes up to rounding, which the matrix's norm
    would magnify where the image is taken to be the flow itself.
    """
    turn = reflector(flow)
    turned = turn @ P @ turn
    along, leaving = turned[0, 0], turned[1:, 0]
    if abs(along - 1.0) > scales.REVERSED:
        return np.asarray(turned[1:, 1:])
    return np.asarray(turned[1:, 1:] - np.outer(leaving, turned[0, 1:]) / along)


def _eigenvalues(P: NDArray[np.float64], R: NDArray[np.float64]) -> NDArray[np.complex128]:
    """Return the generalised eigenvalues of a pencil, infinite ones as inf.

    A state that rests at 0 has no size of its own. Units in which both matrices are balanced take its place.
    """
    from scipy.linalg.lapack import dgebal, dggev

    if not (np.isfinite(P).all() and np.isfinite(R).all()):
        return np.full(len(P), np.nan + 0j)
    if not P.size:
        return np.empty(0, dtype=np.complex128)
    units = dgebal(np.abs(P) + np.abs(R), scale=1, permute=0)[3]  # powers of two
    if np.isfinite(units).all():
        P, R = P * units / units[:, None], R * units / units[:, None]
    re, im, beta, _, _, _, info = dggev(P, R, compute_vl=0, compute_vr=0)
    if info != 0:
        return np.full(len(P), np.nan + 0j)
    alpha = re + 1j * im
    values = np.full(len(P), np.inf + 0j)
    finite = np.abs(beta) > 1e-15 * max(float(np.abs(beta).max(initial=0.0)), float(np.abs(alpha).max(initial=0.0)))
    values[finite] = alpha[finite] / beta[finite]
    first = np.flatnonzero(im > 0.0)
    values[first + 1] = values[first].conj()
    return values


def doubling_determinant(problem: OrbitProblem, J: NDArray[np.float64]) -> tuple[float, float]:
    """Return sign and log of |det(A + B)|: zero where a multiplier is -1, smooth through a grazing.

    A is the derivative of all segment equations in this period's unknowns, B that of the closing ones in the next
    period's start.
    """
    sign, log = problem.pencils.doubling(J, problem.n)
    return float(sign), float(log)


def nontrivial(values: NDArray[np.complex128], *, autonomous: bool) -> NDArray[np.complex128]:
    """Return the multipliers without the trivial one, which `multipliers` puts last."""
    return values[:-1] if autonomous else values


def unstable_count(values: NDArray[np.complex128], *, neutral: bool = False) -> int:
    """Return how many of the given multipliers lie outside the unit circle.

    neutral: whether multipliers may lie on the circle but for rounding, as in a conservative system.
    """
    most = 1.0 + scales.NEUTRAL if neutral else 1.0
    return sum(1 for value in values.tolist() if abs(value) > most)


def distance_from_circle(values: NDArray[np.complex128]) -> float:
    """Return |mu|^2 - 1 of the complex pair nearest to the unit circle; NaN where there is none."""
    nearest = math.nan
    for value in values.tolist():
        if value.imag > scales.PAIRED * abs(value) and math.isfinite(value.real):
            size = abs(value) ** 2 - 1.0
            if not abs(size) >= abs(nearest):
                nearest = size
    return nearest


def height(value: complex) -> float:
    """Return (|mu|^2 - 1) / (|mu|^2 + 1), its height on the Riemann sphere: 0 on the unit circle, 1 at infinity."""
    size = abs(value)
    return 1.0 - 2.0 / (1.0 + size * size) if size < 1e150 else 1.0


class Passage(NamedTuple):
    """What becomes of multipliers from one point of a branch to the next."""

    # multipliers at the second point, in the order of the multipliers at the first that they come from
    followed: tuple[complex, ...]
    # real, pairs: counts of real multipliers and of complex pairs that cross the unit circle
    real: int
    pairs: int
    sure: bool  # false where exchanging two multipliers that lie less than twice as far away changes these counts


def passage(before: Sequence[complex], values: Sequence[complex]) -> Passage:
    """Return what becomes of multipliers on the way from one point of a branch to the next.

    Nearest ones on the Riemann sphere are paired, so that a multiplier may pass through infinity; of a complex pair,
    the one with the positive imaginary part comes from such a one.

    Parameters
    ----------
    before, values : sequences of complex, of the same length
        Multipliers at the first point and at the second.
    """
    every = range(len(values))
    old, new = [_spot(value) for value in before], [_spot(value) for value in values]
    gaps = np.linalg.norm(np.array(old).reshape(-1, 1, 3) - np.array(new).reshape(1, -1, 3), axis=2)
    away: list[list[float]] = gaps.tolist()
    chosen, taken = [-1] * len(values), set[int]()
    for place in np.argsort(gaps, axis=None, kind="stable").tolist():
        i, j = divmod(place, len(values))
        if chosen[i] < 0 and j not in taken:
            chosen[i] = j
            taken.add(j)
            if len(taken) == len(values):
                break
    found = [values[j] for j in chosen]
    for i, value in enumerate(found):
        if value.imag * before[i].imag < 0.0 and (twin := value.conjugate()) in found:
            k = found.index(twin)
            found[i], found[k] = twin, value
    sides, ends = [_side(spot[2]) for spot in old], [_side(new[j][2]) for j in chosen]
    if len({*sides, *ends}) == 1:
        return Passage(tuple(found), 0, 0, True)
    sure, across = True, []
    for i in every:
        if sides[i] * ends[i] < 0:
            across.append(i)
        for k in range(i):
            # an exchange matters where each would end on the other's side, and both do not start on one
            if sides[i] * sides[k] < 0 and ends[i] * ends[k] < 0:
                swapped = max(away[i][chosen[k]], away[k][chosen[i]])
                sure &= swapped >= scales.EXCHANGED * max(away[i][chosen[i]], away[k][chosen[k]])
    pairs = sum(
        any(_complex(at[i]) and at[i] == at[k].conjugate() for at in (before, found))
        for i in across
        for k in across
        if k < i
    )
    return Passage(tuple(found), len(across) - 2 * pairs, pairs, sure)


def _complex(value: complex) -> bool:
    return abs(value.imag) > scales.PAIRED * abs(value)


def _side(above: float) -> int:
    """Return the sign of a height, 0 on the circle."""
    return 0 if abs(above) < scales.ON_CIRCLE else int(math.copysign(1.0, above))


def _spot(value: complex) -> tuple[float, float, float]:
    """Return a multiplier's place on the Riemann sphere, folded so that a complex pair is one place."""
    size = abs(value)
    if not size < 1e150:
        return 0.0, 0.0, 1.0
    over = 2.0 / (1.0 + size * size)
    return over * value.real, over * abs(value.imag), 1.0 - over
