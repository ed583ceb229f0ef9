"""A solution computed anew from its unknowns: what its properties must be, each with the error of that."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from functools import singledispatch
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from saltus.equilibria import Equilibrium
from saltus.equilibria.pseudo import beside_two_fold
from saltus.maps.orbit import MapOrbit
from saltus.orbits import PeriodicOrbit
from saltus.orbits.observables.outputs import curved
from saltus.orbits.signature import EARLY, EVENT_END, MEAN_END
from saltus.orbits.stability.floquet import multiplier_errors, multipliers, nontrivial, unstable_count
from saltus.orbits.stability.speedless import or_unknown
from saltus.scales import (
    ABOVE_ROUNDING,
    ALGEBRAIC_RESIDUAL,
    EPS,
    EXTREME_SURVEYED,
    INFINITE,
    NEUTRAL,
    NEWTON_ACCEPTED,
    NEWTON_AT_ROUNDING,
    RESIDUAL_KEPT,
    SENSITIVITIES,
    SPEEDLESS,
    STALLED_AT_ROUNDING,
    TOUCHING,
    VERIFIED_EXTREME,
    followed,
)
from saltus.verification.growth import own_errors
from saltus.verification.spectra import paired

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits.problem import OrbitProblem
    from saltus.orbits.signature import Survey

__all__ = ["Claim", "claims", "orbit_claims"]


class Claim(NamedTuple):
    """A property as it is said, as it follows from the unknowns, and the error of that, shape (component,) each."""

    what: str
    said: NDArray[Any]
    found: NDArray[Any]
    error: NDArray[np.float64]  # infinite where it is undetermined

    @classmethod
    def of(cls, what: str, said: Any, found: Any, error: Any) -> Claim:
        """Return a claim of numbers or arrays; a single error is that of all components."""
        both = np.atleast_1d(np.asarray(said)), np.atleast_1d(np.asarray(found))
        return cls(what, *both, np.broadcast_to(np.asarray(error, dtype=float), both[1].shape))


@singledispatch
def claims(solution: Any, said: Mapping[str, Any]) -> Iterator[Claim]:
    """Yield what a solution says of itself, held against its unknowns; `said` replaces some of its properties."""
    raise NotImplementedError(type(solution).__name__)


@claims.register
def _(solution: Equilibrium, said: Mapping[str, Any]) -> Iterator[Claim]:
    problem, x = solution.problem(), np.array(solution.state)
    sizes = said.get("sizes", np.abs(x))
    remade = Equilibrium.from_unknowns(problem, x, sizes)
    if beside_two_fold(problem, x, sizes) is None:
        A = problem.within(x, problem.evaluate(x)[1][:, : problem.n])
        errors = _value_errors(A, remade.eigenvalues)
    else:  # the sliding field is 0/0
        errors = np.full(remade.eigenvalues.size, math.inf)
    values = remade.eigenvalues
    own = said.get("eigenvalues", solution.eigenvalues)
    yield _known_values("eigenvalues", own, (problem, x, sizes), remade, errors)
    sure = bool(np.all(np.abs(values.real) > errors))
    yield from _of_zero(solution, remade, said, sure=sure)


@claims.register
def _(solution: MapOrbit, said: Mapping[str, Any]) -> Iterator[Claim]:
    problem, u = _map_problem(solution)
    remade = MapOrbit.from_unknowns(problem, u, said.get("sizes", np.abs(u)))
    values, product = remade.multipliers, np.eye(problem.states)
    for slope in problem.slopes(u)[1]:
        product = slope @ product
    errors = _value_errors(product, values)
    own = said.get("multipliers", solution.multipliers)
    yield _known_values("multipliers", own, (problem, u, said.get("sizes", np.abs(u))), remade, errors)
    yield from _of_zero(solution, remade, said, sure=bool(np.all(np.abs(np.abs(values) - 1.0) > errors)))


def _worded(reasons: Sequence[str]) -> str:
    """Return reasons as one text without their numbers."""
    return "; ".join(re.sub(r"-?\d[\d.]*(e[+-]?\d+)?", "#", text) for text in reasons)


def _known_values(
    what: str, said: Any, given: tuple[Any, NDArray[np.float64], Any], remade: Any, errors: NDArray[np.float64]
) -> Claim:
    """Return the claim of the eigenvalues or multipliers of a zero, computed anew.

    Those of a column are of the unknowns before the last Newton step, which next to a singular solution is the longest
    that is taken. It counts where rounding alone does not explain a difference.
    """
    problem, u, sizes = given
    values = getattr(remade, what)
    claim = _values(what, said, values, errors)
    if not _is_off(claim, values):
        return claim
    errors = np.array(errors)
    for i, size in enumerate(np.abs(u).tolist()):
        moved = u.copy()
        moved[i] += STALLED_AT_ROUNDING * size
        other = getattr(type(remade).from_unknowns(problem, moved, sizes), what)
        errors += np.abs(other[paired(values, other)] - values)
    return _values(what, said, values, errors)


def _map_problem(solution: MapOrbit) -> tuple[Any, NDArray[np.float64]]:
    return solution.problem(), np.array(solution.points, dtype=float).ravel()


def _of_zero(solution: Any, remade: Any, said: Mapping[str, Any], *, sure: bool) -> Iterator[Claim]:
    """Yield what all zeros of algebraic equations say."""
    left = max(ALGEBRAIC_RESIDUAL, NEWTON_AT_ROUNDING)
    yield Claim.of("residual", said.get("residual", solution.residual), remade.residual, left)
    yield Claim.of("residual of the equations", 0.0, remade.residual, left)
    yield Claim.of("regular", said.get("sound", solution.sound), remade.sound, 0.0)
    if "sound" not in said:
        yield Claim.of("reasons", _worded(solution.reasons), _worded(remade.reasons), 0.0)
    if "locus" not in said:
        yield Claim.of("stable", said.get("stable", solution.stable), remade.stable, 0.0 if sure else math.inf)


@claims.register
def _(solution: PeriodicOrbit, said: Mapping[str, Any]) -> Iterator[Claim]:
    names = ("x0", "period", "lows", "highs", "multipliers", "admissible", "faults", "stable", "residual")
    own = {name: getattr(solution, name) for name in names}
    problem, implicit = solution.problem(), solution.implicit
    # either way may follow an orbit: that of the orbits before it goes on
    yield Claim.of("implicit", implicit, problem.stiff, 0.0 if implicit == problem.stiff else math.inf)
    yield from orbit_claims(problem, np.array(solution.unknowns), own | dict(said))


def orbit_claims(problem: OrbitProblem, u: NDArray[np.float64], said: Mapping[str, Any]) -> Iterator[Claim]:
    """Yield what is said of an orbit, held against a survey of it and its multipliers, both made anew.

    said: properties by the names of the columns of a curve. ``family`` is whether it is one of a family. ``sizes`` are
    those of the states, shape (state,), where a curve tells them.
    """
    n, count = problem.n, len(problem.system.states)
    J = problem.resolve(u)[1]
    survey = problem.survey(u)
    sizes = np.maximum(np.abs(survey.lows), np.abs(survey.highs))
    errors = _state_errors(problem, J, sizes[:n])
    phase = problem.system.phase
    period = abs(float(u[n : problem.size : n + 1].sum()))
    yield Claim.of("x0", said["x0"], survey.x0[:count], errors[:count])
    lasting = float(np.abs(u[n : problem.size : n + 1]).sum())
    yield Claim.of("period", said["period"], period, problem.segments * EPS * lasting)
    late = followed(problem.tol) * period
    errors = errors + late * _speeds(problem)
    each = np.concatenate([errors, _output_errors(problem, survey, sizes, errors)])
    for name in ("lows", "highs", "means", "harmonics"):
        if name in said:
            yield Claim.of(name, said[name], getattr(survey, name), each)
    met = problem.event_sizes(u)
    left = max(float(errors.max()), followed(problem.tol) * float(met.max(initial=0.0)))
    left = max(left, late * float(np.abs(survey.rates[:, 0]).max(initial=0.0)))
    yield Claim.of("residual", said["residual"], survey.residual, left)
    scale = np.maximum(problem.state_scale[:count], said.get("sizes", 0.0))
    kept = RESIDUAL_KEPT * max(float(scale.max()), float(met.max(initial=0.0)))
    yield Claim.of("residual of the equations", 0.0, survey.residual, max(left, kept))
    sure = math.inf if _touches(problem, survey, met, u) else 0.0
    yield Claim.of("admissible", said["admissible"], survey.faults == 0, sure)
    if "faults" in said:
        yield Claim.of("faults", said["faults"], survey.faults, sure)
    values = or_unknown(problem, u, J, survey.rates[:, 0], multipliers(problem, u, J))
    off = _multiplier_errors(problem, u, J, values, period, survey)
    claim = _values("multipliers", said["multipliers"], values, off)
    if _is_off(claim, values):
        off = off + own_errors(problem, u, values)
        claim = _values("multipliers", said["multipliers"], values, off)
    yield claim
    if "stable" in said:
        inner, edge = nontrivial(values, autonomous=phase is None), off[: values.size - (phase is None)]
        neutral = bool(said.get("family", False))
        sure = bool(np.all(np.abs(np.abs(inner) - 1.0) > np.maximum(edge, NEUTRAL if neutral else 0.0)))
        stable = unstable_count(inner, neutral=neutral) == 0
        yield Claim.of("stable", said["stable"], stable, 0.0 if sure or (neutral and stable) else math.inf)


def _speeds(problem: OrbitProblem) -> NDArray[np.float64]:
    """Return how fast each state moves at the ends of segments at most, by which it errs as their times do."""
    ends = [problem.state_on(i, 1.0) for i in range(problem.segments)]
    field, p = problem.system.compiled.field, problem.p
    speeds = [np.abs(field(mode, end, p)) for mode, end in zip(problem.signature.modes, ends, strict=True)]
    return np.asarray(np.nan_to_num(np.max(speeds, axis=0), nan=0.0, posinf=0.0))


def _state_errors(problem: OrbitProblem, J: NDArray[np.float64], sizes: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return what the flow leaves of its tolerance in each state: that of a start, and what a segment makes of it."""
    n, rows = problem.n, np.abs(J[:, : problem.size]).reshape(problem.segments, problem.n + 1, -1)
    columns = np.delete(rows[:, :n], np.s_[n :: n + 1], axis=2)
    grown = (columns @ np.tile(sizes, problem.segments)).max(axis=0)
    # a state that rests has the absolute error of one that moves elsewhere on the curve
    return np.asarray(followed(problem.tol) * (sizes + grown + ABOVE_ROUNDING * problem.state_scale))


def _output_errors(
    problem: OrbitProblem, survey: Survey, sizes: NDArray[np.float64], errors: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the errors of outputs' extremes and means: of those with peaks, what a survey's places leave."""
    n, names = problem.n, problem.system.output_names
    share = VERIFIED_EXTREME + float(np.max(errors / np.where(sizes[:n] > 0.0, sizes[:n], 1.0), initial=0.0))
    peaked = [name in curved(problem.system) for name in names]
    ranges = np.nan_to_num(survey.highs[n:] - survey.lows[n:], nan=math.inf, posinf=math.inf)
    with np.errstate(invalid="ignore"):
        return np.where(peaked, EXTREME_SURVEYED * ranges, 0.0) + share * np.nan_to_num(sizes[n:], nan=1.0)


def _touches(problem: OrbitProblem, survey: Survey, sizes: NDArray[np.float64], u: NDArray[np.float64]) -> bool:
    """Return whether an orbit is so near to a border that it may be admissible or not.

    It touches a surface, meets it slowly, begins or ends on another one, or for no time; or a condition vanishes.
    """
    size = float(sizes.max(initial=0.0)) or 1.0
    durations = np.abs(u[problem.n : problem.size : problem.n + 1])
    period = float(durations.sum())
    tables = [survey.margins, survey.unmet, survey.rates[:, 3]]
    if survey.faults & EARLY:
        ends, starts = np.array(survey.ahead), np.array(survey.behind)
        rows, own = np.arange(problem.segments), np.array(problem.signature.transitions)
        ends[rows[own >= 0], own[own >= 0]] = math.nan
        before = np.roll(own, 1)
        starts[rows[before >= 0], before[before >= 0]] = math.nan
        tables += [ends, starts]
    if any(np.any(np.abs(table) <= TOUCHING * size) for table in tables) or np.any(durations <= TOUCHING * period):
        return True
    met = np.isin(problem.kinds, (EVENT_END, MEAN_END))
    return bool(np.any(np.abs(survey.rates[met, 0]) * period <= SPEEDLESS * sizes[met]))


def _multiplier_errors(
    problem: OrbitProblem, u: NDArray[np.float64], J: NDArray[np.float64], values: NDArray[np.complex128],
    period: float, survey: Survey,
) -> NDArray[np.float64]:  # fmt: skip
    """Return the error of each multiplier; infinite where one is, as at an event without speed."""
    top = float(np.abs(values).max(initial=1.0))
    if not top < INFINITE:  # NaN too
        return np.full(values.size, math.inf)
    met = np.isin(problem.kinds, (EVENT_END, MEAN_END))
    rates, sizes = np.abs(survey.rates[met, 0]) * period, problem.event_sizes(u)[met]
    with np.errstate(divide="ignore"):
        slowest = float(np.max(sizes / rates, initial=0.0))
    # the matrix of a column is that of the last Newton step but one
    rough = (followed(problem.tol) + NEWTON_ACCEPTED) * (SENSITIVITIES + slowest) * top
    return np.asarray(SENSITIVITIES * multiplier_errors(problem, u, J, values) + rough)


def _value_errors(A: NDArray[np.float64], values: NDArray[np.complex128]) -> NDArray[np.float64]:
    """Return the rounding of eigenvalues of a matrix, in the order of `values`: by the condition of each."""
    from scipy.linalg import eig, matrix_balance

    if not (A.size and np.all(np.isfinite(A))):
        return np.full(values.size, math.inf)
    balanced = matrix_balance(A, permute=False)[0]
    own, left, right = eig(balanced, left=True)
    norm, rounding = float(np.linalg.norm(balanced)), ALGEBRAIC_RESIDUAL * len(A)
    condition = 1.0 / np.maximum(np.abs(np.sum(left.conj() * right, axis=0)), EPS)
    errors = np.minimum(condition * rounding, math.sqrt(rounding)) * norm
    return np.asarray(errors[paired(values, own)])


def _values(what: str, said: Any, found: NDArray[np.complex128], errors: NDArray[np.float64]) -> Claim:
    """Return the claim of eigenvalues or multipliers; the order of those of one size is no claim."""
    said = np.asarray(said, dtype=np.complex128)
    if said.shape != found.shape:
        return Claim.of(f"number of {what}", said.size, found.size, 0.0)
    order = paired(said, found)
    if _in_order(what, order, found, errors):
        return Claim.of(what, said, found[order], errors[order])
    return Claim.of(what, said, found, errors)


def _is_off(claim: Claim, values: NDArray[np.complex128]) -> bool:
    """Return whether one of as many values is said that errs by more than its error; infinite ones do not."""
    if claim.said.shape != values.shape:
        return False
    with np.errstate(invalid="ignore"):
        return bool(np.any(np.abs(claim.said - claim.found) > claim.error))


def _in_order(what: str, order: NDArray[np.intp], found: NDArray[np.complex128], errors: NDArray[np.float64]) -> bool:
    """Return whether values stand in the order of those found, but for those that differ by no more than their errors.

    order: the index of each value's partner in `found`.
    """
    sizes = found.real if what == "eigenvalues" else np.abs(found)
    for i, first in enumerate(order.tolist()):
        for second in order[i + 1 :].tolist():
            apart = abs(float(sizes[first]) - float(sizes[second]))
            if second < first and apart > float(errors[first] + errors[second]):
                return False
    return True
