"""Branches that leave a rest at 0 by a pitchfork, a transcritical point or a halving: few orbits, right stability.

One direction is critical, by a germ with a closed form; others follow it by its square. Random linear coordinates and
units mix them. The oracle is the critical multiplier: of ``u' = (a + b cos) u - s u^3`` it is ``exp(-2 a T)``.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

import saltus
from selection import guarding

FREQUENCY = 1.3
PERIOD = 2.0 * math.pi / FREQUENCY
UNITS = {"one": [1.0] * 4, "small": [1e-9] * 4, "large": [1e9] * 4, "mixed": [1e-9, 1e9, 1e4, 1.0]}
BOUNDS = (-0.2, 0.15)
KINDS = [
    ("map", "fork"), ("map", "transcritical"), ("map", "halving"), ("field", "fork"), ("field", "transcritical"),
    ("forced", "fork"), ("forced", "transcritical"), ("forced", "halving"),
]  # fmt: skip
STARTS = ("switch", 0.1, 1e-2, 1e-4, 1e-6)
EVERY = [
    (host, germ, sign, beside, unit, seed, STARTS[(seed + i) % len(STARTS)])
    for seed in range(6)
    for i, (host, germ) in enumerate(KINDS)
    for sign in (1, -1)
    for beside, unit in ((False, list(UNITS)[(seed + i) % 4]), (True, list(UNITS)[(seed + i + 1) % 3]))
]
QUICK = [
    ("forced", "halving", 1, False, "large", 3, "switch"),
    ("forced", "fork", -1, False, "large", 1, 0.1),
    ("map", "halving", 1, False, "mixed", 1, 1e-4),
    ("field", "fork", -1, False, "mixed", 0, 1e-4),
]


def written(value: float) -> str:
    return f"({float(value)!r})"


def growing(host: str, germ: str, sign: int, u: str, forcing: float) -> str:
    power = 2 if germ == "transcritical" else 3
    if germ == "halving":
        return f"-(1 + a)*{u} + {sign}*{u}**3"
    factor = {"map": "(1 + a)", "field": "a", "forced": f"(a + {forcing!r}*cos(th))"}[host]
    return f"{factor}*{u} - {sign}*{u}**{power}"


def turning(sign: int, decay: float, y: list[str]) -> tuple[list[str], str]:
    """Return rates of two coordinates that turn by half a turn in a period of the drive, and the square of the first.

    In coordinates that turn along they are ``(a - s u^2) u`` and ``-decay v``.
    """
    ahead = [["(0.5 + 0.5*cos(th))", "(0.5*sin(th))"], ["(0.5*sin(th))", "(0.5 - 0.5*cos(th))"]]
    aside = [["(0.5 - 0.5*cos(th))", "(-0.5*sin(th))"], ["(-0.5*sin(th))", "(0.5 + 0.5*cos(th))"]]
    square = f"(0.5*({y[0]}**2 + {y[1]}**2) + 0.5*cos(th)*({y[0]}**2 - {y[1]}**2) + sin(th)*{y[0]}*{y[1]})"
    spin = [[0.0, -FREQUENCY / 2.0], [FREQUENCY / 2.0, 0.0]]
    rates = [
        " + ".join(
            f"({spin[i][j]!r} + (a - {sign}*{square})*{ahead[i][j]} - {decay!r}*{aside[i][j]})*{y[j]}" for j in range(2)
        )
        for i in range(2)
    ]
    return rates, square


def system_of(host: str, germ: str, sign: int, beside: bool, unit: str, seed: int) -> tuple[Any, np.ndarray, float]:
    """Return a system, the critical direction in its states, and the forcing; `beside` adds a state that moves."""
    rng = np.random.default_rng([seed, *map(ord, host + germ)])
    others = int(rng.integers(0, 3))
    others = max(others, 1) if (host, germ) == ("forced", "halving") else others
    n, sizes = 1 + others, np.array(UNITS[unit])
    turned = np.linalg.qr(rng.normal(size=(n, n)))[0] @ np.diag(10.0 ** rng.uniform(-0.3, 0.3, n))
    back = np.linalg.inv(turned)
    decays, pulls = rng.uniform(0.2, 0.8, others).tolist(), rng.uniform(-0.5, 0.5, others).tolist()
    forcing = float(rng.uniform(0.3, 1.0))
    y = ["(" + " + ".join(f"{written(back[i, j])}*(x{j}/{sizes[j]!r})" for j in range(n)) + ")" for i in range(n)]
    y = [text.replace("np.float64", "") for text in y]
    if (host, germ) == ("forced", "halving"):
        rates, square = turning(sign, decays[0], y)
    else:
        rates, square = [growing(host, germ, sign, y[0], forcing)], f"{y[0]}**2"
    decay = 1.0 if host == "map" else -1.0
    for k in range(len(rates), n):
        rates.append(f"{decay * decays[k - 1]!r}*{y[k]} + {pulls[k - 1]!r}*{square}")
    found = {
        f"x{i}": f"{float(sizes[i])!r}*(" + " + ".join(f"{written(turned[i, j])}*({rates[j]})" for j in range(n)) + ")"
        for i in range(n)
    }
    if beside:
        drive = {"map": "1 + 0.3*z/{0}", "field": "1 + a - z/{0}", "forced": "cos(th) - z/{0}"}[host]
        found["z"] = f"{float(sizes[0])!r}*({drive.format(float(sizes[0]))})"
    direction = np.append(turned[:, 0] * sizes[:n], [float(sizes[0])] * beside)
    if host == "map":
        return saltus.Map([*found], {"a": -0.1}, found), direction, forcing
    phase = {"phase": ("th", "w")} if host == "forced" else {}
    parameters = {"a": -0.1} | ({"w": FREQUENCY} if phase else {})
    return saltus.HybridSystem.smooth(found, parameters, **phase), direction, forcing


def amplitude(host: str, germ: str, sign: int, a: float, forcing: float) -> float:
    """Return the critical coordinate at the period's start."""
    power = 1 if germ == "transcritical" else 2
    if host != "forced" or germ == "halving":
        return (a / sign) ** (1.0 / power)

    def grown(t: float) -> float:
        return a * t + forcing / FREQUENCY * math.sin(FREQUENCY * t)

    fed = quad(lambda t: math.exp(power * (grown(t) - grown(PERIOD))), 0.0, PERIOD, epsabs=0.0, epsrel=1e-12)[0]
    return float(((1.0 - math.exp(-power * a * PERIOD)) / (power * sign * fed)) ** (1.0 / power))


def started(host: str, germ: str, given: Any, start: str | float, sign: int, beside: bool) -> Any:
    """Return a solution on the branch: by `switch_branch` from the rest, or at a given distance of the parameter."""
    system, direction, forcing = given
    follow = saltus.continue_equilibrium if host == "field" else saltus.continue_orbit
    place = np.append(0.0 * direction[:-1], direction[-1]) if beside else 0.0 * direction
    if start == "switch":
        rest = (saltus.find_equilibrium if host == "field" else saltus.find_orbit)(system, x0=place.tolist())
        (point,) = follow(rest, "a", BOUNDS).special_points
        assert point.type == ("PD" if germ == "halving" else "BP")
        return saltus.switch_branch(point)
    a = sign * float(start)
    size = amplitude(host, germ, sign, a, forcing)
    x0 = (direction * np.append([size] * (direction.size - beside), [1.0] * beside)).tolist()
    if host == "field":
        return saltus.find_equilibrium(system, {"a": a}, x0=x0)
    turns = 2 if germ == "halving" else 1
    return saltus.solve_orbit(system, {"a": a}, x0=x0, period=turns if host == "map" else turns * PERIOD)


@pytest.mark.parametrize(
    ("host", "germ", "sign", "beside", "unit", "seed", "start"), guarding(EVERY, *QUICK, campaign=32, spread=True)
)
def test_a_branch_that_leaves_a_rest_takes_few_steps_and_has_its_stability(host, germ, sign, beside, unit, seed, start):
    given = system_of(host, germ, sign, beside, unit, seed)
    follow = saltus.continue_equilibrium if host == "field" else saltus.continue_orbit
    branch = follow(started(host, germ, given, start, sign, beside), "a", BOUNDS)
    a = branch.values
    assert np.sum(np.abs(a) < 1e-4) <= 30
    assert len(a) <= 250
    clear = np.abs(a) > (1e-9 if germ == "transcritical" else -1.0)
    stable = a > 0.0 if germ == "transcritical" else np.full(a.size, sign > 0)
    np.testing.assert_array_equal(np.asarray(branch.stable)[clear], stable[clear])
    (point,) = branch.special_points
    assert point.type == "BP"
    assert point.parameters["a"] == pytest.approx(0.0, abs=1e-7)
    ends = ["bound reached", "the period halves" if germ == "halving" else "bound reached"]
    assert sorted(words.split(": ")[-1] for words in branch.stopped) == ends
    assert not branch.audit.breaches


def test_doubled_orbits_of_a_parametric_pendulum_keep_their_stability_next_to_the_halving():
    pendulum = saltus.HybridSystem.smooth(
        {"x": "v", "v": "-c*v - (1 + h*cos(th))*sin(x)"}, {"c": 0.1, "h": 0.5, "w": 2.0}, phase=("th", "w")
    )
    rest = saltus.solve_orbit(pendulum, x0=[0.0, 0.0], period=math.pi)
    rests = saltus.continue_orbit(rest, "w", (1.5, 2.5))
    for label, stable in (("PD1", False), ("PD2", True)):  # subcritical and supercritical, by the curvature in w
        branch = saltus.continue_orbit(saltus.switch_branch(rests[label]), "w", (1.0, 2.5))
        near = np.abs(branch.values - rests[label].parameters["w"]) < 1e-2
        assert 2 < np.sum(near) < 30
        assert set(np.asarray(branch.stable)[near].tolist()) == {stable}
        assert len(branch) < 100
