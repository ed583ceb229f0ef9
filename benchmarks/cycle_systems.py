"""Thirty smooth autonomous systems with cycles: from textbooks, with known normal forms, random near Hopf points."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

import saltus


@dataclass(frozen=True)
class CycleSystem:
    """A system, the branch of cycles to be followed, and where it is started.

    Attributes
    ----------
    name : str
        What it is called.
    field : dict of str to str
        Time derivative of each state.
    parameters : dict of str to float
        Defaults.
    varied : str
        The parameter that is continued.
    bounds : (float, float)
        Over which interval.
    starts : tuple of float
        Values of the parameter at which the branch is started, each with an attracting cycle on it.
    x0 : tuple of float
        A state that is attracted by it at all of them.
    exact : dict of str to tuple of float
        Special points in closed form by type; types not named are open.
    scatter : float
        By which share of itself `x0` is displaced at random for each start.
    """

    name: str
    field: dict[str, str]
    parameters: dict[str, float]
    varied: str
    bounds: tuple[float, float]
    starts: tuple[float, ...]
    x0: tuple[float, ...]
    exact: dict[str, tuple[float, ...]] = field(default_factory=dict)
    scatter: float = 0.1

    @cached_property
    def system(self) -> saltus.HybridSystem:
        """The system with one mode and no event."""
        return saltus.HybridSystem(
            tuple(self.field), self.parameters, {"flow": saltus.Mode(self.field)}, name=self.name
        )


def rotated_hopf(n: int, growth: str, seed: int, turning: float = 1.0) -> dict[str, str]:
    """Return the field r' = r growth, angle' = turning in a plane of n dimensions turned at random.

    `growth` is an expression in r2, the square of the radius. Across the plane all decays at the rates 1, 2, ...
    """
    rng = np.random.default_rng(seed)
    q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    names = [f"x{i + 1}" for i in range(n)]
    along = ["(" + " + ".join(f"({q[i, k]:.17g})*{names[i]}" for i in range(n)) + ")" for k in range(n)]
    g = "(" + growth.replace("r2", f"({along[0]}**2 + {along[1]}**2)") + ")"
    rates = [f"{g}*{along[0]} - {turning}*{along[1]}", f"{g}*{along[1]} + {turning}*{along[0]}"]
    rates += [f"-{k - 1}*{along[k]}" for k in range(2, n)]
    return {names[i]: " + ".join(f"({q[i, k]:.17g})*({rates[k]})" for k in range(n)) for i in range(n)}


def random_hopf(n: int, seed: int) -> CycleSystem:
    """Return a random field of degree three whose rest at 0 has the eigenvalues mu +- i w and stable ones."""
    rng = np.random.default_rng(seed)
    names = [f"x{i + 1}" for i in range(n)]
    q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    w = rng.uniform(0.8, 2.0)
    linear = np.diag([0.0, 0.0, *(-rng.uniform(0.5, 2.0, n - 2))])
    linear[0, 1], linear[1, 0] = -w, w
    a = q @ linear @ q.T
    along = q[:, :2] @ q[:, :2].T
    squares = rng.normal(0.0, 0.4, (n, n, n))
    r2 = " + ".join(f"{s}**2" for s in names)
    rates = {}
    for i in range(n):
        terms = [f"({a[i, j]:.6f} + ({along[i, j]:.6f})*mu)*{names[j]}" for j in range(n)]
        terms += [f"({squares[i, j, k]:.4f})*{names[j]}*{names[k]}" for j in range(n) for k in range(j, n)]
        rates[names[i]] = " + ".join([*terms, f"-1.5*{names[i]}*({r2})"])
    return CycleSystem(
        f"random, {n} states, seed {seed}", rates, {"mu": 0.1}, "mu", (-0.1, 0.4),
        (0.02, 0.07, 0.13, 0.2, 0.3), tuple(0.1 for _ in names),
    )  # fmt: skip


_TOR = {
    "x": "(-(0.5 + nu)*x + 0.5*y - 0.328578*x**3 + 0.933578*(y - x)**3)/0.6",
    "y": "0.5*x + 0.1*y - z - 0.933578*(y - x)**3",
    "z": "y",
}
_MORRIS_LECAR = {
    "v": "(i0 - 2*(v + 60) - 4.4*(1 + tanh((v + 1.2)/18))/2*(v - 120) - 8*u*(v + 84))/20",
    "u": "0.04*((1 + tanh((v - 2)/30))/2 - u)*cosh((v - 2)/60)",
}
_GOODWIN = {"x": "1/(1 + z**12) - k*x", "y": "x - k*y", "z": "y - k*z"}
_COUPLED = {
    "x": "1 - (b + 1)*x + x**2*y + d*(u - x)",
    "y": "b*x - x**2*y + 4*d*(v - y)",
    "u": "1 - (b + 1)*u + u**2*v + d*(x - u)",
    "v": "b*u - u**2*v + 4*d*(y - v)",
}
_SELKOV = tuple(float(np.sqrt(0.4 + s * np.sqrt(0.2) / 2.0)) for s in (-1.0, 1.0))

SYSTEMS = (
    CycleSystem("van der Pol", {"x": "y", "y": "(mu - x**2)*y - x"}, {"mu": 1.0}, "mu", (-0.5, 4.0),
                (0.05, 0.3, 1.0, 2.0, 3.5), (1.0, 0.2), {"HB": (0.0,), "SN": (), "PD": ()}),
    CycleSystem("Brusselator", {"x": "a - (b + 1)*x + x**2*y", "y": "b*x - x**2*y"}, {"a": 1.0, "b": 2.5}, "b",
                (1.5, 4.0), (2.05, 2.2, 2.5, 3.0, 3.8), (1.2, 2.0), {"HB": (2.0,), "SN": (), "PD": ()}),
    CycleSystem("Lorenz", {"x": "s*(y - x)", "y": "x*(r - z) - y", "z": "x*y - b*z"},
                {"s": 10.0, "r": 350.0, "b": 8 / 3}, "r", (305.0, 400.0), (320.0, 335.0, 350.0, 370.0, 390.0),
                (10.0, 40.0, 300.0)),
    CycleSystem("Roessler", {"x": "-y - z", "y": "x + a*y", "z": "b + z*(x - c)"}, {"a": 0.2, "b": 0.2, "c": 2.5},
                "c", (0.8, 3.6), (1.2, 1.6, 2.0, 2.4, 2.7), (1.0, 1.0, 0.1)),
    CycleSystem("Selkov", {"x": "-x + a*y + x**2*y", "y": "b - a*y - x**2*y"}, {"a": 0.1, "b": 0.6}, "b", (0.2, 1.0),
                (0.45, 0.5, 0.6, 0.7, 0.77), (0.8, 1.2), {"HB": _SELKOV, "PD": ()}),
    CycleSystem("FitzHugh-Nagumo", {"v": "v - v**3/3 - w + i0", "w": "e*(v + 0.7 - 0.8*w)"}, {"i0": 0.8, "e": 0.3},
                "i0", (0.0, 2.0), (0.7, 0.8, 0.9, 1.0, 1.1), (1.0, 0.0), {"PD": ()}),
    CycleSystem("Morris-Lecar", _MORRIS_LECAR, {"i0": 120.0}, "i0", (80.0, 230.0), (110.0, 125.0, 140.0, 160.0, 190.0),
                (0.0, 0.2), {"PD": ()}),
    CycleSystem("Lur'e", {"x": "y", "y": "z", "z": "-al*z - be*y - x + x**2"}, {"al": 0.9, "be": 1.0}, "al",
                (0.61, 1.2), (0.66, 0.7, 0.8, 0.9, 0.98), (0.1, 0.0, 0.0), {"HB": (1.0,), "SN": ()}),
    CycleSystem("torus oscillator", _TOR, {"nu": -0.6}, "nu", (-0.645, -0.55), (-0.603, -0.6015, -0.6, -0.598, -0.595),
                (0.1, 0.12, 0.1), scatter=0.0),
    CycleSystem("Chua, cubic", {"x": "al*(y - x**3 + 0.143*x)", "y": "x - y + z", "z": "-16*y"}, {"al": 8.0}, "al",
                (6.5, 9.6), (7.6, 7.8, 8.1, 8.5, 8.9), (0.4, 0.05, -0.4), {"SN": ()}),
    CycleSystem("Duffing-van der Pol", {"x": "y", "y": "x - x**3 + (mu - x**2)*y"}, {"mu": 1.2}, "mu", (0.7, 2.0),
                (0.8, 0.9, 1.1, 1.4, 1.8), (2.0, 0.5)),
    CycleSystem("Oregonator", {"x": "(x*(1 - x) - f*z*(x - q)/(x + q))/e", "z": "x - z"},
                {"f": 1.0, "q": 0.01, "e": 0.2}, "f", (0.5, 2.2), (0.8, 0.9, 1.0, 1.2, 1.5), (0.3, 0.2)),
    CycleSystem("Rosenzweig-MacArthur", {"x": "x*(1 - x/k) - x*y/(0.5 + x)", "y": "x*y/(0.5 + x) - 0.4*y"}, {"k": 1.5},
                "k", (0.6, 2.5), (1.2, 1.3, 1.5, 1.8, 2.2), (0.4, 0.5), {"HB": (0.5 * 1.4 / 0.6,), "SN": (), "PD": ()}),
    CycleSystem("Higgins", {"x": "1 - x*y", "y": "p*y*(x - (1 + q)/(q + y))"}, {"p": 2.5, "q": 1.0}, "p", (1.0, 4.0),
                (2.05, 2.2, 2.5, 2.9, 3.3), (1.1, 1.0), {"HB": (2.0,)}),
    CycleSystem("Goodwin", _GOODWIN, {"k": 0.4}, "k", (0.15, 1.0), (0.2, 0.3, 0.35, 0.4, 0.45), (0.5, 0.5, 1.0)),
    CycleSystem("repressilator", {"x": "a/(1 + z**4) - x", "y": "a/(1 + x**4) - y", "z": "a/(1 + y**4) - z"},
                {"a": 4.0}, "a", (1.2, 12.0), (2.3, 2.6, 3.0, 4.0, 6.0), (1.0, 1.4, 0.6), {"HB": (2.0,)}),
    CycleSystem("Colpitts", {"x": "g/0.7*(1 - exp(-y) + z)", "y": "g/0.7*z", "z": "-0.35/g*(x + y) - z/1.4"},
                {"g": 1.3}, "g", (0.8, 1.9), (1.03, 1.1, 1.2, 1.4, 1.6), (0.1, 0.1, 0.1), {"HB": (1.0,)}),
    CycleSystem("Hindmarsh-Rose", {"x": "y - x**3 + 3*x**2 - z + i0", "y": "1 - 5*x**2 - y",
                                   "z": "r*(4*(x + 1.6) - z)"},
                {"i0": 4.0, "r": 0.02}, "i0", (3.2, 7.0), (3.7, 4.0, 4.5, 5.0, 5.4), (0.5, 0.0, 3.5)),
    CycleSystem("Langford", {"x": "(z - 0.7)*x - 3.5*y", "y": "3.5*x + (z - 0.7)*y",
                             "z": "0.6 + a*z - z**3/3 - (x**2 + y**2)*(1 + 0.25*z) + 0.1*z*x**3"}, {"a": 0.4}, "a",
                (0.0, 0.9), (0.1, 0.2, 0.3, 0.4, 0.5), (0.5, 0.0, 0.7)),
    CycleSystem("Arneodo", {"x": "y", "y": "z", "z": "-z - 2*y + mu*x - x**3"}, {"mu": 1.3}, "mu", (0.8, 3.0),
                (1.05, 1.1, 1.2, 1.4, 1.6), (1.1, 0.05, 0.0), {"HB": (1.0,)}),
    CycleSystem("Hopf form, 3 states", rotated_hopf(3, "mu - r2", 1), {"mu": 0.3}, "mu", (-0.5, 1.5),
                (0.02, 0.1, 0.3, 0.7, 1.2), (0.2, 0.2, 0.2), {"HB": (0.0,), "SN": (), "PD": (), "TR": ()}),
    CycleSystem("Bautin form, 4 states", rotated_hopf(4, "mu + r2 - r2**2", 2), {"mu": 0.1}, "mu", (-0.5, 1.0),
                (-0.2, -0.1, 0.1, 0.4, 0.8), (0.8, 0.8, 0.8, 0.8), {"HB": (0.0,), "SN": (-0.25,), "PD": (), "TR": ()}),
    CycleSystem("Lorenz-84", {"x": "-y**2 - z**2 - 0.25*x + 0.25*f", "y": "x*y - 4*x*z - y + g",
                              "z": "4*x*y + x*z - z"},
                {"f": 1.6, "g": 0.2}, "f", (0.9, 2.2), (1.2, 1.25, 1.3, 1.35, 1.4), (1.0, 0.3, 0.1)),
    CycleSystem("Wilson-Cowan", {"u": "-u + 1/(1 + exp(-(10*u - 10*v + p)))",
                                 "v": "-v + 1/(1 + exp(-(10*u + 2*v - 4.0)))"},
                {"p": -0.5}, "p", (-3.0, 3.0), (-0.6, -0.3, 0.0, 0.2, 0.4), (0.3, 0.2)),
    CycleSystem("two Brusselators", _COUPLED, {"b": 2.3, "d": 0.05}, "b", (1.8, 2.6), (2.05, 2.1, 2.2, 2.3, 2.4),
                (1.2, 2.0, 0.8, 2.2)),
    *(random_hopf(n, seed) for n, seed in ((2, 11), (3, 12), (3, 13), (4, 14), (4, 15))),
)  # fmt: skip
"""All of them, in the order of the table."""
