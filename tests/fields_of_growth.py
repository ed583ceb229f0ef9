"""Random fields of growth, x' = x g(x) + supply: predators, chemostats, epidemics; and the same in logarithms."""

from __future__ import annotations

from dataclasses import dataclass, field as default

import numpy as np
from scipy.integrate import solve_ivp

from saltus import HybridSystem, Mode, Transition


@dataclass(frozen=True)
class Growth:
    """A field of growth: text of each state's rate over the state, its supply, starts, and a pulse.

    Names of states stand in brackets. A pulse multiplies the states by `kept` at each multiple of `every`.
    """

    rates: dict[str, str]
    start: tuple[float, ...]
    time: float
    every: float = 0.0
    kept: tuple[float, ...] = ()
    supply: dict[str, float] = default(default_factory=dict)

    def system(self, unit: float = 1.0) -> HybridSystem:
        """Return the system of the states in a unit."""
        names = {name: f"({name}*{1.0 / unit!r})" for name in self.rates}
        field = {}
        for name, rate in self.rates.items():
            for other, scaled in names.items():
                rate = rate.replace(f"[{other}]", scaled)
            field[name] = f"{name}*({rate})" + (f" + {self.supply[name] * unit!r}" if name in self.supply else "")
        states = tuple(field)
        if not self.every:
            return HybridSystem(states, {}, {"m": Mode(field)})
        reset = {name: f"{factor!r}*{name}" for name, factor in zip(states, self.kept, strict=True)}
        pulse = Transition("m", "m", at_phase=0, reset=reset, name="pulse")
        return HybridSystem(states, {"T": self.every}, {"m": Mode(field)}, [pulse], phase=("s", "2*pi/T"))

    def logarithms(self) -> np.ndarray:
        """Return the logarithms of the states at the end by SciPy; a pulse at the start has happened."""
        texts = [rate.replace("[", "").replace("]", "") for rate in self.rates.values()]
        codes = [compile(text, "rate", "eval") for text in texts]

        def field(_, y):
            values = dict(zip(self.rates, np.exp(y), strict=True)) | {"exp": np.exp}
            supply = [self.supply.get(name, 0.0) / values[name] for name in self.rates]
            return [eval(code, values) + own for code, own in zip(codes, supply, strict=True)]

        y, t = np.log(self.start), 0.0
        while t < self.time - 1e-9:
            end = min(t + self.every, self.time) if self.every else self.time
            y = y + (np.log(self.kept) if self.every else 0.0)
            y = solve_ivp(field, (t, end), y, method="LSODA", rtol=1e-12, atol=1e-12).y[:, -1]
            t = end
        return y


def growths(count: int, seed: int = 0) -> list[Growth]:
    """Return random fields of growth, of all kinds in turn, with and without pulses."""
    random = np.random.default_rng(seed)
    kinds = _lotka_volterra, _prey_and_predator, _chemostat, _epidemic
    return [kinds[i % 4](random, pulsed=i % 8 > 3) for i in range(count)]


def _pulses(random, states, pulsed):
    return (float(random.uniform(2.0, 6.0)), tuple(random.uniform(0.2, 1.0, states).tolist())) if pulsed else (0.0, ())


def _lotka_volterra(random, *, pulsed):
    """Three competitors in a cycle: motions stay near a face for longer and longer."""
    a, b = random.uniform(0.5, 0.9), random.uniform(1.3, 1.9)
    names = ("x", "y", "z")
    others = [(names[(i + 1) % 3], names[(i + 2) % 3]) for i in range(3)]
    rates = {x: f"1 - [{x}] - {a!r}*[{y}] - {b!r}*[{z}]" for x, (y, z) in zip(names, others, strict=True)}
    every, kept = _pulses(random, 3, pulsed)
    start = tuple(random.uniform(0.1, 0.6, 3).tolist())
    return Growth(rates, start, 12 * every if pulsed else 300.0, every, kept)


def _prey_and_predator(random, *, pulsed):
    K, h, m = random.uniform(8.0, 25.0), random.uniform(0.8, 1.2), random.uniform(0.2, 0.4)
    rates = {"N": f"0.8*(1 - [N]/{K!r}) - 2.5*[P]/([N] + {h!r})", "P": f"1.25*[N]/([N] + {h!r}) - {m!r}"}
    every, kept = _pulses(random, 2, pulsed)
    return Growth(rates, tuple(random.uniform(0.5, 2.0, 2).tolist()), 12 * every if pulsed else 250.0, every, kept)


def _chemostat(random, *, pulsed):
    """Substrate, a species and its predator."""
    D, k = random.uniform(0.05, 0.15), random.uniform(0.1, 0.4)
    rates = {
        "S": f"-{D!r} - [x]/({k!r} + [S])",
        "x": f"[S]/({k!r} + [S]) - {D!r} - 1.5*[y]/(0.3 + [x])",
        "y": f"1.2*[x]/(0.3 + [x]) - {D!r}*4",
    }
    every, kept = _pulses(random, 3, pulsed)
    return Growth(
        rates,
        (1.0, *random.uniform(0.05, 0.5, 2).tolist()),
        12 * every if pulsed else 120.0,
        every,
        kept,
        {"S": 8.0 * D},
    )


def _epidemic(random, *, pulsed):
    m, g, R = random.uniform(0.01, 0.05), random.uniform(10.0, 30.0), random.uniform(5.0, 15.0)
    rates = {"S": f"-{m!r} - {R * g!r}*[I]", "I": f"{R * g!r}*[S] - {g + m!r}"}
    every, kept = (float(random.uniform(0.5, 2.0)), (float(random.uniform(0.3, 0.9)), 1.0)) if pulsed else (0.0, ())
    return Growth(
        rates, (float(random.uniform(0.5, 0.99)), 1e-4), 12 * every if pulsed else 20.0, every, kept, {"S": m}
    )
