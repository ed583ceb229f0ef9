"""The way from afar into the sample at given drives: amplitudes at each closest approach, and where a condition is met.

Where all amplitudes are held, the way goes along the closest approach. Where an amplitude is free, the way may turn
back in distance and in closest approach, and is followed by arclength. Each change of sign of the condition that sets
the distance is a solution.
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

__all__ = ["Approach", "approached", "depths", "from_contact", "started"]

Floats = NDArray[np.float64]

_HEIGHTS = 40  # places above the surface
_DEPTHS = 48  # places below it
_CLOSE = 0.02  # least height, in nm
_SHALLOW = 2e-3  # least depth, in nm
_MOST = 400  # steps along a way that may fold, at most
_LONGEST = 0.3  # step of it, at most
_SHORTEST = 1e-5  # step of it, at least
_CORRECTIONS = 4  # Newton's steps at each place
_TRIES = 25  # Newton's steps from a guess
# guesses of a motion in contact: depth over the amplitude, amplitudes over the free ones, of the first mode and others
_GUESSES = tuple((depth, *shares) for shares in ((0.9, 0.25), (0.8, 0.1), (0.95, 0.6)) for depth in (0.02, 0.06, 0.2))
_SETTLED = 1e-6  # last correction
_STRAIGHT = 0.9  # cosine of the angle by which the way may turn in a step


class Approach(NamedTuple):
    """What is known at each place, shape (place, pixel)."""

    c: Floats
    A: Floats  # (place, mode, pixel)
    # what the condition of the distance lacks; one of an amplitude is met with the drive ahead of 0 degrees, or of 180
    lack: Floats
    other_lack: Floats
    virial: Floats  # of all modes, in aJ


def depths(contact: bool, far: float, deep: float) -> Floats:
    """Places from afar into the sample, as depths in nm below the first level; those above are negative."""
    heights = -np.geomspace(far, _CLOSE, _HEIGHTS)
    return np.concatenate([heights, [0.0], np.geomspace(_SHALLOW, deep, _DEPTHS)]) if contact else heights


def approached(balance: Balance, modes: Sequence[AM | FM], q: Floats, Zc: Floats | None) -> Approach:
    """Follow the way of all pixels. `q` has readings that are held and the law's parameters."""
    way = _Way(balance, modes, q, Zc)
    if not way.free:
        return _as_approach(way.plain())
    afar = np.concatenate([np.full((1, q.shape[1]), way.place(-way.far)), np.log(way.amplitudes[way.free])])
    return _as_approach(way.folded(afar, 0, 1.0))


def from_contact(balance: Balance, modes: Sequence[AM | FM], q: Floats, Zc: Floats | None) -> Approach | None:
    """Follow both ways from a motion that is repelled, where one is found; one from afar may end in the pull-in."""
    way = _Way(balance, modes, q, Zc)
    if not way.free or not way.contact:
        return None
    start = way.repelled()
    if not np.isfinite(start).any():
        return None
    return _as_approach([*reversed(way.folded(start, 1, 1.0)), *way.folded(start, 1, -1.0)])


def _as_approach(rows: Sequence[tuple[Floats, ...]]) -> Approach:
    return Approach(*(np.array([row[i] for row in rows]) for i in range(5)))


class _Way:
    """The way of all pixels from afar."""

    def __init__(self, balance: Balance, modes: Sequence[AM | FM], q: Floats, Zc: Floats | None) -> None:
        self.balance, self.modes, self.q, self.Zc = balance, modes, q, Zc
        self.all = range(len(modes))
        self.held = [{name: q[balance.at[name + end]] for name in OF_MODES} for end in balance.ends]
        self.free = [i for i in self.all if not np.isfinite(self.held[i]["amplitude_nm"]).all()]
        self.amplitudes = np.array(
            [
                _free_amplitude(balance, i, self.held[i], isinstance(modes[i], AM))
                if i in self.free
                else self.held[i]["amplitude_nm"]
                for i in self.all
            ]
        )
        self.size = float(self.amplitudes.max())
        self.far = 5.0 * self.size if Zc is None else max(5.0 * self.size, 1.2 * float(np.max(np.abs(Zc))))
        self.contact, self.level, self.bend = bool(balance.layers.levels), balance.level(q), np.sum(1.0 / balance.k)

    def at(self, depth: Floats, amplitudes: Floats) -> tuple[list[_Mode], tuple[Floats, ...]]:
        """The equations at a depth of the closest approach, and what is recorded there."""
        at, own = self.balance.at, self.q.copy()
        c = self.level - depth + amplitudes.sum(0)
        own[at["mean_gap_nm"]], own[[at[name] for name in self.balance.amplitudes]] = c, amplitudes
        means = self.balance.means(own, ROUGH)
        equations = [_Mode(self.balance, i, self.modes[i], self.held[i], list(amplitudes), means) for i in self.all]
        setting = next((one for one in equations if one.mode.sets_distance), None)
        gap = c - self.bend * means[0, 0, 0] - (math.nan if self.Zc is None else self.Zc)
        lacks = (gap, np.full_like(c, math.nan)) if setting is None else setting.conditions()
        virial = np.sum(amplitudes * means[0, 1:, 0], axis=0)
        return equations, (c, amplitudes, *lacks, virial)

    def plain(self) -> list[tuple[Floats, ...]]:
        """The way where all amplitudes are held."""
        places = depths(self.contact, self.far, 4.0 * self.size)
        return [self.at(np.full(self.q.shape[1], depth), self.amplitudes)[1] for depth in places]

    def repelled(self) -> Floats:
        """A place in contact where the tip is repelled, NaN where none is found."""
        found = np.full((1 + len(self.free), self.q.shape[1]), math.nan)
        for depth, *shares in _GUESSES:
            w = np.concatenate(
                [
                    np.full((1, found.shape[1]), self.place(depth * self.size)),
                    np.log(self.amplitudes[self.free] * np.array([shares[min(i, 1)] for i in self.free])[:, None]),
                ]
            )
            still = np.zeros_like(w)  # the first free amplitude is kept, and the depth is found that belongs to it
            still[1] = 1.0
            steps = np.full_like(w, math.nan)
            for _ in range(_TRIES):
                lack, slopes = self.equations(w)
                steps = _bordered(slopes, still, -lack, np.zeros(found.shape[1]))
                w = w + np.where(np.isfinite(steps), np.clip(steps, -0.5, 0.5), 0.0)
            with np.errstate(invalid="ignore"):
                settled = np.abs(steps).max(0) < _SETTLED
            good = settled & (self.at(self.depth(w[0]), self.whole(w))[1][-1] < 0.0) & ~np.isfinite(found[0])
            found[:, good] = w[:, good]
        return found

    def folded(self, start: Floats, along: int, direction: float) -> list[tuple[Floats, ...]]:
        """The way where amplitudes are free, by arclength: it begins along one unknown, and may turn back in depth."""
        pixels, count, w = self.q.shape[1], len(self.free), start
        border, h = np.zeros((count + 1, pixels)), np.full(pixels, _LONGEST)
        border[along] = direction
        tangent = _bordered(self.equations(w)[1], border, np.zeros((count, pixels)), np.ones(pixels))
        tangent /= np.linalg.norm(tangent, axis=0)
        rows, active = [self.at(self.depth(w[0]), self.whole(w))[1]], np.isfinite(w).all(0)
        for _ in range(_MOST):
            ahead = trial = w + h * tangent
            good = active.copy()
            for _ in range(_CORRECTIONS):
                lack, slopes = self.equations(trial)
                steps = _bordered(slopes, tangent, -lack, np.sum(tangent * (ahead - trial), axis=0))
                good &= np.isfinite(steps).all(0)
                trial = trial + np.where(good, np.clip(steps, -1.0, 1.0), 0.0)
            good &= np.abs(steps).max(0) < _SETTLED
            turned = _bordered(self.equations(trial)[1], tangent, np.zeros((count, pixels)), np.ones(pixels))
            turned /= np.linalg.norm(turned, axis=0)
            with np.errstate(invalid="ignore"):
                good &= (np.sum(turned * tangent, axis=0) > _STRAIGHT) & (np.abs(trial - w).max(0) < 2.0 * h)
            w, tangent = np.where(good, trial, w), np.where(good, turned, tangent)
            h = np.where(good, np.minimum(1.4 * h, _LONGEST), 0.5 * h)
            rows.append(self.at(self.depth(w[0]), self.whole(w))[1])
            deep = w[0] > self.place(4.0 * self.size if self.contact else -_CLOSE)
            active &= ~deep & (w[0] >= self.place(-1.001 * self.far)) & (h > _SHORTEST)
            if not active.any():
                break
        return rows

    def equations(self, w: Floats) -> tuple[Floats, Floats]:
        """What the drives lack, relative, and derivatives along the unknowns of the way."""
        amplitudes, depth = self.whole(w), self.depth(w[0])
        told = [self.at(depth, amplitudes)[0][i].amplitude() for i in self.free]
        A0 = np.array([self.held[i]["excitation_nm"] for i in self.free])
        stretch = np.sqrt(depth**2 + _CLOSE**2) if self.contact else -depth
        slopes = np.array([[one[-1] * stretch, *(one[j] * amplitudes[j] for j in self.free)] for _, one in told])
        return np.array([lack for lack, _ in told]) / A0, slopes / A0[:, None]

    def whole(self, w: Floats) -> Floats:
        """All amplitudes."""
        amplitudes = self.amplitudes.copy()
        amplitudes[self.free] = np.exp(np.clip(w[1:], -50.0, 50.0))
        return amplitudes

    def place(self, depth: float) -> float:
        """The stretched coordinate of a depth."""
        return math.asinh(depth / _CLOSE) if self.contact else -math.log(-depth)

    def depth(self, place: Floats) -> Floats:
        """The depth of a stretched coordinate."""
        bounded = np.clip(place, -50.0, 50.0)
        return np.asarray(_CLOSE * np.sinh(bounded) if self.contact else -np.exp(-bounded))


def _bordered(slopes: Floats, tangent: Floats, right: Floats, along: Floats) -> Floats:
    """Solve for steps with given changes of the equations and along the tangent, shape (unknown, pixel)."""
    matrix = np.concatenate([slopes, tangent[None]]).transpose(2, 0, 1)
    values = np.concatenate([right, along[None]])
    good = np.isfinite(matrix).all((1, 2)) & np.isfinite(values).all(0)
    good[good] &= np.abs(np.linalg.det(matrix[good])) > 0.0
    steps = np.full(values.shape, math.nan)
    steps[:, good] = np.linalg.solve(matrix[good], values[:, good].T[..., None])[..., 0].T
    return steps


def _free_amplitude(balance: Balance, i: int, held: dict[str, Floats], driven: bool) -> Floats:
    """Amplitude of a mode far from the sample."""
    if not driven:
        return held["excitation_nm"].copy()
    r = 1.0 + 1e-3 * held["shift_Hz"] / balance.f0[i]
    return np.asarray(held["excitation_nm"] / np.hypot(balance.Q[i] * (1.0 - r**2), r))


class _Mode:
    """The equations of one mode at given amplitudes and closest approach, and derivatives along both and the depth."""

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
        own = np.array([float(i == j) for j in range(len(amplitudes) + 1)])[:, None]
        factor, omega0 = 2.0 * Q / k, 2e-3 * math.pi * balance.f0[i]
        elastic, damping = means[:, 1 + i, 0]
        # at one closest approach the mean gap moves with the amplitudes
        elastic_A, damping_A = (
            np.concatenate([mean[2 : 2 + len(amplitudes)] + mean[1], -mean[1:2]]) for mean in means[:, 1 + i]
        )
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

    def conditions(self) -> tuple[Floats, Floats]:
        """What the set point that holds the distance lacks: an amplitude belongs to two lags."""
        if isinstance(self.mode, FM):
            return self.resonance - self.held["shift_Hz"], np.full_like(self.x, math.nan)
        cosine = np.sqrt(self.held["excitation_nm"] ** 2 - self.y**2)
        return self.x - cosine, self.x + cosine

    def readings(self) -> dict[str, Floats]:
        """Those that are not held."""
        found = {
            "lag_deg": np.degrees(np.arctan2(self.y, self.x)) % 360.0,
            "shift_Hz": self.f0 * 1e3 * (self.r - 1.0),
            "excitation_nm": np.hypot(self.x, self.y),
        }
        return {name: value for name, value in found.items() if not np.isfinite(self.held[name]).all()}


def started(balance: Balance, modes: Sequence[AM | FM], q: Floats) -> Floats:
    """Fill readings that are not held, at the mean gap and the amplitudes that `q` has."""
    at = balance.at
    held = [{name: q[at[name + end]] for name in OF_MODES} for end in balance.ends]
    amplitudes = [one["amplitude_nm"] for one in held]
    means, out = balance.means(q, ROUGH), q.copy()
    for i, end in enumerate(balance.ends):
        for name, value in _Mode(balance, i, modes[i], held[i], amplitudes, means).readings().items():
            out[at[name + end]] = value
    if not np.isfinite(out[at["Zc_nm"]]).all():
        out[at["Zc_nm"]] = out[at["mean_gap_nm"]] - float(np.sum(1.0 / balance.k)) * means[0, 0, 0]
    return out
