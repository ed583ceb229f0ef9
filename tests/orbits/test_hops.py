"""A flight meets the surface on which it starts as soon as it comes back, however short or low the hop."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

import saltus
from selection import guarding

TURN = 2.0 * math.pi
PRELOAD = {"x": "v", "v": "(-1 + F*cos(th))*g"}


def preloaded(g: float = 1.0, direction: int = -1) -> saltus.HybridSystem:
    """A mass that a constant force of size g presses onto a wall, driven by F g: its flights are in closed form."""
    hit = saltus.Transition("fly", "fly", "x", direction, {"v": "-e*v"}, name="hit")
    return saltus.HybridSystem(
        ("x", "v"), {"F": 3.2, "e": 0.2, "g": g}, {"fly": saltus.Mode(PRELOAD)}, [hit], phase=("th", 1.0)
    )


def start(e: float, way: int) -> tuple[float, float]:
    """Return speed, over g, and phase behind the hit of an orbit with one hit a turn; way: which of the two."""
    v = e * TURN / (1.0 + e)
    phase = math.asin((v - TURN / 2.0) / 3.2)
    return v, phase if way == 0 else math.pi - phase


def flight(v: float, phase: float, t: np.ndarray) -> np.ndarray:
    """Return the height over g at times behind a hit."""
    moved = np.cos(phase + t) - np.cos(phase) + np.sin(phase) * t
    return np.asarray(v * t - t * t / 2.0 - 3.2 * moved)


RESTITUTIONS = [0.2, 0.02, *(10.0**-k for k in range(3, 13)), 0.0]


@pytest.mark.parametrize("way", [0, 1])
@pytest.mark.parametrize("e", guarding(RESTITUTIONS, 0.2, 1e-3, 1e-5, 1e-9, 0.0))
def test_an_orbit_with_one_hit_a_turn_is_admissible_where_its_flight_stays_before_the_wall(e: float, way: int) -> None:
    v, phase = start(e, way)
    stays = bool(flight(v, phase, np.linspace(1e-4, TURN - 1e-4, 100_000)).min() > 0.0)
    for g in (1.0, 1e-9, 1e9):
        segments = [("fly", "hit", [0.0, g * v, phase], TURN)]
        orbit = saltus.solve_orbit(preloaded(g), {"e": e}, segments=segments)
        assert orbit.admissible is stays, (g, orbit)


@pytest.mark.parametrize("e", [1e-4, 1e-6, 0.0])
def test_verify_tells_an_orbit_that_passes_its_wall(e: float) -> None:
    v, phase = start(e, 0)
    orbit = saltus.solve_orbit(preloaded(), {"e": e}, segments=[("fly", "hit", [0.0, v, phase], TURN)])
    told = {row.what for row in saltus.verify(replace(orbit, faults=0)).failures}
    assert told == {"admissible", "faults"}


def test_an_event_in_both_directions_is_met_behind_a_short_hop_as_well() -> None:
    v, phase = start(1e-5, 0)
    for direction, expected in ((-1, False), (0, False)):
        segments = [("fly", "hit", [0.0, v, phase], TURN)]
        orbit = saltus.solve_orbit(preloaded(direction=direction), {"e": 1e-5}, segments=segments)
        assert orbit.admissible is expected


@pytest.mark.campaign
def test_a_branch_ends_where_hits_on_a_table_accumulate() -> None:
    ball = saltus.HybridSystem(
        ("z", "v"), {"a": 1.2, "e": 0.5}, {"flight": saltus.Mode({"z": "v", "v": "-1"})},
        [saltus.Transition("flight", "flight", "z - a*sin(th)", -1, {"v": "-e*v + (1 + e)*a*cos(th)"}, name="impact")],
        phase=("th", 1.0), outputs={"gap": "z - a*sin(th)"},
    )  # fmt: skip
    branch = saltus.continue_orbit(saltus.find_orbit(ball, x0=[0.6, 3.1, 0.5]), "a", (0.3, 4.0))
    assert branch.column("min_gap")[branch.admissible].min() > -1e-11
    assert "hits of 'impact' accumulate" in branch.stopped[0]
    assert branch.audit.passed, str(branch)


def test_a_kick_that_turns_a_rotor_back_happens_again_as_it_returns() -> None:
    modes = {"f": saltus.Mode({"p": "v", "v": "torque - 0.2*v"})}
    kicks = [
        saltus.Transition("f", "f", "sin(p - 1)", 1, {"v": "q*v"}, when="cos(p - 1)", name="kick"),
        saltus.Transition("f", "f", "sin(p - 2.5)", 1, {"v": "v + 0.3"}, when="cos(p - 2.5)", name="push"),
    ]
    rotor = saltus.HybridSystem(("p", "v"), {"torque": 0.5, "q": 0.7}, modes, kicks, angles=("p",))
    branch = saltus.continue_orbit(saltus.find_orbit(rotor, x0=[0.0, 2.0]), "q", (-0.5, 0.9))
    assert branch.values[branch.admissible].min() > -1e-12  # at q < 0 the torque brings it back to the same kick
