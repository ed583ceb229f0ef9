"""What a branch goes on with behind a border: the same orbit there, as the motion has it, or none."""

from __future__ import annotations

import itertools
import math
from functools import cache

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

import saltus
from selection import guarding

FORCES = {"k": 1.0, "c": 0.6, "F1": 0.4, "F2": 0.5, "u": 0.1}
SIGNS = {"-": -1, "0": 0, "+": 1}


@cache
def blocks() -> saltus.HybridSystem:
    """Return two coupled blocks on a belt of speed u, each with a friction that falls with its speed on the belt."""

    def field(s: int, r: int) -> dict[str, str]:
        return {
            "x": "v",
            "v": f"-k*x + c*(y - x) - ({s})*F1/(1 + ({s})*(v - u))",
            "y": "w",
            "w": f"-k*y + c*(x - y) - ({r})*F2/(1 + ({r})*(w - u))",
        }

    fields = {a + b: field(SIGNS[a], SIGNS[b]) for a, b in itertools.product("+-", repeat=2)}
    return saltus.filippov(("x", "v", "y", "w"), FORCES, surfaces=("v - u", "w - u"), fields=fields)


class Blocks:
    """The same blocks without saltus: each is stuck or slips, and SciPy integrates between changes."""

    def __init__(self, **changed: float) -> None:
        own = FORCES | changed
        self.u, self.limits, self.k, self.c = own["u"], (own["F1"], own["F2"]), own["k"], own["c"]

    def pull(self, i: int, z):
        """Return the springs' force on a block."""
        own, other = z[2 * i], z[2 - 2 * i]
        return -self.k * own + self.c * (other - own)

    def rates(self, states, z):
        """Return the derivative where each block slips back (-1), is stuck (0), or slips on (1)."""
        rates = np.empty(4)
        for i, s in enumerate(states):
            rates[2 * i] = z[2 * i + 1]
            friction = s * self.limits[i] / (1.0 + s * (z[2 * i + 1] - self.u))
            rates[2 * i + 1] = 0.0 if s == 0 else self.pull(i, z) - friction
        return rates

    def segment(self, states, z, duration):
        """Return the state at a segment's end, and whether the motion may be in these states all along."""
        found = solve_ivp(
            lambda t, z: self.rates(states, z), (0.0, duration), z, "DOP853", rtol=1e-12, atol=1e-14, dense_output=True
        )  # fmt: skip
        inside = found.sol(np.linspace(0.0, duration, 400)[1:-1])
        allowed = [
            np.all(s * (inside[2 * i + 1] - self.u) > 0.0)
            if s
            else np.all(np.abs(self.pull(i, inside)) < self.limits[i])
            for i, s in enumerate(states)
        ]
        return found.y[:, -1], all(allowed)

    def closes(self, orbit: saltus.PeriodicOrbit) -> float:
        """Return how far an orbit's end is from its start; infinite where it is not allowed."""
        z = start = np.array(orbit.x0[:4])
        for segment in orbit.segments:
            z, allowed = self.segment([SIGNS[sign] for sign in segment.mode], z, segment.duration)
            if not allowed:
                return np.inf
        return float(np.max(np.abs(z - start)))

    def settled_period(self, until: float) -> float:
        """Return the last period of a motion from (1, 0, 1.01, 0), from one sticking of the first block to the next."""
        states, t, z, stuck = [-1, -1], 0.0, np.array([1.0, 0.0, 1.01, 0.0]), []
        while t < until:
            events, what = [], []
            for i, j in itertools.product((0, 1), (1, -1)):
                if states[i] and j < 0:
                    continue

                def height(t, z, i=i, j=j, held=states[i] == 0):
                    return j * self.pull(i, z) - self.limits[i] if held else z[2 * i + 1] - self.u

                height.terminal, height.direction = True, 1 if states[i] == 0 else -states[i]
                events.append(height)
                what.append((i, j if states[i] == 0 else 0))
            now = tuple(states)
            found = solve_ivp(
                lambda t, z, now=now: self.rates(now, z), (t, until), z, "DOP853", rtol=1e-11, atol=1e-13, events=events
            )  # fmt: skip
            t, z = found.t[-1], found.y[:, -1].copy()
            if found.status != 1:
                break
            i, new = what[[len(times) > 0 for times in found.t_events].index(True)]
            z[2 * i + 1] = self.u
            if new == 0 and abs(self.pull(i, z)) >= self.limits[i]:
                new = int(np.sign(self.pull(i, z)))
            states[i] = new
            if (i, new) == (0, 0):
                stuck.append(t)
        return stuck[-1] - stuck[-2]


@pytest.mark.parametrize("largest", guarding((0.1, 0.02, 0.3)))
def test_a_block_that_overtakes_the_belt_adds_a_segment_behind_a_border(largest):
    system = blocks()
    start = saltus.find_orbit(system, {"u": 0.5}, x0=[1.0, 0.0, 1.0, 0.0])
    branch = saltus.continue_orbit(
        start, "u", (0.5, 0.62), directions="up", steps=saltus.StepControl(largest=largest)
    )  # fmt: skip
    (border,) = branch.special_points
    assert (border.type, branch.stopped[1]) == ("BC", "u = 0.62: bound reached")
    assert border.value("u") == pytest.approx(0.540986693, abs=1e-8)
    for u in (0.5405, 0.5415, 0.6):
        (orbit,) = branch.at(u)
        assert [segment.mode for segment in orbit.segments].count("+0") == (u > 0.541)
        assert Blocks(u=u).closes(orbit) < 1e-9
        assert orbit.stable
    assert np.max(np.abs(np.diff(branch.period) / np.diff(branch.values))) < 1.0


@pytest.mark.parametrize("way", ["down", "up"])
def test_blocks_that_swap_their_roles_are_one_branch(way):
    start = saltus.find_orbit(blocks(), {"F2": {"down": 0.405, "up": 0.395}[way]}, x0=[1.0, 0.0, 1.01, 0.0])
    branch = saltus.continue_orbit(start, "F2", (0.39, 0.41), directions=way)
    assert "bound reached" in branch.stopped[1]
    for force in (0.402, 0.3995):
        (orbit,) = branch.at(force)
        assert orbit.period == pytest.approx(Blocks(F2=force).settled_period(300.0), abs=2e-7)


@cache
def balls() -> saltus.HybridSystem:
    """Return two balls above each other over a shaken table, all impacts with a loss."""
    impact = {"u": "u + (1 + E)*(v - u)/(1 + m)", "v": "v - m*(1 + E)*(v - u)/(1 + m)"}
    return saltus.HybridSystem(
        ("x", "u", "y", "v"),
        {"g": 1.0, "e": 0.8, "E": 0.9, "a": 0.3, "w": 2.0, "m": 3.0},
        {"flight": saltus.Mode({"x": "u", "u": "-g", "y": "v", "v": "-g"})},
        [
            saltus.Transition(
                "flight", "flight", "x - a*sin(th)", -1, {"u": "-e*u + (1 + e)*a*w*cos(th)"}, name="table"
            ),
            saltus.Transition("flight", "flight", "y - x", -1, impact, name="balls"),
        ],
        phase=("th", "w"),
    )  # fmt: skip


@pytest.mark.parametrize(("bounds", "largest"), guarding(
    [((0.29, 0.8), 0.1), ((0.05, 2.0), 0.1), ((0.29, 2.0), 0.01)], ((0.29, 0.8), 0.1)))  # fmt: skip
def test_no_branch_jumps_where_three_bodies_meet_and_the_order_of_impacts_counts(bounds, largest):
    start = saltus.find_orbit(balls(), {}, x0=[0.5, 0.0, 1.0, 0.0])
    branch = saltus.continue_orbit(
        start, "a", bounds, directions="up", steps=saltus.StepControl(largest=largest, max_points=80)
    )  # fmt: skip
    border = branch.special_points[-1]
    assert (border.type, border.of) == ("BC", "")
    assert border.value("a") == pytest.approx(0.5310718, abs=1e-6)
    assert "no neighbouring signature is continuous" in branch.stopped[1]
    steps = np.hypot(np.diff(branch.values), np.diff(branch.highs[:, 2]))
    assert steps.max() < 0.5


def _pair(unit: float, loss: float) -> saltus.HybridSystem:
    """Return a mass that is shaken between two walls, lengths in a unit."""
    return saltus.HybridSystem(
        ("x", "v"), {"A": unit, "e": loss, "d": unit, "w": 1.0}, {"free": saltus.Mode({"x": "v", "v": "A*cos(th)"})},
        [
            saltus.Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="right"),
            saltus.Transition("free", "free", "x + d", -1, {"v": "-e*v"}, name="left"),
        ],
        phase=("th", "w"),
    )  # fmt: skip


def _symmetric(pair: saltus.HybridSystem, unit: float, loss: float) -> saltus.PeriodicOrbit:
    """Return its orbit with an impact on each wall in a period, each with the same speed."""
    # every impact has the speed u, half a period apart: 2 sin(p) = (1 - e)*u, and 2 + 2 cos(p) = pi*(1 + e)*u/2
    u = brentq(
        lambda u: 2.0 + 2.0 * math.sqrt(1.0 - (0.5 * (1.0 - loss) * u) ** 2) - 0.5 * math.pi * (1.0 + loss) * u, 0, 3
    )
    p = math.asin(0.5 * (1.0 - loss) * u)
    return saltus.solve_orbit(
        pair, {},
        [("free", "left", [unit, -loss * u * unit, p], math.pi),
         ("free", "right", [-unit, loss * u * unit, p + math.pi], math.pi)],
    )  # fmt: skip


@pytest.mark.parametrize("unit", guarding((1.0, 1e-9, 1e9), 1.0))
@pytest.mark.parametrize("loss", guarding((0.7, 0.5), 0.7))
def test_a_branch_does_not_follow_a_motion_that_only_touches_a_wall(unit, loss):
    """Below A = 1 each x = b - A cos t with |b| <= 1 - A is a motion without impacts: none is a branch's own."""
    start = _symmetric(_pair(unit, loss), unit, loss)
    branch = saltus.continue_orbit(start, "A", (0.05 * unit, 1.1 * unit), directions="down")
    last = branch.special_points[-1]
    assert last.type == "GR"
    assert last.value("A") == pytest.approx(unit, rel=1e-6)
    assert "one of a family" in branch.stopped[1]
    assert all(len(form) == 2 for form in branch.forms)
    assert branch.audit.passed


def test_special_points_of_mirror_images_are_none_of_them_twice():
    symmetric = saltus.continue_orbit(_symmetric(_pair(1.0, 0.7), 1.0, 0.7), "A", (0.5, 4.0))
    branch = saltus.continue_orbit(saltus.switch_branch(symmetric["BP1"]), "A", (0.5, 20.0))
    doubled = [point for point in branch.special_points if point.type == "PD" and point.value("A") < 1.0]
    assert len(doubled) == 2
    assert doubled[0].value("A") == pytest.approx(doubled[1].value("A"), abs=1e-10)
    assert doubled[0].solution.x0[1] == pytest.approx(-doubled[1].solution.x0[1], abs=1e-8)
    assert branch.audit.passed
