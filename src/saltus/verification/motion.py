"""One segment of an orbit followed by SciPy, with all neighbours from which its derivative is taken."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import numpy as np

from saltus.scales import VERIFIED_ENDS, VERIFIED_GAP, VERIFIED_SEGMENT
from saltus.verification.reference import Reference, differences, stencil

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = [
    "Calls",
    "Piece",
    "UnfollowedError",
    "contacts",
    "event_map",
    "extremes",
    "follow",
    "projection",
    "return_behind_hop",
    "touching",
]

_RTOL = 1e-12  # relative tolerance of the integration
_ATOL = 1e-14  # absolute one, over the states' sizes
_MOST_CALLS = 60_000  # evaluations of the field in a period, from which on the motion counts as stiff
_RTOL_STIFF = 1e-10  # relative tolerance of implicit steps, of order 5
_MOST_STIFF = 400_000  # evaluations of the field by these, at most: some 20 s
_FINE = 1e-4  # error of an extreme's place, over the distance of samples
_EARLY = 200  # times of a segment, evenly on a logarithmic scale, at which a hop behind its start is looked for
_OCTAVES = 40  # of the segment's duration, halved so often, is the first of them
_CANDIDATES = 8  # extremes of nearly one height that are looked at
_SAMPLES = 400  # states of a segment at which events and extremes are looked for


class UnfollowedError(Exception):
    """SciPy needs too many steps, or the motion's neighbours run to infinity."""


@dataclass(frozen=True)
class Piece:
    """A segment that was followed.

    Attributes
    ----------
    mode : int
        Its mode.
    times : ndarray, shape (samples,)
        Times from the segment's start.
    states : ndarray, shape (states, samples)
        States at these times.
    slopes : tuple of ndarray, shape (states, states)
        Derivatives of the ends of consecutive parts by their starts, at fixed times.
    between : callable
        State at any time.
    """

    mode: int
    times: NDArray[np.float64]
    states: NDArray[np.float64]
    slopes: tuple[NDArray[np.float64], ...]
    between: Callable[[float], NDArray[np.float64]]

    @property
    def end(self) -> NDArray[np.float64]:
        """The state at the end."""
        return self.states[:, -1]


def follow(calls: Calls, x: NDArray[np.float64], duration: float, sizes: NDArray[np.float64], parts: int = 1) -> Piece:
    """Follow a state with its variational equations for a duration, which may be 0, or negative beside a grazing.

    Where a field ends at a surface, neighbours that take the same steps stand for the variational equations.

    Parameters
    ----------
    calls : Calls
        The rates of the segment's mode.
    x : ndarray, shape (states,)
        Its start.
    duration : float
        Its duration.
    sizes : ndarray, shape (states,)
        Sizes of the states.
    parts : int
        Parts with a derivative each, whose product keeps its small eigenvalues.

    Raises
    ------
    UnfollowedError
        The motion takes too many steps, or cannot be followed to its end.
    """
    span = duration / parts
    slopes, interpolants, first = [], [], (1e-9 if calls.stiff else 1e-3) * abs(span)
    times = np.linspace(0.0, duration, _SAMPLES)
    for part in range(parts):
        interpolant, x, slope, steps = _part(calls, x, span, sizes, first)
        interpolants.append(interpolant)
        slopes.append(slope)
        first = abs(float(np.diff(steps)[max(steps.size - 3, 0)]))  # that of the end itself is cut
        if calls.stiff:  # fast layers lie between equidistant samples
            times = np.union1d(times, part * span + steps[1:-1])

    def between(t: float) -> NDArray[np.float64]:
        i = min(max(int(t / span), 0), parts - 1) if span else 0
        return interpolants[i](t - i * span)

    states = np.column_stack([between(float(t)) for t in times])
    states[:, -1] = x
    return Piece(calls.mode, times, states, tuple(slopes), between)


class Calls:
    """The rates of the modes of a motion, counted.

    Parameters
    ----------
    reference : Reference
        The system.
    stiff : bool
        Whether steps are implicit ones: Radau's method of order 5 with the exact Jacobian.
    """

    def __init__(self, reference: Reference, stiff: bool) -> None:
        self.reference, self.stiff = reference, stiff
        self.enter(0)
        self.count = 0

    def enter(self, mode: int) -> Calls:
        """Go on in a mode."""
        self.mode, self.rooted = mode, self.reference.is_rooted(mode)
        return self

    def __call__(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the rates of a state and of what stands beside it: its neighbours, or its variations."""
        self.count += 1
        if self.count > (_MOST_STIFF if self.stiff else _MOST_CALLS):
            raise UnfollowedError
        if self.rooted:
            return self.reference.field(self.mode, y)
        rate, slope = self.reference.field_with_slope(self.mode, y[:, 0])
        return np.column_stack([rate, slope @ y[:, 1:]])

    def jacobian(self, y: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivative of the rates but for second derivatives of the field, for Newton's method.

        What stands beside the state moves as the state does, so that one matrix serves all columns.
        """
        return np.asarray(np.kron(self.reference.field_slope(self.mode, y[:, 0]), np.eye(y.shape[1])), dtype=float)


def _part(
    calls: Calls, x: NDArray[np.float64], duration: float, sizes: NDArray[np.float64], first: float
) -> tuple[Callable[[float], NDArray[np.float64]], NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
    """Return the states of a part as a function of time, its end, its derivative and the ends of steps."""
    from scipy.integrate import solve_ivp

    if duration == 0.0:
        return (lambda t: x), x, np.eye(x.size), np.zeros(2)
    start = stencil(x, sizes) if calls.rooted else np.column_stack([x, np.eye(x.size)])
    atol = np.tile(_ATOL * sizes[:, None], start.shape[1])
    if not calls.rooted:
        atol[:, 1:] /= sizes
    method: dict[str, Any] = {"method": "DOP853", "rtol": _RTOL, "atol": atol.ravel()}
    if calls.stiff:
        jacobian = lambda t, y: calls.jacobian(y.reshape(start.shape))  # noqa: E731
        method = {"method": "Radau", "rtol": _RTOL_STIFF, "atol": 100.0 * atol.ravel(), "jac": jacobian}
    with np.errstate(all="ignore"):
        found = solve_ivp(
            lambda t, y: calls(y.reshape(start.shape)).ravel(), (0.0, duration), start.ravel(),
            dense_output=True, first_step=min(first, abs(duration)), **method,
        )  # fmt: skip
    if not found.success or not np.all(np.isfinite(found.y[:, -1])):
        raise UnfollowedError
    end = found.y[:, -1].reshape(start.shape)
    slope = differences(end, sizes) if calls.rooted else end[:, 1:]
    own = np.arange(x.size) * start.shape[1]
    return (lambda t: np.asarray(found.sol(t)[own])), end[:, 0], slope, found.t


def projection(rate: NDArray[np.float64], gradient: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the projection along the flow onto a surface: the derivative of a landing by the state before it."""
    return np.eye(rate.size) - np.outer(rate, gradient) / float(gradient @ rate)


def event_map(reference: Reference, mode: int, transition: int, end: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the derivative of what lies behind an event, at the instant of its reset, by the state before it."""
    landing = projection(reference.field(mode, end), reference.event_slope(transition, end))
    return np.asarray(reference.reset_slope(transition, end) @ landing)


def contacts(
    reference: Reference, piece: Piece, transition: int, sizes: NDArray[np.float64], late: float = 0.0
) -> list[tuple[float, float, float]]:
    """Return where an event function vanishes in a segment: time, rate of the function, its unit.

    The ends of the segment are left out. So is a segment that is as a whole too near to the surface to be told from it.
    late: time beside the ends in which an event is that of the end, as a loose tolerance leaves it. What passes the
    surface up to an end by no more than the method's rounding does not pass it: a segment may end without speed.
    """
    h = reference.event(transition, piece.states)
    unit = _unit(reference, transition, piece, sizes)
    found: list[tuple[float, float, float]] = []
    ends = VERIFIED_ENDS + late / abs(float(piece.times[-1])) if piece.times[-1] else 1.0
    if float(np.abs(h).max()) < VERIFIED_SEGMENT * unit:
        return found
    for i in np.flatnonzero((h[:-1] < 0.0) != (h[1:] < 0.0)):
        span = piece.times[i + 1] - piece.times[i]
        share = h[i] / (h[i] - h[i + 1])
        time = float(piece.times[i] + share * span)
        beyond = min(float(np.abs(h[i + 1 :]).max()), float(np.abs(h[: i + 1]).max()))
        if beyond <= _RTOL * unit:
            continue
        if ends < time / piece.times[-1] < 1.0 - ends and _continuous(reference, piece, transition, int(i), h):
            found.append((time, float((h[i + 1] - h[i]) / span), unit))
    return found


def return_behind_hop(
    reference: Reference, piece: Piece, transition: int, sizes: NDArray[np.float64], *, stop: bool
) -> float | None:
    """Return when a segment that starts on a surface comes back to it behind a hop, however short; None if never.

    Between both `contacts` would see no change of sign.
    stop: whether the event throws motions back, so that one that rests on the surface and is drawn beyond meets it.
    """
    system, start, late = reference.system, piece.states[:, 0], float(piece.times[-1])
    unit = _unit(reference, transition, piece, sizes)
    least, rate = VERIFIED_SEGMENT * unit, _rate(reference, piece, transition, 0, sizes)
    if not late > 0.0 or abs(float(reference.event(transition, start[:, None])[0])) > least:
        return None
    leaves = abs(rate) * late > VERIFIED_GAP * unit
    near = -float(system.transitions[transition].direction) or math.copysign(1.0, rate)
    if (leaves and near * rate < 0.0) or not (leaves or stop):
        return None
    early = late * np.geomspace(2.0**-_OCTAVES, 1.0 / _SAMPLES, _EARLY)
    inside = (piece.times > early[-1]) & (piece.times < (1.0 - VERIFIED_ENDS) * late)
    times = np.concatenate([early, piece.times[inside]])
    states = np.column_stack([piece.between(float(t)) for t in times])
    heights = near * reference.event(transition, states)
    beyond, above = np.flatnonzero(heights < -least), np.flatnonzero(heights > least)
    # behind the first of the even samples a change of sign is seen by `contacts`
    if not beyond.size or (above.size and above[0] < beyond[0] and beyond[0] > _EARLY):
        return None
    before = np.flatnonzero(heights[: beyond[0]] >= 0.0)
    return float(times[before[-1]]) if before.size else 0.0


def touching(reference: Reference, piece: Piece, transition: int, sizes: NDArray[np.float64]) -> float:
    """Return the least distance of an extreme of an event function from 0 in a segment, over the function's unit."""
    h = reference.event(transition, piece.states)
    rates = np.array([_rate(reference, piece, transition, i, sizes) for i in range(h.size)])
    unit = _unit(reference, transition, piece, sizes)
    candidates = [abs(_extreme(piece.times, h, rates, i)) for i in range(h.size - 1) if rates[i] * rates[i + 1] <= 0.0]
    for end in (0, -1):  # a contact without speed at an end of the segment
        slow = abs(rates[end]) * piece.times[-1]
        candidates.append(max(abs(h[end]), slow))
    return min(candidates, default=math.inf) / unit


def extremes(reference: Reference, piece: Piece) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return the least and greatest values of states and outputs in a segment, sought between the samples."""
    from scipy.optimize import minimize_scalar

    values = reference.quantities(piece.mode, piece.states)
    lows, highs = values.min(axis=1), values.max(axis=1)
    for row, series in enumerate(values):
        for sign, kept in ((1.0, lows), (-1.0, highs)):
            last = series.size - 1

            def height(t: float, row: int = row, sign: float = sign) -> float:
                return sign * float(reference.quantities(piece.mode, piece.between(t))[row])

            places = _perhaps_least(sign * series)
            # it may lie at a closed end
            for a, b in {*((max(i - 1, 0), min(i + 1, last)) for i in places), (0, 1), (last - 1, last)}:
                ends = sorted((float(piece.times[a]), float(piece.times[b])))
                if ends[0] == ends[1]:
                    continue
                near = {"xatol": min(1e-5, _FINE * (ends[1] - ends[0]))}
                found = minimize_scalar(height, bounds=ends, method="bounded", options=near)
                kept[row] = sign * min(float(found.fun), sign * kept[row])
    return lows, highs


def _perhaps_least(series: NDArray[np.float64]) -> list[int]:
    """Return the samples beside which the least value may lie: no higher than what bends between samples may hide."""
    padded = np.concatenate([[np.inf], series, [np.inf]])
    with np.errstate(invalid="ignore"):
        minima = np.flatnonzero((series <= padded[:-2]) & (series <= padded[2:]))
    bent = np.nan_to_num(np.abs(np.diff(series, 2, prepend=series[0], append=series[-1])), nan=0.0)
    own = np.array([bent[max(i - 1, 0) : i + 2].max() for i in minima.tolist()])
    if not minima.size:
        return [int(np.argmin(series))]
    reach = series[minima] - own
    nearest = np.argsort(reach, kind="stable")[:_CANDIDATES]
    return [int(i) for i in minima[nearest[reach[nearest] <= series.min()]]]


def _extreme(times: NDArray[np.float64], h: NDArray[np.float64], rates: NDArray[np.float64], i: int) -> float:
    """Return the extreme of the cubic through two samples with their rates."""
    span = times[i + 1] - times[i]
    a, b = rates[i] * span, rates[i + 1] * span
    change = h[i + 1] - h[i]
    cubic = np.polynomial.Polynomial([h[i], a, 3.0 * change - 2.0 * a - b, a + b - 2.0 * change])
    roots = np.atleast_1d(cubic.deriv().roots()).astype(complex)
    inside = roots.real[(np.abs(roots.imag) < 1e-9) & (np.abs(roots.real - 0.5) <= 0.5 + 1e-9)].tolist()
    return min((float(cubic(root)) for root in inside), key=abs, default=float(h[i]))


def _rate(reference: Reference, piece: Piece, transition: int, i: int, sizes: NDArray[np.float64]) -> float:
    x = piece.states[:, i]
    gradient = reference.event_slope(transition, x)
    return float(gradient @ reference.field(piece.mode, x))


def _unit(reference: Reference, transition: int, piece: Piece, sizes: NDArray[np.float64]) -> float:
    gradient = reference.event_slope(transition, piece.end)
    return float(np.abs(gradient) @ sizes) or 1.0


def _continuous(reference: Reference, piece: Piece, transition: int, i: int, h: NDArray[np.float64]) -> bool:
    """Whether an event function goes through 0 between two samples, and does not jump there."""
    around = h[max(i - 2, 0) : i + 4]
    return bool(abs(h[i + 1] - h[i]) <= 4.0 * np.median(np.abs(np.diff(around))) + 1e-300)
