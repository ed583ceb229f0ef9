"""The way from afar into the sample at given drives: amplitudes at each closest approach, and where a condition is met.

At a given closest approach the amplitude of a driven mode is nearly always unique, while at a given distance it may
have three values. So the way is followed along the closest approach, and each change of sign is a solution.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from saltus.afm.bimodal.averages import ROUGH
from saltus.afm.bimodal.balance import OF_MODES, Balance
from saltus.afm.bimodal.operation import AM, FM

__all__ = ["Approach", "approached", "depths", "started"]

Floats = NDArray[np.float64]

_HEIGHTS, _DEPTHS = 40, 48  # places above and below the surface
_CLOSE, _SHALLOW = 0.02, 2e-3  # least height and depth, in nm
_NEWTON = 12  # steps for the amplitudes at one place, at most
_SETTLED = 1e-7  # last step of an amplitude, relative
_FAST = 0.3  # largest step of an amplitude, relative


class Approach(NamedTuple):
    """What is known at each place, shape (place, pixel)."""

    c: Floats
    A1: Floats
    A2: Floats
    lack: Floats  # what the condition of the distance lacks; NaN where no amplitudes are found
    virial: Floats  # of both modes, in aJ


def depths(contact: bool, far: float, deep: float) -> Floats:
    """Places from afar into the sample, as depths in nm below the first level; those above are negative."""
    heights = -np.geomspace(far, _CLOSE, _HEIGHTS)
    return np.concatenate([heights, [0.0], np.geomspace(_SHALLOW, deep, _DEPTHS)]) if contact else heights


def approached(balance: Balance, modes: Sequence[AM | FM], q: Floats, Zc: Floats | None) -> Approach:
    """Follow the way of all pixels. `q` has readings that are held and the law's parameters."""
    at, pixels = balance.at, q.shape[1]
    held = [{name: q[at[name + end]] for name in OF_MODES} for end in ("", "_2")]
    free = [i for i in (0, 1) if not np.isfinite(held[i]["amplitude_nm"]).all()]
    amplitudes = [
        _free_amplitude(balance, i, held[i], isinstance(modes[i], AM)) if i in free else held[i]["amplitude_nm"].copy()
        for i in (0, 1)
    ]
    size = float(max(np.max(one) for one in amplitudes))
    far = 5.0 * size if Zc is None else max(5.0 * size, 1.2 * float(np.max(np.abs(Zc))))
    places = depths(bool(balance.layers.levels), far, 4.0 * size)
    level, rows = balance.level(q), []
    for depth in places:
        lost = np.zeros(pixels, dtype=bool)
        for _ in range(_NEWTON):
            c = level - depth + amplitudes[0] + amplitudes[1]
            own = q.copy()
            own[at["mean_gap_nm"]], own[at["amplitude_nm"]], own[at["amplitude_nm_2"]] = c, *amplitudes
            means = balance.means(own, ROUGH)
            equations = [_Mode(balance, i, modes[i], held[i], amplitudes, means) for i in (0, 1)]
            if not free:
                break
            steps = _amplitude_steps(equations, free, amplitudes)
            lost = ~np.isfinite(steps).all(0)
            for i, step in zip(free, np.where(lost, 0.0, steps), strict=True):
                amplitudes[i] = amplitudes[i] + np.clip(step, -_FAST * amplitudes[i], _FAST * amplitudes[i])
            sizes = np.array([amplitudes[i] for i in free])
            lost |= (np.abs(steps) > _SETTLED * sizes).any(0)
            if not lost.any():
                break
        setting = next((one for one, mode in zip(equations, modes, strict=True) if mode.sets_distance), None)
        bend = float(np.sum(1.0 / balance.k))
        lack = setting.condition() if setting is not None else c - bend * means[0, 0] - Zc
        virial = amplitudes[0] * means[1, 0] + amplitudes[1] * means[2, 0]
        rows.append((c, *amplitudes, np.where(lost, math.nan, lack), virial))
    return Approach(*(np.array([row[i] for row in rows]) for i in range(5)))


def _free_amplitude(balance: Balance, i: int, held: dict[str, Floats], driven: bool) -> Floats:
    """Amplitude of a mode far from the sample."""
    if not driven:
        return held["excitation_nm"].copy()
    r = 1.0 + 1e-3 * held["shift_Hz"] / balance.f0[i]
    return np.asarray(held["excitation_nm"] / np.hypot(balance.Q[i] * (1.0 - r**2), r))


class _Mode:
    """The equations of one mode at given amplitudes and closest approach, and derivatives along both amplitudes."""

    def __init__(
        self,
        balance: Balance,
        i: int,
        mode: AM | FM,
        held: dict[str, Floats],
        amplitudes: Sequence[Floats],
        means: Floats,
    ) -> None:
        self.mode, self.held, self.f0 = mode, held, balance.f0[i]
        A, k, Q = amplitudes[i], balance.k[i], balance.Q[i]
        own = np.array([float(i == j) for j in (0, 1)])[:, None]
        factor, omega0 = 2.0 * Q / k, 2e-3 * math.pi * balance.f0[i]
        elastic, damping = means[1 + i, 0], means[3 + i, 0]
        # at one closest approach the mean gap moves with the amplitudes
        elastic_A, damping_A = (means[row, 2:4] + means[row, 1] for row in (1 + i, 3 + i))
        if np.isfinite(held["shift_Hz"]).all():
            r, r_A = 1.0 + 1e-3 * held["shift_Hz"] / self.f0, np.zeros_like(elastic_A)
        else:
            r = np.sqrt(np.maximum(1e-6, 1.0 - 2.0 * elastic / (k * A)))
            r_A = (elastic * own / A - elastic_A) / (k * A * r)
        self.r = r
        self.x = Q * A * (1.0 - r**2) - factor * elastic
        self.y = A * r * (1.0 + factor * omega0 * damping)
        self.x_A = Q * (1.0 - r**2) * own - 2.0 * Q * A * r * r_A - factor * elastic_A
        self.y_A = (r * own + A * r_A) * (1.0 + factor * omega0 * damping) + A * r * factor * omega0 * damping_A
        self.resonance = self.f0 * 1e3 * (np.sqrt(np.maximum(1e-6, 1.0 - 2.0 * elastic / (k * A))) - 1.0)

    def amplitude(self) -> tuple[Floats, Floats]:
        """What the drive lacks, with derivatives: the equation of an amplitude that is not held."""
        A0 = self.held["excitation_nm"]
        if isinstance(self.mode, FM):
            return self.y - A0, self.y_A
        size = np.hypot(self.x, self.y)
        return size - A0, (self.x * self.x_A + self.y * self.y_A) / size

    def condition(self) -> Floats:
        """What the set point that holds the distance lacks."""
        if isinstance(self.mode, FM):
            return np.asarray(self.resonance - self.held["shift_Hz"])
        return np.asarray(np.hypot(self.x, self.y) - self.held["excitation_nm"])

    def readings(self) -> dict[str, Floats]:
        """Those that are not held."""
        found = {
            "lag_deg": np.degrees(np.arctan2(self.y, self.x)) % 360.0,
            "shift_Hz": self.f0 * 1e3 * (self.r - 1.0),
            "excitation_nm": np.hypot(self.x, self.y),
        }
        return {name: value for name, value in found.items() if not np.isfinite(self.held[name]).all()}


def _amplitude_steps(equations: Sequence[_Mode], free: Sequence[int], amplitudes: Sequence[Floats]) -> Floats:
    """Newton's steps of the amplitudes that are not held, shape (free, pixel)."""
    told = [equations[i].amplitude() for i in free]
    lack = np.array([one for one, _ in told])
    matrix = np.array([[slopes[j] for j in free] for _, slopes in told]).transpose(2, 0, 1)
    steps = np.full(lack.shape, math.nan)
    good = np.isfinite(matrix).all((1, 2)) & np.isfinite(lack).all(0)
    good[good] &= np.abs(np.linalg.det(matrix[good])) > 0.0
    steps[:, good] = -np.linalg.solve(matrix[good], lack[:, good].T[..., None])[..., 0].T
    return steps


def started(balance: Balance, modes: Sequence[AM | FM], q: Floats) -> Floats:
    """Fill readings that are not held, at the mean gap and the amplitudes that `q` has."""
    at = balance.at
    held = [{name: q[at[name + end]] for name in OF_MODES} for end in ("", "_2")]
    amplitudes = [one["amplitude_nm"] for one in held]
    means, out = balance.means(q, ROUGH), q.copy()
    for i, end in enumerate(("", "_2")):
        for name, value in _Mode(balance, i, modes[i], held[i], amplitudes, means).readings().items():
            out[at[name + end]] = value
    if not np.isfinite(out[at["Zc_nm"]]).all():
        out[at["Zc_nm"]] = out[at["mean_gap_nm"]] - float(np.sum(1.0 / balance.k)) * means[0, 0]
    return out
