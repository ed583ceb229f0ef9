"""Random smooth fields with a stable cycle, planar and in three dimensions; the cycle is found by SciPy's settling."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
import sympy
from scipy.integrate import solve_ivp

from saltus import HybridSystem

Draw = np.random.Generator
SETTLED = 60  # rounds that a motion has to settle
ALIKE = 1e-7  # of the last rounds, relative


@dataclass(frozen=True)
class Field:
    """Texts of the rates, the parameter with its value and interval, and a start of a motion."""

    kind: str
    rates: dict[str, str]
    parameter: str
    value: float
    bounds: tuple[float, float]
    start: tuple[float, ...]
    least: float = 1e-12  # absolute tolerance of SciPy, below all that matters

    @property
    def system(self) -> HybridSystem:
        return HybridSystem.smooth(self.rates, {self.parameter: self.value})

    @cached_property
    def _functions(self) -> Callable[..., list[float]]:
        states = sympy.symbols(list(self.rates))
        names = {name: sympy.Symbol(name) for name in [*self.rates, self.parameter]}
        texts = [sympy.sympify(text, locals=names) for text in self.rates.values()]
        divergence = sum(sympy.diff(text, x) for text, x in zip(texts, states, strict=True))
        return sympy.lambdify([*states, names[self.parameter]], [*texts, divergence], cse=True)

    def motion(self, x0, period: float, value: float):
        """Return the motion of a duration, with the integral of the divergence as its last component."""
        function = self._functions
        return solve_ivp(
            lambda _, y: function(*y[:-1], value), (0.0, period), [*x0, 0.0], method="LSODA", rtol=1e-11,
            atol=self.least, dense_output=True,
        )  # fmt: skip

    def settled(self, value: float) -> tuple[np.ndarray, float] | None:
        """Return a point of the cycle that the motion settles on, and its period; None where there is no cycle."""
        function, x, longest = self._functions, np.array(self.start), 50.0
        with np.errstate(all="ignore"):
            for _ in range(4):
                run = solve_ivp(
                    lambda _, y: function(*y, value)[:-1], (0.0, longest), x, method="LSODA", rtol=1e-10,
                    atol=self.least,
                )  # fmt: skip
                if not run.success or not np.all(np.isfinite(run.y)) or np.abs(run.y).max() > 1e6:
                    return None
                late = run.y[:, run.t > longest / 2]
                middle = (late[0].max() + late[0].min()) / 2.0
                if np.ptp(late[0]) < 1e-3 * np.abs(late[0]).max():
                    return None

                def crosses(_, y, middle=middle):
                    return y[0] - middle

                crosses.direction = 1.0  # type: ignore[attr-defined]
                ways = {"method": "LSODA", "rtol": 1e-11, "atol": self.least, "events": crosses}
                run = solve_ivp(lambda _, y: function(*y, value)[:-1], (0.0, 4.0 * longest), run.y[:, -1], **ways)
                times, places = run.t_events[0], run.y_events[0]
                if len(times) > 12:
                    gaps, size = np.diff(times[-6:]), np.ptp(run.y, axis=1).max()
                    same = np.ptp(gaps) < ALIKE * gaps[-1] and np.ptp(places[-6:], axis=0).max() < ALIKE * size
                    if same:
                        return places[-1], float(gaps[-1])
                x, longest = run.y[:, -1], 3.0 * longest
        return None


def _reactor(draw: Draw) -> Field:
    """Uppal, Ray and Poore 1974."""
    heat, cooling = draw.uniform(12.0, 16.0), draw.uniform(1.6, 2.4)
    rate = "Da*(1 - x)*exp(y/(1 + y/20))"
    rates = {"x": f"-x + {rate}", "y": f"-y + {heat!r}*{rate} - {cooling!r}*y"}
    return Field("reactor", rates, "Da", draw.uniform(0.1, 0.17), (0.02, 0.5), (0.4, 2.0))


def _schnakenberg(draw: Draw) -> Field:
    a = draw.uniform(0.03, 0.12)
    rates = {"x": f"{a!r} - x + x**2*y", "y": "b - x**2*y"}
    return Field("Schnakenberg", rates, "b", draw.uniform(0.3, 0.7), (0.1, 1.5), (0.6, 1.5))


def _bazykin(draw: Draw) -> Field:
    alpha, gamma, crowd, d = draw.uniform(0.2, 0.5), draw.uniform(0.5, 1.2), *draw.uniform(0.005, 0.05, 2).tolist()
    rates = {
        "x": f"x*(1 - y/(1 + a*x) - {crowd!r}*x)",
        "y": f"y*(x/(1 + a*x) - {gamma!r} - {d!r}*y)",
    }
    return Field("Bazykin", rates, "a", alpha, (0.05, 1.0), (2.0, 1.0), 1e-30)


def _hunters(draw: Draw) -> Field:
    """Rosenzweig and MacArthur, with any shares."""
    h, m, e = draw.uniform(0.2, 0.5), draw.uniform(0.2, 0.45), draw.uniform(0.7, 1.2)
    rates = {"x": f"x*(1 - x/K) - x*y/({h!r} + x)", "y": f"{e!r}*x*y/({h!r} + x) - {m!r}*y"}
    return Field("predator and prey", rates, "K", draw.uniform(0.8, 2.0), (0.3, 2.5), (0.5, 0.3), 1e-30)


def _nerve(draw: Draw) -> Field:
    slow, a, b = draw.uniform(0.08, 0.4), draw.uniform(0.6, 0.9), draw.uniform(0.5, 0.9)
    rates = {"v": "v - v**3/3 - w + i0", "w": f"{slow!r}*(v + {a!r} - {b!r}*w)"}
    return Field("FitzHugh and Nagumo", rates, "i0", draw.uniform(0.5, 1.1), (0.0, 2.2), (1.0, 0.0))


def _membrane(draw: Draw) -> Field:
    """Morris and Lecar, in mV and ms."""
    g, v3, phi = draw.uniform(4.0, 4.8), draw.uniform(1.0, 4.0), draw.uniform(0.03, 0.06)
    rates = {
        "V": f"(i0 - 2*(V + 60) - {g!r}*0.5*(1 + tanh((V + 1.2)/18))*(V - 120) - 8*w*(V + 84))/20",
        "w": f"{phi!r}*(0.5*(1 + tanh((V - {v3!r})/30)) - w)*cosh((V - {v3!r})/60)",
    }
    return Field("Morris and Lecar", rates, "i0", draw.uniform(100.0, 160.0), (60.0, 260.0), (10.0, 0.2))


def _circuit(draw: Draw) -> Field:
    """A negative resistance with a bias, whose characteristic is a cubic or a tanh."""
    r, c, square = draw.uniform(0.1, 0.6), draw.uniform(0.3, 2.0), draw.uniform(-0.3, 0.3)
    bend = ["x**3/3", "0.8*x**3", "x**3/3 + 0.02*x**5"][draw.integers(3)]
    rates = {"x": f"{c!r}*(m*x + {square!r}*x**2 - {bend} - y)", "y": f"(x - {r!r}*y)/{c!r}"}
    return Field("circuit", rates, "m", draw.uniform(0.8, 1.5), (0.05, 2.2), (0.5, 0.0))


def _chua(draw: Draw) -> Field:
    """Chua's circuit with a cubic and a bias."""
    beta, bias = draw.uniform(14.0, 18.0), draw.uniform(-0.02, 0.02)
    rates = {"x": f"al*(y - 0.063*x**3 + 0.167*x + {bias!r})", "y": "x - y + z", "z": f"-{beta!r}*y"}
    return Field("Chua", rates, "al", draw.uniform(6.0, 8.0), (4.0, 9.0), (1.0, 0.1, -1.0))


def _polynomial(draw: Draw) -> Field:
    """A Hopf normal form under random terms of second and third order."""
    terms = ["x**2", "x*y", "y**2", "x**3", "x**2*y", "x*y**2", "y**3"]
    rest = [
        " + ".join(f"{c!r}*{t}" for c, t in zip(draw.uniform(-0.5, 0.5, 7).tolist(), terms, strict=True)) for _ in "xy"
    ]
    rates = {"x": f"m*x - y - x*(x**2 + y**2) + {rest[0]}", "y": f"x + m*y - y*(x**2 + y**2) + {rest[1]}"}
    return Field("polynomial", rates, "m", draw.uniform(0.1, 0.6), (-0.5, 1.2), (0.1, 0.0))


def _polynomial_3d(draw: Draw) -> Field:
    """The same that drives a third state and is driven by it."""
    a, b, c, e = draw.uniform(-0.6, 0.6, 4).tolist()
    decay = draw.uniform(0.3, 3.0)
    rates = {
        "x": f"m*x - y - x*(x**2 + y**2) + {a!r}*x*z",
        "y": f"x + m*y - y*(x**2 + y**2) + {b!r}*z",
        "z": f"-{decay!r}*z + {c!r}*x**2 + {e!r}*y - z**3",
    }
    return Field("polynomial in space", rates, "m", draw.uniform(0.1, 0.6), (-0.5, 1.2), (0.1, 0.0, 0.0))


def _repressors(draw: Draw) -> Field:
    """Three genes that repress each other in a ring, with unlike decays."""
    n, d = draw.integers(3, 7), draw.uniform(0.7, 1.4, 3).tolist()
    rates = {x: f"g/(1 + {z}**{n}) + 0.01 - {k!r}*{x}" for x, z, k in zip("xyz", "zxy", d, strict=True)}
    return Field("repressors", rates, "g", draw.uniform(6.0, 20.0), (1.0, 40.0), (1.0, 1.2, 0.6))


def _rossler(draw: Draw) -> Field:
    a, b = draw.uniform(0.1, 0.25), draw.uniform(0.15, 1.0)
    rates = {"x": "-y - z", "y": f"x + {a!r}*y", "z": f"{b!r} + z*(x - c)"}
    return Field("Roessler", rates, "c", draw.uniform(1.2, 2.6), (1.0, 4.0), (1.0, 1.0, 0.1))


def _iodine(draw: Draw) -> Field:
    """Lengyel and Epstein 1991."""
    a, c = draw.uniform(9.0, 14.0), draw.uniform(0.0, 0.02)
    rates = {"x": f"{a!r} - x - 4*x*y/(1 + x**2)", "y": f"b*(x - x*y/(1 + x**2)) + {c!r}*x"}
    return Field("Lengyel and Epstein", rates, "b", draw.uniform(1.0, 3.0), (0.3, 6.0), (1.0, 3.0))


KINDS = (
    _reactor, _schnakenberg, _bazykin, _hunters, _nerve, _membrane, _circuit, _chua, _polynomial, _polynomial_3d,
    _repressors, _rossler, _iodine,
)  # fmt: skip


@cache
def field_with_cycle(seed: int) -> tuple[Field, np.ndarray, float]:
    """Return a random field, a point of its cycle and the period: the first of those drawn that has a cycle."""
    draw = np.random.default_rng(seed)
    while True:
        field = KINDS[seed % len(KINDS)](draw)
        if (cycle := field.settled(field.value)) is not None:
            return field, *cycle
