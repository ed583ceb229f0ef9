"""The linear part of a mode's field, in modal coordinates about its response to the forcing."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from numpy.typing import NDArray

    from saltus.system.hybrid import HybridSystem

__all__ = ["LinearPart", "linear_parts"]

_WORST_BASIS = 1e6  # condition number of eigenvectors, up to which they are a basis
_LONGEST = 1.0 / 4.0  # longest step, in periods
_SHORTEST = 1.0 / 160.0  # step, in periods, below which exact steps are not worth their cost
_CLOSE = 1.0 / 50.0  # step, in periods, below which a surface is near
_AHEAD = 1.0 / 20.0  # time, in periods, for which no surface may be near where exact steps begin
_NEAREST = 0.05  # event function, over its response's amplitude, below which a lane leaves exact steps
_FROM = 0.1  # event function, over its response's amplitude, from which a lane takes exact steps
_LARGEST_DECAY = 3.0  # largest exponent of a step: the text's functions are right to 1e-15 for half of it
_LARGEST_TURN = 2.0 * np.pi  # largest angle of a step where there is a rest, in radians, for the same reason


@dataclass(frozen=True)
class LinearPart:
    """One mode's linear part ``x' = matrix x + forcing``, its eigenvectors and its periodic response."""

    matrix: NDArray[np.float64]  # shape (n, n)
    # shape (n,): complex pairs first, each with the positive imaginary part before its conjugate, then the real ones
    eigenvalues: NDArray[np.complex128]
    basis: NDArray[np.complex128]  # shape (n, n): eigenvectors in columns
    # rate, period: rate of the phase; time between two looks
    rate: float
    period: float
    harmonics: tuple[int, ...]
    # cosines, sines: shape (harmonics, n): response ``constant + sum_j cosines[j] cos(j theta) + sines[j] sin(j
    # theta)``
    cosines: NDArray[np.float64]
    sines: NDArray[np.float64]
    constant: NDArray[np.float64]  # shape (n,)
    events: NDArray[np.float64]  # shape (events, n): gradients of the event functions
    # event_cosines, event_sines, event_constants: the event functions along the response, shapes (events, harmonics)
    # twice and (events,)
    event_cosines: NDArray[np.float64]
    event_sines: NDArray[np.float64]
    event_constants: NDArray[np.float64]
    rest: tuple[int, ...]  # states in whose equation there is a rest

    @property
    def n(self) -> int:
        """Count of the states without the phase."""
        return len(self.constant)

    @property
    def pairs(self) -> int:
        """Count of the pairs of complex eigenvalues."""
        return int((self.eigenvalues.imag > 0.0).sum())

    def slots(self, row: NDArray[np.complex128]) -> NDArray[np.float64]:
        """Coefficients of a linear function in the real modal coordinates, from those in the complex ones."""
        m = self.pairs
        real = np.empty(self.n)
        real[0 : 2 * m : 2], real[1 : 2 * m : 2] = 2.0 * row[0 : 2 * m : 2].real, -2.0 * row[0 : 2 * m : 2].imag
        real[2 * m :] = row[2 * m :].real
        return real

    def numbers(self, weights: NDArray[np.float64]) -> dict[str, float]:
        """Return the numbers that the generated text of `saltus.ensemble.writer` reads."""
        n, m, eigenvalues = self.n, self.pairs, self.eigenvalues
        inverse = np.linalg.inv(self.basis)
        longest = _LONGEST * self.period
        if (decay := float(np.abs(eigenvalues.real).max())) > 0.0:
            longest = min(longest, _LARGEST_DECAY / decay)
        speeds = self.rate * np.array(self.harmonics)
        swiftest = float(np.concatenate([np.abs(eigenvalues.imag), speeds]).max())
        if self.rest and swiftest > 0.0:
            longest = min(longest, _LARGEST_TURN / swiftest)
        found = {
            "longest": longest,
            "shortest": _SHORTEST * self.period,
            "close": _CLOSE * self.period,
            "ahead": _AHEAD * self.period,
            "swiftest": float(np.abs(eigenvalues).max()),
            "weight": float(max((weights[f] for f in self.rest), default=1.0)),
        }
        found |= {f"lr{i}": value.real for i, value in enumerate(eigenvalues[0 : 2 * m : 2])}
        found |= {f"li{i}": value.imag for i, value in enumerate(eigenvalues[0 : 2 * m : 2])}
        found |= {f"lr{i}": eigenvalues[i].real for i in range(2 * m, n)}
        for e in range(n):
            found |= self._row(f"x{e}", self.slots(self.basis[e]), self.cosines[:, e], self.sines[:, e])
            found[f"x{e}_constant"] = self.constant[e]
        for i in range(n):
            pair, is_imaginary = divmod(i, 2) if i < 2 * m else (i, 0)
            row = inverse[2 * pair if i < 2 * m else i]
            row = row.imag if is_imaginary else row.real
            found |= self._row(f"z{i}", row, -self.cosines @ row, -self.sines @ row)
            found[f"z{i}_constant"] = -float(self.constant @ row)
            found |= {f"l{i}_{f}": row[f] for f in self.rest}
        amplitudes = []
        for j, gradient in enumerate(self.events):
            value = gradient @ self.basis
            cosines, sines = self.event_cosines[j], self.event_sines[j]
            found |= self._row(f"h{j}", self.slots(value), cosines, sines)
            found |= self._row(f"d{j}", self.slots(value * eigenvalues), speeds * sines, -speeds * cosines)
            found |= {f"h{j}_constant": self.event_constants[j], f"d{j}_constant": 0.0}
            swings = np.abs(value) * np.exp(np.maximum(eigenvalues.real, 0.0) * longest)
            found |= {f"a{j}_{i}": 1.001 * swing for i, swing in enumerate(2.0 * swings[0 : 2 * m : 2])}
            bends = swings * np.abs(eigenvalues) ** 2
            bends = [*(2.0 * bends[0 : 2 * m : 2]), *bends[2 * m :]]
            found |= {f"m{j}_{i}": 1.001 * bend for i, bend in enumerate(bends)}
            swing = np.hypot(cosines, sines)
            found[f"m{j}"] = 1.001 * float(swing @ speeds**2) + 1e-9
            amplitudes.append(float(swing.sum()))
            found |= {f"p{j}_{f}": gradient[f] for f in self.rest}
            found |= {f"b{j}_{f}": (gradient @ self.matrix)[f] for f in self.rest}
        size = min((a for a in amplitudes if a > 0.0), default=1.0)
        found |= {"in": _NEAREST * size, "out": _FROM * size}
        return {key: float(value) for key, value in found.items()}

    def _row(
        self, key: str, slots: NDArray[np.float64], cosines: NDArray[np.float64], sines: NDArray[np.float64]
    ) -> dict[str, float]:
        found = {f"{key}_{i}": value for i, value in enumerate(slots)}
        found |= {f"{key}_c{j}": value for j, value in zip(self.harmonics, cosines, strict=True)}
        return found | {f"{key}_s{j}": value for j, value in zip(self.harmonics, sines, strict=True)}


def linear_parts(system: HybridSystem, p: NDArray[np.float64], rate: float, period: float) -> dict[int, LinearPart]:
    """Return the linear part of each mode that has one, and a periodic response, for parameters `p`."""
    found = {}
    for mode, layout in enumerate(system.linear.splits):
        if layout is None or (layout["rest"] and not layout["events"]):
            continue  # without a surface to keep away from, nothing says where the rest is weak
        generator, events = system.linear.at(mode, p)
        part = _linear_part(generator, events, layout, rate, period)
        if part is not None:
            found[mode] = part
    return found


def _linear_part(
    generator: NDArray[np.float64], events: NDArray[np.float64], layout: dict[str, object], rate: float, period: float
) -> LinearPart | None:
    n = int(layout["states"])  # type: ignore[call-overload]
    count = (len(generator) - 1 - n) // 2
    harmonics = tuple(round(abs(generator[n + 2 * i, n + 2 * i + 1]) / rate) for i in range(count))
    matrix = generator[:n, :n]
    values, vectors = np.linalg.eig(matrix)
    if np.linalg.cond(vectors) > _WORST_BASIS:
        return None
    chosen = [i for i in np.argsort(values.imag) if values[i].imag > 0.0]
    order = [j for i in chosen for j in (i, int(np.argmin(np.abs(values - values[i].conj()))))]
    order += [i for i in range(n) if values[i].imag == 0.0]
    values, vectors = values[order].astype(complex), vectors[:, order].astype(complex)
    constant, cosines, sines = np.zeros(n), np.zeros((count, n)), np.zeros((count, n))
    try:
        if generator[:n, -1].any():
            constant = np.linalg.solve(matrix, -generator[:n, -1])
        for i, j in enumerate(harmonics):
            force = generator[:n, n + 2 * i] - 1j * generator[:n, n + 2 * i + 1]
            response = np.linalg.solve(1j * j * rate * np.eye(n) - matrix, force)
            cosines[i], sines[i] = response.real, -response.imag
    except np.linalg.LinAlgError:
        return None
    gradients = events[:, :n]
    return LinearPart(
        matrix, values, vectors, rate, period, harmonics, cosines, sines, constant, gradients,
        events[:, n : n + 2 * count : 2] + gradients @ cosines.T,
        events[:, n + 1 : n + 2 * count : 2] + gradients @ sines.T,
        events[:, -1] + gradients @ constant,
        tuple(layout["rest"]),  # type: ignore[arg-type]
    )  # fmt: skip
