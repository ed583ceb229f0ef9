"""States on a circle: swings and rotations are attractors, once each, whatever the place of the circle's ends."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from saltus import HybridSystem, Map, Mode, Transition, find_attractors, load, map_basins
from saltus.basins import basin_stability
from saltus.basins.measures.integrity import integrity_factor, local_integrity, minimal_fatal_perturbation
from saltus.ensemble.ensemble import Ensemble
from saltus.options import AttractorOptions
from selection import guarding

TURN = 2.0 * math.pi
CIRCLE = (-math.pi, math.pi)
LOOK = AttractorOptions(starts=64, samples=300, interval=0.7)


def pendulum(torque=0.5, damping=0.1, origin=0.0):
    """A pendulum that hangs at the angle `origin` without torque."""
    force = f"-{damping!r}*v + {torque!r} - sin(x - {origin!r})"
    return HybridSystem.smooth({"x": "v", "v": force}, angles=("x",))


def test_a_pendulum_under_torque_rests_or_rotates_as_published():
    """bSTAB's first example (Stender and Hoffmann 2022): shares of 0.152 and 0.848."""
    found = find_attractors(pendulum(), {}, {"x": CIRCLE, "v": (-10, 10)}, options=LOOK)
    assert found.names == ("rest", "rotation 1/1")
    assert found.kinds["rotation 1/1"] == "limit cycle"
    assert found.orbits["rotation 1/1"].winding == {"x": 1}
    basins = map_basins(pendulum(), {}, {"x": (*CIRCLE, 60), "v": (-10, 10, 60)}, found)
    assert basins.fractions()["rest"] == pytest.approx(0.152, abs=0.01)
    assert basins.fractions()["undecided"] == 0.0
    assert (basins.noted_error.wrong, basins.noted_error.missed) == (0, "")


@pytest.mark.parametrize(
    ("torque", "damping", "seed"), guarding([(0.5, 0.1, 0), (0.3, 0.2, 1), (-0.5, 0.1, 2)], (-0.5, 0.1, 2))
)
def test_labels_are_those_of_motions_by_scipy(torque, damping, seed):
    swing = pendulum(torque, damping)
    found = find_attractors(swing, {}, {"x": CIRCLE, "v": (-4, 4)}, options=LOOK)
    starts = np.random.default_rng(seed).uniform((-math.pi, -4.0), (math.pi, 4.0), (8, 2))
    labels = [found.names[k] for k in Ensemble(swing, interval=0.7).settle(starts, found.traps, 4000)[0]]

    def end(start):
        flow = solve_ivp(
            lambda t, y: (y[1], torque - damping * y[1] - math.sin(y[0])), (0.0, 200.0), start, rtol=1e-10, atol=1e-12
        )
        turns = (np.interp(200.0, flow.t, flow.y[0]) - np.interp(150.0, flow.t, flow.y[0])) / TURN
        return "rest" if abs(turns) < 0.5 else f"rotation {1 if turns > 0 else -1}/1"

    assert labels == [end(start) for start in starts]


@pytest.mark.parametrize("cells", guarding([0, 6, 12, 17], 12))
def test_labels_turn_with_the_circle(cells):
    """A pendulum that hangs at another angle, on the ends of the circle among them, has the same basins there."""
    grid = {"x": (*CIRCLE, 24), "v": (-6, 6, 12)}

    def labels(origin):
        swing = pendulum(origin=origin)
        found = find_attractors(swing, {}, {"x": CIRCLE, "v": (-6, 6)}, options=LOOK)
        assert found.names == ("rest", "rotation 1/1")
        return np.asarray(map_basins(swing, {}, grid, found).labels)

    assert np.array_equal(np.roll(labels(0.0), cells, axis=0), labels(cells * TURN / 24))


def test_a_driven_pendulum_has_three_attractors():
    """Nusse and Yorke, Physica D 90 (1996) 242: x'' + 0.2 x' + sin x = 1.66 cos t has three, with Wada basins."""
    driven = HybridSystem.smooth({"x": "v", "v": "-0.2*v - sin(x) + 1.66*cos(s)"}, phase=("s", 1.0), angles=("x",))
    found = find_attractors(driven, {}, {"x": CIRCLE, "v": (-2, 4)}, options=AttractorOptions(starts=64, samples=300))
    assert found.names == ("period-1", "rotation -2/2", "rotation 2/2")
    assert [found.orbits[name].winding["x"] for name in found.names] == [0, -2, 2]


def rests_of_a_rotor(nu, f):
    """Turns of the stable rests of the kicked rotor x + y, (1 - nu) y + f sin(x + y): y = 2 pi m, f sin x = -nu y."""
    rows = ((m, math.asin(TURN * m * nu / f)) for m in range(-99, 100) if abs(TURN * m * nu) < f)
    return [m for m, angle in rows if f * math.cos(angle) < 4.0 - 2.0 * nu]


ROTORS = [(0.1, 3.0), (0.3, 3.0), (0.1, 1.0), (0.2, 2.5), (0.4, 3.0)]


@pytest.mark.parametrize(("nu", "f"), guarding(ROTORS, (0.1, 3.0)))
def test_a_kicked_rotor_has_its_rests_of_each_number_of_turns(nu, f):
    """U. Feudel and others, Phys. Rev. E 54 (1996) 71: many coexisting rests; nine at nu = 0.1 and f = 3."""
    rotor = Map(("x", "y"), {}, {"x": "x + y", "y": f"{1 - nu!r}*y + {f!r}*sin(x + y)"}, angles=("x",))
    options = AttractorOptions(starts=512, samples=100)
    found = find_attractors(rotor, {}, {"x": CIRCLE, "y": (-1.1 * f / nu, 1.1 * f / nu)}, options=options)
    wanted = {f"rotation {m}/1" if m else "period-1" for m in rests_of_a_rotor(nu, f)}
    assert {name for name, kind in found.kinds.items() if kind == "period-1"} == wanted
    for name in wanted:
        x, y = found.points[name][0]
        assert y == pytest.approx(TURN * int(name.split()[1].split("/")[0]) if name != "period-1" else 0.0, abs=1e-9)
        assert f * math.sin(x) == pytest.approx(nu * y, abs=1e-9)


def test_a_rotor_kicked_once_a_turn_has_the_basins_of_its_speed():
    """v -> v - sin(v)/2 where it passes 0 or pi: v ends at the next multiple of a turn."""
    kick = Transition("free", "free", "sin(x)", 1, {"v": "v - sin(v)/2"})
    rotor = HybridSystem(("x", "v"), {}, {"free": Mode({"x": "v", "v": "0"})}, transitions=[kick], angles=("x",))
    options = AttractorOptions(starts=32, samples=100, interval=0.37)
    found = find_attractors(rotor, {}, {"x": CIRCLE, "v": (4, 15)}, options=options)
    assert found.names == ("rotation 1/1 A", "rotation 1/1 B")
    basins = map_basins(rotor, {}, {"x": (*CIRCLE, 8), "v": (4, 15, 22)}, found)
    assert np.array_equal(np.asarray(basins.labels), np.broadcast_to(np.rint(basins.grid.axes[1] / TURN) - 1, (8, 22)))


def test_attractors_with_angles_are_read_back(tmp_path):
    found = find_attractors(pendulum(), {}, {"x": CIRCLE, "v": (-4, 4)}, options=LOOK)
    found.save(tmp_path / "found.nc")
    again = load(tmp_path / "found.nc")
    assert again.names == found.names
    grid = {"x": (0.0, TURN, 6), "v": (-4, 4, 4)}
    basins = map_basins(pendulum(), {}, grid, again)
    assert np.array_equal(basins.labels, map_basins(pendulum(), {}, grid, found).labels)
    assert 0.0 < basin_stability(basins, "rest", 64).value < 0.5


def test_a_ball_about_a_swing_goes_on_beyond_the_ends_of_the_circle():
    """A rest at the angle pi has the ball of one at 0, and the same shortest way out."""
    found = []
    for origin in (0.0, math.pi):
        swing = pendulum(torque=0.0, damping=0.05, origin=origin)
        grid = {"x": (*CIRCLE, 40), "v": (-3, 3, 40)}
        rests = find_attractors(swing, {}, {"x": CIRCLE, "v": (-3, 3)}, options=LOOK)
        halves = map_basins(swing, {}, grid, rests)
        assert rests.names == ("rest",)
        labels = np.where(np.abs(halves.grid.axes[1]) < 1.0, np.asarray(halves.labels), 1)
        halves = type(halves)(labels.astype(np.uint8), halves.grid, halves.attractors, halves.inputs, "")
        ball = integrity_factor(halves, "rest")
        found.append((local_integrity(halves, "rest").value, ball.value, ball.clipped))
        assert np.linalg.norm(minimal_fatal_perturbation(halves, "rest").vector) < 1.2
    assert found[0] == pytest.approx(found[1], abs=1e-9)
    assert found[1][0] == pytest.approx(1.0, abs=0.16)
