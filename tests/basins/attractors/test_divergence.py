"""What has diverged follows the problem, in basins as in simulations: attractors far away, and motions without one."""

from __future__ import annotations

import numpy as np
import pytest

from saltus import HybridSystem, InputError, Map, Mode, find_attractors, map_basins, simulate
from saltus.basins.attractors.found import AttractorOptions
from saltus.ensemble.ensemble import Ensemble
from saltus.ensemble.map_ensemble import MapEnsemble
from saltus.options import BasinOptions

BOX = {"x": (-2.0, 2.0)}

# x' = f, and the rests of each from the box, least first
FAR = {
    "a number": (HybridSystem.smooth({"x": "1e9 - x"}), [1e9]),
    "a parameter": (HybridSystem.smooth({"x": "x - x*(x/L)**2"}, {"L": 1e10}), [-1e10, 1e10]),
    "a billionth": (HybridSystem.smooth({"x": "1 - 1e-9*x"}), [1e9]),
    "a map": (Map(("x",), {"a": 1e9}, {"x": "a + x/2"}), [2e9]),
}


def found_in(system, box=BOX, **options):
    interval = None if isinstance(system, Map) else 0.7
    settings = AttractorOptions(**{"starts": 32, "samples": 200, "interval": interval, **options})
    return find_attractors(system, {}, box, options=settings)


@pytest.mark.parametrize("case", [name for name in FAR if name != "a billionth"])
def test_an_attractor_a_billion_times_as_far_as_the_region_is_found(case):
    system, rests = FAR[case]
    found = found_in(system)
    assert sorted(points[0, 0] for points in found.points.values()) == pytest.approx(rests, rel=1e-9)
    basins = map_basins(system, {}, {"x": (-2.0, 2.0, 20)}, found)
    assert max(basins.fractions()["diverged"], basins.fractions()["undecided"]) == 0.0


def test_a_slow_motion_to_an_attractor_a_billion_times_as_far_does_not_diverge():
    system, _ = FAR["a billionth"]
    ends, _ = Ensemble(system, interval=1e9).strobe([[0.0]])
    assert ends[0, 0] == pytest.approx(1e9 * (1.0 - np.exp(-1.0)), rel=1e-6)


@pytest.mark.parametrize("unit", [1e-9, 1.0, 1e9])
def test_wells_in_any_unit_are_found_and_escapes_told_soon(unit):
    system = HybridSystem.smooth({"x": "-x + x*(x/L)**2"}, {"L": unit})  # from beyond L motions escape in finite time
    found = found_in(system, {"x": (-2.0 * unit, 2.0 * unit)})
    assert found.names == ("rest",)
    basins = map_basins(system, {}, {"x": (-2.0 * unit, 2.0 * unit, 40)}, found, options=BasinOptions(longest=20))
    assert basins.fractions() == {"rest": 0.5, "diverged": 0.5, "undecided": 0.0}


def test_growth_without_end_diverges_within_sixty_e_folds():
    system = HybridSystem.smooth({"x": "x - 1e-9"})
    found = Ensemble(system, interval=1.0)
    ends, _ = found.strobe([[1.0]], count=10)
    assert ends[0, 0] == pytest.approx(np.exp(10.0), rel=1e-6)
    ends, _ = found.strobe([[1.0]], count=60)
    assert np.isnan(ends[0, 0])


@pytest.mark.parametrize("limit", [30.0, 1e15])
def test_a_given_limit_is_that_of_all_motions(limit):
    system = HybridSystem.smooth({"x": "100 - x"})
    assert found_in(system, limit=limit).names == (("rest",) if limit > 100.0 else ())
    basins = map_basins(system, {}, {"x": (-2.0, 2.0, 10)}, options=BasinOptions(limit=limit, interval=0.7))
    assert basins.inputs["traps"]["limit"] == limit
    assert basins.fractions()["diverged"] == (0.0 if limit > 100.0 else 1.0)
    assert np.isnan(Ensemble(system, interval=9.0, limit=limit).strobe([[0.0]])[0][0, 0]) == (limit < 100.0)
    doubling = Map(("x",), {}, {"x": "2*x"})
    assert np.isnan(MapEnsemble(doubling, limit=limit).strobe([[1.0]], count=7)[0][0, 0]) == (limit < 100.0)


def test_a_limit_below_a_given_attractor_is_told():
    system = HybridSystem.smooth({"x": "100 - x"})
    with pytest.raises(InputError, match="a motion that starts on it ends as 'diverged'"):
        map_basins(system, {}, {"x": (-2.0, 2.0, 10)}, found_in(system), options=BasinOptions(limit=30.0))


def test_default_limits_are_those_of_the_region_or_of_the_problem():
    plain = HybridSystem.smooth({"x": "-x"})
    assert found_in(plain).traps.limit == 2e6
    assert Ensemble(plain, interval=1.0).limit == MapEnsemble(Map(("x",), {}, {"x": "x/2"})).limit == 1e8
    assert found_in(FAR["a number"][0]).traps.limit == 1e15
    ends = simulate(FAR["a number"][0], {}, [0.0], t_end=60.0).x_end
    assert ends[0] == pytest.approx(1e9, rel=1e-9)


def test_a_limit_that_is_no_size_is_refused():
    with pytest.raises(InputError, match=r"limit = -1\.0: must be"):
        Ensemble(HybridSystem.smooth({"x": "-x"}), interval=1.0, limit=-1.0)
    with pytest.raises(InputError, match=r"BasinOptions\.limit = 0"):
        BasinOptions(limit=0.0)
    with pytest.raises(InputError, match=r"AttractorOptions\.limit = 'x'"):
        AttractorOptions(limit="x")


def test_a_forced_motion_far_away_is_found_by_lanes_and_by_events():
    field = {"x": "v", "v": "1e9*cos(s) - x - 0.5*v"}
    system = HybridSystem(("x", "v"), {}, {"m": Mode(field)}, phase=("s", 2.0))
    box = {"x": (-2.0, 2.0), "v": (-2.0, 2.0)}
    found = find_attractors(system, {}, box, options=AttractorOptions(starts=16, samples=200))
    assert found.names == ("period-1",)
    assert found.orbits["period-1"].max["x"] == pytest.approx(1e9 / np.hypot(1.0 - 4.0, 1.0), rel=1e-9)
    assert Ensemble(system).alone(np.zeros(2), found.traps, 100) == 0
