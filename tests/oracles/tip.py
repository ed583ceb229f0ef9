"""A tip over a sample by SciPy, event by event, with textbook formulas of forces; nothing here comes from saltus."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

EV_PER_AJ = 1.0 / 0.1602176634


class Stretch(NamedTuple):
    """Force and rates of the law's states between two events, and where the stretch ends: level, direction, next."""

    force: Callable[[float, float, np.ndarray], float]
    ends: Sequence[tuple[Callable[[np.ndarray], float], int, str]]
    rates: Callable[[float, np.ndarray], np.ndarray] = lambda D, s: np.zeros(0)
    contact: bool = False


@dataclass(frozen=True)
class Tip:
    """Oscillators under forces F cos(w t), one of its own each, in nm, nN and us."""

    k: Sequence[float]
    f0: Sequence[float]
    Q: Sequence[float]
    F: Sequence[float]
    f: Sequence[float]
    Zc: float

    def cycles(
        self, law: Mapping[str, Stretch], region: str, start: np.ndarray, turns: int = 1
    ) -> dict[str, float | np.ndarray]:
        """Return the end of a motion over cycles of the first force, and its means over them."""
        n = len(self.k)
        k, own, Q, F = (np.array(values, float) for values in (self.k, self.f0, self.Q, self.F))
        own, w = 2e-3 * math.pi * own, 2e-3 * math.pi * np.array(self.f, float)
        m, T = k / own**2, 2.0 * math.pi * turns / w[0]
        own_states = len(start) - 2 * n

        def rhs(t, y):
            z, v, s = y[:n], y[n : 2 * n], y[2 * n : 2 * n + own_states]
            D, V, here = self.Zc + z.sum(), v.sum(), law[region]
            force, drive = here.force(D, V, s), F * np.cos(w * t)
            a = (force + drive - k * z - m * own / Q * v) / m
            waves = [z * np.cos(w * t), z * np.sin(w * t)]
            sums = [z.sum(), -force * V, drive @ v, m * own / Q @ v**2, force * z.sum(), float(here.contact)]
            return np.concatenate([v, a, here.rates(D, s), *waves, sums])

        t, y = 0.0, np.concatenate([start, np.zeros(2 * n + 6)])
        while t < T:
            watched = []
            for level, direction, _ in law[region].ends:

                def gap(_t, y, level=level):
                    return self.Zc + y[:n].sum() - level(y[2 * n : 2 * n + own_states])

                gap.terminal, gap.direction = True, direction
                watched.append(gap)
            run = solve_ivp(rhs, (t, T), y, method="DOP853", rtol=1e-11, atol=1e-11, events=watched)
            t, y = float(run.t[-1]), run.y[:, -1]
            if run.status == 1:
                region = next(law[region].ends[i][2] for i, times in enumerate(run.t_events) if len(times))
        waves, sums = y[-2 * n - 6 : -6].reshape(2, n) * 2.0 / T, y[-6:]
        harmonic = waves[0] - 1j * waves[1]
        return {
            "end": y[: len(start)],
            "amplitude_nm": np.abs(harmonic),
            "lag_deg": np.degrees(-np.angle(harmonic)) % 360.0,
            "deflection_pm": 1e3 * sums[0] / T,
            "E_ts_eV": sums[1] * EV_PER_AJ / turns,
            "E_ext_eV": sums[2] * EV_PER_AJ / turns,
            "E_med_eV": sums[3] * EV_PER_AJ / turns,
            "virial_eV": sums[4] / T * EV_PER_AJ,
            "contact_fraction": sums[5] / T,
        }


def two_sided(far, contact, level: float = 0.0) -> dict[str, Stretch]:
    """A law whose contact begins and ends at one gap."""
    return {
        "far": Stretch(far, [(lambda s: level, -1, "contact")]),
        "contact": Stretch(contact, [(lambda s: level, 1, "far")], contact=True),
    }


def attraction(H: float, R: float, a0: float) -> Callable[[float], float]:
    return lambda D: -H * R / (6.0 * max(D, a0) ** 2)


def sphere(E: float, R: float, h: float) -> float:
    return 4.0 / 3.0 * E * math.sqrt(R) * max(h, 0.0) ** 1.5


def jkr(D: float, E: float, w: float, R: float) -> float:
    """Force of JKR's contact, by the largest root of a quartic."""
    a = (math.pi * R * R * w / (8.0 * E)) ** (1.0 / 3.0)
    q = max(-D * R / a**2, -3.0)
    x = 1.0 + math.sqrt((q + 3.0) / 6.0) if q < 60.0 else q**0.25
    x = max(x, 1.0 + 1e-16)
    for _ in range(60):
        slope = 4.0 * x**3 - 4.0
        if slope == 0.0:
            break
        step = (x**4 - 4.0 * x - q) / slope
        x -= step
        if abs(step) < 1e-15 * x:
            break
    return math.pi * w * R * (x**6 / 6.0 - x**3)
