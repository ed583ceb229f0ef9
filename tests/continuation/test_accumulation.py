"""Where hits become infinitely many: located points against motions of exact flights, and what lies beyond them."""

from __future__ import annotations

import math

import numpy as np
import pytest

import saltus
from preloaded_mass import PRELOADED, Mass, above
from selection import guarding

CLOSE = 1e-9  # of a parameter located by bisection of motions, which tell it to 1e-11 or so


def points(branch: saltus.Branch) -> list[float]:
    return [point.parameters["F"] for point in branch.special_points if point.type == "CH"]


@pytest.mark.parametrize("step", guarding([0.1, 1.0, 10.0], 1.0))
@pytest.mark.parametrize("rests", [True, False])
def test_hits_accumulate_at_the_same_force_from_orbits_that_hit(rests: bool, step: float) -> None:
    steps = saltus.StepControl(initial=0.01 * step, largest=0.05 * step)
    branch = saltus.continue_orbit(above(Mass(0.2, 1.0, 1.0), rests, 1.4), "F", (1.2, 3.5), steps=steps)
    (found,) = points(branch)
    assert found == pytest.approx(PRELOADED, rel=1e-11)
    assert not branch.audit.breaches, branch.audit
    if not rests:
        end = next(reason for reason in branch.stopped if "bound" not in reason)
        assert "hits of 'hit' accumulate" in end
        assert "`rests=` names a mode" in end
        assert found in branch.values[[0, -1]]
    else:
        assert branch.stopped == ("F = 1.2: bound reached", "F = 3.5: bound reached")
        assert ("fly", "hit_last") in branch.solution(int(np.argmin(branch.values))).signature


@pytest.mark.parametrize("step", guarding([0.1, 1.0, 10.0], 10.0))
def test_hits_accumulate_at_the_same_force_from_orbits_that_rest(step: float) -> None:
    mass, steps = Mass(0.2, 1.0, 1.0), saltus.StepControl(initial=0.01 * step, largest=0.05 * step)
    orbit = saltus.find_orbit(mass.system(True), {"F": 1.8}, x0=[1.0, 1.0])
    branch = saltus.continue_orbit(orbit, "F", (1.2, 3.0), steps=steps)
    (found,) = points(branch)
    assert found == pytest.approx(PRELOADED, rel=1e-11)
    assert branch.values.min() == 1.2
    assert branch.values.max() == 3.0


def test_hits_accumulate_where_motions_of_exact_flights_stop_resting() -> None:
    mass = Mass(0.2, 1.0, 1.0)
    assert mass.accumulates_at(2.18, 2.19) == pytest.approx(PRELOADED, rel=1e-11)


@pytest.mark.campaign
@pytest.mark.parametrize("rests", [True, False])
def test_a_branch_through_an_accumulation_passes_verification(rests: bool) -> None:
    checked = saltus.verify(saltus.continue_orbit(above(Mass(0.2, 1.0, 1.0), rests, 1.4), "F", (1.2, 3.5)), points=5)
    assert checked.passed, checked


def test_harmonics_of_an_orbit_that_rests_are_in_closed_form() -> None:
    # over [a, a + 2 pi] the phase has the integrals -2 pi cos a with its sine, 2 pi sin a with its cosine
    orbit = saltus.find_orbit(Mass(0.2, 1.0, 1.0).system(True), {"F": 1.8}, x0=[1.0, 1.0])
    branch = saltus.continue_orbit(orbit, "F", (1.79, 1.81))
    for u, found in zip(branch.unknowns, branch.harmonics[:, 2], strict=True):
        assert found == pytest.approx(2.0 * complex(-math.cos(u[2]), math.sin(u[2])), rel=1e-12)


def test_a_branch_ends_at_an_accumulation_where_it_is_asked_to() -> None:
    branch = saltus.continue_orbit(above(Mass(0.2, 1.0, 1.0), True, 1.4), "F", (1.2, 3.5), stop_at="CH")
    assert "F = 2.18423967: accumulation of hits (chatter)" in branch.stopped
    assert "accumulation of hits (chatter) of hit" in repr(branch["CH1"])


def test_an_accumulation_has_no_normal_form() -> None:
    branch = saltus.continue_orbit(above(Mass(0.2, 1.0, 1.0), False, 1.4), "F", (1.2, 3.5))
    assert "hits become infinitely many" in branch["CH1"].normal_form.reason
    with pytest.raises(saltus.InputError, match="type = 'CH'"):
        branch["CH1"].sensitivity()


def test_hits_on_a_moving_table_accumulate_as_on_a_stop_under_the_force_of_its_acceleration() -> None:
    # in the frame of a table a sin(th) the ball is pressed by 1 and driven by a sin(th)
    table = "z - a*sin(th)"
    ball = saltus.HybridSystem(
        ("z", "v"), {"a": 2.2, "e": 0.2}, {"fly": saltus.Mode({"z": "v", "v": "-1"})},
        [saltus.Transition("fly", "fly", table, -1, {"v": "-e*v + (1 + e)*a*cos(th)"}, name="hit")], phase=("th", "1"),
    )  # fmt: skip
    branch = saltus.continue_orbit(saltus.find_orbit(ball, x0=[2.0, 2.0]), "a", (1.02, 4.0))
    (found,) = [point.parameters["a"] for point in branch.special_points if point.type == "CH"]
    assert found == pytest.approx(PRELOADED, rel=1e-11)


def random_mass(seed: int) -> Mass:
    rng = np.random.default_rng([seed, 31])
    return Mass(float(rng.uniform(0.05, 0.9)), float(10.0 ** rng.uniform(-3, 3)), float(10.0 ** rng.uniform(-2, 2)))


@pytest.mark.parametrize("seed", guarding(range(50), 0, campaign=4))
def test_random_masses_that_hit_accumulate_where_their_motions_stop_resting(seed: int) -> None:
    mass = random_mass(seed)
    if mass.e > 0.45:
        pytest.skip("the branch of orbits with one hit a period does not come to rest")
    interval = 1.02 * mass.p, 6.0 * mass.p
    (found,) = points(saltus.continue_orbit(above(mass, bool(seed % 2), 1.15), "F", interval))
    assert mass.accumulates_at(0.9999 * found, 1.0001 * found) == pytest.approx(found, rel=CLOSE)


@pytest.mark.parametrize("seed", guarding(range(50), 5, campaign=3))
def test_random_masses_that_rest_do_so_up_to_where_their_hits_accumulate(seed: int) -> None:
    mass = random_mass(seed)
    steps = saltus.StepControl(max_points=400)
    orbit = saltus.find_orbit(mass.system(True), {"F": 1.05 * mass.p}, x0=[mass.p / mass.w**2, 0.0])
    (found,) = points(saltus.continue_orbit(orbit, "F", (1.02 * mass.p, 6.0 * mass.p), steps=steps, stop_at="CH"))
    assert mass.accumulates_at(0.9999 * found, 1.0001 * found) == pytest.approx(found, rel=CLOSE)


@pytest.mark.thorough
@pytest.mark.parametrize("e", [0.55, 0.65, 0.7, 0.75])
def test_a_mass_that_rests_does_so_up_to_its_accumulation_at_high_restitution(e: float) -> None:
    mass, steps = Mass(e, 1.0, 1.0), saltus.StepControl(max_points=400)
    orbit = saltus.find_orbit(mass.system(True), {"F": 1.05}, x0=[1.0, 0.0])
    (found,) = points(saltus.continue_orbit(orbit, "F", (1.02, 6.0), steps=steps, stop_at="CH"))
    assert mass.rests(found * (1.0 - CLOSE))
    assert not mass.rests(found * (1.0 + CLOSE))
