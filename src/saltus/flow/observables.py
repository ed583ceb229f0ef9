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

Integrals are Gauss-Legendre sums over each step of the dense output, in clustered time. A step is divided at kinks,
jumps and poles of the expression, and where it is narrower than the step (`saltus.flow.quadrature`). An integral that
does not converge is NaN, and a warning names it. `estimate` returns each value with an estimate of its error.
"""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Iterable
from fractions import Fraction
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from saltus.errors import InputError
from saltus.flow.formulas import Formula, Observable, check_rotating, read_formula
from saltus.flow.quadrature import Panels, greatest, integrate
from saltus.scales import EPS

if TYPE_CHECKING:
    from numpy.typing import ArrayLike, NDArray

    from saltus.flow.stretch import Motion

__all__ = ["Estimate", "angles", "estimate", "observe"]

_NODES = 16  # fewest nodes in a step; a step through a wide angle has more


class Estimate(NamedTuple):
    """An observable with its error.

    Attributes
    ----------
    value : float
        The value.
    error : float
        An estimate of the distance from the exact value: what the quadrature leaves, and what the tolerance of the
        motion makes of it. NaN where it is not known.
    """

    value: float
    error: float


def warned(text: str) -> None:
    """Warn of an observable without a value."""
    warnings.warn(f"saltus: {text}", RuntimeWarning, stacklevel=2)


def unheard(_: str) -> None:
    """Say nothing of an observable without a value, for those who tell it themselves."""


def observe(motion: Motion, names: Iterable[str], tell: Callable[[str], None] = warned) -> dict[str, float]:
    """Return observables of a motion by name; the page of this module lists them.

    Parameters
    ----------
    names : iterable of str
        What is observed, as in ``"amplitude(z, 1)"`` or ``"-degrees(phase(z, 1))"``.
    tell : callable, optional
        Is called with a text for each observable without a value.

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
    return {name: one.value for name, one in _observed(motion, tuple(names), False, tell).items()}


def estimate(motion: Motion, names: Iterable[str]) -> dict[str, Estimate]:
    """Return observables of a motion with their errors, by name.

    Parameters
    ----------
    names : iterable of str
        As `observe` takes them.

    Raises
    ------
    InputError
        As of `observe`.

    Examples
    --------
    >>> from saltus.flow.simulation import simulate
    >>> from saltus.system.hybrid import HybridSystem
    >>> turning = simulate(HybridSystem.smooth({"x": "v", "v": "-x"}), {}, [1.0, 0.0], t_end=6.283185307179586)
    >>> found = estimate(turning.motion(), ["mean(abs(x))"])["mean(abs(x))"]
    >>> print(f"{found.value:.9f}", found.error < 1e-9)
    0.636619772 True
    """
    return _observed(motion, tuple(names), True, warned)


def _observed(motion: Motion, names: tuple[str, ...], spread: bool, tell: Callable[[str], None]) -> dict[str, Estimate]:
    """Return observables; spread: whether errors hold what the errors of the states make."""
    formulas = {name: read_formula(motion.system, name) for name in names}
    wanted = {part: observable for formula in formulas.values() for part, observable in formula.parts.items()}
    check_rotating(motion.system, motion.rotating, wanted)
    advance = float(np.abs(motion.durations).max()) * motion.angle[1]
    highest = max((float(observable.order) for observable in wanted.values() if observable.order), default=0.0)
    seen = _Seen(motion, _NODES + math.ceil(highest * advance), spread, tell)
    values = {part: _value(seen, part, observable) for part, observable in wanted.items()}
    known = dict(motion.parameters)
    if motion.turns is not None:
        known.setdefault("period", motion.end - motion.begin)
    return {name: _composed(formula, values, known) for name, formula in formulas.items()}


def _composed(formula: Formula, values: dict[str, Estimate], known: dict[str, float]) -> Estimate:
    """Return a formula's value; each of its parts moves it by its own error."""
    plain = {part: values[part].value for part in formula.parts}
    value = float(formula.value(plain, known))
    if formula.expression is None:
        return values[next(iter(formula.parts))]
    moved = [float(formula.value(plain | {part: sum(values[part])}, known)) for part in formula.parts]
    return Estimate(value, math.fsum(abs(one - value) for one in moved) + EPS * abs(value) if moved else 0.0)


class _Seen:
    """A motion at nodes of a quadrature, each expression evaluated once."""

    def __init__(self, motion: Motion, nodes: int, spread: bool, tell: Callable[[str], None]) -> None:
        self.motion, self.nodes, self.spread, self.tell = motion, nodes, spread, tell
        self.panels = Panels.of(motion, np.arange(len(motion.spans)), motion.spans, nodes)
        self._values: dict[str, NDArray[np.float64]] = {}
        self._whole: dict[int, _Seen | None] = {}

    @property
    def length(self) -> float:
        """Length in time."""
        return self.motion.end - self.motion.begin

    def values(self, expression: str) -> NDArray[np.float64]:
        """Values at both ends of each step and the nodes between, shape (step, nodes + 2)."""
        if expression not in self._values:
            self._values[expression] = self.panels.values(expression)
        return self._values[expression]

    def mean(
        self, name: str, of: str, wave: Callable[[NDArray[np.float64]], NDArray[np.complex128]] | None = None
    ) -> tuple[complex, float]:
        """Mean over time of an expression, times a wave of times, and its error; a warning names what has none."""
        total = integrate(self.panels, of, self.values(of), wave, self.spread)
        if total.note:
            self.tell(f"{name} is NaN: {total.note}")
        return total.value / self.length, total.error / abs(self.length)

    def extreme(self, of: str, sign: float) -> Estimate:
        """Greatest value of an expression times a sign, with its error."""
        if of in self.motion.extremes:
            low, high = self.motion.extremes[of]
            known = sign * (high if sign > 0.0 else low)
            if not self.spread:
                return Estimate(known, math.nan)
            error = greatest(self.panels, of, self.values(of), sign, True)
            return Estimate(known, max(error.error, abs(error.value.real - known)))
        found = greatest(self.panels, of, self.values(of), sign, self.spread)
        return Estimate(found.value.real, found.error)

    def whole(self, periods: int) -> _Seen | None:
        """The last whole periods of the angle, as `Motion.whole` has them."""
        if periods not in self._whole:
            stretch = self.motion.whole(periods)
            if stretch is None or stretch is self.motion:
                self._whole[periods] = None if stretch is None else self
            else:
                self._whole[periods] = _Seen(stretch, self.nodes, self.spread, self.tell)
        return self._whole[periods]


def _value(seen: _Seen, name: str, observable: Observable) -> Estimate:
    motion, kind, of = seen.motion, observable.kind, observable.of
    match kind:
        case "max":
            return seen.extreme(of, 1.0)
        case "min":
            found = seen.extreme(of, -1.0)
            return Estimate(-found.value, found.error)
        case "mean":
            mean, error = seen.mean(name, of)
            return Estimate(mean.real, error)
        case "fraction":
            inside = motion.modes == motion.system.mode_names.index(of)
            share = float(np.sum(motion.durations[inside]) / np.sum(motion.durations))
            return Estimate(share, motion.tolerance * max(len(motion.crossings), 1))
        case "velocity":
            index = motion.system.transition_names.index(of)
            rates = [rate for _, transition, rate in motion.crossings if transition == index]
            mean_rate = math.fsum(rates) / len(rates) if rates else math.nan
            return Estimate(mean_rate, motion.tolerance * abs(mean_rate))
        case _:
            assert observable.order is not None
            harmonic, error = _harmonic(seen, name, of, observable.order)
            if kind == "amplitude":
                return Estimate(abs(harmonic), error)
            return Estimate(float(angles(harmonic)), min(error / abs(harmonic), math.pi) if harmonic else math.nan)


def _harmonic(seen: _Seen, name: str, expression: str, order: Fraction) -> tuple[complex, float]:
    """Return a exp(i phi) of a sin(order theta + phi), with its error."""
    motion, periods = seen.motion, order.denominator
    if motion.turns is not None and motion.turns % periods:
        return 0.0, 0.0
    stretch = seen.whole(periods)
    if stretch is None:
        turns = seen.length * motion.angle[1] / (2.0 * math.pi)
        many = "a period" if periods == 1 else f"{periods} periods"
        raise InputError("observable", name, f"of a stretch of {many} of the phase or more", f"it has {turns:.6g}")
    start, rate = motion.angle
    mean, error = stretch.mean(name, expression, lambda times: np.exp(-1j * float(order) * (start + rate * times)))
    return 2j * mean, 2.0 * error


def angles(harmonics: ArrayLike) -> NDArray[np.float64]:
    """Return the phases of harmonics, above -pi and up to pi; NaN where there is no harmonic."""
    found = np.angle(np.asarray(harmonics))
    return np.where(np.equal(harmonics, 0.0), np.nan, np.where(found == -math.pi, math.pi, found))
