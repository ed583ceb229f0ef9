"""A stretch of motion, step by step, with its dense output."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, TypeAlias

import numpy as np

from saltus.system.angles import TURN

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = ["POWERS_OF_TERMS", "Motion", "angle_of", "clustered_clocks", "dense_states"]

States: TypeAlias = "Callable[[NDArray[np.intp], NDArray[np.float64]], NDArray[np.float64]]"

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
    # angle of harmonics at time 0, 2 pi in a period of the drive, and its rate; it runs on beyond 2 pi
    angle: tuple[float, float]
    turns: int | None = None  # periods of the angle after which the motion repeats; None where it does not
    rotating: tuple[str, ...] = ()  # angles among the states that make turns before the motion repeats
    tolerance: float = 1e-10  # relative, of the steps
    # shape (all states,): errors of the states, or what computes them; None where they are not known
    errors: NDArray[np.float64] | Callable[[], NDArray[np.float64]] | None = None
    # least and greatest values of states and outputs that are known already, by name
    extremes: Mapping[str, tuple[float, float]] = field(default_factory=dict)

    @property
    def begin(self) -> float:
        """Time of the start."""
        return _clock(self.clocks[0], float(self.spans[0, 0]))

    @property
    def end(self) -> float:
        """Time of the end."""
        return _clock(self.clocks[-1], float(self.spans[-1, 1]))

    @property
    def state_errors(self) -> NDArray[np.float64] | None:
        """Errors of the states, shape (all states,); None where they are not known."""
        return self.errors() if callable(self.errors) else self.errors

    @property
    def durations(self) -> NDArray[np.float64]:
        """Length of each step in time, shape (step,)."""
        low, high = self.spans.T[:, :, None]
        return (_times(self.clocks, high) - _times(self.clocks, low))[:, 0]

    def clock(self, steps: NDArray[np.intp], fractions: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the times at fractions of steps, shape (m, k) for indices of steps (m,) and fractions (m, k)."""
        return _times(self.clocks[steps], fractions)

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
            extremes={},
        )


def clustered_clocks(
    begun: NDArray[np.float64], duration: NDArray[np.float64], s: NDArray[np.float64], h: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return the times along steps of clustered time, t = T s^2 (3 - 2 s), by powers of a step's fraction, (step, 4).

    begun, duration: of the segment of each step; s, h: where the step begins in it, and its width.
    """
    return np.column_stack(
        [
            begun + duration * s**2 * (3.0 - 2.0 * s),
            duration * 6.0 * s * (1.0 - s) * h,
            duration * 3.0 * h**2 * (1.0 - 2.0 * s),
            duration * -2.0 * h**3,
        ]
    )


def angle_of(system: HybridSystem, phase: float, rate: float) -> tuple[float, float]:
    """Return the angle of harmonics, 2 pi in a period of the drive, and its rate, from those of the phase."""
    faster = TURN / system.turn
    return faster * phase, faster * rate


def dense_states(
    starts: NDArray[np.float64], coefficients: NDArray[np.float64], fractions: NDArray[np.float64]
) -> NDArray[np.float64]:
    """Return states within steps by their dense output of order 7, shape (m, n) or (m, k, n).

    Parameters
    ----------
    starts : ndarray, shape (m, n)
        State at the start of each state's step.
    coefficients : ndarray, shape (m, 7, n)
        The dense output of that step.
    fractions : ndarray, shape (m,) or (m, k)
        Where in the step, from 0 to 1.

    References
    ----------
    E. Hairer, S. P. Norsett, G. Wanner, Solving Ordinary Differential Equations I, 2nd edition, Springer 1993, II.6.
    """
    if fractions.ndim == 2:
        starts, coefficients = starts[:, None, :], coefficients[:, :, None, :]
    fraction = fractions[..., None]
    other = 1.0 - fraction
    y = coefficients[:, 6] * fraction
    for j, factor in ((5, other), (4, fraction), (3, other), (2, fraction), (1, other), (0, fraction)):
        y = (y + coefficients[:, j]) * factor
    return np.asarray(starts + y)


def _powers_of_terms() -> NDArray[np.float64]:
    """Return the powers of the fraction, from the first on, in each term of `dense_states`, shape (7, 7)."""
    term, table = np.array([1.0]), np.zeros((8, 7))
    for j in range(7):
        term = np.convolve(term, [0.0, 1.0] if j % 2 == 0 else [1.0, -1.0])
        table[: term.size, j] = term
    return table[1:]


POWERS_OF_TERMS = _powers_of_terms()


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
