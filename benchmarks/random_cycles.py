"""Random cycles: special points of branches of periodic orbits, against SciPy's variational equations.

Two coupled oscillators, forced (general, with the symmetry x -> -x shifted by half a period, two equal ones), and
cycles born at Hopf points of the polynomial fields of `random_fields`. Along a branch of short steps SciPy's DOP853
integrates field and variational equations, written in NumPy, at 1e-10: a change in the number of unstable multipliers
between two orbits that the points between do not explain is one that is missed, a point whose orbit has no critical
multiplier is false. Branches of longer steps must have the same points. The exit code is 1 if any differs.

    python benchmarks/random_cycles.py --count 100
"""

from __future__ import annotations

import argparse
import sys
import time
from collections import Counter
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from itertools import pairwise

import numpy as np
import random_fields as fields
from scipy.integrate import solve_ivp

from saltus import (
    HybridSystem,
    Mode,
    SaltusError,
    StepControl,
    continue_equilibrium,
    continue_orbit,
    find_equilibrium,
    find_orbit,
    switch_branch,
)
from saltus.results import Branch, PeriodicOrbit

LARGEST = (0.03, 0.1, 0.3)  # largest steps of the branches; the first is looked at by SciPy
LONGEST = 5.0  # period of cycles, over the first one's, up to which a branch is followed
TRIVIAL = 1e-5  # error of the multiplier 1 of a cycle, from which on SciPy's do not tell: next to a homoclinic orbit
MOST = 300  # most points of each direction
CRITICAL = 1e-4  # distance of a multiplier from its place at a special point
DOUBLE = 1e-2  # the same where two meet
SAME = 1e-6  # relative difference of a parameter between branches of different steps
KINDS = ("forced", "symmetric", "equal", "born")
FORCED = ("d", "k", "F", "F0", "G", "w", "a1", "b1", "c1", "a2", "b2", "c2")

Vectors = Callable[[float, np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]


@cache
def oscillators() -> HybridSystem:
    """Two coupled oscillators, forced."""
    text = "-d*y{0} - a{0}*x{0} - b{0}*x{0}**2 - c{0}*x{0}**3 + k*(x{1} - x{0})"
    modes = {"x1": "y1", "y1": text.format(1, 2) + " + F0 + F*cos(th)", "x2": "y2"}
    modes["y2"] = text.format(2, 1) + " + G*F*cos(th)"
    parameters = dict.fromkeys(FORCED, 0.0) | {"w": 1.0}
    return HybridSystem(("x1", "y1", "x2", "y2"), parameters, {"m": Mode(modes)}, phase=("th", "w"))


@dataclass(frozen=True)
class Case:
    """An orbit to follow, field and Jacobian in NumPy for many states at once, the parameter and its bounds."""

    kind: str
    orbit: PeriodicOrbit
    vectors: Vectors
    parameter: str
    bounds: tuple[float, float]


def forced_vectors(p: dict[str, float]) -> Vectors:
    """The oscillators' field and Jacobian at states (m, 4), values (m,) of F, at a phase."""

    def at(phase: float, x: np.ndarray, F: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        f, J = np.zeros_like(x), np.zeros((len(x), 4, 4))
        for i, j, name, force in ((0, 2, "1", F), (2, 0, "2", p["G"] * F)):
            a, b, c = (p[letter + name] for letter in "abc")
            q = x[:, i]
            f[:, i] = x[:, i + 1]
            f[:, i + 1] = -p["d"] * x[:, i + 1] - a * q - b * q**2 - c * q**3 + p["k"] * (x[:, j] - q)
            f[:, i + 1] += force * np.cos(phase) + (p["F0"] if i == 0 else 0.0)
            J[:, i, i + 1] = 1.0
            J[:, i + 1, i] = -a - 2 * b * q - 3 * c * q**2 - p["k"]
            J[:, i + 1, i + 1], J[:, i + 1, j] = -p["d"], p["k"]
        return f, J

    return at


def forced_case(kind: str, rng: np.random.Generator) -> Case | None:
    """A branch of forced oscillations along the force."""
    p = {name: float(value) for name, value in zip(FORCED, rng.normal(0.0, 0.5, len(FORCED)), strict=True)}
    p |= {"d": rng.uniform(0.05, 0.3), "w": rng.uniform(0.6, 2.0), "c1": rng.uniform(0.3, 1.5)}
    p |= {"c2": rng.uniform(0.3, 1.5), "F": 0.05, "k": rng.uniform(0.05, 0.6), "a2": rng.uniform(0.3, 2.0)}
    p["a1"] = rng.uniform(0.3, 2.0)
    if kind in ("symmetric", "equal"):
        p |= {"b1": 0.0, "b2": 0.0, "F0": 0.0}
    if kind == "equal":
        p |= {"a2": p["a1"], "c2": p["c1"], "G": 1.0}
    orbit = find_orbit(oscillators(), p, x0=[0.0, 0.0, 0.0, 0.0])
    return Case(kind, orbit, forced_vectors(p), "F", (0.01, 6.0))


def born_case(rng: np.random.Generator) -> Case | None:
    """Cycles from a Hopf point of a random field; None where it has none."""
    f = fields.random_field("general", int(rng.integers(2, 5)), rng)
    start = fields.start_of(f, rng)
    if start is None:
        return None
    equilibrium = find_equilibrium(fields.polynomial_field(f.n), f.parameters(start[-1]), x0=start[:-1])
    branch = continue_equilibrium(equilibrium, "mu", (-fields.BOUND, fields.BOUND))
    if not (points := branch.special_points.of_type("HB")):
        return None

    def at(_: float, x: np.ndarray, mu: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        found = [f(u) for u in np.column_stack([x, mu])]
        return np.array([F for F, _ in found]), np.array([J[:, :-1] for _, J in found])

    return Case("born", switch_branch(points[0]), at, "mu", (-fields.BOUND, fields.BOUND))


def monodromies(case: Case, x0: np.ndarray, values: np.ndarray, periods: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """States and monodromy matrices after one period of many orbits, all in one integration in scaled time."""
    m, n = x0.shape

    def rate(s: float, flat: np.ndarray) -> np.ndarray:
        z = flat.reshape(m, n + 1, n)
        f, J = case.vectors(2 * np.pi * s, z[:, 0], values)
        return (periods[:, None, None] * np.concatenate([f[:, None], z[:, 1:] @ J.transpose(0, 2, 1)], axis=1)).ravel()

    start = np.concatenate([x0[:, None], np.broadcast_to(np.eye(n), (m, n, n))], axis=1)
    end = solve_ivp(rate, (0.0, 1.0), start.ravel(), method="DOP853", rtol=1e-10, atol=1e-12).y[:, -1]
    z = end.reshape(m, n + 1, n)
    return z[:, 0], z[:, 1:].transpose(0, 2, 1)


def multipliers(case: Case, x0: np.ndarray, values: np.ndarray, periods: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """How far orbits are open, and their multipliers; of cycles those across the flow."""
    ends, M = monodromies(case, x0, values, periods)
    away = np.abs(ends - x0).max(axis=1) / (1 + np.abs(x0).max(axis=1))
    if case.kind == "born":
        f = case.vectors(0.0, x0, values)[0]
        across = [np.linalg.svd(row[None, :])[2][1:] for row in f]
        clear = np.abs(np.linalg.eigvals(M) - 1).min(axis=1) < TRIVIAL
        M = np.array([Q @ A @ Q.T for Q, A in zip(across, M, strict=True)])
        return away, np.where(clear[:, None], np.linalg.eigvals(M), np.inf)
    return away, np.linalg.eigvals(M)


def critical(kind: str, values: np.ndarray) -> float:
    """Distance of multipliers from those of a special point."""
    if kind in ("SN", "BP"):
        return float(np.abs(values - 1).min())
    if kind == "PD":
        return float(np.abs(values + 1).min())
    pairs = values[np.abs(values.imag) > 1e-6]
    return float(np.abs(np.abs(pairs) - 1).min(initial=1.0))


def followed(case: Case, largest: float) -> Branch:
    longest = LONGEST * case.orbit.period
    until = {"events": {"period": longest}, "stop_at": "period"} if case.kind == "born" else {}
    return continue_orbit(
        case.orbit, case.parameter, case.bounds, steps=StepControl(largest=largest, max_points=MOST), **until
    )


def told(branch: Branch) -> list[tuple[str, float, int, float]]:
    """Bifurcations: type, parameter, multiplicity and position."""
    points = branch.special_points.of_type("SN", "BP", "PD", "TR")
    return [(p.type, p.parameters[branch.parameter], p.multiplicity, p.position) for p in points]


def looked_at(case: Case, branch: Branch, results: Counter) -> list[str]:
    """What SciPy finds wrong along a branch."""
    wrong = []
    away, values = multipliers(case, branch.x0, branch.values, branch.period)
    results["orbits compared"] += len(away)
    sharp = np.abs(values).max(axis=1) < 1e5
    if np.any(away[sharp] > 1e-5):
        wrong.append(f"{np.sum(away[sharp] > 1e-5)} orbits are open, by up to {away[sharp].max():.1e}")
    counts = (np.abs(values) > 1).sum(axis=1)
    nearly = np.any(np.abs(np.abs(values) - 1) < 1e-6, axis=1) | ~sharp
    for i, (before, after) in enumerate(pairwise(counts)):
        between = [point for point in told(branch) if i < point[3] < i + 1]
        reach = {0}
        for kind, _, multiplicity, _ in between:
            size = multiplicity * (2 if kind == "TR" else 1)
            ways = range(-size, size + 1) if kind == "BP" or multiplicity > 1 else (-size, size)
            reach = {known + way for known in reach for way in ways}
        if after - before not in reach and not nearly[i] and not nearly[i + 1]:
            place = f"between {case.parameter} = {branch.values[i]:.8g} and {branch.values[i + 1]:.8g}"
            wrong.append(f"missed: {before} to {after} unstable {place}, said {[p[:2] for p in between]}")
            results["missed"] += 1
    points = branch.special_points.of_type("SN", "BP", "PD", "TR")
    if points:
        states, at = np.array([p.orbit.x0 for p in points]), np.array([p.parameters[branch.parameter] for p in points])
        _, found = multipliers(case, states, at, np.array([p.orbit.period for p in points]))
        for point, critical_values in zip(points, found, strict=True):
            size = np.abs(critical_values).max()
            if (distance := critical(point.type, critical_values)) > CRITICAL * max(1.0, size * 1e-3):
                wrong.append(f"false: {point.label} at {case.parameter} = {point.parameters[branch.parameter]:.8g}, "
                             f"its multiplier is {distance:.1e} away")  # fmt: skip
                results["false"] += 1
    results["points"] += len(points)
    return wrong


def alike(fine: Branch, coarse: Branch) -> list[str]:
    """What two branches of different steps say differently, where both lead to their ends."""
    if any("points" in end for end in (*fine.stopped, *coarse.stopped)):
        return []
    rest, wrong = told(coarse), []
    for kind, value, multiplicity, _ in told(fine):
        at = next((i for i, p in enumerate(rest) if p[0] == kind and p[2] == multiplicity
                   and abs(p[1] - value) < SAME * (1 + abs(value))), None)  # fmt: skip
        if at is None:
            wrong.append(f"not at longer steps: {kind} x{multiplicity} at {value:.8f}")
        else:
            rest.pop(at)
    return wrong + [f"at longer steps alone: {kind} x{count} at {value:.8f}" for kind, value, count, _ in rest]


def examine(case: Case, name: str, results: Counter) -> bool:
    """Compare one case, print what differs, and return whether nothing does."""
    right, fine = True, None
    for largest in LARGEST:
        branch = followed(case, largest)
        if fine is None:
            fine, wrong = branch, looked_at(case, branch, results)
        else:
            wrong = alike(fine, branch)
            results["differences between steps"] += len(wrong)
        results["branches"] += 1
        if wrong:
            right = False
            print(f"{name}, step {largest}: ends {branch.stopped}", *wrong, sep="\n    ", flush=True)
    return right


def drawn(index: int, seed: int, kinds: tuple[str, ...]) -> Case:
    """The case of a number; one whose start settles on no orbit is drawn again."""
    rng, kind = np.random.default_rng([seed, index]), kinds[index % len(kinds)]
    while True:
        with suppress(SaltusError):
            case = born_case(rng) if kind == "born" else forced_case(kind, rng)
            if case is not None:
                return case


def main() -> None:
    """Print what differs and the counts."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--count", type=int, default=100)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kinds", nargs="+", choices=KINDS, default=KINDS)
    parser.add_argument("--only", type=int, help="examine the case of this number alone")
    options = parser.parse_args()
    print(f"seed {options.seed}")
    results, by_kind, began, right = Counter(), Counter(), time.perf_counter(), True
    for index in range(options.count) if options.only is None else (options.only,):
        case = drawn(index, options.seed, tuple(options.kinds))
        right &= examine(case, f"{index}: {case.kind}", results)
        by_kind[case.kind] += 1
    print(f"{dict(by_kind)}\n{dict(results)}, {time.perf_counter() - began:.0f} s")
    sys.exit(0 if right else 1)


if __name__ == "__main__":
    main()
