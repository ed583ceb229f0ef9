"""What leaves a rest is the same in all units of the states, whether fields, resets or maps bend it.

Random linear parts have one critical direction, or pair, whose multiplier or eigenvalue goes with r through the
critical one. Random quadratic terms and a cubic one bend. The oracle is the same system in units of one, and the closed
form where there is only the cubic term.
"""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import pytest

import saltus
from selection import guarding

UNITS = (1e-9, 1e9, "mixed")
HOSTS = ("map", "kicks", "field")
POINTS = {"map": ("PD", "BP", "TR", "SN"), "kicks": ("PD", "BP", "TR"), "field": ("BP", "HB")}
EVERY = [
    (host, point, unit, away, seed)
    for host in HOSTS
    for point in POINTS[host]
    for unit in UNITS
    for away in (False, True)
    for seed in range(4)
    if (host, point, seed % 2) != ("field", "BP", 0)  # an eigenvalue touches 0 at a pitchfork's vertex
]
QUICK = [
    ("map", "PD", 1e-9, False, 0),
    ("map", "BP", 1e-9, False, 0),
    ("map", "TR", "mixed", False, 2),
    ("kicks", "PD", 1e9, False, 3),
    ("kicks", "BP", 1e-9, False, 0),
    ("field", "BP", "mixed", False, 3),
    ("field", "HB", 1e9, False, 2),
    ("map", "PD", "mixed", True, 1),
]


def units_of(unit: float | str, n: int) -> list[float]:
    return [1e-9, 1e4, 1e9][:n] if unit == "mixed" else [float(unit)] * n


def system_of(host: str, point: str, unit: float | str, away: bool, seed: int) -> tuple[Any, list[float]]:
    """Return a system in units, and the state at which it rests."""
    rng = np.random.default_rng([seed, HOSTS.index(host), len(point), ord(point[0])])
    pair = point in ("TR", "HB")
    n = int(rng.integers(2 if pair else 1, 4))
    turned = np.linalg.qr(rng.normal(size=(n, n)))[0]
    others = np.diag(rng.uniform(-0.6, 0.6, n))
    lead = np.zeros((n, n))
    if pair:
        angle = float(rng.uniform(0.5, 1.4))
        lead[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    else:
        lead[0, 0] = -1.0 if point == "PD" else 1.0
    others[lead.any(axis=1)] = 0.0
    fixed = turned @ others @ turned.T
    moving = turned @ lead @ turned.T
    if host == "field":  # the map's identity is no rate
        fixed = fixed - turned @ np.diag(np.where(lead.any(axis=1), 0.0, 1.0)) @ turned.T
        moving = turned @ np.diag(np.where(lead.any(axis=1), 1.0, 0.0)) @ turned.T
        fixed += turned @ (lead - np.diag(np.diag(lead))) @ turned.T
    factor = "r" if host == "field" else "(1 + r)"
    bends = 0.2 * rng.normal(size=(n, n, n)) * (seed % 2)
    names, sizes = [f"x{i}" for i in range(n)], units_of(unit, n)
    centre = rng.uniform(0.5, 2.0, n) if away else np.zeros(n)
    X = [f"({name}/{size!r} - {c!r})" for name, size, c in zip(names, sizes, centre.tolist(), strict=True)]
    square = " + ".join(f"{x}**2" for x in X)
    # r moves the rest through a fold, or changes what grows
    drive = turned[:, 0] if point == "SN" else np.zeros(n)
    images = {}
    for i, name in enumerate(names):
        terms = [f"{fixed[i, j]!r}*{X[j]}" for j in range(n)]
        terms += [f"{moving[i, j]!r}*{'1' if point == 'SN' else factor}*{X[j]}" for j in range(n)]
        terms += [f"{bends[i, j, k]!r}*{X[j]}*{X[k]}" for j in range(n) for k in range(n) if bends[i, j, k]]
        cubic = float(np.sign(lead[0, 0])) if point == "PD" else 1.0
        terms += [f"-{cubic!r}*({square})*{X[i]}"]
        if point == "SN":
            along = " + ".join(f"{v!r}*{x}" for v, x in zip(turned[:, 0].tolist(), X, strict=True))
            terms += [f"{float(drive[i])!r}*(r - ({along})**2)"]
        shift = centre[i] if host != "field" else 0.0
        images[name] = f"{sizes[i]!r}*({shift!r} + {' + '.join(terms)})".replace("np.float64", "")
    rest = [float(c) * size for c, size in zip(centre, sizes, strict=True)]
    start = {"r": 0.04 if point == "SN" else -0.1}
    if host == "map":
        return saltus.Map(names, start, images), rest
    if host == "field":
        return saltus.HybridSystem.smooth(images, start), rest
    still = saltus.Mode(dict.fromkeys(names, "0"))
    kick = saltus.Transition("still", "still", at_phase=0, reset=images, name="kick")
    return saltus.HybridSystem(names, start, {"still": still}, [kick], phase=("th", 1.0)), rest


def continued(start: Any) -> Any:
    rests = isinstance(start, saltus.results.Equilibrium)
    return (saltus.continue_equilibrium if rests else saltus.continue_orbit)(start, "r", (-0.2, 0.15))


def sizes_along(branch: Any, scale: list[float]) -> np.ndarray:
    """Return the largest modulus of each state at each solution, in its unit."""
    if isinstance(branch, saltus.results.MapBranch):
        return np.abs(branch.points).max(axis=1) / scale
    if isinstance(branch, saltus.results.EquilibriumBranch):
        return np.abs(branch.x0) / scale
    ends = [[np.abs(branch.column(f"{end}_x{i}")) for i in range(len(scale))] for end in ("min", "max")]
    return np.max(ends, axis=0).T / scale


def followed(host: str, point: str, unit: float | str, away: bool, seed: int) -> dict[str, Any]:
    """Return what is told of the rest and of the branch that leaves it."""
    system, rest = system_of(host, point, unit, away, seed)
    n = len(rest)
    scale = units_of(unit, n)
    if host == "field":
        start = saltus.find_equilibrium(system, x0=rest)
    elif host == "map" and point == "SN":
        start = saltus.find_orbit(system, x0=rest)
    else:
        start = saltus.solve_orbit(system, x0=rest) if host == "map" else saltus.find_orbit(system, x0=rest)
    rests = continued(start)
    told: dict[str, Any] = {"points": [(p.type, p.parameters["r"]) for p in rests.special_points]}
    told["stopped"] = [words.split(": ")[-1] for words in rests.stopped]
    first = next(p for p in rests.special_points if p.type == point)
    if point in ("PD", "HB", "TR", "SN") and not isinstance(unit, str):
        told["coefficient"] = first.normal_form.coefficient * scale[0] ** (1 if point == "SN" else 2)
    if point in ("PD", "BP", "HB"):
        branch = continued(saltus.switch_branch(first))
        told["other"] = [(p.type, p.parameters["r"]) for p in branch.special_points]
        told["other stopped"] = sorted(words.split(": ")[-1] for words in branch.stopped)
        sizes = sizes_along(branch, scale)
        told["r"], told["sizes"] = branch.values, sizes
        told["breaches"] = branch.audit.breaches if host == "kicks" else ()
    return told


@functools.cache
def in_units_of_one(host: str, point: str, away: bool, seed: int) -> dict[str, Any]:
    return followed(host, point, 1.0, away, seed)


def assert_same_points(found: list[tuple[str, float]], known: list[tuple[str, float]]) -> None:
    assert sorted(kind for kind, _ in found) == sorted(kind for kind, _ in known)
    np.testing.assert_allclose(sorted(r for _, r in found), sorted(r for _, r in known), atol=1e-6)


@pytest.mark.parametrize(("host", "point", "unit", "away", "seed"), guarding(EVERY, *QUICK, campaign=20))
def test_what_leaves_a_rest_is_the_same_in_all_units(host, point, unit, away, seed):
    found, known = followed(host, point, unit, away, seed), in_units_of_one(host, point, away, seed)
    assert_same_points(found["points"], known["points"])
    assert found["stopped"] == known["stopped"]
    if "coefficient" in found:
        np.testing.assert_allclose(found["coefficient"], known["coefficient"], rtol=1e-5, atol=1e-6)
    if "r" not in found:
        return
    assert_same_points(found["other"], known["other"])
    assert found["other stopped"] == known["other stopped"]
    assert not found["breaches"]
    ends = []
    for told in (found, known):
        order = np.argsort(told["r"][[0, -1]], kind="stable")
        ends.append((told["r"][[0, -1]][order], told["sizes"].max(axis=0)))
    np.testing.assert_allclose(ends[0][0], ends[1][0], atol=1e-4)
    np.testing.assert_allclose(ends[0][1], ends[1][1], rtol=1e-4)
    if seed % 2 == 0 and not away:  # an amplitude a along the critical direction has a^2 = r
        np.testing.assert_allclose(
            np.linalg.norm(found["sizes"], axis=1) if host != "field" or point != "HB" else found["sizes"].max(axis=1),
            np.sqrt(np.maximum(found["r"], 0.0)),
            atol=1e-3 if point != "HB" else 1.0,
        )


PARTLY = {"small": (1.0, 1e-9), "large": (1.0, 1e9), "beside large": (1e9, 1.0), "wide": (1e6, 1e-9)}


def partly_resting(point: str, unit: str, seed: int) -> tuple[Any, list[float], list[float]]:
    """Return kicks of states that move and of others that rest at 0; a state to start from, and the units of all.

    Those that rest have a random linear part with one critical direction, and bend by a cubic term. They move the
    others by their squares.
    """
    rng = np.random.default_rng([seed, ord(point[0])])
    n, m = rng.integers(1, 3, 2).tolist()
    u, v = PARTLY.get(unit, (1.0, 1.0))
    critical = -1.0 if point == "PD" else 1.0
    turned = np.linalg.qr(rng.normal(size=(n, n)))[0]
    fixed = turned @ np.diag([0.0, *rng.uniform(-0.6, 0.6, n - 1)]) @ turned.T
    moving = critical * np.outer(turned[:, 0], turned[:, 0])
    A, B = [f"(a{i}/{u!r})" for i in range(m)], [f"(b{i}/{v!r})" for i in range(n)]
    square = " + ".join(f"{b}**2" for b in B)
    images, rates = {}, {}
    for i in range(m):
        terms = [f"{share!r}*{a}" for share, a in zip(rng.uniform(-0.3, 0.3, m).tolist(), A, strict=True)]
        drift, decay, push, pull = rng.uniform([0.1, 0.1, 0.5, -0.2], [0.3, 0.5, 1.5, 0.2]).tolist()
        rates[f"a{i}"] = f"{u * drift!r} - {decay!r}*a{i}" if seed % 2 else "0"
        images[f"a{i}"] = f"{u!r}*({push!r} + {' + '.join(terms)} + {pull!r}*({square}))"
    for i in range(n):
        terms = [f"({fixed[i, j].item()!r} + {moving[i, j].item()!r}*(1 + r))*{B[j]}" for j in range(n)]
        rates[f"b{i}"], images[f"b{i}"] = "0", f"{v!r}*({' + '.join(terms)} - {critical!r}*({square})*{B[i]})"
    kick = saltus.Transition("drift", "drift", at_phase=0, reset=images, name="kick")
    system = saltus.HybridSystem([*rates], {"r": -0.1}, {"drift": saltus.Mode(rates)}, [kick], phase=("th", 1.0))
    return system, [0.7 * u] * m + [0.0] * n, [u] * m + [v] * n


@pytest.mark.parametrize(
    ("point", "unit", "seed"),
    guarding(
        [(point, unit, seed) for seed in range(4) for point in ("PD", "BP") for unit in PARTLY],
        ("PD", "small", 1),
        ("BP", "beside large", 0),
        campaign=8,
    ),
)
def test_states_that_rest_beside_others_leave_alike_in_all_units(point, unit, seed):
    system, x0, units = partly_resting(point, unit, seed)
    rests = continued(saltus.find_orbit(system, x0=x0))
    assert_same_points([(p.type, p.parameters["r"]) for p in rests.special_points], [(point, 0.0)])
    branch = continued(saltus.switch_branch(rests[f"{point}1"]))
    assert_same_points([(p.type, p.parameters["r"]) for p in branch.special_points], [("BP", 0.0)])
    ends = ["bound reached", "bound reached" if point == "BP" else "the period halves"]
    assert sorted(words.split(": ")[-1] for words in branch.stopped) == ends
    assert not branch.audit.breaches
    # along the critical direction an amplitude b has b^2 = r
    resting = [i for i, name in enumerate(system.states) if name.startswith("b")]
    found = [branch.column(f"{end}_{system.states[i]}") / units[i] for i in resting for end in ("min", "max")]
    reached = np.abs(np.reshape(found, (len(resting), 2, -1))).max(axis=1)
    np.testing.assert_allclose(np.linalg.norm(reached, axis=0), np.sqrt(np.maximum(branch.values, 0.0)), atol=1e-6)
