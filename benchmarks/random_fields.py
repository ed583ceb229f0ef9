"""Random polynomial fields and maps: special points of equilibria and fixed points, against a scan by NumPy.

One field per number of states, cubic and bounded, with coefficients as parameters. Kinds: general fields; odd ones
(x -> -x); fields with an invariant plane x0 = 0; rings (Z_n, D_n) and all alike (S_n). A map adds the field times a
rate to the state. The scan follows the branch by its own pseudo-arclength steps of 0.01, and bisects each change in the
number of unstable eigenvalues or multipliers; it shares no code with the package. The exit code is 1 if a point is
missed, false, of another type or another multiplicity.

    python benchmarks/random_fields.py --count 300
    python benchmarks/random_fields.py --count 100 --maps
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from saltus import (
    ConvergenceError,
    HybridSystem,
    Map,
    StepControl,
    continue_equilibrium,
    continue_orbit,
    find_equilibrium,
    solve_orbit,
)

BOUND = 3.0  # the parameter goes from -BOUND to BOUND
STEP = 0.01  # arclength of the scan's steps
LARGEST = (0.03, 0.1, 0.3)  # largest steps of the package's branches
NEAR = 1e-6  # distance of a point from that of the scan, over 1 + its size
KINDS = ("general", "odd", "plane", "ring", "dihedral", "alike")
VECTORS = "cdbegrqh"  # coefficients with one value a state, beside the matrix a


def names(n: int) -> list[str]:
    """Names of the states."""
    return [f"x{i}" for i in range(n)]


@cache
def polynomial_field(n: int, *, discrete: bool = False) -> HybridSystem | Map:
    """The field of n states, or the map, with all its coefficients as parameters."""
    x = names(n)
    texts = {}
    for i in range(n):
        right, left = x[(i + 1) % n], x[(i - 1) % n]
        linear = " + ".join(f"a{i}_{j}*{x[j]}" for j in range(n))
        texts[x[i]] = (
            f"c{i} + d{i}*mu + {linear} + mu*(b{i}*{x[i]} + e{i}*{right})"
            f" + q{i}*{left}*{right} + r{i}*{right}**2 + h{i}*{x[i]}*{right} - g{i}*{x[i]}**3"
        )
    coefficients = [f"a{i}_{j}" for i in range(n) for j in range(n)] + [f"{v}{i}" for v in VECTORS for i in range(n)]
    parameters = {"mu": 0.0} | dict.fromkeys(coefficients, 0.0)
    if discrete:
        return Map(x, parameters | {"s": 1.0}, {name: f"{name} + s*({text})" for name, text in texts.items()})
    return HybridSystem.smooth(texts, parameters)


@dataclass(frozen=True)
class Field:
    """Coefficients of one field, with the field and its derivatives written in NumPy."""

    kind: str
    a: np.ndarray
    v: dict[str, np.ndarray]
    rate: float = 0.0  # of a map; 0 of a field

    @property
    def n(self) -> int:
        return len(self.a)

    def parameters(self, mu: float) -> dict[str, float]:
        """The coefficients under the names of `polynomial_field`."""
        matrix = {f"a{i}_{j}": self.a[i, j] for i in range(self.n) for j in range(self.n)}
        vectors = {f"{name}{i}": value[i] for name, value in self.v.items() for i in range(self.n)}
        rate = {"s": self.rate} if self.rate else {}
        return {"mu": mu} | rate | {name: float(value) for name, value in (matrix | vectors).items()}

    def spectrum(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Eigenvalues or multipliers, and how fast their directions grow."""
        values = np.linalg.eigvals(self(u)[1][:, :-1])
        if self.rate:
            values = 1.0 + self.rate * values
            return values, np.abs(values) - 1.0
        return values, values.real

    def __call__(self, u: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Value and Jacobian (n, n + 1) at u = (x, mu)."""
        n, x, mu, v = self.n, u[:-1], u[-1], self.v
        i = np.arange(n)
        right, left = (i + 1) % n, (i - 1) % n
        J = np.zeros((n, n + 1))
        J[:, :n] = self.a
        np.add.at(J, (i, i), mu * v["b"] + v["h"] * x[right] - 3 * v["g"] * x**2)
        np.add.at(J, (i, right), mu * v["e"] + v["q"] * x[left] + 2 * v["r"] * x[right] + v["h"] * x)
        np.add.at(J, (i, left), v["q"] * x[right])
        J[:, n] = v["d"] + v["b"] * x + v["e"] * x[right]
        F = v["c"] + J[:, n] * mu + self.a @ x + v["q"] * x[left] * x[right] + v["r"] * x[right] ** 2
        return F + v["h"] * x * x[right] - v["g"] * x**3, J


def random_field(kind: str, n: int, rng: np.random.Generator, rate: float = 0.0) -> Field:
    """A field of one kind, or its map, with random coefficients."""
    a = rng.normal(0.0, 1.0, (n, n)) * rng.choice([0.3, 1.0, 2.0])
    v = {name: rng.normal(0.0, 1.0, n) for name in VECTORS}
    v["g"] = rng.uniform(0.5, 1.5, n)
    if kind == "odd":
        v |= {name: np.zeros(n) for name in "cdqrh"}
    elif kind == "plane":
        a[0, 1:] = 0.0
        for name in "cderq":
            v[name][0] = 0.0
    elif kind in ("ring", "dihedral", "alike"):
        v = {name: np.full(n, value[0]) for name, value in v.items()}
        row = a[0].copy()
        if kind == "dihedral":
            row = (row + np.roll(row[::-1], 1)) / 2
        elif kind == "alike":
            row[2:] = row[1]
        a = np.array([np.roll(row, i) for i in range(n)])
        zero = {"ring": "", "dihedral": "erh", "alike": "erhq"}[kind]
        v |= {name: np.zeros(n) for name in zero}
    return Field(kind, a, v, rate)


def tangent_at(J: np.ndarray, along: np.ndarray) -> np.ndarray:
    """Unit tangent of the branch, in the direction of `along`."""
    t = np.linalg.solve(np.vstack([J, along]), np.append(np.zeros(len(J)), 1.0))
    return t / np.linalg.norm(t)


def corrected(f: Field, u: np.ndarray, t: np.ndarray) -> np.ndarray | None:
    """The point of the branch in the plane through u across t; None where Newton's method does not converge soon."""
    start = u
    for _ in range(6):
        F, J = f(u)
        du = np.linalg.solve(np.vstack([J, t]), np.append(F, t @ (u - start)))
        u = u - du
        if np.abs(du).max() < 1e-13 * (1 + np.abs(u).max()):
            return u
        if np.abs(du).max() > STEP:
            return None
    return u if np.abs(du).max() < 1e-10 else None


def unstable(f: Field, u: np.ndarray) -> int:
    """Number of directions that grow."""
    return int((f.spectrum(u)[1] > 0).sum())


@dataclass
class Scan:
    """What a scan found: points of the branch, and special points as (type, multiplicity, u)."""

    path: list[np.ndarray] = field(default_factory=list)
    found: list[tuple[str, int, np.ndarray]] = field(default_factory=list)


def located(f: Field, u: np.ndarray, w: np.ndarray, counts: tuple[int, int], t: np.ndarray) -> Iterator[tuple]:
    """Changes of the count between two points of the branch, bisected until they stand alone or at one place."""
    if counts[0] == counts[1]:
        return
    if np.linalg.norm(w - u) < 1e-8:
        yield u, w, abs(counts[1] - counts[0])
        return
    middle = corrected(f, (u + w) / 2, t)
    if middle is None:
        middle = (u + w) / 2
    count = unstable(f, middle)
    yield from located(f, u, middle, (counts[0], count), t)
    yield from located(f, middle, w, (count, counts[1]), t)


def kind_of(f: Field, u: np.ndarray, w: np.ndarray, change: int, turned: bool) -> tuple[str, int]:
    """Type and multiplicity of what lies between two close points."""
    values, growth = f.spectrum((u + w) / 2)
    critical = values[np.argsort(np.abs(growth))[:change]]
    if np.abs(critical.imag).max() > 1e-3:
        return ("TR" if f.rate else "HB"), change // 2
    if f.rate and critical[0].real < 0.0:
        return "PD", change
    return ("SN" if turned else "BP"), change


def scan(f: Field, start: np.ndarray, sign: float) -> Scan:
    """Follow the branch one way until the parameter leaves its bounds or the branch closes."""
    found, u = Scan([start]), start
    t = tangent_at(f(u)[1], np.append(np.zeros(f.n), sign))
    count, h = unstable(f, u), STEP
    for index in range(40_000):
        w = corrected(f, u + h * t, t)
        s = None if w is None else tangent_at(f(w)[1], t)
        if s is None or s @ t < 0.995:
            h /= 2
            if h < 1e-7:
                raise RuntimeError(f"the scan is stuck at {u}")
            continue
        after = unstable(f, w)
        for a, b, change in located(f, u, w, (count, after), t):
            beside = [corrected(f, y, t) for y in (a - 1e-4 * t, b + 1e-4 * t)]
            tangents = [tangent_at(f(y)[1], t) for y in beside if y is not None]
            turned = len(tangents) == 2 and tangents[0][-1] * tangents[1][-1] < 0
            found.found.append((*kind_of(f, a, b, change, turned), (a + b) / 2))
        u, t, count, h = w, s, after, min(STEP, 1.5 * h)
        found.path.append(u)
        if abs(u[-1]) > BOUND:
            break
        if index > 20 and np.linalg.norm(u - start) < STEP and t @ tangent_at(f(start)[1], t) > 0.9:
            break
    found.found = [point for point in found.found if abs(point[2][-1]) <= BOUND]
    return found


def start_of(f: Field, rng: np.random.Generator) -> np.ndarray | None:
    """An equilibrium that has the symmetry of its field, regular, or None."""
    for _ in range(20):
        x = rng.normal(0.0, 1.0, f.n)
        if f.kind == "odd":
            x[:] = 0.0
        elif f.kind == "plane":
            x[0] = 0.0
        elif f.kind != "general":
            x[:] = x[0]
        u = np.append(x, rng.uniform(-1.0, 1.0))
        for _ in range(30):
            F, J = f(u)
            u[:-1] -= np.linalg.solve(J[:, :-1], F)
            if not np.all(np.abs(u) < 1e3):
                break
        if np.all(np.abs(u) < 1e3) and np.abs(f(u)[0]).max() < 1e-11:
            return u
    return None


def near(u: np.ndarray, w: np.ndarray) -> bool:
    return bool(np.linalg.norm(u - w) < NEAR * (1 + np.linalg.norm(u)))


def said(f: Field, start: np.ndarray, largest: float) -> tuple[list[tuple[str, int, np.ndarray]], tuple[str, ...]]:
    """Special points of the package's branch with their multiplicities, and why it ended."""
    parameters, steps = f.parameters(start[-1]), StepControl(largest=largest)
    if f.rate:
        fixed = solve_orbit(polynomial_field(f.n, discrete=True), parameters, x0=start[:-1])
        branch = continue_orbit(fixed, "mu", (-BOUND, BOUND), steps=steps)
        states = [p.map_orbit.points[0] for p in branch.special_points]
    else:
        equilibrium = find_equilibrium(polynomial_field(f.n), parameters, x0=start[:-1])
        branch = continue_equilibrium(equilibrium, "mu", (-BOUND, BOUND), steps=steps)
        states = [p.equilibrium.state for p in branch.special_points]
    found = zip(branch.special_points, states, strict=True)
    return [(p.type, p.multiplicity, np.append(x, p.parameters["mu"])) for p, x in found], branch.stopped


def compared(told: list[tuple], truth: list[tuple]) -> tuple[list[tuple], list[tuple]]:
    """Points that were missed, and points that are false."""
    missed, false = [], list(told)
    for point in truth:
        at = next((i for i, p in enumerate(false) if p[:2] == point[:2] and near(p[2], point[2])), None)
        if at is None:
            missed.append(point)
        else:
            false.pop(at)
    return missed, false


def merged(up: Scan, down: Scan) -> list[tuple[str, int, np.ndarray]]:
    """Points of both ways, each once: a closed branch is seen twice."""
    points = list(up.found)
    points += [p for p in down.found if not any(p[0] == q[0] and near(p[2], q[2]) for q in up.found)]
    together: list[tuple[str, int, np.ndarray]] = []
    for kind, multiplicity, u in points:  # eigenvalues that cross at once part by rounding
        if together and together[-1][0] == kind and near(u, together[-1][2]):
            multiplicity += together.pop()[1]
        together.append((kind, multiplicity, u))
    return together


def cases(
    count: int, seed: int, kinds: tuple[str, ...], *, maps: bool = False
) -> Iterator[tuple[int, Field, np.ndarray]]:
    """Fields with a start each: kinds and sizes in turn."""
    for index in range(count):
        rng = np.random.default_rng([seed, index])
        kind = kinds[index % len(kinds)]
        n = int(rng.integers(2, 9)) if kind not in ("dihedral", "alike") else int(rng.integers(3, 7))
        start = None
        while start is None:
            f = random_field(kind, n, rng, rng.uniform(0.1, 1.0) if maps else 0.0)
            start = start_of(f, rng)
        yield index, f, start


def examine(f: Field, start: np.ndarray, results: Counter, name: str) -> bool:
    """Compare one field at all steps, print what differs, and return whether nothing does."""
    truth = merged(scan(f, start, 1.0), scan(f, start, -1.0))
    results["fields"] += 1
    results["points of the scan"] += len(truth)
    right = True
    for largest in LARGEST:
        try:
            told, ends = said(f, start, largest)
        except ConvergenceError as error:
            print(f"{name}, step {largest}: {error}")
            results["errors"] += 1
            right = False
            continue
        missed, false = compared(told, truth)
        results["branches"] += 1
        results["points said"] += len(told)
        results["missed"] += len(missed)
        results["false"] += len(false)
        if missed or false:
            right = False
            print(f"{name}, step {largest}: ends {ends}")
            for word, points in (("missed", missed), ("false", false)):
                for kind, multiplicity, u in points:
                    print(f"    {word} {kind} x{multiplicity} at mu = {u[-1]:.8f}, x = {np.round(u[:-1], 6).tolist()}")
    return right


def main() -> None:
    """Print what differs and the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=300)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--maps", action="store_true", help="maps in the place of fields")
    parser.add_argument("--only", type=int, help="examine the field of this number alone")
    options = parser.parse_args()
    print(f"seed {options.seed}")
    results, by_kind, began, right = Counter(), Counter(), time.perf_counter(), True
    for index, f, start in cases(options.count, options.seed, tuple(options.kinds), maps=options.maps):
        if options.only in (None, index):
            right &= examine(f, start, results, f"{index}: {f.kind}, {f.n} states")
            by_kind[f.kind] += 1
    print(f"{dict(by_kind)}\n{dict(results)}, {time.perf_counter() - began:.0f} s")
    sys.exit(0 if right else 1)


if __name__ == "__main__":
    main()
