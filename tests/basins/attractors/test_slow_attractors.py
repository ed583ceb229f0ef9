"""Slow attractors: multipliers up to 0.99999, rates down to -1e-4; each is found, with its basin, within seconds."""

from __future__ import annotations

import math
import time

import numpy as np
import pytest

from saltus import HybridSystem, InputError, Map, Piece, find_attractors, load, map_basins
from saltus.basins.attractors.pace import approach
from saltus.ensemble.ensemble import Ensemble
from saltus.errors import StiffnessError
from saltus.options import AttractorOptions
from selection import guarding

FEW = AttractorOptions(starts=16, samples=100)


def test_an_approach_takes_four_times_what_a_linear_decay_takes():
    assert approach(0.5, 8.0) == 12
    assert approach(0.9999, math.e) == pytest.approx(4.0 / 1e-4, rel=1e-3)
    assert approach(math.nan, 2.0) == approach(0.5, 1.0) == approach(0.0, 2.0) == 0
    assert approach(1.0, 2.0) > 1e15


@pytest.mark.parametrize("slow", guarding([0.1, 0.01, 1e-3, 1e-4, 1e-5], 1e-4))
def test_slow_rests_of_a_map_share_the_line_in_two(slow):
    """x -> x + e (x - x^3)/2: two rests at -1 and 1 with the multiplier 1 - e, basins x < 0 and x > 0."""
    creeping = Map(("x",), {"e": slow}, {"x": "x + e*(x - x**3)/2"})
    found = find_attractors(creeping, {}, {"x": (-2, 2)}, options=FEW)
    assert found.names == ("period-1 A", "period-1 B")
    assert found.fates["undecided"] == found.fates["diverged"] == 0
    basins = map_basins(creeping, {}, {"x": (-2, 2, 60)}, found)
    assert [basins.fractions()[name] for name in found.names] == [0.5, 0.5]
    assert (basins.noted_error.wrong, basins.noted_error.nowhere, basins.noted_error.untold) == (0, 0, 0)


RATES = [1e-2, 1e-3, 1e-4, 1.7e-5]


@pytest.mark.parametrize("rate", guarding(RATES, 1e-4))
def test_a_slow_rest_beside_a_slow_cycle_is_found_with_its_disc(rate):
    """r' = k r (r^2 - 1)(4 - r^2), turning at 1: a rest with the rate -4 k in r < 1, else the cycle r = 2."""
    about = f"{rate!r}*(x**2 + y**2 - 1)*(4 - x**2 - y**2)"
    radial = HybridSystem.smooth({"x": f"x*{about} - y", "y": f"y*{about} + x"})
    options = AttractorOptions(starts=32, samples=100, interval=1.37)
    found = find_attractors(radial, {}, {"x": (-3, 3), "y": (-3, 3)}, options=options)
    assert found.names == ("rest", "limit cycle")
    assert found.decays["rest"] == pytest.approx(math.exp(-4.0 * rate * 1.37), rel=1e-6)
    assert found.fates["undecided"] == 0
    basins = map_basins(radial, {}, {"x": (-3, 3, 12), "y": (-3, 3, 12)}, found)
    inside = np.hypot(*basins.grid.points().T).reshape(12, 12) < 1.0
    assert np.array_equal(basins.labels == 0, inside)


@pytest.mark.parametrize(("slow", "turn"), guarding([(1e-3, 0.7), (1e-4, 0.7), (3e-4, 2.3), (1e-4, 1.9)], (3e-4, 2.3)))
def test_slow_spirals_to_a_cycle_of_two_points_are_that_cycle(slow, turn):
    """z -> -z turned, at a distance from two points: both are one orbit of period 2 with |multiplier| (1 - e)^2."""
    c, s = (1.0 - slow) * math.cos(turn), (1.0 - slow) * math.sin(turn)
    # about (1, 0) and (-1, 0), which change places; |x| > 0.5 in all of the region
    ahead = {"x": f"-1 + {c!r}*(x - 1) - {s!r}*y", "y": f"{s!r}*(x - 1) + {c!r}*y"}
    back = {"x": f"1 + {c!r}*(x + 1) - {s!r}*y", "y": f"{s!r}*(x + 1) + {c!r}*y"}
    pair = Map(("x", "y"), {}, pieces={"right": Piece(ahead, where="x"), "left": Piece(back, where="-x")})
    found = find_attractors(pair, {}, {"x": (0.9, 1.1), "y": (-0.1, 0.1)}, options=FEW)
    assert found.names == ("period-2",)
    assert found.decays["period-2"] == pytest.approx(1.0 - slow, rel=1e-9)
    assert found.points["period-2"] == pytest.approx(np.array([[-1.0, 0.0], [1.0, 0.0]]), abs=1e-9)


@pytest.mark.campaign
@pytest.mark.parametrize("damping", [1e-2, 1e-3, 3e-4])
def test_a_weakly_damped_forced_oscillator_has_its_one_response(damping):
    """x'' + d x' + x = cos(1.7 s): one orbit, of amplitude 1/|1 - w^2 + i d w|, that draws all motions."""
    field = {"x": "v", "v": f"cos(s) - {damping!r}*v - x"}
    forced = HybridSystem.smooth(field, phase=("s", 1.7))
    found = find_attractors(forced, {}, {"x": (-2, 2), "v": (-2, 2)}, options=FEW)
    assert found.names == ("period-1",)
    assert found.decays["period-1"] == pytest.approx(math.exp(-math.pi * damping / 1.7), rel=1e-9)
    response = 1.0 / (1.0 - 1.7**2 + 1.7j * damping)
    assert found.points["period-1"][0, 0] == pytest.approx(response.real, abs=1e-8)
    assert found.fates["undecided"] == 0


def _products(count):
    rng = np.random.default_rng(38)
    for _ in range(count):
        slow = tuple(float(10.0 ** -rng.uniform(1.0, 4.0)) for _ in range(int(rng.integers(1, 4))))
        yield slow, float(10.0 ** rng.integers(-9, 10)), int(rng.integers(1000))


PRODUCTS = list(_products(100))


@pytest.mark.parametrize(("slow", "unit", "seed"), guarding(PRODUCTS, campaign=5))
def test_products_of_slow_lines_have_two_rests_a_line_and_equal_orthants(slow, unit, seed):
    """Each state is a line of two rests: 2^n attractors at (+-1, ...), each with the starts of its signs."""
    states = [f"x{k}" for k in range(len(slow))]
    line = {x: f"{x} + {e!r}*({x} - {x}**3/{unit!r}**2)/2" for x, e in zip(states, slow, strict=True)}
    region = dict.fromkeys(states, (-1.5 * unit, 1.5 * unit))
    options = AttractorOptions(starts=48, samples=100, rng=seed)
    found = find_attractors(Map(states, {}, line), {}, region, options=options)
    assert len(found.names) == 2 ** len(slow)
    corners = {tuple(np.sign(found.points[name][0]).astype(int)) for name in found.names}
    assert len(corners) == 2 ** len(slow)
    assert np.abs(np.concatenate(list(found.points.values()))) == pytest.approx(unit, rel=1e-9)
    grid = dict.fromkeys(states, (-1.5 * unit, 1.5 * unit, 6))
    basins = map_basins(Map(states, {}, line), {}, grid, found)
    assert list(basins.fractions().values())[:-2] == pytest.approx([0.5 ** len(slow)] * len(found.names))


TORI = [0.1, 1e-2, 1e-3, 1e-4, 1e-5]


@pytest.mark.parametrize("slow", guarding(TORI, 1e-2, 1e-4))
def test_a_weakly_attracting_torus_is_one_attractor(slow):
    """r -> r (1 + e (1 - r^2)/2), turned by 1: the circle r = 1 draws all motions, by 1 - e an iteration."""
    c, s = math.cos(1.0), math.sin(1.0)
    ahead = f"(1 + e*(1 - x**2 - y**2)/2)*({c!r}*x - {s!r}*y)", f"(1 + e*(1 - x**2 - y**2)/2)*({s!r}*x + {c!r}*y)"
    torus = Map(("x", "y"), {"e": slow}, dict(zip("xy", ahead, strict=True)))
    options = AttractorOptions(starts=16, samples=100)
    found = find_attractors(torus, {}, {"x": (-2, 2), "y": (-2, 2)}, options=options)
    assert found.names == ("quasi-periodic",)
    assert np.hypot(*found.points["quasi-periodic"].T) == pytest.approx(1.0, abs=1e-6)
    assert found.fates["undecided"] == 0
    basins = map_basins(torus, {}, {"x": (-2, 2, 10), "y": (-2, 2, 10)}, found)
    assert basins.fractions()["quasi-periodic"] == 1.0
    assert basins.noted_error.wrong == 0


@pytest.mark.campaign
@pytest.mark.parametrize(("slow", "unit"), [(1e-2, 1.0), (1e-3, 1e6), (3e-4, 1e-6)])
def test_two_slow_tori_one_in_the_other_are_two_attractors(slow, unit):
    """u = r^2 goes to 1 or 9, by u -> u + e u (u - 1)(u - 4)(9 - u)/100, turned by 1; the circle r = 2 parts them."""
    c, s = math.cos(1.0), math.sin(1.0)
    u = f"((x**2 + y**2)/{unit!r}**2)"
    by = f"sqrt(1 + {slow!r}*({u} - 1)*({u} - 4)*(9 - {u})/100)"
    ahead = {"x": f"{by}*({c!r}*x - {s!r}*y)", "y": f"{by}*({s!r}*x + {c!r}*y)"}
    tori, box = Map(("x", "y"), {}, ahead), (-2.3 * unit, 2.3 * unit)
    options = AttractorOptions(starts=32, samples=100)
    found = find_attractors(tori, {}, {"x": box, "y": box}, options=options)
    assert found.names == ("quasi-periodic A", "quasi-periodic B")
    radii = sorted(float(np.hypot(*found.points[name].T).mean()) / unit for name in found.names)
    assert radii == pytest.approx([1.0, 3.0], abs=1e-5)
    basins = map_basins(tori, {}, {"x": (*box, 12), "y": (*box, 12)}, found)
    inside = np.hypot(*basins.grid.points().T).reshape(12, 12) < 2.0 * unit
    small = min(found.names, key=lambda name: np.hypot(*found.points[name].T).mean())
    assert np.array_equal(basins.labels == found.labels[small], inside)


@pytest.mark.campaign
@pytest.mark.parametrize("slow", [0.05, 2e-3, 2e-4])
def test_a_slow_torus_of_a_forced_flow_is_one_attractor(slow):
    """A cycle of radius 1 and a rate -2 k, seen once in each turn of a drive that does nothing to it."""
    about = f"{slow!r}*(1 - x**2 - y**2)"
    drawn = HybridSystem.smooth({"x": f"{about}*x - y + 0*cos(s)", "y": f"{about}*y + x"}, phase=("s", 1.7320508))
    options = AttractorOptions(starts=16, samples=100)
    found = find_attractors(drawn, {}, {"x": (-2, 2), "y": (-2, 2)}, options=options)
    assert found.names == ("quasi-periodic",)
    assert np.hypot(*found.points["quasi-periodic"].T) == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("interval", guarding([1.0, 2.3, 0.4], 2.3))
def test_tori_of_nose_and_hoover_are_no_attractors(interval):
    """The thermostat of Nose and Hoover turns back in time: its tori draw nothing, though volumes swell and shrink."""
    thermostat = HybridSystem.smooth({"x": "y", "y": "-x - z*y", "z": "y**2 - 1"})
    options = AttractorOptions(interval=interval, starts=16, samples=100)
    with pytest.raises(InputError, match="one with attractors"):
        find_attractors(thermostat, {}, {"x": (-2, 2), "y": (-2, 2), "z": (-1, 1)}, options=options)


@pytest.mark.parametrize("rate", guarding([1e5, 1e8], 1e8))
def test_a_search_that_cannot_be_made_is_refused_at_once(rate):
    """y decays at the rate to x^2; x = 0 is an invariant plane, past which implicit steps would carry."""
    stiff = HybridSystem.smooth({"x": "x - x**3", "y": f"-{rate!r}*(y - x**2)"})
    options = AttractorOptions(starts=32, samples=200, interval=1.0)
    began = time.monotonic()
    with pytest.raises(StiffnessError, match=r"it is stiff there.*6272 intervals, with 1e\+08 steps \(max_steps\)"):
        find_attractors(stiff, {}, {"x": (-2, 2), "y": (-2, 2)}, options=options)
    assert time.monotonic() - began < 60.0


def test_motions_beside_lanes_end_with_the_steps_that_all_may_take():
    ensemble = Ensemble(HybridSystem.smooth({"x": "x - x**3", "y": "-1e5*(y - x**2)"}), interval=1.0)
    ensemble.strobe([[0.5, 0.0]])
    first = ensemble.effort.steps
    assert first > 1000
    ensemble.effort.most = 3 * first
    with pytest.raises(StiffnessError, match="steps took the motion only to"):
        ensemble.strobe([[0.5, 0.0]] * 4)
    assert ensemble.effort.steps < 4 * first


def test_motions_that_settle_nowhere_are_told_with_their_places(tmp_path):
    """x -> x - x^3/2 comes to 0 like 1/sqrt(n), beside a rest at 3 of the factor 1/2."""
    pieces = {"lower": Piece({"x": "x - x**3/2"}, where="1 - x"), "upper": Piece({"x": "(x + 3)/2"}, where="x - 1")}
    half = Map(("x",), {}, pieces=pieces)
    found = find_attractors(half, {}, {"x": (-1, 4)}, options=AttractorOptions(starts=32, samples=100, longest=600))
    assert found.names == ("period-1",)
    assert found.fates["undecided"] > 8
    assert found.unsettled.shape == (8, 1)
    assert np.all(np.abs(found.unsettled) < 0.05)
    assert f"{found.fates['undecided']} of 32 motions" in repr(found)
    assert "such are at [" in repr(found)
    found.save(tmp_path / "found.nc")
    assert np.array_equal(load(tmp_path / "found.nc").unsettled, found.unsettled)
