"""Residuals of data of which each reading has an error: by how much readings must move until a law has them.

Where a force is steep, an error of the gap is a large one of the force: a law at the gap that was read says little of
the tip. Here the readings of each datum move by as little as they must, over their errors. What they move by is the
residual, with the sign of the shift's. Moves are those of Gauss and Newton, each shortened until it is nearer.

A law that bends along the errors of a datum has more of them on one side. By half of its curvature they lie beside it
in the mean, which the residual leaves out.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    Shifts = Callable[[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]], NDArray[np.float64]]

__all__ = ["NearestReadings"]

_ROUNDS = 40  # in which moves come to rest, at most
_AT_REST = 1e-5  # step of a move, over its error, below which it rests
_SHORTEST = 1e-2  # share of a step below which none is nearer
_LEAST_ERROR = 1e-9  # of a reduced shift, over the greatest one
_NEAR = 1e-4  # nm; step of differences by a gap or an amplitude
_ASIDE = 0.5  # step of second differences by a move, over its error
_STEP = 1e-6  # step of differences by an unknown, over its scale


class _Found(NamedTuple):
    """What is told of the readings that a law has, nearest to those of the data."""

    residuals: NDArray[np.float64]
    centre: NDArray[np.float64]
    amplitude: NDArray[np.float64]
    size: NDArray[np.float64]  # change of the shift that changes the residual by 1
    beside: NDArray[np.float64]  # the law's shifts less those read, over the errors of what moves no gap
    slopes: NDArray[np.float64]  # derivatives of these by the moves


class NearestReadings:
    """Residuals of readings against a law with unknowns.

    Parameters
    ----------
    shifts : callable
        Reduced shifts of the law by unknowns, centre and amplitude.
    centre, amplitude, measured : ndarray, shape (datum,)
        Gaps in the middle of the oscillation, amplitudes and reduced shifts, as they were read.
    changed : ndarray, shape (reading, 3, datum)
        Changes of these three by the error of each reading.
    scales : ndarray, shape (unknown,)
        Sizes of the unknowns.
    """

    def __init__(
        self,
        shifts: Shifts,
        centre: NDArray[np.float64],
        amplitude: NDArray[np.float64],
        measured: NDArray[np.float64],
        changed: NDArray[np.float64],
        scales: NDArray[np.float64],
    ) -> None:
        self._shifts, self._scales = shifts, scales
        self._read = np.array([centre, amplitude, measured])
        moving = changed[:, :2].any(axis=(1, 2))
        self._changed = changed[moving]
        least = _LEAST_ERROR * float(np.abs(measured).max())
        self._still = np.maximum(np.sqrt(np.sum(changed[~moving, 2] ** 2, axis=0)), least)
        self._moves = np.zeros((int(moving.sum()), len(measured)))  # over the errors of the readings that move the gap
        self._mean = np.zeros(len(measured))  # of the residuals, if the law is that of the data
        self._known: tuple[bytes, _Found] | None = None

    def residuals(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return by how much the readings of each datum move, over their errors."""
        return self._found(x).residuals

    def expect(self, x: NDArray[np.float64]) -> None:
        """Leave out of all further residuals what is expected of data of a law with such unknowns."""
        found, every = self._found(x), np.arange(self._moves.shape[1])
        way = _ASIDE * found.slopes / np.maximum(np.linalg.norm(found.slopes, axis=0), 1e-300)
        ends = [self._beside(x, every, self._moves + sign * way) for sign in (-1.0, 1.0)]
        bent = (ends[0] + ends[1] - 2.0 * found.beside) / _ASIDE**2
        self._mean = 0.5 * bent * (self._still / found.size) ** 3
        self._known = None

    def jacobian(self, x: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the derivatives of the residuals by the unknowns, shape (datum, unknown)."""
        found = self._found(x)
        columns = []
        for k, scale in enumerate(self._scales):
            step = np.zeros(len(x))
            step[k] = _STEP * scale
            ends = [self._shifts(x + sign * step, found.centre, found.amplitude) for sign in (-1.0, 1.0)]
            columns.append((ends[1] - ends[0]) / (2.0 * step[k] * found.size))
        return np.column_stack(columns)

    def _found(self, x: NDArray[np.float64]) -> _Found:
        if self._known is not None and self._known[0] == x.tobytes():
            return self._known[1]
        every = np.arange(self._moves.shape[1])
        beside, slopes = self._beside(x, every, self._moves), np.zeros(self._moves.shape)
        going = every
        for _ in range(_ROUNDS):
            slopes[:, going] = self._slopes(x, going, beside[going])
            going = self._stepped(x, going, slopes, beside)
            if not len(going):
                break
        steep = np.sqrt(1.0 + np.sum(slopes**2, axis=0))
        away = np.copysign(np.sqrt(np.sum(self._moves**2, axis=0) + beside**2), beside)
        centre, amplitude, _ = self._place(every, self._moves)
        self._known = x.tobytes(), _Found(away - self._mean, centre, amplitude, self._still * steep, beside, slopes)
        return self._known[1]

    def _place(self, data: NDArray[np.int64], moves: NDArray[np.float64]) -> NDArray[np.float64]:
        """Return the readings of some data where they are moved to: centre, amplitude and shift."""
        return np.asarray(self._read[:, data] + np.einsum("rd,rkd->kd", moves, self._changed[..., data]))

    def _beside(
        self,
        x: NDArray[np.float64],
        data: NDArray[np.int64],
        moves: NDArray[np.float64],
        more: tuple[float, float] = (0.0, 0.0),
    ) -> NDArray[np.float64]:
        """Return the law's shifts less those that are read, over the errors of what moves no gap."""
        centre, amplitude, shift = self._place(data, moves)
        return np.asarray((self._shifts(x, centre + more[0], amplitude + more[1]) - shift) / self._still[data])

    def _slopes(
        self, x: NDArray[np.float64], data: NDArray[np.int64], here: NDArray[np.float64]
    ) -> NDArray[np.float64]:
        """Return the derivatives of `_beside` by the moves, shape (reading, datum)."""
        moves, changed = self._moves[:, data], self._changed[..., data]
        by_centre = (self._beside(x, data, moves, (_NEAR, 0.0)) - here) / _NEAR
        by_amplitude = (self._beside(x, data, moves, (0.0, _NEAR)) - here) / _NEAR
        return np.asarray(changed[:, 0] * by_centre + changed[:, 1] * by_amplitude - changed[:, 2] / self._still[data])

    def _stepped(
        self,
        x: NDArray[np.float64],
        data: NDArray[np.int64],
        slopes: NDArray[np.float64],
        beside: NDArray[np.float64],
    ) -> NDArray[np.int64]:
        """Move some data nearer to the law, and change `beside`; return those that do not rest yet.

        A step goes to the least sum of squares of moves and of `beside`, were this linear.
        """
        steep, first, from_there = slopes[:, data], self._moves[:, data], beside[data].copy()
        down = -(first + steep * from_there)
        steps = down - steep * np.sum(steep * down, axis=0) / (1.0 + np.sum(steep**2, axis=0))
        before = np.sum(first**2, axis=0) + from_there**2
        trying = np.flatnonzero(np.abs(steps).max(axis=0, initial=0.0) >= _AT_REST)
        going, share = trying, 1.0
        while len(trying) and share > _SHORTEST:
            moves = first[:, trying] + share * steps[:, trying]
            there = self._beside(x, data[trying], moves)
            nearer = np.sum(moves**2, axis=0) + there**2 < before[trying]
            self._moves[:, data[trying[nearer]]], beside[data[trying[nearer]]] = moves[:, nearer], there[nearer]
            trying, share = trying[~nearer], 0.5 * share
        return data[np.setdiff1d(going, trying)]
