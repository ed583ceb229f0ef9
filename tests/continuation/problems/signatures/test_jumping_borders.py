"""Branches end where the map of a sampled relay jumps: from each start, at each step, however it is defined."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np
import pytest
from scipy.linalg import expm

import saltus
from selection import guarding

LEVELS = ("u", "d")


@dataclass(frozen=True)
class Relay:
    """x' = A x + B h, and h is switched at each sampling: to d where x0 - c > b, to u where x0 - c < -b."""

    A: np.ndarray
    B: np.ndarray
    period: float
    values: dict[str, float]

    @classmethod
    def random(cls, seed: int) -> Relay:
        """Return a stable linear system of one to three states, with levels and a threshold that it reaches."""
        rng = np.random.default_rng(seed)
        n = int(rng.integers(1, 4))
        A = rng.normal(size=(n, n))
        A -= np.eye(n) * (float(np.linalg.eigvals(A).real.max()) + rng.uniform(0.2, 0.8))
        B = np.eye(n)[-1]
        up, down = rng.uniform(0.5, 1.5), -rng.uniform(0.5, 1.5)
        if rng.random() < 0.3:
            down = -up
        reach = abs(float(np.linalg.solve(A, B)[0])) * max(up, -down)
        values = {"b": float(rng.uniform(0.05, 0.6)) * reach, "c": 0.0, "u": up, "d": down}
        return cls(A, B, float(rng.uniform(0.6, 2.0)), values)

    @property
    def names(self) -> list[str]:
        """Names of the states."""
        return [f"x{i}" for i in range(len(self.A))]

    def system(self, form: str) -> saltus.HybridSystem:
        """Return the system: each sampling an event ("each"), or those alone at which the relay switches ("some")."""
        n = len(self.A)

        def mode(level: str) -> saltus.Mode:
            rows = [" + ".join(f"({float(self.A[i, j])!r})*{self.names[j]}" for j in range(n)) for i in range(n)]
            return saltus.Mode({self.names[i]: f"{rows[i]} + ({float(self.B[i])!r})*{level}" for i in range(n)})

        keep = (lambda mode: {"otherwise": mode}) if form == "each" else (lambda _: {})
        down = saltus.Transition("up", "down", at_phase=0, when="x0 - c - b", **keep("up"))
        up = saltus.Transition("down", "up", at_phase=0, when="c - x0 - b", **keep("down"))
        parameters = self.values | {"w": 2.0 * np.pi / self.period}
        modes = {"up": mode("u"), "down": mode("d")}
        return saltus.HybridSystem(tuple(self.names), parameters, modes, [down, up], phase=("th", "w"))

    def word(self, orbit: saltus.PeriodicOrbit) -> list[str]:
        """Return the mode in each sampling period of an orbit."""
        return [part.mode for part in orbit.segments for _ in range(round(part.duration / self.period))]

    def slacks(self, word: list[str], values: dict[str, float]) -> np.ndarray:
        """Return how far each sampling of the orbit with a word of modes is from one that decides otherwise."""
        n, count = len(self.A), len(word)
        block = expm(np.block([[self.A, self.B[:, None]], [np.zeros((1, n + 1))]]) * self.period)
        E, G = block[:n, :n], block[:n, n]
        pushes = [G * values["u" if mode == "up" else "d"] for mode in word]
        P, q = np.eye(n), np.zeros(n)
        for push in pushes:
            P, q = E @ P, E @ q + push
        x, found = np.linalg.solve(np.eye(n) - P, q), []
        for k in range(count):
            height = float(x[0]) - values["c"]
            height = height if word[k - 1] == "up" else -height
            found.append(height - values["b"] if word[k] != word[k - 1] else values["b"] - height)
            x = E @ x + pushes[k]
        return np.array(found)

    def interval(self, word: list[str], name: str) -> tuple[float, float]:
        """Return between which values of a parameter the orbit of a word exists: each slack is linear in it."""
        at = self.values[name]
        here = self.slacks(word, self.values)
        slopes = self.slacks(word, self.values | {name: at + 1.0}) - here
        zeros = [at - h / s for h, s in zip(here, slopes, strict=True) if abs(s) > 1e-9]
        return (
            max(
                (zero for zero, s in zip(zeros, slopes[np.abs(slopes) > 1e-9], strict=True) if s > 0.0), default=-np.inf
            ),
            min(
                (zero for zero, s in zip(zeros, slopes[np.abs(slopes) > 1e-9], strict=True) if s < 0.0), default=np.inf
            ),
        )


@cache
def symmetric() -> Relay:
    """Return x' = +-1 - 0.3 x, sampled once in a unit of time, with the threshold 0.4."""
    return Relay(np.array([[-0.3]]), np.array([1.0]), 1.0, {"b": 0.4, "c": 0.0, "u": 1.0, "d": -1.0})


def traced_as_it_exists(relay: Relay, form: str, name: str) -> None:
    """Follow the relay's orbits along a parameter from several starts, at several steps: each to the ends it has."""
    system, n = relay.system(form), len(relay.A)
    low, high = relay.values[name] - 1.1, relay.values[name] + 1.3
    starts = (
        (0.1, "up", None),
        (-0.1, "down", saltus.StepControl(largest=0.05)),
        (0.0, "up", saltus.StepControl(largest=0.02)),
    )
    for x0, mode, steps in starts:
        orbit = saltus.find_orbit(system, x0=[x0] * n, mode=mode)
        first, last = relay.interval(relay.word(orbit), name)
        branch = saltus.continue_orbit(orbit, name, (low, high), steps=steps)
        text, inside = repr(branch), int(first > low) + int(last < high)
        assert branch.values.min() == pytest.approx(max(first, low), rel=0, abs=1e-8)
        assert branch.values.max() == pytest.approx(min(last, high), rel=0, abs=1e-8)
        assert [point.type for point in branch.special_points] == ["BC"] * inside
        assert text.count("the map jumps there") == inside
        assert "fold" not in text
        assert "closed" not in text
        assert branch.audit.breaches == ()


@pytest.mark.parametrize("form", ["each", "some"])
def test_the_symmetric_relay_exists_between_two_jumps(form):
    relay = symmetric()
    e = np.exp(-0.3)
    top = (1.0 - e * e) / (1.0 + e * e) / 0.3
    below = 1.0 / 0.3 - (top + 1.0 / 0.3) * e
    first, last = relay.interval(["up", "up", "down", "down"], "b")
    assert (first, last) == pytest.approx((below, top), rel=1e-12)
    traced_as_it_exists(relay, form, "b")


RELAYS = [(seed, form, name) for seed in range(30) for form in ("each", "some") for name in ("b", "c", "u")]
KEPT = [(0, "each", "u"), (2, "some", "b"), (11, "each", "c")]


@pytest.mark.parametrize(("seed", "form", "name"), guarding(RELAYS, *KEPT, campaign=10))
def test_random_relays_exist_between_the_jumps_of_their_closed_form(seed, form, name):
    traced_as_it_exists(Relay.random(seed), form, name)
