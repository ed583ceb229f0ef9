"""Motions that a jump of the field holds, that take too many steps, or whose events are not finite: each is told."""

from __future__ import annotations

import pickle

import numpy as np
import pytest

import saltus
import systems
from saltus import Average, HybridSystem, Mode, Transition, find_orbit, lyapunov_spectrum, run_sweep, simulate
from saltus.ensemble.ensemble import Ensemble
from saltus.errors import ChatteringError, DefinitionError, DivergenceError, StickingError, StiffnessError
from saltus.flow import variational
from saltus.options import SimulationOptions, SweepOptions


@pytest.fixture(scope="module")
def block():
    """A block on a spring with dry friction, driven: the friction is a jump of its field."""
    field = {"x": "v", "v": "-k*x - mu*sign(v) - c*abs(v)*v + A*cos(theta)"}
    parameters = {"k": 1.0, "mu": 0.3, "c": 0.0, "A": 0.0, "w": 1.3}
    return HybridSystem(("x", "v"), parameters, {"m": Mode(field)}, phase=("theta", "w"), name="block")


HELD = r"^sticking: the field of mode 'm' jumps at v = 0 and holds the motion there from t = .*; define it as saltus"


def test_a_block_that_friction_holds_is_told_with_the_place(block):
    with pytest.raises(StickingError, match=HELD) as held:
        simulate(block, {}, [1.0, 0.0], t_end=10.0)
    # half a turn about 0.3, half a turn about -0.3, and there it stays
    assert held.value.time == pytest.approx(2.0 * np.pi, abs=1e-5)
    assert held.value.state[0] == pytest.approx(-0.2, abs=1e-9)
    assert held.value.surface == "v"
    assert str(pickle.loads(pickle.dumps(held.value))) == str(held.value)


@pytest.mark.parametrize("start", [[0.1, 0.0], [0.0, 0.0], [1e-9, 0.0]])
def test_a_block_that_starts_held_is_told(block, start):
    with pytest.raises(ChatteringError, match=HELD):
        simulate(block, {}, start, t_end=10.0)


@pytest.mark.parametrize(("time", "length"), [(1e-6, 1e-9), (1e6, 1e9)])
def test_friction_is_told_in_any_units(block, time, length):
    parameters = {"k": time**-2, "mu": 0.3 * length / time**2, "w": 1.3 / time}
    with pytest.raises(StickingError, match=HELD) as held:
        simulate(block, parameters, [length, 0.0], t_end=10.0 * time, tolerance=(1e-10, 1e-11 * length / time))
    assert held.value.time == pytest.approx(2.0 * np.pi * time, rel=1e-5)


@pytest.mark.parametrize("call", [find_orbit, lambda *args: lyapunov_spectrum(*args, average=Average(periods=10))])
def test_what_follows_a_motion_tells_that_it_is_held(block, call):
    with pytest.raises(StickingError, match=HELD):
        call(block, {}, [1.0, 0.0])


def test_a_map_tells_that_its_motions_are_held(block):
    with pytest.raises(StickingError, match=HELD):
        Ensemble(block).strobe([[1.0, 0.0]], count=3)


def test_a_motion_that_passes_a_jump_is_not_held(block):
    passing = simulate(block, {"A": 2.0}, [1.0, 0.1], periods=50, options=SimulationOptions(max_steps=20_000))
    assert passing.stopped == "50 periods reached"
    for event, call in [
        ("orbit", find_orbit),
        ("growth", lambda *args: lyapunov_spectrum(*args, average=Average(periods=10))),
    ]:
        with pytest.raises(DefinitionError, match=r"jumps at v = 0: define it as saltus.filippov\(") as error:
            call(block, {"A": 2.0}, [1.0, 0.1])
        assert "field of mode 'm'" in str(error.value), event


def test_the_lines_offered_are_a_system_that_slides_with_all_that_was_defined():
    pendulum = HybridSystem(
        ("x", "v"), {"F": 0.4}, {"m": Mode({"x": "v", "v": "-0.1*sin(x) - F*sign(v)"})}, angles=("x",),
        outputs={"E": "v**2"}, positive=("F",), groups={"friction": ["F"]}, parameter_bounds={"F": (0.0, 1.0)},
        name="pendulum",
    )  # fmt: skip
    with pytest.raises(StickingError) as held:
        simulate(pendulum, {}, [1.0, 0.5], t_end=20.0)
    system = eval(str(held.value).split("define it as ")[1], {"saltus": saltus})
    assert (system.angles, system.output_names, system.positive) == (("x",), ("E",), ("F",))
    assert (system.groups, system.parameter_bounds, system.name) == (
        {"friction": ("F",)}, {"F": (0.0, 1.0)}, "pendulum",
    )  # fmt: skip
    assert simulate(system, {}, [1.0, 0.5], t_end=20.0).mode_end == "sliding"


def test_in_a_system_of_several_modes_each_side_is_to_be_a_mode():
    field = {"x": "v", "v": "-x - 0.3*sign(v)"}
    system = HybridSystem(
        ("x", "v"), {}, {"m": Mode(field), "far": Mode(field)}, [Transition("m", "far", "x - 9", 1)]
    )  # fmt: skip
    with pytest.raises(StickingError, match="give each side a mode, and the surface one"):
        simulate(system, {}, [1.0, 0.0], t_end=20.0)


def test_a_kink_is_no_jump(block):
    orbit = find_orbit(block, {"A": 2.0, "mu": 0.0, "c": 0.3}, [1.0, 0.1])
    back = simulate(block, {"A": 2.0, "mu": 0.0, "c": 0.3}, orbit.x0, periods=1)
    np.testing.assert_allclose(back.x_end[:2], orbit.x0, atol=1e-8)


def test_a_sweep_tells_why_a_value_has_no_motion(block):
    sweep = run_sweep(block, "A", [0.2], x0=[1.0, 0.1], options=SweepOptions(discard=20, keep=5))
    assert sweep.reasons[0, 0].startswith("sticking: the field of mode 'm' jumps at v = 0")
    assert "at 0.2: sticking: " in repr(sweep)


@pytest.mark.parametrize("k", [1e8, 1e12])
def test_a_fast_oscillation_is_told_by_its_steps(k):
    fast = HybridSystem(
        ("x", "v"), {"k": 1.0, "w": 1.0}, {"m": Mode({"x": "v", "v": "-k*x - 0.1*v + cos(s)"})}, phase=("s", "w")
    )
    with pytest.raises(StiffnessError, match=r"^\d+ steps took the motion only to t = .*; settle= allows 1000 steps"):
        find_orbit(fast, {"k": k}, [1.0, 0.0], settle=100)
    sweep = run_sweep(fast, "k", [k], x0=[1.0, 0.0], options=SweepOptions(discard=2, keep=1))
    assert "a limit of work: its fastest time scale is very short" in sweep.reasons[0, 0]


@pytest.mark.campaign
def test_a_phase_that_hardly_turns_is_told_by_its_steps():
    field = {"x": "v", "v": "(1 - x**2)*v - x + 0.1*cos(s)"}
    cycling = HybridSystem(("x", "v"), {"w": 1e-9}, {"m": Mode(field)}, phase=("s", "w"))
    with pytest.raises(StiffnessError, match="a limit of work: its fastest time scale is very short"):
        find_orbit(cycling, {}, [0.0, 0.1], settle=100)


def test_a_drive_that_hardly_turns_is_followed_where_nothing_else_moves():
    """x'' + x' + x = cos(w t), as slow as may be: x is the drive, and no state's zeros are an invariant plane."""
    orbit = find_orbit(systems_stiff(), {"k": 1.0, "w": 1e-9}, [0.0, 0.0], settle=100)
    assert orbit.implicit
    assert orbit.x0 == pytest.approx([1.0, 0.0], abs=1e-8)
    assert np.abs(orbit.multipliers).max() < 1e-8


def systems_stiff():
    field = {"x": "v", "v": "-k*(v - cos(s)) - x"}
    return HybridSystem(("x", "v"), {"k": 1.0, "w": 1.0}, {"m": Mode(field)}, phase=("s", "w"), name="stiff")


def test_a_motion_ends_where_its_memory_does():
    motion = simulate(systems.impact_oscillator(), {}, [0.0, 0.0], periods=100, options=SimulationOptions(max_steps=50))
    assert motion.step_times.size == 50
    assert motion.stopped == f"50 steps reached at t = {motion.t_end:.12g}"


@pytest.mark.parametrize("x0", [-1.0, 0.7])
def test_an_event_function_that_is_infinite_is_named(x0):
    growth = HybridSystem(
        ("x",), {}, {"m": Mode({"x": "1"})}, [Transition("m", "m", "exp(1000*x) - 2", -1, name="far")]
    )
    with pytest.raises(DivergenceError, match=r"the event function of 'far', exp\(1000\*x\) - 2, is not finite$"):
        simulate(growth, {}, [x0], t_end=3.0)


def test_transitions_that_lead_back_onto_their_own_events_are_told():
    back = HybridSystem(
        ("x",),
        {},
        {"a": Mode({"x": "1"}), "b": Mode({"x": "-1"})},
        [Transition("a", "b", "x - 1", 1), Transition("b", "a", "x - 1", -1)],
    )
    with pytest.raises(ChatteringError, match="events accumulate at t = 1 "):
        simulate(back, {}, [0.0], mode="a", t_end=5.0)


@pytest.mark.parametrize("direction", [-1, 0, 1])
@pytest.mark.parametrize("x0", [[0.1, 0.0, 0.0], [0.1, 0.0, 0.2], [0.1, 0.0, -0.2]])
def test_a_section_does_not_count_where_a_motion_starts_on_it(direction, x0):
    field = {"x": "y", "y": "z", "z": "-z - y - x"}
    jerk = HybridSystem(tuple(field), {}, {"m": Mode(field)}, [Transition("m", "m", "y", direction, name="section")])
    times = simulate(jerk, {}, x0, t_end=20.0).events["time"]
    assert times.size
    assert times[0] > 0.1


@pytest.mark.campaign
def test_exponents_of_a_motion_that_becomes_ever_stiffer_end_with_a_word(monkeypatch):
    monkeypatch.setattr(variational, "_STIFF_STEPS", 50_000)
    system = HybridSystem(("x", "y", "z"), {}, {"m": Mode({"x": "x/2", "y": "x*z", "z": "-x*y"})})
    with pytest.raises(StiffnessError, match=r"steps took the motion only to t = .*, mode 'm', .*: a limit of work"):
        lyapunov_spectrum(system, {}, [1.0, 1.0, 0.0], average=Average(t_end=50.0))


def test_exponents_of_a_long_motion_need_not_fear_the_limit_of_stiff_ones(monkeypatch):
    monkeypatch.setattr(variational, "_STIFF_STEPS", 10_000)
    system = HybridSystem(("x", "y"), {}, {"m": Mode({"x": "y", "y": "(1 - x*x)*y - x"})})
    spectrum = lyapunov_spectrum(system, {}, [2.0, 0.0], average=Average(t_end=4000.0))
    assert spectrum.exponents == pytest.approx([0.0, -1.0594], abs=2e-3)
