"""Derivatives of orbits by parameters: closed forms, and central differences of orbits that are solved anew."""

from __future__ import annotations

import functools
import math

import numpy as np
import pytest

import saltus
import systems
from saltus import HybridSystem, Mode, Transition, continue_orbit, find_orbit, solve_orbit
from saltus.errors import InputError
from saltus.orbits.signature import CUT_END
from saltus.results import PeriodicOrbit

DIFFERENCED = 1e-6
"""Relative error of central differences of fourth order; it is mostly the rounding of values, over the step."""


def linear(unit: float = 1.0, second: float = 1.0) -> HybridSystem:
    """Return a damped oscillator, its displacement of the size `unit` and its time of the size `second`."""
    values = {"k": 1.0 / second**2, "c": 0.1 / second, "A": unit / second**2, "w": 1.1 / second}
    return HybridSystem.smooth({"x": "v", "v": "A*cos(s) - c*v - k*x"}, values, phase=("s", "w"))


def response(k: float, c: float, A: float, w: float) -> tuple[float, float, dict[str, float], dict[str, float]]:
    """Return amplitude and phase of the sine, with their derivatives."""
    D = (k - w * w) ** 2 + c * c * w * w
    a = A / math.sqrt(D)
    amplitude = {"k": -a * (k - w * w) / D, "c": -a * c * w * w / D, "A": a / A}
    amplitude["w"] = -a * w * (c * c - 2.0 * (k - w * w)) / D
    phase = {"k": c * w / D, "c": -w * (k - w * w) / D, "A": 0.0, "w": -c * (k + w * w) / D}
    return a, math.atan2(k - w * w, c * w), amplitude, phase


@pytest.mark.parametrize(("unit", "second"), [(1.0, 1.0), (1e-9, 1e6), (1e6, 1e-4)])
def test_a_linear_oscillator_in_closed_form_whatever_its_units(unit, second):
    system = linear(unit, second)
    p = system.parameters
    orbit = solve_orbit(system, x0=[unit, 0.0])
    found = orbit.sensitivity(["amplitude(x, 1)", "phase(x, 1)", "max(x)", "min_v", "mean(x**2)", "period", "k*period"])
    a, phi, amplitude, phase = response(**p)
    assert found["amplitude(x, 1)"].attrs["value"] == pytest.approx(a, rel=1e-11)
    assert found["phase(x, 1)"].attrs["value"] == pytest.approx(phi - math.pi if phi > math.pi else phi, abs=1e-10)
    T = 2.0 * math.pi / p["w"]
    for name in p:
        slope = found.sel(parameter=name)
        assert float(slope["amplitude(x, 1)"]) == pytest.approx(amplitude[name], rel=1e-9)
        assert float(slope["max(x)"]) == pytest.approx(amplitude[name], rel=1e-9)
        assert float(slope["mean(x**2)"]) == pytest.approx(a * amplitude[name], rel=1e-9)
        assert float(slope["phase(x, 1)"]) * p[name] == pytest.approx(phase[name] * p[name], rel=1e-9, abs=1e-11)
        fastest = -p["w"] * amplitude[name] - (a if name == "w" else 0.0)
        assert float(slope["min_v"]) == pytest.approx(fastest, rel=1e-9)
        longer = -T / p["w"] if name == "w" else 0.0
        assert float(slope["period"]) * p[name] == pytest.approx(longer * p[name], rel=1e-12, abs=1e-12 * T)
        both = p["k"] * longer + (T if name == "k" else 0.0)
        assert float(slope["k*period"]) * p[name] == pytest.approx(both * p[name], rel=1e-12, abs=1e-12 * T * p["k"])


def test_an_extreme_at_a_corner_in_closed_form():
    system = linear()
    p, name = system.parameters, "max(Min(x, v))"
    found = solve_orbit(system, x0=[1.0, 0.0]).sensitivity([name])[name]
    a, _, amplitude, _ = response(**p)
    w = p["w"]
    share = w / math.sqrt(1.0 + w * w)  # of the amplitude, where displacement and velocity are equal
    assert found.attrs["value"] == pytest.approx(a * share, rel=1e-11)
    for parameter, slope in amplitude.items():
        moved = a / (1.0 + w * w) ** 1.5 if parameter == "w" else 0.0
        assert float(found.sel(parameter=parameter)) == pytest.approx(share * slope + moved, rel=1e-9)


def duffing() -> HybridSystem:
    field = {"x": "v", "v": "A*cos(s) - c*v - x - a*x**3 + b"}
    values = {"c": 0.1, "A": 0.5, "w": 1.2, "a": 1.0, "b": 0.02}
    return HybridSystem.smooth(field, values, phase=("s", "w"), outputs={"E": "v**2/2 + x**2/2"})


def van_der_pol() -> HybridSystem:
    return HybridSystem.smooth({"x": "y", "y": "mu*(1 - x**2)*y - k*x + b"}, {"mu": 1.5, "k": 1.3, "b": 0.1})


def bilinear() -> HybridSystem:
    free = "A*cos(s) - c*v - k*x"
    return HybridSystem(
        ("x", "v"),
        {"k": 1.0, "k2": 4.0, "c": 0.1, "d": 0.4, "w": 1.3, "A": 1.0},
        {"free": Mode({"x": "v", "v": free}), "stop": Mode({"x": "v", "v": f"{free} - k2*(x - d)"})},
        [Transition("free", "stop", "x - d", 1, name="touch"), Transition("stop", "free", "x - d", -1, name="leave")],
        phase=("s", "w"),
        outputs={"F": {"free": "0", "stop": "k2*(x - d)"}},
    )


def contact() -> HybridSystem:
    """Return a tip over a sample whose force is like the power 3/2 of the depth, in SI units of a small lever."""
    push = "F*cos(s)/m - w0/Q*v - w0**2*x"
    return HybridSystem(
        ("x", "v"),
        {"m": 1e-10, "w0": 1e6, "Q": 40.0, "F": 2.5e-8, "w": 1e6, "d": 6e-9, "K": 1e5},
        {"free": Mode({"x": "v", "v": push}), "in": Mode({"x": "v", "v": f"{push} - K/m*(x - d)**(3/2)"})},
        [Transition("free", "in", "x - d", 1, name="touch"), Transition("in", "free", "x - d", -1, name="leave")],
        phase=("s", "w"),
        outputs={"force": {"free": "0", "in": "K*(x - d)**(3/2)"}},
    )


def rooted() -> HybridSystem:
    """Return an oscillator whose damping in contact is like the root of the depth, steep at the surface."""
    free = "A*cos(s) - c*v - k*x"
    values = {"k": 1.0, "c": 0.1, "d": 0.5, "w": 1.2, "A": 1.0, "q": 1.5, "K": 3.0}
    force = "K*(x - d)**(3/2) + q*sqrt(x - d)*v"
    return HybridSystem(
        ("x", "v"),
        values,
        {"free": Mode({"x": "v", "v": free}), "in": Mode({"x": "v", "v": f"{free} - ({force})"})},
        [Transition("free", "in", "x - d", 1, name="touch"), Transition("in", "free", "x - d", -1, name="leave")],
        phase=("s", "w"),
        outputs={"F": {"free": "0", "in": force}},
    )


def settled(system, parameters=None, x0=(0.0, 0.0)):
    return lambda: find_orbit(system, parameters or {}, x0=list(x0))


CASES = {
    "duffing": (
        settled(duffing()),
        ["max(x)", "min(v)", "amplitude(x, 1)", "phase(x, 3)", "amplitude(v, 2)", "mean(E)", "max(E)",
         "degrees(phase(x, 1))*a", "max(x) - min(x)"],
    ),
    "van der Pol": (
        settled(van_der_pol(), x0=[2.0, 0.0]),
        ["max(x)", "min(y)", "period", "mean(x**2)", "amplitude(x, 1)", "amplitude(y, 3)", "2*pi/period"],
    ),
    "impacts": (
        settled(systems.impact_oscillator(), {"w": 0.9, "d": 0.5, "e": 0.7}),
        ["min(x)", "max(v)", "min(v)", "velocity(impact)", "amplitude(x, 1)", "phase(x, 1)", "mean(v**2)"],
    ),
    "bilinear": (
        settled(bilinear()),
        ["max(x)", "min(x)", "max(F)", "mean(F)", "fraction(stop)", "velocity(touch)", "amplitude(F, 2)"],
    ),
    "tip": (
        settled(contact()),
        ["max(x)", "max(force)", "mean(force)", "fraction(in)", "amplitude(x, 1)", "phase(x, 1)", "velocity(leave)"],
    ),
    "root": (
        settled(rooted()),
        ["max(x)", "max(F)", "mean(F)", "fraction(in)", "velocity(leave)", "amplitude(x, 1)", "phase(x, 1)"],
    ),
    "belt": (
        lambda: solve_orbit(
            systems.stick_slip(), {}, [("slip", "catch", [0.9, 0.3], 4.0), ("stick", "release", [-0.05, 0.3], 3.0)]
        ),
        ["period", "max(x)", "min(v)", "fraction(stick)", "velocity(catch)", "amplitude(x, 1)", "phase(x, 1)"],
    ),
    "two fields": (
        settled(systems.two_fields(), x0=[1.0, 0.3]),
        ["period", "max(x1)", "min(x1)", "mean(x2)", "amplitude(x1, 1)", "phase(x2, 1)"],
    ),
}  # fmt: skip


def again(orbit: PeriodicOrbit, change: dict[str, float]) -> PeriodicOrbit:
    """Return the orbit at other parameters, from its own as a guess."""
    p = dict(orbit.parameters) | change
    if orbit.form.transitions[0] < 0:
        return solve_orbit(orbit.system, p, x0=orbit.x0, period=orbit.period)
    return solve_orbit(orbit.system, p, [(s.mode, s.transition, s.state, s.duration) for s in orbit.segments])


def observed(orbit: PeriodicOrbit, names: list[str]) -> dict[str, float]:
    seen = orbit.observe(*(name for name in names if name != "period"))
    return seen | {"period": orbit.period, "at start": float(orbit.states[0, 0]), "first": float(orbit.durations[0])}


@pytest.mark.parametrize("case", CASES)
def test_derivatives_agree_with_differences_of_orbits_solved_anew(case):
    make, names = CASES[case]
    orbit = make()
    found, values = orbit.sensitivity([*names, "segments"]), observed(orbit, names)
    assert list(found.parameter.values) == list(orbit.system.parameter_names)
    for name in names:
        assert found[name].attrs["value"] == pytest.approx(values[name], rel=1e-9)
        assert "note" not in found[name].attrs
    compared, step = 0, 1e-4 if case == "tip" else 1e-3
    sizes = {name: abs(values[name]) for name in names}
    sizes |= {"at start": max(abs(orbit.lows[0]), abs(orbit.highs[0])), "first": orbit.period}
    for parameter in orbit.system.parameter_names:
        at = orbit.parameters[parameter]
        moved = {k: observed(again(orbit, {parameter: at + step * k * at}), names) for k in (-2, -1, 1, 2)}
        slope = found.sel(parameter=parameter)
        exact = {name: float(slope[name]) for name in names}
        if orbit.form.transitions[0] >= 0:  # elsewhere the start on the orbit is arbitrary, or a whole number of turns
            exact["at start"] = float(slope["segment_state"][0, 0])
            exact["first"] = float(slope["segment_duration"][0])
        for name, one in exact.items():
            near, far = (moved[k][name] - moved[-k][name] for k in (1, 2))
            by_differences = (8.0 * near - far) / (12.0 * step)
            assert one * at == pytest.approx(by_differences, rel=DIFFERENCED, abs=1e-8 * sizes[name]), name
            compared += abs(by_differences) > 1e-2 * sizes[name]
    assert compared >= 2 * len(names)  # and not all of them nothing


def test_some_parameters_in_the_order_that_is_asked_for():
    orbit = find_orbit(bilinear(), x0=[0.0, 0.0])
    all_of_them, some = orbit.sensitivity(["mean(F*v**2)"]), orbit.sensitivity(["mean(F*v**2)"], ["w", "k2"])
    assert some.parameter.values.tolist() == ["w", "k2"]
    wanted = all_of_them["mean(F*v**2)"].sel(parameter=["w", "k2"]).values
    assert some["mean(F*v**2)"].values == pytest.approx(wanted, rel=1e-9)
    with pytest.raises(InputError, match="kk"):
        orbit.sensitivity(["max(x)"], ["kk"])
    with pytest.raises(InputError, match="observable"):
        orbit.sensitivity(["best(x)"])


def test_a_sensitive_orbit_that_is_cut_in_closed_form():
    system = HybridSystem.smooth({"x": "a*x + size*cos(s)"}, {"a": 2.0, "w": 1.0, "size": 1.0}, phase=("s", "w"))
    orbit = solve_orbit(system, x0=[0.0])
    assert CUT_END in orbit.form.kinds
    found = orbit.sensitivity(["amplitude(x, 1)", "max(x)", "phase(x, 1)", "multipliers"])
    wanted = np.array([-2.0, -1.0, 5.0]) / 5.0**1.5  # 1/sqrt(a^2 + w^2)
    assert found["amplitude(x, 1)"].values == pytest.approx(wanted, rel=1e-8)
    assert found["max(x)"].values == pytest.approx(wanted, rel=1e-8)
    assert found["phase(x, 1)"].values == pytest.approx([-0.2, 0.4, 0.0], abs=1e-8)  # an angle atan2(-a, w)
    magnified = math.exp(4.0 * math.pi) * 2.0 * math.pi  # exp(2 pi a/w) by a
    assert found["multiplier_re"].values[0] == pytest.approx([magnified, -2.0 * magnified, 0.0], rel=1e-6, abs=1.0)


def test_a_contact_so_short_that_its_mean_rate_is_integrated():
    system = bilinear()
    branch = continue_orbit(find_orbit(system, {"d": 0.4}, x0=[0.0, 0.0]), "d", (0.1, 3.0))
    lengths = [min(u[3::4]) / u[3::4].sum() if len(u) == 8 else 1.0 for u in branch.unknowns]
    short = branch.solution(int(np.argmin(np.abs(np.log(np.array(lengths) / 0.005)))))
    orbit = again(short, {"d": branch["GR1"].parameters["d"] - 2e-4})
    assert 1e-3 < orbit.durations.min() / orbit.period < 0.01
    names = ["max(F)", "fraction(stop)", "velocity(touch)", "phase(x, 1)"]
    found = orbit.sensitivity(names, ["d", "A", "w"])
    for parameter in ("d", "A", "w"):
        at, step = orbit.parameters[parameter], 1e-6
        seen = {k: again(orbit, {parameter: at * (1.0 + k * step)}).observe(*names) for k in (-2, -1, 1, 2)}
        for name in names:
            near, far = (seen[k][name] - seen[-k][name] for k in (1, 2))
            wanted = (8.0 * near - far) / (12.0 * step)
            assert at * float(found[name].sel(parameter=parameter)) == pytest.approx(wanted, rel=DIFFERENCED)


MULTIPLIED = {
    "a pair": settled(duffing()),
    "impacts": settled(systems.impact_oscillator(), {"w": 0.9, "d": 3.0, "e": 0.7}),
    "a cycle": settled(van_der_pol(), {"mu": 0.3}, [2.0, 0.0]),
    "two fields": settled(systems.two_fields(), x0=[1.0, 0.3]),
    "a power 3/2": settled(contact()),
}


@pytest.mark.parametrize("case", MULTIPLIED)
def test_derivatives_of_multipliers_agree_with_differences(case):
    orbit = MULTIPLIED[case]()
    found = orbit.sensitivity(["multipliers"])
    slopes = found["multiplier_re"] + 1j * found["multiplier_im"]
    np.testing.assert_allclose(found["multiplier_re"].attrs["value"], orbit.multipliers.real, atol=1e-12)
    for parameter in orbit.system.parameter_names:
        at, step = orbit.parameters[parameter], 1e-4 if case == "a power 3/2" else 1e-3
        moved = {k: again(orbit, {parameter: at * (1.0 + k * step)}).multipliers for k in (-2, -1, 1, 2)}
        wanted = (8.0 * (moved[1] - moved[-1]) - (moved[2] - moved[-2])) / (12.0 * step)
        np.testing.assert_allclose(at * slopes.sel(parameter=parameter), wanted, rtol=DIFFERENCED, atol=1e-7)


def test_multipliers_where_a_root_vanishes_are_told_to_be_rough():
    found = find_orbit(rooted(), x0=[0.0, 0.0]).sensitivity(["multipliers"], ["c"])
    assert "three digits" in found["multiplier_re"].attrs["note"]


# what has no derivative is told


@pytest.fixture(scope="module")
def symmetric() -> PeriodicOrbit:
    return solve_orbit(duffing(), {"b": 0.0}, x0=[1.1, 0.0])


def test_an_extreme_at_two_places_has_the_derivatives_that_both_share(symmetric):
    found = symmetric.sensitivity(["max(abs(x))", "max(x)"])
    both, one = found["max(abs(x))"], found["max(x)"]
    assert np.isnan(both.sel(parameter="b"))
    assert both.attrs["note"].startswith("the extreme is attained at two places")
    shared = ["c", "A", "w", "a"]
    assert both.sel(parameter=shared).values == pytest.approx(one.sel(parameter=shared).values, rel=1e-9)
    assert float(one.sel(parameter="b")) > 0.1
    assert "note" not in one.attrs


def test_extremes_at_rest_are_not_differentiated_by_what_sets_in_motion():
    orbit = find_orbit(linear(), {"A": 0.0}, x0=[0.0, 0.0])
    found = orbit.sensitivity(["max(x)", "mean(x)", "amplitude(x, 1)"])
    assert np.isnan(found["max(x)"].sel(parameter="A"))
    assert "two places" in found["max(x)"].attrs["note"]
    assert np.isnan(found["amplitude(x, 1)"].sel(parameter="A"))
    assert float(found["mean(x)"].sel(parameter="A")) == pytest.approx(0.0, abs=1e-9)
    level = find_orbit(bilinear(), x0=[0.0, 0.0]).sensitivity(["min(F)"])["min(F)"]  # 0 all along a segment
    assert np.all(level == 0.0)
    assert "note" not in level.attrs


def test_nothing_asked_for_gives_nothing():
    pendulum = HybridSystem.smooth({"x": "v", "v": "-0.1*v - x + cos(s)"}, phase=("s", "1"))
    orbit = solve_orbit(pendulum, x0=[1.0, 0.0])
    assert orbit.sensitivity(["max(x)"])["max(x)"].shape == (0,)
    assert list(orbit.sensitivity([])) == []


def test_a_harmonic_that_vanishes_and_a_mean_over_a_jump_are_not_differentiated(symmetric):
    found = symmetric.sensitivity(
        ["amplitude(x, 2)", "phase(x, 2)", "mean(x*sign(v - x))", "max(sign(v))", "mean(sqrt(v**2))"]
    )
    for name, words in {
        "amplitude(x, 2)": "no harmonic of this order",
        "phase(x, 2)": "no harmonic of this order",
        "mean(x*sign(v - x))": "jumps",
    }.items():
        assert words in found[name].attrs["note"]
        assert np.all(np.isnan(found[name]))


@pytest.mark.parametrize("name", ["mean(abs(v))", "mean(Max(x, v))", "amplitude(abs(x - v/2), 2)"])
def test_what_has_a_corner_within_a_segment_has_the_derivative_of_differences(symmetric, name):
    slopes = symmetric.sensitivity([name])[name]
    for parameter, value in symmetric.parameters.items():
        step = 1e-5 * max(abs(value), 1.0)
        ends = [observed(again(symmetric, {parameter: value + side * step}), [name])[name] for side in (1.0, -1.0)]
        by = (ends[0] - ends[1]) / (2.0 * step)
        assert slopes.sel(parameter=parameter).item() == pytest.approx(by, rel=1e-6, abs=1e-6)


def test_the_phase_of_a_cycle_that_may_start_anywhere_is_not_differentiated():
    found = find_orbit(van_der_pol(), x0=[2.0, 0.0]).sensitivity(["phase(x, 1)"])["phase(x, 1)"]
    assert np.all(np.isnan(found))
    assert "arbitrary" in found.attrs["note"]


def test_a_transition_that_does_not_happen_has_no_velocity():
    orbit = find_orbit(bilinear(), {"d": 9.0}, x0=[0.0, 0.0])
    found = orbit.sensitivity(["velocity(touch)", "fraction(stop)"])
    assert "does not happen" in found["velocity(touch)"].attrs["note"]
    assert np.all(found["fraction(stop)"] == 0.0)


def test_orbits_that_their_parameters_do_not_determine_are_refused(symmetric):
    fold = continue_orbit(symmetric, "w", (0.3, 3.0))["SN1"].orbit
    with pytest.raises(InputError, match="multiplier 1"):
        fold.sensitivity(["max(x)"])
    pendulum = HybridSystem.smooth({"x": "v", "v": "-k*sin(x)"}, {"k": 1.0})
    swing = solve_orbit(pendulum, x0=[2.0, 0.0], period=9.0, fix={"period": 10.0})
    with pytest.raises(InputError, match="in a family nothing is determined"):
        swing.sensitivity(["max(x)"])


@functools.cache
def grazing(w: float) -> saltus.results.SpecialPoint:
    orbit = find_orbit(systems.impact_oscillator(), {"w": w, "d": 12.0}, x0=[0.0, 0.0])
    return continue_orbit(orbit, "d", (1.0, 13.0))["GR1"]


def test_an_orbit_that_grazes_is_refused():
    with pytest.raises(InputError, match="grazing have other derivatives"):
        grazing(0.9).orbit.sensitivity(["max(x)"])
