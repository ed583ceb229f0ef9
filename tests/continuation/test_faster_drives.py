"""A drive that repeats several times in a turn of the phase is the drive with the phase rewritten."""

from __future__ import annotations

import functools
import json

import numpy as np
import pytest

from saltus import (
    Average,
    HybridSystem,
    Mode,
    Section,
    Transition,
    continue_locus,
    continue_orbit,
    find_attractors,
    find_orbit,
    load,
    lyapunov_spectrum,
    map_basins,
    run_sweep,
    simulate,
    solve_orbit,
    switch_branch,
    verify,
)
from saltus.errors import InputError
from saltus.options import SweepOptions
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


def _impacts(wave, rate):
    return HybridSystem(
        ("x", "v"),
        {"A": 0.8, "w": 2.0, "e": 0.8, "d": 0.1},
        {"free": Mode({"x": "v", "v": f"A*{wave} - x - 0.1*v"})},
        [Transition("free", "free", "x - d", 1, {"v": "-e*v"}, name="impact")],
        phase=("s", rate),
    )


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


WELL = {"x0": [1.0, 0.0]}
STICKS = {"x0": [0.25, 0.0, 0.0], "mode": "stick"}
PAIRS = {
    "well, twice": (_well("cos(2*s)", "w"), _well("cos(s)", "2*w"), WELL, "F", (0.05, 0.45), ("F", "w")),
    "well, product": (_well("2*sin(s)*cos(s)", "w"), _well("sin(s)", "2*w"), WELL, "F", (0.05, 0.45), ("F", "w")),
    "well, three times": (_well("cos(3*s)", "2*w/3"), _well("cos(s)", "2*w"), WELL, "F", (0.05, 0.45), ("F", "w")),
    "well, four times": (
        _well("cos(4*s + 0.3)", "w/2", 0.25), _well("cos(s + 0.3)", "2*w", 0.25), WELL, "F", (0.05, 0.45), ("F", "w"),
    ),
    "impacts": (_impacts("cos(3*s)", "w/3"), _impacts("cos(s)", "w"), {"x0": [0.0, 0.0]}, "w", (1.5, 2.9), ("w", "A")),
    "stick-slip": (
        _stick_slip("sin(s)**2", "w"), _stick_slip("(1 - cos(s))/2", "2*w"), STICKS, "V", (0.4, 0.7), ("V", "c"),
    ),
}  # fmt: skip
EACH = guarding(list(PAIRS), "well, twice", "impacts", "stick-slip", campaign=3)


@functools.cache
def _pair(name):
    """Return both systems' branches from the same orbit."""
    own, other, start, parameter, bounds, _ = PAIRS[name]
    return [continue_orbit(find_orbit(system, **start), parameter, bounds) for system in (own, other)]


@pytest.mark.parametrize("name", EACH)
def test_orbits_last_a_period_of_the_drive_and_have_its_multipliers(name):
    (own, other, *_), (branch, known) = PAIRS[name], _pair(name)
    assert own.drive_repeats > 1 == other.drive_repeats
    assert own.turn == 2.0 * np.pi / own.drive_repeats
    a, b = branch.solution(0), known.solution(0)
    assert a.period == pytest.approx(b.period, rel=1e-12)
    assert a.form.turns == b.form.turns
    assert np.allclose(a.multipliers, b.multipliers, atol=1e-10)
    assert np.allclose(a.x0, b.x0, atol=1e-10)
    assert f"the drive repeats {own.drive_repeats} times per turn of s" in repr(a)
    found = simulate(own, a.parameters, a.x0, mode=a.signature[0][0], periods=a.form.turns)
    assert found.t_end == pytest.approx(a.period, rel=1e-12)
    assert np.allclose(found.x_end[:-1], a.x0, atol=1e-8)


@pytest.mark.parametrize("name", EACH)
def test_points_of_branches_are_those_of_the_rewritten_phase(name):
    parameter = PAIRS[name][3]
    branch, known = _pair(name)
    points, wanted = branch.special_points, known.special_points
    assert [point.type for point in points] == [point.type for point in wanted]
    assert points.of_type("PD")
    for a, b in zip(points, wanted, strict=True):
        assert a.parameters[parameter] == pytest.approx(b.parameters[parameter], abs=1e-10)
        assert np.allclose(a.orbit.multipliers, b.orbit.multipliers, atol=1e-6)
    assert not branch.audit.breaches


@pytest.mark.parametrize("name", EACH)
def test_a_doubling_of_the_drive_has_the_multiplier_minus_one_a_normal_form_and_a_locus(name):
    plane = PAIRS[name][5]
    point, known = (branch.special_points.of_type("PD")[0] for branch in _pair(name))
    assert float(np.abs(point.orbit.multipliers + 1.0).min()) < 1e-10
    assert point.normal_form.criticality == known.normal_form.criticality
    assert point.normal_form.coefficient == pytest.approx(known.normal_form.coefficient, rel=1e-6)
    assert verify(point).passed
    around = {p: (0.9 * point.parameters[p], 1.1 * point.parameters[p]) for p in plane}
    locus, other = (continue_locus(one, plane, bounds=around) for one in (point, known))
    assert len(locus) == len(other) > 5
    for p in plane:
        assert np.allclose(locus.column(p), other.column(p), atol=1e-8)


@pytest.mark.parametrize("name", EACH)
def test_doubled_orbits_are_those_of_the_rewritten_phase(name):
    points = [branch.special_points.of_type("PD")[0] for branch in _pair(name)]
    doubled, known = (switch_branch(point) for point in points)
    assert doubled.form.turns == known.form.turns == 2 * points[0].orbit.form.turns
    assert doubled.period == pytest.approx(known.period, rel=1e-12)
    assert doubled.parameters[PAIRS[name][3]] == pytest.approx(known.parameters[PAIRS[name][3]], abs=1e-9)
    assert doubled.repeats == points[0].orbit.repeats / 2 or PAIRS[name][0].drive_repeats % doubled.form.turns


@pytest.mark.parametrize("name", EACH)
def test_sweeps_label_by_periods_of_the_drive(name):
    own, other, start, parameter, bounds, _ = PAIRS[name]
    low, high = bounds
    values = np.linspace(low, low + 0.25 * (high - low), 5)  # before chaos, from which chance leads to one of the wells
    options = SweepOptions(discard=300, keep=60, mode=start.get("mode"), observables=["amplitude(x, 1)"], lanes=False)
    found, known = (run_sweep(one, parameter, values, x0=start["x0"], options=options) for one in (own, other))
    assert found.labels.tolist() == known.labels.tolist()
    assert any(label.startswith("period") for label in np.ravel(found.labels).tolist())


@pytest.mark.parametrize("name", EACH)
def test_observables_count_harmonics_of_the_drive(name):
    a, b = (branch.solution(0) for branch in _pair(name))
    names = ["amplitude(x, 1)", "phase(x, 1)", "amplitude(x, 1/2)", "amplitude(x, 2)", "mean(x)", "max(v)"]
    for key, value in a.observe(*names).items():
        assert value == pytest.approx(b.observe(key)[key], abs=1e-9), key
    slopes, known = (one.sensitivity(["amplitude(x, 1)", "phase(x, 1)"]) for one in (a, b))
    for key in slopes.data_vars:
        assert np.allclose(slopes[key], known[key], atol=1e-7), key
    assert verify(a).passed


def test_the_stick_slip_oscillator_doubles_where_shooting_says():
    branch = _pair("stick-slip")[0]
    assert branch["PD1"].parameters["V"] == pytest.approx(0.449012869943, abs=1e-11)
    assert branch["PD1"].orbit.period == pytest.approx(np.pi / 0.92, rel=1e-12)
    doubled = continue_orbit(switch_branch(branch["PD1"]), "V", (0.4, 0.7))
    assert doubled.stopped[1].endswith("the period halves")


RANDOM = range(12)


@pytest.mark.parametrize("seed", guarding(list(RANDOM), 0, campaign=5))
def test_random_drives_have_the_multipliers_of_the_rewritten_phase(seed):
    chosen = np.random.default_rng(seed)
    count, terms = int(chosen.integers(2, 8)), int(chosen.integers(1, 4))
    parts = [(chosen.uniform(0.1, 0.4), j, chosen.uniform(0.0, 6.0)) for j in range(1, terms + 1)]

    def system(per_turn, rate):
        wave = " + ".join(f"{a!r}*cos({j * per_turn}*s + {b!r})" for a, j, b in parts)
        events = [Transition("m", "m", f"x - 0.9 - 0.05*cos({per_turn}*s)", 1, {"v": "-0.7*v"}, name="hit")]
        return HybridSystem(
            ("x", "v"), {"w": 1.3}, {"m": Mode({"x": "v", "v": f"-0.3*v - x - 0.2*x**3 + {wave}"})},
            events, phase=("s", rate),
        )  # fmt: skip

    own, other = system(count, f"w/{count}"), system(1, "w")
    assert own.drive_repeats == count
    a, b = find_orbit(own, x0=[0.0, 0.0]), find_orbit(other, x0=[0.0, 0.0])
    assert a.period == pytest.approx(b.period, rel=1e-10)
    assert a.signature == b.signature
    assert np.allclose(np.sort_complex(a.multipliers), np.sort_complex(b.multipliers), atol=1e-8)


def _kicked(angle, rate):
    kick = Transition("m", "m", f"sin({angle})", 1, {"v": "v + 0.4*(1 + 0.3*x)"}, name="kick")
    return HybridSystem(("x", "v"), {"w": 1.3}, {"m": Mode({"x": "v", "v": "-x - 0.2*v"})}, [kick], phase=("s", rate))


def _beam(angle, rate):
    field = {"x": "v", "v": f"0.3*cos({angle}) - x - 0.1*v", "y": "u", "u": f"0.3*cos({angle}) - 40*y - 0.2*u"}
    hit = Transition("m", "m", "x + y - 0.3", 1, {"v": "-0.7*v", "u": "-0.7*u"}, name="hit")
    return HybridSystem(("x", "v", "y", "u"), {"w": 1.2}, {"m": Mode(field)}, [hit], phase=("s", rate))


def _stiff(angle, rate):
    return HybridSystem.smooth({"x": f"-1e4*(x - cos({angle}))", "y": "x - y"}, {"w": 1.0}, phase=("s", rate))


@pytest.mark.parametrize(
    ("make", "shift", "count"),
    guarding(
        [(_kicked, "", 2), (_kicked, "", 3), (_kicked, " - 1", 2), (_beam, "", 3), (_stiff, "", 4)],
        (_kicked, "", 3), (_beam, "", 3),
    ),
)  # fmt: skip
def test_kicks_at_phase_zero_beams_and_stiff_flows_have_the_period_of_the_drive(make, shift, count):
    own, other = make(f"{count}*s{shift}", f"w/{count}"), make(f"s{shift}", "w")
    start = np.zeros(len(own.states))
    a, b = find_orbit(own, x0=start), find_orbit(other, x0=start)
    assert a.period == pytest.approx(b.period, rel=1e-12)
    assert np.allclose(a.x0, b.x0, atol=1e-10)
    assert np.allclose(np.sort_complex(a.multipliers), np.sort_complex(b.multipliers), atol=1e-10)
    assert verify(a).passed
    ends = [simulate(one, {}, [*start, phase], t_end=20.3) for one, phase in ((own, 1.0 / count), (other, 1.0))]
    assert np.allclose(ends[0].x_end[:-1], ends[1].x_end[:-1], atol=1e-10)
    assert count * ends[0].x_end[-1] == pytest.approx(ends[1].x_end[-1], abs=1e-10)
    assert len(ends[0].events) == len(ends[1].events)


def test_motions_and_their_phase_go_back_to_zero_after_a_period_of_the_drive():
    system = PAIRS["well, three times"][0]
    assert "modulo 2 pi/3, in which the drive repeats" in repr(system)
    motion = simulate(system, {}, [1.0, 0.0, 4.5], periods=2)
    assert motion.step_starts[0, -1] == pytest.approx(4.5 - 4.0 * np.pi / 3.0)
    assert motion.t_end == pytest.approx(2.0 * np.pi / 0.6, rel=1e-12)
    events = motion.events["after"][motion.events["kind"] == "phase"]
    assert np.all(events[:, -1] == 0.0)


def test_an_expression_that_repeats_less_often_than_the_drive_is_refused():
    system, other = PAIRS["well, twice"][:2]
    orbit = find_orbit(system, **WELL)
    with pytest.raises(InputError, match="repeats 2 times in a turn of the phase"):
        orbit.observe("mean(x*cos(s))")
    with pytest.raises(InputError, match="an output of this formula"):
        simulate(system, {}, [1.0, 0.0], periods=1).output("cos(s)", [0.0])
    with pytest.raises(InputError, match="repeats 2 times"):
        run_sweep(system, "F", [0.05], x0=[1.0, 0.0], options=SweepOptions(quantities=["cos(s)"]))
    known = find_orbit(other, **WELL).observe("mean(x*cos(s))")
    assert orbit.observe("mean(x*cos(2*s))") == {"mean(x*cos(2*s))": pytest.approx(known["mean(x*cos(s))"], abs=1e-12)}


def test_an_output_or_a_section_of_the_slow_phase_keeps_its_turn():
    field = {"x": "v", "v": "-0.15*v + x - x**3 + 0.05*cos(2*s)"}
    system = HybridSystem.smooth(field, {"w": 0.6}, phase=("s", "w"), outputs={"slow": "cos(s)"})
    assert system.drive_repeats == 1
    assert find_orbit(system, x0=[1.0, 0.0]).period == pytest.approx(2.0 * np.pi / 0.6, rel=1e-12)
    options = SweepOptions(discard=100, keep=20, section=Section("sin(s - 1)", 1))
    swept = run_sweep(PAIRS["well, twice"][0], "F", [0.05], x0=[1.0, 0.0], options=options)
    assert np.ravel(swept.labels).tolist() == ["period-1"]


@pytest.mark.parametrize("count", [2, 6])
def test_states_that_a_mode_lacks_have_multiplier_zero_at_any_fast_drive(count):
    system = _stick_slip(f"(1 - cos({count}*s))/2", f"2*w/{count}")
    orbit = find_orbit(system, **STICKS)
    assert np.abs(orbit.multipliers).min() == 0.0
    wanted = find_orbit(PAIRS["stick-slip"][1], **STICKS).multipliers
    assert np.allclose(orbit.multipliers, wanted, atol=1e-10)


def test_attractors_basins_and_exponents_are_those_of_the_rewritten_phase():
    found = []
    for system in PAIRS["well, twice"][:2]:
        attractors = find_attractors(system, {"F": 0.1}, {"x": (-2.0, 2.0), "v": (-2.0, 2.0)})
        basins = map_basins(system, {"F": 0.1}, {"x": (-2.0, 2.0, 12), "v": (-2.0, 2.0, 12)}, attractors)
        average = {"average": Average(periods=200)}
        exponents = lyapunov_spectrum(system, {"F": 0.2}, x0=[1.0, 0.0], **average)
        found.append((basins.labels.tolist(), exponents.exponents, exponents.period))
    assert found[0][0] == found[1][0]
    assert np.allclose(found[0][1], found[1][1], atol=1e-8)
    assert found[0][2] == pytest.approx(found[1][2], rel=1e-12)


def test_files_keep_periods_of_the_drive_and_earlier_ones_count_turns(tmp_path):
    branch = _pair("well, twice")[0]
    path = tmp_path / "branch.nc"
    branch.save(path)
    kept = load(path)
    assert kept.forms == branch.forms
    assert switch_branch(kept["PD1"]).form.turns == 2
    system, orbit = branch.system, branch.solution(0)
    rows = orbit.states[0], orbit.durations[0]
    turn = solve_orbit(system, orbit.parameters, [("smooth", None, rows[0], 2.0 * rows[1])])
    assert turn.form.turns == turn.rounds == turn.repeats == 2
    dataset = turn.to_xarray()
    form = json.loads(dataset.attrs["form"])
    assert form[3:] == [2, 2]
    dataset.attrs["form"] = json.dumps([*form[:3], 1])  # as files were before: turns of the phase
    earlier = type(turn).from_xarray(dataset)
    assert earlier.form == turn.form
    assert verify(earlier).passed


@pytest.mark.parametrize("wave", ["cos(s)", "a*sin(s) + cos(s)**3"])
def test_a_shift_that_turns_the_sign_is_no_shorter_period(wave):
    system = HybridSystem.smooth(
        {"x": "v", "v": f"-0.2*v - x**3 + F*({wave})"}, {"F": 0.5, "w": 1.0, "a": 0.0}, phase=("s", "w")
    )
    assert drive_repeats(system) == 1
    branch = continue_orbit(find_orbit(system, x0=[0.0, 0.0]), "F", (0.5, 8.0), stop_at="BP")
    assert all(point.orbit.repeats == 1 for point in branch.special_points)
    assert "modulo 2 pi\n" in repr(system)
    assert "the drive repeats" not in repr(branch.solution(0))
