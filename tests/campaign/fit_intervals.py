"""Intervals of fits contain the true parameters as often as they say, for data that SciPy integrates.

`make coverage` runs it: five systems, and for each many sets of data with other noise. A true value lies within an
interval of one standard error in 68.3 % of the sets, within 1.96 of them in 95 %. The counts must lie within the limits
of the binomial distribution. Where a sheet, a reach or a bound limits an interval, only the lower limit counts.

    python tests/campaign/fit_intervals.py [SETS [SYSTEM ...]]
"""

from __future__ import annotations

import sys
import time
import warnings
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.stats import binom

import saltus
from saltus.options import FitOptions

SETS = 50
WRONG = 0.01  # chance that a right fit is said to be wrong, by all counts of a run together
LEVELS = ((1.0, 0.6827), (1.959964, 0.95))  # half widths in standard errors, and what they contain
_DECAYS = 18.0  # relaxation times until a motion has settled
_SAMPLES = 257  # of a period

# The last state and the observable at a value of w, of the motion that is begun at a state.
Settled: TypeAlias = Callable[[float, NDArray[np.float64]], tuple[NDArray[np.float64], float]]


@dataclass(frozen=True)
class Case:
    """A system whose curve is measured."""

    name: str
    system: saltus.HybridSystem
    truth: dict[str, float]  # parameters that are sought
    bounds: dict[str, tuple[float, float]]
    observable: str
    sigma: float
    motion: Callable[[Mapping[str, float]], Settled]  # by SciPy at parameters
    places: Sequence[tuple[float, str]]  # values of w, and the way of each
    ends: tuple[float, float]  # of the branch
    jumps: bool = False
    start: float = 1.06  # of the search, over the true values

    def clean(self, **changes: float) -> NDArray[np.float64]:
        """Return the observable without noise at each place, each motion begun where the last one ended."""
        settled = self.motion(dict(self.system.parameters) | changes)
        state, seen, before = np.zeros(2), [], ""
        for w, way in self.places:
            state = state if way == before else np.zeros(2)
            state, value = settled(w, state)
            seen.append(value)
            before = way
        return np.array(seen)

    def fitted(self, clean: NDArray[np.float64], seed: int) -> saltus.Fit:
        """Return a fit to the data with noise."""
        noisy = clean + self.sigma * np.random.default_rng(seed).normal(size=len(clean))
        data: dict[str, Any] = {"w": [w for w, _ in self.places], self.observable: noisy}
        if any(way for _, way in self.places):
            data["direction"] = [way for _, way in self.places]
        there = {name: self.start * value for name, value in self.truth.items()}
        first = saltus.find_orbit(self.system, {"w": self.ends[0] + 0.02, **there}, [0.0, 0.0])
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", RuntimeWarning)
            return saltus.fit(
                data,
                saltus.continue_orbit(first, "w", self.ends),
                self.bounds,
                {self.observable: self.sigma},
                jumps=self.jumps,
                options=FitOptions(profile=()),
            )


def smoothly(force: Callable[[float, float], float], c: float, A: float, seen: str) -> Settled:
    """Return SciPy's settled motion of x'' = force(x) - c x' + A cos(w t), begun at a state."""

    def settled(w: float, state: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        period = 2.0 * np.pi / w

        def field(t: float, y: NDArray[np.float64]) -> list[float]:
            return [y[1], force(y[0], w) - c * y[1] + A * np.cos(w * t)]

        whole = int(np.ceil(2.0 * _DECAYS / c / period)) + 1
        given = {"method": "LSODA", "rtol": 1e-9, "atol": 1e-11, "max_step": period / 20.0}
        last = solve_ivp(field, (0.0, whole * period), state, **given).y[:, -1]
        times = np.linspace(0.0, period, _SAMPLES)
        x = solve_ivp(field, (0.0, period), last, t_eval=times, **given).y[0]
        return last, greatest(x) if seen == "max" else 2.0 * abs(np.mean(x[:-1] * np.exp(-1j * w * times[:-1])))

    return settled


def greatest(x: NDArray[np.float64]) -> float:
    """Return the greatest value of a sampled period, by the parabola through the three highest samples."""
    i = int(np.argmax(x[:-1]))
    before, here, after = x[:-1][i - 1], x[i], x[i + 1]
    bend = before - 2.0 * here + after
    return float(here - 0.125 * (after - before) ** 2 / bend)


def bounced(c: float, A: float, r: float, d: float) -> Settled:
    """Return SciPy's settled motion of x'' = -x - c x' + A cos(w t) before a wall at d, and minus its least x."""

    def settled(w: float, state: NDArray[np.float64]) -> tuple[NDArray[np.float64], float]:
        period = 2.0 * np.pi / w

        def field(t: float, y: NDArray[np.float64]) -> list[float]:
            return [y[1], -y[0] - c * y[1] + A * np.cos(w * t)]

        def wall(t: float, y: NDArray[np.float64]) -> float:
            return y[0] - d

        wall.terminal, wall.direction = True, 1.0  # type: ignore[attr-defined]
        whole = int(np.ceil(2.0 * _DECAYS / c / period)) + 1
        t, y, least, last = 0.0, np.array(state), np.inf, np.array(state)
        for k in range(whole + 1):
            last, least = y, np.inf
            while t < (k + 1) * period:
                run = solve_ivp(field, (t, (k + 1) * period), y, "DOP853", events=wall, rtol=1e-10, atol=1e-12,
                                dense_output=k == whole)  # fmt: skip
                if k == whole:
                    fine = run.sol(np.linspace(t, run.t[-1], 600))[0]
                    least = min(least, -greatest(-fine) if 0 < np.argmin(fine) < 599 else float(fine.min()))
                t, y = float(run.t[-1]), run.y[:, -1].copy()
                if run.status == 1:
                    y = np.array([d - 1e-14, -r * y[1]])
        return last, float(least)

    return settled


def both_ways(w: NDArray[np.float64]) -> list[tuple[float, str]]:
    """Return places on the ways up and down."""
    return [(float(v), "up") for v in w] + [(float(v), "down") for v in w[::-1]]


def spring_motion(p: Mapping[str, float]) -> Settled:
    """Return SciPy's motion of a driven oscillator with a cubic spring."""
    return smoothly(lambda x, _: -p["k"] * x - p["b"] * x**3, p["c"], p["A"], "amplitude")


def stop_motion(p: Mapping[str, float]) -> Settled:
    """Return SciPy's motion of a driven oscillator with a soft stop."""
    return smoothly(lambda x, _: -x - p["k2"] * max(x - p["d"], 0.0), p["c"], p["A"], "max")


def stopped(k2: float, c: float, A: float, d: float) -> saltus.HybridSystem:
    """Return an oscillator with a soft stop."""
    p = {"c": c, "k2": k2, "d": d, "w": 1.0, "A": A}
    return saltus.HybridSystem(
        ("x", "v"),
        p,
        {
            "free": saltus.Mode({"x": "v", "v": "-x - c*v + A*cos(s)"}),
            "touch": saltus.Mode({"x": "v", "v": "-x - c*v - k2*(x - d) + A*cos(s)"}),
        },
        [
            saltus.Transition("free", "touch", event="x - d", direction=1, name="in"),
            saltus.Transition("touch", "free", event="x - d", direction=-1, name="out"),
        ],
        phase=("s", "w"),
    )


def cases() -> Iterator[Case]:
    """Yield the systems."""
    text = "-c*v - k*x - b*x**3 + A*cos(s)"
    spring = saltus.HybridSystem.smooth(
        {"x": "v", "v": text}, {"k": 1.0, "c": 0.1, "b": 0.0, "w": 1.0, "A": 0.5}, phase=("s", "w")
    )
    yield Case(
        "linear", spring, {"k": 1.0, "c": 0.1, "A": 0.5}, {"k": (0.5, 2.0), "c": (0.02, 0.5), "A": (0.1, 2.0)},
        "amplitude(x, 1)", 0.05, spring_motion,
        [(w, "") for w in np.linspace(0.6, 1.5, 16).tolist()], (0.5, 1.6),
    )  # fmt: skip
    duffing = saltus.HybridSystem.smooth(
        {"x": "v", "v": text}, {"k": 1.0, "c": 0.1, "b": 1.0, "w": 1.0, "A": 0.5}, phase=("s", "w")
    )
    yield Case(
        "Duffing", duffing, {"k": 1.0, "c": 0.1, "b": 1.0}, {"k": (0.2, 3.0), "c": (0.01, 1.0), "b": (0.1, 5.0)},
        "amplitude(x, 1)", 0.05, spring_motion,
        both_ways(np.linspace(0.6, 2.5, 24)), (0.5, 2.6), jumps=True,
    )  # fmt: skip
    vary = {"c": (0.02, 0.6), "k2": (0.5, 20.0), "d": (0.2, 0.9)}
    yield Case(
        "soft stop", stopped(4.0, 0.15, 0.4, 0.5), {"c": 0.15, "k2": 4.0, "d": 0.5}, vary, "max(x)", 0.01, stop_motion,
        [(w, "") for w in [*np.linspace(0.3, 0.95, 12).tolist(), *np.linspace(1.9, 2.6, 6).tolist()]], (0.25, 2.7),
    )  # fmt: skip
    yield Case(
        "soft stop with hysteresis", stopped(4.0, 0.05, 0.1, 0.5),
        {"c": 0.05, "k2": 4.0, "d": 0.5}, vary | {"c": (0.01, 0.2)}, "max(x)",
        0.02, stop_motion, both_ways(np.linspace(0.72, 1.5, 16)), (0.65, 1.6),
    )  # fmt: skip
    impact = saltus.HybridSystem(
        ("x", "v"), {"c": 0.2, "w": 1.0, "A": 0.5, "r": 0.7, "d": 0.6},
        {"f": saltus.Mode({"x": "v", "v": "-x - c*v + A*cos(s)"})},
        [saltus.Transition("f", "f", "x - d", 1, reset={"v": "-r*v"}, name="hit")], phase=("s", "w"),
    )  # fmt: skip
    yield Case(
        "impacts", impact, {"c": 0.2, "r": 0.7, "d": 0.6}, {"c": (0.05, 0.6), "r": (0.3, 0.95), "d": (0.3, 1.0)},
        "min(x)", 0.02, lambda p: bounced(p["c"], p["A"], p["r"], p["d"]),
        [(w, "") for w in np.linspace(0.9, 1.8, 16).tolist()], (0.85, 1.9),
    )  # fmt: skip


def shares(fits: Sequence[saltus.Fit], name: str, true: float) -> tuple[list[int], int]:
    """Return in how many fits each interval of a parameter contains the true value, and how many are limited."""
    inside = [0] * len(LEVELS)
    for found in fits:
        low, high = found.intervals[name]
        for k, (width, _) in enumerate(LEVELS):
            value = found[name]
            inside[k] += value - width * (value - low) <= true <= value + width * (high - value)
    return inside, sum(name in found.limits for found in fits)


def verdict(case: Case, fits: Sequence[saltus.Fit], checks: int) -> list[str]:
    """Print coverage of a system's parameters; return in words what lies outside the binomial limits."""
    wrong, count = [], len(fits)
    for name, true in case.truth.items():
        inside, limited = shares(fits, name, true)
        told = []
        for k, (_, share) in enumerate(LEVELS):
            least, most = (int(binom.ppf(q, count, share)) for q in (0.5 * WRONG / checks, 1.0 - 0.5 * WRONG / checks))
            most = count if limited else most
            told.append(f"{100.0 * share:.0f} %: {inside[k]} of {count}, allowed {least} to {most}")
            if not least <= inside[k] <= most:
                wrong.append(f"{case.name}, {name}: {told[-1]}")
        pulls = np.array([(found[name] - true) / found.errors[name] for found in fits])
        print(
            f"  {name}: {'; '.join(told)}; limited {limited}; mean {pulls.mean():.2f}, rms {pulls.std():.2f}",
            flush=True,
        )
    return wrong


def main(sets: int = SETS, *only: str) -> int:
    """Print the coverage of each system; return 1 where one lies outside the binomial limits."""
    chosen = [case for case in cases() if not only or case.name in only]
    checks, wrong = sum(len(case.truth) for case in chosen) * len(LEVELS), []
    for case in chosen:
        clean, begun, fits, flagged = case.clean(), time.process_time(), [], 0
        for seed in range(sets):
            fits.append(case.fitted(clean, seed))
            flagged += bool(fits[-1].misfit)
        took = (time.process_time() - begun) / sets
        print(
            f"{case.name}: {sets} sets of {len(clean)} data, {took:.1f} s of a processor a fit, {flagged} misfits",
            flush=True,
        )
        wrong += verdict(case, fits, checks)
    print("\n".join(["outside the binomial limits:", *wrong]) if wrong else "all within the binomial limits")
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(*map(int, sys.argv[1:2]), *sys.argv[2:]))
