"""Observables of trajectories and orbits against closed forms."""

import cmath
import math
from fractions import Fraction

import numpy as np
import pytest

import saltus
from oracles.closed_forms import ImpactOrbit
from saltus.errors import InputError
from saltus.flow.formulas import Observable, check_observables, read_observable
from saltus.flow.observables import observe
from saltus.system.hybrid import HybridSystem, Mode, Transition

TIGHT = {"tolerance": (1e-12, 1e-14)}


@pytest.fixture(scope="module")
def impacting(impact_oscillator):
    """One impact a period, at w = 1.1 and A = 1."""
    U = ImpactOrbit(1.1).speeds(1.0)[1]
    guess = [("free", "impact", ImpactOrbit(1.1).after_impact(U), ImpactOrbit(1.1).period)]
    return saltus.solve_orbit(impact_oscillator, {"w": 1.1, "A": 1.0}, guess)


@pytest.fixture(scope="module")
def square_wave():
    """Two modes, one where cos(theta) > 0."""
    return HybridSystem(
        states=("x",),
        parameters={"w": 2.0},
        modes={"up": Mode({"x": "1 - x"}), "down": Mode({"x": "-1 - x"})},
        transitions=[
            Transition("up", "down", "cos(theta)", -1, name="fall"),
            Transition("down", "up", "cos(theta)", 1, name="rise"),
        ],
        phase=("theta", "w"),
        outputs={"u": {"up": "1", "down": "-1"}},
    )


@pytest.fixture(scope="module")
def half_as_fast():
    """x = cos(t/2) while theta = t."""
    return HybridSystem(("x", "y"), {}, {"free": Mode({"x": "-y/2", "y": "x/2"})}, phase=("theta", "1"))


@pytest.mark.parametrize("w", [0.7, 1.3])
def test_a_linear_response_has_the_amplitude_and_phase_of_its_impedance(impact_oscillator, w):
    response = 0.3 / complex(1.0 - w**2, 0.1 * w)  # of A cos(theta), which is A sin(theta + pi/2)
    orbit = saltus.solve_orbit(
        impact_oscillator, {"w": w, "A": 0.3}, [("free", "theta", [response.real, -w * response.imag], 2 * math.pi / w)]
    )
    motion = saltus.simulate(impact_oscillator, {"w": w, "A": 0.3}, orbit.x0, periods=7, **TIGHT)
    names = [f"{kind}(x, {order})" for kind in ("amplitude", "phase") for order in (1, 2, 3, 10)]
    for found in (orbit.observe("mean(x)", *names), motion.observe("mean(x)", *names)):
        assert found["amplitude(x, 1)"] == pytest.approx(abs(response), abs=1e-10)
        assert found["phase(x, 1)"] == pytest.approx(cmath.phase(response) + math.pi / 2.0, abs=1e-10)
        for name in ("mean(x)", "amplitude(x, 2)", "amplitude(x, 3)", "amplitude(x, 10)"):
            assert found[name] == pytest.approx(0.0, abs=1e-10)


@pytest.mark.parametrize("order", [1, 2, 3, 25])
def test_harmonics_of_an_impact_oscillator_balance_drive_and_impulses(impacting, order):
    """The oracle: (k - (j w)^2 + i c j w) X_j = A [j = 1] + 2/T J exp(-i j s), J = -(1 + e) U at the phase s."""
    closed = ImpactOrbit(1.1)
    U = closed.speeds(1.0)[1]
    impulse = -(1.0 + closed.e) * U * cmath.exp(-1j * order * closed.after_impact(U)[2])
    w = order * closed.w
    X = ((order == 1) + 2.0 * impulse / closed.period) / complex(closed.k - w**2, closed.c * w)
    a, phi = impacting.observe(f"amplitude(x, {order})", f"phase(x, {order})").values()
    assert a * cmath.exp(1j * phi) == pytest.approx(1j * X, abs=1e-10)


def test_a_formula_is_made_of_observables_and_parameters(impacting):
    formulas = ("(max(x) - min(x))/2*A", "-degrees(phase(x, 1)) + 0*mean(v)", "Max(mean(x), 1e3)")
    found = impacting.observe(*formulas, "max(x)", "min(x)", "phase(x, 1)")
    half = (found["max(x)"] - found["min(x)"]) / 2.0
    assert found[formulas[0]] == pytest.approx(half * impacting.parameters["A"], rel=1e-14)
    assert found[formulas[1]] == pytest.approx(-math.degrees(found["phase(x, 1)"]), rel=1e-13)
    assert found[formulas[2]] == 1e3


@pytest.mark.parametrize(
    ("formula", "told"),
    [
        ("max(x) - mn(x)", "'max\\(x\\) - mn\\(x\\)': must be a formula in observables and par.*'mn' is unknown"),
        ("-degree(phase(x, 1))", "must be a formula in observables and parameters; did you mean 'degrees'"),
        ("max(x) - x", "'max\\(x\\) - x': must be a formula in observables and parameters; .*'x' is unknown"),
        ("max(x) -", "'max\\(x\\) -': must be a formula in observables and parameters; "),
        ("2*max(q)", "'q' is unknown"),
        ("2*velocity(impct)", "did you mean 'impact'"),
        ("2*w", "must be one of max\\(expression\\)"),
        ("max(x - 1", "must be one of max\\(expression\\)"),
    ],
)
def test_what_is_no_formula_is_told(impacting, formula, told):
    with pytest.raises(InputError, match=told):
        impacting.observe(formula)


def test_the_mean_of_an_impact_oscillator_is_that_of_the_impulses(impacting):
    closed = ImpactOrbit(1.1)
    expected = -(1.0 + closed.e) * closed.speeds(1.0)[1] / closed.period
    assert impacting.observe("mean(k*x)")["mean(k*x)"] == pytest.approx(expected, abs=1e-10)


def test_the_speed_of_an_impact_is_the_closed_form(impacting):
    U = ImpactOrbit(1.1).speeds(1.0)[1]
    assert impacting.observe("velocity(impact)")["velocity(impact)"] == pytest.approx(U, abs=1e-10)
    x, v, s = ImpactOrbit(1.1).after_impact(U)
    motion = saltus.simulate(impacting.system, impacting.parameters, [x, v, s], periods=4, **TIGHT)
    assert motion.observe("velocity(impact)")["velocity(impact)"] == pytest.approx(U, abs=1e-9)


def test_a_square_wave_has_the_harmonics_of_its_series(square_wave):
    """cos: 4/pi (cos(theta) - cos(3 theta)/3 + cos(5 theta)/5 - ...)."""
    motion = saltus.simulate(square_wave, {}, [0.0], mode="up", periods=3, **TIGHT)
    found = motion.observe(
        *(f"amplitude(u, {j})" for j in range(1, 6)), *(f"phase(u, {j})" for j in (1, 3, 5)), "mean(u)", "fraction(up)"
    )
    expected = {"amplitude(u, 1)": 4.0, "amplitude(u, 3)": 4.0 / 3.0, "amplitude(u, 5)": 0.8}
    expected = {name: value / math.pi for name, value in expected.items()}
    expected |= {"amplitude(u, 2)": 0.0, "amplitude(u, 4)": 0.0, "mean(u)": 0.0, "fraction(up)": 0.5}
    expected |= {"phase(u, 1)": math.pi / 2.0, "phase(u, 3)": -math.pi / 2.0, "phase(u, 5)": math.pi / 2.0}
    assert found == pytest.approx(expected, abs=1e-11)


def test_a_subharmonic_is_found_at_its_fraction_of_the_phase_s_rate(half_as_fast):
    motion = saltus.simulate(half_as_fast, {}, [1.0, 0.0], periods=5, **TIGHT)
    found = motion.observe("amplitude(x, 1/2)", "phase(x, 1/2)", "amplitude(x, 1)", "amplitude(x, 2/4)")
    assert found["amplitude(x, 1/2)"] == found["amplitude(x, 2/4)"]
    # cos(theta/2) = sin(theta/2 + pi/2)
    expected = {"amplitude(x, 1/2)": 1.0, "phase(x, 1/2)": math.pi / 2.0, "amplitude(x, 2/4)": 1.0}
    assert {name: found[name] for name in expected} == pytest.approx(expected, abs=1e-11)
    # five periods: over all of them cos(theta/2) has a share of order 1, over the last four none
    assert motion.observe("amplitude(x, 1)", t_start=2.0 * math.pi)["amplitude(x, 1)"] == pytest.approx(0.0, abs=1e-11)


def test_a_subharmonic_of_less_than_its_period_is_refused(half_as_fast):
    motion = saltus.simulate(half_as_fast, {}, [1.0, 0.0], periods=1)
    with pytest.raises(InputError, match=r"observable = 'phase\(x, 1/3\)': must be of a stretch of 3 periods .* has 1"):
        motion.observe("phase(x, 1/3)")
    with pytest.raises(InputError, match=r"of a stretch of a period of the phase or more; it has 0.5"):
        motion.observe("amplitude(x, 1)", t_end=math.pi)


def test_an_orbit_has_the_subharmonics_of_its_own_period_only(impact_oscillator):
    """Past the period doubling at A = 4.2446 two impacts take two periods; the oracle is the trajectory."""
    once = saltus.find_orbit(impact_oscillator, {"w": 1.1, "A": 4.0}, [0.0, 0.0])
    twice = saltus.find_orbit(impact_oscillator, {"w": 1.1, "A": 4.5}, [0.0, 0.0])
    assert (once.form.turns, twice.form.turns) == (1, 2)
    a, phi = once.observe("amplitude(x, 1/2)", "phase(x, 1/2)").values()
    assert a == 0.0
    assert math.isnan(phi)
    names = ("amplitude(x, 1/2)", "amplitude(x, 1)", "phase(x, 1)", "mean(x**2)", "velocity(impact)")
    motion = saltus.simulate(impact_oscillator, twice.parameters, twice.x0, periods=2, **TIGHT)
    assert twice.observe(*names) == pytest.approx(motion.observe(*names), abs=1e-9)
    assert twice.observe("amplitude(x, 1/2)")["amplitude(x, 1/2)"] > 0.01


def test_a_tapping_tip_is_observed_alike_along_its_orbit_and_its_trajectory(afm1):
    orbit = saltus.find_orbit(afm1, {"Omega": 1.05}, x0=[-0.67, 0.75])
    motion = saltus.simulate(afm1, orbit.parameters, orbit.x0, periods=3, **TIGHT)
    force = "G*sqrt(a0 - z)*(a0 - z)"
    names = ["min(z)", "max(z)", "mean(z)", "amplitude(z, 1)", "phase(z, 1)", "amplitude(z, 7)", "velocity(landing)"]
    names += ["velocity(liftoff)", "fraction(contact)", f"max({force})", f"mean({force})"]
    found = orbit.observe(*names)
    # 1e-9: the stiffness of the contact, 1.5 G sqrt(0.06) = 90, on top of the flow's tolerance
    assert found == pytest.approx(motion.observe(*names), abs=1e-9)
    durations = {mode: duration for (mode, _), duration in zip(orbit.signature, orbit.durations, strict=True)}
    assert found["fraction(contact)"] == pytest.approx(durations["contact"] / orbit.period, rel=1e-14)
    assert (found["min(z)"], found["max(z)"]) == pytest.approx((orbit.min["z"], orbit.max["z"]), abs=1e-10)


def test_what_happens_in_part_of_a_trajectory_is_seen_there_only(ball):
    """Falls from 1/2, lands at t = 1 with speed 1 and rises by 1/8."""
    motion = saltus.simulate(ball, {}, [0.5, 0.0], t_end=1.9)
    names = ("max(z)", "mean(z)", "velocity(impact)", "fraction(flight)")
    falling = motion.observe(*names, t_end=0.9)
    assert falling["max(z)"] == pytest.approx(0.5, abs=1e-14)
    assert falling["mean(z)"] == pytest.approx(0.5 - 0.9**2 / 6.0, rel=1e-12)
    assert math.isnan(falling["velocity(impact)"])
    rising = motion.observe(*names, t_start=0.95)
    assert rising["max(z)"] == pytest.approx(0.125, abs=1e-13)
    assert rising["velocity(impact)"] == pytest.approx(-1.0, abs=1e-12)
    assert rising["fraction(flight)"] == 1.0


def test_extremes_lie_between_samples_too(half_as_fast):
    motion = saltus.simulate(half_as_fast, {}, [1.0, 0.0], periods=1, tolerance=1e-6)
    assert motion.step_times.size < 30
    found = motion.observe("max(sin(7*theta + 1))", "min(sin(7*theta + 1))", "max(theta)", "max(2)")
    assert list(found.values()) == pytest.approx([1.0, -1.0, 2.0 * math.pi, 2.0], abs=1e-12)


def test_an_extreme_of_what_has_no_value_is_not_finite(ball):
    motion = saltus.simulate(ball, {}, [0.5, 0.0], t_end=0.5)
    assert motion.observe("max(1/v**2)")["max(1/v**2)"] == math.inf
    assert math.isnan(motion.observe("min(log(-z))")["min(log(-z))"])


def test_without_a_phase_the_period_of_the_orbit_is_that_of_order_one(stick_slip):
    """Slip is x = Fk + r cos(t - s) about Fk, stick a line: the oracle is their Fourier integral by sums."""
    T_slip, T_stick = 4.222431654131, 3.333333333333
    orbit = saltus.find_orbit(stick_slip, {}, [1.0, 0.3])
    found = orbit.observe("fraction(stick)", "max(x)", "mean(v)", "amplitude(x, 1)", "amplitude(x, 1/2)")
    t = (np.arange(200_000) + 0.5) / 200_000 * (T_slip + T_stick)
    slipping = 0.5 + 0.5 * np.cos(t) + 0.3 * np.sin(t)
    x = np.where(t < T_slip, slipping, 1.0 - 0.3 * (T_slip + T_stick - t))
    harmonic = 2.0 * np.mean(x * np.exp(-2j * math.pi * t / (T_slip + T_stick)))
    assert found["fraction(stick)"] == pytest.approx(T_stick / (T_slip + T_stick), abs=1e-11)
    assert found["max(x)"] == pytest.approx(1.083095189485, abs=1e-11)
    assert found["mean(v)"] == pytest.approx(0.0, abs=1e-10)
    assert found["amplitude(x, 1)"] == pytest.approx(abs(harmonic), abs=1e-9)
    assert found["amplitude(x, 1/2)"] == 0.0


def test_without_a_phase_a_trajectory_s_length_is_the_period_of_order_one():
    circle = HybridSystem(("x", "y"), {}, {"free": Mode({"x": "-y", "y": "x"})})
    motion = saltus.simulate(circle, {}, [1.0, 0.0], t_end=20.0, **TIGHT)
    found = motion.observe("amplitude(y, 1)", "phase(y, 1)", "amplitude(y, 3)", t_start=2.0, t_end=2.0 + 2.0 * math.pi)
    expected = {"amplitude(y, 1)": 1.0, "phase(y, 1)": 2.0, "amplitude(y, 3)": 0.0}
    assert found == pytest.approx(expected, abs=1e-10)


def test_a_phase_lies_above_minus_pi_and_up_to_pi(impact_oscillator):
    motion = saltus.simulate(impact_oscillator, {"A": 0.01}, [0.0, 0.0], periods=1, **TIGHT)
    names = {f"phase({name})": value for name, value in (
        ("sin(theta), 1", 0.0), ("-sin(theta), 1", math.pi), ("cos(theta), 1", math.pi / 2.0),
        ("-cos(2*theta), 2", -math.pi / 2.0), ("sin(theta - 3), 1", -3.0), ("sin(theta + 4), 1", 4.0 - 2.0 * math.pi),
    )}  # fmt: skip
    for name, value in motion.observe(*names).items():
        assert -math.pi < value <= math.pi
        assert cmath.exp(1j * value) == pytest.approx(cmath.exp(1j * names[name]), abs=1e-12)


def test_a_name_is_taken_apart_at_its_last_comma(impact_oscillator):
    read = read_observable(impact_oscillator, " amplitude( atan2(x, v) , 3 / 2 ) ")
    assert read == Observable("amplitude", "atan2(x, v)", Fraction(3, 2))


@pytest.mark.parametrize(
    ("name", "message"),
    [
        ("amplitde(x, 1)", "must be one of max(expression), min(expression), .*; did you mean 'amplitude'?"),
        ("x", "must be one of max(expression), .*, velocity(transition)"),
        (1.0, "must be one of max(expression)"),
        ("amplitude(x)", "must be amplitude(expression, order) with an order > 0, a whole number or a fraction of two"),
        ("phase(x, 0)", "must be phase(expression, order) with an order > 0"),
        ("phase(x, 1/0)", "must be phase(expression, order) with an order > 0"),
        ("phase(x, -1)", "must be phase(expression, order) with an order > 0"),
        ("amplitude(, 1)", "expression = '': must be an expression"),
        ("mean(y)", "expression = 'y': must be in x, v, theta, .* but 'y' is unknown"),
        ("fraction(fre)", "must be fraction(mode) of one of the modes free; did you mean 'free'?"),
        ("velocity(x)", "must be velocity(transition) of one of the transitions impact"),
    ],
)
def test_what_is_no_observable_is_told(impact_oscillator, name, message):
    pattern = message.replace("(", r"\(").replace(")", r"\)").replace("?", r"\?")
    with pytest.raises(InputError, match=pattern):
        check_observables(impact_oscillator, ["max(x)", name])


@pytest.mark.parametrize(
    ("stretch", "message"),
    [
        ({"t_start": -0.1}, "t_start = -0.1: must be between 0 and 1, where the trajectory ends"),
        ({"t_end": 1.1}, "t_end = 1.1: must be between 0 and 1, where the trajectory ends"),
        ({"t_start": 0.5, "t_end": 0.5}, "t_start = 0.5: must be less than t_end = 0.5"),
        ({"t_end": math.nan}, "t_end = nan: must be between 0 and 1"),
        ({"t_end": "1"}, "t_end = '1': must be between 0 and 1"),
    ],
)
def test_a_stretch_that_cannot_be_is_told(ball, stretch, message):
    with pytest.raises(InputError) as caught:
        saltus.simulate(ball, {}, [1.0, 0.0], t_end=1.0).observe("max(z)", **stretch)
    assert message in str(caught.value)


def test_observing_a_motion_is_what_its_methods_do(impacting):
    motion = saltus.simulate(impacting.system, impacting.parameters, impacting.x0, periods=2)
    assert observe(motion.motion(), ["mean(x)"]) == motion.observe("mean(x)")
    assert observe(impacting.motion(), ["mean(x)"]) == impacting.observe("mean(x)")
