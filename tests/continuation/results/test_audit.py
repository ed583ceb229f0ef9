"""The audit of a curve: it passes where nothing is wrong, and tells each fault that is put into a curve on purpose."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from saltus import (
    HybridSystem,
    Mode,
    Transition,
    continue_equilibrium,
    continue_orbit,
    find_equilibrium,
    find_orbit,
    load,
    solve_orbit,
    switch_branch,
)
from saltus.continuation.results import auditing
from saltus.continuation.results.audit import Audit
from saltus.continuation.results.auditing import audited
from saltus.continuation.results.special_points import SpecialPoints
from saltus.errors import InputError
from saltus.orbits.signature import Signature
from selection import guarding


@pytest.fixture(scope="module")
def response():
    """The response of Duffing's oscillator, which folds twice."""
    spring = HybridSystem.smooth(
        {"x": "v", "v": "-0.1*v - x - x**3 + 0.5*cos(theta)"}, {"w": 1.0}, phase=("theta", "w")
    )
    return continue_orbit(find_orbit(spring, {"w": 1.2}, [0.0, 0.0]), "w", (1.0, 2.5))


@pytest.fixture(scope="module")
def lorenz():
    """The equilibria of Lorenz's system off the axis: a pitchfork, and a Hopf point on both sides of it."""
    system = HybridSystem.smooth({"x": "10*(y - x)", "y": "x*(r - z) - y", "z": "x*y - 8*z/3"}, {"r": 0.5})
    axis = continue_equilibrium(find_equilibrium(system), "r", (0.0, 3.0))
    return continue_equilibrium(switch_branch(axis["BP1"]), "r", (0.0, 30.0))


def _without(curve, *labels):
    kept = [point for point in curve.special_points if point.label not in labels]
    return replace(curve, special_points=SpecialPoints(kept, curve.varied))


def _checks(curve) -> set[str]:
    return {breach.check for breach in audited(curve).audit.breaches}


def test_branches_with_folds_hopf_points_and_pitchforks_pass(response, lorenz):
    for curve in (response, lorenz):
        assert curve.audit.passed
        assert "audit" not in repr(curve)
    assert dict(response.audit.checked)["forward"] == 2  # both folds
    assert dict(response.audit.checked)["Liouville"] == 1


def test_a_fold_without_its_special_point_is_told_by_turn_and_ledger(response):
    found = audited(_without(response, "SN1")).audit
    assert {breach.check for breach in found.breaches} == {"forward", "ledger"}
    (turn,) = [breach for breach in found.breaches if breach.check == "forward"]
    assert turn.values[0] == pytest.approx(response["SN1"].parameters["w"], abs=1e-2)
    assert "w turns at w = 2.2" in turn.text


def test_a_hopf_point_that_is_missing_leaves_two_directions_unexplained(lorenz):
    (breach,) = audited(_without(lorenz, "HB1")).audit.breaches
    assert breach.check == "ledger"
    assert "nothing lies between" in breach.text


def test_a_point_that_is_listed_twice_is_told(response):
    point = response["SN1"]
    again = replace(point, label="SN3", arclength=point.arclength + 0.1)
    twice = replace(response, special_points=SpecialPoints([*response.special_points, again], response.varied))
    assert "twice" in _checks(twice)


def test_a_branch_that_goes_back_on_itself_is_told(response):
    rows = np.r_[0 : len(response) : 2, len(response) - 2 : 0 : -3]
    names = ("x0", "multipliers", "stable", "admissible", "period", "lows", "highs", "means", "harmonics", "form",
             "implicit", "values", "residual")  # fmt: skip
    back = replace(
        _without(response, "SN1", "SN2"),
        **{name: getattr(response, name)[rows] for name in names},
        unknowns=tuple(response.unknowns[i] for i in rows),
        arclength=np.arange(len(rows), dtype=float),
        freed=np.empty(0),
    )
    found = audited(back).audit.breaches
    assert any("the same solutions follow on both sides" in breach.text for breach in found)
    assert any("a second time" in breach.text for breach in found)


@pytest.mark.parametrize("section", [False, True])
def test_a_branch_that_goes_back_behind_another_signature_is_told(section):
    # forth and back between two rows that meet the wall, or with a section that is met on the way back alone
    event = Transition("m", "m", "x" if section else "x - 50", 1, {} if section else {"v": "-v"}, name="wall")
    system = HybridSystem(
        ("x", "v"), {"w": 1.0}, {"m": Mode({"x": "v", "v": "-0.1*v - x - x**3 + 0.5*cos(theta)"})}, [event],
        phase=("theta", "w"),
    )  # fmt: skip
    forced = continue_orbit(find_orbit(system, {"w": 1.2}, [0.0, 0.0]), "w", (1.0, 1.4))
    rows = np.r_[0 : len(forced), len(forced) - 2 : 0 : -2]
    names = ("x0", "multipliers", "stable", "admissible", "period", "lows", "highs", "means", "harmonics", "implicit",
             "values", "residual")  # fmt: skip
    places, last = np.arange(len(rows)), len(forced) - 1
    met = places > last if section else (places >= last - 1) & (places <= last)
    back = replace(
        forced,
        **{name: getattr(forced, name)[rows] for name in names},
        form=met.astype(np.int64),
        forms=(Signature((0,), (-1,), (2,), 1), Signature((0,), (0,), (0,), 1)),
        unknowns=tuple(forced.unknowns[i] for i in rows),
        arclength=np.arange(len(rows), dtype=float),
        freed=np.empty(0),
    )
    (found, _) = auditing._forward(auditing._Seen.of(back), auditing.growing(back))
    assert any("the same solutions follow on both sides" in text for _, text in found)


@pytest.fixture(scope="module")
def rattle():
    """A gear rattle between two stops: hits of tiny speed come and go at its grazings, where the branch turns."""
    system = HybridSystem(
        ("x", "v"), {"A": 1.0, "d": 0.5, "e": 0.6, "w": 1.0}, {"f": Mode({"x": "v", "v": "A*w**2*cos(th)"})},
        [Transition("f", "f", "x-d", 1, {"v": "-e*v"}, name="R"),
         Transition("f", "f", "x+d", -1, {"v": "-e*v"}, name="L")],
        phase=("th", "w"),
    )  # fmt: skip
    phase, speed = 3.378093327609896, 0.7029064493612437
    halves = [("f", "R", [-0.5, speed, phase], np.pi), ("f", "L", [0.5, -speed, phase + np.pi], np.pi)]
    return continue_orbit(solve_orbit(system, segments=halves), "d", (0.1, 0.6))


def _with_hits(form, hits):
    further = {name: (*getattr(form, name), *[0] * hits) for name in ("modes", "transitions", "kinds")}
    return replace(form, **further)


def _folded(curve, first, last, hits):
    """Return a curve before which stands a part of it, backwards, with further hits of no speed."""
    back = np.r_[last:first:-1]
    rows = np.r_[back, first : len(curve)]
    names = ("x0", "multipliers", "stable", "admissible", "period", "lows", "highs", "means", "harmonics", "implicit",
             "values", "residual")  # fmt: skip
    forms = [_with_hits(form, hits) for form in curve.forms]
    moved = len(back) - first
    points = [replace(p, position=p.position + moved) for p in curve.special_points if p.position > first]
    again = [replace(p, position=last - p.position) for p in curve.special_points if first < p.position < last]
    return replace(
        curve,
        **{name: getattr(curve, name)[rows] for name in names},
        form=np.r_[curve.form[back] + len(curve.forms), curve.form[first:]],
        forms=(*curve.forms, *forms),
        unknowns=tuple(curve.unknowns[i] for i in rows),
        arclength=np.arange(len(rows), dtype=float),
        freed=np.empty(0),
        special_points=SpecialPoints([*again, *points], curve.varied),
    )


@pytest.mark.parametrize("seed", guarding(range(24), 0, 1, 2))
def test_a_branch_with_impacts_that_goes_back_with_one_hit_more_is_told(rattle, seed):
    rng = np.random.default_rng(seed)
    assert rattle.audit.passed
    way = np.sign(np.diff(rattle.values))
    first = int(rng.choice([i for i in range(len(rattle) - 8) if np.ptp(way[i : i + 7]) == 0.0]))
    back = _folded(rattle, first, first + int(rng.integers(4, 8)), int(rng.integers(0, 3)))
    found, _ = auditing._forward(auditing._Seen.of(back), auditing.growing(back))
    assert any("the same solutions follow on both sides" in text for _, text in found)


@pytest.mark.parametrize("label", ["SN3", "BP3"])
def test_a_point_that_is_listed_again_with_one_hit_more_is_told(rattle, label):
    point = rattle[label]
    orbit = point.solution
    states, durations = np.vstack([orbit.states, orbit.states[:1]]), np.append(orbit.durations, 0.0)
    more = replace(orbit, form=_with_hits(orbit.form, 1), states=states, durations=durations)
    again = replace(point, label="X1", arclength=point.arclength + 0.1, solution=more)
    points = SpecialPoints([*rattle.special_points, again], rattle.varied)
    found, _ = auditing._twice(auditing._Seen.of(replace(rattle, special_points=points)))
    assert [text for _, text in found] == [f"X1 is {label} once more"]


def test_multipliers_whose_product_is_not_that_of_the_divergence_are_told(response):
    (breach,) = audited(replace(response, multipliers=response.multipliers * 1.01)).audit.breaches[-1:]
    assert breach.check == "Liouville"
    period = 2.0 * np.pi / breach.values[0]
    # the divergence is -0.1 throughout
    assert f"by the divergence {np.exp(-0.1 * period):.4g}"[:-1] in breach.text


def test_a_label_without_a_critical_value_is_told(response):
    away = replace(response["SN1"], solution=response.solution(3), position=3.5)
    wrong = replace(response, special_points=SpecialPoints([away, response["SN2"]], response.varied))
    assert "label" in _checks(wrong)


def test_stability_that_contradicts_the_multipliers_is_told(response):
    assert "label" in _checks(replace(response, stable=~response.stable))


def test_breaches_stand_in_the_text_and_in_files(response, tmp_path):
    wrong = audited(_without(response, "SN1"))
    assert "  audit: forward, point " in repr(wrong)
    assert repr(wrong.audit).startswith("Audit: 2 breaches; looked at forward at 2 places")
    wrong.save(tmp_path / "wrong.nc")
    held = load(tmp_path / "wrong.nc")
    assert held == wrong
    assert held.audit == wrong.audit


def test_a_file_without_an_audit_is_read(response):
    dataset = response.to_xarray()
    del dataset.attrs["audit"]
    held = type(response).from_xarray(dataset)
    assert held.audit == Audit()
    assert not held.audit.passed
    assert repr(held.audit) == "Audit: none was made"


def test_an_audit_that_is_none_is_refused():
    with pytest.raises(InputError, match="attribute 'audit' = .*: must be breaches and checks"):
        Audit.from_list([[["forward"]], []])


def test_a_branch_of_one_state_passes_at_its_folds():
    fold = HybridSystem.smooth({"x": "r + h*x - x**3"}, {"r": 1.0, "h": 3.0})
    assert continue_equilibrium(find_equilibrium(fold, {}, [2.0]), "r", (-4.0, 4.0)).audit.passed
