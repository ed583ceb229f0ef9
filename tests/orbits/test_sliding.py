"""Orbits that slide, and pseudo-equilibria, against closed forms and numbers in 12 digits."""

import math

import numpy as np
import pytest

import saltus
from sliding import belt, harvested, planar, relay, table

# Words, start of the segment in "below" (theta0, x0), durations from there on, multiplier.
BELT = {
    0.6: ((0.2371220509225717, 1.372018047367355), (5.465404127244443, 4.183504304163894, 0.823067080557641),
          -0.5803268689697),
    0.48: ((0.4500391594568915, 1.300430068648198),
           (5.633894140272623, 0.451399242140092, 2.318483586028264, 3.727554865308987, 0.958637556207506),
           -0.6123778978851),
    0.445: ((0.5834747175401246, 1.234553375782873),
            (5.596181405262846, 4.557698046106336, 2.294624136484339, 1.671013956370270), -0.5120242531674),
    0.439: ((0.5247980560190943, 1.265425140927150), (5.697318357100818, 8.615176647864071), 0.8332330433390),
}  # fmt: skip


def from_below(orbit):
    """Return the segments of an orbit, that in "below" first."""
    first = [segment.mode for segment in orbit.segments].index("below")
    return [*orbit.segments[first:], *orbit.segments[:first]]


@pytest.mark.parametrize("w", BELT)
def test_orbits_of_the_belt_slide_as_in_closed_form(w):
    (phase, x0), durations, multiplier = BELT[w]
    orbit = saltus.find_orbit(belt(), {"w": w}, [1.0, 0.0])
    segments = from_below(orbit)
    np.testing.assert_allclose([part.duration for part in segments], durations, rtol=2e-11)
    start = segments[0].state
    assert start[0] == pytest.approx(x0, abs=1e-10)
    assert start[2] % (2.0 * math.pi) == pytest.approx(phase, abs=1e-10)
    np.testing.assert_allclose(orbit.multipliers, [multiplier, 0.0], atol=1e-10)


@pytest.mark.parametrize(
    ("mu", "left", "landed", "above", "sliding"),
    [
        (1.01, 0.009901951359278, -0.099999808127558, 6.173615216907117, 0.115644097179304),
        (1.1, 0.091607978309962, -0.316227389897593, 5.885555277707431, 0.486330276305063),
        (1.2, 0.170820393249937, -0.447213336470555, 5.693463789000984, 0.806833214630047),
    ],
)
def test_cycles_that_slide_have_a_multiplier_0(mu, left, landed, above, sliding):
    orbit = saltus.find_orbit(planar(), {"mu": mu}, [1.0, 0.2])
    assert [part.mode for part in orbit.segments] == ["above", "sliding"]
    np.testing.assert_allclose([part.duration for part in orbit.segments], [above, sliding], rtol=1e-11)
    np.testing.assert_allclose([part.state[0] for part in orbit.segments], [left, landed], atol=1e-11)
    np.testing.assert_allclose(orbit.multipliers, [0.0, 1.0], atol=1e-12)


@pytest.mark.parametrize(("c", "sliding"), [(-1.0, 1.207383599309432), (-2.0, 3.512833833074009)])
def test_only_the_time_of_sliding_depends_on_the_field_below(c, sliding):
    orbit = saltus.find_orbit(planar(), {"mu": 1.2, "c": c}, [1.0, 0.2])
    np.testing.assert_allclose([part.duration for part in orbit.segments], [5.693463789000984, sliding], rtol=1e-11)


@pytest.mark.parametrize(
    ("r", "height", "flight", "slide", "multiplier"),
    [
        (0.8, 0.988331562544494, 2.86701531113708, 1.01607923481036, 0.132909670253095),
        (0.7, 0.766442819682731, 2.90410623630409, 1.42468139016576, 0.083381691428612),
    ],
)
def test_a_relay_slides_in_both_halves(r, height, flight, slide, multiplier):
    orbit = saltus.find_orbit(relay(), {"r": r}, [0.5, 0.2, 1.0])
    durations = {(part.mode == "sliding", part.duration) for part in orbit.segments}
    for slides, duration in durations:
        assert duration == pytest.approx(slide if slides else flight, rel=1e-11)
    (leaves,) = [part.state for part in orbit.segments if part.mode == "above"]
    np.testing.assert_allclose(leaves, [0.0, 1.0, height], atol=1e-11)
    np.testing.assert_allclose(orbit.multipliers, [multiplier, 0.0, 1.0], atol=1e-11)


@pytest.mark.parametrize(
    ("P", "below", "sliding"), [(1.6, 40.9202980665, 7.6588203694), (1.3, 31.3020604422, 21.4125914422)]
)
def test_a_harvest_above_a_threshold_holds_predators_there(P, below, sliding):
    orbit = saltus.find_orbit(harvested(), {"P": P}, [0.3, 1.0])
    np.testing.assert_allclose([part.duration for part in orbit.segments], [below, sliding], rtol=1e-11)
    assert orbit.segments[0].state[0] == pytest.approx(0.047082262210797, abs=1e-12)


@pytest.mark.parametrize(
    ("x0", "x", "eigenvalue", "regular"),
    [
        (-0.9, -0.926310027734044, -5.905628618031677, True),
        (0.03, 0.031314076966335, 5.628840529199521, True),
        (6.9, 6.894995950767709, None, False),
    ],
)
def test_pseudo_equilibria_are_regular_where_both_fields_lead_to_the_surface(x0, x, eigenvalue, regular):
    found = saltus.find_equilibrium(planar(), {"mu": 1.2, "c": -6.0}, [x0, -1.0], mode="sliding")
    assert found.regular is regular
    assert found["x"] == pytest.approx(x, abs=1e-12)
    if eigenvalue is not None:
        along = found.eigenvalues[np.argmin(np.abs(found.eigenvalues + 1.0) < 1e-9)]  # the other one is the pull
        assert along == pytest.approx(eigenvalue, rel=1e-11)


@pytest.mark.parametrize(("mu", "c", "x"), [(1.0, -4.403669475041612, -0.435420544682339),
                                            (1.2, -2.231813282017789, -0.423986816983778)])  # fmt: skip
def test_pseudo_equilibria_meet_at_a_saddle_node(mu, c, x):
    start = saltus.find_equilibrium(planar(), {"mu": mu, "c": c - 1.0}, [-0.8, -1.0], mode="sliding")
    branch = saltus.continue_equilibrium(start, "c", (c - 2.0, c + 1.0))
    (point,) = branch.special_points.of_type("SN")
    assert point.value("c") == pytest.approx(c, abs=1e-11)
    assert point.equilibrium["x"] == pytest.approx(x, abs=1e-7)


@pytest.mark.parametrize(("e", "rests"), [(0.5, 4.1336062005398752), (0.3, 3.7345970187604894)])
def test_a_ball_comes_to_rest_on_a_table_and_leaves_it(e, rests):
    orbit = saltus.find_orbit(table(), {"e": e}, [0.0, 5.0])
    (rest,) = [part for part in orbit.segments if part.mode == "rest"]
    assert rest.state[-1] % (2.0 * math.pi) == pytest.approx(rests, abs=1e-11)
    leaves = rest.state[-1] + rest.duration
    assert leaves % (2.0 * math.pi) == pytest.approx(0.98511078333774566, abs=1e-11)
    np.testing.assert_allclose(orbit.multipliers, [0.0, 0.0], atol=1e-9)
    assert orbit.period == pytest.approx(2.0 * math.pi)
    assert orbit.admissible


def test_a_cycle_that_comes_near_0_is_exact():
    # y' = 0 where the prey passes 6e-9; the period by SciPy's DOP853 at 2.3e-14 in logarithms of both states
    orbit = saltus.find_orbit(harvested(), {"P": 2.6}, [0.3, 1.0])
    assert orbit.period == pytest.approx(71.87531536, abs=5e-9)
    assert orbit.min["x"] < 1e-8
    rough = saltus.find_orbit(harvested(), {"P": 2.6}, [0.3, 1.0], tolerance=1e-10)
    assert rough.period == pytest.approx(orbit.period, rel=1e-10)


def test_orbits_that_slide_or_rest_are_verified_by_other_means():
    for orbit in (saltus.find_orbit(belt(), {"w": 0.48}, [1.0, 0.0]), saltus.find_orbit(table(), {}, [0.0, 5.0])):
        checked = saltus.verify(orbit)
        assert checked.passed


def test_one_branch_of_equilibria_goes_through_sliding_from_one_side_to_the_other():
    start = saltus.find_equilibrium(harvested(), {"P": 1.1}, [0.6, 1.1], mode="sliding")
    branch = saltus.continue_equilibrium(start, "P", (0.5, 2.0))
    found = {(p.type, p.kind): p.value("P") for p in branch.special_points}
    assert found == {
        ("BE", "persistence"): pytest.approx(0.653850415512466, abs=1e-11),
        ("SN", ""): pytest.approx(1.243602362204724, abs=1e-12),
        ("BE", "nonsmooth fold"): pytest.approx(1.010484747655646, abs=1e-11),
    }
    assert {branch.solution(i).mode for i in range(len(branch))} == {"above", "sliding", "below"}
    locus = saltus.continue_locus(branch["SN1"], ("P", "a"), {"P": (0.9, 2.0), "a": (0.25, 0.49)})
    P, a = (locus.values[:, locus.names.index(name)] for name in ("P", "a"))
    np.testing.assert_allclose(P, 1.33**2 / (4.0 * a), rtol=1e-12)


def test_a_start_at_a_two_fold_is_refused():
    system = saltus.filippov(
        ("x", "y", "z"),
        {},
        surface="z",
        above={"x": "1", "y": "0.3", "z": "-x"},
        below={"x": "0.2", "y": "1", "z": "y"},
    )
    with pytest.raises(saltus.InputError, match="one motion from it"):
        saltus.simulate(system, {}, [0.0, 0.0, 0.0], t_end=1.0)
