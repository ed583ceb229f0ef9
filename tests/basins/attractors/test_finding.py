"""Attractors of systems whose attractors are known, whatever the motions that find them."""

from __future__ import annotations

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from saltus import HybridSystem, InputError, Mode, Transition, afm, find_attractors, find_orbit, simulate, solve_orbit
from saltus.basins.attractors.finding import attractors_from
from saltus.basins.attractors.found import AttractorOptions, Found, Stay
from saltus.basins.attractors.search import AttractorSearch
from saltus.basins.wilson import wilson
from saltus.ensemble.ensemble import Ensemble
from saltus.ensemble.traps import UNDECIDED, Ellipsoids, Traps
from saltus.results import Attractors
from selection import guarding

QUICK = AttractorOptions(samples=400)


def duffing():
    return HybridSystem(
        ("x", "v"),
        {"F": 0.2},
        {"free": Mode({"x": "v", "v": "x - x**3 - 0.15*v + F*cos(s)"})},
        phase=("s", "1"),
        name="Duffing oscillator",
    )


def impact():
    return HybridSystem(
        ("x", "v"),
        {"w": 1.1, "A": 0.2},
        {"free": Mode({"x": "v", "v": "-x - 0.1*v + A*cos(s)"})},
        [Transition("free", "free", "x - 1", 1, {"v": "-0.8*v"}, name="impact")],
        phase=("s", "w"),
        name="impact oscillator",
    )


def carried(states, parameters, image):
    """A map as a hybrid system that lanes can follow: states rest, and jump a quarter into each period of the phase."""
    rest = Mode(dict.fromkeys(states, "0"))
    jump, back = (
        Transition("before", "after", "cos(s)", -1, image, name="map"),
        Transition("after", "before", "cos(s)", 1),
    )
    return HybridSystem(states, parameters, {"before": rest, "after": rest}, [jump, back], phase=("s", "1"))


def carried_alone(states, parameters, image):
    """The same in one mode, whose event function changes sign between events: a case for the event-driven flow."""
    rest = {"rest": Mode(dict.fromkeys(states, "0"))}
    jump = Transition("rest", "rest", "sin(s)", -1, image, name="map")
    return HybridSystem(states, parameters, rest, [jump], phase=("s", "1"))


BOX = {"x": (-2.2, 2.2), "v": (-2.2, 2.2)}


@pytest.fixture(scope="module")
def wells():
    return find_attractors(duffing(), {}, BOX, options=replace(QUICK, starts=64))


def test_two_wells_have_an_attractor_each(wells):
    assert wells.names == ("period-1 A", "period-1 B")
    assert wells.labels == {"period-1 A": 0, "period-1 B": 1, "diverged": 253, "undecided": 254}
    assert sorted(float(np.sign(wells.points[name][0, 0])) for name in wells.names) == [-1.0, 1.0]
    for name, orbit in wells.orbits.items():
        assert orbit.stable
        # Liouville: the area shrinks by exp(-0.15 * 2 pi)
        assert float(np.prod(orbit.multipliers).real) == pytest.approx(math.exp(-0.3 * math.pi), rel=1e-8)
        assert wells.points[name][0] == pytest.approx(orbit.x0, abs=1e-9)


def test_all_motions_of_the_wells_are_accounted_for_about_half_in_each(wells):
    assert sum(wells.fates.values()) == wells.fates["period-1 A"] + wells.fates["period-1 B"] == 64
    assert 16 < wells.fates["period-1 A"] < 48


def test_states_in_a_measured_trap_end_in_its_well(wells):
    rng = np.random.default_rng(7)
    ellipsoids = wells.traps.ellipsoids
    for centre, shape, label in zip(ellipsoids.centres, ellipsoids.shapes, ellipsoids.labels, strict=True):
        ball = rng.standard_normal((200, 2))
        ball *= np.sqrt(rng.random(200) / (ball**2).sum(axis=1))[:, None]
        x = centre + ball @ np.linalg.inv(shape).T
        held = [start for start in x if wells.traps.of(start, 0) == label]
        assert len(held) > 40  # the planes cut off no more than three fifths
        for start in held[:20]:
            end = simulate(duffing(), {}, start, periods=60).x_end[:2]
            assert end == pytest.approx(wells.points[wells.names[label]][0], abs=1e-3)


def test_the_sample_count_of_a_measured_trap_is_told(wells):
    pattern = r"measured: 400 samples, (\w+) elsewhere: < (\S+) at 95 %"
    told = [re.search(pattern, note) for note in wells.notes.values()]
    hits = [0 if found[1] == "none" else int(found[1]) for found in told]
    bounds = [wilson(count, 400)[1] for count in hits]
    assert max(hits) < 4
    assert [float(found[2]) for found in told] == pytest.approx(bounds, rel=0.05)
    assert wells.measured_error == pytest.approx(max(bounds), rel=1e-9)


@pytest.mark.campaign
def test_attractors_survive_a_file(wells, tmp_path):
    again = Attractors.load(wells.save(tmp_path / "wells.nc"))
    assert again == wells
    assert again.names == wells.names
    assert again.orbits["period-1 A"].period == wells.orbits["period-1 A"].period
    assert np.array_equal(again.traps.ellipsoids.shapes, wells.traps.ellipsoids.shapes)


def test_names_and_points_do_not_depend_on_which_motions_found_them(wells):
    for seed in (1, 2):
        again = find_attractors(duffing(), {}, BOX, options=AttractorOptions(starts=16, samples=100, rng=seed))
        assert again.names == wells.names
        for name in wells.names:
            assert again.points[name] == pytest.approx(wells.points[name], abs=1e-9)


@pytest.mark.thorough
@pytest.mark.campaign
def test_a_stable_orbit_is_periodic_even_where_no_ellipsoid_contracts(monkeypatch, wells):
    monkeypatch.setattr("saltus.basins.attractors.periodic.contracting", lambda *_: None)
    found = find_attractors(duffing(), {}, BOX, options=replace(QUICK, starts=16))
    assert dict(found.kinds) == {"period-1 A": "period-1", "period-1 B": "period-1"}
    assert all("boxes" in note for note in found.notes.values())
    for name in found.names:
        assert found.points[name] == pytest.approx(wells.points[name], abs=1e-9)
        assert found.fates[name] > 0
    assert found.fates["undecided"] == 0


@pytest.mark.campaign
def test_motions_that_creep_away_from_an_unstable_orbit_find_no_attractor_there():
    # multiplier 1.01 at 0, and 0.98 at the attractors +-0.1
    system = carried(("x",), {}, {"x": "1.01*x - x**3"})
    search = AttractorSearch(system, {}, np.array([-1.0]), np.array([1.0]), AttractorOptions(samples=100))
    beside = np.array([[1e-6], [-2e-6]])
    path = np.array([search.ensemble.strobe(beside, count=count)[0] for count in (80, 100)])
    assert np.abs(np.diff(path, axis=0)).max() < 1e-5  # it recurs as if it were settling
    search.follow(beside)
    assert sorted(float(found.points[0, 0]) for found in search.found) == pytest.approx([-0.1, 0.1], abs=1e-9)


def test_an_orbit_that_is_no_attractor_is_refused():
    system = duffing()
    saddle = solve_orbit(system, {}, [("free", None, [-0.1, 0.0], 2.0 * math.pi)])
    with pytest.raises(InputError, match="orbit 'top' = 'unstable': must be an attractor: a stable orbit"):
        attractors_from({"top": saddle}, BOX, options=QUICK)
    right, other = find_orbit(system, {}, [1.2, 0.0]), find_orbit(system, {"F": 0.1}, [1.2, 0.0])
    with pytest.raises(InputError, match="orbit 'other' = .*must be of the same system and parameters as 'right'"):
        attractors_from({"right": right, "other": other}, BOX, options=QUICK)


def test_known_orbits_keep_their_names_and_order(wells):
    right, left = (find_orbit(duffing(), {}, [x, 0.0]) for x in (1.2, -0.8))
    known = attractors_from({"right": right, "left": left}, BOX, options=QUICK)
    assert known.names == ("right", "left")
    labels, _ = Ensemble(duffing(), {}).settle([[1.2, 0.0], [-0.8, 0.0]], known.traps)
    assert labels.tolist() == [0, 1]


def test_an_impact_oscillator_rests_before_its_stop_or_hits_it():
    found = find_attractors(impact(), {}, {"x": (-2, 1), "v": (-3, 3)}, options=replace(QUICK, starts=32))
    assert found.names == ("period-1 A", "period-1 B")  # what meets no event comes first
    quiet, hitting = (found.orbits[name] for name in found.names)
    assert quiet.signature == (("free", "s"),)
    assert quiet.max["x"] == pytest.approx(0.2 / math.hypot(1.0 - 1.21, 0.11), rel=1e-9)
    assert hitting.signature == (("free", "impact"),)
    assert float(np.prod(hitting.multipliers).real) == pytest.approx(0.64 * math.exp(-0.1 * hitting.period), rel=1e-8)
    assert "a theorem" in found.notes["period-1 A"]
    assert "measured" in found.notes["period-1 B"]


LOGISTIC = [(carried, 2.9, 1), (carried_alone, 3.2, 2), (carried, 1.0 + math.sqrt(8.0) + 5e-3, 3), (carried, 3.5, 4)]


@pytest.mark.campaign
@pytest.mark.parametrize(("way", "r", "period"), LOGISTIC)
def test_the_logistic_map_has_its_period(way, r, period):
    system = way(("x",), {"r": 3.0}, {"x": "r*x*(1 - x)"})
    search = AttractorOptions(samples=100, longest=1500)
    found = find_attractors(system, {"r": r}, {"x": (-0.2, 1.2)}, options=replace(search, starts=8))
    assert found.names == (f"period-{period}",)
    points = found.points[f"period-{period}"][:, 0]
    assert points[0] == points.min()
    assert r * points * (1.0 - points) == pytest.approx(np.roll(points, -1), abs=1e-9)
    multiplier = np.prod(r * (1.0 - 2.0 * points))
    assert found.orbits[f"period-{period}"].multipliers[0].real == pytest.approx(multiplier, abs=1e-7)
    assert found.fates["diverged"] > 0  # what starts outside [0, 1]


def narrow_well():
    """A damped oscillator whose wide well has a narrow one at 1/2, of a width of some 0.01."""
    well = "0.04*(x - 0.5)/0.0001/(1 + ((x - 0.5)/0.01)**2)**2"
    return HybridSystem(("x", "v"), {}, {"free": Mode({"x": "v", "v": f"-x - 2*v - {well}"})}, phase=("s", "1"))


@pytest.mark.campaign
def test_a_small_attractor_beside_a_large_one_is_found_and_its_states_are_not_in_the_others_trap():
    found = find_attractors(narrow_well(), {}, {"x": (-2, 2), "v": (-2, 2)}, options=AttractorOptions(samples=2000))
    places = [float(points[0, 0]) for points in found.points.values()]
    assert places == pytest.approx([0.0, 0.5], abs=0.01)
    assert found.traps.of(found.points[found.names[1]][0], 0) != 0
    # what starts in the narrow well ends there, whatever trap says so
    x = np.array([0.5, 0.0]) + 0.004 * np.random.default_rng(0).uniform(-1.0, 1.0, (200, 2))
    labels, _ = Ensemble(narrow_well()).settle(x, found.traps)
    ends, _ = Ensemble(narrow_well()).strobe(x, count=20)
    assert np.array_equal(labels, np.where(ends[:, 0] > 0.25, 1, 0))
    assert (labels == 1).sum() > 100


@pytest.mark.thorough
@pytest.mark.campaign
def test_a_long_transient_is_no_attractor():
    system = afm.tapping_mode(afm.table1(), modes=2, parameters={"Omega": 1.165})
    found = find_attractors(
        system, {}, dict.fromkeys(system.states, (-5, 5)), options=AttractorOptions(starts=64, samples=1000)
    )
    assert found.names == ("attractive", "repulsive")
    assert found.kinds["repulsive"] == "period-4"
    assert found.measured_error < 0.01


def beside_a_wall(w, g):
    return HybridSystem(
        ("x", "v"),
        {"w": w, "g": g},
        {"free": Mode({"x": "v", "v": "-x - 0.02*v + 0.5*cos(s)"})},
        [Transition("free", "free", "x - g", 1, {"v": "-0.8*v"}, name="impact")],
        phase=("s", "w"),
    )


@pytest.mark.campaign
@pytest.mark.parametrize("seed", guarding([0, 1, 2], campaign=1))
def test_chaos_that_motions_leave_after_thousands_of_periods_is_no_attractor_whatever_the_seed(seed):
    region, search = {"x": (-2, -1e-3), "v": (-2, 2)}, AttractorOptions(rng=seed, samples=400)
    found = find_attractors(beside_a_wall(2.8, 0.0), {}, region, options=replace(search, starts=32))
    assert dict(found.kinds) == {"period-18": "period-18"}
    orbit, points = found.orbits["period-18"], found.points["period-18"]
    assert orbit.stable
    assert orbit.form.turns == 18
    assert points[0] == pytest.approx(points[np.argmin(points[:, 0])], abs=0.0)  # the order of its points is their own
    assert points[0] == pytest.approx([-0.4533, 0.0775], abs=5e-5)


@pytest.mark.thorough
@pytest.mark.campaign
def test_a_slow_spiral_towards_a_long_orbit_is_no_attractor_beside_it():
    region = {"x": (-2, 0.199), "v": (-2, 2)}
    found = find_attractors(beside_a_wall(3.9, 0.2), {}, region, options=AttractorOptions(starts=64, samples=400))
    assert found.names == ("period-1", "period-9", "period-12")
    assert found.fates["undecided"] == 0
    assert min(found.fates[name] for name in found.names) > 0


def test_the_stay_in_a_leaking_interval_is_measured():
    # of the interval [0, 1] each step carries the part 1 - 2/slope away, uniformly
    slope = 2.002
    search = AttractorSearch(
        carried(("x",), {}, {"x": "x"}), {}, np.zeros(1), np.ones(1), AttractorOptions(samples=100, longest=1500)
    )

    def strobe(points, modes=None, count=1):
        x = np.array(points, dtype=float)
        for _ in range(count):
            x = slope * np.minimum(x, 1.0 - x)
        search.ensemble.work += 1  # as where lanes follow all motions
        return np.where(np.abs(x) < 1e8, x, np.nan), np.zeros(len(x), np.int64)

    search.ensemble.strobe = strobe
    search.ensemble.settle = lambda x, traps, longest: (np.full(len(x), 253, np.uint8), np.zeros(len(x), np.int32))
    chaos = Found("chaotic", np.random.default_rng(3).uniform(0.0, 1.0, (1024, 1)), None, frozenset({"rest"}), True)
    search.found.append(chaos)
    search.drop_transients()
    assert not search.found
    assert 64 < chaos.stay.left < chaos.stay.motions == 128
    assert chaos.stay.mean == pytest.approx(slope / (slope - 2.0), rel=3.0 / math.sqrt(chaos.stay.left))


@pytest.mark.campaign
def test_of_two_intervals_between_which_motions_change_all_the_time_one_is_an_attractor(monkeypatch):
    search = AttractorSearch(
        carried(("x",), {}, {"x": "x"}), {}, np.zeros(1), np.ones(1), AttractorOptions(samples=100, longest=1500)
    )
    rng = np.random.default_rng(4)

    def strobe(points, modes=None, count=1):
        x = np.array(points, dtype=float)
        for _ in range(count):
            # chaos in [0, 1] and in [2, 3], and a change from one to the other in 2000 steps
            within = x % 2.0
            x = np.where(rng.random(x.shape) < 1.0 / 2000.0, 2.0 - (x - within), x - within) + rng.random(x.shape)
        search.ensemble.work += 1
        return x, np.zeros(len(x), np.int64)

    search.ensemble.strobe = strobe
    chaos = {"orbit": None, "visited": frozenset({"rest"}), "touches": True}
    monkeypatch.setattr(search, "_featured", lambda cloud, *_, **__: Found("chaotic", cloud, **chaos))
    search.found.append(Found("chaotic", rng.random((1024, 1)), **chaos))
    search.drop_transients()
    assert len(search.found) == 1
    assert search.found[0].stay.mean > 10 * 1500


def test_what_was_seen_of_the_stay_is_told():
    assert str(Stay(128, 6e5, 0)) == "none of 128 motions left it in 6e+05 strobes: mean stay > 2e+05 at 95 %"
    assert str(Stay(128, 4e5, 4)) == "a transient: 4 of 128 motions left it, mean stay 1e+05 +- 5e+04"


@pytest.mark.thorough
@pytest.mark.campaign
def test_an_orbit_that_nearly_grazes_is_periodic():
    system = afm.tapping_mode(afm.table1(), modes=2, parameters={"Omega": 1.046})
    found = find_attractors(
        system, {}, dict.fromkeys(system.states, (-5, 5)), options=AttractorOptions(starts=16, samples=200)
    )
    assert dict(found.kinds) == {"repulsive": "period-10"}
    assert float(np.abs(found.orbits["repulsive"].multipliers).max()) == pytest.approx(0.7576, abs=5e-5)
    assert found.fates["repulsive"] == 16
    # some are under way for hundreds of periods, which would lead nowhere at the tolerance of motions that fall
    ellipsoids = found.traps.ellipsoids
    small = Ellipsoids(ellipsoids.centres, 3400.0 * ellipsoids.shapes, ellipsoids.labels)
    x = np.random.default_rng(0).uniform(-5.0, 5.0, (64, 4))
    labels, periods = Ensemble(system).settle(x, Traps(4, small), longest=4000)
    assert (labels == 0).all()
    assert periods.max() > 400


@pytest.mark.thorough
@pytest.mark.campaign
def test_a_narrow_window_in_chaos_has_the_one_orbit_of_its_period():
    system = afm.tapping_mode(afm.table1(), modes=2, parameters={"Omega": 1.023})
    found = find_attractors(
        system, {}, dict.fromkeys(system.states, (-5, 5)), options=AttractorOptions(starts=16, samples=200)
    )
    assert dict(found.kinds) == {"repulsive": "period-47"}
    assert found.orbits["repulsive"].form.turns == 47
    assert found.fates["repulsive"] == 16


@pytest.mark.thorough
@pytest.mark.campaign
def test_next_to_a_period_doubling_the_slow_orbit_and_the_one_beside_it_are_told_apart():
    system = afm.tapping_mode(afm.table1(), modes=2, parameters={"Omega": 1.163})
    found = find_attractors(
        system, {}, dict.fromkeys(system.states, (-5, 5)), options=AttractorOptions(starts=64, samples=400)
    )
    assert dict(found.kinds) == {"attractive": "period-1", "repulsive A": "period-1", "repulsive B": "period-4"}
    assert float(np.abs(found.orbits["repulsive A"].multipliers).max()) == pytest.approx(0.987, abs=5e-4)
    assert found.fates["undecided"] == found.fates["diverged"] == 0
    assert min(found.fates[name] for name in found.names) > 0


@pytest.mark.campaign
def test_henon_map_is_chaotic_or_diverges():
    system = carried(("x", "y"), {"a": 1.4, "b": 0.3}, {"x": "a - x**2 + b*y", "y": "x"})
    search = AttractorOptions(samples=100, longest=2000)
    found = find_attractors(system, {}, {"x": (-2, 2), "y": (-2, 2)}, options=replace(search, starts=8))
    assert found.names == ("chaotic",)
    assert not found.orbits
    assert np.abs(found.points["chaotic"]).max() < 1.8  # as it does for the classical parameters
    assert "none of 128 motions left it" in found.notes["chaotic"]
    labels, strobes = Ensemble(system, {}).settle([[0.0, 0.0], [2.5, 0.0]], found.traps)
    assert labels.tolist() == [0, 253]
    assert strobes[0] >= 16


@pytest.mark.campaign
def test_delayed_logistic_map_is_quasi_periodic():
    image = {"x": "y", "y": "a*y*(1 - x)"}
    search = AttractorOptions(samples=100, longest=2000)
    system = carried(("x", "y"), {"a": 2.1}, image)
    found = find_attractors(system, {}, {"x": (0.3, 0.7), "y": (0.3, 0.7)}, options=replace(search, starts=4))
    assert found.names == ("quasi-periodic",)
    centre = 1.0 - 1.0 / 2.1
    assert np.linalg.norm(found.points["quasi-periodic"] - centre, axis=1).min() > 0.05  # round the fixed point


def test_equilibria_of_a_system_without_a_phase_are_at_rest():
    system = HybridSystem(("x", "v"), {}, {"free": Mode({"x": "v", "v": "x - x**3 - 0.3*v"})})
    found = find_attractors(system, {}, {"x": (-2, 2), "v": (-2, 2)}, options=replace(QUICK, starts=16, interval=1.7))
    assert found.names == ("rest A", "rest B")
    assert [float(found.points[name][0, 0]) for name in found.names] == pytest.approx([-1.0, 1.0], abs=1e-8)
    assert found.interval == 1.7


@pytest.mark.campaign
def test_a_limit_cycle_is_seen_as_a_closed_curve_though_the_looks_lock_to_it():
    system = HybridSystem(("x", "v"), {}, {"free": Mode({"x": "v", "v": "-x + (1 - x**2)*v"})})
    region = {"x": (-3, 3), "v": (-3, 3)}
    search = AttractorOptions(samples=100, longest=1200)
    found = find_attractors(system, {}, region, options=replace(search, starts=4, interval=1.0))
    assert found.names == ("limit cycle",)
    assert found.orbits["limit cycle"].period == pytest.approx(6.6632868593, abs=1e-8)
    assert "boxes" in found.notes["limit cycle"]
    for part in (1.0, 2.0, 3.0, 17.0 / 4.0):
        locked = find_attractors(system, {}, region, options=replace(search, starts=4, interval=6.6632868593 / part))
        assert locked.names == ("limit cycle",)
        assert locked.fates["undecided"] == 0


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"region": None}, "region = .*must be given for each of x, v"),
        ({"region": {"x": (-1, 1)}}, r"region = \['x'\]: must be given for each of x, v; 'v' is missing"),
        ({"region": {"x": (-1, 1), "y": 0}}, "region = 'y': must be one of x, v"),
        ({"region": {"x": (1, -1), "v": 0}}, r"region\['x'\] = \(1.0, -1.0\): must be finite, the lower end first"),
        ({"region": {"x": (0, 1, 2), "v": 0}}, r"region\['x'\] = \(0, 1, 2\): must be the two ends of an interval"),
        ({"options": AttractorOptions(interval=1.0)}, "interval = 1.0: must be given for a system without a phase"),
        ({"options": 3}, "options = 3: must be an AttractorOptions"),
    ],
)
def test_each_unusable_argument_is_named(change, message):
    arguments = {"region": BOX, "options": QUICK} | change
    with pytest.raises(InputError, match=message):
        find_attractors(duffing(), {}, **arguments)


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"starts": 0}, "AttractorOptions.starts = 0: must be an integer >= 1"),
        ({"interval": 0.0}, "AttractorOptions.interval = 0.0: must be a finite number > 0"),
        ({"rng": "any"}, "AttractorOptions.rng = 'any': must be an integer >= 0"),
        ({"samples": 10}, "AttractorOptions.samples = 10: must be an integer >= 100"),
        ({"safety": 1.5}, "AttractorOptions.safety = 1.5: must be a number between 0 and 1"),
        ({"tolerance": 0.0}, "AttractorOptions.tolerance = 0.0: must be a finite number > 0"),
        ({"criteria": "strict"}, "AttractorOptions.criteria = 'strict': must be a Criteria"),
    ],
)
def test_each_unusable_option_of_a_search_is_named(options, message):
    with pytest.raises(InputError, match=message):
        AttractorOptions(**options)


@pytest.mark.campaign
@pytest.mark.parametrize("n", [1, 2])
def test_tapping_mode_has_an_attractive_and_a_repulsive_motion(n):
    system = afm.tapping_mode(afm.table1(), modes=n, parameters={"Omega": 1.15, "D_att": 0.025, "D_rep": 4.0})
    found = find_attractors(system, {}, dict.fromkeys(system.states, (-5, 5)), options=AttractorOptions(samples=5000))
    assert found.names == ("attractive", "repulsive")
    assert found.labels["attractive"] == 0
    assert found.orbits["attractive"].signature == (("flight", "theta"),)
    assert {mode for mode, _ in found.orbits["repulsive"].signature} == {"flight", "contact"}
    assert "a theorem" in found.notes["attractive"]
    assert found.fates["undecided"] == found.fates["diverged"] == 0
    if n == 2:
        assert found.points["repulsive"][0, [1, 3]] == pytest.approx([-0.02950, 0.48413], abs=5e-6)


@pytest.mark.campaign
def test_where_states_allow_two_modes_a_trap_holds_motions_in_one():
    """A relay with hysteresis: for |x| < 0.6 both modes go on as they are."""
    field = "-0.1*v - (x {} 0.3) + 0.02*cos(s)"
    relay = HybridSystem(
        ("x", "v"),
        {"w": 1.7},
        {"low": Mode({"x": "v", "v": field.format("+")}), "high": Mode({"x": "v", "v": field.format("-")})},
        [Transition("low", "high", "x - 0.6", 1), Transition("high", "low", "x + 0.6", -1)],
        phase=("s", "w"),
    )
    found = find_attractors(relay, {}, {"x": (-2, 2), "v": (-2, 2)}, options=AttractorOptions(samples=2000))
    assert len(found.names) == 2
    assert (found.traps.ellipsoids.modes == 0).all()
    x = np.random.default_rng(1).uniform(-2.0, 2.0, (2000, 2))
    labels, _ = Ensemble(relay).settle(x, found.traps)
    ends, _ = Ensemble(relay).strobe(x, count=200)
    sides = [found.points[name][0, 0] > 0.0 for name in found.names]
    assert np.array_equal(np.array(sides)[labels], ends[:, 0] > 0.0)


def test_a_plane_may_go_through_the_sample_itself():
    found = find_attractors(duffing(), {}, BOX, options=AttractorOptions(starts=16, samples=400, safety=1.0))
    assert len(found.names) == 2


def test_what_is_nearer_to_an_attractor_is_within_its_planes_too(wells):
    from saltus.basins.map.labelling import _nearer

    points = {label: wells.points[name] for label, name in enumerate(wells.names)}
    nearer = _nearer(wells.traps, points, None)
    x = np.random.default_rng(3).uniform(-1e-4, 1e-4, (2000, 2))
    for label, own in points.items():
        told = [(nearer.of(row, 0), wells.traps.of(row, 0)) for row in own[0] + x]
        assert {pair for pair in told if pair[0] != UNDECIDED} == {(label, label)}
