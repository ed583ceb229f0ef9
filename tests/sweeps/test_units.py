"""Labels of sweeps in all units of states, time and parameter."""

from __future__ import annotations

import functools
import itertools
import math

import pytest

import units
from saltus import Map, run_sweep
from saltus.options import SweepOptions
from selection import guarding

SWEPT = [name for name, case in units.CASES.items() if case.sweep]
KEPT = [("hard stop", "mixed"), ("two wells", "small"), ("delayed logistic", "large"), ("integrate and fire", "slow"),
        ("van der Pol, driven", "mixed")]  # fmt: skip

EVERY = list(itertools.product(SWEPT, units.UNITS))


@functools.cache
def labels(name: str, unit: str) -> list[str]:
    """Return the labels of a case along its values, each from the start."""
    case, new = units.CASES[name], units.NAMED[unit]
    sweep = run_sweep(
        case.system(new), case.parameter, [value * new.parameter for value in case.sweep], x0=case.x0(new),
        options=SweepOptions(follow="restart", discard=300),
    )  # fmt: skip
    return list(sweep.labels.ravel().tolist())


@pytest.mark.parametrize(("name", "unit"), guarding(EVERY, *KEPT, campaign=24, spread=True))
def test_labels_are_the_same_in_all_units(name: str, unit: str) -> None:
    assert labels(name, unit) == labels(name, "one")


APART = [(1e-9, 1.0, 1.0), (1.0, 1e-9, 1.0), (1.0, 1e9, 1e9), (1e-9, 1e9, 1.0)]


def turning(sizes: tuple[float, float, float]) -> Map:
    """Return the map of Grebogi, Ott, Pelikan and Yorke (Physica D 13 (1984) 261), a golden turn by two states."""
    turn = math.pi * (math.sqrt(5.0) - 1.0)
    c, s, (u, v, w) = math.cos(turn), math.sin(turn), sizes
    x, a, b = f"(x/{u!r})", f"(a/{v!r})", f"(b/{w!r})"
    images = {"x": f"{u!r}*g*{a}*tanh({x})", "a": f"{v!r}*({c!r}*{a} - {s!r}*{b})"}
    return Map(("x", "a", "b"), {"g": 3.0}, images | {"b": f"{w!r}*({s!r}*{a} + {c!r}*{b})"})


@pytest.mark.parametrize(("u", "v", "w"), guarding(APART, APART[1]))
def test_a_strange_motion_is_told_in_units_that_are_far_apart(u, v, w):
    sizes = u, v, w
    # an attractor that is not x = 0 is there for |g| > 2
    sweep = run_sweep(turning(sizes), "g", [1.5, 3.0], x0=[0.3 * sizes[0], sizes[1], 0.0])
    assert sweep.labels.ravel().tolist() == ["quasi-periodic", "strange nonchaotic"]


def test_a_state_that_fades_beside_a_torus_is_nothing():
    c, s = math.cos(1.0), math.sin(1.0)
    images = {"a": f"{c!r}*a - {s!r}*b", "b": f"{s!r}*a + {c!r}*b", "z": "q*z"}
    sweep = run_sweep(Map(("a", "b", "z"), {"q": 0.9}, images), "q", [0.5, 0.9, 0.97, 0.995], x0=[1.0, 0.0, 1e-4])
    assert sweep.labels.ravel().tolist() == ["quasi-periodic"] * 4


@pytest.mark.parametrize("u", [1.0, 1e-9, 1e9])
def test_an_exponent_is_taken_over_whole_rounds_in_all_units(u):
    images = {"x": f"{u!r}*r*(x/{u!r})*(1 - x/{u!r})", "y": "0.1*y + 1"}
    sweep = run_sweep(Map(("x", "y"), {"r": 3.84}, images), "r", [3.835, 3.84], x0=[0.3 * u, 1.0])
    for r, exponent in zip(sweep.values.tolist(), sweep.exponents.ravel().tolist(), strict=True):
        x, log = 0.3, 0.0
        for _ in range(3000):
            x = r * x * (1.0 - x)
        for _ in range(3):
            log += math.log(abs(r * (1.0 - 2.0 * x)))
            x = r * x * (1.0 - x)
        assert exponent == pytest.approx(log / 3.0, abs=1e-9)
