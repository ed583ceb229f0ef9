"""Checks of periodic orbits: each segment integrated by SciPy with its variational equations, projected at events."""

from __future__ import annotations

import contextlib
import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.orbits.signature import EVENT_END, MEAN_END
from saltus.scales import (
    FINEST,
    RESTING,
    ROUGH,
    SHRUNK,
    VERIFIED_EXTREME,
    VERIFIED_GAP,
    VERIFIED_INFINITE,
    VERIFIED_REST,
    VERIFIED_SHRUNK,
    VERIFIED_SPEED,
    VERIFIED_SURFACE,
    VERIFIED_TIME,
    VERIFIED_TOUCH,
    Verdict,
    followed,
)
from saltus.system.angles import TURN
from saltus.verification.growth import own_errors
from saltus.verification.instants import without_length
from saltus.verification.motion import (
    Calls,
    Piece,
    UnfollowedError,
    contacts,
    event_map,
    extremes,
    follow,
    projection,
    return_behind_hop,
    touching,
)
from saltus.verification.reference import Reference
from saltus.verification.spectra import (
    growth_on_the_way,
    has_multiplier_condition,
    matched,
    multiplier_condition,
    spectrum,
)
from saltus.verification.table import DIFFERS, Row, compared, equal, unchecked

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.orbits import PeriodicOrbit

__all__ = ["OrbitCheck"]

_SPEEDLESS = "an event is met more slowly than another method's steps tell its speed"
_UNKNOWN = "an event is met more slowly than its own speed is known: some multipliers are rounding"
_PARTS = 8  # parts of a period with a derivative each
_STEPS = 4  # steps of Newton's method from such a cycle to the equilibrium


@dataclass(frozen=True)
class FollowedOrbit:
    """An orbit whose segments were followed by SciPy."""

    reference: Reference  # the system
    sizes: NDArray[np.float64]  # shape (states,): sizes of the states, the phase among them
    pieces: tuple[Piece, ...]  # the segments
    # shape (segments, states): distances of the ends, behind their resets, from the next starts
    gaps: NDArray[np.float64]
    # shape (segments,): by how much errors of each segment may grow up to its end, in the states' sizes
    growth: NDArray[np.float64]
    multipliers: NDArray[np.complex128]  # multipliers without the trivial one
    uncertain: NDArray[np.float64]  # how far each of them may be off
    error: float  # what the flow leaves of its tolerance for each unit of growth, over the states' sizes
    speedless: bool  # whether an event is met more slowly than such steps tell its speed

    @property
    def loose(self) -> float:
        """Error of states along the orbit, over their sizes, besides that of an orbit of the finest tolerance."""
        return max(map(self.late, range(self.growth.size)))

    def late(self, segment: int) -> float:
        """Return the same for one segment: over the period, by how much its end may come too late."""
        besides = self.error - followed(FINEST)
        return besides * float(self.growth[segment]) if besides > 0.0 else 0.0  # the growth may be beyond the floats


class OrbitCheck:
    """The checks of a periodic orbit, which is followed once.

    Parameters
    ----------
    orbit : PeriodicOrbit
        The orbit.
    sizes : ndarray, shape (states,), optional
        Sizes of the states along its curve, over which a cycle may have shrunk to an equilibrium.

    Attributes
    ----------
    shrinks_at : tuple of str
        Types of special points at which the orbit is nothing but an equilibrium.
    left_out : float
        What is known to be left of the equations: at an accumulation of hits, the hops that the orbit has not.
    """

    shrinks_at = ("HB", "BE")
    left_out = 0.0

    def __init__(self, orbit: PeriodicOrbit, sizes: NDArray[np.float64] | None = None) -> None:
        self.orbit = orbit
        self.resting = _is_rest(orbit, sizes)
        self.found: FollowedOrbit | None = None
        if not self.resting:
            for stiff in (False, True):
                with contextlib.suppress(UnfollowedError):
                    self.found = _followed(orbit, stiff)
                    break

    def rows(self) -> list[Row]:
        """Return the claims of the orbit with their checks."""
        orbit, found = self.orbit, self.found
        if self.resting:
            return _shrunk_rows(orbit)
        if found is None:
            return [unchecked("orbit", orbit.period, "SciPy's DOP853 and Radau need too many steps to follow it")]
        rows = [_closing(found, self.left_out), *_durations(orbit, found), *_multipliers(orbit, found)]
        rows += _extremes(orbit, found)
        reasons, doubts = _obstacles(orbit, found)
        if doubts and not reasons:
            rows.append(unchecked("admissible", orbit.admissible, doubts[0]))
        else:
            rows.append(equal("admissible", orbit.admissible, not reasons))
        return rows

    def unstable(self) -> tuple[int, bool]:
        """Return the number of unstable directions, and whether it is known."""
        if self.found is None:
            return 0, False
        sizes, uncertain = np.abs(self.found.multipliers), self.found.uncertain
        return int(np.sum(sizes > 1.0)), bool(np.all(np.abs(sizes - 1.0) > uncertain))

    def condition(self, kind: str, multiplicity: int = 1) -> list[Row]:
        """Return the check that the orbit is critical in the way that a special point says."""
        if kind == "HB":
            return _shrunk_rows(self.orbit)
        if kind != "GR" and not has_multiplier_condition(kind):
            return [unchecked(f"type {kind}", kind, "no independent condition")]
        if self.found is None:
            return [unchecked(f"type {kind}", kind, "SciPy cannot follow the motion")]
        if kind == "GR":
            distance = _least_contact(self.found)
            allowed = VERIFIED_TOUCH + self.found.loose
            return [compared("least distance from a contact without speed", 0.0, distance, allowed)]
        if self.found.speedless:
            return [unchecked(f"type {kind}", kind, _SPEEDLESS)]
        values = self.found.multipliers
        known = self.found.uncertain if self.orbit.tolerance > FINEST else np.zeros_like(self.found.uncertain)
        rows = multiplier_condition(values, kind, multiplicity, float(known.max(initial=0.0)))
        if all(row.verdict != DIFFERS for row in rows) or not np.all(np.isfinite(self.orbit.multipliers)):
            return rows
        # the point was located by multipliers that err as they do along the branch
        own = own_errors(self.orbit.problem(), np.array(self.orbit.unknowns), self.orbit.multipliers)
        return multiplier_condition(values, kind, multiplicity, float(np.max(own) + np.max(self.found.uncertain)))


def _followed(orbit: PeriodicOrbit, stiff: bool) -> FollowedOrbit:
    """Follow an orbit's segments from their starts, by implicit steps where it is stiff."""
    reference = Reference(orbit.system, orbit.parameters)
    sizes = _sizes(orbit)
    form, count = orbit.form, len(orbit.durations)
    pieces, gaps, growth, steps = [], [], [], []
    slowest = 1.0  # unit of an event function over its change in a period at the rate at which it is met
    calls, parts = Calls(reference, stiff), max(1, round(_PARTS / count))
    for i in range(count):
        mode, transition, kind = form.modes[i], form.transitions[i], form.kinds[i]
        piece = follow(calls.enter(mode), orbit.states[i], float(orbit.durations[i]), sizes, parts)
        end, own = piece.end, list(piece.slopes)
        if kind in (EVENT_END, MEAN_END):
            gradient = reference.event_slope(transition, end)
            rate = reference.field(mode, end)
            met = abs(float(gradient @ rate)) * orbit.period
            slowest = max(slowest, float(np.abs(gradient) @ sizes) / met if met > 0.0 else math.inf)
            with np.errstate(divide="ignore", invalid="ignore"):  # an event without speed has no map
                own[-1] = event_map(reference, mode, transition, end) @ own[-1]
            end = reference.reset(transition, end)
        gaps.append(_gap(orbit, i, end))
        growth.append(max(1.0, growth_on_the_way(own, sizes)))  # the last step leaves its error as it is
        steps += own
        pieces.append(piece)
    error = followed(orbit.tolerance)
    across = _across(orbit, reference, end, sizes)
    zeros = error > followed(FINEST)
    values, uncertain = spectrum([*steps, across], sizes, dropped=1, error=error * slowest, zeros=zeros)
    return FollowedOrbit(
        reference, sizes, tuple(pieces), np.array(gaps), np.array(growth), values, uncertain, error,
        speedless=error * slowest > ROUGH,
    )  # fmt: skip


def _sizes(orbit: PeriodicOrbit) -> NDArray[np.float64]:
    n = len(orbit.system.all_states)
    sizes = np.maximum(np.abs(orbit.lows), np.abs(orbit.highs))[:n]
    if orbit.system.phase is not None:
        sizes[-1] = orbit.system.turn
    own = sizes[: len(orbit.system.states)]
    own[own <= RESTING * float(own.max())] = float(own.max()) or 1.0
    return np.asarray(sizes)


def _gap(orbit: PeriodicOrbit, i: int, end: NDArray[np.float64]) -> NDArray[np.float64]:
    gap = end - orbit.states[(i + 1) % len(orbit.durations)]
    phase = () if orbit.system.phase is None else (orbit.system.phase[0],)
    for k, name in enumerate(orbit.system.all_states):
        if name in (*phase, *orbit.system.angles):
            gap[k] = math.remainder(gap[k], orbit.system.turn if name in phase else TURN)
    return np.asarray(gap)


def _across(
    orbit: PeriodicOrbit, reference: Reference, end: NDArray[np.float64], sizes: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the projection along the flow where the period ends, by which the trivial multiplier becomes 0."""
    rate = reference.field(orbit.form.modes[0], end)
    if orbit.system.phase is not None:
        return projection(rate, np.eye(rate.size)[-1])
    return projection(rate, rate / sizes**2)


def _closing(found: FollowedOrbit, left_out: float) -> Row:
    gaps = np.abs(found.gaps) / found.sizes
    allowed = VERIFIED_GAP + (found.error * found.growth)[:, None] + left_out / found.sizes
    i, k = np.unravel_index(int(np.argmax(gaps / allowed)), gaps.shape)
    return compared(f"gap behind segment {i}", 0.0, float(gaps[i, k]), float(allowed[i, k]))


def _durations(orbit: PeriodicOrbit, found: FollowedOrbit) -> list[Row]:
    form, reference = orbit.form, found.reference
    rows = []
    for i, piece in enumerate(found.pieces):
        if form.kinds[i] not in (EVENT_END, MEAN_END):
            continue
        transition = form.transitions[i]
        gradient = reference.event_slope(transition, piece.end)
        rate = float(gradient @ reference.field(piece.mode, piece.end))
        h = float(reference.event(transition, piece.end[:, None])[0])
        unit = float(np.abs(gradient) @ found.sizes) or 1.0
        name = orbit.system.transition_names[transition]
        allowed = VERIFIED_TIME + found.error * found.growth[i]
        if abs(rate) * orbit.period < VERIFIED_SPEED * unit:
            rows.append(compared(f"event {name}", 0.0, h / unit, allowed))
        else:
            duration = float(orbit.durations[i])
            rows.append(compared(f"time of {name}", duration, duration - h / rate, allowed * orbit.period))
    return rows


def _multipliers(orbit: PeriodicOrbit, found: FollowedOrbit) -> list[Row]:
    said = orbit.multipliers
    if orbit.system.phase is None:
        said = said[:-1]
    infinite, top = np.any(np.abs(said) > VERIFIED_INFINITE), float(np.abs(found.multipliers).max(initial=0.0))
    if infinite and (found.speedless or not top < ROUGH * VERIFIED_INFINITE):
        return [unchecked("multipliers", complex(said[0]), "an event has no speed: they are infinite")]
    if np.any(np.isnan(said)):
        return [unchecked("multipliers", complex(said[0]), _UNKNOWN)]
    if found.speedless:
        return [unchecked("multipliers", complex(said[0]), _SPEEDLESS)]
    if not np.all(np.isfinite(found.multipliers)):
        return [unchecked("multipliers", complex(said[0]), "beyond the floats, or too near each other")]
    rows = _multiplier_rows(orbit, said, found, found.uncertain)
    if any(row.verdict == DIFFERS for row in rows) and np.all(np.isfinite(said)):
        problem, u = orbit.problem(), np.array(orbit.unknowns)
        own = own_errors(problem, u, orbit.multipliers)[: said.size]
        rows = _multiplier_rows(orbit, said, found, found.uncertain + own.max())
    return rows


def _multiplier_rows(
    orbit: PeriodicOrbit, said: NDArray[np.complex128], found: FollowedOrbit, uncertain: NDArray[np.float64]
) -> list[Row]:
    """Return the checks of multipliers and of stability, by the errors of what was found."""
    rows = [
        compared(f"multiplier {i + 1}", complex(one), complex(other), allowed)
        for i, (one, other, allowed) in enumerate(matched(said, found.multipliers, uncertain))
    ]
    if not np.all(np.isfinite(said)):
        rows.append(equal("multipliers", "infinite", "finite"))
    if np.all(np.abs(np.abs(found.multipliers) - 1.0) > uncertain):
        rows.append(equal("stable", orbit.stable, bool(np.all(np.abs(found.multipliers) < 1.0))))
    return rows


def _extremes(orbit: PeriodicOrbit, found: FollowedOrbit) -> list[Row]:
    both = [extremes(found.reference, piece) for piece in found.pieces]
    lows, highs = np.min([low for low, _ in both], axis=0), np.max([high for _, high in both], axis=0)
    names = (*orbit.system.all_states, *orbit.system.output_names)
    phase = None if orbit.system.phase is None else orbit.system.phase[0]
    fast = np.max([_at_end(found, piece, orbit.period) for piece in found.pieces], axis=0)
    rows = []
    for q, name in enumerate(names):
        size = max(abs(orbit.lows[q]), abs(orbit.highs[q]))
        if name == phase or not math.isfinite(size):
            continue
        allowed = (VERIFIED_EXTREME + found.loose) * size + 1e-14 * float(found.sizes.max()) + float(fast[q])
        rows.append(compared(f"min {name}", float(orbit.lows[q]), float(lows[q]), allowed))
        rows.append(compared(f"max {name}", float(orbit.highs[q]), float(highs[q]), allowed))
    return rows


def _at_end(found: FollowedOrbit, piece: Piece, period: float) -> NDArray[np.float64]:
    """Return by how much states and outputs change at a segment's end within the error of its time."""
    moved = found.error * period * found.reference.field(piece.mode, piece.end)
    with np.errstate(all="ignore"):
        near = found.reference.quantities(piece.mode, piece.end[:, None] + np.stack([-moved, moved], axis=1))
    return np.asarray(np.nan_to_num(np.ptp(near, axis=1), nan=0.0, posinf=0.0))


def _obstacles(orbit: PeriodicOrbit, found: FollowedOrbit) -> tuple[list[str], list[str]]:
    """Return why the followed orbit is no motion of the system, and what its error leaves open."""
    doubts: list[str] = []
    reasons: list[str] = []
    reference, form = found.reference, orbit.form
    for i, piece in enumerate(found.pieces):
        if not orbit.durations[i] > 0.0:
            told = without_length(found, form, i, float(orbit.durations[i]))
            if told is Verdict.NO:
                reasons.append(f"duration {i}")
            elif not told:
                doubts.append(f"segment {i} lasts no longer than its error, and the order of its events matters")
        late = found.late(i) * orbit.period
        if not np.all(reference.domain(piece.mode, piece.states[:, 1:-1])):
            reasons.append(f"domain in segment {i}")
        for k in reference.ways_out(piece.mode):
            direction = orbit.system.transitions[k].direction
            for time, rate, _ in contacts(reference, piece, k, found.sizes, late):
                at = np.array([np.interp(time, piece.times, row) for row in piece.states])
                if rate * direction >= 0.0 and reference.allows(k, at[:, None])[0]:
                    reasons.append(f"event {k} in segment {i}")
            own = orbit.system.transitions[k]
            stop = own.source == own.target and bool(own.reset) and direction != 0
            back = return_behind_hop(reference, piece, k, found.sizes, stop=stop)
            if back is not None and reference.allows(k, piece.between(back)[:, None])[0]:
                reasons.append(f"event {k} behind a hop at the start of segment {i}")
        if form.kinds[i] in (EVENT_END, MEAN_END):
            k = form.transitions[i]
            gradient = reference.event_slope(k, piece.end)
            rate = float(gradient @ reference.field(piece.mode, piece.end))
            unit = (float(np.abs(gradient) @ found.sizes) or 1.0) / orbit.period
            if rate * orbit.system.transitions[k].direction < -VERIFIED_SPEED * unit:
                reasons.append(f"direction of segment {i}")
            touches = abs(rate) <= VERIFIED_SPEED * unit and k in orbit.system.velocity_conditions
            if touches:
                continue
            if _at_border(found, k, piece.end):
                doubts.append(f"a condition changes within the error of the end of segment {i}")
            elif not reference.allows(k, piece.end[:, None])[0]:
                reasons.append(f"condition of segment {i}")
    return reasons, doubts


def _at_border(found: FollowedOrbit, transition: int, x: NDArray[np.float64]) -> bool:
    """Return whether the condition of a transition holds on one side only of a state that is known to an error."""
    away = np.diag((VERIFIED_SURFACE + found.loose) * found.sizes)
    held = found.reference.allows(transition, x[:, None] + np.concatenate([away, -away], axis=1))
    return bool(held.any() and not held.all())


def _is_rest(orbit: PeriodicOrbit, sizes: NDArray[np.float64] | None) -> bool:
    """Whether an orbit of an autonomous system is an equilibrium, to which cycles shrink."""
    if orbit.system.phase is not None:
        return False
    if sizes is not None and np.all(np.subtract(*orbit.extremes[::-1]) <= SHRUNK * sizes):
        return True
    rate = Reference(orbit.system, orbit.parameters).field(orbit.form.modes[0], orbit.states[0][:, None])[:, 0]
    return bool(np.max(np.abs(rate) / _sizes(orbit)) * orbit.period < VERIFIED_REST)


def _shrunk_rows(orbit: PeriodicOrbit) -> list[Row]:
    """Return the checks of a cycle that has shrunk to an equilibrium: an imaginary pair of its period."""
    reference, mode = Reference(orbit.system, orbit.parameters), orbit.form.modes[0]
    x = orbit.states[0].copy()
    if np.abs(np.linalg.eigvals(reference.field_slope(mode, x))).max() * abs(orbit.period) < math.pi:  # half a turn
        return [unchecked("orbit", orbit.period, "the cycle has shrunk to a point where no field vanishes")]
    if max(orbit.form.transitions) >= 0:
        return [unchecked("orbit", orbit.period, "the cycle has shrunk to a boundary equilibrium, which has no period")]
    for _ in range(_STEPS):
        A = reference.field_slope(mode, x)
        x = x - np.linalg.solve(A, reference.field(mode, x[:, None])[:, 0])
    values = np.linalg.eigvals(reference.field_slope(mode, x))
    pair = values[np.argmin(np.abs(values - 2.0j * math.pi / orbit.period))]
    period = 2.0 * math.pi / abs(pair.imag) if pair.imag != 0.0 else math.inf
    return [
        compared("critical eigenvalue", 0.0, float(pair.real), VERIFIED_SHRUNK * abs(pair)),
        compared("period", orbit.period, period, VERIFIED_SHRUNK * orbit.period),
    ]


def _least_contact(found: FollowedOrbit) -> float:
    """Return how far the orbit is from touching a surface of its modes without speed, in the surfaces' units."""
    reference = found.reference
    return min(
        (
            touching(reference, piece, k, found.sizes)
            for piece in found.pieces
            for k in reference.ways_out(piece.mode)
        ),
        default=math.inf,
    )  # fmt: skip
