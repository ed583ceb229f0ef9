"""Loci of the paper's tapping cantilever: their points are the special points of independent branches."""

from __future__ import annotations

import math
from functools import cache

import numpy as np
import pytest

from oracles.tapping import Tapping
from saltus import StepControl, continue_locus, continue_orbit, solve_orbit
from saltus.afm import table1, tapping_mode
from selection import guarding

STARTS = {
    1: (1.0, [-0.48489216, 0.8003283], (0.85, 1.3)),
    2: (1.15, [-1.23947331, -0.02950304, 0.40286884, 0.48412771], (0.9, 1.3)),
}

BOUNDS = {"Omega": (0.8, 1.4), "ybar": (0.03, 0.25), "D_att_1": (0.01, 0.06), "D_rep_1": (1.5, 8.0)}

PAIRS = [("Omega", "ybar"), ("ybar", "D_att_1"), ("D_rep_1", "Omega"), ("D_att_1", "Omega"), ("ybar", "D_rep_1")]

WIDTH = {"Omega": 0.01, "ybar": 0.004, "D_att_1": 0.002, "D_rep_1": 0.3}
"""How far from a locus an independent branch starts, and thrice that how far it goes."""


def branch_in_frequency(modes):
    Omega, x, bounds = STARTS[modes]
    system = tapping_mode(table1(), modes=modes)
    _, ((t1, touch), (t2, release)) = Tapping(modes, Omega).map(np.array(x), 1e-7)
    end = 2.0 * math.pi / Omega - t2
    segments = [("flight", "touch", x, t1), ("contact", "release", touch, t2 - t1), ("flight", "theta", release, end)]
    return continue_orbit(solve_orbit(system, {"Omega": Omega}, segments), "Omega", bounds)


@pytest.fixture(scope="module")
def branches():
    return {modes: branch_in_frequency(modes) for modes in STARTS}


@pytest.fixture(scope="module")
def locus_of(branches):
    """Return the locus of a special point of a branch in frequency and amplitude; each is computed once."""
    bounds = {name: BOUNDS[name] for name in ("Omega", "ybar")}

    @cache
    def locus(modes, label):
        return continue_locus(branches[modes][label], ("Omega", "ybar"), bounds)

    return locus


def random_cases(count):
    rng = np.random.default_rng(20260401)
    for i in range(count):
        modes = 1 + i % 2
        kind = ("SN", "PD", "GR", "SN", "SN")[i // 2 % 5]
        yield modes, kind, PAIRS[i % len(PAIRS)], float(rng.uniform(0.15, 0.85)), int(rng.integers(1 << 30))


def independent(orbit, name, where):
    """Special points of a branch in one parameter that starts at an orbit which is not critical, apart from the locus.

    The start is a corrected orbit a little along the branch; the branch itself starts there anew and comes back.
    """
    low, high = where - 3.0 * WIDTH[name], where + 3.0 * WIDTH[name]
    away = continue_orbit(orbit, name, (low, high))
    distances = np.abs(away.values - where)
    regular = [
        i for i in range(len(away)) if distances[i] > 1e-4 * WIDTH[name] and np.isfinite(away.multipliers[i]).all()
    ]
    starts = [regular[len(regular) // 4], regular[(3 * len(regular)) // 4]]
    found = []
    for start in starts:
        found += list(continue_orbit(away.solution(start), name, (low, high)).special_points)
    return found


@pytest.mark.campaign
@pytest.mark.parametrize(("modes", "kind", "pair", "share", "seed"), guarding(random_cases(24), campaign=6))
def test_points_of_a_locus_are_special_points_of_independent_branches(branches, modes, kind, pair, share, seed):
    rng = np.random.default_rng(seed)
    points = branches[modes].special_points.of_type(kind)
    if not points:
        points = branches[modes].special_points.of_type("SN")
    start = points[int(rng.integers(len(points)))]
    locus = continue_locus(start, pair, {name: BOUNDS[name] for name in pair})
    assert len(locus) > 5, locus
    assert locus.residual.max() < 1e-9
    i = round(share * (len(locus) - 1))
    orbit = locus.solution(i)
    # the locus is crossed by a branch in a parameter only if the other one, too, varies along it
    steep = np.argsort([np.ptp(locus.column(name)) / (BOUNDS[name][1] - BOUNDS[name][0]) for name in pair])
    varies = np.ptp(locus.column(pair[int(steep[0])])) > 1e-9
    name = pair[int(steep[int(varies and rng.integers(2))])]
    where = orbit.parameters[name]
    same = [p for p in independent(orbit, name, where) if p.type == start.type]
    assert same, (locus, i, name)
    assert min(abs(p.parameters[name] - where) for p in same) < 1e-8


@pytest.mark.campaign
@pytest.mark.thorough
@pytest.mark.parametrize("modes", [1, 2])
def test_every_locus_of_the_response_is_critical_all_along(branches, locus_of, modes):
    """Of orbits computed anew: multipliers at 1 or -1, or contacts without velocity."""
    for start in branches[modes].special_points:
        locus = locus_of(modes, start.label)
        assert len(locus) > 5, locus
        # on a grazing itself the others are not determined
        met = [p.position for p in locus.special_points.of_type("GR") if start.type != "GR"]
        for i in range(0, len(locus), 8):
            if min((abs(i - where) for where in met), default=9.0) < 1.0:
                continue
            orbit = locus.solution(i)
            if start.type == "GR":
                height = float(min(abs(orbit.min["z"] - orbit.parameters["a0"] / orbit.parameters["eta"]), 1.0))
                assert height < 1e-8 or min(orbit.durations) < 1e-8
                continue
            if start.type == "TR" and math.isnan(locus.angle[i]):
                raise AssertionError(f"{start.label}, point {i}: no angle")
            critical = {"SN": 1.0, "PD": -1.0}.get(start.type) or np.exp(1j * locus.angle[i])
            finite = orbit.multipliers[np.isfinite(orbit.multipliers)]
            # where another multiplier is near, as at a resonance, the characteristic polynomial is what vanishes
            distances = np.sort(np.abs(finite - critical))
            # on a mesh of their own: next to a grazing, rounding of the orbit is multiplied by thousands
            assert distances[0] * min(1.0, distances[1]) < 1e-7, (start.label, i, orbit.multipliers)
            own = np.sort(np.abs(locus.multipliers[i] - critical))
            assert own[0] < 1e-8 or own[1] < 0.01, (start.label, i, own)


@pytest.mark.campaign
def test_the_doubling_locus_ends_on_the_grazing_locus_where_that_one_meets_it(branches, locus_of):
    """Found twice: as a grazing on the PD locus, and as a doubling of the motion without contact on the GR locus."""
    ends, meetings = [], []
    for start in branches[1].special_points.of_type("PD", "GR"):
        locus = locus_of(1, start.label)
        wanted = "GR" if start.type == "PD" else "PD"
        found = [(p.parameters["Omega"], p.parameters["ybar"]) for p in locus.special_points.of_type(wanted)]
        (ends if start.type == "PD" else meetings).extend(found)
    assert ends
    for end in ends:
        assert min(np.abs(np.subtract(end, place)).max() for place in meetings) < 1e-8


@pytest.mark.campaign
def test_loci_do_not_depend_on_where_they_start(locus_of):
    bounds = {name: BOUNDS[name] for name in ("Omega", "ybar")}
    for label in ("SN1", "PD1", "GR1"):
        locus = locus_of(1, label)
        again = continue_locus(locus.point(len(locus) // 5), ("Omega", "ybar"), bounds)
        ends = sorted(map(tuple, locus.values[[0, -1]]))
        np.testing.assert_allclose(sorted(map(tuple, again.values[[0, -1]])), ends, atol=1e-8)


@pytest.fixture(scope="module")
def plane(locus_of):
    """Loci of two modes in frequency and amplitude that meet one another."""
    labels = [f"SN{i}" for i in (1, 2, 3, 4, 6, 7)] + [f"TR{i}" for i in (1, 3, 4, 5, 6)]
    labels += [f"PD{i}" for i in (1, 2, 3, 4, 5, 8, 9, 10)] + [f"GR{i}" for i in (1, 2, 3, 4)]
    return {label: locus_of(2, label) for label in labels}


def found(plane, locus, kind):
    return [
        (p.parameters["Omega"], p.parameters["ybar"])
        for curve in plane.values()
        if curve.type == locus
        for p in curve.special_points.of_type(kind)
    ]


@pytest.mark.campaign
@pytest.mark.thorough
@pytest.mark.parametrize(("kind", "other"), [("R1", "SN"), ("R2", "PD")])
def test_torus_loci_end_at_resonances_that_the_other_loci_have_too(plane, kind, other):
    ends, there = found(plane, "TR", kind), found(plane, other, kind)
    assert len(ends) > 2
    for end in ends:
        assert min(np.abs(np.subtract(end, place)).max() for place in there) < 1e-8, end


@pytest.mark.campaign
@pytest.mark.thorough
def test_fold_flips_are_found_on_both_loci(plane):
    folds, flips = found(plane, "SN", "FF"), found(plane, "PD", "FF")
    shared = [a for a in folds if min(np.abs(np.subtract(a, b)).max() for b in flips) < 1e-8]
    assert len(shared) > 4


@pytest.mark.campaign
@pytest.mark.thorough
def test_loci_end_at_grazing_loci_that_they_are_seen_from(plane):
    seen = sum(len(found(plane, "GR", kind)) for kind in ("SN", "PD"))
    shared = []
    for kind in ("SN", "PD"):
        meetings = found(plane, "GR", kind)
        shared += [a for a in found(plane, kind, "GR") if min(np.abs(np.subtract(a, b)).max() for b in meetings) < 1e-8]
    assert len(shared) > 8
    assert seen >= len(shared) / 2


@pytest.mark.campaign
@pytest.mark.thorough
def test_a_closed_locus_has_the_same_points_wherever_it_starts(plane):
    """PD8 and PD9 lie on one closed curve."""
    closed = [curve for curve in plane.values() if curve.stopped[0] == "the locus is closed"]
    assert len(closed) >= 2
    first, second = (
        sorted((p.type, round(p.parameters["Omega"], 7)) for p in curve.special_points) for curve in closed[:2]
    )
    assert first == second


@pytest.mark.campaign
@pytest.mark.thorough
def test_any_point_of_a_grazing_locus_starts_a_branch(plane):
    for curve in plane.values():
        if curve.type == "GR":
            for i in range(0, len(curve), 6):
                where = curve.values[i, 0]
                bounds, few = (where - 1e-4, where + 1e-4), StepControl(max_points=2)
                branch = continue_orbit(curve.solution(i), "Omega", bounds, steps=few)
                assert len(branch) > 1


@pytest.mark.campaign
@pytest.mark.thorough
def test_a_locus_does_not_lose_admissibility_without_saying_where(plane):
    for label, curve in plane.items():
        lost = np.flatnonzero(np.diff(curve.admissible.astype(int)))
        met = [p.position for p in curve.special_points.of_type("GR")]
        assert all(min([abs(i + 0.5 - where) for where in met], default=9.0) < 1.5 for i in lost), (label, lost, met)
