"""Thirty branches of smooth autonomous cycles: do five starts and three sizes of steps find the same special points?

Each branch is continued from five values of its parameter, each cycle found from a state of its own, with steps of at
most 0.05, 0.1 and 0.2. All must have the same special points, to 1e-8 in the parameter, and the same ends. SciPy's
DOP853 integrates field and variational equations, from the texts, at 1e-12 along each orbit: a special point whose
multipliers it does not confirm is false, a change of stability between two special points is one that is missing.
Points `HB` are compared with equilibria whose Jacobian has imaginary eigenvalues.
"""

from __future__ import annotations

import argparse
import math
import sys
import time
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
import sympy
from cycle_systems import SYSTEMS, CycleSystem
from measure import machine
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import fsolve

import saltus

LARGEST = (0.05, 0.1, 0.2)  # `StepControl.largest` of the three runs from each start
SAME = 1e-8  # difference of a special point's parameter between runs, relative to 1 or to its size
HOPF = 1e-9  # the same against an exact Hopf point
EDGE = 1e-6  # special points nearer to a bound than this share of the interval may be there or not
TOLERANCE = 1e-12  # relative tolerance of SciPy's steps
LOOKED_AT = 6  # orbits of a branch whose multipliers are compared with SciPy's
STIFF = 1e6  # a monodromy matrix larger than this has no digits left to compare by shooting once round
GOOD = ("bound reached", "the cycle shrinks to an equilibrium", "the branch is closed")  # ends that need no look
FALSE = 1e-5  # farthest that SciPy's multiplier may lie from its place at an SN, PD or TR


@dataclass(frozen=True)
class Trouble:
    """What is wrong, where."""

    system: str
    start: float
    largest: float
    what: str

    def __str__(self) -> str:
        return f"{self.system}, start {self.start:g}, steps up to {self.largest:g}: {self.what}"


@dataclass
class Row:
    """A line of the table.

    Attributes
    ----------
    name : str
        The system.
    points : str
        Special points of the first run.
    spread : float
        Largest difference of a special point between two runs.
    false : float
        Largest distance of SciPy's multiplier from its place at a special point.
    apart : float
        Largest difference of multipliers from SciPy's, relative to the size of the monodromy matrix.
    hopf : float
        Largest difference of an HB from the exact Hopf point.
    """

    name: str
    points: str = ""
    spread: float = 0.0
    false: float = 0.0
    apart: float = 0.0
    hopf: float = 0.0
    runs: int = 0
    seconds: float = 0.0
    ends: Counter[str] = field(default_factory=Counter)
    troubles: list[Trouble] = field(default_factory=list)


class Reference:
    """Field and Jacobian of a system as functions of state and parameters, made by SymPy from its texts."""

    def __init__(self, described: CycleSystem) -> None:
        names = list(described.field)
        symbols = {name: sympy.Symbol(name) for name in (*names, *described.parameters)}
        rates = sympy.Matrix([sympy.sympify(described.field[name], locals=symbols) for name in names])
        arguments = [[symbols[n] for n in names], [symbols[n] for n in described.parameters]]
        jacobian = rates.jacobian(arguments[0])
        self.names = list(described.parameters)
        self._f: Callable[..., NDArray[np.float64]] = sympy.lambdify(arguments, rates, "numpy", cse=True)
        self._j: Callable[..., NDArray[np.float64]] = sympy.lambdify(arguments, jacobian, "numpy", cse=True)

    def rate(self, x: NDArray[np.float64], p: list[float]) -> NDArray[np.float64]:
        """Return the field at a state."""
        return np.asarray(self._f(x, p), dtype=float).ravel()

    def jacobian(self, x: NDArray[np.float64], p: list[float]) -> NDArray[np.float64]:
        """Return its derivative."""
        return np.asarray(self._j(x, p), dtype=float)

    def once_round(
        self, x: NDArray[np.float64], period: float, p: list[float]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Return the state after a period, and its derivative in the state at the start."""
        n = x.size

        def both(_: float, y: NDArray[np.float64]) -> NDArray[np.float64]:
            return np.concatenate([self.rate(y[:n], p), (self.jacobian(y[:n], p) @ y[n:].reshape(n, n)).ravel()])

        start = np.concatenate([x, np.eye(n).ravel()])
        atol = TOLERANCE * np.concatenate([np.full(n, float(np.max(np.abs(x)))), np.full(n * n, 0.1)])
        end = solve_ivp(both, (0.0, period), start, method="DOP853", rtol=TOLERANCE, atol=atol).y[:, -1]
        return end[:n], end[n:].reshape(n, n)

    def corrected(self, orbit: saltus.results.PeriodicOrbit) -> tuple[float, NDArray[np.float64], float, float]:
        """Return the gap of an orbit, then, after Newton's steps, its nontrivial multipliers, size and period."""
        p = [orbit.parameters[name] for name in self.names]
        x, period = np.array(orbit.states[0], dtype=float), orbit.period
        f0 = self.rate(x, p)
        first = math.nan
        for _ in range(3):
            end, m = self.once_round(x, period, p)
            gap = float(np.max(np.abs(end - x)))
            first = gap if math.isnan(first) else first
            if gap < 1e-11 * max(1.0, float(np.max(np.abs(x)))) or np.max(np.abs(m)) > STIFF:
                break
            matrix = np.block([[m - np.eye(x.size), self.rate(end, p)[:, None]], [f0[None, :], np.zeros((1, 1))]])
            # at a fold the matrix is singular, and the least change that closes the orbit is taken
            step = np.linalg.lstsq(matrix, np.append(x - end, 0.0), rcond=1e-7)[0]
            x, period = x + step[:-1], period + step[-1]
        f = self.rate(x, p)
        across = np.linalg.svd(f[None, :])[2][1:].T  # orthonormal, across the motion
        poincare = across.T @ (np.eye(x.size) - np.outer(f, f) / (f @ f)) @ m @ across
        return first, np.linalg.eigvals(poincare), float(np.max(np.abs(m))), period

    def hopf(self, point: saltus.results.SpecialPoint, varied: str) -> float:
        """Return the parameter at which the equilibrium near a point has imaginary eigenvalues, NaN where none has."""
        n, at = point.orbit.states.shape[1], self.names.index(varied)
        p = [point.orbit.parameters[name] for name in self.names]
        turning = 2.0 * math.pi / point.orbit.period

        def equations(u: NDArray[np.float64]) -> NDArray[np.float64]:
            q = [*p[:at], float(u[-1]), *p[at + 1 :]]
            eigenvalues = np.linalg.eigvals(self.jacobian(u[:n], q))
            return np.append(self.rate(u[:n], q), eigenvalues[np.argmin(np.abs(eigenvalues - 1j * turning))].real)

        found, _, good, _ = fsolve(equations, np.append(point.orbit.states[0], p[at]), xtol=1e-14, full_output=True)
        left = float(np.max(np.abs(equations(found))))
        return float(found[-1]) if good == 1 or left < 1e-11 else math.nan


def distance(kind: str, multipliers: NDArray[np.complex128]) -> float:
    """Return how far the nearest multiplier is from where one must be at a special point."""
    if kind == "TR":
        bent = multipliers[np.abs(multipliers.imag) > 1e-9]
        return float(np.min(np.abs(np.abs(bent) - 1.0))) if bent.size else math.inf
    return float(np.min(np.abs(multipliers - {"SN": 1.0, "BP": 1.0, "PD": -1.0}[kind])))


class Examination:
    """All runs of one system."""

    def __init__(self, described: CycleSystem) -> None:
        self.described, self.reference = described, Reference(described)
        self.row = Row(described.name)
        self.confirmed: list[tuple[str, float]] = []
        self.first: list[tuple[str, float]] | None = None
        self.first_ends: list[str] = []

    def all(self, starts: int, largest: tuple[float, ...]) -> Row:
        """Return the line of the table."""
        begin = time.perf_counter()
        for number, value in enumerate(self.described.starts[:starts]):
            try:
                orbit = self._start(number, value)
            except saltus.SaltusError as error:
                self._note(value, 0.0, f"find_orbit: {error}")
                continue
            for size in largest:
                try:
                    self._branch(orbit, value, size)
                except saltus.SaltusError as error:
                    self._note(value, size, f"continue_orbit: {error}")
        self.row.seconds = time.perf_counter() - begin
        return self.row

    def _note(self, start: float, size: float, what: str) -> None:
        self.row.troubles.append(Trouble(self.described.name, start, size, what))

    def _start(self, number: int, value: float) -> saltus.results.PeriodicOrbit:
        """Return the cycle at a start, from a state of its own; note where it is not once round."""
        d = self.described
        x0 = np.array(d.x0) * (1.0 + d.scatter * np.random.default_rng(number).uniform(-1.0, 1.0, len(d.x0)))
        orbit = saltus.find_orbit(d.system, {d.varied: value}, x0)
        p = [orbit.parameters[name] for name in self.reference.names]
        for rounds in range(2, 8):
            end, _ = self.reference.once_round(np.array(orbit.states[0]), orbit.period / rounds, p)
            size = float(np.max([orbit.max[s] - orbit.min[s] for s in d.system.states]))
            if np.max(np.abs(end - orbit.states[0])) < 1e-6 * size:
                self._note(value, 0.0, f"find_orbit: {rounds} times round, T = {orbit.period:.9g}")
                break
        return orbit

    def _branch(self, orbit: saltus.results.PeriodicOrbit, start: float, size: float) -> None:
        d = self.described
        branch = saltus.continue_orbit(orbit, d.varied, d.bounds, steps=saltus.StepControl(largest=size))
        self.row.runs += 1
        slack = EDGE * (d.bounds[1] - d.bounds[0])
        points = sorted(
            (p.type, p.parameters[d.varied])
            for p in branch.special_points
            if d.bounds[0] + slack < p.parameters[d.varied] < d.bounds[1] - slack
        )
        ends = sorted(_reason(end) for end in branch.stopped)
        self.row.ends.update(ends)
        for point in branch.special_points:
            self._confirm(point, start, size)
        if self.first is None:
            self.first, self.first_ends = points, ends
            self.row.points = ", ".join(f"{kind} {value:.10g}" for kind, value in points)
            self._exact(points, start, size)
            self._compare_orbits(branch, start, size)
        else:
            self._compare(points, start, size)
            if ends != self.first_ends:
                self._note(start, size, f"ends {ends}, in the first run {self.first_ends}")
        self._count_stability(branch, start, size)

    def _confirm(self, point: saltus.results.SpecialPoint, start: float, size: float) -> None:
        """Compare a special point with SciPy, once where several runs have it."""
        value = point.parameters[self.described.varied]
        near = SAME * max(1.0, abs(value))
        if any(kind == point.type and abs(other - value) < near for kind, other in self.confirmed):
            return
        if point.type == "HB":
            exact = self.reference.hopf(point, self.described.varied)
            away = abs(value - exact) / max(1.0, abs(value))
            self.row.hopf = max(self.row.hopf, away) if away == away else math.inf
            if not away < HOPF:
                self._note(start, size, f"HB at {value:.12g}, SciPy's Hopf point at {exact:.12g}")
        elif point.type in ("SN", "PD", "TR", "BP"):
            gap, multipliers, growth, period = self.reference.corrected(point.orbit)
            away = distance(point.type, multipliers)
            allowed = FALSE * max(1.0, growth)
            self.row.false = max(self.row.false, away)
            if not away < allowed and growth < STIFF:
                told = f"{point.type} at {value:.12g} is false: multipliers by SciPy {_short(multipliers)}"
                self._note(
                    start, size, f"{told}, by saltus {_short(point.orbit.multipliers)}, gap {gap:.1g}, T = {period:.6g}"
                )
                return
        self.confirmed.append((point.type, value))

    def _exact(self, points: list[tuple[str, float]], start: float, size: float) -> None:
        """Compare with what is known in closed form."""
        for kind, values in self.described.exact.items():
            found = sorted(value for other, value in points if other == kind)
            wanted = sorted(values)
            if len(found) != len(wanted) or any(abs(a - b) > SAME for a, b in zip(found, wanted, strict=True)):
                self._note(start, size, f"{kind} at {found}, exact {wanted}")

    def _compare(self, points: list[tuple[str, float]], start: float, size: float) -> None:
        """Compare special points with those of the first run."""
        assert self.first is not None
        for kind in sorted({kind for kind, _ in (*points, *self.first)}):
            mine, first = ([v for k, v in listed if k == kind] for listed in (points, self.first))
            if len(mine) != len(first):
                self._note(start, size, f"{kind} at {_listed(mine)}, in the first run at {_listed(first)}")
                continue
            apart = max(abs(a - b) / max(1.0, abs(b)) for a, b in zip(mine, first, strict=True))
            self.row.spread = max(self.row.spread, apart)
            if apart > SAME:
                self._note(
                    start, size, f"{kind} apart by {apart:.2g}: {_listed(mine)}, in the first run {_listed(first)}"
                )

    def _compare_orbits(self, branch: saltus.results.Branch, start: float, size: float) -> None:
        """Compare multipliers of some orbits of a branch with SciPy's."""
        for i in np.unique(np.linspace(0, len(branch) - 1, LOOKED_AT).astype(int)):
            orbit = branch.solution(int(i))
            wide = max(orbit.max[s] - orbit.min[s] for s in self.described.system.states)
            if wide < 1e-6:
                continue  # at HB an orbit has shrunk to its equilibrium
            gap, multipliers, growth, _ = self.reference.corrected(orbit)
            if growth > STIFF:
                continue
            trivial = int(np.argmin(np.abs(orbit.multipliers - 1.0)))
            apart = _pairing(multipliers, np.delete(orbit.multipliers, trivial)) / max(1.0, growth)
            self.row.apart = max(self.row.apart, apart)
            value = orbit.parameters[self.described.varied]
            if gap > 1e-8 * growth * max(1.0, wide):
                self._note(
                    start, size, f"point {i} at {value:.9g} is no orbit: gap {gap:.2g} by SciPy, T = {orbit.period:.6g}"
                )
            elif apart > 1e-6:
                self._note(
                    start, size, f"multipliers at {value:.9g}: {_short(orbit.multipliers)}, SciPy {_short(multipliers)}"
                )

    def _count_stability(self, branch: saltus.results.Branch, start: float, size: float) -> None:
        """Note changes in the count of unstable multipliers without a special point between."""
        counts = []
        for multipliers in branch.multipliers:
            moved = np.delete(multipliers, np.argmin(np.abs(multipliers - 1.0)))
            counts.append(int(np.sum(np.abs(moved) > 1.0 + 1e-7)) if np.all(np.abs(np.abs(moved) - 1.0) > 1e-5) else -1)
        known = [(i, c) for i, c in enumerate(counts) if c >= 0]
        positions = [p.position for p in branch.special_points if p.type in ("SN", "PD", "TR", "BP", "HB")]
        for (i, c), (j, e) in pairwise(known):
            if c != e and not any(i - 0.01 <= place <= j + 0.01 for place in positions):
                values = branch.values[i], branch.values[j]
                self._note(
                    start,
                    size,
                    f"{c} unstable multipliers at {values[0]:.9g}, {e} at {values[1]:.9g}, no point between",
                )


def _listed(values: list[float]) -> str:
    return "[" + ", ".join(f"{v:.10g}" for v in values) + "]"


def _short(values: NDArray[np.complex128]) -> str:
    return "[" + ", ".join(f"{v:.6g}" if v.imag else f"{v.real:.6g}" for v in np.asarray(values, dtype=complex)) + "]"


def _pairing(a: NDArray[np.complex128], b: NDArray[np.complex128]) -> float:
    """Return the largest distance between two sets of numbers, each of `a` paired with the nearest left of `b`."""
    left, worst = list(b), 0.0
    for value in sorted(a, key=abs, reverse=True):
        nearest = min(left, key=lambda other: abs(other - value))
        left.remove(nearest)
        worst = max(worst, abs(nearest - value))
    return worst


def _reason(end: str) -> str:
    """Return why a branch ended, without numbers."""
    return "".join(c for c in end.split(": ", 1)[-1].split("(")[0].split(" at ")[0] if c not in "0123456789").strip()


def main() -> None:
    """Examine the systems that the command line asks for, and print the table."""
    parser = argparse.ArgumentParser(description="Special points of smooth autonomous cycles from several starts.")
    parser.add_argument("--first", type=int, default=0, help="number of the first system (0)")
    parser.add_argument("--count", type=int, default=len(SYSTEMS), help="how many systems (all)")
    parser.add_argument("--starts", type=int, default=5, help="starts of each (5)")
    parser.add_argument("--steps", type=int, default=3, help="sizes of steps from each (3)")
    options = parser.parse_args()
    print(machine())
    print(
        f"{'system':28} {'runs':>4} {'spread':>8} {'false by':>8} {'SciPy':>8} {'HB off':>8} {'s':>6}  special points"
    )
    rows = []
    for described in SYSTEMS[options.first : options.first + options.count]:
        row = Examination(described).all(options.starts, LARGEST[: options.steps])
        rows.append(row)
        numbers = " ".join(f"{v:8.1e}" for v in (row.spread, row.false, row.apart, row.hopf))
        print(f"{row.name:28} {row.runs:4d} {numbers} {row.seconds:6.1f}  {row.points or '-'}", flush=True)
        if odd := [f"{count} {reason}" for reason, count in row.ends.items() if reason not in GOOD]:
            print(f"    ends: {', '.join(odd)}", flush=True)
        for trouble in row.troubles:
            print(f"    {trouble}", flush=True)
    bad = sum(1 for row in rows if row.troubles)
    print(f"{len(rows)} systems, {sum(row.runs for row in rows)} branches, {bad} systems in trouble")
    ends = sum((row.ends for row in rows), Counter())
    for reason, count in ends.most_common():
        print(f"  {count:5d}  {reason}")


if __name__ == "__main__":
    sys.exit(main())
