"""A drive that repeats several times in a turn of the phase has the points of the drive with the phase rewritten."""

from __future__ import annotations

import numpy as np
import pytest

from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit, load, switch_branch
from saltus.system.periodicity import drive_repeats
from selection import guarding

WAVES = [
    ("sin(s)**2", 2),
    ("a*sin(s) + cos(2*s)", 1),  # a is 0, but may be another
    ("0.0*sin(s) + cos(2*s)", 2),
    ("sin(s)*cos(s)", 2),
    ("sin(s)**3", 1),
    ("cos(s)**3 - 3*cos(s)/4", 3),
    ("cos(6*s) + sin(9*s)", 3),
    ("1/(2 + cos(s)**2)", 2),
    ("abs(sin(s))", 2),
    ("exp(cos(4*s))*sin(2*s)", 2),
    ("x*sin(s)", 1),
    ("sin(s)**2 + cos(s)**2", 1),
    ("sqrt(1.5 + sin(2*s + a))", 2),
    ("sin(2*s + x)", 2),
    ("sin(s + cos(2*s))", 1),
    ("sign(sin(s))", 1),
]


@pytest.mark.parametrize(("wave", "count"), WAVES)
def test_the_harmonics_of_a_formula_tell_how_often_it_repeats(wave, count):
    field = {"x": "v", "v": f"-x - v + {wave}"}
    assert drive_repeats(HybridSystem.smooth(field, {"a": 0.0, "w": 1.0}, phase=("s", "w"))) == count
    s = np.linspace(0.0, 2.0 * np.pi, 241)[:-1]
    known = {name: getattr(np, name) for name in ("sin", "cos", "exp", "sqrt", "sign", "abs")}
    values = eval(wave, {"__builtins__": {}}, known | {"s": s, "x": 0.37, "a": 0.61})
    values = np.broadcast_to(values, s.shape)
    for m in (2, 3, 4, 6):
        repeats = bool(np.allclose(np.roll(values, s.size // m), values, atol=1e-9))
        assert repeats == (count % m == 0) or np.ptp(values) < 1e-12


@pytest.mark.parametrize("part", ["field", "event", "when", "reset", "output"])
def test_every_formula_counts(part):
    waves = dict.fromkeys(("field", "event", "when", "reset", "output"), "cos(4*s)") | {part: "cos(2*s)"}
    system = HybridSystem(
        ("x", "v"),
        {"w": 1.0},
        {"on": Mode({"x": "v", "v": f"-x + {waves['field']}"})},
        [
            Transition(
                "on", "on", f"x - 1 - 0.1*{waves['event']}", 1, {"v": f"-v*(1 + 0.1*{waves['reset']})"},
                when=f"2 + {waves['when']}",
            )
        ],
        outputs={"f": waves["output"]},
        phase=("s", "w"),
    )  # fmt: skip
    assert drive_repeats(system) == 2


def _well(wave, rate, damping=0.15):
    return HybridSystem.smooth(
        {"x": "v", "v": f"-{damping}*v + x - x**3 + F*{wave}"}, {"F": 0.05, "w": 0.6}, phase=("s", rate)
    )


def _points(branch):
    return sorted((point.type, point.parameters["F"]) for point in branch.special_points)


CASES = [
    ("cos(2*s)", "cos(s)", 2),
    ("2*sin(s)*cos(s)", "sin(s)", 2),
    ("cos(3*s)", "cos(s)", 3),
    ("cos(4*s)", "cos(s)", 4),
]


@pytest.mark.parametrize(
    ("fast", "slow", "count", "damping"),
    guarding([(*case, d) for case in CASES for d in (0.15, 0.25)], (*CASES[0], 0.15), (*CASES[2], 0.15), campaign=3),
)
def test_doublings_of_the_drive_are_those_of_the_rewritten_phase(fast, slow, count, damping):
    start, interval = [1.0, 0.0], (0.05, 0.45)
    own = _well(fast, "w" if count == 2 else f"2*w/{count}", damping)
    other = _well(slow, "2*w", damping)
    branch = continue_orbit(find_orbit(own, x0=start), "F", interval, stop_at="PD")
    known = continue_orbit(find_orbit(other, x0=start), "F", interval, stop_at="PD")
    assert "PD" in {kind for kind, _ in _points(known)}
    assert [kind for kind, _ in _points(branch)] == [kind for kind, _ in _points(known)]
    assert [p for _, p in _points(branch)] == pytest.approx([p for _, p in _points(known)], abs=1e-8)
    assert not branch.audit.breaches
    first = branch["PD1"].orbit
    assert f"the drive repeats {count} times per turn of s" in repr(first)
    doubled = switch_branch(branch["PD1"])
    assert doubled.repeats * 2 == first.repeats or doubled.form.turns == 2


def test_a_doubling_of_the_drive_is_kept_in_files(tmp_path):
    branch = continue_orbit(find_orbit(_well("cos(2*s)", "w"), x0=[1.0, 0.0]), "F", (0.05, 0.45), stop_at="PD")
    path = tmp_path / "branch.nc"
    branch.save(path)
    doubled = switch_branch(load(path)["PD1"])
    assert doubled.repeats == 1


@pytest.mark.parametrize("wave", ["cos(s)", "a*sin(s) + cos(s)**3"])
def test_a_shift_that_turns_the_sign_is_no_shorter_period(wave):
    system = HybridSystem.smooth(
        {"x": "v", "v": f"-0.2*v - x**3 + F*({wave})"}, {"F": 0.5, "w": 1.0, "a": 0.0}, phase=("s", "w")
    )
    assert drive_repeats(system) == 1
    branch = continue_orbit(find_orbit(system, x0=[0.0, 0.0]), "F", (0.5, 8.0), stop_at="BP")
    assert all(point.orbit.repeats == 1 for point in branch.special_points)
    assert "the drive repeats" not in repr(branch.solution(0))


def _stick_slip(wave, rate):
    force = f"(V**2*{wave}/(1 - x)**2 - c*v - x)"
    return HybridSystem(
        ("x", "v", "u"),
        {"V": 0.5, "c": 0.04, "n": 3.17, "w": 0.92, "e": 0.8},
        {
            "stick": Mode({"x": "v", "v": force}, states=("x", "v")),
            "slip": Mode({"u": f"-n - {force}/5", "x": "v", "v": f"n + 6*{force}/5"}),
        },
        [
            Transition("stick", "slip", "x - 0.5", 1, {"u": "(1 + e)/6*v", "x": "x", "v": "-e*v"}, name="collision"),
            Transition("slip", "stick", "u", -1, {"x": "x", "v": "v"}, name="rest"),
        ],
        phase=("s", rate),
    )


def test_a_stick_slip_oscillator_doubles_where_the_rewritten_one_does():
    branch = continue_orbit(
        find_orbit(_stick_slip("sin(s)**2", "w"), x0=[0.25, 0.0, 0.0, np.pi / 2.0], mode="stick"), "V", (0.4, 0.7)
    )
    other = _stick_slip("(1 - cos(s))/2", "2*w")
    known = continue_orbit(find_orbit(other, x0=[0.25, 0.0, 0.0, np.pi], mode="stick"), "V", (0.4, 0.7))
    assert branch["PD1"].parameters["V"] == pytest.approx(known["PD1"].parameters["V"], abs=1e-10)
    assert known["PD1"].parameters["V"] == pytest.approx(0.449013, abs=1e-6)
    doubled, twice = (continue_orbit(switch_branch(one["PD1"]), "V", (0.4, 0.7)) for one in (branch, known))
    assert [point.type for point in doubled.special_points] == [point.type for point in twice.special_points]
    values = [[point.parameters["V"] for point in one.special_points] for one in (doubled, twice)]
    assert values[0] == pytest.approx(values[1], abs=1e-7)
    assert doubled.stopped[1].endswith("the period halves")
