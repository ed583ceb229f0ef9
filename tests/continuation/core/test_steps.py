"""Steps along a branch: what they may not pass over, and where a branch ends."""

from __future__ import annotations

import cmath
import math

import numpy as np
import pytest
from scipy.optimize import brentq

import systems
from oracles.closed_forms import CUSP, LOGISTIC, ImpactOrbit, logistic_cycle
from saltus import (
    HybridSystem,
    Mode,
    StepControl,
    continue_equilibrium,
    continue_orbit,
    find_equilibrium,
    find_orbit,
    simulate,
    solve_orbit,
    switch_branch,
)
from saltus.afm import table1, tapping_mode
from saltus.continuation.core.zero_problem import correct
from saltus.orbits.stability.floquet import height, passage
from selection import guarding

STEPS = [StepControl(largest=0.03), None, StepControl(initial=0.05, largest=0.3)]


def carried(image, **parameters):
    return systems.carried_map(tuple(image), parameters, image)


def cycle(system, points, **parameters):
    """The orbit through the given points of a carried map."""
    return solve_orbit(system, parameters, [("carry", "map", [*np.atleast_1d(x), 0.0], 1.0) for x in points])


def values(branch, kind):
    return sorted(p.parameters[branch.parameter] for p in branch.special_points if p.type == kind)


def counts(branch):
    kinds = [p.type for p in branch.special_points]
    return {kind: kinds.count(kind) for kind in sorted(set(kinds))}


def turned(x, y, radius, c="c1", s="s1"):
    """Image of (x, y) turned about (1, 1) by the angle whose cosine and sine are c and s, and stretched."""
    return f"1 + ({radius})*({c}*({x} - 1) - {s}*({y} - 1))", f"1 + ({radius})*({s}*({x} - 1) + {c}*({y} - 1))"


# several multipliers cross in one step


OUT, IN = "1 + (a - first)/2", "1 - (a - second)/2"
"""Sizes of multipliers that leave the unit circle, and that come back."""


@pytest.fixture(scope="module")
def two_pairs():
    images = (*turned("x", "y", OUT), *turned("z", "w", IN, "c2", "s2"))
    names = ("a", "first", "second", "c1", "s1", "c2", "s2")
    return carried(dict(zip("xyzw", images, strict=True)), **dict.fromkeys(names, 0.0))


@pytest.fixture(scope="module")
def two_reals():
    return carried({"x": f"1 - ({OUT})*(x - 1)", "y": f"1 - ({IN})*(y - 1)"}, a=0.0, first=0.0, second=0.0)


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("apart", [1e-1, 1e-2, 1e-3, 1e-4])
@pytest.mark.parametrize("angles", [(0.7, 2.0), (1.1, 1.2), (0.1, 3.0)])
def test_two_pairs_that_cross_in_opposite_ways_are_both_found(two_pairs, angles, apart, steps):
    first, second = 0.37, 0.37 + apart
    turns = {f"{name}{i}": of(angles[i - 1]) for name, of in (("c", math.cos), ("s", math.sin)) for i in (1, 2)}
    start = cycle(two_pairs, [(1.0, 1.0, 1.0, 1.0)], first=first, second=second, **turns)
    branch = continue_orbit(start, "a", (-0.5, 1.0), steps=steps)
    assert counts(branch) == {"TR": 2}
    np.testing.assert_allclose(values(branch, "TR"), [first, second], atol=1e-10)


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("apart", [1e-1, 1e-2, 1e-3, 1e-4])
def test_two_real_multipliers_that_cross_in_opposite_ways_are_both_found(two_reals, apart, steps):
    first, second = 0.37, 0.37 + apart
    start = cycle(two_reals, [(1.0, 1.0)], first=first, second=second)
    branch = continue_orbit(start, "a", (-0.5, 1.0), steps=steps)
    assert counts(branch) == {"PD": 2}
    np.testing.assert_allclose(values(branch, "PD"), [first, second], atol=1e-10)


@pytest.fixture(scope="module")
def turning_back():
    """Maps whose multipliers have the size 1 + height - (a - 0.37)^2: a pair, or a negative one."""
    size = "1 + height - (a - 0.37)**2"
    pair = dict(zip("xy", turned("x", "y", size), strict=True))
    real = {"x": f"1 - ({size})*(x - 1)", "y": "1 + (y - 1)/2"}
    return {
        "TR": carried(pair, a=0.0, height=0.0, c1=math.cos(0.8), s1=math.sin(0.8)),
        "PD": carried(real, a=0.0, height=0.0),
    }


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("half", [3e-2, 3e-3, 3e-4])
@pytest.mark.parametrize("kind", ["TR", "PD"])
def test_a_multiplier_that_crosses_and_comes_back_is_found_twice(turning_back, kind, half, steps):
    start = cycle(turning_back[kind], [(1.0, 1.0)], height=half**2)
    branch = continue_orbit(start, "a", (-0.5, 1.0), steps=steps)
    assert counts(branch) == {kind: 2}
    np.testing.assert_allclose(values(branch, kind), [0.37 - half, 0.37 + half], atol=1e-9)


def test_a_multiplier_that_nearly_crosses_is_not_found(turning_back):
    for depth in (1e-3, 1e-5, 1e-7):
        branch = continue_orbit(cycle(turning_back["TR"], [(1.0, 1.0)], height=-depth), "a", (-0.5, 1.0))
        assert counts(branch) == {}
        assert branch.stable.all()


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("excess", [1e-1, 1e-2, 1e-3, 1e-4])
def test_two_folds_near_a_cusp_are_both_found(excess, steps):
    """The folds lie at r = +-2 (excess/3)^(3/2), on a branch of which they are a tiny part."""
    fold = 2 * (excess / 3) ** 1.5
    start = brentq(lambda x: -0.3 + excess * x - x**3, -2.0, 2.0, xtol=1e-15)
    branch = continue_orbit(cycle(carried(CUSP, r=-0.3, h=1 + excess), [start]), "r", (-0.4, 0.5), steps=steps)
    assert counts(branch) == {"SN": 2}
    np.testing.assert_allclose(values(branch, "SN"), [-fold, fold], atol=1e-10)


@pytest.fixture(scope="module")
def near_resonance():
    return carried({"x": "x + y", "y": "(1 + nu)*y + p + x**2 + c*x*y"}, p=-0.25, nu=0.0, c=1.0)


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("apart", [1e-1, 1e-2, 1e-3])
@pytest.mark.parametrize("side", [-1.0, 1.0])
@pytest.mark.parametrize("c", [1.0, 3.0])
def test_a_fold_and_a_torus_point_close_to_the_resonance_one_are_both_found(near_resonance, c, side, apart, steps):
    """Fixed points y = 0, p + x^2 = 0 fold at x = 0; at x = +-apart the determinant is 1 and the trace 2 + 2 x."""
    start = cycle(near_resonance, [(0.5, 0.0)], nu=side * apart * (2.0 - c), c=c)
    branch = continue_orbit(start, "p", (-0.3, 0.1), steps=steps)
    assert values(branch, "SN") == pytest.approx([0.0], abs=1e-10)
    assert values(branch, "TR") == pytest.approx([-(apart**2)] if side < 0.0 else [], abs=1e-9)


@pytest.mark.parametrize("share", [1e-2, 1e-4, 1e-6])
def test_an_event_that_is_met_twice_near_a_maximum_is_found_twice(share):
    """The linear oscillator's largest deflection over the frequency, a little below its maximum."""
    size = lambda w: 0.05 / ImpactOrbit(w).impedance  # noqa: E731
    top = math.sqrt(1.0 - 0.1**2 / 2.0)
    level = size(top) * (1.0 - share)
    expected = [brentq(lambda w: size(w) - level, *ends, xtol=1e-14) for ends in ((0.7, top), (top, 1.4))]
    form = ImpactOrbit(0.7)
    segments = [("free", "theta", form.linear_response(0.05)[1], form.period)]
    orbit = solve_orbit(systems.impact_oscillator(), {"w": 0.7, "A": 0.05}, segments)
    branch = continue_orbit(orbit, "w", (0.7, 1.4), events={"max_x": level})
    assert values(branch, "max_x") == pytest.approx(expected, abs=1e-8)


# correction


class Circle:
    """The unit circle as a zero problem whose mesh is fine enough only after so many evaluations."""

    singular = frozenset()
    continuous = ()

    def __init__(self, patience):
        self.patience, self.evaluations = patience, 0

    def evaluate(self, u):
        self.evaluations += 1
        return np.array([u @ u - 1.0]), 2.0 * u[None, :]

    def accurate(self, *, met=True):
        return self.evaluations >= self.patience

    def scale(self):
        return np.ones(2)


@pytest.mark.parametrize("patience", [1, 10, 20])
def test_a_point_that_is_found_waits_until_its_mesh_is_fine(patience):
    problem = Circle(patience)
    point = correct(problem, np.array([1.0, 0.3]), np.array([0.0, 1.0]), np.ones(2), 7)
    assert point.u == pytest.approx([math.sqrt(1.0 - 0.09), 0.3], abs=1e-15)
    assert problem.evaluations == max(patience, 4)


def test_a_mesh_that_never_becomes_fine_is_given_up():
    problem = Circle(math.inf)
    point = correct(problem, np.array([1.0, 0.3]), np.array([0.0, 1.0]), np.ones(2), 7)
    assert point == "Newton: too many iterations"
    assert problem.evaluations < 40


# pairing of multipliers


def test_pairs_follow_the_nearest_multiplier_on_the_sphere():
    before = (1e6 + 0j, 0.9 + 0j, 0.2 + 0.3j, 0.2 - 0.3j)
    way = passage(before, [0.21 - 0.3j, 0.21 + 0.3j, -1e6 + 0j, 0.95 + 0j])
    assert way.followed == (-1e6 + 0j, 0.95 + 0j, 0.21 + 0.3j, 0.21 - 0.3j)
    assert (way.real, way.pairs, way.sure) == (0, 0, True)


def test_an_infinite_multiplier_is_near_a_large_one_of_either_sign():
    way = passage((complex(math.inf), 0.1 + 0j), [0.1 + 0j, -1e9 + 0j])
    assert way.followed == (-1e9 + 0j, 0.1 + 0j)
    assert way.sure


def test_crossings_are_counted_by_multiplier_and_by_pair():
    pair, out = cmath.rect(0.99, 1.0), cmath.rect(1.01, 1.0)
    way = passage((pair, pair.conjugate(), -0.99 + 0j), [-1.01 + 0j, out.conjugate(), out])
    assert way.followed == (out, out.conjugate(), -1.01 + 0j)
    assert (way.real, way.pairs, way.sure) == (1, 1, True)


def test_a_pair_that_becomes_real_with_one_side_out_crosses_once():
    way = passage((0.97 + 0.02j, 0.97 - 0.02j), [1.02 + 0j, 0.93 + 0j])
    assert (way.real, way.pairs) == (1, 0)


def test_it_is_not_sure_which_of_two_near_multipliers_crossed():
    assert not passage((0.99 + 0j, 1.01 + 0j), [0.998 + 0j, 1.001 + 0j]).sure
    assert passage((0.9 + 0j, 1.1 + 0j), [0.91 + 0j, 1.09 + 0j]).sure
    assert passage((0.99 + 0j, 0.98 + 0j), [0.985 + 0j, 0.99 + 0j]).sure  # all inside: no matter which is which


def test_height_is_that_on_the_sphere():
    assert height(0j) == -1.0
    assert height(1j) == 0.0
    assert height(complex(math.inf)) == 1.0
    assert height(complex(math.inf, math.nan)) == 1.0
    assert height(3.0 + 4.0j) == pytest.approx(24.0 / 26.0)


# where a branch ends


@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize("period", [2, 4])
def test_a_doubled_cycle_ends_at_its_birth_to_all_digits(period, steps):
    parent = {2: 3.0, 4: 1.0 + math.sqrt(6.0)}[period]
    a = parent + 0.05
    orbit = cycle(carried(LOGISTIC, a=a), logistic_cycle(a, period))
    branch = continue_orbit(orbit, "a", (parent - 0.3, a + 0.01), steps=steps)
    assert counts(branch) == {"BP": 1}
    assert values(branch, "BP") == pytest.approx([parent], abs=1e-12)
    assert set(branch.stopped) == {f"a = {parent:.9g}: the period halves", f"a = {a + 0.01:.9g}: bound reached"}
    born = branch["BP1"].orbit.states[:, 0]
    np.testing.assert_allclose(born[: period // 2], born[period // 2 :], atol=1e-12)


DUFFING = HybridSystem(
    ("x", "v"), {"A": 0.2, "w": 1.2}, {"m": Mode({"x": "v", "v": "-0.3*v + x - x**3 + A*cos(s)"})}, phase=("s", "w")
)
ROESSLER = HybridSystem(
    ("x", "y", "z"), {"c": 2.6}, {"m": Mode({"x": "-y - z", "y": "x + 0.2*y", "z": "0.2 + z*(x - c)"})}
)


@pytest.mark.parametrize(
    ("system", "name", "single", "double", "start", "bounds"),
    [
        (DUFFING, "A", 0.2, 0.28, [1.0, 0.0], (0.15, 0.285)),
        (ROESSLER, "c", 2.6, 3.2, [3.0, 1.0, 0.0], (2.3, 3.25)),
    ],
)
def test_motions_without_events_halve_their_period_where_they_doubled_it(system, name, single, double, start, bounds):
    once = continue_orbit(find_orbit(system, {name: single}, start), name, bounds)
    twice = find_orbit(system, {name: double}, start)
    branch = continue_orbit(twice, name, bounds)
    assert twice.period == pytest.approx(2.0 * once["PD1"].orbit.period, rel=0.1)
    assert values(branch, "BP") == pytest.approx(values(once, "PD")[:1], abs=1e-10)
    assert any(reason.endswith(": the period halves") for reason in branch.stopped)


@pytest.mark.campaign
def test_a_pitchfork_that_is_no_period_doubling_does_not_end_a_branch():
    orbit = cycle(carried({"x": "x + r*x - x**3"}, r=0.25), [0.5])
    branch = continue_orbit(orbit, "r", (-0.5, 0.5))
    assert values(branch, "BP") == pytest.approx([0.0], abs=1e-9)
    assert [reason.split(": ")[1] for reason in branch.stopped] == ["bound reached"] * 2


# the cantilever with two modes; each orbit lies near a place where a branch was lost, or a point of it


def tapping(parameters, *segments):
    values = dict(zip(("Omega", "ybar", "D_att_1", "D_att_2", "D_rep_1", "D_rep_2"), parameters, strict=True))
    modes = ("flight", "contact") * len(segments)
    ends = ("touch", "release") * len(segments)
    rows = [(mode, end, x, duration) for mode, end, (*x, duration) in zip(modes, ends, segments, strict=False)]
    return solve_orbit(tapping_mode(table1(), modes=2), values, rows)


SLOW = (
    (1.0637402, 0.0933768351, 0.0589714646, 0.012298703, 7.21528468, 16.0101375),
    (1.084162, -0.0030746, 0.0217201, 0.0085703, 4.2708299, 5.8777759),
    (1.0830054, -0.0031851, 0.0595813, -0.0017357, 10.5232564, 0.0289157),
)
ARRIVES = (
    (0.891155385, 0.133528481, 0.036630872, 0.0420076186, 28.7682861, 3.60656057),
    (0.8550424, 0.0114022, -0.0257722, 0.049072, 1.7937989, 7.0292692),
    (0.8556657, 0.010241, -0.0334283, 0.0597499, 8.0579701, 0.0213365),
)
LEAVES = (
    (0.906389696, 0.116294829, 0.0547599056, 0.0444447662, 25.8956365, 2.39832894),
    (0.8969635, -0.0106294, -0.008623, 0.0407515, 1.8923958, 6.8941161),
    (0.8969617, -0.0118276, 0.01204, 0.0217547, 8.1411516, 0.0379853),
)
DIPS = (
    (0.977278282, 0.122270473, 0.0512580912, 0.0225769263, 13.9765648, 0.974096376),
    (0.9056236, -0.016359, -0.0534525, 0.0125069, 2.069094, 6.0759565),
    (0.889905, -0.0140802, 0.6022747, 0.0468543, 8.0069943, 0.3533129),
)
TOUCHES = (
    (1.03011461, 0.0643894984, 0.0283523128, 0.0437247368, 0.774415018, 2.6229695),
    (0.9567004, 0.0190164, -0.3251657, 0.2519139, 2.810198, 5.3897564),
    (0.9286231, 0.0117941, 0.745119, -0.2350055, 8.3622648, 0.7097448),
)
CROSSES = (
    (1.04866967, 0.134727431, 0.0499053387, 0.0320020931, 0.877676561, 6.16275506),
    (0.9076749, 0.0165897, -0.3000718, 0.3736561, 2.5742462, 5.3268546),
    (0.8268415, 0.0413716, 1.0335966, -0.2290885, 8.1603571, 0.3769019),
    (0.9674105, -0.0736482, -0.1015113, 0.0148509, 8.5556026, 0.2595684),
    (0.916028, 0.0049027, -0.291197, 0.453859, 8.8278042, 0.0282524),
)
FOUR_TURNS = (
    (1.17751499, 0.137779629, 0.0160554333, 0.0223305266, 8.56570014, 6.56086509),
    (1.0617664, -0.0650723, -0.1479431, 0.2124201, 3.141792, 5.0282961),
    (1.0089417, -0.0610809, 1.4815132, 0.2486274, 9.062686, 0.2967562),
    (1.0651558, -0.070233, -0.2229822, 0.0313141, 9.4121208, 4.9741759),
    (1.0054891, -0.0673431, 1.5157432, -0.0692928, 15.2692874, 0.3650439),
    (1.0664828, -0.0710328, -0.1690223, 0.2318559, 15.6991321, 0.172491),
    (1.0227926, 0.0004737, -0.3361436, 0.5175477, 15.9022428, 0.0345216),
    (1.012276, 0.0164622, -0.276094, 0.409253, 15.9428926, 4.8693695),
    (0.995238, -0.0411923, 1.454227, 0.3189531, 21.6766481, 0.2791435),
    (1.0553212, -0.0566988, -0.2166956, -0.0645393, 22.0053438, 4.9591466),
    (0.9883767, -0.0490863, 1.5117662, -0.1671458, 27.8448132, 0.364938),
)


def assert_motions(orbits):
    """Each is a motion by the event-driven simulation, which knows nothing of signatures."""
    for orbit in orbits:
        largest = np.abs(orbit.multipliers).max()
        if largest < 1e4:
            motion = simulate(orbit.system, orbit.parameters, orbit.x0, periods=orbit.form.turns)
            np.testing.assert_allclose(motion.x_end[:4], orbit.x0, atol=1e-9 * max(largest, 1.0))


def test_a_branch_leaves_a_grazing_on_its_admissible_side_however_slowly_it_does():
    branch = continue_orbit(tapping(*SLOW), "ybar", (0.093, 0.1))
    assert counts(branch)["GR"] == 1
    assert branch.admissible[np.abs(branch.multipliers).max(axis=1) < 1e10].all()
    assert {reason.split(": ")[1] for reason in branch.stopped} == {"bound reached"}
    assert {len(form) for form in branch.forms} == {1, 2}


@pytest.mark.parametrize(
    ("start", "bounds", "mode"), [(ARRIVES, (0.8905, 0.893), "contact"), (LEAVES, (0.905, 0.907), "flight")]
)
def test_beyond_a_grazing_where_no_branch_goes_on_motions_part_at_once(start, bounds, mode):
    """A surface is met without velocity, and the motion bent away from it on both sides: displaced, it goes far."""
    branch = continue_orbit(tapping(*start), "Omega", bounds)
    (end,) = (i for i, reason in ((0, branch.stopped[0]), (-1, branch.stopped[1])) if "grazing" in reason)
    assert branch.stopped[end].endswith(f"the motion in '{mode}' does not turn back, so no orbit near it goes on")
    orbit = branch.solution(end)
    touching = {"contact": 1, "flight": 0}[mode]
    gaps = []
    for shift in (-1e-9, 1e-9):
        x = orbit.states[touching].copy()
        x[0] += shift
        gaps.append(simulate(branch.system, orbit.parameters, x, t_end=5e-3).output("z", 5e-3) - 1.0 / 300.0)
    assert gaps[0] > 1e-7
    assert gaps[1] < -1e-7


def test_no_orbit_is_kept_whose_flight_dips_through_the_surface_at_its_start():
    branch = continue_orbit(tapping(*DIPS), "Omega", (0.977, 0.995), directions="up")
    assert branch.values[-1] == pytest.approx(0.98935746, abs=5e-9)  # at 0.98934549 the next segment has no velocity
    assert_motions(branch.solution(i) for i in range(len(branch) - 1))  # at the end itself, motions part


@pytest.mark.campaign
@pytest.mark.parametrize("steps", STEPS)
@pytest.mark.parametrize(
    ("start", "bounds", "expected"),
    [
        (TOUCHES, (1.03, 1.0335), {"GR": 1, "PD": 1, "TR": 1}),
        (CROSSES, (1.0288, 1.0488), {"GR": 1, "TR": 1}),
    ],
)
def test_a_branch_through_a_grazing_has_the_same_points_there_and_back(start, bounds, expected, steps):
    there = continue_orbit(tapping(*start), "Omega", bounds, steps=steps)
    found = counts(there)
    assert {kind: found.get(kind, 0) for kind in expected} == expected
    for end in (0, -1):
        back = continue_orbit(there.solution(end), "Omega", bounds, steps=steps)
        assert counts(back) == found
        for kind in found:
            np.testing.assert_allclose(values(back, kind), values(there, kind), atol=1e-9, err_msg=kind)


@pytest.mark.campaign
def test_beyond_a_grazing_that_makes_two_halves_alike_the_orbit_is_followed_once_round():
    branch = continue_orbit(tapping(*FOUR_TURNS), "D_rep_2", (6.0, 8.0))
    assert {form.turns for form in branch.forms} == {2, 4}
    assert counts(branch)["GR"] == 1
    assert sum(reason.endswith("the period halves") for reason in branch.stopped) == 1
    assert_motions(branch)


@pytest.mark.campaign
@pytest.mark.parametrize("index", [0, 3, 9])
def test_a_branch_leaves_a_grazing_of_two_halves_by_the_contact_that_ends_from_any_start(index):
    branch = continue_orbit(tapping(*FOUR_TURNS), "D_rep_2", (6.0, 8.0))
    other = continue_orbit(branch.solution(index), "D_rep_2", (6.0, 8.0))
    assert [point.label for point in other.special_points] == [point.label for point in branch.special_points]
    assert values(other, "BP") == pytest.approx(values(branch, "BP"), abs=1e-8)
    assert [len(form) for form in other.forms] == [len(form) for form in branch.forms]
    assert {len(form) for form in other.forms} == {10, 4}


@pytest.fixture(scope="module")
def nerve():
    """Return the cycles at the upper birth of FitzHugh's nerve; they explode at both ends of their interval."""
    system = HybridSystem.smooth(
        {"v": "v - v**3/3 - w + I", "w": "e*(v + a - b*w)"}, {"a": 0.7, "b": 0.8, "e": 0.08, "I": 0.0}
    )
    rests = continue_equilibrium(find_equilibrium(system, {}, [-1.2, -0.6]), "I", (-0.5, 2.0))
    return switch_branch(rests["HB1"])


@pytest.mark.campaign
@pytest.mark.parametrize("stretch", guarding([0.93, 0.98, 1.0, 1.01, 1.02, 1.07], campaign=3))
def test_a_step_that_ended_far_away_leaves_nothing_to_the_shorter_ones(nerve, stretch):
    steps = StepControl(initial=0.01 * stretch, largest=0.1 * stretch)
    branch = continue_orbit(nerve, "I", (-0.5, 2.0), steps=steps)
    assert sorted((p.type, round(p.parameters["I"], 8)) for p in branch.special_points) == [
        ("HB", 0.33128134),
        ("HB", 1.41871866),
        ("SN", 0.32417852),
        ("SN", 1.42582148),
    ]
