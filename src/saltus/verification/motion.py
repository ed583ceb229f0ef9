"""One segment of an orbit followed by SciPy, with all neighbours from which its derivative is taken."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from saltus.verification.reference import Reference, differences, slopes, stencil

if TYPE_CHECKING:
    from numpy.typing import NDArray

__all__ = ["Piece", "StiffMotionError", "contacts", "extremes", "follow", "projection", "touching"]

_RTOL = 1e-12  # relative tolerance of the integration
_ATOL = 1e-14  # absolute one, over the states' sizes
_MOST_CALLS = 60_000  # evaluations of the field in a segment, from which on the motion counts as stiff
_SAMPLES = 400  # states of a segment at which events and extremes are looked for
_ENDS = 1e-7  # share of a duration next to a segment's ends in which an event is that of the end


class StiffMotionError(Exception):
    """SciPy needs too many steps."""


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
    slope : ndarray, shape (states, states)
        Derivative of the end by the start at a fixed duration.
    between : callable
        State at any time.
    """

    mode: int
    times: NDArray[np.float64]
    states: NDArray[np.float64]
    slope: NDArray[np.float64]
    between: Callable[[float], NDArray[np.float64]]

    @property
    def end(self) -> NDArray[np.float64]:
        """The state at the end."""
        return self.states[:, -1]


def follow(
    reference: Reference, mode: int, x: NDArray[np.float64], duration: float, sizes: NDArray[np.float64]
) -> Piece:
    """Follow a state and its neighbours for a duration, all with the same steps.

    Parameters
    ----------
    reference : Reference
        The system.
    mode : int
        Mode of the segment.
    x : ndarray, shape (states,)
        Its start.
    duration : float
        Its duration.
    sizes : ndarray, shape (states,)
        Sizes of the states.

    Raises
    ------
    StiffMotionError
        The motion takes too many steps, or cannot be followed to its end.
    """
    from scipy.integrate import solve_ivp

    rooted = reference.is_rooted(mode)
    start = stencil(x, sizes, rooted)
    calls = 0

    def rates(t: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
        nonlocal calls
        calls += 1
        if calls > _MOST_CALLS:
            raise StiffMotionError
        return reference.field(mode, y.reshape(start.shape)).ravel()

    times = np.linspace(0.0, duration, _SAMPLES)
    atol = np.repeat(_ATOL * sizes, start.shape[1])
    found = solve_ivp(
        rates, (0.0, duration), start.ravel(), "DOP853", dense_output=True, rtol=_RTOL, atol=atol,
        first_step=1e-3 * duration,
    )  # fmt: skip
    if not found.success:
        raise StiffMotionError
    own = np.arange(x.size) * start.shape[1]
    states, ends = found.sol(times)[own], found.y[:, -1].reshape(start.shape)
    states[:, -1] = ends[:, 0]
    return Piece(mode, times, states, differences(ends, sizes, rooted), lambda t: np.asarray(found.sol(t)[own]))


def projection(rate: NDArray[np.float64], gradient: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return the projection along the flow onto a surface: the derivative of a landing by the state before it."""
    return np.eye(rate.size) - np.outer(rate, gradient) / float(gradient @ rate)


def contacts(
    reference: Reference, piece: Piece, transition: int, sizes: NDArray[np.float64]
) -> list[tuple[float, float, float]]:
    """Return where an event function vanishes in a segment: time, rate of the function, its unit.

    The ends of the segment are left out.
    """
    h = reference.event(transition, piece.states)
    unit = _unit(reference, transition, piece, sizes)
    found = []
    for i in np.flatnonzero((h[:-1] < 0.0) != (h[1:] < 0.0)):
        span = piece.times[i + 1] - piece.times[i]
        share = h[i] / (h[i] - h[i + 1])
        time = float(piece.times[i] + share * span)
        if _ENDS < time / piece.times[-1] < 1.0 - _ENDS and _continuous(reference, piece, transition, int(i), h):
            found.append((time, float((h[i + 1] - h[i]) / span), unit))
    return found


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
        for find, sign, kept in ((np.argmin, 1.0, lows), (np.argmax, -1.0, highs)):
            i, last = int(find(series)), series.size - 1
            bounds = piece.times[max(i - 1, 0)], piece.times[min(i + 1, last)]

            def height(t: float, row: int = row, sign: float = sign) -> float:
                return sign * float(reference.quantities(piece.mode, piece.between(t))[row])

            kept[row] = sign * min(
                float(minimize_scalar(height, bounds=bounds, method="bounded").fun), sign * kept[row]
            )
    return lows, highs


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
    gradient = slopes(lambda y: reference.event(transition, y), x, sizes)[0]
    return float(gradient @ reference.field(piece.mode, x))


def _unit(reference: Reference, transition: int, piece: Piece, sizes: NDArray[np.float64]) -> float:
    gradient = slopes(lambda y: reference.event(transition, y), piece.end, sizes)[0]
    return float(np.abs(gradient) @ sizes) or 1.0


def _continuous(reference: Reference, piece: Piece, transition: int, i: int, h: NDArray[np.float64]) -> bool:
    """Whether an event function goes through 0 between two samples, and does not jump there."""
    around = h[max(i - 2, 0) : i + 4]
    return bool(abs(h[i + 1] - h[i]) <= 4.0 * np.median(np.abs(np.diff(around))) + 1e-300)
