"""Observables of a motion: extremes, means, harmonics, shares of time, speeds of crossing.

A trajectory, a periodic orbit, a branch, a locus and a sweep name them alike, e being an expression in states, phase,
parameters and outputs:

==================  ==================================================================================================
``max(e)``          greatest value, between samples too
``min(e)``          least value
``mean(e)``         mean over time
``amplitude(e, j)`` a_j > 0 of the harmonic of order j
``phase(e, j)``     phi_j of it, in radians, above -pi and up to pi
``fraction(m)``     share of the time that is spent in the mode m
``velocity(t)``     mean rate of the event function just before the transition t; NaN where it does not happen
==================  ==================================================================================================

Harmonics refer to the system's phase, theta, over whole periods of it: e ~ mean + sum_j a_j sin(j theta + phi_j). So
``-phase(e, 1)`` is the lag behind ``sin(theta)``. A rational order makes a subharmonic, as in ``amplitude(z, 1/2)``,
taken over whole multiples of its own period. The system's phase does not tell its periods apart, so its phase is known
up to multiples of 2 pi over the denominator. In an orbit with another period its amplitude is 0, and its phase NaN.
Without a phase, the motion's length is the period of order 1, and its start is where the angle is 0.

A formula in observables and parameters is taken as well: ``-degrees(phase(x, 1))``, ``max(z) - min(z)``. Of an orbit it
may contain ``period``, as ``2*pi/period``.

Integrals are Gauss-Legendre sums over each step of the dense output, in clustered time. Let an expression be smooth
between events, or like a half-integer power of the distance from one. Its integrals are then as accurate as the dense
output.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from saltus.errors import InputError
from saltus.flow.formulas import Observable, check_rotating, read_formula
from saltus.system.evaluate import evaluate

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = ["Motion", "angles", "dense_states", "observe"]

States: TypeAlias = "Callable[[NDArray[np.intp], NDArray[np.float64]], NDArray[np.float64]]"

_NODES = 16  # fewest nodes in a step; a step through a wide angle has more
_NEAR = 0.05  # share of the range by which a sampled extreme that is refined may miss the true one
_ZOOMS = 7  # divisions of an extreme's neighbourhood, which lead to 1e-7 of a step
_PLACES = 17  # places in each division
_BLOCK = 1 << 16  # states computed at once, each from all coefficients of its step
_WHOLE = 1e-9  # part of a period by which a stretch may miss a whole number of periods


@dataclass(frozen=True)
class Motion:
    """A stretch of motion, step by step, from which observables are computed.

    `Trajectory.motion` and `PeriodicOrbit.motion` make it; so can anything that has dense output.
    """

    system: HybridSystem
    parameters: Mapping[str, float]  # all its parameters
    modes: NDArray[np.int64]  # shape (step,): index of the mode of each step
    # shape (step, 4): time within each step as a polynomial in the fraction of the step, growing powers
    clocks: NDArray[np.float64]
    # shape (step, 2): fractions between which each step belongs to the stretch: 0 and 1, but for cut ones
    spans: NDArray[np.float64]
    states: States  # full states, shape (m, all states), for indices of steps (m,) and fractions (m,)
    # time, index of the transition and rate of the event function before, of each event
    crossings: Sequence[tuple[float, int, float]]
    angle: tuple[float, float]  # the phase at time 0, and its rate; it runs on beyond 2 pi
    turns: int | None = None  # periods of the angle after which the motion repeats; None where it does not
    rotating: tuple[str, ...] = ()  # angles among the states that make turns before the motion repeats

    @property
    def begin(self) -> float:
        """Time of the start."""
        return _clock(self.clocks[0], float(self.spans[0, 0]))

    @property
    def end(self) -> float:
        """Time of the end."""
        return _clock(self.clocks[-1], float(self.spans[-1, 1]))

    @property
    def durations(self) -> NDArray[np.float64]:
        """Length of each step in time, shape (step,)."""
        low, high = self.spans.T[:, :, None]
        return (_times(self.clocks, high) - _times(self.clocks, low))[:, 0]

    def whole(self, periods: int = 1) -> Motion | None:
        """Return the last whole periods of the angle, as many as there are in multiples of `periods`; None for none."""
        if self.turns is not None:
            return self
        turn = 2.0 * math.pi / self.angle[1]
        count = math.floor((self.end - self.begin) / turn + _WHOLE) // periods * periods
        if count == 0:
            return None
        begin = self.end - count * turn
        return self if begin <= self.begin + _WHOLE * turn else self._after(begin)

    def _after(self, begin: float) -> Motion:
        """Return the stretch from a time on, which lies within."""
        ends = _times(self.clocks, self.spans[:, 1:])[:, 0]
        first = min(int(np.searchsorted(ends, begin, side="right")), len(ends) - 1)
        spans = self.spans[first:].copy()
        spans[0, 0] = _fraction(self.clocks[first], begin, float(spans[0, 0]), float(spans[0, 1]))
        steps = self.states
        return replace(
            self,
            modes=self.modes[first:],
            clocks=self.clocks[first:],
            spans=spans,
            states=lambda at, fraction: steps(at + first, fraction),
            crossings=[crossing for crossing in self.crossings if crossing[0] > begin],
            turns=None,
        )


def observe(motion: Motion, names: Iterable[str]) -> dict[str, float]:
    """Return observables of a motion by name; the page of this module lists them.

    Parameters
    ----------
    names : iterable of str
        What is observed, as in ``"amplitude(z, 1)"`` or ``"-degrees(phase(z, 1))"``.

    Raises
    ------
    InputError
        A name that is no observable, or a harmonic of a stretch that is shorter than its period.

    Examples
    --------
    >>> from saltus.flow.simulation import simulate
    >>> from saltus.system.hybrid import HybridSystem, Mode, Transition
    >>> impact = Transition("flight", "flight", "z", -1, {"v": "-v/2"}, name="impact")
    >>> ball = HybridSystem(("z", "v"), {"g": 1.0}, {"flight": Mode({"z": "v", "v": "-g"})}, [impact])
    >>> fall = simulate(ball, {}, [0.5, 0.0], t_end=1.5)
    >>> for name, value in observe(fall.motion(), ["max(z)", "mean(v)", "velocity(impact)"]).items():
    ...     print(f"{name} = {value:.6f}")
    max(z) = 0.500000
    mean(v) = -0.250000
    velocity(impact) = -1.000000
    """
    formulas = {name: read_formula(motion.system, name) for name in names}
    wanted = {part: observable for formula in formulas.values() for part, observable in formula.parts.items()}
    check_rotating(motion.system, motion.rotating, wanted)
    advance = float(np.abs(motion.durations).max()) * motion.angle[1]
    highest = max((float(observable.order) for observable in wanted.values() if observable.order), default=0.0)
    seen = _Seen(motion, _NODES + math.ceil(highest * advance))
    values = {part: _value(seen, part, observable) for part, observable in wanted.items()}
    known = dict(motion.parameters)
    if motion.turns is not None:
        known.setdefault("period", motion.end - motion.begin)
    return {name: float(formula.value(values, known)) for name, formula in formulas.items()}


def dense_states(
    starts: NDArray[np.float64], coefficients: NDArray[np.float64], fractions: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return states within steps by their dense output of order 7, shape (m, n).

    Parameters
    ----------
    starts : ndarray, shape (m, n)
        State at the start of each state's step.
    coefficients : ndarray, shape (m, 7, n)
        The dense output of that step.
    fractions : ndarray, shape (m,)
        Where in the step, from 0 to 1.

    References
    ----------
    E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd edition, Springer 1993, II.6.
    """
    fraction = fractions[:, None]
    other = 1.0 - fraction
    y = coefficients[:, 6] * fraction
    for j, factor in ((5, other), (4, fraction), (3, other), (2, fraction), (1, other), (0, fraction)):
        y = (y + coefficients[:, j]) * factor
    return np.asarray(starts + y)


class _Seen:
    """A motion at nodes of a quadrature, each expression evaluated once."""

    def __init__(self, motion: Motion, nodes: int) -> None:
        self.motion, self.nodes = motion, nodes
        places, weights = _rule(nodes)
        spans = motion.spans
        width = spans[:, 1:] - spans[:, :1]
        self.fractions = spans[:, :1] + width * places
        rates = motion.clocks[:, 1:2] + self.fractions * (
            2.0 * motion.clocks[:, 2:3] + self.fractions * 3.0 * motion.clocks[:, 3:4]
        )
        self.weights = (weights * width * rates)[:, 1:-1]
        self.times = _times(motion.clocks, self.fractions)
        steps, flat = np.repeat(np.arange(len(spans)), places.size), self.fractions.ravel()
        blocks = (slice(first, first + _BLOCK) for first in range(0, flat.size, _BLOCK))
        self._states = np.concatenate([motion.states(steps[block], flat[block]) for block in blocks])
        self._modes = motion.modes[steps]
        self._values: dict[str, NDArray[np.float64]] = {}
        self._whole: dict[int, _Seen | None] = {}

    @property
    def length(self) -> float:
        return self.motion.end - self.motion.begin

    def values(self, expression: str) -> NDArray[np.float64]:
        """Values at both ends of each step and the nodes between, shape (step, nodes + 2)."""
        if expression not in self._values:
            motion = self.motion
            flat = evaluate(motion.system, expression, self._states, self._modes, motion.parameters)
            self._values[expression] = flat.reshape(self.fractions.shape)
        return self._values[expression]

    def integral(self, values: NDArray[np.float64] | NDArray[np.complex128]) -> complex:
        """Integral over time of values at the nodes, shape (step, nodes)."""
        return complex(np.sum(self.weights * values))

    def whole(self, periods: int) -> _Seen | None:
        """The last whole periods of the angle, as `Motion.whole` has them."""
        if periods not in self._whole:
            stretch = self.motion.whole(periods)
            if stretch is None or stretch is self.motion:
                self._whole[periods] = None if stretch is None else self
            else:
                self._whole[periods] = _Seen(stretch, self.nodes)
        return self._whole[periods]


def _value(seen: _Seen, name: str, observable: Observable) -> float:
    motion, kind, of = seen.motion, observable.kind, observable.of
    match kind:
        case "max":
            return _greatest(seen, of, 1.0)
        case "min":
            return -_greatest(seen, of, -1.0)
        case "mean":
            return seen.integral(seen.values(of)[:, 1:-1]).real / seen.length
        case "fraction":
            inside = motion.modes == motion.system.mode_names.index(of)
            return float(np.sum(motion.durations[inside]) / np.sum(motion.durations))
        case "velocity":
            index = motion.system.transition_names.index(of)
            rates = [rate for _, transition, rate in motion.crossings if transition == index]
            return math.fsum(rates) / len(rates) if rates else math.nan
        case _:
            assert observable.order is not None
            harmonic = _harmonic(seen, name, of, observable.order)
            if kind == "amplitude":
                return abs(harmonic)
            return float(angles(harmonic))


def _harmonic(seen: _Seen, name: str, expression: str, order: Fraction) -> complex:
    """Return a exp(i phi) of a sin(order theta + phi)."""
    motion, periods = seen.motion, order.denominator
    if motion.turns is not None and motion.turns % periods:
        return 0.0
    stretch = seen.whole(periods)
    if stretch is None:
        turns = seen.length * motion.angle[1] / (2.0 * math.pi)
        many = "a period" if periods == 1 else f"{periods} periods"
        raise InputError("observable", name, f"of a stretch of {many} of the phase or more", f"it has {turns:.6g}")
    start, rate = motion.angle
    wave = np.exp(-1j * float(order) * (start + rate * stretch.times[:, 1:-1]))
    return 2j * stretch.integral(stretch.values(expression)[:, 1:-1] * wave) / stretch.length


def angles(harmonics: ArrayLike) -> NDArray[np.float64]:
    """Return the phases of harmonics, above -pi and up to pi; NaN where there is no harmonic."""
    found = np.angle(np.asarray(harmonics))
    return np.where(np.equal(harmonics, 0.0), np.nan, np.where(found == -math.pi, math.pi, found))


def _greatest(seen: _Seen, expression: str, sign: float) -> float:
    """Return the greatest of an expression times a sign: samples, then the neighbourhoods of those near it divided."""
    motion, values = seen.motion, sign * seen.values(expression)
    top = float(values.max())
    if not np.all(np.isfinite(values)):
        return top
    padded = np.pad(values, ((0, 0), (1, 1)), constant_values=-np.inf)
    high = (values >= padded[:, :-2]) & (values >= padded[:, 2:]) & (values >= top - _NEAR * np.ptp(values))
    steps, at = np.nonzero(high)
    last = values.shape[1] - 1
    low, far = seen.fractions[steps, np.maximum(at - 1, 0)], seen.fractions[steps, np.minimum(at + 1, last)]
    share = np.linspace(0.0, 1.0, _PLACES)
    rows = np.arange(len(steps))
    each = np.repeat(steps, _PLACES)
    for _ in range(_ZOOMS):
        places = low[:, None] + (far - low)[:, None] * share
        states = motion.states(each, places.ravel())
        found = sign * evaluate(motion.system, expression, states, motion.modes[each], motion.parameters)
        table = found.reshape(places.shape)
        best = table.argmax(axis=1)
        top = max(top, float(table.max()))
        low, far = places[rows, np.maximum(best - 1, 0)], places[rows, np.minimum(best + 1, _PLACES - 1)]
    return top


@cache
def _rule(nodes: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Return places s^2 (3 - 2 s) in [0, 1], both ends among them, and weights, of Gauss and Legendre in s."""
    roots, weights = np.polynomial.legendre.leggauss(nodes)
    s = np.concatenate([[0.0], 0.5 * (roots + 1.0), [1.0]])
    rates = 6.0 * s * (1.0 - s)
    return s**2 * (3.0 - 2.0 * s), rates * np.concatenate([[0.0], 0.5 * weights, [0.0]])


def _times(clocks: NDArray[np.float64], fractions: NDArray[np.float64]) -> NDArray[np.float64]:
    c = clocks.T[:, :, None]
    return np.asarray(c[0] + fractions * (c[1] + fractions * (c[2] + fractions * c[3])))


def _clock(clock: NDArray[np.float64], fraction: float) -> float:
    return float(_times(clock[None, :], np.array([[fraction]]))[0, 0])


def _fraction(clock: NDArray[np.float64], time: float, low: float, high: float) -> float:
    """Return where in a step its clock, which does not run back, shows a time, by halving."""
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if _clock(clock, middle) <= time else (low, middle)
    return 0.5 * (low + high)
