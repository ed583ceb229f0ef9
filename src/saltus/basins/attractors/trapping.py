"""Ellipsoids about periodic orbits, and the metrics and levels at which they contract.

docs/theory/basins.md, "Ellipsoids: measured", derives them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np

from saltus.ensemble.traps import Ellipsoids
from saltus.flow.event_logs import events_after
from saltus.flow.starting import starting_mode
from saltus.orbits.problem import OrbitProblem
from saltus.orbits.signature import EVENT_END, PHASE_END, Signature
from saltus.system.angles import TURN, wrapped

if TYPE_CHECKING:
    from collections.abc import Callable

    from numpy.typing import NDArray

    from saltus.ensemble.ensemble import Ensemble
    from saltus.ensemble.map_ensemble import MapEnsemble
    from saltus.orbits import PeriodicOrbit

__all__ = [
    "CONTRACTING",
    "OrbitEllipsoids",
    "contracting",
    "core_of",
    "largest_multiplier",
    "map_jacobians",
    "metric_of",
    "orbit_jacobians",
]

_RATE = 0.8  # shrinking factor of distances in the metric, over the orbit's period, at least

_STEP = 1e-4  # difference of states, over their scale, for Jacobians of a smooth map

CONTRACTING = 400  # samples of each ellipsoid that must contract
_LEVELS = 4.0  # ratio of the levels (squared radii) that are tried
_RUNGS = 22  # levels that are tried, at most

_CLEAR = 1e-3  # share of a level below which the engine's errors hide a contraction

_CORES = (64.0, 16.0, 4.0)  # levels at which samples contract over those of their cores, the best first

_CORE_SAMPLES = 64  # motions per ellipsoid that measure a core
_STRETCH = 16  # strobes between two looks at them
_STRETCHES = 16  # looks at them


@dataclass(frozen=True)
class OrbitEllipsoids:
    """Ellipsoids about the points of one periodic orbit, ``|metric (x - centre)|^2 < level``."""

    centres: NDArray[np.float64]  # shape (period, n): the points, in the order in which they are visited
    # shape (period, n, n): upper triangular; distances shrink from each point's metric to the next one's
    metrics: NDArray[np.float64]
    level: float  # square of the radius
    # shape (period, planes, n): unit vectors of planes, which leave ``normal . metric (x - centre) < offset`` of an
    # ellipsoid; zero for a plane that an ellipsoid lacks.
    normals: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0, 0)))
    offsets: NDArray[np.float64] = field(default_factory=lambda: np.empty((0, 0)))  # shape (period, planes)
    # shape (period,): mode of the motions that each ellipsoid holds; -1 for all modes
    modes: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))
    # shape (period, n): states that the mode of an ellipsoid's motions lacks; no sample differs from the centre there
    absent: NDArray[np.bool_] = field(default_factory=lambda: np.empty((0, 0), np.bool_))
    # places of the states on a circle; no half width there is above half a turn
    circles: NDArray[np.int64] = field(default_factory=lambda: np.empty(0, np.int64))

    def __post_init__(self) -> None:
        period, n = self.centres.shape
        if not self.absent.size:
            object.__setattr__(self, "absent", np.zeros((period, n), np.bool_))
        if not self.offsets.size:
            object.__setattr__(self, "normals", np.empty((period, 0, n)))
            object.__setattr__(self, "offsets", np.empty((period, 0)))
        if not self.modes.size:
            object.__setattr__(self, "modes", np.full(period, -1))

    def at(self, level: float) -> OrbitEllipsoids:
        """Return the same ellipsoids at another level, with the same planes."""
        return replace(self, level=level)

    def cut(self, x: NDArray[np.float64], part: float) -> OrbitEllipsoids:
        """Return the ellipsoids cut by planes so that given states, shape (m, n), are outside.

        Each plane belongs to the state nearest to the centre among those inside. It is parallel to the tangent of the
        ellipsoid through this state, at a share of its distance.

        References
        ----------
        R. Deits, R. Tedrake, Computing large convex regions of obstacle-free space through semidefinite programming,
        Algorithmic Foundations of Robotics XI (2015) 109-124.
        """
        planes = [
            [(normal, offset) for normal, offset in zip(*pair, strict=True) if normal.any()]
            for pair in zip(self.normals, self.offsets, strict=True)
        ]
        for k, inside in enumerate(self._inside(x).T):
            y = wrapped(x[inside] - self.centres[k], self.circles) @ self.metrics[k].T
            while len(y):
                distances = np.linalg.norm(y, axis=1)
                nearest = int(np.argmin(distances))
                normal, offset = y[nearest] / distances[nearest], part * distances[nearest]
                planes[k].append((normal, offset))
                y = np.delete(y, nearest, axis=0)
                y = y[y @ normal < offset]
        most = max(map(len, planes))
        normals, offsets = np.zeros((len(planes), most, x.shape[1])), np.ones((len(planes), most))
        for k, own in enumerate(planes):
            for j, (normal, offset) in enumerate(own):
                normals[k, j], offsets[k, j] = normal, offset
        return replace(self, normals=normals, offsets=offsets)

    def share(self, samples: int, rng: np.random.Generator) -> float:
        """Return the least share of an ellipsoid's volume that its planes leave, from samples."""
        y = math.sqrt(self.level) * _in_ball(np.ones((samples, self.centres.shape[1]), np.bool_), rng)
        inside = np.einsum("kpj,mj->kmp", self.normals, y) < self.offsets[:, None, :]
        return float(inside.all(axis=2).mean(axis=1).min())

    def sizes(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return ``|metric (x - centre)|^2`` about each point, shape (m, period), of states, shape (m, n)."""
        return np.asarray((self._apart(x) ** 2).sum(axis=2))

    def holds(self, x: NDArray[np.float64], modes: NDArray[np.int64] | None = None) -> NDArray[np.bool_]:
        """Return whether each state, in its mode where modes are given, lies in one of the ellipsoids."""
        inside = self._inside(x)
        if modes is not None:
            inside &= (self.modes < 0) | (self.modes == modes[:, None])
        return np.asarray(inside.any(axis=1))

    def _inside(self, x: NDArray[np.float64]) -> NDArray[np.bool_]:
        """Return whether each state lies in each ellipsoid, shape (m, period)."""
        y = self._apart(x)
        within = (np.einsum("kpi,mki->mkp", self.normals, y) < self.offsets).all(axis=2)
        return np.asarray(within & ((y**2).sum(axis=2) < self.level))

    def _apart(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        apart = wrapped(x[:, None, :] - self.centres, self.circles)
        return np.asarray(np.einsum("kij,mkj->mki", self.metrics, apart))

    def samples(self, count: int, rng: np.random.Generator) -> NDArray[np.float64]:
        """Return states uniform in each ellipsoid, `count` in all, shape (count, n), grouped by ellipsoid."""
        period, n = self.centres.shape
        which = np.arange(count) * period // count
        inverse = np.zeros((period, n, n))  # of each metric, for the states that are present
        for own, metric, present in zip(inverse, self.metrics, ~self.absent, strict=True):
            own[np.ix_(present, present)] = np.linalg.inv(np.linalg.qr(metric[:, present], mode="r"))
        x = np.empty((count, n))
        outside = np.arange(count)
        while len(outside):
            own = which[outside]
            within = math.sqrt(self.level) * _in_ball(~self.absent[own], rng)
            x[outside] = self.centres[own] + np.einsum("mij,mj->mi", inverse[own], within)
            outside = outside[~self._inside(x[outside])[np.arange(len(own)), own]]
        return x

    def modes_of(self, count: int) -> NDArray[np.int64]:
        """Return the modes of `count` samples, -1 for the first that each allows."""
        return self.modes[np.arange(count) * len(self.centres) // count]

    def half_widths(self) -> NDArray[np.float64]:
        """Return the half widths of the boxes about the ellipsoids, shape (period, n)."""
        return np.asarray(np.sqrt(self.level * (np.linalg.inv(self.metrics) ** 2).sum(axis=2)))

    def as_traps(self, label: int) -> Ellipsoids:
        """Return the ellipsoids as regions of an attractor's label, twice those that an end of a circle cuts."""
        which, centres = self._copies()
        return Ellipsoids(
            centres,
            self.metrics[which] / math.sqrt(self.level),
            np.full(len(centres), label, np.uint8),
            np.einsum("kpi,kij->kpj", self.normals[which], self.metrics[which]),
            self.offsets[which],
            self.modes[which],
        )

    def _copies(self) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
        """Return which ellipsoids reach states between -pi and pi in each angle, and their centres, turns away."""
        which, centres = np.arange(len(self.centres)), self.centres
        for place in self.circles:
            angle, reach = centres[:, place], math.pi - self.half_widths()[which, place]
            for beyond, turn in ((angle > reach, -TURN), (angle < -reach, TURN)):
                moved = centres[: len(angle)][beyond]
                moved[:, place] += turn
                which, centres = np.append(which, which[: len(angle)][beyond]), np.concatenate([centres, moved])
        return which, centres


def _in_ball(free: NDArray[np.bool_], rng: np.random.Generator) -> NDArray[np.float64]:
    """Points uniform in unit balls of the coordinates that are free, shape (count, n); the others are 0."""
    ball = free * rng.standard_normal(free.shape)
    radii = rng.random(len(free)) ** (1.0 / free.sum(axis=1))
    return np.asarray(ball * (radii / np.linalg.norm(ball, axis=1))[:, None])


def orbit_jacobians(orbit: PeriodicOrbit, points: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the Jacobians of the one-period map along an orbit of a system with a phase, shape (period, n, n).

    They come from the segment equations, as the orbit's multipliers do, with segments cut at each phase 0 and each
    event. No difference quotient is taken: next to a grazing the map is linear on no scale that one could choose.
    docs/theory/orbits.md derives the equations.

    Parameters
    ----------
    points : ndarray, shape (period, n)
        The orbit's states at phase 0 in the order of visits, from any of them on.

    Raises
    ------
    ChatteringError, DivergenceError
        The orbit cannot be followed from the first point.

    References
    ----------
    As `saltus.flow.saltation.saltation_matrix`, by the implicit function theorem.
    """
    system, n = orbit.system, points.shape[1]
    p, x = system.parameter_vector(orbit.parameters), system.full_state(points[0])
    mode = starting_mode(system, x, p)
    tolerance = orbit.tolerance, orbit.tolerance
    log = events_after(system, p, x, mode, periods=len(points), tolerance=tolerance)
    wraps = log.transition < 0
    starts = np.vstack([x, log.x_after[:-1]])
    starts[:, -1] += system.turn * np.append(0, np.cumsum(wraps)[:-1])
    form = Signature(
        (mode, *log.mode_after[:-1].tolist()),
        tuple(log.transition.tolist()),
        tuple(np.where(wraps, PHASE_END, EVENT_END).tolist()),
        len(points),
    )
    chain = OrbitProblem(system, form, p, tol=orbit.tolerance)
    unknowns = np.column_stack([starts, np.diff(log.time, prepend=0.0)]).ravel()
    chain.start(unknowns)
    _, equations = chain.evaluate(unknowns)
    size, wide = n + 1, n + 2
    jacobians, passed = [], np.eye(size)
    for k, wrap in enumerate(wraps):
        rows = slice(k * wide, k * wide + size)
        block = equations[rows, k * wide : (k + 1) * wide] + (np.eye(size, wide) if len(form) == 1 else 0.0)
        # the end: where the phase has turned once, or the event function vanishes
        end = block[-1] if wrap else equations[rows.stop, k * wide : (k + 1) * wide]
        passed = (block[:, :-1] - np.outer(block[:, -1], end[:-1] / end[-1])) @ passed
        if wrap:
            jacobians.append(passed[:n, :n])
            passed = np.eye(size)
    return np.array(jacobians)


def map_jacobians(
    ensemble: Ensemble | MapEnsemble,
    points: NDArray[np.float64],
    scale: NDArray[np.float64],
    modes: NDArray[np.int64] | None = None,
) -> NDArray[np.float64]:
    """Return the Jacobians of the map from strobe to strobe at points, by central differences, shape (m, n, n).

    Parameters
    ----------
    ensemble : Ensemble
        Engine, best with a tight tolerance.
    points : ndarray, shape (m, n)
        Points at which the map is smooth, as equilibria are.
    scale : ndarray, shape (n,)
        Size of each state.
    modes : ndarray of int, shape (m,), optional
        Modes at the points; by default the first that each allows.
    """
    m, n = points.shape
    pushes = np.concatenate([np.diag(_STEP * scale), np.diag(-_STEP * scale)])
    present = ~ensemble.lacked(points, modes)[:, None, :]  # a state that a mode lacks does not move, and moves nothing
    starts = None if modes is None else np.repeat(modes, 2 * n)
    images, _ = ensemble.strobe((points[:, None, :] + present * pushes).reshape(-1, n), starts)
    ahead, behind = np.split(images.reshape(m, 2 * n, n), 2, axis=1)
    apart = wrapped(ahead - behind, ensemble.system.angle_places)
    return np.asarray((apart / (2.0 * _STEP * scale)[:, None]).transpose(0, 2, 1))


def largest_multiplier(jacobians: NDArray[np.float64]) -> float:
    """Return the largest modulus of a multiplier of the product of Jacobians, shape (period, n, n), once round."""
    once_round = np.eye(jacobians.shape[1])
    for jacobian in jacobians:
        once_round = jacobian @ once_round
    return float(np.abs(np.linalg.eigvals(once_round)).max())


def metric_of(
    points: NDArray[np.float64], jacobians: NDArray[np.float64], scale: NDArray[np.float64]
) -> OrbitEllipsoids | None:
    """Return the ellipsoids in whose metric the linearised map contracts, at level 1; None for an unstable orbit.

    With the Jacobians A_k along an orbit of N points, P_k solves ``P_k = S + A_k^T P_(k+1) A_k / rho^2``. S is the
    inverse square of `scale`. rho^N lies halfway between the largest multiplier and 1, and is at least `_RATE`. So the
    linearised map takes ``x^T P_k x`` to less than rho^2 of itself at the next point. docs/theory/basins.md,
    "Ellipsoids: measured", derives the metric.

    References
    ----------
    J. P. Hespanha, Linear Systems Theory, Princeton 2009, section 8.5, the discrete Lyapunov equation.
    """
    from scipy.linalg import solve_discrete_lyapunov

    period, n = points.shape
    # in parts of the states' scales: in their own units the equation is as ill-conditioned as these are far apart
    jacobians = jacobians * scale / scale[:, None]
    weight, largest = np.eye(n), largest_multiplier(jacobians)
    if not largest < 1.0:
        return None
    rate = max(_RATE, 0.5 * (1.0 + largest)) ** (1.0 / period)
    scaled = jacobians / rate
    total, passed = np.zeros((n, n)), np.eye(n)
    for jacobian in scaled:
        total += passed.T @ passed
        passed = jacobian @ passed
    metric = solve_discrete_lyapunov(passed.T, total)
    metrics = [metric]
    for jacobian in scaled[:0:-1]:
        metrics.append(weight + jacobian.T @ metrics[-1] @ jacobian)
    inorder = np.array([metrics[0], *metrics[:0:-1]])
    return OrbitEllipsoids(points, np.array([np.linalg.cholesky(0.5 * (P + P.T)).T / scale for P in inorder]), 1.0)


def contracting(
    ensemble: Ensemble | MapEnsemble,
    ellipsoid: OrbitEllipsoids,
    rng: np.random.Generator,
    within: Callable[[NDArray[np.float64]], bool] | None = None,
) -> OrbitEllipsoids | None:
    """Return the largest of a ladder of levels at which samples contract, None without one.

    A level passes if each of `CONTRACTING` states, uniform in every ellipsoid, has its next strobe nearer to the next
    point in that point's metric. The next lower level, a quarter of it, must pass too. Where `within` is given, it must
    be true of the samples as well, and each counts, even one from which no motion may start.
    """
    contracts = False
    for rung in range(_RUNGS):
        trial = ellipsoid.at(_LEVELS**-rung)
        before, contracts = contracts, _contracts(ensemble, trial, rng, within)
        if before and contracts:
            return ellipsoid.at(_LEVELS ** (1 - rung))
    return None


def _contracts(
    ensemble: Ensemble | MapEnsemble,
    ellipsoid: OrbitEllipsoids,
    rng: np.random.Generator,
    within: Callable[[NDArray[np.float64]], bool] | None,
) -> bool:
    period = len(ellipsoid.centres)
    x = ellipsoid.samples(period * CONTRACTING, rng)
    which = np.repeat(np.arange(period), CONTRACTING)
    if within is None:
        x, which = x[possible := ensemble.allowing(x, ellipsoid.modes[which])], which[possible]
    elif not within(x):
        return False
    modes, rows = ellipsoid.modes[which], np.arange(len(x))
    before = ellipsoid.sizes(x)[rows, which]
    after = ellipsoid.sizes(ensemble.strobe(x, modes)[0])[rows, (which + 1) % period]
    clear = before > _CLEAR * ellipsoid.level
    # NaN, where a motion diverges, is not less
    contracts = (after < ellipsoid.level) & (~clear | (after < before))
    return bool(contracts.any()) and not any(within is not None or ensemble.admits(row) for row in x[~contracts])


def core_of(ensemble: Ensemble | MapEnsemble, inner: OrbitEllipsoids, rng: np.random.Generator) -> OrbitEllipsoids:
    """Return the core of contracting ellipsoids: the small part that most motions from them soon reach.

    Motions count as settled once they are in the core. Where motions reach it too slowly, as near a bifurcation, the
    core is all of `inner`.
    """
    x = inner.samples(len(inner.centres) * _CORE_SAMPLES, rng)
    modes, typical = inner.modes_of(len(x)), inner.level
    x, modes = x[possible := ensemble.allowing(x, modes)], modes[possible]
    for _ in range(_STRETCHES):
        x, modes = ensemble.strobe(x, modes, _STRETCH)
        typical = float(np.median(np.nan_to_num(inner.sizes(x).min(axis=1), nan=np.inf)))
        if typical < inner.level / _CORES[0]:
            break
    return inner.at(inner.level / next((ratio for ratio in _CORES if typical < inner.level / ratio), 1.0))
