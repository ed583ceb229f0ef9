"""Closed networks of reactions by the law of mass action, and the same with species eliminated by hand."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import sympy
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, minimize_scalar, root

from saltus import HybridSystem

RATE = "k"  # the rate that branches run along


@dataclass(frozen=True)
class Network:
    """Reactions among species of any units; `reactions`: educts and products by species and number, and the rate."""

    species: tuple[str, ...]
    reactions: list[tuple[dict[str, int], dict[str, int], str]]
    start: np.ndarray  # amounts, in units of 1
    units: np.ndarray = field(default_factory=lambda: np.empty(0))  # size of each species' unit
    at: float = 1.0  # value of the rate

    @cached_property
    def stoichiometry(self) -> sympy.Matrix:
        """Net change of each species (row) by each reaction."""
        return sympy.Matrix([
            [products.get(s, 0) - educts.get(s, 0) for educts, products, _ in self.reactions] for s in self.species
        ])  # fmt: skip

    @property
    def scales(self) -> np.ndarray:
        return self.units if self.units.size else np.ones(len(self.species))

    @cached_property
    def laws(self) -> np.ndarray:
        """Conserved sums in units of 1, shape (law, species)."""
        null = self.stoichiometry.T.nullspace()
        return np.array([[float(e) for e in row] for row in null]).reshape(len(null), len(self.species))

    @cached_property
    def rates(self) -> list[sympy.Expr]:
        """Rates of the species in units of 1, as expressions of amounts and the rate."""
        flows = [
            sympy.sympify(rate) * sympy.prod([sympy.Symbol(s) ** m for s, m in educts.items()])
            for educts, _, rate in self.reactions
        ]
        return list(self.stoichiometry * sympy.Matrix(flows))

    @property
    def system(self) -> HybridSystem:
        """The network with all its species, in their units."""
        inside = {
            sympy.Symbol(s): sympy.Symbol(s) / sympy.Float(u, 17)
            for s, u in zip(self.species, self.scales, strict=True)
        }
        field_of = {
            s: f"{u!r}*({rate.subs(inside, simultaneous=True)})"
            for s, u, rate in zip(self.species, self.scales.tolist(), self.rates, strict=True)
        }
        return HybridSystem.smooth(field_of, {RATE: self.at})

    def near(self) -> np.ndarray:
        """Return amounts, in their units, some per cent beside an equilibrium with the totals of the start."""
        kept, rates, solved = self._eliminated
        symbols = [sympy.Symbol(s) for s in kept]
        given = [r.subs(sympy.Symbol(RATE), self.at) for r in rates]
        f, slope = sympy.lambdify([symbols], given), sympy.lambdify([symbols], sympy.Matrix(given).jacobian(symbols))
        y = self.start[[self.species.index(s) for s in kept]]
        span = (0.0, 30.0)
        y = solve_ivp(lambda t, y: f(y), span, y, method="LSODA", rtol=1e-9, atol=1e-12).y[:, -1]
        found = root(lambda y: np.array(f(y), dtype=float), y, jac=slope, method="lm", options={"xtol": 1e-13})
        y = found.x * (1.0 + 0.02 * np.cos(np.arange(y.size)))
        values = dict(zip(symbols, y, strict=True))
        out = {str(s): float(e.subs(values)) for s, e in solved.items()} | {str(s): v for s, v in values.items()}
        return np.array([out[s] for s in self.species]) * self.scales

    def totals(self, x: np.ndarray) -> np.ndarray:
        """Return the conserved sums, over the sizes of their terms at the start, of amounts in their units."""
        return (self.laws @ (x / self.scales)) / (np.abs(self.laws) @ self.start)

    @cached_property
    def _eliminated(self) -> tuple[list[str], list[sympy.Expr], dict[sympy.Symbol, sympy.Expr]]:
        names = [sympy.Symbol(s) for s in self.species]
        totals = self.laws @ self.start
        equations = [
            sum(sympy.nsimplify(c) * s for c, s in zip(row, names, strict=True)) - sympy.Float(total, 17)
            for row, total in zip(self.laws, totals, strict=True)
        ]
        reduced = sympy.Matrix([[sympy.nsimplify(c) for c in row] for row in self.laws]).rref()[1]
        out = [names[i] for i in reduced]
        solved = sympy.solve(equations, out, dict=True)[0]
        kept = [s for s in names if s not in out]
        return [str(s) for s in kept], [self.rates[names.index(s)].subs(solved) for s in kept], solved

    @property
    def reduced(self) -> HybridSystem:
        """The network with as many species eliminated as it has conserved sums, in units of 1."""
        kept, rates, _ = self._eliminated
        return HybridSystem.smooth(dict(zip(kept, map(str, rates), strict=True)), {RATE: self.at})

    def kept(self, x: np.ndarray) -> np.ndarray:
        """Return the amounts of the species that are left, in units of 1, of those of all in their units."""
        return (x / self.scales)[[self.species.index(s) for s in self._eliminated[0]]]

    def by_scipy(self, x: np.ndarray, value: float) -> tuple[np.ndarray, np.ndarray]:
        """Return the equilibrium near amounts, in units of 1, and its eigenvalues, by MINPACK and NumPy."""
        kept, rates, _ = self._eliminated
        symbols = [sympy.Symbol(s) for s in kept]
        at = {sympy.Symbol(RATE): value}
        given = [r.subs(at) for r in rates]
        f = sympy.lambdify([symbols], given)
        slope = sympy.lambdify([symbols], sympy.Matrix(given).jacobian(symbols))
        y = root(lambda y: np.array(f(y), dtype=float), self.kept(x), jac=slope, options={"xtol": 1e-14}).x
        return y, np.linalg.eigvals(np.array(slope(y), dtype=float))

    def critical(self, start: np.ndarray, grid: np.ndarray, along: str) -> list[tuple[str, float]]:
        """Return the folds and Hopf points along a grid of a species' amount or the rate: (type, rate), by SciPy.

        Along the equilibria the determinant of the Jacobian changes its sign at a fold, and that of Hurwitz where two
        eigenvalues are opposite; they are a pair on the imaginary axis at a Hopf point. All of the species left.
        """
        kept, rates, _ = self._eliminated
        names = [sympy.Symbol(s) for s in kept]
        rate = sympy.Symbol(RATE)
        f = sympy.lambdify([[*names, rate]], rates)
        slope = sympy.lambdify([[*names, rate]], sympy.Matrix(rates).jacobian(names))
        whole = sympy.lambdify([[*names, rate]], sympy.Matrix(rates).jacobian([*names, rate]))
        place = len(kept) if along == RATE else kept.index(along)
        rest = [i for i in range(len(kept) + 1) if i != place]

        def solved(value: float, near: np.ndarray) -> np.ndarray:
            def whole_of(z: np.ndarray) -> np.ndarray:
                return np.insert(z, place, value)

            found = root(
                lambda z: np.array(f(whole_of(z)), dtype=float), np.delete(near, place),
                jac=lambda z: np.array(whole(whole_of(z)), dtype=float)[:, rest], options={"xtol": 1e-14},
            )  # fmt: skip
            return whole_of(found.x)

        def tests(y: np.ndarray) -> tuple[float, float]:
            J = np.array(slope(y), dtype=float)
            a = np.real(np.poly(J))
            n = len(a) - 1
            hurwitz = [[a[2 * j - i] if 0 <= 2 * j - i <= n else 0.0 for j in range(1, n)] for i in range(1, n)]
            return float(np.linalg.det(J)), float(np.linalg.det(np.array(hurwitz))) if n > 1 else 1.0

        ys = [solved(grid[0], np.append(self.kept(start), self.at))]
        for value in grid[1:].tolist():
            ys.append(solved(value, ys[-1]))
        found = []
        for kind, which in (("SN", 0), ("HB", 1)):
            for low, high, y in _brackets(grid, ys, lambda y, k=which: tests(y)[k], solved):
                there = solved(
                    brentq(lambda v, k=which, y=y: tests(solved(v, y))[k], low, high, xtol=1e-13, rtol=1e-14), y
                )
                values = np.linalg.eigvals(np.array(slope(there), dtype=float))
                if kind == "SN" or np.abs(values[np.argsort(np.abs(values.real))[:2]].imag).min() > 1e-4:
                    found.append((kind, float(there[-1])))
        return found


def _brackets(
    grid: np.ndarray, ys: list[np.ndarray], test: Callable[[np.ndarray], float], solved: Callable[..., np.ndarray]
) -> Iterator[tuple[float, float, np.ndarray]]:
    """Yield where a test function changes its sign, twice beside a minimum of its modulus too, and a guess there."""
    values = np.array([test(y) for y in ys])
    for i in range(1, len(grid)):
        if values[i - 1] * values[i] < 0.0:
            yield grid[i - 1], grid[i], ys[i]
    for i in range(1, len(grid) - 1):
        sign, near = np.sign(values[i]), np.abs(values[i - 1 : i + 2])
        if np.all(sign * values[i - 1 : i + 2] > 0.0) and near[1] == near.min():
            least = minimize_scalar(
                lambda v, i=i, sign=sign: sign * test(solved(v, ys[i])), bounds=sorted((grid[i - 1], grid[i + 1])),
                method="bounded", options={"xatol": 1e-9 * abs(grid[i])},
            )  # fmt: skip
            if least.fun < 0.0:
                yield grid[i - 1], least.x, ys[i]
                yield least.x, grid[i + 1], ys[i]


def _rate(rng: np.random.Generator) -> str:
    return f"{10 ** rng.uniform(-0.7, 0.7):.4g}"


def reversible(seed: int) -> Network:
    """Return random reversible bindings and turns of 3 to 8 species, the first of which turns at the rate `RATE`."""
    rng = np.random.default_rng(seed)
    n, laws = int(rng.integers(3, 9)), int(rng.integers(1, 4))
    laws = min(laws, n - 1)
    # species made of elements, as many as there are sums: what is made of the same turns into each other
    made = [tuple(int(i == j) for j in range(laws)) for i in range(laws)]
    while len(made) < n:
        one, other = (made[i] for i in rng.integers(0, len(made), 2))
        both = tuple(a + b for a, b in zip(one, other, strict=True))
        made.append(both if sum(both) <= 3 and rng.random() < 0.6 else one)
    names = tuple(f"S{i}" for i in range(n))
    reactions: list[tuple[dict[str, int], dict[str, int], str]] = []
    for i in range(laws, n):
        pairs = [(a, b) for a in range(i) for b in range(a, i)
                 if tuple(x + y for x, y in zip(made[a], made[b], strict=True)) == made[i]]  # fmt: skip
        same = [a for a in range(i) if made[a] == made[i]]
        if pairs and (not same or rng.random() < 0.5):
            a, b = pairs[int(rng.integers(len(pairs)))]
            educts = {names[a]: 2} if a == b else {names[a]: 1, names[b]: 1}
        else:
            educts = {names[same[int(rng.integers(len(same)))]]: 1}
        there, back = _rate(rng), _rate(rng)
        reactions += [(educts, {names[i]: 1}, RATE if i == laws else there), ({names[i]: 1}, educts, back)]
    return Network(names, reactions, rng.uniform(0.3, 2.0, n), _units(rng, n))


def bistable(seed: int) -> Network:
    """Return an enzyme that makes itself from a store, its binding to others, and what these turn into."""
    rng = np.random.default_rng(seed)
    names, start = ["A", "X"], [float(rng.uniform(3.0, 5.0)), 0.1]
    reactions: list[tuple[dict[str, int], dict[str, int], str]] = [
        ({"A": 1, "X": 2}, {"X": 3}, f"{rng.uniform(0.8, 1.2):.4g}"),
        ({"X": 1}, {"A": 1}, RATE),
        ({"A": 1}, {"X": 1}, f"{rng.uniform(0.02, 0.06):.4g}"),
    ]
    for i in range(int(rng.integers(0, 3))):  # further partners, each with a sum of its own
        names += [f"B{i}", f"C{i}"]
        start += [float(rng.uniform(0.1, 0.3)), 0.0]
        reactions += [
            ({"X": 1, f"B{i}": 1}, {f"C{i}": 1}, _rate(rng)),
            ({f"C{i}": 1}, {"X": 1, f"B{i}": 1}, _rate(rng)),
        ]
    if rng.random() < 0.5:
        names.append("D")
        start.append(0.1)
        reactions += [({"A": 1}, {"D": 1}, _rate(rng)), ({"D": 1}, {"A": 1}, "1.3")]
    return Network(tuple(names), reactions, np.array(start), _units(rng, len(names)), 2.0)


def oscillating(seed: int) -> Network:
    """Return a ring whose species speed up each other's turns: its common equilibrium has Hopf points."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(3, 6))
    names = [f"X{i}" for i in range(n)]
    strong = float(rng.uniform(0.8, 1.5))
    reactions: list[tuple[dict[str, int], dict[str, int], str]] = []
    for i in range(n):
        one, after = names[i], names[(i + 1) % n]
        spread = float(rng.uniform(0.95, 1.05))
        reactions += [({one: 1}, {after: 1}, RATE), ({one: 1, after: 2}, {after: 3}, f"{strong * spread:.6g}")]
    start = [1.0] * n
    for i in range(int(rng.integers(0, 3))):
        names += [f"B{i}", f"C{i}"]
        start += [float(rng.uniform(0.5, 1.0)), 0.2]
        reactions += [
            ({names[i]: 1, f"B{i}": 1}, {f"C{i}": 1}, _rate(rng)),
            ({f"C{i}": 1}, {names[i]: 1, f"B{i}": 1}, "2"),
        ]
    return Network(tuple(names), reactions, np.array(start), _units(rng, len(names)), 1.0)


def _units(rng: np.random.Generator, n: int) -> np.ndarray:
    """Units of 1 for two networks of three, else of 1e-9 and 1e9 for some species."""
    if rng.random() < 0.5:
        return np.ones(n)
    return np.array([1e-9, 1.0, 1e9])[rng.integers(0, 3, n)]


KINDS = {"reversible": reversible, "bistable": bistable, "oscillating": oscillating}
EVERY = [*(("reversible", s) for s in range(20)), *(("bistable", s) for s in range(15)),
         *(("oscillating", s) for s in range(15))]  # fmt: skip
